"""Detail and colours lost in the dark: what goes, what stays, and what is kept in all."""

import numpy as np
import pytest

from relume.image.primaries import REC709
from relume.virtual_camera.tone.histogram.eye import blur_width, blurred_by_acuity, colours_in_the_dark
from relume.virtual_camera.tone.vision import acuity, scotopic_luminance
from relume.virtual_camera.view import View

VIEW = View(2000.0)
"""35 pixels to a degree: at 0.001 cd/m² a width of 8 pixels."""


def picture(height=60, width=90):
    return np.random.default_rng(3).random((height, width, 3)).astype(np.float32)


def slow_levels(level):
    """Halved by 1, 3, 3, 1 along each axis, the edge going on."""
    while True:
        yield level
        for axis in (0, 1):
            size = level.shape[axis]
            first = 2 * np.arange((size + 1) // 2)
            taps = [level.take(np.clip(first + step, 0, size - 1), axis) for step in (-1, 0, 1, 2)]
            level = (taps[0] + 3 * taps[1] + 3 * taps[2] + taps[3]) / 8


def slow_blur(image, width):
    """The pyramid read at one width above 1 for the whole picture."""
    lower = max(0, int(np.ceil(np.log2(width))) - 1)
    share = width / 2**lower - 1
    result = np.zeros(image.shape)
    for number, level in zip(range(lower + 2), slow_levels(image.astype(float)), strict=False):
        if number < lower:
            continue
        for axis in (0, 1) if number else ():
            place = (np.arange(image.shape[axis]) + 0.5) / 2**number
            middle = np.minimum(place.astype(int), level.shape[axis] - 1)
            t = place - middle - 0.5
            weights = (0.5 - t) ** 2 / 2, 0.75 - t**2, (0.5 + t) ** 2 / 2
            shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
            taps = [level.take(np.clip(middle + step, 0, level.shape[axis] - 1), axis) for step in (-1, 0, 1)]
            level = np.sum([tap * weight.reshape(shape) for tap, weight in zip(taps, weights, strict=True)], axis=0)
        result += (share if number > lower else 1 - share) * level
    return result


def test_what_is_brightly_lit_is_sharp_to_the_bit():
    image = picture()
    seen = blurred_by_acuity(image, VIEW, 1000.0)
    np.testing.assert_array_equal(seen, image)
    assert seen is not image


@pytest.mark.parametrize("luminance", [1e-3, 0.02, 0.15])
def test_the_kernels_agree_with_a_slow_pyramid(luminance):
    image = picture(53, 70)
    width = float(VIEW.focal_length * np.radians(1) / np.sqrt(2) / acuity(np.array(luminance)))
    # Far from the axis a degree has more pixels: here the whole picture is within 1.3°.
    np.testing.assert_allclose(blur_width((53, 70), VIEW, luminance), width, rtol=2e-3)
    np.testing.assert_allclose(blurred_by_acuity(image, VIEW, luminance), slow_blur(image, width), atol=2e-3)


def test_a_grating_at_the_limit_of_acuity_nearly_vanishes_and_a_coarse_one_stays():
    luminance = 0.01
    finest = float(acuity(np.array(luminance)))
    x = np.arange(1200) / (VIEW.focal_length * np.radians(1))

    def remaining(cycles):
        grating = 1 + np.cos(2 * np.pi * cycles * x)
        seen = np.broadcast_to(grating[None, :, None], (9, 1200, 3)).astype(np.float32)
        seen = blurred_by_acuity(seen, VIEW, luminance)
        return float(np.ptp(seen[4, 300:900, 0])) / 2

    assert 0.01 < remaining(finest) < 0.09
    assert remaining(finest / 20) > 0.98


def test_constant_light_stays_to_the_border():
    seen = blurred_by_acuity(np.full((45, 61, 3), 7.0, np.float32), VIEW, 1e-4)
    np.testing.assert_allclose(seen, 7.0, rtol=1e-5)


@pytest.mark.parametrize("size", [(64, 96), (301, 453)])
def test_the_mean_is_kept(size):
    image = picture(*size) ** 4
    seen = blurred_by_acuity(image, VIEW, 1e-3)
    assert seen.std() < 0.2 * image.std()
    np.testing.assert_allclose(seen.mean((0, 1)), image.mean((0, 1)), rtol=1e-5 if size == (64, 96) else 2e-3)


def test_nothing_comes_in_from_the_opposite_border():
    image = np.zeros((64, 64, 3), np.float32)
    image[:, :4] = 1
    assert not blurred_by_acuity(image, VIEW, 1e-3)[:, 48:].any()


def test_a_lamp_stays_sharp_and_its_light_is_not_spread_over_the_dark_beside_it():
    image = np.full((200, 200, 3), 1e-3, np.float32)
    image[::2] *= 3
    image[95:105, 95:105] = 1000
    grid = np.full((6, 6), 2e-3)
    grid[2:4, 2:4] = 90
    seen = blurred_by_acuity(image, VIEW, grid)
    np.testing.assert_array_equal(seen[90:110, 90:110], image[90:110, 90:110])
    assert seen[:60].max() < 3.001e-3
    assert np.ptp(seen[10:30, 100, 0]) < 2e-5  # Of the lines in the dark 1 % remains.


def test_it_may_work_in_place_and_otherwise_leaves_the_picture():
    image = picture()
    before = image.copy()
    seen = blurred_by_acuity(image, VIEW, 1e-3)
    np.testing.assert_array_equal(image, before)
    assert blurred_by_acuity(image, VIEW, 1e-3, out=image) is image
    np.testing.assert_array_equal(image, seen)


def test_the_darkest_adaptation_has_a_finite_blur():
    # The fit of Shlaer's measurements crosses 0 below 2e-4 cd/m²: 1 cycle per degree is the least.
    assert blur_width((50, 50), VIEW, 0.0).max() == pytest.approx(2000 * np.radians(1) / np.sqrt(2), rel=1e-3)


def test_a_sample_is_as_sharp_as_the_sharpest_beside_it():
    grid = np.full((7, 7), 1e-3)
    grid[3, 4] = 100
    width = blur_width((140, 140), VIEW, grid)
    assert np.all(width[2:5, 3:6] < 1)
    width[2:5, 3:6] = 9
    assert width.min() > 7


def test_a_degree_has_more_pixels_off_the_axis():
    # At 45° a pixel of a flat picture covers cos³ 45° of the solid angle of one in the middle.
    view = View(100.0)
    width = blur_width((1, 201), view, np.full((1, 201), 0.01))[0]
    np.testing.assert_allclose(width[199] / width[100], np.cos(np.arctan(0.98)) ** -1.5, rtol=1e-3)


def pixels(seed=0, shape=(6, 9)):
    return np.random.default_rng(seed).random((*shape, 3)).astype(np.float32) * 3


def test_daylight_colours_are_kept_to_the_bit():
    picture = pixels()
    np.testing.assert_array_equal(colours_in_the_dark(picture, 5.63), picture)


def test_in_starlight_all_is_grey_by_the_rods():
    picture = pixels()
    seen = colours_in_the_dark(picture, 5e-3)
    xyz = picture.astype(float) @ REC709.to_xyz().T
    grey = scotopic_luminance(xyz) / scotopic_luminance(REC709.to_xyz().sum(1))
    np.testing.assert_allclose(seen, np.repeat(grey[..., None], 3, -1), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("colour", "grey"), [((1, 0, 0), 0.0329), ((0, 1, 0), 0.7652), ((0, 0, 1), 0.2016), ((2, 2, 2), 2.0)]
)
def test_reds_darken_and_greys_stay(colour, grey):
    # Eq. 13 by hand: red 0.2126·(1.33·(1 + 0.2319/0.4124) − 1.68) = 0.0846, and so on; white is 2.5733.
    picture = np.full((2, 2, 3), colour, np.float32)
    np.testing.assert_allclose(colours_in_the_dark(picture, 0.0), grey, atol=2e-4)


def test_between_the_two_colours_fade_with_the_adaptation():
    picture, dark, light = pixels(), 5.6e-3, 5.62
    seen = colours_in_the_dark(picture, dark + 0.25 * (light - dark))
    night = colours_in_the_dark(picture, 0.0)
    np.testing.assert_allclose(seen, 0.25 * picture + 0.75 * night, rtol=1e-5)


def test_each_place_has_its_own_adaptation():
    picture = pixels(shape=(40, 60))
    grid = np.array([[1e-4, 100.0], [1e-4, 100.0]])
    seen = colours_in_the_dark(picture, grid)
    assert np.ptp(seen[:, :15], axis=-1).max() < 1e-6
    np.testing.assert_array_equal(seen[:, 45:], picture[:, 45:])


def test_colours_may_be_lost_in_place_and_otherwise_leave_the_picture():
    picture = pixels()
    before = picture.copy()
    seen = colours_in_the_dark(picture, 0.1)
    np.testing.assert_array_equal(picture, before)
    assert colours_in_the_dark(picture, 0.1, out=picture) is picture
    np.testing.assert_array_equal(picture, seen)


def test_black_stays_black():
    assert not colours_in_the_dark(np.zeros((3, 4, 3), np.float32), 0.0).any()
