"""Spherical harmonics of lat-long maps, of any spin: sums over a map's pixels turned into sums over degrees.

The angles are the map's own: polar angle π·v from the top row, longitude 2π·u from the left edge. Coefficients are
those of the complex harmonics Y_lm = √((2l+1)/4π) d^l_m0(θ) e^{imφ} with the Condon–Shortley phase.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
from scipy.fft import ifft, rfft
from scipy.special import gammaln

_BLOCK = 16
"""Degrees summed in one product of matrices."""


def wigner(orders: np.ndarray, spin: int, angles: np.ndarray, degree: int) -> Iterator[np.ndarray]:
    """d^l_{m,spin}(θ) for l = 0 … degree, one (len(orders), len(angles)) array a degree; 0 where l < |m| or l < |spin|.

    By the three-term recurrence upwards in l (Varshalovich et al. 1988, §4.8.2), stable in that direction.
    """
    m = np.asarray(orders, np.float64)[:, None]
    cosine = np.cos(angles)[None, :]
    first = np.maximum(np.abs(m), abs(spin))
    before = now = np.zeros((m.size, cosine.size))
    begins = _first_values(m[:, 0].astype(int), spin, angles)
    for degree_now in range(degree + 1):
        if degree_now:
            below = degree_now - 1
            with np.errstate(invalid="ignore", divide="ignore"):
                scale = 1 / np.sqrt((degree_now**2 - m**2) * (degree_now**2 - spin**2))
                if below == 0:
                    ahead = scale * cosine * now
                else:
                    ahead = (2 * below + 1) * (degree_now * cosine - m * spin / below) * now
                    ahead -= degree_now / below * np.sqrt((below**2 - m**2) * (below**2 - spin**2)) * before
                    ahead *= scale
            before, now = now, np.where(degree_now > first, ahead, 0)
        starting = np.flatnonzero(first[:, 0] == degree_now)
        if starting.size:
            now = now.copy()
            now[starting] = begins[starting]
        yield now


def _first_values(orders: np.ndarray, spin: int, angles: np.ndarray) -> np.ndarray:
    """d^l_{m,spin} at its lowest degree l = max(|m|, |spin|), in closed form."""
    with np.errstate(divide="ignore"):
        log_cosine, log_sine = np.log(np.cos(angles / 2)), np.log(np.sin(angles / 2))
    values = np.empty((len(orders), len(angles)))
    for row, m in enumerate(orders):
        l = max(abs(int(m)), abs(spin))  # noqa: E741
        # Symmetries turn every case into d^l_{l,k} = √C(2l, l+k) cos^{l+k}(θ/2) (−sin(θ/2))^{l−k}.
        if abs(int(m)) == l:
            k, sign = (spin, 1.0) if m >= 0 else (-spin, (-1.0) ** (l + spin))
        else:
            k, sign = (int(m), (-1.0) ** (spin - m)) if spin > 0 else (-int(m), 1.0)
        up, down = l + k, l - k
        logarithm = 0.5 * (gammaln(2 * l + 1) - gammaln(up + 1) - gammaln(down + 1))
        with np.errstate(invalid="ignore"):
            powers = np.where(up, up * log_cosine, 0) + np.where(down, down * log_sine, 0)
        values[row] = sign * (-1.0) ** down * np.exp(logarithm + powers)
    return values


def analysed(flux: np.ndarray, degree: int) -> np.ndarray:
    """Coefficients a_lm = Σ flux · Y*_lm over the pixels of a lat-long map, m ≥ 0: (degree + 1, degree + 1, C) complex.

    flux : (H, 2H, C), radiance × solid angle of each pixel, taken at its centre
    """
    rows, columns = flux.shape[:2]
    orders = np.arange(degree + 1)
    waves = np.moveaxis(np.asarray(rfft(flux, axis=1, workers=-1)), 1, 0)
    # Beyond the map's own frequencies the sum over its columns repeats itself.
    folded = orders % columns
    mirrored = (folded > columns // 2)[:, None, None]
    along = np.where(mirrored, np.conj(waves[(columns - folded) % columns % len(waves)]), waves[folded % len(waves)])
    along *= np.exp(-1j * np.pi * orders / columns)[:, None, None]
    angles = np.pi * (np.arange(rows) + 0.5) / rows
    coefficients = np.zeros((degree + 1, degree + 1, flux.shape[2]), complex)
    for l, values in enumerate(wigner(orders, 0, angles, degree)):  # noqa: E741
        part = values[: l + 1, None, :] @ along[: l + 1]
        coefficients[l, : l + 1] = np.sqrt((2 * l + 1) / (4 * np.pi)) * part[:, 0]
    return coefficients


def synthesised(coefficients: np.ndarray, kernels: np.ndarray, spin: int, rows: int) -> np.ndarray:
    """The light convolved with kernels g(γ)·e^{i·spin·χ} about every table entry: (K, rows, 2·rows, C) complex.

    γ is the angle from the entry's direction and χ the azimuth about it, from the south towards growing longitude.

    coefficients : (L + 1, L + 1, C) of `analysed`
    kernels : (K, L + 1), 2π ∫ g(γ) λ_{l,spin}(γ) sin γ dγ, where Y_lm = λ_lm(θ) e^{imφ}
    """
    degree, channels = len(coefficients) - 1, coefficients.shape[2]
    columns = 2 * rows
    angles = np.pi * (np.arange(rows) + 0.5) / rows
    # ∫ I g e^{i·spin·χ} dω = Σ a_lm e^{imφ} d^l_{m,−spin}(θ) (−1)^spin g_l, by Y_lm turned to the entry's frame.
    orders = np.arange(-degree if spin else 0, degree + 1)
    negative = orders < 0
    parity = np.where(negative, (-1.0) ** orders, 1.0)
    rings = np.zeros((len(orders), rows, 2 * len(kernels) * channels))
    weights = (-1.0) ** spin * kernels.T
    degrees = enumerate(wigner(orders, -spin, angles, degree))
    while block := list(islice(degrees, _BLOCK)):
        first, last = block[0][0], block[-1][0] + 1
        a = coefficients[first:last, np.abs(orders)]
        a = np.where(negative[:, None], np.conj(a), a) * parity[:, None]
        # One product of real matrices an order: angles × degrees by degrees × (kernels, channels, parts).
        terms = np.einsum("lmc,lk->mlkc", a, weights[first:last]).view(float).reshape(len(orders), last - first, -1)
        rings += np.stack([values for _, values in block], axis=-1) @ terms
    rings = rings.view(complex)
    rings *= np.exp(1j * np.pi * orders / columns)[:, None, None]
    if spin == 0:
        # The light is real: what negative orders hold is the conjugate of the positive ones.
        rings[1:] *= 2
    waves = np.zeros((columns, rows, rings.shape[2]), complex)
    np.add.at(waves, orders % columns, rings)
    table = np.asarray(ifft(waves, axis=0, workers=-1)) * columns
    table = table.reshape(columns, rows, len(kernels), channels)
    return np.moveaxis(table, (0, 1, 2), (2, 1, 0))
