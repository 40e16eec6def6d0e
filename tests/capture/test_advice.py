"""Advice on exposures: the paper's ⌈R/F⌉, stops to thirds, and what one photograph does not show."""

from __future__ import annotations

from math import log2

import numpy as np
import pytest

from relume.capture.exposure.advice import advise_brackets
from relume.errors import NotABracket
from relume.image.photograph import Exposure, Photograph
from relume.image.response import Response, srgb_response

FULL = Exposure(1 / 60, 8.0, 100.0)
LINEAR = Response(np.tile(np.log(np.maximum(np.arange(256), 0.25) / 255), (3, 1)), np.full(3, np.sqrt(1 / 12)))
"""Of a sensor without a curve: from 20 to 240 are 3.58 stops."""


def photograph(values: list[int], exposure: Exposure | None = FULL) -> Photograph:
    """Columns of these grey values, as many pixels each."""
    row = np.repeat(np.array(values, np.uint8), 10)
    return Photograph(np.tile(row[None, :, None], (20, 1, 3)), "a.jpg", exposure)


def test_one_photograph_is_enough_for_what_the_middle_of_the_curve_holds():
    advice = advise_brackets(photograph([20, 100, 240]), response=LINEAR)
    assert advice.working == pytest.approx(log2(240 / 20)) and advice.scene == pytest.approx(advice.working)
    assert advice.fewest == 1 and advice.stops == (0.0,) and advice.exposures[0].seconds == pytest.approx(1 / 60)
    assert not advice.open_above and not advice.open_below and advice.white == advice.dark == 0


def test_a_dim_photograph_is_to_be_exposed_longer_by_thirds_of_stops():
    advice = advise_brackets(photograph([20, 40, 60]), response=LINEAR)
    assert advice.stops == (2.0,) and advice.exposures[0].seconds == pytest.approx(4 / 60)
    # 75 would be 1.68 stops below 240: 1.67 are taken, so that nothing gets white.
    assert advise_brackets(photograph([70, 75]), response=LINEAR).stops == pytest.approx((5 / 3,))


def test_the_number_is_the_papers_and_neighbours_show_a_stop_in_common():
    # White: one more working range above it is covered, and from there down to 20.
    advice = advise_brackets(photograph([20, 255]), response=LINEAR)
    assert advice.open_above and advice.white == pytest.approx(0.5)
    assert advice.scene == pytest.approx(2 * log2(12)) and advice.fewest == 2
    assert advice.stops[0] == pytest.approx(-11 / 3)  # 3.58 stops, to a third
    steps = np.diff(advice.stops)
    assert np.all(steps <= log2(12) - 1 + 1e-9) and advice.stops[-1] >= 0
    # With nothing in common the paper's number is enough, to a third of a stop.
    assert len(advise_brackets(photograph([20, 255]), response=LINEAR, step=3.5).stops) == 3
    assert advise_brackets(photograph([20, 255]), response=LINEAR, step=1.0).stops[:2] == pytest.approx(
        (-11 / 3, -8 / 3)
    )


def test_every_part_lies_in_the_working_range_of_a_photograph():
    advice = advise_brackets(photograph([2, 9, 50, 255]), response=LINEAR)
    darkest, brightest = log2(2 / 255), log2(240 / 255) + log2(12)
    for level in np.linspace(darkest, brightest, 50):
        values = [255 * 2.0 ** (level + stop) for stop in advice.stops]
        assert any(20 * 0.999 <= value <= 240 * 1.001 for value in values)


def test_times_are_those_that_cameras_mark():
    # A third of a stop beside 1/60 s is 1/50 on the dial, not 1/47.6.
    steps = advise_brackets(photograph([20, 255]), response=LINEAR, step=1 / 3)
    found = [1 / each.seconds for each in steps.exposures]
    assert found[:5] == pytest.approx([800, 640, 500, 400, 320]) and found[-1] == pytest.approx(60)
    assert found[5:11] == pytest.approx([250, 200, 160, 125, 100, 80])
    # A telephone's 1/117 s is on no dial. All are, none is longer than what the brightest allows, and nothing is left.
    phone = advise_brackets(photograph([20, 255], Exposure(1 / 117)), response=LINEAR)
    assert [1 / each.seconds for each in phone.exposures] == pytest.approx([1600, 320, 60])
    true = np.log2([117 / 2 ** (32 / 3), 117 / 2 ** (25 / 3), 117 / 2**6])
    assert phone.stops == pytest.approx(true) and phone.stops[0] <= -log2(12) and phone.stops[-1] >= 0
    # Beyond the dial whole seconds are counted, and what no shutter makes is said as it is.
    night = advise_brackets(photograph([2]), response=LINEAR)
    assert night.stops == pytest.approx((6 + 2 / 3,)) and night.exposures[0].seconds == pytest.approx(1.6)
    assert advise_brackets(photograph([2], Exposure(1.0)), response=LINEAR).exposures[0].seconds == 102.0
    sun = advise_brackets(photograph([255], Exposure(1 / 8000)), response=LINEAR).exposures
    assert [each.seconds for each in sun[:1]] == pytest.approx([2.0 ** -(50 / 3)])


def test_black_says_only_that_there_is_darker():
    assert advise_brackets(photograph([0, 100]), response=LINEAR).open_below
    assert not advise_brackets(photograph([1, 100]), response=LINEAR).open_below


def test_the_dark_end_is_the_same_for_files_of_8_and_16_bits():
    eight = photograph([0, 20, 100, 240])
    sixteen = Photograph(eight.pixels.astype(np.uint16) * 257, "a.tif", FULL)
    found = [advise_brackets(each) for each in (eight, sixteen)]
    assert found[0].stops == pytest.approx(found[1].stops) and found[0].fewest == found[1].fewest
    # One working range below the dark end of the one that the photograph shows.
    assert found[0].scene == pytest.approx(2 * found[0].working) and found[1].scene == pytest.approx(found[0].scene)
    assert advise_brackets(photograph([0, 240]), response=LINEAR).stops[-1] >= log2(12) - 1e-9


def test_a_luminance_says_how_far_white_goes():
    shown = photograph([30, 255])
    bulb = advise_brackets(shown, response=LINEAR, brightest=1e5)
    sun = advise_brackets(shown, response=LINEAR, brightest=1.6e9)
    assert not bulb.open_above and sun.scene - bulb.scene == pytest.approx(log2(1.6e4))
    # ISO 12232: at 1/60 s, f/8, ISO 100 the value 118 of sRGB is 10 lx s / 100 / 0.65 · 64 · 60 = 591 cd/m².
    grey = advise_brackets(photograph([118]), brightest=591.0)
    level = srgb_response().log_exposure[0]
    assert grey.stops[0] == pytest.approx((level[240] - level[118]) / np.log(2), abs=1 / 3 + 0.01)
    assert sun.too_short and sun.too_short[0].seconds < 1 / 8000 and not bulb.too_short[2:]


def test_measured_noise_says_what_the_working_range_is():
    clean = Response(LINEAR.log_exposure, np.full((3, 256), 0.5))
    assert advise_brackets(photograph([100]), response=clean).working == pytest.approx(log2(240 / 5), abs=0.3)
    noisy = Response(LINEAR.log_exposure, np.full((3, 256), 4.0))
    assert advise_brackets(photograph([100]), response=noisy).working == pytest.approx(log2(240 / 40), abs=0.1)


def test_without_an_exposure_the_stops_are_told():
    advice = advise_brackets(photograph([20, 255], None), response=LINEAR)
    assert advice.exposures == () and len(advice.stops) > 1
    with pytest.raises(NotABracket, match=r"a\.jpg holds no exposure, so that its cd/m² are unknown"):
        advise_brackets(photograph([20, 255], None), response=LINEAR, brightest=1e5)
    with pytest.raises(NotABracket, match=r"has no ISO|has no f-number"):
        advise_brackets(photograph([20, 255], Exposure(0.1)), response=LINEAR, brightest=1e5)


@pytest.mark.parametrize(
    ("given", "words"),
    [({"step": 0.0}, "step is 0 stops"), ({"step": 9.0}, "step is 9 stops"), ({"brightest": -1.0}, "brightest is -1")],
)
def test_values_that_are_none_are_refused(given, words):
    with pytest.raises(ValueError, match=words):
        advise_brackets(photograph([20, 255]), response=LINEAR, **given)
    with pytest.raises(ValueError, match="256 values, and a response of 65536"):
        advise_brackets(photograph([20]), response=srgb_response(65536))
