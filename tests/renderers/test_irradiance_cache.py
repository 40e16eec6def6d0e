"""The irradiance cache: its octree by a slow twin, gradients by closed forms, furnaces, and Mitsuba's Cornell box."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import relume as rl
from cornell_box import cornell_box, cornell_camera
from relume.renderers.irradiance_cache.hemisphere import Hemisphere
from relume.renderers.irradiance_cache.octree import BEHIND, Octree
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from solids import quad, room
from walls import differences_by_wall

BLACK, EVEN = (EnvironmentMap(np.full((8, 16, 3), value, np.float32)) for value in (0.0, 2.0))
INSIDE = rl.Camera.looking_at(np.array([0.5, 0.5, 0.9]), np.array([0.5, 0.4, 0]), width=8, height=8, focal_length=5)
FEW = rl.renderers.IrradianceCache(error=0.5, rays=64, samples=1, shadow_rays=1)


def glowing(reflectance: float, radiance: float) -> Material:
    return Material((reflectance, reflectance, reflectance), specular=0.0, emission=(radiance, radiance, radiance))


def test_the_octree_finds_what_trying_every_record_finds():
    random = np.random.default_rng(5)
    places, normals = random.random((300, 3)), normalised(random.normal(size=(300, 3)))
    normals[: len(normals) // 2] = [0, 1, 0]
    reaches, error = random.uniform(0.02, 0.6, 300), 0.7
    octree = Octree(np.zeros(3), np.ones(3), error * 0.6)
    for place, normal, reach in zip(places, normals, reaches, strict=True):
        octree.insert(place, normal, reach, error * reach)
    asked, facing = random.random((200, 3)), np.tile([0.0, 1.0, 0.0], (200, 1))
    first, record, weight = octree.weights(asked, facing, error, 2)
    found = 0
    for i, (at, n) in enumerate(zip(asked, facing, strict=True)):
        # ε = |x − x_i| / R_i + √(1 − n·n_i), of records that do not lie behind (Ward 1988, eq. 9).
        errors = np.linalg.norm(at - places, axis=1) / reaches + np.sqrt(np.maximum(1 - normals @ n, 0))
        deep = np.einsum("ij,ij->i", at - places, normals + n) / 2
        expected = np.flatnonzero((errors < error) & (deep > -BEHIND * reaches))
        here = slice(first[i], first[i + 1])
        assert sorted(record[here]) == expected.tolist()
        if expected.size:
            wanted = 1 / errors[record[here]] - 1 / error
            np.testing.assert_allclose(weight[here], wanted / wanted.sum(), rtol=1e-9)
        found += len(expected)
        assert (octree.first_bare(asked[i : i + 1], facing[i : i + 1], 0, error) == 1) == bool(expected.size)
    assert found > 500


@pytest.mark.parametrize("normal", [(0.0, 1.0, 0.0), (0.6, 0.0, -0.8)])
def test_a_hemisphere_gives_irradiance_and_how_it_changes_as_the_surface_turns(normal: tuple[float, float, float]):
    hemisphere, n = Hemisphere(30, 94), np.array(normal)
    directions = hemisphere.directions(n, np.random.default_rng(6))
    assert np.all(directions @ n > 0)
    # L = 1 + ω·t on the whole sphere: E = π + 2π/3 n·t.
    t = np.array([0.3, -0.2, 0.5])
    radiance = np.tile((1 + directions @ t)[None, :, None], (1, 1, 3))
    np.testing.assert_allclose(hemisphere.irradiance(radiance)[0], np.pi + 2 * np.pi / 3 * (n @ t), rtol=2e-3)
    # E(n) − E(n_i) = (n_i × n)·∇: the gradient is 2π/3 n_i × t.
    turning = hemisphere.turning(radiance, n[None])[0]
    np.testing.assert_allclose(turning[:, 0], 2 * np.pi / 3 * np.cross(n, t), atol=0.02)


def test_a_hemisphere_gives_how_irradiance_changes_along_the_surface():
    # A square of radiance 1 at height 1 over a dark ground, and what its closed form changes by, 0.2 m off its middle.
    def exact(x: float) -> float:
        sides = [(0.5 - x, 0.5), (0.5 + x, 0.5)]
        return sum(float(_corner(a, b)) * 2 for a, b in sides) * np.pi

    at = np.array([0.2, 0.0, 0.0])
    hemisphere, gradients = Hemisphere(40, 126), []
    for seed in range(40):
        directions = hemisphere.directions(np.array([0.0, 1.0, 0.0]), np.random.default_rng([7, seed]))
        distance = 1 / directions[:, 1]
        hit = at + distance[:, None] * directions
        radiance = (np.abs(hit[:, [0, 2]]).max(axis=1) < 0.5).astype(np.float64)
        gradients.append(
            hemisphere.moving(np.tile(radiance[None, :, None], (1, 1, 3)), 1 / distance[None], np.array([[0, 1.0, 0]]))[
                0
            ]
        )
    mean, slope = np.mean(gradients, axis=0), (exact(0.21) - exact(0.19)) / 0.02
    np.testing.assert_allclose(slope, -0.328, atol=1e-3)
    np.testing.assert_allclose(mean[0], slope, rtol=0.06)
    np.testing.assert_allclose(mean[1:], 0, atol=0.03)


def _corner(a: float, b: float) -> float:
    """The form factor from a point to a parallel rectangle at distance 1 with one corner above it (Howell B-4)."""
    p, q = np.hypot(1, a), np.hypot(1, b)
    return float((a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi))


@pytest.mark.parametrize(("bounces", "expected"), [(0, 1.5), (1, 1.75), (2, 1.875), (24, 2.0)])
def test_a_furnace_shows_what_the_closed_form_says(bounces: int, expected: float):
    # Walls that emit 1 and reflect a half: 1 + ½ + ¼ + …, wherever one looks. Where all is even nothing has a bias.
    scene, method = Scene(BLACK, room(glowing(0.5, 1.0))), replace(FEW, shadow_rays=64, bounces=bounces)
    means = [float(rl.render(scene, INSIDE, method, seed=seed).radiance.mean()) for seed in range(12)]
    deviation = np.std(means, ddof=1) / np.sqrt(len(means))
    assert deviation < 0.02
    assert abs(np.mean(means) - expected) < 4 * deviation


def test_under_an_even_sky_a_board_shows_its_reflectance_and_a_trench_is_darker():
    grey = Diffuse((0.5, 0.5, 0.5))
    board = quad([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], grey)
    camera = rl.Camera.looking_at(np.array([0, 1.0, 0.1]), np.zeros(3), width=4, height=4, focal_length=8)
    method = replace(FEW, shadow_rays=1024)
    np.testing.assert_allclose(rl.render(Scene(EVEN, (board,)), camera, method).radiance, 1.0, rtol=0.02)
    walls = [quad([[x, 0, 1], [x, 2, 1], [x, 2, -1], [x, 0, -1]], grey) for x in (-0.3, 0.3)]
    trench = rl.render(Scene(EVEN, (board, *walls)), camera, method).radiance
    dark = rl.render(Scene(EVEN, (board, *walls)), camera, replace(method, bounces=0)).radiance
    assert dark.mean() < trench.mean() < 0.9


def test_a_ground_without_an_end_is_shown():
    scene = Scene(EVEN, (rl.Plane(Diffuse((0.5, 0.5, 0.5))),))
    camera = rl.Camera.looking_at(np.array([0, 1.0, 0.1]), np.zeros(3), width=4, height=4, focal_length=8)
    np.testing.assert_allclose(rl.render(scene, camera, replace(FEW, shadow_rays=1024)).radiance, 1.0, rtol=0.02)


def test_a_smaller_error_takes_more_records_and_they_stand_closer_in_corners():
    caches = [replace(FEW, error=error).prepared(cornell_box(), cornell_camera(24)).cache for error in (0.6, 0.3)]
    few, many = (cache.seen for cache in caches)
    assert 2 * few < many
    tree = caches[1].octree.tree
    place, reach = tree.place[:many], tree.reach[:many]
    back = place[:, 2] > 0.558
    corner = np.minimum(place[:, 0], 0.55 - place[:, 0]) < 0.05
    assert reach[back & corner].mean() < 0.7 * reach[back & ~corner].mean()


def test_final_gathering_agrees_with_interpolation():
    scene, camera = cornell_box(), cornell_camera(12)
    method = replace(FEW, error=0.3, rays=256, samples=4, shadow_rays=4)
    plain, gathered = (rl.render(scene, camera, replace(method, gather=n)).radiance.mean(axis=(0, 1)) for n in (0, 16))
    np.testing.assert_allclose(plain, gathered, rtol=0.03)


def test_records_are_drawn_over_the_picture():
    scene, camera = cornell_box(), cornell_camera(32)
    plain, drawn = (rl.render(scene, camera, replace(FEW, records=on)).radiance for on in (False, True))
    marked = np.any(plain != drawn, axis=-1)
    assert 0.05 < marked.mean() < 0.8
    assert set(np.unique(drawn[marked]).tolist()) <= {0.0, 1.0}


def test_the_same_seed_gives_the_same_pixels_with_any_threads():
    one, two, other = (
        rl.render(cornell_box(), cornell_camera(12), replace(FEW, threads=t), seed=s).radiance
        for t, s in ((1, 4), (2, 4), (1, 5))
    )
    np.testing.assert_array_equal(one, two)
    assert np.any(one != other)


def test_records_are_found_where_the_eye_does_not_see():
    # The wall behind the eye: were its records not found again, each ray that meets it would make another.
    scene = Scene(BLACK, room(glowing(0.5, 1.0)))
    cache = replace(FEW, error=0.4).prepared(scene, INSIDE).cache
    assert (cache.octree.tree.place[: cache.octree.records, 2] > INSIDE.position[2]).any()
    assert cache.octree.records < 1500


def test_few_records_do_for_the_ground_that_goes_on_to_the_horizon():
    grey = Diffuse((0.5, 0.5, 0.5))
    wall = quad([[-1, 0, -1], [1, 0, -1], [1, 2, -1], [-1, 2, -1]], grey)
    camera = rl.Camera.looking_at(np.array([0, 1.0, 3]), np.array([0, 1.0, -1]), width=8, height=8, focal_length=8)
    cache = FEW.prepared(Scene(EVEN, (rl.Plane(grey), wall)), camera).cache
    place = cache.octree.tree.place[: cache.octree.records]
    assert np.abs(place).max() > 20
    assert 10 < cache.octree.records < 400


def test_what_is_seen_may_be_nothing_at_all():
    away = rl.Camera.looking_at(np.array([0, 1.0, 9.0]), np.array([0, 2.0, 20.0]), width=2, height=2, focal_length=8)
    scene = Scene(EVEN, (quad([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], Diffuse((0.5, 0.5, 0.5))),))
    seen = rl.render(scene, away, FEW)
    np.testing.assert_allclose(seen.radiance, 2.0, rtol=1e-6)
    assert not seen.depth.any()


def test_bad_settings_are_refused_by_name():
    for settings in ({"error": 0.0}, {"error": 2.0}, {"rays": 2}, {"bounces": -1}, {"nearest": 0.6}, {"samples": 0}):
        with pytest.raises(ValueError, match=next(iter(settings))):
            replace(FEW, **settings)


@pytest.mark.slow
@pytest.mark.parametrize("gather", [0, 32])
def test_the_cornell_box_is_mitsubas_within_two_per_cent_on_every_wall(gather: int):
    method = rl.renderers.IrradianceCache(gather=gather, samples=16, shadow_rays=16)
    differ = differences_by_wall(method)
    assert len(differ) == 7
    assert max(differ.values()) < 0.02, differ
