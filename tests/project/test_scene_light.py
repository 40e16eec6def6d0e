"""What lights a scene file: near walls, lamps of a size, surfaces that shine, a medium; and the film for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.image.files import read_layers, write
from relume.image.radiance import RadianceMap
from relume.project.scene_file.metering import metered_scene
from relume.project.scene_file.rendering import render_scene
from relume.project.scene_file.settings import RenderSettings, renderer_name
from relume.scene.lights import RectangleLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.materials.media import Medium
from relume.scene.materials.reflective import Reflective
from relume.scene.scene import Box, Dome, Enclosure, Infinite
from relume.scene.shapes.shapes import Mesh, Plane, Sphere
from toml_files import refusal, scene_of

CAMERA = """
[camera]
size = [16, 12]
position = [0, 1, 4]
target = [0, 0, 0]
"""
CLAY = """
[materials.clay]
kind = "diffuse"
reflectance = 0.5
"""
BALL = """
[[objects]]
sphere = { centre = [0, 0, 0], radius = 0.5 }
material = "clay"
"""
LAMP = """
[materials.lamp]
kind = "pbr"
base_color = [0, 0, 0]
emission = [8, 8, 8]
"""
ROOM = 'distant = { shape = "box", low = [-5, -1, -5], high = [5, 4, 5] }\n'
LIT = "[light]\ncolour = 1\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path / "light.exr", RadianceMap(np.ones((8, 16, 3), np.float32)))
    (tmp_path / "room.obj").write_text("v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    return tmp_path


# Where light comes from


def test_light_comes_from_walls_as_in_shots(folder):
    def distant(words: str):
        scene = scene_of(folder, f'{CAMERA}[light]\nmap = "light.exr"\n{words}{CLAY}{BALL}').scene
        return scene.distant, scene.probe

    assert distant("") == (Infinite(), (0, 0, 0))
    assert distant(ROOM + "probe = [1, 0, 2]\n") == (Box((-5, -1, -5), (5, 4, 5)), (1, 0, 2))
    dome = 'distant = { shape = "dome", radius = 3, centre = [0, 1, 0] }\nprobe = [0, 0, 0]\n'
    assert distant(dome) == (Dome(3, (0, 1, 0)), (0, 0, 0))
    mesh, _ = distant('distant = { shape = "mesh", mesh = "room.obj" }\nprobe = [1, 1, 1]\n')
    assert isinstance(mesh, Enclosure) and len(mesh.faces) == 4


def test_a_rectangle_of_light_and_a_medium_are_read(folder):
    lamp = '[[lights]]\nkind = "rectangle"\nposition = [0, 2, 0]\ntowards = [0, -1, 0]\nup = [0, 0, 1]\nsize = [1, 2]\n'
    medium = "[medium]\nabsorption = 0.1\nscattering = [0.2, 0.3, 0.4]\nanisotropy = 0.5\n"
    scene = scene_of(folder, CAMERA + lamp + "radiance = 3\n" + medium + CLAY + BALL).scene
    assert scene.lights == (RectangleLight((0, 2, 0), (0, -1, 0), (1, 2), (3, 3, 3), (0, 0, 1)),)
    assert scene.medium == Medium((0.1, 0.1, 0.1), (0.2, 0.3, 0.4), 0.5)


def test_real_surfaces_are_of_any_shape_and_material(folder):
    materials = f'{CLAY}[materials.gold]\nkind = "pbr"\npreset = "gold"\n[materials.chrome]\nkind = "mirror"\n'
    local = """
[[local]]
shape = "plane"
material = "chrome"
[[local]]
shape = "plane"
size = [2, 2]
rotate = [0, 0, 90]
translate = [1, 0, 0]
material = "clay"
[[local]]
shape = "box"
low = [0, 0, 0]
high = [1, 1, 1]
material = "gold"
[[local]]
shape = "sphere"
centre = [0, 1, 0]
radius = 1
reflectance = [0.1, 0.2, 0.3]
[[local]]
shape = "mesh"
mesh = "room.obj"
"""
    floor, wall, box, ball, mesh = scene_of(folder, CAMERA + LIT + materials + local).scene.local
    assert isinstance(floor, Plane) and isinstance(floor.material, Reflective)
    assert isinstance(wall, Mesh) and wall.vertices[:, 0] == pytest.approx([1, 1, 1, 1])
    assert isinstance(box, Mesh) and isinstance(box.material, Material) and box.material.metallic == 1
    assert isinstance(ball, Sphere) and isinstance(ball.material, Diffuse)
    assert ball.material.reflectance == (0.1, 0.2, 0.3)
    assert isinstance(mesh, Mesh) and isinstance(mesh.material, Material)  # its own


def test_a_surface_may_shine_by_an_image(folder):
    picture = np.zeros((2, 4, 3), np.float32)
    picture[0, 0] = 700.0
    write(folder / "glow.exr", RadianceMap(picture))
    text = CAMERA + '[materials.clay]\nkind = "pbr"\nemission = "glow.exr"\n' + BALL
    (ball,) = scene_of(folder, text).scene.objects
    assert isinstance(ball.material, Material)
    np.testing.assert_array_equal(ball.material.emission, picture)
    line = refusal(folder, text.replace("glow.exr", "none.exr"))
    assert line.startswith("materials.clay.emission: ")


# The film for it


def square(height: float, side: float, material: str = "lamp") -> str:
    return (
        f'[[local]]\nshape = "plane"\nsize = [{side}, {side}]\nrotate = [180, 0, 0]\ntranslate = [0, {height}, 0]\n'
        f'material = "{material}"\n'
    )


def test_a_lamp_that_is_a_surface_is_metered_as_one_that_is_a_light(folder):
    glow = metered_scene(scene_of(folder, CAMERA + LAMP + CLAY + BALL + square(1, 2)).scene).exposure
    lamp = '[[lights]]\nkind = "rectangle"\nposition = [0, 1, 0]\ntowards = [0, -1, 0]\nup = [0, 0, 1]\nsize = [2, 2]\n'
    light = metered_scene(scene_of(folder, CAMERA + lamp + "radiance = 8\n" + CLAY + BALL).scene).exposure
    # The form factor of a square to a card one half of its side away (Howell, A-1 to a corner, four times).
    corner = 1 / np.sqrt(2)
    share = 4 * (2 * corner * np.arctan(corner)) / (2 * np.pi)
    assert glow == pytest.approx(1 / (8 * share)) and light == pytest.approx(glow)
    # From behind nothing is seen of it, and far away it is a point of L·A/π d².
    assert metered_scene(scene_of(folder, CAMERA + LAMP + CLAY + BALL + square(-1, 2)).scene).exposure == 1
    far = metered_scene(scene_of(folder, CAMERA + LAMP + CLAY + BALL + square(100, 2)).scene).exposure
    assert far == pytest.approx(np.pi * 100**2 / (8 * 4), rel=1e-3)


def test_a_room_lit_by_its_ceiling_shows_a_white_card_white(folder):
    """The card lies in the middle, where the light meter is, and little else is there to send it light."""
    card = '[materials.card]\nkind = "diffuse"\nreflectance = 1\n[[objects]]\nmaterial = "card"\n'
    card += "polygon = [[-0.1, 0, 0.1], [0.1, 0, 0.1], [0.1, 0, -0.1], [-0.1, 0, -0.1]]\n"
    black = '[materials.black]\nkind = "diffuse"\nreflectance = 0\n[[local]]\nshape = "plane"\nheight = -1\n'
    text = CAMERA.replace("[0, 1, 4]", "[0, 0.5, 0.3]") + LAMP + card + black + 'material = "black"\n' + square(1, 2)
    found = scene_of(folder, text)
    assert renderer_name(found, RenderSettings()) == "mitsuba"
    render_scene(found, folder / "card.exr", RenderSettings(samples=256))
    layers = read_layers(folder / "card.exr")
    white = layers["radiance"][layers["matte"] == 1].mean() * metered_scene(found.scene).exposure
    assert white == pytest.approx(1, rel=0.03)


def test_the_cornell_box_of_the_examples_is_lit_by_its_ceiling(folder):
    from relume.project.scene_file.scene_file import read_scene

    found = read_scene(Path(__file__).parents[2] / "examples/cornell_box/cornell_box.toml", size=(32, 32))
    assert not found.scene.lights and not found.scene.light.radiance.any()
    render_scene(found, folder / "box.exr", RenderSettings(samples=64))
    shown = read_layers(folder / "box.exr")["radiance"] * metered_scene(found.scene).exposure
    # Neither dark nor burnt out; red to the left, green to the right.
    assert 0.1 < np.median(shown) < 1
    assert shown[16, 2, 0] > 3 * shown[16, 2, 1] and shown[16, 29, 1] > 1.5 * shown[16, 29, 0]


# What is refused


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (CAMERA + LIT + ROOM + CLAY + BALL, "light: a near distant scene needs probe = [x, y, z]"),
        (CAMERA + LIT + "probe = [0, 0, 0]\n" + CLAY + BALL, "light: has probe, but the light is alike everywhere"),
        (CAMERA + LIT + ROOM + "probe = [9, 0, 0]\n" + CLAY + BALL, "light.probe: "),
        (CAMERA + CLAY + BALL, "light: missing, and there are neither [[lights]] nor a pbr material with emission"),
        (CAMERA + LIT + "[medium]\nscattering = -1\n" + CLAY + BALL, "medium: scattering of the medium is [-1.0"),
        (CAMERA + LIT + CLAY + '[[local]]\nshape = "box"\nmaterial = "clay"', "local.0: a box needs low and high"),
        (CAMERA + LIT + '[[local]]\nshape = "sphere"\ncentre = [0, 0, 0]\nradius = 1', "local.0: has neither; give"),
        (
            CAMERA + '[[lights]]\nkind = "rectangle"\nposition = [0, 1, 0]\ntowards = [0, 0, 0]\nsize = [1, 1]\n'
            "radiance = 1\n" + CLAY + BALL,
            "lights.0: a rectangle of light faces",
        ),
    ],
)  # fmt: skip
def test_a_fault_is_one_line_with_its_key(folder, text, line):
    assert refusal(folder, text).startswith(line)
