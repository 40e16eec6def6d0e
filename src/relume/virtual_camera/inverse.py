"""The virtual camera backwards: from a photograph's pixel values to the radiance in front of the lens."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.capture.weighting import Weighting
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response
from relume.virtual_camera.film.film import Film, srgb_response
from relume.virtual_camera.steps import Optics, Undoable
from relume.virtual_camera.view import View

TAINTED = 0.01
"""Share of a pixel's light from clipped pixels above which it counts as clipped too, as `image.filtering` has it."""


@dataclass(frozen=True)
class AllButEnds:
    """Every value counts but the first and the last `guard` + 1, for photographs that no JPEG went through.

    guard : values beside the very ends that say nothing either; saturated patches of a JPEG file hold 250 to 254
    """

    guard: int = 0

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels)."""
        inner = np.ones((3, response.levels))
        inner[:, : self.guard + 1] = inner[:, response.levels - 1 - self.guard :] = 0
        return inner


def radiance_of(photograph: Photograph, film: Film, *, weighting: Weighting = AllButEnds()) -> RadianceMap:
    """The radiance that this film would have made the photograph of (Debevec & Malik 1997, eq. 5, of one photograph).

    film : its exposure and response; the photograph's own EXIF exposure does not count. None as response stands for
        sRGB at the photograph's depth
    weighting : which pixel values count; for one photograph weights say no more

    What is white is flagged SATURATED with a lower bound, what is black BLACK with an upper bound; the variance is that
    of the response's deviation. Of what was developed without noise, radiance is told to half a step of the response:
    |Δ ln L| ≤ max(g(z + 1) − g(z)) / 2. Raises NotABracket where hardly any pixel is measured, and for a response of
    another depth than the photograph's.
    """
    levels = int(np.iinfo(photograph.pixels.dtype).max) + 1
    response = srgb_response(levels) if film.response is None else film.response
    return merge(Bracket((replace(photograph, exposure=Exposure(film.exposure)),)), response, weighting=weighting)


def undoable(optics: Sequence[Optics]) -> tuple[Undoable, ...]:
    """Those of the optics that `undone_all` undoes, in the order in which it does: the last that light passed first."""
    return tuple(step for step in reversed(optics) if isinstance(step, Undoable))


def undone_all(picture: RadianceMap, optics: Sequence[Optics], view: View) -> RadianceMap:
    """The radiance before it passed the optics: those that can be are undone, the last first.

    optics : in the order in which light passed them. What cannot be undone is left in, with a warning that names it;
        `undoable(optics)` tells the rest

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
            warnings.warn(f"{type(step).__name__} cannot be undone; it is left in the picture", stacklevel=2)
            continue
        radiance, seen = step.undone(radiance, view), step.undone(seen, view)
        deviation = None if deviation is None else step.undone(deviation, view)
        unknown = None if unknown is None else step.undone(unknown, view)
        marks = {kind: step.undone(mark, view) for kind, mark in marks.items()}
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
