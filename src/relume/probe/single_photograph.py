"""Light from a single photograph, of a ball or one view of a panorama: linear, as far as it is not clipped."""

from __future__ import annotations

import numpy as np

from relume.image.colour import decode_srgb
from relume.image.photograph import Photograph
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response

WHITE = 250 / 255
"""Share of the highest pixel value from which on a channel counts as saturated: JPEG leaves white unsure by as much."""


def linear(photograph: Photograph, response: Response | None = None) -> RadianceMap:
    """One photograph as radiance: relative to its exposure where it holds one, else white is 1.

    response : of the camera; sRGB unless given, which cameras only roughly follow (a tone curve brightens the middle)

    Its `clipped` marks what is white in any channel, where radiance is a lower bound, and what is black in all.
    """
    greatest = float(np.iinfo(photograph.pixels.dtype).max)
    encoded = photograph.pixels / np.float32(greatest)
    if response is None:
        light = decode_srgb(encoded)
    else:
        places = np.linspace(0, 1, response.levels)
        light = np.stack(
            [np.exp(np.interp(encoded[..., c], places, g)) for c, g in enumerate(response.log_exposure)], -1
        )
    if photograph.exposure is not None:
        light = light / photograph.exposure.factor
    clipped = np.where((encoded >= WHITE).any(-1), SATURATED, 0).astype(np.uint8)
    clipped[(photograph.pixels == 0).all(-1)] = BLACK
    if photograph.outside is not None:
        clipped[photograph.outside] = OUTSIDE
        light = np.where(photograph.outside[..., None], 0, light)
    return RadianceMap(light.astype(np.float32), clipped=clipped)
