"""The scene file: every key of it, the conventions as literals, and one clear line for what is wrong."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidScene, UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.light.reflection.brdf import GGX, Ward
from relume.light.reflection.lobes import GGXLobe, Lambert, Mirror, Phong, WardLobe
from relume.light.reflection.weights import Complement, Even, Fresnel, Schlick
from relume.project.scene_file.scene_file import read_scene, scene_of_mesh
from relume.scene.lights import SphereLight
from relume.scene.materials.bumps import BumpMap, Wrinkles
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.materials.materials import Ward as WardSurface
from relume.scene.materials.reflective import Reflective, Towards
from relume.scene.shapes.shapes import AnyMaterial, Mesh, Sphere
from relume.sphere.mappings.discs import Angular
from toml_files import SCENE_BALL as BALL
from toml_files import SCENE_CAMERA, refusal, scene_of

HEAD = (
    SCENE_CAMERA
    + """\
[light]
map = "light.exr"
"""
)
CHROME = '[materials.ball]\nkind = "mirror"\n'
PATCHED = "v 0 1 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n"
UNWRAPPED = "v 0 1 0\nv 1 0 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a map that is bright towards −Z, two meshes and an image."""
    radiance = np.full((8, 16, 3), 1.0, np.float32)
    radiance[3:5, 7:9] = 100.0
    files.write(tmp_path / "light.exr", RadianceMap(radiance))
    (tmp_path / "plain.obj").write_text(PATCHED)
    (tmp_path / "unwrapped.obj").write_text(UNWRAPPED)
    files.write(tmp_path / "grey.png", Photograph(np.full((2, 2, 3), 188, np.uint8)))
    return tmp_path


def ball_of(folder: Path, material: str) -> AnyMaterial:
    return scene_of(folder, f"{HEAD}[materials.ball]\n{material}\n{BALL}").scene.objects[0].material


def reflective_of(folder: Path, material: str) -> Reflective:
    found = ball_of(folder, material)
    assert isinstance(found, Reflective) and found.name == "ball"
    return found


# What is read


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("kind = 'ward'\nalpha_x = 0.1\nalpha_y = 0.2\nreflectance = 0.4\ndiffuse = 0.1", "reflectance", 0.4),
        ("kind = 'ward'\nalpha_x = 0.1\nalpha_y = 0.2\nreflectance = 0.4\ndiffuse = 0.1", "diffuse", 0.1),
        ("kind = 'pbr'\nemission = 3", "emission", 3.0),
        ("kind = 'pbr'\nbase_color = 0.25", "base_color", 0.25),
        ("kind = 'pbr'\nsheen_color = 1", "sheen_color", 1.0),
        ("kind = 'pbr'\nspecular_color = 0.5", "specular_color", 0.5),
        ("kind = 'pbr'\ntransmission = 1\nscattering_distance = 0.01", "scattering_distance", 0.01),
        ("kind = 'pbr'\ntransmission = 1\nscattering_distance = 1\nscattering_albedo = 0.5", "scattering_albedo", 0.5),
        (
            "kind = 'pbr'\ntransmission = 1\nattenuation_distance = 1\nattenuation_color = 0.5",
            "attenuation_color",
            0.5,
        ),
        ("kind = 'whitted'\nspecular = 0.5", "specular", 0.5),
    ],
)
def test_one_number_is_grey_wherever_a_colour_is(folder: Path, table: str, key: str, value: float) -> None:
    assert getattr(ball_of(folder, table), key) == (value, value, value)


@pytest.mark.parametrize("kind", ["mirror", "retroreflector", "glass"])
def test_one_number_is_grey_in_reflection_maps_too(folder: Path, kind: str) -> None:
    grey, colour = (reflective_of(folder, f"kind = '{kind}'\ncolour = {value}") for value in ("0.5", "[0.5, 0.5, 0.5]"))
    assert [layer.colour for layer in grey.layers] == [layer.colour for layer in colour.layers]
    assert (0.25,) * 3 in [layer.colour for layer in reflective_of(folder, "kind = 'glossy'\ndiffuse = 0.25").layers]


def test_a_glass_that_lets_no_light_through_is_noted(folder: Path) -> None:
    said = r"materials\.ball: has glass but no transmission, so that it looks like white plastic"
    with pytest.warns(UserWarning, match=said):
        ball_of(folder, "kind = 'pbr'\nglass = 'N-BK7'")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for table in ("glass = 'N-BK7'\ntransmission = 1", "preset = 'glass'\nglass = 'N-BK7'", "ior = 1.5"):
            ball_of(folder, f"kind = 'pbr'\n{table}")


def test_the_example_in_the_docs_is_a_scene_file(folder: Path) -> None:
    page = (Path(__file__).parents[2] / "docs/reference/scene-file.md").read_text(encoding="utf-8")
    example = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[0]
    for name in re.findall(r'"([^"]+\.(?:hdr|obj|png))"', example):
        source = {"hdr": "light.exr", "obj": "unwrapped.obj", "png": "grey.png"}[name[-3:]]
        (folder / name).write_bytes((folder / source).read_bytes())
    found = scene_of(folder, example)
    assert len(found.scene.objects) == 3 and len(found.scene.local) == 1
    assert found.camera.width == 640


def test_the_camera_of_the_file(folder: Path) -> None:
    text = HEAD.replace("[light]", "field_of_view = 90\nsize = [200, 100]\n[light]")
    camera = scene_of(folder, text + CHROME + BALL).camera
    assert (camera.width, camera.height) == (200, 100)
    assert camera.focal_length == pytest.approx(100.0)
    assert camera.position.tolist() == [0, 1, 4]
    assert camera.project(np.array([0, 0.5, 0])) == pytest.approx([100, 50])


def test_a_camera_is_640_by_480_and_40_degrees_across_unless_given(folder: Path) -> None:
    camera = scene_of(folder, HEAD + CHROME + BALL).camera
    assert (camera.width, camera.height) == (640, 480)
    assert camera.focal_length == pytest.approx(879.1927742)  # 320 / tan 20°
    left, right = camera.rays()[240, [0, -1]]
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(40, abs=0.1)


def test_the_light_turns_counter_clockwise_seen_from_above(folder: Path) -> None:
    def brightest(turn: float) -> list[float]:
        light = scene_of(folder, HEAD + f"turn = {turn}\n" + CHROME + BALL).scene.light
        axes = np.array([[0, 0, -1], [-1, 0, 0], [0, 0, 1], [1, 0, 0]])
        return axes[light.lookup(axes)[:, 0].argmax()].tolist()

    assert brightest(0) == [0, 0, -1]
    assert brightest(90) == [-1, 0, 0]
    assert brightest(180) == [0, 0, 1]
    assert brightest(-90) == [1, 0, 0]


def test_a_turn_by_whole_columns_moves_pixels_and_by_parts_loses_no_light(folder: Path) -> None:
    as_it_is = scene_of(folder, HEAD + CHROME + BALL).scene.light
    whole = scene_of(folder, HEAD + "turn = 22.5\n" + CHROME + BALL).scene.light
    np.testing.assert_array_equal(whole.radiance, np.roll(as_it_is.radiance, -1, axis=1))
    part = scene_of(folder, HEAD + "turn = 5.625\n" + CHROME + BALL).scene.light
    assert part.radiance[3, 6:10, 0] == pytest.approx([25.75, 100, 75.25, 1])
    assert part.total() == pytest.approx(as_it_is.total())


def test_the_light_is_scaled_and_a_map_that_remembers_its_mapping_is_read_and_turned_by_it(folder: Path) -> None:
    light = scene_of(folder, HEAD + "scale = 2.5\n" + CHROME + BALL).scene.light
    assert light.radiance.min() == 2.5 and light.radiance.max() == 250
    picture = RadianceMap(np.ones((8, 8, 3), np.float32), unit="cd/m²", attributes={"mapping": "angular"})
    files.write(folder / "light.exr", picture)
    light = scene_of(folder, HEAD + "turn = 30\n" + CHROME + BALL).scene.light
    assert light.mapping == Angular() and light.unit == "cd/m²"


def test_a_mirror(folder: Path) -> None:
    (layer,) = reflective_of(folder, 'kind = "mirror"\ncolour = [0.9, 0.8, 0.7]').layers
    assert layer.lobe == Mirror() and layer.towards is Towards.REFLECTED and layer.colour == (0.9, 0.8, 0.7)


def test_a_glossy_surface_with_everything_given(folder: Path) -> None:
    made = reflective_of(
        folder,
        """kind = "glossy"
        diffuse = [0.5, 0.1, 0.1]
        lobe = { kind = "phong", n = 20, varnish = 0.5 }
        weight = { kind = "even", value = [0.3, 0.2, 0.1] }
        bumps = { height = 0.003, wavelength = 0.04, seed = 7 }""",
    )
    below, above = made.layers
    assert below.lobe == Lambert() and below.towards is Towards.NORMAL and below.colour == (0.5, 0.1, 0.1)
    assert below.weight == Complement(Even((0.3, 0.2, 0.1))) and above.weight == Even((0.3, 0.2, 0.1))
    assert above.lobe == Phong(20, varnish=0.5) and above.towards is Towards.REFLECTED
    assert made.bumps == Wrinkles(0.003, 0.04, 7)


def test_a_glossy_surface_is_half_grey_below_phong_50_and_schlick_unless_given(folder: Path) -> None:
    made = reflective_of(folder, 'kind = "glossy"')
    assert made.layers[0].colour == (0.5, 0.5, 0.5) and made.bumps is None
    assert made.layers[1].lobe == Phong(50) and made.layers[1].weight == Schlick(0.04)


@pytest.mark.parametrize(
    ("table", "lobe"),
    [
        ('{ kind = "ggx", alpha = 0.2 }', GGX(0.2)),
        ('{ kind = "ward", alpha = 0.3 }', Ward(0.3)),
        ('{ kind = "ggx-lobe", alpha = 0.2 }', GGXLobe(0.2)),
        ('{ kind = "ward-lobe", alpha = 0.3 }', WardLobe(0.3)),
    ],
)
def test_the_lobes(folder: Path, table: str, lobe: object) -> None:
    assert reflective_of(folder, f'kind = "glossy"\nlobe = {table}').layers[1].lobe == lobe


@pytest.mark.parametrize(
    ("table", "weight"),
    [
        ('{ kind = "even", value = 0.5 }', Even(0.5)),
        ('{ kind = "schlick", normal = [0.9, 0.6, 0.3] }', Schlick((0.9, 0.6, 0.3))),
        ('{ kind = "fresnel", ior = 1.33 }', Fresnel(1.33)),
    ],
)
def test_the_weights(folder: Path, table: str, weight: object) -> None:
    assert reflective_of(folder, f'kind = "glossy"\nweight = {table}').layers[1].weight == weight


def test_an_image_is_decoded_to_linear_for_a_colour_and_is_metres_for_bumps(folder: Path) -> None:
    made = reflective_of(folder, 'kind = "glossy"\ndiffuse = "grey.png"\nbumps = { map = "grey.png", height = 0.01 }')
    colour = made.layers[0].colour
    assert isinstance(colour, np.ndarray) and colour.shape == (2, 2, 3) and colour.dtype == np.float32
    assert colour == pytest.approx(0.502886, abs=1e-5)  # sRGB 188 of 255
    assert isinstance(made.bumps, BumpMap)
    assert made.bumps.heights == pytest.approx(np.full((2, 2), 0.01 * 188 / 255))


def test_a_retroreflector(folder: Path) -> None:
    (layer,) = reflective_of(folder, 'kind = "retroreflector"\nlobe = { kind = "phong", n = 9 }').layers
    assert layer.lobe == Phong(9) and layer.towards is Towards.VIEWER


def test_glass(folder: Path) -> None:
    reflected, through = reflective_of(folder, 'kind = "glass"\nior = 1.33\ncolour = [0.5, 1, 1]').layers
    assert reflected.weight == Fresnel(1.33) and through.towards is Towards.REFRACTED
    assert through.ior == 1.33 and through.colour == (0.5, 1, 1)


def test_a_diffuse_and_a_metallic_roughness_surface(folder: Path) -> None:
    clay = ball_of(folder, 'kind = "diffuse"\nreflectance = [0.6, 0.5, 0.4]')
    assert clay == Diffuse((0.6, 0.5, 0.4))
    plastic = ball_of(
        folder,
        'kind = "pbr"\nbase_color = [0.1, 0.2, 0.3]\nmetallic = 0.5\nroughness = 0.25\ntransmission = 0.75\nior = 1.4',
    )
    assert isinstance(plastic, Material) and plastic.name == "ball"
    assert (plastic.base_color, plastic.metallic, plastic.roughness) == ((0.1, 0.2, 0.3), 0.5, 0.25)
    assert (plastic.transmission, plastic.ior) == (0.75, 1.4)
    pictured = ball_of(folder, 'kind = "pbr"\nbase_color = "grey.png"')
    assert isinstance(pictured, Material) and pictured.base_color == pytest.approx(0.502886, abs=1e-5)
    assert (pictured.metallic, pictured.roughness, pictured.ior) == (0.0, 1.0, 1.5)


def test_a_preset_is_taken_with_its_changes_and_may_be_a_ward_surface(folder: Path) -> None:
    gold = ball_of(folder, 'kind = "pbr"\npreset = "gold"\nroughness = 0.5\nclearcoat = 0.25')
    assert isinstance(gold, Material) and gold.name == "ball"
    assert (gold.metallic, gold.roughness, gold.clearcoat) == (1.0, 0.5, 0.25)
    pictured = ball_of(folder, 'kind = "pbr"\npreset = "plastic"\nbase_color = "grey.png"')
    assert isinstance(pictured, Material) and isinstance(pictured.base_color, np.ndarray)
    assert pictured.roughness == 0.25
    brass = ball_of(folder, 'kind = "pbr"\npreset = "rolled_brass"\nalpha_y = 0.5')
    assert isinstance(brass, WardSurface) and (brass.alpha_x, brass.alpha_y, brass.name) == (0.05, 0.5, "ball")


def test_a_lamp_has_a_size(folder: Path) -> None:
    lamp = '[[lights]]\nkind = "sphere"\nposition = [0, 2, 0]\nradius = 0.25\nradiance = 3\n'
    assert scene_of(folder, HEAD + lamp + CHROME + BALL).scene.lights == (SphereLight((0, 2, 0), 0.25, (3, 3, 3)),)
    assert refusal(folder, HEAD + lamp.replace("0.25", "0") + CHROME + BALL).startswith("lights.0.radius: ")


def test_a_sphere_stands_where_the_file_says(folder: Path) -> None:
    (ball,) = scene_of(folder, HEAD + CHROME + BALL).scene.objects
    assert isinstance(ball, Sphere) and (ball.centre, ball.radius) == ((0, 0.5, 0), 0.5)
    assert ball.name == "objects.0"


def test_a_mesh_is_scaled_then_turned_about_x_y_and_z_then_moved(folder: Path) -> None:
    text = '[[objects]]\nmesh = "plain.obj"\ntranslate = [10, 0, 0]\nrotate = [90, 90, 90]\nscale = 2.0\n'
    (mesh,) = scene_of(folder, HEAD + text).scene.objects
    assert isinstance(mesh, Mesh)
    # +Y to +Z by x, to +X by y, to +Y by z; +X stays, goes to −Z and stays; +Z goes to −Y and stays, and to +X.
    np.testing.assert_allclose(mesh.vertices, [[10, 2, 0], [10, 0, -2], [12, 0, 0]], atol=1e-5)


def test_a_mesh_keeps_its_own_material_unless_one_is_given(folder: Path) -> None:
    text = HEAD + CHROME + '[[objects]]\nmesh = "plain.obj"\n[[objects]]\nmesh = "plain.obj"\nmaterial = "ball"\n'
    own, given = scene_of(folder, text).scene.objects
    assert isinstance(own.material, Material) and isinstance(given.material, Reflective)


def test_a_mesh_with_texture_coordinates_takes_an_image(folder: Path) -> None:
    material = '[materials.ball]\nkind = "glossy"\ndiffuse = "grey.png"\n'
    text = HEAD + material + '[[objects]]\nmesh = "unwrapped.obj"\nmaterial = "ball"\n'
    (mesh,) = scene_of(folder, text).scene.objects
    assert isinstance(mesh, Mesh) and mesh.uv is not None


def test_a_local_plane_is_enough_to_be_seen(folder: Path) -> None:
    text = '[[local]]\nshape = "plane"\nsize = [2, 3]\nheight = -0.5\nreflectance = [0.1, 0.2, 0.3]\n'
    (plane,) = scene_of(folder, HEAD + text).scene.local
    assert plane.material == Diffuse((0.1, 0.2, 0.3))
    assert getattr(plane, "size", None) == (2, 3) and getattr(plane, "height", None) == -0.5


def test_a_mesh_alone_is_framed_from_a_little_above(folder: Path) -> None:
    (folder / "tall.obj").write_text("v -1 2 0\nv 1 2 0\nv 0 4 0\nf 1 2 3\n")
    found = scene_of_mesh(folder / "tall.obj", folder / "light.exr")
    camera = found.camera
    # The sphere about [0, 3, 0] of radius √2, and half of 30.54° up and down.
    assert camera.position == pytest.approx([0, 4.528915, 5.705989], abs=1e-6)
    assert camera.rotation[:, 2] == pytest.approx([0, 0.258819, 0.965926], abs=1e-6)
    assert (camera.width, camera.height) == (640, 480) and camera.focal_length == pytest.approx(879.1927742)
    assert found.scene.light.size == 8 and isinstance(found.scene.objects[0].material, Material)
    # Every point of the sphere is seen, and some come near to the margin.
    points = np.random.default_rng(0).normal(size=(20000, 3))
    points = np.array([0, 3, 0]) + np.sqrt(2) * points / np.linalg.norm(points, axis=1, keepdims=True)
    seen = camera.project(points)[:, 1]
    assert 480 * 0.02 < seen.min() < 480 * 0.08 and 480 * 0.92 < seen.max() < 480 * 0.98


# What is refused


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (HEAD, "objects: none, so only the light would be seen; add [[objects]] with a sphere or a mesh"),
        (
            HEAD.replace('map = "light.exr"', "") + BALL,
            "light: has none of them; give one of map, maps, probes, sky and colour",
        ),
        (HEAD.replace("[light]", "[lihgt]"), "lihgt: unknown key; did you mean light?"),
        (
            HEAD.replace("[camera]", "[camera"),
            "not valid TOML: Expected ']' at the end of a table declaration (at line 2",
        ),
        ("[camera", "not valid TOML: Expected ']' at the end of a table declaration (at the end, line 1)"),
        ("[light]\nmap = 'light.exr'", "camera: missing; the scene file must have it"),
        (
            HEAD.replace("target", "roll").replace("[0, 0.5, 0]", "5", 1) + BALL,
            "camera: target: missing; the scene file must have it",
        ),
        (
            HEAD.replace("[0, 0.5, 0]", "[0, 1, 4]") + BALL,
            "camera: target [0.0, 1.0, 4.0] is where the camera stands; give another point to look at",
        ),
        (
            HEAD.replace("[0, 0.5, 0]", "[0, 0, 4]") + BALL,
            "camera: a camera at [0. 1. 4.] looking at [0. 0. 4.] has no",
        ),
        (HEAD.replace("[0, 0.5, 0]", "[0, 1]") + BALL, "camera.target: too few numbers (got [0, 1])"),
        (
            HEAD.replace("[0, 0.5, 0]", "[0, nan, 1]") + BALL,
            "camera.target.1: input should be a finite number (got nan)",
        ),
        (HEAD.replace("[light]", "field_of_view = 180\n[light]") + BALL, "camera.field_of_view: input should be less"),
        (HEAD.replace("[light]", "size = [0, 9]\n[light]") + BALL, "camera.size.0: input should be greater than or"),
        (HEAD.replace("[light]", "fov = 3\n[light]") + BALL, "camera.fov: unknown key"),
        (HEAD + "scale = 0\n" + BALL, "light.scale: input should be greater than 0 (got 0)"),
        (HEAD + "scale = 1e300\n" + BALL, "light.scale: radiance holds negative or non-finite values"),
        (HEAD + "turns = 3\n" + BALL, "light.turns: unknown key; did you mean turn?"),
        (HEAD + BALL, "objects.0.material: no material 'ball'; define [materials.ball]"),
        (
            HEAD + CHROME + BALL.replace('"ball"', '"bll"') + "[materials.satin]\nkind = 'glossy'",
            "objects.0.material: no material 'bll'; the file has ball, satin",
        ),
        (HEAD + BALL.replace("material", "materials"), "objects.0.materials: unknown key; did you mean material?"),
        (HEAD + BALL.replace('material = "ball"', ""), "objects.0.material: missing; a sphere needs one, by its name"),
        (
            HEAD + CHROME + BALL + 'mesh = "a.obj"',
            "objects.0: has sphere and mesh; give one of sphere, mesh, polygon and patches",
        ),
        (
            HEAD + CHROME + '[[objects]]\nmaterial = "ball"',
            "objects.0: has no shape; give one of sphere, mesh, polygon and patches",
        ),
        (HEAD + CHROME + BALL + "scale = 2", "objects.0: has scale, but a sphere is placed by its centre and radius"),
        (HEAD + CHROME + BALL.replace("radius = 0.5", "radius = 0"), "objects.0.sphere: radius of 'objects.0' is 0.0;"),
        (HEAD + CHROME + BALL.replace("radius", "r"), "objects.0.sphere.radius: missing"),
        (HEAD + '[[objects]]\nmesh = "plain.obj"\nscale = -1', "objects.0.scale: input should be greater than 0"),
        (HEAD + "[[local]]\nshape = 'plane'", "local.0: has neither; give one of reflectance and material"),
        (HEAD + "[[local]]\nshape = 'disc'\nreflectance = [0, 0, 0]", "local.0.shape: input should be 'plane'"),
        (HEAD + "[[local]]\nshape = 'plane'\nreflectance = [2, 0, 0]", "local.0.reflectance.0: input should be less"),
        (HEAD + "materials = 3\n", "light.materials: unknown key"),
        ("materials = 3\n" + HEAD, "materials: input should be a table (got 3)"),
        (HEAD + "[materials]\nred = 3", "materials.red: input should be a table (got 3)"),
    ],
)
def test_a_fault_is_one_line_with_its_key(folder: Path, text: str, line: str) -> None:
    assert refusal(folder, text).startswith(line)


@pytest.mark.parametrize(
    ("material", "line"),
    [
        ("colour = [1, 1, 1]", ".kind: missing; the scene file must have it"),
        ("kind = 'x'", ".kind: got 'x'; expected one of mirror, glossy, retroreflector, glass, diffuse, pbr"),
        (
            "kind = 'miror'",
            ".kind: got 'miror'; expected one of mirror, glossy, retroreflector, glass, diffuse, pbr, measured, ward, "
            "whitted; did you mean mirror?",
        ),
        ("kind = 'mirror'\ncolor = [1, 1, 1]", ".color: unknown key; did you mean colour?"),
        ("kind = 'mirror'\nior = 1.5", ".ior: unknown key; remove it or see the docs"),
        ("kind = 'mirror'\ncolour = true", ".colour: input should be a list (got True)"),
        ("kind = 'mirror'\ncolour = [-1, 0, 0]", ": colour of a layer has shape (3,); expected three numbers of 0 or"),
        ("kind = 'glossy'\ndiffuse = 'none.png'", ".diffuse: {folder}/none.png: "),
        ("kind = 'glossy'\ndiffuse = [1, 2]", ".diffuse: too few numbers (got [1, 2])"),
        ("kind = 'glossy'\nlobe = { n = 3 }", ".lobe.kind: missing; the scene file must have it"),
        ("kind = 'glossy'\nlobe = { kind = 'blinn' }", ".lobe.kind: got 'blinn'; expected one of phong, ggx-lobe, "),
        ("kind = 'glossy'\nlobe = { kind = 'phong', alpha = 3 }", ".lobe.alpha: unknown key"),
        ("kind = 'glossy'\nlobe = { kind = 'ggx', alpah = 3 }", ".lobe.alpah: unknown key; did you mean alpha?"),
        ("kind = 'glossy'\nlobe = { kind = 'ggx' }", ".lobe.alpha: missing; the scene file must have it"),
        ("kind = 'glossy'\nlobe = { kind = 'phong', n = -1 }", ".lobe: n of phong is -1.0; expected a glossiness of 0"),
        ("kind = 'glossy'\nlobe = { kind = 'ggx', alpha = 0 }", ".lobe: alpha of ggx is 0.0; expected above 0 and at"),
        ("kind = 'glossy'\nweight = { kind = 'schlick', normal = 2 }", ".weight: reflectance along the normal is 2.0;"),
        ("kind = 'glossy'\nweight = { kind = 'fresnel', ior = 0 }", ".weight: index of refraction is 0.0; expected"),
        ("kind = 'glossy'\nweight = { kind = 'even', vlaue = 0 }", ".weight.vlaue: unknown key; did you mean value?"),
        ("kind = 'glossy'\nbumps = 3", ".bumps: input should be a table (got 3)"),
        ("kind = 'glossy'\nbumps = { wavelenght = 3 }", ".bumps.wavelenght: unknown key; did you mean wavelength?"),
        ("kind = 'glossy'\nbumps = { wavelength = 0 }", ".bumps: wrinkles 0.002 m high, 0.0 m long"),
        ("kind = 'glossy'\nbumps = { map = 'grey.png' }", ".bumps.height: missing; the scene file must have it"),
        ("kind = 'glossy'\nbumps = { map = 'none.png', height = 1 }", ".bumps.map: {folder}/none.png: "),
        ("kind = 'retroreflector'\nlobe = { kind = 'ggx', alpha = 1 }", ".lobe.kind: got 'ggx'; expected one of phong"),
        ("kind = 'glass'\nior = 0", ": index of refraction is 0.0; expected above 0"),
        ("kind = 'diffuse'", ".reflectance: missing; the scene file must have it"),
        (
            "kind = 'diffuse'\ncolour = 0.5",
            ".reflectance: missing; the scene file must have it; materials.ball.colour: unknown key; remove it or see",
        ),
        ("kind = 'ward'\nroughness = 0.1", ".reflectance: missing; the scene file must have it; materials.ball.rough"),
        ("kind = 'diffuse'\nreflectance = [2, 0, 0]", ": reflectance is [2.0, 0.0, 0.0]; expected three numbers from"),
        ("kind = 'pbr'\npreset = 'gould'", ".preset: no preset 'gould'; the presets are "),
        ("kind = 'pbr'\nalpha_x = 0.1", ": alpha_x: a glTF material has none; it has "),
        ("kind = 'pbr'\npreset = 'rolled_brass'\nroughness = 0.5", ": roughness: a Ward surface has none; it has "),
        (
            "kind = 'pbr'\npreset = 'rolled_brass'\nbase_color = [1, 0, 0]",
            ": base_color: a Ward surface has none; give",
        ),
        ("kind = 'pbr'\nroughness = 2", ".roughness: input should be less than or equal to 1 (got 2)"),
        ("kind = 'pbr'\nbase_color = [2, 0, 0]", ": base_color of material 'ball' is [2.0, 0.0, 0.0]; expected 0 to 1"),
    ],
)
def test_a_fault_of_a_material_is_one_line_with_its_key(folder: Path, material: str, line: str) -> None:
    text = f"{HEAD}[materials.ball]\n{material}\n{BALL}"
    assert refusal(folder, text).startswith("materials.ball" + line.format(folder=folder))


def test_files_that_are_missing_or_of_no_use_are_named_with_their_key(folder: Path) -> None:
    assert refusal(folder, HEAD.replace("light.exr", "none.exr") + CHROME + BALL).startswith("light.map: ")
    assert "none.exr" in refusal(folder, HEAD.replace("light.exr", "none.exr") + CHROME + BALL)
    assert "a photograph where" in refusal(folder, HEAD.replace("light.exr", "grey.png") + CHROME + BALL)
    files.write(folder / "square.exr", RadianceMap(np.ones((4, 4, 3), np.float32)))
    line = refusal(folder, HEAD.replace("light.exr", "square.exr") + CHROME + BALL)
    assert line.startswith(f"light.map: {folder / 'square.exr'}: a map of 4×4 pixels does not say its mapping")
    line = refusal(folder, HEAD + '[[objects]]\nmesh = "none.obj"')
    assert line == f"objects.0.mesh: {folder / 'none.obj'}: no such mesh file; check the path"


def test_an_image_on_a_mesh_without_texture_coordinates_is_reported(folder: Path) -> None:
    material = '[materials.ball]\nkind = "glossy"\nbumps = { map = "grey.png", height = 0.1 }\n'
    line = refusal(folder, HEAD + material + '[[objects]]\nmesh = "plain.obj"\nmaterial = "ball"\n')
    assert line.startswith("objects.0.material: 'ball' has an image, and mesh ") and "no texture coordinates" in line


def test_a_missing_scene_file_and_a_mesh_without_light_are_reported(folder: Path) -> None:
    with pytest.raises(InvalidScene, match="no such scene file"):
        read_scene(folder / "none.toml")
    with pytest.raises(UnreadableFile, match=r"none\.obj: no such mesh file"):
        scene_of_mesh(folder / "none.obj", folder / "light.exr")
    files.write(folder / "square.exr", RadianceMap(np.ones((4, 4, 3), np.float32)))
    with pytest.raises(InvalidScene, match=r"square\.exr: a map of 4×4 pixels"):
        scene_of_mesh(folder / "plain.obj", folder / "square.exr")


def test_a_material_may_bear_the_name_of_a_key(folder: Path) -> None:
    text = HEAD + "[materials.kind]\nkind = 'glossy'\ndifuse = [1, 1, 1]\n"
    assert refusal(folder, text) == "materials.kind.difuse: unknown key; did you mean diffuse?"
