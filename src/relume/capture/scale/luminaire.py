"""A calibration luminaire in the picture: what it is known to radiate sets scale and balance (§2.5, 2.6)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.capture.scale.absolute import Scale
from relume.capture.scale.regions import measured_patch
from relume.image.colour import luminance, triple
from relume.image.radiance import RadianceMap
from relume.image.response import Response

CERTIFIED = 0.02
"""Relative standard deviation of a luminaire whose radiance a laboratory certified."""


@dataclass(frozen=True)
class ChannelGains:
    """One gain a channel: the scaling factors that the three separately recovered curves leave open (§2.6).

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

    region : (H, W) bool, the luminaire's pixels
    radiance : its luminance, cd/m², for one factor in all channels; or linear Rec. 709 (r, g, b) in cd/m², for a factor
        a channel, which balances the colours as well (§2.6)
    deviation : relative, of the luminaire
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
    """The map with every channel multiplied by its gain, its variance by the square."""
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
