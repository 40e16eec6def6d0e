"""Metals by n and k: Fresnel's equations, published colours, and three channels that stand for a spectrum."""

from __future__ import annotations

import numpy as np
import pytest

from relume.scene.materials.materials import Material
from relume.scene.materials.metals import FITTED_AT, METALS, Metal, fresnel, metal_named

COLOURS = {
    # F₀ in linear Rec. 709 from the same measurements, as physicallybased.info prints it.
    "Cu": (0.932, 0.623, 0.522), "CuZn": (0.910, 0.778, 0.423), "Fe": (0.530, 0.513, 0.494),
    "Ni": (0.697, 0.641, 0.563),
}  # fmt: skip


def test_fresnel_is_that_of_a_textbook():
    # At normal incidence ((n − 1)² + k²)/((n + 1)² + k²), at grazing 1; without k a dielectric, Brewster's angle half.
    assert fresnel(np.array(1.0), np.array(0.2), np.array(3.0)) == pytest.approx((0.64 + 9) / (1.44 + 9))
    assert fresnel(np.array(1e-9), np.array(2.0), np.array(1.0)) == pytest.approx(1.0)
    brewster = np.cos(np.arctan(1.5))
    assert fresnel(brewster, np.array(1.5), np.array(0.0)) == pytest.approx(0.5 * ((1.5**2 - 1) / (1.5**2 + 1)) ** 2)


@pytest.mark.parametrize(
    ("symbol", "wavelength", "percent"),
    # ((n − 1)² + k²)/((n + 1)² + k²) by hand from Johnson and Christy's n and k, and from Rakić's.
    [("Au", 548.6, 78.69), ("Au", 659.5, 96.26), ("Ag", 548.6, 98.28), ("Cu", 616.8, 89.97), ("Al", 563.6, 91.48)],
)
def test_reflectances_are_those_of_the_tables(symbol, wavelength, percent):
    found = METALS[symbol].reflectance(np.array(1.0))
    assert 100 * np.interp(wavelength, np.arange(380, 781), found) == pytest.approx(percent, abs=0.06)


@pytest.mark.parametrize("symbol", COLOURS)
def test_colours_are_those_that_others_publish(symbol):
    np.testing.assert_allclose(METALS[symbol].base_color, COLOURS[symbol], atol=0.0015)


def test_gold_is_yellow_silver_nearly_white_and_brass_between_copper_and_gold():
    gold, silver, copper = (METALS[symbol].base_color for symbol in ("Au", "Ag", "Cu"))
    assert gold[0] == 1.0 > gold[1] > 1.9 * gold[2]
    assert min(silver) > 0.97 and silver[0] > silver[2]
    assert copper[0] > copper[1] > copper[2] > 0.5
    # Outside of Rec. 709 before it is brought in: 1.038, 0.728, 0.365.
    np.testing.assert_allclose(METALS["Au"].colour(np.array(1.0)), (1.038, 0.728, 0.365), atol=0.0015)


@pytest.mark.parametrize("symbol", METALS)
def test_three_channels_of_n_and_k_reflect_as_the_spectrum_does_at_every_angle(symbol):
    metal = METALS[symbol]
    eta, k = (np.array(part) for part in metal.eta_k)
    found, truth = fresnel(FITTED_AT[:, None], eta, k), np.clip(metal.colour(FITTED_AT), 0, 1)
    np.testing.assert_allclose(found, truth, atol=0.007)
    # Schlick's approximation, which glTF's metals have, errs by far more for what is not so bright.
    schlick = truth[0] + (1 - truth[0]) * (1 - FITTED_AT[:, None]) ** 5
    if symbol in ("Al", "Cr", "Fe", "Ni", "Pd", "Pt", "Ti", "W"):
        assert np.abs(schlick - truth).max() > 0.1


def test_a_material_has_the_colour_of_its_metal():
    gold = Material(metal=metal_named("gold"), roughness=0.2)
    assert gold.base_color == METALS["Au"].base_color and gold.metallic == 1.0
    assert metal_named("Au") is metal_named("gold")


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: Material((0.5, 0.4, 0.3), metal=METALS["Au"]), "base_color of material '' is given beside a metal"),
        (lambda: Material(metallic=0.5, metal=METALS["Au"]), "metallic of material '' is given beside a metal"),
        (lambda: Material(metallic=np.ones((2, 2)), metal=METALS["Au"]), "metallic of material '' is given beside"),
        (lambda: metal_named("mithril"), r"no metal 'mithril'; there are Ag \(silver\), "),
        (lambda: Metal((400, 700), (1, 2), (3,)), "2 wavelengths, 2 n and 1 k"),
        (lambda: Metal((700, 400), (1, 2), (3, 3)), "do not increase"),
        (lambda: Metal((500, 600), (1, 2), (3, 3)), "from 500 to 600 nm; it is needed from 450 to 650 nm"),
        (lambda: Metal((400, 700), (0, 2), (3, 3)), "an n of 0 or a k below 0"),
    ],
)
def test_what_is_no_metal_is_refused_in_one_line(made, words):
    with pytest.raises(ValueError, match=words):
        made()
