"""Shadow maps by brightness."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.surface.shadow_map import bright_level, lit
from relume.sphere.directions import normalised


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
