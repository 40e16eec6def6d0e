"""Readings at a place of the picture: meters, lamps of known radiance, white cards and dark places, as plain values.

Each is called with a merged map and answers with what it measures there; its errors begin with its `name`. Numbers
that cannot be right are refused when the value is made, before any photograph is read.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from typing import ClassVar

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.lens.glare import Glare
from relume.capture.lens.glare_recovery import recover_glare_from_dark
from relume.capture.raw.merging import RawCalibration
from relume.capture.scale.absolute import (
    Scale,
    scale_from_exposure,
    scale_from_lux,
    scale_from_saturation,
    scale_from_spot,
)
from relume.capture.scale.luminaire import ChannelGains, balance_from_luminaire, scale_from_luminaire
from relume.capture.scale.regions import rectangle, spot_radius
from relume.image.radiance import RadianceMap
from relume.image.response import Response

SPOT_RADIUS = 4.0
"""Pixels of a spot where the focal length is unknown: a few average noise and keep within what a person points at."""


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
        """(H, W) bool; raises ValueError where the rectangle reaches out of the picture."""
        return rectangle(picture.size, self.left, self.top, self.width, self.height)


@dataclass(frozen=True)
class ExposureScale:
    """cd/m² from shutter, aperture and ISO (ISO 12232); good to a third of a stop."""

    name: ClassVar[str] = "absolute"

    def __call__(self, picture: RadianceMap, bracket: Bracket, camera: Response | RawCalibration) -> Scale:
        if isinstance(camera, RawCalibration):
            return scale_from_saturation(camera.saturation, camera.exposures)
        return scale_from_exposure(camera, [p.exposure for p in bracket.photographs if p.exposure])


@dataclass(frozen=True)
class SpotReading:
    """A spot meter's reading.

    x, y : pixel in the middle of the spot
    luminance : cd/m²
    radius : pixels; a 1° field's unless given, or `SPOT_RADIUS` where the focal length is unknown
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
    """A lux meter's reading on a matt card: lx, and the card's reflectance."""

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
    """A lamp of known radiance, (r, g, b) in cd/m²; white has r = g = b. It sets the balance too (§2.6)."""

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
    """A white light or card that is to come out grey."""

    card: Rectangle
    name: ClassVar[str] = "white"

    def __call__(self, picture: RadianceMap) -> ChannelGains:
        with _named(self.name):
            return balance_from_luminaire(picture, self.card.mask(picture))


@dataclass(frozen=True)
class DarkPlace:
    """A place known to be black: the even veil of glare that it shows is taken out of the whole picture."""

    place: Rectangle
    name: ClassVar[str] = "glare"

    def __call__(self, picture: RadianceMap) -> Glare:
        with _named(self.name):
            return recover_glare_from_dark(picture, self.place.mask(picture))


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
