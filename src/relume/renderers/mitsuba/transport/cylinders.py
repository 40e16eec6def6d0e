"""How wide light that was kept is counted: by what scatters it, and by the smallest of what bent it on its way there.

The light that a large glass ball gathers is counted over a size of its own, and so is that of a bead beside it.
Bodies of like size share a level. What bends no light has no say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit
import mitsuba
import numpy as np

from relume.renderers.mitsuba.arrays import aligned
from relume.renderers.mitsuba.transport.media import Media

# Untyped: a type checker would follow every variable round and round the loops.
dr: Any = drjit
mi: Any = mitsuba

LIKE = 2.0
"""Bodies whose radii differ by less than this factor share a level; the smallest of them gives its size."""
HALF, WIDE = 0.15, 1.0
"""Of a mean free path: half the height and the radius of the cylinder, at most."""
HALF_BODY, WIDE_BODY = 0.01, 0.02
"""The same of the radius of the body."""
BENT = 0.2
"""Of half the height: how far the surface may bend away from the cylinder's flat side, at most."""
LANDED = 0.02
"""Of a smooth object's radius: about a place on a surface, where light is counted that it sent there."""


@dataclass(frozen=True)
class Body:
    """A shape as the light meets it.

    shape : its number in Mitsuba; medium : of what fills it, 0 for nothing
    radius : of its bounding sphere, metres; bends : whether it sends light on in one direction, and not straight
    """

    shape: int
    medium: int
    radius: float
    bends: bool


class Cylinders:
    """Half the height and the radius of what is counted, by what scatters light and by what bent it before.

    sizes : (levels · step, 2), metres, of `number + level · step`; number : of what scatters the light, below `step`
    smallest : (levels,) the smallest radius of each level, rising
    """

    # Not a dataclass: Dr.Jit's loops would take its fields for state.
    def __init__(self, sizes: np.ndarray, step: int, smallest: np.ndarray, bodies: Sequence[Body]) -> None:
        self.sizes, self.step, self.levels = sizes, step, len(smallest)
        table = np.full(max((body.shape for body in bodies), default=0) + 1, self.levels - 1, np.uint32)
        for body in bodies:
            if body.bends:
                table[body.shape] = np.searchsorted(smallest, body.radius, side="right") - 1
        self.table = mi.UInt32(aligned(table, np.uint32))

    def narrowed(self, level: Any, shape: Any, bent: Any) -> Any:
        """The level of light after a shape, where that bent it: never above the one before."""
        number = mi.UInt32(dr.reinterpret_array(mi.UInt32, shape))
        known = bent & (number < dr.width(self.table))
        own = dr.gather(mi.UInt32, self.table, dr.select(known, number, 0), known)
        return dr.select(known, dr.minimum(level, own), level)


def in_bodies(media: Media, bodies: Sequence[Body]) -> Cylinders:
    """What is counted in media."""
    numbers = np.arange(len(np.array(media.anisotropy)))
    densest = np.array(media.extinction(mi.UInt32(numbers))).max(axis=0)
    smallest = _levels(bodies)
    sizes = np.ones((len(smallest), len(numbers), 2))
    for number, free in zip(numbers, 1 / np.maximum(densest, 1e-12), strict=True):
        # Smoke in a body ends with it, and its surface bends nothing.
        smoke = max((body.radius for body in bodies if body.medium == number and not body.bends), default=np.inf)
        for level, radius in enumerate(np.minimum(smallest, smoke)):
            half = min(HALF * free, HALF_BODY * radius)
            sizes[level, number] = half, min(WIDE * free, WIDE_BODY * radius, np.sqrt(2 * BENT * half * radius))
    return Cylinders(sizes.reshape(-1, 2), len(numbers), smallest, bodies)


def on_floors(bodies: Sequence[Body]) -> Cylinders:
    """What is counted on surfaces, whose number is 1."""
    smallest = _levels(bodies)
    sizes = np.repeat(LANDED * smallest[:, None] * [0.5, 1.0], 2, axis=0)
    return Cylinders(sizes, 2, smallest, bodies)


def _levels(bodies: Sequence[Body]) -> np.ndarray:
    smallest: list[float] = []
    for radius in sorted(body.radius for body in bodies if body.bends):
        if not smallest or radius >= LIKE * smallest[-1]:
            smallest.append(radius)
    return np.array(smallest)
