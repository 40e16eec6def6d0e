"""LogLuv encoded and decoded in whole arrays of float64: the slow twin of the kernels (Larson 1998, eqs 1–5)."""

from __future__ import annotations

import numpy as np

from relume.image.files.logluv.codes import CELL, GRID, LOWEST, NEUTRAL, SIGN, LogScale, colours, lines, scale_of
from relume.image.radiance import RadianceMap

_FAR = 8.0  # u′ and v′ beyond are as good as this


def luminance_codes(scale: LogScale, luminance: np.ndarray) -> np.ndarray:
    """The 16-bit codes of luminances, int64; 0 for those too small, and `codes` or more for those too large."""
    luminance = np.asarray(luminance, np.float64)
    with np.errstate(divide="ignore"):
        code = np.floor(scale.steps * (np.log2(np.abs(luminance)) + scale.lowest))
    code = np.clip(code, 0, scale.codes).astype(np.int64)
    return np.where((luminance < 0) & (code > 0), code | SIGN, code) if scale.signed else code * (luminance > 0)


def chromaticity(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """u′ and v′ of CIE X, Y, Z (eq. 2); those of equal energy for black, and where they would have no meaning.

    xyz : (..., 3) float64; that of a negative luminance counts as its negative. There is no meaning where
        X + 15 Y + 3 Z has not the sign of the luminance
    """
    x, y, z = np.moveaxis(np.where(xyz[..., 1:2] < 0, -xyz, xyz), -1, 0)
    total = x + 15 * y + 3 * z
    none = (y == 0) | (total <= 0)
    total = np.where(none, 1.0, total)
    parts = (np.clip(part / total, -_FAR, _FAR) for part in (4 * x, 9 * y))
    u, v = (np.where(none, neutral, part) for neutral, part in zip(NEUTRAL, parts, strict=True))
    return u, v


def decode(words: np.ndarray, bits: int) -> np.ndarray:
    """(..., 3) float64 CIE X, Y, Z of words; as the kernels have it."""
    luminance = scale_of(bits).luminances()[words >> 16]
    return luminance[..., None] * (np.ones(3) if bits == 16 else colours(bits)[words & (2**16 - 1)])


def encode(xyz: np.ndarray, bits: int) -> np.ndarray:
    """int64 words of (..., 3) float64 CIE X, Y, Z; as the kernels have it.

    A colour that no code holds takes the nearest code; a luminance too small for the scale is black, and one too large,
    or of the wrong sign, has to be refused before.
    """
    luminance = luminance_codes(scale_of(bits), xyz[..., 1])
    if bits == 16:
        return luminance << 16
    u, v = chromaticity(np.where((luminance & (SIGN - 1))[..., None] == 0, 0.0, xyz))
    if bits == 24:
        return luminance << 16 | gamut_codes(u, v)[0]
    return luminance << 16 | _on_grid(u) << 8 | _on_grid(v)


def _on_grid(coordinate: np.ndarray) -> np.ndarray:
    return np.clip(np.floor(GRID * coordinate), 0, 255).astype(np.int64)


def gamut_codes(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The code of each colour's cell, or of the nearest one; and whether the colour lies in that cell.

    u, v : CIE 1976 u′, v′, of one shape
    returns : int64 and bool of that shape
    """
    starts, counts, firsts = lines()
    u, v = np.asarray(u, np.float64), np.asarray(v, np.float64)
    line = np.floor((v - LOWEST) / CELL)
    within = (line >= 0) & (line < len(counts))
    line = np.where(within, line, 0).astype(np.int64)
    along = np.floor((u - starts[line]) / CELL)
    within &= (along >= 0) & (along < counts[line])
    result = np.where(within, firsts[line] + along, 0).astype(np.int64)
    for place in zip(*np.nonzero(~within), strict=True):
        result[place] = _nearest(float(u[place]), float(v[place]))
    return result, within


def _nearest(u: float, v: float) -> int:
    """The code whose cell's middle is nearest to a colour."""
    starts, counts, firsts = lines()
    along = np.clip(np.floor((u - starts) / CELL), 0, counts - 1)
    middle_u, middle_v = starts + (along + 0.5) * CELL, LOWEST + (np.arange(len(counts)) + 0.5) * CELL
    best = int(np.argmin((u - middle_u) ** 2 + (v - middle_v) ** 2))
    return int(firsts[best] + along[best])


def some_map(unit: str = "relative", attributes: dict[str, str] | None = None) -> RadianceMap:
    """40 × 70 pixels of random light over six stops, a part of which is even along its rows."""
    generator = np.random.default_rng(3)
    pixels = generator.uniform(0.02, 1, (40, 70, 3)) * 2.0 ** generator.uniform(-4, 2, (40, 70, 1))
    pixels[:, :30] = pixels[:1, :1]
    return RadianceMap(pixels.astype(np.float32), unit=unit, attributes=attributes or {})
