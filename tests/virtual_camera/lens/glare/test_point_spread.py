"""Point spreads in polar coordinates: drawn as they are reported, and the same when turned by half a turn."""

import numpy as np
import pytest

from relume.virtual_camera.lens.glare.convolution import Canvas
from relume.virtual_camera.lens.glare.point_spread import (
    SAMPLES,
    PolarSpread,
    pattern_at,
    pixel_means,
    seen_by_pixels,
    table_distances,
    within_pixel,
)

REACH = 90.0


def spread() -> PolarSpread:
    random = np.random.default_rng(2)
    radial = (1 / (1 + table_distances(REACH, SAMPLES)) ** 2 * np.array([[1], [2], [3]])).astype(np.float32)
    pattern = random.random((3, 12, 64)).astype(np.float32)
    near = random.random((3, 7, 7)).astype(np.float32)
    near = near + near[:, ::-1, ::-1]
    near[:, 3, 3] = 0
    return PolarSpread(np.array([0.1, 0.2, 0.3]), radial, pattern, near, REACH)


def test_rows_are_drawn_as_the_tables_say():
    given = spread()
    drawn = given.draw(30, 40)
    y, x = np.mgrid[-30:31, -40:41].astype(np.float64)
    for channel in range(3):
        # The slow twin.
        distance = np.hypot(x, y)
        mean = np.interp(distance**0.25, table_distances(REACH, SAMPLES) ** 0.25, given.radial[channel])
        expected = mean * pattern_at(given.pattern[channel], REACH, x, y)
        expected[27:34, 37:44] = given.near[channel]
        expected[30, 40] = given.kept[channel]
        assert np.abs(drawn[..., channel] / expected - 1).max() < 5e-4


def test_half_a_turn_changes_nothing():
    drawn = spread().draw(30, 40)
    assert np.array_equal(drawn[1:, 1:], drawn[::-1, ::-1][:-1, :-1]) or np.array_equal(drawn, drawn[::-1, ::-1])
    row = spread().rows(0, 0, 1, Canvas(2, 20))[0]
    assert np.allclose(row[1:20], row[:-20:-1], rtol=1e-6)


def test_what_is_convolved_elsewhere_is_left_out():
    canvas = Canvas(31, 41)
    whole, rest = (spread().rows(1, 0, 31, canvas, hole=hole) for hole in (-1, 16))
    assert not rest[:17, :17].any() and not rest[:17, -16:].any()
    assert np.array_equal(rest[17:], whole[17:]) and np.array_equal(rest[:, 17:-16], whole[:, 17:-16])


@pytest.mark.parametrize("core", [0.01, 0.5, 3.0])
def test_light_within_a_pixel_is_its_integral(core):
    # ∬ over a square of side 2 a of (x² + y² + c²)^(−3/2) is (4 / c) arctan(a² / (c √(2 a² + c²))).
    a = 0.5
    expected = 4 / core * np.arctan(a**2 / (core * np.sqrt(2 * a**2 + core**2)))
    assert within_pixel(lambda r: (r**2 + core**2) ** -1.5) == pytest.approx(expected, rel=1e-5)


def test_a_pixels_mean_is_not_its_middles_value():
    r = np.array([10.0, 30.0])
    # ∇² r⁻³ = 9 r⁻⁵
    assert pixel_means(lambda r: r**-3.0, r) == pytest.approx(r**-3 + 9 / 24 * r**-5, rel=1e-5)


def test_a_pixel_sees_the_mean_of_the_rays_that_it_covers():
    pattern = np.zeros((3, 512))
    pattern[:, 100] = 512.0
    seen = seen_by_pixels(pattern, np.array([0.1, 8.0, 1e6]))
    assert seen.mean(1) == pytest.approx(np.ones(3), abs=0.05)
    assert np.ptp(seen[0]) < 1e-9 and seen[2, 100] == pytest.approx(512, rel=1e-3)
    # 1/8 radian is 20 of the 512 steps.
    assert seen[1, 95:106].min() > 20 and seen[1, 120:].max() < 3
