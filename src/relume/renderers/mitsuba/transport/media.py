"""What fills the objects, in Dr.Jit: light absorbed and scattered on its way through them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.transport import opaque
from relume.scene.materials.media import Medium


class Media:
    """The media of a scene's bodies, by the numbers that Mitsuba gives their shapes, and the one between bodies.

    shapes : of the bodies, as Mitsuba has them
    media : what fills each of them; None for nothing
    opens : of each body, whether light goes straight through its surface, so that lamps are seen from inside
    outside : what fills the space between them; None for nothing
    """

    def __init__(
        self, shapes: Any, media: Sequence[Medium | None], opens: Sequence[bool] = (), outside: Medium | None = None
    ) -> None:  # fmt: skip
        numbers = np.array(dr.reinterpret_array(mi.UInt32, shapes))
        straight = [*opens, *([False] * (len(media) - len(opens)))]
        bodies = [None if medium is None else (medium, open_) for medium, open_ in zip(media, straight, strict=True)]
        kinds = [kind for kind in bodies if kind is not None]
        table = np.zeros(int(numbers.max(initial=0)) + 1, np.uint32)
        for number, kind in zip(numbers, bodies, strict=True):
            table[number] = 0 if kind is None else 1 + kinds.index(kind)
        self.table = mi.UInt32(table)
        if outside is not None:
            kinds.append((outside, True))
        self.outside = len(kinds) if outside is not None else 0
        # The first entry is empty space.
        every = [medium for medium, _ in kinds]
        self.absorption = [mi.Float([0.0, *(m.absorption[c] for m in every)]) for c in range(3)]
        self.scattering = [mi.Float([0.0, *(m.scattering[c] for m in every)]) for c in range(3)]
        self.anisotropy = mi.Float([0.0, *(m.anisotropy for m in every)])
        self.clear = mi.UInt32([1, *(int(open_) for _, open_ in kinds)])
        self.kept = mi.UInt32([0, *(int(any(m.scattering) and not open_) for m, open_ in kinds)])
        self.scatters = any(any(m.scattering) for m in every)
        self.open = any(open_ for _, open_ in kinds)
        # Whether lamps are looked for where light is scattered, and whether they cannot be.
        self.looked_for = any(any(m.scattering) and open_ for m, open_ in kinds)
        self.closed = any(any(m.scattering) and not open_ for m, open_ in kinds)

    def number(self, shape: Any) -> Any:
        """The number of what fills a shape; 0 for nothing."""
        index = mi.UInt32(dr.reinterpret_array(mi.UInt32, shape))
        known = index < dr.width(self.table)
        return dr.gather(mi.UInt32, self.table, dr.select(known, index, 0), known)

    def opens(self, inside: Any) -> Any:
        """Whether lamps are seen from within a medium, straight through what bounds it; as from empty space."""
        return dr.gather(mi.UInt32, self.clear, inside) == 1

    def scatterings(self, inside: Any) -> Any:
        """Per metre and channel."""
        return self._of(self.scattering, inside)

    def extinction(self, inside: Any) -> Any:
        """Per metre and channel."""
        return self._of(self.absorption, inside) + self._of(self.scattering, inside)

    def scattered_share(self, inside: Any, along: Any, towards: Any) -> Any:
        """Of light from one direction, the share per metre that is scattered into another, per steradian.

        along : the way that light goes backwards in, as rays from the camera go
        towards : where it comes from
        """
        return self._of(self.scattering, inside) * self.phase(inside, along, towards)

    def phase(self, inside: Any, along: Any, towards: Any) -> Any:
        """Henyey and Greenstein's phase function, per steradian."""
        g = dr.gather(mi.Float, self.anisotropy, inside)
        square = dr.maximum(1 + g * g - 2 * g * dr.dot(along, towards), 1e-9)
        return (1 - g * g) / (4 * np.pi * square * dr.sqrt(square))

    def drawn(self, inside: Any, distance: Any) -> Any:
        """Density per metre with which `crossed` scatters at a distance."""
        scattering = self._of(self.scattering, inside)
        return opaque.grey(scattering * dr.exp(-scattering * distance))

    def keeps(self, inside: Any) -> Any:
        """Whether a medium scatters light within a surface that bends it."""
        return dr.gather(mi.UInt32, self.kept, inside) == 1

    def passed(self, inside: Any, distance: Any) -> Any:
        """The share of light that meets nothing on its way (Beer–Lambert)."""
        thickness = self._of(self.absorption, inside) + self._of(self.scattering, inside)
        return dr.select(inside > 0, dr.exp(-thickness * dr.minimum(distance, 1e6)), 1)

    def crossed(self, ray: Any, distance: Any, inside: Any, rng: Any, active: Any) -> tuple[Any, Any, Any]:
        """A way through a medium: whether it ends before the surface, its weight, and the ray that goes on from there.

        Distances are drawn by the scattering of a channel chosen by chance, weighed by the mean over all three;
        absorption is a weight, so that what absorbs strongly is still looked through.
        """
        within = active & (inside > 0)
        absorption, scattering = self._of(self.absorption, inside), self._of(self.scattering, inside)
        reach = dr.minimum(distance, 1e6)
        if not self.scatters:
            return mi.Bool(False), dr.select(within, dr.exp(-absorption * reach), 1), ray
        choice, drawn = rng.next_float32(), rng.next_float32()
        rate = dr.select(choice < 1 / 3, scattering.x, dr.select(choice < 2 / 3, scattering.y, scattering.z))
        free = dr.select(rate > 0, -dr.log(1 - drawn) / dr.maximum(rate, 1e-20), dr.inf)
        scattered = within & (free < reach)
        way = dr.select(scattered, free, reach)
        left = dr.exp(-scattering * way)
        ends = opaque.grey(dr.select(scattered, scattering * left, left))
        weight = dr.select(scattered, scattering * left, left) * dr.exp(-absorption * way) / dr.maximum(ends, 1e-30)
        towards = self._turned(ray.d, inside, mi.Point2f(rng.next_float32(), rng.next_float32()))
        onward = mi.Ray3f(ray(dr.select(scattered, free, 0)), towards)
        return scattered, dr.select(within, weight, 1), onward

    def _turned(self, direction: Any, inside: Any, point: Any) -> Any:
        """A direction by Henyey and Greenstein's phase function."""
        g = dr.gather(mi.Float, self.anisotropy, inside)
        even = dr.abs(g) < 1e-3
        part = (1 - g * g) / (1 - g + 2 * g * point.x)
        cosine = dr.select(even, 1 - 2 * point.x, (1 + g * g - part * part) / dr.select(even, 1, 2 * g))
        sine, turn = dr.sincos(2 * np.pi * point.y)
        flat = dr.safe_sqrt(1 - cosine * cosine)
        return mi.Frame3f(direction).to_world(mi.Vector3f(flat * turn, flat * sine, cosine))

    def _of(self, values: list[Any], inside: Any) -> Any:
        return mi.Color3f(*(dr.gather(mi.Float, channel, inside) for channel in values))
