"""The colours of 24-bit LogLuv: the visible part of the CIE (u′, v′) diagram, cut into cells along scan lines.

Square cells of 0.0035 lie side by side on 163 lines, each of which begins where the visible colours do and has as many
cells as they need; a colour's code counts the cells from the lower left (Larson 1998, figure 2). The lines themselves
are not in the paper: they are what libtiff decodes its 16289 codes to.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

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


@lru_cache
def lines() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u′ where each of the 163 scan lines begins, how many cells it has, and the code of its first.

    returns : (163,) float64, (163,) int64, (163,) int64
    """
    starts, counts, repeats = np.array(_LINES).T
    counts = np.repeat(counts, repeats)
    return np.repeat(starts, repeats) / 1e6, counts, np.cumsum(counts) - counts


def chromaticities() -> np.ndarray:
    """(16384, 2) float64: u′, v′ in the middle of each code's cell; neutral for the codes that have none."""
    starts, counts, firsts = lines()
    line = np.repeat(np.arange(len(counts)), counts)
    along = np.arange(CODES) - firsts[line]
    result = np.tile(NEUTRAL, (2**14, 1))
    result[:CODES, 0] = starts[line] + (along + 0.5) * CELL
    result[:CODES, 1] = LOWEST + (line + 0.5) * CELL
    return result


def codes(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
