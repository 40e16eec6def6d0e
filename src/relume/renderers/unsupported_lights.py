"""One line that refuses a light which a renderer does not have, and names one that has it."""

from __future__ import annotations

from collections.abc import Sequence

from relume.errors import UnsupportedScene
from relume.scene.lights import AmbientLight, DistantLight, Light, PointLight, RectangleLight, SphereLight, SquareLaw

_NAMES: dict[type, str] = {
    PointLight: "a point of light",
    DistantLight: "a distant light",
    SphereLight: "a sphere of light",
    RectangleLight: "a rectangle of light",
    AmbientLight: "ambient light",
}


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
