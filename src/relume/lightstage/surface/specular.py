"""The specular lobe of each pixel: how much is reflected at the surface, and how rough it is.

A lobe of microfacets is fitted to the separated specular reflectance function: the GGX distribution of the half
vector with Smith's masking (Walter et al. 2007, eq. 20, 33, 34) and a dielectric's rise of reflectance at grazing
angles. Values are per unit of irradiance, so a lobe is F(v·h) D(h) G / (4 n·v).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.lightstage.field.lights import StageLights


@dataclass(frozen=True)
class SpecularFit:
    """How the roughness is searched, coarse to fine.

    lowest, highest : bounds of α, the square of the perceptual roughness. Narrower lobes than half the lights'
        spacing are never resolved and come out at the lowest bound or by chance
    coarse : candidates at first, even in log α
    halvings : times that the search closes in about the best by half
    """

    lowest: float = 0.03
    highest: float = 1.0
    coarse: int = 12
    halvings: int = 4

    def __post_init__(self) -> None:
        if not 0 < self.lowest < self.highest <= 1 or self.coarse < 3 or self.halvings < 0:
            raise ValueError(f"{self}: expected 0 < lowest < highest ≤ 1 and 3 or more candidates")


@dataclass(frozen=True, eq=False)
class SpecularLobes:
    """Specular lobes of P pixels.

    alpha : (P,) float32, GGX's width, the square of the perceptual roughness; 0 where no lobe could be fitted
    reflectance : (P,) float32, of the surface at normal incidence (F0)
    """

    alpha: np.ndarray
    reflectance: np.ndarray


def specular_lobes(
    values: np.ndarray,
    lights: StageLights,
    normal: np.ndarray,
    view: np.ndarray,
    usable: np.ndarray,
    fit: SpecularFit = SpecularFit(),
) -> SpecularLobes:
    """The GGX lobe nearest each pixel's specular values, by least squares over the solid angle.

    values : (N, P), specular brightness; normal, view : (P, 3), unit, world; usable : bool (N, P), lights that count
    """
    directions = lights.directions.astype(np.float32)
    incident = directions @ normal.T
    outgoing = np.einsum("pk,pk->p", normal, view)
    # |l + v|² = 2 + 2 l·v, and n·h = (n·l + n·v) / |l + v|.
    length = np.sqrt(np.maximum(2 + 2 * (directions @ view.T), 1e-12))
    half_normal, half_view = np.clip((incident + outgoing) / length, 0, 1), length / 2
    rise = schlick_rise(half_view)
    weights = usable * (incident > 0) * lights.solid_angles.astype(np.float32)[:, None]
    incident = np.maximum(incident, 0)
    outgoing = np.maximum(outgoing, 1e-3)

    def nearest(alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        lobe = rise * _lobe(alpha, half_normal, incident, outgoing)
        product, square = (weights * values * lobe).sum(axis=0), (weights * lobe**2).sum(axis=0)
        scale = np.maximum(product, 0) / np.maximum(square, 1e-30)
        return scale, scale * product  # by which the squared error falls

    step = np.log(fit.highest / fit.lowest) / (fit.coarse - 1)
    best = np.full(len(normal), fit.lowest, np.float32)
    scale, gain = nearest(best)

    def tried(alpha: np.ndarray) -> None:
        nonlocal best, scale, gain
        found, won = nearest(alpha)
        better = won > gain
        best, scale, gain = np.where(better, alpha, best), np.where(better, found, scale), np.where(better, won, gain)

    for index in range(1, fit.coarse):
        tried(np.full_like(best, fit.lowest * np.exp(index * step)))
    for _ in range(fit.halvings):
        step /= 2
        centre = best
        for sign in (-1, 1):
            tried(np.clip(centre * np.float32(np.exp(sign * step)), fit.lowest, fit.highest).astype(np.float32))
    known = (scale > 0) & (np.einsum("pk,pk->p", normal, view) > 0)
    return SpecularLobes(np.where(known, best, 0).astype(np.float32), np.where(known, scale, 0).astype(np.float32))


def schlick_rise(half_view: np.ndarray, reflectance: float = 0.04) -> np.ndarray:
    """F(v·h)/F0 of a dielectric, 0.04 at normal incidence as of glass, skin and paint (Schlick 1994)."""
    return np.asarray(1 + (1 - reflectance) / reflectance * (1 - half_view) ** 5)


def _lobe(alpha: np.ndarray, half_normal: np.ndarray, incident: np.ndarray, outgoing: np.ndarray) -> np.ndarray:
    """D G / (4 n·v) for GGX's widths (P,) and cosines (N, P) and (P,)."""
    square = alpha**2
    distribution = square / (np.pi * (half_normal**2 * (square - 1) + 1) ** 2)
    # Smith's G₁ over its cosine; the light's cosine returns with the irradiance.
    shadowing = 2 * incident / np.maximum(incident + np.sqrt(square + (1 - square) * incident**2), 1e-12)
    masking = 2 / (outgoing + np.sqrt(square + (1 - square) * outgoing**2))
    return np.asarray(distribution * shadowing * masking / 4)
