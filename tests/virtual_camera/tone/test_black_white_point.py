"""Black and white point: the settings of the seed's pictures give the pixel values that they say."""

import numpy as np
import pytest

from relume.image.colour import encode_srgb
from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.tone.black_white_point import BlackWhitePoint
from relume.virtual_camera.view import View

NOTHING = Adaptation(np.zeros(0))


def pixel_values(tone: BlackWhitePoint, *light: float) -> np.ndarray:
    """The values, 0 to 255 and not rounded, of grey light."""
    radiance = np.repeat(np.array([light], np.float32)[..., None], 3, axis=2)
    shown = tone.display_values(radiance, View(1.0), NOTHING)
    assert shown.dtype == np.float32 and shown.shape == radiance.shape
    return 255 * encode_srgb(shown.astype(np.float64))[0, :, 1]


@pytest.mark.parametrize(
    "percent, power, at_a_tenth",
    # ln 255 = 5.54126; at 1 %: 5.54126 / (5.54126 + ln 100 = 4.60517) = 0.54613, and 255 · 0.1^0.54613 = 72.5
    [
        (100, 1.0, 25.5),
        (50, 0.88882, 32.9),
        (20, 0.77493, 42.8),
        (10, 0.70645, 50.1),
        (5, 0.64908, 57.2),
        (2, 0.58617, 66.1),
        (1, 0.54613, 72.5),
    ],
)
def test_the_settings_of_the_base_image(percent, power, at_a_tenth):
    tone = BlackWhitePoint(percent / 100)
    assert tone.power == pytest.approx(power, abs=1e-5)
    values = pixel_values(tone, 0.0, percent / 100 / 255, 0.1, 1.0)
    np.testing.assert_allclose(values, [0, 1, at_a_tenth, 255], atol=0.06)


def test_the_base_image_is_radiance_as_pixel_values():
    light = np.linspace(0, 1, 256)
    np.testing.assert_allclose(pixel_values(BlackWhitePoint(), *light), np.arange(256), atol=2e-3)


def test_a_raised_white_point_shows_what_was_too_bright_and_darkens_the_rest():
    raised = BlackWhitePoint(1.0, 50.0)
    values = pixel_values(raised, 1 / 255, 1.0, 50.0)
    np.testing.assert_allclose(values, [1, 255 * 50 ** -(5.5413 / (5.5413 + np.log(50))), 255], rtol=1e-3)
    assert values[1] < 255


def test_brighter_than_white_is_not_clipped_and_each_channel_is_on_its_own():
    tone = BlackWhitePoint(0.1)
    light = np.array([[[4.0, 0.5, 0.01]]], np.float32)
    shown = 255 * encode_srgb(tone.display_values(light, View(1.0), NOTHING).astype(np.float64))[0, 0]
    np.testing.assert_allclose(shown, 255 * light[0, 0] ** tone.power, rtol=1e-4)
    assert shown[0] > 255
    assert tone.adapt(light, View(1.0)).values.size == 0


@pytest.mark.parametrize("white", [0.05, 0.004, 1.0, 1e6])
def test_no_finite_light_overflows(white):
    light = np.array([[[0.0, 1.0, 3e38]]], np.float32)
    shown = BlackWhitePoint(white=white).display_values(light, View(1.0), NOTHING)[0, 0]
    assert np.isfinite(shown).all() and shown[0] < 1e-4 and shown[2] > 1e8
