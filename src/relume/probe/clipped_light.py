"""Light that photographs hold only in part: of a single one, and of lamps that were saturated in some channels only.

`in_the_colour_beside`: near white a camera's curve is steep and hardly known, so that the bound of a channel that was
white in every photograph lies far above the other channels, which were measured: a warm lamp comes out pure red. A
lower bound may be lowered and stays one; what was measured is never changed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation, gaussian_filter

from relume.image.colour import luminance
from relume.image.colour_space import decoded, in_rec709
from relume.image.photograph import Photograph
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response

WHITE = 250 / 255
"""Share of the highest pixel value from which on a channel counts as saturated: JPEG leaves white unsure by as much."""
BESIDE = 2.0
"""Standard deviation, in pixels, of the weights of what is beside: beyond the blur of a lens, within a lamp's halo."""


def linear(photograph: Photograph, response: Response | None = None) -> RadianceMap:
    """One photograph as radiance: relative to its exposure where it holds one, else white is 1.

    response : of the camera; unless given the curve of the photograph's profile, else sRGB, which cameras only roughly
        follow (a tone curve brightens the middle)

    Its primaries are those of Rec. 709, whatever the photograph's are; a colour outside has a negative channel.

    Its `clipped` marks what is white in any channel, where radiance is a lower bound, and what is black in all.
    """
    greatest = float(np.iinfo(photograph.pixels.dtype).max)
    encoded = photograph.pixels / np.float32(greatest)
    if response is None:
        light = decoded(photograph)
    else:
        places = np.linspace(0, 1, response.levels)
        own = np.stack([np.exp(np.interp(encoded[..., c], places, g)) for c, g in enumerate(response.log_exposure)], -1)
        light = in_rec709(RadianceMap(own.astype(np.float32)), photograph).radiance
    if photograph.exposure is not None:
        light = light / photograph.exposure.factor
    clipped = np.where((encoded >= WHITE).any(-1), SATURATED, 0).astype(np.uint8)
    clipped[(photograph.pixels == 0).all(-1)] = BLACK
    if photograph.outside is not None:
        clipped[photograph.outside] = OUTSIDE
        light = np.where(photograph.outside[..., None], 0, light)
    return RadianceMap(light.astype(np.float32), clipped=clipped)


def in_the_colour_beside(picture: RadianceMap) -> tuple[RadianceMap, int]:
    """The picture with the bounds of saturated channels no higher than the colour beside them has it; how many pixels.

    picture : its infinite variance shows which channels of a SATURATED pixel were white in every photograph; given
        back as it is without

    A bound is lowered to the level that the measured channels of its pixel and the colour of the measured pixels round
    it show, but not below the brightest of the measured channels: it was white where that one was not yet. A pixel
    that is white in every channel keeps its bounds, and so does one with nothing measured beside it.
    """
    if picture.clipped is None or picture.variance is None:
        return picture, 0
    white = (picture.clipped == SATURATED)[..., None] & np.isinf(picture.variance)
    some = white.any(-1) & ~white.all(-1)
    if not some.any():
        return picture, 0
    colour, known = _colour_beside(picture, some)
    rows, columns = np.nonzero(some)
    rows, columns = rows[known], columns[known]
    bounds, unmeasured = picture.radiance[rows, columns], white[rows, columns]
    measured = np.where(unmeasured, 0, bounds)
    level = (measured / colour[known]).max(-1, keepdims=True)
    wanted = np.maximum(level * colour[known], measured.max(-1, keepdims=True))
    # A conversion from wide primaries takes the bounds of the others from a measured channel, down to 0 and below: it
    # says nothing then, and has the colour beside it as well.
    spoilt = ~unmeasured & (bounds <= 0)
    least = np.where(unmeasured, bounds / colour[known], np.inf).min(-1, keepdims=True)
    lowered = np.where(unmeasured & (level > 0), np.minimum(bounds, wanted), bounds)
    lowered = np.where(spoilt, np.minimum(least * colour[known], bounds.max(-1, keepdims=True)), lowered)
    radiance = picture.radiance.copy()
    radiance[rows, columns] = lowered
    return replace(picture, radiance=radiance), int(np.any(lowered != bounds, axis=-1).sum())


def _colour_beside(picture: RadianceMap, some: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The mean colour (K, 3) of measured light round each of the chosen pixels, and whether there is any, (K,) bool."""
    assert picture.clipped is not None
    # Only what is near a chosen pixel is blurred.
    reach = int(4 * BESIDE) + 1
    rows, columns = (np.flatnonzero(some.any(axis)) for axis in (1, 0))
    window = tuple(slice(max(int(at[0]) - reach, 0), int(at[-1]) + reach + 1) for at in (rows, columns))
    light = picture.radiance[window].astype(np.float64)
    # Bright light counts most: it is the lamp's own, and the dim beside it is the wall.
    brightness = np.maximum(luminance(light), 0) * (picture.clipped[window] == 0)
    weighted = np.stack([gaussian_filter(light[..., c] * brightness, BESIDE) for c in range(3)], axis=-1)
    near = binary_dilation(brightness > 0, iterations=reach - 1)
    chosen = some[window]
    colour = weighted[chosen]
    total = colour.sum(-1, keepdims=True)
    known = near[chosen] & (colour.min(-1) > 1e-6 * total[..., 0]) & (total[..., 0] > 0)
    return np.divide(colour, total, out=np.ones_like(colour), where=total > 0), known
