"""A constellation as a USD layer: a DistantLight each, SphereLights for placed lights, a DomeLight as background."""

from __future__ import annotations

import numpy as np

from relume.export.lamps import POINT_RADIUS, Bulb, Lamp, LampFile, figure, figures


def text(file: LampFile) -> str:
    """The lights as a `.usda` layer of upAxis Y.

    Lights are normalised, so that UsdLux's intensity × color is our irradiance whatever the angle (UsdLux, LightAPI,
    `inputs:normalize`: "the intensity becomes a measure of the illuminance, expressed in lux"), and a dome of
    intensity 1 shows its pixels' own numbers (there: in cd/m²). The dome is turned half round, since its middle
    is +Z and that of our maps −Z. A normalised sphere's radiance is its intensity over 4π r², and it shines as a disc
    of π r²: UsdLux's intensity × color is four times ours. One without a radius may be treated as a point.
    """
    name = file.background_name
    doc = f"Parallel lights that stand for a light map. {file.meaning} UsdLux takes them for lux and cd/m²."
    parts = [
        "#usda 1.0\n(\n",
        '    defaultPrim = "Light"\n',
        f'    doc = "{doc}"\n',
        '    metersPerUnit = 1\n    upAxis = "Y"\n)\n\n',
        'def Xform "Light"\n{\n',
        *([_dome(name)] if name is not None else []),
        *(_distant(lamp) for lamp in file.lamps),
        *(_sphere(bulb) for bulb in file.bulbs),
        "}\n",
    ]
    return "".join(parts)


def _dome(name: str) -> str:
    # A path that begins with a dot is looked for beside the layer and nowhere else; one with an @ stands between three.
    anchored = name if name.startswith(".") else f"./{name}"
    quoted = f"@@@{anchored}@@@" if "@" in anchored else f"@{anchored}@"
    return f"""    def DomeLight "background"
    {{
        float inputs:intensity = 1
        asset inputs:texture:file = {quoted}
        token inputs:texture:format = "latlong"
        float xformOp:rotateY = 180
        uniform token[] xformOpOrder = ["xformOp:rotateY"]
    }}
"""


def _distant(lamp: Lamp) -> str:
    x, y, z, w = lamp.quaternion
    return f"""    def DistantLight "{lamp.name}"
    {{
        float inputs:angle = {figure(float(np.degrees(lamp.angle)))}
        color3f inputs:color = ({figures(lamp.colour, ", ")})
        float inputs:intensity = {figure(lamp.intensity)}
        bool inputs:normalize = 1
        quatd xformOp:orient = ({figures((w, x, y, z), ", ")})
        uniform token[] xformOpOrder = ["xformOp:orient"]
    }}
"""


def _sphere(bulb: Bulb) -> str:
    return f"""    def SphereLight "{bulb.name}"
    {{
        color3f inputs:color = ({figures(bulb.colour, ", ")})
        float inputs:intensity = {figure(4 * bulb.strength)}
        bool inputs:normalize = 1
        float inputs:radius = {figure(bulb.radius or POINT_RADIUS)}
        bool treatAsPoint = {int(bulb.radius == 0)}
        double3 xformOp:translate = ({figures(bulb.position, ", ")})
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
"""
