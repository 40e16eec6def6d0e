"""Compressed fields: in the cosine domain, and as a low-rank basis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.cosine import CosineField, compress_cosine, laid_out
from relume.lightstage.relighting.low_rank import LowRank, compress_low_rank
from relume.lightstage.relighting.relighting import weighted_sum
from small_stages import grid_directions

GENERATOR = np.random.default_rng(6)


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


def error_of(compressed: CosineField | LowRank, field: Pictures, light: np.ndarray) -> float:
    """Of the compressed field's picture under a light, over the exact one."""
    exact = weighted_sum(field, light).radiance
    return float(np.abs(compressed.relight(light).radiance.astype(np.float64) - exact).sum() / np.abs(exact).sum())


def worst_single(compressed: CosineField | LowRank, field: Pictures) -> float:
    """The greatest error under one light in one channel."""
    every = np.eye(3 * len(field.lights)).reshape(-1, len(field.lights), 3)
    return max(error_of(compressed, field, light) for light in every)


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
    assert error_of(fine, FIELD, LIGHT) < 1e-5
    assert error_of(fine, FIELD, -LIGHT) < 1e-5


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
    assert compressed.error.worst == pytest.approx(worst_single(compressed, FIELD), rel=1e-3)
    trials = np.random.default_rng(0).exponential(size=(16, 128)) * GRID.solid_angles
    random = [error_of(compressed, FIELD, light) for light in np.repeat(trials[..., None], 3, axis=2)]
    assert compressed.error.random == pytest.approx(max(random), rel=1e-3)
    assert compressed.error.random < compressed.error.single < compressed.error.worst


def test_no_light_does_worse_than_the_worst():
    compressed = compress_cosine(FIELD, step=0.5)
    for sharpness in (0, 4, 30):
        light = GENERATOR.random((128, 3)) ** sharpness
        found = error_of(compressed, FIELD, light)
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
    assert error_of(compress_cosine(field, step=0.01), field, light) < 2e-3


@pytest.mark.parametrize("step", [0, -1, np.nan])
def test_a_step_that_is_none_is_refused(step):
    with pytest.raises(ValueError, match="expected a part of the mean value above 0"):
        compress_cosine(FIELD, step=step)


def test_a_step_too_fine_and_a_black_field_are_refused():
    with pytest.raises(ValueError, match="too fine"):
        compress_cosine(FIELD, step=1e-6)
    with pytest.raises(ValueError, match="not all black"):
        compress_cosine(replace(FIELD, values=np.zeros_like(FIELD.values)))


COUNT = 40
FORTY = StageLights.towards(GENERATOR.normal(size=(COUNT, 3)))
MIXED = Pictures(
    np.einsum("nk,khwc->nhwc", GENERATOR.random((COUNT, 3)), GENERATOR.random((3, 20, 30, 3))).astype(np.float32), FORTY
)
"""Mixtures of three pictures."""
NOISE = GENERATOR.random((COUNT, 3))


def spiky() -> Pictures:
    """The field with a mirrored light at another pixel in each picture, 300 times as bright as its mean."""
    values = MIXED.values.copy()
    for index in range(COUNT):
        values[index, index // 8, index % 8] = 300 * MIXED.values.mean()
    return replace(MIXED, values=values)


def test_a_field_of_three_pictures_has_rank_three():
    compressed = compress_low_rank(MIXED, error=1e-4)
    assert compressed.basis.shape == (3, 20, 30, 3) and compressed.basis.dtype == np.float16
    np.testing.assert_allclose(compressed.coefficients @ compressed.coefficients.T, np.eye(3), atol=1e-12)
    assert error_of(compressed, MIXED, NOISE) < 5e-4  # halves
    assert error_of(compressed, MIXED, -NOISE) < 5e-4


def test_as_many_pictures_as_lights_lose_nothing_but_halves():
    field = Pictures(GENERATOR.random((COUNT, 20, 30, 3), np.float32), FORTY)
    compressed = compress_low_rank(field, rank=COUNT)
    assert len(compressed.spikes.pixels) == 0
    assert error_of(compressed, field, NOISE) < 1e-3
    assert compressed.error.worst < 2e-3


def test_the_error_asked_for_is_that_of_the_root_mean_square():
    field = Pictures(GENERATOR.random((COUNT, 20, 30, 3), np.float32), FORTY)
    values = field.values.reshape(COUNT, -1).astype(np.float64)
    sizes = np.linalg.svd(values, compute_uv=False)
    left = np.sqrt(np.append(np.cumsum(sizes[::-1] ** 2)[::-1], 0) / (sizes**2).sum())
    expected = int(np.argmax(left <= 0.3))
    assert 1 < expected < COUNT
    assert len(compress_low_rank(field, error=0.3).basis) == expected


def test_mirrored_lights_are_kept_apart_exactly():
    field = spiky()
    compressed = compress_low_rank(field, rank=6)
    assert len(compressed.spikes.pixels) == COUNT
    assert error_of(compressed, field, NOISE) < 0.02
    spot = np.zeros((COUNT, 3))
    spot[11] = [1, 2, 3]
    found = compressed.relight(spot).radiance[11 // 8, 11 % 8]
    np.testing.assert_allclose(found, field.values[11, 1, 3] * [1, 2, 3], rtol=0.02)
    wholly = compressed.spikes
    lost = replace(compressed, spikes=replace(wholly, values=wholly.values * 0))
    assert error_of(lost, field, NOISE) > 0.1


def test_the_stated_error_of_a_basis_is_that_of_its_pictures():
    field = spiky()
    compressed = compress_low_rank(field, rank=2)
    assert compressed.error.worst == pytest.approx(worst_single(compressed, field), rel=1e-3)
    for sharpness in (1, 30):
        light = GENERATOR.random((COUNT, 3)) ** sharpness
        found = error_of(compressed, field, light)
        assert 0 < found < compressed.error.worst


def test_blocks_change_nothing_that_is_seen():
    field = spiky()
    found = compress_low_rank(field, rank=5, memory=1).relight(NOISE).radiance
    np.testing.assert_allclose(found, compress_low_rank(field, rank=5).relight(NOISE).radiance, rtol=3e-3, atol=1e-3)


@pytest.mark.parametrize("asked", [{"error": 0}, {"error": 1}, {"rank": 0}, {"rank": 41}])
def test_what_cannot_be_asked_for_is_refused(asked):
    with pytest.raises(ValueError, match=r"an error within 0…1, a rank within 1…40"):
        compress_low_rank(MIXED, **asked)


def test_a_black_field_has_no_basis():
    with pytest.raises(ValueError, match="not all black"):
        compress_low_rank(replace(MIXED, values=np.zeros_like(MIXED.values)))
