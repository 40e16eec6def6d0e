"""The transfer curves against literal values of the standards, and luminance against the weights of Rec. 709."""

import numpy as np
import pytest

from relume.image.colour import decode_srgb, encode_hlg, encode_pq, encode_srgb, hlg_gamma, hlg_scene, luminance
from screens import decode_hlg, decode_pq, hlg_displayed


@pytest.mark.parametrize(
    ("linear", "encoded"),
    [(0.0, 0.0), (0.001, 0.01292), (0.0031308, 0.04045), (0.18, 0.461356), (0.5, 0.735357), (1.0, 1.0)],
)
def test_the_srgb_curve_maps_the_standards_values(linear, encoded):
    assert encode_srgb(np.array(linear)) == pytest.approx(encoded, abs=1e-6)
    assert decode_srgb(np.array(encoded)) == pytest.approx(linear, abs=2e-6)


def test_srgb_decodes_what_it_encoded_beyond_one_and_below_zero():
    linear = np.linspace(-0.5, 4, 1001)
    assert decode_srgb(encode_srgb(linear)) == pytest.approx(linear, abs=1e-6)
    assert encode_srgb(np.array(-0.18)) == pytest.approx(-0.461356, abs=1e-6)


def test_srgb_keeps_shape_and_float_type():
    pixels = np.full((2, 3, 3), 0.25, np.float32)
    assert encode_srgb(pixels).dtype == decode_srgb(pixels).dtype == np.float32
    assert encode_srgb(pixels).shape == (2, 3, 3)


def test_luminance_weighs_red_green_and_blue_as_rec_709_does():
    assert luminance(np.eye(3)) == pytest.approx([0.2126, 0.7152, 0.0722], abs=1e-12)
    assert luminance(np.ones((4, 5, 3), np.float32)).shape == (4, 5)
    assert luminance(np.ones((4, 5, 3), np.float32)).dtype == np.float32


def test_luminance_refuses_what_has_no_three_channels():
    with pytest.raises(ValueError, match=r"\(\.\.\., 3\)"):
        luminance(np.ones((4, 4)))


@pytest.mark.parametrize(
    "luminance, signal",
    [
        (0.1, 0.062337),
        (1, 0.149946),
        (100, 0.508078),
        (203, 0.580689),  # BT.2408's white, which it calls 58 %
        (1000, 0.751827),
        (4000, 0.902572),
        (10000, 1.0),
    ],
)
def test_pq_is_st_2084_s(luminance, signal):
    assert encode_pq(luminance) == pytest.approx(signal, abs=5e-7)
    assert decode_pq(encode_pq(luminance)) == pytest.approx(luminance, rel=1e-9)


@pytest.mark.parametrize("linear, signal", [(0.18, 0.461356), (0.5, 0.735357), (0.0031308, 0.04045)])
def test_srgb_is_iec_61966_s(linear, signal):
    assert float(encode_srgb(np.array(linear))) == pytest.approx(signal, abs=5e-7)


def test_pq_stays_within_its_range_beyond_it():
    black = float(encode_pq(0.0))
    assert encode_pq(np.array([-5.0, 0.0, 20000.0, np.inf])) == pytest.approx([black, black, 1, 1], abs=1e-12)
    assert black < 1e-6
    assert decode_pq(np.array([-1.0, 0.0, 2.0])) == pytest.approx([0, 0, 10000])


@pytest.mark.parametrize(
    "scene, signal",
    [(0, 0), (1 / 48, 0.25), (1 / 12, 0.5), (0.26496256, 0.75), (1, 1)],  # √(3·1/48) = ¼; ¾ is BT.2408's white
)
def test_hlg_is_bt_2100_s(scene, signal):
    assert encode_hlg(scene) == pytest.approx(signal, abs=1e-7)
    assert decode_hlg(signal) == pytest.approx(scene, abs=1e-7)


def test_both_pieces_of_hlg_meet_with_one_slope():
    around = 1 / 12 + np.array([-2e-6, -1e-6, 0, 1e-6, 2e-6])
    slopes = np.diff(encode_hlg(around)) / 1e-6
    assert slopes == pytest.approx(np.full(4, 3.0), rel=1e-4)  # ½·√(3/E) at E = 1/12


def test_hlg_is_clipped_at_both_ends():
    assert encode_hlg(np.array([-1.0, np.inf])).tolist() == pytest.approx([0, 1])
    assert decode_hlg(np.array([-1.0, 2.0])).tolist() == pytest.approx([0, 1])


def test_the_ootf_is_what_a_screen_of_1000_shows():
    grey = np.full(3, 0.1)
    assert hlg_displayed(grey) == pytest.approx([63.0957344] * 3)  # as colour-science prints for ootf_HLG_BT2100(0.1)
    assert hlg_displayed(np.full(3, decode_hlg(0.75))) == pytest.approx([203.152] * 3, abs=1e-3)
    # 1000 · 0.2627^0.2 of red alone
    assert hlg_displayed(np.array([1.0, 0, 0])) == pytest.approx([765.406, 0, 0], abs=1e-3)


@pytest.mark.parametrize("peak, gamma", [(1000, 1.2), (400, 1.0328652), (2000, 1.3264326)])
def test_the_system_gamma_follows_the_screen(peak, gamma):
    assert hlg_gamma(peak) == pytest.approx(gamma, abs=1e-7)


def test_scene_light_is_had_back_from_the_screen_s():
    scene = np.random.default_rng(3).random((5, 4, 3))
    scene[0, 0] = 0
    for peak in (400.0, 1000.0, 2000.0):
        assert hlg_scene(hlg_displayed(scene, peak), peak) == pytest.approx(scene, rel=1e-12)


@pytest.mark.parametrize("peak", [399, 2001, float("nan")])
def test_a_peak_beyond_the_formula_is_refused(peak):
    with pytest.raises(ValueError, match="400 to 2000"):
        hlg_gamma(peak)
