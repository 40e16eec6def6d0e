"""The shot files of the virtual shoots, whose photographs are made elsewhere, are shot files."""

from __future__ import annotations

from pathlib import Path

import pytest

from relume.project.shot_file.shot import read_shot

FOLDER = Path(__file__).parents[2] / "benchmarks/shoots"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))


def test_there_are_four() -> None:
    assert NAMES == ["indoor_windows", "night_street", "outdoor_noon", "product_table"]


@pytest.mark.parametrize("name", NAMES)
def test_each_shot_file_names_two_views_of_a_ball_that_stands_on_the_ground(name: str) -> None:
    shot = read_shot(FOLDER / f"{name}.toml")
    assert shot.light.balls is not None
    assert len(shot.light.balls) == 2
    assert shot.light.ball is not None
    assert shot.light.ball.centre == (0.0, shot.light.ball.radius, 0.0)
    assert shot.render.samples == 64
    assert len({each.mesh for each in shot.objects}) == len(shot.objects) >= 4
