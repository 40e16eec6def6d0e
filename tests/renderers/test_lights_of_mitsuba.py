"""Lights and shapes that Mitsuba is handed: what a diffuse plane shows of them by formula, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lights
from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.lights import AmbientLight, DistantLight, Light, Linear, PointLight, Unattenuated
from relume.scene.materials.materials import Diffuse
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Patches, Plane, Polygon, Shape, Sphere
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap

PAINT = Diffuse((0.6, 0.4, 0.2))
RHO = np.array(PAINT.reflectance)
FLOOR = Plane(PAINT, (20.0, 20.0))
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
# A narrow look at the points [2, 0, −1] from above.
SEEN = np.array([2.0, 0.0, -1.0])
CAMERA = Camera.looking_at(SEEN + np.array([0.5, 3.0, 0.5]), SEEN, width=3, height=3, focal_length=3000)
STRENGTH_1 = (np.pi, np.pi, np.pi)
FAST = Mitsuba(samples=4, threads=1)


def shown(*own: Light, shapes: tuple[Shape, ...] = (FLOOR,), light: EnvironmentMap = BLACK) -> np.ndarray:
    """The radiance of the middle pixel, which looks at `SEEN`."""
    return render(Scene(light, local=shapes, lights=own), CAMERA, FAST).radiance[1, 1]


def test_a_diffuse_plane_shows_a_distant_light_as_its_irradiance_and_the_cosine_say():
    light = DistantLight((1.0, 2.0, -2.0), (3.0, 6.0, 9.0))  # of length 3, so the cosine is 2/3
    np.testing.assert_allclose(shown(light), RHO * (3.0, 6.0, 9.0) / np.pi * 2 / 3, rtol=1e-4)
    assert shown(light)[0] == pytest.approx(0.381972, rel=1e-4)


def test_a_diffuse_plane_shows_a_point_of_light_by_the_cosine_and_the_square_of_the_distance():
    light = PointLight((4.0, 4.0, 3.0), (10.0, 20.0, 30.0))  # 6 metres from what is seen, 4 above
    np.testing.assert_allclose(shown(light), RHO * (10.0, 20.0, 30.0) * (4 / 6) / (np.pi * 36), rtol=1e-3)
    assert shown(light)[2] == pytest.approx(0.0353678, rel=1e-3)


def test_lights_add_up_and_add_to_the_map():
    sun, lamp = DistantLight((0.0, 1.0, 0.0), (1.0, 1.0, 1.0)), PointLight((2.0, 2.0, -1.0), (3.0, 4.0, 5.0))
    # Under a sky of 0.5 alone, half the reflectance is seen.
    expected = RHO / 2 + shown(sun) + shown(lamp)
    # Mitsuba takes one of its lights for each ray, by chance.
    scene = Scene(lights.constant(16, 0.5), local=(FLOOR,), lights=(sun, lamp))
    both = render(scene, CAMERA, replace(FAST, samples=4096))
    allowed = 5 * np.sqrt(both.variance[1, 1])
    assert np.all(np.abs(both.radiance[1, 1] - expected) < allowed)
    assert np.all(allowed < 0.2 * shown(lamp)) and np.all(allowed < 0.2 * shown(sun))


def test_what_stands_between_a_light_and_a_surface_throws_a_shadow():
    light = PointLight((2.0, 4.0, -1.0), (10.0, 10.0, 10.0))
    ball = Sphere((2.0, 3.5, -1.0), 0.3, PAINT)
    assert shown(light).min() > 0
    assert shown(light, shapes=(FLOOR, ball)).max() == 0


def test_a_polygon_that_is_not_convex_is_seen_where_it_is_and_not_in_its_notch():
    # A chevron: of the square from −1 to 1 the notch from the right to the middle is missing.
    outline = np.array([[-1, -1, 0], [1, -1, 0], [0, 0, 0], [1, 1, 0], [-1, 1, 0]], float)
    camera = Camera(64, 64, 128.0, np.array([0, 0, 4.0]), np.eye(3))  # a metre is 32 pixels
    scene = Scene(BLACK, objects=(Polygon(outline, PAINT),), lights=(DistantLight((0, 0, 1), STRENGTH_1),))
    picture = render(scene, camera, FAST)
    assert picture.matte.mean() == pytest.approx(0.75, abs=0.01)
    notch = picture.radiance[24:40, 56:]
    assert notch.max() == 0
    np.testing.assert_allclose(picture.radiance[2:62, 4:28], np.broadcast_to(RHO, (60, 24, 3)), rtol=1e-4)


def test_a_patch_is_seen_as_the_surface_that_it_is():
    # z = 1 − 4(x² + y²) over the square from −½ to ½, exactly a patch: its control points by blossoming.
    grid = np.arange(4) / 3 - 0.5
    square = np.array([0.25, -1 / 12, -1 / 12, 0.25])  # of x² at x = ±½, and the two between
    x, y = np.meshgrid(grid, grid, indexing="ij")
    control = np.stack([x, y, 1 - 4 * np.add.outer(square, square)], axis=-1)
    camera = Camera(32, 32, 1e5, np.array([0, 0, 3126.0]), np.eye(3))  # all but orthographic, a metre is 32 pixels
    scene = Scene(BLACK, objects=(Patches(control[None], PAINT),), lights=(DistantLight((0, 0, 1), STRENGTH_1),))
    picture = render(scene, camera, replace(FAST, samples=64))
    middle = (np.arange(32) + 0.5) / 32 - 0.5
    across, up = np.meshgrid(middle, -middle)
    normal = normalised(np.stack([8 * across, 8 * up, np.ones_like(up)], axis=-1))
    inside = np.s_[1:-1, 1:-1]  # what lies at the border is not covered whole
    # A pixel's 64 rays fall anywhere in it, and the cosine changes by up to 0.1 across it.
    np.testing.assert_allclose(picture.radiance[inside], (RHO * normal[..., 2:])[inside], atol=6e-3)
    np.testing.assert_allclose(picture.normal[inside], normal[inside], atol=0.02)


@pytest.mark.parametrize(
    ("light", "line"),
    [
        (AmbientLight((0.1, 0.1, 0.1)), "Mitsuba has no ambient light"),
        (PointLight((0, 1, 0), (1, 1, 1), Unattenuated()), "fall with the square of the distance"),
        (PointLight((0, 1, 0), (1, 1, 1), Linear(5)), "fall with the square of the distance"),
    ],
)
def test_light_that_is_no_physics_is_refused_with_the_renderer_that_has_it(light: Light, line: str):
    with pytest.raises(UnsupportedScene, match=line) as caught:
        shown(light)
    assert "rl.Whitted (--renderer whitted)" in str(caught.value) and "\n" not in str(caught.value)


def test_a_whitted_material_is_refused_by_its_name():
    floor = Plane(WhittedMaterial((0.5, 0.5, 0.5), name="floor"))
    with pytest.raises(UnsupportedScene, match="cannot shade the whitted material 'floor'"):
        shown(DistantLight((0, 1, 0), (1, 1, 1)), shapes=(floor,))
