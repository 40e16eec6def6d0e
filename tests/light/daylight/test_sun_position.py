"""Where the sun stands, against published values: almanacs, and the example of NREL's solar position algorithm."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from relume.light.daylight.sun_position import SunPosition, sun_position

ALMANAC = np.radians(0.02)


def test_it_is_where_the_example_of_nrel_has_it():
    # I. Reda & A. Andreas, "Solar Position Algorithm for Solar Radiation Applications", NREL/TP-560-34302, A.5.
    time = datetime(2003, 10, 17, 12, 30, 30, tzinfo=timezone(timedelta(hours=-7)))
    sun = sun_position(39.742476, -105.1786, time, pressure=820, temperature=11)
    assert abs(sun.elevation - np.radians(90 - 50.11162)) < ALMANAC / 4
    assert sun.true_elevation is not None
    assert abs(sun.true_elevation - np.radians(39.872046)) < ALMANAC / 4
    assert abs(sun.azimuth - np.radians(194.34024)) < ALMANAC / 2


@pytest.mark.parametrize(
    ("time", "declination", "within"),
    [
        (datetime(1992, 10, 12, 23, 59, 1, tzinfo=UTC), -7.78507, 0.0005),  # Meeus 1998, example 25.a, apparent
        (datetime(2024, 3, 20, 3, 6, tzinfo=UTC), 0.0, 0.004),  # equinoxes, to the minute
        (datetime(2024, 9, 22, 12, 44, tzinfo=UTC), 0.0, 0.004),
    ],
)
def test_from_the_pole_its_height_is_its_declination(time: datetime, declination: float, within: float):
    sun = sun_position(90, 0, time, pressure=0)
    parallax = 8.794 / 3600
    assert abs(np.degrees(sun.elevation) - (declination - parallax)) < within


@pytest.mark.parametrize(
    ("time", "distance"),
    [(datetime(2024, 1, 3, 0, 39, tzinfo=UTC), 0.983307), (datetime(2024, 7, 5, 5, 6, tzinfo=UTC), 1.016725)],
)
def test_it_is_nearest_in_january_and_farthest_in_july(time: datetime, distance: float):
    assert abs(sun_position(0, 0, time).distance - distance) < 5e-5


def test_a_sun_on_the_horizon_is_lifted_by_half_a_degree():
    # The standard altitude of the sun's middle at rise is −34 arc minutes, of refraction alone.
    times = [datetime(2026, 3, 20, 6, tzinfo=UTC) + timedelta(seconds=10 * step) for step in range(200)]
    found = [sun_position(0, 0, time) for time in times]
    lift = min(found, key=lambda sun: abs(sun.elevation))
    assert lift.true_elevation is not None
    assert abs(np.degrees(lift.elevation - lift.true_elevation) * 60 - 34) < 1.5


def test_it_rises_in_the_east_and_stands_in_the_south_at_noon():
    morning, noon = (sun_position(48, 0, datetime(2026, 3, 20, hour, 7, tzinfo=UTC)) for hour in (7, 12))
    assert morning.direction()[0] > 0.9
    assert noon.direction()[2] > 0.7
    assert abs(noon.direction()[0]) < 0.02


def test_a_heading_turns_the_frame():
    sun = SunPosition(0.3, np.radians(250))
    np.testing.assert_allclose(sun.direction(np.radians(250)), [0, np.sin(0.3), -np.cos(0.3)], atol=1e-12)
    # Looking east, a sun in the south is on the right.
    np.testing.assert_allclose(SunPosition(0.0001, np.pi).direction(np.pi / 2)[0], 1, atol=1e-6)


def test_the_same_moment_by_two_clocks_is_one_sun():
    utc = datetime(2026, 6, 21, 11, tzinfo=UTC)
    assert sun_position(52, 13, utc) == sun_position(52, 13, utc.astimezone(timezone(timedelta(hours=2))))


def test_what_is_no_place_or_no_moment_is_refused():
    noon = datetime(2026, 6, 21, 12, tzinfo=UTC)
    with pytest.raises(ValueError, match="latitude 91"):
        sun_position(91, 0, noon)
    with pytest.raises(ValueError, match="no offset from UTC"):
        sun_position(52, 13, noon.replace(tzinfo=None))
    with pytest.raises(ValueError, match="the year is 1800"):
        sun_position(52, 13, noon.replace(year=1800))
    with pytest.raises(ValueError, match="elevation"):
        SunPosition(2.0)
