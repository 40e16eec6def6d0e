"""The shapes of the distant scene: how far their walls are, and one line for what cannot be."""

import numpy as np
import pytest

from relume.scene.distant import Box, Dome, Enclosure


def test_a_dome_is_as_far_as_its_radius_from_its_centre_and_nearer_beside_it():
    dome = Dome(2.0, (0.0, 1.0, 0.0))
    way = np.array([[1.0, 0, 0], [0, 1, 0], [0, -1, 0]])
    assert dome.distances(np.array([0.0, 1.0, 0.0]), way).tolist() == [2, 2, 2]
    assert dome.distances(np.array([0.0, 2.0, 0.0]), way) == pytest.approx([np.sqrt(3), 1, 3])


def test_a_boxs_walls_are_where_its_corners_are():
    box = Box((-1, 0, -2), (3, 2, 4))
    way = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0.6, 0.8, 0]])
    found = box.distances(np.array([0.0, 0.5, 0.0]), way)
    assert found == pytest.approx([3, 1, 1.5, 0.5, 4, 2, 1.875])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Dome(0.0), "dome of radius 0.0"),
        (lambda: Dome(1.0, (0, np.nan, 0)), "expected metres"),
        (lambda: Box((0, 0, 0), (1, 0, 1)), "each of low below that of high"),
        (lambda: Enclosure(np.zeros((3, 2), np.float32), np.zeros((1, 3), np.int32)), r"expected \(N, 3\)"),
        (lambda: Enclosure(np.full((3, 3), np.inf, np.float32), np.zeros((1, 3), np.int32)), "NaN or infinity"),
    ],
)
def test_what_is_no_shape_is_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()
