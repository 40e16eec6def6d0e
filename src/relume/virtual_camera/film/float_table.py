"""A smooth function of one positive number as a table over the bits of its float32, evenly fine in every octave."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import exact_kernel, inlined

LOWEST, HIGHEST = -40, 40
"""Octaves tabulated, 2⁻⁴⁰ to 2⁴⁰: beyond the range of any picture, in any unit; outside the ends count."""
FINE = 9
"""Leading bits of the mantissa with an entry of their own, 512 in an octave; between them the line is followed. A
curve with slope 1 per octave and a bend a tenth of an octave wide is then exact to 1e-5."""
SHIFT = 23 - FINE
OFFSET = (127 + LOWEST) << 23
LAST = (HIGHEST - LOWEST) << 23
REST = (1 << SHIFT) - 1
PART = np.float32(2.0**-SHIFT)
STRETCH = 1 << 16


def tabulated(function: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """The table (N,) float32 of a function of float64 arrays that is defined above 0."""
    places = (np.arange((HIGHEST - LOWEST) * 2**FINE + 2) << SHIFT) + OFFSET
    return np.asarray(function(places.astype(np.int32).view(np.float32).astype(np.float64)), np.float32)


@inlined
def looked_up(table, bits):
    """The function's value at the float32 that has those bits, not negative."""
    place = min(max(bits - OFFSET, 0), LAST)
    entry = place >> SHIFT
    below = table[entry]
    return below + np.float32(place & REST) * PART * (table[entry + 1] - below)


@exact_kernel
def _stretch(values, factor, tables, out):
    exposed = np.empty(3, np.float32)
    own_bits = exposed.view(np.int32)
    for i in range(values.shape[0]):
        for c in range(3):
            exposed[c] = values[i, c] * factor
            out[i, c] = looked_up(tables[c], own_bits[c])


def mapped(radiance: np.ndarray, factor: float, tables: np.ndarray) -> np.ndarray:
    """A function of each channel's radiance × factor: (H, W, 3) float32.

    radiance : (H, W, 3) float32, ≥ 0
    tables : (3, N) of `tabulated`, a channel each
    """
    flat = np.ascontiguousarray(radiance).reshape(-1, 3)
    out = np.empty_like(flat)

    def work(begin: int, end: int) -> None:
        part = flat[begin:end]
        _stretch(part, np.float32(factor), tables, out[begin:end])

    in_threads(work, flat.shape[0], chunk=STRETCH)
    return out.reshape(radiance.shape)
