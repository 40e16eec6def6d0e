from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.cosine import compress_cosine, laid_out
from relume.lightstage.relighting.relighting import weighted_sum

GENERATOR = np.random.default_rng(6)


def grid_directions(rows: int, columns: int) -> np.ndarray:
    inclination = (np.arange(rows) + 0.5) * np.pi / rows
    azimuth = np.arange(columns) * 2 * np.pi / columns
    inclination, azimuth = np.meshgrid(inclination, azimuth, indexing="ij")
    ring = np.sin(inclination)
    return np.stack([ring * np.sin(azimuth), np.cos(inclination), ring * np.cos(azimuth)], -1).reshape(-1, 3)


def matte_field(lights: StageLights, rows: int = 21, columns: int = 34) -> Pictures:
    """A field of turned matte pixels, a third of them in the dark, and one mirroring light 5 at pixel (4, 4)."""
    normals = GENERATOR.normal(size=(rows, columns, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    albedo = GENERATOR.random((rows, columns, 3))
    cosine = np.maximum(np.einsum("nc,hwc->nhw", lights.directions, normals), 0)
    values = cosine[..., None] * albedo / np.pi
    values[:, rows * 2 // 3 :] = 0
    values[5, 4, 4] = 40
    return Pictures(values.astype(np.float32), lights)


GRID = StageLights.towards(grid_directions(8, 16), grid=(8, 16))
FIELD = matte_field(GRID)
LIGHT = GENERATOR.random((128, 3)) * GRID.solid_angles[:, None]


def relative(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.abs(found.astype(np.float64) - exact).sum() / np.abs(exact).sum())


def test_a_sum_over_lights_is_the_same_sum_over_coefficients():
    for lights in (GRID, StageLights.towards(GENERATOR.normal(size=(53, 3)))):
        grid, values = laid_out(lights), GENERATOR.random((len(lights), 7, 3))
        irradiances = GENERATOR.random((len(lights), 3))
        coefficients = grid.transformed(values)
        np.testing.assert_allclose(
            np.einsum("npc,nc->pc", coefficients, grid.light(irradiances)),
            np.einsum("npc,nc->pc", values, irradiances),
            rtol=1e-12,
        )
        np.testing.assert_allclose(grid.restored(coefficients), values, atol=1e-12)


def test_even_light_has_one_coefficient():
    light = laid_out(GRID).light(np.ones((128, 3)))
    np.testing.assert_allclose(light[0], 128**0.5)
    assert np.abs(light[1:]).max() < 1e-12


def test_lights_without_a_grid_stand_in_rows_by_inclination_each_once():
    lights = StageLights.towards(GENERATOR.normal(size=(53, 3)))
    grid = laid_out(lights)
    assert (grid.rows, grid.columns) == (5, 11) and grid.own.sum() == 53
    assert sorted(grid.which[grid.own]) == list(range(53))
    heights = lights.directions[grid.which, 1].reshape(5, 11)
    assert all(heights[row].min() > heights[row + 1].max() for row in range(4))


def test_finely_rounded_pictures_are_the_exact_ones():
    fine = compress_cosine(FIELD, step=1e-4)
    assert relative(fine.relight(LIGHT).radiance, weighted_sum(FIELD, LIGHT).radiance) < 1e-5
    assert relative(fine.relight(-LIGHT).radiance, weighted_sum(FIELD, -LIGHT).radiance) < 1e-5


def test_a_coefficient_is_off_by_half_a_step_at_most():
    compressed = compress_cosine(FIELD, step=0.5)
    assert compressed.step == pytest.approx(0.5 * FIELD.values.mean(), rel=1e-5)
    exact = laid_out(GRID).transformed(FIELD.values)
    basis = laid_out(GRID).restored(np.eye(128))  # light under which one coefficient alone is seen
    for coefficient in (0, 1, 17, 127):
        light = np.repeat(basis[:, coefficient, None], 3, axis=1)
        off = np.abs(compressed.relight(light).radiance - exact[coefficient])
        assert 0 < off.max() < 0.5001 * compressed.step


def test_the_stated_error_is_that_of_its_pictures():
    compressed = compress_cosine(FIELD, step=0.5)
    singles = []
    for light in range(128):
        for channel in range(3):
            irradiances = np.zeros((128, 3))
            irradiances[light, channel] = 1
            found, exact = compressed.relight(irradiances).radiance, weighted_sum(FIELD, irradiances).radiance
            singles.append(relative(found, exact))
    assert compressed.error.worst == pytest.approx(max(singles), rel=1e-3)
    trials = np.random.default_rng(0).exponential(size=(16, 128)) * GRID.solid_angles
    random = [
        relative(compressed.relight(light).radiance, weighted_sum(FIELD, light).radiance)
        for light in np.repeat(trials[..., None], 3, axis=2)
    ]
    assert compressed.error.random == pytest.approx(max(random), rel=1e-3)
    assert compressed.error.random < compressed.error.single < compressed.error.worst


def test_no_light_does_worse_than_the_worst():
    compressed = compress_cosine(FIELD, step=0.5)
    for sharpness in (0, 4, 30):
        light = GENERATOR.random((128, 3)) ** sharpness
        found = relative(compressed.relight(light).radiance, weighted_sum(FIELD, light).radiance)
        assert found <= compressed.error.worst


def test_coarser_steps_take_fewer_bytes_and_err_more():
    fine, coarse = compress_cosine(FIELD, step=0.05), compress_cosine(FIELD, step=0.5)
    assert coarse.byte_count < fine.byte_count < FIELD.values.nbytes
    assert fine.error.single < coarse.error.single


def test_tiles_of_nothing_have_no_entries():
    entries = np.diff(compress_cosine(FIELD).starts).reshape(3, 5)
    assert (entries[2] == 0).all() and (entries[:2] > 0).all()  # rows 14 and below are dark


def test_blocks_do_not_change_a_byte():
    whole, cut = compress_cosine(FIELD), compress_cosine(FIELD, memory=1)
    np.testing.assert_array_equal(whole.kinds, cut.kinds)
    np.testing.assert_array_equal(whole.digits, cut.digits)
    np.testing.assert_array_equal(whole.starts, cut.starts)


def test_lights_without_a_grid_are_compressed_too():
    field = matte_field(StageLights.towards(GENERATOR.normal(size=(53, 3))))
    light = GENERATOR.random((53, 3))
    found = compress_cosine(field, step=0.01).relight(light).radiance
    assert relative(found, weighted_sum(field, light).radiance) < 2e-3


@pytest.mark.parametrize("step", [0, -1, np.nan])
def test_a_step_that_is_none_is_refused(step):
    with pytest.raises(ValueError, match="expected a part of the mean value above 0"):
        compress_cosine(FIELD, step=step)


def test_a_step_too_fine_and_a_black_field_are_refused():
    with pytest.raises(ValueError, match="too fine"):
        compress_cosine(FIELD, step=1e-6)
    with pytest.raises(ValueError, match="not all black"):
        compress_cosine(replace(FIELD, values=np.zeros_like(FIELD.values)))
