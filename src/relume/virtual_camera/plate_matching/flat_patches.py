"""Flat patches of a picture, where what varies is noise: its variance by brightness and its covariance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from relume.virtual_camera.film.grain import REACH

SIDE = 16
"""Pixels of a patch's side: a plane fitted to fewer takes much of the noise with it, larger ones are rarely flat."""
MEAN = 4
"""Side, in pixels, of the block means by which flatness is judged; noise hardly enters them, so that choosing flat
patches does not choose quiet ones."""
MOST = 6000
"""Patches looked at: 100 of each brightness and channel would settle a variance to 1 %."""
BINS = 16
"""Ranges of brightness, with equally many patches each."""
FEWEST = 24
"""Flat patches in all below which nothing is said: the variance of 24 · 256 values is good to 2 %."""
FIRST = 0.05
"""Share of the patches, the flattest, from which the first guess is made."""
SMOOTH = 2.0
"""Times the variance of the ranges of brightness beside it that one range may have: more is texture, as the noise of a
camera changes slowly."""
FLAT = 3.0
"""Times the variance of block means that noise alone explains, up to which a patch is flat."""


@dataclass(frozen=True, eq=False)
class FlatPatches:
    """A picture's noise, measured on its flat patches.

    values : (3, N) mean values, rising, a channel each
    variance : (3, N) of the noise there, rounding included
    covariance : (3, 3, 7, 7) of channel a at a pixel with channel b at offsets of −3 to 3 rows and columns, where the
        noise of each brightness and channel has been divided by its deviation
    rounding_share : (3,) what a variance of 1 that is the same at all values adds to the middle of that covariance
    count : patches
    """

    values: np.ndarray
    variance: np.ndarray
    covariance: np.ndarray
    rounding_share: np.ndarray
    count: int


def flat_patches(
    picture: np.ndarray,
    clean: np.ndarray | None = None,
    *,
    darkest: float = 0.0,
    brightest: float = np.inf,
    least: float = 0.0,
) -> FlatPatches | None:
    """The flat patches of a picture (H, W, 3); None where there are too few to measure the noise.

    picture : pixel values or radiances, float; NaN where nothing was measured
    clean : (H, W, 3) the same without noise, where it is known; then the difference is looked at, in which texture is
        none. NaN where it is not known. Without it fine texture that is everywhere is taken for noise
    darkest, brightest : values at and beyond which noise is cut off; patches that reach them are left out
    least : variance below which a patch shows only rounding, and not how neighbours are alike
    """
    if clean is not None:
        picture = np.where(np.isfinite(clean), picture, np.nan)
    patches, kept = _patches(picture, darkest, brightest)
    if len(patches) < FEWEST:
        return None
    means = patches.mean((1, 2))
    if clean is not None:
        patches = patches - _views(clean)[kept]
    residual = _without_planes(patches)
    variance = (residual**2).mean((1, 2))
    blocks = SIDE // MEAN
    block_means = residual.reshape(len(residual), blocks, MEAN, blocks, MEAN, 3).mean((2, 4))
    unevenness = block_means.var((1, 2))
    bins = _bins(means)

    # The flattest few give a first idea of the noise; then all patches count that are as flat as noise lets them be.
    flattest, losses = _flattest(unevenness, bins), _plane_losses()
    for _ in range(2):
        level = np.stack([_medians(variance[:, c], flattest[:, c], bins[:, c]) for c in range(3)])
        of_patch = np.stack([level[c, bins[:, c]] for c in range(3)], axis=-1)
        together = flattest.all(-1) if flattest.all(-1).sum() >= FEWEST else flattest[:, 1]
        noisy = together & (of_patch > max(least, 0.0)).all(-1)
        if noisy.sum() < FEWEST:
            return None
        scaled = residual[noisy] / np.sqrt(of_patch[noisy])[:, None, None]
        covariance, shrinkage = _covariance(scaled, losses)
        expected = of_patch * _of_block_means(covariance)
        flattest = unevenness <= FLAT * expected
        # In a picture that is nowhere flat, the flattest places still are the best there is.
    level = level / shrinkage[:, None]
    # 1 over the variances, as the residuals were divided by what they were before the planes' share was added back.
    rounding_share = (1 / of_patch[noisy]).mean(0)
    values = np.array([[means[bins[:, c] == b, c].mean() for b in range(bins.max() + 1)] for c in range(3)])
    return FlatPatches(values, level, covariance, rounding_share, int(noisy.sum()))


def _patches(picture: np.ndarray, darkest: float, brightest: float) -> tuple[np.ndarray, np.ndarray]:
    """(N, SIDE, SIDE, 3), none with a value that is cut off or unknown, and which of all views they are."""
    patches = _views(picture)
    with np.errstate(invalid="ignore"):
        kept = np.asarray(((patches > darkest) & (patches < brightest)).all((1, 2, 3)))
    return patches[kept], kept


def _views(picture: np.ndarray) -> np.ndarray:
    """(N, SIDE, SIDE, 3) float64, evenly over the picture."""
    height, width = picture.shape[:2]
    if min(height, width) < SIDE:
        return np.zeros((0, SIDE, SIDE, 3))
    step = max(SIDE // 2, int(np.ceil(np.sqrt(height * width / MOST))))
    views = np.lib.stride_tricks.sliding_window_view(picture, (SIDE, SIDE), axis=(0, 1))[::step, ::step]
    return np.moveaxis(views, 2, -1).reshape(-1, SIDE, SIDE, 3).astype(np.float64)


def _plane() -> np.ndarray:
    """(SIDE², 3) an orthonormal basis of all planes over a patch."""
    place = np.arange(SIDE) - (SIDE - 1) / 2
    y, x = np.repeat(place, SIDE), np.tile(place, SIDE)
    return np.linalg.qr(np.stack([np.ones_like(x), x, y], axis=1))[0]


def _without_planes(patches: np.ndarray) -> np.ndarray:
    flat, plane = patches.reshape(len(patches), -1, 3), _plane()
    share = np.einsum("pk,npc->nkc", plane, flat, optimize=True)
    return (flat - np.einsum("pk,nkc->npc", plane, share, optimize=True)).reshape(patches.shape)


def _bins(means: np.ndarray) -> np.ndarray:
    """(N, 3) which range of brightness each patch is of, equally many in each."""
    count = min(BINS, max(1, len(means) // FEWEST))
    order = np.argsort(np.argsort(means, axis=0), axis=0)
    return order * count // len(means)


def _flattest(unevenness: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """(N, 3) bool: the FIRST share of each bin, and at least eight."""
    chosen = np.zeros(unevenness.shape, bool)
    for c in range(3):
        for b in range(bins[:, c].max() + 1):
            members = np.flatnonzero(bins[:, c] == b)
            count = min(len(members), max(8, int(FIRST * len(members))))
            chosen[members[np.argsort(unevenness[members, c])[:count]], c] = True
    return chosen


def _medians(variance: np.ndarray, chosen: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """The median variance of each bin's chosen patches; of a bin without any, its neighbours'."""
    count = bins.max() + 1
    found = np.full(count, np.nan)
    for b in range(count):
        members = chosen & (bins == b)
        if members.any():
            found[b] = np.median(variance[members])
    known = np.flatnonzero(np.isfinite(found))
    filled = np.interp(np.arange(count), known, found[known])
    # The four nearest on either side, more of one side at the ends.
    beside = [np.argsort(np.abs(np.arange(count) - b), kind="stable")[1:5] for b in range(count)]
    return np.array(
        [min(v, SMOOTH * np.median(filled[n])) if len(n) else v for v, n in zip(filled, beside, strict=True)]
    )


def _offsets() -> list[tuple[int, int]]:
    return [(y, x) for y in range(-REACH, REACH + 1) for x in range(-REACH, REACH + 1)]


def _covariance(scaled: np.ndarray, losses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The covariance (3, 3, 7, 7) of the noise, and (3,) the share of its variance that the residuals still have.

    A fitted plane takes a known share of each covariance with it; the measured ones are solved for those that would
    leave them.
    """
    side = 2 * REACH + 1
    measured = np.zeros((side * side, 3, 3))
    for k, (dy, dx) in enumerate(_offsets()[: side * side // 2 + 1]):
        here = scaled[:, max(0, -dy) : SIDE - max(0, dy), max(0, -dx) : SIDE - max(0, dx)]
        there = scaled[:, max(0, dy) : SIDE - max(0, -dy), max(0, dx) : SIDE - max(0, -dx)]
        measured[k] = np.einsum("nyxa,nyxb->ab", here, there, optimize=True) / here[..., 0].size
        measured[-1 - k] = measured[k].T  # the opposite offset: the same pairs the other way round
    solved = np.linalg.solve(losses, measured.reshape(side * side, 9))
    covariance = np.moveaxis(solved.reshape(side, side, 3, 3), (2, 3), (0, 1))
    middle = measured[side * side // 2]
    shrinkage = np.array([middle[c, c] / max(covariance[c, c, REACH, REACH], 1e-9) for c in range(3)])
    return covariance, shrinkage


@cache
def _plane_losses() -> np.ndarray:
    """(49, 49): the mean covariance at each offset that noise of covariance 1 at one offset leaves in a residual."""
    plane, offsets = _plane(), _offsets()
    y, x = np.divmod(np.arange(SIDE**2), SIDE)
    down, right = y[None] - y[:, None], x[None] - x[:, None]
    masks = [(down == dy) & (right == dx) for dy, dx in offsets]
    losses = np.empty((len(offsets), len(offsets)))
    for source, mask in enumerate(masks):
        # (1 − QQᵀ) C (1 − QQᵀ), Q the basis of the planes
        noise = mask.astype(np.float64)
        of_plane = plane.T @ noise
        left = noise - plane @ of_plane - (noise @ plane - plane @ (of_plane @ plane)) @ plane.T
        losses[:, source] = [left[m].mean() for m in masks]
    losses.setflags(write=False)
    return losses


def _of_block_means(covariance: np.ndarray) -> np.ndarray:
    """(3,) variance of a mean of MEAN × MEAN pixels of noise with that covariance."""
    overlap = np.maximum(MEAN - np.abs(np.arange(-REACH, REACH + 1)), 0)
    weights = overlap[:, None] * overlap / MEAN**4
    return np.array([max(float((covariance[c, c] * weights).sum()), 1e-9) for c in range(3)])
