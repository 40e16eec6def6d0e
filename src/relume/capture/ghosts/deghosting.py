"""Deghosting: what moved while a bracket was taken is merged from one instant only.

Two frames disagree where their radiance differs by more than noise, the last part of a pixel of misregistration and
the misfit of the response explain. Connected places of disagreement are regions; each is taken from one frame and
those that agree with it, so that nothing is half transparent or cut. Where nothing disagrees nothing is changed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.capture.exposure.bracket import Bracket, without
from relume.capture.ghosts.levels import Scale, corrections
from relume.capture.ghosts.regions import excluded_frames, moving_regions
from relume.capture.merging import log_deviation
from relume.errors import NotABracket
from relume.image.response import Response

SQUARES = 800_000
"""About how many squares a large photograph is compared in: small enough to find a leaf, few enough to be quick."""
SAMPLED = 60_000
"""About how many squares show how the frames differ in scale."""


@dataclass(frozen=True)
class Consistency:
    """What two frames may differ by and still show the same.

    deviations : of noise that each frame may be off; 3 each let hardly one square in 10⁵ pass two frames by chance
    shift : pixels of misregistration; alignment leaves a quarter, lens distortion and sharpening as much again
    slack : misfit of the response, ln exposure; 0.05 is 5 %
    crosstalk : share of a pixel's brightest channel that a camera's colour matrix may mix into the others
    contrast : beyond all that, ln radiance, that something must differ by somewhere to have moved; 0.2 is 20 %
    """

    deviations: float = 3.0
    shift: float = 0.75
    slack: float = 0.05
    crosstalk: float = 0.03
    contrast: float = 0.2


@dataclass(frozen=True, eq=False)
class Deghosted:
    """A bracket whose moving things are left out of all frames but those that agree.

    bracket : the frames; one with nothing to leave out is the very photograph that was given
    ghosts : (H, W) bool, where anything was left out of any frame
    sources : (H, W) int16, the frame, counted from the least exposed, that a moving region was taken from; −1 elsewhere
    shares : (P,) the share of each frame's pixels that was left out
    reference : the frame that shows what moved with the fewest holes, from which regions are taken where it shows them;
        in a static bracket the frame with the fewest clipped squares
    """

    bracket: Bracket
    ghosts: np.ndarray
    sources: np.ndarray
    shares: np.ndarray
    reference: int


def deghost(bracket: Bracket, response: Response, *, method: Consistency = Consistency()) -> Deghosted:
    """Mark in each frame as outside what moved and is taken from another frame; a static bracket is left as it is.

    bracket : aligned photographs; what is outside in one of them already stays outside and says nothing here
    response : with the noise of its pixel values
    method : how far two frames may differ and still show the same

    Moving regions come from the reference, the frame with the fewest holes there: squares that it clips and no agreeing
    frame measures. A region of which another frame shows clearly more comes from that one. What is white in all of them
    comes from a frame of another moment that shows it nearly as bright, but not white. Every pixel keeps a frame.
    Raises NotABracket where the response is of another depth.
    """
    from relume.capture.ghosts.kernel import disagreement, square_bounds

    photographs, log_times = bracket.photographs, np.log(bracket.exposures)
    width, height = photographs[0].size
    depth = np.iinfo(photographs[0].pixels.dtype).max + 1
    if depth != response.levels:
        raise NotABracket(
            f"{bracket.name}: photographs of {depth} values and a response of {response.levels}; "
            "give the response of these photographs"
        )
    # Squares that the frames are compared in, and the noise of their means.
    side = max(2, int(np.ceil(np.sqrt(width * height / SQUARES))))
    deviation = log_deviation(response)
    scale = Scale(response.log_exposure, _ends(deviation, depth))
    exposures = np.exp(response.log_exposure).astype(np.float32)
    # Neighbours share the noise that JPEG and demosaicking leave: side pixels of a square count, not their square.
    noise = (method.deviations * deviation / np.sqrt(side)).astype(np.float32)
    # What each frame says of each square: bounds of its radiance, its middle, whether it measures.
    bounds, middle, measured = square_bounds(
        photographs, exposures, noise, scale.ends, log_times, side=side, shift=method.shift, crosstalk=method.crosstalk
    )
    shape = measured.shape[1:]
    # The frame that moving things are taken from, and corrections of the frames' scales to it.
    reference = int(np.argmax(measured.sum((1, 2))))
    step = max(1, int(np.sqrt(shape[0] * shape[1] / SAMPLED)))
    sampled = np.s_[::step, ::step]
    tables = corrections(
        bounds[:, :, sampled[0], sampled[1]].reshape(len(photographs), 2, -1, 3),
        middle[:, sampled[0], sampled[1]].reshape(len(photographs), -1, 3),
        log_times,
        scale,
        reference,
        slack=method.slack,
    )
    # Where frames disagree, the regions of that, and the frame each region comes from.
    apart = disagreement(bounds, middle, tables)
    regions = moving_regions(apart, contrast=method.contrast, reach=max(4, max(shape) // 50))
    if regions.count == 0:
        size = (height, width)
        return Deghosted(
            bracket, np.zeros(size, bool), np.full(size, -1, np.int16), np.zeros(len(photographs)), reference
        )
    excluded, sources, reference = excluded_frames(regions, bounds, measured, log_times)
    return _marked(bracket, excluded, sources, side, reference)


def _ends(deviation: np.ndarray, levels: int) -> np.ndarray:
    """(3, 2) the values at or below which a pixel is black, and from which on it is white.

    Black: what merging does not count in 8 bits, or noise of half of the exposure. White: JPEG leaves 249 to 254 in
    saturated patches, and sensors bend as much before they are full.
    """
    noisy = np.argmax(deviation < 0.5, axis=1)
    black = np.clip(np.maximum(noisy, 6 if levels == 256 else 1), 1, levels // 4)
    return np.stack([black, np.full(3, 249 * levels // 256)], axis=1)


def _marked(bracket: Bracket, excluded: np.ndarray, sources: np.ndarray, side: int, reference: int) -> Deghosted:
    """The squares that are left out, in the pixels of the frames."""
    width, height = bracket.photographs[0].size

    def in_pixels(squares: np.ndarray) -> np.ndarray:
        return squares.repeat(side, 0)[:height].repeat(side, 1)[:, :width]

    photographs, shares = [], []
    for photograph, squares in zip(bracket.photographs, excluded, strict=True):
        photographs.append(without(photograph, in_pixels(squares)) if squares.any() else photograph)
        shares.append(float(squares.mean()))
    ghosts = np.asarray(excluded.any(0))
    chosen = np.where(ghosts, sources, -1).astype(np.int16)
    return Deghosted(Bracket(tuple(photographs)), in_pixels(ghosts), in_pixels(chosen), np.array(shares), reference)
