"""Pictures by reflection maps: light, coverage, surfaces and materials through the whole renderer."""

import dataclasses
import sys
import warnings

import numpy as np
import pytest
import trimesh
from numpy.typing import ArrayLike

from lights import constant, of_directions, sunny
from montecarlo import assert_matte_of_disc
from relume.light.reflection.brdf import GGX
from relume.light.reflection.glossy import albedo
from relume.light.reflection.lobes import Lambert, Phong
from relume.light.reflection.weights import Even, Schlick
from relume.renderers.prefiltered.filters import Mip, Plain, Preintegrated, Quadrilateral, Subdivision
from relume.renderers.prefiltered.prefiltered import Prefiltered, Shading
from relume.renderers.prefiltered.shading_inputs import GBuffer
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.materials.bumps import BumpMap, Wrinkles
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.materials.reflective import Layer, Reflective, Towards, glass, glossy, mirror
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Sphere
from relume.sphere.directions import normalised, rotation_about
from relume.sphere.environment_map import EnvironmentMap
from solids import built, quad, sphere

WHITE, GREY = Diffuse((1, 1, 1)), Diffuse((0.5, 0.5, 0.5))
FAR = Camera(64, 64, 280.0, np.array([0, 0, 10.0]), np.eye(3))
"""Sees a ball of radius 1 at the origin 56 pixels wide."""
TABLE = 2e-4
"""How near a sum over a map of 64 rows comes to its integral."""
CLOSE = Camera(24, 24, 120.0, np.array([0, 0, 6.0]), np.eye(3))
"""Sees nothing but that ball."""


def ball(material, centre=(0.0, 0.0, 0.0), radius=1.0):
    return Sphere(centre, radius, material)


def picture(material, light, camera=FAR, **settings):
    return Prefiltered(**settings).render(Scene(light, objects=(ball(material),)), camera)


def on_the_ball(camera, least=0.3):
    """Where the rays through the pixels' middles meet the ball at the origin: normals and directions to the eye.

    The mask is of pixels that see it at a cosine of at least that, and so nothing but the ball.
    """
    rays = camera.rays()
    along = rays @ camera.position
    inside = along**2 - camera.position @ camera.position + 1
    distance = -along - np.sqrt(np.maximum(inside, 0))
    normals = normalised(camera.position + distance[..., None] * rays)
    return (inside > 0) & (np.sum(normals * -rays, -1) > least), normals, -rays


def facing(cosines):
    """A G-buffer of one row of surfaces seen at these cosines."""
    cosines = np.asarray(cosines, float)
    views = np.stack([np.sqrt(1 - cosines**2), 0 * cosines, cosines], -1)[None]
    return GBuffer(np.broadcast_to([0.0, 0, 1], views.shape), views, np.zeros(views.shape[:2], int))


COSINES = np.cos(np.radians([0, 30, 60, 75, 85]))


def in_furnace(material, cosines: ArrayLike = COSINES):
    """Surfaces seen at these cosines under constant light of 1: (N, 3)."""
    return Shading.of([material], constant(64)).shade(facing(cosines))[0]


# --- light -----------------------------------------------------------------------------------------------------------


def test_a_diffuse_ball_under_constant_light_shows_its_reflectance():
    # A1: E = πL, so the radiance is ρL.
    seen = picture(Diffuse((0.2, 0.5, 0.8)), constant(64, (1, 2, 0.5)), CLOSE)
    np.testing.assert_allclose(seen.radiance, np.broadcast_to([0.2, 1.0, 0.4], (24, 24, 3)), rtol=TABLE)


def test_a_white_ball_under_a_lit_half_of_the_sky_shows_its_phases_as_the_moon():
    # A2: E/π = ½(1 + cos γ).
    light = of_directions(lambda d: (d @ normalised([1, 0.4, 0.3]) > 0).astype(float), 256)
    inside, normals, _ = on_the_ball(FAR)
    expected = 0.5 * (1 + normals @ normalised([1, 0.4, 0.3]))
    seen = picture(WHITE, light)
    np.testing.assert_allclose(seen.radiance[inside][:, 0], expected[inside], atol=4e-3)


def test_a_white_ball_under_light_that_grows_upwards_brightens_linearly():
    # A3: E = π + (2π/3) n·up.
    light = of_directions(lambda d: 1 + d[..., 1], 128)
    seen = picture(WHITE, light)
    inside, normals, _ = on_the_ball(FAR)
    np.testing.assert_allclose(seen.radiance[inside][:, 1], (1 + 2 / 3 * normals[..., 1])[inside], atol=2e-3)


@pytest.mark.parametrize("filter", [Plain(), Subdivision(), Quadrilateral(), Preintegrated(), Mip()], ids=str)
def test_a_mirror_ball_shows_the_light_that_each_pixel_reflects(filter):
    light = of_directions(lambda d: 2 + np.sin(4 * d @ [1.0, 0.5, 0.2]) * d[..., 1], 256)
    inside, normals, eyes = on_the_ball(FAR, 0.5)
    reflected = 2 * np.sum(normals * eyes, -1, keepdims=True) * normals - eyes
    expected = light.lookup(normalised(reflected))
    seen = picture(mirror((1, 0.5, 0.25)), light, filter=filter)
    # A pixel reflects a tenth of a radian, in which the light changes by a hundredth or two.
    allowed = 1e-5 if isinstance(filter, Plain) else 0.03
    np.testing.assert_allclose(seen.radiance[inside], (expected * [1, 0.5, 0.25])[inside], rtol=allowed)
    assert inside.sum() > 1500


def test_clear_glass_of_no_refraction_shows_the_light_behind_it():
    light = of_directions(lambda d: 2 + np.sin(4 * d @ [1.0, 0.5, 0.2]) * d[..., 1], 64)
    seen = picture(glass(1.0), light, filter=Plain())
    np.testing.assert_allclose(seen.radiance, light.lookup(FAR.rays()), rtol=2e-3)


@pytest.mark.parametrize(
    "material",
    [GREY, glossy(), mirror(), Material(metallic=1.0, roughness=0.7), Material((0.2, 0.5, 0.8), roughness=0.7)],
    ids=["diffuse", "glossy", "mirror", "metal", "plastic"],
)
def test_twice_the_light_is_twice_as_bright(material):
    light = sunny(32)
    one = picture(material, light, CLOSE)
    two = picture(material, EnvironmentMap(2 * light.radiance), CLOSE)
    np.testing.assert_allclose(two.radiance, 2 * one.radiance, rtol=1e-5)
    for plane in ("matte", "depth", "normal", "albedo"):
        np.testing.assert_array_equal(getattr(two, plane), getattr(one, plane))


# --- white furnace ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rho", [0.0, 0.3, 1.0])
def test_in_a_white_furnace_a_diffuse_surface_shows_its_reflectance(rho):
    np.testing.assert_allclose(in_furnace(Diffuse((rho, rho, rho))), rho, rtol=TABLE)


@pytest.mark.parametrize(
    "material",
    [mirror(), glass(1.5), glass(0.7), glossy((1, 1, 1)), Material(metallic=1.0, roughness=0.0)],
    ids=["mirror", "glass", "from within", "glossy", "polished metal"],
)
def test_in_a_white_furnace_surfaces_that_lose_nothing_cannot_be_seen(material):
    np.testing.assert_allclose(in_furnace(material), 1, rtol=2e-3)


@pytest.mark.parametrize("roughness", [0.5, np.sqrt(0.5), 1.0])
def test_in_a_white_furnace_a_rough_white_metal_shows_what_single_scattering_leaves(roughness):
    # A18: 0.68785 along the normal at α = 0.5, 1 − ln 2 at α = 1.
    seen = in_furnace(Material(metallic=1.0, roughness=roughness))
    expected = [albedo(GGX(roughness**2), np.arccos(cosine)) for cosine in COSINES]
    np.testing.assert_allclose(seen[:, 0], expected, rtol=5e-3)
    along = {0.5: 0.9158, np.sqrt(0.5): 0.68785, 1.0: 1 - np.log(2)}[roughness]
    assert seen[0, 0] == pytest.approx(along, rel=2e-3)


@pytest.mark.parametrize("transmission", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.5, 1.0])
def test_in_a_white_furnace_a_white_dielectric_is_never_brighter_than_the_light(roughness, transmission):
    seen = in_furnace(Material(roughness=roughness, transmission=transmission), [*COSINES, 0.03, 1e-3])
    assert seen.max() <= 1.001
    # Below the coat nothing is lost: what it does not reflect, the base does or goes through.
    assert seen[:5].min() > 0.98


def test_in_a_white_furnace_coloured_metal_turns_white_at_the_rim():
    red, green, blue = in_furnace(Material((0.9, 0.5, 0.1), metallic=1.0, roughness=0.0), [1.0, 0.02]).T
    assert [red[0], green[0], blue[0]] == pytest.approx([0.9, 0.5, 0.1], abs=1e-3)
    expected = 1 - 0.9 * (1 - 0.98**5)  # Schlick
    assert blue[1] == pytest.approx(expected, abs=5e-3)
    assert red[1] > green[1] > blue[1]


# --- what is covered, and by what ------------------------------------------------------------------------------------


@pytest.mark.parametrize("shift", [(0, 0), (0.3, -0.4)])
def test_the_matte_of_a_sphere_sums_to_the_area_of_its_disc(shift):
    camera = Camera(64, 64, 80.0, np.array([0, 0, 4.0]), np.eye(3))
    centre = np.array([*shift, 0]) * 4 / 80
    seen = Prefiltered().render(Scene(constant(64), objects=(ball(GREY, tuple(centre)),)), camera)
    # Radius 1 at distance 4: a cone of half-angle asin(1/4); off the axis its ellipse grows by parts in ten thousand.
    radius = 80 / np.sqrt(15)
    assert_matte_of_disc(seen.matte, radius, (-shift[1], shift[0]), 5e-3 * np.pi * radius**2)


def test_edges_are_mixed_from_object_and_background_by_coverage():
    light = constant(64, (3, 3, 3))
    seen = picture(Diffuse((0.1, 0.1, 0.1)), light)
    np.testing.assert_allclose(seen.radiance[..., 0], 0.3 * seen.matte + 3 * (1 - seen.matte), rtol=TABLE)


@pytest.mark.parametrize("filter", [Plain(), Preintegrated()], ids=str)
def test_the_background_is_the_light_that_comes_from_there(filter):
    light = sunny(64)
    seen = picture(GREY, light, filter=filter)
    behind = seen.matte == 0
    np.testing.assert_allclose(seen.radiance[behind], light.lookup(FAR.rays())[behind], rtol=1e-4)
    assert behind.sum() > 1000


def test_a_scene_without_anything_is_its_light():
    light = sunny(32)
    seen = render(Scene(light), FAR, Prefiltered())
    np.testing.assert_allclose(seen.radiance, light.lookup(FAR.rays()), rtol=1e-4)
    assert not any(plane.any() for plane in (seen.matte, seen.depth, seen.normal, seen.albedo, seen.variance))


def test_without_background_it_is_black_there_and_edges_carry_their_share():
    light = sunny(64)
    alone, before = (picture(GREY, light, background=shown) for shown in (False, True))
    assert not alone.radiance[alone.matte == 0].any()
    whole = alone.matte == 1
    np.testing.assert_array_equal(alone.radiance[whole], before.radiance[whole])
    # Over a plate: what the object leaves free shows the light behind.
    edge = (alone.matte > 0) & (alone.matte < 1)
    free = (before.radiance - alone.radiance)[edge] / light.lookup(FAR.rays())[edge]
    np.testing.assert_allclose(free.mean(1), 1 - alone.matte[edge], atol=0.1)


def test_depth_is_metres_along_the_ray_and_zero_where_nothing_is():
    seen = picture(GREY, constant(64))
    inside, normals, _ = on_the_ball(FAR)
    expected = np.linalg.norm(normals - FAR.position, axis=-1)
    np.testing.assert_allclose(seen.depth[inside], expected[inside], atol=1e-4)
    assert seen.depth[32, 32] == pytest.approx(9.0, abs=1e-3)
    assert not seen.depth[seen.matte == 0].any()
    # At edges it is the mean over what was hit, not mixed with the nothing beside it.
    edge = (seen.matte > 0) & (seen.matte < 1)
    assert seen.depth[edge].min() > 9.5
    assert seen.depth[edge].max() < 10


def test_normals_point_outwards_in_the_world_and_albedo_is_the_reflectance():
    camera = Camera.looking_at(np.array([4.0, 0, 0]), np.zeros(3), width=33, height=33, focal_length=70)
    seen = Prefiltered().render(Scene(constant(64), objects=(ball(Diffuse((0.2, 0.4, 0.6))),)), camera)
    inside, normals, _ = on_the_ball(camera, 0.5)
    np.testing.assert_allclose(seen.normal[inside], normals[inside], atol=1e-5)
    np.testing.assert_allclose(seen.albedo[inside], np.broadcast_to([0.2, 0.4, 0.6], (inside.sum(), 3)), rtol=1e-5)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (mirror((0.9, 0.8, 0.7)), (0.9, 0.8, 0.7)),
        (Material((0.9, 0.6, 0.3), metallic=1.0, roughness=0.0), (0.9, 0.6, 0.3)),
        (Material((0.2, 0.4, 0.6), roughness=0.0), (0.04 + 0.96 * 0.2, 0.04 + 0.96 * 0.4, 0.04 + 0.96 * 0.6)),
        (Reflective((Layer(Phong(), weight=Schlick((0.9, 0.6, 0.3))),)), (0.9, 0.6, 0.3)),
    ],
    ids=["mirror", "gold", "plastic", "coloured weight"],
)
def test_the_albedo_of_layers_is_what_they_reflect_along_the_normal(material, expected):
    seen = picture(material, constant(64), CLOSE)
    np.testing.assert_allclose(seen.albedo[12, 12], expected, rtol=2e-3)


def test_several_materials_in_one_picture_are_each_as_alone():
    light = sunny(64)
    places = {-2.2: mirror((1, 0.5, 0.2)), 0.0: Diffuse((0.2, 0.4, 0.8)), 2.2: Material(roughness=0.7)}
    camera = Camera(120, 40, 160.0, np.array([0, 0, 10.0]), np.eye(3))
    balls = [ball(material, (x, 0.0, 0.0)) for x, material in places.items()]
    with pytest.warns(UserWarning, match="no shadows and no reflections"):
        together = Prefiltered().render(Scene(light, objects=tuple(balls)), camera)
    alone = [Prefiltered().render(Scene(light, objects=(one,)), camera) for one in balls]
    for one in alone:
        np.testing.assert_array_equal(together.radiance[one.matte > 0], one.radiance[one.matte > 0])
    assert together.matte.sum() == pytest.approx(sum(one.matte.sum() for one in alone))


def test_nearer_objects_hide_farther_ones_and_the_scene_hides_objects():
    light, camera = constant(64), Camera(32, 32, 60.0, np.array([0, 1.0, 8.0]), np.eye(3))
    near, far = ball(Diffuse((1, 0, 0)), (0, 1.0, 2)), ball(Diffuse((0, 1, 0)), (0, 1.0, -2))
    for objects in ((near, far), (far, near)):
        with pytest.warns(UserWarning):
            seen = Prefiltered().render(Scene(light, objects=objects), camera)
        np.testing.assert_allclose(seen.radiance[16, 16], [1, 0, 0], atol=TABLE)
    sunk = ball(Diffuse((0, 0, 1)), (0, 0.0, 0))
    with pytest.warns(UserWarning):
        seen = Prefiltered().render(Scene(light, local=(Plane(GREY),), objects=(sunk,)), camera)
    free = Prefiltered().render(Scene(light, objects=(sunk,)), camera)
    assert 0.4 * free.matte.sum() < seen.matte.sum() < 0.7 * free.matte.sum()
    assert np.all(seen.matte <= free.matte + 1e-6)


# --- textures and bumps ----------------------------------------------------------------------------------------------

MARKS = np.kron(np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32), np.ones((8, 8, 1), np.float32))
"""Red upper left, green upper right, blue lower left, white lower right."""


def wall(material):
    return quad([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], material, textured=True)


def corners_of(image):
    """Its upper left, upper right, lower left and lower right, well inside."""
    return [image[y, x] for y in (4, -5) for x in (4, -5)]


@pytest.mark.parametrize(
    "material",
    [
        Material(MARKS, metallic=1.0, roughness=0.0),
        Material(MARKS, roughness=1.0),
        Reflective((Layer(Lambert(), Towards.NORMAL, colour=MARKS),)),
        Reflective((Layer(GGX(0.5), colour=MARKS),)),
    ],
    ids=["metal", "chalk", "lambert", "three-dimensional map"],
)
def test_a_textures_upper_left_corner_is_upper_left_in_the_picture(material):
    camera = Camera(20, 20, 38.0, np.array([0, 0, 4.0]), np.eye(3))
    seen = Prefiltered().render(Scene(constant(64), objects=(wall(material),)), camera)
    for image in (seen.radiance, seen.albedo):
        red, green, blue, white = corners_of(image)
        assert red[0] > 5 * max(red[1:])
        assert green[1] > 5 * max(green[0], green[2])
        assert blue[2] > 5 * max(blue[:2])
        assert white.min() > 0.5 * red[0]


def test_a_texture_on_a_sphere_stands_as_a_map_of_the_world_does():
    # The middle of the image looks along −Z: seen from there; its left half is towards −X.
    image = np.zeros((16, 32, 3), np.float32)
    image[:8, 16:] = [1, 0, 0]  # north east
    image[8:, :16] = [0, 1, 0]  # south west
    camera = Camera.looking_at(np.array([0, 0, -4.0]), np.zeros(3), width=20, height=20, focal_length=50)
    seen = Prefiltered().render(Scene(constant(64), objects=(ball(Material(image, roughness=1.0)),)), camera)
    # From −Z, +X is to the left.
    assert seen.radiance[7, 7, 0] > 0.5
    assert seen.radiance[12, 12, 1] > 0.5
    assert seen.radiance[7, 12].max() < 0.1
    assert seen.radiance[12, 7].max() < 0.1


def test_a_roughness_image_makes_each_place_as_smooth_as_it_says():
    light, buffer = sunny(16), facing(COSINES[:3])
    image = np.repeat(np.array([[0.8, 1.0]]), 4, axis=1).repeat(4, axis=0)
    varied, smooth, middling, rough = (
        Shading.of([Material(metallic=1.0, roughness=roughness)], light) for roughness in (image, 0.8, 0.9, 1.0)
    )
    # u = 0.25 is in the left half; half-way between the halves' entries the image says 0.9.
    for u, same, allowed in ((0.25, smooth, 1e-4), (0.75, rough, 1e-4), (0.5, middling, 0.03)):
        uv = np.broadcast_to([u, 0.5], (*buffer.surface.shape, 2))
        seen = varied.shade(dataclasses.replace(buffer, uv=uv))
        np.testing.assert_allclose(seen, same.shade(buffer), rtol=allowed)
    assert np.abs(smooth.shade(buffer) / rough.shade(buffer) - 1).max() > 0.2


def test_bumps_turn_normals_only_where_the_material_has_them():
    light = sunny(64)
    even, wrinkled = mirror(), mirror(bumps=Wrinkles(0.01, 0.2))
    camera = Camera(80, 40, 160.0, np.array([0, 0, 10.0]), np.eye(3))
    places = ((-1.2, 0.0, 0.0), (1.2, 0.0, 0.0))
    pictures = []
    for first in (even, wrinkled):
        with pytest.warns(UserWarning):
            objects = (ball(first, places[0]), ball(even, places[1]))
            pictures.append(Prefiltered().render(Scene(light, objects=objects), camera))
    smooth, rough = pictures
    np.testing.assert_array_equal(rough.radiance[:, 41:], smooth.radiance[:, 41:])
    np.testing.assert_array_equal(rough.normal[:, 41:], smooth.normal[:, 41:])
    inside = smooth.matte[:, :40] == 1
    turned = np.degrees(np.arccos(np.clip(np.sum(rough.normal * smooth.normal, -1)[:, :40][inside], -1, 1)))
    assert turned.mean() > 2
    np.testing.assert_array_equal(rough.matte, smooth.matte)  # the outline stays


def test_a_bump_map_tilts_a_wall_against_the_rise_of_its_heights():
    ramp = np.broadcast_to(np.linspace(0, 0.5, 65)[None, :], (8, 65)).copy()  # rises to the right, 0.25 per metre
    camera = Camera(9, 9, 9.0, np.array([0, 0, 4.0]), np.eye(3))
    material = Reflective((Layer(Lambert(), Towards.NORMAL),), bumps=BumpMap(ramp))
    seen = Prefiltered().render(Scene(constant(64), objects=(wall(material),)), camera)
    rise = 0.5 / 64 * 65 / 2
    np.testing.assert_allclose(seen.normal[4, 4], normalised([-rise, 0, 1]), atol=1e-3)


def test_a_surface_seen_from_behind_shows_its_back():
    light = of_directions(lambda d: 1 + d[..., 2], 64)
    behind = Camera(9, 9, 18.0, np.array([0, 0, -4.0]), rotation_about([0, 1, 0], np.pi))
    seen = Prefiltered().render(Scene(light, objects=(wall(WHITE),)), behind)
    np.testing.assert_allclose(seen.normal[4, 4], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(seen.radiance[4, 4], 1 - 2 / 3, rtol=5e-3)


# --- motion ----------------------------------------------------------------------------------------------------------


def box(material, turn=None):
    body = trimesh.creation.box(extents=(1.4, 1.0, 0.8))
    body.vertices = body.vertices if turn is None else body.vertices @ np.asarray(turn).T
    return built(body, material)


@pytest.mark.parametrize(
    "material", [GREY, mirror(), Material(metallic=1.0, roughness=0.7)], ids=["grey", "mirror", "metal"]
)
def test_turning_the_objects_is_turning_their_mesh_under_the_same_light(material):
    light, turn = sunny(64), rotation_about([0.2, 1, 0.1], 0.7)
    camera = Camera.looking_at(np.array([0.5, 1.0, 5.0]), np.zeros(3), width=48, height=40, focal_length=100)
    turned = Prefiltered().prepared(Scene(light, objects=(box(material),))).render(camera, turn=turn)
    built = Prefiltered().render(Scene(light, objects=(box(material, turn),)), camera)
    for plane in ("matte", "depth", "normal"):
        np.testing.assert_allclose(getattr(turned, plane), getattr(built, plane), atol=1e-4)
    np.testing.assert_allclose(turned.radiance, built.radiance, rtol=2e-3, atol=2e-3)
    still = Prefiltered().render(Scene(light, objects=(box(material),)), camera)
    assert np.abs(still.radiance - built.radiance).max() > 0.05


def test_wrinkles_turn_with_the_object():
    light, turn = constant(64), rotation_about([0, 1, 0], 0.5)
    prepared = Prefiltered().prepared(Scene(light, objects=(ball(mirror(bumps=Wrinkles(0.01, 0.3))),)))
    turned = prepared.render(FAR, turn=turn)
    # The camera goes round the other way and sees the same face of the ball.
    around = Camera(FAR.width, FAR.height, FAR.focal_length, turn.T @ FAR.position, turn.T @ FAR.rotation)
    seen = prepared.render(around)
    np.testing.assert_allclose(turned.normal, seen.normal @ turn.T, atol=1e-5)


def test_tables_are_made_once_for_many_cameras(monkeypatch):
    made, module = [], sys.modules[Prefiltered.__module__]
    real = module.reflection_map
    monkeypatch.setattr(module, "reflection_map", lambda *given: made.append(given[1]) or real(*given))
    scene = Scene(sunny(32), objects=(ball(glossy()),))
    prepared = Prefiltered().prepared(scene)
    assert made == [Lambert(), Phong()]
    cameras = [Camera.looking_at(p, np.zeros(3), width=32, height=32, focal_length=100) for p in np.eye(3) * 8 + 0.5]
    pictures = [prepared.render(camera) for camera in cameras]
    assert len(made) == 2
    for camera, seen in zip(cameras, pictures, strict=True):
        np.testing.assert_array_equal(seen.radiance, Prefiltered().render(scene, camera).radiance)


def test_materials_of_the_same_lobe_share_its_table():
    red, blue = Diffuse((1, 0, 0)), Diffuse((0, 0, 1))
    shading = Shading.of([red, blue, glossy(), glossy(specular=GGX(0.4)), Reflective((Layer(GGX(0.4)),))], sunny(16))
    tables = [[table for _, table in layers] for layers in shading.layers]
    assert tables[0][0] is tables[1][0] is tables[2][0] is tables[3][0]
    assert tables[3][1] is tables[4][0]
    assert tables[2][1] is not tables[0][0]


def test_progress_is_reported_and_the_seed_changes_nothing():
    said, scene = [], Scene(sunny(16), objects=(ball(GREY),))
    one = Prefiltered().render(scene, CLOSE, seed=1, progress=said.append)
    assert said[-1] == 1.0
    np.testing.assert_array_equal(one.radiance, Prefiltered().render(scene, CLOSE, seed=2).radiance)


def test_the_number_of_threads_does_not_change_a_bit():
    light = sunny(32)
    material = Reflective(
        (Layer(Lambert(), Towards.NORMAL), Layer(GGX(0.5)), Layer(Phong(), weight=Schlick(0.04))),
        bumps=Wrinkles(),
    )
    camera = Camera(100, 150, 900.0, np.array([0, 0, 10.0]), np.eye(3))
    one, two = (picture(material, light, camera, threads=threads) for threads in (1, 2))
    for plane in ("radiance", "matte", "depth", "normal", "albedo"):
        np.testing.assert_array_equal(getattr(two, plane), getattr(one, plane))


# --- what it cannot show, and bad input ------------------------------------------------------------------------------


def test_convex_objects_alone_are_rendered_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for shape in (ball(GREY), box(GREY), sphere(GREY, fine=3), sphere(GREY, centre=(5, 0, 0), fine=2), wall(GREY)):
            Prefiltered().prepared(Scene(constant(64), objects=(shape,)))


@pytest.mark.parametrize(
    ("objects", "names"),
    [
        ((built(trimesh.creation.torus(1.0, 0.3), GREY, "ring"),), "ring"),
        ((ball(GREY), ball(GREY, (3, 0, 0))), "sphere, sphere"),
        (tuple(ball(GREY, (3 * i, 0, 0)) for i in range(5)), "sphere, sphere, sphere, sphere…"),
    ],
    ids=["a hole", "two", "five"],
)
def test_what_would_see_itself_or_others_is_warned_of_by_name(objects, names):
    words = rf"no shadows and no reflections of objects .* \({names}\); light transport and ray tracing do"
    with pytest.warns(UserWarning, match=words):
        Prefiltered().prepared(Scene(constant(64), objects=objects))


def test_an_object_on_a_real_surface_is_warned_of():
    with pytest.warns(UserWarning, match="no shadows"):
        Prefiltered().prepared(Scene(constant(64), local=(Plane(GREY),), objects=(ball(GREY),)))


@pytest.mark.parametrize("threads", [0, -1])
def test_no_threads_are_refused(threads):
    with pytest.raises(ValueError, match=f"threads is {threads}; expected at least 1"):
        Prefiltered(threads=threads)


def good(**changes):
    normal = np.broadcast_to(np.array([0.0, 0, 1]), (2, 3, 3)).copy()
    planes = {"normal": normal, "view": normal.copy(), "surface": np.zeros((2, 3), int)} | changes
    return GBuffer(**planes)


@pytest.mark.parametrize(
    ("name", "plane"),
    [
        ("normal", np.zeros((2, 4, 3))),
        ("normal", np.zeros((3, 2, 3))),
        ("normal", np.zeros((2, 3))),
        ("view", np.zeros((2, 2, 3))),
        ("view", np.zeros((2, 3, 4))),
        ("uv", np.zeros((2, 3, 3))),
        ("uv", np.zeros((1, 3, 2))),
    ],
)
def test_planes_of_different_sizes_are_refused_by_name(name, plane):
    with pytest.raises(ValueError, match=rf"{name} is \(.*\) beside a surface of \(2, 3\); expected \(2, 3, [23]\)"):
        good(**{name: plane})


@pytest.mark.parametrize("surface", [np.zeros((2, 3)), np.zeros((2, 3, 1), int), np.zeros(3, int)])
def test_a_surface_that_is_no_plane_of_integers_is_refused(surface):
    with pytest.raises(ValueError, match=r"surface is \(.*\) .*; expected integers \(H, W\)"):
        good(surface=surface)


@pytest.mark.parametrize("name", ["normal", "view"])
@pytest.mark.parametrize("vector", [(0, 0, 0), (0, 0, 1.02), (0.5, 0.5, 0), (np.nan, 0, 1), (np.inf, 0, 0)], ids=str)
def test_vectors_that_are_not_of_unit_length_are_refused_by_place(name, vector):
    plane = np.broadcast_to(np.array([0.0, 0, 1]), (2, 3, 3)).copy()
    plane[1, 2] = vector
    with pytest.raises(ValueError, match=rf"1 vectors of {name} are not of unit length, the first at row 1, column 2"):
        good(**{name: plane})
    # Where nothing is seen they may be anything.
    surface = np.zeros((2, 3), int)
    surface[1, 2] = -1
    seen = Shading.of([GREY], constant(64)).shade(good(**{name: plane, "surface": surface}))
    assert not seen[1, 2].any()
    np.testing.assert_allclose(seen[0], 0.5, rtol=TABLE)


def test_a_material_that_is_not_there_is_refused_by_its_number():
    surface = np.array([[0, 1, 0], [0, 0, -1]])
    shading = Shading.of([GREY, WHITE], constant(64))
    np.testing.assert_allclose(shading.shade(good(surface=surface))[..., 0], [[0.5, 1, 0.5], [0.5, 0.5, 0]], rtol=TABLE)
    with pytest.raises(ValueError, match=r"the G-buffer names material 1 of 1; they are numbered from 0"):
        Shading.of([GREY], constant(64)).shade(good(surface=surface))


def test_a_g_buffer_is_shaded_as_the_renderer_shades_what_it_sees():
    light = sunny(64)
    material = glossy((0.2, 0.4, 0.8), specular_weight=Even((0.3, 0.5, 0.7)))
    inside, normals, eyes = on_the_ball(FAR)
    buffer = GBuffer(np.where(inside[..., None], normals, 0), eyes, np.where(inside, 0, -1))
    seen = picture(material, light, filter=Plain(), background=False)
    shaded = Shading.of([material], light, Plain()).shade(buffer)
    np.testing.assert_allclose(shaded[inside], seen.radiance[inside], rtol=1e-4, atol=1e-5)
    assert not shaded[~inside].any()


def test_a_picture_in_bands_of_rows_is_the_same(monkeypatch: pytest.MonkeyPatch):
    light = EnvironmentMap(np.random.default_rng(7).random((32, 64, 3)).astype(np.float32))
    scene = Scene(light, objects=(ball(GREY), ball(WHITE, (0.7, 0.4, 1.5), 0.4)))
    with pytest.warns(UserWarning, match="no shadows"):
        prepared = Prefiltered().prepared(scene)
    whole, shares = prepared.render(FAR), []
    monkeypatch.setattr("relume.renderers.prefiltered.prefiltered._BAND", 64 * 7)
    banded = prepared.render(FAR, progress=shares.append)
    for name in ("radiance", "variance", "matte", "depth", "normal", "albedo"):
        assert np.array_equal(getattr(banded, name), getattr(whole, name)), name
    assert len(shares) == 11 and shares[-1] == 1.0
