"""Light that was saturated in some channels only: in the colour of what is beside it, and still a lower bound."""

import numpy as np
import pytest

from relume.image.radiance import SATURATED, RadianceMap
from relume.probe.clipped_light import in_the_colour_beside

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


@pytest.mark.parametrize(
    "inner, white, halo, expected, within",
    [
        pytest.param(
            [469, 2719, 2709], [False, True, True], [400.0, 480.0, 560.0], [469, 562.8, 656.6], 0.01, id="a window"
        ),
        pytest.param([2710, 445, 222], [True, False, False], [900.0, 90.0, 45.0], [2710, 445, 222], 0, id="as red"),
        # Adobe RGB's red, as Rec. 709's: the bounds of the others took it below 0. The least that blue's bound shows.
        pytest.param(
            [-950, 2719, 2708], [False, True, True], [400.0, 480.0, 560.0], [2708 / 1.4, 2719, 2708], 0.01, id="spoilt"
        ),
        # Red is no darker than green, which was not white yet.
        pytest.param([2710, 445, 222], [True, False, False], [100.0, 500.0, 250.0], [445, 445, 222], 1e-6, id="bluish"),
    ],
)
def test_a_bound_has_the_colour_of_what_is_beside_it(inner, white, halo, expected, within):
    found, count = in_the_colour_beside(lamp(inner, white, np.array(halo)))
    assert found.radiance[20, 20] == pytest.approx(expected, rel=within)
    assert count == (expected != inner)


def test_white_in_every_channel_and_nothing_beside_it_keep_their_bounds():
    white = lamp([2710, 2719, 2709], [True, True, True])
    assert in_the_colour_beside(white) == (white, 0)
    alone = lamp([2710, 445, 222], [True, False, False])
    assert alone.clipped is not None
    dark = RadianceMap(
        alone.radiance, alone.variance, np.where(alone.clipped == SATURATED, SATURATED, 2).astype(np.uint8)
    )
    assert in_the_colour_beside(dark)[0].radiance[20, 20].tolist() == [2710, 445, 222]
