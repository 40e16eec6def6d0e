"""Frames of one bracket brought to one white where the camera changed its white balance between them.

A camera that balances white by itself multiplies the channels of each frame by other numbers. What neighbours share
shows them: one curve is fitted to all channels, and each channel's departure from it is that number
(`validation.compare`). Channels whose own curves differ depart too, so that smaller changes are left and doubted only
(`consistency`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.comparison import reduced
from relume.capture.exposure.validation import compare
from relume.errors import warn
from relume.image.photograph import Photograph

LEAST, MOST = 0.6 * float(np.log(2)), 1.5 * float(np.log(2))
"""ln exposure between the channels of two neighbours from which on, and up to which, a change is believed. Real
brackets of a fixed white show up to 0.4 stops; beyond the other end one of the two shows another scene or light."""
SHARED = 0.05
"""Share of a picture that its neighbour must show too."""


def of_one_white(bracket: Bracket) -> Bracket:
    """The bracket with all frames in the white of the middle one; itself where no white balance changed. Warns once.

    bracket : only cameras that say that they balance white by themselves are believed to
    """
    photographs = bracket.photographs
    if len(photographs) < 2 or not any(each.settings.automatic_white for each in photographs):
        return bracket
    # How far each frame's channels are from those of the first, along the chain of neighbours.
    pictures = [reduced(each) for each in photographs]
    order = np.argsort([picture.mean for picture in pictures], kind="stable")
    found = compare([pictures[i] for i in order], np.log(bracket.exposures[order]))
    offsets = np.zeros((len(photographs), 3))
    for place, (cast, shared) in enumerate(zip(found.casts, found.shared, strict=True)):
        believed = shared >= SHARED and np.all(np.isfinite(cast)) and LEAST <= np.ptp(cast) <= MOST
        offsets[order[place + 1]] = offsets[order[place]] + (cast if believed else 0.0)
    if not offsets.any():
        return bracket
    offsets -= offsets[order[len(order) // 2]]
    moved = [each.name for each, own in zip(photographs, offsets, strict=True) if own.any()]
    stops = np.ptp(offsets, axis=1).max() / np.log(2)
    others = f" and {len(moved) - 1} more" if len(moved) > 1 else ""
    warn(
        f"{moved[0]}{others}: automatic white balance moved colours by up to {stops:.1f} stops; by what "
        f"the frames share they are now as in {photographs[order[len(order) // 2]].name}: photograph with a fixed one"
    )
    return Bracket(tuple(_shifted(p, own, found.curve) for p, own in zip(photographs, offsets, strict=True)))


def _shifted(photograph: Photograph, offsets: np.ndarray, curve: np.ndarray) -> Photograph:
    """The photograph with each channel's exposure divided by exp(offset), by the curve (S,) over values 0 to 1."""
    if not offsets.any():
        return photograph
    most = int(np.iinfo(photograph.pixels.dtype).max)
    places, values = np.linspace(0, 1, len(curve)), np.arange(most + 1) / most
    pixels = np.empty_like(photograph.pixels)
    for channel, offset in enumerate(offsets):
        shifted = np.interp(np.interp(values, places, curve) - offset, curve, places)
        # What is white or black was beyond the range, and says no more in another white.
        shifted[[0, -1]] = 0, 1
        table = np.rint(most * shifted).astype(pixels.dtype)
        pixels[..., channel] = table[photograph.pixels[..., channel]]
    return replace(photograph, pixels=pixels)
