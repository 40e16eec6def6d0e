"""Where photographs saturate: the value at which each frame ends, channel by channel.

Exposures are monotone: what is white in a shorter frame is white in a longer one, whatever its pixel value. So a frame
whose bright parts were pressed together afterwards, as telephones do, shows its own white where a shorter one is white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.response.sampling import levels_of
from relume.image.filtering import eroded
from relume.image.photograph import Photograph

WHITE = 250 / 256
"""Share of the values from which on a pixel is white: JPEG leaves as much below 255 in saturated patches."""
LOOKED_AT = 400_000
"""About how many pixels of a frame are looked at for its plateau."""
FEWEST = 60
"""Places that must be white in a shorter frame before a longer one's plateau is believed."""
LOWEST = 0.6
"""Share of the values below which no plateau is believed: a camera's white is bright, and what is darker has moved."""
SPREAD = 14 / 256
"""Share of the values over which eight tenths of a plateau may be spread, by noise and JPEG."""


EDGE = 2
"""Pixels about what is not white that do not count as white."""


@dataclass(frozen=True)
class White:
    """The value at which a channel of a frame ends, as places show it that are white in a shorter frame.

    name : of the frame
    channel : 0 red, 1 green, 2 blue
    value : that nine tenths of the places do not exceed
    least : the value from which on it counts as white; None where that is as for every photograph
    """

    name: str
    channel: int
    value: int
    least: int | None


def whitened(bracket: Bracket) -> tuple[Bracket, tuple[White, ...]]:
    """The bracket with each frame's plateau, where it has one below white, made white; and where its channels end.

    bracket : aligned, so that a place is the same in all frames
    """
    photographs = list(bracket.photographs)
    levels = levels_of(bracket)
    width, height = photographs[0].size
    step = max(1, round(np.sqrt(width * height / LOOKED_AT)))
    white = np.zeros((*photographs[0].pixels[::step, ::step].shape[:2], 3), bool)
    found: list[White] = []
    for index, photograph in enumerate(photographs):
        small = photograph.pixels[::step, ::step]
        inside = np.ones(small.shape[:2], bool)
        if photograph.outside is not None:
            inside = ~photograph.outside[::step, ::step]
        ends = [_end(small[..., c], inside, white[..., c] & inside, levels) for c in range(3)]
        found += [White(photograph.name, c, *end) for c, end in enumerate(ends) if end is not None]
        if any(end is not None and end[1] is not None for end in ends):
            photographs[index] = photograph = _made_white(photograph, found[-3:], levels)
            small = photograph.pixels[::step, ::step]
        # The insides of what is white: at its edges frames are out of register, and JPEG rings.
        white |= eroded(small >= WHITE * levels, EDGE) & inside[..., None]
    pressed = any(each.least is not None for each in found)
    return (replace(bracket, photographs=tuple(photographs)) if pressed else bracket), tuple(found)


def _end(values: np.ndarray, inside: np.ndarray, white: np.ndarray, levels: int) -> tuple[int, int | None] | None:
    """Where a channel of a frame ends where shorter ones are white, and from which value on it counts as white.

    None for the latter where it is white there too; None at all where nothing says so, or something moved.
    """
    there = values[white]
    if len(there) < FEWEST:
        return None
    least, low, middle, high = np.percentile(there, (2, 10, 50, 90))
    if middle >= WHITE * levels:
        return int(high), None
    if middle < LOWEST * levels or high - low > SPREAD * levels:
        return None
    # It ends there: hardly anything is brighter than what saturated.
    spread = max(high - middle, middle - low, levels / 128)
    everywhere = values[inside]
    near = np.count_nonzero(np.abs(everywhere.astype(np.int64) - middle) <= 2 * spread)
    if np.count_nonzero(everywhere > middle + 3 * spread) > 0.1 * near:
        return None
    return int(high), int(min(least, middle - spread))


def _made_white(photograph: Photograph, ends: Sequence[White], levels: int) -> Photograph:
    pixels = photograph.pixels.copy()
    for end in ends:
        if end.name == photograph.name and end.least is not None:
            channel = pixels[..., end.channel]
            channel[channel >= end.least] = levels - 1
    return replace(photograph, pixels=pixels)
