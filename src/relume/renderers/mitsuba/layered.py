"""glTF's opaque surface as one BSDF for Mitsuba's Dr.Jit variants: sheen over coat over gloss over base.

Mitsuba has no such sum: `principled` brightens white dielectrics and has other lobes for coat, sheen and anisotropy.
Here a coat and a gloss take the share E(ωv) of the light, their directional albedo (`directional_albedo`) towards the
viewer, and what is under them has 1 − E(ωv) of it: albedo scaling, as OpenPBR, MaterialX and Blender have it and glTF's
coat does. A white dielectric looks white from everywhere, at any roughness. It is not reciprocal: light that is
followed from the lamps is scattered by the same function with the directions' parts exchanged (decision 44). Metals are
single-scattering GGX, as glTF has them. Frames are Mitsuba's: x along the texture's u, y up in the picture.
Imported only where something is rendered: it imports Mitsuba.
"""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any

from relume.renderers.directional_albedo import COAT_IOR, COSINES, NARROWEST, NARROWEST_SHEEN, ggx_shares, sheen_shares
from relume.renderers.mitsuba.arrays import texture
from relume.renderers.unsupported import extra_lobes
from relume.scene.materials.materials import Material

# The stubs of Mitsuba are of no variant in particular.
dr: Any = import_module("drjit")
mi: Any = import_module("mitsuba")

RAREST = 0.02
"""Least share of the samples that a layer gets which is there: its weight stays bounded where its albedo is small."""


def layered(material: Material) -> Any:
    """The opaque part of a material, one-sided; for the variants with `_ad_` in their names."""
    return surface_class(Layered, mi.variant())(mi.Properties(), material)


@lru_cache
def surface_class(methods: type, variant: str) -> type:
    """The class for a variant of Mitsuba: its base class is another in each, and takes no second one beside it."""
    parts = reversed(methods.__mro__[:-1])
    every = {name: each for part in parts for name, each in vars(part).items() if callable(each)}
    return type(mi.BSDF)(methods.__name__, (mi.BSDF,), every)


def _shares(table: Any) -> Any:
    return mi.Texture2f(mi.TensorXf(table), filter_mode=dr.FilterMode.Linear, wrap_mode=dr.WrapMode.Clamp)


def _share(table: Any, cosine: Any, roughness: Any) -> Any:
    # The tables' nodes are even in √cos θ and in roughness; look-ups have their nodes at texel centres.
    at = mi.Point2f(dr.sqrt(dr.clip(cosine, 0, 1)), dr.clip(roughness, 0, 1))
    return table.eval((at * (COSINES - 1) + 0.5) / COSINES)


def _largest(colour: Any) -> Any:
    return dr.maximum(dr.maximum(colour[0], colour[1]), colour[2])


class Surface:
    """What surfaces of diffuse and glossy lobes have in common, whatever the variant: `mi` means the one in use."""

    # f·cos θo and the density of the directions.
    evaluated: Any

    def set_kinds(self, diffuse: Any, glossy: Any) -> None:
        front = mi.BSDFFlags.FrontSide
        self.m_components = [diffuse | front, glossy | front]
        self.m_flags = diffuse | glossy | front

    def drawn(self, wo: Any, value: Any, density: Any, glossy: Any, active: Any) -> tuple[Any, Any]:
        """Mitsuba's record of a direction that was drawn for one of the lobes, and its weight."""
        sampled = dr.zeros(mi.BSDFSample3f)
        sampled.wo, sampled.pdf, sampled.eta = wo, density, 1.0
        sampled.sampled_component = dr.select(glossy, mi.UInt32(1), mi.UInt32(0))
        sampled.sampled_type = dr.select(
            glossy, mi.UInt32(+mi.BSDFFlags.GlossyReflection), mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
        )
        there = active & (density > 0)
        return sampled, dr.select(there, value / dr.maximum(density, 1e-20), 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.evaluated(ctx, si, wo, active)[0]

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.evaluated(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        return self.evaluated(ctx, si, wo, active)

    def to_string(self) -> str:
        return f"{type(self).__name__}[]"


class Layered(Surface):
    """Sheen over coat over gloss over base."""

    def __init__(self, properties: Any, material: Material) -> None:
        mi.BSDF.__init__(self, properties)
        self.textures = {
            field: texture(mi, getattr(material, field))
            for field in (
                "base_color", "metallic", "roughness", "specular", "specular_color", "clearcoat",
                "clearcoat_roughness", "sheen_color", "sheen_roughness",
            )
        }  # fmt: skip
        # Opaque to the compiler, so that all materials of this class share one program.
        self.ior = dr.opaque(mi.Float, max(material.ior, 1.0))
        self.strength = dr.opaque(mi.Float, material.anisotropy)
        self.rotation = dr.opaque(mi.Float, material.anisotropy_rotation)
        # Of a measured metal: n and k of each channel.
        self.metal = None
        if material.metal is not None:
            self.metal = [[dr.opaque(mi.Float, value) for value in part] for part in material.metal.eta_k]
        self.gloss_table = _shares(ggx_shares(float(material.ior)))
        self.steps = material.ior >= 1.0001
        there = extra_lobes(material)
        self.turned, self.coated, self.fibrous = there["anisotropy"], there["clearcoat"], there["sheen"]
        self.coat_table: Any = _shares(ggx_shares(COAT_IOR)) if self.coated else None
        self.sheen_table: Any = _shares(sheen_shares()) if self.fibrous else None
        self.set_kinds(mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection)

    def number(self, field: str, si: Any, active: Any) -> Any:
        return self.textures[field].eval_1(si, active)

    def colour(self, field: str, si: Any, active: Any) -> Any:
        return self.textures[field].eval_3(si, active)

    def turn(self, v: Any, back: bool = False) -> Any:
        """The direction in the frame of the lobe, turned against its rotation; or back."""
        if not self.turned:
            return v
        sine, cosine = dr.sincos(self.rotation)
        sine = -sine if back else sine
        return mi.Vector3f(cosine * v.x + sine * v.y, cosine * v.y - sine * v.x, v.z)

    def gloss(self, si: Any, active: Any) -> tuple[Any, Any]:
        """The microfacets and their mean perceptual roughness."""
        roughness = self.number("roughness", si, active)
        across = dr.maximum(dr.square(roughness), NARROWEST)
        if not self.turned:
            return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, across, True), roughness
        along = dr.lerp(across, 1.0, dr.square(self.strength))
        lobe = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, along, across, True)
        return lobe, dr.sqrt(dr.sqrt(along * across))

    def coat(self, si: Any, active: Any) -> tuple[Any, Any]:
        roughness = self.number("clearcoat_roughness", si, active)
        alpha = dr.maximum(dr.square(roughness), NARROWEST)
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True), roughness

    def normal_reflectance(self, si: Any, active: Any) -> tuple[Any, Any]:
        """F₀ and F₉₀ of the dielectric (KHR_materials_specular)."""
        weight = self.number("specular", si, active)
        step = dr.square((self.ior - 1) / (self.ior + 1))
        return weight * dr.minimum(step * self.colour("specular_color", si, active), 1), weight

    def risen(self, cosine: Any, ior: Any, steps: bool = True) -> Any:
        if not steps:
            return dr.power(1 - cosine, 5)
        normal = dr.square((ior - 1) / (ior + 1))
        return dr.clip((mi.fresnel(cosine, ior)[0] - normal) / (1 - normal), 0, 1)

    def metal_reflectance(self, base: Any, cosine: Any) -> Any:
        """By Fresnel's equations where n and k are known, by Schlick's approximation from the base colour else."""
        if self.metal is None:
            return base + (1 - base) * dr.power(1 - cosine, 5)
        eta, k = self.metal
        return mi.Color3f(*(mi.fresnel_conductor(cosine, mi.Complex2f(eta[c], k[c])) for c in range(3)))

    def probabilities(self, si: Any, active: Any) -> tuple[Any, Any, Any, Any]:
        """Shares of the samples for base, gloss, coat and sheen: about what each returns of light from here."""
        base, metallic = self.colour("base_color", si, active), self.number("metallic", si, active)
        low, high = self.normal_reflectance(si, active)
        _, roughness = self.gloss(si, active)
        at_view = _share(self.gloss_table, si.wi.z, roughness)
        returned = _largest(low) * at_view[0] + high * at_view[1]
        tint = _largest(base)
        diffuse = (1 - metallic) * tint * (1 - returned)
        glossy = dr.lerp(returned, tint, metallic)
        none = mi.Float(0)
        coat, fibres, under = none, none, mi.Float(1)
        if self.coated:
            amount = self.number("clearcoat", si, active)
            _, coat_roughness = self.coat(si, active)
            at_view = _share(self.coat_table, si.wi.z, coat_roughness)
            coat = amount * (0.04 * at_view[0] + at_view[1])
            under = 1 - coat
        if self.fibrous:
            fibre = _largest(self.colour("sheen_color", si, active))
            at_view = _share(self.sheen_table, si.wi.z, self.sheen_roughness(si, active))
            fibres = fibre * at_view[0]
        lobes = (
            diffuse * under + dr.select(diffuse > 0, RAREST, 0),
            glossy * under + dr.select(glossy > 0, RAREST, 0),
            coat + dr.select(coat > 0, RAREST, 0),
            fibres + dr.select(fibres > 0, RAREST, 0),
        )
        total = lobes[0] + lobes[1] + lobes[2] + lobes[3]
        scale = dr.select(total > 0, dr.rcp(dr.maximum(total, 1e-12)), 0)
        return lobes[0] * scale, lobes[1] * scale, lobes[2] * scale, lobes[3] * scale

    def sheen_roughness(self, si: Any, active: Any) -> Any:
        return dr.maximum(self.number("sheen_roughness", si, active), NARROWEST_SHEEN)

    def evaluated(self, ctx: Any, si: Any, wo: Any, active: Any, shares_of_samples: Any = None) -> tuple[Any, Any]:
        """f·cos θo and the density of the directions; `shares_of_samples` where they are known already."""
        # The geometry, and what the layers share.
        wi = si.wi
        cos_i, cos_o = wi.z, wo.z
        active = active & (cos_i > 0) & (cos_o > 0)
        half = dr.normalize(wi + wo)
        facing = dr.clip(dr.dot(wi, half), 0, 1)
        base, metallic = self.colour("base_color", si, active), self.number("metallic", si, active)
        low, high = self.normal_reflectance(si, active)
        p_base, p_gloss, p_coat, p_fibres = shares_of_samples or self.probabilities(si, active)

        # The gloss of the dielectric and the metal.
        lobe, roughness = self.gloss(si, active)
        wi_l, wo_l, half_l = self.turn(wi), self.turn(wo), self.turn(half)
        shape = lobe.eval(half_l) * lobe.G(wi_l, wo_l, half_l) / (4 * cos_i)
        dielectric = low + (high - low) * self.risen(facing, self.ior, self.steps)
        metal = self.metal_reflectance(base, facing)
        glossy = dr.lerp(dielectric, metal, metallic) * shape
        density = p_gloss * lobe.pdf(wi_l, half_l) / (4 * dr.maximum(facing, 1e-8))

        # The diffuse base has what the dielectric's gloss leaves, as the viewer sees it.
        cos_v = cos_o if ctx.mode == mi.TransportMode.Importance else cos_i
        at_v = _share(self.gloss_table, cos_v, roughness)
        cosine_lobe = cos_o * dr.inv_pi
        diffuse = (1 - metallic) * base * (1 - _largest(low) * at_v[0] - high * at_v[1]) * cosine_lobe
        density += p_base * cosine_lobe

        value = diffuse + glossy
        # The coat, and what it leaves to the layers below.
        if self.coated:
            amount = self.number("clearcoat", si, active)
            film, film_roughness = self.coat(si, active)
            at_v = _share(self.coat_table, cos_v, film_roughness)
            reflected = 0.04 + 0.96 * self.risen(facing, mi.Float(COAT_IOR))
            film_shape = film.eval(half) * film.G(wi, wo, half) / (4 * cos_i)
            value = value * (1 - amount * (0.04 * at_v[0] + at_v[1])) + amount * reflected * film_shape
            density += p_coat * film.pdf(wi, half) / (4 * dr.maximum(facing, 1e-8))
        # The sheen's fibres, on top of the others.
        if self.fibrous:
            fibre, fibre_roughness = self.colour("sheen_color", si, active), self.sheen_roughness(si, active)
            at_i, at_o = (_share(self.sheen_table, cosine, fibre_roughness) for cosine in (cos_i, cos_o))
            through = 1 - _largest(fibre) * dr.maximum(at_i[0], at_o[0])
            inverse = dr.rcp(dr.square(fibre_roughness))
            sine = dr.safe_sqrt(1 - dr.square(half.z))
            stand = (2 + inverse) * dr.power(dr.maximum(sine, 1e-6), inverse) * dr.inv_two_pi
            bound = dr.maximum(dr.maximum(at_i[1], at_o[1]), 1)
            fur = stand / (4 * (cos_i + cos_o - cos_i * cos_o) * bound) * cos_o
            value = value * through + fibre * fur
            density += p_fibres * dr.inv_two_pi
        return dr.select(active, value, 0), dr.select(active, density, 0)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        shares_of_samples = self.probabilities(si, active)
        _, p_gloss, p_coat, p_fibres = shares_of_samples
        wo = mi.warp.square_to_cosine_hemisphere(sample2)
        # What is left of the first number chooses the layer: gloss, coat, then the even lobes.
        on_gloss = sample1 < p_gloss
        lobe, _ = self.gloss(si, active)
        normal, _ = lobe.sample(self.turn(si.wi), sample2)
        wo[on_gloss] = mi.reflect(si.wi, mi.Normal3f(self.turn(normal, back=True)))
        if self.coated:
            on_coat = (sample1 >= p_gloss) & (sample1 < p_gloss + p_coat)
            film, _ = self.coat(si, active)
            normal, _ = film.sample(si.wi, sample2)
            wo[on_coat] = mi.reflect(si.wi, normal)
        if self.fibrous:
            # Fibres shine at grazing, where even chances over the solid angle are nearer to them than the cosine's.
            on_fibres = (sample1 >= p_gloss + p_coat) & (sample1 < p_gloss + p_coat + p_fibres)
            wo[on_fibres] = mi.warp.square_to_uniform_hemisphere(sample2)
        value, density = self.evaluated(ctx, si, wo, active, shares_of_samples)
        return self.drawn(wo, value, density, sample1 < p_gloss + p_coat, active)

    def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
        return self.colour("base_color", si, active)
