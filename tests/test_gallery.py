"""The gallery's scripts: their codings and their lights are what their captions say."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import relume as rl
from relume.sphere.mappings.mapping import pixel_directions

FOLDER = Path(__file__).parents[1] / "examples" / "gallery"


def script(name: str) -> ModuleType:
    described = importlib.util.spec_from_file_location(f"gallery_{name}", FOLDER / f"{name}.py")
    assert described is not None and described.loader is not None
    module = importlib.util.module_from_spec(described)
    described.loader.exec_module(module)
    return module


def test_photo_ycc_holds_greys_up_to_200_per_cent():
    larson = script("larson_out_of_gamut")
    # Luma 1.402 is 255: ((1.402 + 0.099)/1.099)^(1/0.45) = 2.0.
    greys = np.array([0.18, 1.0, 2.0, 8.0])[:, None].repeat(3, 1)[None]
    found = larson.photo_ycc(greys)[0]
    np.testing.assert_allclose(found[:3], greys[0, :3], rtol=0.02)
    np.testing.assert_allclose(found[3], 2.0, rtol=0.01)
    dim, tinted = larson.faults(greys, larson.photo_ycc(greys))
    assert dim.tolist() == [[False, False, False, True]] and not tinted.any()


def test_what_photo_ycc_loses_log_luv_keeps():
    larson = script("larson_out_of_gamut")
    picture = np.array([[[0.0002, 0.0002, 0.0002], [9000.0, 8000.0, 7000.0], [0.0, 0.05, 1.5], [0.5, 0.4, 0.3]]])
    wrong = np.logical_or(*larson.faults(picture, larson.photo_ycc(picture)))
    assert wrong.tolist() == [[True, True, True, False]]
    assert not np.logical_or(*larson.faults(picture, larson.log_luv(picture))).any()


def test_a_clipped_kitchen_has_lost_its_lamp_and_some_of_its_window():
    debevec = script("debevec_1998_figure_3")
    light = debevec.kitchen(64)
    kept = np.minimum(light.radiance, debevec.CLIPPED * light.radiance.max())
    areas = light.mapping.solid_angles(64)[..., None]
    lost = 1 - (kept * areas).sum((0, 1)) / (light.radiance * areas).sum((0, 1))
    # Most of the light, and more of the lamp's red than of the sky's blue.
    assert 0.6 < lost[2] < 0.95 and lost[0] > lost[2] - 0.1
    assert light.radiance.max() == pytest.approx(1000.0)
    assert len(debevec.shapes(debevec.MATERIALS["diffuse gray"])) == 13


def test_the_sun_is_yellow_in_photo_ycc_for_each_byte_ends_at_a_bound_of_its_own():
    larson = script("larson_out_of_gamut")
    sun = larson.photo_ycc(np.array([[[9000.0, 8280.0, 7200.0]]]))[0, 0]
    np.testing.assert_allclose(sun, [5.521, 1.528, 0.0004], atol=1e-3)


def test_a_sky_of_clouds_gives_level_ground_seven_ninths_of_an_even_one():
    light = script("debevec_1998_figures").overcast(256)
    up = pixel_directions(light.mapping, 256)[..., 1]
    weights = light.mapping.solid_angles(256) * np.maximum(up, 0)
    assert (light.radiance[..., 0] * weights).sum() == pytest.approx(7 / 9 * np.pi, rel=1e-3)
    assert light.radiance[0, 0].tolist() == pytest.approx([1.0] * 3, abs=1e-3)


def test_where_the_probe_was_the_model_of_the_room_is_the_map():
    rng = np.random.default_rng(3)
    light = rl.EnvironmentMap(rng.random((32, 64, 3), dtype=np.float32))
    scene = rl.Scene(light, distant=rl.scene.Box((-2.5, -0.75, -2.0), (2.5, 1.95, 2.0)), probe=(0.0, 0.05, 0.0))
    camera = rl.Camera.looking_at(
        np.array([0.0, 0.05, 0.0]), np.array([1.0, 0.3, 0.4]), width=24, height=16, focal_length=15.0
    )
    found = script("debevec_1998_figures").room_of_the_map(scene, camera)
    np.testing.assert_allclose(found, light.lookup(camera.rays()), atol=1e-5)
    # Seen from elsewhere, a place of the table has what the probe saw in its direction.
    above = rl.Camera.looking_at(
        np.array([0.3, 1.0, 0.2]), np.array([0.3, 0.0, 0.1999]), width=3, height=3, focal_length=300.0
    )
    place = script("debevec_1998_figures").room_of_the_map(scene, above)[1, 1]
    way = np.array([0.3, -0.05, 0.2]) / np.linalg.norm([0.3, -0.05, 0.2])
    np.testing.assert_allclose(place, light.lookup(way), atol=0.02)
    # And a place of the wall behind the table what the probe saw towards it: 0.5 m aside and 0.25 m up, 2 m away.
    ahead = rl.Camera.looking_at(
        np.array([0.0, 0.6, 1.0]), np.array([0.5, 0.3, -2.0]), width=3, height=3, focal_length=300.0
    )
    place = script("debevec_1998_figures").room_of_the_map(scene, ahead)[1, 1]
    way = np.array([0.5, 0.25, -2.0]) / np.linalg.norm([0.5, 0.25, -2.0])
    np.testing.assert_allclose(place, light.lookup(way), atol=0.02)
