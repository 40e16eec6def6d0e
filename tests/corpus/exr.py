"""OpenEXR: scan lines, tiles and parts, built attribute by attribute from "OpenEXR File Layout"."""

from __future__ import annotations

import struct
import tempfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from corpus.files import DESCRIBE, READ, READ_LAYERS, SALVAGE, Bad, Corpus, Good, cut, integer, picture

_SUFFIX = ".exr"
_MAGIC = b"\x76\x2f\x31\x01"
_TILED, _LONG_NAMES, _DEEP, _PARTS = 0x200, 0x400, 0x800, 0x1000  # bits of the version field
_NONE, _RLE, _ZIPS, _ZIP, _PIZ, _PXR24, _B44, _B44A, _DWAA, _DWAB, _HTJ2K256, _HTJ2K32 = range(12)
_LINES = {_NONE: 1, _RLE: 1, _ZIPS: 1, _ZIP: 16}
_HALF, _FLOAT = 1, 2
_REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)

Attribute = tuple[str, bytes]


def corpus() -> Corpus:
    """The good and bad files of the format."""
    return Corpus("EXR", _good(), _bad(), (READ, DESCRIBE, READ_LAYERS, SALVAGE))


@dataclass(frozen=True)
class Exr:
    """One file of one part.

    attributes : name → type and bytes
    chunks : what stands behind the table of their places
    places : what the table says, in place of where they are
    """

    attributes: Mapping[str, Attribute]
    chunks: Sequence[bytes]
    version: int = 2
    places: Sequence[int] | None = None
    magic: bytes = _MAGIC
    sizes: Mapping[str, int] = field(default_factory=dict)

    def but(self, **changes: Attribute | None) -> Exr:
        """The same with other attributes; None takes one away."""
        attributes = {**self.attributes, **changes}
        return replace(self, attributes={name: value for name, value in attributes.items() if value is not None})

    def header(self) -> bytes:
        """The attributes and the NUL that ends them."""
        written = b""
        for name, (kind, value) in self.attributes.items():
            size = self.sizes.get(name, len(value))
            written += name.encode() + b"\0" + kind.encode() + b"\0" + integer(size, "I") + value
        return written + b"\0"

    def data(self) -> bytes:
        """The bytes of the file."""
        head = self.magic + struct.pack("<I", self.version) + self.header()
        return head + _with_table(len(head), self.chunks, self.places)


def _with_table(start: int, chunks: Sequence[bytes], places: Sequence[int] | None = None) -> bytes:
    if places is None:
        at, said = start + 8 * len(chunks), []
        for chunk in chunks:
            said.append(at)
            at += len(chunk)
        places = said
    return b"".join(integer(place, "Q") for place in places) + b"".join(chunks)


def _channels(names: str, kind: int = _HALF, sampling: tuple[int, int] = (1, 1)) -> Attribute:
    listed = b"".join(name.encode() + b"\0" + struct.pack("<IIII", kind, 0, *sampling) for name in names)
    return "chlist", listed + b"\0"


def _window(left: int, top: int, right: int, bottom: int) -> Attribute:
    return "box2i", b"".join(integer(value, "I") for value in (left, top, right, bottom))


def _attributes(height: int, width: int, channels: Attribute, compression: int = _NONE) -> dict[str, Attribute]:
    return {
        "channels": channels,
        "compression": ("compression", bytes([compression])),
        "dataWindow": _window(0, 0, width - 1, height - 1),
        "displayWindow": _window(0, 0, width - 1, height - 1),
        "lineOrder": ("lineOrder", b"\0"),
        "pixelAspectRatio": ("float", struct.pack("<f", 1.0)),
        "screenWindowCenter": ("v2f", bytes(8)),
        "screenWindowWidth": ("float", struct.pack("<f", 1.0)),
    }


def _packed(stored: bytes, compression: int) -> bytes:
    """As ZIP does: every second byte first, then differences, then deflated."""
    if compression == _NONE:
        return stored
    octets = np.frombuffer(stored, np.uint8)
    split = np.concatenate([octets[::2], octets[1::2]]).astype(int)
    differences = np.concatenate([split[:1], np.diff(split) + 128]) & 255
    packed = zlib.compress(differences.astype(np.uint8).tobytes())
    return packed if len(packed) < len(stored) else stored


def _rows(pixels: np.ndarray, kind: int, compression: int = _NONE, part: bytes = b"") -> list[bytes]:
    """The chunks of scan lines; channels in the order of their letters: B, G, R."""
    number = {_HALF: "<f2", _FLOAT: "<f4"}[kind]
    planes = np.ascontiguousarray(pixels[..., ::-1].transpose(0, 2, 1), number)
    chunks, step = [], _LINES[compression]
    for y in range(0, len(planes), step):
        stored = _packed(planes[y : y + step].tobytes(), compression)
        chunks.append(part + struct.pack("<iI", y, len(stored)) + stored)
    return chunks


def scan_lines(pixels: np.ndarray, kind: int = _HALF, compression: int = _NONE) -> Exr:
    """A file of scan lines."""
    height, width, count = pixels.shape
    names = "BGR" if count == 3 else "Y"
    return Exr(_attributes(height, width, _channels(names, kind), compression), _rows(pixels, kind, compression))


def _tiles(pixels: np.ndarray, side: int = 8) -> Exr:
    height, width, _ = pixels.shape
    chunks = []
    for y in range(0, height, side):
        for x in range(0, width, side):
            tile = np.ascontiguousarray(pixels[y : y + side, x : x + side, ::-1].transpose(0, 2, 1), "<f2").tobytes()
            chunks.append(struct.pack("<iiiiI", x // side, y // side, 0, 0, len(tile)) + tile)
    attributes = _attributes(height, width, _channels("BGR")) | {
        "tiles": ("tiledesc", struct.pack("<IIB", side, side, 0))
    }
    return Exr(attributes, chunks, 2 | _TILED)


def _parts(pictures: Sequence[np.ndarray], change: Mapping[str, Attribute] = {}, part_number: int = 0) -> bytes:
    """Parts of scan lines; `change` is made to the attributes of the second one."""
    headers, groups = b"", []
    for number, pixels in enumerate(pictures):
        height, width, _ = pixels.shape
        attributes = _attributes(height, width, _channels("BGR"))
        attributes |= {
            "chunkCount": ("int", struct.pack("<i", height)),
            "name": ("string", f"part{number}".encode()),
            "type": ("string", b"scanlineimage"),
        }
        headers += Exr({**attributes, **(change if number == 1 else {})}, []).header()
        groups.append(_rows(pixels, _HALF, part=struct.pack("<i", number + part_number)))
    head = _MAGIC + struct.pack("<I", 2 | _PARTS) + headers + b"\0"
    at, table = len(head) + 8 * sum(map(len, groups)), b""
    for group in groups:
        for chunk in group:
            table += struct.pack("<Q", at)
            at += len(chunk)
    return head + table + b"".join(chunk for group in groups for chunk in group)


def _by_openexr(pixels: np.ndarray, compression: int, number: type[np.floating] = np.float16) -> bytes:
    """A file that OpenEXR's own writer makes, for the compressions that are too long to be written here."""
    import OpenEXR

    header = {"compression": OpenEXR.Compression(compression), "type": OpenEXR.scanlineimage}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels, number)}).write(str(path))
        return path.read_bytes()


def _compressed() -> list[Good]:
    """A smooth picture in every compression; 40 rows, so that each has more than one chunk but DWAB (256)."""
    y, x, channel = np.indices((40, 24, 3))
    smooth = (1 + x / 8 + y / 16 + channel / 2).astype(np.float16).astype(np.float32)
    # B44 keeps 14 halves of each 4 × 4 in six bits each; DWA is asked for errors of 45, which no eye sees.
    tolerances = {_RLE: 0.0, _PIZ: 0.0, _PXR24: 0.0, _B44: 0.03, _B44A: 0.03, _DWAA: 0.03, _DWAB: 0.03}
    tolerances |= {_HTJ2K256: 0.0, _HTJ2K32: 0.0}
    return [
        Good(f"compression {code}", _by_openexr(smooth, code), _SUFFIX, smooth, tolerance)
        for code, tolerance in tolerances.items()
    ] + [Good("PIZ of floats", _by_openexr(smooth, _PIZ, np.float32), _SUFFIX, smooth)]


def _good() -> list[Good]:
    pixels = picture(8)
    primaries = ("chromaticities", struct.pack("<8f", *_REC709))
    shifted = scan_lines(pixels).but(dataWindow=_window(-3, 5, 12, 12), displayWindow=_window(-3, 5, 12, 12))
    shifted = replace(shifted, chunks=[struct.pack("<i", 5 + y) + chunk[4:] for y, chunk in enumerate(shifted.chunks)])
    grey = pixels[..., :1]
    return [
        Good("half", scan_lines(pixels).data(), _SUFFIX, pixels),
        Good("float", scan_lines(pixels, _FLOAT).data(), _SUFFIX, pixels),
        Good("ZIPS", scan_lines(pixels, _HALF, _ZIPS).data(), _SUFFIX, pixels),
        Good("ZIP", scan_lines(pixels, _FLOAT, _ZIP).data(), _SUFFIX, pixels),
        Good("grey", scan_lines(grey).data(), _SUFFIX, np.repeat(grey, 3, 2)),
        Good("tiles", _tiles(pixels).data(), _SUFFIX, pixels),
        Good("tiles that do not fill it", _tiles(picture(9, 11, 19)).data(), _SUFFIX, picture(9, 11, 19)),
        Good("two parts", _parts([pixels, pixels + 1]), _SUFFIX, pixels),
        Good("primaries", scan_lines(pixels).but(chromaticities=primaries).data(), _SUFFIX, pixels),
        Good("a data window that does not begin at 0", shifted.data(), _SUFFIX, pixels),
        *_compressed(),
    ]


def _bad() -> list[Bad]:
    pixels = picture(8)
    good, zipped, tiled = scan_lines(pixels), scan_lines(pixels, _FLOAT, _ZIP), _tiles(pixels)
    bad: list[tuple[str, bytes]] = []
    lenient: list[tuple[str, bytes]] = []
    for name in good.attributes:
        missing = good.but(**{name: None}).data()
        (bad if name in ("channels", "compression", "dataWindow") else lenient).append((f"no {name}", missing))
        value = good.attributes[name][1]
        metadata = name in ("pixelAspectRatio", "screenWindowWidth", "screenWindowCenter")
        for size in sorted({0, len(value) - 1, 2**31 - 1, 2**32 - 1}):
            (lenient if metadata and 0 < size < 9 else bad).append(
                (f"{name} of {size} bytes", replace(good, sizes={name: size}).data())
            )
        lenient.append((f"{name} of another type", good.but(**{name: ("string", value)}).data()))
    largest = 2**31 - 1
    for left, top, right, bottom in (
        (0, 0, -1, 7),
        (0, 0, 15, -1),
        (0, 0, largest, 7),
        (0, 0, 15, largest),
        (-largest - 1, 0, largest, 7),
        (-largest - 1, -largest - 1, largest, largest),
        (0, 0, 2**16, 7),
        (0, 0, 2**16 - 1, 2**16 - 1),
        (10, 0, 5, 7),
        (0, 0, 15, 8),
        (0, 0, 16, 7),
    ):
        window = _window(left, top, right, bottom)
        bad.append((f"a data window of {left} {top} {right} {bottom}", good.but(dataWindow=window).data()))
        lenient.append((f"a display window of {left} {top} {right} {bottom}", good.but(displayWindow=window).data()))
    for code in (_HTJ2K256, _HTJ2K32, 99, 255):
        bad.append((f"compression {code}", good.but(compression=("compression", bytes([code]))).data()))
    for code in (_NONE, _RLE, _ZIPS, _PIZ, _PXR24, _B44, _B44A, _DWAA, _DWAB):
        wrong = zipped.but(compression=("compression", bytes([code])))
        (lenient if code in (_ZIPS, _PXR24) else bad).append(
            (f"ZIP that claims to be compression {code}", wrong.data())
        )
    for version in (0, 1, 3, 255, 2 | _TILED, 2 | _PARTS, 2 | _DEEP, 2 | 1 << 31):
        (lenient if version == 1 else bad).append(
            (f"version field {version:#x}", replace(good, version=version).data())
        )
    channel_lists = {
        "an empty list of channels": b"\0",
        "channels that do not end": b"R\0" + bytes(8),
        "a channel of a type that is none": b"R\0" + struct.pack("<IIII", 9, 0, 1, 1) + b"\0",
        "a channel of every 0th pixel": b"R\0" + struct.pack("<IIII", 1, 0, 0, 0) + b"\0",
        "a channel of every −1st pixel": b"R\0" + struct.pack("<IIII", 1, 0, 2**32 - 1, 1) + b"\0",
        "a channel of every 2^31st pixel": b"R\0" + struct.pack("<IIII", 1, 0, 2**31 - 1, 2**31 - 1) + b"\0",
        "a thousand channels": b"".join(b"c%d\0" % n + struct.pack("<IIII", 2, 0, 1, 1) for n in range(1000)) + b"\0",
        "the same channel twice": _channels("RR")[1],
        "channels out of order": _channels("RGB")[1],
        "a channel without a name": b"\0" + struct.pack("<IIII", 1, 0, 1, 1) + b"\0",
        "a channel name of a kilobyte": b"R" * 1024 + b"\0" + struct.pack("<IIII", 1, 0, 1, 1) + b"\0",
        "a channel name that is no text": b"\xff\xfe\0" + struct.pack("<IIII", 1, 0, 1, 1) + b"\0",
        "only alpha": _channels("A")[1],
        "colour differences alone": b"BY\0" + struct.pack("<IIII", 1, 0, 2, 2) + b"\0",
        "integers": _channels("BGR", 0)[1],
        "floats where halves are": _channels("BGR", _FLOAT)[1],
    }
    mild = ("channels out of order", "a channel without a name", "only alpha", "a channel name that is no text")
    for name, listed in channel_lists.items():
        (lenient if name in mild else bad).append((name, good.but(channels=("chlist", listed)).data()))
    for place in (0, 1, 8, 2**31, 2**63 - 1, 2**64 - 1):
        lenient.append((f"every chunk at byte {place}", replace(good, places=[place] * 8).data()))
    shuffled = list(good.chunks)
    for number in (-1, 8, largest):
        lenient.append((f"a scan line {number}", replace(good, chunks=[_line(good, number), *good.chunks[1:]]).data()))
    for size in (0, 1, 95, 97, largest, 2**32 - 1):
        chunk = good.chunks[3][:4] + integer(size, "I") + good.chunks[3][8:]
        bad.append((f"a chunk of {size} bytes", replace(good, chunks=[*shuffled[:3], chunk, *shuffled[4:]]).data()))
    bad += [
        ("a chunk of ZIP that is noise", replace(zipped, chunks=[zipped.chunks[0][:8] + b"\x55" * 600]).data()),
        (
            "a chunk of ZIP cut short",
            replace(zipped, chunks=[struct.pack("<iI", 0, 40) + zipped.chunks[0][8:48]]).data(),
        ),
        ("a chunk of ZIP that is a bomb", replace(zipped, chunks=[_bomb()]).data()),
        ("a header that does not end", _MAGIC + struct.pack("<I", 2) + good.header()[:-1]),
        ("a magic number alone", _MAGIC),
        ("a version and no header", _MAGIC + struct.pack("<I", 2)),
        ("no attributes", _MAGIC + struct.pack("<I", 2) + b"\0"),
        ("an attribute name without end", _MAGIC + struct.pack("<I", 2) + b"x" * 5000),
        ("ten thousand attributes and no end", _MAGIC + struct.pack("<I", 2) + b"a\0int\0\4\0\0\0\0\0\0\0" * 10_000),
        ("a tile of 0 pixels", tiled.but(tiles=("tiledesc", struct.pack("<IIB", 0, 0, 0))).data()),
        ("a tile of 2^31 pixels", tiled.but(tiles=("tiledesc", struct.pack("<IIB", 2**31, 2**31, 0))).data()),
        ("a tile of 2^32 − 1 pixels", tiled.but(tiles=("tiledesc", b"\xff" * 8 + b"\0")).data()),
        ("tiles without their size", tiled.but(tiles=None).data()),
        ("tiles of levels that are none", tiled.but(tiles=("tiledesc", struct.pack("<IIB", 8, 8, 0x33))).data()),
        ("a tile outside", replace(tiled, chunks=[struct.pack("<i", 7) + tiled.chunks[0][4:], tiled.chunks[1]]).data()),
        ("a tile of a level that is none", replace(tiled, chunks=[_level(tiled.chunks[0]), tiled.chunks[1]]).data()),
        ("parts of one name", _parts([pixels, pixels], {"name": ("string", b"part0")})),
        ("a part of a type that is none", _parts([pixels, pixels], {"type": ("string", b"hologram")})),
        ("chunks of parts that are none", _parts([pixels, pixels], part_number=7)),
        ("1,025 parts", _parts([pixels[:1, :1]] * 1025)),
    ]
    lenient += [
        ("a pixel aspect of 0", good.but(pixelAspectRatio=("float", bytes(4))).data()),
        ("a pixel aspect that is no number", good.but(pixelAspectRatio=("float", b"\0\0\xc0\x7f")).data()),
        ("a line order that is none", good.but(lineOrder=("lineOrder", b"\x09")).data()),
        ("primaries that are no numbers", good.but(chromaticities=("chromaticities", b"\xff" * 32)).data()),
        ("primaries in one place", good.but(chromaticities=("chromaticities", struct.pack("<8f", *[0.3] * 8))).data()),
        ("primaries of four bytes", good.but(chromaticities=("chromaticities", bytes(4))).data()),
        ("white of 0 candelas", good.but(whiteLuminance=("float", bytes(4))).data()),
        ("white that is no number", good.but(whiteLuminance=("float", b"\0\0\xc0\x7f")).data()),
        ("white as text", good.but(whiteLuminance=("string", b"bright")).data()),
        ("an owner that is no text", good.but(owner=("string", b"\xff\xfe\n\x1b[2J")).data()),
        ("a preview of 2^31 pixels", good.but(preview=("preview", struct.pack("<II", 2**31, 2**31))).data()),
        ("texts without end", good.but(multiView=("stringvector", b"\xff\xff\xff\x7f")).data()),
        ("an attribute of an unknown type", good.but(mystery=("widget", bytes(9))).data()),
        ("an attribute of four megabytes", good.but(mystery=("widget", bytes(2**22))).data()),
        ("bytes behind", good.data() + bytes(500)),
        ("tiles of 64 × 64 of a small picture", tiled.but(tiles=("tiledesc", struct.pack("<IIB", 64, 64, 0))).data()),
        ("half of infinity and NaN", scan_lines(np.full((8, 16, 3), np.nan, np.float32)).data()),
        ("a part of −1 chunks", _parts([pixels, pixels], {"chunkCount": ("int", b"\xff" * 4)})),
        ("a part of 2^31 − 1 chunks", _parts([pixels, pixels], {"chunkCount": ("int", b"\xff\xff\xff\x7f")})),
        ("a second part of another size", _parts([pixels, pixels], {"displayWindow": _window(0, 0, 99, 99)})),
    ]
    files = [Bad(name, data, _SUFFIX) for name, data in bad]
    files += [Bad(name, data, _SUFFIX, refused=False) for name, data in lenient]
    files += cut("scan lines", good.data(), _SUFFIX, (60, -1, -97, len(good.data()) // 2))
    files += cut("ZIP", zipped.data(), _SUFFIX, (-1, -200))
    files += cut("tiles", tiled.data(), _SUFFIX, (-1, -400))
    return files + cut("two parts", _parts([pixels, pixels]), _SUFFIX, (-1, -700, 300))


def _line(file: Exr, number: int) -> bytes:
    return integer(number, "I") + file.chunks[0][4:]


def _level(chunk: bytes) -> bytes:
    return chunk[:8] + struct.pack("<ii", 3, 3) + chunk[16:]


def _bomb() -> bytes:
    stored = zlib.compress(bytes(2**24), 9)
    return struct.pack("<iI", 0, len(stored)) + stored


def bomb() -> bytes:
    """An EXR of 464 bytes that claims 40,000 × 40,000 halves and has nothing of them."""
    file = Exr(_attributes(40_000, 40_000, _channels("BGR"), _ZIP), [])
    return file.data().ljust(464, b"\0")


def framed_bomb() -> bytes:
    """An EXR of 16 × 8 pixels that are all there, in a display window of 8192 × 8192: 768 MiB of nothing as floats."""
    return scan_lines(picture(8)).but(displayWindow=_window(0, 0, 2**13 - 1, 2**13 - 1)).data()
