"""Constellations in the files of other programs: what is written, read back, and what Mitsuba makes of it."""

import ast
import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from other_programs import mitsuba_reading
from relume.export.lamps import Lamp, LampFile, figure
from relume.export.light_files import FORMATS
from relume.image import files
from relume.light.constellations.constellation import Constellation
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.sphere.mappings.orientation_chart import LABELS, orientation_chart

EACH = pytest.mark.parametrize("name", FORMATS)
LIGHTS = Constellation(
    normalised([[1.0, 2.0, 0.5], [-2.0, 1.0, -1.0], [0.3, -1.0, 2.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]),
    np.array([[3.0, 2.5, 1.0], [0.2, 0.5, 2.0], [5e4, 4e4, 1 / 3], [0.0, 0.7, 0.1], [0.0, 0.0, 0.0]]),
)
NONE = Constellation(np.zeros((0, 3)), np.zeros((0, 3)))
ONE = Constellation(np.array([[0.6, 0.8, 0.0]]), np.array([[4.0, 2.0, 1.0]]))
NORMALS = np.array([label.towards for label in LABELS.values()])
Z = np.array([0.0, 0.0, 1.0])


def written(name, lights=LIGHTS, unit="relative", background=None, angles=None):
    return FORMATS[name].text(LampFile(lights, unit, background, angles))


def background_of(name):
    return "maps/residual" + FORMATS[name].background_suffix


def turned_by(quaternion, vector):
    """A vector turned by a unit quaternion (x, y, z, w)."""
    axis, w = np.array(quaternion[:3]), quaternion[3]
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + w * vector)


# Read back: directions and irradiance of every format, from its text alone


def read_json(text):
    report = json.loads(text)["lights"]
    return [light["direction"] for light in report], [light["irradiance"] for light in report]


def read_gltf(text):
    report = json.loads(text)
    bulbs = report["extensions"]["KHR_lights_punctual"]["lights"]
    nodes = [report["nodes"][index] for index in report["scenes"][report["scene"]]["nodes"]]
    ways = [turned_by(node["rotation"], -Z) for node in nodes]
    shining = [bulbs[node["extensions"]["KHR_lights_punctual"]["light"]] for node in nodes]
    return [-way for way in ways], [np.multiply(bulb["color"], bulb["intensity"]) for bulb in shining]


def read_usd(text):
    lights = re.findall(r"def DistantLight.*?\n    }", text, re.DOTALL)

    def numbers(light, attribute):
        values = re.search(rf"{re.escape(attribute)} = \(?([^)\n]*)", light)
        assert values is not None
        return [float(value) for value in values[1].split(",")]

    turns = [numbers(light, "xformOp:orient") for light in lights]
    irradiance = [np.multiply(numbers(one, "inputs:color"), numbers(one, "inputs:intensity")[0]) for one in lights]
    assert all("bool inputs:normalize = 1" in light for light in lights)
    return [turned_by((x, y, z, w), Z) for w, x, y, z in turns], irradiance


def read_blender(text):
    tree = ast.parse(text)
    values = {
        target.id: ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(target := node.targets[0], ast.Name)
        if target.id in ("LIGHTS", "BACKGROUND")
    }
    lights = values["LIGHTS"]
    return [light[1] for light in lights], [np.multiply(light[2], light[3]) for light in lights]


def read_radiance(text):
    shown = re.findall(r"^3 (\S+) (\S+) (\S+)$", text, re.MULTILINE)
    sources = re.findall(r"light_\d+_emission source light_\d+\n0\n0\n4 (\S+) (\S+) (\S+) (\S+)$", text, re.MULTILINE)
    spots = np.array(sources, float).reshape(-1, 4)
    x, y, z, angle = spots.T
    projected = np.pi * np.sin(np.radians(angle) / 2) ** 2
    return np.stack([x, z, -y], axis=-1), np.array(shown, float).reshape(-1, 3) * projected[:, None]


def read_mitsuba(text):
    emitters = [emitter for emitter in ET.fromstring(text) if emitter.get("type") == "directional"]

    def numbers(emitter, kind):
        found = emitter.find(kind)
        assert found is not None
        return [float(value) for value in found.get("value", "").split(",")]

    ways = np.array([numbers(emitter, "vector") for emitter in emitters])
    return -ways, [numbers(emitter, "rgb") for emitter in emitters]


READERS = {
    "json": read_json,
    "usd": read_usd,
    "gltf": read_gltf,
    "blender": read_blender,
    "radiance": read_radiance,
    "mitsuba": read_mitsuba,
}


@EACH
def test_every_light_is_read_back_where_it_is_and_as_strong(name):
    directions, irradiance = READERS[name](written(name, background=background_of(name)))
    np.testing.assert_allclose(directions, LIGHTS.directions, atol=2e-9)
    np.testing.assert_allclose(irradiance, LIGHTS.irradiance, rtol=1e-8, atol=1e-12)


@EACH
def test_apparent_diameters_leave_irradiance_alone(name):
    angles = np.radians([0.0, 0.5, 10.0, 90.0, 180.0])
    directions, irradiance = READERS[name](written(name, angles=angles))
    np.testing.assert_allclose(directions, LIGHTS.directions, atol=2e-9)
    np.testing.assert_allclose(irradiance, LIGHTS.irradiance, rtol=1e-7, atol=1e-12)


@EACH
def test_no_lights_are_no_lights(name):
    text = written(name, NONE, background=background_of(name))
    assert "light_0" not in text
    assert background_of(name) in text


@EACH
def test_a_text_is_the_same_every_time_and_says_what_its_numbers_mean(name):
    text = written(name, background=background_of(name))
    assert text == written(name, background=background_of(name))
    assert text.endswith("\n") and "\r" not in text
    assert "relative unit × steradian" in text
    assert "lux" in written(name, unit="cd/m²") and "cd/m²" in written(name, unit="cd/m²")


@EACH
@pytest.mark.parametrize("path", ["/home/me/map.hdr", "C:\\maps\\map.hdr", "two\nlines.hdr"])
def test_a_background_that_is_right_on_one_machine_only_is_refused(name, path):
    with pytest.raises(ValueError, match="relative to the file that will name it"):
        written(name, background=path)


@EACH
def test_a_unit_that_there_is_not_is_refused(name):
    with pytest.raises(ValueError, match='unit is "lux"; expected "relative" or "cd/m²"'):
        written(name, unit="lux")


@EACH
@pytest.mark.parametrize("angles", [[0.1], [0, 0, 0, 0, -0.1], [0, 0, 0, 0, 4.0], [0, 0, 0, 0, np.nan]])
def test_angles_that_do_not_fit_are_refused(name, angles):
    with pytest.raises(ValueError, match="one a light, each from 0 to π"):
        written(name, angles=np.array(angles))


@EACH
@pytest.mark.parametrize("broken", [-1.0, np.inf, np.nan])
def test_light_that_is_none_is_refused(name, broken):
    with pytest.raises(ValueError, match="negative or non-finite"):
        written(name, Constellation(ONE.directions, np.array([[1.0, broken, 1.0]])))


def test_every_format_has_a_suffix_of_its_own():
    assert {form.name: form.suffix for form in FORMATS.values()} == {
        "json": ".json",
        "usd": ".usda",
        "gltf": ".gltf",
        "blender": ".py",
        "radiance": ".rad",
        "mitsuba": ".xml",
    }


# The texts themselves


def test_the_json_text():
    report = json.loads(written("json", ONE, unit="cd/m²", background="rest.exr", angles=np.array([0.01])))
    assert report["format"] == "relume constellation 1"
    assert report["unit"] == "cd/m²" and report["background"] == "rest.exr"
    assert report["lights"] == [{"direction": [0.6, 0.8, 0.0], "irradiance": [4.0, 2.0, 1.0], "angle": 0.01}]
    assert "angle" not in json.loads(written("json", ONE))["lights"][0]


def test_the_gltf_text_keeps_to_the_schema():
    text = written("gltf", background="rest.exr", angles=np.full(5, 0.01))
    report = json.loads(text)
    assert report["asset"]["version"] == "2.0" and report["extensionsUsed"] == ["KHR_lights_punctual"]
    assert report["asset"]["extras"]["background"] == "rest.exr"
    assert len(report["nodes"]) == 5 and report["scenes"][0]["nodes"] == [0, 1, 2, 3, 4]
    for bulb in report["extensions"]["KHR_lights_punctual"]["lights"]:
        # KHR_lights_punctual: "range" is undefined for directional lights, colours are in 0…1, intensity in lux.
        assert set(bulb) == {"name", "type", "color", "intensity", "extras"} and bulb["type"] == "directional"
        assert bulb["intensity"] >= 0 and max(bulb["color"]) == 1 and min(bulb["color"]) >= 0
    for node in report["nodes"]:
        assert np.linalg.norm(node["rotation"]) == pytest.approx(1, abs=1e-8)
    dark = json.loads(written("gltf", NONE))
    # The schema wants at least one element in every list there is.
    assert set(dark) == {"asset"}


def test_the_radiance_text():
    text = written("radiance", ONE, unit="cd/m²", background="my maps/rest.hdr")
    # 4 / 179 lux over π sin² 0.05°, and +Y is Radiance's +Z.
    assert "3 9340.33502 4670.16751 2335.08376" in text and "4 0.6 0 0.8 0.1\n" in text
    assert '7 red green blue "my maps/rest.hdr" . 1+atan2(Dx,Dy)/PI 1-Acos(Dz)/PI' in text
    assert "4 0.00558659218 0.00558659218 0.00558659218 0" in text
    assert "179 lm/W" in text and "illum" in text
    assert all(line.isascii() for line in text.splitlines() if not line.startswith("#"))


def test_wide_lights_of_radiance_would_hide_the_background():
    wide = np.radians([60.0])
    alone = written("radiance", ONE, angles=wide)
    # 4 over π sin² 30°.
    assert "3 5.09295818 2.54647909 1.27323954" in alone and "4 0.6 0 0.8 60\n" in alone and "-dj" in alone
    beside_a_map = written("radiance", ONE, background="rest.hdr", angles=wide)
    assert "4 0.6 0 0.8 0.1\n" in beside_a_map and "hides what glows behind it" in beside_a_map
    assert "hides" not in written("radiance", ONE, background="rest.hdr")


def test_radiance_reads_no_exr():
    with pytest.raises(ValueError, match=r"'rest.exr', which Radiance cannot read; write it as a .hdr file"):
        written("radiance", background="rest.exr")


def test_the_usd_text():
    text = written("usd", ONE, background="rest@home.exr", angles=np.radians([2.0]))
    assert text.startswith("#usda 1.0\n") and 'upAxis = "Y"' in text and "metersPerUnit = 1" in text
    assert "asset inputs:texture:file = @@@./rest@home.exr@@@" in text and "float xformOp:rotateY = 180" in text
    assert "float inputs:angle = 2\n" in text and "color3f inputs:color = (1, 0.5, 0.25)" in text
    assert "float inputs:intensity = 4\n" in text
    assert "@./rest.exr@" in written("usd", ONE, background="rest.exr")
    assert "@../rest.exr@" in written("usd", ONE, background="../rest.exr")
    assert "DomeLight" not in written("usd", ONE)


def test_the_blender_text_is_a_script_that_names_its_background_safely():
    text = written("blender", ONE, background="it's {mine}.exr")
    assert 'BACKGROUND = "it\'s {mine}.exr"' in text
    assert "('light_000', (0.6, 0.8, 0), (1, 0.5, 0.25), 4, 0)," in text
    assert "-math.pi / 2" in text
    compile(text, "lights.py", "exec")
    assert "BACKGROUND = None" in written("blender", ONE)


def test_the_mitsuba_text():
    text = written("mitsuba", ONE, background='"a" & b.exr', angles=np.array([0.1]))
    assert '<vector name="direction" value="-0.6, -0.8, 0"/>' in text
    assert '<rgb name="irradiance" value="4, 2, 1"/>' in text
    found = ET.fromstring(text).find("emitter[@type='envmap']/string")
    assert found is not None and found.get("value") == '"a" & b.exr'
    assert "apparent diameters are not in here" in text
    assert "apparent diameters" not in written("mitsuba", ONE)


# What they stand on


def test_a_lamp_is_an_intensity_times_a_colour_whose_strongest_channel_is_one():
    lamp = LampFile(ONE, "relative").lamps[0]
    assert lamp == Lamp("light_000", (0.6, 0.8, 0.0), (4.0, 2.0, 1.0), 0.0)
    assert lamp.intensity == 4 and lamp.colour == (1.0, 0.5, 0.25)
    dark = LampFile(LIGHTS, "relative").lamps[4]
    assert dark.intensity == 0 and dark.colour == (1.0, 1.0, 1.0)


def test_a_lamps_turn_takes_plus_z_towards_the_light():
    directions = np.concatenate([normalised(np.random.default_rng(2).normal(size=(50, 3))), NORMALS])
    for lamp in LampFile(Constellation(directions, np.ones_like(directions)), "relative").lamps:
        assert np.linalg.norm(lamp.quaternion) == pytest.approx(1)
        np.testing.assert_allclose(turned_by(lamp.quaternion, Z), lamp.direction, atol=1e-12)


def test_names_sort_as_the_lights_do():
    many = Constellation(np.tile(Z, (1200, 1)), np.ones((1200, 3)))
    names = [lamp.name for lamp in LampFile(many, "relative").lamps]
    assert names[0] == "light_0000" and names[-1] == "light_1199" and names == sorted(names)


@pytest.mark.parametrize(
    ("number", "text"), [(-0.0, "0"), (1 / 3, "0.333333333"), (2.2e5, "220000"), (1e-12, "1e-12"), (65504.0, "65504")]
)
def test_figures_have_nine_digits(number, text):
    assert figure(number) == text


@pytest.mark.parametrize(
    ("path", "name"), [("maps\\sky.exr", "maps/sky.exr"), ("../sky.exr", "../sky.exr"), (None, None)]
)
def test_a_background_is_named_with_forward_slashes(path, name):
    assert LampFile(ONE, "relative", path).background_name == name


# Mitsuba renders what it is given


def patch(normal, up):
    """A white matte square that faces along a normal, and a camera that sees it from there."""
    x, y, z = normal
    a, b, c = up
    where = f'<lookat origin="{5 * x}, {5 * y}, {5 * z}" target="0, 0, 0" up="{a}, {b}, {c}"/>'
    return f"""<scene version="3.0.0">
        <include filename="lights.xml"/>
        <integrator type="direct"><integer name="emitter_samples" value="1"/><integer name="bsdf_samples" value="0"/>
        </integrator>
        <shape type="rectangle">
            <transform name="to_world"><lookat origin="0, 0, 0" target="{x}, {y}, {z}" up="{a}, {b}, {c}"/></transform>
            <bsdf type="diffuse"><rgb name="reflectance" value="1, 1, 1"/></bsdf>
        </shape>
        <sensor type="perspective"><float name="fov" value="5"/><transform name="to_world">{where}</transform>
            <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/>
                <rfilter type="box"/><string name="pixel_format" value="rgb"/></film>
            <sampler type="independent"/>
        </sensor></scene>"""


def rendered(folder, samples):
    """Irradiance on the six squares, (6, 3)."""
    found = []
    with mitsuba_reading("scalar_rgb") as mi:
        for label in LABELS.values():
            (folder / "patch.xml").write_text(patch(label.towards, label.up))
            picture = mi.render(mi.load_file(str(folder / "patch.xml")), spp=samples, seed=1)
            found.append(np.array(picture).mean((0, 1)) * np.pi)
    return np.array(found)


def test_mitsubas_irradiance_under_the_lights_is_ours(tmp_path):
    lights = Constellation(LIGHTS.directions, np.minimum(LIGHTS.irradiance, 5))
    (tmp_path / "lights.xml").write_text(written("mitsuba", lights), encoding="utf-8")
    # One of the lights is chosen for every ray.
    wanted = np.maximum(NORMALS @ lights.directions.T, 0) @ lights.irradiance
    np.testing.assert_allclose(rendered(tmp_path, 256), wanted, atol=0.03 * wanted.max())


def test_mitsubas_irradiance_under_a_lone_light_is_ours_to_rounding(tmp_path):
    for index in range(4):
        lone = Constellation(LIGHTS.directions[index : index + 1], LIGHTS.irradiance[index : index + 1])
        (tmp_path / "lights.xml").write_text(written("mitsuba", lone), encoding="utf-8")
        wanted = np.maximum(NORMALS @ lone.directions.T, 0) @ lone.irradiance
        np.testing.assert_allclose(rendered(tmp_path, 4), wanted, rtol=1e-5, atol=1e-6)


def test_mitsubas_irradiance_under_the_background_is_ours(tmp_path):
    directions = pixel_directions(LatLong(), 32)
    slopes = np.array([[0.8, 0.3, 0.1], [-0.2, 0.7, 0.4], [0.1, -0.5, -0.7]])
    light = EnvironmentMap((0.5 * (1.05 + directions @ slopes.T)).astype(np.float32))
    files.write(tmp_path / "rest.exr", as_radiance_map(light))
    (tmp_path / "lights.xml").write_text(written("mitsuba", NONE, background="rest.exr"), encoding="utf-8")
    np.testing.assert_allclose(rendered(tmp_path, 1024), light.irradiance(NORMALS), rtol=0.02)


def test_mitsuba_shows_the_background_where_it_is(tmp_path):
    files.write(tmp_path / "probe.exr", as_radiance_map(orientation_chart(64)))
    (tmp_path / "lights.xml").write_text(written("mitsuba", NONE, background="probe.exr"), encoding="utf-8")
    with mitsuba_reading("scalar_rgb") as mi:
        emitter = mi.load_file(str(tmp_path / "lights.xml")).environment()
        for label in LABELS.values():
            interaction = mi.SurfaceInteraction3f()
            interaction.wi = -mi.Vector3f(*label.towards)
            np.testing.assert_allclose(np.array(emitter.eval(interaction)), label.colour, atol=0.01)
