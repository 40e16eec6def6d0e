"""Gloss that varies over a surface, and metals, from several photographs: what each place sends to several eyes.

A photograph fixes one number a channel at each place, and the diffuse part takes it all. From a second eye, or under
another light, the diffuse part is the same and the gloss is not. For a roughness, what a place sends is linear in its
diffuse reflectance and in F₀ (Schlick 1994). So both follow from linear least squares: the diffuse part of each place,
and the gloss of a neighbourhood. The roughness is the one that leaves the least. A metal has no diffuse part, and a
coloured F₀: where that explains as much with fewer numbers, the surface is one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from relume.composite.surface.gloss import USUAL, USUALLY, Gloss, glossy

ROUGHNESSES = (0.1, 0.15, 0.2, 0.25, 0.3, 0.37, 0.45, 0.53, 0.62, 0.72, 0.85)
"""That are tried; between them the misfit is a parabola."""
LEVELS = (0.02, 0.06)
"""F₀ between which what is reflected is taken to be linear, as Schlick's law has it."""
LARGEST = 0.3
"""F₀ of dielectrics at most, as in `gloss`."""
METALLIC = 0.35
"""F₀ of metals at least, in their brightest channel: iron's is 0.5, and platinum's 0.6."""
MODEL = 0.03
"""Share by which light and model are off, beside the photograph's own noise."""
OUTLIER = 3.0
"""Errors from which on an observation counts for less."""
ROUNDS = 3
"""Of weights for outliers."""


@dataclass(frozen=True, eq=False)
class Observations:
    """What K views show of N places.

    radiance : (K, N, 3), NaN where a view does not show the place
    variance : (K, N, 3), of the photographs' noise
    groups : (N,) int, neighbourhoods that share a gloss, from 0
    """

    radiance: np.ndarray
    variance: np.ndarray
    groups: np.ndarray


@dataclass(frozen=True, eq=False)
class VaryingGloss:
    """The gloss of each neighbourhood, G of them, and how well it is known: one standard deviation each.

    f0, f0_error : (G, 3); of a dielectric alike in all channels
    roughness, roughness_error : (G,)
    metal : (G,) bool
    determined : (G,) bool, whether the views say more than what such surfaces usually are
    diffuse, diffuse_error : (N, 3), of each place; 0 for metals
    """

    f0: np.ndarray
    f0_error: np.ndarray
    roughness: np.ndarray
    roughness_error: np.ndarray
    metal: np.ndarray
    determined: np.ndarray
    diffuse: np.ndarray
    diffuse_error: np.ndarray


def fit_varying_gloss(
    seen: Observations, lights: Sequence[Callable[[Gloss], tuple[np.ndarray, np.ndarray]]]
) -> VaryingGloss:
    """Find gloss, diffuse reflectance and metals from what several views show.

    lights : one for each view: the gloss, and the base per unit of albedo, (N, 3) each, that places of a `Gloss` send
        to it

    What few views leave open is taken from what such surfaces usually are, F₀ 0.04 ± 0.02 and roughness 0.5 ± 0.3, and
    the errors say so. Raises ValueError for a single view, which determines nothing.
    """
    if len(lights) < 2 or len(seen.radiance) != len(lights):
        raise ValueError(f"{len(seen.radiance)} views and {len(lights)} lights; a gloss that varies needs two or more")
    fits = [_Linear.of(seen, lights, roughness) for roughness in ROUGHNESSES]
    count = int(seen.groups.max()) + 1
    dielectric = np.stack([fit.misfit(metal=False) for fit in fits], axis=-1)
    metallic = np.stack([fit.misfit(metal=True) for fit in fits], axis=-1)
    observed = np.maximum(np.bincount(seen.groups, fits[0].observed, count), 1)
    places = np.bincount(seen.groups, minlength=count)
    # Numbers that each explanation has; a misfit per freedom below 1 would be luck.
    free = np.stack([3 * places + 2, np.full(count, 4)])
    best = np.stack([dielectric.min(axis=-1), metallic.min(axis=-1)])
    scale = np.maximum(best.min(axis=0) / np.maximum(observed - free.min(axis=0), 1), 1.0)
    # What each leaves, and twice the numbers it has (Akaike 1974).
    criterion = best / scale + 2 * free
    # The roughness, and with it the rest.
    prior = ((np.array(ROUGHNESSES) - USUAL[1]) / USUALLY[1]) ** 2 * scale[:, None]
    result = []
    for metal, misfit in ((False, dielectric), (True, metallic)):
        roughness, error = _lowest(misfit + prior, scale)
        f0, f0_error = (np.stack(each) for each in zip(*(fit.f0(metal) for fit in fits), strict=True))
        # A roughness that is a little off is made up for by another F₀.
        shift = _between(f0, roughness + error / 2) - _between(f0, roughness - error / 2)
        spread = np.hypot(_between(f0_error, roughness) * np.sqrt(scale)[:, None], shift)
        result.append((_between(f0, roughness), spread, roughness, error))
    metal = (criterion[1] < criterion[0]) & (result[1][0].max(axis=-1) > METALLIC) & (observed >= free[1] + 3)
    f0, f0_error, roughness, roughness_error = (
        np.where(metal.reshape(-1, *[1] * (one.ndim - 1)), two, one)
        for one, two in zip(*result, strict=True)
    )  # fmt: skip
    diffuse, diffuse_error = (
        _between(np.stack(each), roughness[seen.groups])
        for each in zip(*(fit.diffuse(f0) for fit in fits), strict=True)
    )  # fmt: skip
    metals = metal[seen.groups][:, None]
    enough = np.maximum(0.7 * USUALLY[0], 0.4 * f0.max(axis=-1))
    known = (roughness_error < 0.7 * USUALLY[1]) & (f0_error.max(axis=-1) < enough)
    return VaryingGloss(
        f0, f0_error, roughness, roughness_error, metal, known, np.where(metals, 0.0, diffuse),
        np.where(metals, 0.0, diffuse_error * np.sqrt(scale)[seen.groups][:, None]),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Linear:
    """The least squares at one roughness: sums over views of each place, from which F₀ and the diffuse part follow.

    y, base, slope, weight : (K, N, 3) what is seen less what any gloss reflects; the base; what grows with F₀; weights
    groups : (N,)
    """

    y: np.ndarray
    base: np.ndarray
    slope: np.ndarray
    weight: np.ndarray
    groups: np.ndarray
    observed: np.ndarray

    @staticmethod
    def of(
        seen: Observations, lights: Sequence[Callable[[Gloss], tuple[np.ndarray, np.ndarray]]], roughness: float
    ) -> _Linear:
        low, high = LEVELS
        at = [(light(Gloss(low, roughness)), light(Gloss(high, roughness))) for light in lights]
        slope = np.stack([(b[0] - a[0]) / (high - low) for a, b in at])
        base = np.stack([(a[1] + b[1]) / 2 for a, b in at])
        known = np.isfinite(seen.radiance)
        shown = np.where(known, seen.radiance, 0.0)
        y = np.where(known, shown - np.stack([a[0] for a, _ in at]) + low * slope, 0.0)
        weight = known / np.maximum(seen.variance + (MODEL * np.abs(shown)) ** 2, 1e-30)
        fit = _Linear(y, base, slope, weight, seen.groups, known.sum(axis=(0, 2)))
        # What a thing that is not of the surface shows, as a reflection of the camera's stand, counts for less.
        for _ in range(ROUNDS):
            off = fit._left(False) ** 2 * weight
            fit = _Linear(y, base, slope, weight / (1 + off / OUTLIER**2), seen.groups, fit.observed)
        return fit

    def f0(self, metal: bool) -> tuple[np.ndarray, np.ndarray]:
        """(G, 3), and its errors without the scale of the misfit."""
        count = int(self.groups.max()) + 1
        if metal:
            grown = self._summed((self.weight * self.slope**2).sum(axis=0), count)
            value = self._summed((self.weight * self.slope * self.y).sum(axis=0), count) / np.maximum(grown, 1e-30)
            return np.clip(value, 0, 1), 1 / np.sqrt(np.maximum(grown, 1e-30))
        # The diffuse part of each place is eliminated first (Schur's complement); F₀ is alike in all channels.
        square, cross, right = self._sums()
        grown = (self.weight * self.slope**2).sum(axis=0) - cross**2 / square
        aim = (self.weight * self.slope * self.y).sum(axis=0) - cross * right / square
        strength = np.bincount(self.groups, grown.sum(axis=-1), count) + 1 / USUALLY[0] ** 2
        value = (np.bincount(self.groups, aim.sum(axis=-1), count) + USUAL[0] / USUALLY[0] ** 2) / strength
        error = 1 / np.sqrt(strength)
        return np.repeat(np.clip(value, 0, LARGEST)[:, None], 3, axis=1), np.repeat(error[:, None], 3, axis=1)

    def diffuse(self, f0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) of each place under the gloss (G, 3) of its neighbourhood, and the error."""
        square, cross, right = self._sums()
        return np.maximum((right - cross * f0[self.groups]) / square, 0), 1 / np.sqrt(square)

    def misfit(self, metal: bool) -> np.ndarray:
        """(G,) χ² of what is left."""
        left = (self._left(metal) ** 2 * self.weight).sum(axis=(0, 2))
        return np.bincount(self.groups, left, int(self.groups.max()) + 1)

    def _left(self, metal: bool) -> np.ndarray:
        f0 = self.f0(metal)[0]
        gloss = self.slope * f0[self.groups]
        return self.y - gloss - (0.0 if metal else self.base * self.diffuse(f0)[0])

    def _sums(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        square = np.maximum((self.weight * self.base**2).sum(axis=0), 1e-30)
        return (
            square,
            (self.weight * self.base * self.slope).sum(axis=0),
            (self.weight * self.base * self.y).sum(axis=0),
        )

    def _summed(self, values: np.ndarray, count: int) -> np.ndarray:
        return np.stack([np.bincount(self.groups, values[:, channel], count) for channel in range(3)], axis=-1)


def _lowest(misfit: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Roughness (G,) where a parabola about the least of the misfits (G, R) is lowest; its error."""
    tried = np.array(ROUGHNESSES)
    middle = np.clip(np.argmin(misfit, axis=-1), 1, len(tried) - 2)
    rows = np.arange(len(misfit))
    x = np.stack([tried[middle + step] for step in (-1, 0, 1)])
    y = np.stack([misfit[rows, middle + step] for step in (-1, 0, 1)])
    first, second = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    curve = (second - first) / (x[2] - x[0])
    lowest = np.where(
        curve > 0, (x[0] + x[1]) / 2 - first / (2 * np.where(curve > 0, curve, 1.0)), tried[np.argmin(misfit, -1)]
    )
    error = np.where(curve > 0, np.sqrt(scale / np.maximum(curve, 1e-30)), USUALLY[1])
    # Between tried roughnesses none is known better than a quarter of their distance.
    return np.clip(lowest, tried[0], tried[-1]), np.clip(np.hypot(error, (x[2] - x[0]) / 8), 0, USUALLY[1])


def _between(values: np.ndarray, roughness: np.ndarray) -> np.ndarray:
    """Values (R, M, 3) of the tried roughnesses at other ones (M,), linear between: (M, 3)."""
    tried = np.array(ROUGHNESSES)
    low = np.clip(np.searchsorted(tried, roughness) - 1, 0, len(tried) - 2)
    share = np.clip((roughness - tried[low]) / (tried[low + 1] - tried[low]), 0, 1)[:, None]
    rows = np.arange(values.shape[1])
    return (1 - share) * values[low, rows] + share * values[low + 1, rows]


def gloss_lights(
    split: Callable[..., tuple[np.ndarray, np.ndarray]],
) -> Callable[[Gloss], tuple[np.ndarray, np.ndarray]]:
    """What `Arriving.gloss_and_base` gives for materials, for a `Gloss`."""
    return lambda gloss: split(glossy((1.0, 1.0, 1.0), gloss))
