"""Lateral colour: scales of channels that are known are found in edges and undone, and lamps keep their light."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from relume.capture.lens.lateral_colour import LateralColour, recover_lateral_colour, without_lateral_colour
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap

SIZE = (240, 160)
LENS = LateralColour(red=(0.003, 0.004), blue=(-0.002, -0.003))


@cache
def drawn(lateral: LateralColour, seed: int = 0, fine: int = 4) -> np.ndarray:
    """A picture (H, W, 3) of discs of many greys and hues, each channel at its own scale, in boxes of fine pixels.

    Not to be written to: every test gets the same.
    """
    width, height = SIZE
    random = np.random.default_rng(seed)
    discs = [(random.uniform(-130, 130), random.uniform(-90, 90), random.uniform(4, 22), random.uniform(0.05, 3),
              random.uniform(0.8, 1.2, 3)) for _ in range(150)]  # fmt: skip
    x = (np.arange(width * fine) + 0.5) / fine - width / 2
    y = ((np.arange(height * fine) + 0.5) / fine - height / 2)[:, None]
    picture = np.empty((height, width, 3))
    for channel, (a, b) in enumerate((lateral.red, (0.0, 0.0), lateral.blue)):
        # Green's place of what this channel shows here, by repetition.
        shrink = np.ones((height * fine, width * fine))
        for _ in range(20):
            shrink = 1 / (1 + a + b * shrink**2 * (x**2 + y**2) / (np.hypot(width, height) / 2) ** 2)
        plane = np.full(shrink.shape, 0.3)
        for across, down, radius, grey, hue in discs:
            # Only where the disc can be: a few pixels more on each side than the channel's scale moves it.
            rows = slice(*np.searchsorted(y[:, 0], (down - radius - 3, down + radius + 3)))
            columns = slice(*np.searchsorted(x, (across - radius - 3, across + radius + 3)))
            near = shrink[rows, columns]
            inside = np.hypot(x[columns] * near - across, y[rows] * near - down) < radius
            plane[rows, columns][inside] = grey * hue[channel]
        picture[..., channel] = plane.reshape(height, fine, width, fine).mean((1, 3))
    picture.flags.writeable = False
    return picture


def as_map(picture: np.ndarray, variance: np.ndarray | None = None, clipped: np.ndarray | None = None) -> RadianceMap:
    return RadianceMap(picture.astype(np.float32), variance, clipped)


def shift(lateral: LateralColour, other: LateralColour) -> float:
    """The largest distance, pixels, between where two have red or blue, but for the very corners."""
    radius = np.linspace(0, 0.9, 21)
    apart = [radius * ((a - c) + (b - d) * radius**2) for (a, b), (c, d) in
             zip((lateral.red, lateral.blue), (other.red, other.blue), strict=True)]  # fmt: skip
    return float(np.abs(apart).max() * np.hypot(*SIZE) / 2)


def test_the_scales_of_the_channels_are_found_to_a_seventh_of_a_pixel():
    seen = as_map(drawn(LENS))
    assert LENS.at_corner(SIZE)[0] > 0.9  # pixels
    found = recover_lateral_colour(seen)
    assert shift(found, LENS) < 0.15
    noise = np.random.default_rng(1).normal(1, 0.02, (160, 240, 3))
    assert shift(recover_lateral_colour(as_map(drawn(LENS, 2) * noise)), LENS) < 0.25
    # A picture without any is left as it is.
    assert shift(recover_lateral_colour(as_map(drawn(LateralColour()))), LateralColour()) < 0.03


def test_red_and_blue_come_to_lie_on_green():
    seen, true = as_map(drawn(LENS)), drawn(LateralColour())
    fixed = without_lateral_colour(seen, LENS)
    assert np.array_equal(fixed.radiance[..., 1], seen.radiance[..., 1])
    for channel in (0, 2):
        before, after = (np.abs(each.radiance[..., channel] - true[..., channel]).mean() for each in (seen, fixed))
        assert after < 0.6 * before
    assert fixed.attributes["lateral_colour"] == "red +0.003000 +0.004000 blue -0.002000 -0.003000"


def test_a_lamp_gets_no_dark_ring_and_keeps_its_light():
    picture = np.full((160, 240, 3), 0.2)
    picture[20:24, 200:204] = 500
    fixed = without_lateral_colour(as_map(picture), LENS).radiance
    assert fixed.min() == pytest.approx(0.2, rel=1e-6) and fixed.max() <= 500
    assert fixed[..., 0].sum() / picture[..., 0].sum() == pytest.approx(1, abs=0.05)


def test_marks_and_noise_move_with_their_channels():
    clipped = np.zeros((160, 240), np.uint8)
    clipped[8, 12], clipped[100, 3] = SATURATED, OUTSIDE
    variance = np.full((160, 240, 3), 0.01, np.float32)
    variance[8, 12] = np.inf
    fixed = without_lateral_colour(as_map(drawn(LENS), variance=variance, clipped=clipped), LENS)
    assert fixed.clipped is not None and fixed.variance is not None
    # What was saturated stays marked, and so is where red came from there; beyond the picture nothing else is marked.
    marked = np.argwhere(fixed.clipped == SATURATED)
    assert [8, 12] in marked.tolist() and 2 <= len(marked) <= 3 and np.sum(fixed.clipped == OUTSIDE) == 1
    assert np.isinf(fixed.variance[..., 0]).sum() in (2, 4) and np.isinf(fixed.variance[..., 1]).sum() == 1
    assert np.nanmin(fixed.variance[np.isfinite(fixed.variance)]) == pytest.approx(0.01)


def test_what_shows_nothing_is_refused():
    with pytest.raises(ValueError, match="too few edges"):
        recover_lateral_colour(as_map(np.full((160, 240, 3), 0.5)))
    dark = replace(as_map(drawn(LENS)), clipped=np.full((160, 240), SATURATED, np.uint8))
    with pytest.raises(ValueError, match="no pixel is measured"):
        recover_lateral_colour(dark)
    with pytest.raises(ValueError, match=r"red is 0\.5,0"):
        LateralColour(red=(0.5, 0.0))
