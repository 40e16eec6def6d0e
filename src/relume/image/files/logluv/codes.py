"""The numbers of LogLuv: codes of log luminance and of u′, v′, and the CIE XYZ they stand for (Larson 1998, eqs 1–5).

A word is a luminance code in its upper 16 bits, sign first, and a colour code in its lower 16: 32-bit files store it
as it is, 24-bit ones the 10 and 14 bits that they use of it, 16-bit ones the upper half. Codes are rounded down, and
mean the middle of their step, so that neither luminance nor colour is biased over many pixels that differ. One colour
is off by its own part of a step, everywhere alike: at its luminance, the neutral of D65 comes back with 1.5 % more red
and 1.8 % less blue in 32 bits, 1.0 % less and 2.4 % more in 24. Luminance code 0 is black, of any colour.

The colours of 24 bits are the visible part of the (u′, v′) diagram: square cells of 0.0035 lie side by side on 163 scan
lines, each of which begins where the visible colours do and has as many cells as they need. A colour's code counts the
cells from the lower left (Larson 1998, figure 2). The lines are not in the paper: they are what libtiff decodes its
16289 codes to.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

GRID = 410  # steps of u′ and v′ per unit in 32 bits, eq. 5
SIGN = 2**15  # of the 16-bit luminance code
CELL = 0.0035  # Larson 1998, "24-bit Encoding"
LOWEST = 0.01694  # v′ below the first line, as libtiff has it
CODES = 16289  # of the 2^14 that 14 bits hold
NEUTRAL = (4 / 19, 9 / 19)  # u′, v′ of equal energy, x = y = 1/3, which libtiff takes the other codes for

# (millionths of u′ where a line begins, its cells, how many lines in a row are so), from the lowest v′ up.
_LINES = (
    (247663, 4, 1), (243779, 6, 1), (241684, 7, 1), (237874, 9, 1), (235906, 10, 1), (232153, 12, 1),
    (228352, 14, 1), (226259, 15, 1), (222371, 17, 1), (220410, 18, 1), (214710, 21, 1), (212714, 22, 1),
    (210721, 23, 1), (204976, 26, 1), (202986, 27, 1), (199245, 29, 1), (195525, 31, 1), (193560, 32, 1),
    (189878, 34, 1), (186216, 36, 2), (182592, 38, 1), (179003, 40, 1), (175466, 42, 1), (172001, 44, 2),
    (168612, 46, 2), (163575, 49, 1), (158642, 52, 3), (153815, 55, 2), (149097, 58, 2), (142746, 62, 3),
    (138270, 65, 3), (132166, 69, 2), (126204, 73, 3), (120381, 77, 4), (112962, 82, 3), (107450, 86, 4),
    (100343, 91, 3), (95126, 95, 4), (88276, 100, 4), (81523, 105, 4), (74861, 110, 4), (68290, 115, 4),
    (63573, 119, 4), (57219, 124, 4), (50985, 129, 5), (44859, 134, 4), (40571, 138, 4), (36339, 142, 4),
    (32139, 146, 4), (27947, 150, 3), (23739, 154, 4), (19504, 158, 3), (16976, 161, 4), (12639, 165, 3),
    (9991, 168, 3), (9016, 170, 3), (6217, 173, 2), (5097, 175, 3), (3909, 177, 2), (2340, 177, 1), (2389, 170, 1),
    (1068, 164, 1), (1653, 157, 1), (717, 150, 1), (1614, 143, 1), (270, 136, 1), (484, 129, 1), (1103, 123, 1),
    (1242, 115, 1), (1188, 109, 1), (1011, 103, 1), (709, 97, 1), (301, 89, 1), (2416, 82, 1), (3251, 76, 1),
    (3246, 69, 1), (4141, 62, 1), (5963, 55, 1), (8839, 47, 1), (10490, 40, 1), (16994, 31, 1), (23659, 21, 1),
)  # fmt: skip


@dataclass(frozen=True)
class LogScale:
    """A scale of log luminance: code c > 0 stands for 2^((c + ½)/steps − lowest).

    steps : codes per octave
    lowest : octaves below 1 at which the codes begin
    codes : how many there are
    signed : whether a sign bit marks negative luminance
    """

    steps: int
    lowest: int
    codes: int
    signed: bool

    def luminances(self) -> np.ndarray:
        """(65536,) float64, read-only: the luminance of each 16-bit code with its sign; 0 for codes that are none."""
        return _luminances(self)


@lru_cache
def _luminances(scale: LogScale) -> np.ndarray:
    result = np.zeros(2**16)
    code = np.arange(1, scale.codes)
    result[1 : scale.codes] = np.exp2((code + 0.5) / scale.steps - scale.lowest)
    if scale.signed:
        result[SIGN + 1 : SIGN + scale.codes] = -result[1 : scale.codes]
    result.flags.writeable = False
    return result


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
        return _cells_of_24_bits()
    middle = (np.arange(256) + 0.5) / GRID
    return np.stack(np.meshgrid(middle, middle, indexing="ij"), axis=-1).reshape(-1, 2)


@lru_cache
def colours(bits: int) -> np.ndarray:
    """CIE X, Y, Z at luminance 1 of each colour code, float64, read-only, from eq. 3."""
    u, v = chromaticities(bits).T
    result = np.stack([9 * u, 4 * v, 12 - 3 * u - 20 * v], axis=-1) / (4 * v[:, None])
    result.flags.writeable = False
    return result


@lru_cache
def lines() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u′ where each of the 163 scan lines begins, how many cells it has, and the code of its first.

    returns : (163,) float64, (163,) int64, (163,) int64
    """
    starts, counts, repeats = np.array(_LINES).T
    counts = np.repeat(counts, repeats)
    return np.repeat(starts, repeats) / 1e6, counts, np.cumsum(counts) - counts


def _cells_of_24_bits() -> np.ndarray:
    """(16384, 2) float64: u′, v′ in the middle of each code's cell; neutral for the codes that have none."""
    starts, counts, firsts = lines()
    line = np.repeat(np.arange(len(counts)), counts)
    along = np.arange(CODES) - firsts[line]
    result = np.tile(NEUTRAL, (2**14, 1))
    result[:CODES, 0] = starts[line] + (along + 0.5) * CELL
    result[:CODES, 1] = LOWEST + (line + 0.5) * CELL
    return result
