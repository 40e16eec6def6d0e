"""What must hold of a difference whatever the scene: exact zeros, proportionality to light, and repeatable bytes."""

from dataclasses import fields, replace

import numpy as np
import pytest

from relume.renderers.mitsuba.differential import Differential
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_points
from solids import sphere

CAMERA = Camera.looking_at(np.array([0, 1.0, 2.5]), np.array([0, 0.6, 0]), width=24, height=16, focal_length=16)
FLOOR = Plane(Diffuse((0.6, 0.5, 0.4)), (3.0, 2.0))
BALL = sphere(Material((0.9, 0.3, 0.2), metallic=0.0, roughness=0.4), centre=(0.2, 0.31, 0), radius=0.3)
PLANES = ("objects", "difference", "matte", "depth", "normal", "albedo")


def light(scale=1.0):
    x, y, z = np.moveaxis(LatLong().directions(pixel_points(LatLong(), 32)), -1, 0)
    sky, sun = np.stack([1 + 0.5 * y, 1 + 0.3 * x, 1 - 0.4 * z], -1), 20 * np.exp(30 * (0.6 * x + 0.8 * y - 1))
    radiance = sky + sun[..., None]
    return EnvironmentMap((scale * radiance).astype(np.float32))


SCENE = Scene(light(), (FLOOR,), (BALL,))
RENDERER = Differential(samples=32)


@pytest.fixture(scope="module")
def change():
    return RENDERER.change(SCENE, CAMERA, seed=1)


def test_without_objects_nothing_changes_anywhere():
    nothing = RENDERER.change(SCENE.without_objects(), CAMERA, seed=1)
    for plane in ("objects", "difference", "matte", "objects_variance", "difference_variance"):
        np.testing.assert_array_equal(getattr(nothing, plane), 0.0, err_msg=plane)


def test_an_object_that_a_real_surface_hides_changes_nothing():
    buried = sphere(Diffuse((0.8, 0.8, 0.8)), centre=(0, -2, 0), radius=0.5)
    endless = replace(SCENE, local=(Plane(FLOOR.material),), objects=(buried,))
    down = Camera.looking_at(np.array([0, 1.0, 2.5]), np.zeros(3), width=24, height=16, focal_length=40)
    hidden = RENDERER.change(endless, down, seed=1)
    for plane in ("objects", "difference", "matte"):
        np.testing.assert_array_equal(getattr(hidden, plane), 0.0, err_msg=plane)


def test_where_no_real_surface_is_seen_the_difference_is_exactly_nothing(change):
    rays = CAMERA.rays()
    sky = np.ones(rays.shape[:2], bool)
    # The floor's far edge is at z = −1; a pixel with no corner on the floor sees none of it.
    for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
        grid = np.stack(np.meshgrid(np.arange(24) + corner[0], np.arange(16) + corner[1]), -1).astype(float)
        way = CAMERA.rays_through(grid)
        reach = np.where(way[..., 1] < 0, -CAMERA.position[1] / np.minimum(way[..., 1], -1e-9), 1e6)
        met = CAMERA.position + reach[..., None] * way
        sky &= ~((np.abs(met[..., 0]) < 1.6) & (np.abs(met[..., 2]) < 1.1))
    empty = sky & (change.matte == 0)
    assert empty.sum() > 50
    np.testing.assert_array_equal(change.difference[empty], 0.0)
    np.testing.assert_array_equal(change.objects[change.matte == 0], 0.0)
    assert np.any(change.difference[~sky] != 0)


def test_a_quick_change_is_the_same_change_in_one_pass():
    quick = Differential(samples=128, quick=True).change(SCENE, CAMERA, seed=1)
    usual = Differential(samples=512).change(SCENE, CAMERA, seed=2)
    assert (quick.passes, quick.samples) == (1, 128)
    assert not quick.difference_variance.any()  # unknown
    # The other has a quarter of its variance; of some hundred pixels a few are beyond three deviations.
    for plane in ("objects", "difference"):
        variance = 5 * getattr(usual, f"{plane}_variance")
        off = np.abs(getattr(quick, plane) - getattr(usual, plane)) / (np.sqrt(variance) + 1e-3)
        assert np.mean(off > 3) < 0.02, plane
        sums = float(getattr(quick, plane).sum()), float(getattr(usual, plane).sum())
        assert sums[0] == pytest.approx(sums[1], abs=4 * float(np.sqrt(variance.sum()))), plane


def test_four_times_the_light_changes_four_times_as_much_to_the_bit(change):
    # Powers of two scale single-precision numbers exactly, and no decision of a path depends on the light's unit.
    more = RENDERER.change(replace(SCENE, light=light(4.0)), CAMERA, seed=1)
    np.testing.assert_array_equal(more.difference, 4 * change.difference)
    np.testing.assert_array_equal(more.objects, 4 * change.objects)


def test_one_and_two_threads_make_the_same_bytes_and_another_seed_others(change):
    one = replace(RENDERER, threads=1).change(SCENE, CAMERA, seed=1)
    two = replace(RENDERER, threads=2).change(SCENE, CAMERA, seed=1)
    for field in fields(change):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(two, field.name), err_msg=field.name)
        np.testing.assert_array_equal(getattr(one, field.name), getattr(change, field.name), err_msg=field.name)
    other = RENDERER.change(SCENE, CAMERA, seed=2)
    assert np.any(other.difference != change.difference)


def test_every_plane_is_finite_and_of_the_pictures_size(change):
    for name in (*PLANES, "objects_variance", "difference_variance"):
        plane = getattr(change, name)
        assert plane.dtype == np.float32 and plane.shape[:2] == (16, 24), name
        assert np.all(np.isfinite(plane)), name
    assert np.all((change.matte >= 0) & (change.matte <= 1))
    assert change.matte.max() == 1.0 and np.all(change.objects >= 0)


@pytest.mark.slow
def test_the_variance_it_states_is_that_of_repeated_pictures():
    repeats = [RENDERER.change(SCENE, CAMERA, seed=seed) for seed in range(100, 132)]
    for plane in ("objects", "difference"):
        scatter = np.var([getattr(r, plane) for r in repeats], axis=0, ddof=1).mean(dtype=np.float64)
        stated = np.mean([getattr(r, f"{plane}_variance").mean(dtype=np.float64) for r in repeats])
        # 32 repeats of 384 pixels: the mean of the variances is good to a few hundredths.
        assert stated == pytest.approx(scatter, rel=0.15), plane
