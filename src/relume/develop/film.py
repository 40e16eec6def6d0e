"""Developing: from scene-linear radiance to the pixel values a camera would have written."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.capture.absolute import Scale
from relume.image.colour import encode_srgb, luminance
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import OUTSIDE, RadianceMap
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
    return Photograph(np.rint(developed_values(radiance, film)).astype(np.uint8), "developed picture")


def developed_values(radiance: np.ndarray, film: Film) -> np.ndarray:
    """The pixel values (H, W, 3) float64, 0 to 255, that `develop` rounds."""
    exposed = np.asarray(radiance, np.float64) * film.exposure
    if film.response is None:
        return 255 * encode_srgb(np.clip(exposed, 0, 1))
    return np.clip(film.response.pixel_values(exposed) * (255 / (film.response.levels - 1)), 0, 255)


def virtual_photograph(
    picture: RadianceMap,
    response: Response,
    exposure: Exposure,
    *,
    scale: Scale | None = None,
    noise: np.random.Generator | None = None,
    name: str = "virtual photograph",
) -> Photograph:
    """Photograph a radiance map with any camera at any exposure (Debevec & Malik 1997, §2.7, eq. 1).

    response : the camera's; 256 values make 8-bit pixels, 65536 make 16-bit ones. It may be another than the one the
        map was merged with; then the zeros of both must have been set alike, or both have a scale
    exposure : shutter, aperture and ISO, which the photograph carries
    scale : cd/m² per relative unit of that response, for maps in cd/m²
    noise : draws the camera's noise, by the response's deviation at each pixel value; None for none. The same seed
        gives the same pixels. What saturates does so without noise, being far above the largest value or clipped
    name : of the photograph

    Pixels outside the map are 0 and outside the photograph. Raises ValueError for a response of other levels, and for
    a map in cd/m² without a scale (or the other way round).
    """
    if response.levels not in _DEPTHS:
        raise ValueError(f"the response has {response.levels} values; photographs have 256 or 65536")
    if (picture.unit == "cd/m²") != (scale is not None):
        raise ValueError(
            f"the map's unit is {picture.unit} and scale is {scale}; give the response's scale with a map in cd/m², "
            "and none with a relative one"
        )
    light = picture.radiance.astype(np.float64)
    values = response.pixel_values(light * (exposure.factor / np.array(1.0 if scale is None else scale.factor)))
    if noise is not None:
        values = _noisy(values, response, noise)
    outside = None if picture.clipped is None else picture.clipped == OUTSIDE
    pixels = np.rint(np.clip(values, 0, response.levels - 1)).astype(_DEPTHS[response.levels])
    if outside is not None and outside.any():
        pixels[outside] = 0
    return Photograph(pixels, name, exposure, outside=outside if outside is not None and outside.any() else None)


def _noisy(values: np.ndarray, response: Response, generator: np.random.Generator) -> np.ndarray:
    """The values with the noise that makes up the response's deviation once they are rounded."""
    steps = np.arange(response.levels, dtype=np.float64)
    # Rounding adds the variance of an even spread over one value.
    sigma = np.sqrt(np.maximum(response.deviation**2 - 1 / 12, 0))
    spread = np.stack([np.interp(values[..., c], steps, sigma[c]) for c in range(3)], axis=-1)
    spread[values >= response.levels - 1] = 0.0
    return values + spread * generator.standard_normal(values.shape)


_DEPTHS = {256: np.uint8, 65536: np.uint16}
