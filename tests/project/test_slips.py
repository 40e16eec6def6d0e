"""Lengths in another unit, diameters for radii, plates of another day: one line that says what and what to do."""

from __future__ import annotations

import warnings
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from relume.capture.exposure.bracket import Bracket
from relume.errors import DoubtWarning, InvalidShot, doubt_of
from relume.image.photograph import Exposure, Photograph, Settings
from relume.image.radiance import RadianceMap
from relume.probe.ball.silhouette import outline_of_circle
from relume.probe.ball.unwrapping import BallView, unwrap_ball
from relume.project.insertion.slips import held_to_tape, other_time_or_place, require_measures, require_outside_ball
from relume.project.shot_file.light_table import Ball, BallPhotographs
from relume.scene.cameras.camera import Camera
from toml_files import shot_of

SHOT = """
[plate]
photographs = "plate/*.jpg"
[camera]
pose = {{ position = [0.2, 0.5, 1.2], look_at = [0, 0, 0] }}
[light]
balls = [ {{ photographs = ["ball/*.jpg"], camera = {camera} }} ]
ball = {{ centre = {centre}, radius = {radius} }}
"""


def lines_of(folder: Path, **given: object) -> list[str]:
    measures = {"camera": [0, 0.17, 1.05], "centre": [0, 0.05, 0], "radius": 0.05} | given
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        require_measures(shot_of(folder, SHOT.format(**measures)))
    lines = [str(each.message) for each in caught]
    assert all("\n" not in line for line in lines)
    return lines


def test_measures_that_can_be_are_not_doubted(tmp_path: Path) -> None:
    assert lines_of(tmp_path) == []
    # On a stand.
    assert lines_of(tmp_path, centre=[0, 0.4, 0]) == []


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"camera": [0, 17, 105]}, "light.balls.0.camera: 106 m from a ball of 0.05 m, 2127 of its radii; lengths"),
        ({"radius": 0.0005}, "lengths are metres: 5 cm are 0.05"),
        ({"camera": [0, 0.05, 0.5]}, "light.balls.0.camera: 10 ball radii away; the camera hides much of the light "
         "there: stand 20 radii away (1 m) or more"),
        ({"centre": [0, 0.005, 0]}, "light.ball: it reaches 0.045 m into the plane it stands on; check its centre"),
    ],
)  # fmt: skip
def test_measures_that_cannot_be_are_doubted_in_one_line(tmp_path: Path, given: dict[str, object], line: str) -> None:
    assert any(line in each for each in lines_of(tmp_path, **given))


def test_a_radius_in_centimetres_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidShot, match=r"^light\.ball\.radius: the ball is given 5 m, and the camera of .* metres: 5"
    ):
        lines_of(tmp_path, radius=5)
    # All of the ball's lengths in centimetres agree among themselves, but not with the plate's camera.
    assert lines_of(tmp_path, radius=5, centre=[0, 5, 0], camera=[0, 17, 105]) == []
    camera = Camera.looking_at(np.array([0.2, 0.5, 1.2]), np.zeros(3), width=60, height=40, focal_length=50)
    with pytest.raises(
        InvalidShot, match=r"^light\.ball: .*the plate's camera stands 4\.\d+ m from its middle, inside"
    ):
        require_outside_ball(camera, Ball(centre=(0, 5, 0), radius=5))
    require_outside_ball(camera, Ball(centre=(0, 0.05, 0), radius=0.05))


def view_at(radii: float, focal_length: float, rim: float) -> BallView:
    picture = RadianceMap(np.ones((200, 200, 3), np.float32))
    return unwrap_ball(
        picture, camera=np.array([0, 0, radii]), centre=np.zeros(3), focal_length=focal_length,
        outline=outline_of_circle(100, 100, rim),
    )  # fmt: skip


def held(view: BallView, radius: float, focal_length: float | None = None) -> tuple[BallView, list[str]]:
    table = BallPhotographs(photographs=["a.jpg"], camera=(0, 0, 1), focal_length=focal_length)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = held_to_tape(view, 0, table, Ball(centre=(0, 0, 0), radius=radius))
    return found, [str(each.message) for each in caught]


def test_rim_and_focal_length_are_held_against_the_tape() -> None:
    # 40 pixels at a focal length of 800: 20 radii.
    view = view_at(20, 800, 40)
    assert view.distance == pytest.approx(20, rel=0.01)
    assert held(view, 0.05) == (view, []) and held(view, 0.045)[1] == []
    same, (line,) = held(view, 0.1)
    assert same is view and line == (
        "light.balls.0: by its rim and focal length the camera stood 20 ball radii away, by tape 10; is 0.1 m the "
        "ball's diameter?"
    )
    assert held(view, 0.0005)[1][0].endswith("by tape 2e+03; lengths are metres: 5 cm are 0.05")
    assert held(view, 0.029)[1][0].endswith("by tape 34.5; check camera, ball.radius and focal_length")
    # 20 radii away by a rim that may have been missed, 15 by tape: it shows 0.56 of the ball.
    with pytest.warns(DoubtWarning, match="by tape 15; check .* or the rim was missed") as caught:
        held_to_tape(
            view, 0, BallPhotographs(photographs=["a.jpg"], camera=(0, 0, 1)), Ball(centre=(0, 0, 0), radius=1 / 15)
        )
    assert doubt_of(caught[0].message).effect == pytest.approx(1 - (15 / 20) ** 2, abs=0.01)


def test_a_crop_whose_exif_has_the_whole_pictures_focal_length_is_placed_by_tape() -> None:
    view = view_at(20, 200, 95)
    assert view.distance < 3
    found, (line,) = held(view, 0.05)
    assert found.distance == pytest.approx(20, rel=1e-3) and found.focal_length == pytest.approx(95 * np.sqrt(399))
    assert "taken for crops" in line
    # A focal length that is given is believed.
    assert held(view, 0.05, focal_length=200.0)[0] is view


def bracket(taken: datetime | None, latitude: float | None = None) -> Bracket:
    settings = Settings(taken=taken, latitude=latitude, longitude=None if latitude is None else 9.0)
    return Bracket((Photograph(np.zeros((2, 2, 3), np.uint8), exposure=Exposure(1.0), settings=settings),))


def test_a_plate_of_another_time_or_place_is_doubted() -> None:
    noon = datetime(2026, 6, 1, 12)
    ball = (bracket(noon, 47.0), bracket(noon + timedelta(minutes=5), 47.0))
    assert list(other_time_or_place(bracket(noon + timedelta(minutes=20), 47.0005), ball)) == []
    assert list(other_time_or_place(bracket(None), ball)) == []
    assert list(other_time_or_place(RadianceMap(np.ones((2, 2, 3), np.float32)), ball)) == []
    (late,) = other_time_or_place(bracket(noon - timedelta(hours=3)), ball)
    assert late.startswith("the plate was taken 3.0 hours before the ball's photographs")
    (days,) = other_time_or_place(bracket(noon + timedelta(days=4)), ball)
    assert "4 days after" in days
    (far,) = other_time_or_place(bracket(noon, 47.1), ball)
    # A tenth of a degree of latitude: 6371 km · π / 1800.
    assert far.startswith("the plate was taken 11.1 km from")
