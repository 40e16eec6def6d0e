"""Reinhard's global operator: its curve exactly (A33), its log average, and a key that suits the picture."""

import numpy as np
import pytest

from relume.virtual_camera.protocols import ToneOperator
from relume.virtual_camera.tone.reinhard import Reinhard
from relume.virtual_camera.view import View

VIEW = View(500.0)


def shown(tone: ToneOperator, picture: np.ndarray) -> np.ndarray:
    return tone.display_values(picture, VIEW, tone.adapt(picture, VIEW))


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return np.exp(np.random.default_rng(5).normal(0, 2, (90, 100, 3))).astype(np.float32)


def test_a_grey_picture_of_one_luminance_comes_to_the_key():
    wall = np.full((6, 7, 3), 42.0, np.float32)
    np.testing.assert_allclose(shown(Reinhard(0.18, np.inf), wall), 0.18 / 1.18, rtol=2e-6)
    # Its highest luminance is its white.
    np.testing.assert_allclose(shown(Reinhard(), wall), 1, rtol=2e-6)


def test_the_picture_is_its_slow_twin(picture: np.ndarray):
    light = picture.astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    average = np.exp(np.log(1e-6 * light.mean() + light).mean())
    scaled = 0.25 * light / average
    for white, tone in ((scaled.max(), Reinhard(0.25)), (2.0, Reinhard(0.25, 2.0)), (np.inf, Reinhard(0.25, np.inf))):
        display = scaled * (1 + scaled / white**2) / (1 + scaled)
        np.testing.assert_allclose(shown(tone, picture), picture * (display / light)[..., None], rtol=3e-6)


def test_the_brightest_pixel_is_white_and_nothing_is_beyond(picture: np.ndarray):
    light = shown(Reinhard(), picture).astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    assert light.max() == pytest.approx(1, rel=1e-6)


def test_the_unit_changes_nothing(picture: np.ndarray):
    for tone in (Reinhard(), Reinhard(None), Reinhard(white=3.0)):
        np.testing.assert_allclose(shown(tone, picture * np.float32(1e-7)), shown(tone, picture), rtol=1e-5)


def test_a_brighter_exposure_is_brighter(picture: np.ndarray):
    tone = Reinhard()
    settled = tone.adapt(picture, VIEW)
    assert np.all(
        tone.display_values(picture * np.float32(2), VIEW, settled) > tone.display_values(picture, VIEW, settled)
    )


def test_the_estimated_key_is_pinned_and_follows_where_the_average_lies():
    steps = np.repeat(np.float32(2) ** np.arange(9), 100)
    even = np.repeat(steps[None, :, None], 3, axis=2)
    # Percentiles 1 and 256 and an average of 16 lie evenly: 0.18 · 4⁰.
    assert np.exp(Reinhard(None).adapt(even, VIEW).values[2]) == pytest.approx(0.18, rel=1e-4)
    # Nine parts of ten at 256 of 1 to 256: the average is 2^7.2, 0.18 · 4^((14.4 − 8) / 8).
    bright = np.full((1, 1000, 3), 256, np.float32)
    bright[:, :100] = 1
    assert np.exp(Reinhard(None).adapt(bright, VIEW).values[2]) == pytest.approx(0.18 * 4**0.8, rel=1e-4)
    assert np.exp(Reinhard(None).adapt(1 / bright, VIEW).values[2]) == pytest.approx(0.18 * 4**-0.8, rel=1e-4)


def test_black_stays_black_and_a_spark_in_the_dark_overflows_nothing():
    black = np.zeros((4, 5, 3), np.float32)
    dim = np.full((40, 50, 3), 1e-6, np.float32)
    dim[3, 4] = 1e6
    for tone in (Reinhard(), Reinhard(None), Reinhard(white=np.inf), Reinhard(white=1e-3)):
        assert np.all(shown(tone, black) == 0)
        assert np.all(np.isfinite(shown(tone, dim)))
        assert np.all(shown(tone, dim) > 0)


def test_frames_mix_in_stops(picture: np.ndarray):
    tone = Reinhard()
    dim, bright = tone.adapt(picture, VIEW), tone.adapt(picture * np.float32(16), VIEW)
    between = tone.display_values(picture * np.float32(4), VIEW, dim.mixed(bright, 0.5))
    np.testing.assert_allclose(between, shown(tone, picture), rtol=1e-5)


@pytest.mark.parametrize("key", [0.0, -1.0, float("nan"), float("inf")])
def test_a_key_that_is_no_display_value_is_refused(key: float):
    with pytest.raises(ValueError, match=r"key is .*expected"):
        Reinhard(key)


def test_a_white_of_no_light_is_refused():
    with pytest.raises(ValueError, match=r"white is .*expected"):
        Reinhard(white=0.0)
