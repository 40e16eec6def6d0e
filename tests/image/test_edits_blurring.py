"""Motion and soft blur: slow twins, light kept, constants kept, and a streak that stays bright (HDR Shop, Figure 2)."""

from __future__ import annotations

import numpy as np
import pytest

from relume.image.blurring import (
    gaussian_taps,
    line_weights,
    mirrored_transfer,
    motion_blurred,
    soft_blurred,
    streak_kernel,
)
from relume.image.radiance import SATURATED, RadianceMap


def spot(rows: int = 21, columns: int = 31, light: float = 1e5) -> RadianceMap:
    """A dark picture with one very bright pixel in its middle."""
    field = np.full((rows, columns, 3), 1e-3, np.float32)
    field[rows // 2, columns // 2] = light
    return RadianceMap(field)


def naive_streak(length: float, angle: float, half: int, steps: int) -> np.ndarray:
    """A unit square pixel moved along the line in small steps, its area shared among the pixels that it covers."""
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    for time in (np.arange(steps) + 0.5) / steps - 0.5:
        x, y = half + time * length * np.cos(angle), half - time * length * np.sin(angle)
        places = np.arange(2 * half + 1)
        kernel += np.maximum(0, 1 - abs(places[:, None] - y)) * np.maximum(0, 1 - abs(places - x))
    return kernel / steps


@pytest.mark.parametrize(("length", "angle"), [(0.5, 0.0), (5.0, 0.4), (4.3, np.pi / 2), (6.0, 2.5), (4.0, -0.78)])
def test_a_streak_is_the_slow_twin(length: float, angle: float) -> None:
    kernel = streak_kernel(length, angle)
    half = 5
    whole = np.zeros((2 * half + 1, 2 * half + 1))
    rows, columns = (side // 2 for side in kernel.shape)
    whole[half - rows : half + rows + 1, half - columns : half + columns + 1] = kernel
    assert kernel.sum() == pytest.approx(1, abs=1e-14)
    assert np.abs(whole - naive_streak(length, angle, half, 2000)).max() < 2e-4


def test_a_level_streak_of_three_pixels() -> None:
    kernel = streak_kernel(3.0, 0.0)
    assert kernel.shape == (1, 5) and kernel[0] * 24 == pytest.approx([1, 7, 8, 7, 1], abs=1e-12)
    assert streak_kernel(0.0, 0.3).tolist() == [[1.0]]


def test_the_angle_turns_anticlockwise() -> None:
    slanted = motion_blurred(spot(), 8, np.radians(45)).radiance[..., 0]
    assert slanted[8, 17] > 1e3 and slanted[8, 13] < 1


@pytest.mark.parametrize("angle", [0.0, np.pi / 2])
def test_motion_keeps_the_mean_whatever_stands_at_the_border(angle: float) -> None:
    field = np.random.default_rng(2).random((20, 30, 3)).astype(np.float32)
    field[0, 0] = field[10, 29] = 1e4
    blurred = motion_blurred(RadianceMap(field), 33.3, angle).radiance
    assert blurred.mean((0, 1), dtype=np.float64) == pytest.approx(field.mean((0, 1), dtype=np.float64), rel=1e-7)


def test_slanted_motion_keeps_the_mean_away_from_corners_and_constants_everywhere() -> None:
    picture = spot(41, 41)
    blurred = motion_blurred(picture, 12, 0.7).radiance
    assert blurred.mean(dtype=np.float64) == pytest.approx(picture.radiance.mean(dtype=np.float64), rel=1e-7)
    constant = RadianceMap(np.full((9, 7, 3), 0.3, np.float32))
    assert np.abs(motion_blurred(constant, 11, 0.7).radiance - np.float32(0.3)).max() < 1e-7


def test_a_blurred_highlight_stays_bright_where_a_display_would_have_greyed_it() -> None:
    """HDR Shop sketch, Figure 2: the same streak from the picture that a display clips is a fiftieth as bright."""
    picture = spot(light=50.0)
    clipped = RadianceMap(np.minimum(picture.radiance, np.float32(1)))
    streak = motion_blurred(picture, 20).radiance[10, 10:20, 0]
    grey = motion_blurred(clipped, 20).radiance[10, 10:20, 0]
    assert streak == pytest.approx(np.full(10, 50 / 20 + 1e-3 * 19 / 20), rel=1e-5)
    assert grey == pytest.approx(np.full(10, 1 / 20 + 1e-3 * 19 / 20), rel=1e-5)
    assert np.minimum(streak, 1).min() == 1


def naive_gauss(field: np.ndarray, sigma: float) -> np.ndarray:
    """Weights that are the Gaussian's integrals over pixels, one by one, the border mirrored."""
    from math import erf, sqrt

    reach = int(9 * sigma) + 3
    taps = [erf((k + 0.5) / (sigma * sqrt(2))) - erf((k - 0.5) / (sigma * sqrt(2))) for k in range(-reach, reach + 1)]
    padded = np.pad(field.astype(np.float64), [(reach, reach), (reach, reach), (0, 0)], mode="symmetric")
    rows, columns = field.shape[:2]
    tall = sum(tap * padded[k : k + rows] for k, tap in enumerate(taps))
    wide = sum(tap * np.asarray(tall)[:, k : k + columns] for k, tap in enumerate(taps))
    return np.asarray(wide) / sum(taps) ** 2


@pytest.mark.parametrize("sigma", [0.1, 0.7, 3.0, 15.0])
def test_soft_blur_is_the_slow_twin_and_keeps_the_mean(sigma: float) -> None:
    field = np.random.default_rng(4).random((12, 17, 3)).astype(np.float32)
    field[0, 3] = 1e3
    made = soft_blurred(RadianceMap(field), sigma).radiance
    assert np.abs(made - naive_gauss(field, sigma)).max() < 1e-7 * made.max() + 1e-7
    assert made.mean((0, 1), dtype=np.float64) == pytest.approx(field.mean((0, 1), dtype=np.float64), rel=1e-7)


def test_soft_blur_follows_a_bright_light_far_out_and_never_below_zero() -> None:
    made = soft_blurred(spot(61, 61, 1e6), 4.0).radiance[30, :, 0]
    expected = 1e6 / (2 * np.pi * 16) * np.exp(-((np.arange(61.0) - 30) ** 2) / (2 * (16 + 1 / 12)))
    assert made[8:30] == pytest.approx(expected[8:30] + 1e-3, rel=0.04)
    assert made.min() > 0


def test_soft_focus_is_a_mixture() -> None:
    picture = spot(light=100.0)
    sharp, soft = picture.radiance, soft_blurred(picture, 2.0).radiance
    np.testing.assert_allclose(soft_blurred(picture, 2.0, share=0.3).radiance, 0.7 * sharp + 0.3 * soft, rtol=1e-6)
    assert np.array_equal(soft_blurred(picture, 2.0, share=0.0).radiance, sharp)
    np.testing.assert_allclose(soft_blurred(picture, 0.0).radiance, sharp, rtol=1e-6)


@pytest.mark.parametrize("blur", ["motion", "soft", "soft focus"])
def test_variance_is_that_of_the_weighted_sum(blur: str) -> None:
    """Against the spread of the blurred noise itself, far from the border, to 4 σ of so many pixels."""
    noise = np.random.default_rng(6).normal(100, 2, (240, 240, 3)).astype(np.float32)
    picture = RadianceMap(noise, np.full(noise.shape, 4.0, np.float32))
    made = {
        "motion": lambda: motion_blurred(picture, 5.0, 0.5),
        "soft": lambda: soft_blurred(picture, 1.0),
        "soft focus": lambda: soft_blurred(picture, 1.0, share=0.5),
    }[blur]()
    assert made.variance is not None
    said = float(made.variance[120, 120, 0])
    assert said < 4
    # Neighbours are correlated over some ten pixels, so fewer count.
    assert float(made.radiance[20:-20, 20:-20].var()) == pytest.approx(said, rel=4 * np.sqrt(2 * 10 / (3 * 200**2)))


def test_what_a_clipped_light_reaches_is_a_lower_bound() -> None:
    picture = spot()
    marks = np.zeros((21, 31), np.uint8)
    marks[10, 15] = SATURATED
    made = motion_blurred(RadianceMap(picture.radiance, None, marks), 6.0).clipped
    assert made is not None
    assert made[10].tolist() == [0] * 12 + [SATURATED] * 7 + [0] * 12
    assert made.sum() == 7 * SATURATED


def test_blurs_that_cannot_be_are_refused() -> None:
    picture = spot()
    for length in (-1.0, 40.0, np.nan):
        with pytest.raises(ValueError, match="length"):
            motion_blurred(picture, length)
    with pytest.raises(ValueError, match="angle"):
        motion_blurred(picture, 3, np.inf)
    for sigma in (-1.0, 32.0, np.nan):
        with pytest.raises(ValueError, match="sigma"):
            soft_blurred(picture, sigma)
    with pytest.raises(ValueError, match="share"):
        soft_blurred(picture, 1, share=1.5)
    picture.radiance[3, 3, 1] = np.inf
    with pytest.raises(ValueError, match="1 pixels are NaN or infinite"):
        soft_blurred(picture, 1)


def test_the_weights_of_a_level_line_are_the_tents_time_within_it():
    # Of a length of 3 the middle and its neighbours see 1, 1 and 1 less an eighth, the next ones an eighth.
    rows, columns, weights = line_weights(3.0, 0.0)
    np.testing.assert_array_equal(rows, 0)
    np.testing.assert_array_equal(columns, [-2, -1, 0, 1, 2])
    np.testing.assert_allclose(weights, np.array([1, 7, 8, 7, 1]) / 24)
    # Along the diagonal of a pixel, from (−½, −½) to (½, ½): ∫ (1 − |t|)² and ∫ t (1 − t) over it.
    rows, columns, weights = line_weights(1.0, 1.0)
    grid = np.zeros((3, 3))
    grid[rows + 1, columns + 1] = weights
    np.testing.assert_allclose(grid, np.array([[1, 2, 0], [2, 14, 2], [0, 2, 1]]) / 24)
    assert [part.tolist() for part in line_weights(0.0, 0.0)] == [[0], [0], [1.0]]


def test_light_that_comes_and_goes_evenly_is_a_tent():
    # A triangle 2 pixels wide is a tent: its product with the pixel's own, integrated, is 1/6, 2/3, 1/6.
    rows, columns, weights = line_weights(0.0, 2.0, lambda times: 2 - 4 * np.abs(times), (-0.5, 0.0, 0.5))
    np.testing.assert_array_equal(rows, [-1, 0, 1])
    np.testing.assert_array_equal(columns, 0)
    np.testing.assert_allclose(weights, [1 / 6, 2 / 3, 1 / 6])


def test_a_gaussians_taps_are_its_shares_of_pixels():
    taps = gaussian_taps(1.0)
    # Φ(½) − Φ(−½), Φ(1½) − Φ(½), Φ(2½) − Φ(1½)
    assert taps[:3] == pytest.approx([0.38292492, 0.24173034, 0.06059754], abs=1e-8)
    assert taps[0] + 2 * taps[1:].sum() == pytest.approx(1, abs=1e-15) and taps.min() >= 0
    assert gaussian_taps(0.0).tolist() == [1.0]


@pytest.mark.parametrize("size", [1, 5, 40])
def test_the_transfer_is_that_of_the_mirrored_line(size):
    taps = gaussian_taps(2.0)
    whole = np.concatenate([taps[:0:-1], taps])
    for wave, factor in enumerate(mirrored_transfer(taps, size)):
        line = np.cos(np.pi * wave * (np.arange(size) + 0.5) / size)
        blurred = np.convolve(np.pad(line, len(taps) - 1, mode="symmetric"), whole, "valid")
        np.testing.assert_allclose(blurred, factor * line, atol=1e-12)
