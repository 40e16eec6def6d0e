"""A known luminaire: its radiance sets the scale, its colour the balance, and both hold for other pictures."""

from dataclasses import replace

import numpy as np
import pytest

from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.capture.scale.absolute import apply_scale
from relume.capture.scale.readings import ChannelGains, apply_balance, balance_from_luminaire, scale_from_luminaire
from relume.capture.scale.regions import measured_patch, rectangle
from relume.image.photograph import Exposure
from relume.image.radiance import SATURATED, RadianceMap
from relume.image.response import Response
from synthetic import NOISELESS, STOPS

LAMP = rectangle((40, 30), 5, 6, 10, 8)


def scene() -> RadianceMap:
    """A dim scene with a luminaire of relative colour (4, 5, 8), unevenly lit by no more than its noise."""
    radiance = np.full((30, 40, 3), 0.3)
    radiance[LAMP] = (4.0, 5.0, 8.0)
    return RadianceMap(
        radiance.astype(np.float32), np.full((30, 40, 3), 0.01, np.float32), np.zeros((30, 40), np.uint8)
    )


def test_a_luminaire_of_known_luminance_sets_one_factor():
    scale = scale_from_luminaire(scene(), LAMP, 1000.0, deviation=0.0)
    light = 0.2126 * 4 + 0.7152 * 5 + 0.0722 * 8
    assert scale.factor == pytest.approx((1000 / light,) * 3, rel=1e-6)
    noise = 0.1 * np.linalg.norm([0.2126, 0.7152, 0.0722]) / np.sqrt(80) / light
    assert scale.deviation == pytest.approx(noise, rel=1e-3)
    assert measured_patch(apply_scale(scene(), scale), LAMP).luminance == pytest.approx(1000.0, rel=1e-6)


def test_a_luminaire_of_known_colour_sets_a_factor_a_channel():
    scale = scale_from_luminaire(scene(), LAMP, (900.0, 1000.0, 1200.0))
    assert scale.factor == pytest.approx((225.0, 200.0, 150.0), rel=1e-6) and scale.deviation >= 0.02
    np.testing.assert_allclose(apply_scale(scene(), scale).radiance[10, 8], (900, 1000, 1200), rtol=1e-6)


def test_a_white_luminaire_balances_the_picture_and_keeps_its_luminance():
    balance = balance_from_luminaire(scene(), LAMP)
    result = apply_balance(scene(), balance)
    light = 0.2126 * 4 + 0.7152 * 5 + 0.0722 * 8
    np.testing.assert_allclose(result.radiance[10, 8], (light,) * 3, rtol=1e-6)
    np.testing.assert_allclose(result.radiance[20, 30], 0.3 * light / np.array([4, 5, 8]), rtol=1e-6)
    assert result.variance is not None and result.unit == "relative"
    np.testing.assert_allclose(result.variance[0, 0], 0.01 * np.square(balance.gains), rtol=1e-6)
    np.testing.assert_allclose(balance.deviation, 0.1 / np.sqrt(80) / np.array([4, 5, 8]), rtol=1e-3)


def test_a_coloured_luminaire_comes_out_in_its_colour():
    result = apply_balance(scene(), balance_from_luminaire(scene(), LAMP, (1.0, 0.6, 0.3)))
    seen = result.radiance[10, 8]
    np.testing.assert_allclose(seen / seen[0], (1.0, 0.6, 0.3), rtol=1e-6)


def test_a_balanced_response_merges_balanced_maps(calibration):
    white = NOISELESS.bracket(np.full((12, 16, 3), 3.0, np.float32), STOPS)
    merged = merge(white, calibration.response)
    assert np.ptp(merged.radiance[0, 0]) / merged.radiance[0, 0].mean() > 0.05
    balance = balance_from_luminaire(merged, np.ones((12, 16), bool))
    again = merge(white, balance.response(calibration.response))
    assert np.ptp(again.radiance[0, 0]) / again.radiance[0, 0].mean() < 1e-6
    # A grey of another brightness is grey as well: gains are no exposure.
    dim = NOISELESS.bracket(np.full((12, 16, 3), 0.4, np.float32), STOPS)
    grey = merge(dim, balance.response(calibration.response)).radiance[0, 0]
    assert np.ptp(grey) / grey.mean() < 0.02


def test_gains_move_a_curve_by_their_logarithm():
    response = Response(np.tile(np.arange(256) * 0.01, (3, 1)), np.ones(3))
    frame = Bracket((replace(NOISELESS.photograph(np.full((4, 4, 3), 0.2), Exposure(1.0)), exposure=Exposure(0.5)),))
    plain, moved = merge(frame, response), merge(frame, ChannelGains((2.0, 1.0, 0.5)).response(response))
    np.testing.assert_allclose(moved.radiance / plain.radiance, np.broadcast_to([2, 1, 0.5], (4, 4, 3)), rtol=1e-5)


def test_a_luminaire_that_cannot_be_used_is_refused():
    bright = scene()
    assert bright.clipped is not None
    bright.clipped[7, 7] = SATURATED
    with pytest.raises(ValueError, match="1 of the region's 80 pixels are clipped"):
        scale_from_luminaire(bright, LAMP, 1000.0)
    with pytest.raises(ValueError, match="expected positive red, green and blue"):
        scale_from_luminaire(scene(), LAMP, (100.0, 0.0, 50.0))
    with pytest.raises(ValueError, match="expected positive red, green and blue"):
        balance_from_luminaire(scene(), LAMP, (1.0, 2.0))  # type: ignore[arg-type]
    dull = scene()
    dull.radiance[LAMP, 2] = 0
    with pytest.raises(ValueError, match="must be lit in all three channels"):
        balance_from_luminaire(dull, LAMP)
    with pytest.raises(ValueError, match="a balance is three positive numbers"):
        ChannelGains((1.0, -1.0, 1.0))
