"""Lights placed in space: a room's walls, lamps that two probes see, and what a third place then gets."""

from dataclasses import replace

import numpy as np
import pytest

from relume.errors import LampsNotMatched
from relume.light.constellations.constellation import Constellation, constellation
from relume.light.constellations.placement import PlacedLights, chosen, placed_in_box
from relume.light.constellations.triangulation import triangulated
from relume.light.suns.extraction import extract_sun
from relume.sphere.directions import normalised, rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_points

LAMPS = np.array([[1.5, 2.4, -1.8], [-1.7, 2.2, -0.4], [0.4, 1.9, 1.9], [-1.2, 0.9, -2.2], [1.8, 1.2, 0.9]])
RADII = np.array([0.06, 0.05, 0.08, 0.04, 0.05])
SHINE = np.array([[900.0, 800, 600], [500, 550, 700], [400, 300, 200], [800, 500, 300], [300, 320, 330]])
INTENSITY = np.pi * RADII[:, None] ** 2 * SHINE
FIRST, SECOND, THIRD = np.array([0.0, 1.1, 0.0]), np.array([0.9, 1.0, -0.5]), np.array([-0.9, 1.3, 0.6])
NORMALS = np.concatenate([np.eye(3), -np.eye(3), normalised([[1.0, 1, 1], [-1, 1, -1], [1, -1, 0.5]])])


def room(place, lamps=(0, 1, 2, 3, 4), size=256, ambient=0.3, parts=8):
    """The lamps as spheres, seen from a place: the share of each pixel that they cover, before dim walls."""
    d = LatLong().directions(pixel_points(LatLong(), size))
    radiance = ambient * np.array([1.0, 0.9, 0.8]) * (1.2 + 0.4 * d[..., 1:2] + 0.3 * d[..., :1])
    fine_points = pixel_points(LatLong(), size, parts).reshape(size, parts, 2 * size, parts, 2)
    for lamp, radius, shine in zip(*(each[list(lamps)] for each in (LAMPS, RADII, SHINE)), strict=True):
        way = lamp - place
        distance = np.linalg.norm(way)
        reach = np.arcsin(radius / distance)
        rows, columns = np.nonzero(d @ (way / distance) > np.cos(reach + 2 * np.pi / size))
        fine = LatLong().directions(fine_points[rows, :, columns])
        share = np.mean(fine @ (way / distance) > np.cos(reach), axis=(1, 2))[:, None]
        radiance[rows, columns] += share * (shine - radiance[rows, columns])
    return EnvironmentMap(radiance.astype(np.float32))


@pytest.fixture(scope="module")
def maps():
    return room(FIRST), room(SECOND), room(THIRD)


def compact(light, count=5):
    return extract_sun(light, count).lights()


def points(places, intensity, at):
    """Lamps without size as a place sees them."""
    return PlacedLights(np.asarray(places, float), np.asarray(intensity, float)).seen_from(at)


def of(found, places=LAMPS):
    """The number of the true lamp next to each that was found."""
    return np.argmin(np.linalg.norm(found[:, None] - places[None], axis=-1), axis=1)


# In a box


def test_lights_stand_where_their_rays_meet_the_walls():
    lights = Constellation(
        normalised([[1.0, 0, 0], [0, 1, 0], [0, 0, -1], [3, 4, 0], [-1, -1, -1]]),
        np.array([[4.0, 2, 1], [1, 1, 1], [0, 5, 0], [9, 9, 9], [1, 0, 0]]),
    )
    placed = placed_in_box(lights, (0.5, 1.0, 0.0), ((-2, 0, -3), (3.5, 3, 4))).points
    expected = [[3.5, 1, 0], [0.5, 3, 0], [0.5, 1, -3], [2, 3, 0], [-0.5, 0, -1]]
    np.testing.assert_allclose(placed.positions, expected, atol=1e-12)
    # Distances are 3, 2, 3, 2.5 and √3.
    np.testing.assert_allclose(
        placed.intensity, [[36, 18, 9], [4, 4, 4], [0, 45, 0], [56.25] * 3, [3, 0, 0]], atol=1e-12
    )
    assert placed.radii is None


def test_the_probe_gets_what_it_got(maps):
    lights = constellation(maps[0], 50)
    placed = placed_in_box(lights, FIRST, ((-2, 0, -2.5), (2, 2.6, 2)))
    back = placed.points.seen_from(FIRST)
    np.testing.assert_allclose(back.directions, lights.directions, atol=1e-12)
    np.testing.assert_allclose(back.irradiance, lights.irradiance, rtol=1e-12)
    assert back.angular_radii is not None and lights.angular_radii is not None
    np.testing.assert_allclose(back.angular_radii, lights.angular_radii, rtol=1e-9)
    np.testing.assert_allclose(back.irradiance_on(NORMALS), lights.irradiance_on(NORMALS), rtol=1e-12)
    assert len(placed.distant.directions) == 0


def test_the_sun_through_a_window_stays_distant(maps):
    lights = constellation(maps[0], 9)
    placed = placed_in_box(lights, FIRST, ((-2, 0, -2.5), (2, 2.6, 2)), distant=[4, 1])
    np.testing.assert_array_equal(placed.distant.directions, lights.directions[[1, 4]])
    np.testing.assert_array_equal(placed.distant.irradiance, lights.irradiance[[1, 4]])
    assert lights.labels is not None and placed.distant.labels is not None
    np.testing.assert_array_equal(placed.distant.labels == 1, lights.labels == 4)
    assert np.count_nonzero(placed.distant.labels == -1) == np.count_nonzero(~np.isin(lights.labels, [1, 4]))
    both = placed.points.seen_from(FIRST).total() + placed.distant.total()
    np.testing.assert_allclose(both, lights.total(), rtol=1e-12)
    assert len(placed.points.positions) == 7


def test_an_angular_radius_becomes_a_sphere_that_looks_as_large():
    lights = Constellation(np.array([[0.0, 1, 0], [1, 0, 0]]), np.ones((2, 3)), np.array([np.pi / 6, 3.0]))
    placed = placed_in_box(lights, (0, 0, 0), ((-2, -2, -2), (2, 3, 2))).points
    assert placed.radii == pytest.approx([1.5, 2.0])


@pytest.mark.parametrize(
    ("probe", "box", "distant", "report"),
    [
        ((0, 5, 0), ((-1, 0, -1), (1, 3, 1)), [], r"probe at \[0.0, 5.0, 0.0\] is not inside the box"),
        ((1, 1, 0), ((-1, 0, -1), (1, 3, 1)), [], "is not inside the box"),
        ((0, 1, 0), ((1, 3, 1), (-1, 0, -1)), [], "its lowest corner, then its highest"),
        ((0, 1, 0), ((-1, 0, -1), (1, np.nan, 1)), [], "box, high .* three finite lengths in metres"),
        ((0, 1), ((-1, 0, -1), (1, 3, 1)), [], r"probe is \[0, 1\]; expected three"),
        ((0, 1, 0), ((-1, 0, -1), (1, 3, 1)), [2], "of 2 lights the numbers are from 0 to 1"),
        ((0, 1, 0), ((-1, 0, -1), (1, 3, 1)), [-1], "of 2 lights"),
    ],
)
def test_boxes_and_probes_that_cannot_be_are_refused(probe, box, distant, report):
    lights = Constellation(np.array([[0.0, 1, 0], [1, 0, 0]]), np.ones((2, 3)))
    with pytest.raises(ValueError, match=report):
        placed_in_box(lights, probe, box, distant)


# Placed lights themselves


def test_what_a_place_sees_falls_with_the_square_of_the_distance():
    seen = PlacedLights(np.array([[0.0, 3, 0]]), np.array([[18.0, 9, 0]]), np.array([0.5])).seen_from((0, 2, 0))
    np.testing.assert_allclose(seen.directions, [[0, 1, 0]])
    np.testing.assert_allclose(seen.irradiance, [[18, 9, 0]])
    assert seen.angular_radii == pytest.approx([np.pi / 6])
    far = PlacedLights(np.array([[0.0, 3, 0]]), np.array([[18.0, 9, 0]])).seen_from((0, 0, 0))
    np.testing.assert_allclose(far.irradiance, [[2, 1, 0]])


@pytest.mark.parametrize(
    ("positions", "intensity", "radii", "report"),
    [
        (np.zeros((2, 3)), np.zeros((1, 3)), None, "expected \\(N, 3\\) both"),
        (np.full((1, 3), np.inf), np.zeros((1, 3)), None, "a light without a place is a distant one"),
        (np.zeros((1, 3)), np.full((1, 3), -1.0), None, "negative or non-finite"),
        (np.zeros((1, 3)), np.ones((1, 3)), np.array([-1.0]), "radii are .* expected 1 of them"),
    ],
)
def test_lights_that_cannot_be_are_refused(positions, intensity, radii, report):
    with pytest.raises(ValueError, match=report):
        PlacedLights(positions, intensity, radii)


def test_a_place_in_a_light_is_refused():
    with pytest.raises(ValueError, match="is in a light"):
        PlacedLights(np.zeros((1, 3)), np.ones((1, 3)), np.array([0.2])).seen_from((0.1, 0, 0))


# Two probes


def test_lamps_of_a_room_are_where_they_are_and_as_strong(maps):
    found = triangulated(compact(maps[0]), compact(maps[1]), FIRST, SECOND)
    true = of(found.points.positions)
    assert sorted(true) == [0, 1, 2, 3, 4]
    off = np.linalg.norm(found.points.positions - LAMPS[true], axis=-1)
    distance = np.linalg.norm(LAMPS[true] - FIRST, axis=-1)
    assert np.max(off / distance) < 0.01
    np.testing.assert_allclose(found.points.intensity, INTENSITY[true], rtol=0.02)
    assert found.points.radii == pytest.approx(RADII[true], rel=0.02)
    assert np.all(off < 3 * found.uncertainty) and np.all(found.misses < 0.02)
    assert found.ratios == pytest.approx(1, abs=0.03)
    assert len(found.far) == 0 and [len(alone) for alone in found.unmatched] == [0, 0]
    assert len(found.distant.directions) == 0


def test_placed_lamps_say_the_irradiance_elsewhere_and_distant_ones_do_not(maps):
    taken = extract_sun(maps[0], 5)
    found = triangulated(taken.lights(), compact(maps[1]), FIRST, SECOND)
    truth = maps[2].irradiance(NORMALS)
    walls = taken.rest.irradiance(NORMALS)
    placed = found.points.seen_from(THIRD).irradiance_on(NORMALS) + walls
    distant = taken.lights().irradiance_on(NORMALS) + walls
    error = [np.abs(guess - truth).max() / truth.mean() for guess in (placed, distant)]
    assert error[0] < 0.005 and error[1] > 50 * error[0]
    # The box that the lamps hang in guesses their distances: better than none, worse than two probes.
    boxed = placed_in_box(taken.lights(), FIRST, ((-2, 0, -2.5), (2, 2.6, 2.2))).points
    guess = boxed.seen_from(THIRD).irradiance_on(NORMALS) + walls
    assert error[0] < np.abs(guess - truth).max() / truth.mean() < error[1]


def test_lamps_that_one_probe_does_not_see_are_reported(maps):
    second = compact(room(SECOND, lamps=(0, 1, 3, 4)))
    first = compact(maps[0])
    found = triangulated(first, second, FIRST, SECOND)
    assert sorted(of(found.points.positions)) == [0, 1, 3, 4]
    (alone,), (missing,) = found.unmatched[0], [2]
    np.testing.assert_allclose(first.directions[alone], normalised(LAMPS[missing] - FIRST), atol=0.01)
    np.testing.assert_array_equal(found.distant.irradiance, first.irradiance[[alone]])
    assert len(found.unmatched[1]) == 0


def test_the_sun_is_far_and_stays_distant():
    sun, light = normalised([[0.3, 0.8, -0.5]]), np.array([[5.0, 4.8, 4.4]])

    def seen(at):
        lamps = points(LAMPS[:2], INTENSITY[:2], at)
        # A pixel of a map of 360 rows off, and other pixels for the other probe.
        turned = sun @ rotation_about([1, 0, 0], 0.004 * at[0]).T
        return Constellation(np.concatenate([turned, lamps.directions]), np.concatenate([light, lamps.irradiance]))

    found = triangulated(seen(FIRST), seen(SECOND), FIRST, SECOND)
    np.testing.assert_array_equal(found.far, [[0, 0]])
    np.testing.assert_array_equal(found.pairs, [[1, 1], [2, 2]])
    np.testing.assert_array_equal(found.distant.irradiance, light)
    np.testing.assert_allclose(found.points.positions, LAMPS[:2], atol=1e-9)
    assert [len(alone) for alone in found.unmatched] == [0, 0]
    lone = triangulated(chosen(seen(FIRST), np.array([0])), seen(SECOND), FIRST, SECOND)
    assert len(lone.points.positions) == 0 and len(lone.far) == 1 and list(lone.unmatched[1]) == [1, 2]


def test_intensity_says_lamps_apart_whose_rays_meet_twice():
    # Both lamps and both probes lie in one plane, so that every ray meets every other.
    first, second = np.array([0.0, 0, 0]), np.array([1.0, 0, 0])
    places = [[0.2, 0, -2], [0.8, 0, -1.5]]
    seen = [points(places, [[3.0, 3, 3], [1, 1, 1]], at) for at in (first, second)]
    for order in ([0, 1], [1, 0]):
        found = triangulated(seen[0], chosen(seen[1], np.array(order)), first, second, ratio=2)
        np.testing.assert_array_equal(found.pairs, [[0, order[0]], [1, order[1]]])
        np.testing.assert_allclose(found.points.positions, places, atol=1e-9)
        np.testing.assert_allclose(found.points.intensity, [[3, 3, 3], [1, 1, 1]])


def test_colour_says_lamps_apart():
    first, second = np.array([0.0, 0, 0]), np.array([1.0, 0, 0])
    red, blue = [[0.2, 0, -2]], [[0.8, 0, -2]]
    seen = points(red, [[3.0, 1, 0.5]], first), points(blue, [[0.5, 1, 6.0]], second)
    with pytest.raises(LampsNotMatched, match="intensities or tints differ"):
        triangulated(*seen, first, second)


def test_the_nearer_probe_says_more_of_the_place():
    # Rays from 1 m and from 4 m that miss by 17 cm of each other.
    first, second = np.array([0.0, 0, 0]), np.array([4.0, 0, -1])
    seen = points([[0, 0, -1]], np.ones((1, 3)), first), points([[0, 0.17, -1]], np.ones((1, 3)), second)
    found = triangulated(*seen, first, second, uncertainty=np.radians(1))
    assert found.misses == pytest.approx([0.17], rel=0.01)
    assert found.points.positions[0] == pytest.approx([0, 0.17 / 17, -1], abs=2e-3)
    # A degree from 4 m, in the direction that the nearer probe cannot say.
    assert found.uncertainty == pytest.approx([4 * np.radians(1)], rel=0.01)


def test_the_uncertainty_is_that_of_places_found_from_rays_that_err():
    random, sigma = np.random.default_rng(5), np.radians(0.2)
    off = []
    for _ in range(300):
        first, second = (
            replace(lamps, directions=normalised(lamps.directions + random.normal(0, sigma, (1, 3))))
            for lamps in (points(LAMPS[:1], INTENSITY[:1], at) for at in (FIRST, SECOND))
        )
        # Twice what they err by, so that none is turned down by chance.
        found = triangulated(first, second, FIRST, SECOND, uncertainty=2 * sigma, ratio=3)
        off.append(found.points.positions[0] - LAMPS[0])
    worst = np.sqrt(np.linalg.eigvalsh(np.cov(np.array(off).T))[-1])
    assert found.uncertainty == pytest.approx([2 * worst], rel=0.15)


def test_a_lamp_on_the_line_through_both_probes_has_no_place():
    first, second = np.array([0.0, 1, 0]), np.array([1.0, 1, 0])
    for place in ([[3.0, 1, 0]], [[0.5, 1.0, 0]], [[0.5, 1.003, 0]]):
        seen = points(place, np.ones((1, 3)), first), points(place, np.ones((1, 3)), second)
        with pytest.raises(LampsNotMatched, match=r"check the places|line through both probes"):
            triangulated(*seen, first, second)


def test_rays_that_miss_are_of_two_lamps():
    first, second = np.array([0.0, 0, 0]), np.array([1.0, 0, -1])
    seen = points([[0, 0, -1]], np.ones((1, 3)), first), points([[0, 0.2, -1]], np.ones((1, 3)), second)
    with pytest.raises(LampsNotMatched, match=r"nearest rays miss by 0\.2 m, where 0\.037 m is allowed"):
        triangulated(*seen, first, second)
    assert len(triangulated(*seen, first, second, uncertainty=np.radians(4)).pairs) == 1


def test_probes_at_one_place_are_refused(maps):
    lights = constellation(maps[0], 3)
    with pytest.raises(ValueError, match=r"both probes stood at .* lamps have a place only where the probes differ"):
        triangulated(lights, lights, FIRST, FIRST)
    for words in ({"uncertainty": 0.0}, {"ratio": 1.0}, {"tint": 0.0}):
        with pytest.raises(ValueError, match=r"expected 0 to 0.5 rad, above 1, above 0"):
            triangulated(lights, lights, FIRST, SECOND, **words)


def test_that_no_lamp_matches_is_reported_in_a_line(maps):
    first, second = compact(maps[0]), compact(maps[1])
    turned = replace(second, directions=second.directions @ rotation_about([0.3, 1, 0.2], 2.0).T)
    with pytest.raises(LampsNotMatched, match=r"none of 5 and 5 lamps match: .*check the places") as report:
        triangulated(first, turned, FIRST, SECOND)
    assert "\n" not in str(report.value)
    with pytest.raises(LampsNotMatched, match="exposure"):
        triangulated(first, replace(second, irradiance=100 * second.irradiance), FIRST, SECOND)
    none = Constellation(np.zeros((0, 3)), np.zeros((0, 3)))
    with pytest.raises(LampsNotMatched, match="the probes have 5 and 0 lamps"):
        triangulated(first, none, FIRST, SECOND)
