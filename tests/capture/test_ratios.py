"""Exposures that were reported wrong: found, corrected, and left alone where they were right."""

from dataclasses import replace

import numpy as np
import pytest

from camera_curves import CurveCamera, camera_curves, exposure_error, mixed_scene
from relume.capture.exposure.bracket import Bracket
from relume.capture.response.calibration import Calibration, corrected, recover_response
from relume.capture.response.ratios import ExposureRatios, Ratios
from relume.image.photograph import Exposure, Photograph

THIRD = 2 ** (1 / 3)


@pytest.fixture(scope="module")
def camera() -> CurveCamera:
    return CurveCamera(camera_curves(6)[3:])


@pytest.fixture(scope="module")
def right(camera) -> Bracket:
    return camera.bracket(mixed_scene())


@pytest.fixture(scope="module")
def plain(right) -> Calibration:
    """From the right times, none of them doubted."""
    return recover_response(right)


@pytest.fixture(scope="module")
def refined(right) -> Calibration:
    """From the right times, each of them doubted."""
    return recover_response(right, refine=Ratios())


def ratios_of(brackets: Bracket | list[Bracket]) -> ExposureRatios:
    found = recover_response(brackets, refine=Ratios()).ratios
    assert found is not None
    return found


def seconds(photograph: Photograph) -> float:
    assert photograph.exposure is not None
    return photograph.exposure.seconds


def misreported(bracket: Bracket, factors: dict[int, float]) -> Bracket:
    """The bracket with the times of the frames of these numbers reported wrong by these factors."""
    wrong = {f"frame_{number}.jpg": factor for number, factor in factors.items()}
    return Bracket(
        tuple(replace(p, exposure=Exposure(seconds(p) * wrong.get(p.name, 1.0))) for p in bracket.photographs)
    )


@pytest.mark.parametrize(
    "factors",
    [
        pytest.param({3: THIRD}, id="one", marks=pytest.mark.slow),
        pytest.param({2: THIRD, 6: 1 / THIRD}, id="two"),
        pytest.param({1: THIRD, 7: THIRD}, id="two alike", marks=pytest.mark.slow),
        pytest.param({4: 1024.0}, id="ten stops"),
        pytest.param({5: 1 / 1024.0}, id="ten stops less", marks=pytest.mark.slow),
    ],
)
def test_wrong_times_are_found_and_the_curve_is_as_good_as_with_right_ones(camera, right, plain, factors):
    wrong = misreported(right, factors)
    found = recover_response(wrong, refine=Ratios())
    mended = {p.name: seconds(p) for p in corrected(wrong, found).photographs}
    for photograph in right.photographs:
        assert mended[photograph.name] == pytest.approx(seconds(photograph), rel=0.005)
    true = camera.true_exposure()
    for channel in range(3):
        good = exposure_error(plain.response.log_exposure[channel], true[channel])
        assert exposure_error(found.response.log_exposure[channel], true[channel]) < good + 5e-4


def test_right_times_stay_as_they_are(right, plain, refined):
    assert refined.ratios is not None and np.all(refined.ratios.corrections[0] == 0)
    np.testing.assert_array_equal(refined.response.log_exposure, plain.response.log_exposure)
    assert corrected(right, refined).exposures.tolist() == right.exposures.tolist()
    assert plain.ratios is None and corrected(right, plain) is right


@pytest.mark.slow
def test_the_stated_errors_are_of_the_size_of_the_errors_made(right):
    ratios = ratios_of(misreported(right, {3: THIRD}))
    frame = ratios.names[0].index("frame_3.jpg")
    off = ratios.corrections[0][frame] + np.log(THIRD)
    # A wrong correction of 4 standard errors would be one in ten thousand; rounding adds to it.
    assert abs(off) < 4 * ratios.errors[0][frame] + 0.001
    assert 1e-5 < ratios.errors[0][frame] < 0.005


def test_three_photographs_cannot_show_which_is_wrong(camera):
    few = camera.bracket(mixed_scene(), (0.125, 0.0625, 0.03125))
    with pytest.warns(UserWarning, match="from four different ones on"):
        ratios = ratios_of(misreported(few, {1: 1.3}))
    assert np.all(ratios.corrections[0] == 0) and np.all(np.isnan(ratios.errors[0]))


def test_where_most_disagree_none_is_corrected(right):
    wild = misreported(right, {1: 1.5, 2: 0.6, 4: 1.9, 5: 0.5, 7: 1.4})
    with pytest.warns(UserWarning, match=r"frame_.* of 9 exposures disagree"):
        ratios = ratios_of(wild)
    assert np.all(ratios.corrections[0] == 0)


@pytest.mark.slow
def test_one_bracket_s_wrong_time_is_found_beside_another_bracket(camera, right):
    other = camera.bracket(mixed_scene(), seed=9)
    other = Bracket(tuple(replace(p, name="b_" + p.name) for p in other.photographs))
    ratios = ratios_of([misreported(right, {4: THIRD}), other])
    factors = ratios.factors()
    assert factors.pop("frame_4.jpg") == pytest.approx(1 / THIRD, rel=0.005)
    assert set(factors.values()) == {1.0} and len(factors) == 17


def test_a_bracket_that_was_not_calibrated_is_refused(right, refined):
    stranger = Bracket(tuple(replace(p, name="other.jpg") for p in right.photographs[:1]))
    with pytest.raises(ValueError, match=r"other\.jpg is not one of the photographs"):
        corrected(stranger, refined)
