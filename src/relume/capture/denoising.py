"""Removing photographic noise from a merged radiance map, as far as its variance plane says that it is noise.

Overlapping blocks are taken to frequencies, and those too weak to stand out of the noise are set to 0 (DCT image
denoising: Yu & Sapiro 2011, doi 10.5201/ipol.2011.ys-dct). It works on ln radiance, where the noise of
neighbours is alike, and on channels turned into brightness and two colour differences, where detail is shared.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.fft import dctn, idctn

from relume.image.bands import in_bands
from relume.image.radiance import RadianceMap

BLOCK = 16
STEP = 2
"""Blocks start every 2 pixels both ways, so that each pixel is the mean of 64 opinions and no grid shows."""
SQUARE = 512
"""Pixels along the squares that are cleaned at a time, each with a block more around it: memory for one, not the whole
picture, and all cores busy."""
THRESHOLD = np.sqrt(2 * np.log(BLOCK**2))
"""Standard deviations below which a frequency is noise: what the largest of a block of pure noise reaches
(Donoho & Johnstone 1994), about 3.3."""
OPPONENT = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])


def denoise(picture: RadianceMap) -> RadianceMap:
    """The same radiance map with less noise; what no photograph measured stays as it is.

    The variance plane is kept: it is a bound now. Raises ValueError for a map without one.
    """
    if picture.variance is None:
        raise ValueError("the radiance map has no variance plane, so its noise is not known; merge a bracket")
    from relume._kernel import in_threads

    radiance, variance = picture.radiance, picture.variance
    height, width = radiance.shape[:2]
    least = min(in_bands(height, width, lambda rows: _known(radiance[rows], variance[rows])[1]))
    # Mirrored beyond its border, so that blocks cover all of it alike.
    mode = "symmetric" if min(height, width) > 2 * BLOCK else "edge"
    rows, columns = (np.pad(np.arange(n), (BLOCK, -n % BLOCK + BLOCK), mode=mode) for n in (height, width))  # pyright: ignore[reportCallIssue, reportArgumentType]
    result = np.empty_like(radiance)
    lefts = range(0, width, SQUARE)

    def work(begin: int, end: int) -> None:
        for index in range(begin, end):
            top, left = index // len(lefts) * SQUARE, lefts[index % len(lefts)]
            larger = np.ix_(rows[top : top + SQUARE + 2 * BLOCK], columns[left : left + SQUARE + 2 * BLOCK])
            inside = slice(top, top + SQUARE), slice(left, left + SQUARE)
            result[inside] = _smooth(radiance[larger], variance[larger], least)[: height - top, : width - left]

    in_threads(work, -(-height // SQUARE) * len(lefts), chunk=1)
    return replace(picture, radiance=result)


def _known(radiance: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, float]:
    """Where radiance was measured, and the least of it."""
    known = np.isfinite(variance) & (radiance > 0)
    return known, float(radiance[known].min(initial=1e-6))


def _smooth(radiance: np.ndarray, variance: np.ndarray, least: float) -> np.ndarray:
    """A square (H, W, 3) of the picture with less noise, without the BLOCK pixels of its border."""
    known = _known(radiance, variance)[0]
    logarithm = np.log(np.where(known, radiance, np.float32(least)))
    relative = np.where(known, variance, 0) / np.where(known, radiance, 1) ** 2
    channels = logarithm.astype(np.float64) @ OPPONENT.T
    # The rotation is orthonormal, so variances mix by its squares.
    noise = relative.astype(np.float64) @ (OPPONENT**2).T
    own = slice(BLOCK, -BLOCK)
    smooth = np.exp(_shrunk(channels, noise)[own, own] @ OPPONENT)
    return np.where(known[own, own], smooth, radiance[own, own])


def _shrunk(channels: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """The weighted mean of all blocks that cover a pixel; blocks that hold less detail count more."""
    total, weight = np.zeros_like(channels), np.zeros((*channels.shape[:2], 1))
    for top in range(0, BLOCK, STEP):
        for left in range(0, BLOCK, STEP):
            rows = slice(top, top + (channels.shape[0] - top) // BLOCK * BLOCK)
            columns = slice(left, left + (channels.shape[1] - left) // BLOCK * BLOCK)
            frequencies = np.asarray(dctn(_blocks(channels[rows, columns]), axes=(2, 3), norm="ortho"))
            deviation = np.sqrt(_blocks(variance[rows, columns]).mean((2, 3), keepdims=True))
            kept = np.abs(frequencies) > THRESHOLD * deviation
            kept[:, :, 0, 0] = True
            share = 1.0 / kept.sum((2, 3, 4), keepdims=True)
            blocks = idctn(np.where(kept, frequencies, 0), axes=(2, 3), norm="ortho") * share
            total[rows, columns] += _joined(blocks)
            weight[rows, columns] += _joined(np.broadcast_to(share, (*blocks.shape[:4], 1)))
    return total / np.maximum(weight, 1e-30)


def _blocks(image: np.ndarray) -> np.ndarray:
    """(H, W, C) as (rows, columns, BLOCK, BLOCK, C)."""
    height, width, channels = image.shape
    return image.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, channels).swapaxes(1, 2)


def _joined(blocks: np.ndarray) -> np.ndarray:
    """The inverse of `_blocks`."""
    rows, columns, _, _, channels = blocks.shape
    return blocks.swapaxes(1, 2).reshape(rows * BLOCK, columns * BLOCK, channels)
