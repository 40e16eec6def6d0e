"""Turning real spherical harmonics: a rotation mixes the orders of a degree and nothing else.

Any rotation is one about Z by γ, one about Y by β and one about Z by α. Those about Z multiply the complex harmonics
by e^{−imα}; the one about Y mixes them by Wigner's d^l_mk(β).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import gammaln

from relume.sphere.directions import required_rotation, rotation_about


def turned(coefficients: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Coefficients ((L + 1)², C) of real harmonics of the function turned by an active rotation (3, 3).

    What the function was at ω it is at `rotation` @ ω. The work grows as L³.
    Raises ValueError for what is not a rotation: it would mirror or stretch the light.
    """
    alpha, beta, gamma = euler_angles(rotation)
    degree = round(len(coefficients) ** 0.5) - 1
    result = np.empty(np.shape(coefficients))
    for l, wigner in enumerate(wigner_matrices(beta, degree)):  # noqa: E741
        orders = np.arange(1, l + 1)
        middle = l * l + l
        # f is real: a_m = (−1)^m (c_m − i c_−m)/√2 of the complex harmonics, and a_−m = (−1)^m a*_m.
        positive = (coefficients[middle + orders] - 1j * coefficients[middle - orders]) / np.sqrt(2)
        signs = ((-1.0) ** orders)[:, None]
        a = np.concatenate([np.conj(positive[::-1]), coefficients[middle : middle + 1], signs * positive])
        every = np.arange(-l, l + 1)[:, None]
        # Orders from 0 on give the others.
        a = np.exp(-1j * every[l:] * alpha) * (wigner @ (np.exp(-1j * every * gamma) * a))
        result[middle] = a[0].real
        positive = np.sqrt(2) * signs * a[1:]
        result[middle + orders], result[middle - orders] = positive.real, -positive.imag
    return result


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


def wigner_matrices(beta: float, degree: int) -> Iterator[np.ndarray]:
    """d^l_mk(β) for l = 0 … degree: (l + 1, 2l + 1) each, m = 0 … l by k = −l … l.

    By the three-term recurrence upwards in l (Varshalovich et al. 1988, §4.8.2), stable in that direction.
    """
    m, k = np.arange(degree + 1.0)[:, None], np.arange(-degree, degree + 1.0)[None, :]
    m, k = np.broadcast_arrays(m, k)
    first, begins = np.maximum(m, np.abs(k)), _first_values(m, k, beta)
    before = now = np.zeros(m.shape)
    for l in range(degree + 1):  # noqa: E741
        here = np.s_[: l + 1, degree - l : degree + l + 1]
        # Where both |m| and |k| are below l, the two degrees below are known (or 0).
        inner = np.s_[: max(l, 0), degree - l + 1 : degree + l]
        ahead = np.zeros(m.shape)
        if l == 1:
            ahead[inner] = np.cos(beta) * now[inner]
        elif l > 1:
            mm, kk, n = m[inner], k[inner], l - 1
            rise = (2 * n + 1) * (l * np.cos(beta) - mm * kk / n) * now[inner]
            rise -= l / n * np.sqrt(np.maximum((n * n - mm * mm) * (n * n - kk * kk), 0)) * before[inner]
            ahead[inner] = rise / np.sqrt((l * l - mm * mm) * (l * l - kk * kk))
        ahead = np.where(first == l, begins, ahead)
        before, now = now, ahead
        yield now[here]


def _first_values(m: np.ndarray, k: np.ndarray, beta: float) -> np.ndarray:
    """d^l_mk at its lowest degree l = max(m, |k|), m ≥ 0, in closed form."""
    # Symmetries turn every case into d^l_{l,j} = √C(2l, l + j) cos^{l+j}(β/2) (−sin(β/2))^{l−j}.
    l = np.maximum(m, np.abs(k))  # noqa: E741
    j = np.where(m == l, k, np.where(k > 0, m, -m))
    sign = np.where((m != l) & (k > 0), (-1.0) ** (k - m), 1.0)
    up, down = l + j, l - j
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = 0.5 * (gammaln(2 * l + 1) - gammaln(up + 1) - gammaln(down + 1))
        logarithm = logarithm + np.where(up > 0, up * np.log(np.cos(beta / 2)), 0)
        logarithm = logarithm + np.where(down > 0, down * np.log(np.sin(beta / 2)), 0)
    return sign * (-1.0) ** down * np.exp(logarithm)
