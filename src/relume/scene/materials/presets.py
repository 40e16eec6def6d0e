"""Materials by name, with where their numbers come from.

Metals: measured n and k (`metals`). Colours of matt bodies: the reference sheet of Google's Filament ("Material
properties", sRGB bytes). Translucent bodies: the reduced scattering and absorption that Jensen, Marschner, Levoy and
Hanrahan measured ("A practical model for subsurface light transport", 2001, fig. 5), which with even scattering (g =
0) stand for the true ones by similarity. Rolled and brushed metals: Ward's fits ("Measuring and modeling anisotropic
reflection", 1992, table 1). Indices of refraction at 589 nm: refractiveindex.info; for what parts light into
wavelengths see `glasses`. Roughness is how such things are usually finished, an artist's choice.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from relume.image.colour import decode_srgb
from relume.scene.materials.abc_facets import MERL_FITS, ABCFacets
from relume.scene.materials.checks import triple
from relume.scene.materials.glasses import glass_named
from relume.scene.materials.materials import Colour, Material, Ward
from relume.scene.materials.metals import METALS


def material_preset(name: str) -> Material | Ward | ABCFacets:
    """The material of a name, of `PRESETS` or `MERL_FITS`.

    name : as those lists have it
    Raises ValueError that lists the names.
    """
    if name in PRESETS:
        return PRESETS[name]
    if name in MERL_FITS:
        return MERL_FITS[name]
    if name.startswith("merl/"):
        raise ValueError(f"no preset {name!r}; of MERL's surfaces there are {', '.join(sorted(MERL_FITS))}")
    raise ValueError(
        f"no preset {name!r}; the presets are {', '.join(sorted(PRESETS))}, and merl/NAME for {len(MERL_FITS)} "
        "measured surfaces"
    )


def _srgb(red: int, green: int, blue: int) -> Colour:
    return triple(decode_srgb(np.array([red, green, blue]) / 255))


def _metal(name: str, symbol: str, roughness: float) -> Material:
    return Material(metal=METALS[symbol], roughness=roughness, name=name)


def _clear(name: str, ior: float, **more: Any) -> Material:
    return Material(roughness=0.0, transmission=1.0, ior=ior, name=name, **more)


def _parting(name: str, glass: str) -> Material:
    """A clear body that parts light into wavelengths."""
    return Material(roughness=0.0, transmission=1.0, glass=glass_named(glass), name=name)


def _translucent(name: str, scattering: Colour, absorption: Colour, ior: float, roughness: float) -> Material:
    """A body from Jensen's σs′ and σa per millimetre."""
    extinction = np.add(scattering, absorption)
    return Material(
        roughness=roughness,
        transmission=1.0,
        ior=ior,
        name=name,
        scattering_distance=triple(1e-3 / extinction),
        scattering_albedo=triple(np.asarray(scattering) / extinction),
    )


_METALS = (
    _metal("aluminium", "Al", 0.2),
    _metal("brass", "CuZn", 0.2),
    _metal("chrome", "Cr", 0.0),
    _metal("copper", "Cu", 0.2),
    _metal("gold", "Au", 0.15),
    _metal("iron", "Fe", 0.4),
    _metal("platinum", "Pt", 0.15),
    _metal("silver", "Ag", 0.1),
    _metal("titanium", "Ti", 0.3),
    # A front-silvered mirror.
    Material((0.95, 0.95, 0.95), metallic=1.0, roughness=0.0, name="mirror"),
)
_BRUSHED = (
    # Ward's figures have no colour; brass's, of luminance 1.
    Ward((0.384, 0.330, 0.178), 0.05, 0.16, (0.116, 0.100, 0.054), "rolled_brass"),
    Ward((0.21, 0.21, 0.21), 0.04, 0.09, (0.10, 0.10, 0.10), "rolled_aluminium"),
    Ward((0.19, 0.19, 0.19), 0.088, 0.13, (0.15, 0.15, 0.15), "brushed_aluminium"),
    # Ward measured no steel: the slopes of his rolled brass under the reflectance of iron, without a diffuse part.
    Ward(_srgb(192, 189, 186), 0.05, 0.16, (0.0, 0.0, 0.0), "brushed_steel"),
    # The same brushed twice, the second time across.
    Ward(_srgb(192, 189, 186), 0.05, 0.16, (0.0, 0.0, 0.0), "cross_brushed_steel", crossed=0.5),
)
_CLEAR = (
    # Window glass, without dispersion, which costs noise and is not seen in what is not cut to show it.
    _clear("glass", 1.517),
    _clear("thin_glass", 1.517, thin=True),
    Material(roughness=0.4, transmission=1.0, ior=1.517, name="frosted_glass"),
    # Green as of a bottle, for bodies some centimetres thick: an artist's choice.
    _clear("bottle_glass", 1.517, attenuation_color=(0.25, 0.7, 0.2), attenuation_distance=0.05),
    _parting("diamond", "diamond"),
    _parting("crown_glass", "N-BK7"),
    _parting("flint_glass", "SF11"),
    _parting("sapphire", "sapphire"),
    _clear("ice", 1.31),
    # Pope and Fry 1997: 0.34, 0.06 and 0.006 per metre at 650, 550 and 450 nm.
    _clear("water", 1.333, attenuation_color=(0.712, 0.942, 0.994), attenuation_distance=1.0),
)
_TRANSLUCENT = (
    _translucent("cream", (7.38, 5.47, 3.15), (0.0002, 0.0028, 0.0163), 1.3, 0.2),
    _translucent("ketchup", (0.18, 0.07, 0.03), (0.061, 0.97, 1.45), 1.3, 0.2),
    _translucent("marble", (2.19, 2.62, 3.00), (0.0021, 0.0041, 0.0071), 1.5, 0.2),
    _translucent("milk", (2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014), 1.3, 0.0),
    _translucent("skim_milk", (0.70, 1.22, 1.90), (0.0014, 0.0025, 0.0142), 1.3, 0.0),
    _translucent("skin", (0.74, 0.88, 1.01), (0.032, 0.17, 0.48), 1.3, 0.5),
)
_OPAQUE = (
    Material(_srgb(148, 125, 117), roughness=0.9, name="brick"),
    # Coats of lacquer over red flakes: a rough half-metal under a smooth coat.
    Material(
        (0.45, 0.02, 0.02), metallic=0.5, roughness=0.45, clearcoat=1.0, clearcoat_roughness=0.03, name="car_paint"
    ),
    Material(_srgb(50, 50, 50), roughness=0.9, name="coal"),
    Material(_srgb(192, 191, 187), roughness=0.9, name="concrete"),
    Material((0.8, 0.8, 0.8), roughness=0.25, name="plastic"),
    Material((0.8, 0.8, 0.78), roughness=0.08, name="porcelain"),
    Material(_srgb(53, 53, 53), roughness=0.7, name="rubber"),
    Material((0.25, 0.01, 0.03), roughness=1.0, sheen_color=(0.6, 0.15, 0.2), sheen_roughness=0.35, name="velvet"),
    Material(_srgb(135, 92, 60), roughness=0.5, name="wood"),
)
PRESETS: Mapping[str, Material | Ward] = MappingProxyType(
    {each.name: each for each in (*_METALS, *_BRUSHED, *_CLEAR, *_TRANSLUCENT, *_OPAQUE)}
)
"""Every preset by its name, without the fits to measured surfaces of `MERL_FITS`."""
