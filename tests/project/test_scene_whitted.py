"""What a scene file says for Whitted's trees: lights, materials, polygons, patches, orbits and the renderer itself."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.project.scene_file.scene_file import read_scene, scene_of_mesh
from relume.renderers.whitted.antialiasing import Antialiasing
from relume.renderers.whitted.whitted import Whitted
from relume.scene.lights import AmbientLight, DistantLight, Light, Linear, PointLight, SquareLaw, Unattenuated
from relume.scene.materials.bumps import Wrinkles
from relume.scene.materials.materials import Diffuse
from relume.scene.materials.whitted import Checks, WhittedMaterial
from relume.scene.shapes.shapes import Mesh, Patches, Polygon, Sphere
from toml_files import SCENE_CAMERA as CAMERA
from toml_files import refusal, scene_of

SUN = '[[lights]]\nkind = "distant"\ntowards = [1, 1, 1]\nirradiance = 3\n'
BLOB = '[materials.blob]\nkind = "whitted"\n'
BALL = '[[objects]]\nsphere = { centre = [0, 0.5, 0], radius = 0.5 }\nmaterial = "blob"\n'
HEAD = CAMERA + SUN
PATCH = "1\n3 3\n" + "".join(f"{i} {j} {i * j}\n" for i in range(4) for j in range(4))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a light map, a mesh, an image and a patch."""
    files.write(tmp_path / "light.exr", RadianceMap(np.full((8, 16, 3), 2.0, np.float32)))
    (tmp_path / "plain.obj").write_text("v 0 1 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n")
    (tmp_path / "sheet.bpt").write_text(PATCH)
    files.write(tmp_path / "grey.png", Photograph(np.full((2, 2, 3), 188, np.uint8)))
    return tmp_path


def light_of(folder: Path, table: str) -> Light:
    return scene_of(folder, f"{CAMERA}[[lights]]\n{table}\n{BLOB}{BALL}").scene.lights[0]


def blob_of(folder: Path, keys: str) -> WhittedMaterial:
    material = scene_of(folder, f"{HEAD}{BLOB}{keys}\n{BALL}").scene.objects[0].material
    assert isinstance(material, WhittedMaterial) and material.name == "blob"
    return material


def whitted_of(folder: Path, keys: str) -> Whitted:
    found = scene_of(folder, f"{HEAD}{BLOB}{BALL}[whitted]\n{keys}\n")
    assert found.asks_whitted
    return found.whitted


# What is read


def test_the_second_example_in_the_docs_is_a_scene_file(folder: Path) -> None:
    page = (Path(__file__).parents[2] / "docs/reference/scene-file.md").read_text(encoding="utf-8")
    found = scene_of(folder, re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[1])
    assert len(found.scene.lights) == 2 and len(found.scene.objects) == 2 and found.moves
    assert found.whitted == Whitted(depth=6, constellation=0)


@pytest.mark.parametrize("name", ["figure_6", "figure_7", "figure_8", "sequence"])
def test_the_examples_are_scene_files_for_whitted(name: str) -> None:
    found = read_scene(Path(__file__).parents[2] / f"examples/whitted/{name}.toml")
    assert found.asks_whitted and found.scene.lights
    assert found.moves == (name == "sequence")


def test_a_light_of_one_colour_is_the_same_from_everywhere(folder: Path) -> None:
    light = scene_of(folder, CAMERA + "[light]\ncolour = [0.2, 0.3, 0.5]\nscale = 2\n" + BLOB + BALL).scene.light
    assert light.radiance.shape == (4, 8, 3)
    np.testing.assert_allclose(light.radiance, np.broadcast_to([0.4, 0.6, 1.0], (4, 8, 3)), rtol=1e-6)
    grey = scene_of(folder, CAMERA + "[light]\ncolour = 0.5\n" + BLOB + BALL).scene.light
    assert np.all(grey.radiance == 0.5)


def test_lights_alone_are_before_black(folder: Path) -> None:
    scene = scene_of(folder, HEAD + BLOB + BALL).scene
    assert scene.light.size <= 16 and not scene.light.radiance.any()
    assert scene.lights == (DistantLight((1, 1, 1), (3, 3, 3)),)


def test_lights_stand_in_the_order_of_the_file_and_beside_a_map(folder: Path) -> None:
    more = '[[lights]]\nkind = "ambient"\nradiance = [0.1, 0.2, 0.3]\n'
    scene = scene_of(folder, HEAD + more + '[light]\nmap = "light.exr"\n' + BLOB + BALL).scene
    assert scene.lights == (DistantLight((1, 1, 1), (3, 3, 3)), AmbientLight((0.1, 0.2, 0.3)))
    assert scene.light.radiance.max() == 2


@pytest.mark.parametrize(
    ("falloff", "law"),
    [
        ("", SquareLaw()),
        ('falloff = "square"', SquareLaw()),
        ('falloff = "none"', Unattenuated()),
        ("falloff = { linear = 40 }", Linear(40)),
    ],
)
def test_a_point_of_light_falls_with_the_square_unless_asked(folder: Path, falloff: str, law: object) -> None:
    light = light_of(folder, f'kind = "point"\nposition = [1, 2, 3]\nintensity = [4, 5, 6]\n{falloff}')
    assert light == PointLight((1, 2, 3), (4, 5, 6), law)  # type: ignore[arg-type]


def test_a_material_of_whitted_is_as_in_python_unless_asked(folder: Path) -> None:
    found, plain = blob_of(folder, ""), WhittedMaterial(name="blob")
    names = (
        "diffuse", "specular", "transmission", "ambient", "highlight", "exponent", "ior", "fresnel", "coated",
        "roughness", "bumps",
    )  # fmt: skip
    assert [getattr(found, name) for name in names] == [getattr(plain, name) for name in names]


def test_a_material_of_whitted_with_everything_reported(folder: Path) -> None:
    found = blob_of(
        folder,
        """diffuse = [0.3, 0.1, 0.1]
        specular = 0.2
        transmission = [0.1, 0.2, 0.3]
        ambient = [0.4, 0.5, 0.6]
        highlight = 0.7
        exponent = 80
        ior = 1.33
        fresnel = true
        coated = true
        roughness = 0.05
        bumps = { height = 0.003, wavelength = 0.04, seed = 7 }""",
    )
    assert (found.diffuse, found.specular, found.transmission) == ((0.3, 0.1, 0.1), (0.2,) * 3, (0.1, 0.2, 0.3))
    assert (found.ambient, found.highlight, found.exponent, found.ior) == ((0.4, 0.5, 0.6), (0.7,) * 3, 80, 1.33)
    assert (found.fresnel, found.coated, found.roughness) == (True, True, 0.05)
    assert found.bumps == Wrinkles(0.003, 0.04, 7)


def test_paint_is_a_grey_checks_or_an_image(folder: Path) -> None:
    assert blob_of(folder, "diffuse = 0.5").diffuse == (0.5, 0.5, 0.5)
    checks = blob_of(folder, "diffuse = { checks = [[1, 1, 0], 0.25], size = 0.5 }").diffuse
    assert checks == Checks((1, 1, 0), (0.25, 0.25, 0.25), 0.5)
    assert blob_of(folder, "diffuse = { checks = [1, 0] }").diffuse == Checks()
    image = blob_of(folder, 'diffuse = "grey.png"').diffuse
    assert isinstance(image, np.ndarray) and image.shape == (2, 2, 3)
    assert image == pytest.approx(0.502886, abs=1e-5)  # sRGB 188 of 255


def test_a_material_that_creates_energy_is_reported_and_used(folder: Path) -> None:
    with pytest.warns(UserWarning, match="'blob' creates energy"):
        assert blob_of(folder, "diffuse = 0.6\nspecular = 0.6").specular == (0.6, 0.6, 0.6)


def test_a_polygon_stands_as_it_is_given(folder: Path) -> None:
    text = '[[objects]]\npolygon = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]\nmaterial = "blob"\n'
    (polygon,) = scene_of(folder, HEAD + BLOB + text).scene.objects
    assert isinstance(polygon, Polygon) and polygon.name == "objects.0"
    assert polygon.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]] and polygon.vertices.dtype == np.float64


def test_patches_are_scaled_turned_and_moved_as_a_mesh(folder: Path) -> None:
    sheet = '[[objects]]\npatches = "sheet.bpt"\nmaterial = "blob"\n'
    (sheet,) = scene_of(
        folder, HEAD + BLOB + sheet + "scale = 2\nrotate = [90, 0, 0]\ntranslate = [10, 0, 0]"
    ).scene.objects
    assert isinstance(sheet, Patches) and sheet.control.shape == (1, 4, 4, 3) and sheet.control.dtype == np.float64
    # By a quarter about x, y goes to z and z to −y.
    points = {tuple(point) for point in sheet.control.reshape(16, 3).round(9) + 0.0}
    assert points == {(10 + 2 * i, -2 * i * j, 2 * j) for i in range(4) for j in range(4)}


def test_a_plane_takes_a_material_of_whitted_and_a_diffuse_one(folder: Path) -> None:
    floor = '[[local]]\nshape = "plane"\nmaterial = "blob"\nsize = [2, 3]\n'
    clay = '[materials.clay]\nkind = "diffuse"\nreflectance = [0.1, 0.2, 0.3]\n'
    wall = '[[local]]\nshape = "plane"\nmaterial = "clay"\n'
    first, second = scene_of(folder, HEAD + BLOB + clay + floor + wall).scene.local
    assert isinstance(first.material, WhittedMaterial) and getattr(first, "size", None) == (2, 3)
    assert second.material == Diffuse((0.1, 0.2, 0.3))


def test_objects_go_round_and_the_others_stay(folder: Path) -> None:
    mesh = '[[objects]]\nmesh = "plain.obj"\norbit = { centre = [1, 0, 0] }\n'
    round_ball = BALL.replace("[0, 0.5, 0]", "[3, 0.5, 0]") + "orbit = { centre = [1, 7, 0], turns = -1 }\n"
    found = scene_of(folder, HEAD + BLOB + BALL + mesh + round_ball)
    assert found.moves and len(found.orbits) == len(found.scene.objects) == 3
    quarter = found.at(0.25)
    still, body, ball = quarter.objects
    assert still is found.scene.objects[0]
    assert isinstance(body, Mesh) and isinstance(ball, Sphere)
    # Counter-clockwise from above +X goes to −Z, and +Z to +X; the ball goes the other way.
    np.testing.assert_allclose(body.vertices, [[1, 1, 1], [1, 0, 0], [2, 0, 1]], atol=1e-6)
    assert ball.centre == pytest.approx((1, 0.5, 2))
    assert quarter.lights == found.scene.lights and quarter.light is found.scene.light
    for a, b in zip(found.at(1.0).objects, found.scene.objects, strict=True):
        points = (a.centre, b.centre) if isinstance(a, Sphere) and isinstance(b, Sphere) else (0, 0)
        np.testing.assert_allclose(*points, atol=1e-12)


def test_what_does_not_move_is_the_same_scene_at_any_time(folder: Path) -> None:
    found = scene_of(folder, HEAD + BLOB + BALL)
    assert not found.moves and found.at(0.5) is found.scene
    mesh = scene_of_mesh(folder / "plain.obj", folder / "light.exr")
    assert not mesh.moves and mesh.at(0.5) is mesh.scene
    assert mesh.whitted == Whitted() and not mesh.asks_whitted


def test_the_renderer_is_whitted_unless_asked(folder: Path) -> None:
    found = scene_of(folder, HEAD + BLOB + BALL)
    assert found.whitted == Whitted() and not found.asks_whitted
    assert whitted_of(folder, "") == Whitted()


def test_the_renderer_with_everything_reported(folder: Path) -> None:
    found = whitted_of(
        folder,
        """depth = 5
        contribution = 0.001
        attenuation = { linear = 40 }
        subdivisions = 2
        tolerance = 0.3
        constellation = 0
        rays = 9
        clear_shadows = false""",
    )
    assert found == Whitted(5, 0.001, Linear(40), Antialiasing(2, 0.3), 0, 9, False)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ("antialiasing = false", Whitted(antialiasing=None)),
        ("antialiasing = true\ntolerance = 0.2", Whitted(antialiasing=Antialiasing(tolerance=0.2))),
        ("subdivisions = 1", Whitted(antialiasing=Antialiasing(1))),
        ('attenuation = "square"', Whitted(attenuation=SquareLaw())),
        ('attenuation = "none"', Whitted(attenuation=Unattenuated())),
    ],
)
def test_the_renderer_with_something_reported(folder: Path, keys: str, expected: Whitted) -> None:
    assert whitted_of(folder, keys) == expected


def test_the_docs_say_the_renderers_defaults() -> None:
    page = (Path(__file__).parents[2] / "docs/reference/scene-file.md").read_text(encoding="utf-8")
    table = page.partition("| `[whitted]` | meaning")[2].partition("\n\n")[0]
    said = {row.split("|")[1].strip(" `"): row.split("|")[3].strip(" `") for row in table.splitlines()[2:]}
    plain, finer = Whitted(), Antialiasing()
    assert plain.antialiasing == finer and plain.attenuation == Unattenuated()
    assert said == {
        "depth": f"{plain.depth}",
        "contribution": f"1/{1 / plain.contribution:g}",
        "attenuation": '"none"',
        "antialiasing": "true",
        "subdivisions`, `tolerance": f"{finer.subdivisions}, {finer.tolerance:g}",
        "constellation": f"{plain.constellation}",
        "rays": f"{plain.rays}",
        "clear_shadows": str(plain.clear_shadows).lower(),
    }


# What is refused


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (CAMERA + BLOB + BALL, "light: missing, and there are neither [[lights]] nor a pbr material with emission, so"),
        (
            CAMERA + "[light]\nmap = 'light.exr'\ncolour = 1\n" + BLOB + BALL,
            "light: has map and colour; give one of map",
        ),
        (
            CAMERA + "[light]\nscale = 2\n" + BLOB + BALL,
            "light: has none of them; give one of map, maps, probes, sky and colour",
        ),
        (CAMERA + "[light]\ncolour = 1\nturn = 3\n" + BLOB + BALL, "light: has turn, but a colour is the same from"),
        (CAMERA + "[light]\ncolour = -1\n" + BLOB + BALL, "light.colour: radiance holds negative or non-finite"),
        (CAMERA + "[light]\ncolour = 'red'\n" + BLOB + BALL, "light.colour: input should be a list (got"),
        (CAMERA + "[light]\ncolor = 1\n" + BLOB + BALL, "light.color: unknown key; did you mean colour?"),
        (CAMERA + "[lights]\n" + BLOB + BALL, "lights: input should be a valid list"),
        (HEAD + '[[lights]]\nkind = "spot"\n' + BLOB + BALL, "lights.1.kind: got 'spot'; expected one of point, dist"),
        (HEAD + "[[lights]]\n" + BLOB + BALL, "lights.1.kind: missing; the scene file must have it"),
        (HEAD + "colour = 3\n" + BLOB + BALL, "lights.0.colour: unknown key; remove it or see the docs"),
        (HEAD + "falloff = 'none'\n" + BLOB + BALL, "lights.0.falloff: unknown key; remove it or see the docs"),
        (HEAD.replace("irradiance = 3", "") + BLOB + BALL, "lights.0.irradiance: missing; the scene file must have"),
        (HEAD.replace("irradiance = 3", "irradiance = -3") + BLOB + BALL, "lights.0: irradiance of a distant light is"),
        (HEAD.replace("[1, 1, 1]", "[0, 0, 0]") + BLOB + BALL, "lights.0: direction of a distant light is (0.0, 0.0,"),
        (HEAD.replace("[1, 1, 1]", "3") + BLOB + BALL, "lights.0.towards: input should be a list (got 3)"),
        (HEAD + BLOB + BALL + "orbit = 3", "objects.0.orbit: input should be a table (got 3)"),
        (HEAD + BLOB + BALL + "orbit = { center = [0, 0, 0] }", "objects.0.orbit.center: unknown key; did you mean ce"),
        (HEAD + "[[objects]]\norbit = { turns = 1 }", "objects.0: has no shape; give one of sphere, mesh, polygon and"),
        (
            HEAD + BLOB + "[[objects]]\npolygon = [[0, 0, 0], [1, 0, 0]]\nmaterial = 'blob'",
            "objects.0.polygon: 'objects.0' has 2 vertices; expected three or more",
        ),
        (
            HEAD + BLOB + "[[objects]]\npolygon = []\nmaterial = 'blob'",
            "objects.0.polygon: 'objects.0' has 0 vertices; expected three or more",
        ),
        (
            HEAD + BLOB + "[[objects]]\npolygon = [[0, 0, 0], [1, 0], [1, 1, 1]]\nmaterial = 'blob'",
            "objects.0.polygon.1: too few numbers (got [1, 0])",
        ),
        (
            HEAD + "[[objects]]\npolygon = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]",
            "objects.0.material: missing; a polygon needs one, by its name in [materials]",
        ),
        (
            HEAD + BLOB + "[[objects]]\npolygon = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]\nmaterial = 'blob'\nscale = 2",
            "objects.0: has scale, but a polygon is placed by its vertices; remove scale",
        ),
        (HEAD + "[[objects]]\npatches = 'sheet.bpt'", "objects.0.material: missing; patches need one, by its name in"),
        (
            HEAD + BLOB + "[[objects]]\npatches = 'none.bpt'\nmaterial = 'blob'",
            "objects.0.patches: {folder}/none.bpt: no such file of patches; check the path",
        ),
        (
            HEAD + BLOB + "[[objects]]\npatches = 'plain.obj'\nmaterial = 'blob'",
            "objects.0.patches: {folder}/plain.obj: not a list of bicubic patches",
        ),
        (
            HEAD + "[[local]]\nshape = 'plane'\nmaterial = 'floor'",
            "local.0.material: no material 'floor'; define [materials.floor]",
        ),
        (
            HEAD + BLOB + "[[local]]\nshape = 'plane'\nmaterial = 'blob'\nreflectance = [0, 0, 0]",
            "local.0: has both; give one of reflectance and material",
        ),
        (
            HEAD + BLOB + "diffuse = 'grey.png'\n[[objects]]\nmesh = 'plain.obj'\nmaterial = 'blob'",
            "objects.0.material: 'blob' has an image, and mesh ",
        ),
    ],
)
def test_a_fault_is_one_line_with_its_key(folder: Path, text: str, line: str) -> None:
    assert refusal(folder, text).startswith(line.format(folder=folder))


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ("position = [0, 0, 0]", ".intensity: missing; the scene file must have it"),
        ("position = [0, 0, 0]\nintensity = [1, 1]", ".intensity: too few numbers (got [1, 1])"),
        ("position = [0, 0, 0]\nintensity = -1", ": intensity of a point light is (-1.0, -1.0, -1.0); expected three"),
        ("position = [0, 0, 0]\nintensity = nan", ".intensity: input should be a finite number (got nan)"),
        ("falloff = 'linear'", '.falloff: got \'linear\'; expected "square", "none" or {{ linear = REACH }}'),
        ("falloff = 3", '.falloff: got 3; expected "square", "none" or {{ linear = REACH }}'),
        ("falloff = {{ liner = 3 }}", ".falloff.liner: unknown key; did you mean linear?"),
        ("falloff = {{ linear = 0 }}", ".falloff: reach of linear attenuation is 0.0; expected a positive length"),
    ],
)
def test_a_fault_of_a_point_of_light_is_one_line_with_its_key(folder: Path, keys: str, line: str) -> None:
    if "position" not in keys:
        keys += "\nposition = [0, 0, 0]\nintensity = 1"
    text = f"{CAMERA}[[lights]]\nkind = 'point'\n{keys.format()}\n{BLOB}{BALL}"
    assert refusal(folder, text).startswith("lights.0" + line.format())


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ("difuse = 1", ".difuse: unknown key; did you mean diffuse?"),
        ("diffuse = [1, 2]", ".diffuse: too few numbers (got [1, 2])"),
        ("diffuse = -1", ": diffuse of material 'blob' is [-1.0, -1.0, -1.0]; expected finite numbers of 0 or more"),
        ("diffuse = 'none.png'", ".diffuse: {folder}/none.png: "),
        ("diffuse = true", ".diffuse: input should be a list (got True)"),
        ("diffuse = {{ checks = [1] }}", ".diffuse.checks: too few numbers (got [1])"),
        ("diffuse = {{ size = 1 }}", ".diffuse.checks: missing; the scene file must have it"),
        ("diffuse = {{ checks = [1, 0], sise = 1 }}", ".diffuse.sise: unknown key; did you mean size?"),
        ("diffuse = {{ checks = [1, 0], size = 0 }}", ".diffuse: size of checks is 0.0; expected a positive length"),
        ("specular = 'red'", ".specular: input should be a list (got 'red')"),
        ("highlight = [1, 1, -1]", ": highlight of material 'blob' is [1.0, 1.0, -1.0]"),
        ("exponent = 0", ": exponent of material 'blob' is 0.0; expected above 0, like 50"),
        ("ior = 0", ": ior of material 'blob' is 0.0; expected above 0, like 1.5 for glass"),
        ("roughness = -1", ": roughness of material 'blob' is -1.0; expected 0 or more"),
        ("fresnel = 'maybe'", ".fresnel: input should be a valid boolean"),
        ("bumps = {{ wavelength = 0 }}", ".bumps: wrinkles 0.002 m high, 0.0 m long"),
    ],
)
def test_a_fault_of_a_material_is_one_line_with_its_key(folder: Path, keys: str, line: str) -> None:
    text = f"{HEAD}{BLOB}{keys.format()}\n{BALL}"
    assert refusal(folder, text).startswith("materials.blob" + line.format(folder=folder))


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ("depht = 3", ".depht: unknown key; did you mean depth?"),
        ("depth = 0", ": depth is 0; expected a whole number from 1 to 1000"),
        ("depth = 1.5", ".depth: input should be a valid integer"),
        ("contribution = 1", ": contribution is 1.0; expected a share of the pixel from 0 to 1"),
        ("attenuation = 'quadratic'", '.attenuation: got \'quadratic\'; expected "square", "none" or {{ linear'),
        ("attenuation = {{ linear = -1 }}", ".attenuation: reach of linear attenuation is -1.0"),
        ("subdivisions = 9", ": subdivisions 9, tolerance "),
        ("antialiasing = false\ntolerance = 0.1", ": has tolerance, but antialiasing is false; remove one of them"),
        ("rays = 0", ": rays is 0; expected a whole number from 1 to 65536"),
        ("threads = 2", ".threads: unknown key"),
    ],
)
def test_a_fault_of_the_renderer_is_one_line_with_its_key(folder: Path, keys: str, line: str) -> None:
    text = f"{HEAD}{BLOB}{BALL}[whitted]\n{keys.format()}\n"
    assert refusal(folder, text).startswith("whitted" + line.format())
