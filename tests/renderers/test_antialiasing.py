"""Squares halved where their corners differ, and small objects found (Whitted 1980, §3)."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import relume as rl
from relume.renderers.whitted.antialiasing import Antialiasing, Small, sampled
from relume.scene.lights import AmbientLight, DistantLight, Linear, PointLight, SquareLaw, Unattenuated
from relume.scene.materials.whitted import Checks, WhittedMaterial

NOTHING = Small(np.zeros((0, 2)), np.zeros(0))
WHITE = rl.EnvironmentMap(np.ones((4, 8, 3), np.float32))
BLACK = rl.EnvironmentMap(np.zeros((4, 8, 3), np.float32))


def picture(function, width: int, height: int, how: Antialiasing, small: Small = NOTHING):
    """`sampled` of a function of pixel coordinates (N, 2) to radiance (N,); also all places that were asked for."""
    asked = []

    def trace(at: np.ndarray):
        asked.append(at.copy())
        values = np.zeros((len(at), 12), np.float32)
        values[:, :3] = function(at)[:, None]
        return values, np.zeros(len(at), np.int64), np.ones(len(at), np.int32)

    means, rays = sampled(trace, (0, 0, width, height), how, small, 0.0)
    return means[..., 0], rays, np.concatenate(asked)


def half_plane(at: np.ndarray) -> np.ndarray:
    return (at @ [1.0, 0.37] > 5.13).astype(float)


def area_of_half_plane() -> np.ndarray:
    """The share that it covers of each of 10 × 10 pixels."""
    x, y = np.meshgrid((np.arange(1000) + 0.5) / 100, (np.arange(1000) + 0.5) / 100)
    return half_plane(np.stack([x, y], -1)).reshape(10, 100, 10, 100).mean(axis=(1, 3))


def disc(centre, radius: float):
    """1 within a circle, 0 elsewhere, as a function of pixel coordinates."""
    return lambda at: (np.linalg.norm(at - centre, axis=1) < radius).astype(float)


def test_a_pixel_is_the_mean_of_its_four_corners_and_neighbours_share_them():
    means, rays, asked = picture(lambda at: at[:, 0] + 10 * at[:, 1], 3, 2, Antialiasing(tolerance=10.0))
    np.testing.assert_allclose(means, [[5.5, 6.5, 7.5], [15.5, 16.5, 17.5]])
    assert len(asked) == 4 * 3 == len(np.unique(asked, axis=0))
    np.testing.assert_array_equal(rays, [[1, 1, 2], [2, 2, 4]])  # the last row and column pay for the border too


def test_an_edge_is_found_by_its_area_to_the_hundredth_and_costs_only_the_pixels_it_crosses():
    means, rays, asked = picture(half_plane, 10, 10, Antialiasing(3, 0.1))
    area = area_of_half_plane()
    assert np.abs(means - area).max() < 0.02
    crossed = (area > 0) & (area < 1)
    assert 5 < crossed.sum() < 20
    assert np.all(rays[:-1, :-1][~crossed[:-1, :-1]] == 1)
    assert np.all(rays[crossed] > 8)
    assert len(asked) == len(np.unique(asked, axis=0)), "no place is traced twice"


def test_every_halving_brings_the_edge_nearer():
    area = area_of_half_plane()
    errors = [np.abs(picture(half_plane, 10, 10, Antialiasing(n, 0.1))[0] - area).max() for n in (0, 1, 2, 3, 4)]
    assert all(fine < 0.7 * coarse for coarse, fine in pairwise(errors))


def test_a_difference_within_the_tolerance_is_left_alone():
    def step(at: np.ndarray) -> np.ndarray:
        return np.where(at[:, 0] > 1.5, 1.0, 0.95)

    assert len(picture(step, 3, 1, Antialiasing(3, 0.06))[2]) == 8
    assert len(picture(step, 3, 1, Antialiasing(3, 0.04))[2]) > 8


@pytest.mark.parametrize("radius", [0.4, 0.1, 0.03])
def test_an_object_between_all_corners_is_found_and_weighed_by_its_area(radius):
    centre = np.array([4.47, 3.56])
    shape = disc(centre, radius)
    assert picture(shape, 8, 8, Antialiasing(3, 0.1))[0].sum() == 0, "it lies between the corners"
    means = picture(shape, 8, 8, Antialiasing(3, 0.1), Small(centre[None], np.array([radius])))[0]
    assert means.sum() == pytest.approx(np.pi * radius**2, rel=0.15)
    assert means[3, 4] == means.max()


def test_small_objects_shared_by_four_pixels_light_each_of_them():
    centre = np.array([5.0, 3.0]) + 0.01
    means = picture(disc(centre, 0.2), 8, 8, Antialiasing(3, 0.1), Small(centre[None], np.array([0.2])))[0]
    np.testing.assert_allclose(means[2:4, 4:6], np.pi * 0.04 / 4, rtol=0.3)


@pytest.mark.parametrize(("changes", "words"), [({"subdivisions": 9}, "0 to 8"), ({"tolerance": -0.1}, "0 or more")])
def test_settings_that_make_no_sense_are_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        Antialiasing(**changes)


# In pictures of scenes


def far_marbles(count: int) -> rl.Scene:
    """Marbles of 0.12 pixels' radius before black, at places that no corner meets."""
    random = np.random.default_rng(3)
    places = random.uniform([-0.9, -0.9, -0.1], [0.9, 0.9, 0.1], (count, 3))
    white = WhittedMaterial(diffuse=(0.0, 0.0, 0.0), ambient=(1.0, 1.0, 1.0))
    marbles = tuple(rl.Sphere(tuple(p), 0.0012 * (10 - p[2]) / 10, white, f"marble {i}") for i, p in enumerate(places))
    return rl.Scene(BLACK, objects=marbles, lights=(AmbientLight((1.0, 1.0, 1.0)),))


def test_no_small_object_is_lost():
    camera = rl.Camera.looking_at(np.array([0, 0, 10.0]), np.zeros(3), width=200, height=200, focal_length=1000)
    scene = far_marbles(40)
    rendered = rl.Whitted().render(scene, camera).radiance[..., 0]
    places = camera.project(np.array([s.centre for s in scene.objects if isinstance(s, rl.Sphere)]))
    for x, y in places:
        near = rendered[max(int(y) - 1, 0) : int(y) + 2, max(int(x) - 1, 0) : int(x) + 2]
        assert near.sum() > 0.5 * np.pi * 0.12**2
    assert rendered.sum() == pytest.approx(40 * np.pi * 0.12**2, rel=0.1)
    one_ray = rl.Whitted(antialiasing=None).render(scene, camera).radiance
    assert one_ray.astype(bool).any(axis=-1).sum() < 10, "without it nearly all fall between the rays"


def floor_scene() -> tuple[rl.Scene, rl.Camera]:
    floor = rl.Plane(WhittedMaterial(diffuse=Checks((0.9, 0.9, 0.1), (0.8, 0.1, 0.1), 1.0)), (30, 30))
    ball = rl.Sphere((0, 1, 0), 1.0, WhittedMaterial(diffuse=(0.2, 0.2, 0.6), specular=(0.4, 0.4, 0.4)))
    lights = (DistantLight((1, 2, 1), (np.pi, np.pi, np.pi)), AmbientLight((0.2, 0.2, 0.2)))
    camera = rl.Camera.looking_at(np.array([0, 2, 7.0]), np.array([0, 0.8, 0]), width=96, height=72, focal_length=100)
    return rl.Scene(WHITE, (floor,), (ball,), lights), camera


def rough_scene() -> tuple[rl.Scene, rl.Camera]:
    """`floor_scene` with a ball whose reflected rays are scattered, lit by lamps of every fall-off too."""
    scene, camera = floor_scene()
    rough = rl.Sphere((1.5, 0.6, 1), 0.6, WhittedMaterial(specular=(0.8, 0.8, 0.8), roughness=0.1))
    falloffs = (Unattenuated(), Linear(8.0), SquareLaw())
    lamps = tuple(PointLight((x, 3.0, 2.0), (4.0, 4.0, 4.0), falloff) for x, falloff in enumerate(falloffs))
    return replace(scene, lights=(*scene.lights, *lamps)).adding(rough), camera


def encoded_error(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean((np.clip(a, 0, 1) ** (1 / 2.2) - np.clip(b, 0, 1) ** (1 / 2.2)) ** 2)))


def uniform(scene: rl.Scene, camera: rl.Camera, side: int) -> tuple[np.ndarray, int]:
    """side² rays through each pixel, and how many rays their trees had."""
    fine = camera.resized(camera.width * side, camera.height * side)
    render = rl.Whitted(constellation=0, antialiasing=None).render(scene, fine)
    means = render.radiance.reshape(camera.height, side, camera.width, side, 3).mean(axis=(1, 3))
    assert render.rays is not None
    return means, int(render.rays.sum())


def test_adaptive_sampling_takes_a_third_of_the_rays_of_uniform_sampling_of_the_same_error():
    scene, camera = floor_scene()
    truth, _ = uniform(scene, camera, 16)
    render = rl.Whitted(constellation=0).render(scene, camera)
    assert render.rays is not None
    error = encoded_error(render.radiance, truth)
    assert error < 0.008
    # The coarsest uniform sampling that is no worse; its rays, against ours.
    side = next(n for n in range(2, 16) if encoded_error(uniform(scene, camera, n)[0], truth) <= error)
    coarser, rays = uniform(scene, camera, side - 1)
    assert encoded_error(coarser, truth) > error
    assert render.rays.sum() <= 0.35 * rays


def test_rays_go_to_edges_shadows_and_texture_and_not_to_the_sky():
    scene, camera = floor_scene()
    rays = rl.Whitted(constellation=0).render(scene, camera).rays
    assert rays is not None and rays.shape == (72, 96) and rays.dtype == np.int32
    assert np.median(rays[:10]) == 1
    assert np.percentile(rays[40:], 90) > 10 * np.median(rays[:10])


def test_the_pixels_do_not_depend_on_the_number_of_threads():
    scene, camera = rough_scene()
    one, many = (rl.Whitted(threads=n).render(scene, replace(camera, width=200, height=150), seed=7) for n in (1, 5))
    np.testing.assert_array_equal(one.radiance, many.radiance)
    np.testing.assert_array_equal(one.rays, many.rays)
    other = rl.Whitted().render(scene, replace(camera, width=200, height=150), seed=8)
    assert np.any(other.radiance != one.radiance)


def test_a_region_of_a_picture_is_that_part_of_it():
    scene, camera = rough_scene()
    prepared = rl.Whitted().prepared(scene)
    whole, part = prepared.render(camera), prepared.render(camera, region=(30, 20, 70, 50))
    np.testing.assert_array_equal(part.radiance, whole.radiance[20:50, 30:70])
    np.testing.assert_array_equal(part.depth, whole.depth[20:50, 30:70])
    with pytest.raises(ValueError, match="region 90,0,100,10"):
        prepared.render(camera, region=(90, 0, 100, 10))
