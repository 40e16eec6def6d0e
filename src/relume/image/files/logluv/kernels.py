"""The loops of LogLuv over pixels: runs to words and back, words to colours and back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from relume.image.files.logluv.codes import CELL, GRID, LOWEST, NEUTRAL, SIGN
from relume.image.kernel import exact_kernel

_NEUTRAL_U, _NEUTRAL_V = NEUTRAL
_FAR = 8.0  # u′ and v′ beyond are as good as this, and no float64 that no integer could hold

# What `encode` counts, by place.
NOT_FINITE, TOO_BRIGHT, TOO_DARK, NEGATIVE, NO_SUCH_COLOUR, COLOURED, KINDS = range(7)
_COLOURED = 2 ** (1 / 256) - 1  # a step of luminance: below it, channels are as good as equal


@exact_kernel
def find_rows(
    data: Any, begins: Any, ends: Any, firsts: Any, width: int, streams: int, places: Any, failures: Any
) -> None:
    """Where each row's first stream of runs begins in `data`, for the blocks that begin and end there.

    places[firsts[b]] to places[firsts[b + 1]] are the rows of block b; −1 is left for those from its first failure on.
    failures : (blocks, 3): row within the block, byte, and the pixels that its stream has by then; more than `width`
        for a run that goes beyond the row
    """
    for block in range(begins.shape[0]):
        at, end = begins[block], ends[block]
        for row in range(firsts[block + 1] - firsts[block]):
            start = at
            for _stream in range(streams):
                filled = 0
                while filled < width and at < end:
                    number = np.int64(data[at])
                    length = 2 if number >= 128 else number + 1
                    if at + length > end:
                        break
                    filled += number - 126 if number >= 128 else number
                    if filled > width:
                        break
                    at += length
                if filled != width:
                    failures[block, 0], failures[block, 1], failures[block, 2] = row, at, filled
                    break
            if failures[block, 0] >= 0:
                break
            places[firsts[block] + row] = start


@exact_kernel
def unpack_runs(data: Any, places: Any, streams: int, words: Any) -> None:
    """The words of the rows that begin at `places`, each the sum of its byte streams, the highest first; 0 for −1."""
    width = words.shape[1]
    for row in range(places.shape[0]):
        at = places[row]
        words[row, :] = 0
        if at < 0:
            continue
        for stream in range(streams):
            shift = np.uint32(24 - 8 * stream)
            column = 0
            while column < width:
                number = np.int64(data[at])
                if number >= 128:
                    value = np.uint32(data[at + 1]) << shift
                    for j in range(column, column + number - 126):
                        words[row, j] |= value
                    column += number - 126
                    at += 2
                else:
                    for j in range(number):
                        words[row, column + j] |= np.uint32(data[at + 1 + j]) << shift
                    column += number
                    at += number + 1


@exact_kernel
def pack_runs(words: Any, streams: int, packed: Any) -> int:
    """Write the byte streams of rows of words to `packed` as runs of 4 and more, and literals; how many bytes."""
    height, width = words.shape
    at = 0
    for row in range(height):
        for stream in range(streams):
            shift = np.uint32(24 - 8 * stream)
            column = 0
            literal = -1  # the place of the count of the literals that are being written
            while column < width:
                value = np.uint8(words[row, column] >> shift)
                end = column + 1
                while end < width and end < column + 129 and np.uint8(words[row, end] >> shift) == value:
                    end += 1
                if end - column >= 4 or (literal < 0 and end - column >= 2):
                    packed[at] = end - column + 126
                    packed[at + 1] = value
                    at += 2
                    literal = -1
                    column = end
                    continue
                for _ in range(end - column):
                    if literal < 0 or packed[literal] == 127:
                        literal = at
                        packed[at] = 0
                        at += 1
                    packed[literal] += 1
                    packed[at] = value
                    at += 1
                column = end
    return at


@exact_kernel
def unpack_24(data: Any, places: Any, cells: int, words: Any) -> Any:
    """The words of rows of three bytes a pixel; how many are not black and have a code from `cells` on."""
    strange = 0
    for row in range(places.shape[0]):
        at = places[row]
        if at < 0:
            words[row, :] = 0
            continue
        for column in range(words.shape[1]):
            stored = np.uint32(data[at]) << 16 | np.uint32(data[at + 1]) << 8 | np.uint32(data[at + 2])
            words[row, column] = (stored >> 14) << 16 | stored & 0x3FFF
            strange += (stored & 0x3FFF) >= cells and stored >> 14 > 0
            at += 3
    return strange


@exact_kernel
def pack_24(words: Any, packed: Any) -> None:
    """Write words to (N, 3) bytes, the highest first."""
    for i in range(words.shape[0]):
        stored = (words[i] >> 16) << 14 | words[i] & 0x3FFF
        packed[i, 0], packed[i, 1], packed[i, 2] = stored >> 16, stored >> 8 & 255, stored & 255


@exact_kernel
def paint(words: Any, luminances: Any, colours: Any, picture: Any) -> None:
    """Each pixel of a float32 picture the product of its word's entries in two tables."""
    mask = np.uint32(colours.shape[0] - 1)
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            word = words[row, column]
            luminance, colour = luminances[word >> 16], word & mask
            for channel in range(3):
                picture[row, column, channel] = luminance * colours[colour, channel]


@exact_kernel
def encode(
    pixels: Any,
    to_xyz: Any,
    scale: tuple[int, int, int, bool],
    starts: Any,
    counts: Any,
    firsts: Any,
    words: Any,
    doubts: Any,
) -> None:
    """The words of (N, 3) linear pixels, and how many of each doubt.

    scale : steps, lowest, codes and signed of the `LogScale`
    starts, counts, firsts : the gamut's scan lines; none for the square grid of 32 bits
    """
    steps, lowest, codes, signed = scale
    for i in range(pixels.shape[0]):
        r, g, b = float(pixels[i, 0]), float(pixels[i, 1]), float(pixels[i, 2])
        # CIE XYZ, and the code of the luminance.
        x = to_xyz[0, 0] * r + to_xyz[0, 1] * g + to_xyz[0, 2] * b
        y = to_xyz[1, 0] * r + to_xyz[1, 1] * g + to_xyz[1, 2] * b
        z = to_xyz[2, 0] * r + to_xyz[2, 1] * g + to_xyz[2, 2] * b
        luminance = 0
        if not math.isfinite(r + g + b):
            doubts[NOT_FINITE] += 1
        elif y < 0 and not signed:
            doubts[NEGATIVE] += 1
        elif y != 0:
            luminance = max(0, math.floor(steps * (math.log2(abs(y)) + lowest)))
            if luminance == 0:
                doubts[TOO_DARK] += 1
            if luminance >= codes:
                doubts[TOO_BRIGHT] += 1
                luminance = 0
        elif r != 0 or g != 0 or b != 0:
            doubts[TOO_DARK] += 1
        # The chromaticity; neutral for black.
        u, v = _NEUTRAL_U, _NEUTRAL_V
        if luminance > 0:
            if y < 0:
                luminance |= SIGN
                x, y, z = -x, -y, -z
            total = x + 15 * y + 3 * z
            if total > 0:
                u, v = min(max(4 * x / total, -_FAR), _FAR), min(max(9 * y / total, -_FAR), _FAR)
            else:  # eq. 2 has no meaning
                doubts[NO_SUCH_COLOUR] += 1
            if max(r, g, b) - min(r, g, b) > _COLOURED * y:
                doubts[COLOURED] += 1
        # The code of the colour: a cell of the gamut in 24 bits, else one of the square grid.
        if starts.shape[0]:
            colour = -1
            line = math.floor((v - LOWEST) / CELL)
            if 0 <= line < starts.shape[0]:
                along = math.floor((u - starts[line]) / CELL)
                if 0 <= along < counts[line]:
                    colour = firsts[line] + along
            if colour < 0:
                doubts[NO_SUCH_COLOUR] += 1
                nearest = math.inf
                for line in range(starts.shape[0]):
                    along = min(max(math.floor((u - starts[line]) / CELL), 0), counts[line] - 1)
                    off_u = u - starts[line] - (along + 0.5) * CELL
                    off_v = v - LOWEST - (line + 0.5) * CELL
                    if off_u * off_u + off_v * off_v < nearest:
                        nearest = off_u * off_u + off_v * off_v
                        colour = firsts[line] + along
        else:
            column, line = math.floor(GRID * u), math.floor(GRID * v)
            if not (0 <= column < 256 and 0 <= line < 256):
                doubts[NO_SUCH_COLOUR] += 1
            colour = min(max(column, 0), 255) << 8 | min(max(line, 0), 255)
        words[i] = luminance << 16 | colour
