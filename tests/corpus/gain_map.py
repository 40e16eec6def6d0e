"""JPEGs with a gain map: Ultra HDR 1.1 (XMP), ISO 21496-1 (2025) and the multi-picture format (CIPA DC-007)."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from corpus.files import DESCRIBE, READ, READ_RADIANCE, SALVAGE, Bad, Corpus, Good, cut
from corpus.jpeg import BLOCKS, EOI, SOI, frame, picture_of, scan, segment, shown, tables

_SUFFIX = ".jpg"
_XMP, _ISO, _MPF = b"http://ns.adobe.com/xap/1.0/\0", b"urn:iso:std:iso:ts:21496:-1\0", b"MPF\0"
_GAINS = np.array([[[64], [255]]], np.uint8)
_DEFAULTS = {
    "Version": "1.0",
    "GainMapMin": "0",
    "GainMapMax": "3",
    "Gamma": "1",
    "OffsetSDR": "0.015625",
    "OffsetHDR": "0.015625",
    "HDRCapacityMin": "0",
    "HDRCapacityMax": "3",
    "BaseRenditionIsHDR": "False",
}
_BOUNDS = ("GainMapMin", "GainMapMax", "Gamma", "OffsetSDR", "OffsetHDR", "HDRCapacityMin", "HDRCapacityMax")


def corpus() -> Corpus:
    """The good and bad files of the format."""
    return Corpus("gain map", _good(), _bad(), (READ_RADIANCE, READ, DESCRIBE, SALVAGE))


@dataclass(frozen=True)
class Pair:
    """A base picture and its gain map.

    xmp : what the map says under hdrgm:, None for nothing
    iso : what it says under ISO 21496-1, b"" for nothing
    length, offset : of the map as the XMP directory and MPF say them; None for the truth
    """

    gain_map: bytes | None = None
    xmp: Mapping[str, str] | None = field(default_factory=lambda: dict(_DEFAULTS))
    iso: bytes = b""
    listed: bool = True
    multi_picture: bool = True
    length: int | None = None
    offset: int | None = None
    directory: bytes | None = None
    index: bytes | None = None

    def data(self) -> bytes:
        """The bytes of the file."""
        said = [segment(0xE1, _XMP + _packet(self.xmp))] if self.xmp is not None else []
        said += [segment(0xE2, _ISO + self.iso)] if self.iso else []
        second = picture_of(_GAINS, said) if self.gain_map is None else self.gain_map
        length = len(second) if self.length is None else self.length
        parts = []
        if self.listed:
            parts.append(segment(0xE1, _XMP + (_directory(length) if self.directory is None else self.directory)))
        if self.iso:
            parts.append(segment(0xE2, _ISO + bytes(4)))
        if not self.multi_picture:
            return picture_of(BLOCKS, parts) + second
        size = len(picture_of(BLOCKS, [*parts, segment(0xE2, _MPF + _index(0, 0, 0))]))
        # Places are counted from the header of the index, which stands behind "MPF\0".
        origin = len(SOI) + sum(map(len, parts)) + 8
        offset = size - origin if self.offset is None else self.offset
        index = _index(size, length, offset) if self.index is None else self.index
        return picture_of(BLOCKS, [*parts, segment(0xE2, _MPF + index)]) + second


def _packet(values: Mapping[str, str]) -> bytes:
    said = " ".join(f'hdrgm:{name}="{value}"' for name, value in values.items())
    return (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="" xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" {said}/>'
        "</rdf:RDF></x:xmpmeta>"
    ).encode()


def _directory(length: int | str, second: str = "GainMap") -> bytes:
    items = (
        '<rdf:li rdf:parseType="Resource"><Container:Item Item:Semantic="Primary" Item:Mime="image/jpeg"/></rdf:li>'
        f'<rdf:li rdf:parseType="Resource"><Container:Item Item:Semantic="{second}" Item:Mime="image/jpeg"'
        f' Item:Length="{length}"/></rdf:li>'
    )
    return (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        '<rdf:Description rdf:about="" xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0"'
        ' xmlns:Container="http://ns.google.com/photos/1.0/container/"'
        ' xmlns:Item="http://ns.google.com/photos/1.0/container/item/"><Container:Directory><rdf:Seq>'
        f"{items}</rdf:Seq></Container:Directory></rdf:Description></rdf:RDF></x:xmpmeta>"
    ).encode()


def _index(size: int, length: int, offset: int, *, pictures: int = 2, entries_at: int = 50, order: str = "<") -> bytes:
    def entry(tag: int, kind: int, count: int, value: bytes) -> bytes:
        return struct.pack(order + "HHI", tag, kind, count) + value

    head = {"<": b"II", ">": b"MM"}[order] + struct.pack(order + "HI", 42, 8) + struct.pack(order + "H", 3)
    head += entry(0xB000, 7, 4, b"0100")
    head += entry(0xB001, 4, 1, struct.pack(order + "I", pictures & 0xFFFFFFFF))
    head += entry(0xB002, 7, 32, struct.pack(order + "I", entries_at)) + bytes(4)
    listed = struct.pack(order + "IIIHH", 0x030000, size & 0xFFFFFFFF, 0, 0, 0)
    return head + listed + struct.pack(order + "IIIHH", 0, length & 0xFFFFFFFF, offset & 0xFFFFFFFF, 0, 0)


def _iso(*numbers: tuple[int, int], minimum: int = 0, writer: int = 0, flags: int = 0x40, channels: int = 1) -> bytes:
    """Headrooms of base and alternate; then for each channel minimum, maximum, gamma and two offsets, as fractions."""
    values = numbers or ((0, 1), (3, 1), *[(0, 1), (3, 1), (1, 1), (1, 64), (1, 64)] * channels)
    packed = b"".join(struct.pack(">iI", n if n < 2**31 else n - 2**32, d) for n, d in values)
    return struct.pack(">HHB", minimum, writer, flags) + packed


def _expected() -> np.ndarray:
    """The light of the pair: (base + offset)·2^gain − offset, the gain in stops from 0 to 3."""
    encoded = shown(BLOCKS) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    stops = shown(_GAINS)[..., :1] / 255 * 3
    return (linear + 1 / 64) * np.exp2(stops) - 1 / 64


def _good() -> list[Good]:
    light = _expected()
    files = {
        "XMP": Pair(),
        "ISO 21496-1": Pair(xmp=None, iso=_iso(), listed=False),
        "both": Pair(iso=_iso()),
        "XMP without MPF": Pair(multi_picture=False),
        "three channels": Pair(xmp=None, listed=False, iso=_iso(flags=0xC0, channels=3)),
    }
    # One step of the base is up to 2 % of its light.
    return [Good(name, pair.data(), _SUFFIX, light, 0.02) for name, pair in files.items()]


def _bad() -> list[Bad]:
    good, modern = Pair(), Pair(xmp=None, iso=_iso(), listed=False)
    bad: list[tuple[str, Pair]] = []
    lenient: list[tuple[str, Pair]] = []
    for name in _BOUNDS:
        for value in ("nan", "inf", "-1e999", "abc", "", "1e30", "1,2"):
            (bad if value != "1e30" else lenient).append((f"{name} {value!r}", _reported(good, name, value)))
    for name, files_of in (("GainMapMax", bad), ("HDRCapacityMax", lenient)):  # the two that have no default
        files_of.append((f"no {name}", replace(good, xmp={k: v for k, v in _DEFAULTS.items() if k != name})))
    bad += [
        ("gains from 3 to 1", _reported(good, "GainMapMin", "4")),
        ("a gamma of 0", _reported(good, "Gamma", "0")),
        ("a negative gamma", _reported(good, "Gamma", "-1")),
        ("a version of 99", _reported(good, "Version", "99.0")),
        ("a map that is cut short", replace(good, gain_map=picture_of(_GAINS, [_reported_segment()])[:-20])),
        ("a map of noise", replace(good, gain_map=SOI + b"\x55" * 300)),
        ("a map that is no JPEG", replace(good, gain_map=b"\x89PNG\r\n\x1a\n" + bytes(300))),
        ("no map at all", replace(good, gain_map=b"", length=400)),
        ("a map that claims 65500 × 65500", replace(good, gain_map=_vast())),
        ("an ISO version that must be known", replace(modern, iso=_iso(minimum=9))),
        ("ISO numbers cut short", replace(modern, iso=_iso()[:-3])),
        (
            "an ISO denominator of 0",
            replace(modern, iso=_iso((0, 1), (3, 1), (0, 0), (3, 1), (1, 1), (1, 64), (1, 64))),
        ),
        ("an ISO gamma of 0", replace(modern, iso=_iso((0, 1), (3, 1), (0, 1), (3, 1), (0, 1), (1, 64), (1, 64)))),
        ("ISO gains from 4 to 3", replace(modern, iso=_iso((0, 1), (3, 1), (4, 1), (3, 1), (1, 1), (1, 64), (1, 64)))),
        ("ISO with one channel of three", replace(modern, iso=_iso(flags=0xC0))),
        ("ISO with a version alone", replace(modern, iso=bytes(5))),
    ]
    # Where places and lengths are wrong, the second picture may still be found by its first bytes.
    for offset in (1, 3, 2**31 - 1, 2**31, 2**32 - 1):
        lenient.append((f"the map at {offset}", replace(good, offset=offset)))
        lenient.append((f"ISO, the map at {offset}", replace(modern, offset=offset)))
    for length in (0, 10, 2**20, 2**31 - 1, 2**32 - 1):
        lenient.append((f"a length of {length}", replace(good, length=length)))
    for pictures in (1, 3, 2**16, 2**32 - 1):
        lenient.append(
            (f"an index of {pictures} pictures", replace(good, index=_index(900, 400, 800, pictures=pictures)))
        )
    lenient += [
        ("the map at 0", replace(good, offset=0)),
        ("an index beyond its segment", replace(good, index=_index(900, 400, 800, entries_at=2**31))),
        ("an index cut short", replace(good, index=_index(900, 400, 800)[:30])),
        ("an index of noise", replace(good, index=b"\x55" * 90)),
        ("an index of an order that is none", replace(good, index=b"XX" + _index(900, 400, 800)[2:])),
        ("a directory of noise", replace(good, directory=b"<\x00\xff&" * 40)),
        ("a directory that does not end", replace(good, directory=_directory(300)[:-60])),
        ("a directory nested 5000 deep", replace(good, directory=b"<a>" * 5000)),
        ("a directory with entities", replace(good, directory=b'<!DOCTYPE x [<!ENTITY a "hdrgm:">]>' + _directory(3))),
        ("a directory of another kind", replace(good, directory=_directory(300, "Depth"))),
        ("a length of letters", replace(good, directory=_directory("many"))),
        ("a length of 5000 digits", replace(good, directory=_directory("9" * 5000))),
        ("a negative length", replace(good, directory=_directory(-5))),
        ("offsets of −1", _reported(good, "OffsetSDR", "-1")),
        ("a base that is the brighter one", _reported(good, "BaseRenditionIsHDR", "True")),
        ("a base that is neither", _reported(good, "BaseRenditionIsHDR", "Perhaps")),
        ("a capacity that falls", _reported(good, "HDRCapacityMin", "9")),
        ("no version", replace(good, xmp={k: v for k, v in _DEFAULTS.items() if k != "Version"})),
        ("a map that says nothing", replace(good, xmp=None)),
        ("a map of another shape", replace(good, gain_map=picture_of(np.full((3, 1, 1), 99), [_reported_segment()]))),
        ("a map that is a pair itself", replace(good, gain_map=good.data())),
        ("ISO headrooms of 0", replace(modern, iso=_iso((0, 1), (0, 1), (0, 1), (3, 1), (1, 1), (1, 64), (1, 64)))),
        ("ISO flags of all kinds", replace(modern, iso=_iso(flags=0xFF))),
        ("ISO with bytes behind", replace(modern, iso=_iso() + bytes(99))),
        (
            "ISO of enormous gains",
            replace(modern, iso=_iso((0, 1), (3, 1), (0, 1), (2**31 - 1, 1), (1, 1), (1, 64), (1, 64))),
        ),
    ]
    files = [Bad(name, pair.data(), _SUFFIX) for name, pair in bad]
    files += [Bad(name, pair.data(), _SUFFIX, refused=False) for name, pair in lenient]
    whole = good.data()
    files += [Bad("a map of which the end is missing", whole[: -len(EOI) - 9], _SUFFIX)]
    return files + cut("XMP", whole, _SUFFIX, (700, -100, -500))


def _reported(pair: Pair, name: str, value: str) -> Pair:
    return replace(pair, xmp={**(pair.xmp or {}), name: value})


def _reported_segment() -> bytes:
    return segment(0xE1, _XMP + _packet(_DEFAULTS))


def _vast() -> bytes:
    return SOI + _reported_segment() + tables() + frame(65_500, 65_500, 1) + scan(_GAINS) + EOI


def bomb() -> bytes:
    """A base of 16 × 8 pixels with a gain map that claims 65,500 × 65,500."""
    return Pair(gain_map=_vast()).data()
