"""Cubes of light: which way goes to which face and corner, and that no light is lost on the way to 1 × 1."""

import numpy as np
import pytest

from lights import SIMPLE, of_directions, spread
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import Strip, face_solid_angles
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.sphere.mip_cube import faces_of, mips, mirrored_strip

# Direction in the world → face, s to the right, t down: OpenGL 4.6, table 8.19, worked out by hand.
PLACES = [
    ((1, 0, 0), 0, 0.5, 0.5),
    ((-1, 0, 0), 1, 0.5, 0.5),
    ((0, 1, 0), 2, 0.5, 0.5),
    ((0, -1, 0), 3, 0.5, 0.5),
    ((0, 0, 1), 4, 0.5, 0.5),
    ((0, 0, -1), 5, 0.5, 0.5),
    ((1, 0.6, 0.4), 0, 0.3, 0.2),
    ((-1, 0.6, 0.4), 1, 0.7, 0.2),
    ((0.6, 1, 0.4), 2, 0.8, 0.7),
    ((0.6, -1, 0.4), 3, 0.8, 0.3),
    ((0.6, 0.4, 1), 4, 0.8, 0.3),
    ((0.6, 0.4, -1), 5, 0.2, 0.3),
]


def strip_of(faces, unit="relative"):
    return EnvironmentMap(np.concatenate(list(faces), axis=1), Strip(), unit)


def directions(size):
    return np.stack(np.split(pixel_directions(Strip(), size), 6, axis=1))


def spot(direction, size=128):
    """A soft spot of about 5° round a direction."""
    return of_directions(lambda d: np.exp(400 * (d @ normalised(direction) - 1)), size)


def noise(size, seed=1):
    return strip_of(np.random.default_rng(seed).random((6, size, size, 3)).astype(np.float32), "cd/m²")


@pytest.mark.parametrize(("direction", "face", "s", "t"), PLACES)
def test_a_light_ends_where_a_sampler_looks_for_it(direction, face, s, t):
    faces = faces_of(spot(direction).remapped(Strip(), 40))
    found, row, column = np.unravel_index(faces[..., 1].argmax(), faces.shape[:3])
    assert found == face
    assert abs((column + 0.5) / 40 - s) < 0.03
    assert abs((row + 0.5) / 40 - t) < 0.03


@pytest.mark.parametrize(("direction", "face", "s", "t"), PLACES)
def test_a_look_up_finds_the_texel_of_a_direction(direction, face, s, t):
    faces = np.zeros((6, 20, 20, 3), np.float32)
    faces[..., 0] = np.arange(6)[:, None, None]
    faces[..., 1:] = np.stack(np.broadcast_arrays(*np.meshgrid(np.arange(20.0), np.arange(20.0))), -1)
    found = strip_of(faces).lookup(normalised(direction))
    assert found == pytest.approx([face, 20 * s - 0.5, 20 * t - 0.5], abs=1e-5)


def test_directions_are_unit_and_those_of_the_table():
    table = directions(2)
    assert np.linalg.norm(table, axis=-1) == pytest.approx(1)
    assert table[0, 0, 0] == pytest.approx(np.array([1, 0.5, 0.5]) / 1.5**0.5)
    assert table[5, 1, 0] == pytest.approx(np.array([0.5, -0.5, -1]) / 1.5**0.5)
    cube = noise(16)
    assert cube.lookup(directions(16)) == pytest.approx(faces_of(cube), abs=1e-6)


def test_solid_angles_are_exact():
    for size in (1, 2, 3, 64, 1024):
        assert face_solid_angles(size).shape == (size, size)
        assert 6 * face_solid_angles(size).sum() == pytest.approx(4 * np.pi, abs=1e-12)
    assert face_solid_angles(1)[0, 0] == pytest.approx(2.094395, abs=1e-6)
    # dω = du dv / (1 + u² + v²)^(3/2), by Gauss and Legendre
    nodes, weights = np.polynomial.legendre.leggauss(12)
    u, v = np.meshgrid((nodes + 1) / 4 + 0.5, (nodes + 1) / 4 - 0.5)
    expected = ((1 + u**2 + v**2) ** -1.5 * np.outer(weights, weights)).sum() / 16
    assert face_solid_angles(4)[1, 3] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("mapping", SIMPLE, ids=[m.name for m in SIMPLE])
def test_constant_light_stays_exactly_constant(mapping):
    value = np.array([0.3, 1.7, 1e-5], np.float32)
    light = EnvironmentMap(np.broadcast_to(value, (*mapping.shape(24), 3)).copy(), mapping, "cd/m²")
    for size in (1, 5, 16):
        cube = light.remapped(Strip(), size)
        assert np.all(cube.radiance == value)
        assert cube.unit == "cd/m²"
    assert all(np.allclose(level.radiance, value, rtol=2e-7) for level in mips(cube))


@pytest.mark.parametrize("size", [4, 32])
def test_the_light_of_a_map_with_a_sun_is_kept(size):
    random = np.random.default_rng(4)
    radiance = random.random((96, 192, 3)).astype(np.float32)
    radiance[31, 150] = 5e4, 4e4, 3e4
    light = EnvironmentMap(radiance)
    cube = light.remapped(Strip(), size)
    assert cube.total() == pytest.approx(light.total(), rel=1e-6)
    # Away from the sun the scale to the total is not seen: noise of mean ½ keeps it.
    shade = faces_of(cube)[directions(size) @ LatLong().directions(np.array([150.5 / 192, 31.5 / 96])) < 0]
    assert shade.mean() == pytest.approx(0.5, rel=0.02)


def test_a_fine_map_loses_no_pixel_in_a_coarse_cube():
    for column in range(100, 104):
        radiance = np.zeros((64, 128, 3), np.float32)
        radiance[20, column] = 1
        light = EnvironmentMap(radiance)
        faces = faces_of(light.remapped(Strip(), 4))
        towards = LatLong().directions(np.array([(column + 0.5) / 128, 20.5 / 64]))
        lit = (faces[..., :1] * directions(4) * face_solid_angles(4)[..., None]).sum((0, 1, 2))
        assert normalised(lit) @ towards > np.cos(np.radians(12))  # within half a texel


def test_a_smooth_light_keeps_its_values():
    light = of_directions(lambda d: 1 + 0.5 * d[..., 2] + 0.3 * d[..., 0] * d[..., 1], 128)
    x, y, z = np.moveaxis(directions(32), -1, 0)
    np.testing.assert_allclose(
        faces_of(light.remapped(Strip(), 32))[..., 0], 1 + 0.5 * z + 0.3 * x * y, rtol=0, atol=2e-3
    )


def test_mip_levels_go_down_to_one_texel_and_keep_the_light():
    cube = noise(32)
    levels = mips(cube)
    assert [level.size for level in levels] == [32, 16, 8, 4, 2, 1]
    assert levels[0] is cube
    for level in levels:
        assert level.total() == pytest.approx(cube.total(), rel=1e-6)
        assert level.unit == "cd/m²"


def test_a_mip_texel_weighs_its_four_by_solid_angle():
    faces = np.zeros((6, 4, 4, 3), np.float32)
    faces[2, 0, 3] = 1  # the corner of a face, the smallest of its four
    level = faces_of(mips(strip_of(faces))[1])
    share = face_solid_angles(4)[0, 3] / face_solid_angles(4)[:2, 2:].sum()
    assert share < 0.22
    assert level[2, 0, 1] == pytest.approx(share, rel=1e-6)
    assert np.count_nonzero(level) == 3


@pytest.mark.parametrize(("axis", "sign", "faces"), [("x", (-1, 1, 1), "102345"), ("z", (1, 1, -1), "012354")])
def test_a_mirrored_cube_is_met_by_a_mirrored_direction(axis, sign, faces):
    cube, towards = noise(8), spread(200)
    mirrored = mirrored_strip(cube, axis)
    assert mirrored.lookup(towards * sign) == pytest.approx(cube.lookup(towards), abs=1e-6)
    assert mirrored.unit == "cd/m²"
    means = faces_of(cube).mean((1, 2, 3))[[int(face) for face in faces]]
    assert faces_of(mirrored).mean((1, 2, 3)) == pytest.approx(means)


def test_a_wrong_call_is_reported():
    with pytest.raises(ValueError, match="power of two"):
        mips(noise(6))
    with pytest.raises(ValueError, match='axis is "y"'):
        mirrored_strip(noise(2), "y")
    with pytest.raises(ValueError, match="only strips of cube faces are mirrored"):
        mirrored_strip(EnvironmentMap(np.ones((2, 4, 3), np.float32)), "x")
