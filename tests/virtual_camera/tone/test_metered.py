"""Plain exposure: bright parts near white, a card at its grey, or what shutter, aperture and ISO say (A35)."""

import numpy as np
import pytest

from relume.image.colour import encode_srgb
from relume.image.photograph import Exposure
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.tone.metered import (
    CameraExposure,
    FixedExposure,
    LinearExposure,
    MeteredExposure,
    saturation_luminance,
)
from relume.virtual_camera.view import View

VIEW = View(500.0)
ONE = Exposure(1 / 100, 8.0, 100.0)


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return np.exp(np.random.default_rng(4).normal(0, 2, (90, 100, 3))).astype(np.float32)


def test_a_hundredth_of_the_values_is_beyond_white(picture: np.ndarray):
    meter = MeteredExposure(grey=None)
    shown = meter.display_values(picture, VIEW, meter.adapt(picture, VIEW))
    assert np.mean(shown > 1 + 1e-6) == pytest.approx(0.01, abs=1e-4)
    assert float(np.percentile(shown, 99)) == pytest.approx(1, rel=0.01)


def test_the_log_mean_becomes_the_grey_asked_for(picture: np.ndarray):
    meter = MeteredExposure(percentile=None)
    shown = meter.display_values(picture, VIEW, meter.adapt(picture, VIEW))
    light = shown.astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    assert np.exp(np.log(light).mean()) == pytest.approx(0.18, rel=1e-6)


def test_black_around_the_picture_and_its_unit_change_no_exposure(picture: np.ndarray):
    around = np.concatenate([np.zeros((400, 100, 3), np.float32), picture])
    for meter in (MeteredExposure(grey=None), MeteredExposure(None, 0.2)):
        alone = meter.adapt(picture, VIEW).values
        np.testing.assert_allclose(meter.adapt(around, VIEW).values, alone, rtol=1e-12)
        np.testing.assert_allclose(
            meter.adapt(picture * np.float32(64), VIEW).values, alone - np.log(64), rtol=1e-6, atol=1e-6
        )


def test_the_brighter_rule_exposes(picture: np.ndarray):
    even, window = np.full((4, 5, 3), 0.3, np.float32), np.full((10, 10, 3), 0.01, np.float32)
    window[:1] = 100
    # An evenly lit place comes out near white; before a window the room's log mean is a grey card's.
    assert np.exp(MeteredExposure().adapt(even, VIEW).values[0]) == pytest.approx(1 / 0.3, rel=0.01)
    mean = np.exp(0.9 * np.log(0.01) + 0.1 * np.log(100))
    assert np.exp(MeteredExposure().adapt(window, VIEW).values[0]) == pytest.approx(0.18 / mean, rel=1e-5)


def test_half_way_between_two_frames_is_half_way_in_stops(picture: np.ndarray):
    meter = MeteredExposure()
    dim, bright = meter.adapt(picture, VIEW), meter.adapt(picture * np.float32(16), VIEW)
    between = dim.mixed(bright, 0.5)
    assert meter.gain(between, VIEW) == pytest.approx(meter.gain(dim, VIEW) / 4, rel=1e-6)


def test_black_asks_for_no_gain():
    black = np.zeros((4, 5, 3), np.float32)
    for meter in (MeteredExposure(), MeteredExposure(grey=0.18)):
        assert meter.adapt(black, VIEW).values.tolist() == [0]


def test_linear_tones_say_so_and_their_gain_is_what_they_show(picture: np.ndarray):
    view = View(500.0, luminance_scale=50.0)
    for tone in (MeteredExposure(), MeteredExposure(grey=0.1), FixedExposure(0.25), CameraExposure(ONE)):
        assert isinstance(tone, LinearExposure)
        settled = tone.adapt(picture, view)
        np.testing.assert_array_equal(
            tone.display_values(picture, view, settled), picture * np.float32(tone.gain(settled, view))
        )
    assert not isinstance(object(), LinearExposure)


def test_saturation_is_that_of_iso_12232():
    # 78 · 8² / (0.65 · 100 · 0.01)
    assert saturation_luminance(ONE) == pytest.approx(7680.0, rel=1e-12)


def test_a_stop_is_a_factor_of_exactly_two():
    longer = saturation_luminance(Exposure(1 / 50, 8.0, 100.0))
    faster = saturation_luminance(Exposure(1 / 100, 8.0, 200.0))
    assert saturation_luminance(ONE) / longer == 2
    assert saturation_luminance(ONE) / faster == 2
    assert saturation_luminance(Exposure(1 / 100, 16.0, 100.0)) / saturation_luminance(ONE) == 4


def test_what_saturates_the_camera_is_white():
    wall = np.full((2, 2, 3), 7680 / 50, np.float32)
    tone, view = CameraExposure(ONE, saturating=True), View(500.0, luminance_scale=50.0)
    np.testing.assert_allclose(tone.display_values(wall, view, tone.adapt(wall, view)), 1, rtol=1e-6)


def test_a_cameras_own_picture_has_118_where_the_plate_that_it_calibrates_has():
    # Standard output: 10 N² / (0.65 S t) cd/m² make 118 of 255, as capture's absolute scale has it.
    grey = np.full((2, 2, 3), 10 * 256 / (0.65 * 100 / 100), np.float32)
    exposure, view = Exposure(1 / 100, 16.0, 100.0), View(500.0)
    shown = CameraExposure(exposure).display_values(grey, view, CameraExposure(exposure).adapt(grey, view))
    assert np.rint(255 * encode_srgb(shown)).tolist() == np.full((2, 2, 3), 118).tolist()
    film = Film.of(exposure)
    np.testing.assert_allclose(film.display_values(grey, view, film.adapt(grey, view)), shown, rtol=0.02)
