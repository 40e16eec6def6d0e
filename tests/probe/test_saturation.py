"""Light that was saturated in some channels only: in the colour of what is beside it, and still a lower bound."""

import numpy as np
import pytest

from relume.image.radiance import SATURATED, RadianceMap
from relume.probe.ball.saturation import in_the_colour_beside

WARM = np.array([1.0, 0.6, 0.3])


def lamp(inner: list[float], white: list[bool], halo: np.ndarray = WARM * 500) -> RadianceMap:
    """A pixel of which some channels were white in every photograph, in a measured halo, on a bluish wall."""
    radiance = np.full((41, 41, 3), [4.0, 5.0, 9.0], np.float32)
    radiance[17:24, 17:24] = halo
    radiance[20, 20] = inner
    variance = np.full(radiance.shape, 1e-4, np.float32)
    variance[20, 20] = np.where(white, np.inf, 1e-4)
    clipped = np.zeros((41, 41), np.uint8)
    clipped[20, 20] = SATURATED
    return RadianceMap(radiance, variance, clipped)


def test_a_warm_lamp_is_not_red():
    picture = lamp([2710, 445, 222], [True, False, False])
    found, count = in_the_colour_beside(picture)
    # Green and blue were measured; red is what the halo's colour makes of them: 445 / 0.6 = 742.
    assert found.radiance[20, 20] == pytest.approx([742, 445, 222], rel=0.01)
    assert count == 1 and found.clipped is not None and found.clipped[20, 20] == SATURATED
    others = np.ones((41, 41), bool)
    others[20, 20] = False
    np.testing.assert_array_equal(found.radiance[others], picture.radiance[others])


def test_a_bluish_window_is_not_cyan():
    found, _ = in_the_colour_beside(lamp([469, 2719, 2709], [False, True, True], np.array([400.0, 480.0, 560.0])))
    assert found.radiance[20, 20] == pytest.approx([469, 469 * 1.2, 469 * 1.4], rel=0.01)


def test_a_red_lamp_stays_as_red_as_its_halo():
    found, count = in_the_colour_beside(lamp([2710, 445, 222], [True, False, False], np.array([900.0, 90.0, 45.0])))
    assert found.radiance[20, 20].tolist() == [2710, 445, 222] and count == 0


def test_a_white_channel_is_no_darker_than_one_that_was_not_white_yet():
    found, _ = in_the_colour_beside(lamp([2710, 445, 222], [True, False, False], np.array([100.0, 500.0, 250.0])))
    assert found.radiance[20, 20] == pytest.approx([445, 445, 222])


def test_white_in_every_channel_and_nothing_beside_it_keep_their_bounds():
    white = lamp([2710, 2719, 2709], [True, True, True])
    assert in_the_colour_beside(white) == (white, 0)
    alone = lamp([2710, 445, 222], [True, False, False])
    assert alone.clipped is not None
    dark = RadianceMap(
        alone.radiance, alone.variance, np.where(alone.clipped == SATURATED, SATURATED, 2).astype(np.uint8)
    )
    assert in_the_colour_beside(dark)[0].radiance[20, 20].tolist() == [2710, 445, 222]
