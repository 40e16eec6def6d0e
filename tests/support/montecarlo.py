"""Statements about noisy pictures that can be false: z-tests on means and on single pixels."""

from __future__ import annotations

import numpy as np
from scipy import stats

from relume.renderers.results import Change, Render

LIMIT = 4.0
"""Standard errors a mean may lie from the truth: beyond 4 once in 16 000 correct runs, and seeds are fixed."""


def assert_mean_agrees(radiance: np.ndarray, variance: np.ndarray, truth: np.ndarray | float, *, near: float = 0.0):
    """The mean over pixels (…, 3) lies within `LIMIT` standard errors of the truth's, channel by channel.

    variance : of the pixels' values, which are independent
    near : share of the truth allowed on top, for what the test knows to be approximate
    """
    pixels, spread = radiance.reshape(-1, 3).astype(np.float64), variance.reshape(-1, 3).astype(np.float64)
    expected = np.broadcast_to(truth, radiance.shape).reshape(-1, 3).mean(0)
    error = np.sqrt(spread.sum(0)) / len(pixels)
    # float32 pixels: 1e-6 of the value is rounding, and a picture without noise has nothing else.
    allowed = LIMIT * error + (near + 1e-6) * np.abs(expected)
    found = pixels.mean(0)
    assert np.all(np.abs(found - expected) <= allowed), f"mean {found}, expected {expected} ± {allowed}"


def assert_matte_of_disc(matte: np.ndarray, radius: float, middle: tuple[float, float], allowed: float):
    """A square picture's matte sums to the area of a disc, is whole inside, nothing outside, and mixed at its rim.

    middle : row and column of the disc's middle from the picture's, pixels
    allowed : how far the sum may be from the area, pixels
    """
    assert abs(matte.sum() - np.pi * radius**2) <= allowed
    from_middle = np.hypot(*(np.indices(matte.shape) + 0.5 - len(matte) / 2 - np.reshape(middle, (2, 1, 1))))
    assert np.all(matte[from_middle < radius - 1] == 1)
    assert np.all(matte[from_middle > radius + 1] == 0)
    edge = matte[np.abs(from_middle - radius) < 0.3]
    assert np.mean((edge > 0) & (edge < 1)) > 0.9


def assert_renders_agree(one: Render, other: Render):
    """Two renders of one scene from independent seeds: their means differ by no more than their noise."""
    assert_mean_agrees(one.radiance, one.variance + other.variance, other.radiance)


def assert_pixels_agree(
    radiance: np.ndarray, variance: np.ndarray, truth: np.ndarray, *, passes: int, rounding: float = 1e-5
):
    """Every pixel agrees with the truth, at one chance in a thousand that any of a correct picture's does not.

    Šidák's correction for the number of values; Student's t because each variance comes from `passes` pictures.
    rounding : share of the picture's brightest value below which differences are float32's
    """
    level = 1 - (1 - 1e-3) ** (1 / radiance.size)
    limit = stats.t.isf(level / 2, passes - 1)
    error = np.abs(radiance.astype(np.float64) - truth)
    # A variance that few passes happened to estimate far too low is brought up to half of its neighbourhood's.
    floor = 0.5 * float(variance.mean()) if variance.any() else 0.0
    allowed = limit * np.sqrt(np.maximum(variance, floor)) + rounding * np.abs(truth).max()
    worst = np.unravel_index(int(np.argmax(error - allowed)), error.shape)
    assert np.all(error <= allowed), f"pixel {worst}: {radiance[worst]}, expected {truth[worst]} ± {allowed[worst]}"


def assert_change_is_the_difference(change: Change, with_: Render, without: Render, *, most: float):
    """A change is what two whole pictures differ by, and its objects are the picture's: in the mean and pixel by pixel.

    most : share of the mean that its standard error may be, so that the comparison says something

    Both measures of a pixel must be below 3.5 in 98 of 100: the mean of its channels' deviations, and the mean of its
    differences over that of the deviations. A variance that few paths happened to estimate far too low is brought up
    to 0.3 of the picture's.
    """
    for where, found, expected, spread in (
        (change.matte == 0, change.difference, with_.radiance - without.radiance, with_.variance + without.variance),
        (change.matte == 1, change.objects, with_.radiance, with_.variance),
    ):
        noise = change.difference_variance + change.objects_variance + spread
        error = np.sqrt(noise[where].sum(0)) / where.sum()
        gap = np.abs(found[where].mean(0) - expected[where].mean(0))
        assert np.all(error < most * np.abs(expected[where]).mean()), error
        assert np.all(gap < 4.5 * error), (gap, error)
        off, deviation = np.abs(found - expected)[where], np.sqrt(np.maximum(noise, 0.3 * noise[where].mean(0)))[where]
        for pixels in ((off / deviation).mean(-1), off.mean(-1) / deviation.mean(-1)):
            assert np.mean(pixels < 3.5) > 0.98, np.sort(pixels)
