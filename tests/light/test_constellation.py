"""Constellations of lights: all of the map's light, where it is (Debevec 2005; "Image-Based Lighting", slides 5)."""

import numpy as np
import pytest

import naive
from lights import constant, lone, of_directions, spiky, spread, sunny
from relume.image.files import read_radiance
from relume.light.constellation import constellation
from relume.sphere.discs import Angular, MirrorBall
from relume.sphere.illumination import IlluminationMap, as_illumination
from relume.sphere.mappings import LatLong, pixel_points

SKIES = {"sunset": sunny(64), "clear sky": sunny(64, 400), "spiky": spiky(32), "constant": constant(32, (1, 2, 0.5))}
EVERY = pytest.mark.parametrize("light", SKIES.values(), ids=SKIES.keys())


def error(light, count):
    """Mean and largest error of irradiance, over surfaces that face anywhere, as shares of the mean irradiance."""
    normals = spread(500)
    lights, truth = constellation(light, count), light.irradiance(normals)
    found = np.maximum(normals @ lights.directions.T, 0) @ lights.irradiance
    difference = np.abs(found - truth) / truth.mean(0)
    return difference.mean(), difference.max()


# --- the light is all there ------------------------------------------------------------------------------------------


@EVERY
@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 300])
def test_any_number_of_lights_carries_the_maps_light_exactly(light, count):
    lights = constellation(light, count)
    assert lights.directions.shape == lights.irradiance.shape == (count, 3)
    np.testing.assert_allclose(lights.irradiance.sum(0), light.total(), rtol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(lights.directions, axis=-1), 1, rtol=1e-13)
    assert np.all(lights.irradiance.sum(-1) > 0)


@pytest.mark.parametrize("mapping", [Angular(), MirrorBall()])
def test_a_map_in_another_mapping_keeps_its_light_and_its_place(mapping):
    towards = np.array([0.6, 0.64, -0.48])
    light = of_directions(lambda d: 1 + 1000 * (d @ towards > 0.995), 64, mapping)
    lights = constellation(light, 8)
    np.testing.assert_allclose(lights.irradiance.sum(0), light.total(), rtol=1e-13)
    assert lights.directions[np.argmax(lights.irradiance[:, 0])] @ towards > np.cos(np.radians(10))


def test_constant_light_is_4_pi_shared_out_in_equal_parts():
    lights = constellation(constant(256), 64)
    assert lights.irradiance.sum(0) == pytest.approx([12.566371] * 3)  # A1's fluence
    np.testing.assert_allclose(lights.irradiance, 12.566371 / 64, rtol=0.05)  # whole pixels: not quite halves


def test_two_lights_of_constant_light_are_its_left_and_right():
    # As seen from the centre, towards −Z: a full turn is longer than the half turn from pole to pole.
    lights = constellation(constant(16, (1, 2, 0.5)), 2)
    np.testing.assert_allclose(lights.irradiance, 2 * np.pi * np.array([[1, 2, 0.5]] * 2), rtol=1e-7)
    np.testing.assert_allclose(lights.directions, [[-1, 0, 0], [1, 0, 0]], atol=1e-12)


# --- and where it is -------------------------------------------------------------------------------------------------


@EVERY
def test_surfaces_are_lit_as_by_the_map_itself(light):
    means, worst = np.transpose([error(light, count) for count in (16, 64, 256)])
    assert np.all(means < [0.07, 0.015, 0.004])
    assert np.all(worst < [0.3, 0.06, 0.02])


@pytest.mark.parametrize("name", ["venice_sunset", "quarry_01", "royal_esplanade"])
def test_surfaces_are_lit_as_by_photographed_light(name, shared):
    light = as_illumination(read_radiance(shared / f"data/hdri/three/{name}_1k.hdr")).remapped(LatLong(), 128)
    mean, worst = error(light, 64)
    assert mean < 0.015
    assert worst < 0.04


@pytest.mark.parametrize("count", [1, 2, 64])
def test_one_bright_pixel_is_one_light_at_its_middle(count):
    light = lone(16, 3, 21, value=5.0)
    lights = constellation(light, count)
    pixels, flux = naive.latlong_pixels(light.radiance)
    np.testing.assert_allclose(lights.directions, pixels[[3 * 32 + 21]], atol=1e-12)
    np.testing.assert_allclose(lights.irradiance, flux[[3 * 32 + 21]], rtol=1e-12)
    # Row 3 of 16: 5·(2π/32)(cos 3π/16 − cos 4π/16).
    assert lights.irradiance[0, 0] == pytest.approx(0.1220929, rel=1e-6)


def test_a_sun_gets_a_light_of_its_own_and_leaves_the_others_to_the_sky():
    light = lone(64, 20, 77, value=1e6, dark=1.0)
    lights = constellation(light, 64)
    pixels, flux = naive.latlong_pixels(light.radiance)
    sun = int(np.argmax(lights.irradiance[:, 0]))
    assert lights.directions[sun] @ pixels[20 * 128 + 77] > 1 - 1e-9
    assert lights.irradiance[sun] == pytest.approx(flux[20 * 128 + 77], rel=1e-3)
    others = np.delete(lights.irradiance[:, 0], sun)
    assert others.sum() == pytest.approx(4 * np.pi, rel=0.01)
    assert others.max() < 0.1 * others.sum()


def test_one_light_stands_where_the_light_is_on_average():
    light = sunny(16)
    directions, flux = naive.latlong_pixels(light.radiance)
    moment = (flux @ [0.2126, 0.7152, 0.0722]) @ directions
    (found,) = constellation(light, 1).directions
    np.testing.assert_allclose(found, moment / np.linalg.norm(moment), atol=1e-12)


def test_every_light_stands_among_the_pixels_it_stands_for():
    # Four bright pixels, one a quadrant of longitude, at different heights: four lights, each on one of them.
    radiance = np.zeros((8, 16, 3), np.float32)
    places = [(1, 2), (3, 6), (4, 9), (6, 13)]
    for value, place in enumerate(places, 1):
        radiance[place] = value, 0.1, 2
    lights = constellation(IlluminationMap(radiance), 4)
    pixels, flux = naive.latlong_pixels(radiance)
    numbers = [row * 16 + column for row, column in places]
    found = np.argmax(lights.directions @ pixels[numbers].T, axis=1)
    assert sorted(found) == [0, 1, 2, 3]
    np.testing.assert_allclose(lights.directions, pixels[numbers][found], atol=1e-12)
    np.testing.assert_allclose(lights.irradiance, flux[numbers][found], rtol=1e-12)


# --- odd maps and requests -------------------------------------------------------------------------------------------


def test_a_black_map_has_no_lights():
    lights = constellation(constant(8, 0.0), 5)
    assert lights.directions.shape == lights.irradiance.shape == (0, 3)


def test_there_are_never_more_lights_than_bright_pixels():
    radiance = np.zeros((8, 16, 3), np.float32)
    radiance[::3, ::5] = 1, 0, 0
    lights = constellation(IlluminationMap(radiance), 64)
    assert len(lights.directions) == 3 * 4
    np.testing.assert_allclose(lights.irradiance.sum(0), IlluminationMap(radiance).total(), rtol=1e-13)
    assert len(constellation(constant(1), 64).directions) == 2  # a map of two pixels


def test_faint_light_beside_a_blinding_one_is_kept():
    radiance = np.zeros((8, 16, 3), np.float32)
    radiance[2, 3], radiance[5, 12] = 1e12, 1e-6
    lights = constellation(IlluminationMap(radiance), 2)
    _, flux = naive.latlong_pixels(radiance)
    np.testing.assert_allclose(lights.irradiance[np.argsort(lights.irradiance[:, 0])], flux[[5 * 16 + 12, 2 * 16 + 3]])


def test_the_same_map_gives_the_same_lights():
    one, other = (constellation(spiky(32), 40) for _ in range(2))
    np.testing.assert_array_equal(one.directions, other.directions)
    np.testing.assert_array_equal(one.irradiance, other.irradiance)


def test_a_tall_map_and_one_in_other_floats_are_read_alike():
    light = spiky(16)
    double = IlluminationMap(np.asfortranarray(light.radiance.astype(np.float64)))
    np.testing.assert_array_equal(constellation(double, 9).irradiance, constellation(light, 9).irradiance)


@pytest.mark.parametrize("count", [0, -3])
def test_no_lights_are_refused(count):
    with pytest.raises(ValueError, match=r"a constellation of .* lights; expected 1 or more"):
        constellation(constant(8), count)


def test_the_middle_of_the_light_is_inside_its_rectangle():
    lights = constellation(sunny(32), 64)
    points = LatLong().image_points(lights.directions)
    assert len(np.unique(np.round(points, 9), axis=0)) == 64
    # Between lights that tile the sphere no direction is far from one.
    everywhere = LatLong().directions(pixel_points(LatLong(), 16)).reshape(-1, 3)
    assert np.degrees(np.arccos((everywhere @ lights.directions.T).max(1).min())) < 60
