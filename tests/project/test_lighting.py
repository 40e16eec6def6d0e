"""What ties the plate's scale to the light's, and what is told when it is loose."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from relume.errors import InvalidShot, NotABracket
from relume.image.files import read_radiance, write
from relume.project.insertion.insert import insert
from relume.project.insertion.outcome import Inserted
from relume.project.shot_file.shot import read_shot
from relume.renderers.renderer import ConstantRenderer

FAKE = ConstantRenderer((3.0, 2.0, 1.0))


def test_times_for_the_plate_alone_are_refused_when_the_balls_tell_an_aperture(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    shot = read_shot(path)
    timed = shot.plate.model_copy(update={"times": [0.25, 1.0, 4.0, 16.0]})
    with pytest.raises(NotABracket, match="f_number"):
        insert(shot.model_copy(update={"plate": timed}), out, renderer=FAKE)


def test_a_plate_in_candelas_is_not_mixed_with_relative_light(
    room: tuple[Inserted, Path], copied_room: tuple[Path, Path]
) -> None:
    path, out = copied_room
    shot = read_shot(path)
    write(out / "absolute.exr", replace(read_radiance(room[1] / "composite.exr"), unit="cd/m²"))
    plate = shot.plate.model_copy(update={"photographs": [str(out / "absolute.exr")], "denoise": False})
    # The light of the balls as it was measured: without the plate's photographs it would be measured anew.
    light = type(shot.light)(map=str(room[1] / "light.exr"))
    with pytest.raises(InvalidShot, match=r"cd/m².*relative"):
        insert(shot.model_copy(update={"plate": plate, "light": light}), out, renderer=FAKE)


def test_a_ball_camera_that_stood_elsewhere_is_told(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    shot = read_shot(path)
    assert shot.light.balls is not None
    mirrored = shot.light.balls[1].model_copy(update={"camera": (-1.0, 0.17, 0.0)})
    light = shot.light.model_copy(update={"balls": [shot.light.balls[0], mirrored], "size": 64})
    result = insert(shot.model_copy(update={"light": light}), out, renderer=FAKE)
    assert any("check where its camera stood" in note for note in result.notes)


def test_the_picture_is_the_photograph_itself_where_nothing_changed(room: tuple[Inserted, Path]) -> None:
    result, _ = room
    from relume.image.files import read_photograph

    folder = Path(__file__).parents[2] / "examples/room/plate"
    photographs = [read_photograph(path).pixels for path in sorted(folder.glob("*.jpg"))]
    assert any((result.composited.before.pixels == photograph).all() for photograph in photographs)
    untouched = result.change.matte == 0
    assert (result.picture.pixels[untouched] == result.composited.before.pixels[untouched]).all()
