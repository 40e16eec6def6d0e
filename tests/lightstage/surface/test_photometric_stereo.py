"""Lambertian lobes and the normals they say; which lights reach a pixel, by brightness."""

from __future__ import annotations

import numpy as np
import pytest

from angles import degrees_between
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.lightstage.surface.photometric_stereo import bright_level, lambertian_lobes, lit, towards_camera
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised

LIGHTS = StageLights.towards(even_directions(200))
NORMALS = normalised(np.random.default_rng(3).normal(size=(40, 3)))
LENGTHS = np.linspace(0.05, 0.3, 40)
SHADED = np.maximum(LIGHTS.directions @ NORMALS.T, 0) * LENGTHS
"""Lambertian pixels, (200, 40)."""


def degrees(found: np.ndarray) -> np.ndarray:
    return degrees_between(found, NORMALS)


def test_a_lambertian_surface_gives_its_normal_and_its_albedo_over_pi() -> None:
    lobes = lambertian_lobes(SHADED.astype(np.float32), LIGHTS)
    np.testing.assert_allclose(lobes.vectors, LENGTHS[:, None] * NORMALS, atol=1e-5)
    np.testing.assert_allclose(lobes.normals, NORMALS, atol=1e-4)
    assert lobes.weight.min() > 0.97


def test_a_third_of_the_lights_in_shadow_does_not_tilt_the_normal() -> None:
    shadow = LIGHTS.directions @ normalised([1.0, 0.4, 0.2]) > 0.4
    values = np.where(shadow[:, None], 0.02 * SHADED, SHADED).astype(np.float32)
    seen = ((~shadow[:, None]) & (SHADED > 0)).sum(axis=0) / (SHADED > 0).sum(axis=0) > 0.6
    assert seen.sum() > 25
    assert degrees(lambertian_lobes(values, LIGHTS).normals)[seen].max() < 1
    plain = normalised(np.einsum("np,nk->pk", values, LIGHTS.directions))
    assert np.median(degrees(plain)[seen]) > 3, "else the shadow would not matter"


def test_highlights_do_not_tilt_the_normal() -> None:
    half = normalised(LIGHTS.directions + np.array([0.0, 0.0, 1.0]))
    values = SHADED + 0.3 * np.maximum(half @ NORMALS.T, 0) ** 60
    assert np.median(degrees(lambertian_lobes(values.astype(np.float32), LIGHTS).normals)) < 0.5


def test_scale_of_the_values_scales_the_lobe_alone() -> None:
    values = SHADED.astype(np.float32)
    first, second = lambertian_lobes(values, LIGHTS), lambertian_lobes(values * np.float32(64), LIGHTS)
    np.testing.assert_allclose(second.vectors, 64 * first.vectors, rtol=1e-4, atol=1e-5)


def test_pixels_that_no_three_lights_say_have_no_lobe_and_no_nan() -> None:
    usable = np.zeros(SHADED.shape, bool)
    usable[:2] = True
    values = SHADED.astype(np.float32)
    values[:, 1] = 0
    lobes = lambertian_lobes(values, LIGHTS, usable)
    assert not lobes.vectors.any() and not lobes.normals.any() and not lobes.weight.any()


def test_values_of_other_lights_are_refused() -> None:
    with pytest.raises(ValueError, match="expected \\(200 lights, pixels\\)"):
        lambertian_lobes(SHADED[:100].astype(np.float32), LIGHTS)


def test_views_point_to_the_camera_and_along_z_without_one() -> None:
    camera = Camera.looking_at(np.array([0, 0, 4.0]), np.zeros(3), width=3, height=3, focal_length=3.0)
    view = towards_camera(camera, (3, 3))
    np.testing.assert_allclose(view[1, 1], [0, 0, 1], atol=1e-6)
    assert view[1, 2, 0] < 0, "the right pixel sees the camera to its left"
    np.testing.assert_array_equal(towards_camera(None, (2, 2))[1, 1], [0, 0, 1])


def few(values: list[float]) -> np.ndarray:
    """One pixel under as many lights, (N, 1, 3)."""
    return np.repeat(np.array(values, np.float32)[:, None, None], 3, axis=-1)


def test_lights_below_the_fraction_of_the_bright_level_are_in_shadow() -> None:
    assert lit(few([1.0, 0.3, 0.11, 0.09, 0.0]))[:, 0].tolist() == [True, True, True, False, False]


def test_a_highlight_in_one_light_of_forty_does_not_put_the_others_in_shadow() -> None:
    values = few([100.0] + [1.0] * 20 + [0.01] * 19)
    assert lit(values)[:, 0].sum() == 21
    assert bright_level(values.mean(axis=-1))[0] == pytest.approx(1.0)


def test_a_pixel_that_is_always_black_is_lit_by_none() -> None:
    assert not lit(few([0.0] * 6)).any()


def test_the_shadow_map_of_a_blocked_half_is_the_half() -> None:
    lights = StageLights.towards(normalised(np.random.default_rng(1).normal(size=(200, 3))))
    facing, open_sky = lights.directions[:, 2], lights.directions[:, 0] > 0
    pixel = np.where(open_sky, np.maximum(facing, 0), 0.02 * np.maximum(facing, 0))
    field = Pictures(np.tile(pixel[:, None, None, None], (1, 2, 1, 3)).astype(np.float32), lights)
    found = lit(field.block(slice(0, len(field.lights)), slice(0, 1)))
    assert found.shape == (200, 1, 1)
    np.testing.assert_array_equal(found[facing > 0.12, 0, 0], open_sky[facing > 0.12])
    assert not found[facing <= 0, 0, 0].any()


def test_strong_indirect_light_makes_the_lit_part_too_large() -> None:
    """As the paper says of the ear in its Fig. 13."""
    direct = few([1.0, 0.9, 0.0, 0.0])
    assert lit(direct + np.float32(0.2)).sum() == 4 and lit(direct).sum() == 2
