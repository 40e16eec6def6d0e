"""Marks that are the ends of their edges: they say where along an edge it ends, beside where it runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.scene.places.fitting import Fit, about_y
from relume.scene.places.sightings import corner_errors

REACH = 10.0
"""Standard deviations of a mark from where an edge ends, beyond which it was cut off there by what hides the rest."""


def with_ends(fit: Fit, values: np.ndarray) -> Fit:
    """The fit in which the outermost two marks of each straight edge are corners, where they lie near its ends.

    values : of a fit of the same marks as points on their edges, which says which mark is which end
    """
    marks = fit.marks
    rows = marks.segments.reshape(-1)
    one = np.concatenate([[1.0], values[: len(fit.model.lengths)]])
    turned, position, focal = fit.cameras(values)
    start, k = np.stack([view.rotation for view in fit.views]), marks.photograph[rows]
    upright = about_y(fit.angles(values)[marks.turn[rows]])
    away = np.empty((2, len(rows)))
    for end in (0, 1):
        points = np.einsum("nij,nj->ni", upright, marks.ends[rows, end] @ one)
        off = corner_errors(points, turned[k], position[k], focal[k], start[k], fit.seen[rows])
        away[end] = np.hypot(*off.reshape(2, -1))
    # Of each pair one mark is one end and the other the other.
    swap = away[1, 0::2] + away[0, 1::2] < away[0, 0::2] + away[1, 1::2]
    end = np.stack([swap.astype(int), 1 - swap.astype(int)], axis=1).reshape(-1)
    near = away[end, np.arange(len(rows))] < REACH * fit.deviation
    rows, end = rows[near], end[near]
    kept = np.ones(len(marks.photograph), bool)
    kept[rows] = False
    number = np.cumsum(kept) - 1
    lines, labels = len(kept), marks.labels
    found = replace(
        marks,
        photograph=marks.photograph[kept], turn=marks.turn[kept], pixels=marks.pixels[kept], ends=marks.ends[kept],
        directions=marks.directions[kept], segments=marks.segments[:0],
        corner_photograph=np.concatenate([marks.corner_photograph, marks.photograph[rows]]),
        corner_turn=np.concatenate([marks.corner_turn, marks.turn[rows]]),
        corner_pixels=np.concatenate([marks.corner_pixels, marks.pixels[rows]]),
        corner_points=np.concatenate([marks.corner_points, marks.ends[rows, end]]),
        labels=(*(labels[i] for i in np.flatnonzero(kept)), *labels[lines:], *(labels[i] for i in rows)),
        # Curves have no ends; their rows move up.
        curves=tuple(replace(curve, rows=number[curve.rows]) for curve in marks.curves),
    )  # fmt: skip
    return replace(fit, marks=found, seen=fit.seen[kept], corner_seen=np.concatenate([fit.corner_seen, fit.seen[rows]]))
