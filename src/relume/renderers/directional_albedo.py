"""Tables of how much of the light from one direction a lobe sends back in all: what layered surfaces share out by."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

COSINES = ROUGHNESSES = 32
"""Nodes of the tables, even in √cos θ and in perceptual roughness; bilinear between them errs by less than 0.003."""
COAT_IOR = 1.5
"""Index of refraction of KHR_materials_clearcoat's coat."""
NARROWEST = 1e-3
"""The least α of a microfacet lobe, as Mitsuba's `principled` has it: narrower ones are no numbers in float32."""
NARROWEST_SHEEN = 0.07
"""The least sheen roughness: fibres closer to the normal than its α = 0.0049 reflect nothing a picture could show."""


def nodes() -> tuple[np.ndarray, np.ndarray]:
    """Cosines and perceptual roughnesses at the nodes."""
    return np.linspace(0, 1, COSINES) ** 2, np.linspace(0, 1, ROUGHNESSES)


def fresnel(cosine: np.ndarray, ior: float) -> np.ndarray:
    """Fresnel's reflectance of unpolarised light that enters a dielectric of `ior` ≥ 1."""
    cosine = np.clip(np.asarray(cosine, float), 0, 1)
    inner = np.sqrt(1 - (1 - cosine**2) / ior**2)
    parallel = (ior * cosine - inner) / np.maximum(ior * cosine + inner, 1e-12)
    across = (cosine - ior * inner) / np.maximum(cosine + ior * inner, 1e-12)
    return 0.5 * (parallel**2 + across**2)


def rise(cosine: np.ndarray, ior: float) -> np.ndarray:
    """How far Fresnel's reflectance has risen from its value at the normal (0) to 1 at grazing."""
    # Without a step of the index nothing rises but at grazing: Schlick's curve stands for the limit.
    if ior < 1.0001:
        return (1 - np.asarray(cosine, float)) ** 5
    normal = ((ior - 1) / (ior + 1)) ** 2
    return (fresnel(cosine, ior) - normal) / (1 - normal)


@lru_cache(maxsize=64)
def ggx_shares(ior: float) -> np.ndarray:
    """(ROUGHNESSES, COSINES, 2) float32: (A, B) so that a GGX lobe of F₀ and F₉₀ returns F₀·A + F₉₀·B.

    The split is by `rise`: F = F₀ + (F₉₀ − F₀)·rise.
    """
    cosines, roughnesses = nodes()
    steps = (np.arange(32) + 0.5) / 32
    # Denser towards u = 1: there lies GGX's long tail, much of which leaves below the surface.
    u, v = (grid.ravel() for grid in np.meshgrid(1 - steps**2, steps))
    share = 2 * np.sqrt(1 - u) / u.size
    table = np.empty((ROUGHNESSES, COSINES, 2), np.float32)
    for row, roughness in enumerate(roughnesses):
        alpha = max(roughness**2, NARROWEST)
        weight, facing = _visible_normals(np.maximum(cosines, 1e-4)[:, None], alpha, u, v)
        risen = rise(facing, ior)
        table[row, :, 0] = (weight * (1 - risen)) @ share
        table[row, :, 1] = (weight * risen) @ share
    table.setflags(write=False)
    return table


def _visible_normals(cosine: np.ndarray, alpha: float, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights G₂/G₁ and cosines to the microfacet of directions drawn by the normals that are visible.

    Heitz 2018, "Sampling the GGX distribution of visible normals".
    """
    # Stretch the view, draw on the half disc that it sees, and unstretch.
    sine = np.sqrt(1 - cosine**2)
    x, z = alpha * sine, cosine
    length = np.hypot(x, z)
    x, z = x / length, z / length
    radius, angle = np.sqrt(u), 2 * np.pi * v
    across, along = radius * np.cos(angle), radius * np.sin(angle)
    s = 0.5 * (1 + z)
    along = (1 - s) * np.sqrt(1 - across**2) + s * along
    up = np.sqrt(np.maximum(1 - across**2 - along**2, 0))
    # In the frame of the stretched view: across is y, along is (−z, 0, x).
    normal_x, normal_z = -along * z + up * x, along * x + up * z
    normal_z = np.maximum(normal_z, 0)
    length = np.sqrt((alpha * normal_x) ** 2 + (alpha * across) ** 2 + normal_z**2)
    normal_x, normal_z = alpha * normal_x / length, normal_z / length
    facing = np.clip(sine * normal_x + cosine * normal_z, 0, 1)
    out = 2 * facing * normal_z - cosine
    # Masked separately, G₂/G₁ is the masking of the way out.
    return np.where(out > 0, _smith(np.clip(out, 1e-6, 1), alpha), 0), facing


def _smith(cosine: np.ndarray, alpha: float) -> np.ndarray:
    """G₁ of GGX (Walter and others 2007), with which separable G₂ = G₁·G₁, as Mitsuba has it."""
    return 2 / (1 + np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)))


@lru_cache(maxsize=1)
def sheen_shares() -> np.ndarray:
    """(ROUGHNESSES, COSINES, 2) float32: what a white sheen lobe returns as it is bounded, and as it is written.

    As written it returns up to five times what it gets at grazing; `1 / max(1, both directions' share)` bounds it and
    leaves it reciprocal.
    """
    written = _sheen_albedo(lambda row, column, out: np.ones_like(out))
    places = np.linspace(0, 1, COSINES)

    def bound(row: int, column: int, out: np.ndarray) -> np.ndarray:
        other = np.interp(np.sqrt(out), places, written[row])
        return 1 / np.maximum(np.maximum(other, written[row, column]), 1)

    table = np.stack([_sheen_albedo(bound), written], axis=-1)
    table.setflags(write=False)
    return table


def _sheen_albedo(factor: Callable[[int, int, np.ndarray], np.ndarray]) -> np.ndarray:
    """(ROUGHNESSES, COSINES): the lobe times `factor(row, column, outgoing cosines)` over the hemisphere."""
    cosines, roughnesses = nodes()
    count = 128
    edge = (np.arange(count) + 0.5) / count
    # Denser towards grazing, where fibres shine.
    out, weight = edge**2, 2 * edge / count
    angle = edge * np.pi
    table = np.empty((ROUGHNESSES, COSINES), np.float32)
    for column, cosine in enumerate(np.maximum(cosines, 1e-3)):
        product = np.sqrt((1 - cosine**2) * (1 - out**2))[:, None] * np.cos(angle) + (cosine * out)[:, None]
        half = np.clip((cosine + out)[:, None] / np.sqrt(np.maximum(2 + 2 * product, 1e-12)), 0, 1)
        for row, roughness in enumerate(roughnesses):
            value = sheen(half, cosine, out[:, None], roughness).mean(axis=1)
            table[row, column] = 2 * np.pi * (value * factor(row, column, out) * out) @ weight
    return table


def sheen(half: np.ndarray, cosine_in: float, cosine_out: np.ndarray, roughness: float) -> np.ndarray:
    """The sheen BRDF of KHR_materials_sheen: Estevez and Kulla's "Charlie" over Ashikhmin's visibility.

    half : cosine between the normal and the half vector
    """
    inverse = 1 / max(roughness, NARROWEST_SHEEN) ** 2
    distribution = (2 + inverse) * (1 - half**2) ** (inverse / 2) / (2 * np.pi)
    return distribution / (4 * (cosine_in + cosine_out - cosine_in * cosine_out))
