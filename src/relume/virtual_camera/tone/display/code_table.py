"""The look-up table from floats to code values of Tchou & Debevec's HDR Shop (2001), made exact to rounding.

The sketch indexes a table by the sign-less top 16 bits of a float, 8 of exponent and 8 of mantissa. Here the table
gives the code at which such a bin begins, and one comparison with the float at which the next code begins, found once
by bisection over the bits of floats, makes the result that of rounding the curve itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads

Three = tuple[float, float, float]


@dataclass(frozen=True)
class Clipping:
    """The share of pixels, 0 to 1, that came out as the nearest thing the display has; of R, G and B.

    above : brighter than its white, or its peak
    below : darker than its black; a colour outside its primaries is negative in a channel
    """

    above: Three
    below: Three

    @property
    def sentence(self) -> str:
        """For a warning or a caption: "1.2 % of the pixels are beyond white, 0 % below black", of the worst channel."""
        return f"{_percent(max(self.above))} of the pixels are beyond white, {_percent(max(self.below))} below black"


def clipping_of(above: np.ndarray, below: np.ndarray, pixels: int) -> Clipping:
    """From (3,) counts of each channel among so many pixels."""
    (red, green, blue), (dark_red, dark_green, dark_blue) = np.array([above, below]) / max(pixels, 1)
    return Clipping((float(red), float(green), float(blue)), (float(dark_red), float(dark_green), float(dark_blue)))


def _percent(share: float) -> str:
    # A single pixel of many is reported too: "0 %" would say that there is none.
    return f"{100 * share:.2g} %" if share >= 0.0001 or share == 0 else "less than 0.01 %"


Curve = Callable[[np.ndarray], np.ndarray]
"""Exposures (N, 3) float64 → display values (N, 3), 0 to 1 nominally; each channel by a curve that never falls."""

_INFINITY = 0x7F800000  # its bits; those of the floats from 0 up to it rise with them
_MANTISSA = 23
_MOST_BITS = 15  # of mantissa: a table of 16-bit sRGB then is 1.4 MB, which a core's own cache holds
_ROUNDING = 1e-12  # of a curve: 1.055 − 0.055 is a little less than 1
_ROWS = 64
_THROUGH = 2**16  # pixels


@dataclass(frozen=True, eq=False)
class CodeTable:
    """A curve and its rounding, ready to be looked up; one for all channels, or one for each.

    bits : of the codes
    thresholds : (1 or 3, 2**bits) float32, the least float whose code is above k, for each code k; NaN where none is
    starts : (1 or 3, bins) uint8 or uint16, the code of the float at which each bin begins
    lowest : the bits of the float at which the first bin begins, shifted; all below are in it
    shift : how many low bits of a float do not matter for its bin
    comparisons : the most thresholds that lie within a bin, 1 but for curves that leap
    black, white : (1 or 3,) float32, the exposures beyond which the curve stays as it is; infinite where it never does
    """

    bits: int
    thresholds: np.ndarray
    starts: np.ndarray
    lowest: int
    shift: int
    comparisons: int
    black: np.ndarray
    white: np.ndarray


def code_table(curve: Curve, bits: int = 8) -> CodeTable:
    """The table of `round((2**bits − 1) · curve(x))` for every float x from 0 to infinity.

    curve : its values beyond 0 and 1 are clipped; negative exposures get the code of 0
    bits : of the codes, 1 to 16; up to 8 make uint8
    Raises ValueError for a curve that falls or is no number.
    """
    if not 1 <= bits <= 16:
        raise ValueError(f"bits is {bits}; a code has 1 to 16")
    top = 2**bits - 1

    def shown(floats: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            values = np.asarray(curve(floats.astype(np.float64)), np.float64)
        if values.shape != floats.shape or np.isnan(values).any():
            raise ValueError("the curve gives no numbers for some exposures; it needs one for each from 0 to infinity")
        return np.clip(values, 0, 1)

    levels = np.repeat(np.arange(1, top + 1)[:, None], 3, axis=1)
    found = _least(lambda floats: np.rint(top * shown(floats)) >= levels, levels.shape)
    last = shown(np.full((1, 3), np.inf, np.float32))
    first = shown(np.zeros((1, 3), np.float32))
    white = _least(lambda floats: shown(floats) >= last - _ROUNDING, (1, 3))[0]
    lit = _least(lambda floats: shown(floats) > first, (1, 3))[0]
    # The next float down; 0 for a curve that rises from 0, or nowhere.
    black = np.where(lit > 0, np.nextafter(lit, np.float32(0)), np.float32(0)).astype(np.float32)
    bounds = np.concatenate([found, [black, white]])
    channels = 1 if all(np.array_equal(bounds[:, 0], bounds[:, c], equal_nan=True) for c in (1, 2)) else 3
    thresholds = np.full((channels, top + 1), np.nan, np.float32)
    thresholds[:, :-1] = found.T[:channels]
    lowest, shift, comparisons, starts = _bins(thresholds)
    _refuse_falling(shown, starts.shape[1], lowest, shift)
    codes = starts.astype(np.uint8 if bits <= 8 else np.uint16)
    return CodeTable(bits, thresholds, codes, lowest, shift, comparisons, black[:channels], white[:channels])


def _least(reached: Callable[[np.ndarray], np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """The least float32 from 0 to infinity that has `reached`, by halves of the range of bits; NaN where none has."""
    low, high = np.zeros(shape, np.int32), np.full(shape, _INFINITY, np.int32)
    never = ~reached(high.view(np.float32))
    while np.any(low < high):
        middle = low + (high - low) // 2
        here = reached(middle.view(np.float32))
        low, high = np.where(here, low, np.minimum(middle + 1, high)), np.where(here, middle, high)
    found = high.view(np.float32).copy()
    found[never] = np.nan
    return found


def _bins(thresholds: np.ndarray) -> tuple[int, int, int, np.ndarray]:
    """(lowest, shift, comparisons, starts) of the coarsest bins that hold the fewest thresholds each."""
    known = [row[~np.isnan(row)] for row in thresholds]
    risen = np.concatenate([row[row > 0] for row in known])
    ends = (risen.min(), risen.max()) if risen.size else (np.float32(1), np.float32(1))
    chosen = None
    for mantissa in range(4, _MOST_BITS + 1):
        shift = _MANTISSA - mantissa
        # The first bin begins below every threshold above 0, so that it is right for all that is darker, too.
        begin, end = ((int(value.view(np.int32)) >> shift) for value in ends)
        lowest = max(begin - 1, 0)
        floats = (np.arange(lowest, end + 2, dtype=np.int64) << shift).astype(np.int32).view(np.float32)
        counts = np.stack([np.searchsorted(row, floats, side="right") for row in known])
        within = max(1, int(np.diff(counts, axis=1).max()))
        if chosen is None or within < chosen[2]:
            chosen = lowest, shift, within, counts[:, :-1]
        if within == 1:
            break
    assert chosen is not None
    return chosen


def _refuse_falling(shown: Callable[[np.ndarray], np.ndarray], bins: int, lowest: int, shift: int) -> None:
    """Where each bin begins, and coarsely everywhere: bisection would not notice."""
    bits = np.union1d(np.arange(lowest, lowest + bins + 1) << shift, np.arange(0, _INFINITY + 1, 1 << 17))
    floats = np.minimum(bits, _INFINITY).astype(np.int32).view(np.float32)
    values = shown(np.repeat(floats[:, None], 3, axis=1))
    fallen = np.flatnonzero((np.diff(values, axis=0) < -_ROUNDING).any(1))
    if fallen.size:
        where = float(floats[fallen[0]])
        raise ValueError(f"the curve falls above {where:g}; a table needs one that never does: sort or smooth it")


def coded(
    values: np.ndarray,
    table: CodeTable,
    gain: float | tuple[float, float, float] = 1.0,
    through: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[np.ndarray, Clipping]:
    """Codes (H, W, 3) uint8 or uint16 of values (H, W, 3) float32, and how many lie beyond either end of the curve.

    gain : what values are multiplied by first, in float32, each channel by its own where three are given: an exposure
    through : what becomes of values before that, some rows at a time, so that they are never whole in memory
    Raises ValueError for NaN, whose first pixel it names, and for another shape or type.
    """
    if values.ndim != 3 or values.shape[2] != 3 or values.dtype != np.float32:
        raise ValueError(f"values are {values.shape} {values.dtype}; expected (H, W, 3) float32")
    from relume.virtual_camera.tone.display.code_table_kernels import lookup

    height, width = values.shape[:2]
    gains = np.broadcast_to(np.asarray(gain, np.float32), 3).copy()
    if not (np.all(np.isfinite(gains)) and np.all(gains > 0)):
        raise ValueError(f"gain is {gain}; expected positive numbers")
    codes = np.empty(values.shape, table.starts.dtype)
    bounds = np.stack([np.broadcast_to(bound, 3) for bound in (table.black, table.white)])

    def work(begin: int, end: int) -> np.ndarray:
        counts = np.zeros((3, 3), np.int64)
        rows, into = values[begin:end], codes[begin:end]
        rows = rows if through is None else through(rows)
        bins = (table.starts, table.lowest, table.shift, table.comparisons)
        lookup(rows, gains, table.thresholds, *bins, bounds, into, counts)
        return counts

    # Rows that stay in the cache between the two, and are too few for threads of their own.
    chunk = _ROWS if through is None else max(1, _THROUGH // width)
    counts = np.sum(in_threads(work, height, chunk=chunk), axis=0)
    absent = int(counts[2].sum())
    if absent:
        y, x = np.argwhere(np.isnan(values if through is None else through(values)).any(-1))[0]
        raise ValueError(f"{absent} values are NaN, the first at x {x}, y {y}; mend or mask them before they are shown")
    return codes, clipping_of(counts[0], counts[1], height * width)
