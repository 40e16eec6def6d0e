"""A clear sky as light: the sky, the sun in it and the ground under it, as an environment map in cd/m².

By the place, the date and the hour (`sun_position`), haze and ground; `sky` draws it. The sky is Hošek & Wilkie's of
2012, the sun theirs of 2013 with its disc as large as its distance makes it. The ground is even and matte, lit by both.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from functools import cached_property

import numpy as np

from relume.errors import warn
from relume.image.colour import luminance
from relume.image.primaries import inside_gamut
from relume.light.daylight.hosek_wilkie import (
    CLEAREST,
    HAZIEST,
    WAVELENGTHS,
    HosekWilkie,
    limb_darkening,
    reflectances,
    to_rgb,
)
from relume.light.daylight.sun_position import SunPosition, sun_position
from relume.light.suns.clipped_regions import SUN_DIAMETER
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, Mapping, matching_size, pixel_directions

_POINTS = 4096
"""Of the sun's disc, each with the same solid angle."""
_ROWS = 512
_BLOCK = 64
"""Rows that are drawn at once."""


@dataclass(frozen=True)
class Sky:
    """A clear sky.

    sun : where it stands; above the horizon
    turbidity : haze, 1 (air alone) to 10: 2 in the mountains, 3 on a clear day, 6 in haze
    ground : albedo of the ground all round, linear R, G, B from 0 to 1
    heading : radians from north over east, the compass direction in which −Z, the middle of the map, looks

    Raises ValueError for others, and for a sun below the horizon: the model knows the day.
    """

    sun: SunPosition
    turbidity: float = 3.0
    ground: tuple[float, float, float] = (0.2, 0.2, 0.2)
    heading: float = 0.0

    def __post_init__(self) -> None:
        if not self.sun.elevation > 0:
            below = np.degrees(-self.sun.elevation)
            raise ValueError(f"the sun is {below:.2g}° below the horizon; the model knows the day: give its hours")
        if not CLEAREST <= self.turbidity <= HAZIEST:
            raise ValueError(f"the turbidity is {self.turbidity:g}; expected 1 (clear air) to 10 (haze)")
        if len(self.ground) != 3 or not all(0 <= each <= 1 for each in self.ground):
            raise ValueError(f"the ground is {self.ground}; expected an albedo, three numbers from 0 to 1")
        if not np.isfinite(self.heading):
            raise ValueError(f"the heading is {self.heading}; expected radians")

    @classmethod
    def at(
        cls, latitude: float, longitude: float, time: datetime, turbidity: float = 3.0,
        ground: tuple[float, float, float] | float = 0.2, heading: float = 0.0,
    ) -> Sky:  # fmt: skip
        """The sky over a place at a time.

        latitude, longitude : degrees, north and east positive
        time : with its offset from UTC
        turbidity, ground, heading : as of the sky itself; one number of ground is grey
        Raises ValueError, also where the sun is below the horizon there.
        """
        grey = (ground, ground, ground) if isinstance(ground, int | float) else ground
        return cls(sun_position(latitude, longitude, time), turbidity, grey, heading)

    @cached_property
    def _model(self) -> HosekWilkie:
        return HosekWilkie(self.sun.elevation, self.turbidity, reflectances(self.ground))

    @property
    def sun_direction(self) -> np.ndarray:
        """The direction (3,) towards the sun's middle, in the world's frame."""
        return self.sun.direction(self.heading)

    @property
    def sun_radius(self) -> float:
        """The angular radius of the sun's disc, radians."""
        return SUN_DIAMETER / 2 / self.sun.distance

    def radiance(self, directions: np.ndarray) -> np.ndarray:
        """The radiance (…, 3), cd/m², from unit directions (…, 3): sky without the sun's disc, and the ground."""
        up = directions[..., 1]
        ground = np.asarray(self.ground) / np.pi * (self.sky_illuminance + self.sun_illuminance)
        chord = np.linalg.norm(directions - self.sun_direction, axis=-1)
        angle = 2 * np.arcsin(np.minimum(chord / 2, 1))
        above = up >= 0
        spectral = np.zeros((*up.shape, len(WAVELENGTHS)))
        spectral[above] = self._model.sky(up[above], angle[above])
        return np.where(above[..., None], to_rgb(spectral), ground)

    @cached_property
    def sun_flux(self) -> np.ndarray:
        """(3,) lux by channel on a surface that faces the sun, of its disc alone."""
        return self.disc[1].sum(axis=0)

    @property
    def sun_illuminance(self) -> np.ndarray:
        """The illuminance (3,) of the sun's disc alone on level ground, lux by channel."""
        directions, flux = self.disc
        return directions[:, 1] @ flux

    @cached_property
    def sky_illuminance(self) -> np.ndarray:
        """(3,) lux by channel on level ground, of the sky without the sun's disc."""
        # Gauss's rule over the height, even steps round: the halo is 1° wide, and the sum has settled to 1e-3.
        nodes, weights = np.polynomial.legendre.leggauss(96)
        up, weight = (nodes + 1) / 2, weights / 2
        turns = (np.arange(360) + 0.5) * 2 * np.pi / 360
        level = np.sqrt(1 - up**2)[:, None]
        directions = np.stack(np.broadcast_arrays(level * np.sin(turns), up[:, None], -level * np.cos(turns)), axis=-1)
        chord = np.linalg.norm(directions - self.sun.direction(), axis=-1)
        seen = to_rgb(self._model.sky(directions[..., 1], 2 * np.arcsin(np.minimum(chord / 2, 1))))
        return np.einsum("i,ijc->c", weight * up, seen) * 2 * np.pi / 360

    @cached_property
    def disc(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (N, 3) of the sun's disc above the horizon, and what each gives, (N, 3) lux by channel."""
        # Fermat's spiral: as many points in every part.
        share = np.sqrt((np.arange(_POINTS) + 0.5) / _POINTS)
        turn = np.arange(_POINTS) * np.pi * (3 - np.sqrt(5))
        middle = self.sun_direction
        right = np.cross(middle, [0, 1, 0] if abs(middle[1]) < 0.9 else [0, 0, 1])
        right /= np.linalg.norm(right)
        above = np.cross(right, middle)
        offset = np.tan(self.sun_radius) * share[:, None]
        points = middle + offset * (np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * above)
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        spectral = self._model.sun(np.arcsin(np.clip(points[:, 1], -1, 1))) * limb_darkening(share)
        solid_angle = 4 * np.pi * np.sin(self.sun_radius / 2) ** 2
        return points, to_rgb(spectral) * solid_angle / _POINTS

    def facts(self) -> dict[str, object]:
        """Where the sun is, degrees, and the light on level ground, lux."""
        six = lambda value: float(f"{value:.6g}")  # noqa: E731
        sun, sky = float(luminance(self.sun_illuminance)), float(luminance(self.sky_illuminance))
        return {
            "sun elevation": six(np.degrees(self.sun.elevation)),
            "sun azimuth": six(np.degrees(self.sun.azimuth)),
            "sun direction": [six(each) for each in self.sun_direction],
            "sun facing it, lux": six(float(luminance(self.sun_flux))),
            "sun on level ground, lux": six(sun),
            "sky on level ground, lux": six(sky),
        }


def sky(
    description: Sky, size: int = _ROWS, mapping: Mapping = LatLong(), *, dome: bool = True, sun: bool = True
) -> EnvironmentMap:
    """A clear sky as an environment map in cd/m²: sky, sun and lit ground.

    description : where the sun stands, how hazy the air is, what the ground reflects
    mapping : lat-long unless given
    size : rows; 512 make pixels of 0.35°, finer than the sun's disc
    dome : whether sky and ground are in it
    sun : whether the sun's disc is in it; the ground is lit by it either way. Both maps apart add up to the whole: the
        disc's light goes to the pixels that show it, all of it, however coarse they are

    Colours outside Rec. 709 move towards grey of their luminance, with a warning. Raises ValueError where neither is.
    """
    if not (dome or sun):
        raise ValueError("neither sky nor sun: nothing to draw; ask for one of them")
    lat_long = isinstance(mapping, LatLong)
    rows = size if lat_long else 2 * matching_size(mapping, size, LatLong())
    radiance = np.zeros((rows, 2 * rows, 3))
    if dome:
        radiance = _shown(_dome(description, rows), "some of the sky")
    if sun:
        radiance += _disc_in_map(description, rows)
    light = EnvironmentMap(radiance.astype(np.float32), LatLong(), "cd/m²", None, {"sky": _attribute(description)})
    return light if lat_long else light.remapped(mapping, size)


def _dome(description: Sky, rows: int) -> np.ndarray:
    """(rows, 2 rows, 3) the mean of sky and ground over each pixel of a lat-long map, by solid angle."""
    finer = max(1, -(-_ROWS // rows))
    directions = pixel_directions(LatLong(), rows * finer)
    areas = LatLong().solid_angles(rows * finer)[:, :1, None]
    pixels = []
    step = finer * max(1, _BLOCK // finer)
    for begin in range(0, rows * finer, step):
        flux = description.radiance(directions[begin : begin + step]) * areas[begin : begin + step]
        pixels.append(flux.reshape(-1, finer, 2 * rows, finer, 3).sum(axis=(1, 3)))
    return np.concatenate(pixels) / (areas.reshape(rows, finer).sum(axis=1) * finer)[:, None, None]


def _disc_in_map(description: Sky, rows: int) -> np.ndarray:
    """(rows, 2 rows, 3) radiance of the sun's disc in a lat-long map, each point shared out among four pixels."""
    directions, flux = description.disc
    flux = _shown(flux, "a sun so low")
    points = LatLong().image_points(directions)
    x, y = points[:, 0] * 2 * rows - 0.5, points[:, 1] * rows - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    right, below = x - column, y - row
    sums = np.zeros((rows, 2 * rows, 3))
    for across, down in ((0, 0), (1, 0), (0, 1), (1, 1)):
        share = (right if across else 1 - right) * (below if down else 1 - below)
        # Beyond a pole lies the pixel half a turn away.
        over = (row + down < 0) | (row + down >= rows)
        there = (np.clip(row + down, 0, rows - 1), (column + across + over * rows) % (2 * rows))
        np.add.at(sums, there, share[:, None] * flux)
    return sums / LatLong().solid_angles(rows)[..., None]


def _shown(light: np.ndarray, what: str) -> np.ndarray:
    """(…, 3) light without negative channels, which renderers need."""
    if (light < 0).any():
        warn(f"{what} is of a colour outside Rec. 709; moved towards grey of its luminance")
    return inside_gamut(light)


def _attribute(description: Sky) -> str:
    where = np.degrees([description.sun.elevation, description.sun.azimuth])
    ground = ",".join(f"{each:g}" for each in description.ground)
    sun = f"sun {where[0]:.3f} above, {where[1]:.3f} from north"
    return f"Hosek-Wilkie, {sun}, turbidity {description.turbidity:g}, ground {ground}"
