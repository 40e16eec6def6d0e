"""The colour of light of a temperature, against published chromaticities."""

from __future__ import annotations

import numpy as np
import pytest

from relume.image.colour import luminance
from relume.image.primaries import (
    daylight_chromaticity,
    gains_from_temperature,
    linear_white,
    planckian_chromaticity,
)


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
