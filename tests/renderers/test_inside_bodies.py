"""Lamps and cameras inside bodies, holes under lamps without a size: refused or warned of by name, never dark."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import relume as rl
from relume.errors import DoubtWarning, UnsupportedScene
from relume.renderers.environment_probe import environment
from relume.renderers.mitsuba.enclosing import surrounds
from relume.scene.lights import DistantLight, PointLight, RectangleLight, SphereLight
from relume.scene.materials.checks import triple
from relume.scene.materials.media import Medium
from relume.scene.materials.presets import material_preset
from relume.scene.shapes.shapes import Polygon, Sphere

DARK = rl.EnvironmentMap(np.zeros((2, 4, 3), np.float32))
MILK, GREY = material_preset("milk"), rl.Diffuse((0.5, 0.5, 0.5))
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]], np.int32
)  # fmt: skip
CUBE = rl.Mesh(CORNERS, FACES, MILK, name="cube")
CAMERA = rl.Camera.looking_at(np.array([0, 0, 6.0]), np.zeros(3), width=4, height=4, focal_length=4.0)
LAMPS = (
    PointLight((0.2, 0.1, 0.0), (1, 1, 1)),
    SphereLight((0.2, 0.1, 0.0), 0.05, (1, 1, 1)),
    RectangleLight((0.2, 0.1, 0.0), (0, -1, 0), (0.1, 0.1), (1, 1, 1), up=(0, 0, 1)),
)


@pytest.mark.parametrize(
    ("point", "inside"), [((0, 0, 0), True), ((0.99, 0.9, -0.9), True), ((1.01, 0, 0), False), ((0.9, 1.2, 0.3), False)]
)
def test_a_point_is_inside_a_closed_mesh_by_the_solid_angle_of_its_faces(point, inside):
    assert surrounds(CUBE, point) is inside
    turned = rl.Mesh(CORNERS, FACES[:, ::-1].copy(), MILK, name="inside out")
    assert surrounds(turned, point) is inside


def test_a_sphere_surrounds_what_is_nearer_than_its_radius():
    ball = Sphere((1.0, 0.0, 0.0), 0.5, MILK)
    assert surrounds(ball, (1.3, 0.3, 0.0)) and not surrounds(ball, (1.4, 0.4, 0.0))
    assert not surrounds(rl.Plane(GREY), (0.0, -1.0, 0.0))


@pytest.mark.parametrize("lamp", LAMPS, ids=lambda lamp: type(lamp).__name__)
@pytest.mark.parametrize("body", [CUBE, Sphere((0.0, 0.0, 0.0), 1.0, MILK)], ids=["mesh", "sphere"])
def test_a_lamp_in_what_fills_a_body_is_refused_by_name(lamp, body):
    with pytest.raises(UnsupportedScene, match=r"at \[0.2, 0.1, 0.0\] stands inside 'milk'"):
        rl.Mitsuba(samples=2).render(rl.Scene(DARK, objects=(body,), lights=(lamp,)), CAMERA)
    with pytest.raises(UnsupportedScene, match="stands inside 'milk'"):
        rl.Differential(samples=2).change(rl.Scene(DARK, objects=(body,), lights=(lamp,)), CAMERA)


def test_a_lamp_beside_the_body_or_in_clear_glass_is_not():
    beside = PointLight((1.5, 0.0, 0.0), (1, 1, 1))
    glass = Sphere((5.0, 0.0, 0.0), 1.0, material_preset("glass"))
    inside_glass = PointLight((5.0, 0.0, 0.0), (1, 1, 1))
    rl.Mitsuba(samples=2).render(rl.Scene(DARK, objects=(CUBE, glass), lights=(beside, inside_glass)), CAMERA)


GLASS = rl.Material(roughness=0.0, transmission=1.0)
MIDDLE = (0.0, 1.0, 0.0)
SMALL = (
    PointLight(MIDDLE, (1, 1, 1)),
    SphereLight(MIDDLE, 0.002, triple(np.full(3, 1 / np.pi / 4e-6))),
    RectangleLight(MIDDLE, (0, -1, 0), (0.02, 0.02), (2500, 2500, 2500), up=(0, 0, 1)),
)


# Whatever lamp is dim without fog is so in it.
@pytest.mark.parametrize(
    "medium",
    [pytest.param(None, marks=pytest.mark.slow), Medium((0.5, 0.3, 0.1))],
    ids=["clear", "fog"],
)
@pytest.mark.parametrize("lamp", SMALL, ids=lambda lamp: type(lamp).__name__)
def test_a_lamp_in_the_middle_of_a_glass_ball_lights_as_without_it(mi, lamp, medium):
    """From the middle no ray is bent; of what lights one half alone the other gets 4 %. In the ball there is no fog."""
    from relume.renderers.mitsuba.transport.estimator import Estimator
    from relume.renderers.mitsuba.transport.plain import Plain

    floor, ball = rl.Plane(GREY, (8.0, 8.0)), Sphere(MIDDLE, 0.5, GLASS)
    camera = rl.Camera.looking_at(
        np.array([1.5, 0.6, 0.01]), np.array([0.8, 0.0, 0.0]), width=4, height=4, focal_length=8.0
    )
    rays = camera.rays_through(np.stack(np.meshgrid(*[(np.arange(80) + 0.5) / 20] * 2), axis=-1))
    seen = -camera.position[1] / rays[..., 1]
    way = np.array(MIDDLE) - (camera.position + seen[..., None] * rays)
    far = np.linalg.norm(way, axis=-1)
    given = way[..., 1] / far**3 * (0.96 * way[..., 1] / far if isinstance(lamp, RectangleLight) else 1)
    fogged = np.zeros(3) if medium is None else np.array(medium.absorption)
    left = np.exp(-fogged * (far - 0.5 + seen)[..., None])
    expected = (given[..., None] * left).mean((0, 1)) * 0.5 / np.pi
    scene = rl.Scene(DARK, (floor,), (ball,), (lamp,), medium=medium)
    for made in (Plain(scene, camera, 8), Estimator(scene, camera, 8)):
        light = [made.lit(1 << 18, seed) for seed in (1, 2)]
        found = np.mean([each["objects"] + each["difference"] for each in light], axis=(0, 1, 2))
        np.testing.assert_allclose(found, expected, rtol=0.03)


@pytest.mark.parametrize("lamp", SMALL, ids=lambda lamp: type(lamp).__name__)
def test_smoke_about_a_lamp_dims_what_a_mirror_makes_of_it(mi, lamp):
    """A body of index 1: in 0.5 m of it a half, a quarter and a tenth are left of the light of a small lamp."""
    from relume.renderers.mitsuba.transport.plain import Plain

    left = np.array((0.5, 0.25, 0.1))
    smoke = rl.Material(roughness=0.0, transmission=1.0, ior=1.0, attenuation_color=triple(left))
    corners = np.array([[-2, 0, -1], [2, 0, -1], [2, 2, -1], [-2, 2, -1]], np.float64)
    mirror = Polygon(corners, rl.Material(metallic=1.0, roughness=0.0, name="mirror"))
    camera = rl.Camera.looking_at(np.array([0, 1.0, 3.0]), np.array([0, 0, 0.8]), width=4, height=4, focal_length=16.0)

    def lit(distance: float) -> np.ndarray:
        body = Sphere((0.0, 1.0, 0.0), 0.5, replace(smoke, attenuation_distance=distance))
        scene = rl.Scene(DARK, (rl.Plane(GREY, (8.0, 8.0)), mirror), (body,), (lamp,))
        light = Plain(scene, camera, 8).lit(1 << 16, 1)
        return (light["objects"] + light["difference"]).mean((0, 1))

    clear = lit(1e9)
    assert np.all(clear > 0)
    np.testing.assert_allclose(lit(0.5) / clear, left, rtol=0.01)


def test_a_camera_in_a_body_is_refused_where_the_scene_has_media():
    inside = rl.Camera.looking_at(np.zeros(3), np.array([0, 0, -1.0]), width=4, height=4, focal_length=4.0)
    with pytest.raises(UnsupportedScene, match="the camera stands inside 'milk'"):
        rl.Mitsuba(samples=2).render(rl.Scene(DARK, objects=(CUBE,), lights=LAMPS[:0]), inside)


@pytest.mark.parametrize("lamp", [PointLight((0, 3.0, 0), (1, 1, 1)), DistantLight((0, 1.0, 0), (1, 1, 1))])
def test_an_environment_of_lamps_without_a_size_in_fog_is_refused(lamp):
    scene = rl.Scene(DARK, (rl.Plane(GREY, (4.0, 4.0)),), lights=(lamp,), medium=Medium((1.0, 1.0, 1.0)))
    with pytest.raises(UnsupportedScene, match="the scene has a medium"):
        environment(scene, (0.0, 1.0, 0.0), rl.Mitsuba(samples=2), size=4)


def test_glass_beside_holes_under_a_point_of_light_is_warned_of():
    leaf = rl.Mesh(CORNERS[:4], FACES[:2], rl.Material(alpha=0.5, name="leaf"), name="leaf")
    glass = Sphere((0.0, 1.0, 0.0), 0.3, rl.Material(transmission=1.0, roughness=0.0))
    floor, lamp = rl.Plane(GREY, (4.0, 4.0), -2.0), PointLight((0, 3.0, 0), (1, 1, 1))
    with pytest.warns(DoubtWarning, match="material 'leaf' has holes: beside them light of points and suns does not"):
        rl.Mitsuba(samples=2).render(rl.Scene(DARK, (floor,), (leaf, glass), (lamp,)), CAMERA)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rl.Mitsuba(samples=2).render(rl.Scene(DARK, (floor,), (leaf,), (lamp,)), CAMERA)


def cloudy(roughness: float) -> Sphere:
    wax = rl.Material(
        roughness=roughness, transmission=1.0, ior=1.33, name="wax",
        scattering_distance=(0.1, 0.1, 0.1), scattering_albedo=(0.95, 0.9, 0.8),
    )  # fmt: skip
    return Sphere((0, 0, 0), 0.5, wax)


def test_milk_below_a_surface_of_little_roughness_is_warned_of_under_lamps_without_a_size():
    point, sphere = PointLight((1.2, 1.5, 1.0), (1, 1, 1)), SphereLight((1.2, 1.5, 1.0), 0.3, (1, 1, 1))
    with pytest.warns(DoubtWarning, match="material 'wax' scatters light below a surface of little roughness"):
        rl.Mitsuba(samples=2).render(rl.Scene(DARK, objects=(cloudy(0.2),), lights=(point,)), CAMERA)
    with pytest.warns(DoubtWarning, match="'wax' scatters light below"):
        rl.Differential(samples=2).change(rl.Scene(DARK, objects=(cloudy(0.2),), lights=(point,)), CAMERA)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for roughness, lamp in ((0.2, sphere), (0.0, point), (0.5, point)):
            rl.Mitsuba(samples=2).render(rl.Scene(DARK, objects=(cloudy(roughness),), lights=(lamp,)), CAMERA)


def test_milk_below_a_rough_surface_has_the_light_of_a_point_as_of_a_small_lamp():
    at, camera = (
        (1.2, 1.5, 1.0),
        rl.Camera.looking_at(np.array([0, 0.6, 3.0]), np.zeros(3), width=12, height=12, focal_length=30.0),
    )
    lamps = PointLight(at, (10, 10, 10)), SphereLight(at, 0.3, triple(np.full(3, 10 / np.pi / 0.09)))
    point, sphere = (
        rl.Mitsuba(samples=1024).render(rl.Scene(DARK, objects=(cloudy(0.8),), lights=(lamp,)), camera).radiance
        for lamp in lamps
    )
    np.testing.assert_allclose(point.mean((0, 1)), sphere.mean((0, 1)), rtol=0.05)
    assert np.all(point.mean((0, 1)) > 0.02)


@pytest.mark.parametrize(
    ("lamp", "direct"),
    [
        (PointLight((0, 2.0, 0), (1, 2, 3)), np.array([1, 2, 3]) / 4),
        (DistantLight((0, 1.0, 0), (1, 2, 3)), np.array([1, 2, 3])),
        # Found by chance, and not once more by looking for it.
        (SphereLight((0, 2.0, 0), 0.6, triple(np.full(3, 1 / 0.09 / np.pi))), np.ones(3)),
    ],
    ids=["point", "sun", "sphere"],
)
def test_light_of_lamps_goes_through_holes_as_far_as_they_are_open(lamp, direct: np.ndarray):
    """Black leaves at 0.75 and 0.5 of alpha, one over the other, let an eighth through; a hole lets all through."""
    over = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], np.float32)
    faces, uv = np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)

    def leaf(height: float, alpha: object) -> rl.Mesh:
        black = rl.Material((0, 0, 0), specular=0.0, alpha=alpha, name="leaf")  # pyright: ignore[reportArgumentType]
        return rl.Mesh(over * 0.4 + np.array([0, height, 0], np.float32), faces, black, uv=uv, name="leaf")

    floor = rl.Plane(GREY, (4.0, 4.0))
    camera = rl.Camera.looking_at(np.array([1.5, 0.5, 0.0]), np.zeros(3), width=2, height=2, focal_length=400.0)
    for leaves, share in (
        ((leaf(0.6, 0.75), leaf(0.8, 0.5)), 1 / 8),
        ((leaf(0.6, np.zeros((2, 2), np.float32)),), 1.0),
    ):
        scene = rl.Scene(DARK, (floor,), leaves, (lamp,))
        expected = share * 0.5 / np.pi * direct
        shown = rl.Mitsuba(samples=2048).render(scene, camera).radiance.mean((0, 1))
        np.testing.assert_allclose(shown, expected, rtol=0.2 if isinstance(lamp, SphereLight) else 2e-3)
        if not isinstance(lamp, SphereLight):
            taken = rl.Differential(samples=64).change(scene, camera).difference.mean((0, 1))
            np.testing.assert_allclose(taken, expected - 0.5 / np.pi * direct, rtol=5e-3, atol=1e-6)


def test_a_sun_in_fog_goes_through_holes():
    """A black leaf of ½ above all fog that is seen halves what it scatters."""
    corners = np.array([[-9, 1, 9], [9, 1, 9], [9, 1, -9], [-9, 1, -9]], np.float32)
    sun = DistantLight((0, 1.0, 0), (1, 1, 1))
    camera = rl.Camera.looking_at(np.array([0, 0.5, 2.0]), np.array([0, 0.5, 0]), width=2, height=2, focal_length=40.0)

    def scene(alpha: float) -> rl.Scene:
        black = rl.Material((0, 0, 0), specular=0.0, alpha=alpha, name="leaf")
        leaf = rl.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), black, name="leaf")
        # All fog that is seen lies below the leaf.
        wall = rl.Mesh(
            corners[:, [0, 2, 1]] - np.array([0, 0, 4], np.float32),
            leaf.faces,
            rl.Diffuse((0.0, 0.0, 0.0)),
            name="wall",
        )
        return rl.Scene(DARK, (wall,), (leaf,), (sun,), medium=Medium((0, 0, 0), (0.01, 0.01, 0.01)))

    half, open_ = (rl.Mitsuba(samples=1024).render(scene(a), camera).radiance.mean() for a in (0.5, 1e-4))
    assert half == pytest.approx(open_ / 2, rel=0.03)


@pytest.mark.parametrize("lights", [(), (DistantLight((0, 1.0, 0), (1, 1, 1)),)], ids=["map", "sun"])
def test_fog_over_a_plane_without_an_edge_is_refused_under_light_from_infinity(lights):
    light = DARK if lights else rl.EnvironmentMap(np.ones((2, 4, 3), np.float32))
    scene = rl.Scene(light, (rl.Plane(GREY),), lights=lights, medium=Medium((0.1, 0.1, 0.1)))
    with pytest.raises(UnsupportedScene, match="give the plane a size"):
        rl.Mitsuba(samples=2).render(scene, CAMERA)


def test_an_image_on_a_sphere_lies_as_a_light_map_does_in_every_renderer():
    """Seen from +Z its left half is what lies at u from 0 to a quarter, which is towards -X: here the first colour."""
    image = np.zeros((2, 4, 3), np.float32)
    image[:, 0], image[:, 3] = (0.8, 0.0, 0.0), (0.0, 0.8, 0.0)
    ball = Sphere((0.0, 0.0, 0.0), 1.0, rl.Material(image, roughness=1.0, name="halves"))
    scene = rl.Scene(rl.EnvironmentMap(np.ones((4, 8, 3), np.float32)), objects=(ball,))
    camera = rl.Camera.looking_at(np.array([0, 0, 6.0]), np.zeros(3), width=8, height=8, focal_length=20.0)
    for renderer in (rl.Mitsuba(samples=16), rl.Prefiltered(), rl.Whitted()):
        seen = renderer.render(scene, camera).radiance
        left, right = seen[3:5, 2:3].mean((0, 1)), seen[3:5, 5:6].mean((0, 1))
        assert left[0] > left[1] + 0.05 and right[1] > right[0] + 0.05, type(renderer).__name__
