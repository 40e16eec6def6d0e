"""Placed lights in the files of other programs: what is written, read back, and what Mitsuba makes of it."""

import ast
import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from other_programs import mitsuba_reading
from relume.export.lamps import LampFile
from relume.export.light_files import FORMATS
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.placement import PlacedLights

EACH = pytest.mark.parametrize("name", FORMATS)
SUN = Constellation(np.array([[0.6, 0.8, 0.0]]), np.array([[4.0, 2.0, 1.0]]))
NONE = Constellation(np.zeros((0, 3)), np.zeros((0, 3)))
POINTS = PlacedLights(
    np.array([[1.0, 2.0, -3.0], [-2.0, 1.5, 0.5], [0.0, 3.0, 1.0]]),
    np.array([[8.0, 6.0, 4.0], [0.5, 1.0, 0.0], [0.0, 0.0, 0.0]]),
    np.array([0.0, 0.25, 0.0]),
)
RADII = {"json": [0, 0.25, 0], "gltf": [0, 0.25, 0], "blender": [0, 0.25, 0], "mitsuba": [0, 0.25, 0]}
"""Where a program knows no point it is a sphere of a centimetre."""


def written(name, points: PlacedLights | None = POINTS, lights=SUN, unit="relative"):
    return FORMATS[name].text(LampFile(lights, unit, points=points))


# Read back: positions, intensity and radii from the text alone


def read_json(text):
    return [(each["position"], each["intensity"], each["radius"]) for each in json.loads(text)["points"]]


def read_gltf(text):
    report, extension = json.loads(text), "KHR_lights_punctual"
    bulbs = report["extensions"][extension]["lights"]
    found = []
    for index in report["scenes"][report["scene"]]["nodes"]:
        node = report["nodes"][index]
        bulb = bulbs[node["extensions"][extension]["light"]]
        if bulb["type"] == "point":
            radius = bulb.get("extras", {}).get("radius_metres", 0)
            found.append((node["translation"], np.multiply(bulb["color"], bulb["intensity"]), radius))
    return found


def read_usd(text):
    found = []
    for light in re.findall(r"def SphereLight.*?\n    }", text, re.DOTALL):
        value = dict(re.findall(r"(\S+) = \(?([^)\n]*)", light))
        assert value["inputs:normalize"] == "1"
        assert value["treatAsPoint"] == str(int(value["inputs:radius"] == "0.01"))
        radius, strength = float(value["inputs:radius"]), float(value["inputs:intensity"])
        colour, place = (np.array(value[key].split(","), float) for key in ("inputs:color", "xformOp:translate"))
        # Radiance over the area 4π r², seen as a disc of π r².
        found.append((place, strength * colour / (4 * np.pi * radius**2) * np.pi * radius**2, radius))
    return found


def read_blender(text):
    (points,) = (
        ast.literal_eval(node.value)
        for node in ast.parse(text).body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == "POINTS"
    )
    return [(place, np.multiply(colour, watts / (4 * np.pi)), radius) for _name, place, colour, watts, radius in points]


def read_radiance(text):
    shown = re.findall(r"^void (?:light|illum) point_\d+_emission\n(?:0|1 void)\n0\n3 (.*)$", text, re.MULTILINE)
    spheres = re.findall(r"^point_\d+_emission sphere point_\d+\n0\n0\n4 (.*)$", text, re.MULTILINE)
    found = []
    for radiance, sphere in zip(shown, spheres, strict=True):
        x, y, z, radius = (float(word) for word in sphere.split())
        found.append(((x, z, -y), np.pi * radius**2 * np.array(radiance.split(), float), radius))
    return found


def read_mitsuba(text):
    def values(element, kind):
        part = element.find(f".//{kind}")
        assert part is not None
        return np.array(part.get("value", "").split(","), float)

    found = []
    for element in ET.fromstring(text):
        if element.get("type") == "point":
            found.append((values(element, "point"), values(element, "rgb"), 0))
        if element.get("type") == "sphere":
            (radius,) = values(element, "float")
            found.append((values(element, "point"), np.pi * radius**2 * values(element, "rgb"), radius))
    return found


READERS = {
    "json": read_json,
    "usd": read_usd,
    "gltf": read_gltf,
    "blender": read_blender,
    "radiance": read_radiance,
    "mitsuba": read_mitsuba,
}


@EACH
def test_every_placed_light_is_read_back_where_it_is_and_as_strong(name):
    positions, intensity, radii = zip(*READERS[name](written(name)), strict=True)
    np.testing.assert_allclose(positions, POINTS.positions, atol=1e-8)
    np.testing.assert_allclose(intensity, POINTS.intensity, rtol=1e-8)
    assert list(radii) == RADII.get(name, [0.01, 0.25, 0.01])


@EACH
def test_without_placed_lights_nothing_speaks_of_them(name):
    alone = written(name, None)
    assert alone == FORMATS[name].text(LampFile(SUN, "relative"))
    words = ("point_0", "POINTS", '"points"', "Points have", "SphereLight", "candela", 'emitter type="point')
    assert not any(word in alone for word in words)
    # The distant lights are the same beside them.
    beside, both = alone.splitlines(), written(name).splitlines()
    assert sum(line not in both for line in beside) <= 6


@EACH
@pytest.mark.parametrize(("unit", "report"), [("cd/m²", "intensity in cd:"), ("relative", "in that unit × m²:")])
def test_the_text_says_what_intensity_is(name, unit, report):
    assert report in written(name, unit=unit)


@EACH
def test_no_distant_lights_beside_placed_ones(name):
    text = written(name, lights=NONE)
    assert "light_0" not in text and len(READERS[name](text)) == 3


@EACH
def test_no_placed_lights_are_none(name):
    text = written(name, PlacedLights(np.zeros((0, 3)), np.zeros((0, 3))), lights=NONE)
    assert "point_0" not in text and text.endswith("\n")


def test_the_texts_have_the_numbers_their_programs_want():
    assert json.loads(written("json"))["points"][0] == {"position": [1, 2, -3], "intensity": [8, 6, 4], "radius": 0}
    assert "radius" not in json.loads(written("json", PlacedLights(np.ones((1, 3)), np.ones((1, 3)))))["points"][0]
    # A Point light of P watts has the intensity P / 4π: 8 × 4π.
    assert "('point_000', (1, 2, -3), (1, 0.75, 0.5), 100.530965, 0)," in written("blender")
    compile(written("blender"), "lights.py", "exec")
    # +Y is Radiance's +Z; 8 over π 0.01², and over 179 lm/W where it is candela.
    radiance = written("radiance")
    assert "void illum point_000_emission\n1 void\n0\n3 25464.7909 19098.5932 12732.3954\n" in radiance
    assert "point_000_emission sphere point_000\n0\n0\n4 1 3 2 0.01\n" in radiance
    assert "void light point_001_emission\n0\n0\n3 2.54647909 5.09295818 0\n" in radiance
    assert "3 142.261402 106.696051 71.1307008\n" in written("radiance", unit="cd/m²")
    assert "float inputs:intensity = 32\n" in written("usd")


def test_the_gltf_text_keeps_to_the_schema():
    report = json.loads(written("gltf"))
    bulbs = report["extensions"]["KHR_lights_punctual"]["lights"]
    assert [bulb["type"] for bulb in bulbs] == ["directional", "point", "point", "point"]
    assert [node["extensions"]["KHR_lights_punctual"]["light"] for node in report["nodes"]] == [0, 1, 2, 3]
    assert bulbs[2] == {
        "name": "point_001",
        "type": "point",
        "color": [0.5, 1.0, 0.0],
        "intensity": 1.0,
        "extras": {"radius_metres": 0.25},
    }
    assert bulbs[3]["color"] == [1.0, 1.0, 1.0] and bulbs[3]["intensity"] == 0


# Mitsuba renders what it is given

PATCH = """<scene version="3.0.0">
    <include filename="lights.xml"/>
    <integrator type="direct"><integer name="emitter_samples" value="1"/><integer name="bsdf_samples" value="0"/>
    </integrator>
    <shape type="rectangle">
        <transform name="to_world"><scale value="0.01"/><lookat origin="{x},{y},{z}" target="{x}, 9, {z}" up="0, 0, 1"/>
        </transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="1, 1, 1"/></bsdf>
    </shape>
    <sensor type="perspective"><float name="fov" value="0.1"/><transform name="to_world">
        <lookat origin="{x},{high},{z}" target="{x},{y},{z}" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/>
            <rfilter type="box"/><string name="pixel_format" value="rgb"/></film>
        <sampler type="independent"/>
    </sensor></scene>"""


@pytest.mark.parametrize("index", [0, 1])
def test_mitsubas_irradiance_of_a_lone_placed_light_is_ours(index, tmp_path):
    radii = POINTS.radii
    assert radii is not None
    one = slice(index, index + 1)
    lone = PlacedLights(POINTS.positions[one], POINTS.intensity[one], radii[one])
    (tmp_path / "lights.xml").write_text(written("mitsuba", lone, lights=NONE), encoding="utf-8")
    with mitsuba_reading("scalar_rgb") as mi:
        for x, y, z in ((0.0, 0.0, 0.0), (-1.0, 0.5, -0.5)):
            (tmp_path / "patch.xml").write_text(PATCH.format(x=x, y=y, z=z, high=y + 1))
            scene = mi.load_file(str(tmp_path / "patch.xml"))
            found = np.array(mi.render(scene, spp=1024, seed=1)).mean((0, 1)) * np.pi
            wanted = lone.seen_from((x, y, z)).irradiance_on(np.array([0.0, 1, 0]))
            np.testing.assert_allclose(found, wanted, rtol=0.005, atol=1e-7)
