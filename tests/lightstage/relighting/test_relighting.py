from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest

from relume.lightstage.field.field import Derived, Noise, Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.relighting import (
    pictures_at_once,
    planned,
    weighted_sum,
    weighted_sum_per_pixel,
    weighted_sums,
)
from relume.lightstage.relighting.sum_kernel import add_weighted, blended
from small_stages import chosen

GENERATOR = np.random.default_rng(3)
COUNT, ROWS, COLUMNS = 13, 11, 300
LIGHTS = StageLights.towards(GENERATOR.normal(size=(COUNT, 3)))
VALUES = GENERATOR.random((COUNT, ROWS, COLUMNS, 3), np.float32)
FIELD = Pictures(VALUES, LIGHTS)
E1, E2 = GENERATOR.random((2, COUNT, 3))
FEW = Pictures(GENERATOR.random((9, 20, 30, 3), np.float32), chosen(LIGHTS, np.arange(9)), noise=Noise(1e-4, 1e-3))
SEVERAL = GENERATOR.random((7, 9, 3))


@dataclass(frozen=True, eq=False)
class Lazy(Derived):
    """The same field, known only by its blocks; it counts how many of its values were asked for."""

    field: Pictures
    asked: list[int] = dataclasses.field(default_factory=list)

    def block(self, lights, rows):
        found = self.field.block(lights, rows)
        self.asked.append(found.size)
        return found


def test_a_picture_is_the_sum_of_each_lights_picture_times_its_irradiance():
    values = np.array([[1, 2, 3], [10, 20, 30]], np.float32).reshape(2, 1, 1, 3)
    field = Pictures(values, StageLights.towards(np.array([[0, 0, 1.0], [0, 1.0, 0]])))
    picture = weighted_sum(field, np.array([[2, 2, 2], [0.5, 0.25, 1]])).radiance
    np.testing.assert_array_equal(picture.ravel(), [7, 9, 36])


def test_one_light_gives_back_its_picture():
    for light in (0, 7, COUNT - 1):
        np.testing.assert_array_equal(
            weighted_sum(FIELD, np.eye(COUNT)[light][:, None] * np.ones(3)).radiance, VALUES[light]
        )


def test_relighting_is_linear():
    a, b = 0.7, 1.9
    together = weighted_sum(FIELD, a * E1 + b * E2).radiance.astype(np.float64)
    apart = a * weighted_sum(FIELD, E1).radiance.astype(np.float64) + b * weighted_sum(FIELD, E2).radiance
    assert np.abs(together / apart - 1).max() < 2e-7


def test_lights_are_summed_in_their_order_in_double_precision():
    expected = np.zeros((ROWS, COLUMNS, 3))
    for values, irradiance in zip(VALUES, E1, strict=True):
        expected += values.astype(np.float64) * irradiance
    np.testing.assert_array_equal(weighted_sum(FIELD, E1).radiance, expected.astype(np.float32))


@pytest.mark.parametrize("kind", [np.float16, np.uint8])
def test_values_of_every_kind_are_summed_as_what_they_stand_for(kind):
    scale = GENERATOR.random(COUNT).astype(np.float32) if kind == np.uint8 else None
    values = (VALUES * 255).astype(kind)
    expected = np.zeros((ROWS, COLUMNS, 3))
    for index in range(COUNT):
        expected += values[index].astype(np.float64) * (E1[index] * (1 if scale is None else float(scale[index])))
    found = weighted_sum(Pictures(values, LIGHTS, scale=scale), E1).radiance
    np.testing.assert_array_equal(found, expected.astype(np.float32))


@pytest.mark.parametrize("size", [1.0, 1e-310, 1e300])
def test_bytes_give_the_same_bits_however_small_or_large_the_light_is(size):
    # Seven lights, so that some are summed by fours; more values than one call takes, and a few at the end.
    values = GENERATOR.integers(0, 256, (7, 49_152 + 3 * 41), np.uint8)
    weights = GENERATOR.normal(size=(7, 2, 3)) * size
    expected = np.zeros((2, values.shape[1]))
    for each, weight in zip(values, weights, strict=True):
        expected += each.astype(np.float64) * np.tile(weight, (1, values.shape[1] // 3))
    for threads in (1, 2):
        totals = np.zeros_like(expected)
        add_weighted(values, weights, totals, threads)
        np.testing.assert_array_equal(totals, expected)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("count", [1, 8, 11])
def test_pictures_blended_in_single_precision_are_the_matrix_product(kind, count):
    # Also numbers so small that half a float has few digits for them.
    values = (GENERATOR.normal(size=(count, 999)) * 10.0 ** GENERATOR.integers(-7, 3, (count, 999))).astype(kind)
    weights = GENERATOR.normal(size=(count, 3))
    expected = np.einsum("nk,nk->k", values.astype(np.float64), np.tile(weights, (1, 333)))
    most = np.einsum("nk,nk->k", np.abs(values).astype(np.float64), np.abs(np.tile(weights, (1, 333))))
    assert (np.abs(blended(values, weights) - expected) <= 1e-6 * most).all()


def test_every_half_is_read_as_numpy_reads_it():
    every = np.arange(65535, dtype=np.uint16).view(np.float16)
    field = Pictures(every.reshape(1, 85, 257, 3), StageLights.towards(np.array([[0, 0, 1.0]])))
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(weighted_sum(field, np.ones((1, 3))).radiance.ravel(), every.astype(np.float32))


def test_blocks_and_threads_do_not_change_a_byte():
    noisy = Pictures(VALUES, LIGHTS, noise=Noise(1e-4, 1e-3))
    expected = weighted_sum(noisy, E1, threads=1)
    least = ROWS * COLUMNS * 3 * 8
    plan = planned(Lazy(noisy), least + 60_000, len_totals=2)
    assert len(plan.rows) > 2 and len(plan.lights) >= 1
    small = weighted_sum(Lazy(noisy), E1, memory=least + 60_000, threads=2)
    np.testing.assert_array_equal(small.radiance, expected.radiance)
    assert small.variance is not None and expected.variance is not None
    np.testing.assert_array_equal(small.variance, expected.variance)


def test_light_may_be_negative_and_the_picture_then_too():
    picture = weighted_sum(FIELD, -E1).radiance
    np.testing.assert_array_equal(picture, -weighted_sum(FIELD, E1).radiance)
    assert picture.max() < 0


def test_variance_is_that_of_the_sum():
    noise = Noise(0.01, 0.5)
    found = weighted_sum(Pictures(VALUES, LIGHTS, noise=noise), E1).variance
    expected = np.einsum("nhwc,nc->hwc", noise.constant + noise.slope * VALUES.astype(np.float64), E1**2)
    assert found is not None
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_variance_is_that_of_many_takes():
    noise, constant = Noise(0.04), np.full((COUNT, 40, 40, 3), 0.5, np.float32)
    takes = constant + GENERATOR.normal(scale=0.2, size=constant.shape).astype(np.float32)
    light = np.repeat(E1[:, :1], 3, axis=1)
    found = weighted_sum(Pictures(takes, LIGHTS, noise=noise), light)
    assert found.variance is not None
    assert found.radiance.var() == pytest.approx(float(found.variance.mean()), rel=0.08)  # 4800 samples: 2 % a sigma


def test_variance_is_never_below_nothing():
    found = weighted_sum(Pictures(-VALUES, LIGHTS, noise=Noise(0.0, 1.0)), E1).variance
    assert found is not None and found.min() == 0


def test_without_noise_there_is_no_variance():
    assert weighted_sum(FIELD, E1).variance is None


def test_a_label_chooses_the_light_of_its_pixels():
    labels = GENERATOR.integers(0, 2, (ROWS, COLUMNS))
    noisy = Pictures(VALUES, LIGHTS, noise=Noise(1e-4, 1e-3))
    found = weighted_sum_per_pixel(noisy, labels, np.stack([E1, E2]))
    for label, irradiances in enumerate((E1, E2)):
        alone = weighted_sum(noisy, irradiances)
        np.testing.assert_array_equal(found.radiance[labels == label], alone.radiance[labels == label])
        assert found.variance is not None and alone.variance is not None
        np.testing.assert_allclose(found.variance[labels == label], alone.variance[labels == label], rtol=1e-6)


def test_progress_ends_at_one():
    reports: list[float] = []
    weighted_sum(Lazy(FIELD), E1, memory=200_000, progress=reports.append)
    assert reports == sorted(reports) and reports[-1] == 1 and len(reports) > 1


@pytest.mark.parametrize(
    ("irradiances", "said"),
    [
        (E1[:-1], r"\(12, 3\).*13×3"),
        (np.where(np.arange(COUNT)[:, None] == 4, np.nan, E1), '"4" is not a finite'),
    ],
)
def test_wrong_irradiances_are_refused(irradiances, said):
    with pytest.raises(ValueError, match=said):
        weighted_sum(FIELD, irradiances)


def test_too_little_memory_is_reported_with_what_is_needed():
    with pytest.raises(ValueError, match=r"need at least 0\.\d MB"):
        weighted_sum(Lazy(FIELD), E1, memory=1000)


@pytest.mark.parametrize(
    ("labels", "said"),
    [
        (np.full((ROWS, COLUMNS), 2), "labels are 2…2, but there are irradiances for 0…1"),
        (np.zeros((ROWS, 5), int), "expected integers for every pixel"),
        (np.zeros((ROWS, COLUMNS)), "expected integers for every pixel"),
    ],
)
def test_wrong_labels_are_refused(labels, said):
    with pytest.raises(ValueError, match=said):
        weighted_sum_per_pixel(FIELD, labels, np.stack([E1, E2]))


def test_each_picture_has_the_bytes_it_has_alone():
    for picture, irradiances in zip(weighted_sums(FEW, SEVERAL), SEVERAL, strict=True):
        alone = weighted_sum(FEW, irradiances)
        np.testing.assert_array_equal(picture.radiance, alone.radiance)
        np.testing.assert_array_equal(picture.variance, alone.variance)


def test_all_pictures_are_made_in_one_pass_over_the_field():
    counted = Lazy(FEW)
    assert len(list(weighted_sums(counted, SEVERAL))) == 7
    assert sum(counted.asked) == FEW.values.size


def test_where_memory_is_short_the_field_is_read_again_and_nothing_changes():
    counted, memory = Lazy(FEW), 300_000
    assert pictures_at_once(counted, memory) == 3
    reports: list[float] = []
    found = list(weighted_sums(counted, SEVERAL, memory=memory, progress=reports.append))
    assert sum(counted.asked) == 3 * FEW.values.size
    assert reports == sorted(reports) and reports[-1] == 1
    for picture, whole in zip(found, weighted_sums(FEW, SEVERAL), strict=True):
        np.testing.assert_array_equal(picture.radiance, whole.radiance)


def test_a_wrong_light_is_refused_before_the_first_picture():
    with pytest.raises(ValueError, match=r"\(pictures, 9 lights, 3\)"):
        weighted_sums(FEW, SEVERAL[0])
    broken = SEVERAL.copy()
    broken[6, 2] = np.inf
    with pytest.raises(ValueError, match='"2" is not a finite number'):
        weighted_sums(FEW, broken)
