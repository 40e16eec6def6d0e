"""Scene materials as layers of reflection maps: `Diffuse`, glTF's `Material` and `Reflective`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from relume.light.reflection.brdf import GGX
from relume.light.reflection.glossy import albedo
from relume.light.reflection.lobes import GGXLobe, Lambert, Mirror
from relume.light.reflection.weights import ByAngle, Complement, Schlick
from relume.renderers.raytrace.alpha_coverage import repeated
from relume.renderers.unsupported import warn_of_unsupported
from relume.scene.materials.materials import Colour, Diffuse, Material
from relume.scene.materials.reflective import Layer, Reflective, Towards

SMOOTHEST = 0.07
"""Below this α the three-dimensional map would need hundreds of megabytes; the lobe about R is taken."""
MIRROR = 0.002
"""Below this α the lobe is narrower than an entry of any map: a mirror."""
LEVELS = 6
"""Widths between which a roughness image is interpolated."""

ANGLES = 33
"""View angles at which a material's reflectance is integrated."""

Shade = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""A colour (Q, 3), or (1, 3) where it is everywhere the same, from texture coordinates (P, 2) and rows (Q,) of them."""


@dataclass(frozen=True, eq=False)
class ShadedLayer:
    """A layer whose colours may vary over the surface.

    layer : lobe, direction and weights; its own colour is not used
    colour : what multiplies `layer.weight`
    rim : what multiplies `layer.grazing`
    has_image : whether a colour asks for texture coordinates
    """

    layer: Layer
    colour: Shade
    rim: Shade
    has_image: bool = False


def layers_of(material: Material | Diffuse | Reflective) -> tuple[ShadedLayer, ...]:
    """The layers that a material adds up."""
    if isinstance(material, Diffuse):
        lambert = Layer(Lambert(), Towards.NORMAL)
        return (ShadedLayer(lambert, _shade(material.reflectance), _shade(0.0), np.ndim(material.reflectance) > 1),)
    if isinstance(material, Reflective):
        return tuple(
            ShadedLayer(layer, _shade(layer.colour), _shade(1.0), np.ndim(layer.colour) > 1)
            for layer in material.layers
        )
    images = any(
        np.ndim(each) > 1
        for each in (material.base_color, material.metallic, material.roughness, material.transmission)
    )
    warn_of_unsupported(material, "reflection maps do")
    return tuple(replace(layer, has_image=images) for layer in _metallic_roughness(material))


def _metallic_roughness(material: Material) -> Iterator[ShadedLayer]:
    """glTF's model: a metal of the base colour, or a dielectric coat over it (glTF 2.0, appendix B)."""
    base, metallic, clear = (_shade(v) for v in (material.base_color, material.metallic, material.transmission))
    dielectric = ((material.ior - 1) / (material.ior + 1)) ** 2
    roughness = np.asarray(material.roughness, np.float64)
    white, rim = facet_albedos(float(roughness.mean()) ** 2)
    coat = ByAngle(tuple(dielectric * (white - rim) + rim))
    below = Layer(Lambert(), Towards.NORMAL, Complement(coat))
    yield ShadedLayer(below, lambda uv, at: base(uv, at) * (1 - metallic(uv, at)) * (1 - clear(uv, at)), _shade(0.0))
    if np.any(np.asarray(material.transmission) > 0):
        through = Layer(Mirror(), Towards.REFRACTED, Complement(coat), ior=material.ior)
        yield ShadedLayer(through, lambda uv, at: base(uv, at) * (1 - metallic(uv, at)) * clear(uv, at), _shade(0.0))

    def reflectance(uv: np.ndarray, at: np.ndarray) -> np.ndarray:
        return dielectric * (1 - metallic(uv, at)) + base(uv, at) * metallic(uv, at)

    for alpha, share in _widths(roughness):
        yield ShadedLayer(_specular(alpha), lambda uv, at, share=share: share(uv, at) * reflectance(uv, at), share)


def _specular(alpha: float) -> Layer:
    """Schlick's F0·(1 − s) + s under the facets' sum: its share by angle, times white facets (Karis 2013)."""
    if alpha < MIRROR:
        return Layer(Mirror(), weight=Complement(Schlick(0.0)), grazing=Schlick(0.0))
    white, rim = facet_albedos(alpha)
    if alpha < SMOOTHEST:
        return Layer(GGXLobe(alpha), weight=ByAngle(tuple(white - rim)), grazing=ByAngle(tuple(rim)))
    return Layer(GGX(alpha), weight=ByAngle(tuple(1 - rim / white)), grazing=ByAngle(tuple(rim / white)))


@lru_cache(64)
def facet_albedos(alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """What facets reflect by the angle of view, 0 to π/2, when white and when black along their normal."""
    angles = np.linspace(0, np.pi / 2, ANGLES)
    if alpha < MIRROR:
        return np.ones(ANGLES), Schlick(0.0)(np.cos(angles))
    angles = np.minimum(angles, np.pi / 2 - 1e-3)
    white = np.array([albedo(GGX(alpha), angle) for angle in angles])
    return white, np.array([albedo(GGX(alpha, Schlick(0.0)), angle) for angle in angles])


def _widths(roughness: np.ndarray) -> Iterator[tuple[float, Shade]]:
    """The widths α = roughness² that are looked up, each with its share at every point."""
    low, high = float(roughness.min()), float(roughness.max())
    if high - low < 0.02:
        yield float(roughness.mean()) ** 2, _shade(1.0)
        return
    levels = np.linspace(low, high, LEVELS)
    image = _shade(roughness)
    for level in levels:
        # A hat about each level: between two levels their shares are linear and sum to one.
        yield (
            float(level) ** 2,
            lambda uv, at, level=level: np.maximum(1 - np.abs(image(uv, at) - level) * (LEVELS - 1) / (high - low), 0),
        )


def _shade(value: Colour | np.ndarray | float) -> Shade:
    """A constant, or an image (H, W) or (H, W, 3) repeated over the texture coordinates."""
    image = np.asarray(value, np.float64)
    if image.ndim < 2:
        constant = np.broadcast_to(image, (3,))[None]
        return lambda uv, at: constant
    lookup = repeated(image)

    def looked_up(uv: np.ndarray, at: np.ndarray) -> np.ndarray:
        values = lookup(uv[at])
        return values if image.ndim == 3 else np.repeat(values[:, None], 3, axis=1)

    return looked_up
