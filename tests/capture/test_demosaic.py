"""Colours from a mosaic: exact where the scene is plain, sharper than averaging, without new extremes, honest noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import convolve

from relume.capture.raw.demosaic import developed_mosaic
from relume.image.radiance import BLACK, SATURATED

PATTERNS = [((0, 1), (1, 2)), ((2, 1), (1, 0)), ((1, 0), (2, 1)), ((1, 2), (0, 1))]
INNER = (slice(3, -3), slice(3, -3))


def demosaic(mosaic: np.ndarray, pattern: np.ndarray) -> np.ndarray:
    """The colours (H, W, 3) float32 of a mosaic (H, W) whose channels are balanced; the borders are mirrored.

    pattern : (2, 2) int, the channel of the photosites at even and odd rows and columns
    """
    height, width = mosaic.shape
    exact, measured = np.zeros((1, 1), np.float32), np.zeros((height, width), np.uint8)
    colours, _, _ = developed_mosaic(mosaic, exact, measured, pattern, np.ones(3), np.eye(3))
    return colours


def channels_of(pattern: object, shape: tuple[int, int]) -> np.ndarray:
    y, x = np.indices(shape)
    return np.asarray(pattern)[y % 2, x % 2]


def mosaicked(colours: np.ndarray, pattern: object) -> np.ndarray:
    return np.take_along_axis(colours, channels_of(pattern, colours.shape[:2])[..., None], 2)[..., 0]


def bilinear(mosaic: np.ndarray, pattern: object) -> np.ndarray:
    """The mean of the nearest samples of each colour, written as convolutions."""
    channels, result = channels_of(pattern, mosaic.shape), []
    for channel in range(3):
        beside, corner = (0.25, 0.0) if channel == 1 else (0.5, 0.25)
        weights = np.array([[corner, beside, corner], [beside, 1, beside], [corner, beside, corner]])
        result.append(convolve(np.where(channels == channel, mosaic, 0.0), weights, mode="mirror"))
    return np.stack(result, axis=-1)


def details(size: int = 160) -> np.ndarray:
    """Fine neutral rings with a slow change of colour, between 0.1 and 1, as most real detail is."""
    y, x = np.mgrid[:size, :size] / size
    rings = 0.55 + 0.4 * np.cos(140 * (x**2 + y**2))
    return rings[..., None] * np.stack([0.7 + 0.3 * x, np.ones_like(x), 1 - 0.4 * y], axis=-1)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_one_colour_comes_back_exactly(pattern):
    colours = np.broadcast_to([0.2, 0.7, 3.0], (20, 22, 3))
    np.testing.assert_allclose(demosaic(mosaicked(colours, pattern), np.array(pattern)), colours, rtol=1e-6)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_ramps_of_every_colour_come_back_exactly(pattern):
    y, x = np.mgrid[:24, :26]
    colours = np.stack([5 + 0.2 * x + 0.1 * y, 9 - 0.3 * x + 0.2 * y, 4 + 0.05 * x - 0.1 * y], axis=-1)
    found = demosaic(mosaicked(colours, pattern), np.array(pattern))
    np.testing.assert_allclose(found[INNER], colours[INNER], rtol=1e-5)


def test_the_filters_are_the_papers():
    # Malvar, He & Cutler 2004, figure 2: what a lone photosite of 8 over a large pedestal adds to its surroundings.
    pattern = np.array(PATTERNS[0])
    for place, channel, expected in [
        # A red photosite, seen in green: 4 at itself, −1 at the red ones two away; in blue: 6 at itself, −1.5.
        ((6, 6), 1, {(6, 6): 4, (6, 7): 0, (6, 8): -1, (8, 6): -1, (7, 7): 0}),
        ((6, 6), 2, {(6, 6): 6, (6, 8): -1.5, (8, 6): -1.5, (6, 7): 0.0, (7, 7): 0}),
        # In red: itself, half beside and a quarter diagonal: (4, 4, 2) / 8 of it.
        ((6, 6), 0, {(6, 6): 8, (6, 7): 4, (7, 6): 4, (7, 7): 2, (6, 8): 0}),
        # A green photosite in a red row, seen in red: 5 at itself, −1 at the greens beside and diagonal, 0.5 across.
        ((6, 7), 0, {(6, 7): 5, (6, 9): -1, (8, 7): 0.5, (7, 8): -1, (6, 8): 0}),
        ((6, 7), 2, {(6, 7): 5, (6, 9): 0.5, (8, 7): -1, (7, 8): -1}),
        ((6, 7), 1, {(6, 7): 8, (6, 8): 2, (7, 7): 2, (6, 9): 0, (7, 8): 0}),
    ]:
        mosaic = np.full((14, 14), 100.0, np.float32)
        mosaic[place] += 8
        # Noise enough that nothing is taken back to the range of its neighbours.
        noisy = np.full((14, 14), 1e4, np.float32)
        none = np.zeros((14, 14), np.uint8)
        colours, _, _ = developed_mosaic(mosaic, noisy, none, pattern, np.ones(3), np.eye(3))
        for (y, x), added in expected.items():
            assert colours[y, x, channel] - 100 == pytest.approx(added, abs=1e-4), (place, channel, (y, x))


@pytest.mark.parametrize("pattern", PATTERNS)
def test_detail_is_nearer_the_truth_than_by_averaging(pattern):
    scene = details()
    mosaic = mosaicked(scene, pattern)
    errors = [
        np.mean((found - scene)[INNER] ** 2)
        for found in (demosaic(mosaic, np.array(pattern)), bilinear(mosaic, pattern))
    ]
    corrected, averaged = (-10 * np.log10(error) for error in errors)
    assert corrected > averaged + 4  # dB; the paper finds 5.5 dB on photographs


def test_a_bright_edge_neither_rings_nor_goes_negative():
    scene = np.full((40, 40, 3), 0.01)
    scene[:, 20:] = [5000, 4000, 6000]
    scene[10, 5] = 20_000
    found = demosaic(mosaicked(scene, PATTERNS[0]), np.array(PATTERNS[0]))
    assert found.min() >= 0.01 * (1 - 1e-6)
    for channel in range(3):
        assert found[..., channel].max() <= scene[..., channel].max()
    # The paper's own filter would fall to −500 beside that edge.
    assert found[20, 18:22].max() <= 6000


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("coloured", [False, True])
def test_the_variance_is_that_of_the_interpolated_channels(pattern, coloured):
    generator, shape = np.random.default_rng(2), (300, 300)
    balance = np.array([2.0, 1.0, 1.5]) if coloured else np.ones(3)
    matrix = np.array([[1.7, -0.8, 0.1], [-0.2, 1.6, -0.4], [0.0, -0.5, 1.5]]) if coloured else np.eye(3)
    variance = np.where(channels_of(pattern, shape) == 1, 0.04, 0.01).astype(np.float32)
    mosaic = (10 / balance[channels_of(pattern, shape)] + generator.normal(0, np.sqrt(variance))).astype(np.float32)
    none = np.zeros(shape, np.uint8)
    colours, spread, mask = developed_mosaic(mosaic, variance, none, np.array(pattern), balance, matrix)
    assert not mask.any()
    residual = ((colours - 10) / np.sqrt(spread))[INNER]
    # 9 · 10⁴ values, each sharing photosites with about ten others.
    np.testing.assert_allclose(residual.var((0, 1)), 1, atol=0.04)
    np.testing.assert_allclose(residual.mean((0, 1)), 0, atol=0.02)
    y, x = np.indices(shape)
    for site in range(4):
        of_site = (2 * (y % 2) + x % 2)[INNER] == site
        np.testing.assert_allclose(residual[of_site].var(0), 1, atol=0.06)


def saturated(colour: tuple[float, float, float], level: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A flat patch of a camera colour cut at `level`, in the middle of a dim picture, developed."""
    balance = np.array([2.0, 1.0, 1.5])
    scene = np.full((24, 24, 3), 0.05)
    scene[8:16, 8:16] = colour
    mosaic = mosaicked(np.minimum(scene, level), PATTERNS[0]).astype(np.float32)
    clipped = np.where(mosaic >= level, SATURATED, 0).astype(np.uint8)
    variance = np.full(mosaic.shape, 1e-8, np.float32)
    return developed_mosaic(mosaic, variance, clipped, np.array(PATTERNS[0]), balance, np.eye(3))


@pytest.mark.parametrize(
    "colour, expected",
    [
        pytest.param((3.0, 3.0, 3.0), [1.0, 1.0, 1.0], id="all: neutral, at the level all reached"),
        # A neutral light of 1.4: balanced, red and blue read 1.4, and green is cut at 1.
        pytest.param((0.7, 1.4, 1.4 / 1.5), [1.0, 1.0, 1.0], id="green alone: not pink"),
        pytest.param((1.5, 0.3, 0.1), [2.0, 0.3, 0.15], id="red alone: a red lamp stays red"),
    ],
)
def test_light_that_saturates_some_channels_keeps_a_colour_that_can_be(colour, expected):
    colours, spread, mask = saturated(colour)
    rtol = 1e-7 if expected[0] == 1.0 else 1e-5
    np.testing.assert_allclose(colours[10:14, 10:14], np.broadcast_to(expected, (4, 4, 3)), rtol=rtol)
    assert (mask[10:14, 10:14] == SATURATED).all() and np.isinf(spread[10:14, 10:14]).all()


def test_only_pixels_whose_nearest_samples_are_saturated_are_masked():
    mosaic, clipped = np.ones((12, 12), np.float32), np.zeros((12, 12), np.uint8)
    clipped[6, 6] = SATURATED
    variance = np.full((12, 12), 0.01, np.float32)
    _, spread, mask = developed_mosaic(mosaic, variance, clipped, np.array(PATTERNS[0]), np.ones(3), np.eye(3))
    expected = np.zeros((12, 12), np.uint8)
    expected[5:8, 5:8] = SATURATED
    np.testing.assert_array_equal(mask, expected)
    np.testing.assert_array_equal(np.isinf(spread).all(-1), mask != 0)
    assert np.isfinite(spread[mask == 0]).all()
    # The red photosite two away, whose correction would use it: itself, green of four, blue of four.
    np.testing.assert_allclose(spread[6, 8], [0.01, 0.0025, 0.0025], rtol=1e-5)
    clipped[6, 7] = BLACK
    _, _, mask = developed_mosaic(mosaic, variance, clipped, np.array(PATTERNS[0]), np.ones(3), np.eye(3))
    # Green's nearest samples of a green photosite are itself alone: the one diagonal to (6, 7) does not use it.
    assert mask[6, 6] == SATURATED
    assert mask[6, 8] == BLACK
