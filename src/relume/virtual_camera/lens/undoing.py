"""Taking a lens out of a picture again: `undo_optics` undoes what can be undone, the last part first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.errors import warn
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.virtual_camera.protocols import Optics, Undoable
from relume.virtual_camera.view import View

TAINTED = 0.01
"""Share of a pixel's light from clipped pixels above which it counts as clipped too, as `image.filtering` has it."""


def undo_optics(picture: RadianceMap, optics: Sequence[Optics], view: View) -> RadianceMap:
    """The radiance before it passed the optics. Parts that can be undone are undone, the last first.

    picture : a photograph's radiance
    optics : in the order in which light passed them. What cannot be undone is left in, with a warning that names it
    view : of the picture, by `VirtualCamera.view`

    What the picture does not show becomes OUTSIDE. Clipped marks go where their light goes. Deviations are taken back
    as light is: exactly where it is multiplied, and to an upper bound where it is resampled, for noise averages out.
    """
    radiance = picture.radiance
    deviation = None if picture.variance is None else np.sqrt(picture.variance)
    clipped = np.zeros(radiance.shape[:2], np.uint8) if picture.clipped is None else picture.clipped
    kinds = [kind for kind in (BLACK, SATURATED, OUTSIDE) if np.any(clipped == kind)]
    marks = {kind: _plane(clipped == kind) for kind in kinds}
    unknown = None
    if deviation is not None and not np.all(np.isfinite(deviation)):
        unknown = _plane(~np.isfinite(deviation))
        deviation = np.where(np.isfinite(deviation), deviation, np.float32(0))
    seen = _plane(np.ones(clipped.shape, bool))
    for step in reversed(optics):
        if not isinstance(step, Undoable):
            warn(f"{type(step).__name__} cannot be undone; it is left in the picture")
            continue
        radiance, seen = step.undo(radiance, view), step.undo(seen, view)
        deviation = None if deviation is None else step.undo(deviation, view)
        unknown = None if unknown is None else step.undo(unknown, view)
        marks = {kind: step.undo(mark, view) for kind, mark in marks.items()}
    shown = np.isfinite(radiance).all(2) & np.isfinite(seen).all(2)
    flags = np.zeros(clipped.shape, np.uint8)
    for kind, mark in marks.items():
        # A factor on all light is on its marks too.
        flags[(mark > TAINTED * seen).any(2)] = kind
    flags[~shown] = OUTSIDE
    variance = None if deviation is None else deviation**2
    if variance is not None:
        if unknown is not None:
            variance[unknown > TAINTED * seen] = np.inf
        variance[~shown] = np.inf
    # Pieces that were outside before say nothing, whatever was smeared into them.
    radiance = np.where((flags != OUTSIDE)[..., None], radiance, np.float32(0)).astype(np.float32)
    known = picture.clipped is not None or bool(flags.any())
    return replace(picture, radiance=radiance, variance=variance, clipped=flags if known else None)


def _plane(mask: np.ndarray) -> np.ndarray:
    """A mask (H, W) or (H, W, 3) as light (H, W, 3) float32 of 1 where it holds."""
    return np.broadcast_to(mask if mask.ndim == 3 else mask[..., None], (*mask.shape[:2], 3)).astype(np.float32)
