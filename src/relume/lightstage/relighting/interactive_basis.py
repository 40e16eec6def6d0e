"""A reflectance field made small enough to be turned by hand under a map: some pictures, and what each asks of light.

A relit picture is a sum of K pictures, and the amount of picture k is ∫ L(ω) c_k(ω) dω with a function c_k over the
sphere (a low-rank basis of the field). Turning the light turns only the arguments of c_k, which is quick anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.lightstage.relighting.interpolation import Interpolation, Smooth
from relume.lightstage.relighting.low_rank import LowRank
from relume.sphere.directions import rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

ROWS = 48
"""Of the functions c_k: 3.75 degrees, finer than stages' lights stand."""
LIGHT_ROWS = 64


@dataclass(frozen=True, eq=False)
class InteractiveBasis:
    """What a page needs to relight a subject.

    codes : (K, H, W, 3) uint8; picture k is lowest[k] + step[k] · codes[k]
    lowest, step : (K,) float32
    functions : (ROWS, 2·ROWS, K) float32, c_k on a lat-long map
    """

    codes: np.ndarray
    lowest: np.ndarray
    step: np.ndarray
    functions: np.ndarray

    def amounts(self, light: EnvironmentMap, yaw: float, pitch: float) -> np.ndarray:
        """∫ L c_k dω, (K, 3), of a lat-long light turned by `yaw` about +Y after `pitch` about +X, radians."""
        flux = flux_of(light)
        turned = pixel_directions(LatLong(), flux.shape[0]) @ turn(yaw, pitch).T
        values = _bilinear(self.functions, LatLong().image_points(turned))
        return np.einsum("hwk,hwc->kc", values, flux)

    def picture(self, amounts: np.ndarray) -> np.ndarray:
        """The relit picture (H, W, 3) float32."""
        scaled = (amounts * self.step[:, None]).astype(np.float32)
        return np.einsum("khwc,kc->hwc", self.codes, scaled, dtype=np.float32) + self.lowest @ amounts


def interactive_basis(basis: LowRank, by: Interpolation = Smooth()) -> InteractiveBasis:
    """The basis in 8 bits, and its functions of direction; glints, which no small basis holds, are left out."""
    pictures = np.asarray(basis.basis, np.float32)
    lowest = pictures.min(axis=(1, 2, 3))
    step = np.maximum((pictures.max(axis=(1, 2, 3)) - lowest) / 255, np.finfo(np.float32).tiny)
    codes = np.rint((pictures - lowest[:, None, None, None]) / step[:, None, None, None]).astype(np.uint8)
    directions = pixel_directions(LatLong(), ROWS)
    weights = by.weights(basis.lights, directions.reshape(-1, 3))
    functions = (weights @ np.asarray(basis.coefficients, np.float64).T).reshape(ROWS, 2 * ROWS, -1)
    return InteractiveBasis(codes, lowest, step, functions.astype(np.float32))


def flux_of(light: EnvironmentMap) -> np.ndarray:
    """Radiance × solid angle (LIGHT_ROWS, 2·LIGHT_ROWS, 3) of a map made as small as a page can carry."""
    small = light.remapped(LatLong(), LIGHT_ROWS)
    return small.radiance.astype(np.float64) * small.mapping.solid_angles(LIGHT_ROWS)[..., None]


def turn(yaw: float, pitch: float) -> np.ndarray:
    """The rotation that tips by `pitch` about +X and then turns by `yaw` about +Y."""
    return rotation_about((0.0, 1.0, 0.0), yaw) @ rotation_about((1.0, 0.0, 0.0), pitch)


def _bilinear(functions: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Values (…, K) at image points (…, 2), round the seam; the rows of the poles go on over them."""
    rows, columns = functions.shape[:2]
    x, y = points[..., 0] * columns - 0.5, np.clip(points[..., 1] * rows - 0.5, 0, rows - 1)
    left, top = np.floor(x).astype(int), np.minimum(np.floor(y).astype(int), rows - 2)
    across, down = (x - left)[..., None], (y - top)[..., None]
    first, second = left % columns, (left + 1) % columns
    upper = functions[top, first] * (1 - across) + functions[top, second] * across
    lower = functions[top + 1, first] * (1 - across) + functions[top + 1, second] * across
    return upper * (1 - down) + lower * down
