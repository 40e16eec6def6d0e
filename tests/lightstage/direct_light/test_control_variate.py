"""Light between the lights of a stage, with a mesh of the subject.

A square hovers over a matte floor: what the floor receives from any direction is known in closed form.
"""

from __future__ import annotations

from dataclasses import replace
from time import process_time

import numpy as np
import pytest

from relume.lightstage.direct_light.control_variate import estimate_seconds, relight_with_mesh, row_blocks
from relume.lightstage.direct_light.light_directions import ALL_RAYS, DirectedLight, quadtree_lights
from relume.lightstage.direct_light.model import DirectLightSettings, fit_direct_light
from relume.lightstage.direct_light.surface import disc_directions, over_neighbours
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Barycentric, Interpolation, NearestLight, Smooth
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh
from relume.sphere.environment_map import EnvironmentMap

HEIGHT, HALF = 0.6, 0.4
CAMERA = Camera.looking_at(np.array([2.2, 1.1, 0.1]), np.zeros(3), width=28, height=20, focal_length=30.0)
ALBEDO = np.array([0.5, 0.3, 0.2])
EXACT = DirectLightSettings(light_radius=0.0, alpha=0.2, side=1, filter_share=0.0)
LIGHTS = StageLights.towards(even_directions(80))
BETWEEN = StageLights.towards(even_directions(13))
EVEN = DirectedLight(BETWEEN.directions, np.ones((13, 3)), np.zeros(13))
"""Light from `BETWEEN`, where none of the stage's lights is."""


def quad(height: float, half: float) -> Mesh:
    corners = np.array([[-half, height, -half], [-half, height, half], [half, height, half], [half, height, -half]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(corners.astype(np.float32), faces, Diffuse(np.array([0.5, 0.5, 0.5])))


MESHES = (quad(0.0, 1.5), quad(HEIGHT, HALF))


def floor_under(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radiance (N, H, W, 3) per irradiance of the floor in closed form, and the pixels (H, W) that show it."""
    through = CAMERA.rays()
    place = CAMERA.position - through * (CAMERA.position[1] / through[..., 1:2])
    above = CAMERA.position + through * ((HEIGHT - CAMERA.position[1]) / through[..., 1:2])
    hidden = np.abs(above[..., [0, 2]]).max(axis=-1) < HALF
    shown = (through[..., 1] < 0) & (np.abs(place[..., [0, 2]]).max(axis=-1) < 1.5) & ~hidden
    values = []
    for light in directions:
        crossing = place + light * HEIGHT / max(light[1], 1e-9)
        lit = (np.abs(crossing[..., [0, 2]]).max(axis=-1) > HALF) & shown & (light[1] > 0)
        values.append(lit[..., None] * ALBEDO * max(light[1], 0) / np.pi)
    return np.array(values, np.float32), shown


def upsampled(
    field: Pictures,
    lights: StageLights,
    meshes: tuple[Mesh, ...] = MESHES,
    settings: DirectLightSettings = DirectLightSettings(),
) -> np.ndarray:
    """Pictures (M, H, W, 3) under each of these lights alone, of irradiance 1."""
    radius, one = np.array([settings.light_radius]), np.ones((1, 3))
    each = (DirectedLight(direction[None], one, radius) for direction in lights.directions)
    return np.stack([relight_with_mesh(field, light, meshes, settings) for light in each])


FIELD = Pictures(floor_under(LIGHTS.directions)[0], LIGHTS, CAMERA)


def interpolated(by: Interpolation, field: Pictures = FIELD) -> np.ndarray:
    """Pictures (M, H, W, 3) under the lights `BETWEEN` without a mesh."""
    return np.einsum("mn,nhwc->mhwc", by.weights(LIGHTS, BETWEEN.directions), field.values)


def error_of(pictures: np.ndarray) -> float:
    truth, shown = floor_under(BETWEEN.directions)
    return float(np.abs(pictures - truth)[:, shown].sum() / truth[:, shown].sum())


def test_with_a_mesh_a_shadow_stands_where_it_belongs() -> None:
    assert error_of(upsampled(FIELD, BETWEEN, MESHES, EXACT)) < 0.01


def test_a_rough_mesh_still_helps() -> None:
    shifted = (MESHES[0], quad(HEIGHT * 1.05, HALF * 1.03))
    without = error_of(interpolated(Smooth()))
    assert 0.05 < without < 0.5
    assert error_of(upsampled(FIELD, BETWEEN, shifted, EXACT)) < 0.7 * without


def test_in_its_own_lights_the_field_is_what_was_measured() -> None:
    # A third of them, from all sides.
    some = StageLights.towards(LIGHTS.directions[::3])
    found = upsampled(FIELD, some, MESHES, DirectLightSettings(alpha=0.2, side=2, remainder=Smooth()))
    np.testing.assert_allclose(found, FIELD.values[::3], atol=2e-4)


def test_a_map_is_the_sum_over_its_directions() -> None:
    power = np.random.default_rng(3).random((len(BETWEEN), 3))
    light = replace(EVEN, irradiances=power)
    summed = np.einsum("mhwc,mc->hwc", upsampled(FIELD, BETWEEN, MESHES, EXACT), power)
    np.testing.assert_allclose(relight_with_mesh(FIELD, light, MESHES, EXACT), summed, atol=1e-4)


def test_relighting_is_linear_in_the_light() -> None:
    power = np.random.default_rng(4).random((2, len(BETWEEN), 3))
    one, other, both = (
        relight_with_mesh(FIELD, replace(EVEN, irradiances=p), MESHES, EXACT)
        for p in (power[0], power[1], 2 * power[0] + power[1])
    )
    np.testing.assert_allclose(both, 2 * one + other, rtol=1e-4, atol=1e-4)


def test_lights_add_whatever_share_of_the_whole_they_make() -> None:
    sky = np.ones((16, 32, 3), np.float32)
    sunny = sky.copy()
    sunny[3, 20] = 5000.0
    strong, faint = quadtree_lights(EnvironmentMap(sunny), 400), quadtree_lights(EnvironmentMap(0.1 * sky), 120)
    assert set(strong.looked_at()[:, 0]) == {1, ALL_RAYS} and set(faint.looked_at()[:, 0]) == {ALL_RAYS}
    settings = DirectLightSettings(light_radius=0.0, alpha=0.2, side=3)
    both, one, other = (
        relight_with_mesh(FIELD, light, MESHES, settings)
        for light in (DirectedLight.of([faint, strong]), strong, faint)
    )
    # Against the fainter light's own picture, not against the sum, in which it would drown.
    assert np.abs(both - one - other).max() < 2e-5 * both.max()
    assert np.abs(both - one - other).mean() < 1e-4 * other.mean()


def test_pictures_do_not_depend_on_memory_or_threads() -> None:
    settings = DirectLightSettings(alpha=0.2, side=2)
    little = relight_with_mesh(FIELD, EVEN, MESHES, settings, memory=80 * 28 * 96 * 5, threads=1)
    np.testing.assert_allclose(little, relight_with_mesh(FIELD, EVEN, MESHES, settings, threads=2), atol=1e-5)
    assert row_blocks(FIELD, 80 * 28 * 96 * 5) == tuple(slice(i, min(i + 3, 20)) for i in range(0, 20, 3))
    with pytest.raises(ValueError, match=r"memory is 0.1 MB; rows of 28 pixels under 80 lights need at least 0.7 MB"):
        relight_with_mesh(FIELD, EVEN, MESHES, settings, memory=100_000)


def test_how_far_it_is_is_said_within_a_block_too():
    """All of a picture is one block, which took half a minute without a word."""
    many = StageLights.towards(even_directions(60))
    light, said = DirectedLight(many.directions, np.ones((60, 3)), np.zeros(60)), []
    relight_with_mesh(FIELD, light, MESHES, EXACT, said.append, threads=2)
    assert said == sorted(said) and len(said) == 5 and said[0] == pytest.approx(16 / 60) and said[-1] == 1


def test_the_time_of_a_mesh_is_estimated(monkeypatch: pytest.MonkeyPatch) -> None:
    # Of the processor, so that what else runs on it does not count.
    monkeypatch.setattr("relume.lightstage.direct_light.control_variate.perf_counter", process_time)
    begin = process_time()
    relight_with_mesh(FIELD, EVEN, MESHES, EXACT)
    took = process_time() - begin
    assert 0.05 * took < estimate_seconds(FIELD, EVEN, MESHES, EXACT) < 20 * took + 1


def test_mirrors_are_never_below_zero() -> None:
    glints = FIELD.values.copy()
    glints[7, 4:12] += 5.0
    field = Pictures(glints, LIGHTS, CAMERA)
    assert upsampled(field, BETWEEN, MESHES, EXACT)[:, 4:12].min() >= 0
    assert upsampled(field, BETWEEN, MESHES, replace(EXACT, spike_interpolation=Smooth()))[:, 4:12].min() < -0.1
    for i in (3, 7):
        one = DirectedLight(EVEN.directions[i : i + 1], EVEN.irradiances[:1], EVEN.radii[:1])
        assert relight_with_mesh(field, one, MESHES, EXACT)[4:12].min() >= 0


def test_a_mirror_is_left_to_interpolation() -> None:
    glints = np.zeros((80, 20, 28, 3), np.float32)
    glints[7] = 5.0
    field = Pictures(glints, LIGHTS, CAMERA)
    found = upsampled(field, BETWEEN, MESHES, replace(EXACT, remainder=Smooth()))
    np.testing.assert_allclose(found, interpolated(Barycentric(), field), atol=1e-6)


def test_direct_light_is_fitted_with_its_scales() -> None:
    rng = np.random.default_rng(5)
    basis = rng.random((80, 2, 4)).astype(np.float32)
    scales = rng.random((4, 2, 3)) + 0.2
    indirect = 0.3 + LIGHTS.directions @ np.array([0.1, 0.05, 0.0])
    values = np.einsum("nbk,kbc->nkc", basis, scales) + indirect[:, None, None]
    np.testing.assert_allclose(fit_direct_light(values.astype(np.float32), basis, LIGHTS), scales, atol=1e-3)
    negative = np.einsum("nbk,kbc->nkc", basis, scales * np.array([1, -0.3])[:, None])
    assert fit_direct_light(negative.astype(np.float32), basis, LIGHTS).min() == 0


def test_the_leaves_of_a_map_hold_its_light_and_its_sun() -> None:
    radiance = np.ones((32, 64, 3), np.float32)
    radiance[10, 40] = 1e5
    light = EnvironmentMap(radiance)
    leaves = quadtree_lights(light, 200)
    np.testing.assert_allclose(leaves.irradiances.sum(axis=0), light.total(), rtol=1e-9)
    sun = int(np.argmax(leaves.irradiances[:, 0]))
    inclination, azimuth = np.pi * 10.5 / 32, 2 * np.pi * 40.5 / 64 - np.pi
    expected = [np.sin(inclination) * np.sin(azimuth), np.cos(inclination), -np.sin(inclination) * np.cos(azimuth)]
    np.testing.assert_allclose(leaves.directions[sun], expected, atol=1e-6)
    assert 190 <= len(leaves.directions) <= 203


def test_a_dark_map_has_no_leaves_and_gives_a_black_picture() -> None:
    leaves = quadtree_lights(EnvironmentMap(np.zeros((8, 16, 3), np.float32)))
    assert len(leaves.directions) == 0
    assert not relight_with_mesh(FIELD, leaves, MESHES, EXACT).any()


def test_a_disc_is_filled_evenly_about_its_centre() -> None:
    centre = np.array([0.48, 0.6, 0.64])
    disc = disc_directions(centre, 0.1, 400)
    angle = np.arccos(disc @ centre)
    assert angle.max() <= 0.1
    # Half of an even disc lies within 1/√2 of its radius.
    np.testing.assert_allclose(np.median(angle), 0.1 / np.sqrt(2), rtol=0.01)
    assert disc_directions(centre, 0.1, 1).tolist() == [centre.tolist()]


def test_neighbours_get_their_share() -> None:
    dot = np.zeros((1, 15), np.float32)
    dot[0, 7] = 1
    expected = [[0.01, 0.08, 0.01], [0.08, 0.64, 0.08], [0.01, 0.08, 0.01]]
    np.testing.assert_allclose(over_neighbours(dot, 5, 0.1).reshape(3, 5)[:, 1:4], expected, atol=1e-7)


def test_wrong_calls_are_refused() -> None:
    with pytest.raises(ValueError, match="the field has no camera"):
        upsampled(Pictures(FIELD.values, LIGHTS), BETWEEN, MESHES)
    away = Camera.looking_at(np.array([9.0, 1, 0]), np.array([20.0, 1, 0]), width=28, height=20, focal_length=30.0)
    with pytest.raises(ValueError, match="sees nothing of the mesh"):
        upsampled(Pictures(FIELD.values, LIGHTS, away), BETWEEN, MESHES, EXACT)
    with pytest.raises(ValueError, match="no mesh was given"):
        upsampled(FIELD, BETWEEN, ())
    with pytest.raises(ValueError, match="alpha is 0"):
        DirectLightSettings(alpha=0)
    with pytest.raises(ValueError, match="count is 0"):
        quadtree_lights(EnvironmentMap(np.zeros((8, 16, 3), np.float32)), 0)


def test_the_nearest_cell_may_stand_for_the_rest() -> None:
    assert error_of(upsampled(FIELD, BETWEEN, MESHES, replace(EXACT, remainder=NearestLight()))) < 0.01


def test_pixels_beside_the_mesh_leave_the_others_fits_as_they_are() -> None:
    random = np.random.default_rng(4)
    basis = random.uniform(size=(len(LIGHTS), 2, 40)).astype(np.float32)
    scales = random.uniform(0.2, 1, size=(40, 2, 3))
    values = np.einsum("nbk,kbc->nkc", basis, scales).astype(np.float32)
    beside = np.zeros(40, bool)
    beside[[0, 5, 6, 39]] = True
    alone = fit_direct_light(values[:, ~beside], basis[..., ~beside], LIGHTS)
    basis[..., beside] = 0
    found = fit_direct_light(values, basis, LIGHTS)
    np.testing.assert_allclose(found[~beside], alone, rtol=1e-4)
    np.testing.assert_allclose(alone, scales[~beside], atol=1e-3)
    assert not found[beside].any()
    assert fit_direct_light(values, 0 * basis, LIGHTS).shape == (40, 2, 3)
