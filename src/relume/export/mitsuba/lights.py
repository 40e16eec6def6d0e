"""A constellation as a Mitsuba 3 scene of emitters alone, to be included in another."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

from relume.export.lamps import Bulb, Lamp, LampFile, figure, figures


def text(file: LampFile) -> str:
    """The lights as directional emitters of our irradiance, the background as an envmap turned half round.

    A directional emitter has no apparent diameter, which a comment says. Placed lights are point emitters, or spheres
    that emit where they have a radius.

    An envmap's middle is +Z and ours −Z. Its first and last rows stand at the poles, where ours are half a pixel off:
    what Mitsuba shows is at most half a pixel of the file too near the horizon.
    """
    name, lamps = file.background_name, file.lamps
    parts = [
        '<?xml version="1.0" encoding="utf-8"?>\n',
        f"<!-- Parallel lights that stand for a light map; +Y is up. {file.meaning} -->\n",
        '<!-- To use it: <include filename="…"/> in a scene. -->\n',
        "<!-- The lights' apparent diameters are not in here: Mitsuba's directional emitters have none. -->\n"
        if any(lamp.angle > 0 for lamp in lamps)
        else "",
        '<scene version="3.0.0">\n',
        _envmap(name) if name is not None else "",
        *(_directional(lamp) for lamp in lamps),
        *(_placed(bulb) for bulb in file.bulbs),
        "</scene>\n",
    ]
    return "".join(parts)


def _envmap(name: str) -> str:
    return f"""    <emitter type="envmap" id="background">
        <string name="filename" value={quoteattr(name)}/>
        <transform name="to_world">
            <rotate y="1" angle="180"/>
        </transform>
    </emitter>
"""


def _directional(lamp: Lamp) -> str:
    x, y, z = lamp.direction
    # Mitsuba's direction is the light's way.
    return f"""    <emitter type="directional" id="{lamp.name}">
        <vector name="direction" value="{figures((-x, -y, -z), ", ")}"/>
        <rgb name="irradiance" value="{figures(lamp.irradiance, ", ")}"/>
    </emitter>
"""


def _placed(bulb: Bulb) -> str:
    if bulb.radius == 0:
        return f"""    <emitter type="point" id="{bulb.name}">
        <point name="position" value="{figures(bulb.position, ", ")}"/>
        <rgb name="intensity" value="{figures(bulb.intensity, ", ")}"/>
    </emitter>
"""
    return sphere(bulb.name, bulb.position, bulb.radius, bulb.radiance(bulb.radius))


def sphere(
    name: str,
    centre: tuple[float, ...],
    radius: float,
    radiance: tuple[float, ...],
    surface: str = "",
) -> str:
    """A sphere that shines; `surface` is the line of its BSDF."""
    return f"""    <shape type="sphere" id="{name}">
        <point name="center" value="{figures(centre, ", ")}"/>
        <float name="radius" value="{figure(radius)}"/>
{surface}        <emitter type="area">
            <rgb name="radiance" value="{figures(radiance, ", ")}"/>
        </emitter>
    </shape>
"""
