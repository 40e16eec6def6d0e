"""Single pixels that stand out, pushed: their flux, exactly, shared out among the pixels of another layout.

Each goes out over a tent as wide as the one that bilinear look-ups would show, so that it looks like what is gathered.
"""

from __future__ import annotations

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import kernel
from relume.sphere.mappings.kernels import found, neighbour, solid_angle, spreads, toward, turned
from relume.sphere.mappings.layouts import EQUIDISTANT, EQUISOLID, LAT_LONG, ORTHOGRAPHIC, Layout, Planes

_PIXELS, _CELLS, _COPIED = 1 << 12, 1 << 17, 1 << 19
"""Pixels and cells splatted at a time, and pixels that a thread copies."""
_HALF, _ONE = np.float32(0.5), np.float32(1)
AROUND = ((8, 0), (6, 6), (0, 8), (-6, 6), (-8, 0), (-6, -6), (0, -8), (6, -6))
"""Columns and rows from a pixel to those round it: what is narrower than sixteen pixels stands out of them."""
KEPT = 2.0
"""Times their mean that a pixel keeps: a half is what the edge of a window has round it, and a window is no lamp."""
_MOST_CELLS = 64
"""Cells a side, at most, of a pixel that is pushed."""


def stands_out(source: Layout, light: np.ndarray, most: np.ndarray, peaks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The source's pixels above `most`: (K, 3) plane, row and column, and (K, 3) the flux above it."""
    none = np.empty((0, 3), np.int64), np.empty((0, 3))
    count = bright(source.planes, light, most, peaks, *none)
    places, flux = np.empty((count, 3), np.int64), np.empty((count, 3))
    bright(source.planes, light, most, peaks, places, flux)
    return places, flux


def taken_out(
    source: Layout, light: np.ndarray, most: np.ndarray, places: np.ndarray, flux: np.ndarray, deep: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The source without what is compact and bright in it, and the places and flux (K, 3) of that.

    light : (N, 3), returned as it is where nothing is taken out
    most, places, flux : of `stands_out`
    deep : rows of a lat-long near each pole that are averaged along themselves, of which only those are returned that
        something is taken out of

    A pixel keeps `most`, or `KEPT` times the mean of those `AROUND` it where that is more: bright skies and windows are
    smooth, and looking them up does them no harm, while pushing them pixel by pixel would leave a moiré.
    """
    if not len(places):
        return light, places, flux
    planes = source.planes
    level = np.zeros((len(places), 3), np.float32)
    start = planes.origins[places[:, 0]]
    for right, down in AROUND:
        column, row = places[:, 2] + right, np.clip(places[:, 1] + down, 0, planes.rows - 1)
        column = column % planes.columns if planes.kind == LAT_LONG else np.clip(column, 0, planes.columns - 1)
        level += light[start + row * planes.stride + column]
    index = start + places[:, 1] * planes.stride + places[:, 2]
    kept = np.minimum(light[index], np.maximum(most, level * (KEPT / len(AROUND))))
    excess = light[index] - kept
    chosen = np.flatnonzero(excess.max(1) > 0)
    if not len(chosen):
        return light, places[:0], flux[:0]
    # What `stands_out` found is solid angle times light above `most`.
    above = np.maximum(light[index] - most, 0).astype(np.float64)
    channel = above.argmax(1)
    each = np.arange(len(places))
    areas = flux[each, channel] / above[each, channel]
    rest, begin = np.empty_like(light), deep * planes.stride

    def copy(first: int, last: int) -> None:
        rest[begin + first : begin + last] = light[begin + first : begin + last]

    in_threads(copy, len(light) - 2 * begin, chunk=_COPIED)
    for row in np.unique(places[chosen, 1]) if deep else ():
        start = row * planes.stride
        rest[start : start + planes.stride] = light[start : start + planes.stride]
    rest[index[chosen]] = kept[chosen]
    return rest, places[chosen], excess[chosen] * areas[chosen, None]


def push(
    source: Layout, target: Layout, turns: np.ndarray, places: np.ndarray, flux: np.ndarray, result: np.ndarray
) -> None:
    """Add the flux of the source's pixels at `places` to the target's, over each pixel's own tent."""
    for plane in range(len(source.frames)):
        own = np.flatnonzero(places[:, 0] == plane)
        for some in (own[b : b + _PIXELS] for b in range(0, len(own), _PIXELS)):
            _push_some(source.planes, target.planes, turns[plane], places[some, 1:], flux[some], result)


def _push_some(
    source: Planes, target: Planes, turn: np.ndarray, places: np.ndarray, flux: np.ndarray, result: np.ndarray
) -> None:
    across, down = _middles(source, places)
    xs, ys, plane, _ = _sent(source, target, turn, across, down)
    # How many of the target's pixels a pixel of the source covers there, each way.
    wide, high, fine, fine_down = np.empty((4, len(xs)))
    spreads(source.kind, source.across, source.down, source.rows, across, down, wide, high)
    spreads(target.kind, target.across, target.down, target.rows, xs, ys, fine, fine_down)
    finest = np.maximum(np.minimum(fine * 2 / target.columns, fine_down * 2 / target.rows), 1e-9)
    wide, high = wide * 2 / (source.columns * finest), high * 2 / (source.rows * finest)
    # A tent over the pixel and half its neighbours, as bilinear look-ups have it; narrower where it and the target's
    # own bilinear shares would blur more than one such tent.
    tent, tent_down = (np.sqrt(np.maximum(1 - 1 / np.maximum(n, 1) ** 2, 0)) for n in (wide, high))
    many, many_down = (
        np.minimum(np.ceil(2 * t * n) + 1, _MOST_CELLS).astype(np.int64) for t, n in ((tent, wide), (tent_down, high))
    )
    half_width, half_height = tent * 2 / source.columns, tent_down * 2 / source.rows
    ends = np.cumsum(many * many_down)
    begin = 0
    while begin < len(ends):
        end = max(begin + 1, int(np.searchsorted(ends, (ends[begin - 1] if begin else 0) + _CELLS)))
        some = slice(begin, end)
        count = int(ends[end - 1] - (ends[begin - 1] if begin else 0))
        points = np.empty((2, count), np.float32)
        share, owner = np.empty(count, np.float32), np.empty(count, np.int32)
        tents(
            across[some], down[some], half_width[some], half_height[some], many[some], many_down[some],
            *points, share, owner,
        )  # fmt: skip
        xs, ys, plane, _ = _sent(source, target, turn, *points)
        deposit(target, plane, xs, ys, share, owner, flux[some], result)
        begin = end


def _sent(
    source: Planes, target: Planes, turn: np.ndarray, xs: np.ndarray, ys: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Where points of a plane of the source fall in the target: points, planes, and the source's density there."""
    x, y, z, density, across, down = np.empty((6, len(xs)), np.float32)
    plane = np.empty(len(xs), np.int32)
    toward(source.kind, source.across, source.down, xs, ys, x, y, z, density)
    turned(turn, x, y, z)
    found(target.kind, target.across, target.down, target.frames, target.whole, x, y, z, plane, across, down)
    return across, down, plane, density


def _middles(source: Planes, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The middles by solid angle of pixels (K, 2) of a plane, as points of it, (K,) float32 each."""
    steps = (np.arange(8) + 0.5) / 8
    down = (2 * (places[:, :1, None] + steps[None, :, None]) / source.rows - 1).astype(np.float32)
    across = (2 * (places[:, 1:, None] + steps[None, None, :]) / source.columns - 1).astype(np.float32)
    across, down = (np.ascontiguousarray(a.reshape(len(places), 64)) for a in np.broadcast_arrays(across, down))
    x, y, z, weight = np.empty((4, across.size), np.float32)
    toward(source.kind, source.across, source.down, across.reshape(-1), down.reshape(-1), x, y, z, weight)
    weight = weight.reshape(across.shape).astype(np.float64)
    shown = np.ones(weight.shape)
    if source.kind in (EQUIDISTANT, EQUISOLID, ORTHOGRAPHIC):
        radius = np.hypot(across, down)
        # A sliver that no point shows: its nearest one to the disc.
        shown = radius <= np.maximum(1, radius.min(axis=1, keepdims=True))
        weight *= shown
        inner = np.minimum(1, (1 - 1e-6) / np.maximum(radius, 1e-9))
        across, down = across * inner, down * inner
    # At the rim of a disc that shows a whole ball a point has no solid angle, and is the middle of a pixel that has
    # no other.
    nothing = ~weight.any(axis=1)
    weight[nothing] = shown[nothing]
    whole = weight.sum(axis=1)
    middle = (across * weight).sum(axis=1) / whole, (down * weight).sum(axis=1) / whole
    return middle[0].astype(np.float32), middle[1].astype(np.float32)


@kernel
def bright(planes, light, most, peaks, places, flux):
    """Pixels with light above `most`: fills places (K, 3) plane, row, column and flux (K, 3); returns how many."""
    kind, rows, columns = planes.kind, planes.rows, planes.columns
    count = 0
    for line in range(rows * len(planes.origins)):
        if peaks[line, 0] <= most[0] and peaks[line, 1] <= most[1] and peaks[line, 2] <= most[2]:
            continue
        plane, row = line // rows, line % rows
        start = planes.origins[plane] + row * planes.stride
        for column in range(columns):
            index = start + column
            if light[index, 0] <= most[0] and light[index, 1] <= most[1] and light[index, 2] <= most[2]:
                continue
            angle = solid_angle(kind, planes.across, planes.down, rows, columns, row, column)
            if angle == 0:
                continue
            if count < len(places):
                places[count, 0], places[count, 1], places[count, 2] = plane, row, column
                for channel in range(3):
                    flux[count, channel] = max(light[index, channel] - most[channel], np.float32(0)) * angle
            count += 1
    return count


@kernel
def tents(across, down, half_width, half_height, many, many_down, xs, ys, share, owner):
    """Cells over tents round points, with shares that sum to 1 for each."""
    place = 0
    for i in range(len(across)):
        begin, whole = place, 0.0
        for j in range(many_down[i]):
            below = 2 * (j + 0.5) / many_down[i] - 1
            for k in range(many[i]):
                right = 2 * (k + 0.5) / many[i] - 1
                xs[place], ys[place] = across[i] + right * half_width[i], down[i] + below * half_height[i]
                share[place], owner[place] = (1 - abs(right)) * (1 - abs(below)), i
                whole += share[place]
                place += 1
        for k in range(begin, place):
            share[k] /= whole


@kernel
def deposit(target, plane, xs, ys, share, owner, flux, radiance):
    """Shares the owners' flux out among the four pixels round each cell, as a bilinear look-up there would ask them."""
    kind, rows, columns = target.kind, target.rows, target.columns
    for i in range(len(xs)):
        if plane[i] < 0:
            continue
        x, y = (xs[i] + _ONE) * np.float32(columns / 2) - _HALF, (ys[i] + _ONE) * np.float32(rows / 2) - _HALF
        column, row = int(np.floor(x)), int(np.floor(y))
        right, below = x - column, y - row
        for k in range(4):
            if not target.whole and not (0 <= column + k % 2 < columns and 0 <= row + k // 2 < rows):
                continue
            index = neighbour(
                kind, target.across, target.down, rows, columns, target.stride, target.origins, target.frames,
                target.whole, plane[i], row + k // 2, column + k % 2,
            )  # fmt: skip
            # The pixel may have been found on another plane.
            place = index - target.origins[plane[i]]
            for p in range(len(target.origins)):
                other = index - target.origins[p]
                if other >= 0 and other % target.stride < columns and other // target.stride < rows:
                    place = other
            angle = solid_angle(
                kind, target.across, target.down, rows, columns, place // target.stride, place % target.stride
            )
            if angle > 0:
                part = share[i] * (right if k % 2 else 1 - right) * (below if k // 2 else 1 - below) / angle
                for channel in range(3):
                    radiance[index, channel] += flux[owner[i], channel] * part
