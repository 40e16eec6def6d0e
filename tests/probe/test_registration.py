"""Views of one ball find how they are turned against each other, and say when they cannot be views of one light."""

from dataclasses import replace

import numpy as np
import pytest

from angles import degrees_turned
from relume.errors import BallNotFound
from relume.image.radiance import RadianceMap
from relume.probe.ball.registration import KnownPlaces, UnknownPlaces
from relume.probe.ball.silhouette import Outline
from relume.probe.ball.unwrapping import BallView, unwrap_ball
from relume.sphere.directions import look_at
from synthetic import CENTRE, lobes, photograph_ball, turned, unit

FRONT = np.array([0.0, 0.17, 1.0])
OTHERS = {"a quarter turn": np.array([1.0, 0.17, 0.0]), "behind, from above": np.array([-0.5, 0.5, -0.7])}


def view(camera: np.ndarray, light=lobes, given: np.ndarray = FRONT, outline: Outline | None = None) -> BallView:
    """The ball from `camera`, whose place is given as that of the first one unless another is.

    outline : of a view from as far, where the rim need not be sought again
    """
    picture = photograph_ball(light, camera, width=240, height=240, focal_length=2200.0)
    return unwrap_ball(picture, camera=given, centre=CENTRE, focal_length=2200.0, outline=outline)


def turn_of(camera: np.ndarray) -> np.ndarray:
    return look_at(camera, CENTRE) @ look_at(FRONT, CENTRE).T


@pytest.fixture(scope="module")
def front() -> BallView:
    return view(FRONT)


@pytest.mark.parametrize(
    "camera",
    [OTHERS["a quarter turn"], pytest.param(OTHERS["behind, from above"], marks=pytest.mark.slow)],
    ids=list(OTHERS),
)
def test_an_unknown_turn_is_found(front, camera):
    found = UnknownPlaces()((front, view(camera)))
    # Measured: 0.02° and 0.06°; the goal is 0.2°.
    assert degrees_turned(found.turns[1], turn_of(camera)) < 0.2
    assert found.likenesses[1] > 0.999 and not found.doubts
    assert found.gains[1] == pytest.approx(1, abs=0.01)
    np.testing.assert_array_equal(found.turns[0], np.eye(3))


@pytest.mark.slow
def test_the_turn_of_the_room_is_found(shared):
    from relume.capture.exposure.bracket import read_bracket
    from relume.capture.merging import merge
    from relume.capture.response.calibration import recover_response

    folders = [shared / "shoots/room" / name for name in ("ball_0", "ball_90")]
    brackets = [read_bracket(sorted(folder.glob("*.jpg"))) for folder in folders]
    response = recover_response(brackets).response
    views = [
        unwrap_ball(merge(bracket, response), camera=FRONT, centre=CENTRE, focal_length=bracket.focal_length)
        for bracket in brackets
    ]
    found = UnknownPlaces()(views)
    # The goal is 0.2°, and it is not always met: measured 0.1° to 0.32°, by how the pictures were merged and where the
    # refinement began. Walls that are not all equally far make 0.1° even with the silhouettes as they were rendered.
    assert degrees_turned(found.turns[1], turn_of(np.array([1.0, 0.17, 0.0]))) < 0.35
    assert found.likenesses[1] > 0.99


@pytest.mark.slow
def test_several_views_are_refined_together():
    cameras = [FRONT, *OTHERS.values(), np.array([-0.9, 0.1, 0.2])]
    pictures = [photograph_ball(lobes, camera) for camera in cameras]
    views = [unwrap_ball(picture, camera=FRONT, centre=CENTRE, focal_length=3400.0) for picture in pictures]
    found = UnknownPlaces()(views)
    # Balls of 169 pixels; with those of 109 one view of the three is 0.22° off.
    for turn, camera in zip(found.turns[1:], cameras[1:], strict=True):
        assert degrees_turned(turn, turn_of(camera)) < 0.2
    assert found.nearness < 0.005


def test_views_of_different_lights_are_refused(front):
    def elsewhere(directions: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(directions, -1, 0)
        light = 0.3 + 0.25 * np.sin(9 * x + 2) * np.cos(8 * y) + 4 * ((np.abs(x) < 0.1) & (z > 0)) + 0.2 * (y < -0.2)
        return light[..., None] * np.ones(3)

    with pytest.raises(BallNotFound, match=r"^view 2 of the ball shows nothing that fits the first one"):
        UnknownPlaces()((front, view(OTHERS["a quarter turn"], elsewhere, outline=front.outline)))


@pytest.mark.slow
def test_someone_who_walked_between_the_views_does_not_turn_them(front):
    someone = unit(np.array([0.7, 0.3, 0.6]))

    def passing(directions: np.ndarray) -> np.ndarray:
        return np.where((directions @ someone > np.cos(np.radians(9)))[..., None], 0.02, lobes(directions))

    camera = OTHERS["a quarter turn"]
    assert np.degrees(KnownPlaces()((front, view(camera, passing, camera))).corrections[1]) < 0.25


def test_light_that_is_the_same_all_round_turns_nothing(front):
    even = replace(front, picture=RadianceMap(np.full_like(front.picture.radiance, 0.5)))
    found = KnownPlaces()([even, even])
    assert max(found.corrections) < 1e-6 and found.gains == (1.0, 1.0) and not found.doubts


@pytest.mark.slow
def test_a_silhouette_found_too_small_is_corrected_by_the_other_view():
    def patterned(directions: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(directions, -1, 0)
        return lobes(directions) * np.exp(0.8 * np.sin(7 * x + 2 * z) * np.cos(6 * y - 3 * z))[..., None]

    views = []
    for camera in (FRONT, OTHERS["a quarter turn"]):
        found = view(camera, patterned, camera)
        # As if little of the rim had been seen, so that it is not held where it is.
        views.append(replace(found, outline=replace(found.outline, points=found.outline.points[::4])))
    # Both cameras are 20.14 radii away. What is wrong in both alike looks like nearer walls; what differs does not.
    wrong = [views[0], views[1].adjusted(0.0, 0.0, -0.9)]  # too small by 0.9 pixels of 109
    before, after = wrong, KnownPlaces()(wrong).views
    assert abs(before[1].distance - before[0].distance) > 0.15
    assert abs(after[1].distance - after[0].distance) < 0.02


def test_an_adjusted_silhouette_keeps_its_camera(front):
    moved = front.adjusted(3.0, -2.0, 1.0)
    np.testing.assert_allclose(moved.towards_camera, front.towards_camera, atol=1e-12)
    x, y = (moved.axis[:2] / moved.axis[2] - front.axis[:2] / front.axis[2]) * front.focal_length
    assert (x, y) == pytest.approx((3, -2), rel=0.01)
    assert front.distance / moved.distance == pytest.approx(1 + 1 / front.outline.radius)


def test_a_lone_view_stays_as_it_is(front):
    found = UnknownPlaces()((front,))
    assert found.corrections == (0.0,) and found.gains == (1.0,) and found.nearness == 0.0
    assert degrees_turned(found.turns[0], np.eye(3)) == 0


def test_a_given_place_wrong_by_more_than_a_tape_measure_is_doubted(front):
    wrong = CENTRE + turned(OTHERS["a quarter turn"] - CENTRE, np.array([0.0, 1.0, 0.0]), 40.0)
    doubts = KnownPlaces()((front, view(OTHERS["a quarter turn"], given=wrong, outline=front.outline))).doubts
    assert doubts and doubts[0].wrong
    assert doubts[0].line == "view 2 of the ball does not fit the first one; check where its camera stood"
