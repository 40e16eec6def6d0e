"""The lights of a constellation as other programs hold lamps: a colour, an intensity, a turn; and what numbers mean."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePosixPath, PureWindowsPath

import numpy as np

from relume.light.constellations.constellation import Constellation
from relume.light.constellations.placement import PlacedLights

POINT_RADIUS = 0.01
"""Metres: of a point in programs that have spheres alone. A centimetre blurs no shadow visibly."""
FRAME = "right-handed, +Y up, metres; directions point towards the lights"


@dataclass(frozen=True)
class Lamp:
    """One parallel light.

    name : "light_000", "light_001", … in the constellation's order
    direction : unit, towards the light, in our frame
    irradiance : red, green and blue on a surface that faces the light
    angle : apparent diameter in radians, 0 for parallel light
    """

    name: str
    direction: tuple[float, float, float]
    irradiance: tuple[float, float, float]
    angle: float

    @property
    def intensity(self) -> float:
        """The strongest channel of the irradiance."""
        return max(self.irradiance)

    @property
    def colour(self) -> tuple[float, float, float]:
        """Irradiance = intensity × colour, whose strongest channel is 1; white where there is no light."""
        return _colour(self.irradiance)

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """(x, y, z, w) of the smallest turn that takes +Z towards the light, so that −Z is the way the light goes."""
        x, y, z = self.direction
        if z < -1 + 1e-12:
            return (1.0, 0.0, 0.0, 0.0)
        length = float(np.sqrt(2 * (1 + z)))
        return (-y / length, x / length, 0.0, length / 2)


@dataclass(frozen=True)
class Bulb:
    """One light that shines from a place.

    name : "point_000", "point_001", … in the order of the placed lights
    position : metres, in our frame
    intensity : red, green and blue, irradiance at a metre on a surface that faces the light
    radius : of the sphere that it is, metres; 0 for a point
    """

    name: str
    position: tuple[float, float, float]
    intensity: tuple[float, float, float]
    radius: float

    @property
    def strength(self) -> float:
        """The strongest channel of the intensity."""
        return max(self.intensity)

    @property
    def colour(self) -> tuple[float, float, float]:
        """Intensity = strength × colour, whose strongest channel is 1; white where there is no light."""
        return _colour(self.intensity)

    def radiance(self, radius: float) -> tuple[float, float, float]:
        """Of a sphere that is so wide, metres, and has this intensity: a disc of π r² from everywhere."""
        red, green, blue = self.intensity
        disc = float(np.pi * radius**2)
        return red / disc, green / disc, blue / disc


@dataclass(frozen=True, eq=False)
class LampFile:
    """All that a file of lamps holds.

    lights : parallel ones
    unit : the map's, "relative" or "cd/m²"
    background : the lat-long file with the light that the lights do not carry, relative to this one; None for none
    angles : (N,), apparent diameters of the lights in radians from 0 to π; parallel light where None
    points : lights that have a place; None where no places were asked for

    Its properties raise ValueError for another unit, an absolute path, angles that do not fit, and lights that are not
    finite or below 0.
    """

    lights: Constellation
    unit: str
    background: str | None = None
    angles: np.ndarray | None = None
    points: PlacedLights | None = None

    @property
    def lamps(self) -> list[Lamp]:
        """The parallel lights one by one."""
        count = len(self.lights.directions)
        wide = np.zeros(count) if self.angles is None else np.asarray(self.angles, np.float64)
        if wide.shape != (count,) or not np.all((wide >= 0) & (wide <= np.pi)):
            raise ValueError(
                f"angles of shape {wide.shape}; expected ({count},), one a light, each from 0 to π radians; "
                "leave them out for parallel light"
            )
        irradiance = np.asarray(self.lights.irradiance, np.float64)
        if not np.all(np.isfinite(irradiance)) or np.any(irradiance < 0):
            raise ValueError("irradiance holds negative or non-finite values; light must be finite and not below 0")
        # Unit to the last digit, which programs that trust a quaternion expect.
        directions = np.asarray(self.lights.directions, np.float64)
        directions = directions / np.maximum(np.linalg.norm(directions, axis=-1, keepdims=True), 1e-300)
        return [
            Lamp(name, _three(direction), _three(light), float(angle))
            for name, direction, light, angle in zip(_names("light", count), directions, irradiance, wide, strict=True)
        ]

    @property
    def bulbs(self) -> list[Bulb]:
        """The placed lights one by one."""
        if self.points is None:
            return []
        count = len(self.points.positions)
        radii = np.zeros(count) if self.points.radii is None else self.points.radii
        return [
            Bulb(name, _three(place), _three(intensity), float(radius))
            for name, place, intensity, radius in zip(
                _names("point", count), self.points.positions, self.points.intensity, radii, strict=True
            )
        ]

    @property
    def meaning(self) -> str:
        """What the numbers of lights, background and placed lights are."""
        if self.unit == "cd/m²":
            irradiance, intensity = (
                "Irradiance is in lux, red, green and blue apart, and the background's pixels are in cd/m².",
                "cd",
            )
        elif self.unit == "relative":
            irradiance, intensity = (
                "Irradiance is in the light map's own relative unit × steradian, and the background's pixels in that "
                "unit.",
                "that unit × m²",
            )
        else:
            raise ValueError(f'unit is "{self.unit}"; expected "relative" or "cd/m²"')
        if self.points is None:
            return irradiance
        return f"{irradiance} Points have a place in metres and an intensity in {intensity}: irradiance × distance²."

    @property
    def background_name(self) -> str | None:
        """The background's path as a file can hold it: with forward slashes, and never an absolute one.

        An absolute path would be right on one machine only; a line break would end the line that names it.
        """
        name = self.background
        if name is None:
            return None
        if PurePosixPath(name).is_absolute() or PureWindowsPath(name).drive or not name.isprintable():
            raise ValueError(f"background is {name!r}; give its path relative to the file that will name it")
        return PureWindowsPath(name).as_posix() if "\\" in name else name


def figure(number: float) -> str:
    """A number in nine significant digits, which is more than a float32 holds; never "-0"."""
    return f"{number + 0.0:.9g}"


def figures(numbers: tuple[float, ...], between: str = " ") -> str:
    """Numbers in nine significant digits."""
    return between.join(figure(number) for number in numbers)


def rounded(numbers: tuple[float, ...]) -> list[float]:
    """Numbers of nine significant digits, as JSON holds them."""
    return [float(figure(number)) for number in numbers]


def _names(word: str, count: int) -> list[str]:
    """The lights' names, with as many digits as sort them."""
    digits = max(3, len(str(max(count - 1, 0))))
    return [f"{word}_{index:0{digits}d}" for index in range(count)]


def _colour(values: tuple[float, float, float]) -> tuple[float, float, float]:
    red, green, blue = values
    strongest = max(values)
    return (red / strongest, green / strongest, blue / strongest) if strongest > 0 else (1.0, 1.0, 1.0)


def _three(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
