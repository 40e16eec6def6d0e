"""Iris openings: their areas, corners and turns."""

import numpy as np
import pytest

from relume.develop.lens.blade_shapes import Blades


def area(outline):
    x, y = outline.T
    return abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2


@pytest.mark.parametrize("blades", [Blades(), Blades(3), Blades(5, 0.5, 0.3), Blades(9, 1.0), Blades(7, 0.2)])
def test_openings_of_one_f_number_have_one_area(blades):
    assert area(blades.outline()) == pytest.approx(np.pi, rel=1e-12)
    assert np.abs(blades.outline().mean(0)).max() < 1e-9


def test_a_hexagon_of_area_pi_has_known_corners():
    outline = Blades(6).outline()
    # A = 3√3/2 R², so R = √(2π / (3√3)) = 1.0996361.
    np.testing.assert_allclose(outline[0], [1.0996361, 0], atol=1e-7)
    assert np.linalg.norm(outline, axis=1).max() == pytest.approx(1.0996361, abs=1e-7)
    assert np.linalg.norm(outline, axis=1).min() == pytest.approx(1.0996361 * np.sqrt(3) / 2, abs=1e-6)


def test_rotation_is_anticlockwise_with_y_down():
    np.testing.assert_allclose(Blades(6, rotation=np.pi / 2).outline()[0], [0, -1.0996361], atol=1e-7)


def test_round_blades_make_a_disc_and_half_round_ones_lie_between():
    radii = [np.ptp(np.linalg.norm(Blades(5, c).outline(), axis=1)) for c in (0.0, 0.5, 1.0)]
    assert radii[0] > radii[1] > 0.05 and radii[2] < 1e-12
    np.testing.assert_allclose(Blades(5, 1.0).outline(), Blades().outline(), atol=1e-12)


@pytest.mark.parametrize(
    ("fields", "message"),
    [((2,), "at least 3"), ((-1,), "at least 3"), ((5, 1.5), "curvature"), ((5, 0, np.nan), "rotation")],
)
def test_what_is_no_iris_is_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        Blades(*fields)
