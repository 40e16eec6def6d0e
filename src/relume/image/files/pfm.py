"""Portable float maps (.pfm): a header of three words and 32-bit floats, read and written without a library.

The header is "PF" (colour) or "Pf" (grey), width and height, and a scale whose sign is the byte order: negative is
little-endian. One byte of white space follows, then the rows, the bottom one first (Debevec, "Portable FloatMap image
format"; netpbm's pfm(5)). Photoshop writes the top row first, and nothing in its files says so.

Debevec's format knows no scale but 1. netpbm's is the unit of the samples, so that a value is a sample times the scale:
that is done here, as OpenImageIO does, with a warning; OpenCV divides, Pillow and HDR Shop leave the samples alone.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from relume.errors import FormatError, UnreadableFile, warn
from relume.image.files.atomic import replacing
from relume.image.files.encodings import PFM
from relume.image.files.metadata.attributes import warn_of_losses
from relume.image.files.read_options import OR_SALVAGE, ReadOptions, refuse_absurd_amount, refuse_absurd_size
from relume.image.radiance import OUTSIDE, RadianceMap

_HEADER = 2**14  # bytes in which a header ends; with comments, which Debevec's has not, but some readers take
_BATCH = 64  # rows turned over and written at once, which stay in the cache
_GAP = re.compile(rb"(?:\s|#[^\n]*\n)+")
_COMMENT = re.compile(rb"#([^\n]*)\n")
_WORDS = (
    ("width", re.compile(rb"\d{1,9}(?=\s)")),
    ("height", re.compile(rb"\d{1,9}(?=\s)")),
    ("scale", re.compile(rb"[-+]?(?:\d{1,30}\.?\d{0,30}|\.\d{1,30})(?:[eE][-+]?\d{1,3})?(?=\s)")),
)


@dataclass(frozen=True)
class _Header:
    width: int
    height: int
    channels: int
    order: str  # "<" or ">"
    scale: float
    comments: str
    end: int  # one byte of white space lies there, then the pixels

    @property
    def row(self) -> int:
        """Bytes of a row."""
        return 4 * self.channels * self.width


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RadianceMap:
    """The radiance map in a portable float map, bit for bit where its scale is 1 or −1; grey in three equal channels.

    Comments between the words of the header are kept as "comments". Warns of another scale, which the samples are
    multiplied by, and of bytes after the pixels. Raises FormatError, UnreadableFile.
    """
    with open(path, "rb") as file:
        header, size = _header(path, file), os.fstat(file.fileno()).st_size
        width, height = header.width, header.height
        refuse_absurd_size(path, width, height, options)
        refuse_absurd_amount(path, 12 * width * height, size, options)
        start = _start(path, file, header, size)
        missing = max(0, height - (size - start) // header.row)
        if missing == height or (missing and not options.salvage):
            _refuse_short(path, header, size, start)
        file.seek(start)
        radiance = np.empty((height, width, 3), np.float32)
        radiance[:missing] = 0
        lost = 0
        line = np.empty(header.channels * width, np.float32)
        for row in radiance[missing:][::-1]:
            into = row.reshape(-1) if header.channels == 3 else line
            if file.readinto(into.data.cast("B")) < header.row:
                _refuse_short(path, header, file.seek(0, os.SEEK_CUR), start)
            if np.dtype(header.order + "f4") != np.float32:
                into.byteswap(inplace=True)
            if header.scale != 1:
                lost += _scale(into, header.scale)
            if header.channels == 1:
                row[:] = line[:, None]
    if lost:
        raise UnreadableFile(
            f"{path}: its scale of {header.scale:g} takes {lost} values beyond float32; set it to 1 in the header"
        )
    if header.scale != 1:
        warn(
            f"{path}: its scale is {header.scale:g}; its samples were multiplied by it, which not every program does",
            0.0,
        )
    clipped = None
    if missing:
        clipped = np.zeros((height, width), np.uint8)
        clipped[:missing] = OUTSIDE
        warn(f"{path}: ends early; the top {missing} of {height} rows are missing", missing / height)
    attributes = {"comments": header.comments} if header.comments else {}
    return RadianceMap(radiance, clipped=clipped, attributes=attributes)


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """Byte order, channels and the scale where it is not 1, as in "little-endian, colour"."""
    with open(path, "rb") as file:
        header = _header(path, file)
    words = ["little-endian" if header.order == "<" else "big-endian", "colour" if header.channels == 3 else "grey"]
    return ", ".join(words if header.scale == 1 else [*words, f"scale {header.scale:g}"])


def write(path: str | os.PathLike[str], image: RadianceMap, encoding: PFM = PFM()) -> None:
    """Write a radiance map bit for bit, NaN and infinity included; a warning says what of it is not kept.

    Raises ValueError for a map without pixels, and for grey where channels differ in any bit; OutputNotWritten.
    """
    (width, height), radiance = image.size, image.radiance
    if not width * height:
        raise ValueError(f"the map is {width} x {height} pixels; a .pfm file holds at least one")
    if encoding.grey and (coloured := sum(_coloured(row) for row in radiance)):
        raise ValueError(
            f"{coloured} of {width * height} pixels have channels that differ, which grey cannot hold; write colour"
        )
    warn_of_losses(path, image, (), unit=False)
    kind, scale = "Pf" if encoding.grey else "PF", "1.0" if encoding.big_endian else "-1.0"
    number = ">f4" if encoding.big_endian else "<f4"
    channels = 1 if encoding.grey else 3
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(f"{kind}\n{width} {height}\n{scale}\n".encode("ascii"))
        for end in range(height, 0, -_BATCH):
            batch = radiance[max(0, end - _BATCH) : end, :, :channels]
            file.write(np.ascontiguousarray(batch[::-1], number).data)


def _header(path: str | os.PathLike[str], file: BinaryIO) -> _Header:
    head = file.read(_HEADER)
    values, at = [], 2
    for name, word in _WORDS:
        gap = _GAP.match(head, at)
        at = gap.end() if gap else at
        match = word.match(head, at) if gap else None
        if match is None:
            expected = "a number" if name == "scale" else "a positive whole number"
            raise FormatError(path, "PFM", f"byte {at}", f"the {name}, {expected}", _shown(head[at : at + 24]))
        values.append(match[0])
        at = match.end()
    scale = float(values[2])
    if not 0 < abs(scale) <= float(np.finfo(np.float32).max):
        expected = "a number other than 0, whose sign is the byte order"
        raise FormatError(path, "PFM", "the scale", expected, _shown(values[2]))
    comments = b"\n".join(comment.strip() for comment in _COMMENT.findall(head[:at])).decode("utf-8", "replace")
    order, channels = "<" if scale < 0 else ">", 3 if head[1:2] == b"F" else 1
    return _Header(int(values[0]), int(values[1]), channels, order, abs(scale), comments.strip(), at)


def _start(path: str | os.PathLike[str], file: BinaryIO, header: _Header, size: int) -> int:
    """Where the pixels begin: a byte after the scale, or two of a carriage return and a line feed.

    The format has one byte; but a header in lines of DOS has two, unless the file has just the length for one.
    """
    pixels = header.row * header.height
    file.seek(0)
    head = file.read(header.end + 2)
    dos = head[2:4] == b"\r\n"
    two = head[header.end :] == b"\r\n" and (dos or size - header.end - 1 != pixels)
    start = header.end + (2 if two else 1)
    if (more := size - start - pixels) > 0:
        if dos:
            what = f"{more} more: its line ends were converted to CR LF, which ruins the pixels"
            raise FormatError(path, "PFM", f"byte {start}", f"{pixels} bytes of pixels", what, "copy it in binary mode")
        warn(f"{path}: {more} bytes after its pixels are left out; one picture is read")
    return start


def _refuse_short(path: str | os.PathLike[str], header: _Header, size: int, start: int) -> None:
    there, needed = max(0, size - start), header.row * header.height
    raise FormatError(
        path,
        "PFM",
        f"byte {size}",
        f"{needed} bytes of pixels from byte {start} on",
        f"the end of the file after {there} of them, {there // header.row} of {header.height} rows",
        OR_SALVAGE,
    )


def _scale(samples: np.ndarray, scale: float) -> int:
    """Multiply in place, rounding once; how many finite samples became infinite."""
    finite = np.count_nonzero(np.isfinite(samples))
    with np.errstate(all="ignore"):
        np.multiply(samples, scale, out=samples, dtype=np.float64, casting="same_kind")
    return int(finite - np.count_nonzero(np.isfinite(samples)))


def _coloured(row: np.ndarray) -> int:
    """How many pixels of (W, 3) have channels of different bits."""
    bits = np.ascontiguousarray(row).view(np.uint32)
    return int(np.count_nonzero(np.any(bits[:, 1:] != bits[:, :1], axis=1)))


def _shown(found: bytes) -> str:
    return repr(found.decode("latin-1")) if found else "the end of the file"
