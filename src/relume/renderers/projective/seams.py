"""How well the photographs of a baked place agree where several show it: what its seams are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from relume.image.colour import luminance
from relume.renderers.projective.baking import BakedPlace
from relume.renderers.projective.photographs import ProjectedPhotograph, projectors
from relume.renderers.raytrace.raycast import RayCaster

PLACES = 20_000
"""Texels that photographs are compared at."""
SURELY = 0.25
"""Of its say that a photograph needs to count: beside edges and borders it is not believed."""
FEW = 30
"""Texels from which on a ratio of two photographs is known."""


@dataclass(frozen=True)
class Seams:
    """How photographs differ where two or more show one place.

    shared : share of the seen surface that two or more photographs show
    typical, worst : the median and the 95th percentile of how far they lie apart there, as a share of their mean
    gains : by name, how many times as bright as the middle one each photograph is, of those that it shares places
        with, itself or through others; NaN where it shares too little
    """

    shared: float
    typical: float
    worst: float
    gains: dict[str, float]


def seams(place: BakedPlace, photographs: Sequence[ProjectedPhotograph]) -> Seams:
    """Compare the photographs that a place was baked from, at its own texels, by luminance.

    place : as `bake` made it
    photographs : that it was baked from

    Photographs of one exposure on one scale differ by gloss and by what the model lacks. One whose gain is far from 1
    was exposed or merged on another scale. Raises ValueError for no photographs.
    """
    points = np.concatenate([part.points[part.used & part.seen] for part in place.parts]).astype(np.float64)
    points = points[:: max(1, len(points) // PLACES)]
    shown = np.full((len(photographs), len(points)), np.nan)
    for row, projector in zip(shown, projectors(photographs, RayCaster.of(place.meshes())), strict=True):
        at, say = projector.sees(points)
        there = np.flatnonzero(say > SURELY)
        row[there] = luminance(projector.shown(at[there]))
    values = np.log(np.where(shown > 0, shown, np.nan))
    both = np.isfinite(values).sum(axis=0) >= 2
    if not both.any():
        return Seams(0.0, 0.0, 0.0, {each.name: float("nan") for each in photographs})
    apart = np.expm1(np.nanmax(values[:, both], axis=0) - np.nanmin(values[:, both], axis=0))
    # A ratio r of two lies 2 (r − 1) / (r + 1) of their mean apart.
    apart = 2 * apart / (apart + 2)
    gains = dict(zip((each.name for each in photographs), _gains(values).tolist(), strict=True))
    return Seams(float(both.mean()), float(np.median(apart)), float(np.quantile(apart, 0.95)), gains)


def _gains(values: np.ndarray) -> np.ndarray:
    """(K,) of logarithms (K, N): the gains that explain all pairs' ratios, least squares, over their group's median.

    A group shares places, from one photograph to the next; across groups nothing is known. NaN of what shares too
    little with any other.
    """
    from scipy.sparse.csgraph import connected_components

    count = len(values)
    rows, ratios, linked = [], [], np.zeros((count, count), bool)
    for i, j in combinations(range(count), 2):
        apart = values[i] - values[j]
        if (known := int(np.isfinite(apart).sum())) >= FEW:
            row = np.zeros(count)
            row[i], row[j] = np.sqrt(known), -np.sqrt(known)
            rows.append(row)
            linked[i, j] = True
            ratios.append(np.sqrt(known) * np.nanmedian(apart))
    if not rows:
        return np.full(count, np.nan)
    logs = np.linalg.lstsq(np.array(rows), np.array(ratios), rcond=None)[0]
    groups = connected_components(linked, directed=False)[1]
    middles = np.array([np.median(logs[groups == group]) for group in groups])
    return np.where((linked | linked.T).any(axis=0), np.exp(logs - middles), np.nan)
