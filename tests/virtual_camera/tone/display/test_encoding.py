"""What a screen is sent for a linear value, pinned for each kind of screen."""

import numpy as np
import pytest

from relume.image.colour import encode_pq
from relume.virtual_camera.tone.display.encoding import (
    HLG,
    PQ,
    DisplayP3,
    HdrGainMap,
    Srgb,
    encoded,
    encoded_and_clipped,
)


def pixel(*values: float) -> np.ndarray:
    return np.array([[values]], np.float32)


def codes(display, *values: float) -> list[int]:
    return encoded(pixel(*values), display)[0, 0].tolist()


def test_srgb_has_8_or_16_bits():
    assert codes(Srgb(), 0.18, 0.5, 1) == [118, 188, 255]
    assert codes(Srgb(16), 0.18, 0.5, 1) == [30235, 48192, 65535]  # 65535 · 0.461356 and · 0.735357


def test_pure_srgb_red_is_what_every_p3_screen_is_sent_for_it():
    assert codes(DisplayP3(), 1, 0, 0) == [234, 51, 35]
    assert codes(DisplayP3(), 0.5, 0.5, 0.5) == [188] * 3


def test_a_colour_beyond_rec_709_is_within_p3():
    """Display P3's own red in linear Rec. 709."""
    red = (1.2249401, -0.0420569, -0.0196376)
    assert codes(DisplayP3(), *red) == [255, 0, 0]
    clipping = encoded_and_clipped(pixel(*red), Srgb())[1]
    assert clipping.above == (1, 0, 0) and clipping.below == (0, 1, 1)


def test_pq_has_white_at_203_and_stops_at_its_peak():
    assert codes(PQ(), 1, 1, 1) == [38055] * 3  # 65535 · 0.580689
    assert codes(PQ(white=100), 1, 1, 1) == [33297] * 3  # 65535 · 0.508078
    assert codes(PQ(peak=1000, white=100), 50, 50, 50) == [49271] * 3  # 65535 · 0.751827
    clipping = encoded_and_clipped(np.full((1, 4, 3), [[[1], [4.9], [4.93], [60]]], np.float32), PQ())[1]
    assert clipping.above == (0.5, 0.5, 0.5)  # 1000 / 203 = 4.926


def test_bt_2020_holds_rec_709_s_red_in_three_channels():
    """0.6274, 0.0691, 0.0164 (BT.2087-0, annex 1) of 203 cd/m², through PQ."""
    expected = 65535 * encode_pq(203 * np.array([0.6274, 0.0691, 0.0164]))
    assert codes(PQ(), 1, 0, 0) == pytest.approx(expected.tolist(), abs=10)


def test_hlg_has_white_at_three_quarters_and_its_peak_at_the_top():
    assert codes(HLG(), 1, 1, 1) == pytest.approx([49151 - 6] * 3, abs=4)  # 65535 · ¾ is 203.15 cd/m²
    assert codes(HLG(), 1000 / 203, 1000 / 203, 1000 / 203) == pytest.approx([65535] * 3, abs=1)
    assert encoded_and_clipped(pixel(6, 6, 6), HLG())[1].above == (1, 1, 1)
    assert codes(HLG(), 0, 0, 0) == [0, 0, 0]


def test_a_gain_map_s_base_is_the_srgb_picture():
    assert codes(HdrGainMap(), 0.18, 0.5, 7) == [118, 188, 255]


@pytest.mark.parametrize("display", [Srgb(), DisplayP3(), PQ(), HLG()])
def test_a_gain_is_the_same_as_brighter_values(display):
    values = np.random.default_rng(1).uniform(0, 1, (9, 7, 3)).astype(np.float32)
    assert np.abs(encoded(values, display, gain=0.5).astype(int) - encoded(values / 2, display)).max() <= 1
    assert encoded(values, display, gain=0.5).max() < encoded(values, display).max()


@pytest.mark.parametrize("display", [Srgb(), DisplayP3(), PQ(), HLG(), HdrGainMap()])
def test_bad_values_are_refused_and_infinite_ones_are_the_brightest(display):
    with pytest.raises(ValueError, match="NaN, the first at x 0, y 0"):
        encoded(pixel(0, np.nan, 0), display)
    with pytest.raises(ValueError, match="expected"):
        encoded(np.zeros((2, 2, 3)), display)
    with pytest.raises(ValueError, match="gain is 0"):
        encoded(pixel(0, 0, 0), display, gain=0)
    brightest = encoded(np.full((1, 1, 3), np.inf, np.float32), display)
    assert np.array_equal(brightest, encoded(np.full((1, 1, 3), 1e9, np.float32), display))


@pytest.mark.parametrize(
    "make, said",
    [
        (lambda: Srgb(10), "bits is 10"),  # pyright: ignore[reportArgumentType]
        (lambda: DisplayP3(12), "bits is 12"),  # pyright: ignore[reportArgumentType]
        (lambda: PQ(peak=100), "white is 203"),
        (lambda: PQ(peak=20000), "peak 20000"),
        (lambda: HLG(peak=4000), "400 to 2000"),
        (lambda: HdrGainMap(headroom=0), "headroom is 0"),
        (lambda: HdrGainMap(quality=101), "quality is 101"),
    ],
)
def test_senseless_displays_are_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()


@pytest.mark.parametrize("display", [Srgb(), Srgb(16), DisplayP3(), PQ(), HLG(), HdrGainMap()])
def test_what_is_below_a_screens_black_is_black_and_counted(display):
    picture = np.concatenate([pixel(-0.0101, -0.0101, -0.0101), pixel(0.5, 0.5, 0.5)], axis=1)
    found, clipping = encoded_and_clipped(picture, display)
    assert found[0, 0].tolist() == [0, 0, 0] == encoded(pixel(0, 0, 0), display)[0, 0].tolist()
    assert clipping.below == (0.5, 0.5, 0.5)
    assert found[0, 1].tolist() == encoded(pixel(0.5, 0.5, 0.5), display)[0, 0].tolist()
