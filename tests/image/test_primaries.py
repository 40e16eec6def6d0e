"""Primaries: matrices as the standards print them, neutrals that stay neutral, and triangles that are none; whites."""

import numpy as np
import pytest

from relume.image.colour import luminance
from relume.image.primaries import (
    BT2020,
    EQUAL_ENERGY,
    REC709,
    Primaries,
    adaptation,
    between,
    converted,
    daylight_chromaticity,
    gains_from_temperature,
    linear_white,
    mixed,
    planckian_chromaticity,
)
from relume.image.radiance import RadianceMap

# XYZ of ASTM E308, of which Lindbloom's tables are made.
D50, D65 = ((x / (x + 1 + z), 1 / (x + 1 + z)) for x, z in ((0.96422, 0.82521), (0.95047, 1.08883)))
PROPHOTO = Primaries((0.7347, 0.2653), (0.1596, 0.8404), (0.0366, 0.0001), D50)
ACES = Primaries((0.7347, 0.2653), (0, 1), (0.0001, -0.077), (0.32168, 0.33767))


@pytest.mark.parametrize(
    ("made", "digits", "printed"),
    [
        (REC709.to_xyz(), 4, "0.4124 0.3576 0.1805  0.2126 0.7152 0.0722  0.0193 0.1192 0.9505"),
        (between(REC709, BT2020), 4, "0.6274 0.3293 0.0433  0.0691 0.9195 0.0114  0.0164 0.0880 0.8956"),
        (between(BT2020, REC709), 4, "1.6605 -0.5876 -0.0728  -0.1246 1.1329 -0.0083  -0.0182 -0.1006 1.1187"),
        (
            adaptation(D50, D65),
            7,
            "0.9555766 -0.0230393 0.0631636  -0.0282895 1.0099416 0.0210077  0.0122982 -0.0204830 1.3299098",
        ),
        (PROPHOTO.to_xyz(), 7, "0.7976749 0.1351917 0.0313534  0.2880402 0.7118741 0.0000857  0 0 0.8252100"),
        (ACES.to_xyz(), 10, "0.9525523959 0 0.0000936786  0.3439664498 0.7281660966 -0.0721325464  0 0 1.0088251844"),
    ],
    ids=["IEC 61966", "BT.2087", "BT.2407", "Lindbloom's Bradford", "Lindbloom's ProPhoto", "ST 2065-1"],
)
def test_matrices_are_as_they_are_printed(made, digits, printed):
    bound = {4: 6e-5, 7: 2e-7, 10: 2e-10}[digits]
    np.testing.assert_allclose(made, np.array(printed.split(), float).reshape(3, 3), rtol=0, atol=bound)


def test_an_adaptation_has_its_way_back():
    np.testing.assert_allclose(adaptation(D50, D65) @ adaptation(D65, D50), np.eye(3), rtol=0, atol=1e-14)


@pytest.mark.parametrize("given", [REC709, BT2020, PROPHOTO, ACES])
@pytest.mark.parametrize("wanted", [REC709, BT2020, PROPHOTO, ACES])
def test_white_stays_white_and_the_way_back_is_the_inverse(given, wanted):
    there = between(given, wanted)
    np.testing.assert_allclose(there.sum(1), 1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(between(wanted, given) @ there, np.eye(3), rtol=0, atol=1e-11)


def test_white_has_a_luminance_of_one():
    for primaries in (REC709, BT2020, PROPHOTO, ACES):
        assert primaries.to_xyz()[1].sum() == pytest.approx(1, abs=1e-12)


def test_equal_energy_adapts_to_its_own_xyz():
    np.testing.assert_allclose(adaptation(EQUAL_ENERGY, REC709.white) @ np.ones(3), [0.95046, 1, 1.08906], atol=1e-5)


def test_the_same_white_needs_no_adaptation():
    assert (adaptation(REC709.white, (0.31271, 0.32902)) == np.eye(3)).all()
    assert (adaptation(REC709.white, (0.3123, 0.3290)) != np.eye(3)).any()


def test_a_white_that_differs_in_its_last_digit_still_goes_to_white():
    nearly = Primaries(BT2020.red, BT2020.green, BT2020.blue, (0.3128, 0.3291))
    np.testing.assert_allclose(between(nearly, REC709).sum(1), 1, rtol=0, atol=1e-12)


def test_a_saturated_colour_gets_a_negative_channel_and_is_not_clipped():
    image = RadianceMap(np.array([[[0, 2, 0]]], np.float32), unit="cd/m²", attributes={"camera": "box"})
    found = converted(image, between(BT2020, REC709), BT2020)
    np.testing.assert_allclose(found.radiance, [[[-1.1752, 2.2658, -0.2012]]], rtol=0, atol=2e-4)
    assert (found.unit, found.radiance.dtype) == ("cd/m²", np.float32)
    assert found.attributes == {"camera": "box", "primaries": "0.708 0.292 0.17 0.797 0.131 0.046 0.3127 0.329"}


def test_variance_goes_with_the_squares():
    image = RadianceMap(np.ones((1, 1, 3), np.float32), variance=np.array([[[1, 4, 9]]], np.float32))
    found = converted(image, between(BT2020, REC709), BT2020).variance
    assert found is not None
    matrix = between(BT2020, REC709)
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
    assert not BT2020.is_close(REC709)


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


@pytest.mark.parametrize(
    ("kelvin", "xy"),
    [(5003, (0.3457, 0.3585)), (5503, (0.3324, 0.3474)), (6504, (0.3127, 0.3290)), (7504, (0.2990, 0.3149))],
)
def test_daylight_is_that_of_the_cie_illuminants(kelvin: float, xy: tuple[float, float]) -> None:
    """D50, D55, D65 and D75, CIE 15:2018, table 1."""
    assert daylight_chromaticity(kelvin) == pytest.approx(xy, abs=1.5e-4)


@pytest.mark.parametrize(
    ("kelvin", "xy"), [(2000, (0.5267, 0.4133)), (2856, (0.4476, 0.4074)), (4000, (0.3805, 0.3768))]
)
def test_black_bodies_are_where_planck_puts_them(kelvin: float, xy: tuple[float, float]) -> None:
    """Illuminant A among them; Krystek's fit is good to 1e-4 in (u, v), some 4e-4 in y."""
    assert planckian_chromaticity(kelvin) == pytest.approx(xy, abs=4e-4)


def test_white_is_the_primaries_own() -> None:
    assert linear_white((0.3127, 0.3290)) == pytest.approx([1, 1, 1], abs=1e-12)
    # A primary's chromaticity is that channel alone, at the luminance of its weight's inverse.
    assert linear_white((0.64, 0.33)) == pytest.approx([1 / 0.2126, 0, 0], abs=2e-3)


@pytest.mark.parametrize("kelvin", [2000.0, 3200.0, 3999.0, 4000.0, 5600.0, 6504.0, 12000.0, 25000.0])
def test_gains_make_that_light_neutral_and_keep_its_luminance(kelvin: float) -> None:
    chromaticity = daylight_chromaticity(kelvin) if kelvin >= 4000 else planckian_chromaticity(kelvin)
    white = linear_white(chromaticity)
    made = white * gains_from_temperature(kelvin)
    assert made == pytest.approx(np.full(3, made[0]), rel=1e-12)
    assert float(luminance(made)) == pytest.approx(float(luminance(white)), rel=1e-12)


def test_daylight_needs_nothing_and_lamps_need_blue() -> None:
    assert gains_from_temperature(6504) == pytest.approx((1, 1, 1), abs=1e-3)
    red, green, blue = gains_from_temperature(3200)
    assert red < green < blue and blue > 2.5
    red, green, blue = gains_from_temperature(10000)
    assert blue < green < red


def test_temperatures_beyond_the_loci_are_refused() -> None:
    for kelvin in (1999.0, 25001.0, float("nan")):
        with pytest.raises(ValueError, match="2000 to 25000"):
            gains_from_temperature(kelvin)
    with pytest.raises(ValueError, match="4000"):
        daylight_chromaticity(3000)
    with pytest.raises(ValueError, match="1000"):
        planckian_chromaticity(20000)
