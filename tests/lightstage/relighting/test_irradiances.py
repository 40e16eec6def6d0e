"""What each light of a stage has to give of a map, a sun, a lamp."""

from __future__ import annotations

import numpy as np
import pytest

from relume.light.constellations.constellation import Constellation
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Interpolation, NearestLight, Smooth
from relume.lightstage.relighting.stage_lighting import StageLighting, as_lighting, irradiances
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.lights import DistantLight, PointLight, Unattenuated
from relume.sphere.directions import rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.discs import Angular
from relume.sphere.mappings.mapping import LatLong, pixel_directions

LIGHTS = StageLights.towards(np.random.default_rng(5).normal(size=(60, 3)))
WAYS = pytest.mark.parametrize("by", [NearestLight(), Smooth()])


def noisy(rows: int = 32) -> EnvironmentMap:
    return EnvironmentMap(np.random.default_rng(1).random((rows, 2 * rows, 3)).astype(np.float32))


def of_lamp(lamp: DistantLight | PointLight, by: Interpolation = Smooth(), diameter: float = 0.0) -> np.ndarray:
    return StageLighting(lamps=(lamp,), lamp_diameter=diameter).irradiances(LIGHTS, by)


@WAYS
def test_nothing_of_a_map_is_lost_or_added(by):
    light = noisy()
    np.testing.assert_allclose(irradiances(LIGHTS, light, by).sum(axis=0), light.total(), rtol=1e-6)


def test_even_light_asks_of_each_light_its_cell():
    even = EnvironmentMap(np.ones((256, 512, 3), np.float32))
    found = irradiances(LIGHTS, even, NearestLight())
    np.testing.assert_allclose(found, np.repeat(LIGHTS.solid_angles[:, None], 3, axis=1), rtol=0.01, atol=1e-3)


@pytest.mark.parametrize(("rows", "count", "error"), [(4, 60, 0.1), (16, 1000, 0.15)])
def test_a_map_coarser_than_the_cells_is_integrated_over_parts_of_its_pixels(rows, count, error):
    coarse = EnvironmentMap(np.ones((rows, 2 * rows, 3), np.float32))
    lights = StageLights.towards(even_directions(count))
    found = irradiances(lights, coarse, NearestLight())
    np.testing.assert_allclose(found[:, 0], lights.solid_angles, rtol=error)
    np.testing.assert_allclose(found.sum(axis=0), 4 * np.pi, rtol=1e-6)


def test_a_sun_that_is_one_pixel_is_not_missed():
    radiance = np.zeros((512, 1024, 3), np.float32)
    radiance[100, 300] = 1e5
    light = EnvironmentMap(radiance)
    towards = pixel_directions(LatLong(), 512)[100, 300]
    found = irradiances(LIGHTS, light, NearestLight())
    assert np.argmax(found[:, 0]) == np.argmax(LIGHTS.directions @ towards)
    np.testing.assert_allclose(found.sum(axis=0), light.total(), rtol=1e-6)


@WAYS
def test_a_light_of_the_stage_stands_for_itself_alone(by):
    towards = tuple(LIGHTS.directions[7])
    found = of_lamp(DistantLight(towards, (2.0, 3.0, 4.0)), by)
    expected = np.zeros((60, 3))
    expected[7] = [2, 3, 4]
    np.testing.assert_allclose(found, expected, atol=1e-6)


@WAYS
def test_light_and_map_turned_together_ask_the_same(by):
    light, turn = noisy(16), rotation_about((1, 2, 3), 0.8)
    turned = StageLights(LIGHTS.directions @ turn.T, LIGHTS.solid_angles, LIGHTS.names)
    np.testing.assert_allclose(
        irradiances(turned, light, by, turn), irradiances(LIGHTS, light, by), rtol=1e-6, atol=1e-6
    )


def test_yaw_takes_what_is_ahead_to_the_left():
    radiance = np.zeros((64, 128, 3), np.float32)
    radiance[30:34, 62:66] = 1
    axes = StageLights.towards(
        np.concatenate([np.eye(3), -np.eye(3)]), ("right", "up", "back", "left", "down", "ahead")
    )
    found = irradiances(axes, EnvironmentMap(radiance), NearestLight(), rotation_about((0, 1, 0), np.pi / 2))
    assert axes.names[int(np.argmax(found[:, 0]))] == "left"


def test_the_mapping_of_the_map_does_not_matter():
    light = EnvironmentMap(np.ones((64, 128, 3), np.float32) * np.linspace(0, 1, 64)[:, None, None].astype(np.float32))
    there = light.remapped(Angular(), 128)
    np.testing.assert_allclose(irradiances(LIGHTS, there), irradiances(LIGHTS, light), atol=0.01)


def test_a_lamp_twice_as_far_gives_a_quarter():
    near = of_lamp(PointLight((0, 1, 0), (1.0, 1.0, 1.0)))
    far = of_lamp(PointLight((0, 2, 0), (1.0, 1.0, 1.0)))
    np.testing.assert_allclose(far, near / 4, rtol=1e-9)
    np.testing.assert_allclose(near.sum(axis=0), 1.0, rtol=1e-9)


def test_a_mesh_is_lit_as_strongly_as_the_field():
    """With a mesh a lamp is a direction, without one shares of the lights: its fall with distance is the same."""
    lighting = StageLighting(lamps=(PointLight((0, 2, 0), (1.0, 2.0, 3.0), Unattenuated()),))
    directed = lighting.directed()
    np.testing.assert_allclose(directed.irradiances, [[1, 2, 3]], rtol=1e-12)
    np.testing.assert_allclose(lighting.irradiances(LIGHTS).sum(axis=0), directed.irradiances[0], rtol=1e-9)


def test_a_wide_sun_spreads_over_more_lights_and_keeps_its_light():
    sun = DistantLight((0.3, 0.8, 0.5), (1.0, 1.0, 1.0))
    wide = of_lamp(sun, NearestLight(), 1.6)
    assert (wide[:, 0] > 0).sum() > 5 > (of_lamp(sun, NearestLight())[:, 0] > 0).sum()
    np.testing.assert_allclose(wide.sum(axis=0), 1.0, rtol=1e-9)


@WAYS
def test_a_constellation_is_the_sum_of_its_lights(by):
    towards, power = LIGHTS.directions[:3], np.array([[1.0, 0, 0], [0, 2, 0], [0, 0, 3]])
    found = StageLighting(light_sets=(Constellation(towards, power),)).irradiances(LIGHTS, by)
    np.testing.assert_allclose(found[:3], power, atol=1e-6)
    np.testing.assert_allclose(found[3:], 0, atol=1e-6)


def test_a_lamp_inside_the_subject_is_refused():
    with pytest.raises(ValueError, match="holds the subject"):
        of_lamp(PointLight((0, 0, 0), (1.0, 1.0, 1.0)))


def test_light_that_is_no_light_is_refused():
    with pytest.raises(ValueError, match=r"the light is of type str; give an EnvironmentMap.* rl\.read_environment"):
        as_lighting("map.exr")  # pyright: ignore[reportArgumentType]
