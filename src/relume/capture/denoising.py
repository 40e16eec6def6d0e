"""Removing photographic noise from a merged radiance map, as far as its variance plane says that it is noise.

Overlapping blocks are taken to frequencies, and those too weak to stand out of the noise are set to 0 (DCT image
denoising: Yu & Sapiro 2011, doi 10.5201/ipol.2011.ys-dct). It works on ln radiance, where the noise of
neighbours is alike, and on channels turned into brightness and two colour differences, where detail is shared.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.image.bands import in_bands, in_threads
from relume.image.radiance import RadianceMap

SQUARE = 512
"""Pixels along the squares that are cleaned at a time, each with a block more around it: memory for one, not the whole
picture, and all cores busy."""
OPPONENT = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])


def denoise(picture: RadianceMap) -> RadianceMap:
    """The same radiance map with less noise; what no photograph measured stays as it is.

    picture : a radiance map with its variance

    The variance plane is kept: it is a bound now. Raises ValueError for a map without one.
    """
    if picture.variance is None:
        raise ValueError("the radiance map has no variance plane, so its noise is not known; merge a bracket")
    from relume.capture.denoising_kernel import BLOCK

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
    from relume.capture.denoising_kernel import BLOCK, shrunk

    known = _known(radiance, variance)[0]
    logarithm = np.log(np.where(known, radiance, np.float32(least)))
    relative = np.where(known, variance, 0) / np.where(known, radiance, 1) ** 2
    channels = np.moveaxis(logarithm.astype(np.float64) @ OPPONENT.T, -1, 0)
    # The rotation is orthonormal, so variances mix by its squares.
    noise = np.moveaxis(relative.astype(np.float64) @ (OPPONENT**2).T, -1, 0)
    clean = shrunk(np.ascontiguousarray(channels, np.float32), np.ascontiguousarray(noise, np.float32))
    own = slice(BLOCK, -BLOCK)
    smooth = np.exp(np.moveaxis(clean, 0, -1)[own, own] @ OPPONENT)
    return np.where(known[own, own], smooth, radiance[own, own])
