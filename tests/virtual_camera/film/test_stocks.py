"""Generic films and papers: what standards say of them holds exactly."""

import numpy as np
import pytest

from relume.virtual_camera.film.stocks import (
    black_and_white_negative,
    black_and_white_paper,
    colour_negative,
    colour_paper,
    slide_film,
)


@pytest.mark.parametrize("speed", [25.0, 100.0, 400.0, 3200.0])
def test_a_black_and_white_negative_has_its_iso_6_speed_and_contrast(speed):
    film = black_and_white_negative(speed)
    speed_point, later = film.density(np.array([0.8 / speed, 0.8 / speed * 10**1.3]), 0)
    assert speed_point == pytest.approx(0.25 + 0.10, abs=1e-9)
    # ISO 6 asks for a difference of 0.80 ± 0.05.
    assert later - speed_point == pytest.approx(0.793, abs=5e-4)


def test_a_colour_negative_has_its_iso_5800_speed():
    for speed in (100.0, 800.0):
        film = colour_negative(speed)
        for layer in range(3):
            assert film.density(np.array(np.sqrt(2) / speed), layer) == pytest.approx(0.25 + 0.15, abs=1e-9)


def test_a_slide_has_its_iso_2240_speed_and_falls():
    film = slide_film(100.0)
    exposure = np.geomspace(1e-4, 100, 20001)
    density = film.density(exposure, 1)
    assert np.all(np.diff(density) <= 0) and density[0] == pytest.approx(3.2, abs=1e-3)
    light, dark = (np.exp(np.interp(-d, -density, np.log(exposure))) for d in (0.15 + 0.2, 0.15 + 2.0))
    assert np.sqrt(light * dark) == pytest.approx(10 / 100, rel=1e-3)


def test_a_meter_gives_the_exposure_that_iso_2720_and_12232_say():
    # 0.65 · 12.5 / 400, ten times the speed point's exposure
    assert black_and_white_negative(400.0).grey_exposure == pytest.approx(0.0203125)
    assert slide_film(100.0).grey_exposure == pytest.approx(0.08125)


@pytest.mark.parametrize("grade, decades", [(0, 1.55), (1, 1.275), (2, 1.05), (3, 0.875), (4, 0.725), (5, 0.575)])
def test_a_paper_of_each_grade_covers_its_range_of_exposures(grade, decades):
    own = black_and_white_paper(grade)
    assert own.range() == pytest.approx(decades, abs=1e-9)
    first = own.curve.log_exposure(0.05 + 0.04)
    assert own.curve.density(first + decades) == pytest.approx(0.9 * 2.1, abs=1e-9)


def test_harder_papers_are_steeper_and_grade_two_is_as_steep_as_they_say():
    slopes = [black_and_white_paper(g).curve.gamma for g in np.linspace(0, 5, 11)]
    assert np.all(np.diff(slopes) > 0)
    assert 2.0 < black_and_white_paper(2).curve.gamma < 2.6


def test_paper_is_white_without_light_and_prints_grey_where_it_says():
    for own in (black_and_white_paper(1), black_and_white_paper(4), colour_paper()):
        np.testing.assert_allclose(own.reflectance(np.array([-9.0, own.grey_exposure()])), [1.0, 0.18], rtol=1e-6)
        assert own.reflectance(np.array(9.0)) == pytest.approx(10 ** (own.curve.minimum - own.curve.maximum))


def test_grey_light_exposes_all_layers_alike_and_is_seen_alike():
    for film in (black_and_white_negative(), colour_negative(), slide_film()):
        exposures = film.exposures(np.array([0.5, 0.5, 0.5]), 2.0)
        np.testing.assert_allclose(exposures, 1.0)
        density = np.array([film.density(exposures[..., k], k) for k in range(len(film.curves))])
        minima = np.array([curve.minimum for curve in film.curves])
        np.testing.assert_allclose(film.crosstalk @ (density - minima), density - minima)
