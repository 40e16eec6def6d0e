"""Views of a panorama brought into one environment map along their seams; what none sees is filled in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from relume.image.bilinear import bilinear
from relume.image.radiance import OUTSIDE, SATURATED
from relume.probe.panorama.coverage import shrunk, view_in_map
from relume.probe.panorama.seams import Seams, sphere_graph, wrapped
from relume.probe.panorama.views import PanoramaView
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong

CELLS = 2
"""Look-ups a pixel of the map and side: a view's corners are finer than its middle."""
STRIP = 32
"""Rows at a time: what the views show in them stays small."""
RAMP = 0.01
"""Of a picture's shorter side, over which its weight rises from its rim, where lenses are worst."""
COARSE = 96
"""Rows of the map in which what no view sees is filled in."""


def blend(views: Sequence[PanoramaView], seams: Seams, size: int, margin: float = 0.0) -> EnvironmentMap:
    """The environment map of `size` rows that the views show.

    Radiance is averaged as it is, by weights that fall from one view to the next within half a degree of their seam. A
    saturated pixel never counts where another view measured the direction; where none did the highest bound is kept,
    and `clipped` says SATURATED. What no view sees is OUTSIDE and filled in (`fill`).

    margin : share of a picture's shorter side that it goes on beyond its rim, for views that only touch
    """
    from relume._kernel import in_threads
    from relume.probe.panorama.kernel import add_view

    views = [shrunk(view, size / np.pi) for view in views]
    sides = [min(view.picture.size) for view in views]
    radiance = np.zeros((size, 2 * size, 3), np.float32)
    clipped = np.zeros((size, 2 * size), np.uint8)

    def work(begin: int, end: int) -> None:
        shape = (end - begin, 2 * size)
        total, bound, weight = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
        for view, cost, side in zip(views, seams.costs, sides, strict=True):
            shown = view_in_map(view, size, begin, end, CELLS, margin * side)
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
