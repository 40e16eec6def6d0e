"""Masked values are foretold from the lights around: constants exactly, smooth functions closely, nothing invented."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.field.filling import filled
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions

LIGHTS = StageLights.towards(even_directions(100))


def smooth_values(rows: int = 3, columns: int = 4) -> np.ndarray:
    """Lambertian-like reflectance functions (N, rows, columns, 3) of normals all over the sphere, without a kink."""
    normals = even_directions(rows * columns)
    shade = 1.2 + LIGHTS.directions @ normals.T
    return (shade.reshape(100, rows, columns, 1) * [0.9, 0.5, 0.3]).astype(np.float32)


def scattered_mask(share: float, shape: tuple[int, int] = (3, 4)) -> np.ndarray:
    return np.random.default_rng(3).random((100, *shape)) < share


def test_values_that_are_not_masked_are_the_same_to_the_bit() -> None:
    values, masked = smooth_values(), scattered_mask(0.3)
    assert np.array_equal(filled(values, masked, LIGHTS)[~masked], values[~masked])


def test_a_constant_function_is_filled_with_its_constant() -> None:
    values, masked = np.full((100, 3, 4, 3), 0.375, np.float32), scattered_mask(0.5)
    found = filled(np.where(masked[..., None], np.float32(99), values), masked, LIGHTS)
    np.testing.assert_allclose(found, 0.375, rtol=1e-6)


def test_a_smooth_function_comes_back_within_two_percent() -> None:
    values, masked = smooth_values(), scattered_mask(0.3)
    found = filled(np.where(masked[..., None], np.float32(0), values), masked, LIGHTS)
    error = np.abs(found - values)[masked].sum() / values[masked].sum()
    assert 0 < error < 0.02


def test_two_lights_at_the_same_distance_count_alike() -> None:
    lights = StageLights.towards(np.array([[0, 0, 1.0], [0.3, 0, 1], [-0.3, 0, 1]]))
    values = np.array([9, 1, 3], np.float32)[:, None, None, None] * np.ones((1, 1, 1, 3), np.float32)
    found = filled(values, np.array([True, False, False])[:, None, None], lights)
    np.testing.assert_allclose(found[0], 2.0, rtol=1e-6)


def test_a_filled_value_is_never_beyond_those_it_was_foretold_from() -> None:
    values = np.random.default_rng(1).random((100, 3, 4, 3), np.float32) ** 8
    masked = scattered_mask(0.9)
    masked[0] = False
    found = filled(values, masked, LIGHTS)
    known = np.where(masked[..., None], np.nan, values)
    assert (found >= np.nanmin(known, axis=0)).all() and (found <= np.nanmax(known, axis=0)).all()


def test_masked_values_themselves_count_nowhere() -> None:
    values, masked = smooth_values(), scattered_mask(0.6)
    other = np.where(masked[..., None], np.float32(1e6), values)
    assert np.array_equal(filled(values, masked, LIGHTS), filled(other, masked, LIGHTS))


def test_some_lights_alone_come_out_as_they_do_with_all() -> None:
    values, masked = smooth_values(), scattered_mask(0.4)
    both = filled(values, masked, LIGHTS)
    assert np.array_equal(filled(values, masked, LIGHTS, slice(20, 45)), both[20:45])


def test_where_all_near_lights_are_masked_farther_ones_are_asked() -> None:
    values = smooth_values()
    masked = np.zeros(values.shape[:3], bool)
    near = np.argsort(-LIGHTS.directions @ LIGHTS.directions[40])[:60]
    masked[near] = True
    found = filled(np.where(masked[..., None], np.float32(0), values), masked, LIGHTS)
    assert np.isfinite(found).all() and (found[40] > 0).all()


def test_a_pixel_masked_under_every_light_is_refused_by_its_place() -> None:
    masked = np.zeros((100, 3, 4), bool)
    masked[:, 2, 1] = True
    with pytest.raises(ValueError, match="1 pixels are masked under all 100 lights, the first in column 1 of row 2"):
        filled(smooth_values(), masked, LIGHTS)
