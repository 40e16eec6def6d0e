"""Sums over all directions of light, Σ I[L] · Area[L] · f(N·L), for every entry of a table (Miller & Hoffman 1984, §6).

Three ways to the same sums: hemispheres for Lambert (exact), zonal harmonics for smooth lobes (to a bound that is
returned), and transforms along the longitude for any other function of the cosine (exact, slower).
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from relume.light.harmonics.transform import Flux, analysed, synthesised, wigner
from relume.light.reflection.lobes import Lambert, Lobe, SelfLuminous, quadrature
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong

TOLERANCE = 1e-4
"""Zonal harmonics are used where their error is surely below this share of every table entry."""
FINEST = 4096
"""Rows to which a light may be cut up for narrow lobes."""
HIGHEST_DEGREE = 400
"""Beyond it the transforms along the longitude are as fast."""
ROUNDING = 1e-14
"""Coefficients below this share of the first are the quadrature's rounding, not the lobe's; sums round by as much."""


def convolved(light: EnvironmentMap, lobe: Lobe, rows: int) -> tuple[np.ndarray, float]:
    """The sums for a table of (rows, 2·rows, 3) float64 at its pixel centres, and the bound of their relative error.

    light : a lat-long map; its radiance is taken at pixel centres, its areas are exact
    lobe : f; its mirror's share is left out
    rows : the table's height

    The bound is on the largest error of any entry against the sum itself; 0 for the exact ways.
    """
    flux = Flux(light.radiance, light.mapping.solid_angles(light.size))
    if isinstance(lobe, SelfLuminous):
        return np.broadcast_to(lobe.k * flux.sum(), (rows, 2 * rows, 3)).copy(), 0.0
    if isinstance(lobe, Lambert):
        # Numba is imported only where the kernel is used.
        from relume.light.reflection.hemisphere import hemisphere_sums

        return lobe.k * hemisphere_sums(flux, rows), 0.0
    return _by_zonal_harmonics(flux, lobe, rows) or (_by_longitude(flux, lobe, rows), 0.0)


def zonal_coefficients(lobe: Lobe, degree: int) -> np.ndarray:
    """f_l = 2π ∫ f(cos θ) P_l(cos θ) sin θ dθ for l = 0 … degree; row A4's factors for Lambert."""
    theta, weights = quadrature(lobe.width, degree)
    values = 2 * np.pi * weights * lobe(np.cos(theta))
    return np.array([legendre[0] @ values for legendre in wigner(np.zeros(1), 0, theta, degree)])


def _by_zonal_harmonics(flux: Flux, lobe: Lobe, rows: int) -> tuple[np.ndarray, float] | None:
    """The table and its bound, or None where the lobe needs more degrees than are worth it."""
    coefficients = zonal_coefficients(lobe, 2 * HIGHEST_DEGREE)
    coefficients[np.abs(coefficients) < ROUNDING * np.abs(coefficients[0])] = 0
    # |f(x) − f_L(x)| ≤ Σ_{l>L} (2l+1)/4π |f_l|, since |P_l| ≤ 1.
    degrees = np.arange(len(coefficients))
    held = np.cumsum(((2 * degrees + 1) / (4 * np.pi) * np.abs(coefficients))[::-1])[::-1]
    missed = np.append(held[1:], 0.0)[: HIGHEST_DEGREE + 1] + ROUNDING * held[0]
    kernel, total = coefficients * np.sqrt((2 * degrees + 1) / (4 * np.pi)), flux.sum()
    for wanted in (1e-7, 1e-11):
        enough = np.flatnonzero(missed <= wanted * max(float(lobe(np.array([1.0]))[0]), 1e-300))
        if not enough.size:
            return None
        degree = int(enough[0])
        table = synthesised(analysed(flux, degree), kernel[None, : degree + 1], 0, rows)[0].real
        if (bound := _relative(missed[degree] * total, table.min((0, 1)))) <= TOLERANCE:
            return table, bound
    return None


def _relative(error: np.ndarray, lowest: np.ndarray) -> float:
    """The largest of the channels' errors as a share of their lowest entries; a channel without light has none."""
    return float(np.where(error == 0, 0, np.where(lowest > 0, error / np.maximum(lowest, 1e-300), np.inf)).max())


def _by_longitude(flux: Flux, lobe: Lobe, rows: int) -> np.ndarray:
    """Circular convolution along the longitude for every pair of rows; exact for any f."""
    from scipy.fft import irfft, rfft

    size, columns = flux.shape[:2]
    waves = np.asarray(rfft(flux[:], axis=1, workers=-1))
    phases = 2 * rows // np.gcd(2 * rows, columns)
    longitudes = (np.arange(columns) + 0.5) * 2 * np.pi / columns
    angles = np.pi * (np.arange(size) + 0.5) / size
    reach = _reach(lobe)
    table = np.empty((rows, 2 * rows, 3))

    def fill(row: int) -> None:
        polar = np.pi * (row + 0.5) / rows
        near = np.flatnonzero(np.abs(angles - polar) <= reach)
        up, across = np.cos(polar) * np.cos(angles[near]), np.sin(polar) * np.sin(angles[near])
        for phase in range(phases):
            # Entries `phases` apart lie whole columns of the map apart: one convolution serves them all.
            turned = np.cos(longitudes - np.pi * (phase + 0.5) / rows)
            lobes = lobe(np.clip(up[:, None] + across[:, None] * turned, -1, 1))
            seen = np.conj(np.asarray(rfft(lobes, axis=1)))
            for entry, sources in ((row, near), (rows - 1 - row, size - 1 - near)):
                rolled = np.asarray(irfft(np.einsum("im,imc->mc", seen, waves[sources]), n=columns, axis=0))
                table[entry, phase::phases] = rolled[:: columns * phases // (2 * rows)]

    with ThreadPoolExecutor() as pool:
        list(pool.map(fill, range((rows + 1) // 2)))
    return np.maximum(table, 0)


def _reach(lobe: Lobe) -> float:
    """The angle beyond which a lobe holds nothing that double precision would notice."""
    angles = np.linspace(0, np.pi, 20001)
    values = lobe(np.cos(angles))
    return float(angles[np.flatnonzero(values > 1e-18 * values.max())[-1]]) + np.pi / 20000 if values.any() else 0.0


def cut_up(light: EnvironmentMap, width: float) -> EnvironmentMap:
    """A lat-long map, its pixels cut up where they are wider than a lobe, so that middles of pixels sample it.

    width : of the lobe, radians; at most FINEST rows are made
    """
    spacing = np.pi / light.size
    if spacing <= width or width > 0.5:
        return light
    times = int(np.clip(np.ceil(2 * spacing / width), 1, max(FINEST // light.size, 1)))
    fine = np.repeat(np.repeat(light.radiance, times, axis=0), times, axis=1)
    return EnvironmentMap(fine, light.mapping, light.unit)


def as_latlong(light: EnvironmentMap) -> EnvironmentMap:
    """The light as a lat-long map, energy kept; itself where it is one, else of as many rows, or more to be as fine."""
    if isinstance(light.mapping, LatLong):
        return light
    return light.remapped(LatLong(), max(light.size, light.matching_size(LatLong())))
