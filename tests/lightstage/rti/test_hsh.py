"""Hemispherical harmonics: the functions of the viewers, the fit, and .rti files."""

import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from relume.image import files
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.lightstage.rti.hemisphere_fit import STEADINESS
from relume.lightstage.rti.hsh import HemisphericalHarmonics, fit_hsh, hemispherical_terms, write_hsh
from written_by_stages import read_hsh

PHOTOGRAPHS = Path(__file__).resolve().parents[4] / "shared" / "data" / "olat" / "uw_psm"
FINE = even_directions(200_000)
FINE = FINE[FINE[:, 2] > 0]
DOME = even_directions(120)
DOME = DOME[DOME[:, 2] > 0.1]


def some_harmonics(degree: int) -> HemisphericalHarmonics:
    coefficients = np.random.default_rng(degree).uniform(-0.2, 0.2, (4, 5, 3, (degree + 1) ** 2))
    coefficients[..., 0] += 1.2
    return HemisphericalHarmonics(coefficients.astype(np.float32))


def test_the_functions_are_orthonormal_over_the_hemisphere():
    terms = hemispherical_terms(FINE, 3)
    np.testing.assert_allclose(terms.T @ terms * (2 * np.pi / len(FINE)), np.eye(16), atol=2e-4)


def test_the_functions_are_those_of_the_viewers():
    # θ = 60°, φ = 30°: RTIViewer's formulas, written out for cos θ = ½, where cos θ − cos² θ is ¼ and 2 cos θ − 1 is 0.
    towards = np.array([np.sqrt(0.75) * np.cos(np.pi / 6), np.sqrt(0.75) * np.sin(np.pi / 6), 0.5])
    expected = [
        1 / np.sqrt(2 * np.pi),
        np.sqrt(6 / np.pi) * np.cos(np.pi / 6) / 2, 0, np.sqrt(6 / np.pi) * 0.5 / 2,
        -np.sqrt(30 / np.pi) * np.cos(np.pi / 3) / 4, 0, -np.sqrt(5 / (2 * np.pi)) / 2, 0,
        -np.sqrt(30 / np.pi) * np.sin(np.pi / 3) / 4,
        0, 0, -2 * np.sqrt(21 / np.pi) * np.cos(np.pi / 6) / 2 / 4, 0,
        -2 * np.sqrt(21 / np.pi) * 0.5 / 2 / 4, 0, 2 * np.sqrt(35 / np.pi) / 8,
    ]  # fmt: skip
    np.testing.assert_allclose(hemispherical_terms(towards, 3), expected, atol=1e-12)
    # And nearer to the camera, where no term of degree 2 is 0: φ = 90°, cos θ = 0.9.
    towards = np.array([0, np.sqrt(0.19), 0.9])
    found = hemispherical_terms(towards, 3)
    assert found[2] == pytest.approx(np.sqrt(3 / (2 * np.pi)) * 0.8)
    assert found[7] == pytest.approx(np.sqrt(30 / np.pi) * 0.8 * 0.3)
    assert found[4] == pytest.approx(np.sqrt(30 / np.pi) * 0.09)
    assert found[10] == pytest.approx(np.sqrt(210 / np.pi) * 0.8 * 0.09)
    assert found[12] == pytest.approx(np.sqrt(7 / (2 * np.pi)) * (-1 + 10.8 - 24.3 + 14.58))


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_exact_harmonics_come_back(degree):
    harmonics = some_harmonics(degree)
    pictures = np.stack([harmonics.lit_from(towards) for towards in DOME])
    found = fit_hsh(pictures, DOME, degree, steadiness=0)
    np.testing.assert_allclose(found.coefficients, harmonics.coefficients, atol=2e-5)
    assert np.abs(fit_hsh(pictures, DOME, degree).coefficients - harmonics.coefficients).max() < 0.05


@pytest.mark.skipif(not PHOTOGRAPHS.is_dir(), reason="the photographs are not here")
def test_nine_harmonics_of_twelve_photographs_survive_their_file(tmp_path):
    # Twelve lights near the camera leave mixes of nine harmonics nearly open.
    lights = np.array([line.split() for line in (PHOTOGRAPHS / "lights.txt").read_text().splitlines()[1:13]], float)
    lights /= np.linalg.norm(lights, axis=1, keepdims=True)
    paths = [PHOTOGRAPHS / "gray" / f"gray.{number}.png" for number in range(12)]
    pictures = np.stack([files.read_photograph(path).pixels[::4, ::4] for path in paths]).astype(np.float32) / 255
    ball = files.read_photograph(PHOTOGRAPHS / "gray" / "gray.mask.png").pixels[::4, ::4, 0] > 128

    def error(fit: HemisphericalHarmonics, numbers: Iterable[int]) -> float:
        shown = [np.clip(fit.lit_from(lights[i]), 0, 1) - pictures[i] for i in numbers]
        return float(np.sqrt(np.mean(np.square(shown)[:, ball])))

    def of_file(steadiness: float) -> float:
        write_hsh(tmp_path / "a.rti", fit_hsh(pictures, lights, 2, steadiness=steadiness))
        return error(read_hsh(tmp_path / "a.rti"), range(12))

    def without_one(steadiness: float) -> float:
        errors = []
        for i in range(12):
            rest = np.arange(12) != i
            errors.append(error(fit_hsh(pictures[rest], lights[rest], 2, steadiness=steadiness), [i]))
        return float(np.sqrt(np.mean(np.square(errors))))

    assert of_file(STEADINESS) < 0.015 < 0.03 < of_file(0)
    assert without_one(STEADINESS) < 0.05 < 0.09 < without_one(0)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_files_come_back_to_the_quantisation(tmp_path, degree):
    harmonics = some_harmonics(degree)
    write_hsh(tmp_path / "a.rti", harmonics)
    back = read_hsh(tmp_path / "a.rti")
    spread = np.ptp(harmonics.coefficients, axis=(0, 1, 2))
    assert back.degree == degree and back.coefficients.shape[:2] == (4, 5)
    assert np.all(np.abs(back.coefficients - harmonics.coefficients).max(axis=(0, 1, 2)) < 0.51 / 255 * spread)
    write_hsh(tmp_path / "b.rti", back)
    assert (tmp_path / "b.rti").read_bytes() == (tmp_path / "a.rti").read_bytes()


def test_the_bytes_are_those_that_the_viewers_read(tmp_path):
    coefficients = np.zeros((2, 1, 3, 4), np.float32)
    coefficients[0, 0, 0] = [1, 2, 3, 4]  # the upper pixel's red
    coefficients[1, 0, 2] = [-1, 0, 1, 3.5]  # the lower one's blue
    write_hsh(tmp_path / "a.rti", HemisphericalHarmonics(coefficients))
    content = (tmp_path / "a.rti").read_bytes()
    header = b"#HSH1.2\r\n3\r\n1 2 3\r\n4 2 1\r\n"
    assert content.startswith(header)
    assert struct.unpack_from("<8f", content, len(header)) == (2, 2, 3, 4, -1, 0, 0, 0)
    codes = np.frombuffer(content[len(header) + 32 :], np.uint8).reshape(2, 3, 4)
    # From the upper row down, each channel's terms together.
    assert codes[0].tolist() == [[255, 255, 255, 255], [128, 0, 0, 0], [128, 0, 0, 0]]
    assert codes[1, 2].tolist() == [0, 0, 85, 223]


def test_a_term_that_is_the_same_everywhere_is_kept(tmp_path):
    write_hsh(tmp_path / "a.rti", HemisphericalHarmonics(np.full((2, 2, 3, 4), 0.7, np.float32)))
    back = read_hsh(tmp_path / "a.rti")
    np.testing.assert_allclose(back.coefficients, 0.7, atol=1e-6)


def test_too_few_lights_are_refused():
    with pytest.raises(ValueError, match="degree 2 needs 9 or more"):
        fit_hsh(np.zeros((8, 2, 2, 3), np.float32), DOME[:8])
