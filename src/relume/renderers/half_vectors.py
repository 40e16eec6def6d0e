"""How directions are drawn for an isotropic BRDF that is only known by its values: a lobe of half vectors, fitted.

The lobe is constant within bins of θh, as dense as MERL's tables are. As of a surface of microfacets f is about
D(θh)/(4 cos²θh) where light comes back the way it came, and half vectors are drawn with the density D(θh)·cos θh.
Beside the lobe directions are drawn by the cosine; how many by which is by the angle of view.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

BINS = 256
"""Of θh, even in its square root: the lobe of polished metal, 0.2° wide, spans a dozen."""
COSINES = 32
"""Angles of view for which albedo and shares are tabulated, even in cos θ."""
LEAST = 0.1
"""Of the samples, to each of lobe and cosine: no weight exceeds ten times what the other alone would give."""
_ANGLES = np.radians([4.0, 12.0, 20.0, 28.0])
"""Differences θd over which the lobe's shape is averaged."""
_AROUND = 48


class BRDF(Protocol):
    """What is known of a surface."""

    def evaluate(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """f (…, 3) in 1/sr of pairs of unit vectors (…, 3), z the normal."""
        ...


@dataclass(frozen=True, eq=False)
class HalfVectorLobe:
    """The fitted lobe, and what the surface returns.

    edges : (BINS + 1,) 1 − cos θh between the bins, 0 to 1
    chances : (BINS,) of the bins; they add up to 1
    glossy : (COSINES,) share of the samples that are drawn by the lobe, at cosines of the view from 0 to 1
    albedo : (COSINES, 3) share of the light from there that is returned
    """

    edges: np.ndarray
    chances: np.ndarray
    glossy: np.ndarray
    albedo: np.ndarray


def fitted_lobe(brdf: BRDF) -> HalfVectorLobe:
    """The lobe of half vectors that fits a BRDF, found by evaluating it."""
    angles = np.pi / 2 * np.linspace(0, 1, BINS + 1) ** 2
    edges = 2 * np.sin(angles / 2) ** 2
    middle = (angles[:-1] + angles[1:]) / 2
    values = _facets(brdf, middle)
    floor = values[middle > np.radians(60)].min(axis=0)
    chances = np.maximum(values - floor, 0).max(axis=1) * np.cos(middle) ** 3 * np.diff(edges)
    if not chances.sum() > 0:
        chances = np.cos(middle) * np.diff(edges)
    chances /= chances.sum()
    albedo = directional_albedo(brdf, np.linspace(0, 1, COSINES))
    # As much of the light as is not diffuse, of each channel alike: the gloss of a yellow plastic is most of its blue.
    glossy = np.clip((1 - np.pi * floor / np.maximum(albedo, 1e-9)).mean(axis=1), LEAST, 1 - LEAST)
    return HalfVectorLobe(edges, chances, glossy, albedo)


def directional_albedo(brdf: BRDF, cosines: np.ndarray) -> np.ndarray:
    """(N, 3): the share of light from these cosines that is returned, by quadrature over half vectors.

    At grazing the integral has no end for a BRDF that grows as 1/cos there; cosines are taken from 0.002 on.
    """
    count = 2 * BINS
    steps = (np.arange(count) + 0.5) / count
    # Twice the square root: dense enough for a lobe of a tenth of a degree.
    theta = np.pi / 2 * steps**4
    weight = np.sin(theta) * 2 * np.pi * steps**3 / count * 2 * np.pi / _AROUND
    phi = (np.arange(_AROUND) + 0.5) * np.pi / _AROUND
    half = np.stack(
        [
            np.sin(theta)[:, None] * np.cos(phi),
            np.sin(theta)[:, None] * np.sin(phi),
            np.broadcast_to(np.cos(theta)[:, None], (count, _AROUND)),
        ],
        axis=-1,
    )
    found = np.empty((len(cosines), 3))
    for row, cosine in enumerate(np.clip(cosines, 2e-3, 1)):
        one = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
        facing = half @ one
        other = 2 * facing[..., None] * half - one
        seen = (facing > 0) & (other[..., 2] > 0)
        values = brdf.evaluate(np.broadcast_to(one, other.shape)[seen], other[seen])
        jacobian = np.broadcast_to(weight[:, None], seen.shape)[seen] * 4 * facing[seen] * other[..., 2][seen]
        found[row] = jacobian @ values
    return found


def _facets(brdf: BRDF, theta: np.ndarray) -> np.ndarray:
    """f (N, 3) by θh, averaged over small differences."""
    values = []
    for difference in _ANGLES:
        sine, cosine = np.sin(difference), np.cos(difference)
        # φd = 90°: both directions are as far from the normal as each other.
        up, level = np.cos(theta) * cosine, np.sin(theta) * cosine
        one = np.stack([level, np.full_like(theta, sine), up], -1)
        values.append(brdf.evaluate(one, one * [1, -1, 1]))
    return np.mean(values, axis=0)
