"""What `read` and `write` accept and refuse, and in which words."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.image import files
from relume.image.files import read, read_layers, read_photograph, read_radiance, write, write_layers
from relume.image.files.description import describe
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.sphere.environment_map import EnvironmentMap

PHOTOGRAPH = Photograph(np.zeros((2, 3, 3), np.uint8))
SIXTEEN_BITS = Photograph(np.zeros((2, 3, 3), np.uint16))
RADIANCE = RadianceMap(np.ones((2, 3, 3), np.float32))


def test_importing_the_door_to_image_files_loads_no_format_library():
    code = "import sys, relume.image.files; print([m for m in ('OpenEXR', 'OpenImageIO', 'PIL') if m in sys.modules])"
    environment = {**os.environ, "PYTHONPATH": str(Path(files.__file__).parents[3])}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_a_photograph_is_written_without_the_libraries_that_read_them(tmp_path):
    code = (
        "import sys, numpy as np; from relume.image import files; from relume.image.photograph import Photograph; "
        f"[files.write({str(tmp_path / 'made')!r} + end, Photograph(np.zeros((2, 3, 3), np.uint8))) "
        "for end in ('.jpg', '.png', '.tif')]; print([m for m in ('OpenImageIO', 'PIL.Image') if m in sys.modules])"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(files.__file__).parents[3])}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("[]\n", "")


@pytest.mark.parametrize("reader", [read, read_photograph, read_radiance, read_layers, describe])
def test_a_missing_file_is_named_with_what_to_do(tmp_path, reader):
    path = tmp_path / "plate" / "IMG_1.jpg"
    with pytest.raises(UnreadableFile) as raised:
        reader(path)
    assert str(raised.value) == f"{path}: no such file; check the path"


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "an empty file"),
        (b"GIF89a" * 9, "a GIF picture, which relume does not read"),
        (b"hello" * 9, "no picture relume reads"),
    ],
)
def test_what_is_no_picture_is_refused(tmp_path, content, complaint):
    (tmp_path / "a.jpg").write_bytes(content)
    with pytest.raises(UnreadableFile, match=complaint):
        read(tmp_path / "a.jpg")


def test_a_folder_is_no_picture(tmp_path):
    with pytest.raises(UnreadableFile, match="a folder, not a file"):
        read(tmp_path)


def test_a_bare_magic_number_is_a_damaged_file(tmp_path):
    for magic in (b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"II*\0", b"\x76\x2f\x31\x01", b"#?RADIANCE\n"):
        (tmp_path / "a").write_bytes(magic)
        with pytest.raises(UnreadableFile) as raised:
            read(tmp_path / "a")
        assert "\n" not in str(raised.value)


@pytest.mark.parametrize("suffix", [".jpg", ".JPEG", ".png"])
def test_a_photograph_where_radiance_is_needed_is_refused(tmp_path, suffix):
    write(tmp_path / f"a{suffix}", PHOTOGRAPH)
    assert isinstance(read(tmp_path / f"a{suffix}"), Photograph)
    with pytest.raises(UnreadableFile, match="a photograph where a radiance map is needed; give"):
        read_radiance(tmp_path / f"a{suffix}")
    with pytest.raises(UnreadableFile, match="where layers are needed"):
        read_layers(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", [".exr", ".HDR"])
def test_radiance_where_a_photograph_is_needed_is_refused(tmp_path, suffix):
    write(tmp_path / f"a{suffix}", RADIANCE)
    assert isinstance(read(tmp_path / f"a{suffix}"), RadianceMap)
    with pytest.raises(UnreadableFile, match="a radiance map where a photograph is needed; give"):
        read_photograph(tmp_path / f"a{suffix}")


@pytest.mark.parametrize(
    ("name", "image", "complaint"),
    [
        ("a.png", RADIANCE, r'ends in "\.png"; a radiance map goes to \.exr, \.hdr, .*develop'),
        ("a", RADIANCE, 'ends in ""'),
        ("a.exr", PHOTOGRAPH, r'ends in "\.exr"; a photograph goes to \.png, \.tif or \.jpg: merge'),
        ("a.exr", EnvironmentMap(np.ones((2, 4, 3), np.float32)), "is of type EnvironmentMap.*as_radiance_map"),
        ("a.jpg", SIXTEEN_BITS, r"pixels are uint16; a JPEG holds uint8: write \.png"),
    ],
)
def test_an_image_written_to_the_wrong_format_is_refused(tmp_path, name, image, complaint):
    with pytest.raises(ValueError, match=complaint):
        write(tmp_path / name, image)
    assert os.listdir(tmp_path) == []


def test_layers_go_to_exr_only(tmp_path):
    with pytest.raises(ValueError, match=r"layers are written to \.exr"):
        write_layers(tmp_path / "a.png", {"a": np.zeros((2, 2))})


@pytest.mark.parametrize("name", ["a.exr", "a.hdr", "a.png", "a.jpg"])
def test_a_description_is_plain_enough_for_json(tmp_path, name):
    write(tmp_path / name, RADIANCE if name in ("a.exr", "a.hdr") else PHOTOGRAPH)
    assert json.loads(json.dumps(describe(tmp_path / name)))["size"] == [3, 2]
