"""Removing photographic noise from a merged radiance map, as far as its variance plane says that it is noise.

Overlapping blocks are taken to frequencies, and those too weak to stand out of the noise are set to 0 (DCT image
denoising: Yu & Sapiro 2011, doi 10.5201/ipol.2011.ys-dct). It works on ln radiance, where the noise of
neighbours is alike, and on channels turned into brightness and two colour differences, where detail is shared.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.fft import dctn, idctn

from relume.image.radiance import RadianceMap

BLOCK = 16
STEP = 2
"""Blocks start every 2 pixels both ways, so that each pixel is the mean of 64 opinions and no grid shows."""
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
    known = np.isfinite(picture.variance) & (picture.radiance > 0)
    logarithm = np.log(np.where(known, picture.radiance, picture.radiance[known].min(initial=1e-6)))
    relative = np.where(known, picture.variance, 0) / np.where(known, picture.radiance, 1) ** 2
    channels = logarithm.astype(np.float64) @ OPPONENT.T
    # The rotation is orthonormal, so variances mix by its squares.
    noise = relative.astype(np.float64) @ (OPPONENT**2).T
    smooth = np.exp(_shrunk(channels, noise) @ OPPONENT)
    return replace(picture, radiance=np.where(known, smooth, picture.radiance).astype(np.float32))


def _shrunk(channels: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """The weighted mean of all blocks that cover a pixel; blocks that hold less detail count more."""
    height, width = channels.shape[:2]
    below, right = -height % BLOCK + BLOCK, -width % BLOCK + BLOCK
    border = ((BLOCK, below), (BLOCK, right), (0, 0))
    channels, variance = (np.pad(a, border, mode="symmetric" if min(height, width) > 2 * BLOCK else "edge")
                          for a in (channels, variance))  # fmt: skip
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
    return (total / weight)[BLOCK : BLOCK + height, BLOCK : BLOCK + width]


def _blocks(image: np.ndarray) -> np.ndarray:
    """(H, W, C) as (rows, columns, BLOCK, BLOCK, C)."""
    height, width, channels = image.shape
    return image.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, channels).swapaxes(1, 2)


def _joined(blocks: np.ndarray) -> np.ndarray:
    """The inverse of `_blocks`."""
    rows, columns, _, _, channels = blocks.shape
    return blocks.swapaxes(1, 2).reshape(rows * BLOCK, columns * BLOCK, channels)
