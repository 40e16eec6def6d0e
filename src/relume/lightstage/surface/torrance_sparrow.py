"""What a rough surface reflects besides its facets' distribution: the G and F of Torrance and Sparrow (1967).

The surface is made of V-shaped grooves whose sides are small mirrors. F is what such a mirror reflects, G the part of
them that neither lies in another's shadow nor is hidden by one. All directions are unit vectors (…, 3) in one frame:
`view` and `light` away from the surface, `normal` outward; arrays broadcast against each other.
"""

from __future__ import annotations

import numpy as np

from relume.light.reflection.weights import Fresnel

SKIN = 1.4
"""Index of refraction of skin: of the oil on it and of its dead outer cells, measured between 1.37 and 1.5 for visible
light. Between these bounds F at normal incidence goes from 2.4 % to 4 %, but eq. 9 needs only how F rises from there
to grazing angles, which hardly differs."""
LEAST_COSINE = 1e-3
"""Cosines below this, 0.06° from the horizon, count as this: G/cos stays finite there, but 0/0 has no value."""


def half_vector(view: np.ndarray, light: np.ndarray) -> np.ndarray:
    """The normal (…, 3) of the facets that mirror the light to the viewer; +Y where the two are opposite."""
    total = np.asarray(view + light, np.float64)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return np.where(length > 1e-9, total / np.maximum(length, 1e-9), [0.0, 1.0, 0.0])


def mirrored(half: np.ndarray, view: np.ndarray) -> np.ndarray:
    """The direction (…, 3) from which light is mirrored to the viewer by facets of normal `half`: 2 (h·v) h − v."""
    return 2 * _dot(half, view)[..., None] * half - view


def grooved_reflection(view: np.ndarray, light: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """G F / (n·v) (…), above 0: radiance by the density of facets along the half vector, but for a factor.

    It is the part of a specular reflectance function that depends on the view. Where view or light is below the horizon
    it is that of the horizon.
    Source: Debevec et al. 2000, eq. 8, with the light's irradiance and the 4 left out.
    """
    half = half_vector(view, light)
    across = np.maximum(_dot(view, half), LEAST_COSINE)
    towards_view = np.maximum(_dot(view, normal), LEAST_COSINE)
    towards_light = np.maximum(_dot(light, normal), LEAST_COSINE)
    # G and n·v divided by each other before either is 0.
    masked = 2 * np.maximum(_dot(half, normal), LEAST_COSINE) / across
    attenuated = np.minimum(1 / towards_view, masked * np.minimum(1.0, towards_light / towards_view))
    return attenuated * Fresnel(SKIN)(across)


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.sum(np.asarray(first) * second, axis=-1)
