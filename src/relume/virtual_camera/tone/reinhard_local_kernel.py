"""One tile of a picture dodged and burned, compiled: Gaussians of its luminance, and the widest that stays even."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel

TILE = 192
"""Pixels along a tile's side: with the widest Gaussian's reach around it, its planes stay in a core's own cache."""


@kernel
def mirrored(place, size):
    """Where a place beyond the border of `size` pixels is seen in its mirror."""
    place %= 2 * size
    return place if place < size else 2 * size - 1 - place


@kernel
def gather(pixels, weights, scale, top, left, reach, light):
    """Fill `light` with scaled luminances around a tile at `top`, `left`, `reach` pixels further on every side."""
    height, width = pixels.shape[:2]
    for row in range(light.shape[0]):
        y = mirrored(top - reach + row, height)
        for column in range(light.shape[1]):
            x = left - reach + column
            if x < 0 or x >= width:
                x = mirrored(x, width)
            light[row, column] = scale * (
                weights[0] * pixels[y, x, 0] + weights[1] * pixels[y, x, 1] + weights[2] * pixels[y, x, 2]
            )


@kernel
def blur(light, reach, taps, half, passed, blurred):
    """The middle of `light` by a separable filter: `taps` (half + 1,), the middle one first. Both ways symmetric."""
    height, width = blurred.shape
    for row in range(height + 2 * half):
        source, into = light[row + reach - half], passed[row]
        for x in range(width):
            into[x] = taps[0] * source[x + reach]
        for k in range(1, half + 1):
            tap = taps[k]
            for x in range(width):
                into[x] += tap * (source[x + reach - k] + source[x + reach + k])
    for row in range(height):
        into, middle = blurred[row], passed[row + half]
        for x in range(width):
            into[x] = taps[0] * middle[x]
        for k in range(1, half + 1):
            tap, above, below = taps[k], passed[row + half - k], passed[row + half + k]
            for x in range(width):
                into[x] += tap * (above[x] + below[x])


@kernel
def dodge_and_burn(pixels, weights, scale, taps, halves, sharpening, threshold, top, left, result):
    """One tile: each pixel times scale / (1 + V1), V1 at the scale where the surround first differs (eq. 7–9).

    taps : (S, R + 1) float32, Gaussians' halves, the middle first; halves : (S,) how many beside the middle count
    sharpening : (S,) float32, 2^φ a / s² of eq. 7
    """
    height, width = min(TILE, pixels.shape[0] - top), min(TILE, pixels.shape[1] - left)
    scales, reach = len(halves), halves[-1]
    light = np.empty((height + 2 * reach, width + 2 * reach), np.float32)
    passed = np.empty((height + 2 * reach, width), np.float32)
    centre, surround = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    chosen, open_still = np.empty((height, width), np.float32), np.ones((height, width), np.bool_)
    gather(pixels, weights, scale, top, left, reach, light)
    blur(light, reach, taps[0], halves[0], passed, centre)
    waiting = height * width
    for s in range(1, scales):
        if waiting == 0:
            break
        blur(light, reach, taps[s], halves[s], passed, surround)
        for y in range(height):
            for x in range(width):
                if open_still[y, x]:
                    activity = abs(centre[y, x] - surround[y, x]) / (sharpening[s - 1] + centre[y, x])
                    if activity > threshold:
                        chosen[y, x] = centre[y, x]
                        open_still[y, x] = False
                        waiting -= 1
        centre, surround = surround, centre
    for y in range(height):
        for x in range(width):
            around = centre[y, x] if open_still[y, x] else chosen[y, x]
            factor = scale / (np.float32(1) + around)
            for channel in range(3):
                result[top + y, left + x, channel] = pixels[top + y, left + x, channel] * factor
