"""Raw floating-point images (.float, .float.gz): 32-bit floats and nothing else, read and written without a library.

Three floats a pixel, the channels interleaved, the top row first, big-endian from workstations and little-endian for
personal computers (Debevec, "Light Probe Image Gallery"); HDR Shop writes and asks for the same. No header gives the
size or the byte order: a square picture's size is inferred, the order is the one of the two that makes sense, and what
cannot be inferred is asked for.
"""

from __future__ import annotations

import math
import os
import zlib
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import numpy as np

from relume.errors import FormatError, UnreadableFile, warn
from relume.image.files.atomic import replacing
from relume.image.files.encodings import RawFloat
from relume.image.files.metadata.attributes import warn_of_losses
from relume.image.files.read_options import OR_SALVAGE, ReadOptions, refuse_absurd_amount, refuse_absurd_size
from relume.image.radiance import OUTSIDE, RadianceMap

_GZIP = b"\x1f\x8b\x08"  # RFC 1952, which knows no other method than 8
_WINDOW = 31  # zlib's word for gzip's header and trailer, and its own largest window
_LEVEL = 6  # gzip's own
_CHUNK = 2**18  # bytes handed to zlib, and taken from it, at once
_BATCH = 256  # rows written at once
_RUNS, _RUN = 64, 1024  # runs of values, evenly spread, and values in each, from which the byte order is inferred
# A value read in the wrong order has its last bits for an exponent, out of this range in seven of ten cases.
_SMALLEST, _LARGEST = 2.0**-40, 2.0**40
_MOST = 0.9  # of the values that are not 0
# A guess is clear where all but stray values make sense in one order and less than half in the other, and where there
# are so many that chance cannot do it (0.3^16 is 4e-9) or no value is a number in the other, as of ½, 1 and 2.
_CLEAR, _UNCLEAR, _MANY = 0.99, 0.5, 16


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RadianceMap:
    """The radiance map in a raw float file, bit for bit; grey in three equal channels.

    options : `float_size` and `float_order` where they are known. Without a size the picture must be square: of three
        channels, or of one where no picture of three has that length. Without an order it is guessed, with a warning
        where it rests on few different values, or values that light seldom has
    Raises FormatError, UnreadableFile, which names the number of pixels or asks for the byte order; ValueError for a
    size below 1.
    """
    with open(path, "rb") as file:
        stored, there = _lengths(path, file)
        width, height, channels = _shape(path, there, options)
        refuse_absurd_size(path, width, height, options, where="float_size" if options.float_size else "its length")
        refuse_absurd_amount(path, 12 * width * height, stored, options)
        values = np.empty((height, width, channels), "<f4")
        data = values.reshape(-1).data.cast("B")
        found = _unpack(path, file, data) if _is_packed(path) else file.readinto(data)
    rows = found // (4 * channels * width)
    if rows == 0 or (rows < height and not options.salvage):
        what = "raw float in gzip" if _is_packed(path) else "raw float"
        raise FormatError(
            path, what, f"byte {found} of the pixels", f"{len(data)} bytes", "the end of the file", OR_SALVAGE
        )
    order = options.float_order or _order(path, values[:rows].reshape(-1))
    if (order == "little") != (np.dtype("<f4") == np.float32):
        values[:rows].byteswap(inplace=True)
    radiance = values.view(np.float32)
    radiance[rows:] = 0
    if channels == 1:
        radiance = np.repeat(radiance, 3, axis=2)
    clipped = None
    if rows < height:
        clipped = np.zeros((height, width), np.uint8)
        clipped[rows:] = OUTSIDE
        warn(f"{path}: ends early; the last {height - rows} of {height} rows are missing", (height - rows) / height)
    return RadianceMap(radiance, clipped=clipped)


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """Byte order, channels, packing and how the size is known, as in "big-endian, colour, gzip, taken for square"."""
    with open(path, "rb") as file:
        _, there = _lengths(path, file)
        *_, channels = _shape(path, there, options)
        data = file.read(_CHUNK)
    if _is_packed(path):
        with suppress(zlib.error):  # reading will say what is wrong
            data = zlib.decompressobj(_WINDOW).decompress(data, _CHUNK)
    shares = _shares(np.frombuffer(data, "<f4", len(data) // 4))
    orders = [options.float_order] if options.float_order else [o for o, share in shares.items() if share >= _MOST]
    words = [f"{orders[0]}-endian"] if len(orders) == 1 else []
    words.append("colour" if channels == 3 else "grey")
    words += ["gzip"] if _is_packed(path) else []
    return ", ".join(words + (["taken for square"] if options.float_size is None else []))


def write(path: str | os.PathLike[str], image: RadianceMap, encoding: RawFloat = RawFloat()) -> None:
    """Write a radiance map bit for bit, in three channels, and gzipped where the name ends in .gz.

    Warns of all that is not kept: the size too, where it is not square. Raises ValueError for a map without pixels, and
    for one whose length gzip cannot store (4 GiB); OutputNotWritten.
    """
    width, height = image.size
    if not width * height:
        raise ValueError(f"the map is {width} x {height} pixels; a .float file holds at least one")
    if _is_packed(path) and image.radiance.nbytes >= 2**32:
        raise ValueError(f"the map has {image.radiance.nbytes} bytes; gzip stores lengths below 4 GiB: write .float")
    warn_of_losses(path, image, (), unit=False)
    if width != height:
        warn(f"{path}: does not store its size; to read it again give it, --float-size {width}x{height}")
    number = ">f4" if encoding.big_endian else "<f4"
    packer = zlib.compressobj(_LEVEL, wbits=_WINDOW) if _is_packed(path) else None
    with replacing(path) as temporary, open(temporary, "wb") as file:
        for begin in range(0, height, _BATCH):
            batch = np.ascontiguousarray(image.radiance[begin : begin + _BATCH], number)
            data = batch.reshape(-1).view(np.uint8).data
            file.write(packer.compress(data) if packer else data)
        if packer:
            file.write(packer.flush())


def _is_packed(path: str | os.PathLike[str]) -> bool:
    return Path(path).name.lower().endswith(".gz")


def _lengths(path: str | os.PathLike[str], file: BinaryIO) -> tuple[int, int]:
    """Bytes of the file, and of its floats: those that gzip's last four bytes claim."""
    stored = os.fstat(file.fileno()).st_size
    if not _is_packed(path):
        return stored, stored
    magic = file.read(3)
    if magic != _GZIP or stored < 18:
        remedy = "name it .float if it is not packed"
        raise FormatError(path, "gzip", "byte 0", f"{_GZIP.hex(' ')}", magic.hex(" ") or "nothing", remedy)
    file.seek(-4, os.SEEK_END)
    there = int.from_bytes(file.read(4), "little")
    file.seek(0)
    return stored, there


def _shape(path: str | os.PathLike[str], there: int, options: ReadOptions) -> tuple[int, int, int]:
    """Width, height and channels of `there` bytes.

    No length is that of a square of three channels and also of one, as 3 is no square. But a square of one channel
    whose side is a multiple of 3 is also as long as an oblong of three: only the others are taken for grey.
    """
    if options.float_size is not None:
        width, height = options.float_size
        colour, grey = 12 * width * height, 4 * width * height
        if there in (colour, grey) or (options.salvage and (there < colour or _is_packed(path))):
            return width, height, 1 if there == grey else 3
        expected = f"{colour} bytes of three channels, or {grey} of one, for {width} x {height} pixels"
        raise FormatError(path, "raw float", "its length", expected, f"{there}", "give its true float_size")
    if there % 4:
        raise FormatError(path, "raw float", "its length", "a multiple of 4 bytes", f"{there}")
    values = there // 4
    if values % 3 == 0 and (side := math.isqrt(values // 3)) ** 2 == values // 3:
        return side, side, 3
    if values % 3 and (side := math.isqrt(values)) ** 2 == values:
        return side, side, 1
    shared = f"{values} pixels of one channel" if values % 3 else f"{values // 3} pixels of three channels"
    shared += f", or {values} of one" if values % 3 == 0 and math.isqrt(values) ** 2 == values else ""
    raise UnreadableFile(f"{path}: {shared}, no square, and the file has no shape; give it, --float-size WIDTHxHEIGHT")


def _unpack(path: str | os.PathLike[str], file: BinaryIO, data: memoryview) -> int:
    """Fill `data` from a gzip file, never beyond; how many bytes there were."""
    unpacker, done = zlib.decompressobj(_WINDOW), 0
    while not unpacker.eof and (packed := unpacker.unconsumed_tail or file.read(_CHUNK)):
        try:
            piece = unpacker.decompress(packed, _CHUNK)
        except zlib.error as error:
            where = f"near byte {file.seek(0, os.SEEK_CUR) - len(packed)}"
            raise FormatError(path, "gzip", where, "packed floats", str(error).split(": ")[-1]) from None
        if done + len(piece) > len(data):
            where = "the length in its last four bytes"
            raise FormatError(path, "gzip", where, f"{len(data)} bytes unpacked, as they claim", "more")
        data[done : done + len(piece)] = piece
        done += len(piece)
    if unpacker.eof and (unpacker.unused_data or file.read(1)):
        where = f"byte {file.seek(0, os.SEEK_CUR) - len(unpacker.unused_data)}"
        raise FormatError(path, "gzip", where, "the end of the file", "more", "unpack it with gunzip")
    return done


def _order(path: str | os.PathLike[str], values: np.ndarray) -> str:
    """The byte order in which values, seen as little-endian, make sense."""
    bits = values.view("<u4")
    if len(bits) > _RUNS * _RUN:
        starts = np.linspace(0, len(bits) - _RUN, _RUNS).astype(int)
        seen = np.concatenate([bits[start : start + _RUN] for start in starts])
        bits = seen if seen.any() else bits[bits != 0][: _RUNS * _RUN]
    if not bits.any():
        return "little"  # zeros, in whatever order
    values = bits.view("<f4")
    shares = _shares(values)
    orders = [order for order, share in shares.items() if share >= _MOST]
    if len(orders) != 1:
        which = "both byte orders" if orders else "neither byte order"
        packed = " (.gz is for gzipped ones)" if values[:1].tobytes().startswith(_GZIP) else ""
        sense = " and ".join(f"{share:.0%} as {order}-endian" for order, share in shares.items())
        raise UnreadableFile(
            f"{path}: its values make sense in {which} ({sense}){packed}; give --float-order little or big"
        )
    (guess,) = orders
    (other,) = shares.keys() - {guess}
    different = len(np.unique(bits[bits != 0]))
    # Any value that is a normal number in the other order: not 0, infinite, NaN, or so small that floats lose digits.
    exponents = (bits if other == "little" else bits.byteswap()) >> 23 & 255
    few = different < _MANY and np.any((exponents > 0) & (exponents < 255))
    if shares[guess] < _CLEAR or shares[other] >= _UNCLEAR or few:
        sense = f"{shares[guess]:.0%} make sense so, {shares[other]:.0%} the other way"
        evidence = f"of its values, {different} different ones, {sense}"
        warn(f"{path}: {guess}-endian by a guess: {evidence}; give --float-order {guess} or {other}")
    return guess


def _shares(values: np.ndarray) -> dict[str, float]:
    """Of the values that are not 0, how many are finite and of a magnitude that light has in each byte order."""
    shares = dict[str, float]()
    for order, seen in (("little", values), ("big", values.byteswap())):
        with np.errstate(all="ignore"):
            magnitudes = np.abs(seen[seen != 0])
            sensible = np.count_nonzero((magnitudes >= _SMALLEST) & (magnitudes <= _LARGEST))
        shares[order] = sensible / len(magnitudes) if len(magnitudes) else 1.0
    return shares
