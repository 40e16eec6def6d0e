"""A lamp taken out of a map and put where it hangs: no light is lost, and the map is believed for its direction."""

import numpy as np
import pytest

from relume.light.constellations.local_lamps import REACH, free_lamp
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

PROBE = (0.2, 0.1, -0.3)
COLOUR = np.array([900.0, 700.0, 400.0])


def map_with_lamp(towards, radius=0.04, size=256, behind=(0.5, 0.4, 0.3)):
    """A round lamp in even surroundings, a little brighter on one side of the sky."""
    directions = pixel_directions(LatLong(), size)
    inside = directions @ normalised(np.asarray(towards, float)) > np.cos(radius)
    radiance = np.asarray(behind) * (1 + 0.2 * directions[..., :1])
    return EnvironmentMap(np.where(inside[..., None], COLOUR, radiance).astype(np.float32))


def seen_from_probe(found):
    """The irradiance (3,) that the lamp gives a surface at the probe that faces it."""
    distance = np.linalg.norm(found.lamp.positions[0] - PROBE)
    return found.lamp.intensity[0] / distance**2


@pytest.mark.parametrize("place", [(1.1, 1.5, -0.6), (-0.8, 0.4, 2.0), (0.2, 2.0, -0.25), (0.1, -0.9, -0.3)])
def test_what_is_taken_and_what_is_left_are_all_the_light(place):
    light = map_with_lamp(np.subtract(place, PROBE))
    found = free_lamp(light, place, PROBE)
    areas = LatLong().solid_angles(256)[..., None]
    taken = ((light.radiance.astype(float) - found.rest.radiance) * areas).sum((0, 1))
    assert seen_from_probe(found) == pytest.approx(taken, rel=1e-5)
    # It was a cap of 1 − cos 0.04 of the sphere.
    assert taken == pytest.approx(COLOUR * 2 * np.pi * (1 - np.cos(0.04)), rel=0.05)
    assert found.lamp.positions[0] == pytest.approx(place, abs=0.01) and found.off < 0.005
    # As wide as it looks: a cap of 0.04 rad at its distance.
    assert found.lamp.radii is not None
    assert found.lamp.radii[0] == pytest.approx(0.04 * np.linalg.norm(np.subtract(place, PROBE)), rel=0.1)


def test_nothing_of_the_lamp_is_left_and_nothing_else_is_touched():
    place = (1.1, 1.5, -0.6)
    towards = normalised(np.subtract(place, PROBE))
    light = map_with_lamp(towards)
    rest = free_lamp(light, place, PROBE).rest
    assert rest.radiance.max() < 1
    far = pixel_directions(LatLong(), 256) @ towards < np.cos(3 * REACH)
    assert np.array_equal(rest.radiance[far], light.radiance[far])


def test_for_the_direction_the_map_is_believed():
    place = np.array((1.1, 1.5, -0.6))
    way = place - PROBE
    aside = np.cross(way, [0, 1, 0])
    seen = normalised(normalised(way) + np.tan(np.radians(3)) * normalised(aside))
    found = free_lamp(map_with_lamp(seen), place, PROBE)
    assert found.off == pytest.approx(np.radians(3), abs=0.005)
    assert found.lamp.positions[0] == pytest.approx(PROBE + np.linalg.norm(way) * seen, abs=0.01)


def test_clipped_pixels_are_forgotten_with_the_lamp():
    place = (1.1, 1.5, -0.6)
    light = map_with_lamp(np.subtract(place, PROBE))
    clipped = (light.radiance[..., 0] > 100).astype(np.uint8)
    assert clipped.any()
    rest = free_lamp(EnvironmentMap(light.radiance, clipped=clipped), place, PROBE).rest
    assert rest.clipped is not None and not rest.clipped.any()


def test_where_the_map_shows_no_lamp_there_is_none():
    light = map_with_lamp((0, 1, 0))
    with pytest.raises(ValueError, match=r"no lamp towards \[2.0, 0.1, 0.0\].*in metres"):
        free_lamp(light, (2.0, 0.1, 0.0), PROBE)
    with pytest.raises(ValueError, match="where the light was measured"):
        free_lamp(light, PROBE, PROBE)
