"""Constellations of lights: all of the map's light, where it is (Debevec 2005; "Image-Based Lighting", slides 5)."""

import numpy as np
import pytest

import naive
from lights import constant, lone, of_directions, spiky, spread, sunny
from relume.image.files import read_radiance
from relume.light.constellations.cells import cells_of
from relume.light.constellations.constellation import Constellation, constellation, irradiance_error, together
from relume.light.constellations.k_means import KMeans, _assigned, _groups
from relume.light.constellations.rectangles import MedianCut, VarianceMinimisation
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_points
from relume.sphere.mappings.names import mapping_named

SKIES = {"sunset": sunny(64), "clear sky": sunny(64, 400), "spiky": spiky(32), "constant": constant(32, (1, 2, 0.5))}
METHODS = {"median cut": MedianCut(), "variance": VarianceMinimisation(), "k-means": KMeans()}
EACH = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS.keys())
BOUNDS = {  # of irradiance, for 16, 64 and 256 lights: mean and largest
    MedianCut: ([0.07, 0.015, 0.004], [0.3, 0.06, 0.02]),
    VarianceMinimisation: ([0.05, 0.015, 0.004], [0.2, 0.07, 0.02]),
    KMeans: ([0.05, 0.01, 0.005], [0.2, 0.05, 0.03]),
}
MAPPINGS = ["angular", "ball", "octahedral", "equalarea", "hemispheres", "cross", "strip"]
EVERY = pytest.mark.parametrize("light", SKIES.values(), ids=SKIES.keys())


def error(light, count, method=None):
    """Mean and largest error of irradiance, over surfaces that face anywhere, as shares of the mean irradiance."""
    normals = spread(500)
    lights, truth = constellation(light, count, method), light.irradiance(normals)
    found = np.maximum(normals @ lights.directions.T, 0) @ lights.irradiance
    difference = np.abs(found - truth) / truth.mean(0)
    return difference.mean(), difference.max()


# --- the light is all there ------------------------------------------------------------------------------------------


@EVERY
@EACH
@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 300])
def test_any_number_of_lights_carries_the_maps_light_exactly(light, count, method):
    lights = constellation(light, count, method)
    assert lights.directions.shape == lights.irradiance.shape == (count, 3)
    np.testing.assert_allclose(lights.irradiance.sum(0), light.total(), rtol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(lights.directions, axis=-1), 1, rtol=1e-13)
    assert np.all(lights.irradiance.sum(-1) > 0)


@EACH
@pytest.mark.parametrize("name", MAPPINGS)
def test_a_map_in_another_mapping_keeps_its_light_and_its_place(name, method):
    towards = np.array([0.6, 0.64, -0.48])
    size = {"cross": 96, "strip": 32}.get(name, 64)
    light = of_directions(lambda d: 1 + 1000 * (d @ towards > 0.995), size, mapping_named(name))
    lights = constellation(light, 8, method)
    assert len(lights.directions) == 8
    np.testing.assert_allclose(lights.irradiance.sum(0), light.total(), rtol=1e-12)
    assert lights.directions[np.argmax(lights.irradiance[:, 0])] @ towards > np.cos(np.radians(10))


@EACH
@pytest.mark.parametrize("name", ["latlong", "angular", "cross"])
def test_a_light_is_the_sum_of_the_pixels_labelled_as_its_own(name, method):
    light = sunny(48) if name == "latlong" else sunny(48).remapped(mapping_named(name), 48)
    lights = constellation(light, 12, method)
    areas = light.mapping.solid_angles(light.size)
    assert lights.labels is not None and lights.solid_angles is not None
    assert lights.labels.shape == areas.shape
    assert np.all((lights.labels >= 0) == (areas > 1e-12))
    flux = light.radiance.astype(np.float64) * areas[..., None]
    for number in range(12):
        own = lights.labels == number
        np.testing.assert_allclose(lights.irradiance[number], flux[own].sum(0), rtol=1e-10)
        assert lights.solid_angles[number] == pytest.approx(areas[own].sum(), rel=1e-10)
    assert lights.solid_angles.sum() == pytest.approx(12.566371)


def test_a_map_of_many_rows_is_summed_in_blocks_and_loses_nothing():
    light = spiky(37)
    fine, coarse = cells_of(light), cells_of(light, 10)
    assert fine.flux.shape == (37, 74, 3) and coarse.flux.shape == (10, 19, 3)
    directions, flux = naive.latlong_pixels(light.radiance)
    flux, moment = flux.reshape(37, 74, 3), (flux @ [0.2126, 0.7152, 0.0722])[:, None] * directions
    np.testing.assert_allclose(fine.flux, flux, rtol=1e-12)
    np.testing.assert_allclose(fine.moment, moment.reshape(37, 74, 3), rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(coarse.flux[9, 18], flux[36:, 72:].sum((0, 1)), rtol=1e-12)
    np.testing.assert_allclose(coarse.moment[3, 4], moment.reshape(37, 74, 3)[12:16, 16:20].sum((0, 1)), rtol=1e-9)
    assert coarse.areas.sum() == pytest.approx(12.566371)
    many = coarse.in_pixels(np.arange(190, dtype=np.int32).reshape(10, 19))
    assert many.shape == (37, 74) and (many[35, 7], many[36, 73]) == (8 * 19 + 1, 189)


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
@EACH
def test_surfaces_are_lit_as_by_the_map_itself(light, method):
    means, worst = np.transpose([error(light, count, method) for count in (16, 64, 256)])
    mean_bounds, worst_bounds = BOUNDS[type(method)]
    assert np.all(means < mean_bounds)
    assert np.all(worst < worst_bounds)


@pytest.mark.parametrize("name", ["venice_sunset", "quarry_01", "royal_esplanade"])
def test_surfaces_are_lit_as_by_photographed_light(name, shared):
    fine = as_environment(read_radiance(shared / f"data/hdri/three/{name}_1k.hdr"))
    light = EnvironmentMap(fine.radiance.reshape(128, 4, 256, 4, 3).mean((1, 3)))
    mean, worst = error(light, 64)
    assert mean < 0.015
    assert worst < 0.04
    assert error(light, 64, KMeans())[0] < 0.8 * mean
    assert error(light, 64, VarianceMinimisation())[0] < 0.015


@EACH
@pytest.mark.parametrize("count", [1, 2, 64])
def test_one_bright_pixel_is_one_light_at_its_middle(count, method):
    light = lone(16, 3, 21, value=5.0)
    lights = constellation(light, count, method)
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
    lights = constellation(EnvironmentMap(radiance), 4)
    pixels, flux = naive.latlong_pixels(radiance)
    numbers = [row * 16 + column for row, column in places]
    found = np.argmax(lights.directions @ pixels[numbers].T, axis=1)
    assert sorted(found) == [0, 1, 2, 3]
    np.testing.assert_allclose(lights.directions, pixels[numbers][found], atol=1e-12)
    np.testing.assert_allclose(lights.irradiance, flux[numbers][found], rtol=1e-12)


# --- odd maps and requests -------------------------------------------------------------------------------------------


@EACH
def test_a_black_map_has_no_lights(method):
    lights = constellation(constant(8, 0.0), 5, method)
    assert lights.directions.shape == lights.irradiance.shape == (0, 3)


@EACH
def test_there_are_never_more_lights_than_bright_pixels(method):
    radiance = np.zeros((8, 16, 3), np.float32)
    radiance[::3, ::5] = 1, 0, 0
    lights = constellation(EnvironmentMap(radiance), 64, method)
    assert len(lights.directions) == 3 * 4
    np.testing.assert_allclose(lights.irradiance.sum(0), EnvironmentMap(radiance).total(), rtol=1e-13)
    assert len(constellation(constant(1), 64).directions) == 2  # a map of two pixels


def test_faint_light_beside_a_blinding_one_is_kept():
    radiance = np.zeros((8, 16, 3), np.float32)
    radiance[2, 3], radiance[5, 12] = 1e12, 1e-6
    lights = constellation(EnvironmentMap(radiance), 2)
    _, flux = naive.latlong_pixels(radiance)
    np.testing.assert_allclose(lights.irradiance[np.argsort(lights.irradiance[:, 0])], flux[[5 * 16 + 12, 2 * 16 + 3]])


@EACH
def test_the_same_map_gives_the_same_lights(method):
    one, other = (constellation(spiky(32), 40, method) for _ in range(2))
    np.testing.assert_array_equal(one.directions, other.directions)
    np.testing.assert_array_equal(one.irradiance, other.irradiance)


def test_a_tall_map_and_one_in_other_floats_are_read_alike():
    light = spiky(16)
    double = EnvironmentMap(np.asfortranarray(light.radiance.astype(np.float64)))
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


# --- the three methods -----------------------------------------------------------------------------------------------


def spread_of(light, lights):
    """Σ Y |ω − direction|² dω, each pixel about its own light: what variance minimisation and k-means make small."""
    pixels, flux = naive.latlong_pixels(light.radiance)
    assert lights.labels is not None
    own = lights.directions[lights.labels.ravel()]
    return float((flux @ [0.2126, 0.7152, 0.0722]) @ np.sum((pixels - own) ** 2, axis=-1))


@pytest.mark.parametrize("name", ["sunset", "clear sky", "spiky"])
def test_variance_minimisation_spreads_light_less_than_median_cut_and_k_means_less_still(name):
    light = SKIES[name]
    median, variance, means = (spread_of(light, constellation(light, 48, m)) for m in METHODS.values())
    assert means < variance < median


def test_of_all_cuts_the_first_leaves_the_least_variance():
    light = sunny(12)
    pixels, flux = naive.latlong_pixels(light.radiance)
    weights = flux @ [0.2126, 0.7152, 0.0722]

    def variance(inside):
        w, p = weights[inside.ravel()], pixels[inside.ravel()]
        return w @ np.sum((p - w @ p / w.sum()) ** 2, axis=-1)

    rows, columns = np.indices((12, 24))
    cuts = [rows < k for k in range(1, 12)] + [columns < k for k in range(1, 24)]
    best = min(cuts, key=lambda cut: variance(cut) + variance(~cut))
    labels = constellation(light, 2, VarianceMinimisation()).labels
    assert labels is not None
    assert np.array_equal(labels == labels[0, 0], best == best[0, 0])


def test_two_sources_are_not_cut_through_where_median_cut_does():
    # The poster's Fig. 2: a strong source beside a weak one, in one region that is to be halved.
    radiance = np.zeros((16, 32, 3), np.float32)
    radiance[7, 10:12], radiance[7, 20] = 10, 3
    lights = constellation(EnvironmentMap(radiance), 2, VarianceMinimisation())
    assert lights.labels is not None
    assert np.array_equal(np.unique(lights.labels[7, 10:12]), [0])
    assert lights.irradiance[0, 0] / lights.irradiance[1, 0] == pytest.approx(20 / 3)
    halved = constellation(EnvironmentMap(radiance), 2, MedianCut())
    assert halved.irradiance[0, 0] / halved.irradiance[1, 0] == pytest.approx(13 / 10)


def test_k_means_asks_only_the_centres_that_may_be_nearest_and_misses_none():
    cells = cells_of(spiky(45))
    directions, centres = cells.directions(), spread(70)
    lit = np.concatenate([cells.luminance[..., None], cells.moment], axis=-1)
    labels = np.empty(lit.shape[:2], np.int32)
    sums = _assigned(lit, directions, *_groups(directions), centres, labels)
    nearest = np.argmax(directions @ centres.T, axis=-1)
    np.testing.assert_array_equal(labels, nearest)
    for k in range(70):
        np.testing.assert_allclose(sums[k], lit[nearest == k].sum(0), rtol=1e-9, atol=1e-12)


def test_k_means_gives_a_centre_that_lost_its_light_other_light():
    class Badly:
        def regions(self, cells, count):
            # Two rings round the same pole have one mean direction; the second of them can never be the nearest.
            labels = np.zeros(cells.areas.shape, np.int32)
            labels[2:5], labels[5:] = 1, 2
            return labels

    lights = constellation(constant(16), 3, KMeans(start=Badly()))
    assert len(lights.directions) == 3
    assert lights.irradiance[:, 0].min() > 0.2 * 4 * np.pi


def test_k_means_of_no_iterations_is_refused():
    with pytest.raises(ValueError, match="k-means of 0 iterations; expected 1 or more"):
        KMeans(iterations=0)


# --- what a light is besides -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [2.0, 10.0, 60.0])
def test_the_angular_radius_is_that_of_the_disc_of_light(degrees):
    towards = np.array([0.6, 0.64, -0.48])
    light = of_directions(lambda d: 1.0 * (d @ towards > np.cos(np.radians(degrees))), 256)
    lights = constellation(light, 1)
    assert lights.angular_radii is not None
    assert np.degrees(lights.angular_radii[0]) == pytest.approx(degrees, rel=0.03)
    assert lights.directions[0] @ towards > np.cos(np.radians(0.1))


def test_the_irradiance_error_is_what_surfaces_miss():
    light = sunny(64)
    normals, lights = spread(500), constellation(light, 16)
    truth = light.irradiance(normals)
    difference = np.abs(lights.irradiance_on(normals) - truth) / truth.mean(0)
    mean, worst = irradiance_error(light, lights)
    assert mean == pytest.approx(difference.mean(0).max(), rel=0.05)
    assert worst == pytest.approx(difference.max(), rel=0.15)
    nothing = Constellation(np.zeros((0, 3)), np.zeros((0, 3)))
    assert irradiance_error(light, nothing, light) == (0, 0)


def test_the_lights_of_two_constellations_together_keep_their_pixels():
    first, second = constellation(lone(8, 2, 3), 1), constellation(constant(8), 4)
    first = Constellation(first.directions, first.irradiance, first.angular_radii, first.solid_angles, None)
    both = together(first, second)
    assert second.labels is not None
    np.testing.assert_array_equal(both.irradiance, np.concatenate([first.irradiance, second.irradiance]))
    np.testing.assert_array_equal(both.labels, second.labels + 1)
    marked = Constellation(first.directions, first.irradiance, labels=np.where(second.labels == 0, 0, -1))
    labels = together(marked, second).labels
    np.testing.assert_array_equal(labels, np.where(second.labels == 0, 0, second.labels + 1))


def test_directions_and_irradiance_that_do_not_match_are_refused():
    with pytest.raises(ValueError, match=r"directions are \(2, 3\) and irradiance \(3, 3\)"):
        Constellation(np.zeros((2, 3)), np.zeros((3, 3)))
