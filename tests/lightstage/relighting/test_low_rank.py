from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.low_rank import compress_low_rank
from relume.lightstage.relighting.relighting import weighted_sum

GENERATOR = np.random.default_rng(7)
COUNT = 40
LIGHTS = StageLights.towards(GENERATOR.normal(size=(COUNT, 3)))
PLANES = GENERATOR.random((3, 20, 30, 3))
MIXTURE = GENERATOR.random((COUNT, 3))
FIELD = Pictures(np.einsum("nk,khwc->nhwc", MIXTURE, PLANES).astype(np.float32), LIGHTS)
LIGHT = GENERATOR.random((COUNT, 3))


def spiky() -> Pictures:
    """The field with a mirrored light at another pixel in each picture, 300 times as bright as its mean."""
    values = FIELD.values.copy()
    for index in range(COUNT):
        values[index, index // 8, index % 8] = 300 * FIELD.values.mean()
    return replace(FIELD, values=values)


def relative(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.abs(found.astype(np.float64) - exact).sum() / np.abs(exact).sum())


def test_a_field_of_three_pictures_has_rank_three():
    compressed = compress_low_rank(FIELD, error=1e-4)
    assert compressed.basis.shape == (3, 20, 30, 3) and compressed.basis.dtype == np.float16
    np.testing.assert_allclose(compressed.coefficients @ compressed.coefficients.T, np.eye(3), atol=1e-12)
    exact = weighted_sum(FIELD, LIGHT).radiance
    assert relative(compressed.relight(LIGHT).radiance, exact) < 5e-4  # halves
    assert relative(compressed.relight(-LIGHT).radiance, -exact) < 5e-4


def test_as_many_pictures_as_lights_lose_nothing_but_halves():
    field = Pictures(GENERATOR.random((COUNT, 20, 30, 3), np.float32), LIGHTS)
    compressed = compress_low_rank(field, rank=COUNT)
    assert len(compressed.spikes.pixels) == 0
    assert relative(compressed.relight(LIGHT).radiance, weighted_sum(field, LIGHT).radiance) < 1e-3
    assert compressed.error.worst < 2e-3


def test_the_error_asked_for_is_that_of_the_root_mean_square():
    field = Pictures(GENERATOR.random((COUNT, 20, 30, 3), np.float32), LIGHTS)
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
    assert relative(compressed.relight(LIGHT).radiance, weighted_sum(field, LIGHT).radiance) < 0.02
    spot = np.zeros((COUNT, 3))
    spot[11] = [1, 2, 3]
    found = compressed.relight(spot).radiance[11 // 8, 11 % 8]
    np.testing.assert_allclose(found, field.values[11, 1, 3] * [1, 2, 3], rtol=0.02)
    wholly = compressed.spikes
    lost = replace(compressed, spikes=replace(wholly, values=wholly.values * 0))
    assert relative(lost.relight(LIGHT).radiance, weighted_sum(field, LIGHT).radiance) > 0.1


def test_the_stated_error_is_that_of_its_pictures():
    field = spiky()
    compressed = compress_low_rank(field, rank=2)
    singles = []
    for light in range(COUNT):
        for channel in range(3):
            irradiances = np.zeros((COUNT, 3))
            irradiances[light, channel] = 1
            found, exact = compressed.relight(irradiances).radiance, weighted_sum(field, irradiances).radiance
            singles.append(relative(found, exact))
    assert compressed.error.worst == pytest.approx(max(singles), rel=1e-3)
    for sharpness in (1, 30):
        light = GENERATOR.random((COUNT, 3)) ** sharpness
        found = relative(compressed.relight(light).radiance, weighted_sum(field, light).radiance)
        assert 0 < found < compressed.error.worst


def test_blocks_change_nothing_that_is_seen():
    field = spiky()
    found = compress_low_rank(field, rank=5, memory=1).relight(LIGHT).radiance
    np.testing.assert_allclose(found, compress_low_rank(field, rank=5).relight(LIGHT).radiance, rtol=3e-3, atol=1e-3)


@pytest.mark.parametrize("asked", [{"error": 0}, {"error": 1}, {"rank": 0}, {"rank": 41}])
def test_what_cannot_be_asked_for_is_refused(asked):
    with pytest.raises(ValueError, match=r"an error within 0…1, a rank within 1…40"):
        compress_low_rank(FIELD, **asked)


def test_a_black_field_is_refused():
    with pytest.raises(ValueError, match="not all black"):
        compress_low_rank(replace(FIELD, values=np.zeros_like(FIELD.values)))
