"""What a renderer does not show: a warning or one line that refuses it and names a renderer that has it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.errors import UnsupportedScene, warn
from relume.scene.lights import AmbientLight, DistantLight, Light, PointLight, RectangleLight, SphereLight, SquareLaw
from relume.scene.materials.materials import Material
from relume.scene.materials.whitted import WhittedMaterial

_NAMES: dict[type, str] = {
    PointLight: "a point of light",
    DistantLight: "a distant light",
    SphereLight: "a sphere of light",
    RectangleLight: "a rectangle of light",
    AmbientLight: "ambient light",
}


def warn_of_unsupported(material: Material, whose: str) -> None:
    """Warn of what of a material is not shown where only its base, its gloss and its transmission are.

    whose : the renderer, to begin the sentence
    """
    if found := unsupported_features(material):
        warn(
            f"{whose} not show {', '.join(found)} of {material.name or 'a material'!r}; "
            "use rl.Mitsuba (--renderer mitsuba)"
        )


def renderer_of(material: object) -> str:
    """What to use for a material that a teaching renderer does not show, as the end of a line."""
    if isinstance(material, WhittedMaterial):
        return "use rl.Whitted (--renderer whitted)"
    return "use rl.Mitsuba (--renderer mitsuba)"


def extra_lobes(material: Material) -> dict[str, bool]:
    """Which lobes a material has beside its base, its plain gloss and its transmission."""
    tints = (material.specular, material.specular_color)
    return {
        "clearcoat": bool(np.any(np.asarray(material.clearcoat) > 0)),
        "sheen": bool(np.any(np.asarray(material.sheen_color) > 0)),
        "anisotropy": material.anisotropy > 0,
        "specular": any(bool(np.any(np.asarray(tint) != 1)) for tint in tints),
    }


def unsupported_features(material: Material) -> tuple[str, ...]:
    """The names of what is set of a material beyond base colour, metallic, roughness, transmission and ior."""
    clear = bool(np.any(material.through))
    there = {
        "its normal map": material.normal is not None,
        "emission": material.emits,
        "alpha": bool(np.any(np.asarray(material.alpha) < 1)),
        **extra_lobes(material),
        "thinness": material.thin and clear,
        "what fills the body": material.medium is not None,
        "dispersion": material.dispersion > 0 and clear,
    }
    return tuple(name for name, is_there in there.items() if is_there)


def light_name(light: Light) -> str:
    """What kind of light it is, in plain words."""
    by_law = not isinstance(light, PointLight) or isinstance(light.falloff, SquareLaw)
    return _NAMES[type(light)] + ("" if by_law else " that does not fall by the square law")


def is_whitteds(light: Light) -> bool:
    """Whether Whitted's method alone has such a light: one that nothing shadows, or without the square law."""
    return isinstance(light, AmbientLight) or (
        isinstance(light, PointLight) and not isinstance(light.falloff, SquareLaw)
    )


def renderer_for(lights: Sequence[Light]) -> str:
    """What to use for a scene with these lights, as the end of a line."""
    whitteds = [light for light in lights if is_whitteds(light)]
    if not whitteds:
        return "use rl.Mitsuba (--renderer mitsuba)"
    if any(isinstance(light, SphereLight | RectangleLight) for light in lights):
        return f"use rl.Mitsuba (--renderer mitsuba), and leave out {light_name(whitteds[0])}, which it does not have"
    return "use rl.Whitted (--renderer whitted)"


def refused_light(light: Light, lights: Sequence[Light], whose: str) -> UnsupportedScene:
    """The error for one of a scene's lights, ambient or without the square law, that `whose` renderer lacks."""
    ambient = isinstance(light, AmbientLight)
    instead = "an even light map, as light.colour makes it" if ambient else "the square law"
    return UnsupportedScene(f"{whose} has no place for {light_name(light)}; {renderer_for(lights)}, or {instead}")
