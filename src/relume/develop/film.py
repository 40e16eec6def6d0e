"""Developing: from scene-linear radiance to the pixel values a camera would have written."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.colour import encode_srgb, luminance
from relume.image.photograph import Photograph
from relume.image.response import Response
from relume.sphere.illumination import IlluminationMap


@dataclass(frozen=True, eq=False)
class Film:
    """What stands between radiance and pixel values.

    exposure : sensor exposure per unit of radiance (`Exposure.factor` of a photograph to be matched)
    response : a camera's recovered response; None for the sRGB curve, on which exposure 1 is white
    """

    exposure: float = 1.0
    response: Response | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.exposure) and self.exposure > 0):
            raise ValueError(f"exposure is {self.exposure}; expected a positive number")

    def brighter(self, stops: float) -> Film:
        """The same film exposed longer by `stops` factors of two."""
        return Film(self.exposure * 2.0**stops, self.response)


def metered(light: IlluminationMap) -> Film:
    """The film of a photographer with an incident light meter in that light, one stop under.

    The mean radiance, which a grey card would show at its own grey, becomes ½: reflected lights keep room above it.
    """
    mean = float(luminance(light.total())) / (4 * np.pi)
    return Film(0.5 / mean) if mean > 0 else Film()


def develop(radiance: np.ndarray, film: Film) -> Photograph:
    """Take a virtual photograph (H, W, 3) uint8 of radiance (H, W, 3) (Debevec & Malik 1997, §2.7, eq. 1).

    Exposure beyond the film's range saturates at 0 and 255, as it does in a camera.
    """
    exposed = np.asarray(radiance, np.float64) * film.exposure
    if film.response is None:
        values = 255 * encode_srgb(np.clip(exposed, 0, 1))
    else:
        values = film.response.pixel_values(exposed) * (255 / (film.response.levels - 1))
    return Photograph(np.rint(np.clip(values, 0, 255)).astype(np.uint8), "developed picture")
