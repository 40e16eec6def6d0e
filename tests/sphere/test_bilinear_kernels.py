"""Look-up inside kernels: the same values as the friendly look-up, everywhere on the sphere."""

import numba
import numpy as np
import pytest

from lights import spiky, spread
from relume.sphere.bilinear_kernels import arctangent2, looked_up, padded, polar_point
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap


@numba.njit
def at_directions(table, directions):
    seen, entries = np.empty_like(directions), table.reshape(-1)
    for i in range(len(directions)):
        u, v = polar_point(directions[i, 0], directions[i, 1], directions[i, 2])
        seen[i, 0], seen[i, 1], seen[i, 2], _ = looked_up(entries, 0, table.shape[0] - 2, u, v)
    return seen


@numba.njit
def angles_of(y, x):
    angles = np.empty_like(y)
    for i in range(len(y)):
        angles[i] = arctangent2(y[i], x[i])
    return angles


def seen(light, directions):
    return at_directions(padded(light.radiance), directions.astype(np.float32))


def smooth(size):
    """Every pixel differs by a little from the next, so that float32 directions do not."""
    return EnvironmentMap((2 + np.random.default_rng(1).random((size, 2 * size, 3))).astype(np.float32))


AXES = np.concatenate([np.eye(3), -np.eye(3)])
NEAR_POLES = normalised(spread(200) * [0.02, 0, 0.02] + [0, 1, 0])
NEAR_THE_SEAM = normalised(spread(200) * [1e-3, 1, 0] + [0, 0, 1])
PLACES = {
    "everywhere": spread(2000),
    "on the axes": AXES,
    "at the poles": np.concatenate([NEAR_POLES, -NEAR_POLES]),
    "on the seam": NEAR_THE_SEAM,
    "a hair from the seam": normalised([[s * 1e-7, y, 1] for s in (-1, 0, 1) for y in (-2, -0.1, 0, 0.5, 3)]),
    "a hair from a pole": normalised([[x, y, z] for x in (-1e-7, 0, 1e-7) for z in (-1e-7, 0, 1e-7) for y in (-1, 1)]),
}


@pytest.mark.parametrize("directions", PLACES.values(), ids=PLACES.keys())
@pytest.mark.parametrize("size", [1, 2, 9, 16])
def test_a_kernel_looks_up_what_the_map_looks_up(directions, size):
    light = smooth(size)
    # Both are asked about the direction as float32 holds it.
    directions = directions.astype(np.float32).astype(np.float64)
    np.testing.assert_allclose(seen(light, directions), light.lookup(directions), rtol=1e-5)


def test_a_kernel_looks_up_a_sun_beside_the_dark():
    # float32 places a point to 4e-7 rad, so a share of the sun's edge may differ, but nothing of its size.
    light = spiky(64)
    directions = spread(5000).astype(np.float32).astype(np.float64)
    np.testing.assert_allclose(seen(light, directions), light.lookup(directions), atol=1e-5 * light.radiance.max())


def test_a_kernel_looks_up_directions_of_any_length():
    directions = spread(100)
    np.testing.assert_allclose(seen(smooth(8), directions * 7), seen(smooth(8), directions), rtol=1e-5)


def test_the_arctangent_is_numpys_to_4e_7():
    angle = np.linspace(-np.pi, np.pi, 100_001)[1:-1]
    for length in (1e-20, 1.0, 1e15):
        y, x = (length * np.sin(angle)).astype(np.float32), (length * np.cos(angle)).astype(np.float32)
        assert np.abs(angles_of(y, x) - np.arctan2(y.astype(float), x.astype(float))).max() < 4e-7


def test_the_arctangent_of_the_axes():
    y, x = np.array([[0, 1, 0, -1, 0, 1, -1], [1, 0, -1, 0, 0, 1, -1]], np.float32)
    expected = [0, np.pi / 2, np.pi, -np.pi / 2, 0, np.pi / 4, -3 * np.pi / 4]
    np.testing.assert_allclose(angles_of(y, x), expected, atol=4e-7)


def test_a_padded_table_goes_on_round_the_seam_and_over_the_poles():
    table = np.arange(2 * 4 * 3, dtype=np.float64).reshape(2, 4, 3)
    wide = padded(table)
    assert wide.shape == (4, 6, 4)
    assert wide.dtype == np.float32
    assert not wide[..., 3].any()
    wide = wide[..., :3]
    np.testing.assert_array_equal(wide[1:3, 1:5], table)
    np.testing.assert_array_equal(wide[1:3, 0], table[:, 3])
    np.testing.assert_array_equal(wide[1:3, 5], table[:, 0])
    np.testing.assert_array_equal(wide[0, 1:5], table[0, [2, 3, 0, 1]])
    np.testing.assert_array_equal(wide[3, 1:5], table[1, [2, 3, 0, 1]])
    np.testing.assert_array_equal(wide[0, 0], table[0, 1])
