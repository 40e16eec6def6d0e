"""The energy audit: what it measures, and that it says a lost sun and nothing else."""

import numpy as np
import pytest

from lights import NAMED, constant, fitting, sunny
from relume.image.radiance import OUTSIDE, SATURATED
from relume.sphere.directions import rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.discs import Fisheye
from relume.sphere.mappings.mapping import LatLong


@pytest.mark.parametrize("name", NAMED)
def test_constant_light_has_a_total_of_four_pi_and_irradiance_of_pi(name):
    mapping = NAMED[name]
    flat = np.broadcast_to(np.array([1, 2, 0.5], np.float32), (*mapping.shape(fitting(mapping, 120)), 3))
    found = EnvironmentMap(flat.copy(), mapping).audit()
    np.testing.assert_allclose(found.total, 4 * np.pi * np.array([1, 2, 0.5]), rtol=2e-5)
    np.testing.assert_allclose(found.irradiance, np.broadcast_to(np.pi * np.array([1, 2, 0.5]), (14, 3)), rtol=2e-3)
    assert found.peak.tolist() == [1, 2, 0.5]


def test_the_peak_is_where_the_brightest_pixel_lies():
    radiance = np.zeros((8, 16, 3), np.float32)
    radiance[3, 12] = (1, 5, 1)
    found = EnvironmentMap(radiance).audit()
    np.testing.assert_allclose(found.peak_direction, LatLong().directions(np.array([12.5 / 16, 3.5 / 8])), atol=1e-12)
    assert found.peak.tolist() == [1, 5, 1]


def test_clipped_and_unseen_solid_angles_are_those_of_the_marked_pixels():
    clipped = np.zeros((8, 16), np.uint8)
    clipped[0], clipped[7, :4] = SATURATED, OUTSIDE
    light = constant(8)
    found = EnvironmentMap(light.radiance, clipped=clipped).audit()
    cap = 2 * np.pi * (1 - np.cos(np.pi / 8))
    assert (found.clipped, found.unseen) == (pytest.approx(cap), pytest.approx(cap / 4))
    assert found.facts()["clipped sr"] == pytest.approx(cap, rel=1e-3)


def test_blocks_of_a_large_map_say_the_same_as_its_pixels(monkeypatch):
    light = sunny(256, sun=400)
    whole = light.audit()
    monkeypatch.setattr("relume.sphere.audit._ROWS", 64)
    blocks = light.audit()
    np.testing.assert_allclose(blocks.total, whole.total, rtol=1e-6)
    np.testing.assert_allclose(blocks.irradiance, whole.irradiance, rtol=2e-2)
    assert np.any(blocks.irradiance != whole.irradiance)


def test_a_step_that_keeps_the_light_loses_nothing():
    light = sunny(64)
    rounded = EnvironmentMap((light.radiance * (1 + 0.004 * np.sin(np.arange(128))[:, None])).astype(np.float32))
    assert light.audit().losses(light.audit()) == ()
    assert light.audit().losses(rounded.audit()) == ()


def test_a_lost_sun_is_named_with_its_direction():
    light = sunny(64, sun=4000)
    lines = light.audit().losses(EnvironmentMap(np.minimum(light.radiance, 3)).audit())
    assert len(lines) == 3
    assert lines[0].startswith("the light's total changed by -")
    assert "the brightest light, towards (0.69, 0.31, -0.65), is gone" in lines[2]


def test_a_light_that_only_moved_shows_in_the_irradiance():
    light = sunny(64, sun=4000)
    turned = EnvironmentMap(np.roll(light.radiance, 32, axis=1))
    lines = light.audit().losses(turned.audit())
    assert len(lines) == 1
    assert lines[0].startswith("irradiance on a surface facing")


def test_an_audit_of_light_yet_to_be_turned_is_that_of_light_turned():
    light = sunny(64, sun=400)
    quarter = rotation_about([0, 1, 0], -np.pi / 2)  # to the right, by a quarter of the columns
    turned = EnvironmentMap(np.roll(light.radiance, 32, axis=1))
    assert light.audit(quarter).losses(turned.audit()) == ()
    assert light.audit(quarter.T).losses(turned.audit()) != ()
    np.testing.assert_allclose(light.audit(quarter).peak_direction, turned.audit().peak_direction, atol=1e-12)


def test_black_maps_are_no_fault():
    black = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
    assert black.audit().losses(black.audit()) == ()


def test_a_fisheye_that_leaves_the_sun_out_loses_light():
    light = sunny(64, sun=4000)
    lens = Fisheye(np.radians(90))
    shown = EnvironmentMap(
        light.lookup(np.nan_to_num(lens.directions(np.full((9, 9, 2), 0.5)))).astype(np.float32), lens
    )
    assert any("total changed" in line for line in light.audit().losses(shown.audit()))
