"""`relume panorama` and `relume render --environment`: what they write, say and refuse."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command_line import printed, refused, reported
from panoramas import patchwork, photograph
from relume.cli import main
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.probe.panorama.view_files import stored_crop
from relume.probe.panorama.views import FACES, orientation
from relume.sphere.mappings.orientation_chart import LABELS, orientation_chart
from relume.sphere.mappings.perspective import perspective_view

WORLD = patchwork(128, 800)


@pytest.fixture(scope="module")
def faces(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("faces")
    for name, angles in FACES.items():
        picture = photograph(WORLD, orientation(*np.radians(angles)), focal_length=32, size=(64, 64), cells=2)
        files.write(folder / f"{name}.exr", picture)
    return [str(folder / f"{name}.exr") for name in FACES]


ORDER = ",".join(FACES)


def test_six_faces_become_a_map(faces, tmp_path, capsys):
    out = tmp_path / "light.exr"
    facts = reported(["panorama", *faces, "-o", str(out), "--faces", ORDER, "--size", "64", "--no-balance"], capsys)
    light = files.read_radiance(out)
    assert light.size == (128, 64) and light.attributes["mapping"] == "latlong"
    np.testing.assert_allclose(facts["total"], WORLD.total(), rtol=0.01)
    assert [round(view["yaw"]) % 360 for view in facts["views"]] == [0, 90, 180, 270, 0, 0]
    assert facts["unseen sr"] == 0 and facts["matches agree within"] is None


def test_a_table_says_orientation_and_field_and_a_hole_is_doubted(faces, tmp_path, capsys):
    table = tmp_path / "head.csv"
    lines = [f"{name}.exr, {yaw}, {pitch}, 0, 90" for name, (yaw, pitch) in FACES.items() if name != "down"]
    table.write_text("name, yaw, pitch, roll, field\n" + "\n".join(lines))
    out = tmp_path / "light.exr"
    words = ["panorama", *faces[:5], "-o", out, "--orientations", table, "--size", "32", "--json"]
    captured = printed(words, capsys, 4)
    assert json.loads(captured.out)["unseen sr"] == pytest.approx(4 * np.pi / 6, rel=0.1)
    assert "17 % of the sphere is seen by no view" in captured.err or "16 %" in captured.err
    assert out.exists()
    clipped = files.read_radiance(out).clipped
    assert clipped is not None and clipped[-1].min() == 3


def test_each_view_is_a_line_without_negative_zeros(faces, tmp_path, capsys):
    words = ["panorama", *faces, "-o", tmp_path / "light.exr", "--faces", ORDER, "--size", "32", "--no-balance"]
    lines = [" ".join(line.split()) for line in printed(words, capsys).out.splitlines()]
    assert "view front.exr yaw 0, pitch 0, roll 0, field 90, gain 1.0000" in lines
    assert "view left.exr yaw -90, pitch 0, roll 0, field 90, gain 1.0000" in lines
    assert not [line for line in lines if "-0," in line]


def test_a_dim_map_is_reported_with_all_digits(faces, tmp_path, capsys):
    paths = []
    for face in faces:
        picture = files.read_radiance(face)
        path = tmp_path / Path(face).name
        files.write(path, RadianceMap(picture.radiance * np.float32(1e-5)))
        paths.append(str(path))
    out = tmp_path / "light.exr"
    facts = reported(["panorama", *paths, "-o", str(out), "--faces", ORDER, "--size", "64", "--no-balance"], capsys)
    np.testing.assert_allclose(facts["total"], 1e-5 * WORLD.total(), rtol=0.01)
    assert len(facts["peak"]) == 3 and set(facts["irradiance"]) == {"+X", "-X", "+Y", "-Y", "+Z", "-Z"}


def test_views_in_an_absolute_unit_are_balanced_only_when_asked(faces, tmp_path, capsys):
    paths = []
    for gain, yaw in ((1.0, 0), (1.2, 40)):
        picture = photograph(WORLD, orientation(np.radians(yaw)), focal_length=64, size=(128, 96), gain=gain)
        path = tmp_path / f"{yaw}.exr"
        files.write(path, RadianceMap(picture.radiance, unit="cd/m²"))
        paths.append(str(path))
    words = ["panorama", *paths, "-o", str(tmp_path / "a.exr"), "--turn", "40", "--field", "90", "--size", "32"]
    for more, ratio in (([], 1.0), (["--balance"], 1.2)):
        captured = printed([*words, *more, "--json"], capsys, 4)  # most of the sphere is unseen
        first, second = (view["gain"][0] for view in json.loads(captured.out)["views"])
        assert first / second == pytest.approx(ratio, rel=0.01)
        assert ("not balanced: radiance in cd/m²" in captured.err) == (ratio == 1)


ANGLES = [(0, 0, 0), (72, 0, 10), (144, 0, -10), (216, 0, 0), (288, 0, 0), (30, 88, 20), (-50, -88, 0)]
PROBE = orientation_chart(128)


@pytest.fixture(scope="module")
def crops(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Views of the labelled probe, 110° across, that remember it."""
    folder = tmp_path_factory.mktemp("crops")
    for number, angles in enumerate(ANGLES):
        picture = perspective_view(PROBE, orientation(*np.radians(angles)), np.radians(110), (180, 180))
        files.write(folder / f"{number}.exr", picture)
    return [folder / f"{number}.exr" for number in range(len(ANGLES))]


def is_the_probe(path: Path) -> bool:
    """But for edges, which are half a pixel soft."""
    found = files.read_radiance(path).radiance
    return found.shape == PROBE.radiance.shape and float(np.abs(found - PROBE.radiance).mean()) < 0.01


def test_crops_and_a_table_with_the_same_angles_give_the_map_back(crops, tmp_path):
    table, out = tmp_path / "head.csv", tmp_path / "light.exr"
    words = ["panorama", *map(str, crops), "-o", str(out), "--orientations", str(table), "--size", "128"]
    for sign in (1, -1):
        rows = [f"{i}.exr,{sign * yaw},{pitch},{roll},110" for i, (yaw, pitch, roll) in enumerate(ANGLES)]
        table.write_text("name,yaw,pitch,roll,field\n" + "\n".join(rows))
        assert main([*words, "--no-balance", "-q"]) == (0 if sign == 1 else 4)
        assert is_the_probe(out) == (sign == 1)


def test_crops_remember_field_and_orientation(crops, tmp_path, capsys):
    out = tmp_path / "light.exr"
    words = ["panorama", *map(str, crops), "-o", str(out), "--size", "128", "--json"]
    captured = printed(words, capsys)
    facts = json.loads(captured.out)
    assert "7 of 7 views hold how they were cropped" in captured.err and "--match" in captured.err
    assert "not balanced: crops of an environment map share its exposure" in captured.err
    assert is_the_probe(out)
    assert [view["yaw"] for view in facts["views"]][:5] == pytest.approx([0, 72, 144, -144, -72], abs=1e-3)
    assert {view["field"] for view in facts["views"]} == {110.0} and facts["matches agree within"] is None
    # What is given overrules what is remembered.
    main([*words, "--turn", "10"])
    captured = capsys.readouterr()
    assert [view["yaw"] for view in json.loads(captured.out)["views"]][:3] == pytest.approx([0, 10, 20], abs=1e-3)
    assert "cropped" not in captured.err
    main([*words, "--field", "100"])
    assert {view["field"] for view in json.loads(capsys.readouterr().out)["views"]} == {100.0}
    assert "give one" in refused([*words, "--match", "--turn", "10"], capsys)


def test_faces_cropped_wider_keep_their_field(tmp_path, capsys):
    paths = []
    for name, angles in FACES.items():
        picture = perspective_view(PROBE, orientation(*np.radians(angles)), np.radians(96), (60, 60))
        # The yaw to the right: the first three look along −Z, +X and +Z.
        label = LABELS[{"front": "-Z", "right": "+X", "back": "+Z", "left": "-X", "up": "+Y", "down": "-Y"}[name]]
        np.testing.assert_allclose(picture.radiance[30, 30], label.colour, atol=0.01)
        files.write(tmp_path / f"{name}.exr", picture)
        paths.append(str(tmp_path / f"{name}.exr"))
    words = ["panorama", *paths, "-o", tmp_path / "a.exr", "--faces", ORDER, "--size", "64"]
    assert {view["field"] for view in reported(words, capsys)["views"]} == {96.0}


def test_match_does_not_use_what_crops_remember(crops, tmp_path, capsys):
    # Up and down have nothing in common.
    line = refused(["panorama", *map(str, crops[5:]), "-o", str(tmp_path / "a.exr"), "--match"], capsys)
    assert "too little in common" in line


def test_a_view_that_cannot_be_is_not_used(tmp_path):
    picture = perspective_view(PROBE, np.eye(3), np.radians(90), (40, 30))
    crop = stored_crop(picture)
    assert crop is not None and crop.focal_length == pytest.approx(20)
    np.testing.assert_array_equal(crop.rotation, np.eye(3))
    assert stored_crop(replace(picture, attributes={})) is None
    for wrong in ({"view-field": "190"}, {"view-rotation": "1 0 0"}, {"view-rotation": "2 0 0 0 1 0 0 0 1"}):
        broken = replace(picture, attributes={**picture.attributes, **wrong})
        with pytest.warns(UserWarning, match="front: its attributes hold an impossible view"):
            assert stored_crop(broken, "front") is None


def test_a_dry_run_writes_nothing(faces, tmp_path, capsys):
    planned = reported(["panorama", *faces, "-o", tmp_path / "light.exr", "--dry-run", "--field", "90"], capsys)
    assert planned["orientation"] == "matched, where the views do not hold it" and list(tmp_path.iterdir()) == []


def test_single_photographs_are_taken_for_srgb_and_said_so(tmp_path, capsys):
    paths, out = [tmp_path / "0.png", tmp_path / "40.png"], tmp_path / "light.exr"
    for path in paths:
        files.write(path, Photograph(np.full((40, 60, 3), 188, np.uint8)))
    words = ["panorama", *paths, "-o", out, "--turn", "40", "--field", "60", "--size", "32"]
    assert "2 single photographs are assumed to be sRGB" in printed(words, capsys, 4).err
    assert np.median(files.read_radiance(out).radiance) == pytest.approx(0.5029, rel=1e-3)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ([], "front.exr: no focal length in the file; give the field of view across with --field"),
        (["--faces", "front,right"], "2 faces for 6 views"),
        (["--faces", "front,sideways"], '"sideways" is not a face'),
        (["--faces", ORDER, "--turn", "60"], "faces and turn both give the orientation"),
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
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    out = tmp_path / "light.exr"
    start = ["render", scene, "-o", out, "--environment", "0,1,0"]
    words = [*start, "--size", "64x32", "--samples", "4"]
    assert reported(words, capsys)["total"] == pytest.approx([1, 1, 1], rel=1e-3)
    assert files.read_radiance(out).size == (64, 32)
    scene.write_text(SCENE.replace("intensity = 4.0", "intensity = 4.0e-5"))
    facts = reported(words, capsys)
    assert facts["total"] == pytest.approx([1e-5] * 3, rel=1e-3)
    assert facts["irradiance from above"] == pytest.approx([1e-5] * 3, rel=1e-2)
    assert "twice as wide as high" in refused([*start, "--size", "64x48"], capsys)
    line = refused([*start, "--frames", "3"], capsys)
    assert "--environment shows all directions" in line and "--frames is of something else" in line
