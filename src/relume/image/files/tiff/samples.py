"""The samples of a TIFF, piece by piece: through OpenImageIO, or unpacked here where it does not know them.

OpenImageIO 3.2 takes floats of 24 bits for something else and makes noise of packed tiles of doubles; what is not
packed needs no decoder, and is read here as far as a file that ends early goes. Format: Adobe Photoshop TIFF technical
note 3.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from relume.errors import FormatError
from relume.image.files.signatures import one_line
from relume.image.files.tiff.layout import NONE, Layout

_PREDICTED = 3
_PIECE = 2**23  # bytes of samples at once: enough to share among cores, and no second copy of the picture


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
    """The samples of the first `rows` rows; raises FormatError where they are damaged.

    order : "<" or ">", the byte order of the file
    """
    if layout.compression == NONE or needs_own(layout):
        return _own(path, order, layout, rows)
    return _foreign(path, layout, rows)


def needs_own(layout: Layout) -> bool:
    """Whether OpenImageIO would get it wrong, so that only what is unpacked here is read: uncompressed and ZIP."""
    return layout.bits == 24 or (layout.bits == 64 and layout.tiled)


def predicted(pixels: np.ndarray) -> bytes:
    """(rows, W, samples) little-endian float32 as the floating-point predictor stores them.

    The bytes of a row are sorted by their weight, the highest first; then each is told as its difference from the one a
    pixel's samples before it.
    """
    rows, width, samples = pixels.shape
    weights = pixels.view(np.uint8).reshape(rows, width * samples, 4)[..., ::-1].swapaxes(1, 2).reshape(rows, -1)
    told = weights.copy()
    told[:, samples:] -= weights[:, :-samples]
    return told.tobytes()


def _foreign(path: str | os.PathLike[str], layout: Layout, rows: int) -> Iterator[Piece]:
    import OpenImageIO as oiio

    wanted = oiio.ImageSpec()
    wanted.attribute("oiio:UnassociatedAlpha", 1)  # else colours come multiplied by alpha
    source = oiio.ImageInput.open(str(path), wanted)
    if source is None:
        raise FormatError(path, "TIFF", "its header", "a sound one", one_line(oiio.geterror()))
    try:
        spec = source.spec()
        found = (spec.width, spec.height, spec.nchannels, source.format_name())
        if found != (layout.width, layout.height, layout.samples, "tiff"):
            expected = f"{layout.width} x {layout.height} x {layout.samples}"
            raise FormatError(path, "TIFF", "its header", expected, " x ".join(map(str, found)))
        deep = layout.block[1]
        step = max(1, _PIECE // max(1, layout.decoded // layout.height) // deep) * deep
        for top in range(0, rows, step):
            end = min(top + step, rows)
            if layout.tiled:
                values = source.read_tiles(0, layout.width, top, end, 0, 1, 0, spec.nchannels, spec.format)
            else:
                values = source.read_scanlines(top, end, 0, 0, spec.nchannels, spec.format)
            complaint = one_line(source.geterror()).replace(f' ("{path}")', "")
            if values is None or complaint:
                where = f"rows {top} to {end - 1}"
                raise FormatError(path, "TIFF", where, f"whole {layout.packing} data", complaint or "none")
            yield Piece(top, 0, 0, values.reshape(end - top, layout.width, layout.samples))
    finally:
        source.close()


def _own(path: str | os.PathLike[str], order: str, layout: Layout, rows: int) -> Iterator[Piece]:
    samples = 1 if layout.planar else layout.samples
    wide, deep = layout.block
    step = max(1, _PIECE // (wide * samples * 8))
    with open(path, "rb") as file:
        for index in range(len(layout.places)):
            plane, place = divmod(index, layout.across * layout.down)
            top, left = place // layout.across * deep, place % layout.across * wide
            wanted = min(deep, rows - top)
            if wanted <= 0:
                continue
            unpacked = _Unpacked(path, file, layout, index)
            for begin in range(0, wanted, step):
                count = min(step, wanted - begin)
                stored = unpacked.read(count * wide * samples * layout.bits // 8)
                values = _values(stored, order, layout, wide, samples)
                yield Piece(top + begin, left, plane, values[:, : layout.width - left])


class _Unpacked:
    """The bytes of one strip or tile, unpacked as they are asked for."""

    def __init__(self, path: str | os.PathLike[str], file: BinaryIO, layout: Layout, index: int) -> None:
        self.path, self.file, self.where = path, file, f"{'tile' if layout.tiled else 'strip'} {index}"
        self.left, self.tail = layout.lengths[index], b""
        self.inflater = None if layout.compression == NONE else zlib.decompressobj()
        self.file.seek(layout.places[index])

    def read(self, count: int) -> bytes:
        """The next `count` bytes; raises FormatError where there are fewer."""
        if self.inflater is None:
            read = self._stored(count)
        else:
            read = self._inflated(count)
        if len(read) < count:
            raise FormatError(self.path, "TIFF", self.where, f"{count} more bytes of pixels", str(len(read)))
        return read

    def _stored(self, count: int) -> bytes:
        read = self.file.read(min(count, self.left))
        self.left -= len(read)
        return read

    def _inflated(self, count: int) -> bytes:
        assert self.inflater is not None
        found = []
        while count > 0:
            packed = self.tail or self._stored(2**16)
            if not packed:
                break
            try:
                found.append(self.inflater.decompress(packed, count))
            except zlib.error as error:
                raise FormatError(self.path, "TIFF", self.where, "whole ZIP data", str(error)) from None
            self.tail = self.inflater.unconsumed_tail
            count -= len(found[-1])
        return b"".join(found)


def _values(stored: bytes, order: str, layout: Layout, wide: int, samples: int) -> np.ndarray:
    """(rows, wide, samples) numbers of whole rows of a strip or tile."""
    each = layout.bits // 8
    values = np.frombuffer(stored, np.uint8).reshape(-1, wide * samples * each)
    if layout.predictor == _PREDICTED:
        values, order = _unpredicted(values, samples, each), ">"
    if each != 3:
        letter = "f" if layout.sample_format == 3 else "u"
        return values.view(f"{order}{letter}{each}").reshape(-1, wide, samples)
    weighed = values.reshape(-1, wide, samples, 3).astype(np.uint32)
    high, low = (0, 2) if order == ">" else (2, 0)
    return _floats_of_24_bits(weighed[..., high] << 16 | weighed[..., 1] << 8 | weighed[..., low])


def _floats_of_24_bits(codes: np.ndarray) -> np.ndarray:
    """float32, exact, of 1 sign, 7 exponent bits of bias 63 and 16 mantissa bits, as IEEE 754 would have them."""
    sign, exponent, mantissa = (codes >> 23) << 31, (codes >> 16) & 127, codes & 0xFFFF
    biased = np.where(exponent == 127, 255, exponent + (127 - 63)).astype(np.uint32)  # 127 is infinity, or no number
    normal = (sign | biased << 23 | mantissa << 7).view(np.float32)
    denormal = mantissa.astype(np.float32) * np.where(sign, np.float32(-(2.0**-78)), np.float32(2.0**-78))
    return np.where(exponent == 0, denormal, normal)


def _unpredicted(told: np.ndarray, samples: int, each: int) -> np.ndarray:
    """(rows, bytes) big-endian samples of `each` bytes, of what `predicted` makes."""
    sums = np.cumsum(told.reshape(len(told), -1, samples), axis=1, dtype=np.uint8)
    return np.ascontiguousarray(sums.reshape(len(told), each, -1).swapaxes(1, 2)).reshape(len(told), -1)
