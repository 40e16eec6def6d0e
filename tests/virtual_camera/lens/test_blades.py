"""Iris openings: as large as their f-number says, whatever their shape, and one shape however they are reported."""

import numpy as np
import pytest

from relume.virtual_camera.lens.blades import Blades

EVERY = [Blades(), Blades(3), Blades(6), Blades(5, 0.5, 0.3), Blades(9, 1.0), Blades(7, 0.2), Blades(9, 0.9)]


def area(outline):
    x, y = outline.T
    return abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2


@pytest.mark.parametrize("blades", EVERY)
def test_openings_of_one_f_number_have_one_area(blades):
    assert area(blades.outline()) == pytest.approx(np.pi, rel=1e-12)
    assert np.abs(blades.outline().mean(0)).max() < 1e-9
    drawn = blades.draw(128)
    assert drawn.sum() * (2 * blades.corner / 128) ** 2 == pytest.approx(np.pi / 4, rel=2e-3)
    assert not drawn[0, 0] and drawn[64, 64] == 1


@pytest.mark.parametrize("blades", [Blades(), Blades(3, 0.0, 0.4), Blades(5, 0.5, 0.3), Blades(7, 0.2)])
def test_outline_and_drawn_opening_are_one_shape(blades):
    drawn = blades.draw(400)
    for scale, expected in ((0.98, 1), (1.02, 0)):
        cells = (scale * blades.outline() / 2 / blades.corner + 1) * 200
        column, row = np.floor(cells).astype(int).T
        seen = (column >= 0) & (column < 400) & (row >= 0) & (row < 400)
        assert np.all(drawn[row[seen], column[seen]] == expected)


def test_a_hexagon_of_area_pi_has_known_corners():
    outline = Blades(6).outline()
    # A = 3√3/2 R², so R = √(2π / (3√3)) = 1.0996361.
    np.testing.assert_allclose(outline[0], [1.0996361, 0], atol=1e-7)
    assert np.linalg.norm(outline, axis=1).max() == pytest.approx(1.0996361, abs=1e-7)
    assert np.linalg.norm(outline, axis=1).min() == pytest.approx(1.0996361 * np.sqrt(3) / 2, abs=1e-6)


def test_straight_and_round_blades_have_the_edges_of_polygons_and_circles():
    # A hexagon of area π / 4 has sides and corners of √(π / (6 √3)).
    assert Blades(6).corner == pytest.approx(0.549818) and Blades(6).edge == pytest.approx(0.549818)
    assert Blades(6).edge_radius == np.inf
    for circle in (Blades(6, 1.0), Blades()):
        assert (circle.corner, circle.edge_radius, circle.edges * circle.edge) == pytest.approx((0.5, 0.5, np.pi))
    assert 6 * Blades(6, 0.5).edge < 6 * Blades(6).edge


def test_half_round_edges_are_arcs_of_half_the_turn():
    # A triangle of curvature ½: every arc turns by 60° about the corner that faces it, Reuleaux's triangle, which is as
    # wide as its arcs' radius in every direction: its perimeter is π times that.
    triangle = Blades(3, 0.5)
    outline = triangle.outline() / 2
    widths = [np.ptp(outline @ (np.cos(turn), np.sin(turn))) for turn in np.linspace(0, np.pi, 7)]
    assert widths == pytest.approx(np.full(7, triangle.edge_radius), rel=1e-4)
    assert 3 * triangle.edge == pytest.approx(np.pi * triangle.edge_radius)
    # Its area is (π − √3) / 2 of that squared.
    assert (np.pi - np.sqrt(3)) / 2 * triangle.edge_radius**2 == pytest.approx(np.pi / 4)


def test_rotation_is_anticlockwise_with_y_down():
    np.testing.assert_allclose(Blades(6, rotation=np.pi / 2).outline()[0], [0, -1.0996361], atol=1e-7)
    assert Blades(3, rotation=0.1).normals == pytest.approx(0.1 + np.array([1, 3, 5]) * np.pi / 3)
    right, up = (Blades(3, rotation=turn).draw(64) for turn in (0.0, np.pi / 2))
    # A triangle's corner points right and its straight edge stands left, at half of the distance.
    assert right[32, 60] == 1 and right[32, 4] == 0
    assert up[4, 32] == 1 and up[60, 32] == 0


def test_round_blades_make_a_disc_and_half_round_ones_lie_between():
    radii = [np.ptp(np.linalg.norm(Blades(5, c).outline(), axis=1)) for c in (0.0, 0.5, 1.0)]
    assert radii[0] > radii[1] > 0.05 and radii[2] < 1e-12
    np.testing.assert_allclose(Blades(5, 1.0).outline(), Blades().outline(), atol=1e-12)
