"""Generic films and papers: typical of what makers publish for each kind, and no maker's own.

Speeds hold exactly by their standards. Slopes, fog, greatest densities and granularities are round numbers from within
the ranges of published data sheets.
"""

from __future__ import annotations

import numpy as np

from relume.virtual_camera.film.characteristic_curve import CharacteristicCurve
from relume.virtual_camera.film.density_grain import DensityGrain
from relume.virtual_camera.film.halation import Halation
from relume.virtual_camera.film.negative import FilmStock, Paper

GRADES = (1.55, 1.275, 1.05, 0.875, 0.725, 0.575)
"""Decades of exposure that papers of grade 0 (very soft) to 5 (extra hard) cover: the middles of ANSI PH2.2-1966's
ranges, 1.70, 1.40, 1.15, 0.95, 0.80, 0.65 and 0.50."""

FASTER = 0.4
"""Power of its speed with which a film's granularity goes, among films of one kind."""


def black_and_white_negative(speed: float = 400.0) -> FilmStock:
    """A panchromatic negative, developed to the contrast of ISO 6: 0.79 of density in 1.30 decades, of 0.80 ± 0.05.

    speed : ISO 6, S = 0.8 / H_m with H_m the exposure that gives 0.1 above fog; 400 is the usual all-purpose
        film. Faster films are grainier: granularity is 9 at 100, 16 at 400 and 37 at 3200, as it is published within
        a few units
    """
    curve = CharacteristicCurve(gamma=0.68, minimum=0.25, maximum=2.3, toe=0.2, shoulder=0.25)
    curve = curve.through(np.log10(0.8 / speed), curve.minimum + 0.1)
    grain = DensityGrain(16 * (speed / 400) ** FASTER, clump=2.5)
    # Silver halide is by nature sensitive to blue; dyes add green and, less, red.
    return FilmStock(
        speed, np.array([[0.28, 0.38, 0.34]]), (curve,), np.eye(1), grain, Halation((0.01,)), reversal=False
    )


def colour_negative(speed: float = 400.0) -> FilmStock:
    """A colour negative, its orange mask printed away.

    speed : ISO 5800, S = √2 / H_m with H_m the exposure that gives 0.15 above the minimum; with layers alike, any's
    """
    curve = CharacteristicCurve(gamma=0.62, minimum=0.25, maximum=2.6, toe=0.2, shoulder=0.3)
    curve = curve.through(np.log10(np.sqrt(2) / speed), curve.minimum + 0.15)
    sensitivity = np.array([[0.90, 0.09, 0.01], [0.06, 0.88, 0.06], [0.01, 0.09, 0.90]])
    crosstalk = np.array([[1.12, -0.09, -0.03], [-0.06, 1.12, -0.06], [-0.03, -0.09, 1.12]])
    # Clouds of dye are larger than specks of silver and thinner.
    grain = DensityGrain(6 * (speed / 400) ** FASTER, clump=3.5)
    return FilmStock(speed, sensitivity, (curve,) * 3, crosstalk, grain, Halation())


def slide_film(speed: float = 100.0) -> FilmStock:
    """A colour reversal film, to be projected: look at it without paper.

    speed : ISO 2240, S = 10 / H_m with H_m the geometric mean of the exposures that leave 0.2 and 2.0 above the minimum
    """
    curve = CharacteristicCurve(gamma=1.8, minimum=0.15, maximum=3.2, toe=0.18, shoulder=0.2)
    # Turned round, 0.2 above the minimum is 0.2 below the maximum.
    light, dark = (float(curve.log_exposure(curve.maximum - above)) for above in (0.2, 2.0))
    curve = curve.through(np.log10(10 / speed) + (dark - light) / 2, curve.maximum - 2.0)
    sensitivity = np.array([[0.92, 0.07, 0.01], [0.04, 0.92, 0.04], [0.01, 0.07, 0.92]])
    crosstalk = np.array([[1.10, -0.07, -0.03], [-0.05, 1.10, -0.05], [-0.03, -0.07, 1.10]])
    grain = DensityGrain(9 * (speed / 100) ** FASTER, clump=2.5)
    return FilmStock(speed, sensitivity, (curve,) * 3, crosstalk, grain, Halation(), reversal=True)


def black_and_white_paper(grade: float = 2.0) -> Paper:
    """A black-and-white paper; 2 is the normal grade, for which negatives of ISO 6's contrast are made.

    grade : 0 to 5; halves and others as of papers of variable contrast
    Raises ValueError for a grade outside of that.
    """
    if not 0 <= grade <= len(GRADES) - 1:
        raise ValueError(f"the grade is {grade:g}; papers come from 0, very soft, to 5, extra hard")
    # By the logarithm of their ranges, so that each step hardens by the same kind of factor.
    decades = np.exp(np.interp(grade, np.arange(len(GRADES)), np.log(GRADES)))
    curve = CharacteristicCurve(gamma=1.0, minimum=0.05, maximum=2.1, toe=0.25, shoulder=0.25)
    return Paper(curve).of_range(float(decades))


def colour_paper() -> Paper:
    """A paper for colour negatives: steeper than grade 2 for their flatter curves, with deeper blacks of dye."""
    curve = CharacteristicCurve(gamma=1.0, minimum=0.08, maximum=2.4, toe=0.25, shoulder=0.3)
    return Paper(curve).of_range(1.1)
