"""Readings at a place of the picture: meters, lamps of known radiance, white cards and dark places, as plain values.

Each is called with a merged map and answers with what it measures there; its errors begin with its `name`. Numbers
that cannot be right are refused when the value is made, before any photograph is read. What a calibration luminaire is
known to radiate sets scale and balance (Debevec & Malik 1997, §2.5, 2.6).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import ClassVar

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.lens.glare import Glare
from relume.capture.lens.glare_recovery import recover_glare_from_dark, recover_glare_from_lamp
from relume.capture.raw.merging import RawCalibration
from relume.capture.scale.absolute import (
    Scale,
    scale_from_exposure,
    scale_from_lux,
    scale_from_saturation,
    scale_from_spot,
)
from relume.capture.scale.regions import measured_patch, rectangle, spot_radius
from relume.image import files
from relume.image.colour import luminance, triple
from relume.image.radiance import RadianceMap
from relume.image.response import Response

CERTIFIED = 0.02
"""Relative standard deviation of a luminaire whose radiance a laboratory certified."""
SPOT_RADIUS = 4.0
"""Pixels of a spot where the focal length is unknown: a few average noise and keep within what a person points at."""


@dataclass(frozen=True)
class ChannelGains:
    """One gain a channel: the scaling factors that the three separate curves leave open (Debevec & Malik 1997, §2.6).

    gains : of red, green and blue; they keep the luminance of the luminaire they were measured at
    deviation : standard deviation of each ln gain
    """

    gains: tuple[float, float, float]
    deviation: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if len(self.gains) != 3 or not all(np.isfinite(g) and g > 0 for g in self.gains):
            raise ValueError(f"gains are {self.gains}; a balance is three positive numbers")

    def response(self, response: Response) -> Response:
        """The response whose merged maps are balanced from the start: each curve moved by ln gain."""
        return replace(response, log_exposure=response.log_exposure + np.log(self.gains)[:, None])


def scale_from_luminaire(
    picture: RadianceMap,
    region: np.ndarray,
    radiance: float | tuple[float, float, float],
    *,
    deviation: float = CERTIFIED,
) -> Scale:
    """The scale that makes a luminaire as bright as it is known to be (Debevec & Malik 1997, §2.5).

    picture : a radiance map in relative units
    region : (H, W) bool, the luminaire's pixels
    radiance : its luminance, cd/m², for one factor in all channels; or linear Rec. 709 (r, g, b) in cd/m², for a factor
        a channel, which balances the colours as well (§2.6)
    deviation : relative, of the luminaire; 0.02 as of a calibrated one
    """
    known = _colour("radiance", (radiance,) * 3 if np.isscalar(radiance) else radiance)
    patch = measured_patch(picture, region)
    factor = known / (patch.luminance if np.isscalar(radiance) else _lit(patch.radiance))
    uncertainty = float(np.hypot(deviation, patch.uncertainty))
    return Scale(triple(factor), uncertainty, "a luminaire of known radiance")


def balance_from_luminaire(
    picture: RadianceMap, region: np.ndarray, colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> ChannelGains:
    """The gains that show a luminaire in its known colour and as bright as before (Debevec & Malik 1997, §2.6).

    picture : a radiance map
    region : (H, W) bool, the luminaire's pixels, or those of a white card under it
    colour : its linear Rec. 709 colour up to a factor; white unless given
    """
    known, patch = _colour("colour", colour), measured_patch(picture, region)
    seen = _lit(patch.radiance)
    gains = known / seen
    # A change of balance is no change of exposure: the luminaire keeps its luminance.
    gains *= patch.luminance / float(luminance(gains * seen))
    return ChannelGains(triple(gains), triple(patch.deviation / seen))


def apply_balance(picture: RadianceMap, balance: ChannelGains) -> RadianceMap:
    """The map with every channel multiplied by its gain, its variance by the square.

    picture : radiance of the camera that the gains are of
    balance : one gain a channel
    """
    gains = np.array(balance.gains, np.float32)
    return replace(
        picture,
        radiance=picture.radiance * gains,
        variance=None if picture.variance is None else picture.variance * gains**2,
    )


def _colour(name: str, value: object) -> np.ndarray:
    colour = np.asarray(value, np.float64)
    if colour.shape != (3,) or not np.all(np.isfinite(colour) & (colour > 0)):
        raise ValueError(f"{name} is {value}; expected positive red, green and blue")
    return colour


def _lit(radiance: np.ndarray) -> np.ndarray:
    if radiance.min() <= 0:
        raise ValueError(f"the region's mean is {radiance}; a luminaire must be lit in all three channels")
    return radiance


@dataclass(frozen=True)
class Rectangle:
    """Pixels of a picture: `width` columns from `left` and `height` rows from `top`, counted from 0 at the top left."""

    left: int
    top: int
    width: int
    height: int

    def __post_init__(self) -> None:
        if self.left < 0 or self.top < 0 or self.width <= 0 or self.height <= 0:
            raise ValueError(
                f"{self.left},{self.top},{self.width},{self.height} is not a rectangle; give X,Y from 0, and WIDTH and "
                "HEIGHT above 0"
            )

    def mask(self, picture: RadianceMap) -> np.ndarray:
        """The pixels of a picture that are in the rectangle, (H, W) bool; raises ValueError where it reaches out."""
        return rectangle(picture.size, self.left, self.top, self.width, self.height)


@dataclass(frozen=True)
class ExposureScale:
    """A scale to cd/m² from shutter, aperture and ISO (ISO 12232); good to a third of a stop."""

    name: ClassVar[str] = "absolute"

    def __call__(self, picture: RadianceMap, bracket: Bracket, camera: Response | RawCalibration) -> Scale:
        if isinstance(camera, RawCalibration):
            return scale_from_saturation(camera.saturation, camera.exposures)
        return scale_from_exposure(camera, [p.exposure for p in bracket.photographs if p.exposure])


@dataclass(frozen=True)
class SpotReading:
    """A spot meter's reading of one place of a picture.

    x, y : pixel in the middle of the spot
    luminance : cd/m²
    radius : pixels; unless given that of a 1° field, or 4 where the focal length is unknown
    """

    x: int
    y: int
    luminance: float
    radius: float | None = None
    name: ClassVar[str] = "spot"

    def __post_init__(self) -> None:
        _require_positive(self.name, luminance=self.luminance, radius=1.0 if self.radius is None else self.radius)

    def __call__(self, picture: RadianceMap, bracket: Bracket, camera: Response | RawCalibration) -> Scale:
        radius = self.radius or (spot_radius(bracket.focal_length) if bracket.focal_length else SPOT_RADIUS)
        with _named(self.name):
            return scale_from_spot(picture, self.x, self.y, self.luminance, radius=radius)


@dataclass(frozen=True)
class LuxReading:
    """A lux meter's reading on a matt card: lx, and the card's reflectance.

    card : the card's pixels
    illuminance : lx, on the card and facing as it does
    reflectance : 0 to 1
    """

    card: Rectangle
    illuminance: float
    reflectance: float
    name: ClassVar[str] = "lux"

    def __post_init__(self) -> None:
        _require_positive(self.name, illuminance=self.illuminance)
        if not 0 < self.reflectance <= 1:
            share = self.reflectance / 100
            remedy = f" (write {share:g} for {self.reflectance:g} %)" if 0.01 < share <= 1 else ""
            raise ValueError(
                f"{self.name}: reflectance is {self.reflectance:g}; give a number above 0 and up to 1{remedy}"
            )

    def __call__(self, picture: RadianceMap, bracket: Bracket, camera: Response | RawCalibration) -> Scale:
        with _named(self.name):
            return scale_from_lux(picture, self.card.mask(picture), self.illuminance, reflectance=self.reflectance)


@dataclass(frozen=True)
class LuminaireReading:
    """A lamp of known radiance; white has r = g = b. It sets the balance too (Debevec & Malik 1997, §2.6).

    lamp : its pixels
    radiance : (r, g, b) in cd/m², linear Rec. 709
    """

    lamp: Rectangle
    radiance: tuple[float, float, float]
    name: ClassVar[str] = "luminaire"

    def __post_init__(self) -> None:
        for channel, value in zip(("red", "green", "blue"), self.radiance, strict=True):
            _require_positive(self.name, **{channel: value})

    def __call__(self, picture: RadianceMap, bracket: Bracket, camera: Response | RawCalibration) -> Scale:
        with _named(self.name):
            return scale_from_luminaire(picture, self.lamp.mask(picture), self.radiance)


@dataclass(frozen=True)
class WhiteCard:
    """A white light or card that is to come out grey.

    card : its pixels
    """

    card: Rectangle
    name: ClassVar[str] = "white"

    def __call__(self, picture: RadianceMap) -> ChannelGains:
        with _named(self.name):
            return balance_from_luminaire(picture, self.card.mask(picture))


@dataclass(frozen=True)
class DarkPlace:
    """A place known to be black: the even veil of glare that it shows is taken out of the whole picture.

    place : its pixels
    """

    place: Rectangle
    name: ClassVar[str] = "glare"

    def __call__(self, picture: RadianceMap) -> Glare:
        with _named(self.name):
            return recover_glare_from_dark(picture, self.place.mask(picture))


@dataclass(frozen=True)
class LampInTheDark:
    """A radiance map of a small lamp in a dark room, by the same lens: the veil and the halo that it shows go.

    path : of the map
    lamp : its pixels in it
    """

    path: Path
    lamp: Rectangle
    name: ClassVar[str] = "glare_lamp"

    def __call__(self, picture: RadianceMap) -> Glare:
        with _named(self.name):
            shown = files.read_radiance(self.path)
            return recover_glare_from_lamp(shown, self.lamp.mask(shown))


PLACED = (SpotReading, LuxReading, LuminaireReading, WhiteCard, DarkPlace)
"""The readings at a place of one picture: they hold for the brackets of one camera only."""


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Begin the message of a ValueError with the reading's name."""
    try:
        yield
    except ValueError as error:
        raise type(error)(f"{name}: {error}") from None


def _require_positive(name: str, **values: float) -> None:
    for what, value in values.items():
        if not (isfinite(value) and value > 0):
            raise ValueError(f"{name}: {what} is {value:g}; give a number above 0")
