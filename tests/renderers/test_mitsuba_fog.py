"""A medium between the bodies: what it absorbs, what it scatters towards the eye, where it ends, and who refuses it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from lights import constant
from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.prefiltered.prefiltered import Prefiltered
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight, PointLight, SphereLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.materials.media import Medium
from relume.scene.scene import Box, Scene
from relume.scene.shapes.shapes import Plane, Sphere
from relume.sphere.environment_map import EnvironmentMap

pytestmark = pytest.mark.usefixtures("mi")
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
RHO = np.array([0.6, 0.4, 0.2])
FLOOR = Plane(Diffuse((0.6, 0.4, 0.2)), (8.0, 8.0))
LAMP = PointLight((1.0, 2.0, 0.5), (10.0, 20.0, 30.0))
SEEN = np.array([0.5, 0.0, -0.5])
EYE = np.array([0.5, 1.5, 1.0])
NARROW = Camera.looking_at(EYE, SEEN, width=2, height=2, focal_length=3000)
HAZE = Medium((0.5, 0.2, 0.05))


def shown(scene: Scene, camera: Camera = NARROW, samples: int = 16, seed: int = 1) -> np.ndarray:
    return Mitsuba(samples).render(scene, camera, seed=seed).radiance.mean((0, 1))


def test_between_lamp_wall_and_eye_light_is_lost_by_beer_and_lamberts_law():
    way = np.array(LAMP.position) - SEEN
    distance = np.linalg.norm(way)
    lit = RHO / np.pi * np.array(LAMP.intensity) * way[1] / distance**3
    passed = np.exp(-np.array(HAZE.absorption) * (distance + np.linalg.norm(EYE - SEEN)))
    found = shown(Scene(BLACK, (FLOOR,), lights=(LAMP,), medium=HAZE))
    np.testing.assert_allclose(found, lit * passed, rtol=5e-3)
    assert found[0] == pytest.approx(0.034968, rel=1e-3)


def test_light_from_infinity_enters_at_the_sphere_about_everything():
    # A ball of 1 m above a floor whose corners are √32 m away: the medium is a sphere about both.
    medium, sun = Medium((0.1, 0.1, 0.1)), DistantLight((0.0, 1.0, 0.0), (np.pi, np.pi, np.pi))
    radius = np.sqrt(32)
    far = Camera.looking_at(np.array([2.0, 30.0, 1e-3]), np.array([2.0, 0, 0]), width=2, height=2, focal_length=30000)
    found = shown(Scene(BLACK, (FLOOR,), lights=(sun,), medium=medium), far)
    # Down to the floor and up again, beside the middle.
    way = np.sqrt(radius**2 - 2.0**2)
    np.testing.assert_allclose(found, RHO * np.exp(-0.1 * 2 * way), rtol=5e-3)


def test_a_near_distant_scene_ends_it():
    room, medium = Box((-2.0, -1.0, -2.0), (2.0, 3.0, 2.0)), Medium((0.3, 0.3, 0.3))
    ball = Sphere((0.0, 0.0, -1.5), 0.05, Diffuse((0.0, 0.0, 0.0)))
    up = Camera.looking_at(np.zeros(3), np.array([0, 1, 0.01]), width=2, height=2, focal_length=3000)
    scene = Scene(constant(8, (1.0, 2.0, 0.5)), objects=(ball,), distant=room, medium=medium)
    np.testing.assert_allclose(shown(scene, up), np.exp(-0.9) * np.array([1.0, 2.0, 0.5]), rtol=5e-3)


@pytest.mark.parametrize("g", [0.0, 0.6])
def test_a_thin_fog_shows_the_light_of_a_lamp_as_the_integral_along_the_ray_has_it(g):
    # So thin that nothing is scattered twice.
    medium = Medium((0.0, 0.0, 0.0), (1e-3, 2e-3, 4e-3), g)
    eye, ahead = np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.0, -1.0])
    camera = Camera.looking_at(eye, eye + ahead, width=4, height=4, focal_length=30000)
    ball = Sphere((0.0, 1.0, -3.0), 0.5, Diffuse((0.0, 0.0, 0.0)))
    scene = Scene(BLACK, objects=(ball,), lights=(PointLight((0.2, 1.5, 0.0), (10.0, 10.0, 10.0)),), medium=medium)

    def scattered(t: float) -> float:
        way = np.array([0.2, 1.5, 0.0]) - (eye + t * ahead)
        distance = np.linalg.norm(way)
        cosine = ahead @ way / distance
        return float(10.0 / distance**2 * (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5))

    # From where the fog begins to the ball.
    begins = entry(scene, eye, ahead)
    whole = quad(scattered, begins, 5.5, points=[3.0])[0]
    found = Mitsuba(4096).render(scene, camera, seed=2)
    expected = np.array(medium.scattering) * whole
    error = np.sqrt(found.variance.mean((0, 1)) / 16)
    assert np.all(error < 0.005 * expected)
    np.testing.assert_allclose(found.radiance.mean((0, 1)), expected, atol=4 * error.max() + 0.004 * expected.max())


def entry(scene: Scene, eye: np.ndarray, ahead: np.ndarray) -> float:
    """Where a ray enters a scene's fog."""
    from relume.renderers.raytrace.extent import sphere_round_all

    centre, radius = sphere_round_all(scene)
    along = (centre - eye) @ ahead
    return max(0.0, along - np.sqrt(radius**2 - np.sum((eye + along * ahead - centre) ** 2)))


def test_white_fog_in_a_furnace_is_not_seen():
    # Light is 1 everywhere: whatever is scattered, as much comes in.
    ball = Sphere((0.0, 0.0, 0.0), 1.0, Diffuse((1.0, 1.0, 1.0)))
    camera = Camera(4, 4, 8.0, np.array([0, 0, 4.0]), np.eye(3))
    fog = Medium((0.0, 0.0, 0.0), (0.5, 1.0, 1.5), 0.3)
    found = Mitsuba(512, depth=40).render(Scene(constant(8, (1, 1, 1)), objects=(ball,), medium=fog), camera)
    error = np.sqrt(found.variance.mean() / 16)
    assert error < 0.006
    assert abs(found.radiance.mean() - 1) < 4 * error


def test_a_lamp_is_seen_through_fog():
    lamp = SphereLight((0.0, 0.0, -2.0), 0.5, (8.0, 4.0, 2.0))
    camera = Camera(2, 2, 3000.0, np.zeros(3), np.eye(3))
    ball = Sphere((0.0, 3.0, 0.0), 0.5, Diffuse((0.0, 0.0, 0.0)))
    found = shown(Scene(BLACK, objects=(ball,), lights=(lamp,), medium=HAZE), camera)
    np.testing.assert_allclose(found, np.array(lamp.radiance) * np.exp(-1.5 * np.array(HAZE.absorption)), rtol=1e-3)


def test_smoke_in_a_ball_of_index_1_is_lit_by_a_point_and_throws_a_shadow_of_its_thickness():
    smoke = Material(
        roughness=0.0, transmission=1.0, ior=1.0, attenuation_color=(0.5, 0.25, 0.9), attenuation_distance=0.5
    )
    ball = Sphere((0.5, 1.0, -0.5), 0.25, smoke)
    over = PointLight((0.5, 2.0, -0.5), (10.0, 10.0, 10.0))
    beside = Camera.looking_at(np.array([2.5, 1.5, 1.0]), SEEN, width=2, height=2, focal_length=3000)
    # 0.5 m through the middle of the ball, from 2 m above.
    made = shown(Scene(BLACK, (FLOOR,), (ball,), (over,)), beside)
    np.testing.assert_allclose(made, RHO / np.pi * 10 / 4 * np.array([0.5, 0.25, 0.9]), rtol=5e-3)
    # What objects change: the light that is lost.
    change = Differential(16).change(Scene(BLACK, (FLOOR,), (ball,), (over,)), beside)
    lost = RHO / np.pi * 10 / 4 * (np.array([0.5, 0.25, 0.9]) - 1)
    np.testing.assert_allclose(change.difference.mean((0, 1)), lost, rtol=5e-3)


@pytest.mark.parametrize("renderer", [Whitted(), Prefiltered()])
def test_others_refuse_a_medium_between_bodies_in_one_line(renderer):
    scene = Scene(constant(8, (1, 1, 1)), objects=(Sphere((0.0, 0.0, -2.0), 0.5, Material()),), medium=HAZE)
    with pytest.raises(UnsupportedScene, match="medium") as caught:
        renderer.render(scene, replace(NARROW))
    assert "\n" not in str(caught.value)
