"""Light parted into wavelengths by glass, in Dr.Jit: which wavelength a path has, how it is bent, what it counts.

A path has none until a boundary first bends it by its wavelength (`Dispersion.met`); from there on it keeps that one,
and its light counts as `relume.light.spectra.hero` says. Mirrored light stays whole: only its share is that of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import drjit
import mitsuba
import numpy as np

from relume.light.spectra.hero import STRATA, strata
from relume.renderers.mitsuba.materials import parts_light
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Shape

dr: Any = drjit
mi: Any = mitsuba


class Dispersion:
    """The shapes of a scene that bend light by its wavelength, by the numbers that Mitsuba gives them.

    A wavelength is a place from 0 to 1, of which each is equally likely; below 0 stands for none.
    """

    def __init__(self, shapes: Sequence[Any], materials: Sequence[Material]) -> None:
        ends, weights, shares = strata()
        numbers = np.array([int(np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(each)))[0]) for each in shapes])
        rows, wrinkled = (np.zeros(int(numbers.max()) + 1, np.uint32) for _ in range(2))
        rows[numbers] = np.arange(len(numbers)) + 1
        wrinkled[numbers] = [material.normal is not None for material in materials]
        self.rows, self.wrinkled = mi.UInt32(rows), mi.UInt32(wrinkled)
        glasses = [material.refraction for material in materials]
        indices = [np.maximum(glass.index(ends), 1.0001) for glass in glasses if glass is not None]
        self.indices = mi.Float(np.concatenate(indices))
        self.middle = mi.Float([max(material.ior, 1.0001) for material in materials])
        self.weights = [mi.Float(np.ascontiguousarray(weights[:, channel])) for channel in range(3)]
        self.shares = [mi.Float(np.ascontiguousarray(shares[:, channel])) for channel in range(3)]

    def index(self, shape: Any, place: Any) -> Any:
        """The index of refraction of a shape at a wavelength; 0 for shapes that have one for all light."""
        row = self._row(shape)
        at = dr.clip(place, 0, 0.99999994) * STRATA
        first = mi.UInt32(at)
        position = dr.select(row > 0, (row - 1) * (STRATA + 1) + first, 0)
        near, far = (dr.gather(mi.Float, self.indices, position + step, row > 0) for step in (0, 1))
        return dr.select(row > 0, near + (at - mi.Float(first)) * (far - near), 0)

    def met(self, si: Any, sample: Any, place: Any, active: Any) -> tuple[Any, Any]:
        """Whether a path without a wavelength takes that at `place` here, and the weight of one that does not.

        si : the surface, whose `time` is the index at `place`
        sample : the direction drawn
        Light that is mirrored from outside stays whole. It was drawn by the reflectance F at `place`, for that at n_d,
        F_d: its weight F_d/F + w (1 − F_d/F) has as its mean over all places that of w F.
        """
        row = self._row(si.shape)
        delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        here = active & (row > 0) & delta
        outside, bent = si.wi.z > 0, si.wi.z * sample.wo.z < 0
        number = dr.reinterpret_array(mi.UInt32, si.shape)
        wrinkled = dr.gather(mi.UInt32, self.wrinkled, dr.select(row > 0, number, 0), row > 0) == 1
        first = here & (bent | ~outside | wrinkled)
        middle = dr.gather(mi.Float, self.middle, dr.select(row > 0, row - 1, 0), row > 0)
        whole = mi.fresnel(si.wi.z, dr.maximum(middle, 1.0001))[0]
        drawn = mi.fresnel(si.wi.z, dr.maximum(si.time, 1.0001))[0]
        share = whole / dr.maximum(drawn, 1e-12)
        weight, _ = self._of(place)
        return first, dr.select(here & ~first, share + weight * (1 - share), 1)

    def sent(self, flux: Any, place: Any, first: Any) -> Any:
        """Light followed from a lamp, where it takes its wavelength."""
        weight, share = self._of(place)
        return dr.select(first, weight * dr.dot(share, flux), flux)

    def weighed(self, throughput: Any, place: Any, first: Any) -> Any:
        """The weight of a path that takes its wavelength, channel by channel: right for white light."""
        return dr.select(first, throughput * self._of(place)[0], throughput)

    def parted(self, before: Any, tint: Any, result: Any, throughput: Any, place: Any, first: Any) -> tuple[Any, ...]:
        """The state of a path from the camera where it takes its wavelength.

        What it has found so far is kept in `before`. What it finds from now on is summed over the channels by their
        shares, which its throughput becomes, and counts by `tint` (`joined`).
        """
        weight, share = self._of(place)
        most = dr.max(share)
        before = dr.select(first, result, before)
        tint = dr.select(first, throughput * weight * most, tint)
        return before, tint, dr.select(first, 0, result), dr.select(first, share / most, throughput)

    def _of(self, place: Any) -> tuple[Any, Any]:
        at = mi.UInt32(dr.clip(place, 0, 0.99999994) * STRATA)
        weight, share = (
            mi.Color3f(*(dr.gather(mi.Float, channel, at) for channel in table))
            for table in (self.weights, self.shares)
        )
        return weight, share

    def _row(self, shape: Any) -> Any:
        number = dr.reinterpret_array(mi.UInt32, shape)
        known = number < dr.width(self.rows)
        return dr.gather(mi.UInt32, self.rows, dr.select(known, number, 0), known)


def joined(before: Any, tint: Any, result: Any, parted: Any) -> Any:
    """The light of a path from the camera, of which some `parted` into wavelengths."""
    return dr.select(parted, before + tint * (result.x + result.y + result.z), result)


def dispersion_of(*parts: tuple[Any, Sequence[Shape]]) -> Dispersion | None:
    """What bends light by its wavelength, of Mitsuba's scenes and the shapes that each is made of; None for nothing."""
    found = [
        (shape, solid.material)
        for built, solids in parts
        if built is not None
        for shape, solid in zip(built.shapes(), solids, strict=True)
        if isinstance(solid.material, Material) and parts_light(solid.material)
    ]
    return Dispersion(*zip(*found, strict=True)) if found else None
