"""What is reported of a map's pixels, against NumPy on small maps and by hand on planted ones."""

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
    said, seen = statistics(pixels), luminance(pixels)
    lit = seen[seen > 0]
    assert said.lit == lit.size < seen.size
    wanted = np.percentile(lit, PERCENTS, method="inverted_cdf")
    assert list(said.percentiles) == list(PERCENTS)
    assert list(said.percentiles.values()) == wanted.tolist()
    low, high = np.percentile(lit, (0.1, 99.9), method="inverted_cdf")
    assert said.robust == (low, high)
    assert said.robust_stops == pytest.approx(math.log2(high / low), abs=1e-5)
    assert (said.darkest, said.brightest) == (lit.min(), lit.max())
    assert said.stops == pytest.approx(math.log2(float(lit.max()) / float(lit.min())), abs=1e-5)
    assert (said.minimum, said.maximum) == (0, pixels.max())
    assert said.mean == pytest.approx(pixels.mean(dtype=np.float64), rel=1e-9)
    assert said.mean_luminance == pytest.approx(seen.mean(dtype=np.float64), rel=1e-6)


def test_percentiles_of_a_handful_of_pixels_are_pixels():
    said = statistics(grey([[1, 2, 3, 4]]))
    assert [said.percentiles[percent] for percent in (1, 25, 50, 75, 99.9)] == pytest.approx([1, 1, 2, 3, 4])
    assert said.robust == pytest.approx((1, 4)) and said.stops == pytest.approx(2)


def test_a_range_beyond_what_a_ratio_of_floats_can_hold_is_reported_in_stops():
    tiny, huge = np.float32(2.0**-140), np.float32(2.0**120)
    assert statistics(grey([[tiny, huge]])).stops == pytest.approx(260, abs=1e-3)


def test_odd_values_are_counted_and_kept_out_of_everything_else():
    pixels = np.full((40, 30, 3), 2, np.float32)
    pixels[0, 0] = np.nan
    pixels[0, 1] = np.inf, -np.inf, 7
    pixels[39, 29, 1] = -0.5
    said = statistics(pixels)
    assert (said.nan, said.infinite, said.negative) == (3, 2, 1)
    assert (said.minimum, said.maximum, said.at_maximum) == (-0.5, 7, 1)
    assert said.lit == 40 * 30 - 2
    finite = pixels[np.isfinite(pixels)]
    assert said.mean == pytest.approx(finite.mean(dtype=np.float64))
    assert said.brightest == pytest.approx(2) and said.spot is not None
    seen = luminance(pixels[np.isfinite(pixels).all(-1)])
    assert said.mean_luminance == pytest.approx(seen.mean(dtype=np.float64), rel=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_map_of_odd_values_alone_has_nothing_to_say(value: float):
    said = statistics(grey(np.full((3, 4), value)))
    assert (said.minimum, said.maximum, said.mean, said.mean_luminance) == (None,) * 4
    assert (said.darkest, said.robust, said.stops, said.robust_stops, said.spot, said.lone) == (None,) * 6
    assert (said.lit, said.at_maximum, dict(said.percentiles)) == (0, 0, {})
    assert said.nan + said.infinite == 36


def test_a_black_map_has_values_and_no_light():
    said = statistics(grey(np.zeros((3, 4))))
    assert (said.minimum, said.maximum, said.mean, said.lit, said.stops, said.spot) == (0, 0, 0, 0, None, None)


def test_the_brightest_spot_is_where_it_was_put_with_its_light():
    plane = np.full((60, 90), 0.5)
    plane[41, 70:72] = 900, 1000
    said = statistics(grey(plane))
    assert place(said.spot) == (71, 41)
    assert said.lone is None and said.spot is not None
    assert said.spot.around == pytest.approx((900 + 1000 + 7 * 0.5) / 9)
    assert said.brightest == pytest.approx(1000)


def test_a_lone_pixel_is_reported_beside_the_spot_and_does_not_hide_it():
    plane = np.full((60, 90), 0.5)
    plane[41, 70:73] = 90, 100, 90
    plane[7, 8] = 5000
    said = statistics(grey(plane))
    assert place(said.spot) == (71, 41) and place(said.lone) == (8, 7)
    assert said.lone is not None and said.lone.luminance == pytest.approx(5000)
    plane[7, 9] = 5000 / 15
    assert statistics(grey(plane)).lone is None, "a lamp with a glow about it is no lone pixel"


@pytest.mark.parametrize("step", [(0, 1), (1, -1), (1, 0), (1, 1)])
def test_two_bright_pixels_side_by_side_are_a_lamp(step: tuple[int, int]):
    plane = np.full((9, 9), 0.5)
    plane[4, 4] = plane[4 + step[0], 4 + step[1]] = 100
    said = statistics(grey(plane))
    assert said.lone is None and said.spot is not None
    assert said.spot.luminance == pytest.approx(100)


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
    said = statistics(grey(plane))
    assert place(said.spot) == (0, 8) and said.lone is None


@pytest.mark.parametrize("corner", [(0, 0), (0, 28), (18, 0), (18, 28)])
def test_a_spot_in_a_corner_is_found(corner: tuple[int, int]):
    plane = np.full((20, 30), 0.1)
    y, x = corner
    plane[y : y + 2, x : x + 2] = 8
    said = statistics(grey(plane)).spot
    assert said is not None and said.luminance == pytest.approx(8)
    assert y <= said.y < y + 2 and x <= said.x < x + 2


def test_of_a_clipped_sun_the_middle_is_reported():
    y, x = np.mgrid[:200, :300]
    plane = np.where((x - 170) ** 2 + (y - 120) ** 2 <= 15**2, 64.0, 1.0)
    said = statistics(grey(plane))
    assert place(said.spot) == (170, 120)
    assert said.at_maximum == np.count_nonzero(plane == 64) > 600


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
        said = statistics(lying)
        assert place(said.spot) == (x, top)
        assert said.lone is not None and said.lone.luminance == seen.max()


def test_a_map_without_pixels_is_refused():
    with pytest.raises(ValueError, match="0 x 0 pixels"):
        statistics(np.zeros((0, 0, 3), np.float32))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_codes_are_counted_as_numpy_counts_them(dtype: type):
    top = np.iinfo(dtype).max
    pixels = np.random.default_rng(3).integers(0, top, (611, 700, 3), dtype, endpoint=True)
    pixels[:100, :, 0], pixels[:50, :, 1] = 0, top
    said = code_values(Photograph(pixels))
    assert (said.top, said.pixels) == (top, 611 * 700)
    assert said.black == tuple((pixels == 0).mean((0, 1))) and said.white == tuple((pixels == top).mean((0, 1)))
    assert (said.minimum, said.maximum) == (pixels.min(), pixels.max())
    assert said.mean == pytest.approx(pixels.mean())
    wanted = np.percentile(pixels, PERCENTS, method="inverted_cdf").tolist()
    assert list(said.percentiles.values()) == wanted


def test_what_is_outside_the_picture_counts_nowhere():
    pixels = np.full((4, 6, 3), 100, np.uint8)
    pixels[:, 3:] = 255
    outside = np.zeros((4, 6), bool)
    outside[:, 3:] = True
    said = code_values(Photograph(pixels, outside=outside))
    assert (said.pixels, said.maximum, said.white) == (12, 100, (0, 0, 0))
    said = code_values(Photograph(pixels, outside=np.ones((4, 6), bool)))
    assert (said.pixels, said.minimum, said.mean, dict(said.percentiles)) == (0, None, None, {})
