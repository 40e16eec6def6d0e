"""Shots in the files of other programs: what is written, read back, and what Mitsuba makes of it."""

import ast
import re
import warnings
import xml.etree.ElementTree as ET
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from other_programs import mitsuba_reading
from relume.errors import Doubt, OutputNotWritten, UnsupportedScene, doubt_of
from relume.export.shot_files import SHOT_FORMATS, export_shot
from relume.export.shot_lamps import light_of, undistorted
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.residual import KeyLights
from relume.project.insertion.insert import prepare_shot
from relume.project.insertion.prepared import PreparedShot
from relume.renderers.mitsuba.scene import scene_dictionary
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.lights import AmbientLight, DistantLight, PointLight, SphereLight
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.scene import Box, Scene
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh, Plane, Sphere
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

EACH = pytest.mark.parametrize("name", SHOT_FORMATS)
BOX = Box((-2.0, -0.5, -1.5), (2.0, 2.5, 1.5))
GREY = Material((0.2, 0.4, 0.6), roughness=0.3, name="grey")
SQUARE = Mesh(
    np.array([[-0.2, 0.1, 0.3], [0.3, 0.1, 0.3], [0.3, 0.6, 0.3], [-0.2, 0.6, 0.3]], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    GREY,
    None,
    np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
    "a square!",
)


def light(size=16):
    directions = pixel_directions(LatLong(), size)
    slopes = np.array([[0.8, 0.3, 0.1], [-0.2, 0.7, 0.4], [0.1, -0.5, -0.7]])
    return EnvironmentMap((1.05 + directions @ slopes.T).astype(np.float32))


def shot(**changes):
    scene = Scene(light(), (Plane(Diffuse((0.5, 0.4, 0.3)), (1.0, 0.8)),), (SQUARE,))
    camera = Camera.looking_at(
        np.array([0.3, 0.8, 1.2]), np.array([0.0, 0.1, 0.0]), width=24, height=16, focal_length=30.0
    )
    plate = RadianceMap(np.full((16, 24, 3), 0.5, np.float32))
    fields = {"camera": camera, "plate": plate} | {k: v for k, v in changes.items() if k in ("camera", "plate", "keys")}
    return PreparedShot(
        replace(scene, **{k: v for k, v in changes.items() if k not in fields and k != "keys"}), **fields
    )


def found(pattern, text):
    match = re.search(pattern, text, re.DOTALL)
    assert match is not None
    return ast.literal_eval(match.group(1))


def under(root, path):
    element = root.find(path)
    assert element is not None
    return element


def value_of(element):
    said = element.get("value")
    assert said is not None
    return said


def quietly(value, folder, name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return export_shot(value, folder, name).not_held


@EACH
def test_every_file_that_is_named_is_there(name, tmp_path):
    image = np.linspace(0.1, 0.9, 4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)
    textured = replace(SQUARE, material=replace(GREY, base_color=image), name="real")
    quietly(shot(local=(textured,), distant=BOX, probe=(0.0, 0.2, 0.0)), tmp_path / "out", name)
    there = {path.name for path in (tmp_path / "out").iterdir()}
    named = set()
    for path in (tmp_path / "out").iterdir():
        if path.suffix in (".py", ".usda", ".xml"):
            named |= set(re.findall(r"[\w./-]+\.(?:exr|png|glb|ply|usda|xml)\b", path.read_text(encoding="utf-8")))
    assert {name.removeprefix("./") for name in named if "OUT" not in name} - {"shot.xml"} <= there
    assert {SHOT_FORMATS[name].main, "README.txt", "plate.exr", "plate.png"} <= there


def test_blender_gets_the_camera_in_its_terms(tmp_path):
    camera = replace(shot().camera, centre=(13.0, 7.0), aperture=0.01, focus=1.5)
    quietly(shot(camera=camera), tmp_path / "out", "blender")
    tree = ast.parse((tmp_path / "out" / "shot.py").read_text(encoding="utf-8"))
    said = next(
        ast.literal_eval(each.value)
        for each in tree.body
        if isinstance(each, ast.Assign) and isinstance(each.targets[0], ast.Name) and each.targets[0].id == "SHOT"
    )
    # 36 mm across are 24 pixels.
    assert said["camera"]["lens"] == pytest.approx(45.0)
    # The principal point is a pixel right of and above the middle: the frame moves left and down.
    assert said["camera"]["shift"] == pytest.approx((-1 / 24, -1 / 24))
    assert said["camera"]["f_stop"] == pytest.approx(0.045 / 0.02) and said["camera"]["focus"] == 1.5
    assert np.allclose(np.array(said["camera"]["axes"]).T, camera.rotation)
    assert (said["objects"], said["real"], said["distant"]) == ("objects.glb", "real.glb", None)


def test_blender_finds_the_strength_of_each_wall(tmp_path):
    bright = light()
    bright.radiance[3, 20] = 1000.0
    value = shot(light=bright, distant=BOX, probe=(0.0, 0.2, 0.0))
    quietly(value, tmp_path / "out", "blender")
    text = (tmp_path / "out" / "shot.py").read_text(encoding="utf-8")
    steps = found(r"'steps': (\[[^\]]*\])", text)
    meshes = read_meshes(tmp_path / "out" / "distant.glb")
    assert len(meshes) == len(steps) > 1
    assert np.all(np.diff(steps) > 0) and 500 <= steps[-1] <= 2000
    # All walls, once: 256 rows of 512 cells of two triangles, one at the poles.
    assert sum(len(mesh.faces) for mesh in meshes) == 2 * 512 * 255


def test_glb_keeps_meshes_and_materials(tmp_path):
    image = np.linspace(0.1, 0.9, 4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)
    glass = Material(
        (0.9, 0.8, 0.7), roughness=0.1, transmission=1.0, ior=1.33, attenuation_color=(0.5, 0.6, 0.7),
        attenuation_distance=0.02, clearcoat=0.5, emission=(2.0, 1.0, 0.5),
    )  # fmt: skip
    painted = replace(SQUARE, material=replace(GREY, base_color=image, metallic=0.7))
    quietly(shot(objects=(replace(SQUARE, material=glass), painted)), tmp_path / "out", "blender")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        first, second = read_meshes(tmp_path / "out" / "objects.glb")
    assert first.uv is not None and isinstance(first.material, Material) and isinstance(second.material, Material)
    assert (first.name, second.name) == ("object_00_a_square", "object_01_a_square")
    assert np.array_equal(first.vertices, SQUARE.vertices) and np.array_equal(first.faces, SQUARE.faces)
    assert np.allclose(first.uv, [[0, 0], [1, 0], [1, 1], [0, 1]])
    assert first.material.base_color == pytest.approx((0.9, 0.8, 0.7))
    assert (first.material.transmission, first.material.ior) == pytest.approx((1.0, 1.33))
    # 8 bits of sRGB: half a code value, which is steepest at white.
    assert np.allclose(second.material.base_color, image, atol=0.5 / 255 * 2.4)
    assert second.material.metallic == pytest.approx(0.7)


def test_usd_holds_the_camera_and_the_surfaces(tmp_path):
    camera = replace(shot().camera, centre=(13.0, 7.0))
    quietly(shot(camera=camera), tmp_path / "out", "usd")
    text = (tmp_path / "out" / "shot.usda").read_text(encoding="utf-8")
    number = {key: float(value) for key, value in re.findall(r"float (\w+) = (\S+)\n", text)}
    assert number["focalLength"] == pytest.approx(0.45) and number["horizontalAperture"] == pytest.approx(0.36)
    assert number["verticalAperture"] == pytest.approx(0.24)
    assert number["horizontalApertureOffset"] == pytest.approx(-0.015)
    assert number["verticalApertureOffset"] == pytest.approx(-0.015)
    matrix = np.array(found(r"matrix4d xformOp:transform = (\([^\n]*\))\n", text))
    assert np.allclose(matrix[:3, :3], camera.rotation.T) and np.allclose(matrix[3, :3], camera.position)
    assert text.count('def Mesh "') == 2 and text.count("custom bool relume:shadowCatcher = 1") == 1
    assert text.count("{") == text.count("}") and "{path}" not in text
    # The square's own corners, and the material that it is bound to.
    assert "(-0.200000003, 0.100000001, 0.300000012)" in text
    assert "</Shot/Objects/object_00_a_square/Material>" in text
    assert "color3f inputs:diffuseColor = (0.2, 0.4, 0.6)" in text


@pytest.mark.parametrize("walls", [False, True])
def test_mitsuba_reads_the_scene_that_is_rendered_here(walls, tmp_path):
    image = np.linspace(0.1, 0.9, 4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)
    mirror = replace(SQUARE, material=Material((0.9, 0.8, 0.7), 1.0, 0.0), normals=np.tile([[0, 0, 1]], (4, 1)))
    glass = Sphere((0.2, 0.2, 0.5), 0.15, Material(transmission=1.0, roughness=0.0))
    painted = replace(SQUARE, material=Diffuse((0.7, 0.2, 0.1)), vertices=SQUARE.vertices - [0, 0, 0.6])
    wall = replace(SQUARE, material=Material(image, 1.0, 0.0), vertices=SQUARE.vertices - [0.6, 0, 0])
    lamps = (DistantLight((1.0, 2.0, 0.5), (0.3, 0.2, 0.1)), PointLight((0.0, 1.0, 0.5), (0.1, 0.2, 0.3)))
    value = shot(local=(*shot().scene.local, wall), objects=(mirror, glass, painted), lights=lamps)
    if walls:
        value = replace(value, scene=replace(value.scene, distant=BOX, probe=(0.0, 0.2, 0.0)))
    notes = quietly(value, tmp_path / "out", "mitsuba")
    assert notes == ()
    with mitsuba_reading(None) as mi:
        for file, scene in (("shot", value.scene), ("place", value.scene.without_objects())):
            here = mi.load_dict(scene_dictionary(mi, scene, value.camera))
            there = mi.load_file(str(tmp_path / "out" / f"{file}.xml"), samples=64)
            path = mi.load_dict({"type": "path", "max_depth": 13})
            ours = np.array(mi.render(here, integrator=path, spp=64, seed=1))
            read = np.array(mi.render(there, seed=2))
            # 384 pixels of 64 rays: the mean of a light without lamps in it is known to better than a hundredth.
            assert np.allclose(read.mean((0, 1)), ours.mean((0, 1)), rtol=0.01)
            assert np.corrcoef(read.ravel(), ours.ravel())[0, 1] > 0.98


def test_mitsuba_gets_what_fills_a_body(tmp_path):
    water = Material(transmission=1.0, roughness=0.0, attenuation_color=(0.5, 0.25, 1.0), attenuation_distance=0.1)
    quietly(shot(objects=(Sphere((0.2, 0.2, 0.5), 0.15, water),)), tmp_path / "out", "mitsuba")
    root = ET.fromstring((tmp_path / "out" / "shot.xml").read_bytes())
    medium = under(root, "shape/medium[@name='interior']")
    # −ln ½ / 0.1 m
    said = value_of(under(medium, "rgb[@name='sigma_t']")).split(", ")
    scale = float(value_of(under(medium, "float[@name='scale']")))
    assert [scale * float(part) for part in said] == pytest.approx([6.93147, 13.86294, 0.0], abs=1e-4)
    place = ET.fromstring((tmp_path / "out" / "place.xml").read_bytes())
    assert under(place, "integrator").get("type") == "volpath"


def test_key_lights_stand_at_the_walls_and_give_the_probe_what_they_gave():
    lights = Constellation(np.array([[0.6, 0.8, 0.0], [0.0, 0.0, -1.0]]), np.array([[4.0, 2.0, 1.0], [1.0, 1.0, 3.0]]))
    value = shot(distant=BOX, probe=(0.0, 0.5, 0.0), keys=KeyLights(lights, light(), 1.0))
    _, lamps = light_of(value)
    assert lamps.points is not None and not len(lamps.lights.directions)
    # The ceiling is 2 m above the probe, 1.5 m beside it; the wall behind 1.5 m away.
    assert np.allclose(lamps.points.positions, [[1.5, 2.5, 0.0], [0.0, 0.5, -1.5]])
    assert np.allclose(lamps.points.seen_from((0.0, 0.5, 0.0)).irradiance, lights.irradiance)
    _, far = light_of(shot(keys=KeyLights(lights, light(), 1.0)))
    assert far.points is None and np.array_equal(far.lights.directions, lights.directions)


def test_lamps_of_the_scene_are_handed_over():
    _, lamps = light_of(
        shot(
            lights=(DistantLight((0.0, 3.0, 4.0), (1.0, 2.0, 3.0)), SphereLight((0.0, 2.0, 0.0), 0.5, (4.0, 4.0, 8.0)))
        )
    )
    assert np.allclose(lamps.lights.directions, [[0.0, 0.6, 0.8]])
    assert np.allclose(lamps.lights.irradiance, [[1.0, 2.0, 3.0]])
    assert lamps.points is not None
    assert np.allclose(lamps.points.intensity, np.pi * 0.25 * np.array([[4.0, 4.0, 8.0]]))
    with pytest.raises(UnsupportedScene, match="ambient"):
        light_of(shot(lights=(AmbientLight((0.1, 0.1, 0.1)),)))


def test_plate_is_drawn_without_distortion():
    camera = replace(shot().camera, distortion=Distortion(k1=-0.2))
    # Each pixel holds its own place, as the distorted camera saw it.
    x, y = np.meshgrid(np.arange(24) + 0.5, np.arange(16) + 0.5)
    plate = RadianceMap(np.stack([x, y, 0 * x], axis=-1).astype(np.float32))
    straight, notes = undistorted(shot(camera=camera, plate=plate))
    assert straight.camera.distortion is None and "distortion" in notes[0]
    world = camera.position + camera.pinhole().rays()[8, 15]
    assert np.allclose(straight.plate.radiance[8, 15, :2], camera.project(world), atol=1e-4)
    assert np.abs(straight.plate.radiance[0, 0] - plate.radiance[0, 0]).max() > 0.3


@EACH
def test_what_is_not_held_is_said(name, tmp_path):
    ward = replace(SQUARE, material=Ward((0.5, 0.5, 0.5), 0.1, 0.4))
    camera = replace(shot().camera, distortion=Distortion(k1=-0.1))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        notes = export_shot(shot(objects=(ward,), camera=camera), tmp_path / "out", name).not_held
    assert [str(each.message) for each in caught] == [f"{name}: {note}" for note in notes]
    readme = (tmp_path / "out" / "README.txt").read_text(encoding="utf-8")
    assert any("Ward" in note for note in notes) and any("distortion" in note for note in notes)
    assert all(f"- {note}\n" in readme for note in notes)


@EACH
def test_materials_that_are_no_physical_ones_are_refused(name, tmp_path):
    painted = replace(SQUARE, material=WhittedMaterial((0.5, 0.5, 0.5)))
    with pytest.raises(UnsupportedScene):
        export_shot(shot(objects=(painted,)), tmp_path / "out", name)
    assert not list(tmp_path.iterdir())


def test_folder_that_exists_keeps_what_is_not_ours(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "mine.blend").write_text("mine")
    (folder / "shot.py").write_text("old")
    quietly(shot(), folder, "blender")
    assert (folder / "mine.blend").read_text() == "mine"
    assert (folder / "shot.py").read_text(encoding="utf-8") != "old"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    with pytest.raises(ValueError, match='program is "maya"; choose one of blender, usd, mitsuba'):
        export_shot(shot(), folder, "maya")  # pyright: ignore[reportArgumentType]
    with pytest.raises(OutputNotWritten, match="nowhere"):
        export_shot(shot(), tmp_path / "nowhere" / "out", "blender")
    with pytest.raises(OutputNotWritten, match="file has that name"):
        export_shot(shot(), folder / "shot.py", "blender")


def test_plate_of_another_size_is_refused():
    with pytest.raises(ValueError, match="give both alike"):
        shot(plate=RadianceMap(np.zeros((8, 24, 3), np.float32)))


def test_plate_is_written_as_it_is(tmp_path):
    quietly(shot(), tmp_path / "out", "usd")
    assert np.array_equal(files.read_radiance(tmp_path / "out" / "plate.exr").radiance, shot().plate.radiance)


def test_what_is_prepared_for_other_programs_has_the_doubts_of_its_objects(monkeypatch, tmp_path):
    """All before the render is made up; what is asked is whether the objects are looked at."""
    job = "relume.project.insertion.insert"
    hovering = replace(SQUARE, vertices=SQUARE.vertices + np.array([0, 0.4, 0], np.float32))
    ready = shot()
    scene = Scene(ready.scene.light, local=(Plane(Diffuse((0.5, 0.5, 0.5)), size=(2.0, 2.0)),))
    place = SimpleNamespace(camera=ready.camera, bare=scene, relit=lambda shot: scene)
    calibrated = SimpleNamespace(plate=ready.plate)
    white = (Doubt("the lamps are white", 0.1),)
    for name, made in {
        "placed_meshes": (hovering,), "read_photographs": None, "calibrate": calibrated, "on_one_scale": calibrated,
        "find_camera": SimpleNamespace(camera=ready.camera), "find_place": place, "doubts_on": white,
        "development_of": SimpleNamespace(photograph=ready.photograph, film=ready.film),
    }.items():  # fmt: skip
        monkeypatch.setattr(f"{job}.{name}", lambda *_, made=made, **__: made)
    asked = SimpleNamespace(render=SimpleNamespace(samples=4, depth=12), light=SimpleNamespace(scale=1.0))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        prepare_shot(asked, tmp_path)  # pyright: ignore[reportArgumentType]
    doubts = [doubt_of(each.message) for each in caught]
    assert doubts[0].line.startswith("the objects hover 0.5 m over the plane") and doubts[0].effect == 0.2
    assert doubts[1] == Doubt("the lamps are white", 0.1)
