"""The loop of `denoise`: overlapping blocks of a square to frequencies and back, without those that are noise."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel

BLOCK = 16
STEP = 2
"""Blocks start every 2 pixels both ways, so that each pixel is the mean of 64 opinions and no grid shows."""
THRESHOLD = np.float32(np.sqrt(2 * np.log(BLOCK**2)))
"""Standard deviations below which a frequency is noise: what the largest of a block of pure noise reaches
(Donoho & Johnstone 1994), about 3.3."""
_HALVES = (np.arange(BLOCK) + 0.5) / BLOCK
COSINES = np.cos(np.pi * np.arange(BLOCK)[:, None] * _HALVES) * np.sqrt(2 / BLOCK)
COSINES[0] = np.sqrt(1 / BLOCK)
COSINES = COSINES.astype(np.float32)
"""(frequency, pixel) of the orthonormal DCT-II: its inverse is its transpose."""

_C1, _C2, _C3, _C4, _C5, _C6, _C7, _C8, _C9, _C10, _C11, _C12, _C13, _C14, _C15 = (
    np.float32(np.cos(np.pi * n / 32) * np.sqrt(2 / BLOCK)) for n in range(1, 16)
)


def shrunk(channels: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """The weighted mean (3, H, W) of all blocks that cover a pixel; blocks that hold less detail count more.

    channels, variance : (3, H, W) float32, and of their noise
    """
    total, weight = np.zeros_like(channels), np.zeros(channels.shape[1:], np.float32)
    _shrink(channels, variance, COSINES, np.ascontiguousarray(COSINES.T), total, weight)
    return total / np.maximum(weight, np.float32(1e-30))


@exact_kernel
def _shrink(channels, variance, cosines, transposed, total, weight):
    height, width = weight.shape
    # A strip is the blocks that begin in one row. Their columns go to frequencies and back once for all of them.
    strip = np.empty((3, width, BLOCK), np.float32)
    result = np.empty((3, BLOCK, width), np.float32)
    noise = np.empty((3, width), np.float32)
    shares = np.empty(width, np.float32)
    block = np.empty((3, BLOCK, BLOCK), np.float32)
    for top in range(0, height - BLOCK + 1, STEP):
        strip[:] = 0
        result[:] = 0
        noise[:] = 0
        shares[:] = 0
        for channel in range(3):
            for x in range(width):
                for i in range(BLOCK):
                    c = channels[channel, top + i, x]
                    for k in range(BLOCK):
                        strip[channel, x, k] += c * transposed[i, k]
            for i in range(BLOCK):
                for x in range(width):
                    noise[channel, x] += variance[channel, top + i, x]
        for left in range(0, width - BLOCK + 1, STEP):
            kept = 0
            for channel in range(3):
                # The mean variance of the block's pixels is that of each of its frequencies.
                mean = np.float32(0)
                for j in range(BLOCK):
                    mean += noise[channel, left + j]
                deviation = THRESHOLD * np.sqrt(mean / np.float32(BLOCK * BLOCK))
                _along_rows(strip[channel, left : left + BLOCK], block[channel])
                # What does not stand out of the noise is noise; the mean stays.
                average = block[channel, 0, 0]
                here = 0
                for m in range(BLOCK):
                    for k in range(BLOCK):
                        stays = abs(block[channel, m, k]) > deviation
                        here += np.int32(stays)
                        block[channel, m, k] = block[channel, m, k] if stays else np.float32(0)
                kept += here
                if not abs(average) > deviation:
                    kept += 1
                    block[channel, 0, 0] = average
            # Back along the rows; few frequencies are left of most blocks.
            share = np.float32(1) / np.float32(kept)
            for channel in range(3):
                for m in range(BLOCK):
                    for k in range(BLOCK):
                        c = block[channel, m, k]
                        if c != 0:
                            c *= share
                            for j in range(BLOCK):
                                result[channel, k, left + j] += c * cosines[m, j]
            for j in range(BLOCK):
                shares[left + j] += share
        # And along the columns.
        for i in range(BLOCK):
            for channel in range(3):
                for k in range(BLOCK):
                    c = cosines[k, i]
                    for x in range(width):
                        total[channel, top + i, x] += c * result[channel, k, x]
            for x in range(width):
                weight[top + i, x] += shares[x]


@exact_kernel
def _along_rows(pixels, frequencies):
    """The DCT-II (frequency, k) of pixels (pixel, k) for each k: its even half is that of half as many sums, and its
    odd half a matrix of differences (Chen, Smith & Fralick 1977)."""
    for k in range(BLOCK):
        x0, x1, x2, x3 = pixels[0, k], pixels[1, k], pixels[2, k], pixels[3, k]
        x4, x5, x6, x7 = pixels[4, k], pixels[5, k], pixels[6, k], pixels[7, k]
        y0, y1, y2, y3 = pixels[15, k], pixels[14, k], pixels[13, k], pixels[12, k]
        y4, y5, y6, y7 = pixels[11, k], pixels[10, k], pixels[9, k], pixels[8, k]
        d0, d1, d2, d3, d4, d5, d6, d7 = x0 - y0, x1 - y1, x2 - y2, x3 - y3, x4 - y4, x5 - y5, x6 - y6, x7 - y7
        s0, s1, s2, s3, s4, s5, s6, s7 = x0 + y0, x1 + y1, x2 + y2, x3 + y3, x4 + y4, x5 + y5, x6 + y6, x7 + y7
        frequencies[1, k] = _C1 * d0 + _C3 * d1 + _C5 * d2 + _C7 * d3 + _C9 * d4 + _C11 * d5 + _C13 * d6 + _C15 * d7
        frequencies[3, k] = _C3 * d0 + _C9 * d1 + _C15 * d2 - _C11 * d3 - _C5 * d4 - _C1 * d5 - _C7 * d6 - _C13 * d7
        frequencies[5, k] = _C5 * d0 + _C15 * d1 - _C7 * d2 - _C3 * d3 - _C13 * d4 + _C9 * d5 + _C1 * d6 + _C11 * d7
        frequencies[7, k] = _C7 * d0 - _C11 * d1 - _C3 * d2 + _C15 * d3 + _C1 * d4 + _C13 * d5 - _C5 * d6 - _C9 * d7
        frequencies[9, k] = _C9 * d0 - _C5 * d1 - _C13 * d2 + _C1 * d3 - _C15 * d4 - _C3 * d5 + _C11 * d6 + _C7 * d7
        frequencies[11, k] = _C11 * d0 - _C1 * d1 + _C9 * d2 + _C13 * d3 - _C3 * d4 + _C7 * d5 + _C15 * d6 - _C5 * d7
        frequencies[13, k] = _C13 * d0 - _C7 * d1 + _C1 * d2 - _C5 * d3 + _C11 * d4 + _C15 * d5 - _C9 * d6 + _C3 * d7
        frequencies[15, k] = _C15 * d0 - _C13 * d1 + _C11 * d2 - _C9 * d3 + _C7 * d4 - _C5 * d5 + _C3 * d6 - _C1 * d7
        e0, e1, e2, e3 = s0 - s7, s1 - s6, s2 - s5, s3 - s4
        t0, t1, t2, t3 = s0 + s7, s1 + s6, s2 + s5, s3 + s4
        frequencies[2, k] = _C2 * e0 + _C6 * e1 + _C10 * e2 + _C14 * e3
        frequencies[6, k] = _C6 * e0 - _C14 * e1 - _C2 * e2 - _C10 * e3
        frequencies[10, k] = _C10 * e0 - _C2 * e1 + _C14 * e2 + _C6 * e3
        frequencies[14, k] = _C14 * e0 - _C10 * e1 + _C6 * e2 - _C2 * e3
        u0, u1, v0, v1 = t0 + t3, t1 + t2, t0 - t3, t1 - t2
        frequencies[4, k] = _C4 * v0 + _C12 * v1
        frequencies[12, k] = _C12 * v0 - _C4 * v1
        frequencies[8, k] = _C8 * (u0 - u1)
        frequencies[0, k] = _C8 * (u0 + u1)
