"""Arithmetic between radiance maps: literals, units, marks, errors, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.image.arithmetic import (
    added,
    average,
    brighter,
    darker,
    divided,
    multiplied,
    subtracted,
    without_negative,
)
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap


def flat(values: object, **rest: object) -> RadianceMap:
    """A map of one row, a grey pixel for each value."""
    row = np.repeat(np.array(values, np.float32)[None, :, None], 3, axis=2)
    return RadianceMap(row, **rest)  # type: ignore[arg-type]


def red(picture: RadianceMap) -> list[float]:
    return picture.radiance[0, :, 0].tolist()


def test_every_operation_on_literals() -> None:
    a, b = flat([6.0, 1.0]), flat([2.0, 4.0])
    assert red(added(a, b)) == [8.0, 5.0]
    assert red(subtracted(a, b)) == [4.0, -3.0]
    assert red(multiplied(a, b)) == [12.0, 4.0]
    assert red(divided(a, b)) == [3.0, 0.25]
    assert red(darker(a, b)) == [2.0, 1.0]
    assert red(brighter(a, b)) == [6.0, 4.0]
    assert red(average([a, b, flat([4.0, 4.0])])) == [4.0, 3.0]


def test_constants_work_on_all_channels_or_on_each() -> None:
    assert added(flat([1.0]), (1.0, 2.0, 3.0)).radiance[0, 0].tolist() == [2.0, 3.0, 4.0]
    assert red(divided(flat([1.0]), 4.0)) == [0.25]
    assert red(brighter(flat([1.0, 3.0]), 2.0)) == [2.0, 3.0]


def test_a_gain_of_a_power_of_two_there_and_back_changes_no_bit() -> None:
    rng = np.random.default_rng(1)
    picture = RadianceMap(np.exp(rng.normal(0, 8, (16, 16, 3))).astype(np.float32))
    there = multiplied(picture, 2.0)
    assert np.array_equal(there.radiance, 2 * picture.radiance)
    assert multiplied(there, 0.5).radiance.tobytes() == picture.radiance.tobytes()


def test_units_combine_or_are_refused() -> None:
    relative, calibrated = flat([2.0]), flat([8.0], unit="cd/m²")
    assert added(calibrated, calibrated).unit == "cd/m²"
    assert multiplied(calibrated, relative).unit == multiplied(relative, calibrated).unit == "cd/m²"
    assert multiplied(calibrated, 2.0).unit == "cd/m²"
    assert divided(calibrated, calibrated).unit == "relative"
    assert divided(calibrated, relative).unit == "cd/m²"
    for operation in (added, subtracted, darker, brighter):
        with pytest.raises(ValueError, match="in relative and cd/m²"):
            operation(relative, calibrated)
    with pytest.raises(ValueError, match="no radiance"):
        multiplied(calibrated, calibrated)
    with pytest.raises(ValueError, match="exchange them"):
        divided(relative, calibrated)


def test_variances_are_those_of_independent_errors() -> None:
    """Against the spread of many drawn pairs, to four times the error of a variance from so many."""
    rng = np.random.default_rng(3)
    count, (mean_a, mean_b), (sd_a, sd_b) = 200_000, (5.0, 4.0), (0.2, 0.05)
    a = rng.normal(mean_a, sd_a, count)
    b = rng.normal(mean_b, sd_b, count)
    first = replace(flat([mean_a]), variance=np.full((1, 1, 3), sd_a**2, np.float32))
    second = replace(flat([mean_b]), variance=np.full((1, 1, 3), sd_b**2, np.float32))
    for operation, drawn in ((added, a + b), (subtracted, a - b), (multiplied, a * b), (divided, a / b)):
        made = operation(first, second).variance
        assert made is not None
        assert float(made[0, 0, 0]) == pytest.approx(drawn.var(), rel=4 * np.sqrt(2 / count) + 0.002)
    mean = average([first, first, first]).variance
    assert mean is not None and float(mean[0, 0, 0]) == pytest.approx(sd_a**2 / 3, rel=1e-6)


def test_a_lost_variance_is_reported() -> None:
    known = replace(flat([1.0]), variance=np.ones((1, 1, 3), np.float32))
    with pytest.warns(UserWarning, match="the result has none"):
        assert added(known, flat([1.0])).variance is None
    kept = multiplied(known, 3.0).variance
    assert kept is not None and kept[0, 0, 0] == 9.0


def test_bounds_stay_bounds_and_opposing_ones_say_nothing() -> None:
    marks = np.array([[0, SATURATED, BLACK, OUTSIDE, SATURATED]], np.uint8)
    others = np.array([[SATURATED, SATURATED, SATURATED, 0, BLACK]], np.uint8)
    first, second = flat([1.0] * 5, clipped=marks), flat([1.0] * 5, clipped=others)
    total, difference = added(first, second).clipped, subtracted(first, second).clipped
    assert total is not None and difference is not None
    assert total[0].tolist() == [SATURATED, SATURATED, OUTSIDE, OUTSIDE, OUTSIDE]
    # What is taken away and at least so bright leaves at most so much.
    assert difference[0].tolist() == [BLACK, OUTSIDE, BLACK, OUTSIDE, SATURATED]
    assert added(flat([1.0] * 5), second).clipped is not None
    assert added(first, 1.0).clipped is marks


def test_a_negative_factor_turns_bounds_round_and_zero_leaves_none() -> None:
    marks = np.array([[0, SATURATED, BLACK, OUTSIDE]], np.uint8)
    first = flat([1.0] * 4, clipped=marks)

    def after(operation, factor: object) -> list[int]:
        made = operation(first, factor).clipped
        assert made is not None
        return made[0].tolist()

    assert after(multiplied, -1.0) == after(divided, -2.0) == [0, BLACK, SATURATED, OUTSIDE]
    assert after(multiplied, (2.0, 0.0, 1.0)) == [0, SATURATED, BLACK, OUTSIDE]
    assert after(multiplied, (-1.0, 0.0, -1.0)) == [0, BLACK, SATURATED, OUTSIDE]
    # A pixel has one mark: where some channels are bounded above and others below it says nothing.
    assert after(multiplied, (1.0, -1.0, 1.0)) == [0, OUTSIDE, OUTSIDE, OUTSIDE]
    assert after(multiplied, 0.0) == [0, 0, 0, 0]
    assert after(multiplied, flat([-1.0, -1.0, 0.0, 2.0])) == [0, BLACK, 0, OUTSIDE]
    # −1 × what is at least 1 is at most −1, and −1 ÷ it is at least −1.
    negative = flat([-1.0] * 4)
    product, quotient = multiplied(negative, first).clipped, divided(negative, first).clipped
    assert product is not None and product[0].tolist() == [0, BLACK, SATURATED, OUTSIDE]
    assert quotient is not None and quotient[0].tolist() == [0, SATURATED, BLACK, OUTSIDE]
    # Nothing is known of what is at least 1 times what is at most 0.
    unsure = multiplied(flat([1.0], clipped=marks[:, 1:2]), flat([0.0], clipped=marks[:, 2:3])).clipped
    assert unsure is not None and unsure[0].tolist() == [OUTSIDE]


def test_division_by_zero_is_marked_and_reported() -> None:
    with pytest.warns(UserWarning, match="0 in 1 pixels"):
        result = divided(flat([1.0, 1.0]), flat([0.0, 2.0]))
    assert red(result) == [0.0, 0.5]
    assert result.clipped is not None and result.clipped.tolist() == [[OUTSIDE, 0]]
    with pytest.raises(ValueError, match="other than 0"):
        divided(flat([1.0]), (1.0, 0.0, 1.0))


def test_negative_results_are_kept_until_taken_out_and_counted() -> None:
    difference = subtracted(flat([1.0, 5.0]), 2.0)
    assert red(difference) == [-1.0, 3.0]
    with pytest.warns(UserWarning, match="1 of 2 pixels came out negative, down to −1"):
        assert red(without_negative(difference)) == [0.0, 3.0]
    kept = flat([0.0, 1.0])
    assert without_negative(kept) is kept


def test_what_cannot_be_combined_is_refused() -> None:
    with pytest.raises(ValueError, match="2×1 and 1×1"):
        added(flat([1.0, 1.0]), flat([1.0]))
    with pytest.raises(ValueError, match="latlong and angular"):
        added(flat([1.0], attributes={"mapping": "latlong"}), flat([1.0], attributes={"mapping": "angular"}))
    ours, blenders = {"mapping": "latlong"}, {"mapping": "latlong", "orientation": "blender"}
    with pytest.raises(ValueError, match="latlong and latlong for blender; convert"):
        added(flat([1.0], attributes=ours), flat([1.0], attributes=blenders))
    with pytest.raises(ValueError, match="strip mirrored in x and strip mirrored in z; convert"):
        average([flat([1.0], attributes={"mapping": "strip", "mirror": axis}) for axis in "xz"])
    assert red(added(flat([1.0], attributes=blenders), flat([1.0], attributes=blenders))) == [2.0]
    assert red(multiplied(flat([3.0], attributes=blenders), flat([2.0]))) == [6.0]
    with pytest.raises(ValueError, match="beyond float32"):
        multiplied(flat([1e38]), 1e3)
    with pytest.raises(ValueError, match="one number"):
        added(flat([1.0]), (1.0, float("nan"), 1.0))
    with pytest.raises(ValueError, match="at least one"):
        average([])
