"""Materials in Mitsuba's words: surfaces, what they send out, and what fills the bodies behind them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from relume.errors import UnsupportedScene, warn
from relume.renderers.directional_albedo import NARROWEST
from relume.renderers.mitsuba.arrays import rgb, texture_words
from relume.renderers.unsupported import extra_lobes
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.materials.media import Medium
from relume.scene.shapes.shapes import AnyMaterial

NARROW = 0.35
"""Below this roughness a metal sends light on nearly one way: α < 0.12, most of it within 14° of the mirror's way."""
SMOOTH = 0.03
"""Below this roughness glass is smooth: α < 0.001, finer than any picture shows."""


def bsdf(mi: Any, material: AnyMaterial, *, media: bool = False, dispersion: bool = False) -> Any:
    """The surface of a material as a BSDF or the dictionary of one; of one that `scene.why_not` has nothing against.

    media : whether the integrator follows light through what fills the body (`Material.medium`). Where it does not, a
        body that scatters is a diffuse one of the same colour, and one that only absorbs is clear: both with a warning.
    dispersion : whether the integrator follows each wavelength by itself (`transport.dispersion`)
    Warns of all else that is not rendered; raises UnsupportedScene for Ward's and measured surfaces in a scalar
    variant.
    """
    if isinstance(material, Diffuse):
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": texture_words(mi, material.reflectance)}}
    if isinstance(material, Ward):
        if not _is_jit(mi):
            raise UnsupportedScene(
                f"the scalar variant of Mitsuba cannot shade the Ward surface {material.name!r}; "
                "install LLVM 16 or newer, or use a metal with anisotropy"
            )
        from relume.renderers.mitsuba.ward import ward

        return {"type": "twosided", "bsdf": ward(material)}
    if isinstance(material, MeasuredBRDF | ABCFacets):
        if not _is_jit(mi):
            raise UnsupportedScene(
                f"the scalar variant of Mitsuba cannot shade the measured surface {material.name!r}; "
                "install LLVM 16 or newer, or use a diffuse or pbr material"
            )
        from relume.renderers.mitsuba.half_vector import half_vector

        return {"type": "twosided", "bsdf": half_vector(material)}
    assert isinstance(material, Material)
    if lost := not_rendered(material, media=media, dispersion=dispersion, scalar=not _is_jit(mi)):
        warn(f"not rendered of material {material.name!r}: {', '.join(lost)}")
    medium = material.medium
    if not media and medium is not None and any(medium.scattering):
        material = replace(
            material, base_color=medium.diffuse_reflectance(), transmission=0.0, scattering_distance=None
        )
    return _masked(mi, material, _surface(mi, material, dispersion and _is_jit(mi) and parts_light(material)))


def parts_light(material: Material) -> bool:
    """Whether its boundary bends light by its wavelength: smooth, with an index for each, of a body that is clear."""
    if material.refraction is None or material.scattering_distance is not None:
        return False
    return float(np.mean(np.asarray(material.roughness))) <= SMOOTH


def not_rendered(material: Material, *, media: bool, scalar: bool, dispersion: bool = False) -> tuple[str, ...]:
    """What of a material Mitsuba's BSDFs here leave out or replace, each in a few words."""
    lost, there = [], extra_lobes(material)
    if np.any(material.through):
        if material.refraction is not None:
            if scalar:
                lost.append("dispersion (the scalar variant has none)")
            elif not parts_light(material):
                lost.append("dispersion of what is rough or scatters inside")
            elif not dispersion:
                lost.append("dispersion")
        upper = ("clearcoat", "sheen", "specular")
        lost += [f"{name} over what light goes through" for name in upper if there[name]]
    if material.medium is not None and not media:
        lost.append("subsurface scattering (drawn diffuse)" if material.scattering_distance else "volume attenuation")
    if scalar:
        if material.metal is not None and np.any(material.roughness):
            lost.append("the metal's reflectance by angle (the scalar variant has Schlick's)")
        layers = ("clearcoat", "sheen", "specular", "anisotropy")
        lost += [f"{name} (the scalar variant has none)" for name in layers if there[name]]
    return tuple(lost)


def emission(mi: Any, material: Any) -> dict[str, Any] | None:
    """The area emitter of a shape of this material; None where it sends out nothing, as all but `Material` do."""
    if not isinstance(material, Material) or not material.emits:
        return None
    return {"type": "area", "radiance": texture_words(mi, material.emission)}


def filling(material: AnyMaterial) -> Medium | None:
    """What fills a body of this material; None where it is empty."""
    return material.medium if isinstance(material, Material) else None


def crossed_straight(material: AnyMaterial) -> np.ndarray | None:
    """The share (3,) of light that crosses the surface of a clear body of index 1, which does not bend it.

    None where light is bent, scattered or mirrored there, or has the colours of an image.
    """
    if not isinstance(material, Material) or material.thin or material.ior > 1 or material.normal is not None:
        return None
    if np.any(np.asarray(material.through) < 1) or np.any(np.asarray(material.alpha) < 1):
        return None
    if np.mean(np.asarray(material.roughness)) > SMOOTH or np.ndim(material.base_color) != 1:
        return None
    return np.sqrt(np.asarray(material.base_color, np.float32))


def sends_narrowly(material: AnyMaterial) -> bool:
    """Whether all light that a surface scatters goes nearly one way: a brushed metal, frosted glass.

    Such a surface is to `transport.caustics` as a smooth one: from the camera its glow on others is found by chance.
    """
    if not isinstance(material, Material) or material.medium is not None or np.any(np.asarray(material.alpha) < 1):
        return False
    if extra_lobes(material)["sheen"] or np.max(np.asarray(material.roughness)) > NARROW:
        return False
    return bool(np.all(material.through == 1) or np.all(np.asarray(material.metallic) == 1))


def interior(material: AnyMaterial) -> dict[str, Any] | None:
    """Mitsuba's medium inside a shape of this material, for its volumetric integrators; None where it is clear."""
    medium = filling(material)
    if medium is None:
        return None
    # Mitsuba's colours end at 1; its scale does not.
    densest = max(medium.extinction)
    return {
        "type": "homogeneous",
        "sigma_t": rgb(np.asarray(medium.extinction) / densest),
        "scale": densest,
        "albedo": rgb(medium.albedo),
        "phase": {"type": "hg", "g": float(medium.anisotropy)} if medium.anisotropy else {"type": "isotropic"},
    }


def _is_jit(mi: Any) -> bool:
    return "_ad_" in mi.variant()


def _surface(mi: Any, material: Material, parted: bool) -> Any:
    through = material.through
    if not np.any(through):
        return _opaque(mi, material)
    clear = _bumped(mi, material, _parted(material) if parted else _clear(mi, material))
    if np.all(through == 1):
        return clear
    return {
        "type": "blendbsdf",
        "weight": texture_words(mi, through),
        "first": _opaque(mi, material),
        "second": clear,
    }


def _bumped(mi: Any, material: Material, surface: Any) -> Any:
    if material.normal is None:
        return surface
    # Mitsuba stores −1…1 as 0…1.
    stored = 0.5 * (np.asarray(material.normal, np.float32) + 1)
    return {"type": "normalmap", "normalmap": texture_words(mi, stored), "nested": surface}


def _masked(mi: Any, material: Material, surface: Any) -> Any:
    if np.all(np.asarray(material.alpha) == 1):
        return surface
    return {"type": "mask", "opacity": texture_words(mi, material.alpha), "nested": surface}


def _opaque(mi: Any, material: Material) -> dict[str, Any]:
    return {"type": "twosided", "bsdf": _bumped(mi, material, _opaque_side(mi, material))}


def _opaque_side(mi: Any, material: Material) -> Any:
    plain, there = np.ndim(material.metallic) == 0 and np.ndim(material.roughness) == 0, extra_lobes(material)
    bare = not (there["clearcoat"] or there["sheen"] or there["anisotropy"])
    if plain and bare and material.metallic == 1 and material.roughness == 0:
        if material.metal is not None:
            eta, k = (rgb(part) for part in material.metal.eta_k)
            return {"type": "conductor", "eta": eta, "k": k}
        return {
            "type": "conductor",
            "material": "none",
            "specular_reflectance": texture_words(mi, material.base_color),
        }
    if _is_jit(mi):
        from relume.renderers.mitsuba.layered import layered

        return layered(material)
    return {
        "type": "principled",
        "base_color": texture_words(mi, material.base_color),
        "metallic": texture_words(mi, material.metallic),
        "roughness": texture_words(mi, material.roughness),
        "eta": max(material.ior, 1.0001),
    }


def _parted(material: Material) -> Any:
    from relume.renderers.mitsuba.dispersive import dispersive

    return dispersive(material)


def _clear(mi: Any, material: Material) -> dict[str, Any]:
    roughness = np.asarray(material.roughness, np.float32)
    base = np.asarray(material.base_color, np.float32)
    ior = max(material.ior, 1.0001)
    if material.thin:
        return _thin(mi, base, roughness, ior)
    dielectric: dict[str, Any] = {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0}
    if np.any(roughness > SMOOTH):
        across = np.maximum(roughness**2, NARROWEST)
        along = across + (1 - across) * material.anisotropy**2
        dielectric |= {"type": "roughdielectric", "distribution": "ggx", "alpha_u": texture_words(mi, along)}
        dielectric["alpha_v"] = texture_words(mi, across)
    # Light crosses a closed body twice; the tint of both crossings together is the base colour.
    return dielectric | {"specular_transmittance": texture_words(mi, np.sqrt(base))}


def _thin(mi: Any, base: np.ndarray, roughness: np.ndarray, ior: float) -> dict[str, Any]:
    if np.all(roughness <= SMOOTH):
        return {
            "type": "thindielectric", "int_ior": ior, "ext_ior": 1.0, "specular_transmittance": texture_words(mi, base),
        }  # fmt: skip
    return {
        "type": "principledthin",
        "base_color": texture_words(mi, base),
        "roughness": texture_words(mi, roughness),
        "spec_trans": 1.0,
        "eta": ior,
    }
