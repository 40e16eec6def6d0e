"""Lights that are not part of the environment map: points, suns, lamps with a size, and light from everywhere (Whitted
1980, eq. 1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.scene.materials.materials import Colour


@dataclass(frozen=True)
class Unattenuated:
    """Light that does not fall with distance."""

    def at(self, distance: np.ndarray) -> np.ndarray:
        """The share that arrives over a distance, metres."""
        return np.ones(np.shape(distance))


@dataclass(frozen=True)
class Linear:
    """Light that falls linearly with distance, to nothing at `reach` metres (Whitted 1980, §2)."""

    reach: float

    def __post_init__(self) -> None:
        if not 0 < self.reach < np.inf:
            raise ValueError(f"reach of linear attenuation is {self.reach}; expected a positive length in metres")

    def at(self, distance: np.ndarray) -> np.ndarray:
        """The share that arrives over a distance, metres."""
        return np.maximum(1 - np.asarray(distance, np.float64) / self.reach, 0)


@dataclass(frozen=True)
class SquareLaw:
    """Light that falls as 1/distance², 1 at a metre: what light from a point does."""

    def at(self, distance: np.ndarray) -> np.ndarray:
        """The share that arrives over a distance, metres."""
        return 1 / np.asarray(distance, np.float64) ** 2


Attenuation = Unattenuated | Linear | SquareLaw


@dataclass(frozen=True)
class PointLight:
    """A point that shines alike in all directions.

    position : metres, world
    intensity : per channel, the light's unit times m²/sr: irradiance at a metre on a surface that faces it
    falloff : with distance; the square law unless given, which is physics
    """

    position: tuple[float, float, float]
    intensity: Colour
    falloff: Attenuation = SquareLaw()

    def __post_init__(self) -> None:
        _check_vector("position of a point light", self.position)
        _check_colour("intensity of a point light", self.intensity)


@dataclass(frozen=True)
class DistantLight:
    """Parallel light, as of the sun.

    towards : from the scene towards the light, of any length above 0
    irradiance : per channel, on a surface that faces it
    """

    towards: tuple[float, float, float]
    irradiance: Colour

    def __post_init__(self) -> None:
        _check_vector("direction of a distant light", self.towards)
        if not any(self.towards):
            raise ValueError(f"direction of a distant light is {self.towards}; expected one that points somewhere")
        _check_colour("irradiance of a distant light", self.irradiance)


@dataclass(frozen=True)
class SphereLight:
    """A lamp that has a size: a sphere that shines evenly, takes no light and throws no shadow.

    position : of its middle, metres, world
    radius : metres
    radiance : per channel, of its surface, in the light's unit
    """

    position: tuple[float, float, float]
    radius: float
    radiance: Colour

    def __post_init__(self) -> None:
        _check_vector("position of a sphere of light", self.position)
        _check_colour("radiance of a sphere of light", self.radiance)
        if not 0 < self.radius < np.inf:
            raise ValueError(f"radius of a sphere of light is {self.radius}; expected a positive length in metres")


@dataclass(frozen=True)
class RectangleLight:
    """A flat lamp: a rectangle that shines evenly to one side, takes no light and throws no shadow.

    position : of its middle, metres, world
    towards : the direction that it faces, of any length above 0
    size : width and height, metres
    radiance : per channel, of its front, in the light's unit; the back is not seen
    up : of its two sides the height lies as near to this direction as it can; to −Z where it faces along this one
    """

    position: tuple[float, float, float]
    towards: tuple[float, float, float]
    size: tuple[float, float]
    radiance: Colour
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        _check_vector("position of a rectangle of light", self.position)
        _check_vector("direction of a rectangle of light", self.towards)
        _check_vector("up of a rectangle of light", self.up)
        _check_colour("radiance of a rectangle of light", self.radiance)
        if len(self.size) != 2 or not all(0 < side < np.inf for side in self.size):
            raise ValueError(f"size of a rectangle of light is {self.size}; expected two positive lengths in metres")
        if not any(self.towards) or not any(self.up):
            raise ValueError(
                f"a rectangle of light faces {self.towards} and its up is {self.up}; expected two directions "
                "that point somewhere"
            )

    @property
    def frame(self) -> np.ndarray:
        """The unit columns (3, 3): along the width, along the height, and the direction that it faces."""
        ahead = np.asarray(self.towards, np.float64) / np.linalg.norm(self.towards)
        up = np.asarray(self.up, np.float64) / np.linalg.norm(self.up)
        across = np.cross(up, ahead)
        if np.linalg.norm(across) < 1e-6:
            across = np.cross([0.0, 0.0, -1.0] if abs(ahead[2]) < 0.9 else [1.0, 0.0, 0.0], ahead)
        across /= np.linalg.norm(across)
        return np.stack([across, np.cross(ahead, across), ahead], axis=1)


@dataclass(frozen=True)
class AmbientLight:
    """The same light from everywhere that nothing shadows: I_a of Whitted 1980, eq. 1 and 2.

    radiance : per channel; a diffuse surface of reflectance ρ adds ρ times this
    """

    radiance: Colour

    def __post_init__(self) -> None:
        _check_colour("radiance of ambient light", self.radiance)


Light = PointLight | DistantLight | SphereLight | RectangleLight | AmbientLight


def _check_vector(what: str, value: tuple[float, float, float]) -> None:
    if len(value) != 3 or not np.all(np.isfinite(value)):
        raise ValueError(f"{what} is {value}; expected three finite numbers")


def _check_colour(what: str, value: Colour) -> None:
    # Pixels are kept in single precision, which ends at 3e38.
    if len(value) != 3 or not np.all(np.asarray(value) <= 1e30) or min(value) < 0:
        raise ValueError(f"{what} is {value}; expected three numbers from 0 to 1e30")
