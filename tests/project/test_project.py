"""The shot file: what is read, and one clear line for what is not."""

from __future__ import annotations

from pathlib import Path

import pytest

from relume.errors import InvalidShot
from relume.project.shot_file.shot import read_shot
from toml_files import shot_of

GOOD = """
[plate]
photographs = ["plate/*.jpg"]
[camera]
grid = { photograph = "grid.jpg", squares = [9, 6], square = 0.03 }
[light]
map = "light.exr"
"""


def test_the_example_is_a_valid_shot_file() -> None:
    shot = read_shot(Path(__file__).parents[2] / "examples/room/shot.toml")
    assert shot.objects[0].mesh == "objects/suzanne_plastic.glb"
    assert shot.render.samples == 64 and shot.render.noise is None and shot.develop.response == "plate"
    assert shot.light.distant.shape == "box" and len(shot.light.lamps) == 1
    assert [(table.reflectance, table.gloss) for table in shot.local] == [("recover", "recover")]


def test_a_short_shot_file_has_a_plane_and_defaults(tmp_path: Path) -> None:
    shot = shot_of(tmp_path, GOOD)
    assert shot.local[0].shape == "plane" and shot.local[0].reflectance == "recover"
    assert shot.folder == tmp_path and shot.objects == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("[plate]", "[plate]\nphotograph = 3"), "plate.photograph: unknown key; did you mean photographs"),
        (GOOD + "[lihgt]\nmap = 'x'", "lihgt: unknown key; did you mean light"),
        (GOOD + "[render]\nsample = 3", "render.sample: unknown key; did you mean samples"),
        (GOOD + "[render]\nsamples = 0", "render.samples: input should be greater than or equal to 2 (got 0)"),
        (GOOD + "[[objects]]\nscale = 2.0", "objects.0.mesh: missing"),
        (GOOD + "[[objects]]\nmesh = 'a.glb'\nmaterial = { roughness = 2 }", "objects.0.material.roughness"),
        (GOOD + "[[local]]\nshape = 'cone'", "local.0.shape"),
        ("folder = 'x'\n" + GOOD, "folder: unknown key"),
        (GOOD + "[develop]\nresponse = 'film'", "develop.response"),
        (GOOD.replace('map = "light.exr"', ""), "light: give one of balls, map, maps, probes and sky"),
        (
            GOOD.replace('map = "light.exr"', 'balls = [{ photographs = ["b.jpg"], camera = [0, 0, 1] }]'),
            "balls need ball",
        ),
        (
            GOOD.replace(
                'map = "light.exr"',
                'balls = [{ photographs = ["b.jpg"], camera = [0, 0, 1], pick = [1, 2] }]\n'
                "ball = { centre = [0, 0, 0], radius = 1 }",
            ),
            "light.balls.0: a rim is [x, y, radius], or three points or more",
        ),
        (GOOD.replace("grid =", "gird ="), "camera.gird: unknown key; did you mean grid"),
        (GOOD.replace("[plate]", "[plate"), "not valid TOML"),
        (GOOD.replace('["plate/*.jpg"]', "[]"), "plate.photographs"),
    ],
)
def test_what_is_wrong_or_contradicts_itself_is_reported_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InvalidShot) as caught:
        shot_of(tmp_path, text)
    line = str(caught.value)
    assert message in line and "shot.toml" in line and "\n" not in line


def test_a_missing_shot_file_and_a_binary_one_are_reported(tmp_path: Path) -> None:
    with pytest.raises(InvalidShot, match="no such shot file"):
        read_shot(tmp_path / "none.toml")
    (tmp_path / "shot.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InvalidShot, match="cannot be read"):
        read_shot(tmp_path / "shot.toml")
