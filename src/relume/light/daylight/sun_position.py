"""Where the sun stands, seen from a place at a time: Meeus's low-precision series, to 0.01° from 1900 to 2100.

J. Meeus, *Astronomical Algorithms*, 2nd edition (1998): chapters 12 (sidereal time), 22 (nutation) and 25 (the sun
to 0.01°), parallax of chapter 40; refraction by Saemundsson, eq. 16.4. NOAA's solar calculator does the same. The
world's frame: +Y up, −Z north and +X east, unless a heading turns it.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
LATE = 69.0 / 86400
"""Days by which terrestrial time is ahead of clocks, about 2020; 60 s more move the sun by 0.0007°."""
PARALLAX = np.radians(8.794 / 3600)
FIRST, LAST = 1900, 2100


@dataclass(frozen=True)
class SunPosition:
    """Where the sun stands in the sky.

    elevation : radians above the horizon, where it is seen: lifted by refraction
    azimuth : radians from north over east
    distance : astronomical units, which says how large it looks
    true_elevation : radians without refraction; the elevation unless given
    """

    elevation: float
    azimuth: float = 0.0
    distance: float = 1.0
    true_elevation: float | None = None

    def __post_init__(self) -> None:
        if not abs(self.elevation) <= np.pi / 2:
            raise ValueError(f"the sun's elevation is {self.elevation:g}; expected radians from −π/2 to π/2")
        if not np.isfinite(self.azimuth) or not 0.9 < self.distance < 1.1:
            raise ValueError(f"azimuth {self.azimuth:g}, distance {self.distance:g}; expected radians, and about 1 au")

    def direction(self, heading: float = 0.0) -> np.ndarray:
        """The direction (3,) towards the sun; `heading` is where −Z looks, radians from north over east."""
        level, round_about = np.cos(self.elevation), self.azimuth - heading
        return np.array([level * np.sin(round_about), np.sin(self.elevation), -level * np.cos(round_about)])


def sun_position(
    latitude: float, longitude: float, time: datetime, *, pressure: float = 1013.25, temperature: float = 10.0
) -> SunPosition:
    """Where the sun stands at a place and time.

    latitude, longitude : degrees, as maps write them, north and east positive
    time : with its offset from UTC, years 1900 to 2100
    pressure, temperature : of the air, hPa and °C, for refraction; sea level's on a cool day unless given. No pressure,
        no refraction

    Raises ValueError for a place or a time that is none, and for a time without an offset.
    """
    if not (abs(latitude) <= 90 and abs(longitude) <= 360):
        raise ValueError(f"latitude {latitude:g}, longitude {longitude:g}; expected degrees, −90 to 90 and −180 to 180")
    if time.utcoffset() is None:
        raise ValueError(
            f"the time {time.isoformat()} has no offset from UTC; write {time.isoformat()}Z, or +02:00 after it"
        )
    if not FIRST <= time.year <= LAST:
        raise ValueError(f"the year is {time.year}; the sun's place is known from {FIRST} to {LAST}")
    if not (0 <= pressure < 1200 and -100 < temperature < 100):
        raise ValueError(f"pressure {pressure:g}, temperature {temperature:g}; expected hPa and °C of air")
    days = (time.astimezone(UTC) - J2000).total_seconds() / 86400
    right_ascension, declination, distance, nutation = _equatorial(days + LATE)
    # The hour angle, by apparent sidereal time at Greenwich (Meeus 12.4).
    centuries = days / 36525
    sidereal = np.radians(280.46061837 + 360.98564736629 * days + 0.000387933 * centuries**2) + nutation
    hour = sidereal + np.radians(longitude) - right_ascension
    north = np.radians(latitude)
    across = -np.cos(declination) * np.sin(hour)
    ahead = np.sin(declination) * np.cos(north) - np.cos(declination) * np.cos(hour) * np.sin(north)
    up = np.sin(north) * np.sin(declination) + np.cos(north) * np.cos(declination) * np.cos(hour)
    elevation = np.arctan2(up, np.hypot(across, ahead))
    elevation -= PARALLAX / distance * np.cos(elevation)
    seen = elevation + _refraction(elevation, pressure, temperature)
    azimuth = np.arctan2(across, ahead) % (2 * np.pi)
    return SunPosition(min(float(seen), np.pi / 2), float(azimuth), float(distance), float(elevation))


def _equatorial(days: float) -> tuple[float, float, float, float]:
    """Apparent right ascension and declination, distance, au, and nutation in right ascension, days after J2000."""
    t = days / 36525
    mean_longitude = 280.46646 + 36000.76983 * t + 0.0003032 * t**2
    anomaly = np.radians(357.52911 + 35999.05029 * t - 0.0001537 * t**2)
    eccentricity = 0.016708634 - 0.000042037 * t - 0.0000001267 * t**2
    centre = (
        (1.914602 - 0.004817 * t - 0.000014 * t**2) * np.sin(anomaly)
        + (0.019993 - 0.000101 * t) * np.sin(2 * anomaly)
        + 0.000289 * np.sin(3 * anomaly)
    )
    distance = 1.000001018 * (1 - eccentricity**2) / (1 + eccentricity * np.cos(anomaly + np.radians(centre)))
    # Nutation and aberration, by the moon's node.
    node = np.radians(125.04 - 1934.136 * t)
    longitude = np.radians(mean_longitude + centre - 0.00569 - 0.00478 * np.sin(node))
    obliquity = np.radians(23.4392911 - 0.0130042 * t - 1.64e-7 * t**2 + 0.00256 * np.cos(node))
    right_ascension = np.arctan2(np.cos(obliquity) * np.sin(longitude), np.cos(longitude))
    declination = np.arcsin(np.sin(obliquity) * np.sin(longitude))
    nutation = np.radians(-0.00478 * np.sin(node)) * np.cos(obliquity)
    return float(right_ascension), float(declination), float(distance), float(nutation)


def _refraction(elevation: float, pressure: float, temperature: float) -> float:
    """Radians by which air lifts what stands at a true elevation; below −1°, where nothing is seen, as there."""
    degrees = max(float(np.degrees(elevation)), -1.0)
    minutes = 1.02 / np.tan(np.radians(degrees + 10.3 / (degrees + 5.11)))
    return float(np.radians(max(minutes, 0.0) / 60)) * pressure / 1010 * 283 / (273 + temperature)
