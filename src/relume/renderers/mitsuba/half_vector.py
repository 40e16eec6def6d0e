"""Isotropic surfaces that are known by half and difference angle, for Mitsuba's Dr.Jit variants: measured tables and
ABC facets. Directions are drawn by a lobe of half vectors that is fitted to the surface, and by the cosine.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from relume.errors import warn
from relume.renderers.half_vectors import BINS, COSINES, HalfVectorLobe, fitted_lobe
from relume.renderers.mitsuba.layered import Surface, dr, mi, surface_class
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.measured import MeasuredBRDF

GRAZING, MOST = 0.2, 1.01
"""The cosine from which on an albedo counts, and the albedo that is more than an error of quadrature."""


def half_vector(material: MeasuredBRDF | ABCFacets) -> Any:
    """The surface, one-sided; for the variants with `_ad_` in their names. Warns where it returns more than it gets."""
    methods = MeasuredSurface if isinstance(material, MeasuredBRDF) else ABCSurface
    lobe = fitted_lobe(material)
    # At grazing angles measurements are poor, and few pixels are seen there.
    seen = lobe.albedo[int(GRAZING * COSINES) :]
    if seen.max() > MOST:
        warn(
            f"the measured surface {material.name!r} returns up to {seen.max():.3g} of the light that it gets; between "
            "such surfaces light grows: give it a smaller scale"
        )
    return surface_class(methods, mi.variant())(mi.Properties(), material, lobe)


class HalfVectorSurface(Surface):
    """What both have in common: how directions are drawn."""

    # f of directions above the surface and their half vector.
    reflectance: Any

    def set_lobe(self, lobe: HalfVectorLobe) -> None:
        self.edges = mi.Float(lobe.edges.astype(np.float32))
        self.chances = mi.Float(lobe.chances.astype(np.float32))
        self.below = mi.Float(np.concatenate([[0], np.cumsum(lobe.chances)]).astype(np.float32))
        self.glossy = mi.Float(lobe.glossy.astype(np.float32))
        self.mean = mi.Color3f(*(dr.opaque(mi.Float, float(c)) for c in np.minimum(lobe.albedo[COSINES // 2], 1)))
        self.set_kinds(mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection)

    def share(self, cosine: Any, active: Any) -> Any:
        """The share of the samples that the lobe gets, by the view."""
        at = dr.clip(cosine, 0, 1) * (COSINES - 1)
        low = dr.minimum(mi.UInt32(at), COSINES - 2)
        first, second = (dr.gather(mi.Float, self.glossy, low + step, active) for step in (0, 1))
        return dr.lerp(first, second, at - mi.Float(low))

    def evaluated(self, ctx: Any, si: Any, wo: Any, active: Any) -> tuple[Any, Any]:
        active = active & (si.wi.z > 0) & (wo.z > 0)
        half = dr.normalize(si.wi + wo)
        facing = dr.maximum(dr.dot(si.wi, half), 1e-6)
        level = dr.sqrt(dr.square(half.x) + dr.square(half.y))
        theta = dr.atan2(level, half.z)
        index = dr.minimum(mi.UInt32(dr.sqrt(theta * (2 / dr.pi)) * BINS), BINS - 1)
        low, high, chance = (
            dr.gather(mi.Float, table, place, active)
            for table, place in ((self.edges, index), (self.edges, index + 1), (self.chances, index))
        )
        lobe = chance / (dr.two_pi * (high - low) * 4 * facing)
        value = self.reflectance(si.wi, wo, half, theta, level, active) * wo.z
        density = dr.lerp(wo.z * dr.inv_pi, lobe, self.share(si.wi.z, active))
        return dr.select(active, value, 0), dr.select(active, density, 0)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        # The bin that the first number falls into; what is left of the number places the direction in it.
        index = dr.binary_search(0, BINS - 1, lambda i: dr.gather(mi.Float, self.below, i + 1, active) <= sample2.x)
        low, high, under, chance = (
            dr.gather(mi.Float, table, place, active)
            for table, place in (
                (self.edges, index), (self.edges, index + 1), (self.below, index), (self.chances, index)
            )
        )  # fmt: skip
        left = dr.clip((sample2.x - under) / dr.maximum(chance, 1e-20), 0, 1)
        versine = dr.lerp(low, high, left)
        sine, cosine = dr.sincos(dr.two_pi * sample2.y)
        level = dr.safe_sqrt(versine * (2 - versine))
        on_gloss = sample1 < self.share(si.wi.z, active)
        wo = mi.warp.square_to_cosine_hemisphere(sample2)
        wo[on_gloss] = mi.reflect(si.wi, mi.Normal3f(level * cosine, level * sine, 1 - versine))
        value, density = self.evaluated(ctx, si, wo, active)
        return self.drawn(wo, value, density, on_gloss, active)

    def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
        return mi.Color3f(self.mean)


class MeasuredSurface(HalfVectorSurface):
    """A table, linear between the middles of its entries."""

    def __init__(self, properties: Any, material: MeasuredBRDF, lobe: HalfVectorLobe) -> None:
        mi.BSDF.__init__(self, properties)
        self.set_lobe(lobe)
        # One more entry at both ends of φd, which comes round.
        padded = np.concatenate([material.values[:, :, -1:], material.values, material.values[:, :, :1]], axis=2)
        self.sizes = material.values.shape[:3]
        self.table = mi.Texture3f(
            mi.TensorXf(np.ascontiguousarray(padded)), filter_mode=dr.FilterMode.Linear, wrap_mode=dr.WrapMode.Clamp
        )

    def reflectance(self, wi: Any, wo: Any, half: Any, theta: Any, level: Any, active: Any) -> Any:
        apart = wi - wo
        difference = dr.atan2(dr.norm(apart), dr.norm(wi + wo))
        # As `scene.materials.measured.half_and_difference`.
        along = level > 1e-7
        scale = dr.rcp(dr.maximum(level, 1e-7))
        x, y = dr.select(along, half.x * scale, 1), dr.select(along, half.y * scale, 0)
        across = x * apart.y - y * apart.x
        upright = half.z * (x * apart.x + y * apart.y) - level * apart.z
        turn = dr.atan2(across, upright)
        turn = dr.select(turn < 0, turn + dr.pi, turn)
        rows = self.sizes[2]
        at = mi.Point3f(
            (turn * (rows / dr.pi) + 1) / (rows + 2), difference * (2 / dr.pi), dr.sqrt(theta * (2 / dr.pi))
        )
        found = self.table.eval(at, active)
        return mi.Color3f(found[0], found[1], found[2])


class ABCSurface(HalfVectorSurface):
    """ABC facets over a diffuse base, exactly."""

    def __init__(self, properties: Any, material: ABCFacets, lobe: HalfVectorLobe) -> None:
        mi.BSDF.__init__(self, properties)
        self.set_lobe(lobe)
        # Opaque to the compiler, so that all materials of this class share one program.
        self.diffuse, self.strength = (
            mi.Color3f(*(dr.opaque(mi.Float, float(channel)) for channel in colour))
            for colour in (material.diffuse, material.strength)
        )
        self.b, self.c, self.ior = (dr.opaque(mi.Float, float(each)) for each in (material.b, material.c, material.ior))

    def reflectance(self, wi: Any, wo: Any, half: Any, theta: Any, level: Any, active: Any) -> Any:
        facing = dr.clip(dr.dot(wi, half), 1e-6, 1)
        versine = 2 * dr.square(dr.sin(theta / 2))
        facets = dr.power(1 + self.b * versine, -self.c)
        masked = dr.minimum(1, 2 * half.z * dr.minimum(wi.z, wo.z) / facing)
        shape = mi.fresnel(facing, self.ior)[0] * masked * facets / dr.maximum(wi.z * wo.z, 1e-9)
        return (self.diffuse + self.strength * shape) * dr.inv_pi
