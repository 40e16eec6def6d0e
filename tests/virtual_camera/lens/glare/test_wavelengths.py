"""Wavelengths of pixels."""

import numpy as np
import pytest

from relume.virtual_camera.lens.glare.wavelengths import channel_shares, colour_matching


def test_the_fit_is_near_the_standard_observer():
    # CIE 1931, x̄, ȳ, z̄ at 450, 555 and 600 nm.
    table = [[0.3362, 0.0380, 1.7721], [0.5121, 1.0000, 0.0057], [1.0622, 0.6310, 0.0008]]
    assert np.abs(colour_matching(np.array([450.0, 555.0, 600.0])) - table).max() < 0.025


def test_colours_hold_their_own_wavelengths_and_all_of_their_light():
    wavelengths = np.arange(400.0, 701.0, 10.0)
    shares = channel_shares(wavelengths)
    assert shares.shape == (3, 31) and shares.min() >= 0
    assert shares.sum(1) == pytest.approx([1, 1, 1], abs=1e-12)
    red, green, blue = shares @ wavelengths
    assert 590 < red < 620 and 530 < green < 555 and 445 < blue < 470
