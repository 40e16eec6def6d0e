"""The geometry of a mirrored ball: known angles, the blind cone, and the solid angle of a pixel."""

from dataclasses import replace

import numpy as np
import pytest

from relume.image.radiance import OUTSIDE, RadianceMap
from relume.probe.ball.reflectance import CHROME_STEEL, BallReflectance, measured_reflectance
from relume.probe.ball.silhouette import Cone, outline_of
from relume.probe.ball.unwrapping import CAMERA_FROM_PIXELS, BallView
from relume.probe.ball.weights import STILL_SEEN, clear_of_camera
from synthetic import unit


def ball_view(distance: float, *, axis=(0.0, 0.0, 1.0), focal_length=2000.0, size=(400, 300), **more) -> BallView:
    """A ball drawn by its cone alone; the picture's pixels hold their own x and y and how far they are outside."""
    y, x = np.mgrid[: size[1], : size[0]] + 0.5
    cone = Cone(unit(np.array(axis)), distance)
    picture = RadianceMap(np.stack([x, y, np.ones_like(x)], -1).astype(np.float32), **more)
    outline = outline_of(cone, size, focal_length)
    return BallView(picture, focal_length, cone.axis, distance, CAMERA_FROM_PIXELS, outline)


def at_angle(view: BallView, degrees: float, around: float = 0.3) -> np.ndarray:
    """The world direction that makes an angle with that towards the camera."""
    back = view.towards_camera
    side = unit(np.cross(back, [0.1, 1.0, 0.2]))
    other = np.cross(back, side)
    a = np.radians(degrees)
    return np.cos(a) * back + np.sin(a) * (np.cos(around) * side + np.sin(around) * other)


@pytest.mark.parametrize(
    "radius, degrees", [(0.25, 28.955), (0.5, 60.0), (0.70711, 90.0), (0.9, 128.316), (0.99, 163.781), (0.999, 174.875)]
)
def test_from_far_away_a_ball_shows_twice_the_arcsine(radius, degrees):
    view = ball_view(1e5, focal_length=1e7, size=(240, 240))  # 100 pixels in radius
    x, y, _ = view.see(at_angle(view, degrees)).radiance
    assert np.hypot(x - 120, y - 120) / 100 == pytest.approx(radius, abs=2e-4)


@pytest.mark.parametrize("distance, degrees", [(5, 11.537), (10, 5.7392), (20, 2.866), (50, 1.146), (100, 0.573)])
def test_a_near_camera_is_blind_to_a_cone_behind_the_ball(distance, degrees):
    view = ball_view(distance, focal_length=140.0 * np.sqrt(distance**2 - 1))
    edge = 180 - degrees
    inner, outer = (view.see(at_angle(view, edge + step)) for step in (0.02, -0.5))
    assert inner.incidence < 1e-6 and inner.sampling < 1e-3
    assert outer.incidence > 1e-3 and outer.sampling == 0  # within the ball's outermost pixel, which is mixed
    assert view.see(at_angle(view, edge - 20)).sampling > 0
    assert view.solid_angles(at_angle(view, edge + 0.02)) == 0 < view.solid_angles(at_angle(view, edge - 0.5))


@pytest.mark.parametrize("distance, axis", [(6.0, (0, 0, 1)), (20.0, (0.2, -0.1, 1)), (60.0, (0, 0, 1))])
def test_the_solid_angle_of_a_pixel_is_its_jacobian(distance, axis):
    focal_length = 120.0 * np.sqrt(distance**2 - 1)
    # Off the axis the ball lies 540 pixels from the middle.
    size = (1400, 1400) if axis[0] else (400, 400)
    view = ball_view(distance, axis=axis, focal_length=focal_length, size=size)
    step = 1e-3
    for degrees in (0.0, 20.0, 75.0, 120.0, 160.0):
        towards = at_angle(view, degrees)
        side = unit(np.cross(towards, [0.3, 0.2, 1.0]))
        other = np.cross(towards, side)
        corners = unit(towards + step * np.array([side, -side, other, -other]))
        places = view.see(corners).radiance[:, :2]
        across, along = (places[0] - places[1]) / (2 * step), (places[2] - places[3]) / (2 * step)
        numeric = 1 / abs(across[0] * along[1] - across[1] * along[0])
        assert view.solid_angles(towards) == pytest.approx(numeric, rel=3e-3)
        least = np.linalg.svd(np.stack([across, along]), compute_uv=False)[-1]
        # Not in the outermost pixel; off the middle the picture itself stretches by a few percent more.
        if axis[0] == 0 and degrees < 150:
            assert view.see(towards).sampling == pytest.approx(least, rel=0.02)


def test_from_far_away_every_pixel_takes_in_the_same_solid_angle():
    view = ball_view(2000.0, focal_length=100.0 * np.sqrt(2000.0**2 - 1), size=(240, 240))
    around = np.stack([at_angle(view, degrees) for degrees in (1, 40, 90, 140, 170)])
    np.testing.assert_allclose(view.solid_angles(around), 4 / 100**2, rtol=5e-3)


def test_what_lies_outside_every_photograph_is_not_seen():
    mask = np.zeros((300, 400), np.uint8)
    mask[:, 200:] = OUTSIDE
    view = ball_view(20.0, clipped=mask)
    left, right = (view.see(np.array([sign * 0.6, 0.0, 0.8])) for sign in (-1, 1))
    assert left.incidence > 0.5 and right.incidence == 0 and right.sampling == 0


def test_a_camera_hides_itself_and_what_is_under_it():
    view = ball_view(20.0)
    level = at_angle(view, 0.0)
    assert clear_of_camera(view, level[None]) == pytest.approx(STILL_SEEN)
    down, up = (np.array([0, np.sin(np.radians(a)), np.cos(np.radians(a))]) for a in (-25.0, 25.0))
    assert clear_of_camera(view, down[None]) == pytest.approx(STILL_SEEN)
    assert clear_of_camera(view, up[None]) == pytest.approx(1.0)
    assert clear_of_camera(view, np.array([[0, -0.8, 0.6]])) == pytest.approx(1.0)  # 53° down: the table


def test_reflectance_rises_towards_grazing():
    steel = BallReflectance((0.55, 0.556, 0.554))
    np.testing.assert_allclose(steel.at(np.array([1.0, 0.0])), [[0.55, 0.556, 0.554], [1, 1, 1]])
    assert steel.at(np.array(0.5))[0] == pytest.approx(0.55 + 0.45 / 32)
    assert BallReflectance((0.5, 0.5, 0.5), rising=False).at(np.array(0.0)).tolist() == [0.5, 0.5, 0.5]
    assert min(CHROME_STEEL.normal) > 0.5 and max(CHROME_STEEL.normal) < 0.6


def test_what_a_ball_keeps_is_divided_out_by_its_angle():
    plain = ball_view(20.0)
    dull = replace(plain, reflectance=BallReflectance((0.5, 0.6, 0.7)))
    for degrees in (10.0, 90.0, 165.0):
        towards = at_angle(plain, degrees)
        shown, light = plain.see(towards), dull.see(towards).radiance
        np.testing.assert_allclose(light * dull.reflectance.at(shown.incidence), shown.radiance)
        assert degrees > 10 or (shown.radiance / light)[0] == pytest.approx(0.5, abs=1e-4)


def test_reflectance_is_measured_from_a_card_and_its_image():
    card = np.random.default_rng(0).uniform(0.9, 1.1, (20, 20, 3))
    found = measured_reflectance(card * [0.5, 0.55, 0.6], card)
    assert found.normal == pytest.approx((0.5, 0.55, 0.6), rel=0.03) and found.rising
    with pytest.raises(ValueError, match="times as bright as the card itself"):
        measured_reflectance(card * 1.5, card)
    with pytest.raises(ValueError, match="choose pixels where it is lit"):
        measured_reflectance(card, card * 0)


@pytest.mark.parametrize("normal", [(0.0, 0.5, 0.5), (0.5, 0.5, 1.2), (0.5, 0.5, float("nan"))])
def test_a_reflectance_is_a_share(normal):
    with pytest.raises(ValueError, match="three values above 0 and at most 1"):
        BallReflectance(normal)
