"""Clear glass for Mitsuba's Dr.Jit variants whose index of refraction is said by who follows the light (dispersion).

Mitsuba's dielectric has one index for all light. Here the index comes with the surface's interaction, in its `time`,
which nothing else uses: moments of a shutter are scenes of their own. Where it holds none, below 1, it is n_d.
Imported only where something is rendered: it imports Mitsuba.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from relume.renderers.mitsuba.arrays import texture
from relume.renderers.mitsuba.layered import surface_class
from relume.scene.materials.materials import Material

# The stubs of Mitsuba are of no variant in particular.
dr: Any = import_module("drjit")
mi: Any = import_module("mitsuba")


def dispersive(material: Material) -> Any:
    """The smooth boundary of a clear body; for the variants with `_ad_` in their names."""
    return surface_class(Dispersive, mi.variant())(mi.Properties(), material)


class Dispersive:
    """Reflection and refraction by Fresnel's equations, as Mitsuba's `dielectric` has them."""

    def __init__(self, properties: Any, material: Material) -> None:
        mi.BSDF.__init__(self, properties)
        # Opaque to the compiler, so that all materials of this class share one program.
        self.ior = dr.opaque(mi.Float, max(material.ior, 1.0001))
        # Light crosses a closed body twice; the tint of both crossings together is the base colour.
        self.tint = texture(mi, np.sqrt(np.asarray(material.base_color, np.float32)))
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        reflection, transmission = mi.BSDFFlags.DeltaReflection, mi.BSDFFlags.DeltaTransmission
        self.m_components = [reflection | sides, transmission | sides | mi.BSDFFlags.NonSymmetric]
        self.m_flags = reflection | transmission | sides | mi.BSDFFlags.NonSymmetric

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        index = dr.select(si.time >= 1, si.time, self.ior)
        reflected, cosine, _, relative = mi.fresnel(si.wi.z, index)
        mirrored = sample1 <= reflected
        found = dr.zeros(mi.BSDFSample3f)
        found.wo = dr.select(mirrored, mi.reflect(si.wi), mi.refract(si.wi, cosine, relative))
        found.pdf = dr.select(mirrored, reflected, 1 - reflected)
        found.eta = dr.select(mirrored, 1, dr.rcp(relative))
        found.sampled_component = dr.select(mirrored, mi.UInt32(0), mi.UInt32(1))
        found.sampled_type = dr.select(
            mirrored, mi.UInt32(+mi.BSDFFlags.DeltaReflection), mi.UInt32(+mi.BSDFFlags.DeltaTransmission)
        )
        # Radiance is compressed with the solid angle that it fills.
        squeezed = dr.square(relative) if ctx.mode == mi.TransportMode.Radiance else 1
        weight = dr.select(mirrored, mi.Color3f(1), self.tint.eval_3(si, active) * squeezed)
        return found, dr.select(active, weight, 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return mi.Color3f(0)

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return mi.Float(0)

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        return mi.Color3f(0), mi.Float(0)

    def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
        return mi.Color3f(0)

    def to_string(self) -> str:
        return f"{type(self).__name__}[]"
