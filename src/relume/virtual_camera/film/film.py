"""Developing: from scene-linear radiance to the pixel values a camera would have written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from relume.capture.scale.absolute import Scale, scale_from_exposure
from relume.errors import warn
from relume.image.colour import decode_srgb, encode_srgb, luminance
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import OUTSIDE, RadianceMap
from relume.image.response import Response, srgb_response
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.film.grain import Grain
from relume.virtual_camera.protocols import Adaptation, Relative
from relume.virtual_camera.view import View

MOST_BEYOND_RANGE = 0.5
"""Share of the lit pixels beyond one end above which a warning says so: more than an exposure for one part of a
picture leaves out."""
LOOKED_AT = 2**18
"""Pixels that are looked at; they give the share to a thousandth."""


def warn_of_range(
    radiance: np.ndarray,
    exposures: Callable[[np.ndarray], np.ndarray],
    least: np.ndarray,
    most: np.ndarray,
) -> None:
    """Warn where most lit pixels are beyond one end of a film's range: the picture shows little but that end.

    radiance : (H, W, 3); what is 0 is black in any picture and does not count
    exposures : gives the exposures (N, layers) of radiances (N, 3)
    least, most : (layers,) exposures at and beyond which all light makes the same density
    """
    step = max(1, int(np.sqrt(radiance.shape[0] * radiance.shape[1] / LOOKED_AT)))
    light = radiance[::step, ::step].reshape(-1, 3)
    light = light[light.max(1) > 0]
    if not light.size:
        return
    exposed = exposures(light)
    over, under = (exposed >= most).all(1).mean(), (exposed <= least).all(1).mean()
    if max(over, under) <= MOST_BEYOND_RANGE:
        return
    end, side, colour, where = (most, "most", "white", "above") if over > under else (least, "least", "black", "below")
    stops = float(np.log2(np.median(exposed.max(1)) / end.mean()))
    warn(
        f"{100 * max(over, under):.0f} % of the picture is {colour}: its middle is {abs(stops):.1f} stops {where} the "
        f"{side} exposure in the film's range; expose by {-stops:+.1f} stops or more"
    )


SATURATED = 1 + 2.0**-20
"""The display value of what a response saturates: rounding, by a matrix between primaries too, leaves it above 1."""


@dataclass(frozen=True, eq=False)
class Film(Relative):
    """What stands between radiance and pixel values.

    exposure : sensor exposure per unit of radiance (`Exposure.factor` of a photograph to be matched)
    response : a camera's recovered response; None for the sRGB curve, on which exposure 1 is white
    grain : that is added to the pixel values, 0 to 255; None for none. `pixel_values` gives the values without
    """

    exposure: float = 1.0
    response: Response | None = None
    grain: Grain | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.exposure) and self.exposure > 0):
            raise ValueError(f"exposure is {self.exposure}; expected a positive number")

    @staticmethod
    def of(
        exposure: Exposure,
        response: Response | None = None,
        *,
        scale: Scale | None = None,
        grain: Grain | None = None,
    ) -> Film:
        """The film in a camera at that shutter, aperture and ISO.

        exposure : shutter, aperture and ISO
        response : of the camera; None for one that writes sRGB as its ISO number promises (ISO 12232, standard output:
            10 / S lx·s make 118 of 255), for pictures in cd/m². Needs f-number and ISO
        scale : cd/m² per relative unit of that response, for pictures in cd/m²; None for relative ones on the
            response's own scale
        grain : that is added to the pixel values; None for none

        Raises NotABracket where f-number or ISO are needed and unknown, and ValueError for a scale without a response.
        """
        if response is None:
            if scale is not None:
                raise ValueError("a scale belongs to a camera's response; give that too, or neither")
            return Film(exposure.factor / scale_from_exposure(srgb_response(), exposure).luminance, grain=grain)
        if scale is None:
            return Film(exposure.factor, response, grain)
        # Where the scale differs between channels, that is part of the response.
        own = np.log(scale.factor) - np.log(scale.luminance)
        balanced = Response(response.log_exposure + own[:, None], response.noise)
        return Film(exposure.factor / scale.luminance, balanced if np.any(own) else response, grain)

    def brighter(self, stops: float) -> Film:
        """The same film exposed longer by `stops` factors of two."""
        return replace(self, exposure=self.exposure * 2.0**stops)

    def pixel_values(self, radiance: np.ndarray, levels: int = 256) -> np.ndarray:
        """The pixel values (H, W, 3) float64, 0 to levels − 1, of radiance (H, W, 3), neither rounded nor with grain.

        Exposure beyond the film's range saturates at both ends, as it does in a camera.
        """
        exposed = np.asarray(radiance, np.float64) * self.exposure
        if self.response is None:
            return (levels - 1) * encode_srgb(np.clip(exposed, 0, 1))
        return np.clip(self.response.pixel_values(exposed) * ((levels - 1) / (self.response.levels - 1)), 0, levels - 1)

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """Nothing: the exposure is the film's own, whatever `radiance` and `view` are."""
        return Adaptation(np.zeros(0))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Linear values (H, W, 3) float32, from 0, that sRGB encodes as this film's pixel values / 255.

        radiance, adaptation : (H, W, 3) float32 in the picture's unit, and what `adapt` returned

        Without a response what is brighter than white stays so: the display clips and counts it, and one with room
        above white shows it. A camera's response ends at 1: what is beyond it is SATURATED, a millionth above, which
        no screen shows brighter but which counts as beyond white. Grain is drawn with the view's seed. Warns where
        most of the picture is beyond what the response reaches.
        """
        from relume.virtual_camera.tone.luminance_curve import without_overflow

        least, most = np.full(3, decode_srgb(np.array(0.5 / 255))), np.ones(3)
        if self.response is not None:
            least, most = np.exp(self.response.log_exposure[:, [0, -1]]).T
        radiance = without_overflow(radiance, self.exposure)
        warn_of_range(radiance, lambda light: light * self.exposure, least, most)
        if self.response is None:
            shown = radiance * np.float32(self.exposure)
        else:
            from relume.virtual_camera.film.float_table import mapped, tabulated

            tables = np.stack([tabulated(_channel(self.response, c)) for c in range(3)])
            shown = mapped(radiance, self.exposure, tables)
        if self.grain is not None:
            _grained(shown, self.grain, view.grain_seed)
        return shown


def metered_film(light: EnvironmentMap) -> Film:
    """The film of a photographer with an incident light meter in that light, one stop under.

    light : in any mapping

    The mean radiance, which a grey card would show at its own grey, becomes ½: reflected lights keep room above it.
    """
    mean = float(luminance(light.total())) / (4 * np.pi)
    return Film(0.5 / mean) if mean > 0 else Film()


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

    picture : a radiance map
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
    values = Film.of(exposure, response, scale=scale).pixel_values(picture.radiance, response.levels)
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


def _channel(response: Response, channel: int) -> Callable[[np.ndarray], np.ndarray]:
    """Linear display value by exposure, of one channel."""
    curve, values = response.log_exposure[channel], np.arange(response.levels) / (response.levels - 1)

    def shown(exposed: np.ndarray) -> np.ndarray:
        reading = np.log(exposed)
        return np.where(reading > curve[-1], SATURATED, decode_srgb(np.interp(reading, curve, values)))

    return shown


def _grained(shown: np.ndarray, grain: Grain, seed: int) -> None:
    """Add grain in pixel values to own linear values (H, W, 3), in place."""
    from relume.virtual_camera.film.float_table import tabulated
    from relume.virtual_camera.film.grain_kernels import add_to_values

    def value(light: np.ndarray) -> np.ndarray:
        return 255 * encode_srgb(light)

    measured = zip(grain.values, grain.deviation, strict=True)
    tables = (
        tabulated(value),
        np.stack([tabulated(lambda light, known=known: np.interp(value(light), *known)) for known in measured]),
        tabulated(lambda values: decode_srgb(values / 255)),
    )

    def add(top: int, left: int, noise: np.ndarray) -> None:
        # What saturates does so without noise, being far above the largest value or clipped.
        part = shown[top : top + noise.shape[1], left : left + noise.shape[2]]
        add_to_values(part, noise, *tables)

    grain.noise(seed).each_square(shown.shape[0], shown.shape[1], add)


_DEPTHS = {256: np.uint8, 65536: np.uint16}
