"""The absolute scale of a radiance map: cd/m² per relative unit, and how sure it is (Debevec & Malik 1997, §2.5).

A colour (r, g, b) in cd/m² is one whose luminance 0.2126 r + 0.7152 g + 0.0722 b is in cd/m²; white has r = g = b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from relume.capture.scale.regions import disc, measured_patch
from relume.errors import NotABracket, warn
from relume.image.colour import luminance, triple
from relume.image.photograph import Exposure
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.sphere.environment_map import EnvironmentMap

THIRD_OF_A_STOP = float(np.log(2) / 3)
"""How well ISO, f-number and q determine the exposure: makers round the rating to thirds of a stop, f-numbers leave out
what the lens absorbs, and the light meter's own constant (K = 12.5) differs from the rating's by 0.3 stops."""
METER = 0.05
"""Half of the 10 % by which a lux or luminance meter of class B may err in all (DIN 5032-7)."""
Q = 0.65
"""q of ISO 12232, of the focal plane's exposure H = q L t / N² in lx·s: (π/4) T v cos⁴θ, T = 0.9, v = 0.98, θ = 10°."""


@dataclass(frozen=True)
class Scale:
    """The factor from relative radiance to cd/m².

    factor : one a channel; all alike unless a source of known colour sets them apart
    deviation : standard deviation of ln factor, so 0.05 is about 5 %
    source : what it was measured with, for the report and for messages
    """

    factor: tuple[float, float, float]
    deviation: float
    source: str

    def __post_init__(self) -> None:
        if len(self.factor) != 3 or not all(np.isfinite(f) and f > 0 for f in self.factor):
            raise ValueError(f"factor is {self.factor}; a scale is three positive numbers")
        if not (np.isfinite(self.deviation) and self.deviation >= 0):
            raise ValueError(f"deviation is {self.deviation}; expected a finite number not below 0")

    @staticmethod
    def grey(factor: float, deviation: float, source: str) -> Scale:
        """One factor for all channels, with its deviation and source.

        factor : from relative radiance to cd/m²
        deviation : standard deviation of ln factor
        source : what it was measured with
        """
        return Scale((factor, factor, factor), deviation, source)

    @property
    def luminance(self) -> float:
        """Luminance, cd/m², of relative radiance (1, 1, 1)."""
        return float(luminance(np.array(self.factor)))

    def __str__(self) -> str:
        return f"{self.luminance:.4g} cd/m² ± {100 * self.deviation:.2g} % per relative unit, from {self.source}"


@dataclass(frozen=True)
class Rating:
    """What a camera's ISO number S promises: the pixel value that a focal plane exposure of `lux_seconds` / S makes.

    lux_seconds : lx·s at S = 1
    value : that pixel value as a share of the largest
    """

    lux_seconds: float
    value: float


STANDARD_OUTPUT = Rating(10.0, 118 / 255)
"""ISO 12232 standard output sensitivity, what JPEG files are rated by: 10/S lx·s make sRGB value 118 of 255."""
SATURATION = Rating(78.0, 1.0)
"""ISO 12232 saturation-based speed, what raw values are rated by: 78/S lx·s saturate."""


def scale_from_exposure(
    response: Response, exposures: Exposure | Sequence[Exposure], *, rating: Rating = STANDARD_OUTPUT
) -> Scale:
    """The scale from shutter, aperture and ISO (Debevec & Malik 1997, §2.5; ISO 12232).

    response : the one the map was merged with; its zero is the scale of the relative radiance
    exposures : of the merged photographs; every one needs its f-number and ISO, for `Exposure.factor` takes an unknown
        one as 1 and 100
    rating : what S means: the standard output sensitivity of JPEG files unless given

    With H = q L t / N² = K / S at the rated value z and X = L' t (S/100) / N² = f⁻¹(z), the scale L / L' is
    K / (100 q X), whatever t, N and S. Its uncertainty is a third of a stop.
    Raises NotABracket where f-number or ISO is unknown.
    """
    value = rating.value * (response.levels - 1)
    curves = [np.interp(value, np.arange(response.levels), g) for g in response.log_exposure]
    return _rated(float(luminance(np.exp(curves))), exposures, rating)


def scale_from_saturation(saturation: float, exposures: Exposure | Sequence[Exposure]) -> Scale:
    """The scale of linear raw photographs from the saturation-based speed (ISO 12232): 78/S lx·s saturate.

    saturation : relative radiance × `Exposure.factor` at which the raw values saturate
    exposures : what the photographs were set to
    Raises NotABracket where f-number or ISO is unknown.
    Raises ValueError for a saturation that is not above 0.
    """
    if not (np.isfinite(saturation) and saturation > 0):
        raise ValueError(f"saturation is {saturation}; expected a positive exposure")
    return _rated(saturation, exposures, SATURATION)


def _rated(exposure: float, exposures: Exposure | Sequence[Exposure], rating: Rating) -> Scale:
    for one in [exposures] if isinstance(exposures, Exposure) else exposures:
        for name, value in (("f-number", one.f_number), ("ISO", one.iso)):
            if value is None:
                raise NotABracket(
                    f"a photograph of {one.seconds:.4g} s has no {name}, so its exposure says nothing of cd/m²; "
                    "give a spot-meter or lux reading"
                )
    return Scale.grey(rating.lux_seconds / (100 * Q * exposure), THIRD_OF_A_STOP, "shutter, aperture and ISO")


def scale_from_spot(
    picture: RadianceMap, x: int, y: int, reading: float, *, radius: float = 4.0, deviation: float = METER
) -> Scale:
    """The scale from a spot meter's reading of one place.

    picture : a radiance map in relative units
    x, y : column and row of the pixel in the middle of the spot, from 0 at the top left
    reading : cd/m²
    radius : pixels of the disc whose mean is compared; a few average noise and keep within what a person would point
        at. A spot meter sees 1°: half of that is 0.0087 times the focal length in pixels
    deviation : relative, of the meter; 0.05 as of a good one

    Unevenness within the disc counts as uncertainty: spot and disc never coincide.
    Raises ValueError for a place that is clipped or outside the picture.
    """
    patch = measured_patch(picture, disc(picture.size, x, y, radius))
    scale = _positive("reading", reading) / patch.luminance
    if patch.uncertainty > THIRD_OF_A_STOP:
        warn(
            f"the spot at {x}, {y} is uneven to {100 * patch.uncertainty:.0f} %, worse than by shutter and aperture; "
            "meter an even place"
        )
    return Scale.grey(scale, float(np.hypot(deviation, patch.uncertainty)), f"a spot-meter reading at {x}, {y}")


def scale_from_lux(
    picture: RadianceMap,
    region: np.ndarray,
    illuminance: float,
    *,
    reflectance: float = 0.18,
    deviation: float = METER,
) -> Scale:
    """The scale from a lux reading at a matte card: L = ρ E / π.

    picture : a radiance map in relative units
    region : (H, W) bool, the card's pixels
    illuminance : lx, read on the card and facing as it does
    reflectance : ρ of the card; 0.18 is a photographer's grey card
    deviation : relative, of meter and card together; 0.05 as of good ones
    Raises ValueError for a reflectance that is not above 0 and up to 1.
    """
    if not 0 < reflectance <= 1:
        raise ValueError(f"reflectance is {reflectance}; expected a number above 0 and up to 1")
    patch = measured_patch(picture, region)
    scale = reflectance * _positive("illuminance", illuminance) / np.pi / patch.luminance
    return Scale.grey(scale, float(np.hypot(deviation, patch.uncertainty)), "a lux reading at a card")


def scale_from_illuminance(
    light: EnvironmentMap,
    illuminance: float,
    *,
    normal: tuple[float, float, float] = (0.0, 1.0, 0.0),
    deviation: float = METER,
) -> Scale:
    """The scale from a lux reading where the light was captured: E = ∫ L max(0, ω·n) dω.

    light : the whole sphere of it, in relative units; clipped lamps make it too dark and the scale too large
    illuminance : lx on a plane that faces `normal`; upwards unless given, as a meter lies on a table
    deviation : relative, of the meter; 0.05 as of a good one
    Raises ValueError where no light of the map reaches the plane.
    """
    direction = np.asarray(normal, np.float64)
    light_sum = float(luminance(light.irradiance(direction / np.linalg.norm(direction))))
    if not light_sum > 0:
        raise ValueError("no light of the map reaches that plane; give the direction that the lux meter faced")
    return Scale.grey(_positive("illuminance", illuminance) / light_sum, deviation, "a lux reading")


def combine_scales(scales: Sequence[Scale]) -> Scale:
    """The one scale of several sources, each counted by its certainty; warns where two disagree.

    scales : of one camera and response; one at least

    Where they scatter more than their deviations allow, the result's deviation grows by as much (Birge 1932).
    Warns where two differ by more than two standard deviations.
    Raises ValueError where none is given.
    """
    if not scales:
        raise ValueError("no scales were given; combine at least one")
    if len(scales) == 1:
        return scales[0]
    for one, other in combinations(scales, 2):
        apart = abs(float(np.log(one.luminance / other.luminance)))
        allowed = 2 * float(np.hypot(one.deviation, other.deviation))
        if apart > allowed:
            warn(
                f"{one.source} and {other.source} disagree by {apart / np.log(2):.2f} stops, more than the "
                f"{allowed / np.log(2):.2f} they are sure of; check the readings"
            )
    weights = np.array([max(s.deviation, 1e-6) ** -2 for s in scales])
    logarithms = np.log([s.factor for s in scales])
    mean = weights @ logarithms / weights.sum()
    light = np.log([s.luminance for s in scales])
    spread = float(weights @ (light - weights @ light / weights.sum()) ** 2) / (len(scales) - 1)
    deviation = float(np.sqrt(max(spread, 1.0) / weights.sum()))
    return Scale(triple(np.exp(mean)), deviation, " and ".join(s.source for s in scales))


def apply_scale(picture: RadianceMap, scale: Scale) -> RadianceMap:
    """The map in cd/m², its variance multiplied by the square; the scale's own uncertainty stands in its attributes.

    picture : a map in relative units
    scale : the factor to cd/m²

    It is common to all pixels, so the variance plane, which is each pixel's own, does not hold it.
    Raises ValueError for a map that is in cd/m² already.
    """
    if picture.unit == "cd/m²":
        raise ValueError(
            "the radiance map is in cd/m² already; to scale it anew, declare it relative first: "
            'dataclasses.replace(picture, unit="relative")'
        )
    # In float32 throughout: a map of 45 megapixels would take a gigabyte in double.
    factor = np.array(scale.factor, np.float32)
    return replace(
        picture,
        radiance=picture.radiance * factor,
        variance=None if picture.variance is None else picture.variance * factor**2,
        unit="cd/m²",
        attributes={**picture.attributes, "scale": str(scale)},
    )


def _positive(name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{name} is {value}; expected a positive number")
    return float(value)
