"""Matte, depth, normal and albedo: what the composite is made with."""

import numpy as np
import pytest

import gltf_files
from montecarlo import assert_matte_of_disc
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.limits import MATTE_SAMPLES
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Plane
from relume.sphere.directions import rotation_about
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

LIGHT = EnvironmentMap(np.ones((4, 8, 3), np.float32))
GREY = Diffuse((0.5, 0.5, 0.5))
FEW = Mitsuba(samples=16)
DOWN = rotation_about([1, 0, 0], -np.pi / 2)


@pytest.mark.parametrize(
    "material",
    [GREY, Material((0, 0, 0)), Material(metallic=1.0, roughness=0.0), Material(roughness=0.0, transmission=1.0)],
    ids=["diffuse", "black", "mirror", "glass"],
)
def test_the_matte_of_a_sphere_sums_to_the_area_of_its_disc(material):
    camera = Camera(64, 64, 80.0, np.array([0, 0, 4.0]), np.eye(3))
    matte = render(Scene(LIGHT, objects=(sphere(material),)), camera, FEW).matte
    # A sphere of radius 1 at 4: half-angle asin(1/4), on the film a disc of radius f tan(asin(1/4)) = f/√15.
    radius = 80 / np.sqrt(15)
    # Rays fall at random only in the ≈ 8r pixels of the edge, each with a variance of at most ¼.
    noise = np.sqrt(8 * radius * 0.25 / MATTE_SAMPLES)
    assert_matte_of_disc(matte, radius, (0, 0), 4 * noise + 0.003 * np.pi * radius**2)  # facets


def test_real_surfaces_hide_objects_from_the_matte():
    # A sphere half sunk into the table, seen from above at a slant: what is below the surface is not seen.
    camera = Camera.looking_at(np.array([0, 3.0, 4]), np.zeros(3), width=48, height=48, focal_length=60)
    ball = sphere(GREY)
    free = render(Scene(LIGHT, objects=(ball,)), camera, FEW).matte
    sunk = render(Scene(LIGHT, local=(Plane(GREY),), objects=(ball,)), camera, FEW).matte
    assert np.all(sunk <= free)
    assert 0.5 * free.sum() < sunk.sum() < 0.95 * free.sum()


def test_without_objects_the_matte_is_exactly_zero():
    camera = Camera(8, 8, 8.0, np.array([0, 1.0, 0]), DOWN)
    assert not render(Scene(LIGHT, local=(Plane(GREY),)), camera, FEW).matte.any()


def test_depth_normal_and_albedo_of_a_floor_seen_from_above():
    camera = Camera(9, 9, 9.0, np.array([0, 2.0, 0]), DOWN)
    seen = render(Scene(LIGHT, local=(Plane(Diffuse((0.2, 0.4, 0.6))),)), camera, FEW)
    # Depth is along the ray: 2 m over the cosine of the ray; a pixel's mean differs from its middle by about (1/9)²/24.
    expected = 2 / -camera.rays()[..., 1]
    np.testing.assert_allclose(seen.depth, expected, rtol=0.01)
    assert seen.depth[4, 4] == pytest.approx(2.0, rel=2e-3)
    change = Differential(16).change(Scene(LIGHT, local=(Plane(GREY),), objects=(sphere(GREY, radius=0.01),)), camera)
    np.testing.assert_allclose(change.depth[:3], expected[:3], rtol=0.01)
    np.testing.assert_allclose(seen.normal, np.broadcast_to([0, 1, 0], (9, 9, 3)), atol=1e-6)
    np.testing.assert_allclose(seen.albedo, np.broadcast_to([0.2, 0.4, 0.6], (9, 9, 3)), atol=1e-5)


def test_a_raised_floor_is_nearer():
    camera = Camera(5, 5, 50.0, np.array([0, 2.0, 0]), DOWN)
    assert render(Scene(LIGHT, local=(Plane(GREY, height=0.5),)), camera, FEW).depth[2, 2] == pytest.approx(
        1.5, rel=1e-3
    )


def test_depth_is_the_mean_over_what_was_hit_and_zero_where_nothing_was():
    # A floor of 2 m × 2 m from 2 m above: its edge lies on pixels 1.5 pixels from the rim.
    camera = Camera(9, 9, 6.0, np.array([0, 2.0, 0]), DOWN)
    depth = render(Scene(LIGHT, local=(Plane(GREY, size=(2.0, 2.0)),)), camera, FEW).depth
    assert depth[0, 0] == 0
    hit = depth[depth > 0]
    assert hit.min() > 1.99
    assert hit.max() < np.sqrt(2**2 + 1 + 1) + 0.01


def test_a_textures_upper_left_corner_is_upper_left_in_the_render(tmp_path):
    image = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    (tmp_path / "square.glb").write_bytes(gltf_files.square_glb(image=image))
    scene = Scene(LIGHT, objects=read_meshes(tmp_path / "square.glb"))
    seen = render(scene, Camera(8, 8, 15.0, np.array([0, 0, 4.0]), np.eye(3)), Mitsuba(samples=64))
    for picture in (seen.albedo, seen.radiance):
        upper_left, upper_right, lower_left, lower_right = (picture[y, x] for y in (1, 6) for x in (1, 6))
        assert upper_left[0] > 2 * max(upper_left[1], upper_left[2])  # red
        assert upper_right[1] > 2 * max(upper_right[0], upper_right[2])  # green
        assert lower_left[2] > 2 * max(lower_left[0], lower_left[1])  # blue
        assert lower_right.min() > 0.6  # white


def test_normals_of_a_sphere_point_outwards_in_the_world():
    camera = Camera.looking_at(np.array([4.0, 0, 0]), np.zeros(3), width=9, height=9, focal_length=20)
    normal = render(Scene(LIGHT, objects=(sphere(GREY),)), camera, FEW).normal
    np.testing.assert_allclose(normal[4, 4], [1, 0, 0], atol=0.01)  # mean over a pixel of 3°
    assert normal[2, 4][1] > 0.2  # above the middle it turns up
    assert normal[4, 6][2] < -0.2  # and to the right of a camera on +X is −Z
