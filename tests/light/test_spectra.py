"""Spectra: the CIE's chromaticities, Planck's law, colours of lamps, files, and the wavelengths of paths."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.image.colour import LUMINANCE_WEIGHTS
from relume.image.primaries import REC709
from relume.light.spectra.hero import STRATA, strata
from relume.light.spectra.lamps import lamp_colour, read_spectrum
from relume.light.spectra.reflectance import colour_of, primaries, white_matching
from relume.light.spectra.spectrum import Spectrum, blackbody, illuminant, rgb_matching, visible
from relume.light.spectra.tables import COLOUR_MATCHING, ILLUMINANTS, PRIMARIES, table


def chromaticity(spectrum: Spectrum) -> np.ndarray:
    found = REC709.to_xyz() @ (spectrum.at(visible()) @ rgb_matching())
    return found[:2] / found.sum()


@pytest.mark.parametrize(
    ("name", "x", "y"),
    [
        # CIE 15:2018, tables T.3 and T.10, and ISO/CIE 11664-2.
        ("A", 0.44758, 0.40745), ("D50", 0.34567, 0.35851), ("D65", 0.31272, 0.32903), ("E", 0.33333, 0.33333),
        ("F2", 0.3721, 0.3751), ("F11", 0.3805, 0.3769), ("LED-B1", 0.4560, 0.4078), ("LED-B3", 0.3756, 0.3723),
        ("LED-B5", 0.3118, 0.3236), ("LED-RGB1", 0.4557, 0.4211), ("LED-V1", 0.4548, 0.4044), ("HP1", 0.5330, 0.4150),
    ],
)  # fmt: skip
def test_illuminants_have_the_cies_chromaticities(name, x, y):
    # Of five-nanometre tables in between which is linear; the lines of lamps are a little wider so.
    np.testing.assert_allclose(chromaticity(illuminant(name)), (x, y), atol=8e-4)


def test_a_radiator_follows_planck():
    # The peak by Wien's displacement, 2.897771955e-3 m K, and σT⁴/π would need all wavelengths: two values of the law.
    hot = blackbody(5000.0)
    assert visible()[int(np.argmax(hot.values))] == pytest.approx(2.897771955e6 / 5000, abs=1)
    # 2hc²/λ⁵/(exp(hc/λkT) − 1) at 500 nm and 5000 K, in W/(m² sr nm).
    assert float(hot.at(np.array(500.0))) == pytest.approx(12107.19, rel=2e-4)
    # Its chromaticity is that of the Planckian locus: CIE A's is 2856 K by today's constants.
    np.testing.assert_allclose(chromaticity(blackbody(2855.5)), (0.44758, 0.40745), atol=3e-4)


def test_the_tables_begin_and_end_as_published():
    for text, columns in ((COLOUR_MATCHING, 3), (ILLUMINANTS, 10), (PRIMARIES, 3)):
        rows = table(text)
        assert rows.shape == (81, 1 + columns)
        np.testing.assert_array_equal(rows[:, 0], np.arange(380, 785, 5))
    matching = table(COLOUR_MATCHING)
    np.testing.assert_array_equal(matching[35], (555, 0.51205, 1.0, 0.00575))  # ȳ is 1 at 555 nm
    assert table(ILLUMINANTS)[36, 2] == 100  # D65 at 560 nm


def test_white_and_the_primaries_come_back_exactly():
    np.testing.assert_allclose(colour_of(np.ones(401)), 1, rtol=1e-12)
    np.testing.assert_allclose(white_matching().T @ primaries(), np.eye(3), atol=1e-12)
    np.testing.assert_allclose(primaries().sum(axis=1), 1, rtol=1e-12)
    assert primaries().min() > 0
    # No wavelength alone is within Rec. 709.
    assert np.all(white_matching()[40:300].min(axis=1) < 0)


def test_paths_of_all_wavelengths_add_up_to_the_light():
    ends, weights, shares = strata()
    assert ends[0] == 380 and ends[-1] == 780 and np.all(np.diff(ends) > 0)
    np.testing.assert_allclose(weights.mean(axis=0), 1, rtol=1e-12)
    np.testing.assert_allclose(weights.T @ shares / STRATA, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(shares.sum(axis=1), 1, rtol=1e-12)
    # Each stratum has the colour of its wavelength: red at 640 nm, green at 530, blue at 450.
    for channel, wavelength in enumerate((640, 530, 450)):
        assert weights[np.searchsorted(ends, wavelength)].argmax() == channel


def test_a_lamp_is_as_bright_as_it_is_said_to_be_and_yellower_than_daylight():
    for spectrum in (illuminant("A"), blackbody(3000), illuminant("F11"), illuminant("LED-B3")):
        colour = np.array(lamp_colour(spectrum, 250.0))
        assert colour @ LUMINANCE_WEIGHTS == pytest.approx(250.0, rel=1e-4)
        assert colour[0] > colour[1] > colour[2] > 0
    np.testing.assert_allclose(lamp_colour(illuminant("D65")), 1, atol=1e-3)
    # Illuminant A by its chromaticity, X/Y = x/y and Z/Y = (1 − x − y)/y, and the inverse of IEC 61966-2-1's matrix.
    to_rgb = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    expected = to_rgb @ (0.44758 / 0.40745, 1, 0.14497 / 0.40745)
    np.testing.assert_allclose(lamp_colour(illuminant("A")), expected, atol=2e-3)


def test_a_colour_outside_of_rec_709_is_brought_in_with_a_warning_and_stays_as_bright():
    with pytest.warns(UserWarning, match="outside of Rec. 709"):
        colour = np.array(lamp_colour(Spectrum((585.0, 590.0, 595.0), (0.0, 1.0, 0.0)), 3.0))
    assert colour.min() == 0 and colour @ LUMINANCE_WEIGHTS == pytest.approx(3.0, rel=1e-4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lamp_colour(blackbody(2500))


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: illuminant("D93"), "no illuminant 'D93'; there are A, D50, D65"),
        (lambda: blackbody(20), "the temperature is 20 K"),
        (lambda: Spectrum((400, 500), (1, 2, 3)), "2 wavelengths and 3 values"),
        (lambda: Spectrum((500, 400), (1, 2)), "do not increase"),
        (lambda: Spectrum((400, 500), (1, -2)), "below 0"),
        (lambda: Spectrum((0.4, 0.7), (1, 2)), "nothing of a spectrum from 0.4 to 0.7 is seen"),
        (lambda: lamp_colour(illuminant("A"), -1), "luminance of a lamp is -1"),
        (lambda: lamp_colour(Spectrum((400, 500), (0, 0))), "has no light"),
    ],
)
def test_what_is_no_spectrum_is_refused_in_one_line(made, words):
    with pytest.raises(ValueError, match=words):
        made()


@pytest.mark.parametrize(
    "text",
    [
        "wavelength,power\n380,1\n500,3\n780,2\n",
        "# an instrument\nnm;W\n500;3\n380;1\n780;2",
        "380 1\n500\t3\n780   2 # the last\n\n",
    ],
)
def test_files_of_spectra_are_read(tmp_path, text):
    (tmp_path / "lamp.csv").write_text(text)
    found = read_spectrum(tmp_path / "lamp.csv")
    assert found == Spectrum((380, 500, 780), (1, 3, 2))
    assert float(found.at(np.array(440.0))) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has 0 lines of numbers"),
        ("380,1\n", "has 1 lines of numbers"),
        ("380,1,2\n400,2,3\n", "line 1 has 3 numbers"),
        ("380,1\n400,two\n", "line 2 is '400,two'"),
        ("380,1\n380,2\n", "do not increase"),
        ("380,nan\n780,2\n", "not finite"),
    ],
)
def test_files_that_hold_none_are_refused_by_line(tmp_path, text, words):
    (tmp_path / "lamp.csv").write_text(text)
    with pytest.raises(UnreadableFile, match=words):
        read_spectrum(tmp_path / "lamp.csv")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(UnreadableFile, match="no such spectrum"):
        read_spectrum(tmp_path / "none.csv")
    (tmp_path / "picture.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(UnreadableFile, match="is it a text file"):
        read_spectrum(tmp_path / "picture.csv")
