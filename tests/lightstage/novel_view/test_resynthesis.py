"""Reflectance functions from a new view: exact where nothing moves, and a known rough surface elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.field.lights import StageLights
from relume.lightstage.novel_view.resynthesis import (
    Facets,
    LightTriangles,
    resynthesised_diffuse,
    resynthesised_specular,
    without_shift,
)
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.lightstage.surface.chromaticity import ramp, ramped
from relume.lightstage.surface.torrance_sparrow import grooved_reflection, half_vector
from relume.sphere.directions import normalised
from small_stages import grid_directions

LIGHTS = StageLights.towards(even_directions(600))
WHITE = np.full(3, 3**-0.5)


def towards(degrees: float, turn: float = 0.0) -> np.ndarray:
    angle, turn = np.radians(degrees), np.radians(turn)
    return np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])


def rough(view: np.ndarray, normal: np.ndarray, width: float = 0.25) -> np.ndarray:
    """Specular values (N, P, 3) of grooves that lean by `width` radians, as Torrance and Sparrow have them."""
    values = np.zeros((len(LIGHTS), len(normal), 3), np.float32)
    for index, light in enumerate(LIGHTS.directions):
        lean = np.arccos(np.clip(np.einsum("pk,pk->p", half_vector(view, light), normal), -1, 1))
        reflected = np.exp(-((lean / width) ** 2)) * grooved_reflection(view, light, normal)
        values[index] = np.where(normal @ light > 0, reflected, 0)[:, None]
    return values


def few_pixels(view: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals (P, 3) within 50° of +Z and as many times the view."""
    normals = np.stack([towards(angle, turn) for angle in (0, 25, 50) for turn in (10, 130, 250)])
    return normals, np.broadcast_to(view, normals.shape).copy()


def test_a_view_that_did_not_move_sees_the_very_data() -> None:
    generator = np.random.default_rng(1)
    normals, view = few_pixels(towards(10, 40))
    values = generator.normal(size=(len(LIGHTS), len(normals), 3)).astype(np.float32)
    same = resynthesised_specular(values, LIGHTS, normals, view, view.copy())
    assert np.array_equal(same, values)
    alpha = generator.uniform(-0.4, 0.4, (len(normals), 2))
    assert np.array_equal(resynthesised_diffuse(values, LIGHTS, normals, view, view.copy(), alpha), values)


def test_a_view_that_hardly_moved_sees_hardly_anything_else() -> None:
    """Equation 9 itself, not the short cut for views that did not move."""
    generator = np.random.default_rng(2)
    normals, view = few_pixels(towards(10, 40))
    values = generator.uniform(0, 1, (len(LIGHTS), len(normals), 3)).astype(np.float32)
    lit = generator.uniform(size=values.shape[:2]) > 0.3
    moved = normalised(view + 1e-7)
    found = resynthesised_specular(values, LIGHTS, normals, view, moved, lit)
    assert np.allclose(found, values, atol=2e-3)


def test_a_rough_surface_is_seen_from_another_side_as_it_is() -> None:
    normals, view = few_pixels(towards(5, 200))
    new_view = np.broadcast_to(towards(35), normals.shape).copy()
    seen = np.einsum("pk,pk->p", normals, new_view) > 0.2
    truth = rough(new_view, normals)[:, seen]
    first = rough(view, normals)
    found = resynthesised_specular(first, LIGHTS, normals, view, new_view)[:, seen]
    kept = np.abs(first[:, seen] - truth).sum() / truth.sum()
    error = np.abs(found - truth).sum() / truth.sum()
    assert kept > 0.8  # the lobes moved: unmoved ones are wrong
    assert error < 0.12
    assert np.allclose(found.sum(axis=0), truth.sum(axis=0), rtol=0.12)


def test_facets_that_could_not_be_measured_lean_evenly_to_all_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    normal, view = np.array([[0.0, 0.0, 1.0]]), towards(75, 180)[None]
    new_view = towards(60)[None]
    truth = rough(new_view, normal, 0.4)
    first = rough(view, normal, 0.4)

    def error() -> float:
        return np.abs(resynthesised_specular(first, LIGHTS, normal, view, new_view) - truth).sum() / truth.sum()

    assert error() < 0.2
    monkeypatch.setattr(Facets, "at", lambda facets, cosine, pixels: np.zeros((len(pixels), 3)))
    assert error() > 0.2


def test_no_highlight_appears_where_the_light_is_in_shadow() -> None:
    normals, view = few_pixels(towards(0))
    new_view = np.broadcast_to(towards(30), normals.shape).copy()
    values = rough(view, normals)
    lit = np.broadcast_to((LIGHTS.directions[:, 0] > 0)[:, None], values.shape[:2])
    values = values * lit[..., None]
    found = resynthesised_specular(values, LIGHTS, normals, view, new_view, lit)
    assert np.all(found[~lit] == 0)
    assert found[lit].sum() > 0.1 * values.sum()


def test_blocks_of_any_shape_are_worked_on_alike() -> None:
    normals, view = few_pixels(towards(5, 200))
    new_view = np.broadcast_to(towards(35), normals.shape)
    values = rough(view, normals)
    flat = resynthesised_specular(values, LIGHTS, normals, view, new_view)
    n, first, second = (each.reshape(3, 3, 3) for each in (normals, view, new_view))
    shaped = resynthesised_specular(values.reshape(-1, 3, 3, 3), LIGHTS, n, first, second)
    assert np.array_equal(shaped.reshape(flat.shape), flat)
    one = resynthesised_specular(values[:, 4:5], LIGHTS, normals[4:5], view[4:5], new_view[4:5])
    assert np.array_equal(one, flat[:, 4:5])


def test_a_shift_of_chromaticity_is_undone() -> None:
    generator = np.random.default_rng(3)
    body = normalised(generator.uniform(0.1, 1, (200, 3)))
    shift = generator.uniform(-0.45, 0.8, 200)
    assert np.allclose(without_shift(ramped(body, WHITE, shift), shift, WHITE), body, atol=1e-12)


def test_the_diffuse_part_takes_the_new_views_chromaticity_and_keeps_its_amount() -> None:
    normals, view = few_pixels(towards(0))
    new_view = np.broadcast_to(towards(30, 50), normals.shape)
    body, alpha = normalised([0.6, 0.37, 0.27]), np.broadcast_to([-0.1, 0.35], (len(normals), 2))
    incident = np.maximum(LIGHTS.directions @ normals.T, 0)
    first, second = (
        incident[..., None] * ramped(body, WHITE, ramp(alpha, incident * np.einsum("pk,pk->p", normals, each)))
        for each in (view, new_view)
    )
    found = resynthesised_diffuse(first.astype(np.float32), LIGHTS, normals, view, new_view, alpha)
    assert np.abs(first - second).max() > 0.01
    assert np.allclose(found, second, atol=1e-6)
    black = resynthesised_diffuse(0 * found, LIGHTS, normals, view, new_view, 0 * alpha)
    assert np.all(black == 0)


@pytest.mark.parametrize("count", [1, 3, 7, 50])
def test_weights_of_the_nearest_lights_sum_to_one_and_a_light_is_itself(count: int) -> None:
    lights = StageLights.towards(even_directions(count))
    triangles = LightTriangles.of(lights)
    near, weights, _ = triangles.weights(even_directions(2000))
    assert np.allclose(weights.sum(axis=1), 1) and weights.min() >= 0 and near.max() < count
    near, weights, real = triangles.weights(lights.directions)
    own = np.sum(weights * real * (near == np.arange(count)[:, None]), axis=1)
    assert np.allclose(own, 1, atol=1e-9)


def test_what_is_linear_is_interpolated_as_it_is() -> None:
    """On a grid too, whose rings of coplanar lights make thin triangles."""
    grid = grid_directions(12, 24, 0.5)
    directions = even_directions(4000)
    near, weights, real = LightTriangles.of(StageLights.towards(grid)).weights(directions)
    assert real.all()
    met = np.einsum("mk,mkc->mc", weights, grid[near])
    # The weighted lights lie along the direction itself, on a flat triangle within the sphere.
    assert np.allclose(normalised(met), directions, atol=1e-9)


def test_where_no_light_is_near_the_weights_are_not_real() -> None:
    dome = even_directions(200)
    triangles = LightTriangles.of(StageLights.towards(dome[dome[:, 1] > 0.1]))
    _, weights, real = triangles.weights(np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]))
    assert np.allclose(np.sum(weights * real, axis=1), [0, 1], atol=1e-9)


def test_arrays_that_do_not_belong_together_are_refused() -> None:
    normals, view = few_pixels(towards(0))
    with pytest.raises(ValueError, match=r"expected \(N, …, 3\)"):
        resynthesised_specular(np.zeros((5, 9, 3), np.float32), LIGHTS, normals, view, view)
