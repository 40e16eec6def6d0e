"""Surface normals from reflectance functions: the Lambertian lobe that fits each pixel's diffuse values in its light.

A lobe is a vector b (world frame) with value = max(b · l, 0) for light from l: its direction is the normal, its length
albedo/π. Debevec et al. 2000, §4.2, search it directly; here the same lobe is found by reweighted least squares.

Which lights reach a pixel straight (§4.4, Fig. 13) is found by brightness alone, without geometry. Where strong
indirect light falls, as within an ear, a shadowed light looks bright enough to be seen: the lit part is overestimated
there, and the albedo that is fitted to it under.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.lightstage.field.lights import StageLights
from relume.scene.cameras.camera import Camera

SHADOW = 0.1
"""A light below this fraction of the pixel's bright level is in shadow: a Lambertian surface loses by it only lights
within 6° of its horizon, which show little of it."""
BRIGHT = 0.95
"""The quantile of a pixel's values that is its bright level: highlights are in fewer of the lights than the rest."""
DARKEST = 0.004
"""A pixel below this share of the field's level shows noise, no surface; where the level is that of a surface of albedo
0.5, the share is that of an albedo of 0.002: a tenth of soot's."""
FIELD = 0.99
"""The quantile of the pixels' bright levels that is the field's: so that a subject may be small, but no stray pixel."""
WIDTH = 0.1
"""Departures from the lobe, as fractions of its length, beyond which a value soon stops counting; shadows, light from
neighbours and from below the skin are such departures."""
HORIZON = 0.1
"""Lights of which the lobe itself sees less than this fraction are left out: there scattered light is all."""
ROUNDS = 15
"""Of reweighting."""


@dataclass(frozen=True, eq=False)
class Lobes:
    """Lambertian lobes of P pixels.

    vectors : (P, 3) float32, world, unit of the values; 0 where none could be fitted
    weight : (P,) float32, 0 to 1, how much of the light that the lobe sees counted in its fit; low in deep shadow and
        where the pixel is no Lambertian surface
    """

    vectors: np.ndarray
    weight: np.ndarray

    @property
    def normals(self) -> np.ndarray:
        """Unit normals (P, 3) float32, world; 0 where there is no lobe."""
        length = np.linalg.norm(self.vectors, axis=-1, keepdims=True)
        return np.divide(self.vectors, length, out=np.zeros_like(self.vectors), where=length > 0)


def lambertian_lobes(values: np.ndarray, lights: StageLights, usable: np.ndarray | None = None) -> Lobes:
    """The Lambertian lobe of each pixel.

    values : (N, P), one channel or the brightness of a diffuse reflectance function
    usable : bool (N, P), which may count: such as a shadow map; all unless given
    A light counts by its solid angle. Fewer than three usable lights, or lights in one plane, fit no lobe.
    Raises ValueError when the values are not (N, P).
    """
    if values.ndim != 2 or len(values) != len(lights):
        raise ValueError(f"values are {values.shape}; expected ({len(lights)} lights, pixels)")
    return lambertian_fit(values, lights.directions, lights.solid_angles / lights.solid_angles.mean(), usable)


def lambertian_fit(
    values: np.ndarray, directions: np.ndarray, shares: np.ndarray, usable: np.ndarray | None = None
) -> Lobes:
    """The lobes b (P, 3) for which max(b · d, 0) over directions (N, 3) is nearest to values (N, P).

    shares : (N,), how much each direction counts; 1 on average
    usable : bool (N, P), which values may count; all unless given
    Source: as of `lambertian_lobes`; light and normal change places in it as one likes.
    """
    directions = directions.astype(np.float32)
    share = shares.astype(np.float32)[:, None]
    weights = share * (np.ones_like(values) if usable is None else usable.astype(np.float32))
    bright = weights * (values > 0)
    vectors = _least_squares(values, bright, directions)
    for _ in range(ROUNDS):
        predicted = directions @ vectors.T
        length = np.maximum(np.linalg.norm(vectors, axis=1), np.float32(1e-12))
        seen = weights * (predicted > HORIZON * length)
        departure = np.minimum(np.abs(values - predicted) / (WIDTH * length), np.float32(1e4))
        trust = 1 / (1 + departure**2) ** 2
        vectors = _least_squares(values, seen * trust, directions)
    expected = np.maximum(predicted, 0) * share
    counted = (expected * seen / np.maximum(share, 1e-30) * trust).sum(axis=0)
    weight = counted / np.maximum(expected.sum(axis=0), 1e-30)
    return Lobes(vectors, np.where(vectors.any(axis=1), np.clip(weight, 0, 1), 0).astype(np.float32))


def _least_squares(values: np.ndarray, weights: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Vectors (P, 3) with directions · vectors nearest the values; 0 where the lights do not determine them."""
    pairs = (directions[:, :, None] * directions[:, None, :]).reshape(-1, 9)
    matrices = (weights.T @ pairs).reshape(-1, 3, 3).astype(np.float64)
    sides = ((weights * values).T @ directions).astype(np.float64)
    trace = np.trace(matrices, axis1=1, axis2=2)
    known = (weights > 0).sum(axis=0) >= 3
    known &= np.linalg.det(matrices) > 1e-9 * np.maximum(trace, 1e-30) ** 3
    matrices[~known] = np.eye(3)
    return np.where(known[:, None], np.linalg.solve(matrices, sides[..., None])[..., 0], 0).astype(np.float32)


def towards_camera(camera: Camera | None, shape: tuple[int, int], rows: slice = slice(None)) -> np.ndarray:
    """Unit directions (rows, W, 3) float32, world, from what each pixel of some rows shows to the camera.

    Without a camera the view is that of one far away on +Z: (0, 0, 1) everywhere.
    """
    chosen = range(shape[0])[rows]
    if camera is None:
        return np.broadcast_to(np.array([0, 0, 1], np.float32), (len(chosen), shape[1], 3))
    x, y = np.arange(shape[1]) + 0.5, np.asarray(chosen) + 0.5
    through = camera.rays_through(np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1))
    return (-through).astype(np.float32)


def brightness(values: np.ndarray) -> np.ndarray:
    """The mean of the three channels of values (…, 3)."""
    return np.asarray(values.mean(axis=-1))


def bright_level(bright: np.ndarray) -> np.ndarray:
    """The bright level (…) of brightnesses (N, …) under N lights: their quantile `BRIGHT`."""
    rank = min(int(np.ceil(BRIGHT * len(bright))), len(bright) - 1)
    return np.asarray(np.partition(bright, rank, axis=0)[rank])


def shows_surface(level: np.ndarray) -> np.ndarray:
    """Whether each pixel shows a surface and not noise, bool (…), for the bright levels (…) of all pixels of a field.

    The field's own level decides, so that it does not matter in what unit the lights' irradiance was given.
    """
    return np.asarray(level > darkest_level(level))


def darkest_level(level: np.ndarray) -> float:
    """The bright level above which pixels of a field show a surface, for those (…) of all its pixels."""
    above = level[level > 0]
    return float(DARKEST * (np.quantile(above, FIELD) if above.size else 0))


def lit(values: np.ndarray) -> np.ndarray:
    """Whether each light reaches each pixel straight, bool (N, …), for values (N, …, 3) of a reflectance field.

    A pixel that no light brightens is lit by none.
    Source: Debevec et al. 2000, §4.4.
    """
    bright = brightness(values)
    return (bright > SHADOW * bright_level(bright)) & (bright > 0)
