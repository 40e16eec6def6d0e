"""Where things moved, which frame each such region is taken from, and which other frames agree with it there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

_TOUCHING = np.ones((3, 3), bool)
_DISC = ndimage.iterate_structure(ndimage.generate_binary_structure(2, 1), 2)
DARKER = 2 * np.log(2)
"""ln radiance by which what another frame shows may be darker than a white place is at least, to stand for it."""
GROWN = 2
"""Squares by which a region is grown: its edge is blurred, and mixes what moved with what did not."""


@dataclass(frozen=True, eq=False)
class Regions:
    """Connected regions in which the frames of a bracket disagree.

    labels : (h, w) int32, 0 where nothing moved, else the number of the region
    count : how many
    """

    labels: np.ndarray
    count: int


def moving_regions(apart: np.ndarray, *, contrast: float, reach: int) -> Regions:
    """The regions of squares that disagree.

    apart : (h, w) how far apart the frames are, ln radiance, positive where they disagree
    contrast : by which a region must be apart somewhere, else it is noise
    reach : squares over which regions count as one, so that a person whose coat looks like the wall is not cut
    """
    weak = apart > 0
    # Edges out of register are lines one square wide; what moved is wider.
    seeds = np.asarray(ndimage.binary_opening(weak, np.ones((2, 2))), bool) & (apart > contrast)
    labels, count = _labelled(weak)
    enough = np.zeros(count + 1, bool)
    enough[labels[seeds]] = True
    moving = ndimage.binary_dilation(enough[labels], _TOUCHING, iterations=GROWN) if enough.any() else enough[labels]
    # Grown by a square filter, which is separable, so that a long reach costs no more.
    grown = ndimage.maximum_filter(moving.view(np.uint8), 2 * reach + 1).view(bool) if moving.any() else moving
    joined, count = _labelled(grown)
    return Regions(np.where(moving, joined, 0).astype(np.int32), count)


def _dilated(mask: np.ndarray) -> np.ndarray:
    return np.asarray(ndimage.binary_dilation(mask, _TOUCHING), bool)


def _labelled(mask: np.ndarray) -> tuple[np.ndarray, int]:
    labels = np.empty(mask.shape, np.int32)
    return labels, int(ndimage.label(mask, _TOUCHING, output=labels))  # pyright: ignore[reportArgumentType]


def excluded_frames(
    regions: Regions, bounds: np.ndarray, measured: np.ndarray, log_times: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """Which frames to leave out where, (P, h, w) bool; the source of each square (h, w), −1 for none; the reference.

    bounds : (P, 2, h, w, 3) least and greatest ln radiance
    measured : (P, h, w) whether a frame measures all of a square

    The reference is the frame that shows what moved with the fewest holes. A square that is white in every frame of
    its region's moment, and in another frame is not, though hardly darker, comes from that frame: of two moments the
    one that was measured.
    """
    from relume.capture.ghosts.kernel import consensus

    count, where = len(bounds), np.nonzero(regions.labels)
    labels = regions.labels[where]
    within = np.ascontiguousarray(bounds[:, :, where[0], where[1]])
    known = measured[:, where[0], where[1]]
    agreeing, unsure = np.empty((count, count, len(labels)), bool), np.empty(len(labels), bool)
    holes = np.empty((count, regions.count + 1))
    for source in range(count):
        order = np.argsort(np.abs(log_times - log_times[source]), kind="stable")
        order = np.concatenate([[source], order[order != source]])
        consensus(within, order, agreeing[source], unsure)
        # A hole is a square that some frame measures, but none of those that agree with the source; where those
        # that fill the source's holes disagree among each other, they are not its instant either.
        hole = (known.any(0) & ~(agreeing[source] & known).any(0)) | unsure
        holes[source] = np.bincount(labels[hole], minlength=regions.count + 1)
    reference = int(np.argmin(holes.sum(1) - 1e-9 * measured.sum((1, 2))))
    sources = _sources(holes, np.bincount(labels, minlength=regions.count + 1), reference)

    agree = agreeing[sources[labels], :, np.arange(len(labels))].T
    excluded = np.zeros((count, *regions.labels.shape), bool)
    excluded[:, where[0], where[1]] = ~agree
    clear = np.empty_like(agree)
    for index, frame in enumerate(excluded):
        closed = ndimage.binary_closing(frame, _DISC) | frame
        clear[index] = ~_dilated(frame)[where]
        frame[:] = _dilated(closed) & (regions.labels > 0)
    kept = ~excluded[:, where[0], where[1]]
    # Growing must not take away the only frames that measure, but for the blurred edges of what moved in them; nor
    # the last frame that shows a place at all.
    bare = (clear & known).any(0) & ~(kept & known).any(0)
    kept[:, bare] |= clear[:, bare]
    seen = np.isfinite(within).any((1, 3))
    blank = ~(kept & seen).any(0)
    kept[:, blank] |= agree[:, blank]
    taken = sources[labels]
    _unclipped(within, kept, taken)
    excluded[:, where[0], where[1]] = ~kept
    squares = np.full(regions.labels.shape, -1, np.int16)
    squares[where] = taken
    return excluded, squares, reference


def _unclipped(bounds: np.ndarray, kept: np.ndarray, taken: np.ndarray) -> None:
    """Let squares that are white in all that is kept (P, N) come from the longest frame that shows them otherwise.

    bounds : (P, 2, N, 3); `kept` and `taken` (N,), the source of each square, are changed
    """
    white = np.isinf(bounds[:, 1]).any(-1)
    shown = np.isfinite(bounds).any((1, 3))
    # Neither white in any channel nor black in all; nor plainly darker, as a wall before which a lamp was.
    clear = ~white & np.isfinite(bounds[:, 0]).any(-1)
    least = np.where(kept[..., None], bounds[:, 0], -np.inf).max(0)
    clear &= (bounds[:, 1] >= least - DARKER).all(-1)
    lost = (white | ~kept).all(0) & (kept & shown).any(0) & clear.any(0)
    longest = len(clear) - 1 - np.argmax(clear[::-1], axis=0)
    kept[:, lost] = False
    kept[longest[lost], lost] = True
    taken[lost] = longest[lost]


def _sources(holes: np.ndarray, areas: np.ndarray, reference: int) -> np.ndarray:
    """The reference, unless another frame has clearly fewer holes in a region: then the one with the fewest."""
    distance = np.abs(np.arange(len(holes)) - reference)[:, None]
    best = np.argmin(holes + 1e-3 * distance, axis=0)
    sources = np.where(holes[reference] <= holes.min(0) + np.maximum(4, 0.05 * areas), reference, best)
    sources[0] = -1
    return sources
