"""Simulated environments: what scenes of known light send to a point."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import lights
from relume.errors import UnsupportedScene
from relume.renderers.environment_probe import environment, face_camera
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.renderer import ConstantRenderer, Renderer, render
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.lights import AmbientLight, DistantLight, Linear, PointLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Sphere
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import CubeCross, Strip, VerticalCubeCross
from relume.sphere.mappings.discs import Angular, MirrorBall
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.sphere.mappings.squares import EqualArea

BLACK = lights.constant(4, 0.0)
DARK = ConstantRenderer((0.0, 0.0, 0.0))
GLOWING = WhittedMaterial(ambient=(1.0, 1.0, 1.0))
HERE = (0.3, 0.4, 0.5)


def moment(light: EnvironmentMap) -> np.ndarray:
    """The sum over all directions of red light, each times the direction."""
    red = light.radiance[..., 0] * LatLong().solid_angles(light.size)
    return np.einsum("hwd,hw->d", pixel_directions(LatLong(), light.size), red)


def test_the_same_light_from_all_sides_stays_the_same():
    light = environment(Scene(BLACK), HERE, ConstantRenderer((1.0, 2.0, 3.0)), size=48)
    np.testing.assert_allclose(light.radiance, np.broadcast_to([1, 2, 3], (48, 96, 3)), rtol=1e-5)


def test_the_faces_look_where_the_cross_has_them():
    for face in range(6):
        rays = face_camera(face, np.zeros(3), 4).rays()
        row, column = CubeCross.cells[face] * 4
        expected = pixel_directions(CubeCross(), 12)[row : row + 4, column : column + 4]
        np.testing.assert_allclose(rays, expected, atol=1e-12)


@dataclass(frozen=True)
class Recorder(Renderer):
    """Renders black, and remembers how wide the pictures are."""

    sides: list[int] = field(default_factory=list)

    def render(self, scene, camera, *, seed=0, progress=None):
        self.sides.append(camera.width)
        return DARK.render(scene, camera, seed=seed, progress=progress)


@pytest.mark.parametrize(
    ("mapping", "size", "side"),
    [
        (LatLong(), 96, 62),  # a horizon of 192 pixels: 96/π a radian
        (Strip(), 48, 48),
        (CubeCross(), 96, 32),
        (VerticalCubeCross(), 96, 24),
        (MirrorBall(), 96, 49),  # π/4·96² pixels on 4π, and those that the rim cuts
        (EqualArea(), 96, 55),  # 96² on 4π
    ],
)
def test_the_faces_are_as_fine_as_the_map(mapping, size, side):
    recorder = Recorder()
    light = environment(Scene(BLACK), HERE, recorder, size=size, mapping=mapping)
    assert recorder.sides == 6 * [side] and light.radiance.shape[:2] == mapping.shape(size)


def test_a_point_of_light_gives_its_intensity_over_the_square_of_the_distance():
    lamp = PointLight((1.3, 2.4, 2.5), (9.0, 18.0, 27.0))  # 3 metres away
    light = environment(Scene(BLACK, lights=(lamp,)), HERE, DARK, size=64)
    np.testing.assert_allclose(light.total(), [1, 2, 3], rtol=1e-6)
    np.testing.assert_allclose(light.irradiance(np.array([1, 2, 2]) / 3), [1, 2, 3], rtol=1e-3)
    np.testing.assert_allclose(moment(light), np.array([1, 2, 2]) / 3, atol=2e-3)


@pytest.mark.parametrize("towards", [(0.0, 1.0, 0.0), (0.0, -1.0, 1e-9), (0.0, 0.0, 1.0), (1e-9, 0.0, 1.0)])
def test_suns_at_poles_and_seam_keep_their_energy_and_place(towards):
    light = environment(Scene(BLACK, lights=(DistantLight(towards, (2.0, 2.0, 2.0)),)), HERE, DARK, size=32)
    np.testing.assert_allclose(light.total(), 2, rtol=1e-6)
    np.testing.assert_allclose(moment(light), 2 * np.array(towards), atol=0.02)


def test_other_falloffs_and_mappings_keep_their_energy():
    lamp = PointLight((2.3, 0.4, 0.5), (4.0, 4.0, 4.0), Linear(4.0))  # 2 of 4 metres away: half is left
    light = environment(Scene(BLACK, lights=(lamp,)), HERE, DARK, size=64, mapping=Angular())
    np.testing.assert_allclose(light.total(), 2, rtol=1e-3)
    assert light.mapping == Angular()


def test_a_lamp_behind_a_shape_sends_nothing():
    lamp, wall = PointLight((0.3, 0.4, 5.0), (1.0, 1.0, 1.0)), Sphere((0.3, 0.4, 2.0), 0.2, Diffuse((0.5, 0.5, 0.5)))
    sun = DistantLight((0, 0, 1), (1.0, 1.0, 1.0))
    assert environment(Scene(BLACK, objects=(wall,), lights=(lamp, sun)), HERE, DARK, size=16).total().max() == 0
    behind = Sphere((0.3, 0.4, 8.0), 0.2, Diffuse((0.5, 0.5, 0.5)))
    assert environment(Scene(BLACK, objects=(behind,), lights=(lamp,)), HERE, DARK, size=16).total().min() > 0
    glass = Sphere((0.3, 0.4, 2.0), 0.2, Material(transmission=1.0))
    with pytest.warns(UserWarning, match="1 of the scene's lamps shine through something transparent"):
        environment(Scene(BLACK, objects=(glass,), lights=(lamp,)), HERE, DARK, size=16)


def test_a_glowing_sphere_has_its_solid_angle_and_its_place():
    towards = normalised([0.6, 0.2, -0.77])
    centre = np.array(HERE) + 4 * towards
    ball = Sphere((float(centre[0]), float(centre[1]), float(centre[2])), 1.0, GLOWING)
    scene = Scene(BLACK, objects=(ball,), lights=(AmbientLight((5.0, 5.0, 5.0)),))
    light = environment(scene, HERE, Whitted(), size=64)
    assert light.total()[0] / 5 == pytest.approx(2 * np.pi * (1 - np.sqrt(1 - 1 / 16)), rel=5e-3)
    np.testing.assert_allclose(normalised(moment(light)), towards, atol=2e-3)


def test_the_light_map_is_seen_behind_the_shapes():
    sky = lights.sunny(32, sun=3.0)
    ground = Plane(GLOWING, height=-1.0)
    scene = Scene(sky, local=(ground,), lights=(AmbientLight((7.0, 7.0, 7.0)),))
    light = environment(scene, (0, 0, 0), Whitted(constellation=0), size=32)
    np.testing.assert_allclose(light.radiance[20:], 7, rtol=0.02)
    above = normalised(np.random.default_rng(0).normal(size=(40, 3)) * [1, 0.1, 1] + [0, 1.2, 0])
    # As the sky's upper half and a glowing ground do.
    radiance = sky.radiance.copy()
    radiance[16:] = 7
    expected = replace(sky, radiance=radiance).irradiance(above[:1])
    np.testing.assert_allclose(light.irradiance(above[:1]), expected, rtol=0.03)


def test_what_has_no_environment_is_refused():
    with pytest.raises(ValueError, match="has no direction"):
        environment(Scene(BLACK, lights=(PointLight(HERE, (1.0, 1.0, 1.0)),)), HERE, DARK)
    with pytest.raises(ValueError, match="three finite lengths"):
        environment(Scene(BLACK), (0, np.nan, 0), DARK)
    with pytest.raises(ValueError, match="at least 2 rows"):
        environment(Scene(BLACK), HERE, DARK, size=1)
    with pytest.raises(UnsupportedScene):
        environment(Scene(BLACK, lights=(AmbientLight((1.0, 1.0, 1.0)),)), HERE, Mitsuba(samples=4), size=8)


@pytest.mark.slow
def test_the_environment_of_a_scene_lights_a_ball_as_the_scene_does():
    floor = Plane(Diffuse((0.7, 0.4, 0.2)), (6.0, 6.0))
    pillar = Sphere((1.5, 1.0, -1.0), 0.8, Diffuse((0.2, 0.3, 0.8)))
    lamp = PointLight((-2.0, 3.0, 1.0), (12.0, 10.0, 8.0))
    scene = Scene(lights.sunny(64, sun=5.0), local=(floor,), objects=(pillar,), lights=(lamp,))
    centre, radius = np.array([0.0, 1.2, 0.5]), 0.02  # small, so that all of it sees what its middle sees
    x, y, z = map(float, centre)
    ball = Sphere((x, y, z), radius, Diffuse((0.5, 0.5, 0.5)))
    light = environment(scene, centre, Mitsuba(samples=1024), size=128)
    camera = Camera.looking_at(
        centre + np.array([0.3, 0.3, 0.6]), centre, width=24, height=24, focal_length=24 * 0.73 / 2 / radius * 0.9
    )
    inside = render(scene.adding(ball), camera, Mitsuba(samples=4096))
    under = render(Scene(light, objects=(ball,)), camera, Mitsuba(samples=4096))
    whole = under.matte > 0.999
    assert whole.sum() > 150
    a, b = inside.radiance[whole].astype(np.float64), under.radiance[whole].astype(np.float64)
    np.testing.assert_allclose(b.mean(0), a.mean(0), rtol=0.015)
