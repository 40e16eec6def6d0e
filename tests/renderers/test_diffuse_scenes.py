"""Scenes of diffuse surfaces: light straight from its sources by closed forms, and refusals by name."""

from __future__ import annotations

import numpy as np
import pytest

import relume as rl
from relume.renderers.diffuse.direct_light import DirectLight
from relume.renderers.diffuse.scenes import DiffuseScene, not_diffuse
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.media import Medium
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import AnyMaterial, Mesh, Sphere
from relume.scene.shapes.tessellation import as_mesh
from relume.sphere.environment_map import EnvironmentMap
from solids import quad, room

BLACK, EVEN = (EnvironmentMap(np.full((8, 16, 3), value, np.float32)) for value in (0.0, 2.0))
GREY = Diffuse((0.5, 0.5, 0.5))
GROUND = quad([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], GREY)
CAMERA = rl.Camera.looking_at(np.array([0, 2.0, 0.1]), np.zeros(3), width=4, height=4, focal_length=4)
LOOKED = [
    rl.renderers.Radiosity(rays=10_000, refinements=0, unshot=5e-3, samples=16),
    rl.renderers.Radiosity(rays=10_000, refinements=0, unshot=5e-3, samples=16, gather=16),
    rl.renderers.IrradianceCache(samples=16, shadow_rays=4, rays=256),
]
BOTH = [rl.renderers.Radiosity(rays=64), rl.renderers.IrradianceCache(rays=8)]


def lamp(height: float, half: float, radiance: tuple[float, float, float], *, up: bool = False) -> Mesh:
    """A square above the ground that shines downward, or upward."""
    corners = np.array([[-half, height, -half], [half, height, -half], [half, height, half], [-half, height, half]])
    return quad(corners[::-1] if up else corners, Material((0, 0, 0), specular=0.0, emission=radiance), name="lamp")


def irradiance(scene: Scene, samples: int = 4096) -> np.ndarray:
    """What arrives in the middle of the ground, (3,)."""
    ready = DiffuseScene.of(scene, "the test")
    seen = ready.look(np.array([[0.0, 0.5, 0.0]]), np.array([[0.0, -1.0, 0.0]]), leaving=False)
    return DirectLight(ready).irradiance(seen, samples, np.random.default_rng(1))[0]


def towards_square(half: float, height: float) -> float:
    """The form factor from a point to a parallel square above it: four times that of a quarter (Howell B-4)."""
    a = half / height
    return float(4 / (2 * np.pi) * 2 * a / np.hypot(1, a) * np.arctan(a / np.hypot(1, a)))


def test_an_even_map_gives_pi_times_its_radiance():
    np.testing.assert_allclose(irradiance(Scene(EVEN, (GROUND,))), 2 * np.pi, rtol=2e-3)


def test_a_square_lamp_gives_the_closed_form():
    expected = np.pi * towards_square(0.5, 1.0) * np.array([3.0, 2.0, 1.0])
    np.testing.assert_allclose(expected[2], 0.752275, rtol=1e-5)
    got = irradiance(Scene(BLACK, (GROUND, lamp(1.0, 0.5, (3.0, 2.0, 1.0)))))
    np.testing.assert_allclose(got, expected, rtol=2e-3)


def test_a_lamp_shines_from_its_outer_side_alone_and_throws_a_shadow():
    assert not irradiance(Scene(BLACK, (GROUND, lamp(1.0, 0.5, (1, 1, 1), up=True))), 64).any()
    screen = quad([[-1, 0.8, 1], [1, 0.8, 1], [1, 0.8, -1], [-1, 0.8, -1]], GREY)
    assert not irradiance(Scene(BLACK, (GROUND, lamp(1.0, 0.5, (1, 1, 1)), screen)), 64).any()


def test_a_picture_of_emission_lights_as_its_mean_does_far_away():
    picture = np.zeros((2, 2, 3), np.float32)
    picture[0] = 2.0
    shining = Material((0, 0, 0), specular=0.0, emission=picture)
    small = quad([[-0.01, 1, -0.01], [0.01, 1, -0.01], [0.01, 1, 0.01], [-0.01, 1, 0.01]], shining, textured=True)
    np.testing.assert_allclose(irradiance(Scene(BLACK, (GROUND, small))), 4e-4, rtol=0.02)


def test_points_fall_by_the_square_law_and_suns_by_the_cosine():
    point = rl.scene.PointLight((0, 2.0, 0), (4.0, 8.0, 12.0))
    sun = rl.scene.DistantLight((0, 1, 1), (1.0, 1.0, 1.0))
    got = irradiance(Scene(BLACK, (GROUND,), lights=(point, sun)))
    np.testing.assert_allclose(got, np.array([1, 2, 3]) + np.sqrt(0.5), rtol=1e-9)


def test_spheres_and_rectangles_of_light_give_closed_forms_and_throw_no_shadow():
    ball = rl.scene.SphereLight((0, 1.0, 0), 0.25, (3.0, 2.0, 1.0))
    # π L (r/d)².
    expected = np.pi / 16 * np.array([3.0, 2.0, 1.0])
    np.testing.assert_allclose(irradiance(Scene(BLACK, (GROUND,), lights=(ball,))), expected, rtol=2e-3)
    down, up = (rl.scene.RectangleLight((0, 1.0, 0), (0, y, 0), (1.0, 1.0), (3.0, 2.0, 1.0)) for y in (-1, 1))
    square = np.pi * towards_square(0.5, 1.0) * np.array([3.0, 2.0, 1.0])
    np.testing.assert_allclose(irradiance(Scene(BLACK, (GROUND,), lights=(down,))), square, rtol=2e-3)
    assert not irradiance(Scene(BLACK, (GROUND,), lights=(up,)), 64).any()
    # The point of light stands behind the others.
    point = rl.scene.PointLight((0, 2.0, 0), (4.0, 4.0, 4.0))
    together = irradiance(Scene(BLACK, (GROUND,), lights=(ball, down, up, point)))
    np.testing.assert_allclose(together, expected + square + 1, rtol=5e-3)


def test_an_eye_sees_lamps_without_a_body_from_their_front_and_what_lies_behind():
    down, up = (rl.scene.RectangleLight((0, 1.0, 0), (0, y, 0), (1.0, 1.0), (3.0, 2.0, 1.0)) for y in (-1, 1))
    shining = quad([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], Material(specular=0.0, emission=(0.5, 0.5, 0.5)))
    for light, seen in ((down, 0.5), (up, [3.5, 2.5, 1.5])):
        ready = DiffuseScene.of(Scene(BLACK, (shining,), lights=(light,)), "the test")
        eye, way = np.array([[0.0, 3.0, 0.0]]), np.array([[0.0, -1.0, 0.0]])
        np.testing.assert_allclose(ready.look(eye, way, leaving=False).emission[0], seen)
        # Rays from surfaces find lamps by shadow rays.
        np.testing.assert_allclose(ready.look(eye, way).emission[0], 0.5)


LIGHTS = (
    rl.scene.SphereLight((0.3, 0.6, 0.4), 0.1, (6.0, 4.0, 3.0)),
    rl.scene.RectangleLight((0.6, 0.9, 0.4), (0.2, -1, 0), (0.3, 0.2), (5.0, 6.0, 8.0)),
)
LIT = Scene(BLACK, room(GREY), lights=LIGHTS)
EYE = rl.Camera.looking_at(np.array([0.5, 0.5, 0.9]), np.array([0.5, 0.3, 0]), width=8, height=8, focal_length=5)


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    """The lit room by Mitsuba."""
    return rl.Mitsuba(samples=256).render(LIT, EYE).radiance


@pytest.mark.parametrize("renderer", LOOKED, ids=["radiosity", "gathered", "cache"])
def test_a_room_under_lamps_without_a_body_is_as_bright_as_mitsubas(renderer: rl.Renderer, truth: np.ndarray):
    found = rl.render(LIT, EYE, renderer).radiance
    np.testing.assert_allclose(found.mean((0, 1)), truth.mean((0, 1)), rtol=0.03)
    # Where no lamp is seen, and no edge is.
    np.testing.assert_allclose(found[4:, 2:6].mean((0, 1)), truth[4:, 2:6].mean((0, 1)), rtol=0.03)


@pytest.mark.parametrize(
    ("material", "why"),
    [
        (Material((0.5, 0.5, 0.5)), "specular reflection"),
        (Material((0.5, 0.5, 0.5), metallic=1.0), "the reflection of a metal"),
        (Material(transmission=1.0, specular=0.0), "transmission"),
        (Material(specular=0.0, clearcoat=1.0), "clearcoat"),
        (Material(specular=0.0, alpha=0.5), "alpha"),
        (Ward((0.2, 0.2, 0.2), 0.1, 0.1), "the reflection of a Ward"),
    ],
)
def test_what_is_not_diffuse_is_refused_by_name(material: AnyMaterial, why: str):
    ball = Sphere((0, 1, 0), 0.5, material, name="ball")
    for renderer in BOTH:
        with pytest.raises(rl.errors.UnsupportedScene, match=rf"diffuse surfaces alone, .*'ball' has .*{why}"):
            rl.render(Scene(EVEN, (GROUND,), (ball,)), CAMERA, renderer)


def test_a_diffuse_material_of_gltf_is_not_refused():
    assert not_diffuse(Material((0.5, 0.5, 0.5), specular=0.0, emission=(1, 1, 1))) is None


@pytest.mark.parametrize("renderer", BOTH, ids=["radiosity", "cache"])
def test_other_scenes_and_lenses_are_refused_in_one_line(renderer: rl.Renderer):
    ambient = rl.scene.AmbientLight((1, 1, 1))
    lens = rl.Camera(4, 4, 4.0, CAMERA.position, CAMERA.rotation, aperture=0.01, focus=2.0)
    for scene, camera, why in [
        (Scene(BLACK, (GROUND,)), CAMERA, "nothing shines"),
        (Scene(EVEN, (GROUND,), lights=(ambient,)), CAMERA, "no place for ambient light; use rl.Whitted"),
        (Scene(EVEN, (GROUND,), medium=Medium((0.1, 0.1, 0.1))), CAMERA, "a medium fills"),
        (Scene(EVEN, (GROUND,), distant=rl.scene.Dome(9.0)), CAMERA, "at infinity"),
        (Scene(EVEN, (GROUND,)), lens, "aperture"),
    ]:
        with pytest.raises(rl.errors.UnsupportedScene, match=why) as refused:
            rl.render(scene, camera, renderer)
        assert "\n" not in str(refused.value)
    with pytest.raises(ValueError, match="seed is -1"):
        rl.render(Scene(EVEN, (GROUND,)), CAMERA, renderer, seed=-1)


def test_every_shape_becomes_triangles_of_its_area():
    ball = as_mesh(Sphere((1, 2, 3), 2.0, GREY))
    corners = ball.vertices[ball.faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(0.5 * np.linalg.norm(across, axis=-1).sum(), 16 * np.pi, rtol=2e-3)
    assert np.all(np.einsum("ij,ij->i", across, corners.mean(axis=1) - [1, 2, 3]) > 0)
    plane = as_mesh(rl.Plane(GREY, (4.0, 2.0), 0.5))
    assert np.ptp(plane.vertices, axis=0).tolist() == [4, 0, 2]
