"""The weights of blurs: exact for a line, the Gaussian's own shares of pixels, and mirrored at the border."""

import numpy as np
import pytest

from relume.image.blurring import gaussian_taps, line_weights, mirrored_transfer


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
