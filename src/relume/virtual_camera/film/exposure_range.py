"""The range of exposures of a film, and a warning where most of a picture lies beyond it."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

MOST = 0.5
"""Share of the lit pixels beyond one end above which a warning says so: more than an exposure for one part of a
picture leaves out."""
LOOKED_AT = 2**18
"""Pixels that are looked at; they give the share to a thousandth."""


def warn_of_range(
    radiance: np.ndarray,
    exposures: Callable[[np.ndarray], np.ndarray],
    least: np.ndarray,
    most: np.ndarray,
    *,
    stacklevel: int = 3,
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
    if max(over, under) <= MOST:
        return
    end, side, colour, where = (most, "most", "white", "above") if over > under else (least, "least", "black", "below")
    stops = float(np.log2(np.median(exposed.max(1)) / end.mean()))
    warnings.warn(
        f"{100 * max(over, under):.0f} % of the picture is {colour}: its middle is {abs(stops):.1f} stops {where} the "
        f"{side} exposure in the film's range; expose by {-stops:+.1f} stops or more",
        stacklevel=stacklevel,
    )
