"""Whether a merged map has the hues of its photographs: channels that were tied wrongly tint everything alike."""

from __future__ import annotations

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.consistency import BracketDoubt
from relume.image.colour import decode_srgb
from relume.image.radiance import RadianceMap

LOOKED_AT = 40_000
"""About how many pixels of each photograph are compared."""
WELL = (30 / 255, 225 / 255)
"""Share of white between which all channels of a pixel lie whose hue is compared."""
FEWEST = 300
FAR = 0.8
"""Stops by which a channel may stand off green, merged, beyond what the photographs show, a median over all places.
Seven of eight real sets stay within 0.6; cameras whose curves differ much by channel reach 0.7."""


def hue_departure(bracket: Bracket, picture: RadianceMap) -> np.ndarray | None:
    """(3,) stops by which the map's channels stand off green beyond what its photographs show as sRGB; 0 for green.

    bracket : aligned as it was merged
    None where too little is well exposed. A median over places and photographs: contrast stretches colours, but
    greys stay grey.
    """
    width, height = bracket.photographs[0].size
    step = max(1, int(np.sqrt(width * height / LOOKED_AT)))
    light = picture.radiance[::step, ::step]
    apart = []
    for photograph in bracket.photographs:
        shown = photograph.pixels[::step, ::step] / np.float32(np.iinfo(photograph.pixels.dtype).max)
        well = (shown.min(-1) > WELL[0]) & (shown.max(-1) < WELL[1]) & (light.min(-1) > 0)
        if photograph.outside is not None:
            well &= ~photograph.outside[::step, ::step]
        merged, own = np.log2(light[well]), np.log2(decode_srgb(shown[well]))
        apart.append((merged - merged[:, 1:2]) - (own - own[:, 1:2]))
    together = np.concatenate(apart)
    return np.median(together, axis=0) if len(together) >= FEWEST else None


def hue_doubts(bracket: Bracket, picture: RadianceMap, *, given: bool = False) -> tuple[BracketDoubt, ...]:
    """A doubt where the map's hues are plainly others than those of the photographs.

    given : whether the response is that of a profile, and not recovered from the photographs
    """
    departure = hue_departure(bracket, picture)
    if departure is None or np.abs(departure).max() < FAR:
        return ()
    channel = int(np.argmax(np.abs(departure)))
    name, side = ("red", "green", "blue")[channel], "brighter" if departure[channel] > 0 else "darker"
    return (
        BracketDoubt(
            bracket.name,
            f"merged, {name} is {abs(departure[channel]):.1f} stops {side} beside green than the photographs show it",
            "the profile is of another camera or picture style: give this camera's, or none to recover its response"
            if given
            else "tie the channels at a value that all show with --neutral, 128 for film, or give the camera's profile",
            degraded=True,
            # One of three channels, by so much.
            effect=float(2.0 ** np.abs(departure[channel]) - 1) / 3,
        ),
    )
