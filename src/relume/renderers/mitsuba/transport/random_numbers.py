"""Random numbers of paths in Dr.Jit: evenly spread where they matter most, by chance where they do not.

Imported only where something is rendered: it imports Mitsuba.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

PLANE = (0.7548776662466927, 0.5698402909980532)
SPACE = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)
"""Steps of sequences that fill a square and a cube evenly: powers of the roots of x³ = x + 1 and x⁴ = x + 1."""


class Numbers:
    """Numbers from 0 to 1 for `samples` rays of each pixel; the same for a seed, whatever the number of threads.

    Seeds of passes should lie far apart (`pass_seed`); `first` is the number of the first pixel.

    Within a pixel the first numbers of its rays are a lattice, shifted by chance: farther apart than drawn ones.
    """

    def __init__(self, count: int, samples: int, seed: int, first: int = 0) -> None:
        index = dr.arange(mi.UInt32, count)
        self.pixel: Any = dr.opaque(mi.UInt32, first) + index // samples
        self.sample = index % samples
        self.seed: Any = dr.opaque(mi.UInt32, seed & 0xFFFFFFFF)
        state, sequence = dr.opaque(mi.UInt64, seed), dr.opaque(mi.UInt64, 1 + seed)
        self.stream = mi.PCG32(size=count, initstate=state, initseq=sequence)  # pyright: ignore[reportCallIssue]

    def within_pixel(self) -> tuple[Any, Any]:
        """Where in its pixel each ray goes through."""
        index = mi.Float(self.sample)
        across, down = (_fraction(self._shift(axis) + index * step) for axis, step in enumerate(PLANE))
        return across, down

    def towards_light(self, look: int, looks: int) -> tuple[Any, Any]:
        """For the first surface of a path: which light, and where in it."""
        index = mi.Float(self.sample * looks + look)
        choice, u, v = (_fraction(self._shift(2 + axis) + index * step) for axis, step in enumerate(SPACE))
        return choice, mi.Point2f(u, v)

    def _shift(self, axis: int) -> Any:
        return mi.sample_tea_float32(self.pixel, self.seed + mi.UInt32(0x9E3779B9 * (axis + 1) & 0xFFFFFFFF), 6)


def two(stream: Any) -> Any:
    """A point of the unit square."""
    first = stream.next_float32()
    return mi.Point2f(first, stream.next_float32())


def _fraction(value: Any) -> Any:
    return dr.minimum(value - dr.floor(value), 0.99999994)
