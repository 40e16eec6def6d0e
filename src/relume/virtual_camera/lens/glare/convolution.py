"""Convolution of a picture with a point spread as large as itself to every side, by Fourier transforms.

The padded picture is never held: rows are transformed as they are, then columns are padded, multiplied and cropped in
small blocks. What leaves the frame leaves it, and nothing comes in at the opposite edge.

A transform's rounding is a share of its largest values, and follows their rows and columns: a sun would draw a cross
over the shadows. So light is spread in three parts: what stays in its pixel is multiplied, what goes a few pixels far
is convolved in float64 tile by tile, and only what goes farther, which is faint, in float32 over the whole picture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.image.bands import in_threads

ROWS, COLUMNS = 48, 32
"""In a block: large enough for the calls' cost to vanish, small enough for the caches."""
NEAR = 16
"""Pixels about a light for which glare is convolved in float64: beyond, it is some 1e-5 of the light and smooth."""
TILE = 128, 576
"""Rows and columns of what is convolved at once in float64: the margins of `NEAR` are a third of it."""

Block = Callable[[int, int], np.ndarray]
"""The transform (padded rows, end − begin) of a point spread at columns begin…end of the half plane."""
Transfer = Callable[[int, int], Block]
"""Makes ready for blocks within such columns: all at once take as much memory as the picture's own, a part less."""


@dataclass(frozen=True)
class Canvas:
    """The size of a picture and of the transforms in which nothing of it wraps round.

    mirrored : whether the picture goes on as its own mirror image; else it is black outside
    """

    height: int
    width: int
    mirrored: bool = False

    @property
    def rows(self) -> int:
        return self._full(self.height)

    @property
    def columns(self) -> int:
        return self._full(self.width)

    def _full(self, size: int) -> int:
        from scipy.fft import next_fast_len

        # A mirror image has to meet its own mirror image exactly at twice the size.
        return 2 * size if self.mirrored else int(next_fast_len(max(2 * size - 1, 2), real=True) or 0)


class PointSpread(Protocol):
    """Where the light of a point goes, within and outside the square of `NEAR` pixels to each side."""

    @property
    def kept(self) -> np.ndarray:
        """(3,) shares of the light that stay in the point's own pixel."""
        ...

    def nearby(self) -> np.ndarray:
        """(2 NEAR + 1, 2 NEAR + 1, 3) shares that go within the square; 0 in the middle."""
        ...

    def transfer(self, channel: int, canvas: Canvas) -> Transfer | None:
        """The transform of what leaves the square; None where nothing does."""
        ...


def spread_out(radiance: np.ndarray, spread: PointSpread, *, mirrored: bool = False) -> np.ndarray:
    """Radiance (H, W, 3) float32 of which each point's light went where `spread` says; never negative.

    mirrored : whether the picture goes on as its mirror image outside the frame; else all is black there

    It holds less than twice the picture's memory beside the input.
    """
    height, width = radiance.shape[:2]
    canvas = Canvas(height, width, mirrored)
    nearby = spread.nearby()
    # Memory that nothing was written to takes no room yet. Pairs of the first two channels wait in the last two thirds
    # of the result: there pixels put in from the front never come upon a pair that is still to be read.
    result = np.empty(radiance.shape, np.float32)
    pairs = result.reshape(-1)[height * width :].reshape(height, width, 2)

    def plane_of(channel: int, parts: int) -> np.ndarray:
        light = radiance[..., channel]
        plane = _far(light, spread, channel, canvas, parts)
        _add_near(plane, light, nearby[..., channel], float(spread.kept[channel]), mirrored)
        return plane

    first, second = plane_of(0, 1), plane_of(1, 1)
    pairs[..., 0], pairs[..., 1] = first, second
    del first, second
    # Most is in memory now: the last point spread is made in two parts, each drawn anew.
    last = plane_of(2, 2)
    for row in range(0, height, ROWS):
        rows = slice(row, row + ROWS)
        # Read before it is written: a band may cover its own pairs.
        result[rows, :, :2] = pairs[rows].copy()
        result[rows, :, 2] = last[rows]
    return result


def _far(light: np.ndarray, spread: PointSpread, channel: int, canvas: Canvas, parts: int) -> np.ndarray:
    """(H, W) float32, what of the light (H, W) goes farther than `NEAR`, the transfer made ready in so many parts."""
    from scipy.fft import irfft

    unit = np.float32(light.max())
    transfer = spread.transfer(channel, canvas) if unit > 0 else None
    if transfer is None:
        return np.zeros(light.shape, np.float32)
    # Far from 1, products of float32 leave its range: the glare of starlight is as good as the sun's.
    waves = row_waves(lambda begin, end: light[begin:end] / unit, len(light), canvas)
    part = -(-waves.shape[1] // parts)
    for left in range(0, waves.shape[1], part):
        _multiply(waves, transfer, left, min(left + part, waves.shape[1]), canvas)
    plane = np.empty(light.shape, np.float32)

    def crop(begin: int, end: int) -> None:
        scattered = np.asarray(irfft(waves[begin:end], canvas.columns, axis=1))[:, : canvas.width]
        plane[begin:end] = unit * np.maximum(scattered, 0)

    in_threads(crop, len(light), chunk=ROWS)
    return plane


def _multiply(waves: np.ndarray, transfer: Transfer, left: int, right: int, canvas: Canvas) -> None:
    """Convolve columns left…right of `waves` in place: transforms of rows, (H, padded columns // 2 + 1), are also
    transformed along columns."""
    from scipy.fft import fft, ifft

    height, spread = canvas.height, transfer(left, right)

    def multiply(begin: int, end: int) -> None:
        begin, end = left + begin, left + end
        block = np.zeros((canvas.rows, end - begin), np.complex64)
        block[:height] = waves[:, begin:end]
        if canvas.mirrored:
            block[height:] = block[height - 1 :: -1]
        block = np.asarray(fft(block, axis=0, overwrite_x=True))
        block *= spread(begin, end)
        waves[:, begin:end] = np.asarray(ifft(block, axis=0, overwrite_x=True))[:height]

    in_threads(multiply, right - left, chunk=COLUMNS)


def _add_near(plane: np.ndarray, light: np.ndarray, nearby: np.ndarray, kept: float, mirrored: bool) -> None:
    """Add to a plane (H, W) what of the light (H, W) stays and what goes `nearby`, in float64."""
    from scipy.fft import irfft2, rfft2

    height, width = light.shape
    down, right = (side - 2 * NEAR for side in TILE)
    # The transform turns round its end what lies left of and above the middle.
    turned = np.zeros(TILE)
    turned[: 2 * NEAR + 1, : 2 * NEAR + 1] = nearby
    transfer = np.asarray(rfft2(np.roll(turned, (-NEAR, -NEAR), (0, 1))))
    across = -(-width // right)

    def add(begin: int, end: int) -> None:
        for tile in range(begin, end):
            top, left = tile // across * down, tile % across * right
            given = np.zeros(TILE)
            if mirrored:
                rows, columns = (np.arange(-NEAR, side - NEAR) for side in TILE)
                given[:] = light[_beyond(rows + top, height)[:, None], _beyond(columns + left, width)]
            else:
                y, x = max(NEAR - top, 0), max(NEAR - left, 0)
                part = light[max(top - NEAR, 0) : top + down + NEAR, max(left - NEAR, 0) : left + right + NEAR]
                given[y : y + part.shape[0], x : x + part.shape[1]] = part
            spread = np.asarray(irfft2(np.asarray(rfft2(given)) * transfer, TILE))[NEAR:-NEAR, NEAR:-NEAR]
            inside = plane[top : top + down, left : left + right]
            inside += np.maximum(spread[: inside.shape[0], : inside.shape[1]], 0)
            inside += kept * light[top : top + down, left : left + right]

    in_threads(add, across * -(-height // down), chunk=1)


def _beyond(places: np.ndarray, size: int) -> np.ndarray:
    """Where in 0…size − 1 the mirror image of places outside lies, however far outside."""
    turned = places % (2 * size)
    return np.minimum(turned, 2 * size - 1 - turned)


def row_waves(
    rows: Callable[[int, int], np.ndarray], count: int, canvas: Canvas, columns: slice = slice(None)
) -> np.ndarray:
    """(count, padded columns // 2 + 1) complex64, or `columns` of them: transforms of rows (n, W) or (n, padded
    columns) float32."""
    from scipy.fft import rfft

    waves = np.empty((count, len(range(canvas.columns // 2 + 1)[columns])), np.complex64)

    def transform(begin: int, end: int) -> None:
        given = rows(begin, end)
        if canvas.mirrored and given.shape[1] == canvas.width:
            given = np.concatenate([given, given[:, ::-1]], axis=1)
        waves[begin:end] = np.asarray(rfft(given, canvas.columns, axis=1))[:, columns]

    in_threads(transform, count, chunk=ROWS)
    return waves


def symmetric_transfer(rows: Callable[[int, int], np.ndarray], canvas: Canvas) -> Transfer:
    """Of a spread that is the same when turned by half a turn: real, and given by its rows 0…H below the point.

    rows : gives rows begin…end, (n, padded columns) float32 in the order of transforms: 0, 1, …, −2, −1 pixels right
    """
    from scipy.fft import hfft

    def ready(left: int, right: int) -> Block:
        waves = row_waves(rows, canvas.height, canvas, slice(left, right))
        # k(−x, −y) = k(x, y): the row above is the conjugate of the row below.
        return lambda begin, end: np.asarray(hfft(waves[:, begin - left : end - left], canvas.rows, axis=0))

    return ready


def general_transfer(kernel: np.ndarray, canvas: Canvas) -> Transfer:
    """Of any spread (h, w), both odd, about its middle; what reaches farther than the picture is left off."""
    from scipy.fft import fft

    y, x = kernel.shape[0] // 2, kernel.shape[1] // 2
    down, right = min(y, canvas.height - 1), min(x, canvas.width - 1)
    inner = kernel[y - down : y + down + 1, x - right : x + right + 1]
    ordered = np.zeros((2 * down + 1, canvas.columns), np.float32)
    ordered[:, np.arange(-right, right + 1) % canvas.columns] = inner
    places = np.arange(-down, down + 1) % canvas.rows

    def ready(left: int, right: int) -> Block:
        waves = row_waves(lambda begin, end: ordered[begin:end], len(ordered), canvas, slice(left, right))

        def transform(begin: int, end: int) -> np.ndarray:
            block = np.zeros((canvas.rows, end - begin), np.complex64)
            block[places] = waves[:, begin - left : end - left]
            return np.asarray(fft(block, axis=0, overwrite_x=True))

        return transform

    return ready
