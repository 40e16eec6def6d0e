"""Key lights and the glow that is left: both together are the map (*Fiat Lux*, SIGGRAPH 99)."""

import numpy as np
import pytest

from lights import constant, lone, spread, sunny
from relume.image.radiance import OUTSIDE, SATURATED
from relume.light.constellations.constellation import irradiance_error
from relume.light.constellations.k_means import KMeans
from relume.light.constellations.rectangles import VarianceMinimisation
from relume.light.constellations.residual import glow_level, key_lights
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.names import mapping_named

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("contrast", [0.0, 1.0, 1.5, 4.0, 30.0, np.inf])
@pytest.mark.parametrize("name", ["latlong", "angular"])
def test_lights_and_residual_have_the_maps_light_in_every_channel(name, contrast):
    light = sunny(64, 400)
    light = light if name == "latlong" else light.remapped(mapping_named(name), 64)
    key = key_lights(light, 20, contrast)
    assert key.residual.mapping == light.mapping
    np.testing.assert_allclose(key.lights.total() + key.residual.total(), light.total(), rtol=1e-12)
    assert np.all(key.residual.radiance <= light.radiance)
    assert np.all(key.lights.irradiance >= 0)


@pytest.mark.parametrize("contrast", [1.5, 4.0, 16.0])
def test_the_residual_is_nowhere_brighter_than_so_many_times_its_mean(contrast):
    key = key_lights(sunny(64, 400), 20, contrast)
    luminance = key.residual.radiance @ LUMINANCE
    mean = float(key.residual.total() @ LUMINANCE) / (4 * np.pi)
    assert luminance.max() == pytest.approx(contrast * mean, rel=1e-5)
    assert key.level == pytest.approx(contrast * mean, rel=1e-5)


def test_the_level_does_not_depend_on_how_bright_a_source_is():
    levels = [key_lights(lone(32, 10, 20, sun, dark=1.0)).level for sun in (10.0, 1e3, 1e6)]
    assert levels == pytest.approx([4.0 / (1 - 3.0 * 0)] * 3, rel=0.02)
    assert levels[0] == levels[1] == levels[2]


def test_a_lone_source_over_even_light_is_split_at_the_level():
    # T = 4 (1 − s + s T) for a source on the share s of the sphere, row 10 of 32.
    share = (np.cos(10 * np.pi / 32) - np.cos(11 * np.pi / 32)) / 2 / 64
    level = 4 * (1 - share) / (1 - 4 * share)
    key = key_lights(lone(32, 10, 20, 1000.0, dark=1.0))
    assert key.level == pytest.approx(level, rel=1e-9)
    assert len(key.lights.directions) == 1
    np.testing.assert_allclose(key.lights.irradiance[0], (1000 - level) * 4 * np.pi * share, rtol=1e-6)
    assert key.residual.radiance[10, 20] == pytest.approx([level] * 3, rel=1e-6)
    assert key.residual.radiance[9, 20] == pytest.approx([1.0] * 3)


@pytest.mark.parametrize("method", [None, VarianceMinimisation(), KMeans()])
def test_surfaces_are_lit_as_by_the_map(method):
    light = sunny(64, 400)
    key = key_lights(light, 16, 4.0, method)
    normals = spread(300)
    truth = light.irradiance(normals)
    found = key.lights.irradiance_on(normals) + key.residual.irradiance(normals)
    difference = np.abs(found - truth) / truth.mean(0)
    assert difference.max() < 0.002
    # Reported for other normals, so it is not the very same number.
    assert 0.4 < irradiance_error(light, key.lights, key.residual)[1] / difference.max() < 1.5


def test_all_of_the_light_is_in_the_lights_or_all_in_the_residual():
    light = sunny(32)
    nothing = key_lights(light, 8, 0.0)
    assert nothing.residual.radiance.max() == 0
    np.testing.assert_allclose(nothing.lights.total(), light.total(), rtol=1e-12)
    everything = key_lights(light, 8, np.inf)
    np.testing.assert_array_equal(everything.residual.radiance, light.radiance)
    assert len(everything.lights.directions) == 0
    assert len(key_lights(constant(8), 8).lights.directions) == 0  # even light has no key
    assert key_lights(constant(8, 0.0), 8).level == 0


def test_colour_stays_where_light_is_taken():
    radiance = np.full((16, 32, 3), 0.1, np.float32)
    radiance[4, 7] = 0.0, 1.0, 80.0
    key = key_lights(EnvironmentMap(radiance), 4)
    left = key.residual.radiance[4, 7]
    assert left[0] == 0 and left[2] / left[1] == pytest.approx(80, rel=1e-5)
    assert key.lights.irradiance[0, 2] / key.lights.irradiance[0, 1] == pytest.approx(80, rel=1e-5)


def test_a_clipped_source_is_no_longer_clipped_in_the_residual_but_what_was_unseen_stays_so():
    light = lone(16, 4, 7, 1000.0, dark=1.0)
    clipped = np.zeros((16, 32), np.uint8)
    clipped[4, 7], clipped[5, 5], clipped[6, 6] = SATURATED, SATURATED, OUTSIDE
    residual = key_lights(EnvironmentMap(light.radiance, clipped=clipped)).residual
    assert residual.clipped is not None
    assert (residual.clipped[4, 7], residual.clipped[5, 5], residual.clipped[6, 6]) == (0, SATURATED, OUTSIDE)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="key lights are 0; expected 1 or more"):
        key_lights(constant(8), 0)
    with pytest.raises(ValueError, match="contrast of the residual is -1; expected 0 or more"):
        key_lights(constant(8), 4, -1)
    with pytest.raises(ValueError, match="contrast of the residual is nan"):
        glow_level(np.ones((2, 4)), np.ones((2, 4)), np.nan)
