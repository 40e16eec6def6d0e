"""Soft and motion blur of light on the sphere: the total kept, the same everywhere on it, against a slow twin."""

from __future__ import annotations

import numpy as np
import pytest

from relume.image.radiance import SATURATED
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import CubeCross, Strip
from relume.sphere.mappings.discs import Angular, Fisheye
from relume.sphere.mappings.mapping import LatLong, Mapping, pixel_directions
from relume.sphere.resampling.blur import blurred, spun


def sparks(rows: int = 24, light: float = 1e5) -> EnvironmentMap:
    """Noise with a very bright pixel at a pole, one on the seam and one elsewhere."""
    field = np.random.default_rng(1).random((rows, 2 * rows, 3)).astype(np.float32) * 1e-2
    field[0, 3] = field[rows // 2, 0] = field[rows // 3, rows] = light
    return EnvironmentMap(field)


def naive(light: EnvironmentMap, sigma: float, rounds: int = 400) -> np.ndarray:
    """The kernel between every two pixels, balanced with all of them."""
    directions = pixel_directions(LatLong(), light.size).reshape(-1, 3)
    areas = LatLong().solid_angles(light.size).ravel()
    kernel = np.exp((np.minimum(directions @ directions.T, 1) - 1) / sigma**2)
    factor = np.ones(len(areas))
    for _ in range(rounds):
        factor /= np.sqrt(factor * (kernel @ (areas * factor)))
    field = light.radiance.reshape(-1, 3).astype(np.float64)
    return (factor[:, None] * (kernel @ ((areas * factor)[:, None] * field))).reshape(light.radiance.shape)


@pytest.mark.parametrize("sigma", [1.0, 8.0, 60.0])
def test_the_blur_is_the_slow_twin(sigma: float) -> None:
    light = sparks(12)
    twin = naive(light, np.radians(sigma))
    made = blurred(light, np.radians(sigma)).radiance
    assert np.abs(made / twin - 1).max() < 1e-6


@pytest.mark.parametrize("degrees", [0.05, 1.0, 4.0, 30.0, 180.0])
def test_the_total_is_kept_and_constant_light_stays_constant(degrees: float) -> None:
    light = sparks()
    assert blurred(light, np.radians(degrees)).total() == pytest.approx(light.total(), rel=1e-7)
    constant = EnvironmentMap(np.full((24, 48, 3), 0.3, np.float32))
    assert np.abs(blurred(constant, np.radians(degrees)).radiance / np.float32(0.3) - 1).max() < 3e-7


def test_a_light_is_as_wide_at_the_pole_as_at_the_horizon_and_across_the_seam() -> None:
    """A pixel's flux F spreads to F κ e^{κ(cos γ − 1)} / 2π(1 − e^{−2κ}), wherever it stands.

    In the polar rows a pixel's light lies a sixth of a row beyond its centre; balancing costs them 0.6 % of the peak.
    """
    rows, sigma = 90, np.radians(6)
    kappa = 1 / sigma**2
    directions = pixel_directions(LatLong(), rows)
    areas = LatLong().solid_angles(rows)
    for row, column in ((0, 17), (20, 100), (45, 0), (89, 179)):
        field = np.zeros((rows, 2 * rows, 3), np.float32)
        field[row, column] = 1e6
        made = blurred(EnvironmentMap(field), sigma).radiance[..., 0]
        cosine = np.minimum(directions @ directions[row, column], 1)
        expected = 1e6 * areas[row, column] * kappa / (2 * np.pi) * np.exp(kappa * (cosine - 1))
        near = cosine > np.cos(4 * sigma)
        assert made[near] == pytest.approx(expected[near], rel=1e-3 if 0 < row < 89 else 7e-3)


def test_a_narrow_blur_changes_little_and_none_nothing() -> None:
    light = sparks()
    assert blurred(light, 0.0) is light and blurred(light, 0.1, share=0.0) is light
    # A hundredth of a pixel at the horizon: only the crowded pixels of the polar rows could notice, and do not.
    np.testing.assert_allclose(blurred(light, np.radians(0.01)).radiance, light.radiance, rtol=1e-6)


def test_soft_focus_is_a_mixture() -> None:
    light = sparks()
    mixed = blurred(light, 0.1, share=0.25).radiance
    np.testing.assert_allclose(mixed, 0.75 * light.radiance + 0.25 * blurred(light, 0.1).radiance, rtol=1e-6)


def test_what_a_clipped_light_reaches_is_marked() -> None:
    light = sparks()
    marks = np.zeros((24, 48), np.uint8)
    marks[12, 0] = SATURATED
    made = blurred(EnvironmentMap(light.radiance, clipped=marks), np.radians(6)).clipped
    assert made is not None
    assert made[12, 0] == made[12, 47] == made[12, 1] == made[11, 0] == SATURATED
    assert made[12, 24] == 0 and made[0, 3] == 0


@pytest.mark.parametrize(
    ("mapping", "rows", "degrees"), [(Strip(), 64, 6), (Angular(), 128, 12), (CubeCross(), 192, 6)]
)
def test_in_another_mapping_light_spreads_by_the_same_kernel(mapping: Mapping, rows: int, degrees: float) -> None:
    """A spark whose blur is twice as bright as the even light about it, which resampling interpolates.

    A lat-long as fine as these mappings are has pixels of 1.4° to 2.8°: two resamplings blur by as much and cost 4 % of
    a kernel of four of them.
    """
    sigma = np.radians(degrees)
    kappa = 1 / sigma**2
    directions, areas = pixel_directions(mapping, rows), mapping.solid_angles(rows)
    shown = areas > 0
    cosine = np.where(shown, directions @ normalised([0.3, 0.5, -0.8]), -1)
    place = np.unravel_index(int(cosine.argmax()), areas.shape)
    field = np.where(shown[..., None], np.float32(1), np.float32(0)).repeat(3, -1)
    field[place] += 2 * 2 * np.pi / (kappa * areas[place])
    light = EnvironmentMap(field, mapping)
    made = blurred(light, sigma)
    assert made.mapping == mapping and made.radiance.shape == field.shape
    cosine = np.minimum(directions @ directions[place], 1)
    expected = 1 + 2 * np.exp(kappa * (cosine - 1))
    np.testing.assert_allclose(made.radiance[shown, 0], expected[shown], rtol=0, atol=0.04 * 2)
    assert made.total() == pytest.approx(light.total(), rel=1e-6)


@pytest.mark.parametrize("mapping", [Strip(), Angular(), Fisheye()])
def test_what_stays_sharp_stays_in_its_pixel_in_any_mapping(mapping: Mapping) -> None:
    field = np.random.default_rng(4).random((*mapping.shape(32), 3)).astype(np.float32)
    field[16, 20] = 1e4
    field[mapping.solid_angles(32) == 0] = 0
    marks = np.zeros(field.shape[:2], np.uint8)
    marks[16, 20] = SATURATED
    light = EnvironmentMap(field, mapping, clipped=marks)
    mixed, soft = blurred(light, 0.2, share=0.25), blurred(light, 0.2)
    np.testing.assert_allclose(mixed.radiance, 0.75 * field + 0.25 * soft.radiance, rtol=1e-6)
    assert mixed.radiance[16, 20, 0] > 7500 and soft.radiance[16, 20, 0] < 2500
    assert mixed.clipped is not None and mixed.clipped[16, 20] == mixed.clipped[15, 20] == SATURATED
    assert mixed.clipped[16, 4] == 0


@pytest.mark.parametrize("mapping", [Fisheye(), Fisheye(np.radians(120), equisolid=True), Strip(), Angular()])
def test_constant_light_stays_constant_in_any_mapping_up_to_its_rim(mapping: Mapping) -> None:
    shown = mapping.solid_angles(48) > 0
    light = EnvironmentMap(np.where(shown[..., None], np.float32(0.3), np.float32(0)).repeat(3, -1), mapping)
    for made in (blurred(light, 0.3), blurred(light, 0.02), blurred(light, 0.3, share=0.5), spun(light, 1.0)):
        np.testing.assert_allclose(made.radiance[shown], np.float32(0.3), rtol=2e-6)
        assert not made.radiance[~shown].any() and made.clipped is None


def test_a_turn_is_a_streak_along_the_row_across_the_seam() -> None:
    """A turn of four columns: the light's own and one each side have a quarter, the next an eighth."""
    light = sparks()
    field = np.zeros_like(light.radiance)
    field[5, 1] = 8.0
    made = spun(EnvironmentMap(field), np.radians(4 * 360 / 48)).radiance
    assert made[5, [46, 47, 0, 1, 2, 3, 4], 0] == pytest.approx([0, 1, 2, 2, 2, 1, 0], abs=1e-6)
    assert not made[4].any()
    assert spun(light, 1.3).radiance.sum(1) == pytest.approx(light.radiance.sum(1), rel=1e-5)
    whole = spun(light, 2 * np.pi).radiance
    assert np.ptp(whole, axis=1).max() < 1e-6 * whole.max()
    assert spun(light, 0.0) is light


def test_blurs_that_cannot_be_are_refused() -> None:
    light = sparks()
    for sigma in (-0.1, 4.0, np.nan):
        with pytest.raises(ValueError, match="sigma"):
            blurred(light, sigma)
    with pytest.raises(ValueError, match="share"):
        blurred(light, 0.1, share=-1)
    with pytest.raises(ValueError, match="angle"):
        spun(light, 7)
