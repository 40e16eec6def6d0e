"""Ferwerda's operator: thresholds meet thresholds, rods see greys, and eyes take their time."""

import numpy as np
import pytest

from relume.image.primaries import REC709
from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.ferwerda import Ferwerda, adaptation_after, multipliers
from relume.virtual_camera.tone.histogram.eye import blurred_by_acuity
from relume.virtual_camera.tone.vision import cone_threshold, rod_threshold, scotopic_luminance
from relume.virtual_camera.view import View

VIEW = View(500.0)
PLAIN = Ferwerda(DisplayRange(), acuity=False)


def adapted_to(cones: float, rods: float) -> Adaptation:
    return Adaptation(np.log([cones, rods]))


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return np.exp(np.random.default_rng(10).normal(0, 1, (60, 70, 3))).astype(np.float32)


def test_multipliers_by_hand():
    # Tp(50) = 10^((0.249 · 1.69897 + 0.65)^2.7 − 0.72) = 3.0879464; Tp(1000) = 10^1.745; Ts(1e-4) = 10^−2.86
    day, night = (
        multipliers(adapted_to(1000.0, 2500.0), DisplayRange()),
        multipliers(adapted_to(1e-4, 1e-4), DisplayRange()),
    )
    assert day[0] == pytest.approx(3.0879464 / 55.590426, rel=1e-7)
    assert day[1] == 0
    assert night[0] == pytest.approx(3.0879464 / 0.19054607, rel=1e-7)
    assert night[1] == pytest.approx(3.0879464 / 0.0013803843, rel=1e-7)


@pytest.mark.parametrize("adapted", [1e-5, 1e-2, 1.0, 300.0])
def test_what_cones_just_see_is_just_seen_on_the_screen(adapted: float):
    cones, rods = multipliers(adapted_to(adapted, adapted), DisplayRange(80.0, 0.5))
    on_screen = float(cone_threshold(np.array(40.0)))
    assert cones * float(cone_threshold(np.array(adapted))) == pytest.approx(on_screen, rel=1e-12)
    assert rods * float(rod_threshold(np.array(adapted))) <= on_screen * (1 + 1e-12)


def test_rods_fade_over_the_mesopic_range():
    shares = []
    for light in (1e-3, 5.6e-3, float(np.sqrt(5.6e-3 * 5.62)), 5.62, 100.0):
        _, rods = multipliers(adapted_to(light, light), DisplayRange())
        shares.append(rods * float(rod_threshold(np.array(light))) / float(cone_threshold(np.array(50.0))))
    np.testing.assert_allclose(shares, [1, 1, 0.5, 0, 0], atol=1e-9)


@pytest.mark.parametrize("colour", [True, False])
@pytest.mark.parametrize("scale", [1e-5, 0.05, 100.0])
def test_the_picture_is_its_slow_twin(picture: np.ndarray, colour: bool, scale: float):
    tone, view = Ferwerda(DisplayRange(), acuity=False, colour=colour), View(500.0, luminance_scale=scale)
    settled = tone.adapt(picture, view)
    cones, rods = multipliers(settled, DisplayRange())
    xyz = picture.astype(np.float64) @ REC709.to_xyz().T * scale
    grey = rods * scotopic_luminance(xyz)
    if colour:
        shown = cones * picture * scale + grey[..., None]
    else:
        shown = picture * scale * (cones + grey / xyz[..., 1])[..., None]
    # The screen's black of 1 of 100 cd/m² is there without a signal.
    expected = (shown - 1) / 99
    np.testing.assert_allclose(tone.display_values(picture, view, settled), expected, rtol=5e-6, atol=1e-7)


def test_the_screen_adds_its_black_to_what_is_displayed():
    # Adapted to 1000 cd/m², cones are shown by 3.0879464 / 55.590426, as above: 900 cd/m² as 49.993352.
    grey = np.full((1, 1, 3), 900.0, np.float32)
    assert PLAIN.display_values(grey, VIEW, adapted_to(1000.0, 2500.0)) == pytest.approx((49.993352 - 1) / 99, rel=1e-6)
    dark_room = Ferwerda(acuity=False)
    assert dark_room.display_values(grey, VIEW, adapted_to(1000.0, 2500.0)) == pytest.approx(
        49.983352 / 99.99, rel=1e-6
    )
    # 15 cd/m² as 0.8332225: below what the screen has without a signal.
    assert PLAIN.display_values(grey / 60, VIEW, adapted_to(1000.0, 2500.0)) == pytest.approx(-0.1667775 / 99, rel=1e-5)


def test_an_eye_adapts_to_half_of_what_is_bright(picture: np.ndarray):
    bright = float(np.sort(picture.ravel())[int(np.ceil(0.99 * picture.size)) - 1])
    view = View(500.0, luminance_scale=8.0)
    assert np.exp(PLAIN.adapt(picture, view).values[0]) == pytest.approx(4 * bright, rel=1e-6)
    assert np.exp(Ferwerda(percentile=100.0).adapt(picture, view).values[0]) == pytest.approx(
        4 * float(picture.max()), rel=1e-6
    )


def test_rods_adapt_to_the_scotopic_light_of_the_picture():
    grey = np.full((5, 5, 3), 3.0, np.float32)
    cones, rods = np.exp(PLAIN.adapt(grey, VIEW).values)
    # 1.33 · (1 + (1 + 1.0890578) / 0.9504559) − 1.68 of D65
    assert rods / cones == pytest.approx(2.573295, rel=1e-5)


def test_by_day_it_is_plain_exposure_and_by_night_grey(picture: np.ndarray):
    day, night = View(500.0, luminance_scale=1000.0), View(500.0, luminance_scale=1e-6)
    bright = PLAIN.display_values(picture, day, PLAIN.adapt(picture, day))
    shown, factor = bright * 99 + 1, multipliers(PLAIN.adapt(picture, day), DisplayRange())[0] * 1000
    np.testing.assert_allclose(shown, factor * picture, rtol=1e-5, atol=1e-5)
    dark_room = Ferwerda(DisplayRange(100.0, 1e-12), acuity=False)
    dark = dark_room.display_values(picture, night, dark_room.adapt(picture, night))
    assert np.max(dark.max(-1) / dark.min(-1)) < 1.3
    assert dark.mean() < 0.1 * bright.mean()


def test_without_colour_loss_proportions_stay(picture: np.ndarray):
    tone = Ferwerda(DisplayRange(100.0, 1e-12), acuity=False, colour=False)
    night = View(500.0, luminance_scale=1e-6)
    dark = tone.display_values(picture, night, tone.adapt(picture, night))
    np.testing.assert_allclose(dark[..., 0] * picture[..., 1], dark[..., 1] * picture[..., 0], rtol=1e-5)


def test_acuity_is_lost_before_thresholds_are_met(picture: np.ndarray):
    night = View(2000.0, luminance_scale=1e-3)
    tone = Ferwerda(DisplayRange())
    settled, before = tone.adapt(picture, night), picture.copy()
    blurred = blurred_by_acuity(picture, night, float(np.exp(settled.values[0])))
    assert blurred.std() < 0.7 * picture.std()
    np.testing.assert_array_equal(
        tone.display_values(picture, night, settled), PLAIN.display_values(blurred, night, settled)
    )
    np.testing.assert_array_equal(picture, before)


def test_eyes_adapt_in_a_blink_to_light_and_in_minutes_to_darkness():
    dark, bright = adapted_to(0.01, 0.01), adapted_to(100.0, 100.0)
    lit = adaptation_after(dark, bright, 0.15)
    # 1 − exp(−0.15 / 0.08) and 1 − 1/e of the way
    np.testing.assert_allclose((lit.values - dark.values) / np.log(1e4), [0.8466450, 0.6321206], rtol=1e-6)
    dim = adaptation_after(bright, dark, 400.0)
    np.testing.assert_allclose((bright.values - dim.values) / np.log(1e4), [0.9736520, 0.6321206], rtol=1e-6)


def test_time_adds_up_and_none_changes_nothing():
    now, later = adapted_to(300.0, 2.0), adapted_to(0.5, 80.0)
    np.testing.assert_allclose(adaptation_after(now, later, 0.0).values, now.values, rtol=1e-15)
    twice = adaptation_after(adaptation_after(now, later, 3.0), later, 5.0)
    np.testing.assert_allclose(twice.values, adaptation_after(now, later, 8.0).values, rtol=1e-12)
    np.testing.assert_allclose(adaptation_after(now, later, 1e6).values, later.values, rtol=1e-12)
    with pytest.raises(ValueError, match="expected 0 or more"):
        adaptation_after(now, later, -1.0)
