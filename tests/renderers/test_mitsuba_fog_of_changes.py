"""Objects in fog: dimmed by it, lit through it, their shadows in it; nothing changes where no object is."""

from __future__ import annotations

import numpy as np
import pytest

from lights import constant
from montecarlo import assert_change_is_the_difference
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.scene.cameras.camera import Camera
from relume.scene.lights import PointLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.materials.media import Medium
from relume.scene.scene import Box, Scene
from relume.scene.shapes.shapes import Plane, Polygon, Sphere
from relume.sphere.environment_map import EnvironmentMap

pytestmark = pytest.mark.usefixtures("mi")
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
FLOOR = Plane(Diffuse((0.6, 0.4, 0.2)), (4.0, 4.0))
POINT = PointLight((0.3, 1.6, -0.4), (5.0, 5.0, 5.0))
FOG = Medium((0.02, 0.02, 0.02), (0.3, 0.25, 0.2), 0.3)
CAMERA = Camera.looking_at(np.array([0.2, 0.9, 2.2]), np.array([0.1, 0.5, 0]), width=24, height=16, focal_length=20)
MIRROR = Material((0.9, 0.8, 0.7), metallic=1.0, roughness=0.0)
WALL = Polygon(np.array([[-1.2, 0.0, -0.9], [1.2, 0.0, -0.9], [1.2, 1.5, -0.9], [-1.2, 1.5, -0.9]]), MIRROR)
GLASS = Material(roughness=0.0, transmission=1.0)


@pytest.mark.parametrize(
    ("grounds", "material", "samples", "whole", "most"),
    [
        pytest.param((FLOOR,), Diffuse((0.3, 0.5, 0.7)), 256, 1024, 0.12, id="matte"),
        # The caustic in the fog: 0.0020 at 256 and 1024 samples.
        pytest.param((FLOOR,), GLASS, 1024, 4096, 0.15, id="glass", marks=pytest.mark.slow),
        pytest.param(
            (FLOOR, WALL), Diffuse((0.3, 0.5, 0.7)), 256, 1024, 0.12, id="real mirror", marks=pytest.mark.slow
        ),
    ],
)
def test_the_change_is_the_difference_of_whole_pictures(grounds, material, samples, whole, most):
    scene = Scene(BLACK, grounds, (Sphere((0.25, 0.8, -0.3), 0.25, material),), (POINT,), medium=FOG)
    change = Differential(samples).change(scene, CAMERA, seed=1)
    with_, without = (Mitsuba(whole).render(each, CAMERA, seed=2) for each in (scene, scene.without_objects()))
    assert_change_is_the_difference(change, with_, without, most=most)


def test_an_object_is_dimmed_by_beer_and_lamberts_law():
    room, haze = Box((-3.0, -1.0, -3.0), (3.0, 3.0, 3.0)), Medium((0.5, 0.2, 0.05))
    glow = Material((0.0, 0.0, 0.0), specular=0.0, emission=(2.0, 2.0, 2.0))
    ball = Sphere((0.0, 1.0, -1.0), 0.5, glow)
    camera = Camera.looking_at(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 0]), width=2, height=2, focal_length=3000)
    scene = Scene(constant(8, (1.0, 1.0, 1.0)), objects=(ball,), distant=room, medium=haze)
    change = Differential(16).change(scene, camera, seed=1)
    np.testing.assert_allclose(change.objects.mean((0, 1)), 2 * np.exp(-2.5 * np.array(haze.absorption)), rtol=5e-3)


def test_a_beam_of_shadow_is_the_light_that_the_fog_no_longer_scatters():
    # So thin that nothing is scattered twice: a black ball hides a point from a stretch of the ray behind it.
    thin = Medium((0.0, 0.0, 0.0), (1e-3, 2e-3, 4e-3))
    black = Diffuse((0.0, 0.0, 0.0))
    lamp = PointLight((0.0, 3.0, 0.0), (10.0, 10.0, 10.0))
    ball = Sphere((0.0, 2.0, 0.0), 0.4, black)
    eye = np.array([0.0, 1.0, 3.0])
    camera = Camera.looking_at(eye, eye - [0, 0, 1], width=4, height=4, focal_length=30000)
    stop = Sphere((0.0, 1.0, -3.0), 0.5, black)
    # The fog reaches as far as shapes do.
    beside = Sphere((3.0, 1.0, 2.5), 0.1, black)
    change = Differential(2048).change(Scene(BLACK, (stop, beside), (ball,), (lamp,), medium=thin), camera, seed=1)
    # The cone about the ball: tan α = r / √(d² − r²), 2 m below the lamp on the ray.
    half = 2 * 0.4 / np.sqrt(1 - 0.4**2)
    hidden = 10 * np.arctan(half / 2) / (4 * np.pi)
    np.testing.assert_allclose(change.difference.mean((0, 1)), -hidden * np.array(thin.scattering), rtol=0.02)


def test_what_no_object_changes_is_0_to_the_bit():
    below = Sphere((0.0, -0.5, 0.0), 0.3, Diffuse((0.5, 0.5, 0.5)))
    room = Box((-2.5, -0.001, -2.5), (2.5, 2.5, 2.5))
    deep = Box((-2.5, -1.0, -2.5), (2.5, 2.5, 2.5))
    assert room.low != deep.low
    scene = Scene(
        constant(8, (1.0, 1.0, 1.0)), (Plane(FLOOR.material, (5.1, 5.1)),), (below,), (POINT,), deep, medium=FOG
    )
    change = Differential(16).change(scene, CAMERA, seed=1)
    assert not np.any(change.difference)
    assert not np.any(change.objects)
