"""Scan lines of Radiance pictures in memory: from bytes to float32 in one step and back, on every core.

A line is flat (four bytes a pixel), in old runs (before 1991: the pixel (1, 1, 1, n) repeats the one before it n times,
and where several follow each other they count in powers of 256) or in new ones: known by the bytes 2, 2, length, they
hold the four components apart. One file may mix them.
"""

from __future__ import annotations

import os

import numpy as np

from relume.errors import FormatError
from relume.image.bands import in_threads
from relume.image.files.hdr.header import FORMAT
from relume.image.files.read_options import OR_SALVAGE
from relume.image.primaries import mixed

_STEPS = {"-Y": 1, "+Y": -1, "+X": 1, "-X": -1}  # our rows go down, our columns right
DARKEST = 127.5 * 2.0**-135  # the largest channel of a pixel with the smallest codes, 128 and 1, before rounding
_TOGETHER = 2**18  # pixels that one thread takes at a time
_ROUNDING = 1e-6  # of float32, when channels are mixed: a colour of one wavelength may come out as negative as this


def along(pixels: np.ndarray, axes: tuple[str, str]) -> np.ndarray:
    """The view of an upright picture (H, W, …) whose first axis is a file's scan lines, and the second their pixels.

    axes : that scan lines follow each other along, and pixels in them, like ("-Y", "+X"): downwards, and right
    """
    seen = pixels.swapaxes(0, 1) if axes[0][1] == "X" else pixels
    return seen[:: _STEPS[axes[0]], :: _STEPS[axes[1]]]


def decode(
    path: str | os.PathLike[str],
    data: np.ndarray,
    start: int,
    radiance: np.ndarray,
    axes: tuple[str, str],
    *,
    scale: np.ndarray,
    middle: float = 0.0,
    matrix: np.ndarray | None = None,
    salvage: bool = False,
) -> int:
    """Fill `radiance` from scan lines; returns how many there are: all of them, but where a file is salvaged.

    data : uint8, the file from byte `start` on
    radiance : (H, W, 3) float32, upright, contiguous
    axes : of the file, see `along`
    scale : (3,), what the pixels were multiplied by
    middle : added to every mantissa, 0 or ½
    matrix : (3, 3) that the decoded channels are mixed by; None to leave them
    salvage : take a file that ends early as far as it goes, if it holds a whole line
    Raises FormatError with the line and byte where the file breaks its format.
    """
    from relume.image.files.hdr.kernels import decode_lines, find_lines

    view = along(radiance, axes)
    lines, length, _ = view.shape
    begins = np.empty(lines + 1, np.int64)
    whole, place, why = find_lines(data, lines, length, begins)
    if why:
        _refuse_damage(path, whole, lines, length, start + place, why, salvage=salvage)
    with np.errstate(over="ignore"):
        worth = np.ldexp(1.0, np.arange(256) - 136) / scale[:, None]
    worth[:, 0] = 0
    out = radiance.reshape(-1)
    first = (view.ctypes.data - out.ctypes.data) // out.itemsize
    line_step, pixel_step, _ = (step // out.itemsize for step in view.strides)

    def work(begin: int, end: int) -> None:
        decode_lines(data, begins, begin, end, length, worth, middle, out, first, line_step, pixel_step)
        if matrix is not None:
            view[begin:end] = mixed(view[begin:end], matrix)

    in_threads(work, whole, chunk=max(1, _TOGETHER // length))
    return whole


def encoded(
    radiance: np.ndarray, *, matrix: np.ndarray | None = None, compressed: bool
) -> tuple[list[np.ndarray], int, int]:
    """Bytes of the scan lines, in pieces in their order; how many pixels RGBE cannot hold, and how many it blackens.

    radiance : (lines, pixels, 3) float32
    matrix : (3, 3) that its channels are mixed by first; None to leave them
    compressed : by new runs, in lines of 8 to 32767 pixels; others are flat
    """
    from relume.image.files.hdr.kernels import encode_lines

    lines, length, _ = radiance.shape
    steps = np.ldexp(1.0, 136 - np.arange(256))
    steps[0] = 0  # the code of black
    slack = 0.0 if matrix is None else _ROUNDING

    def work(begin: int, end: int) -> tuple[np.ndarray, int, int]:
        pixels = np.ascontiguousarray(radiance[begin:end], np.float32)
        if matrix is not None:
            pixels = mixed(pixels, matrix)
        pixels = pixels.reshape(-1)
        # A plane costs a byte more for every 128 of it, and each line four.
        out = np.empty((end - begin) * (4 * length + 4 * (length // 128 + 1) + 4), np.uint8)
        bits = pixels.view(np.int32)
        used, unfit, dark = encode_lines(pixels, bits, end - begin, length, compressed, steps, slack, out)
        return out[:used], unfit, dark

    done = in_threads(work, lines, chunk=max(1, _TOGETHER // length))
    return [piece for piece, *_ in done], sum(unfit for _, unfit, _ in done), sum(dark for *_, dark in done)


def _refuse_damage(
    path: str | os.PathLike[str], line: int, lines: int, length: int, place: int, why: int, *, salvage: bool
) -> None:
    """Raise FormatError where a file breaks its format, but not where it may end early."""
    from relume.image.files.hdr import kernels

    if why == kernels.ENDS_EARLY and salvage and line > 0:
        return
    expected, found = {
        kernels.ENDS_EARLY: (f"{length} pixels", "the end of the file"),
        kernels.EMPTY_RUN: ("a run of 1 byte or more", "one of none"),
        kernels.LONG_RUN: (f"a run that stays within the line of {length} pixels", "a longer one"),
        kernels.NOTHING_TO_REPEAT: ("the first pixel of the line", "a run that repeats it"),
        kernels.OTHER_LENGTH: (f"a line of {length} pixels", "the mark of another length"),
    }[why]
    where = f"scan line {line + 1} of {lines}, byte {place}"
    if why == kernels.ENDS_EARLY and line > 0:
        raise FormatError(path, FORMAT, where, expected, found, OR_SALVAGE)
    raise FormatError(path, FORMAT, where, expected, found)
