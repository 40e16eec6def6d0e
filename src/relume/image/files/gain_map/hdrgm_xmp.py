"""The XMP of a gain map: the hdrgm parameters, and the directory of the pictures in a file.

Source: Ultra HDR 1.1 ("XMP attributes", "GContainer"). `metadata.xmp` holds what is true of all packets.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.parsers import expat

from relume.image.files.gain_map.metadata import GainMapMetadata, Three
from relume.image.files.signatures import one_line

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


def metadata_in(properties: Properties) -> GainMapMetadata:
    """The hdrgm parameters of a packet; what is left out has the value that the specification gives.

    properties : as `xmp.properties` gives them
    Raises ValueError for another version, what is no number, a missing GainMapMax, and values that make no sense.
    """
    version = properties.get(f"{HDRGM}Version", ("1.0",))[0].strip()
    if version.partition(".")[0] != "1":
        raise ValueError(f'hdrgm:Version is "{one_line(version)[:40]}"; expected 1.0')
    low, high, gamma, base_offset, bright_offset = (_three(properties, *field) for field in _FIELDS.values())
    base = _three(properties, "HDRCapacityMin", 0.0)[0]
    bright = _three(properties, "HDRCapacityMax", max(high))[0]
    if properties.get(f"{HDRGM}BaseRenditionIsHDR", ("False",))[0].strip().lower() == "true":
        base, bright = max(base, bright, 2**-20), min(base, bright, 0.0)
    return GainMapMetadata(low, high, gamma, base_offset, bright_offset, base, bright)


def _three(properties: Properties, name: str, default: float | None) -> Three:
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
