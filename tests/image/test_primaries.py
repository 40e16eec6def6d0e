"""Primaries: matrices as the standards print them, neutrals that stay neutral, and triangles that are none."""

import numpy as np
import pytest

from relume.image.primaries import EQUAL_ENERGY, REC709, Primaries, adaptation, between, converted, mixed
from relume.image.radiance import RadianceMap

REC2020 = Primaries((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), (0.3127, 0.3290))
# XYZ of ASTM E308, of which Lindbloom's tables are made.
D50, D65 = ((x / (x + 1 + z), 1 / (x + 1 + z)) for x, z in ((0.96422, 0.82521), (0.95047, 1.08883)))
PROPHOTO = Primaries((0.7347, 0.2653), (0.1596, 0.8404), (0.0366, 0.0001), D50)
ACES = Primaries((0.7347, 0.2653), (0, 1), (0.0001, -0.077), (0.32168, 0.33767))


def test_rec_709_to_xyz_is_that_of_iec_61966():
    printed = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    np.testing.assert_allclose(REC709.to_xyz(), printed, rtol=0, atol=6e-5)


def test_rec_709_to_2020_is_that_of_bt_2087():
    printed = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
    np.testing.assert_allclose(between(REC709, REC2020), printed, rtol=0, atol=6e-5)


def test_rec_2020_to_709_is_that_of_bt_2407():
    printed = [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
    np.testing.assert_allclose(between(REC2020, REC709), printed, rtol=0, atol=6e-5)


def test_the_bradford_matrix_is_lindblooms():
    printed = [
        [0.9555766, -0.0230393, 0.0631636],
        [-0.0282895, 1.0099416, 0.0210077],
        [0.0122982, -0.0204830, 1.3299098],
    ]
    np.testing.assert_allclose(adaptation(D50, D65), printed, rtol=0, atol=2e-7)
    np.testing.assert_allclose(adaptation(D50, D65) @ adaptation(D65, D50), np.eye(3), rtol=0, atol=1e-14)


def test_prophoto_to_xyz_is_lindblooms():
    printed = [[0.7976749, 0.1351917, 0.0313534], [0.2880402, 0.7118741, 0.0000857], [0, 0, 0.8252100]]
    np.testing.assert_allclose(PROPHOTO.to_xyz(), printed, rtol=0, atol=2e-7)


def test_aces_to_xyz_is_that_of_st_2065_1():
    printed = [
        [0.9525523959, 0, 0.0000936786],
        [0.3439664498, 0.7281660966, -0.0721325464],
        [0, 0, 1.0088251844],
    ]
    np.testing.assert_allclose(ACES.to_xyz(), printed, rtol=0, atol=2e-10)


@pytest.mark.parametrize("given", [REC709, REC2020, PROPHOTO, ACES])
@pytest.mark.parametrize("wanted", [REC709, REC2020, PROPHOTO, ACES])
def test_white_stays_white_and_the_way_back_is_the_inverse(given, wanted):
    there = between(given, wanted)
    np.testing.assert_allclose(there.sum(1), 1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(between(wanted, given) @ there, np.eye(3), rtol=0, atol=1e-11)


def test_white_has_a_luminance_of_one():
    for primaries in (REC709, REC2020, PROPHOTO, ACES):
        assert primaries.to_xyz()[1].sum() == pytest.approx(1, abs=1e-12)


def test_equal_energy_adapts_to_its_own_xyz():
    np.testing.assert_allclose(adaptation(EQUAL_ENERGY, REC709.white) @ np.ones(3), [0.95046, 1, 1.08906], atol=1e-5)


def test_the_same_white_needs_no_adaptation():
    assert (adaptation(REC709.white, (0.31271, 0.32902)) == np.eye(3)).all()
    assert (adaptation(REC709.white, (0.3123, 0.3290)) != np.eye(3)).any()


def test_a_white_that_differs_in_its_last_digit_still_goes_to_white():
    nearly = Primaries(REC2020.red, REC2020.green, REC2020.blue, (0.3128, 0.3291))
    np.testing.assert_allclose(between(nearly, REC709).sum(1), 1, rtol=0, atol=1e-12)


def test_a_saturated_colour_gets_a_negative_channel_and_is_not_clipped():
    image = RadianceMap(np.array([[[0, 2, 0]]], np.float32), unit="cd/m²", attributes={"camera": "box"})
    found = converted(image, REC2020, REC709)
    np.testing.assert_allclose(found.radiance, [[[-1.1752, 2.2658, -0.2012]]], rtol=0, atol=2e-4)
    assert (found.unit, found.attributes, found.radiance.dtype) == ("cd/m²", {"camera": "box"}, np.float32)


def test_variance_goes_with_the_squares():
    image = RadianceMap(np.ones((1, 1, 3), np.float32), variance=np.array([[[1, 4, 9]]], np.float32))
    found = converted(image, REC2020, REC709).variance
    assert found is not None
    matrix = between(REC2020, REC709)
    draws = np.random.default_rng(2).normal(1, [1, 2, 3], (400_000, 3)) @ matrix.T
    np.testing.assert_allclose(found[0, 0], draws.var(0), rtol=0.01)


def test_mixing_is_one_row_of_the_matrix_a_channel(numbered):
    matrix = np.array([[0.0, 1, 0], [0, 0, 2], [1, 1, 1]])
    found = mixed(numbered, matrix)
    np.testing.assert_array_equal(found[..., 0], numbered[..., 1])
    np.testing.assert_array_equal(found[..., 1], 2 * numbered[..., 2])
    np.testing.assert_array_equal(found[..., 2], numbered.sum(2))


def test_numbers_and_text_come_back():
    numbers = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329]
    assert Primaries.of(numbers) == REC709
    assert Primaries.of(np.array(numbers, np.float32).reshape(4, 2)).is_close(REC709)
    assert REC709.values == tuple(numbers)
    assert REC709.text == "0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329"


def test_three_digits_are_close_and_four_thousandths_are_not():
    assert Primaries((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.313, 0.329)).is_close(REC709)
    assert not Primaries((0.644, 0.33), (0.30, 0.60), (0.15, 0.06), (0.3127, 0.329)).is_close(REC709)
    assert not REC2020.is_close(REC709)


@pytest.mark.parametrize("count", [0, 6, 9])
def test_other_than_eight_numbers_are_refused(count):
    with pytest.raises(ValueError, match=f"{count} numbers; primaries are eight"):
        Primaries.of([0.3] * count)


@pytest.mark.parametrize(
    "numbers",
    [
        [0] * 8,  # Photoshop's: it does not say
        [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0],  # white of no luminance
        [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, -0.329],
        [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.7, 0.25],  # white outside the triangle
        [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.47, 0.465],  # and on its edge
        [0.6, 0.3, 0.3, 0.3, 0.1, 0.3, 0.3, 0.3],  # a line
        [0.64, 0.33, 0.64, 0.33, 0.15, 0.06, 0.3, 0.3],  # two alike
        [np.nan, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329],
        [0.64, 0.33, 0.3, np.inf, 0.15, 0.06, 0.3127, 0.329],
        [1e300, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329],
        [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 5e-324],
    ],
)
def test_a_triangle_that_holds_no_white_is_refused(numbers):
    with pytest.raises(ValueError, match=r"the primaries are .*; white must lie within the triangle"):
        Primaries.of(numbers)
