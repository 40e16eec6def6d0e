"""Pixels that are nothing but four directions: what a filter reads of a map, and what it should have read."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from relume.light.reflection.lobes import Mirror
from relume.renderers.prefiltered.filters import Filter, Spans
from relume.renderers.prefiltered.shading_inputs import Samples, term
from relume.scene.materials.reflective import Layer, Towards
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap

WHITE, BLACK = np.ones((1, 3)), np.zeros((1, 3))


def filtered(
    filter: Filter,
    light: EnvironmentMap,
    quads: np.ndarray,
    *,
    middles: np.ndarray | None = None,
    own: np.ndarray | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """What pixels with these corners (P, 4, 3) see of a mirror's map, (P, 3) float32.

    middles : (P, 3); the corners' mean unless given
    own : (P, 4) bool, which corners lie on the pixel's own surface; all unless given
    """
    count = len(quads)
    middles = normalised(quads.mean(1)) if middles is None else middles
    own = np.ones((count, 4), bool) if own is None else own
    # A table looked up by the view is looked up by the directions themselves.
    # In rows, as pictures have them: in another order of memory each kernel would be compiled once more.
    views, corners = (np.ascontiguousarray(each.reshape(-1, 3), np.float32) for each in (middles, quads))
    samples = Samples(
        views, views, np.zeros(count, np.int32), np.arange(4 * count, dtype=np.int32).reshape(-1, 4),
        corners, corners, np.where(own.reshape(-1), 0, -1).astype(np.int32),
    )  # fmt: skip
    seen = np.zeros((count, 4), np.float32)
    by_view = term(Layer(Mirror(), Towards.VIEWER), WHITE, BLACK)
    filter.add(
        seen, np.arange(count, dtype=np.int32), Spans(samples, threads), by_view, filter.prepared(light.radiance)
    )
    return seen[:, :3]


def supersampled(light: EnvironmentMap, quads: np.ndarray, side: int = 32) -> np.ndarray:
    """The mean of side² look-ups inside each pixel (P, 4, 3), its directions interpolated: (P, 3)."""
    place = (np.arange(side) + 0.5) / side
    right, down = (share[..., None, None] for share in np.meshgrid(place, place))
    upper = quads[:, 0] * (1 - right) + quads[:, 1] * right
    lower = quads[:, 3] * (1 - right) + quads[:, 2] * right
    return light.lookup(normalised(upper * (1 - down) + lower * down)).mean((0, 1))


def around(middles: ArrayLike, across: float, along: float | None = None, turn: float = 0.0) -> np.ndarray:
    """Rectangular pixels (P, 4, 3) about directions (P, 3), so many radians wide and high, turned about the middle."""
    middles = np.atleast_2d(middles)
    right = normalised(np.cross(middles, [0.31, 0.44, -0.84]))
    down = np.cross(middles, right)
    right, down = np.cos(turn) * right + np.sin(turn) * down, np.cos(turn) * down - np.sin(turn) * right
    x, y = np.tan(across / 2), np.tan((across if along is None else along) / 2)
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
    return normalised(np.stack([middles + a * right + b * down for a, b in corners], axis=1))
