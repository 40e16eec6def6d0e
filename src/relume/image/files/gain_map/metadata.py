"""What a gain map's pixels stand for: the parameters, in the binary form of ISO 21496-1 and in XMP.

A map's code m in [0, 1] is a gain of g = low + (high − low) · m^(1/gamma) stops, and the bright picture
(base + base offset) · 2^g − bright offset (ISO 21496-1, clause 6; Ultra HDR 1.1, "Gain map generation"). Its XMP has
them as hdrgm parameters, and a directory of the pictures in the file (Ultra HDR 1.1, "XMP attributes", "GContainer");
`metadata.xmp` holds what is true of all packets.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, fields
from xml.parsers import expat

from relume.image.files.signatures import one_line

_SINGLE = 1 / 64  # the offset of Ultra HDR 1.1 where a file has none
_MOST = 64.0  # stops; a gain beyond is no picture's
_THREE, _IN_BASE, _BACKWARD, _COMMON = 0x80, 0x40, 0x04, 0x08  # the two last: libultrahdr 1.2
_GRID = 2**20  # a gain's denominator: 2¹¹ stops fit before the point

HDRGM = "http://ns.adobe.com/hdr-gain-map/1.0/"
CONTAINER = "http://ns.google.com/photos/1.0/container/"
ITEM = "http://ns.google.com/photos/1.0/container/item/"
SCALE, UNIT = "gain_map_scale", "unit"  # our own: what radiance was multiplied by, and its unit
LARGEST_SCALE = 2.0**100  # and the inverse of the smallest; beyond, float32 runs out of digits or of range
Properties = Mapping[str, tuple[str, ...]]
_FIELDS = {
    "low": ("GainMapMin", 0.0),
    "high": ("GainMapMax", None),
    "gamma": ("Gamma", 1.0),
    "base_offset": ("OffsetSDR", 1 / 64),
    "bright_offset": ("OffsetHDR", 1 / 64),
}

Three = tuple[float, float, float]


@dataclass(frozen=True)
class GainMapMetadata:
    """The parameters of a gain map; threes are for R, G, B.

    low, high : stops of gain that the map's codes 0 and 1 stand for
    gamma : exponent of the codes
    base_offset, bright_offset : added before and taken away after the gain, in units of the base's white
    base_headroom, bright_headroom : log₂ of a display's white over the base's for which each picture is made
    in_base_primaries : whether gains are for the base's primaries; else for those of the map's own profile
    """

    low: Three = (0.0, 0.0, 0.0)
    high: Three = (0.0, 0.0, 0.0)
    gamma: Three = (1.0, 1.0, 1.0)
    base_offset: Three = (_SINGLE, _SINGLE, _SINGLE)
    bright_offset: Three = (_SINGLE, _SINGLE, _SINGLE)
    base_headroom: float = 0.0
    bright_headroom: float = 0.0
    in_base_primaries: bool = True

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            numbers = value if isinstance(value, tuple) else (value,)
            if not all(math.isfinite(number) and abs(number) <= _MOST for number in numbers):
                raise ValueError(f"{field.name} is {value}; expected numbers within ±{_MOST:g}")
        if min(self.gamma) <= 0:
            raise ValueError(f"gamma is {self.gamma}; expected numbers above 0")
        if any(high < low for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError(f"low is {self.low} and high {self.high}; expected no low above its high")

    @property
    def base_is_bright(self) -> bool:
        """Whether the base is the picture for the brighter display, and the gains lead down from it."""
        return self.base_headroom > self.bright_headroom


def from_iso(block: bytes) -> GainMapMetadata:
    """The parameters in the binary block behind ISO 21496-1's name (annex C.2.2).

    Raises ValueError for a block cut short, a newer version, a denominator of 0, senseless values.
    """
    try:
        minimum, _, flags = struct.unpack_from(">HHB", block)
        if minimum != 0:
            raise ValueError(f"it is for readers of version {minimum}; expected 0")
        channels = 3 if flags & _THREE else 1
        # Two headrooms, then low, high, gamma and the two offsets of each channel; gains and offsets are signed.
        signs = "II" + "iiIii" * channels
        if flags & _COMMON:
            denominator, *numerators = struct.unpack_from(">I" + signs, block, 5)
            denominators = [denominator] * len(numerators)
        else:
            numbers = struct.unpack_from(">" + "".join(sign + "I" for sign in signs), block, 5)
            numerators, denominators = numbers[::2], numbers[1::2]
    except struct.error:
        raise ValueError(f"it ends after {len(block)} bytes; expected 61 of one channel or 141 of three") from None
    if 0 in denominators:
        raise ValueError("a denominator is 0; expected 1 or more")
    base, bright, *rest = (n / d for n, d in zip(numerators, denominators, strict=True))
    if flags & _BACKWARD:
        base, bright = max(base, bright), min(base, bright)
    low, high, gamma, base_offset, bright_offset = (_three(rest[kind::5]) for kind in range(5))
    return GainMapMetadata(low, high, gamma, base_offset, bright_offset, base, bright, bool(flags & _IN_BASE))


def to_iso(metadata: GainMapMetadata) -> bytes:
    """The binary block of three channels, 141 bytes; values are rounded as by `rounded`."""
    block = struct.pack(">HHB", 0, 0, _THREE | (_IN_BASE if metadata.in_base_primaries else 0))
    numbers = [metadata.base_headroom, metadata.bright_headroom]
    for channel in range(3):
        for field in ("low", "high", "gamma", "base_offset", "bright_offset"):
            numbers.append(getattr(metadata, field)[channel])
    return block + b"".join(struct.pack(">iI", *_fraction(number)) for number in numbers)


VERSION = bytes(4)
"""What the primary picture has in place of the block: both versions, 0."""


def rounded(value: float) -> float:
    """`value` as both forms hold it: to 2⁻²⁰, but for numbers below 1, to 30 bits behind the point."""
    numerator, denominator = _fraction(value)
    return numerator / denominator


def _fraction(value: float) -> tuple[int, int]:
    denominator = _GRID if abs(value) >= 1 else 2**30
    return round(value * denominator), denominator


def _three(values: list[float]) -> Three:
    return (values[0], values[0], values[0]) if len(values) == 1 else (values[0], values[1], values[2])


def metadata_in(properties: Properties) -> GainMapMetadata:
    """The hdrgm parameters of a packet; what is left out has the value that the specification gives.

    properties : as `xmp.properties` gives them
    Raises ValueError for another version, what is no number, a missing GainMapMax, and values that make no sense.
    """
    version = properties.get(f"{HDRGM}Version", ("1.0",))[0].strip()
    if version.partition(".")[0] != "1":
        raise ValueError(f'hdrgm:Version is "{one_line(version)[:40]}"; expected 1.0')
    low, high, gamma, base_offset, bright_offset = (_property(properties, *field) for field in _FIELDS.values())
    base = _property(properties, "HDRCapacityMin", 0.0)[0]
    bright = _property(properties, "HDRCapacityMax", max(high))[0]
    if properties.get(f"{HDRGM}BaseRenditionIsHDR", ("False",))[0].strip().lower() == "true":
        base, bright = max(base, bright, 2**-20), min(base, bright, 0.0)
    return GainMapMetadata(low, high, gamma, base_offset, bright_offset, base, bright)


def _property(properties: Properties, name: str, default: float | None) -> Three:
    values = properties.get(HDRGM + name, ())
    if not values:
        if default is None:
            raise ValueError(f"hdrgm:{name} is missing")
        return default, default, default
    try:
        numbers = [float(value) for value in values]
    except ValueError:
        raise ValueError(f'hdrgm:{name} is "{one_line(" ".join(values))[:40]}"; expected a number or three') from None
    if len(numbers) == 1:
        return numbers[0], numbers[0], numbers[0]
    if len(numbers) != 3:
        raise ValueError(f"hdrgm:{name} has {len(numbers)} values; expected one or three")
    return numbers[0], numbers[1], numbers[2]


def lengths_in(packet: bytes) -> list[tuple[str, int]]:
    """(meaning, bytes) of the pictures that a container's directory lists behind the primary one, in their order.

    packet : one that `xmp.properties` has read without complaint
    returns : nothing where there is no directory, or a length that makes no sense
    """
    items: list[dict[str, str]] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        if name == CONTAINER + "Item":
            items.append({})
        if items:
            items[-1].update({key: value for key, value in attributes.items() if key.startswith(ITEM)})

    parser = expat.ParserCreate(namespace_separator="")
    parser.StartElementHandler = start
    parser.Parse(packet.strip(b"\0 \t\r\n"), True)
    listed = []
    for item in items[1:]:
        length, padding = item.get(ITEM + "Length", ""), item.get(ITEM + "Padding", "0")
        if not all(text.isascii() and text.isdecimal() and len(text) < 16 for text in (length, padding)):
            return []
        listed.append((item.get(ITEM + "Semantic", ""), int(length) + int(padding)))
    return listed


def directory(length: int) -> str:
    """The elements that go into the primary picture's packet: the version, and the directory of both pictures.

    length : of the gain map, bytes
    """
    return (
        f'<rdf:Description rdf:about="" xmlns:hdrgm="{HDRGM}" xmlns:Container="{CONTAINER}" xmlns:Item="{ITEM}"'
        ' hdrgm:Version="1.0"><Container:Directory><rdf:Seq>'
        '<rdf:li rdf:parseType="Resource"><Container:Item Item:Semantic="Primary" Item:Mime="image/jpeg"/></rdf:li>'
        '<rdf:li rdf:parseType="Resource"><Container:Item Item:Semantic="GainMap" Item:Mime="image/jpeg"'
        f' Item:Length="{length}"/></rdf:li></rdf:Seq></Container:Directory></rdf:Description>'
    )


def description(metadata: GainMapMetadata) -> str:
    """The element that goes into the gain map's own packet: all parameters, three values each."""
    properties = "".join(
        f"<hdrgm:{field}><rdf:Seq>"
        + "".join(f"<rdf:li>{_decimal(value)}</rdf:li>" for value in getattr(metadata, name))
        + f"</rdf:Seq></hdrgm:{field}>"
        for name, (field, _) in _FIELDS.items()
    )
    return (
        f'<rdf:Description rdf:about="" xmlns:hdrgm="{HDRGM}" hdrgm:Version="1.0" hdrgm:BaseRenditionIsHDR="False"'
        f' hdrgm:HDRCapacityMin="{_decimal(metadata.base_headroom)}"'
        f' hdrgm:HDRCapacityMax="{_decimal(metadata.bright_headroom)}">{properties}</rdf:Description>'
    )


def with_description(packet: bytes, element: str) -> bytes:
    """A packet of `xmp.packet` with an rdf:Description more; properties may be spread over several (7.4)."""
    head, end, tail = packet.rpartition(b"</rdf:RDF>")
    return head + element.encode() + end + tail


def _decimal(value: float) -> str:
    """Every digit of a fraction of 2³⁰, without an exponent, which some readers of XMP do not know."""
    return f"{value:.30f}".rstrip("0").rstrip(".")
