"""Developing: radiance through a film gives the values that a camera, or sRGB, would have written."""

import functools

import numpy as np
import pytest

from relume.capture.exposure.bracket import read_bracket
from relume.capture.merging import merge
from relume.capture.response.calibration import recover_response
from relume.image.response import Response
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film
from synthetic import NOISELESS, wide_scene


def grey(*values: float) -> np.ndarray:
    return np.repeat(np.array([values], np.float32)[..., None], 3, axis=2)


@functools.cache
def recovered() -> Response:
    return recover_response(NOISELESS.bracket(wide_scene(96, 64))).response


@pytest.mark.parametrize(
    "linear, value",
    [
        (0.0, 0),
        (0.0002, 1),  # 255 · 12.92 · 0.0002 = 0.66
        (0.0031308, 10),  # the foot of the power, 255 · 0.04045 = 10.3
        (0.18, 118),  # 255 · (1.055 · 0.18^(1/2.4) − 0.055) = 117.6
        (0.2126, 127),  # 126.9
        (0.5, 188),  # 187.5
        (0.9, 243),  # 243.4
        (1.0, 255),
    ],
)
def test_the_srgb_curve_maps_radiance_as_iec_61966_2_1_says(linear, value):
    assert develop(grey(linear), Film()).pixels[0, 0].tolist() == [value] * 3


def test_white_and_black_are_the_ends_of_any_film():
    light = grey(-1.0, 0.0, 1e-30, 1.0001, 50.0, 1e30)
    assert develop(light, Film()).pixels[0, :, 1].tolist() == [0, 0, 0, 255, 255, 255]
    assert develop(light[:, :3], Film(response=recovered())).pixels.max() == 0
    assert develop(light[:, 4:], Film(response=recovered())).pixels.min() == 255


def test_every_pixel_value_is_developed_from_its_own_exposure():
    for response in (recovered(), recovered().balanced_at(255)):
        radiance = np.exp(response.log_exposure).T[None]  # (1, 256, 3): value z of every channel in column z
        expected = np.repeat(np.arange(256)[:, None], 3, axis=1)
        np.testing.assert_array_equal(develop(radiance, Film(1.0, response)).pixels[0], expected)
        np.testing.assert_array_equal(develop(radiance / 0.004, Film(0.004, response)).pixels[0], expected)
        # In float32, as radiance maps are kept, too.
        np.testing.assert_array_equal(develop(radiance.astype(np.float32), Film(1.0, response)).pixels[0], expected)


def test_between_two_values_the_nearer_is_taken():
    curve = np.tile(np.arange(256) * 0.02, (3, 1))
    film = Film(1.0, Response(curve, np.ones(3)))
    values = [develop(grey(np.exp(0.02 * z)), film).pixels[0, 0, 0] for z in (99.6, 100.0, 100.4, 100.6)]
    assert values == [100, 100, 100, 101]


def test_values_never_fall_as_light_rises():
    light = grey(*np.geomspace(1e-6, 1e3, 2000))
    for film in (Film(), Film(0.3, recovered())):
        assert np.all(np.diff(develop(light, film).pixels[0].astype(int), axis=0) >= 0)


def test_a_brighter_film_is_one_exposed_longer():
    response = recovered()
    film = Film(0.25, response)
    assert film.brighter(3).exposure == 2.0 and film.brighter(-1).exposure == 0.125
    assert film.brighter(0.5).exposure == pytest.approx(0.25 * np.sqrt(2))
    assert film.brighter(3).response is response and film.exposure == 0.25
    light = wide_scene(24, 16)
    np.testing.assert_array_equal(develop(light, film.brighter(2)).pixels, develop(4 * light, film).pixels)


def test_a_developed_picture_leaves_its_radiance_alone():
    light = wide_scene(24, 16)
    before = light.copy()
    photograph = develop(light, Film(0.1, recovered()))
    np.testing.assert_array_equal(light, before)
    assert photograph.size == (24, 16) and photograph.pixels.dtype == np.uint8


def test_a_virtual_photograph_is_the_one_that_was_taken():
    camera, scene = NOISELESS, wide_scene()
    bracket = camera.bracket(scene)
    response = recover_response(bracket).response
    merged = merge(bracket, response)
    for photograph, exposure in zip(bracket.photographs, bracket.exposures, strict=True):
        again = develop(merged.radiance, Film(float(exposure), response))
        difference = np.abs(again.pixels.astype(int) - photograph.pixels)
        assert np.median(difference) == 0
        # The darkest values of the longest exposures, in the toe, where the curve is reported by few pixels.
        assert np.percentile(difference, 99) <= 3


def test_each_photograph_of_the_room_is_developed_back_from_the_merged_bracket(shared):
    bracket = read_bracket(sorted((shared / "shoots/room/plate").glob("*.jpg")))
    response = recover_response(bracket).response
    merged = merge(bracket, response)
    for photograph, exposure in zip(bracket.photographs, bracket.exposures, strict=True):
        again = develop(merged.radiance, Film(float(exposure), response))
        difference = np.abs(again.pixels.astype(int) - photograph.pixels)
        assert np.median(difference) <= 1
        # JPEG, noise and rounding of one frame against the mean of four.
        assert np.percentile(difference, 90) <= 2
