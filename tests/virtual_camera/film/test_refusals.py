"""Films, papers and exposures that cannot be are refused, each with what was expected."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from relume.image.photograph import Exposure
from relume.virtual_camera.film.characteristic_curve import CharacteristicCurve
from relume.virtual_camera.film.darkroom import Darkroom
from relume.virtual_camera.film.density_grain import DensityGrain
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.grain import noise_of
from relume.virtual_camera.film.halation import Halation
from relume.virtual_camera.film.stocks import black_and_white_paper, colour_negative, slide_film

CURVE = CharacteristicCurve(gamma=0.7, minimum=0.2, maximum=2.2)
GRAIN, SLIDE, NEGATIVE = DensityGrain(10.0), Darkroom(slide_film(100.0)), colour_negative()
NOISE = partial(noise_of, np.zeros((3, 3, 3, 3)))


@pytest.mark.parametrize(
    ("make", "given", "message"),
    [
        (partial(replace, CURVE), {"gamma": 0.0}, "gamma is 0.0; expected a positive number"),
        (partial(replace, CURVE), {"toe": np.nan}, "toe is nan"),
        (partial(replace, CURVE), {"maximum": 0.1}, "densities from 0.2 to 0.1"),
        (partial(replace, CURVE), {"inertia": np.inf}, "inertia is inf"),
        (partial(replace, GRAIN), {"granularity": 0.0}, "granularity is"),
        (partial(replace, GRAIN), {"clump": -1.0}, "clump is"),
        (partial(replace, GRAIN), {"fog": np.nan}, "fog is"),
        *((Halation, {"share": share}, "share is") for share in ((1.0,), (-0.1,))),
        (Halation, {"thickness": 0.0}, "thickness is"),
        (Halation, {"index": 1.0}, "index is"),
        *(
            (Film, {"exposure": wrong}, r"exposure is .*; expected a positive number")
            for wrong in (0, -1, np.nan, np.inf)
        ),
        (NOISE, {"seed": -1}, "seed is -1; expected 0 or more"),
        (partial(replace, SLIDE), {"exposure": Exposure(0.01)}, "has no f-number"),
        (partial(replace, SLIDE), {"exposure": Exposure(0.01, 8.0, 200.0)}, "at ISO 200 and the film's speed is 100"),
        (partial(replace, SLIDE), {"frame": 0}, "frame is 0"),
        (partial(replace, SLIDE), {"stops": np.nan}, "stops is nan"),
        (partial(replace, NEGATIVE), {"sensitivity": np.ones((1, 3)) / 3}, "3 curves, sensitivity"),
        (partial(replace, NEGATIVE), {"crosstalk": 2 * np.eye(3)}, "rows of crosstalk have the sums"),
        (
            partial(replace, NEGATIVE),
            {"sensitivity": np.array([[1.5, -0.5, 0], [0, 1, 0], [0, 0, 1]])},
            "sensitivity is negative",
        ),
        (partial(replace, NEGATIVE), {"halation": Halation((0.1,))}, "halation has 1 shares and the film 3 layers"),
        (partial(replace, NEGATIVE), {"speed": 0}, "speed is 0"),
        (black_and_white_paper, {"grade": 6}, "the grade is 6; papers come from 0"),
        (black_and_white_paper(2).of_range, {"decades": 0.0}, r"a range of 0\.0 decades"),
    ],
)
def test_what_cannot_be_is_refused(make, given, message):
    with pytest.raises(ValueError, match=message):
        make(**given)


def test_an_exposure_at_the_films_own_speed_is_none_of_these():
    assert replace(SLIDE, exposure=Exposure(0.01, 8.0, 100.0)).exposure
