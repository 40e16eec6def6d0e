"""Where one view of a panorama gives way to the next, how their differences are spread out, and the map they make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy import sparse
from scipy.ndimage import gaussian_filter
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import spsolve

from relume.image.bands import in_threads
from relume.image.bilinear import bilinear
from relume.image.radiance import OUTSIDE, SATURATED
from relume.probe.panorama.coverage import Coverage, coverage, shrunk, view_in_map
from relume.probe.panorama.views import PanoramaView
from relume.sphere.directions import angle_between
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_points

ROWS = 192
"""Of the map on which seams are laid: cells of a degree."""
DIFFERENCE = 0.04
"""Of ln luminance, at which a front moves twice as fast: what views differ by when all is well."""
SOFTNESS = np.radians(0.35)
"""Over which one view gives way to the other: a few pixels of a usual map."""
MOST = 30.0
"""Greatest cost: a weight of 1e-13, which counts where nothing else is measured."""
MOVED = 0.35
"""Difference of ln radiance above which two views show different things, which no gain makes alike."""
STRONGEST = 0.25
"""Of ln radiance, that a view is evened out by at most."""
ACROSS = 64
"""Cells across a picture in which it is evened out."""
WIDTH = 2.5
"""Of these cells, the deviation of the Gaussian that makes it smooth: 4 % of the picture, far above all detail."""
FADING = 0.1
"""Where so little of what is compared lies near, the correction has faded to half."""
CELLS = 2
"""Look-ups a pixel of the map and side: a view's corners are finer than its middle."""
STRIP = 32
"""Rows at a time: what the views show in them stays small."""
RAMP = 0.01
"""Of a picture's shorter side, over which its weight rises from its rim, where lenses are worst."""
COARSE = 96
"""Rows of the map in which what no view sees is filled in."""


@dataclass(frozen=True, eq=False)
class Seams:
    """Which view shows which direction.

    costs : (views, rows + 2, 2·rows + 2) float32 on a lat-long map with one more cell on every side; a view's weight is
        exp(−cost), 0 for the one that shows the cell
    disputed : steradians in which views that overlap show different things
    """

    costs: np.ndarray
    disputed: float


def even(views: Sequence[PanoramaView], margin: float = 0.0) -> tuple[PanoramaView, ...]:
    """The views with what is left of their smooth differences spread over the overlaps.

    Every direction is given the mean of ln radiance of the views that measure it, by their distance from the rim; what
    each view lacks to that, smoothed in its own picture and faded where it is alone, multiplies it. Multiplied are the
    coarsest band's values alone, by ratios of the same directions: a lamp that both views see cancels, and no halo
    comes of it; where views agree nothing changes.
    """
    seen = coverage(views, ROWS, margin)
    weight = np.where(seen.measured, np.maximum(seen.inwards, 1e-3) ** 2, 0)[..., None]
    total = weight.sum(0)
    mean = np.divide((weight * seen.logarithm).sum(0), total, out=np.zeros((*total.shape[:2], 3)), where=total > 0)
    shared = seen.measured.sum(0) > 1
    result = []
    for index, view in enumerate(views):
        lacking = mean - seen.logarithm[index]
        usable = shared & seen.measured[index] & (np.abs(lacking).max(-1) < MOVED)
        if not usable.any():
            result.append(view)
            continue
        result.append(_evened(view, np.clip(lacking, -STRONGEST, STRONGEST), usable))
    return tuple(result)


def _evened(view: PanoramaView, lacking: np.ndarray, usable: np.ndarray) -> PanoramaView:
    import cv2

    width, height = view.picture.size
    columns = min(ACROSS, width)
    rows = max(1, round(columns * height / width))
    x, y = (np.arange(columns) + 0.5) / columns * width, (np.arange(rows) + 0.5) / rows * height
    rays = view.rays(np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)) @ view.placed.T
    points = LatLong().image_points(rays)
    share = _look_up(usable.astype(np.float32)[..., None], points)
    value = _look_up(np.where(usable[..., None], lacking, 0).astype(np.float32), points)
    smooth = [np.asarray(gaussian_filter(plane, WIDTH, mode="constant")) for plane in np.moveaxis(value, -1, 0)]
    near = np.asarray(gaussian_filter(share[..., 0], WIDTH, mode="constant"))
    field = (np.stack(smooth, axis=-1) / (near + FADING)[..., None]).astype(np.float32)
    gain = np.exp(cv2.resize(field, (width, height), interpolation=cv2.INTER_CUBIC))
    picture = replace(view.picture, radiance=(view.picture.radiance * gain).astype(np.float32))
    return replace(view, picture=picture)


def _look_up(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    rows = image.shape[0]
    return bilinear(wrapped(image), points[..., 0] * 2 * rows + 1, points[..., 1] * rows + 1)


def wrapped(image: np.ndarray) -> np.ndarray:
    """A lat-long image with one more cell on every side: round the seam, and over the poles to the other side."""
    half = image.shape[1] // 2
    tall = np.concatenate([np.roll(image[:1], half, 1), image, np.roll(image[-1:], half, 1)])
    return np.concatenate([tall[:, -1:], tall, tall[:, :1]], axis=1)


def lay_seams(views: Sequence[PanoramaView], seen: Coverage | None = None) -> Seams:
    """Lay the seams where the views agree.

    A front goes out from the middle of every view, within what it shows, and each cell belongs to the view whose front
    is there first. Where views differ fronts run fast, so that what moved between them is taken whole from one of them;
    they meet where views agree. Without differences that is the nearest view's axis.
    """
    seen = coverage(views, ROWS) if seen is None else seen
    grey = seen.logarithm.mean(-1)
    highest = np.where(seen.measured, grey, -np.inf).max(0)
    lowest = np.where(seen.measured, grey, np.inf).min(0)
    difference = np.where(seen.measured.sum(0) > 1, highest - lowest, 0.0)
    pace = 1 / (1 + (difference / DIFFERENCE).ravel())
    starts, ends, lengths = sphere_graph(seen.rows)
    costs = lengths * 0.5 * (pace[starts] + pace[ends])
    count = pace.size
    graph = sparse.csr_array((costs, (starts, ends)), (count, count))
    directions = LatLong().directions(pixel_points(LatLong(), seen.rows)).reshape(-1, 3)
    reached = np.full((len(views), count), np.inf)
    for index, view in enumerate(views):
        inside = np.flatnonzero(seen.covered[index])
        if not len(inside):
            continue
        off_axis = directions[inside] @ view.axis
        # Parts that no front reaches, cut off by what is outside the picture, come after all that one reaches.
        within = dijkstra(graph[inside][:, inside], indices=int(off_axis.argmax()))
        beyond = np.pi + angle_between(directions[inside], view.axis)
        reached[index, inside] = np.where(np.isfinite(within), within, beyond)
    first = reached.min(0)
    with np.errstate(invalid="ignore"):
        # Where fronts run fast a little behind is far behind: what moved is not seen through.
        late = np.where(np.isfinite(reached), (reached - first) / (SOFTNESS * pace), MOST)
    late = np.minimum(late, MOST).reshape(len(views), seen.rows, 2 * seen.rows).astype(np.float32)
    disputed = float(LatLong().solid_angles(seen.rows)[difference > MOVED].sum())
    return Seams(np.stack([wrapped(each) for each in late]), disputed)


@lru_cache(4)
def sphere_graph(rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Neighbouring cells of a lat-long map, over the seam and the poles: from, to, and the angle between, radians."""
    directions = LatLong().directions(pixel_points(LatLong(), rows)).reshape(-1, 3)
    cells = np.arange(2 * rows * rows).reshape(rows, 2 * rows)
    edged = wrapped(cells)
    starts, ends = [], []
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1), (0, -1), (-1, 0), (-1, -1), (-1, 1)):
        starts.append(cells.ravel())
        ends.append(edged[1 + down : rows + 1 + down, 1 + across : 2 * rows + 1 + across].ravel())
    start, end = np.concatenate(starts), np.concatenate(ends)
    # Over a pole a cell may be met twice, and its own neighbour from both sides; one edge is enough.
    keys = np.sort(start * len(directions) + end)  # np.unique by hashes takes ten times as long
    keys = keys[np.append(True, keys[1:] != keys[:-1])]
    start, end = keys // len(directions), keys % len(directions)
    start, end = start[start != end], end[start != end]
    chord = np.linalg.norm(directions[start] - directions[end], axis=-1)
    return start, end, 2 * np.arcsin(np.minimum(chord / 2, 1))


def blend(views: Sequence[PanoramaView], seams: Seams, size: int) -> EnvironmentMap:
    """The environment map of `size` rows that the views show.

    Radiance is averaged as it is, by weights that fall from one view to the next within half a degree of their seam. A
    saturated pixel never counts where another view measured the direction; where none did the highest bound is kept,
    and `clipped` says SATURATED. What no view sees is OUTSIDE and filled in (`fill`).
    """
    from relume.probe.panorama.kernel import add_view

    views = [shrunk(view, size / np.pi) for view in views]
    sides = [min(view.picture.size) for view in views]
    radiance = np.zeros((size, 2 * size, 3), np.float32)
    clipped = np.zeros((size, 2 * size), np.uint8)

    def work(begin: int, end: int) -> None:
        shape = (end - begin, 2 * size)
        total, bound, weight = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
        for view, cost, side in zip(views, seams.costs, sides, strict=True):
            shown = view_in_map(view, size, begin, end, CELLS)
            add_view(shown, cost, begin, size, RAMP * side, total, weight, bound)
        measured = weight > 0
        mean = total / np.where(measured, weight, 1)[..., None]
        radiance[begin:end] = np.where(measured[..., None], mean, bound)
        bounded = ~measured & (bound.max(-1) > 0)
        clipped[begin:end] = np.select([measured, bounded], [0, SATURATED], OUTSIDE)

    in_threads(work, size, chunk=STRIP)
    radiance = fill(radiance, clipped == OUTSIDE)
    return EnvironmentMap(radiance, LatLong(), views[0].picture.unit, clipped if clipped.any() else None)


def fill(radiance: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    """The map with what is unseen as smooth as can be: its logarithm is harmonic, bounded by what is seen.

    radiance : (rows, 2·rows, 3); unseen : (rows, 2·rows) bool
    Logarithms, so that a lamp at the rim of what is seen does not shine into it.
    """
    if not unseen.any() or unseen.all():
        return radiance
    rows = min(COARSE, radiance.shape[0])
    logarithm, known = _coarse_logarithm(radiance, ~unseen, rows)
    start, end, length = sphere_graph(rows)
    strength = 1 / np.maximum(length, 1e-3)
    count = known.size
    free = ~known.ravel()
    filled = logarithm.reshape(-1, 3)
    if free.any():
        links = sparse.csr_array((strength, (start, end)), (count, count))
        laplacian = sparse.csr_array(sparse.diags_array(links.sum(axis=1)) - links)
        inner = laplacian[free][:, free].tocsc()
        outer = -(laplacian[free][:, ~free] @ filled[~free])
        filled[free] = np.asarray(spsolve(inner, outer)).reshape(-1, 3)
    smooth = filled.reshape(rows, 2 * rows, 3)
    row, column = np.nonzero(unseen)
    scale = rows / radiance.shape[0]
    values = bilinear(wrapped(smooth), (column + 0.5) * scale + 1, (row + 0.5) * scale + 1)
    result = radiance.copy()
    result[row, column] = np.exp(values)
    return result


def _coarse_logarithm(radiance: np.ndarray, seen: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """The mean logarithm of what is seen in the cells of a coarser map, and which cells see anything."""
    lit = radiance[seen]
    least = 1e-4 * float(np.median(lit[lit > 0])) if np.any(lit > 0) else 1.0
    logarithm = np.where(seen[..., None], np.log(np.maximum(radiance, least)), 0)
    edges = (np.arange(rows) * radiance.shape[0]) // rows, (np.arange(2 * rows) * radiance.shape[1]) // (2 * rows)
    total = np.add.reduceat(np.add.reduceat(logarithm, edges[0], axis=0), edges[1], axis=1)
    count = np.add.reduceat(np.add.reduceat(seen.astype(float), edges[0], axis=0), edges[1], axis=1)
    return total / np.maximum(count, 1)[..., None], count > 0
