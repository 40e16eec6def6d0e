"""`relume render`: what it writes, which renderer it takes, and what it refuses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import lights
from relume.cli import main
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.image.radiance import RadianceMap
from relume.sphere.illumination import as_radiance_map

SCENE = """
[camera]
position = [0, 0, 6]
target = [0, 0, 0]
field_of_view = 40
size = [40, 30]
[light]
map = "light.exr"
[materials.chrome]
kind = "mirror"
[materials.clay]
kind = "diffuse"
reflectance = [0.5, 0.5, 0.5]
[[objects]]
sphere = { centre = [%s, 0, 0], radius = 1 }
material = "%s"
"""
TRIANGLES = "v -1 0 0\nv 1 0 0\nv 0 0 1\nv 0 2 0\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 1 3 2\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path / "light.exr", as_radiance_map(lights.constant(16, 0.5)))
    (tmp_path / "clay.toml").write_text(SCENE % (0, "clay"))
    (tmp_path / "chrome.toml").write_text(SCENE % (0, "chrome"))
    (tmp_path / "aside.toml").write_text(SCENE % (1, "chrome"))
    (tmp_path / "body.obj").write_text(TRIANGLES)
    return tmp_path


def run(folder: Path, scene: str, out: str, *options: str) -> int:
    return main(["render", str(folder / scene), "-o", str(folder / out), *options])


def test_an_exr_holds_radiance_matte_depth_and_normals(folder):
    assert run(folder, "clay.toml", "picture.exr", "--renderer", "mapped") == 0
    layers = read_layers(folder / "picture.exr")
    assert set(layers) == {"radiance", "matte", "depth", "normal"}
    # Lambert of ½ in constant light of ½, before that light; sixteen rows of pixel middles hold it to 0.2 %.
    assert layers["radiance"][15, 20] == pytest.approx(0.25, rel=2e-3)
    assert layers["radiance"][0, 0] == pytest.approx(0.5, rel=1e-5)
    assert (layers["matte"][15, 20], layers["matte"][0, 0]) == (1, 0)
    assert layers["depth"][15, 20] == pytest.approx(5, abs=0.01)
    assert layers["normal"][15, 20] == pytest.approx([0, 0, 1], abs=0.05)


def test_a_mirror_needs_maps_and_gets_them(folder, capsys):
    assert run(folder, "chrome.toml", "picture.hdr") == 0
    assert "renderer  mapped" in capsys.readouterr().out
    assert read_radiance(folder / "picture.hdr").radiance == pytest.approx(0.5, rel=0.01)


def test_what_any_renderer_shades_is_left_to_light_transport(folder, capsys):
    assert run(folder, "clay.toml", "picture.exr", "--dry-run") == 0
    assert "renderer     mitsuba" in capsys.readouterr().out
    assert not (folder / "picture.exr").exists()


def test_a_picture_is_metered_by_the_mean_of_the_light(folder):
    assert run(folder, "chrome.toml", "picture.png", "--exposure", "1") == 0
    # The mean is ½ of white, a stop more is white.
    assert read_photograph(folder / "picture.png").pixels.min() >= 254


def test_objects_over_a_plate_leave_the_rest_of_it_as_it_is(folder):
    plate = np.random.default_rng(1).random((30, 40, 3), dtype=np.float32)
    write(folder / "plate.exr", RadianceMap(plate))
    (folder / "clay.toml").write_text(
        SCENE % (0, "clay") + '[[local]]\nshape = "plane"\nreflectance = [1, 1, 1]\nheight = -1\n'
    )
    assert run(folder, "clay.toml", "picture.exr", "--plate", str(folder / "plate.exr"), "-q") == 0
    layers = read_layers(folder / "picture.exr")
    outside = layers["matte"] == 0
    assert 0.4 < outside.mean() < 0.95
    np.testing.assert_array_equal(layers["radiance"][outside], plate[outside])
    # The real plane is in the plate already: no pixel is brighter than object and plate together can be.
    assert layers["radiance"].max() <= plate.max() + 1e-6


def test_a_turntable_turns_objects_where_they_stand(folder):
    assert run(folder, "aside.toml", "turn", "--frames", "3") == 0
    frames = [read_photograph(folder / f"turn/frame_{i:04d}.png").pixels for i in (1, 2, 3)]
    assert np.array_equal(frames[0], frames[1])
    assert np.array_equal(frames[0], frames[2])
    assert len(list((folder / "turn").iterdir())) == 3


def test_frames_of_two_movies_are_not_mixed(folder, capsys):
    assert run(folder, "chrome.toml", "turn", "--frames", "3") == 0
    assert run(folder, "chrome.toml", "turn", "--frames", "2") == 2
    assert "holds frames of another movie, from frame_0003.png on" in capsys.readouterr().err


def test_a_movie_has_its_frames(folder):
    av = pytest.importorskip("av")
    assert run(folder, "chrome.toml", "turn.mp4", "--frames", "4", "--motion", "orbit") == 0
    with av.open(str(folder / "turn.mp4")) as movie:
        assert sum(1 for _ in movie.decode(video=0)) == 4


def test_a_mesh_is_framed_whole_in_any_size(folder):
    for size in ("40x30", "64x20", "20x64"):
        options = ("--light", str(folder / "light.exr"), "--renderer", "mapped", "--size", size)
        assert run(folder, "body.obj", "picture.exr", *options) == 0
        matte = read_layers(folder / "picture.exr")["matte"]
        assert matte.any()
        assert not (matte[0].any() or matte[-1].any() or matte[:, 0].any() or matte[:, -1].any())


@pytest.mark.parametrize(
    ("scene", "out", "options", "line"),
    [
        ("body.obj", "a.png", [], "a mesh brings no light; give --light MAP"),
        ("light.exr", "a.png", [], "neither a scene file nor a mesh"),
        ("none.toml", "a.png", [], "no such file"),
        ("clay.toml", "a.mp4", [], "a movie needs --frames N"),
        ("clay.toml", "a.tif", [], "must end in"),
        ("clay.toml", "a.png", ["--frames", "2"], "with --frames give a folder"),
        ("clay.toml", "turn", ["--frames", "0"], "--frames is 0; give 1 or more"),
        ("clay.toml", "a.png", ["--degrees", "90"], "--degrees tells how things move; give --frames N too"),
        ("clay.toml", "a.png", ["--size", "0x0"], "--size: 0x0 holds no pixels"),
        ("clay.toml", "a.png", ["--size", "big"], '"big" is no size; write WIDTHxHEIGHT'),
        ("clay.toml", "a.png", ["--renderer", "mapped", "--samples", "9"], "--samples is for --renderer mitsuba"),
        ("clay.toml", "a.png", ["--renderer", "mitsuba", "--filter", "mip"], "--filter is for --renderer mapped"),
        ("chrome.toml", "a.png", ["--renderer", "mitsuba"], "cannot shade the reflection maps of 'chrome'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(folder, capsys, scene: str, out: str, options: Sequence[str], line: str):
    assert run(folder, scene, out, *options) == 2
    said = capsys.readouterr().err
    assert line in said
    assert said.count("\n") == 1
    assert not (folder / out).exists()


def test_a_plate_of_another_size_is_refused_with_the_size_to_give(folder, capsys):
    write(folder / "plate.exr", RadianceMap(np.ones((10, 20, 3), np.float32)))
    assert run(folder, "chrome.toml", "a.png", "--plate", str(folder / "plate.exr")) == 2
    assert "give --size 20x10" in capsys.readouterr().err
