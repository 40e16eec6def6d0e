"""What codes a photograph holds, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from relume.image.code_values import code_values
from relume.image.photograph import Photograph
from relume.image.statistics import PERCENTS


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_codes_are_counted_as_numpy_counts_them(dtype: type):
    top = np.iinfo(dtype).max
    pixels = np.random.default_rng(3).integers(0, top, (611, 700, 3), dtype, endpoint=True)
    pixels[:100, :, 0], pixels[:50, :, 1] = 0, top
    told = code_values(Photograph(pixels))
    assert (told.top, told.pixels) == (top, 611 * 700)
    assert told.black == tuple((pixels == 0).mean((0, 1))) and told.white == tuple((pixels == top).mean((0, 1)))
    assert (told.minimum, told.maximum) == (pixels.min(), pixels.max())
    assert told.mean == pytest.approx(pixels.mean())
    wanted = np.percentile(pixels, PERCENTS, method="inverted_cdf").tolist()
    assert list(told.percentiles.values()) == wanted


def test_what_is_outside_the_picture_counts_nowhere():
    pixels = np.full((4, 6, 3), 100, np.uint8)
    pixels[:, 3:] = 255
    outside = np.zeros((4, 6), bool)
    outside[:, 3:] = True
    told = code_values(Photograph(pixels, outside=outside))
    assert (told.pixels, told.maximum, told.white) == (12, 100, (0, 0, 0))
    told = code_values(Photograph(pixels, outside=np.ones((4, 6), bool)))
    assert (told.pixels, told.minimum, told.mean, dict(told.percentiles)) == (0, None, None, {})
