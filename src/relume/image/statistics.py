"""What pixels hold: range in stops, percentiles, brightest spot, faults; how a photograph uses its code values.

Range and percentiles are of the *lit* pixels, those whose luminance is finite and above 0: the corners of an angular
map and what no photograph saw are black, and say nothing of the light. A percentile is a luminance of the map itself,
the least that so many percent of the lit pixels do not exceed; nothing is interpolated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relume.image.colour import luminance, triple
from relume.image.photograph import Photograph

PERCENTS = (1.0, 5.0, 25.0, 50.0, 75.0, 95.0, 99.0, 99.9)
ROBUST = (0.1, 99.9)
"""Percents between which the robust range lies: one pixel in a thousand may be dead or a firefly at either end."""
_LONE = np.float32(16)
"""Four stops: a lens spreads light so that next to a real lamp's pixel some neighbour is less far below."""
_BAND = 2**18  # pixels worked on at a time, which stay in the cache


@dataclass(frozen=True)
class Spot:
    """A pixel, by its place and its light.

    x, y : column and row, from 0 at the top left
    radiance : R, G, B there, in the map's unit
    luminance : there
    around : the mean luminance of the 3 × 3 pixels about it, of those that lie in the map and are finite
    """

    x: int
    y: int
    radiance: tuple[float, float, float]
    luminance: float
    around: float


@dataclass(frozen=True)
class Statistics:
    """What the pixels of a radiance map hold; luminances and values in its unit, None where there are none.

    minimum, maximum, mean : of the finite values of all three channels
    mean_luminance : of the pixels whose channels are all finite
    lit : number of pixels whose luminance is finite and above 0
    darkest, brightest : least and largest luminance of lit pixels
    robust : the same but for the pixels beyond `ROBUST`, one in a thousand at either end
    percentiles : percent → luminance, of lit pixels, for `PERCENTS`
    spot : the brightest pixel that does not stand alone; where several are equal, one in their middle
    lone : the brightest pixel, where it does stand alone, its neighbours all more than four stops darker: a firefly,
        a hot photosite, or a sun smaller than a pixel; None otherwise, and where every lit pixel stands alone
    at_maximum : number of pixels of which a channel is at `maximum`; many mean that the map is clipped there
    nan, infinite, negative : number of values (three a pixel); negative are those that are finite
    """

    minimum: float | None
    maximum: float | None
    mean: float | None
    mean_luminance: float | None
    lit: int
    darkest: float | None
    brightest: float | None
    robust: tuple[float, float] | None
    percentiles: Mapping[float, float]
    spot: Spot | None
    lone: Spot | None
    at_maximum: int
    nan: int
    infinite: int
    negative: int

    @property
    def stops(self) -> float | None:
        """log₂ of the largest luminance over the least, of all lit pixels."""
        return (
            None
            if self.darkest is None or self.brightest is None
            else math.log2(self.brightest) - math.log2(self.darkest)
        )

    @property
    def robust_stops(self) -> float | None:
        """The same of the robust range."""
        return None if self.robust is None else math.log2(self.robust[1]) - math.log2(self.robust[0])


@dataclass(frozen=True)
class CodeValues:
    """The code values of a photograph's pixels, but for those outside the picture; None and 0 where there are none.

    top : the largest code there is, 255 or 65535
    pixels : how many were counted
    black, white : the share of pixels at 0 and at `top`, of R, G and B
    minimum, maximum, mean : of all three channels
    percentiles : percent → code, of all three channels, for `PERCENTS`
    """

    top: int
    pixels: int
    black: tuple[float, float, float]
    white: tuple[float, float, float]
    minimum: int | None
    maximum: int | None
    mean: float | None
    percentiles: Mapping[float, int]


def statistics(radiance: np.ndarray) -> Statistics:
    """What pixels (H, W, 3) float32 hold, from few passes over them and a sort of their luminances (4 bytes a pixel).

    Raises ValueError where there are none.
    """
    height, width = radiance.shape[:2]
    if height * width == 0:
        raise ValueError(f"{width} x {height} pixels; a map without pixels has no statistics")
    seen = np.empty((height, width), np.float32)
    finite_values = nan = infinite = negative = whole = 0
    low, high, total, total_luminance = math.inf, -math.inf, 0.0, 0.0
    for rows in _bands(height, width):
        band = radiance[rows]
        with np.errstate(invalid="ignore"):  # ∞ − ∞ in the luminance of a broken pixel
            seen[rows] = luminance(band)
        usable = np.isfinite(band)
        if not usable.all():
            missing = int(np.count_nonzero(np.isnan(band)))
            nan, infinite = nan + missing, infinite + int(np.count_nonzero(~usable)) - missing
            seen[rows][~usable.all(-1)] = 0
            whole -= int(np.count_nonzero(~usable.all(-1)))
            band = band[usable]
        finite_values, whole = finite_values + band.size, whole + seen[rows].size
        if band.size:
            negative += int(np.count_nonzero(band < 0))
            low, high = min(low, float(band.min())), max(high, float(band.max()))
            total += float(band.sum(dtype=np.float64))
            total_luminance += float(seen[rows].sum(dtype=np.float64))
    at_maximum = sum(np.count_nonzero((radiance[rows] == high).any(-1)) for rows in _bands(height, width))
    spot, lone = _spots(radiance, seen)
    lit = seen.reshape(-1)
    lit.sort()
    lit = lit[np.searchsorted(lit, np.float32(0), side="right") :]
    return Statistics(
        minimum=low if finite_values else None,
        maximum=high if finite_values else None,
        mean=total / finite_values if finite_values else None,
        mean_luminance=total_luminance / whole if whole else None,
        lit=lit.size,
        darkest=float(lit[0]) if lit.size else None,
        brightest=float(lit[-1]) if lit.size else None,
        robust=(_at(lit, ROBUST[0]), _at(lit, ROBUST[1])) if lit.size else None,
        percentiles={percent: _at(lit, percent) for percent in PERCENTS} if lit.size else {},
        spot=spot,
        lone=lone,
        at_maximum=int(at_maximum) if finite_values else 0,
        nan=nan,
        infinite=infinite,
        negative=negative,
    )


def code_values(photograph: Photograph) -> CodeValues:
    """What codes a photograph holds, and how often those at either end."""
    pixels, top = photograph.pixels, int(np.iinfo(photograph.pixels.dtype).max)
    counts = np.zeros((3, top + 1), np.int64)
    for rows in _bands(*pixels.shape[:2]):
        band = pixels[rows].reshape(-1, 3)
        if photograph.outside is not None:
            band = band[~photograph.outside[rows].reshape(-1)]
        for channel in range(3):
            counts[channel] += np.bincount(band[:, channel], minlength=top + 1)
    number = int(counts[0].sum())
    black, white = (counts[:, code] / max(number, 1) for code in (0, top))
    every = counts.sum(0)
    used = np.flatnonzero(every)
    return CodeValues(
        top=top,
        pixels=number,
        black=triple(black),
        white=triple(white),
        minimum=int(used[0]) if number else None,
        maximum=int(used[-1]) if number else None,
        mean=float(every @ np.arange(top + 1.0) / every.sum()) if number else None,
        percentiles=code_percentiles(every) if number else {},
    )


def code_percentiles(counts: np.ndarray) -> dict[float, int]:
    """For each of `PERCENTS` the least code that so many percent of the values do not exceed.

    counts : (codes,), how often each occurs; not all 0
    """
    below = np.cumsum(counts)
    return {
        percent: int(np.searchsorted(below, max(int(np.ceil(below[-1] * percent / 100)), 1))) for percent in PERCENTS
    }


def _spots(radiance: np.ndarray, seen: np.ndarray) -> tuple[Spot | None, Spot | None]:
    """The brightest pixel that does not stand alone, and the brightest of all where that does.

    seen : (H, W) float32, luminance, 0 where it is not finite
    """
    height, width = seen.shape
    best, peak, counts, brightest = np.float32(0), np.float32(0), np.zeros(height, np.int64), (0, 0)
    for rows in _bands(height, width):
        company = _in_company(seen, rows)
        if (here := company.max()) > best:
            best = here
            counts[:] = 0
        counts[rows] = np.count_nonzero(company == best, axis=1)
        if (here := seen[rows].max()) > peak:
            peak = here
            row, column = divmod(int(seen[rows].argmax()), width)
            brightest = rows.start + row, column
    if peak <= 0:
        return None, None
    alone = _spot(radiance, seen, *brightest)
    if best <= 0:
        return alone, None
    # The median row of the equals, and the median of its equals: the middle of a clipped sun, and always one of them.
    y = int(np.searchsorted(np.cumsum(counts), (counts.sum() + 1) // 2))
    columns = np.flatnonzero(_in_company(seen, slice(y, y + 1))[0] == best)
    return _spot(radiance, seen, y, int(columns[columns.size // 2])), alone if peak > best else None


def _in_company(seen: np.ndarray, rows: slice) -> np.ndarray:
    """The luminance of some rows; of a pixel that stands alone that of its brightest neighbour."""
    # Of each pixel the largest luminance of its eight neighbours, or fewer at a border.
    around = seen[max(rows.start - 1, 0) : rows.stop + 1]
    padded = np.pad(around, ((int(rows.start == 0), int(rows.stop >= seen.shape[0])), (1, 1)))
    beside = np.maximum(padded[:-2], padded[2:])
    columns = np.maximum(beside, padded[1:-1])
    neighbours = np.maximum(np.maximum(columns[:, :-2], columns[:, 2:]), beside[:, 1:-1])
    with np.errstate(over="ignore"):
        return np.where(seen[rows] > _LONE * neighbours, neighbours, seen[rows])


def _spot(radiance: np.ndarray, seen: np.ndarray, y: int, x: int) -> Spot:
    window = slice(max(y - 1, 0), y + 2), slice(max(x - 1, 0), x + 2)
    usable = np.isfinite(radiance[window]).all(-1)
    return Spot(x, y, triple(radiance[y, x]), float(seen[y, x]), float(seen[window][usable].mean(dtype=np.float64)))


def _bands(height: int, width: int) -> list[slice]:
    step = max(1, _BAND // width)
    return [slice(start, min(start + step, height)) for start in range(0, height, step)]


def _at(ordered: np.ndarray, percent: float) -> float:
    """The least of ordered values that `percent` of them do not exceed (Hyndman & Fan 1996, definition 1)."""
    return float(ordered[max(math.ceil(ordered.size * percent / 100) - 1, 0)])
