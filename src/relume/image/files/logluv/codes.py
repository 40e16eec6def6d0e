"""The numbers of LogLuv: codes of log luminance and of u′, v′, and the CIE XYZ they stand for (Larson 1998, eqs 1–5).

A word is a luminance code in its upper 16 bits, sign first, and a colour code in its lower 16: 32-bit files store it
as it is, 24-bit ones the 10 and 14 bits that they use of it, 16-bit ones the upper half. Codes are rounded down, and
mean the middle of their step, so that neither luminance nor colour is biased over many pixels that differ. One colour
is off by its own part of a step, everywhere alike: at its luminance, the neutral of D65 comes back with 1.5 % more red
and 1.8 % less blue in 32 bits, 1.0 % less and 2.4 % more in 24. Luminance code 0 is black, of any colour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.files.logluv import gamut as logluv_gamut

GRID = 410  # steps of u′ and v′ per unit in 32 bits, eq. 5
SIGN = 2**15  # of the 16-bit luminance code
_FAR = 8.0  # u′ and v′ beyond are as good as this


@dataclass(frozen=True)
class LogScale:
    """A scale of log luminance: code c > 0 stands for 2^((c + ½)/steps − lowest).

    steps : codes per octave
    lowest : octaves below 1 at which the codes begin
    codes : how many there are
    signed : whether a sign bit tells negative luminance
    """

    steps: int
    lowest: int
    codes: int
    signed: bool

    def luminances(self) -> np.ndarray:
        """(65536,) float64: the luminance of each 16-bit code with its sign; 0 for codes that there are not."""
        result = np.zeros(2**16)
        code = np.arange(1, self.codes)
        result[1 : self.codes] = np.exp2((code + 0.5) / self.steps - self.lowest)
        if self.signed:
            result[SIGN + 1 : SIGN + self.codes] = -result[1 : self.codes]
        return result

    def encode(self, luminance: np.ndarray) -> np.ndarray:
        """The 16-bit codes of luminances, int64; 0 for those too small, and `codes` or more for those too large."""
        luminance = np.asarray(luminance, np.float64)
        with np.errstate(divide="ignore"):
            code = np.floor(self.steps * (np.log2(np.abs(luminance)) + self.lowest))
        code = np.clip(code, 0, self.codes).astype(np.int64)
        return np.where((luminance < 0) & (code > 0), code | SIGN, code) if self.signed else code * (luminance > 0)


SHORT = LogScale(steps=64, lowest=12, codes=2**10, signed=False)
"""Of 24 bits: 2^-12 to 2^4 in steps of 1.1 % (eq. 1)."""

LONG = LogScale(steps=256, lowest=64, codes=2**15, signed=True)
"""Of 32 and 16 bits: 2^-64 to 2^64, of either sign, in steps of 0.27 % (eq. 4, of which 4b is misset in the paper)."""


def scale_of(bits: int) -> LogScale:
    """The scale of luminance of a LogLuv of 16, 24 or 32 bits."""
    return SHORT if bits == 24 else LONG


def chromaticities(bits: int) -> np.ndarray:
    """(2^16, 2) or, of 24 bits, (2^14, 2) float64: u′, v′ of each colour code (eqs 5c, 5d)."""
    if bits == 24:
        return logluv_gamut.chromaticities()
    middle = (np.arange(256) + 0.5) / GRID
    return np.stack(np.meshgrid(middle, middle, indexing="ij"), axis=-1).reshape(-1, 2)


def colours(bits: int) -> np.ndarray:
    """CIE X, Y, Z at luminance 1 of each colour code, float64, from eq. 3."""
    u, v = chromaticities(bits).T
    return np.stack([9 * u, 4 * v, 12 - 3 * u - 20 * v], axis=-1) / (4 * v[:, None])


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
    u, v = (np.where(none, neutral, part) for neutral, part in zip(logluv_gamut.NEUTRAL, parts, strict=True))
    return u, v


def decode(words: np.ndarray, bits: int) -> np.ndarray:
    """(..., 3) float64 CIE X, Y, Z of words; the slow twin of the kernels."""
    luminance = scale_of(bits).luminances()[words >> 16]
    return luminance[..., None] * (np.ones(3) if bits == 16 else colours(bits)[words & (2**16 - 1)])


def encode(xyz: np.ndarray, bits: int) -> np.ndarray:
    """int64 words of (..., 3) float64 CIE X, Y, Z; the slow twin of the kernels.

    A colour that no code holds takes the nearest code; a luminance too small for the scale is black, and one too large,
    or of the wrong sign, has to be refused before.
    """
    luminance = scale_of(bits).encode(xyz[..., 1])
    if bits == 16:
        return luminance << 16
    u, v = chromaticity(np.where((luminance & (SIGN - 1))[..., None] == 0, 0.0, xyz))
    if bits == 24:
        return luminance << 16 | logluv_gamut.codes(u, v)[0]
    return luminance << 16 | _on_grid(u) << 8 | _on_grid(v)


def _on_grid(coordinate: np.ndarray) -> np.ndarray:
    return np.clip(np.floor(GRID * coordinate), 0, 255).astype(np.int64)
