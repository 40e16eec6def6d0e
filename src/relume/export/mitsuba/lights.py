"""A constellation as a Mitsuba 3 scene of emitters alone, to be included in another."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np

from relume.export.lamps import Bulb, Lamp, beside, bulbs, figure, figures, lamps, meaning
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.placement import PlacedLights


def text(
    lights: Constellation,
    *,
    unit: str,
    background: str | None = None,
    angles: np.ndarray | None = None,
    points: PlacedLights | None = None,
) -> str:
    """The lights as directional emitters of our irradiance, the background as an envmap turned half round.

    unit : the map's, "relative" or "cd/m²"
    background : the lat-long file with the light that the lights do not carry, relative to the scene; None for none
    angles : (N,), apparent diameters in radians; a directional emitter has none, which a comment says
    points : lights that have a place, as point emitters, or as spheres that emit where they have a radius

    An envmap's middle is +Z and ours −Z. Its first and last rows stand at the poles, where ours are half a pixel off:
    what Mitsuba shows is at most half a pixel of the file too near the horizon.

    Raises ValueError for another unit, an absolute path or angles that do not fit.
    """
    name = beside(background)
    parts = [
        '<?xml version="1.0" encoding="utf-8"?>\n',
        f"<!-- Parallel lights that stand for a light map; +Y is up. {meaning(unit, points)} -->\n",
        '<!-- To use it: <include filename="…"/> in a scene. -->\n',
        "<!-- The lights' apparent diameters are not in here: Mitsuba's directional emitters have none. -->\n"
        if angles is not None and np.any(np.asarray(angles) > 0)
        else "",
        '<scene version="3.0.0">\n',
        _envmap(name) if name is not None else "",
        *(_directional(lamp) for lamp in lamps(lights, angles)),
        *(_placed(bulb) for bulb in bulbs(points)),
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
    return f"""    <shape type="sphere" id="{bulb.name}">
        <point name="center" value="{figures(bulb.position, ", ")}"/>
        <float name="radius" value="{figure(bulb.radius)}"/>
        <emitter type="area">
            <rgb name="radiance" value="{figures(bulb.radiance(bulb.radius), ", ")}"/>
        </emitter>
    </shape>
"""
