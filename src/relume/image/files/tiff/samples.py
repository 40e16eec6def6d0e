"""The samples of a TIFF's strips and tiles, unpacked by imagecodecs under limits of our own.

imagecodecs decodes each block by itself, into as many bytes as the block has pixels and no more, prints nothing, and
knows what OpenImageIO 3.2 gets wrong: floats of 24 bits, and packed tiles of doubles. tifffile reads the frame of these
files too, but passes over a damaged tag with a line in a log, so that a lost sample format would be read as another
kind of number; see docs/decisions. Format: Adobe Photoshop TIFF technical note 3.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.errors import FormatError
from relume.image.bands import in_threads
from relume.image.files.signatures import one_line
from relume.image.files.tiff.layout import LZW, NONE, OLD_ZIP, PACKBITS, ZIP, Layout

_PREDICTED = 3
_PIECE = 2**25  # bytes of samples at once: enough to share among cores, and no second copy of the picture


@dataclass(frozen=True, eq=False)
class Piece:
    """Some samples of a picture.

    top, left, first : the row, column and sample of the first of them
    values : (rows, columns, samples) floats of 16, 32 or 64 bits, or whole numbers of 8 or 16
    """

    top: int
    left: int
    first: int
    values: np.ndarray


def pieces(path: str | os.PathLike[str], order: str, layout: Layout, rows: int) -> Iterator[Piece]:
    """The samples of the first `rows` rows, strip by strip; raises FormatError where they are damaged.

    order : "<" or ">", the byte order of the file
    """
    blocks = [index for index in range(len(layout.places)) if _place_of(layout, index)[1] < rows]
    each = layout.block[0] * layout.block[1] * 8 * (1 if layout.planar else layout.samples)
    together = max(1, _PIECE // each)
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        for begin in range(0, len(blocks), together):
            part = blocks[begin : begin + together]
            stored = []
            for index in part:
                file.seek(min(layout.places[index], size))
                stored.append(file.read(max(min(layout.lengths[index], size - layout.places[index]), 0)))

            def work(first: int, _end: int, part: list[int] = part, stored: list[bytes] = stored) -> Piece:
                return _unpacked(path, order, layout, rows, part[first], stored[first])

            yield from in_threads(work, len(part), chunk=1)


def predicted(pixels: np.ndarray) -> bytes:
    """(rows, W, samples) little-endian float32 as the floating-point predictor stores them."""
    import imagecodecs

    return np.asarray(imagecodecs.floatpred_encode(np.ascontiguousarray(pixels), axis=-2)).tobytes()


def _place_of(layout: Layout, index: int) -> tuple[int, int, int]:
    """The plane, the top row and the left column of a strip or tile."""
    plane, place = divmod(index, layout.across * layout.down)
    return plane, place // layout.across * layout.block[1], place % layout.across * layout.block[0]


def _unpacked(path: str | os.PathLike[str], order: str, layout: Layout, rows: int, index: int, stored: bytes) -> Piece:
    """The pixels of one block that lie in the picture."""
    plane, top, left = _place_of(layout, index)
    samples, wide = 1 if layout.planar else layout.samples, layout.block[0]
    row = wide * samples * layout.bits // 8
    needed = min(layout.block[1], rows - top) * row
    # Some writers fill the last strip up to the height of the others.
    data = _decoded(path, layout, index, stored, needed, layout.block[1] * row)
    values = _values(data[:needed], order, layout, wide, samples)
    return Piece(top, left, plane, values[:, : layout.width - left])


def _decoded(path: str | os.PathLike[str], layout: Layout, index: int, stored: bytes, needed: int, most: int) -> bytes:
    """The bytes of a block, `needed` or more; raises FormatError where they are fewer, more than `most`, or damaged."""
    import imagecodecs

    where = f"{'tile' if layout.tiled else 'strip'} {index}"
    decoders: dict[int, Callable[..., Any]] = {
        ZIP: imagecodecs.deflate_decode,
        OLD_ZIP: imagecodecs.deflate_decode,
        LZW: imagecodecs.lzw_decode,
        PACKBITS: imagecodecs.packbits_decode,
    }
    data = stored
    if layout.compression != NONE:
        try:
            data = bytes(decoders[layout.compression](stored, out=most))
        except (RuntimeError, ValueError) as error:
            raise FormatError(path, "TIFF", where, f"whole {layout.packing} data", one_line(error)) from None
    if len(data) < needed:
        raise FormatError(path, "TIFF", where, f"{needed} bytes of pixels", str(len(data)))
    return data


def _values(data: bytes, order: str, layout: Layout, wide: int, samples: int) -> np.ndarray:
    """(rows, wide, samples) numbers of whole rows of a strip or tile."""
    import imagecodecs

    each = layout.bits // 8
    if layout.predictor == _PREDICTED and each == 3:
        data, order = _weighed(data, wide, samples), ">"
    if each == 3:
        byteorder = "<" if order == "<" else ">"
        return np.asarray(imagecodecs.float24_decode(data, byteorder=byteorder)).reshape(-1, wide, samples)
    letter = "f" if layout.sample_format == 3 else "u"
    values = np.frombuffer(data, f"{order}{letter}{each}").reshape(-1, wide, samples)
    if layout.predictor == _PREDICTED:
        return np.asarray(imagecodecs.floatpred_decode(values, axis=-2))
    return values


def _weighed(data: bytes, wide: int, samples: int) -> bytes:
    """Big-endian samples of 24 bits from the floating-point predictor, which imagecodecs undoes for other sizes."""
    rows = np.frombuffer(data, np.uint8).reshape(-1, wide * samples * 3)
    sums = np.cumsum(rows.reshape(len(rows), -1, samples), axis=1, dtype=np.uint8)
    return sums.reshape(len(rows), 3, -1).swapaxes(1, 2).tobytes()
