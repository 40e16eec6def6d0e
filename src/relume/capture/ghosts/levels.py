"""Putting the frames of a bracket on one scale before they are compared, so that only what moved disagrees.

Exposure times are a little off, a response fits a little badly at its ends, lamps flicker and dark frames have a
floor of stray light: all of this depends on a frame and on the pixel value, not on the place, and most places of a
scene do not move. The median over places therefore measures it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BINS = 32
SMOOTH = 1.5
"""Bins over which a misfit is smoothed, standard deviation."""
FEWEST = 30
"""Squares that a bin needs for its median to count."""
HIGHLIGHTS, SHADOWS = 0.5, 2.2
"""ln exposure below white from which on, and down from which, a frame's values may turn out to say nothing."""
LARGEST_MISFIT, LARGEST_SCATTER = 0.3, 0.2
"""What is taken for a misfit or scatter of the response, in ln exposure; whatever is larger is motion."""


@dataclass(frozen=True, eq=False)
class Scale:
    """The values of a response cut into bins of equal steps of ln exposure.

    curve : (3, levels) ln exposure
    ends : (3, 2) values at or below which a pixel is black, and from which on it is white
    """

    curve: np.ndarray
    ends: np.ndarray

    def limits(self, channel: int) -> tuple[float, float]:
        """ln exposure of the channel's two ends."""
        black, white = self.ends[channel]
        return float(self.curve[channel, black]), float(self.curve[channel, white])

    def bins(self, channel: int) -> np.ndarray:
        """(levels,) the bin of every pixel value."""
        low, high = self.limits(channel)
        return np.clip((self.curve[channel] - low) / (high - low) * BINS, 0, BINS - 1).astype(np.intp)

    def spread(self, channel: int, of_bins: np.ndarray) -> np.ndarray:
        """(levels,) what is known of each bin's middle, linearly between the middles."""
        low, high = self.limits(channel)
        return np.interp(self.curve[channel], low + (np.arange(BINS) + 0.5) * (high - low) / BINS, of_bins)


def corrections(
    bounds: np.ndarray, middle: np.ndarray, log_times: np.ndarray, scale: Scale, reference: int, *, slack: float
) -> np.ndarray:
    """What to add to the bounds of every frame at every pixel value, (P, 2, 3, levels) float32.

    bounds : (P, 2, N, 3) least and greatest ln radiance of N places, ±∞ where clipped
    middle : (P, N, 3) mean pixel values
    reference : the frame on whose scale the others are put, from neighbour to neighbour
    slack : misfit of ln exposure that any frame may have
    """
    count, levels = len(bounds), scale.curve.shape[1]
    tables = np.zeros((count, 2, 3, levels))
    tables[reference] = np.array([-slack, slack])[:, None, None]
    bounds = bounds.astype(np.float64)
    neighbours = [(p, p - 1) for p in range(reference + 1, count)] + [(p, p + 1) for p in range(reference - 1, -1, -1)]
    for frame, towards in neighbours:
        step = log_times[frame] - log_times[towards]
        inner = [_inner(bounds, middle, scale, frame, towards, step, channel) for channel in range(3)]
        offset = _offset(bounds[frame], bounds[towards], inner)
        bounds[frame] += offset
        for channel in range(3):
            tables[frame, :, channel] = offset + _of_channel(
                bounds[frame, :, :, channel],
                bounds[towards, :, :, channel],
                middle[frame, :, channel],
                inner[channel],
                scale,
                channel,
                slack,
                longer=frame > towards,
            )
            bounds[frame, :, :, channel] += tables[frame, :, channel][:, middle[frame, :, channel]] - offset
    return tables.astype(np.float32)


def _inner(
    bounds: np.ndarray, middle: np.ndarray, scale: Scale, frame: int, towards: int, step: float, channel: int
) -> np.ndarray:
    """The places that both frames measure and neither could have had clipped.

    Where a value in one frame predicts a clipped one in the other, only those are measured in both that noise has
    favoured: their median would be biased.
    """
    low, high = scale.limits(channel)
    curve, margin = scale.curve[channel], 0.2
    one, other = curve[middle[frame, :, channel]], curve[middle[towards, :, channel]]
    measured = np.isfinite(bounds[[frame, towards], :, :, channel]).all((0, 1))
    for predicted in (one, other, one - step, other + step):
        measured &= (predicted > low + margin) & (predicted < high - margin)
    return measured


def _offset(frame: np.ndarray, towards: np.ndarray, inner: list[np.ndarray]) -> float:
    """The weighted median of the frames' difference: the error of the exposure times; 0 where none was measured."""
    ours = np.concatenate([frame[:, places, channel] for channel, places in enumerate(inner)], axis=1)
    theirs = np.concatenate([towards[:, places, channel] for channel, places in enumerate(inner)], axis=1)
    differences, widths = (theirs - ours).mean(0), (ours[1] - ours[0]) + (theirs[1] - theirs[0])
    if len(differences) < FEWEST:
        return 0.0
    order = np.argsort(differences)
    heap = np.cumsum(1 / (0.05 + widths[order]) ** 2)
    return float(differences[order][np.searchsorted(heap, heap[-1] / 2)])


def _of_channel(
    frame: np.ndarray,
    towards: np.ndarray,
    middle: np.ndarray,
    inner: np.ndarray,
    scale: Scale,
    channel: int,
    slack: float,
    *,
    longer: bool,
) -> np.ndarray:
    """(2, levels) for one channel of a frame: the misfit taken out, the scatter allowed, and −∞ and ∞ at its ends."""
    bins = scale.bins(channel)[middle]
    difference = np.zeros(len(middle))
    difference[inner] = (towards[:, inner] - frame[:, inner]).mean(0)
    misfit = scale.spread(channel, np.clip(_medians(difference, bins, inner), -LARGEST_MISFIT, LARGEST_MISFIT))
    scatter = _medians(np.abs(difference - misfit[middle]), bins, inner)
    tolerance = slack + np.minimum(2 * scale.spread(channel, scatter), LARGEST_SCATTER)
    lower, upper = misfit - tolerance, misfit + tolerance
    # Dark values that mostly say more than the longer frame next to it are stray light or noise, and bright ones that
    # mostly say less than the shorter frame are past what the sensor holds.
    low, high = scale.limits(channel)
    if longer:
        useless = _mostly(towards[0] - frame[1] - upper[middle] > 0, bins, np.isfinite(frame[1] - towards[0]))
        useless &= np.arange(BINS) >= BINS * (1 - HIGHLIGHTS / (high - low))
        upper = np.where(scale.bins(channel) >= np.argmax(useless), np.inf, upper) if useless.any() else upper
    else:
        useless = _mostly(frame[0] + lower[middle] - towards[1] > 0, bins, np.isfinite(frame[0] - towards[1]))
        useless &= np.arange(BINS) <= BINS * (1 - SHADOWS / (high - low))
        last = BINS - 1 - np.argmax(useless[::-1])
        lower = np.where(scale.bins(channel) <= last, -np.inf, lower) if useless.any() else lower
    return np.stack([lower, upper])


def _medians(values: np.ndarray, bins: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(BINS,) the median of each bin, smoothed over bins by how many places each has.

    A response errs smoothly, so that few places of a tone that nothing else has, a thing that moved, weigh little.
    Bins with too few places take the median of their neighbours; 0 where none has any.
    """
    known, heap = np.zeros(BINS), np.bincount(bins[where], minlength=BINS).astype(np.float64)
    heap[heap < FEWEST] = 0
    for index in np.flatnonzero(heap):
        known[index] = np.median(values[where & (bins == index)])
    filled = np.flatnonzero(heap)
    if not len(filled):
        return known
    near = np.exp(-(((filled[:, None] - filled) / SMOOTH) ** 2) / 2) * heap[filled]
    return np.interp(np.arange(BINS), filled, (near @ known[filled]) / near.sum(1))


def _mostly(mask: np.ndarray, bins: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(BINS,) whether the mask holds at more than half of the places of each bin."""
    total = np.bincount(bins[where], minlength=BINS)
    return (total >= FEWEST) & (np.bincount(bins[where & mask], minlength=BINS) > total / 2)
