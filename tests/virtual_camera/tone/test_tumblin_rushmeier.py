"""Tumblin and Rushmeier's operator: the published constants by hand, and what follows from them."""

import numpy as np
import pytest

from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.tumblin_rushmeier import TumblinRushmeier, brightness_exponent, screen_luminance
from relume.virtual_camera.view import View

VIEW = View(500.0)


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return np.exp(np.random.default_rng(9).normal(1, 2, (60, 70, 3))).astype(np.float32)


def test_the_exponent_is_the_published_one():
    assert brightness_exponent(1000.0) == 2.655
    assert brightness_exponent(100.0) == pytest.approx(2.655, abs=1e-7)
    assert brightness_exponent(1.0) == pytest.approx(1.855004, abs=1e-6)
    assert brightness_exponent(0.01) == pytest.approx(1.055399, abs=1e-6)
    assert brightness_exponent(1e-9) == 0


def test_pinned_luminances_by_hand():
    # Adapted to 1000: γ 2.655; the screen's 10: γ 2.2550004; ratio 1.1773834; m = 10^0.1773834 = 1.5044695
    found = screen_luminance(np.array([1000.0, 100.0, 10000.0]), 1000.0, DisplayRange(100.0, 1.0))
    np.testing.assert_allclose(found, [15.044695, 1.0, 226.342843], rtol=1e-5)


def test_an_eye_adapted_alike_sees_the_scene_as_it_is():
    light = np.logspace(-3, 4, 20)
    np.testing.assert_allclose(screen_luminance(light, 10.0, DisplayRange(100.0, 1.0)), light, rtol=1e-12)
    np.testing.assert_allclose(screen_luminance(light, 6.0, DisplayRange(120.0, 0.3)), light, rtol=1e-12)


def test_the_picture_is_its_slow_twin(picture: np.ndarray):
    tone, view = TumblinRushmeier(DisplayRange(80.0, 0.8)), View(500.0, luminance_scale=30.0)
    light = picture.astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    adapted = np.exp(np.log(30 * light + 2.3e-5).mean())
    world, display = (2.655 if a > 100 else 1.855 + 0.4 * np.log10(a + 2.3e-5) for a in (adapted, 8.0))
    expected = 10 ** (world / display - 1) * 8 * (30 * light / adapted) ** (world / display)
    # The screen's black of 0.8 of 80 cd/m² is there without a signal.
    expected = (expected - 0.8) / 79.2
    settled = tone.adapt(picture, view)
    # 1e-5 is a thirtieth of the least step of 8 bits: so much the curve's table rounds the bend at black.
    np.testing.assert_allclose(
        tone.display_values(picture, view, settled),
        np.maximum(picture * (expected / light)[..., None], -0.8 / 79.2),
        rtol=1e-5,
        atol=1e-5,
    )


def test_dim_scenes_look_flatter_and_dimmer(picture: np.ndarray):
    tone = TumblinRushmeier()

    def seen(scale: float) -> np.ndarray:
        view = View(500.0, luminance_scale=scale)
        shown = tone.display_values(picture, view, tone.adapt(picture, view)).astype(np.float64)
        return 1 + 99 * shown @ [0.2126, 0.7152, 0.0722]

    day, dusk = np.log(seen(1000.0)), np.log(seen(0.001))
    assert dusk.std() < 0.6 * day.std()
    assert dusk.mean() < day.mean()


def test_a_unit_and_its_scale_are_one(picture: np.ndarray):
    tone, dim = TumblinRushmeier(), View(500.0, luminance_scale=64.0)
    brighter = picture * np.float32(64)
    np.testing.assert_allclose(
        tone.display_values(picture, dim, tone.adapt(picture, dim)),
        tone.display_values(brighter, VIEW, tone.adapt(brighter, VIEW)),
        rtol=1e-5,
    )
