"""A constellation as a Radiance scene: a distant `source` each, spheres for placed lights, the background as a glow.

Radiance is used with +Z up: our (x, y, z) is (x, −z, y) there. Its picture coordinates count from the lower left corner
with the shorter side as 1, so our lat-long map is u = 1 + longitude/π, v = 1 − polar angle/π.
"""

from __future__ import annotations

import numpy as np

from relume.export.lamps import POINT_RADIUS, Bulb, Lamp, LampFile, figure, figures

EFFICACY = 179.0
"""Lumens a watt, by which Radiance turns its RGB into photometric units (Ward 1994, §4; WHTEFFICACY in color.h)."""
NARROWEST = np.radians(0.1)
"""Apparent diameter of a light that has none: a Radiance source must have some, and 0.1° blurs no shadow visibly."""
_NARROWED = "# All lights are 0.1 degrees wide, whatever they stand for: a source hides what glows behind it.\n"
_WIDE = "# Wide lights want jittered rays: trace with -dj 0.9 or so.\n"
LONGITUDE, POLAR = "1+atan2(Dx,Dy)/PI", "1-Acos(Dz)/PI"


def text(file: LampFile) -> str:
    """The lights as a `.rad` scene for oconv.

    Lux and cd/m² are divided by 179 lm/W, by which Radiance multiplies. The background's path is relative to where
    Radiance runs; raises ValueError for one that is no Radiance picture (.hdr or .pic).
    Apparent diameters below 0.1°, and all where there are none, become 0.1°. So do all beside a background, for a
    source hides what glows behind it (30 lights of 15° took 4 % from it). A source's radiance is E / (π sin²(angle/2)),
    so that its irradiance is ours whatever its angle. Placed lights are spheres of `light` where they have a radius,
    else of unseen `illum`.
    """
    name, lamps = file.background_name, file.lamps
    if name is not None and not name.lower().endswith((".hdr", ".pic")):
        raise ValueError(f"background is {name!r}, which Radiance cannot read; write it as a .hdr file")
    scale, watts = 1.0, "Radiance takes them for W/m² and W/(sr·m²); its 179 lm/W make no lux of them"
    if file.unit == "cd/m²":
        scale = 1 / EFFICACY
        watts = "Here they are divided by Radiance's 179 lm/W: multiply what it computes by 179 for lux and cd/m²"
    narrow, wide = name is not None, any(lamp.angle > NARROWEST for lamp in lamps)
    parts = [
        f"# Parallel lights that stand for a light map, for Radiance's +Z up.\n# {file.meaning}\n",
        f"# {watts}.\n",
        "# Red, green and blue are of Rec. 709 and are handed over as they are.\n",
        "# To keep a light out of sight and of mirrors, as when the background shows it already, write `illum` for\n"
        "# `light`: illum sources light surfaces and are not seen (as the placed lights of Fiat Lux, 1999).\n",
        "# Trace many lights with -dt 0, or the faint ones are guessed.\n",
        (_NARROWED if narrow else _WIDE) if wide else "",
        _glow(name, scale) if name is not None else "",
        *(_source(lamp, 0.0 if narrow else lamp.angle, scale) for lamp in lamps),
        *(_sphere(bulb, scale) for bulb in file.bulbs),
    ]
    return "".join(parts)


def _glow(name: str, scale: float) -> str:
    quoted = f'"{name}"' if " " in name else name
    level = figures((scale, scale, scale))
    return f"""
# The background gives light to indirect calculation alone: trace with -ab 1 or more.
void colorpict background_map
7 red green blue {quoted} . {LONGITUDE} {POLAR}
0
0

background_map glow background_glow
0
0
4 {level} 0

background_glow source background
0
0
4 0 0 1 360
"""


def _source(lamp: Lamp, diameter: float, scale: float) -> str:
    x, y, z = lamp.direction
    angle = max(diameter, float(NARROWEST))
    per_irradiance = scale / (np.pi * np.sin(angle / 2) ** 2)
    red, green, blue = (float(channel * per_irradiance) for channel in lamp.irradiance)
    return f"""
void light {lamp.name}_emission
0
0
3 {figures((red, green, blue))}

{lamp.name}_emission source {lamp.name}
0
0
4 {figures((x, -z, y))} {figure(float(np.degrees(angle)))}
"""


def _sphere(bulb: Bulb, scale: float) -> str:
    """A lamp that is seen, or for a point one that lights and is not seen: an `illum` of no other material."""
    x, y, z = bulb.position
    material = "light {0}_emission\n0" if bulb.radius else "illum {0}_emission\n1 void"
    radius = bulb.radius or POINT_RADIUS
    red, green, blue = bulb.radiance(radius)
    return f"""
void {material.format(bulb.name)}
0
3 {figures((scale * red, scale * green, scale * blue))}

{bulb.name}_emission sphere {bulb.name}
0
0
4 {figures((x, -z, y))} {figure(radius)}
"""
