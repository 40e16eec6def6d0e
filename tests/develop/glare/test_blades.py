"""The opening between blades: as large as its f-number says, whatever its shape."""

import numpy as np
import pytest

from relume.develop.glare.blades import Iris


@pytest.mark.parametrize("iris", [Iris(3), Iris(6), Iris(7, 0.4, 0.3), Iris(5, 1.0), Iris(9, 0.9)])
def test_every_opening_has_the_area_of_a_circle_of_diameter_one(iris):
    drawn = iris.drawn(128)
    assert drawn.sum() * (2 * iris.corner / 128) ** 2 == pytest.approx(np.pi / 4, rel=2e-3)
    assert not drawn[0, 0] and drawn[64, 64] == 1


def test_straight_and_round_blades_have_the_edges_of_polygons_and_circles():
    # A hexagon of area π / 4 has sides and corners of √(π / (6 √3)).
    assert Iris(6).corner == pytest.approx(0.549818) and Iris(6).edge == pytest.approx(0.549818)
    assert Iris(6).edge_radius == np.inf
    circle = Iris(6, 1.0)
    assert (circle.corner, circle.edge_radius, 6 * circle.edge) == pytest.approx((0.5, 0.5, np.pi))
    assert 6 * Iris(6, 0.5).edge < 6 * Iris(6).edge


def test_rotation_turns_the_first_blade_from_right_to_down():
    right, down = (Iris(3, rotation=turn).drawn(64) for turn in (0.0, np.pi / 2))
    # The blade on the right cuts a triangle there at half of its corner's distance.
    assert right[32, 60] == 0 and right[32, 4] == 1
    assert np.abs(down - right.T).max() < 0.3


def test_impossible_openings_are_refused():
    for arguments, words in (((2,), "2 blades"), ((6, 1.5), "roundness is 1.5"), ((6, 0.0, np.nan), "rotation is nan")):
        with pytest.raises(ValueError, match=words):
            Iris(*arguments)  # type: ignore[arg-type]
