"""Keys and what lies between them, held against closed forms and another library's rotations."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation
from scipy.spatial.transform import Slerp as ScipySlerp

from relume.scene.motion.keyframes import (
    Linear,
    Shutter,
    Slerp,
    Smooth,
    Step,
    Tangents,
    Track,
    Turning,
)

TIMES = np.array([1.0, 3.0, 4.0, 8.0])
VALUES = np.array([[0.0, 1.0], [2.0, -1.0], [5.0, 0.0], [4.0, 4.0]])


@pytest.mark.parametrize("between", [Linear(), Step(), Smooth()])
def test_every_interpolation_goes_through_its_keys_and_the_ends_hold(between):
    track = Track(TIMES, VALUES, between)
    assert all(np.array_equal(track.at(t), v) for t, v in zip(TIMES, VALUES, strict=True))
    assert np.array_equal(track.at(-50), VALUES[0]) and np.array_equal(track.at(50), VALUES[-1])


def test_a_line_and_a_step():
    assert Track(TIMES, VALUES).at(1.5) == pytest.approx([0.5, 0.5])
    assert Track(TIMES, VALUES).at(7.0) == pytest.approx([4.25, 3.0])
    assert np.array_equal(Track(TIMES, VALUES, Step()).at(3.999), VALUES[1])


def test_a_smooth_track_is_the_spline_with_the_slopes_between_neighbours():
    slopes = [VALUES[1] / 2 - VALUES[0] / 2, (VALUES[2] - VALUES[0]) / 3, (VALUES[3] - VALUES[1]) / 5,
              (VALUES[3] - VALUES[2]) / 4]  # fmt: skip
    spline = CubicHermiteSpline(TIMES, VALUES, np.array(slopes))
    track = Track(TIMES, VALUES, Smooth())
    for time in np.linspace(1, 8, 29):
        assert track.at(time) == pytest.approx(spline(time), abs=1e-12)


def test_given_slopes_are_per_second():
    arriving, leaving = np.array([[9.0], [2.0]]), np.array([[1.0], [9.0]])
    track = Track(np.array([0.0, 4.0]), np.array([[0.0], [1.0]]), Tangents(arriving, leaving))
    spline = CubicHermiteSpline([0, 4], [0.0, 1.0], [1.0, 2.0])
    assert [float(track.at(t)[0]) for t in (1, 2.5, 3.9)] == pytest.approx([float(spline(t)) for t in (1, 2.5, 3.9)])


def test_slerp_is_another_librarys_and_takes_the_shorter_way():
    turns = Rotation.from_euler("xyz", [[10, 20, 30], [-80, 50, 200], [-80, 50, 201]], degrees=True)
    quaternions = turns.as_quat()
    quaternions[1] *= -1  # the same rotation
    track = Track(np.array([0.0, 1.0, 3.0]), quaternions, Slerp())
    other = ScipySlerp([0, 1, 3], turns)
    for time in (0.1, 0.5, 0.9, 1.7, 2.999):
        assert Rotation.from_quat(track.at(time)).as_matrix() == pytest.approx(other(time).as_matrix(), abs=1e-9)


def rotation_of(degrees):
    return Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()


def test_a_full_turn_about_one_axis_is_a_full_turn():
    turning = Turning(np.array([1.0, 121.0]), np.array([[5.0, 0, 0], [5.0, 360, 0]]))
    assert turning.at(31) == pytest.approx([5, 90, 0]) and turning.at(91) == pytest.approx([5, 270, 0])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_less_than_half_a_turn_of_one_angle_is_the_shorter_way(axis):
    first = np.array([20.0, -30.0, 50.0])
    second = first.copy()
    second[axis] += 130
    turning = Turning(np.array([0.0, 1.0]), np.array([first, second]))
    other = ScipySlerp([0, 1], Rotation.from_euler("xyz", [first, second], degrees=True))
    for time in (0.2, 0.7):
        assert rotation_of(turning.at(time)) == pytest.approx(other(time).as_matrix(), abs=1e-9)


def test_rotations_that_differ_in_more_take_the_shorter_way_through_all_keys():
    keys = np.array([[0.0, 0, 0], [30, 40, 0], [30, 90, -60]])
    other = ScipySlerp([0, 1, 2], Rotation.from_euler("xyz", keys, degrees=True))
    for time in (0.3, 0.8, 1.5):
        got = rotation_of(Turning(np.array([0.0, 1.0, 2.0]), keys).at(time))
        assert got == pytest.approx(other(time).as_matrix(), abs=1e-9)
    smooth = Turning(np.array([0.0, 1.0, 2.0]), keys, Smooth())
    steps = [rotation_of(smooth.at(t)) for t in (0.998, 0.999, 1.001, 1.002)]
    before, after = steps[0].T @ steps[1], steps[2].T @ steps[3]
    # No corner at the key: the turn of a thousandth before it is that after it. Slerp's differ by nine tenths of it.
    assert np.abs(before - after).max() < 0.02 * np.abs(before - np.eye(3)).max()


@pytest.mark.parametrize(
    ("times", "values", "words"),
    [
        ([], [], "0 values"),
        ([1, 1], [0, 0], "each later than the one before"),
        ([2, 1], [0, 0], "each later"),
        ([1, 2], [0], "1 values at times"),
        ([1, float("nan")], [0, 1], "each later"),
    ],
)
def test_keys_that_cannot_be_are_refused(times, values, words):
    with pytest.raises(ValueError, match=words):
        Track(np.array(times), np.array(values))


def test_a_shutter_is_covered_evenly_by_all_passes_and_by_the_first_few():
    times = Shutter(-0.25, 0.25).times(64, seed=3)
    assert np.array_equal(np.floor((np.sort(times) + 0.25) * 128), np.arange(64))
    for few in (4, 8, 16):
        assert np.array_equal(np.floor((np.sort(times[:few]) + 0.25) * 2 * few), np.arange(few))
    assert np.array_equal(times, Shutter(-0.25, 0.25).times(64, seed=3))
    assert not np.array_equal(times, Shutter(-0.25, 0.25).times(64, seed=4))


def test_a_shutter_that_does_not_open_sees_one_moment():
    assert np.array_equal(Shutter(0.1, 0.1).times(5), np.full(5, 0.1))


@pytest.mark.parametrize("ends", [(0.2, 0.1), (-2, 0), (0, float("nan"))])
def test_a_shutter_that_cannot_be_is_refused(ends):
    with pytest.raises(ValueError, match="in order"):
        Shutter(*ends)
    with pytest.raises(ValueError, match="0 passes"):
        Shutter().times(0)
