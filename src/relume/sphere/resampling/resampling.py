"""Light moved between mappings and sizes: antialiased, energy kept, turned on the way.

Every target pixel is the mean, by solid angle, of bilinear look-ups in cells hardly wider than the source's pixels:
where a map grows that is bilinear interpolation, where it shrinks an average over areas (a box filter, as HDR Shop's).
Look-ups at a few points count a single pixel a few per cent too much or too little. For most pixels that averages
out; for a sun it would not. So what stands out is taken out first and pushed instead: its flux, exactly, is shared out
among the target's pixels. A lat-long's rows near the poles are averaged along themselves beforehand to pixels as wide
as high.
"""

from __future__ import annotations

import numpy as np

from relume.image.bands import in_threads
from relume.sphere.mappings.kernels import found, grain, toward, turned
from relume.sphere.mappings.layouts import LAT_LONG, Layout, Planes
from relume.sphere.mappings.mapping import LatLong, Mapping
from relume.sphere.resampling.kernels import (
    RUN,
    across_edges,
    cells,
    divisions,
    finish,
    locate,
    mark,
    round_caps,
    scaled,
    settle,
    sums,
)
from relume.sphere.resampling.splatting import push, stands_out, taken_out

STANDS_OUT = 4.0
"""Times a channel's mean radiance above which light is pushed: few pixels do that, and below it errors average out."""
SMALL = 1e-5
"""Share of the whole flux below which a pixel need not be pushed: 10,000 such with errors of 5 % add up to 5e-5."""
APART = 1.3
"""Pixels of the source between look-ups, at most: bilinear look-ups are two wide, so they overlap well."""
_ROUNDED = 0.75
"""sin of the angle from a pole below which a lat-long's rows are averaged: pixels there are narrower than that."""
_UNEVEN = 3
"""Width of a row's averages, in pixels, from which on pushed light would show: 19° from a pole."""
_EXACT = 3e-7
"""How near to 1 the ratio of totals may stay: float32 rounds to a fifth of that."""
_LINES, _PIXELS, _CELLS = 32, 1 << 20, 1 << 17
"""Lines a thread takes at a time, pixels it scales, and cells it looks up."""


def moved(
    radiance: np.ndarray, clipped: np.ndarray | None, source: Layout, target: Layout, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    """Light of one layout in another: radiance (H, W, 3) float32, marks (H, W) uint8 or None, and the share covered.

    rotation : (3, 3), active: what came from ω comes from `rotation` @ ω

    The share (H, W) float32 is of each target pixel what the source shows; empty where it shows the whole sphere.
    Each channel's total is kept, unless one of the layouts shows a part of the sphere only: light that falls outside
    is lost then, and what no pixel showed stays 0 and is marked OUTSIDE. Constant light stays constant. Marks in
    `clipped` travel: a pixel is SATURATED when any of the pixels it is made from is, else marked when all of them are.
    """
    light = np.ascontiguousarray(radiance, np.float32).reshape(-1, 3)
    codes = np.zeros(0, np.uint8) if clipped is None else np.ascontiguousarray(clipped, np.uint8).reshape(-1)
    whole = source.planes.whole
    pixels = target.shape[0] * target.shape[1]
    # What no plane shows, as between the faces of a cross, stays 0; all else is written.
    planes = target.planes.rows * target.planes.columns * len(target.planes.origins)
    result = (np.empty if planes == pixels else np.zeros)((pixels, 3), np.float32)
    covered = np.zeros(0 if whole else pixels, np.float32)
    if not whole and clipped is None:
        codes = np.zeros(len(light), np.uint8)
    marks = np.zeros(pixels if len(codes) else 0, np.uint8)

    peaks = np.empty((source.lines, 3), np.float32)
    parts = in_threads(lambda a, b: sums(source.planes, light, a, b, peaks), source.lines, chunk=_LINES)
    *total, shown = np.sum(parts, axis=0)
    # The radiance of each channel above which light may be pushed.
    mean = np.array(total) / shown
    most = np.maximum(STANDS_OUT * mean, SMALL * len(light) * mean).astype(np.float32)
    deep, given = _deep(source), light
    light, places, flux = taken_out(source, light, most, *stands_out(source, light, most, peaks), deep)
    caps = _caps(given, light, places, deep, source)
    turns = target.turns(source, rotation.T)
    work = target.planes, source.planes, turns, light.reshape(-1), caps.reshape(-1), codes, result, covered, marks
    parts = in_threads(lambda a, b: _gathered(a, b, *work), target.lines, chunk=_LINES)
    if whole and target.planes.whole:
        gathered, wanted = np.sum(parts, axis=0), np.array(total) - flux.sum(axis=0)
        scale = np.divide(wanted, gathered, out=np.ones(3), where=(gathered > 0) & (wanted > 0))
        if np.abs(scale - 1).max() > _EXACT:
            factors = scale.astype(np.float32)
            in_threads(lambda a, b: scaled(result, factors, a, b), pixels, chunk=_PIXELS)
    if len(places):
        push(source, target, source.turns(target, rotation), places, flux, result)
        if target.planes.kind == LAT_LONG:
            _even_poles(result.reshape(*target.shape, 3))
    known = marks.reshape(target.shape) if clipped is not None or marks.any() else None
    return result.reshape(*target.shape, 3), known, covered.reshape(target.shape if covered.size else 0)


def _gathered(
    begin: int,
    end: int,
    target: Planes,
    source: Planes,
    turns: np.ndarray,
    light: np.ndarray,
    caps: np.ndarray,
    codes: np.ndarray,
    result: np.ndarray,
    covered: np.ndarray,
    marks: np.ndarray,
) -> np.ndarray:
    """Fill lines begin…end of the target with means of look-ups in the source; their total, (3,)."""
    step = APART * grain(source.kind, source.across, source.down, source.rows, source.columns)
    lines = range(begin, end)
    wide = np.empty((len(lines), -(-target.columns // RUN)), np.int64)
    high = np.empty_like(wide)
    counts = np.empty(len(lines), np.int64)
    divisions(target, step, begin, wide, high, counts)
    total = np.zeros(3)
    while begin < end:
        # As many lines of one plane as fill the buffers; one line may be more.
        last, need = begin + 1, counts[begin - lines.start]
        while last < end and last % target.rows and need + counts[last - lines.start] <= _CELLS:
            need, last = need + counts[last - lines.start], last + 1
        xs, ys, x, y, z, weight = np.empty((6, need), np.float32)
        owner, plane = np.empty((2, need), np.int32)
        owned = (last - begin) * target.columns
        values = np.empty((owned, 3), np.float32)
        inside, every, parts = np.empty((3, owned), np.float32)
        here = slice(begin - lines.start, last - lines.start)
        count = cells(target, begin, last, wide[here], high[here], xs, ys, owner, parts)
        xs, ys, x, y, z, weight, owner, plane = (a[:count] for a in (xs, ys, x, y, z, weight, owner, plane))
        toward(target.kind, target.across, target.down, xs, ys, x, y, z, weight)
        turned(turns[begin // target.rows], x, y, z)
        found(source.kind, source.across, source.down, source.frames, source.whole, x, y, z, plane, xs, ys)
        marked = owned if len(codes) else 0
        least, saturated = np.full(marked, 255, np.uint8), np.zeros(marked, np.uint8)
        if marked:
            mark(source, plane, xs, ys, owner, codes, least, saturated)
        place = np.empty(count, np.int64)
        locate(source, len(caps) // (6 * source.columns), plane, xs, ys, place)
        beyond = across_edges(source, plane, place, light, caps)
        settle(source.stride, place, xs, ys, owner, weight, light, caps, beyond, values, inside, every)
        total += finish(target, begin, last, values, inside, every, parts, least, saturated, result, covered, marks)
        begin = last
    return total


def _even_poles(radiance: np.ndarray) -> None:
    """Average a lat-long's rows near the poles along themselves, over pixels as wide as high, in place.

    Pushed light lands in some of the narrow pixels there and not in their neighbours; a row keeps its total.
    """
    from scipy.ndimage import uniform_filter1d

    rows = len(radiance)
    widths = np.minimum(1 / np.sin(np.pi * (np.arange(rows) + 0.5) / rows), 2 * rows - 1)
    for row in np.flatnonzero(widths >= _UNEVEN):
        evened = uniform_filter1d(radiance[row], int(widths[row]) | 1, axis=0, mode="wrap")
        # Running sums leave a trace of a sun behind it, which may lie below 0.
        radiance[row] = np.maximum(evened, 0)


def _deep(source: Layout) -> int:
    """How many rows of a lat-long are averaged near each pole; 0 of others."""
    rows = source.planes.rows
    narrow = np.sin(np.pi * (np.arange(rows) + 0.5) / rows) < _ROUNDED
    return int(np.sum(narrow)) // 2 if source.planes.kind == LAT_LONG else 0


def _caps(given: np.ndarray, light: np.ndarray, places: np.ndarray, deep: int, source: Layout) -> np.ndarray:
    """A lat-long's rows near the poles, averaged along themselves: (2·K·columns, 3) float32; else empty.

    given, light, places : the map, and what `taken_out` made of it, whose rows here hold something where it took
        something out
    """
    rows, columns = source.planes.rows, source.planes.columns
    caps = np.empty((2 * deep * columns, 3), np.float32)
    in_threads(lambda a, b: round_caps(given, rows, columns, caps, a, b), 2 * deep, chunk=_LINES)
    changed = np.unique(places[:, 1])
    for line in (*changed[changed < deep], *(changed[changed >= rows - deep] - rows + 2 * deep)):
        round_caps(light, rows, columns, caps, int(line), int(line) + 1)
    return caps


def whole_columns(here: tuple[Mapping, int], there: tuple[Mapping, int], rotation: np.ndarray) -> int | None:
    """Columns by which to roll a lat-long map, if that is all: 0 for no turn in any mapping, None otherwise."""
    if here != there:
        return None
    mapping, rows = here
    if np.abs(rotation - np.eye(3)).max() < 1e-12:
        return 0
    if not isinstance(mapping, LatLong) or abs(rotation[1, 1] - 1) > 1e-12:
        return None
    turn = np.arctan2(rotation[0, 2], rotation[0, 0]) * 2 * rows / (2 * np.pi)
    return round(turn) if abs(turn - round(turn)) <= 1e-6 else None
