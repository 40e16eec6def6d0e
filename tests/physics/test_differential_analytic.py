"""What an object changes where that is known in closed form: form factors, furnaces, and lights of no extent."""

import numpy as np
import pytest

from lights import constant, of_directions
from montecarlo import assert_mean_agrees, assert_pixels_agree
from relume.renderers.mitsuba.differential import Differential
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight, PointLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Plane, Sphere
from solids import quad, sphere

LIGHT = np.array([1.0, 2.0, 0.5])
REFLECTANCE = np.array([0.5, 0.4, 0.8])
FLOOR = Plane(Diffuse((0.5, 0.4, 0.8)))
BLACK = Diffuse((0.0, 0.0, 0.0))
DARKNESS, EVEN = constant(8, 0.0), constant(8, (1.0, 2.0, 0.5))


def varying(profile):
    """A map whose radiance is `profile` of the height of the direction, −1 to 1, in all channels."""
    return of_directions(lambda d: profile(d[..., 1]), 128)


def floor_points(camera):
    """Where the pixels' middles meet the floor, (H, W, 3)."""
    rays = camera.rays()
    return camera.position - camera.position[1] / rays[..., 1:2] * rays


def disc(radius, height, material=BLACK):
    """A flat round thing over the origin, facing down; its area is that of the circle to 1e-4."""
    corners = 256
    turn = 2 * np.pi * np.arange(corners) / corners
    rim = np.stack([radius * np.cos(turn), np.full(corners, height), radius * np.sin(turn)], -1)
    vertices = np.concatenate([[[0, height, 0]], rim]).astype(np.float32)
    index = np.arange(corners)
    faces = np.stack([np.zeros(corners, int), 1 + index, 1 + (index + 1) % corners], -1)
    return Mesh(vertices, faces.astype(np.int32), material, name="disc")


def looking_at_the_floor(target, position, *, width=24, height=16, focal_length=24.0):
    return Camera.looking_at(
        np.array(position, float), np.array(target, float), width=width, height=height, focal_length=focal_length
    )


def test_a_black_ball_takes_its_form_factor_from_every_point_of_the_floor():
    # A19: −ρL · h r²/(h² + x²)^{3/2} at x from the foot of a ball of radius 1 at height 1.5.
    camera = looking_at_the_floor((0.5, 0, 0), (0.5, 1.5, 4.5))
    ball = sphere(BLACK, centre=(0, 1.5, 0), fine=5)
    change = Differential(samples=2048).change(Scene(EVEN, (FLOOR,), (ball,)), camera, seed=3)
    foot = np.hypot(*np.moveaxis(floor_points(camera)[..., [0, 2]], -1, 0))
    expected = -REFLECTANCE * LIGHT * (1.5 / (1.5**2 + foot**2) ** 1.5)[..., None]
    beside = (change.matte == 0) & (camera.rays()[..., 1] < -0.1)
    assert beside.sum() > 200
    # A pixel's middle stands for all of it, and facets take a two-thousandth of the ball's disc.
    found = change.difference[beside], change.difference_variance[beside], expected[beside]
    assert_mean_agrees(*found, near=5e-3)
    assert_pixels_agree(*found, passes=change.passes, rounding=0.03)
    np.testing.assert_array_equal(change.objects, 0.0)  # it shines nowhere


SQUARE = [[-1, 1, -1], [1, 1, -1], [1, 1, 1], [-1, 1, 1]]
BODIES = {  # their form factors from the floor at the origin
    "disc": (lambda material: disc(1.0, 2.0, material), 0.2),  # A12: R²/(R² + d²)
    "square": (lambda material: quad(SQUARE, material), 0.5541264),  # A13, of 2 × 2 at height 1
    "ball": (lambda material: sphere(material, centre=(0, 2, 0), fine=5), 0.25),  # A10: (R/d)²
}
NEAR_ORIGIN = looking_at_the_floor((0, 0, 0), (0, 0.4, 4.0), width=8, height=8, focal_length=8000)
"""So long a lens that what is seen is four centimetres long, over which the factors fall by less than a thousandth."""


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
def test_a_black_body_takes_its_form_factor_from_the_floor_below_it(body):
    shape, share = BODIES[body]
    change = Differential(samples=8192).change(Scene(EVEN, (FLOOR,), (shape(BLACK),)), NEAR_ORIGIN, seed=4)
    assert not change.matte.any()
    assert_mean_agrees(change.difference, change.difference_variance, -REFLECTANCE * LIGHT * share, near=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
def test_a_body_that_shines_lights_the_floor_below_it_by_its_form_factor(body):
    # The same rows with the sign turned: E = πLF, and ρE/π is seen. An index of 1 leaves nothing to be reflected.
    shining = Material((0.0, 0.0, 0.0), roughness=1.0, ior=1.0, emission=(4.0, 2.0, 1.0))
    shape, share = BODIES[body]
    change = Differential(samples=8192).change(Scene(DARKNESS, (FLOOR,), (shape(shining),)), NEAR_ORIGIN, seed=9)
    assert not change.matte.any()
    expected = REFLECTANCE * np.array([4.0, 2.0, 1.0]) * share
    assert_mean_agrees(change.difference, change.difference_variance, expected, near=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("light", "irradiance"),
    [
        (EVEN, np.pi * LIGHT),  # A1
        (varying(lambda up: 1 + up), 5.235988),  # A3
        (varying(lambda up: np.where(up > 0, (1 + 2 * up) / 3, 0)), 2.443461),  # A20, the overcast sky
    ],
    ids=["constant", "brighter upwards", "overcast"],
)
def test_a_black_dome_takes_all_light_from_the_floor(light, irradiance):
    dome = sphere(BLACK, radius=3.0, fine=4)
    camera = looking_at_the_floor((0, 0, 0), (0, 1, 1.5), width=12, height=12, focal_length=20)
    change = Differential(samples=1024).change(Scene(light, (FLOOR,), (dome,)), camera, seed=5)
    assert not change.matte.any()
    expected = -REFLECTANCE / np.pi * irradiance
    assert_mean_agrees(change.difference, change.difference_variance, expected, near=2e-3)


LOSSLESS = {
    "white": Diffuse((1, 1, 1)),
    "mirror": Material(metallic=1.0, roughness=0.0),
    "glass": Material(roughness=0.0, transmission=1.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("material", LOSSLESS.values(), ids=LOSSLESS)
def test_what_loses_no_light_cannot_be_seen_on_a_white_floor_under_constant_light(material):
    # A17 with everything white: floor and ball both show L wherever one looks, so nothing changes but for noise.
    ball = sphere(material, centre=(0, 0.6, 0), radius=0.5, fine=4)
    white = Plane(Diffuse((1, 1, 1)))
    camera = looking_at_the_floor((0, 0.3, 0), (0, 1.2, 3))
    change = Differential(samples=256, depth=24).change(Scene(EVEN, (white,), (ball,)), camera, seed=6)
    covered, beside = change.matte == 1, (change.matte == 0) & (camera.rays()[..., 1] < -0.05)
    assert covered.sum() > 20 and beside.sum() > 150
    # Paths end after 24 bounces; facets under smooth normals turn some rays into the ball itself.
    assert_mean_agrees(change.objects[covered], change.objects_variance[covered], LIGHT, near=5e-3)
    beside_mean = change.difference[beside].mean(0, dtype=np.float64)
    error = np.sqrt(change.difference_variance[beside].sum(0, dtype=np.float64)) / beside.sum()
    assert np.all(error < 0.02 * LIGHT)  # else the next line says little
    assert np.all(np.abs(beside_mean) <= 4 * error + 2e-3 * LIGHT)


@pytest.mark.slow
@pytest.mark.parametrize("material", LOSSLESS.values(), ids=LOSSLESS)
def test_what_loses_no_light_shows_the_light_that_surrounds_it(material):
    camera = Camera(12, 12, 36.0, np.array([0, 0, 6.0]), np.eye(3))
    change = Differential(samples=256, depth=24).change(Scene(EVEN, (), (sphere(material),)), camera, seed=7)
    assert 0 < change.matte.mean() < 1
    np.testing.assert_array_equal(change.difference, 0.0)  # no real surface
    expected = change.matte[..., None] * LIGHT
    assert_mean_agrees(change.objects, change.objects_variance, expected, near=2e-3)


@pytest.mark.parametrize(
    "lamp",
    [
        PointLight((0, 3, 0), (5.0, 10.0, 20.0)),  # A15
        pytest.param(DistantLight((0, 1, 0), (1.0, 2.0, 3.0)), marks=pytest.mark.slow),
    ],
    ids=["point", "sun"],
)
def test_a_black_disc_takes_all_light_of_a_lamp_from_its_shadow_and_none_beside_it(lamp):
    scene = Scene(DARKNESS, (FLOOR,), (disc(1.0, 1.0),), (lamp,))
    # From below the disc's height, so that only shadow is seen: half a metre round its middle.
    under = looking_at_the_floor((0, 0, 0), (0, 0.9, 2.0), focal_length=100)
    change = Differential(samples=64).change(scene, under, seed=8)
    foot = np.hypot(*np.moveaxis(floor_points(under)[..., [0, 2]], -1, 0))
    assert foot.max() < 0.7 and not change.matte.any()
    if isinstance(lamp, PointLight):
        irradiance = np.asarray(lamp.intensity) * (3 / np.hypot(3, foot) ** 3)[..., None]  # I cos θ/d²
    else:
        irradiance = np.broadcast_to(lamp.irradiance, (*foot.shape, 3))
    expected = -REFLECTANCE / np.pi * irradiance
    # A pixel's middle stands for its 64 rays, over which the light differs by a hundredth.
    np.testing.assert_allclose(change.difference, expected, rtol=0.01)
    np.testing.assert_allclose(change.difference.mean((0, 1)), expected.mean((0, 1)), rtol=1e-3)
    # The shadow ends a metre and a half from the foot at most.
    beside = looking_at_the_floor((3, 0, 0), (3, 0.9, 2.0), focal_length=100)
    change = Differential(samples=16).change(scene, beside, seed=8)
    np.testing.assert_array_equal(change.difference, 0.0)


def test_a_mirrored_ball_scatters_parallel_light_alike_in_all_directions():
    # A beam of irradiance E on a mirrored ball of radius r leaves it with the intensity E r²/4 everywhere: far from it
    # the floor gains ρ/π · E r²/4 · cos θ/d². No path from the camera can find a light without size in a mirror.
    radius, height = 0.02, 1.0
    ball = Sphere((0.0, height, 0.0), radius, Material((1.0, 1.0, 1.0), metallic=1.0, roughness=0.0))
    sun = DistantLight((0.6, 0.8, 0.0), (4.0, 2.0, 1.0))
    # Away from the ball's shadow, which falls towards −x.
    camera = looking_at_the_floor((0.6, 0, 0), (0.6, 0.9, 1.5), focal_length=150)
    # A small piece of floor: a wide one lit by the sun is itself mirrored in the ball.
    piece = quad([[0.4, 0, 0.2], [0.8, 0, 0.2], [0.8, 0, -0.2], [0.4, 0, -0.2]], FLOOR.material)
    change = Differential(samples=4096).change(Scene(DARKNESS, (piece,), (ball,), (sun,)), camera, seed=9)
    foot = np.hypot(*np.moveaxis(floor_points(camera)[..., [0, 2]], -1, 0))
    assert not change.matte.any()
    intensity = np.array(sun.irradiance) * radius**2 / 4
    expected = REFLECTANCE / np.pi * intensity * (height / np.hypot(height, foot) ** 3)[..., None]
    error = np.sqrt(change.difference_variance.sum((0, 1), dtype=np.float64)) / foot.size
    assert np.all(error < 0.04 * expected.mean((0, 1)))
    # Light leaves a mirrored ball from half a radius off its middle at most: a hundredth of a metre in one.
    near = 0.02 * expected.mean((0, 1))
    assert np.all(np.abs(change.difference.mean((0, 1)) - expected.mean((0, 1))) < 4 * error + near)
