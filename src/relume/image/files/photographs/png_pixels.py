"""The pixels of a PNG: inflated, unfiltered, put together from their passes, and widened to whole bytes.

Ours and not libpng's, because that tells damage on stderr, where no program finds it, and does not say which row.
Format: W3C PNG 3rd edition, clauses 7 to 11.
"""

from __future__ import annotations

import os
import warnings
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.errors import FormatError
from relume.image.files.photographs.png import Chunks, Header

# First column and row of each pass of an interlaced PNG, and the steps from one to the next (8.2).
_PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
_SLICE = 2**16  # bytes to inflate at once, at most 64 MiB of rows


def decoded(path: str | os.PathLike[str], header: Header, chunks: Chunks) -> np.ndarray:
    """(H, W, 1 to 4) uint8 or uint16: grey, RGB, each with alpha where the file has it or a transparent colour.

    Grey of less than 8 bits is widened such that white is 255. Warns of what a decoder can do without: a tRNS chunk
    of a wrong length, numbers beyond the palette (black), data behind the last row. Raises FormatError where rows are
    missing or damaged.
    """
    passes = _PASSES if header.interlaced else ((0, 0, 1, 1),)
    sizes = [(-(-(header.width - x) // across), -(-(header.height - y) // down)) for x, y, across, down in passes]
    wanted = sum(high * (1 + header.bytes_of(wide)) for wide, high in sizes if wide > 0)
    inflated = _inflated(chunks.packed, wanted)
    if inflated.error or inflated.filled < wanted or not inflated.ended:
        where = f"its pixels, byte {inflated.filled} of {wanted}"
        raise FormatError(path, "PNG", where, "deflated data that is whole", inflated.error or "its end")
    if inflated.more:
        warnings.warn(f"{path}: holds more data than its pixels need; look whether its size is right", stacklevel=5)
    samples, begin = np.empty((0, 0, 0), np.uint8), 0
    for (x, y, across, down), (wide, high) in zip(passes, sizes, strict=True):
        if wide <= 0 or high <= 0:
            continue
        each = 1 + header.bytes_of(wide)
        lines = inflated.lines[begin : begin + high * each].reshape(high, each)
        found = _samples(path, header, lines, wide, (y, down))
        begin += high * each
        if not header.interlaced:
            samples = found
            break
        if not samples.size:
            samples = np.empty((header.height, header.width, found.shape[2]), found.dtype)
        samples[y::down, x::across] = found
    del inflated
    return _coloured(path, header, chunks, samples)


def whole_rows(path: str | os.PathLike[str], header: Header, chunks: Chunks) -> np.ndarray | None:
    """As `decoded`, the rows from the top that a file which ends early still holds; None where it is damaged besides.

    header : of a PNG that is not interlaced
    """
    each = 1 + header.bytes_of(header.width)
    inflated = _inflated(chunks.packed, each * header.height)
    if inflated.error:
        return None
    rows = inflated.filled // each
    samples = _samples(path, header, inflated.lines[: rows * each].reshape(rows, each), header.width, (0, 1))
    return _coloured(path, header, chunks, samples)


@dataclass(frozen=True, eq=False)
class _Inflated:
    """Rows as they are stored: `filled` bytes of `lines` are there; `more` were to be had; `ended` with a checksum."""

    lines: np.ndarray
    filled: int
    error: str = ""
    more: bool = False
    ended: bool = True


def _inflated(packed: Sequence[memoryview], wanted: int) -> _Inflated:
    lines, filled = np.empty(wanted, np.uint8), 0
    engine = zlib.decompressobj()
    try:
        for piece in packed:
            for begin in range(0, len(piece), _SLICE):
                found = engine.decompress(piece[begin : begin + _SLICE], wanted - filled + 1)
                fits = min(len(found), wanted - filled)
                lines[filled : filled + fits] = np.frombuffer(found, np.uint8, fits)
                filled += fits
                if len(found) > fits or engine.eof:
                    return _Inflated(lines, filled, more=len(found) > fits)
    except zlib.error as error:
        return _Inflated(lines, filled, str(error))
    return _Inflated(lines, filled, ended=False)


def _samples(
    path: str | os.PathLike[str], header: Header, lines: np.ndarray, width: int, place: tuple[int, int]
) -> np.ndarray:
    """(H, width, samples) uint8 or uint16 of one pass, as stored; its rows are those from `place`[0] by `place`[1]."""
    from relume.image.files.photographs.png_kernels import unfilter

    rows = np.empty((lines.shape[0], lines.shape[1] - 1), np.uint8)
    whole = unfilter(lines, max(1, header.samples * header.bits // 8), rows)
    if whole < len(rows):
        row = place[0] + whole * place[1]
        raise FormatError(path, "PNG", f"row {row}", "a filter of 0 to 4", str(lines[whole, 0]))
    if header.bits == 16:
        wide = rows.view(np.uint16)
        if np.little_endian:
            wide.byteswap(inplace=True)
        return wide.reshape(len(rows), width, header.samples)
    if header.bits < 8:
        shifts = np.arange(8 - header.bits, -1, -header.bits, dtype=np.uint8)
        rows = ((rows[:, :, None] >> shifts) & np.uint8(2**header.bits - 1)).reshape(len(rows), -1)[:, :width]
    return rows.reshape(len(rows), width, header.samples)


def _coloured(path: str | os.PathLike[str], header: Header, chunks: Chunks, samples: np.ndarray) -> np.ndarray:
    """Palette and transparent colour in place of the numbers that stand for them."""
    told = chunks.ahead.get(b"tRNS")
    if header.colour == "palette":
        return _from_palette(path, header, chunks.ahead.get(b"PLTE"), told, samples)
    key = None
    if told is not None:
        if header.colour in ("grey", "RGB") and len(told) == 2 * header.samples:
            key = np.frombuffer(told, ">u2").astype(np.uint16) & (2**header.bits - 1)
        else:
            _warn_of_transparency(path, told)
    transparent = None if key is None else np.all(samples == key, axis=2, keepdims=True)
    if header.bits < 8:
        samples = samples * np.uint8(255 // (2**header.bits - 1))
    if transparent is None:
        return samples
    alpha = np.where(transparent, 0, np.iinfo(samples.dtype).max).astype(samples.dtype)
    return np.concatenate([samples, alpha], axis=2)


def _from_palette(
    path: str | os.PathLike[str], header: Header, told: bytes | None, alpha: bytes | None, samples: np.ndarray
) -> np.ndarray:
    if told is None or len(told) % 3 or not 3 <= len(told) <= 768:
        found = "none" if told is None else f"{len(told)} bytes"
        raise FormatError(path, "PNG", "its PLTE chunk", "1 to 256 colours of 3 bytes ahead of the pixels", found)
    count = len(told) // 3
    if alpha is not None and len(alpha) > count:
        _warn_of_transparency(path, alpha)
        alpha = None
    table = np.zeros((256, 3 if alpha is None else 4), np.uint8)
    table[:count, :3] = np.frombuffer(told, np.uint8).reshape(count, 3)
    if alpha is not None:
        table[:, 3] = 255
        table[: len(alpha), 3] = np.frombuffer(alpha, np.uint8)
    if beyond := int(np.count_nonzero(samples >= count)):
        warnings.warn(
            f"{path}: {beyond} of its pixels are beyond its palette of {count} colours, and black", stacklevel=6
        )
    return table[samples[..., 0]]


def _warn_of_transparency(path: str | os.PathLike[str], told: bytes) -> None:
    warnings.warn(f"{path}: its tRNS chunk of {len(told)} bytes makes no sense and is left out", stacklevel=7)
