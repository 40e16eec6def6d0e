"""Radiosity: form factors by closed forms, the linear system solved directly, furnaces, and Mitsuba's Cornell box."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh

import relume as rl
from cornell_box import cornell_box, cornell_camera
from relume.renderers.radiosity.elements import Elements, edge_lengths, no_longer_than
from relume.renderers.radiosity.radiosity import PreparedRadiosity
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Sphere
from relume.sphere.environment_map import EnvironmentMap
from solids import built, quad, room
from walls import differences_by_wall

BLACK = EnvironmentMap(np.zeros((8, 16, 3), np.float32))
GREY, WHITE = Diffuse((0.5, 0.5, 0.5)), Diffuse((1.0, 1.0, 1.0))
INSIDE = rl.Camera.looking_at(np.array([0.5, 0.5, 0.9]), np.array([0.5, 0.4, 0]), width=8, height=8, focal_length=5)
COARSE = rl.renderers.Radiosity(patch=2.0, element=2.0, refinements=0)
ONE = quad([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]], WHITE, name="floor")


def glowing(reflectance: float, radiance: float) -> Material:
    return Material((reflectance, reflectance, reflectance), specular=0.0, emission=(radiance, radiance, radiance))


def parallel(distance: float) -> float:
    """The form factor between two equal parallel squares of side 1 (Howell C-11)."""
    x = 1 / distance
    first = np.log(np.sqrt((1 + x * x) ** 2 / (1 + 2 * x * x)))
    return float(
        2 / (np.pi * x * x) * (first + 2 * x * np.hypot(1, x) * np.arctan(x / np.hypot(1, x)) - 2 * x * np.arctan(x))
    )


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0])
def test_parallel_squares_see_each_other_as_the_closed_form_says(distance: float):
    above = quad([[0, distance, 0], [1, distance, 0], [1, distance, 1], [0, distance, 1]], WHITE)
    found = rl.renderers.form_factors(Scene(BLACK, (ONE, above)), rays=1 << 16)
    if distance == 1.0:
        np.testing.assert_allclose(parallel(1.0), 0.199825, rtol=1e-5)
    for i, j in ((0, 1), (1, 0)):
        # No bias: within four standard deviations of independent rays; those that are spread are far closer.
        assert abs(found.factors[i, j] - parallel(distance)) < 4 * found.deviation[i, j]
        np.testing.assert_allclose(found.factors[i, j], parallel(distance), atol=2e-3)
    assert found.factors[0, 0] == found.factors[1, 1] == 0


def test_perpendicular_squares_see_each_other_as_the_closed_form_says():
    wall = quad([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], WHITE)
    found = rl.renderers.form_factors(Scene(BLACK, (ONE,), (wall,)), rays=1 << 16)
    np.testing.assert_allclose([found.factors[0, 1], found.factors[1, 0]], 0.200044, atol=2e-3)  # Howell C-14


def test_form_factors_close_and_are_reciprocal():
    low = quad([[0.2, 0.3, 0.2], [0.2, 0.3, 0.5], [0.9, 0.3, 0.5], [0.9, 0.3, 0.2]], WHITE, name="board")
    found = rl.renderers.form_factors(Scene(BLACK, room(WHITE)), rays=1 << 14)
    np.testing.assert_allclose(found.factors.sum(axis=1), 1, rtol=1e-12)
    found = rl.renderers.form_factors(Scene(BLACK, room(WHITE), (low,)), rays=1 << 14)
    exchanged = found.factors * found.area[:, None]
    # What sees the board's back is in no row; the front's are reciprocal.
    deviation = found.deviation * found.area[:, None]
    assert np.all(np.abs(exchanged - exchanged.T) <= 4 * np.hypot(deviation, deviation.T))
    np.testing.assert_allclose(found.area, [1] * 6 + [0.21], rtol=1e-6)


def test_a_white_furnace_holds_what_the_closed_form_says():
    # E/(1 − ρ) everywhere, whatever the form factors are.
    solved = replace(COARSE, unshot=1e-6, rays=20_000).prepared(Scene(BLACK, room(glowing(0.5, 1.0))))
    elements, state = solved.solution
    front = state.irradiance[: len(elements.area)]
    total = (front * elements.area[:, None]).sum(axis=0) / elements.area.sum()
    np.testing.assert_allclose(total, 2 * np.pi, rtol=1e-5)
    np.testing.assert_allclose(front, 2 * np.pi, rtol=0.03)
    np.testing.assert_allclose(rl.render(solved_scene(), INSIDE, COARSE).radiance, 2.0, rtol=0.03)


def solved_scene() -> Scene:
    return Scene(BLACK, room(glowing(0.5, 1.0)))


def test_shooting_ends_where_the_linear_system_is_solved():
    colours = [(0.8, 0.2, 0.1), (0.1, 0.7, 0.2), (0.5, 0.5, 0.5), (0.9, 0.9, 0.9), (0.3, 0.4, 0.6), (0.0, 0.0, 0.0)]
    walls = room(
        *(Diffuse(colour) for colour in colours[:5]), Material((0, 0, 0), specular=0.0, emission=(3.0, 2.0, 1.0))
    )
    triangles = [replace(wall, faces=wall.faces[k : k + 1]) for wall in walls for k in (0, 1)]
    found = rl.renderers.form_factors(Scene(BLACK, tuple(triangles)), rays=1 << 15)
    reflectance, emitted = np.repeat(colours, 2, axis=0), np.zeros((12, 3))
    emitted[10:] = np.pi * np.array([3.0, 2.0, 1.0])
    solution = np.stack(
        [np.linalg.solve(np.eye(12) - reflectance[:, [k]] * found.factors, emitted[:, k]) for k in range(3)], axis=-1
    )
    _, state = replace(COARSE, unshot=1e-5, rays=300_000).prepared(Scene(BLACK, walls)).solution
    radiosity = emitted + reflectance * state.irradiance[:12]
    np.testing.assert_allclose(radiosity, solution, rtol=0.02, atol=1e-9)
    assert not state.irradiance[12:].any()


def test_what_a_square_sends_to_another_has_no_bias():
    below = quad([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]], Diffuse((0, 0, 0)))
    above = quad([[0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1]], Material((0, 0, 0), specular=0.0, emission=(1, 1, 1)))
    scene, got = Scene(BLACK, (below, above)), []
    for seed in range(24):
        elements, state = replace(COARSE, rays=200).prepared(scene, seed=seed).solution
        got.append((state.irradiance[:2, 0] * elements.area[:2]).sum())
    z = (np.mean(got) - np.pi * parallel(1.0)) / (np.std(got, ddof=1) / np.sqrt(len(got)))
    assert abs(z) < 4


def test_steps_show_light_arriving_and_the_ambient_term_what_is_to_come():
    scene = Scene(BLACK, room(*[Diffuse((0.7, 0.7, 0.7))] * 3, glowing(0.7, 2.0), *[Diffuse((0.7, 0.7, 0.7))] * 2))
    method = replace(COARSE, rays=5000, samples=1)
    with_, without = (list(replace(method, ambient=on).prepared(scene).steps(INSIDE, every=3)) for on in (True, False))
    left = [step.left for step in with_]
    assert left[0] == 1
    assert left[-1] <= method.unshot
    assert all(later < earlier for earlier, later in pairwise(left))
    assert [step.shots for step in with_[:3]] == [0, 3, 6]
    means = [float(step.radiance.mean()) for step in without]
    assert all(later >= earlier for earlier, later in pairwise(means))
    # The ambient term guesses the end from the first shots: closer than what has arrived.
    final = means[-1]
    assert abs(with_[1].radiance.mean() - final) < 0.5 * abs(means[1] - final)
    np.testing.assert_allclose(with_[-1].radiance.mean(), final, rtol=2e-3)


def test_the_red_wall_colours_the_floor_beside_it():
    grey = Diffuse((0.7, 0.7, 0.7))
    red = Diffuse((0.7, 0.05, 0.05))
    scene = Scene(BLACK, room(red, grey, grey, glowing(0.7, 1.0), grey, grey))
    elements, state = (
        rl.renderers.Radiosity(patch=0.5, element=0.4, refinements=0, rays=40_000).prepared(scene).solution
    )
    floor = slice(elements.first[2], elements.first[3])
    redness = state.irradiance[floor, 0] / state.irradiance[floor, 1]
    x = elements.corners[floor].mean(axis=1)[:, 0]
    assert redness[x < 0.25].mean() > redness[x > 0.75].mean() + 0.1
    assert redness[x > 0.75].mean() > 1


def test_an_even_sky_shows_a_board_at_its_reflectance():
    board = quad([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], GREY)
    camera = rl.Camera.looking_at(np.array([0, 1.0, 0.1]), np.zeros(3), width=4, height=4, focal_length=8)
    even = EnvironmentMap(np.full((8, 16, 3), 2.0, np.float32))
    seen = rl.render(Scene(even, (board,)), camera, rl.renderers.Radiosity(patch=1.0, element=1.0, samples=1))
    np.testing.assert_allclose(seen.radiance, 1.0, rtol=0.03)
    beside = rl.Camera.looking_at(np.array([0, 1.0, 9.0]), np.array([0, 2.0, 20.0]), width=2, height=2, focal_length=8)
    np.testing.assert_allclose(rl.render(Scene(even, (board,)), beside, COARSE).radiance, 2.0, rtol=1e-6)


def test_divided_surfaces_keep_their_area_and_share_their_vertices():
    mesh = quad([[0, 0, 0], [2, 0, 0], [2.5, 1, 0], [0, 1, 0]], GREY, textured=True)
    fine, parent = no_longer_than(mesh, np.arange(2), 0.3)
    assert edge_lengths(fine).max() <= 0.3
    corners = fine.vertices[fine.faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    assert np.all(across > 0)
    np.testing.assert_allclose(np.bincount(parent, across), [1.0, 1.25], rtol=1e-6)
    # Every inner edge belongs to two triangles: no vertex lies on another's side.
    pairs = np.sort(np.stack([fine.faces, np.roll(fine.faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, count = np.unique(pairs, axis=0, return_counts=True)
    ends = fine.vertices[edges]
    outline = count == 1
    assert np.isin(count, (1, 2)).all()
    around = np.linalg.norm(ends[outline, 0] - ends[outline, 1], axis=-1).sum()
    np.testing.assert_allclose(around, 2 + np.hypot(0.5, 1) + 2.5 + 1, rtol=1e-6)


def test_elements_are_finer_where_a_shadow_ends():
    board = quad([[0.3, 0.3, 0.3], [0.3, 0.3, 0.7], [0.7, 0.3, 0.7], [0.7, 0.3, 0.3]], Diffuse((0.1, 0.1, 0.1)))
    black = Diffuse((0.02, 0.02, 0.02))
    small = quad([[0.45, 0.9, 0.45], [0.55, 0.9, 0.45], [0.55, 0.9, 0.55], [0.45, 0.9, 0.55]], glowing(0, 50.0))
    scene = Scene(BLACK, room(black), (board, small))
    solved = rl.renderers.Radiosity(patch=0.5, element=0.2, refinements=1, contrast=0.3, rays=60_000).prepared(scene)
    coarse, fine = solved.coarse, solved.solution[0]
    assert len(coarse.area) < len(fine.area) < 3 * len(coarse.area)
    np.testing.assert_allclose(fine.area.sum(), coarse.area.sum(), rtol=1e-6)
    floor = slice(fine.first[2], fine.first[3])
    middle = np.abs(fine.corners[floor].mean(axis=1)[:, [0, 2]] - 0.5).max(axis=1)
    assert fine.area[floor][middle < 0.35].mean() < 0.8 * fine.area[floor][middle > 0.4].mean()


def test_flat_patches_have_one_colour_each_and_outlines_are_black():
    scene = Scene(BLACK, room(Diffuse((0.5, 0.5, 0.5)), *[GREY] * 2, glowing(0.5, 1.0), *[GREY] * 2))
    camera = replace(INSIDE, width=32, height=32, focal_length=20.0)
    flat = rl.render(scene, camera, replace(COARSE, rays=2000, flat=True, samples=1)).radiance
    assert 3 <= len(np.unique(flat.reshape(-1, 3), axis=0)) <= 12
    lines = rl.render(scene, camera, replace(COARSE, rays=2000, flat=True, outlines=True, samples=1)).radiance
    black = ~lines.any(axis=-1)
    assert 0.02 < black.mean() < 0.3
    np.testing.assert_array_equal(lines[~black], flat[~black])


def test_the_same_seed_gives_the_same_pixels_with_any_threads():
    one, two, other = (
        rl.render(
            cornell_box(),
            cornell_camera(8),
            rl.renderers.Radiosity(patch=0.5, element=0.2, refinements=1, unshot=0.1, rays=3000, threads=t, gather=2),
            seed=s,
        ).radiance
        for t, s in ((1, 4), (2, 4), (1, 5))
    )
    np.testing.assert_array_equal(one, two)
    assert np.any(one != other)


def test_smooth_bodies_have_no_creases_and_corners_have():
    smooth = Elements.of(prepared_for(Sphere((0.5, 0.5, 0.5), 0.2, GREY)).scene, 2.0, 2.0)
    ball = smooth.vertex[smooth.first[6] :]
    assert len(np.unique(ball)) == 162  # the quartered icosahedron's
    walls = smooth.vertex[: smooth.first[6]]
    assert len(np.unique(walls)) == 24
    block = Elements.of(prepared_for(built(trimesh.creation.box((0.2, 0.2, 0.2)), GREY)).scene, 2.0, 2.0)
    assert len(np.unique(block.vertex[block.first[6] :])) == 24  # eight corners, each with three sides


def prepared_for(solid: Sphere | Mesh) -> PreparedRadiosity:
    return COARSE.prepared(Scene(BLACK, room(glowing(0.5, 1.0)), (solid,)))


def test_triangles_without_an_area_hold_no_light_and_do_no_harm():
    walls = room(glowing(0.5, 1.0))
    flat = replace(walls[2], faces=np.concatenate([walls[2].faces, np.array([[0, 1, 1], [2, 2, 2]], np.int32)]))
    seen = rl.render(Scene(BLACK, (*walls[:2], flat, *walls[3:])), INSIDE, replace(COARSE, rays=20_000)).radiance
    np.testing.assert_allclose(seen, 2.0, rtol=0.03)


def test_change_comes_by_subtraction():
    change = replace(COARSE, rays=500, samples=1).change(cornell_box(), cornell_camera(8))
    assert change.matte.max() == 1
    assert change.objects[change.matte == 0].any() == False  # noqa: E712
    assert np.isfinite(change.difference).all()


def test_a_ground_without_an_end_and_bad_settings_are_refused():
    with pytest.raises(rl.errors.UnsupportedScene, match="ground plane has no end; give it a size"):
        COARSE.prepared(Scene(BLACK, (rl.Plane(GREY), *room(glowing(0.5, 1.0)))))
    for settings in ({"rays": 0}, {"patch": -1.0}, {"samples": 0}, {"gather": 4, "flat": True}, {"contrast": 0.0}):
        with pytest.raises(ValueError, match=next(iter(settings))):
            replace(COARSE, **settings)
    with pytest.raises(ValueError, match="more than 2000000 triangles"):
        replace(COARSE, patch=1e-4).prepared(Scene(BLACK, room(glowing(0.5, 1.0)))).solution  # noqa: B018


@pytest.mark.slow
@pytest.mark.parametrize("gather", [0, 64])
def test_the_cornell_box_is_mitsubas_within_two_per_cent_on_every_wall(gather: int):
    differ = differences_by_wall(rl.renderers.Radiosity(gather=gather, samples=16))
    assert len(differ) == 7
    assert max(differ.values()) < 0.02, differ
