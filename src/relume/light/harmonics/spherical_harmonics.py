"""Light as real spherical harmonics of any degree: what is smooth in it, in few numbers (Ramamoorthi & Hanrahan 2001).

Y_lm = √2 N_lm P_l|m|(z) · cos mφ for m > 0, sin |m|φ for m < 0, without the √2 for m = 0, where x, y, z is the unit
direction, φ = atan2(y, x), and the square of each integrates to 1 over the sphere. There is no Condon–Shortley sign:
Y_1 is y, z, x times √(3/4π). The polar axis is the world's +Z, and (l, m) stands in row l² + l + m.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.errors import warn
from relume.light.harmonics.transform import Flux, analysed, as_complex, as_real, synthesised, turned
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, Mapping, pixel_directions

HIGHEST_DEGREE = 1000
"""Beyond it the recurrence starts from numbers that double precision cannot hold near the poles."""
_BLOCK = 2048
"""Directions at once: their Legendre functions stay in the cache."""
# The map's own frame for its sums: up is the polar axis and longitude 0 the left edge, +Z. Its rows are x, y, z there.
_UPRIGHT = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


class Window(Protocol):
    """What the coefficients of every degree (…) are multiplied by when those above `highest` are missing."""

    def __call__(self, degrees: np.ndarray, highest: int) -> np.ndarray: ...


@dataclass(frozen=True)
class Hann:
    """½ (1 + cos πl/(L + 1)): the least ringing, below 3 % of a lone light's peak, and the strongest blur."""

    def __call__(self, degrees: np.ndarray, highest: int) -> np.ndarray:
        return 0.5 * (1 + np.cos(np.pi * degrees / (highest + 1)))


@dataclass(frozen=True)
class Lanczos:
    """sin(πl/(L + 1)) / (πl/(L + 1)): up to 5 % ringing, less blur (Sloan, "Stupid Spherical Harmonics Tricks")."""

    def __call__(self, degrees: np.ndarray, highest: int) -> np.ndarray:
        return np.sinc(degrees / (highest + 1))


@dataclass(frozen=True, eq=False)
class SphericalHarmonics:
    """The coefficients L_lm = ∫ L Y_lm dω of a light.

    coefficients : ((L + 1)², 3) float64, (l, m) in row l² + l + m, in `unit` times steradians
    unit : of the radiance, "cd/m²" when calibrated, else "relative"
    """

    coefficients: np.ndarray
    unit: str = "relative"

    def __post_init__(self) -> None:
        shape = np.shape(self.coefficients)
        if len(shape) != 2 or shape[1] != 3 or shape[0] == 0 or (self.degree + 1) ** 2 != shape[0]:
            raise ValueError(f"coefficients have shape {shape}; expected ((L + 1)², 3), like (9, 3) for degree 2")

    @property
    def degree(self) -> int:
        """The highest degree, L."""
        return round(len(self.coefficients) ** 0.5) - 1

    def evaluate(self, directions: np.ndarray) -> np.ndarray:
        """Σ L_lm Y_lm from unit directions (…, 3): (…, 3) float64, below 0 where the missing degrees ring."""
        flat = np.asarray(directions, np.float64).reshape(-1, 3)
        blocks = [self.coefficients.T @ each for each in _blocks(flat, self.degree)]
        return np.concatenate([np.empty((3, 0)), *blocks], axis=1).T.reshape(np.shape(directions))

    def rotated(self, rotation: np.ndarray) -> SphericalHarmonics:
        """The light turned by an active rotation (3, 3): what came from ω comes from `rotation` @ ω; exact."""
        return SphericalHarmonics(turned(self.coefficients, rotation), self.unit)

    def irradiance(self, normals: np.ndarray) -> np.ndarray:
        """E = Σ Â_l L_lm Y_lm on surfaces of unit normals (…, 3): (…, 3), π·L under constant light.

        Degree 2 holds all but about 1 % of a sky's irradiance; a lone light, 1 where a surface faces it, gives 1.0625.
        """
        return self._weighted(cosine_factors(self.degree)).evaluate(normals)

    def power(self) -> np.ndarray:
        """Σ_m L_lm² of every degree, (L + 1, 3): what no rotation changes."""
        starts = np.arange(self.degree + 1) ** 2
        return np.add.reduceat(self.coefficients**2, starts, axis=0)

    def windowed(self, window: Window = Hann()) -> SphericalHarmonics:
        """Blurred, so that it does not ring where degrees above L are missing: round a sun, for one.

        window : `Hann()`, because light must not be negative; `Lanczos()` where sharpness matters more
        """
        return self._weighted(window(np.arange(self.degree + 1), self.degree))

    def as_map(self, size: int, mapping: Mapping = LatLong()) -> EnvironmentMap:
        """The light at the middles of the pixels of a map of `size` rows.

        mapping : of the result

        Negative radiance, which is no light, becomes 0 and is warned of: `windowed` harmonics have less of it.
        """
        areas = mapping.solid_angles(size)[..., None]
        if isinstance(mapping, LatLong):
            # By sums along the longitude, fast for any degree. It grows to the right, which is clockwise about +Y: that
            # conjugates the complex harmonics.
            upright = np.conj(as_complex(turned(self.coefficients, _UPRIGHT)))
            kernel = np.sqrt((2 * np.arange(self.degree + 1) + 1) / (4 * np.pi))
            radiance = synthesised(upright, kernel[None], 0, size)[0].real
        else:
            radiance = np.where(areas > 0, self.evaluate(pixel_directions(mapping, size)), 0)
        lost = float((np.maximum(-radiance, 0) * areas).sum() / max((np.abs(radiance) * areas).sum(), 1e-300))
        if lost > 1e-6:
            warn(
                f"harmonics of degree {self.degree} ring below 0: {lost:.1%} of the light was negative and became 0; "
                "take them windowed, or of a higher degree"
            )
        return EnvironmentMap(np.maximum(radiance, 0).astype(np.float32), mapping, self.unit)

    def _weighted(self, factors: np.ndarray) -> SphericalHarmonics:
        return SphericalHarmonics(self.coefficients * _degrees(factors)[:, None], self.unit)


def project_sh(light: EnvironmentMap, degree: int = 2) -> SphericalHarmonics:
    """The harmonics of a light up to a degree: Σ L · Y_lm(middle) · solid angle over the pixels of its map.

    light : in any mapping; lat-long ones are summed by transforms along the longitude, in a fraction of the time
    degree : 2, nine harmonics, light a matte surface; 8 to 12 hold soft reflections; a map of H rows holds about H/2

    The sums are those of `EnvironmentMap.irradiance`. Pixels are taken at their middles, so that what a map of H
    rows holds of degree l comes back with an error of about (l + ½)·(π/H)²/12 of it.

    Raises ValueError for a degree below 0 or above 1000.

    >>> even = EnvironmentMap(np.ones((64, 128, 3), np.float32))
    >>> project_sh(even, 1).irradiance(np.array([0.0, 1.0, 0.0])).round(2)
    array([3.14, 3.14, 3.14])
    """
    _check_degree(degree)
    areas = light.mapping.solid_angles(light.size)
    if isinstance(light.mapping, LatLong):
        flux = Flux(light.radiance, areas)
        # Clockwise about +Y, as in `as_map`.
        coefficients = turned(as_real(np.conj(analysed(flux, degree))), _UPRIGHT.T)
        return SphericalHarmonics(coefficients, light.unit)
    flux = light.radiance * areas[..., None]
    lit = flux.any(-1)
    directions, flux = pixel_directions(light.mapping, light.size)[lit], flux[lit]
    coefficients = np.zeros(((degree + 1) ** 2, 3))
    for begin, each in zip(range(0, len(flux), _BLOCK), _blocks(directions, degree), strict=True):
        coefficients += each @ flux[begin : begin + _BLOCK]
    return SphericalHarmonics(coefficients, light.unit)


def sh_basis(directions: np.ndarray, degree: int) -> np.ndarray:
    """Y_lm at unit directions (…, 3): (…, (degree + 1)²) float64, (l, m) at l² + l + m.

    degree : L, the highest
    Raises ValueError for a degree below 0 or above 1000.
    """
    _check_degree(degree)
    flat = np.asarray(directions, np.float64).reshape(-1, 3)
    values = np.concatenate([np.empty(((degree + 1) ** 2, 0)), *_blocks(flat, degree)], axis=1)
    return values.T.reshape(*np.shape(directions)[:-1], -1)


def cosine_factors(degree: int) -> np.ndarray:
    """Â_l for l = 0 … degree: what max(0, cos θ) multiplies harmonics by (Ramamoorthi & Hanrahan 2001, eq. 8).

    π, 2π/3, π/4, 0, −π/24, 0, π/64, …
    """
    factors = np.zeros(degree + 1)
    # l! / (2^l (l/2)!²) of even l, one factor after the other: the factorials alone overflow.
    central = 1.0
    for l in range(0, degree + 1, 2):  # noqa: E741
        central *= (l - 1) / l if l else 1.0
        factors[l] = 2 * np.pi * (-1) ** (l // 2 + 1) / ((l + 2) * (l - 1)) * central
    if degree:
        factors[1] = 2 * np.pi / 3
    return factors


def _check_degree(degree: int) -> None:
    if not 0 <= degree <= HIGHEST_DEGREE:
        raise ValueError(f"harmonics of degree {degree}; expected 0 to {HIGHEST_DEGREE}, like 2 for matte surfaces")


def _degrees(factors: np.ndarray) -> np.ndarray:
    """A factor for every degree as one for every row."""
    return np.repeat(factors, 2 * np.arange(len(factors)) + 1)


def _blocks(directions: np.ndarray, degree: int) -> Iterator[np.ndarray]:
    """Y_lm of blocks of directions (N, 3): ((degree + 1)², up to _BLOCK)."""
    for begin in range(0, len(directions), _BLOCK):
        yield _values(directions[begin : begin + _BLOCK], degree)


def _values(directions: np.ndarray, degree: int) -> np.ndarray:
    x, y, z = np.ascontiguousarray(directions.T)
    values = np.empty(((degree + 1) ** 2, len(z)))
    # P_mm times √2 cos mφ and √2 sin mφ: real and imaginary part of (x + iy)^m, so that no pole needs care.
    first = np.zeros((degree + 1, 2, len(z)))
    first[0, 0] = np.sqrt(1 / (4 * np.pi))
    for m in range(1, degree + 1):
        (real, imaginary), factor = first[m - 1], np.sqrt((2 * m + 1) / (2 * m) * (2 if m == 1 else 1))
        first[m] = factor * (real * x - imaginary * y), factor * (real * y + imaginary * x)
    # P_lm = a (z P_{l−1,m} − b P_{l−2,m}), upwards in l, where it is stable.
    before = now = np.empty((0, 2, len(z)))
    for l in range(degree + 1):  # noqa: E741
        m = np.arange(l)[:, None, None]
        a = np.sqrt((4 * l * l - 1) / (l * l - m * m)) if l else np.ones((0, 1, 1))
        ahead = (a * z) * now
        if l > 1:
            b = np.sqrt(((l - 1) ** 2 - m[:-1] ** 2) / (4 * (l - 1) ** 2 - 1))
            ahead[:-1] -= (a[:-1] * b) * before
        before, now = now, np.concatenate([ahead, first[l : l + 1]])
        values[l * l + l : (l + 1) ** 2] = now[:, 0]
        values[l * l : l * l + l] = now[:0:-1, 1]
    return values
