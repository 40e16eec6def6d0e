"""Spherical harmonics of lat-long maps, of any spin: sums over a map's pixels turned into sums over degrees; and turns.

The angles are the map's own: polar angle π·v from the top row, longitude 2π·u from the left edge. Coefficients are
those of the complex harmonics Y_lm = √((2l+1)/4π) d^l_m0(θ) e^{imφ} with the Condon–Shortley phase.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from relume.sphere.directions import required_rotation, rotation_about

_BLOCK = 16
"""Degrees summed in one product of matrices."""
_BAND = 64
"""Rows of a map that are transformed at once: all at once would take twice a large map's own memory, and more."""


@dataclass(frozen=True)
class Flux:
    """Radiance × solid angle of a map's pixels, float64, made for the rows that are asked for.

    radiance : (H, W, C)
    areas : (H, W), steradians
    """

    radiance: np.ndarray
    areas: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        return self.radiance.shape

    def __getitem__(self, rows: slice) -> np.ndarray:
        return self.radiance[rows] * self.areas[rows][..., None]

    def sum(self) -> np.ndarray:
        """(C,) over all pixels."""
        return np.sum([self[begin : begin + _BAND].sum((0, 1)) for begin in range(0, self.shape[0], _BAND)], axis=0)


def wigner(orders: np.ndarray, spin: int | np.ndarray, angles: float | np.ndarray, degree: int) -> Iterator[np.ndarray]:
    """d^l_{m,spin}(θ) for l = 0 … degree, one (len(orders), len(angles)) array a degree; 0 where l < |m| or l < |spin|.

    orders : ascending; spin : one for all angles, or many (K,) for a single angle: (len(orders), K) a degree

    By the three-term recurrence upwards in l (Varshalovich et al. 1988, §4.8.2), stable in that direction.
    """
    m, k = np.asarray(orders, np.float64)[:, None], np.asarray(spin, np.float64)
    product, cosine, first = m * k, np.cos(angles), np.maximum(np.abs(m), np.abs(k))
    begins = _first_values(m, k, np.asarray(angles))
    before, now, root_before = np.zeros_like(begins), np.zeros_like(begins), np.zeros_like(first)
    for l in range(degree + 1):  # noqa: E741
        if l:
            n = l - 1
            # Orders beyond hold nothing yet.
            of = slice(*np.searchsorted(m[:, 0], (-n, l)))
            root, ahead = np.zeros_like(first), np.zeros_like(begins)
            with np.errstate(invalid="ignore", divide="ignore"):
                root[of] = np.sqrt((l**2 - m[of] ** 2) * (l**2 - k**2))
                if n == 0:
                    found = cosine * now[of] / root[of]
                else:
                    found = (2 * n + 1) * (l * cosine - product[of] / n) * now[of]
                    found -= l / n * root_before[of] * before[of]
                    found /= root[of]
            ahead[of] = np.where(l > first[of], found, 0)
            before, now, root_before = now, ahead, root
        np.copyto(now, begins, where=first == l)
        yield now


def _first_values(m: np.ndarray, k: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """d^l_mk at its lowest degree l = max(|m|, |k|), in closed form."""
    from scipy.special import gammaln

    # Symmetries turn every case into d^l_{l,j} = √C(2l, l+j) cos^{l+j}(θ/2) (−sin(θ/2))^{l−j}.
    l = np.maximum(np.abs(m), np.abs(k))  # noqa: E741
    highest = np.abs(m) == l
    j = np.where(highest, np.where(m >= 0, k, -k), np.where(k > 0, m, -m))
    sign = np.where(np.where(highest, m < 0, k > 0), (-1.0) ** (l + np.where(highest, k, m)), 1.0)
    up, down = l + j, l - j
    logarithm = 0.5 * (gammaln(2 * l + 1) - gammaln(up + 1) - gammaln(down + 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        powers = np.where(up, up * np.log(np.cos(angles / 2)), 0) + np.where(down, down * np.log(np.sin(angles / 2)), 0)
    return sign * (-1.0) ** down * np.exp(logarithm + powers)


def analysed(flux: np.ndarray | Flux, degree: int) -> np.ndarray:
    """Coefficients a_lm = Σ flux · Y*_lm over the pixels of a lat-long map, m ≥ 0: (degree + 1, degree + 1, C) complex.

    flux : (H, 2H, C), radiance × solid angle of each pixel, taken at its centre
    """
    from scipy.fft import rfft

    rows, columns = flux.shape[:2]
    orders = np.arange(degree + 1)
    # Beyond the map's own frequencies the sum over its columns repeats itself.
    folded = orders % columns
    mirrored = (folded > columns // 2)[:, None, None]
    along = np.empty((degree + 1, rows, flux.shape[2]), complex)
    for begin in range(0, rows, _BAND):
        band = slice(begin, begin + _BAND)
        waves = np.moveaxis(np.asarray(rfft(flux[band], axis=1, workers=-1)), 1, 0)
        back = np.conj(waves[(columns - folded) % columns % len(waves)])
        along[:, band] = np.where(mirrored, back, waves[folded % len(waves)])
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

    coefficients : (L + 1, L + 1, C) of `analysed`; the sums over degrees are in their precision, single or double
    kernels : (K, L + 1), 2π ∫ g(γ) λ_{l,spin}(γ) sin γ dγ, where Y_lm = λ_lm(θ) e^{imφ}
    """
    from scipy.fft import ifft

    degree, channels = len(coefficients) - 1, coefficients.shape[2]
    columns = 2 * rows
    # ∫ I g e^{i·spin·χ} dω = Σ a_lm e^{imφ} d^l_{m,−spin}(θ) (−1)^spin g_l, by Y_lm turned to the entry's frame.
    orders = np.arange(-degree if spin else 0, degree + 1)
    rings = _rings(coefficients, (-1.0) ** spin * kernels.T, spin, rows)
    rings *= np.exp(1j * np.pi * orders / columns)[:, None, None].astype(rings.dtype)
    if spin == 0:
        # The light is real: what negative orders hold is the conjugate of the positive ones.
        rings[1:] *= 2
    waves = np.zeros((columns, rows, rings.shape[2]), rings.dtype)
    # Orders beyond the table's own frequencies come down to them.
    for begin in range(0, len(orders), columns):
        waves[orders[begin : begin + columns] % columns] += rings[begin : begin + columns]
    table = np.asarray(ifft(waves, axis=0, norm="forward", workers=-1))
    table = table.reshape(columns, rows, len(kernels), channels)
    return np.moveaxis(table, (0, 1, 2), (2, 1, 0))


def _rings(coefficients: np.ndarray, weights: np.ndarray, spin: int, rows: int) -> np.ndarray:
    """Σ_l a_lm d^l_{m,−spin}(θ) weights_l for every order and row: (orders, rows, K · C) complex.

    Only the upper half is summed, even and odd degrees apart: d^l_mk(π−θ) = (−1)^{l−k} d^l_{−m,k}(θ) and
    a_l,−m = (−1)^m a*_lm give the lower one, which is their difference where the upper one is their sum.
    """
    degree, complexes = len(coefficients) - 1, coefficients.dtype
    reals = np.finfo(complexes).dtype
    orders, half = np.arange(-degree if spin else 0, degree + 1), (rows + 1) // 2
    signs = (-1.0) ** orders
    found = np.zeros((2, len(orders), half, 2 * weights.shape[1] * coefficients.shape[2]), reals)
    weights = weights.astype(reals)
    degrees = enumerate(wigner(orders, -spin, np.pi * (np.arange(half) + 0.5) / rows, degree))
    while block := list(islice(degrees, 2 * _BLOCK)):
        for odd in range(2):
            some = [(n, values) for n, values in block if n % 2 == odd]
            if not some:
                continue
            first, last = some[0][0], some[-1][0] + 1
            # Orders beyond the block's degrees hold nothing.
            of = slice(max(0, degree + 1 - last) if spin else 0, min(len(orders), degree + last) if spin else last)
            a = coefficients[first:last:2, np.abs(orders[of])]
            a = np.where(orders[of, None] < 0, np.conj(a) * signs[of, None].astype(reals), a)
            # One product of real matrices an order: angles × degrees by degrees × (kernels, channels, parts).
            terms = np.einsum("lmc,lk->mlkc", a, weights[first:last:2]).view(reals).reshape(a.shape[1], len(some), -1)
            found[odd, of] += np.stack([values[of] for _, values in some], axis=-1, dtype=reals) @ terms
    even, odd = found.view(complexes)
    rings = np.empty((len(orders), rows, even.shape[2]), complexes)
    rings[:, :half] = even + odd
    lower = (even - odd)[:, : rows // 2][:, ::-1] * (signs * (-1.0) ** spin)[:, None, None].astype(reals)
    rings[:, half:] = np.conj(lower[::-1]) if spin else lower
    return rings


def as_complex(real: np.ndarray) -> np.ndarray:
    """Coefficients (L + 1, L + 1, C) of the complex harmonics, m ≥ 0, from those of real ones, ((L + 1)², C).

    a_m = (−1)^m (c_m − i c_−m)/√2; the others are a_−m = (−1)^m a*_m, since the function is real.
    """
    degree = round(len(real) ** 0.5) - 1
    found = np.zeros((degree + 1, degree + 1, real.shape[1]), complex)
    for l in range(degree + 1):  # noqa: E741
        middle, m = l * l + l, np.arange(1, l + 1)
        found[l, 0] = real[middle]
        found[l, 1 : l + 1] = ((-1.0) ** m / np.sqrt(2))[:, None] * (real[middle + m] - 1j * real[middle - m])
    return found


def as_real(coefficients: np.ndarray) -> np.ndarray:
    """What `as_complex` did, undone."""
    degree = len(coefficients) - 1
    real = np.empty(((degree + 1) ** 2, coefficients.shape[2]))
    for l in range(degree + 1):  # noqa: E741
        middle, m = l * l + l, np.arange(1, l + 1)
        both = np.sqrt(2) * ((-1.0) ** m)[:, None] * coefficients[l, 1 : l + 1]
        real[middle], real[middle + m], real[middle - m] = coefficients[l, 0].real, both.real, -both.imag
    return real


def turned(coefficients: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Coefficients ((L + 1)², C) of real harmonics of the function turned by an active rotation (3, 3).

    What the function was at ω it is at `rotation` @ ω. A rotation mixes the orders of a degree and nothing else: those
    about Z, by γ first and α last, multiply the complex harmonics by e^{−imα}, the one about Y between them mixes them
    by Wigner's d^l_mk(β). The work grows as L³.
    Raises ValueError for what is not a rotation: it would mirror or stretch the light.
    """
    alpha, beta, gamma = euler_angles(rotation)
    a = as_complex(coefficients)
    degree = len(a) - 1
    for l, values in enumerate(wigner(np.arange(degree + 1), np.arange(-degree, degree + 1), beta, degree)):  # noqa: E741
        own, every = a[l, : l + 1], np.arange(-l, l + 1)[:, None]
        below = (-1.0) ** every[:l] * np.conj(own[:0:-1])
        mixed = values[: l + 1, degree - l : degree + l + 1] @ (
            np.exp(-1j * every * gamma) * np.concatenate([below, own])
        )
        a[l, : l + 1] = np.exp(-1j * every[l:] * alpha) * mixed
    return as_real(a)


def euler_angles(rotation: np.ndarray) -> tuple[float, float, float]:
    """α, β, γ in radians, with `rotation` = Rz(α) Ry(β) Rz(γ) and β from 0 to π.

    Raises ValueError for what is not a rotation matrix.
    """
    matrix = required_rotation(rotation)
    alpha = float(np.arctan2(matrix[1, 2], matrix[0, 2]))
    beta = float(np.arctan2(np.hypot(matrix[0, 2], matrix[1, 2]), matrix[2, 2]))
    # What is left turns about Z alone, also where β is 0 or π and α could be anything.
    left = rotation_about([0, 1, 0], -beta) @ rotation_about([0, 0, 1], -alpha) @ matrix
    return alpha, beta, float(np.arctan2(left[1, 0] - left[0, 1], left[0, 0] + left[1, 1]))
