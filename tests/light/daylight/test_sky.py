"""A clear sky as an environment map: its energy, its sun, its ground, and illuminances against a published formula."""

from datetime import UTC, datetime

import numpy as np
import pytest

from relume.image.colour import luminance
from relume.light.daylight.sky import Sky, sky
from relume.light.daylight.sun_position import SunPosition
from relume.light.suns.extraction import extract_sun
from relume.sphere.directions import normalised
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.sphere.mappings.squares import Octahedral

UP = np.array([0.0, 1.0, 0.0])


def standing(degrees: float, azimuth: float = 40.0, **more: float) -> Sky:
    return Sky(SunPosition(np.radians(degrees), np.radians(azimuth)), **more)  # type: ignore[arg-type]


# A finer map draws the same sky: one height of the sun shows that its pixels are weighed as a coarse one's.
@pytest.mark.parametrize(("degrees", "rows"), [(5.0, 64), (42.0, 64), (88.0, 64), (5.0, 400)])
def test_level_ground_gets_from_the_map_what_sky_and_sun_give(degrees: float, rows: int):
    description = standing(degrees)
    light = sky(description, rows)
    assert light.unit == "cd/m²"
    expected = description.sun_illuminance + description.sky_illuminance
    np.testing.assert_allclose(light.irradiance(UP), expected, rtol=2e-3)


def test_the_ground_gives_back_its_albedo_of_that():
    description = Sky(SunPosition(0.7, 1.0), ground=(0.4, 0.2, 0.1))
    light = sky(description, 64)
    whole = description.sun_illuminance + description.sky_illuminance
    expected = np.array([0.4, 0.2, 0.1]) * whole / np.pi
    np.testing.assert_allclose(light.radiance[40:], np.broadcast_to(expected, (24, 128, 3)), rtol=1e-5)
    # A bright ground brightens the sky too.
    grey, snow = (Sky(SunPosition(0.7), ground=(g, g, g)).sky_illuminance for g in (0.0, 0.8))
    assert np.all(snow > 1.1 * grey)


def test_sky_and_sun_apart_add_up_to_the_whole():
    description = standing(30)
    whole, dome, disc = (sky(description, 64, dome=d, sun=s) for d, s in ((True, True), (True, False), (False, True)))
    np.testing.assert_allclose(whole.radiance, dome.radiance + disc.radiance, rtol=1e-6)
    assert np.count_nonzero(luminance(disc.radiance)) < 12


@pytest.mark.parametrize("rows", [8, 64, 700])
@pytest.mark.parametrize("degrees", [20.0, 89.5, 89.9])
def test_the_disc_keeps_its_light_and_its_place_however_coarse_the_map_is(rows: int, degrees: float):
    description = standing(degrees)
    disc = sky(description, rows, dome=False)
    np.testing.assert_allclose(disc.total(), description.sun_flux, rtol=1e-5)
    flux = luminance(disc.radiance) * LatLong().solid_angles(rows)
    middle = normalised(np.einsum("hw,hwc->c", flux, pixel_directions(LatLong(), rows)))
    assert np.linalg.norm(middle - description.sun_direction) < 0.2 * np.pi / rows


def test_in_another_mapping_it_keeps_its_light():
    description = standing(50)
    square = sky(description, 128, Octahedral())
    assert isinstance(square.mapping, Octahedral)
    np.testing.assert_allclose(square.total(), sky(description, 512).total(), rtol=5e-4)


def test_the_sun_can_be_taken_out_as_a_lamp():
    description = standing(35)
    found = extract_sun(sky(description, 512)).suns[0]
    assert np.linalg.norm(found.direction - description.sun_direction) < np.radians(0.05)
    np.testing.assert_allclose(luminance(found.irradiance), luminance(description.sun_flux), rtol=0.02)


@pytest.mark.parametrize("altitude", [30.0, 45.0, 60.0, 75.0])
def test_illuminances_are_near_the_published_ones_of_a_clear_day(altitude: float):
    # IES RP-21 (Gillette et al. 1984): direct normal 127.5 exp(−0.21 m) klx, sky on level ground 0.8 + 15.5 √sin klx.
    sine = np.sin(np.radians(altitude))
    description = standing(altitude, turbidity=2.0)
    assert abs(float(luminance(description.sun_flux)) / (127_500 * np.exp(-0.21 / sine)) - 1) < 0.2
    assert abs(float(luminance(description.sky_illuminance)) / (800 + 15_500 * np.sqrt(sine)) - 1) < 0.2


def test_the_sun_is_larger_in_january():
    sizes = [Sky(SunPosition(0.5, distance=d)).sun_radius for d in (0.9833, 1.0167)]
    np.testing.assert_allclose(np.degrees(sizes) * 2, [0.5419, 0.5241], atol=2e-4)


def test_it_is_made_by_place_and_time():
    noon = Sky.at(52.5, 13.4, datetime(2026, 6, 21, 11, 6, tzinfo=UTC), ground=0.1)
    assert abs(np.degrees(noon.sun.elevation) - (90 - 52.5 + 23.44)) < 0.05
    assert noon.ground == (0.1, 0.1, 0.1)
    facts = noon.facts()
    assert facts["sun elevation"] == pytest.approx(np.degrees(noon.sun.elevation), rel=1e-5)


def test_what_rec_709_cannot_show_is_warned_of():
    with pytest.warns(UserWarning, match="a sun so low is of a colour outside Rec. 709"):
        sky(Sky(SunPosition(np.radians(1.0)), 2.0), 32)


def test_night_and_wrong_numbers_are_refused():
    with pytest.raises(ValueError, match=r"the sun is 6° below the horizon"):
        standing(-6)
    with pytest.raises(ValueError, match=r"turbidity is 0\.5"):
        standing(30, turbidity=0.5)
    with pytest.raises(ValueError, match="ground is"):
        Sky(SunPosition(0.5), ground=(0.5, 0.5, 1.5))
    with pytest.raises(ValueError, match="neither sky nor sun"):
        sky(standing(30), dome=False, sun=False)
