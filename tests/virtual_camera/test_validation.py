"""What may be developed: bad radiance is named, repaired when asked, and never passed on."""

import numpy as np
import pytest

from relume.image.radiance import RadianceMap
from relume.virtual_camera.validation import validate_radiance


def flat(value: float = 0.5) -> np.ndarray:
    return np.full((6, 8, 3), value, np.float32)


def test_a_sound_picture_is_itself():
    picture = RadianceMap(flat())
    assert validate_radiance(picture) is picture


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_by_its_place(value):
    radiance = flat()
    radiance[4, 3, 1] = value
    with pytest.raises(ValueError, match=r"plate\.exr: the radiance at x 3, y 4 is .* 0 more pixels") as caught:
        validate_radiance(RadianceMap(radiance), name="plate.exr")
    assert "\n" not in str(caught.value)


def test_repair_takes_nan_from_what_is_about_it_and_infinity_from_the_brightest():
    radiance = flat(0.25)
    radiance[2, 2] = np.nan
    radiance[2, 3] = np.nan
    radiance[5, 7, 0] = np.inf
    radiance[0, 0] = 3.0
    with pytest.warns(UserWarning, match=r"2 pixels that were no number .* 1 infinite ones .* 3$"):
        repaired = validate_radiance(RadianceMap(radiance), repair=True).radiance
    assert np.array_equal(repaired[2, 2:4], flat(0.25)[2, 2:4])
    assert repaired[5, 7, 0] == 3.0 and repaired[5, 7, 1] == 0.25
    assert np.isnan(radiance[2, 2]).all(), "the input stays as it was"


def test_a_picture_without_any_number_cannot_be_repaired():
    with pytest.raises(ValueError, match="no pixel is finite"):
        validate_radiance(RadianceMap(flat(np.nan)), repair=True)


def test_negative_values_are_reported_and_taken_as_nothing():
    radiance = flat()
    radiance[1, 1, 2] = -0.25
    with pytest.warns(UserWarning, match=r"1 of 144 values are negative, as low as -0\.25"):
        made = validate_radiance(RadianceMap(radiance)).radiance
    assert made.min() == 0 and made[1, 1, 0] == 0.5


def test_black_everywhere_is_refused():
    with pytest.raises(ValueError, match="black everywhere"):
        validate_radiance(RadianceMap(flat(0)))


@pytest.mark.parametrize("value, message", [(np.nan, "at x 2, y 299"), (np.inf, "at x 2, y 299"), (-1.0, "negative")])
def test_the_last_rows_of_a_large_picture_are_looked_at_too(value, message):
    radiance = np.ones((300, 400, 3), np.float32)
    radiance[299, 2, 1] = value
    if value < 0:
        with pytest.warns(UserWarning, match=message):
            validate_radiance(RadianceMap(radiance))
        return
    with pytest.raises(ValueError, match=message):
        validate_radiance(RadianceMap(radiance))
