"""HEIF photographs of telephones: pixels, depth, turns, EXIF, colours and gain maps, and damaged files in one line."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from relume.capture.exposure.bracket import read_bracket
from relume.capture.exposure.folder import pictures_in
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.colour_space import name_of
from relume.image.files.description import describe
from relume.image.files.metadata.icc_profile import screen_profile
from relume.image.files.photographs.heif import _straight
from relume.image.files.read_options import ReadOptions
from relume.image.primaries import P3

pillow_heif = pytest.importorskip("pillow_heif", reason="pillow-heif writes the files that are read here")
SMOOTH = np.add.outer(np.arange(48), np.arange(64))[..., None] + np.array([0, 40, 80])


def saved(path: Path, pixels: np.ndarray, **options: Any) -> Path:
    """Written by x265 without loss, 4:4:4."""
    options = {"quality": -1, "chroma": 444, "matrix_coefficients": 0, **options}
    if pixels.dtype == np.uint16:
        data, size = np.ascontiguousarray(pixels).tobytes(), (pixels.shape[1], pixels.shape[0])
        pillow_heif.encode("RGB;16", size, data, str(path), **options)
    else:
        pillow_heif.from_pillow(Image.fromarray(pixels)).save(path, **options)
    return path


def exif(orientation: int = 1) -> bytes:
    block = Image.Exif()
    block[0x010F], block[0x0110], block[0x0112] = "Apple", "iPhone 15", orientation
    block.get_ifd(0x8769).update({0x829A: 1 / 60, 0x829D: 1.8, 0x8827: 100, 0xA405: 26, 0xA002: 64, 0xA003: 48})
    return block.tobytes()


def test_pixels_exif_and_focal_length_are_read(tmp_path):
    pixels = SMOOTH.astype(np.uint8)
    path = saved(tmp_path / "a.heic", pixels, exif=exif())
    photograph = files.read_photograph(path)
    assert files.kind_of(path) == "HEIF" and not files.has_radiance(path)
    assert np.abs(photograph.pixels.astype(int) - pixels).max() <= 1
    assert photograph.camera == "Apple iPhone 15" and photograph.exposure is not None
    assert (photograph.exposure.seconds, photograph.exposure.iso) == (pytest.approx(1 / 60), 100)
    assert photograph.focal_length == pytest.approx(26 / 36 * 64)
    facts = files.read_facts(path)
    assert (facts.size, facts.camera, facts.exposure) == ((64, 48), "Apple iPhone 15", photograph.exposure)
    assert describe(path)["subtype"] == "8 bits, RGB, HEIF"
    assert [found.name for found in pictures_in(tmp_path)] == ["a.heic"]


def test_ten_bits_reach_white_and_stay_apart(tmp_path):
    pixels = np.linspace(0, 65535, 48 * 64 * 3).astype(np.uint16).reshape(48, 64, 3)
    photograph = files.read_photograph(saved(tmp_path / "a.heic", pixels))
    assert photograph.pixels.dtype == np.uint16
    assert (photograph.pixels.min(), photograph.pixels.max()) == (0, 65535)
    assert len(np.unique(photograph.pixels)) == 1024
    assert np.abs(photograph.pixels.astype(int) - pixels).max() <= 65535 / 1023


def test_it_is_turned_once(tmp_path):
    pixels = SMOOTH.astype(np.uint8)
    picture = pillow_heif.from_pillow(Image.fromarray(pixels))
    picture[0].info["exif"] = exif(6)  # the writer makes a turn of its own of it, as telephones do
    picture.save(tmp_path / "a.heic", quality=-1, chroma=444, matrix_coefficients=0)
    photograph = files.read_photograph(tmp_path / "a.heic")
    assert photograph.size == (48, 64) == files.read_facts(tmp_path / "a.heic").size
    assert np.abs(photograph.pixels.astype(int) - np.rot90(pixels, -1)).max() <= 1


def test_its_colours_are_those_of_its_profile_or_of_its_code_points(tmp_path):
    pixels = SMOOTH.astype(np.uint8)
    profiled = Image.fromarray(pixels)
    profiled.info["icc_profile"] = screen_profile(P3, "Display P3")
    pillow_heif.from_pillow(profiled).save(tmp_path / "a.heic", quality=90)
    saved(tmp_path / "b.heic", pixels, color_primaries=12, transfer_characteristics=13, save_nclx_profile=True)
    saved(tmp_path / "c.heic", pixels, color_primaries=1, transfer_characteristics=13, save_nclx_profile=True)
    names = [name_of(files.read_photograph(tmp_path / f"{letter}.heic")) for letter in "abc"]
    assert names == ["Display P3", "Display P3", "sRGB"]
    # A copy in another format keeps them.
    files.write(tmp_path / "b.png", files.read_photograph(tmp_path / "b.heic"))
    assert name_of(files.read_photograph(tmp_path / "b.png")) == "Display P3"
    saved(tmp_path / "d.heic", pixels, color_primaries=9, transfer_characteristics=16, save_nclx_profile=True)
    with pytest.warns(UserWarning, match=r"d\.heic: its values are PQ, not sRGB"):
        files.read_photograph(tmp_path / "d.heic")


@pytest.mark.parametrize("transfer", [1, 6, 14, 15])
def test_the_curve_of_video_is_a_doubt(transfer, tmp_path):
    options = {"color_primaries": 9, "transfer_characteristics": transfer, "save_nclx_profile": True}
    saved(tmp_path / "a.heic", SMOOTH.astype(np.uint8), **options)
    with pytest.warns(UserWarning, match=r"a\.heic: its code points name the curve of video .*read as sRGB's"):
        assert name_of(files.read_photograph(tmp_path / "a.heic")) == "BT.2020"


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_colours_that_were_multiplied_by_alpha_are_divided_by_it(kind):
    white = np.iinfo(kind).max
    colours = (np.linspace(0.1, 0.9, 12).reshape(2, 2, 3) * white).astype(kind)
    alpha = np.array([[white, white // 2], [white // 5, 0]], kind)[..., None]
    times = np.rint(colours * (alpha / white)).astype(kind)
    found = _straight(np.concatenate([times, alpha], axis=-1))
    assert found.dtype == kind and (found[..., 3:] == alpha).all() and (found[1, 1, :3] == 0).all()
    off = np.abs(found[..., :3].astype(int) - colours)[alpha[..., 0] > 0]
    assert off.max() <= 3  # what five parts of a code's rounding are


def test_a_file_of_multiplied_colours_is_read_straight(tmp_path):
    colours = np.broadcast_to(np.array([200, 120, 60], np.uint8), (48, 64, 3))
    stored = np.concatenate([colours // 2, np.full((48, 64, 1), 128, np.uint8)], axis=-1)
    data = np.ascontiguousarray(stored).tobytes()
    pillow_heif.encode("RGBa", (64, 48), data, str(tmp_path / "a.heic"), quality=-1, chroma=444, matrix_coefficients=0)
    with pytest.warns(UserWarning, match="alpha is left out"):
        photograph = files.read_photograph(tmp_path / "a.heic")
    assert np.abs(photograph.pixels.astype(int) - colours).max() <= 2


def test_a_bracket_with_gain_maps_is_one_note(tmp_path):
    """Of ISO 21496-1's kind, which a file's brands name."""
    paths = []
    for index, name in enumerate(("a", "b", "c")):
        pixels = np.clip(SMOOTH + 20 * index, 0, 255).astype(np.uint8)
        path = saved(tmp_path / f"{name}.heic", pixels, exif=exif())
        # A brand that says of the file what its items would.
        data = path.read_bytes()
        assert data[4:8] == b"ftyp" and data[16:20] != b"heic"
        path.write_bytes(data[:16] + b"tmap" + data[20:])
        paths.append(path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read_bracket(paths, times=[1, 2, 4])
    lines = [str(each.message) for each in caught]
    assert len(lines) == 1 and "a.heic and 2 others have gain maps for HDR screens, not used" in lines[0]


def test_apple_s_gain_map_is_an_auxiliary_picture(tmp_path, monkeypatch):
    path = saved(tmp_path / "a.heic", SMOOTH.astype(np.uint8))
    opened = pillow_heif.open_heif

    def with_map(*names: str, **options: Any) -> Any:
        found = opened(*names, **options)
        found[0].info["aux"] = {"urn:com:apple:photo:2020:aux:hdrgainmap": [2]}
        return found

    monkeypatch.setattr(pillow_heif, "open_heif", with_map)
    with pytest.warns(UserWarning, match=r"a\.heic has a gain map for HDR screens, not used"):
        assert files.read_photograph(path).gain_map


def test_damaged_files_are_one_line_and_absurd_ones_are_not_decoded(tmp_path, capfd):
    whole = saved(tmp_path / "a.heic", SMOOTH.astype(np.uint8)).read_bytes()
    for length in (20, 60, 200, len(whole) // 2, len(whole) - 40):
        (tmp_path / "b.heic").write_bytes(whole[:length])
        with pytest.raises(UnreadableFile) as caught:
            files.read_photograph(tmp_path / "b.heic")
        assert "\n" not in str(caught.value) and "b.heic" in str(caught.value)
    # Noise where the pixels are: refused, or decoded to something; never more than a line.
    generator = np.random.default_rng(6)
    for _ in range(40):
        noisy = bytearray(whole)
        for place in generator.integers(24, len(whole), 8):
            noisy[place] = int(generator.integers(256))
        (tmp_path / "c.heic").write_bytes(bytes(noisy))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                files.read_photograph(tmp_path / "c.heic")
            except UnreadableFile as error:
                assert "\n" not in str(error)
    with pytest.raises(UnreadableFile, match="64 x 48 pixels"):
        files.read_photograph(tmp_path / "a.heic", ReadOptions(side=32))
    assert capfd.readouterr() == ("", "")


def test_avif_is_still_a_stranger(tmp_path):
    (tmp_path / "a.avif").write_bytes(
        struct.pack(">I", 28) + b"ftypavif" + bytes(4) + b"mif1miaf" + bytes(4) + bytes(64)
    )
    with pytest.raises(UnreadableFile, match="an AVIF picture, which relume does not read"):
        files.kind_of(tmp_path / "a.avif")
