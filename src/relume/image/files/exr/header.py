"""The header of an EXR file, judged byte by byte before anything is allocated or the library sees the file.

Every count is held against the size of the file or the limits of `ReadOptions`. Every refusal names the byte offset and
the attribute (OpenEXR 3.4, "OpenEXR File Layout").
"""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import BinaryIO

from relume.errors import FormatError, UnreadableFile
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount, refuse_absurd_size

_TILED, _NOT_PICTURES, _MANY_PARTS = 0x200, 0x800, 0x1000  # bits of the version field
_KNOWN_FLAGS = 0x1E00  # those, and 0x400 for names beyond 31 letters
_NAME = 255  # letters of a name, at most
_SAMPLES = ("uint", "half", "float")
_REQUIRED = ("channels", "compression", "dataWindow", "displayWindow", "lineOrder")
# Of the attributes that say how the file is built ("OpenEXR File Layout", "Header Attributes").
_TYPES = {
    "channels": "chlist",
    "compression": "compression",
    "dataWindow": "box2i",
    "displayWindow": "box2i",
    "lineOrder": "lineOrder",
    "pixelAspectRatio": "float",
    "screenWindowCenter": "v2f",
    "screenWindowWidth": "float",
    "tiles": "tiledesc",
    "name": "string",
    "type": "string",
    "chunkCount": "int",
}
_FLOAT_PIXEL = 12  # bytes of R, G, B as they are read


@dataclass(frozen=True)
class Compression:
    """What a file calls it, how many rows go into one chunk, and whether an even picture packs beyond any ratio.

    talkative : whether its decoder, OpenJPH, prints about damage on stdout
    """

    name: str
    rows: int
    flat: bool = False
    talkative: bool = False


# By the number in the file. The exception for flat pictures: 14,260 : 1 in DWAB, and without bound in wide PIZ or ZSTD.
COMPRESSIONS = (
    Compression("uncompressed", 1),
    Compression("RLE", 1),
    Compression("ZIPS", 1, flat=True),
    Compression("ZIP", 16, flat=True),
    Compression("PIZ", 32, flat=True),
    Compression("PXR24", 16),
    Compression("B44", 32),
    Compression("B44A", 32),
    Compression("DWAA", 32, flat=True),
    Compression("DWAB", 256, flat=True),
    Compression("HTJ2K256", 256, flat=True, talkative=True),
    Compression("HTJ2K32", 32, flat=True, talkative=True),
    Compression("LJ2K", 256, flat=True, talkative=True),
    Compression("ZSTD", 1, flat=True),
)


@dataclass(frozen=True)
class Channel:
    """One channel: its kind of numbers ("uint", "half", "float") and every how many pixels it has a sample."""

    name: str
    kind: str
    x_sampling: int
    y_sampling: int

    @property
    def bytes(self) -> int:
        """Of a sample."""
        return 2 if self.kind == "half" else 4


@dataclass(frozen=True)
class Tiling:
    """Size of a tile, and its levels: mode 0 one, 1 halved together (MIP), 2 halved apart (RIP); `up`: rounded up."""

    width: int
    height: int
    mode: int
    up: bool


@dataclass(frozen=True)
class Header:
    """What the header of one part claims.

    data, display : windows (left, top, right, bottom), the last pixel included
    texts : attributes that are strings, also those that are not UTF-8 (read as Latin-1)
    foreign : (offset, bytes) of the texts that are not UTF-8, which the library cannot read
    """

    name: str
    channels: tuple[Channel, ...]
    compression: Compression
    data: tuple[int, int, int, int]
    display: tuple[int, int, int, int]
    tiling: Tiling | None
    deep: bool
    texts: Mapping[str, str]
    foreign: tuple[tuple[int, int], ...]

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the data window."""
        return _extent(self.data)

    @property
    def padding(self) -> int:
        """How many pixels of the display window lie outside the data window."""
        (width, height), (left, top, right, bottom) = _extent(self.display), self.data
        wide = min(right, self.display[2]) - max(left, self.display[0]) + 1
        high = min(bottom, self.display[3]) - max(top, self.display[1]) + 1
        return width * height - max(wide, 0) * max(high, 0)


@dataclass(frozen=True)
class Headers:
    """The headers of all parts; `end` is the byte after them, `many` whether chunks name the part they are of."""

    parts: tuple[Header, ...]
    end: int
    many: bool


def read_headers(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> Headers:
    """The headers of an EXR file; raises FormatError where they are damaged, UnreadableFile beyond `options`."""
    try:
        with open(path, "rb") as file:
            return _Cursor(path, file, options).headers()
    except OSError as error:
        raise UnreadableFile(
            f"{path}: cannot be opened: {error.strerror}; check the path and its permissions"
        ) from None


def refuse_beyond(path: str | os.PathLike[str], headers: Headers, options: ReadOptions) -> None:
    """Raise UnreadableFile where the parts are deep, or their pixels are more than `options` allows.

    The picture is the display window: what of it has no pixels takes memory like the rest, but is no flat picture.
    """
    decoded, flat, stored = 0, True, os.path.getsize(path)
    for header in headers.parts:
        if header.deep:
            raise UnreadableFile(f"{path}: a deep EXR, several samples a pixel; flatten it first")
        for window, name in ((header.data, "its data window"), (header.display, "its display window")):
            refuse_absurd_size(path, *_extent(window), options, where=name)
        width, height = header.size
        decoded += sum(
            channel.bytes * (width // channel.x_sampling) * (height // channel.y_sampling)
            for channel in header.channels
        )
        flat = flat and header.compression.flat
    padding = _FLOAT_PIXEL * sum(header.padding for header in headers.parts)
    try:
        refuse_absurd_amount(path, padding, stored, options)
    except UnreadableFile:
        emptiest = max(headers.parts, key=lambda header: header.padding)
        (width, height), (data_width, data_height) = _extent(emptiest.display), emptiest.size
        raise UnreadableFile(
            f"{path}: its display window claims {width} x {height} pixels around a data window of {data_width} x "
            f"{data_height}, {padding} bytes of nothing for {stored} bytes of file; crop it to its data window"
        ) from None
    refuse_absurd_amount(path, decoded + padding, stored, options, flat=flat)


def _extent(window: tuple[int, int, int, int]) -> tuple[int, int]:
    """Width and height of a window whose last pixel is included."""
    left, top, right, bottom = window
    return right - left + 1, bottom - top + 1


class _Cursor:
    """A place in the bytes of a header; only as many are read as `options.metadata` allows."""

    def __init__(self, path: str | os.PathLike[str], file: BinaryIO, options: ReadOptions) -> None:
        self.path, self.options = path, options
        self.file_size = os.fstat(file.fileno()).st_size
        self.bytes = file.read(options.metadata + 1)
        self.place = 0

    def headers(self) -> Headers:
        magic, version = struct.unpack("<4sI", self.take(8, "magic number and version"))
        if magic != b"\x76\x2f\x31\x01" or version & 0xFF != 2 or version & 0xFFFFFF00 & ~_KNOWN_FLAGS:
            raise self.broken(4, "version", "2 with known flags", f"{version & 0xFF} with flags {version >> 8:#x}")
        many = bool(version & _MANY_PARTS)
        parts, starts = list[Header](), list[int]()
        while not many or self.bytes[self.place : self.place + 1] != b"\0":
            starts.append(self.place)
            parts.append(self.part(bool(version & _TILED), bool(version & _NOT_PICTURES), many, len(parts)))
            if len(parts) > self.options.parts:
                raise UnreadableFile(
                    f"{self.path}: more than {self.options.parts} parts; relume reads {self.options.parts}: split it"
                )
            if not many:
                break
        if many:
            self.take(1, "end of the headers")
        if not parts:
            raise self.broken(8, "header", "at least one part", "none")
        names = {""}
        for index, (part, start) in enumerate(zip(parts, starts, strict=True)):
            if many and part.name in names:
                raise self.broken(start, f'"name" of part {index}', "one of its own", ascii(part.name[:40]))
            names.add(part.name)
        return Headers(tuple(parts), self.place, many)

    def part(self, tiled: bool, not_pictures: bool, many: bool, index: int) -> Header:
        start, values = self.place, dict[str, tuple[str, int, bytes]]()
        while (name := self.name("name of an attribute")) != "":
            kind = self.name(f'type of the attribute "{name}"')
            place = self.place
            (size,) = struct.unpack("<i", self.take(4, f'size of the attribute "{name}"'))
            if not 0 <= size <= self.file_size - self.place:
                raise self.broken(place, f'size of "{name}"', f"at most {self.file_size - self.place}", str(size))
            if name in values:
                raise self.broken(place, f'"{name}"', "each attribute once", f"another at byte {values[name][1]}")
            if kind != _TYPES.get(name, kind):
                raise self.broken(place, f'"{name}"', f"the type {_TYPES[name]}", ascii(kind[:40]))
            values[name] = (kind, self.place, self.take(size, f'attribute "{name}"'))
        for wanted in _REQUIRED:
            if wanted not in values:
                raise self.broken(start, f"header of part {index}", f'the attribute "{wanted}"', "none")
        _, type_place, data = values.get("type", ("string", self.place, b""))
        kind = data.decode("latin-1")
        if many and kind not in ("scanlineimage", "tiledimage", "deepscanline", "deeptile"):
            raise self.broken(type_place, '"type"', "scanlineimage or tiledimage", ascii(kind[:40]))
        # The flags of a file of one part count, whatever its attribute "type" says.
        is_tiled = kind == "tiledimage" if many else tiled
        texts, foreign = dict[str, str](), list[tuple[int, int]]()
        for name, (value_kind, place, data) in values.items():
            if value_kind == "string":
                try:
                    texts[name] = data.decode("utf-8")
                except UnicodeDecodeError:
                    texts[name] = data.decode("latin-1")
                    foreign.append((place, len(data)))
        place, code = self.numbers(values, "compression", "B")
        if code[0] >= len(COMPRESSIONS):
            raise self.broken(place, '"compression"', f"a number below {len(COMPRESSIONS)}", str(code[0]))
        return Header(
            texts.get("name", ""),
            self.channels(values),
            COMPRESSIONS[code[0]],
            self.window(values, "dataWindow"),
            self.window(values, "displayWindow"),
            self.tiling(values, index) if is_tiled else None,
            kind.startswith("deep") if many else not_pictures,
            texts,
            tuple(foreign),
        )

    def channels(self, values: Mapping[str, tuple[str, int, bytes]]) -> tuple[Channel, ...]:
        _, place, data = values["channels"]
        channels, at = list[Channel](), 0
        while data[at : at + 1] != b"\0":
            end = data.find(b"\0", at)
            if not at < end <= at + _NAME or len(data) < end + 17:
                raise self.broken(place + at, '"channels"', "a name and 16 bytes for each channel", "less")
            kind, x_sampling, y_sampling = struct.unpack_from("<i4xii", data, end + 1)
            name = data[at:end].decode("utf-8", "replace")
            if not 0 <= kind < len(_SAMPLES) or x_sampling < 1 or y_sampling < 1:
                found = f"{kind} and {x_sampling} x {y_sampling}"
                raise self.broken(place + end + 1, f'channel "{name}"', "type 0, 1 or 2 and samplings above 0", found)
            channels.append(Channel(name, _SAMPLES[kind], x_sampling, y_sampling))
            at = end + 17
            if len(channels) > self.options.channels:
                limit = self.options.channels
                raise UnreadableFile(
                    f"{self.path}: more than {limit} channels in a part; relume reads {limit}: split it"
                )
        if not channels:
            raise self.broken(place, '"channels"', "at least one channel", "none")
        return tuple(channels)

    def window(self, values: Mapping[str, tuple[str, int, bytes]], name: str) -> tuple[int, int, int, int]:
        place, (left, top, right, bottom) = self.numbers(values, name, "4i")
        # Beyond half of what 32 bits hold, differences overflow in programs (OpenEXR 3.4, "sanityCheck").
        if left > right or top > bottom or max(map(abs, (left, top, right, bottom))) > 2**30:
            found = f"({left}, {top}) to ({right}, {bottom})"
            raise self.broken(place, f'"{name}"', "a window with left above top to right above bottom", found)
        return left, top, right, bottom

    def tiling(self, values: Mapping[str, tuple[str, int, bytes]], index: int) -> Tiling:
        if "tiles" not in values:
            raise self.broken(self.place, f"header of part {index}", 'the attribute "tiles" of a tiled part', "none")
        place, (width, height, mode) = self.numbers(values, "tiles", "IIB")
        side = self.options.side
        if not (0 < width <= side and 0 < height <= side) or mode & 15 > 2 or mode >> 4 > 1:
            found = f"{width} x {height}, mode {mode}"
            raise self.broken(place, '"tiles"', f"sides of 1 to {side} and a known mode", found)
        return Tiling(width, height, mode & 15, bool(mode >> 4))

    def numbers(
        self, values: Mapping[str, tuple[str, int, bytes]], name: str, layout: str
    ) -> tuple[int, tuple[int, ...]]:
        _, place, data = values[name]
        if len(data) != struct.calcsize("<" + layout):
            expected = f"{struct.calcsize('<' + layout)} bytes"
            raise self.broken(place, f'"{name}"', expected, f"{len(data)}")
        return place, struct.unpack("<" + layout, data)

    def name(self, what: str) -> str:
        end = self.bytes.find(b"\0", self.place, self.place + _NAME + 1)
        if end < 0:
            if len(self.bytes) - self.place <= _NAME and len(self.bytes) == self.file_size:
                raise self.broken(self.place, what, "a zero after it", "the end of the file")
            self.take(_NAME + 1, what)
            raise self.broken(self.place - _NAME - 1, what, f"at most {_NAME} letters and a zero", "more")
        return self.take(end + 1 - self.place, what)[:-1].decode("utf-8", "replace")

    def take(self, count: int, what: str) -> bytes:
        taken = self.bytes[self.place : self.place + count]
        if len(taken) < count and len(self.bytes) > self.options.metadata:
            limit = self.options.metadata
            raise UnreadableFile(f"{self.path}: a header beyond {limit} bytes at its {what}; relume reads {limit}")
        if len(taken) < count:
            raise self.broken(self.place, what, f"{count} bytes", f"the end of the file after {len(taken)}")
        self.place += count
        return taken

    def broken(self, place: int, what: str, expected: str, found: str) -> FormatError:
        what = what if what.isprintable() else ascii(what)  # names out of a damaged file may hold line breaks
        return FormatError(self.path, "EXR", f"byte {place}, {what}", expected, found)
