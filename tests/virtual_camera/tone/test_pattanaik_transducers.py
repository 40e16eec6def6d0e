"""Gains and transducers of the multiscale model: pinned values, and curves that can be undone."""

from __future__ import annotations

import numpy as np
import pytest

from relume.virtual_camera.tone.pattanaik.transducers import (
    COMMON_RESPONSE,
    CONES,
    RODS,
    Transducer,
    cone_gain,
    rod_gain,
    sensitivity,
)


def test_gains_have_their_pinned_values() -> None:
    # 1/0.555; 1/(0.555·101^0.85); [10/11]/(0.908·1.001^0.85); 1/(0.908·0.011^0.85) but for 1e-5
    assert cone_gain(np.array([0.0, 100.0])) == pytest.approx([1.801802, 0.0356479], rel=1e-5)
    assert rod_gain(np.array([0.0, 0.01, 1.0])) == pytest.approx([390.77, 50.905, 1.000331], rel=1e-4)


def test_cones_brighten_slower_than_light_and_rods_end_by_day() -> None:
    light = np.logspace(-6, 8, 200)
    assert np.all(np.diff(light * cone_gain(light)) > 0)
    seen = light * rod_gain(light)
    assert 0.5 < light[np.argmax(seen)] < 2 and seen[-1] < 1e-6


def test_sensitivity_to_contrast_is_best_near_eight_cycles_per_degree() -> None:
    assert sensitivity(np.array([0.5, 8.0, 16.0])) == pytest.approx([0.189819, 0.98068, 0.69073], rel=1e-3)


@pytest.mark.parametrize("transducer", [*CONES, *RODS[2:]])
def test_a_transducer_is_odd_monotonic_and_one_at_threshold(transducer: Transducer) -> None:
    contrast = np.logspace(-5, 3, 4001)
    response = transducer.response(contrast)
    assert np.all(np.diff(response) > 0)
    np.testing.assert_allclose(transducer.response(-contrast), -response, rtol=1e-6)
    knees = np.array([transducer.threshold, transducer.meeting])
    assert transducer.response(knees) == pytest.approx([1, COMMON_RESPONSE])
    assert transducer.response(knees * (1 + 1e-9)) == pytest.approx([1, COMMON_RESPONSE], rel=1e-6)


def test_thresholds_are_a_gratings_at_its_best_adaptation() -> None:
    # 1/250 of the signal at 100 cd/m², and 1/20 at 0.01 cd/m², each over the sensitivity of its band
    assert CONES[1].threshold == pytest.approx(0.01426 / 0.98068, rel=1e-3)
    assert RODS[4].threshold == pytest.approx(0.025453 / 0.98068, rel=1e-3)


def test_rods_are_blind_to_the_finest_bands_alone() -> None:
    assert [rods.is_blind for rods in RODS] == [True, True, False, False, False, False]
    assert np.array_equal(RODS[0].response(np.array([-3.0, 3.0])), [0, 0])
    assert not any(cones.is_blind for cones in CONES)
