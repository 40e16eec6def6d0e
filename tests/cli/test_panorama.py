"""`relume panorama` and `relume render --environment`: what they write, tell and refuse."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from command_line import refused
from panoramas import patchwork, photograph
from relume.cli import main
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.probe.panorama_views import FACES, orientation

WORLD = patchwork(128, 800)


@pytest.fixture(scope="module")
def faces(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("faces")
    for name, angles in FACES.items():
        picture = photograph(WORLD, orientation(*np.radians(angles)), focal_length=32, size=(64, 64), cells=2)
        files.write(folder / f"{name}.exr", picture)
    return [str(folder / f"{name}.exr") for name in FACES]


ORDER = ",".join(FACES)


def test_six_faces_become_a_map(faces: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "light.exr"
    assert main(["panorama", *faces, "-o", str(out), "--faces", ORDER, "--size", "64", "--no-balance", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    light = files.read_radiance(out)
    assert light.size == (128, 64) and light.attributes["mapping"] == "latlong"
    np.testing.assert_allclose(told["total"], WORLD.total(), rtol=0.01)
    assert [round(view["yaw"]) % 360 for view in told["views"]] == [0, 90, 180, 270, 0, 0]
    assert told["unseen sr"] == 0 and told["matches agree within"] is None


def test_a_table_tells_orientation_and_field_and_a_hole_is_doubted(
    faces: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    table = tmp_path / "head.csv"
    lines = [f"{name}.exr, {yaw}, {pitch}, 0, 90" for name, (yaw, pitch) in FACES.items() if name != "down"]
    table.write_text("name, yaw, pitch, roll, field\n" + "\n".join(lines))
    out = tmp_path / "light.exr"
    assert main(["panorama", *faces[:5], "-o", str(out), "--orientations", str(table), "--size", "32", "--json"]) == 4
    captured = capsys.readouterr()
    assert json.loads(captured.out)["unseen sr"] == pytest.approx(4 * np.pi / 6, rel=0.1)
    assert "17 % of the sphere is seen by no view" in captured.err or "16 %" in captured.err
    assert out.exists()
    clipped = files.read_radiance(out).clipped
    assert clipped is not None and clipped[-1].min() == 3


def test_a_dry_run_writes_nothing(faces: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "light.exr"
    assert main(["panorama", *faces, "-o", str(out), "--dry-run", "--field", "90", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["orientation"] == "matched"
    assert not out.exists()


def test_single_photographs_are_taken_for_srgb_and_said_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    paths = []
    for yaw in (0, 40):
        path = tmp_path / f"{yaw}.png"
        files.write(path, Photograph(np.full((40, 60, 3), 188, np.uint8)))
        paths.append(str(path))
    out = tmp_path / "light.exr"
    assert main(["panorama", *paths, "-o", str(out), "--turn", "40", "--field", "60", "--size", "32"]) == 4
    assert "2 single photographs are taken to be sRGB" in capsys.readouterr().err
    assert np.median(files.read_radiance(out).radiance) == pytest.approx(0.5029, rel=1e-3)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ([], "front.exr: no focal length in the file; tell the field of view across with --field"),
        (["--faces", "front,right"], "--faces names 2 faces for 6 views"),
        (["--faces", "front,sideways"], '"sideways" is no face'),
        (["--faces", ORDER, "--turn", "60"], "--faces and --turn both tell the orientation"),
        (["--field", "190"], "less than 180"),
        (["--orientations", "none.csv"], "none.csv: no table could be read"),
    ],
)
def test_words_that_cannot_be_are_refused(words, line, faces, tmp_path, capsys):
    assert line in refused(["panorama", *faces, "-o", str(tmp_path / "a.exr"), *words], capsys)


def test_files_that_cannot_be_used_are_refused_by_name(faces, tmp_path, capsys):
    out = ["-o", str(tmp_path / "a.exr"), "--field", "90"]
    assert "front.exr: a panorama needs two views" in refused(["panorama", faces[0], *out], capsys)
    assert "gone.exr: no such file or folder" in refused(["panorama", faces[0], "gone.exr", *out], capsys)
    assert "too little in common" in refused(["panorama", faces[0], faces[2], *out], capsys)
    broken = tmp_path / "broken.exr"
    files.write(broken, RadianceMap(np.full((64, 64, 3), -1, np.float32)))
    assert "broken.exr: holds negative" in refused(["panorama", faces[0], str(broken), *out], capsys)
    table = tmp_path / "wrong.csv"
    table.write_text("name,yaw\nother.exr,10\n")
    assert "other.exr is no view" in refused(["panorama", *faces, *out, "--orientations", str(table)], capsys)
    table.write_text("file,angle\nother.exr,10\n")
    assert "must name the columns" in refused(["panorama", *faces, *out, "--orientations", str(table)], capsys)


SCENE = """
[camera]
position = [0, 1, 3]
target = [0, 1, 0]
[[lights]]
kind = "point"
position = [0, 3, 0]
intensity = 4.0
[[objects]]
sphere = { centre = [0, 0, 0], radius = 0.2 }
material = "grey"
[materials.grey]
kind = "diffuse"
reflectance = [0, 0, 0]
"""


def test_an_environment_of_a_scene_file_is_written(tmp_path, capsys):
    from relume.render.environment import environment  # noqa: F401

    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    out = tmp_path / "light.exr"
    words = [
        "render",
        str(scene),
        "-o",
        str(out),
        "--environment",
        "0,1,0",
        "--size",
        "64x32",
        "--samples",
        "4",
        "--json",
    ]
    code = main(words)
    captured = capsys.readouterr()
    assert code == 0, captured.err
    assert json.loads(captured.out)["total"] == pytest.approx([1, 1, 1], rel=1e-3)
    assert files.read_radiance(out).size == (64, 32)
    scene.write_text(SCENE.replace("intensity = 4.0", "intensity = 4.0e-5"))
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["total"] == pytest.approx([1e-5] * 3, rel=1e-3)
    assert told["irradiance from above"] == pytest.approx([1e-5] * 3, rel=1e-2)
    line = refused([*words[:4], "--environment", "0,1,0", "--size", "64x48"], capsys)
    assert "twice as wide as high" in line
    line = refused([*words[:4], "--environment", "0,1,0", "--frames", "3"], capsys)
    assert "--frames asks for pictures" in line
