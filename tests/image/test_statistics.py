"""What is told of a map's pixels, against NumPy on small maps and by hand on planted ones."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest

from relume.image.colour import luminance
from relume.image.photograph import Photograph
from relume.image.statistics import PERCENTS, Spot, code_values, statistics


def grey(values: object) -> np.ndarray:
    """Pixels whose three channels, and so their luminance, are these values."""
    return np.repeat(np.asarray(values, np.float32)[..., None], 3, axis=-1)


def place(spot: Spot | None) -> tuple[int, int] | None:
    return None if spot is None else (spot.x, spot.y)


def test_percentiles_and_range_are_those_of_the_lit_pixels():
    pixels = np.random.default_rng(1).lognormal(0, 3, (701, 997, 3)).astype(np.float32)
    pixels[::3] = 0
    told, seen = statistics(pixels), luminance(pixels)
    lit = seen[seen > 0]
    assert told.lit == lit.size < seen.size
    wanted = np.percentile(lit, PERCENTS, method="inverted_cdf")
    assert list(told.percentiles) == list(PERCENTS)
    assert list(told.percentiles.values()) == wanted.tolist()
    low, high = np.percentile(lit, (0.1, 99.9), method="inverted_cdf")
    assert told.robust == (low, high)
    assert told.robust_stops == pytest.approx(math.log2(high / low), abs=1e-5)
    assert (told.darkest, told.brightest) == (lit.min(), lit.max())
    assert told.stops == pytest.approx(math.log2(float(lit.max()) / float(lit.min())), abs=1e-5)
    assert (told.minimum, told.maximum) == (0, pixels.max())
    assert told.mean == pytest.approx(pixels.mean(dtype=np.float64), rel=1e-9)
    assert told.mean_luminance == pytest.approx(seen.mean(dtype=np.float64), rel=1e-6)


def test_percentiles_of_a_handful_of_pixels_are_pixels():
    told = statistics(grey([[1, 2, 3, 4]]))
    assert [told.percentiles[percent] for percent in (1, 25, 50, 75, 99.9)] == pytest.approx([1, 1, 2, 3, 4])
    assert told.robust == pytest.approx((1, 4)) and told.stops == pytest.approx(2)


def test_a_range_beyond_what_a_ratio_of_floats_can_hold_is_told_in_stops():
    tiny, huge = np.float32(2.0**-140), np.float32(2.0**120)
    assert statistics(grey([[tiny, huge]])).stops == pytest.approx(260, abs=1e-3)


def test_odd_values_are_counted_and_kept_out_of_everything_else():
    pixels = np.full((40, 30, 3), 2, np.float32)
    pixels[0, 0] = np.nan
    pixels[0, 1] = np.inf, -np.inf, 7
    pixels[39, 29, 1] = -0.5
    told = statistics(pixels)
    assert (told.nan, told.infinite, told.negative) == (3, 2, 1)
    assert (told.minimum, told.maximum, told.at_maximum) == (-0.5, 7, 1)
    assert told.lit == 40 * 30 - 2
    finite = pixels[np.isfinite(pixels)]
    assert told.mean == pytest.approx(finite.mean(dtype=np.float64))
    assert told.brightest == pytest.approx(2) and told.spot is not None
    seen = luminance(pixels[np.isfinite(pixels).all(-1)])
    assert told.mean_luminance == pytest.approx(seen.mean(dtype=np.float64), rel=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_map_of_odd_values_alone_has_nothing_to_tell(value: float):
    told = statistics(grey(np.full((3, 4), value)))
    assert (told.minimum, told.maximum, told.mean, told.mean_luminance) == (None,) * 4
    assert (told.darkest, told.robust, told.stops, told.robust_stops, told.spot, told.lone) == (None,) * 6
    assert (told.lit, told.at_maximum, dict(told.percentiles)) == (0, 0, {})
    assert told.nan + told.infinite == 36


def test_a_black_map_has_values_and_no_light():
    told = statistics(grey(np.zeros((3, 4))))
    assert (told.minimum, told.maximum, told.mean, told.lit, told.stops, told.spot) == (0, 0, 0, 0, None, None)


def test_the_brightest_spot_is_where_it_was_put_with_its_light():
    plane = np.full((60, 90), 0.5)
    plane[41, 70:72] = 900, 1000
    told = statistics(grey(plane))
    assert place(told.spot) == (71, 41)
    assert told.lone is None and told.spot is not None
    assert told.spot.around == pytest.approx((900 + 1000 + 7 * 0.5) / 9)
    assert told.brightest == pytest.approx(1000)


def test_a_lone_pixel_is_told_beside_the_spot_and_does_not_hide_it():
    plane = np.full((60, 90), 0.5)
    plane[41, 70:73] = 90, 100, 90
    plane[7, 8] = 5000
    told = statistics(grey(plane))
    assert place(told.spot) == (71, 41) and place(told.lone) == (8, 7)
    assert told.lone is not None and told.lone.luminance == pytest.approx(5000)
    plane[7, 9] = 5000 / 15
    assert statistics(grey(plane)).lone is None, "a lamp with a glow about it is no lone pixel"


@pytest.mark.parametrize("step", [(0, 1), (1, -1), (1, 0), (1, 1)])
def test_two_bright_pixels_side_by_side_are_a_lamp(step: tuple[int, int]):
    plane = np.full((9, 9), 0.5)
    plane[4, 4] = plane[4 + step[0], 4 + step[1]] = 100
    told = statistics(grey(plane))
    assert told.lone is None and told.spot is not None
    assert told.spot.luminance == pytest.approx(100)


def test_little_memory_is_needed_beside_the_map():
    pixels = np.random.default_rng(5).lognormal(0, 1, (1500, 2000, 3)).astype(np.float32)
    tracemalloc.start()
    statistics(pixels)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < pixels.nbytes / 3 + 12 * 2**20  # a luminance of 4 bytes a pixel, and a band of rows


def test_a_lone_pixel_in_the_dark_is_the_spot_itself():
    plane = np.zeros((9, 9))
    plane[8, 0] = 3
    told = statistics(grey(plane))
    assert place(told.spot) == (0, 8) and told.lone is None


@pytest.mark.parametrize("corner", [(0, 0), (0, 28), (18, 0), (18, 28)])
def test_a_spot_in_a_corner_is_found(corner: tuple[int, int]):
    plane = np.full((20, 30), 0.1)
    y, x = corner
    plane[y : y + 2, x : x + 2] = 8
    told = statistics(grey(plane)).spot
    assert told is not None and told.luminance == pytest.approx(8)
    assert y <= told.y < y + 2 and x <= told.x < x + 2


def test_of_a_clipped_sun_the_middle_is_told():
    y, x = np.mgrid[:200, :300]
    plane = np.where((x - 170) ** 2 + (y - 120) ** 2 <= 15**2, 64.0, 1.0)
    told = statistics(grey(plane))
    assert place(told.spot) == (170, 120)
    assert told.at_maximum == np.count_nonzero(plane == 64) > 600


def test_the_spot_is_the_same_however_wide_the_map_lies():
    """Maps larger than the band that is worked on at a time, against one loop over all pixels."""
    pixels = np.random.default_rng(2).lognormal(0, 2, (1100, 517, 3)).astype(np.float32)
    seen = luminance(pixels)
    padded = np.pad(seen, 1)
    views = [padded[1 + dy : 1101 + dy, 1 + dx : 518 + dx] for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx]
    together = seen <= 16 * np.max(views, axis=0)
    y, x = np.unravel_index(np.where(together, seen, 0).argmax(), seen.shape)
    assert not together.flat[seen.argmax()], "the brightest pixel of this noise stands alone"
    for lying, top in ((pixels, y), (np.ascontiguousarray(pixels[::-1]), 1099 - y)):
        told = statistics(lying)
        assert place(told.spot) == (x, top)
        assert told.lone is not None and told.lone.luminance == seen.max()


def test_a_map_without_pixels_is_refused():
    with pytest.raises(ValueError, match="0 x 0 pixels"):
        statistics(np.zeros((0, 0, 3), np.float32))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_codes_are_counted_as_numpy_counts_them(dtype: type):
    top = np.iinfo(dtype).max
    pixels = np.random.default_rng(3).integers(0, top, (611, 700, 3), dtype, endpoint=True)
    pixels[:100, :, 0], pixels[:50, :, 1] = 0, top
    told = code_values(Photograph(pixels))
    assert (told.top, told.pixels) == (top, 611 * 700)
    assert told.black == tuple((pixels == 0).mean((0, 1))) and told.white == tuple((pixels == top).mean((0, 1)))
    assert (told.minimum, told.maximum) == (pixels.min(), pixels.max())
    assert told.mean == pytest.approx(pixels.mean())
    wanted = np.percentile(pixels, PERCENTS, method="inverted_cdf").tolist()
    assert list(told.percentiles.values()) == wanted


def test_what_is_outside_the_picture_counts_nowhere():
    pixels = np.full((4, 6, 3), 100, np.uint8)
    pixels[:, 3:] = 255
    outside = np.zeros((4, 6), bool)
    outside[:, 3:] = True
    told = code_values(Photograph(pixels, outside=outside))
    assert (told.pixels, told.maximum, told.white) == (12, 100, (0, 0, 0))
    told = code_values(Photograph(pixels, outside=np.ones((4, 6), bool)))
    assert (told.pixels, told.minimum, told.mean, dict(told.percentiles)) == (0, None, None, {})
