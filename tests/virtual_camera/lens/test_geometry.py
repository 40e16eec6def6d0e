"""Distortion and lateral colour: places, one resampling, and the way back."""

import numpy as np
import pytest

from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.virtual_camera.lens.geometry import LateralColour, LensGeometry, RadialScale
from relume.virtual_camera.protocols import Undoable
from relume.virtual_camera.view import View

WIDTH, HEIGHT, FOCAL = 180, 120, 150.0
VIEW = View(FOCAL)
BARREL = Distortion(k1=-0.15, k2=0.03, p1=0.001, p2=-0.002, k3=0.002)
PINCUSHION = Distortion(k1=0.08)
COLOURS = LateralColour(RadialScale(0.004, 0.002), RadialScale(-0.003, 0.0, 0.001))


def smooth(x, y):
    """Waves (…, 3) whose curvature cubics follow."""
    return np.stack([2 + np.sin(x / 9) * np.cos(y / 11), 2 + np.sin(x / 12 + 1), 2 + np.cos(y / 10)], axis=-1)


def grid(width=WIDTH, height=HEIGHT):
    return np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)


PICTURE = smooth(*np.moveaxis(grid(), -1, 0)).astype(np.float32)


def within(places, margin=3.0):
    return np.all((places > margin) & (places < np.array([WIDTH, HEIGHT]) - margin), axis=-1)


def test_a_distorted_picture_shows_what_the_camera_sees():
    camera = Camera(WIDTH, HEIGHT, FOCAL, np.zeros(3), np.eye(3), distortion=BARREL)
    places = camera.pinhole().project(camera.rays())
    seen, inside = LensGeometry(BARREL).apply(PICTURE, VIEW), within(places)
    assert inside.mean() > 0.8 and np.abs(places - grid()).max() > 3
    # Cubics kept between their four neighbours lose a little of the waves' crests.
    np.testing.assert_allclose(seen[inside], smooth(*np.moveaxis(places, -1, 0))[inside], atol=1.5e-3)


def test_each_colour_is_drawn_at_its_own_size():
    x, y = np.moveaxis(grid(), -1, 0)
    # A soft lamp 60 pixels right of the axis.
    lamp = np.exp(-((x - 150) ** 2 + (y - 60) ** 2) / 32)[..., None].repeat(3, 2).astype(np.float32)
    geometry = LensGeometry(lateral=LateralColour(RadialScale(0.02), RadialScale(-0.01)))
    seen = geometry.apply(lamp, VIEW)
    centre = (seen * grid()[..., :1]).sum((0, 1)) / seen.sum((0, 1)) - WIDTH / 2
    np.testing.assert_allclose(centre, [60 * 1.02, 60.0, 60 * 0.99], atol=0.02)
    np.testing.assert_allclose(seen[..., 1], lamp[..., 1], atol=1e-6)


def test_distortion_and_colour_are_one_resampling():
    seen = LensGeometry(BARREL, COLOURS).apply(PICTURE, VIEW)
    points = (grid() - [WIDTH / 2, HEIGHT / 2]) / FOCAL
    for channel, scale in ((0, COLOURS.red), (1, RadialScale()), (2, COLOURS.blue)):
        places = BARREL.undistorted(scale.unscaled(points)) * FOCAL + [WIDTH / 2, HEIGHT / 2]
        inside = within(places)
        expected = smooth(*np.moveaxis(places, -1, 0))[inside][:, channel]
        np.testing.assert_allclose(seen[inside][:, channel], expected, atol=1.5e-3)


@pytest.mark.parametrize("geometry", [LensGeometry(BARREL, COLOURS), LensGeometry(PINCUSHION, centre=(0.52, 0.47))])
def test_undone_is_the_inverse_to_interpolation(geometry):
    step: Undoable = geometry
    assert isinstance(step, Undoable)
    back = geometry.undo(geometry.apply(PICTURE, VIEW), VIEW)
    inside = within(grid(), 16) & np.isfinite(back).all(-1)
    assert inside.mean() > 0.6
    assert np.abs(back - PICTURE)[inside].max() < 4e-3
    assert np.sqrt(np.mean((back - PICTURE)[inside] ** 2)) < 3e-4


def test_what_a_photograph_does_not_show_is_nan_when_undone_and_drawn_out_when_applied():
    # A pincushion lens pushes the corners out of the picture; undone they are not known.
    back = LensGeometry(PINCUSHION).undo(PICTURE, VIEW)
    points = (grid() - [WIDTH / 2, HEIGHT / 2]) / FOCAL
    places = PINCUSHION.distorted(points) * FOCAL + [WIDTH / 2, HEIGHT / 2]
    outside = ~within(places, 0)
    assert 0.02 < outside.mean() < 0.5
    assert np.array_equal(np.isnan(back).all(-1), outside) and np.array_equal(np.isnan(back).any(-1), outside)
    # A barrel lens sees farther than the picture: its edge goes on.
    ramp = np.repeat(np.arange(WIDTH, dtype=np.float32)[None, :, None], HEIGHT, 0).repeat(3, 2)
    seen = LensGeometry(BARREL).apply(ramp, VIEW)
    assert seen[60, 0].tolist() == [0, 0, 0] and seen[60, -1].tolist() == [WIDTH - 1] * 3


def test_beside_a_sun_nothing_rings():
    sun = np.full((HEIGHT, WIDTH, 3), 0.1, np.float32)
    sun[40:43, 50:53] = 1e6
    seen = LensGeometry(BARREL, COLOURS).apply(sun, VIEW)
    assert seen.min() >= 0.1 * (1 - 1e-6) and 5e5 < seen.max() <= 1e6


def slow_cubic(picture, x, y):
    """Keys' cubic at one place, the border going on, kept between the four pixels around; (3,)."""
    height, width = picture.shape[:2]
    x, y = np.clip(x - 0.5, 0, width - 1), np.clip(y - 0.5, 0, height - 1)
    j, i = int(x), int(y)

    def weight(distance):
        d = abs(distance)
        if d < 1:
            return 1.5 * d**3 - 2.5 * d**2 + 1
        return -0.5 * d**3 + 2.5 * d**2 - 4 * d + 2 if d < 2 else 0.0

    rows, columns = np.clip(np.arange(i - 1, i + 3), 0, height - 1), np.clip(np.arange(j - 1, j + 3), 0, width - 1)
    across = np.array([weight(x - k) for k in range(j - 1, j + 3)])
    down = np.array([weight(y - k) for k in range(i - 1, i + 3)])
    part = picture[np.ix_(rows, columns)].astype(float)
    around = part[1:3, 1:3].reshape(4, 3)
    return np.clip(np.einsum("i,j,ijc->c", down, across, part), around.min(0), around.max(0))


def test_the_slow_twin_agrees():
    picture = np.random.default_rng(7).random((30, 44, 3)).astype(np.float32)
    view, axis = View(40.0), np.array([22.0, 15.0])
    seen = LensGeometry(BARREL, COLOURS).apply(picture, view)
    points = (grid(44, 30) - axis) / 40
    for channel, scale in ((0, COLOURS.red), (1, RadialScale()), (2, COLOURS.blue)):
        places = BARREL.undistorted(scale.unscaled(points)) * 40 + axis
        expected = [[slow_cubic(picture, *place)[channel] for place in row] for row in places]
        np.testing.assert_allclose(seen[..., channel], expected, atol=2e-3)


def test_no_lens_changes_nothing_and_the_border_may_not_fold():
    assert np.array_equal(LensGeometry().apply(PICTURE, VIEW), PICTURE)
    assert np.array_equal(LensGeometry(Distortion()).apply(PICTURE, VIEW), PICTURE)
    with pytest.raises(ValueError, match="folds over within a picture of 180×120"):
        LensGeometry(Distortion(k1=-0.6)).apply(PICTURE, VIEW)
    assert np.isnan(LensGeometry(Distortion(k1=-2.0)).undo(PICTURE, VIEW)[0, 0]).all()
    with pytest.raises(ValueError, match="centre"):
        LensGeometry(BARREL, centre=(np.nan, 0.5))


def test_a_radius_is_scaled_by_the_polynomial():
    scale = RadialScale(0.01, 0.002, -0.0005)
    # r = 0.5: 0.5 · (1 + 0.01 + 0.002 · 0.25 − 0.0005 · 0.0625) = 0.505234375.
    np.testing.assert_allclose(scale.scaled(np.array([0.3, 0.4])), [0.6 * 0.505234375, 0.8 * 0.505234375], rtol=1e-12)
    np.testing.assert_allclose(scale.scaled(np.array([0.0, 0.0])), 0)


def test_unscaled_is_the_inverse():
    points = np.random.default_rng(1).uniform(-0.7, 0.7, (50, 2))
    for scale in (RadialScale(0.002), RadialScale(-0.003, 0.002, 0.001)):
        np.testing.assert_allclose(scale.unscaled(scale.scaled(points)), points, atol=1e-12)
