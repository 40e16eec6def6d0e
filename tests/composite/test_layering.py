"""Layers one over the other."""

import numpy as np
import pytest

from relume.composite.layering import over


def test_the_foreground_covers_by_its_matte_and_the_rest_keeps_its_bits():
    plate = np.random.default_rng(0).random((2, 3, 3), dtype=np.float32)
    foreground, matte = np.zeros((2, 3, 3), np.float32), np.zeros((2, 3), np.float32)
    foreground[0, 1], matte[0, 1] = (3, 2, 1), 1
    foreground[1, 2], matte[1, 2] = (0.5, 0.5, 0.5), 0.25
    picture = over(foreground, matte, plate)
    np.testing.assert_array_equal(picture[0, 1], [3, 2, 1])
    np.testing.assert_allclose(picture[1, 2], 0.5 + 0.75 * plate[1, 2], rtol=1e-6)
    np.testing.assert_array_equal(picture[matte == 0], plate[matte == 0])


def test_layers_of_other_sizes_are_refused():
    with pytest.raises(ValueError, match="differ in size; render with a camera of the plate's size"):
        over(np.zeros((2, 3, 3)), np.zeros((2, 3)), np.zeros((3, 2, 3)))
