"""The way back from a photograph to radiance: `undevelop`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import Weighting, merge
from relume.image.colour_space import in_rec709, response_of
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import RadianceMap
from relume.image.response import Response, srgb_response
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.lens.undoing import undo_optics
from relume.virtual_camera.protocols import Optics
from relume.virtual_camera.view import View
from relume.virtual_camera.virtual_camera import VirtualCamera


@dataclass(frozen=True)
class AllButEnds:
    """Every value counts but the first and the last `guard` + 1, for photographs that no JPEG went through.

    guard : values beside the very ends that say nothing either; saturated patches of a JPEG file hold 250 to 254. −1
        where the ends count too
    """

    guard: int = 0

    @property
    def predicted(self) -> bool:
        """Never: no other photograph predicts a value."""
        return False

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels)."""
        inner = np.ones((3, response.levels))
        inner[:, : self.guard + 1] = inner[:, response.levels - 1 - self.guard :] = 0
        return inner


def undevelop(
    photograph: Photograph,
    film: Film,
    optics: Sequence[Optics] = (),
    view: View | None = None,
    *,
    weighting: Weighting = AllButEnds(),
) -> RadianceMap:
    """The radiance that this film recorded, before it passed the optics (Debevec & Malik 1997, eq. 5, one photograph).

    film : its exposure and response; the photograph's own EXIF exposure does not count. Without a response it is that
        of the photograph's profile, else sRGB, at its depth
    optics : of the lens, in the order in which light passed them; see `undo_optics`
    view : the photograph's field of view, for the optics; 50° across unless given
    weighting : which pixel values count; for one photograph weights have no other effect

    White pixels are flagged SATURATED with a lower bound, black ones BLACK with an upper bound; the variance is that of
    the response's deviation. For a photograph without noise the radiance is exact to half a step of the response:
    |Δ ln L| ≤ max(g(z + 1) − g(z)) / 2. Raises NotABracket where hardly any pixel is measured, and for a response of
    another depth than the photograph's.
    """
    levels = int(np.iinfo(photograph.pixels.dtype).max) + 1
    response = film.response or response_of(photograph) or srgb_response(levels)
    bracket = Bracket((replace(photograph, exposure=Exposure(film.exposure)),))
    picture = in_rec709(merge(bracket, response, weighting=weighting), photograph)
    return undo_optics(picture, optics, VirtualCamera().view(picture) if view is None else view) if optics else picture
