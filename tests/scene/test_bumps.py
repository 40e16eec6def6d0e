"""Wrinkled normals (§8, Blinn 1978): slopes against the surface's own, and which way they turn."""

import numpy as np
import pytest

from angles import degrees_between
from lights import spread
from relume.scene.materials.bumps import BumpMap, Wrinkles
from relume.sphere.directions import normalised

NORMAL, EAST, NORTH = np.array([[0.0, 1, 0]]), np.array([[2.0, 0, 0]]), np.array([[0.0, 0, -2.0]])
"""A floor seen from above: u goes 2 m east, v 2 m north, and dp_du × dp_dv is up."""


def of_wrinkles(wrinkles, points, normals):
    nothing = np.zeros((len(points), 3))
    return wrinkles.turned(normals, points, np.zeros((len(points), 2)), nothing, nothing)


def on_the_floor(heights, uv, normal=NORMAL, du=EAST, dv=NORTH):
    uv = np.atleast_2d(uv)
    spread_out = [np.broadcast_to(vector, (len(uv), 3)) for vector in (normal, np.zeros(3), du, dv)]
    return BumpMap(np.asarray(heights)).turned(spread_out[0], spread_out[1], uv, spread_out[2], spread_out[3])


def slopes(normals):
    """Rise towards east and north of a floor with these normals."""
    return -normals[:, 0] / normals[:, 1], normals[:, 2] / normals[:, 1]


def hill(columns=32, rows=16):
    """A height that rises along u in the west, falls in the east, and falls with v in the north."""
    u, v = (np.arange(columns) + 0.5) / columns, 1 - (np.arange(rows)[:, None] + 0.5) / rows
    return 0.05 * np.sin(2 * np.pi * u) * np.ones((rows, 1)) + 0.03 * np.cos(2 * np.pi * v)


# --- wrinkles through space ------------------------------------------------------------------------------------------


def test_wrinkles_of_no_height_leave_normals_alone():
    normals, points = spread(100), np.random.default_rng(1).normal(size=(100, 3))
    np.testing.assert_allclose(of_wrinkles(Wrinkles(0.0), points, normals), normals, atol=1e-15)


def test_wrinkled_normals_are_of_unit_length_and_differ():
    normals, points = spread(500), np.random.default_rng(1).normal(size=(500, 3))
    turned = of_wrinkles(Wrinkles(), points, normals)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=-1), 1, rtol=1e-12)
    assert degrees_between(turned, normals).mean() > 3


def heights_on_the_floor(wrinkles, side, count):
    """The displacement of a floor, summed up from the slopes that its normals say."""
    east = np.linspace(0, side, count)
    points = np.stack(np.meshgrid(east, [0.0], east, indexing="ij"), -1).reshape(-1, 3)
    normals = of_wrinkles(wrinkles, points, np.broadcast_to(NORMAL, points.shape))
    along, north = (slope.reshape(count, count) for slope in slopes(normals))
    return along, -north, side / (count - 1)


def test_the_slopes_of_wrinkles_are_of_one_surface():
    # Summed round every little square they come back to the height they began with: ∂²h/∂x∂z is one number.
    east, south, step = heights_on_the_floor(Wrinkles(0.002, 0.05, seed=4), 0.1, 401)
    across, along = np.gradient(east, step, axis=1), np.gradient(south, step, axis=0)
    inner = (slice(2, -2), slice(2, -2))
    assert np.abs(across - along)[inner].max() < 2e-3 * np.abs(across).max()


def test_the_height_of_wrinkles_is_the_root_mean_square_of_the_displacement():
    found = []
    for seed in range(12):
        east, _, step = heights_on_the_floor(Wrinkles(0.002, 0.05, seed=seed), 1.0, 301)
        heights = np.cumsum(east, axis=0) * step
        found.append(np.mean((heights - heights.mean(0)) ** 2))
    # 24 waves of a dozen seeds: 288 random amplitudes along a line. A factor of √2 would be 40 % off.
    assert np.sqrt(np.mean(found)) == pytest.approx(0.002, rel=0.1)


@pytest.mark.parametrize("wavelength", [0.02, 0.1])
def test_the_slopes_of_wrinkles_are_those_of_waves_of_their_length(wavelength):
    points = np.random.default_rng(2).uniform(-5, 5, (4000, 3))
    found = []
    for seed in range(12):
        normals = of_wrinkles(Wrinkles(0.001, wavelength, seed), points, np.broadcast_to(NORMAL, points.shape))
        found.append(np.mean(np.square(slopes(normals))))
    # A wave a·sin(k·x) with k turned every way: each slope's mean square is h² k²/3, and the mean of k² over an octave
    # in its logarithm is (2π/λ)² · 0.75/ln 2.
    expected = 0.001 * 2 * np.pi / wavelength * np.sqrt(0.75 / np.log(2) / 3)
    assert np.sqrt(np.mean(found)) == pytest.approx(expected, rel=0.05)


def test_the_same_seed_gives_the_same_wrinkles_and_another_gives_others():
    normals, points = spread(50), np.random.default_rng(1).normal(size=(50, 3))
    one = of_wrinkles(Wrinkles(seed=3), points, normals)
    assert np.array_equal(one, of_wrinkles(Wrinkles(seed=3), points, normals))
    assert np.abs(one - of_wrinkles(Wrinkles(seed=4), points, normals)).max() > 0.1


def test_wrinkles_of_a_point_do_not_depend_on_the_points_beside_it():
    normals, points = spread(50), np.random.default_rng(1).normal(size=(50, 3))
    together = of_wrinkles(Wrinkles(), points, normals)
    np.testing.assert_allclose(together[7:8], of_wrinkles(Wrinkles(), points[7:8], normals[7:8]), rtol=1e-12)


@pytest.mark.parametrize("given", [{"height": -1.0}, {"height": np.nan}, {"wavelength": 0.0}, {"waves": 0}])
def test_wrinkles_that_cannot_be_are_refused(given):
    with pytest.raises(ValueError, match=r"wrinkles .* m high, .* waves; expected 0 or more, above 0 and at least 1"):
        Wrinkles(**given)


# --- heights over texture coordinates --------------------------------------------------------------------------------


def test_a_flat_map_leaves_normals_alone():
    uv = np.random.default_rng(1).random((50, 2))
    np.testing.assert_allclose(on_the_floor(np.full((4, 6), 0.3), uv), np.broadcast_to(NORMAL, (50, 3)), atol=1e-15)


def test_a_ramp_that_rises_along_u_tilts_the_normal_against_dp_du():
    ramp = np.linspace(0, 0.1, 11) * np.ones((4, 1))  # 0.01 m an entry of 2/11 m
    (normal,) = on_the_floor(ramp, [0.5, 0.5])
    assert normal[0] < 0
    np.testing.assert_allclose(normal, normalised([-0.01 * 11 / 2, 1, 0]), rtol=1e-12, atol=1e-15)


def test_a_ramp_that_rises_along_v_tilts_the_normal_against_dp_dv():
    # v goes up the image: its upper rows are higher.
    ramp = np.linspace(0.1, 0, 11)[:, None] * np.ones((1, 4))
    (normal,) = on_the_floor(ramp, [0.5, 0.5])
    np.testing.assert_allclose(normal, normalised([0, 1, 0.01 * 11 / 2]), rtol=1e-12, atol=1e-15)


def test_the_normals_are_those_of_the_displaced_surface():
    # Against numerical derivatives of the bilinear heights' centre values, where the map is smooth.
    uv = np.random.default_rng(3).random((300, 2))
    east, north = slopes(on_the_floor(hill(256, 128), uv))
    np.testing.assert_allclose(east, 0.05 * 2 * np.pi * np.cos(2 * np.pi * uv[:, 0]) / 2, atol=2e-4)
    np.testing.assert_allclose(north, -0.03 * 2 * np.pi * np.sin(2 * np.pi * uv[:, 1]) / 2, atol=2e-4)


@pytest.mark.parametrize(("du", "dv"), [([[-2.0, 0, 0]], NORTH), (EAST, [[0.0, 0, 2.0]])], ids=["u", "v"])
def test_mirrored_coordinates_mirror_the_bumps_and_keep_them_outward(du, dv):
    uv = np.random.default_rng(3).random((100, 2))
    east, north = slopes(on_the_floor(hill(), uv))
    across, along = slopes(on_the_floor(hill(), uv, du=np.array(du), dv=np.array(dv)))
    np.testing.assert_allclose(across, east * np.sign(du[0][0]), atol=1e-12)
    np.testing.assert_allclose(along, north * -np.sign(np.array(dv)[0][2]), atol=1e-12)


def test_on_the_back_of_a_surface_a_bump_is_a_bump_as_well():
    # Seen from below the floor's normal is down; the same heights rise towards the viewer.
    uv = np.random.default_rng(3).random((100, 2))
    above, below = on_the_floor(hill(), uv), on_the_floor(hill(), uv, normal=-NORMAL)
    np.testing.assert_allclose(below, above * [1, -1, 1], atol=1e-12)


def test_skewed_coordinates_tilt_normals_as_the_displaced_surface_is():
    du, dv, normal = np.array([2.0, 0.3, 0.5]), np.array([0.4, -0.1, -1.5]), np.empty(3)
    normal = normalised(np.cross(du, dv))
    uv, step = np.array([0.31, 0.62]), 1e-4
    fine = hill(2048, 1024)

    def place(u, v):
        height = 0.05 * np.sin(2 * np.pi * u) + 0.03 * np.cos(2 * np.pi * v)
        return u * du + v * dv + height * normal

    tangents = [
        (place(*(uv + offset)) - place(*(uv - offset))) / (2 * step) for offset in (np.array([step, 0]), [0, step])
    ]
    expected = normalised(np.cross(*tangents))
    (found,) = on_the_floor(fine, uv, normal=normal, du=du, dv=dv)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_heights_repeat_beyond_the_unit_square():
    uv = np.random.default_rng(3).random((100, 2))
    for offset in ([1, 0], [0, -1], [-3, 2]):
        np.testing.assert_allclose(on_the_floor(hill(), uv + offset), on_the_floor(hill(), uv), atol=1e-9)


def test_heights_go_on_over_the_edge_of_the_unit_square():
    for before, after in (([1 - 1e-9, 0.3], [1e-9, 0.3]), ([0.3, 1 - 1e-9], [0.3, 1e-9])):
        np.testing.assert_allclose(on_the_floor(hill(), before), on_the_floor(hill(), after), atol=1e-6)


def test_where_there_are_no_coordinates_normals_are_left_alone():
    none = np.zeros((1, 3))
    np.testing.assert_allclose(on_the_floor(hill(), [0.3, 0.3], du=none, dv=none), NORMAL)
    np.testing.assert_allclose(on_the_floor(hill(), [0.3, 0.3], du=EAST, dv=EAST), NORMAL)


@pytest.mark.parametrize(
    "heights", [np.zeros(4), np.zeros((4, 4, 3)), np.array([[0, np.nan]]), np.array([[0, np.inf]]), np.zeros((0, 3))]
)
def test_heights_that_are_no_image_of_metres_are_refused(heights):
    with pytest.raises(ValueError, match=r"heights are \(.*\); expected an image \(H, W\) of finite metres"):
        BumpMap(heights)
