"""Glasses by wavelength: the catalogues' indices, Abbe's number, and a material that takes both from its glass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.scene.materials.glasses import C_LINE, D_LINE, F_LINE, GLASSES, Cauchy, Sellmeier, glass_named, of_abbe
from relume.scene.materials.materials import Material

PUBLISHED = {
    # n_d, n_F, n_C and V_d of Schott's data sheets.
    "N-BK7": (1.51680, 1.52238, 1.51432, 64.17),
    "N-BAK4": (1.56883, 1.57591, 1.56575, 55.98),
    "N-LAK9": (1.69100, 1.69979, 1.68716, 54.71),
    "F2": (1.62004, 1.63208, 1.61503, 36.37),
    "SF6": (1.80518, 1.82775, 1.79609, 25.43),
    "SF10": (1.72825, 1.74648, 1.72085, 28.41),
    "SF11": (1.78472, 1.80645, 1.77599, 25.76),
    "N-SF11": (1.78472, 1.80651, 1.77596, 25.68),
    # Malitson 1965, table 1, at the same lines.
    "fused silica": (1.45846, 1.46313, 1.45637, 67.82),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_indices_are_those_of_the_data_sheets(name):
    glass, (n_d, n_f, n_c, abbe) = GLASSES[name], PUBLISHED[name]
    # Printed to five places: half of the last and no more.
    np.testing.assert_allclose(glass.index(np.array([D_LINE, F_LINE, C_LINE])), (n_d, n_f, n_c), atol=1e-5, rtol=0)
    assert glass.n_d == pytest.approx(n_d, abs=1e-5) and glass.abbe == pytest.approx(abbe, abs=0.01)


@pytest.mark.parametrize(
    ("name", "n_d", "abbe"),
    # Handbooks: diamond 2.417, sapphire (o) 1.768, water at 20 °C 1.333, ice 1.309 at the sodium line.
    [("diamond", 2.4175, 55.3), ("sapphire", 1.7682, 72.3), ("water", 1.3334, 55.8), ("ice", 1.3097, 51.9)],
)
def test_crystals_and_water_are_as_handbooks_have_them(name, n_d, abbe):
    assert GLASSES[name].n_d == pytest.approx(n_d, abs=2e-4) and GLASSES[name].abbe == pytest.approx(abbe, abs=0.3)


@pytest.mark.parametrize("name", GLASSES)
def test_all_bend_violet_most(name):
    assert np.all(np.diff(GLASSES[name].index(np.arange(380, 781.0))) < 0)


def test_abbes_number_makes_cauchys_two_coefficients():
    glass = of_abbe(1.5168, 20 / 64.17)
    assert glass.n_d == pytest.approx(1.5168, abs=1e-12) and glass.abbe == pytest.approx(64.17, rel=1e-9)
    # Between the lines it is near the catalogue's own curve.
    lengths = np.linspace(450, 680, 24)
    np.testing.assert_allclose(glass.index(lengths), GLASSES["N-BK7"].index(lengths), atol=4e-4)
    # What would fall below 1 does not.
    assert of_abbe(1.1, 20.0).index(780.0) >= 1


def test_a_material_has_the_index_and_the_dispersion_of_its_glass():
    flint = Material(transmission=1.0, roughness=0.0, glass=GLASSES["SF11"])
    assert flint.ior == GLASSES["SF11"].n_d and flint.dispersion == pytest.approx(20 / 25.76, abs=1e-3)
    assert flint.refraction is GLASSES["SF11"]
    assert replace(flint, roughness=0.2).refraction is GLASSES["SF11"]
    by_number = Material(transmission=1.0, ior=1.6, dispersion=0.5)
    assert by_number.refraction == of_abbe(1.6, 0.5)
    for none in (Material(glass=GLASSES["SF11"]), replace(flint, thin=True), Material(transmission=1.0)):
        assert none.refraction is None


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: Material(ior=1.6, glass=GLASSES["SF11"]), "ior of material '' is given beside a glass"),
        (lambda: Material(dispersion=0.3, glass=GLASSES["SF11"]), "dispersion of material '' is given beside a glass"),
        (lambda: glass_named("BK7"), "no glass 'BK7'; there are N-BK7, "),
        (lambda: Sellmeier((1.0,), (0.1, 0.2)), "1 B and 2 C"),
        (lambda: Sellmeier((), ()), "0 B and 0 C"),
        (lambda: Sellmeier((1.0,), (0.25,)), "no index of refraction from 1 to 10"),
        (lambda: Cauchy(0.9, 0.0), "no index of refraction from 1 to 10"),
        (lambda: Cauchy(1.5, 4000.0), "they belong to wavelengths in µm"),
    ],
)
def test_what_is_no_glass_is_refused_in_one_line(made, words):
    with pytest.raises(ValueError, match=words):
        made()
