"""The sRGB curve against literal values of the standard, and luminance against the weights of Rec. 709."""

import numpy as np
import pytest

from relume.image.colour import decode_srgb, encode_srgb, luminance


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
