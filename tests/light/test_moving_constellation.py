"""Lights that follow a map's light from frame to frame: all of it, and none jumps."""

from itertools import pairwise

import numpy as np
import pytest

from lights import spread
from probe_films import LAMPS, place_light, truth
from relume.errors import UnreadableFile
from relume.image import files
from relume.light.constellations.constellation import constellation
from relume.light.constellations.moving import moving_constellation
from relume.light.constellations.rectangles import MedianCut
from relume.light.light_sequence import LightSequence
from relume.light.light_set import LightSettings, Room, follow_lights
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap

SOFT = tuple((towards, min(sharpness, 60.0), colour) for towards, sharpness, colour in LAMPS)


def turning(steps: int, degrees: float) -> list[EnvironmentMap]:
    return [truth(place_light(degrees * k, SOFT), finer=1) for k in range(steps)]


def jumps(every) -> float:
    """The greatest light that goes from one place to another between maps: chords by shares of all light."""
    worst = 0.0
    for before, now in pairwise(every):
        share = np.minimum(before.irradiance.sum(-1), now.irradiance.sum(-1)) / now.irradiance.sum()
        worst = max(worst, float((share * np.linalg.norm(now.directions - before.directions, axis=-1)).sum()))
    return worst


def test_lights_move_with_the_light_and_carry_all_of_it():
    maps = turning(12, 2.0)
    every = list(moving_constellation(iter(maps), 24, MedianCut()))
    normals = spread(200)
    for light, lights in zip(maps, every, strict=True):
        np.testing.assert_allclose(lights.total(), light.total(), rtol=1e-6)
        true = light.irradiance(normals)
        assert np.abs(lights.irradiance_on(normals) - true).max() / true.mean() < 0.1
    # Everything turns by 2°, a chord of 0.035 at most; lights divided anew map by map jump farther.
    alone = [constellation(light, 24) for light in maps]
    assert jumps(every) < 0.04 < 3 * jumps(every) < jumps(alone)
    # No light comes or goes at once, but for the pixels of 2.8° that go from one to the other.
    shares = np.array([lights.irradiance.sum(-1) / lights.irradiance.sum() for lights in every])
    assert np.abs(np.diff(shares, axis=0)).max() < 0.05


def test_lights_of_still_light_stand_still():
    every = list(moving_constellation(iter(turning(4, 0.0)), 16, MedianCut()))
    for lights in every[1:]:
        assert np.abs(lights.directions - every[0].directions).max() < 1e-2
        assert np.abs(lights.irradiance / every[0].irradiance - 1).max() < 0.02


def test_a_light_whose_light_goes_out_waits_dark_where_it_was():
    on = np.zeros((16, 32, 3), np.float32)
    on[4, 6], on[8, 20] = 1, 2
    off = on.copy()
    off[4, 6] = 0
    first, dark, again = moving_constellation(iter(EnvironmentMap(each) for each in (on, off, on)), 2, MedianCut())
    gone = int(np.argmin(dark.irradiance.sum(-1)))
    assert dark.irradiance[gone].sum() == 0
    np.testing.assert_allclose(dark.directions[gone], first.directions[gone], atol=1e-9)
    np.testing.assert_allclose(again.irradiance, first.irradiance)


@pytest.fixture
def sequence(tmp_path) -> LightSequence:
    for number, light in enumerate(turning(3, 2.0)):
        files.write(tmp_path / f"map_{number}.exr", as_radiance_map(light))
    return LightSequence.found(tmp_path)


def test_a_sequence_gives_a_set_of_as_many_lights_for_every_map(sequence):
    made = list(follow_lights(sequence, LightSettings(count=8)))
    assert [len(each.lights.directions) for each in made] == [8, 8, 8]
    assert not any(each.doubts for each in made)


def test_what_is_of_a_single_map_is_refused(sequence, tmp_path):
    for settings in (LightSettings(suns=1), LightSettings(residual=True), LightSettings(room=ROOM)):
        with pytest.raises(ValueError, match="of a single map"):
            next(follow_lights(sequence, settings))
    files.write(tmp_path / "map_0.exr", as_radiance_map(EnvironmentMap(np.zeros((64, 128, 3), np.float32))))
    with pytest.raises(UnreadableFile, match=r"map_0\.exr: black all over"):
        next(follow_lights(sequence))


ROOM = Room((0.0, 1.0, 0.0), (-1.0, 0.0, -1.0), (1.0, 2.0, 1.0))
