"""Where in a JPEG file its gain map is, and where its parameters: found for reading, put together for writing.

Three things may lead to the second picture: the multi-picture index (CIPA DC-007), the directory in the primary
picture's XMP (Ultra HDR 1.1), and at last what follows the primary picture's end. None is trusted: a picture is the
gain map when it is a JPEG with gain-map parameters of its own.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import BinaryIO

from relume.errors import FormatError
from relume.image.files.gain_map import metadata as gain_map_metadata
from relume.image.files.gain_map.metadata import GainMapMetadata
from relume.image.files.metadata import xmp
from relume.image.files.photographs import jpeg_segments
from relume.image.files.photographs.jpeg_segments import APP1, APP2, Header
from relume.image.files.read_options import ReadOptions

FORMAT = "gain-map JPEG"
_INDEX, _ENTRIES = 0xB001, 0xB002  # NumberOfImages, MPEntry: CIPA DC-007, 5.2.3
_PRIMARY_TYPE = 0x20030000  # representative, baseline MP primary image: 5.2.3.3.1
_MOST_TAGS = 64
_MOST_ENTRIES = 64
_MOST_TRIED = 16  # places; a header may take its time
_SCANNED = 2**16  # bytes behind the primary picture in which a second is looked for


@dataclass(frozen=True)
class Layout:
    """Both pictures of a gain-map JPEG.

    base, map : their headers
    base_end, map_end : the bytes that end them, or lie behind their ends
    metadata : the gain map's parameters
    form : where they stand, "ISO 21496-1" or "XMP"
    packet : the primary picture's XMP
    """

    base: Header
    base_end: int
    map: Header
    map_end: int
    metadata: GainMapMetadata
    form: str
    packet: bytes | None


def located(path: str | os.PathLike[str], file: BinaryIO, options: ReadOptions) -> Layout | None:
    """Where the gain map of an open JPEG is; None where it has none, and claims none.

    Raises FormatError where the primary picture claims one that is not there, or the parameters make no sense.
    """
    base = jpeg_segments.header_at(path, file, 0, options)
    packet = base.first(APP1, jpeg_segments.XMP)
    claims, lengths = _claims_and_lengths(packet, options)
    claims = claims or base.first(APP2, jpeg_segments.ISO_GAIN_MAP) is not None
    size = file.seek(0, os.SEEK_END)
    tried: set[int] = set()
    tries = 0
    for begin, end in _candidates(base, lengths, file, size, claims):
        if begin in tried or not base.scan < begin < size - 4:
            continue
        if (tries := tries + 1) > _MOST_TRIED:
            break
        tried.add(begin)
        try:
            header = jpeg_segments.header_at(path, file, begin, options)
        except FormatError:
            continue
        if end <= header.scan:  # another place may have its length right
            tried.discard(begin)
            continue
        if (found := _metadata_in(path, header, options)) is not None:
            return Layout(base, begin, header, min(end, size), *found, packet)
    if claims:
        places = ", ".join(str(place) for place in sorted(tried)[:4]) or "any byte"
        raise FormatError(
            path, FORMAT, "behind its base picture", "a JPEG with gain-map parameters", f"none at {places}"
        )
    return None


def _claims_and_lengths(packet: bytes | None, options: ReadOptions) -> tuple[bool, list[tuple[str, int]]]:
    """Whether the primary picture's XMP claims a gain map, and its directory; of a damaged packet, nothing.

    The picture index and the gain map itself are still there then.
    """
    if packet is None:
        return False, []
    try:
        claims = any(name.startswith(gain_map_metadata.HDRGM) for name in xmp.properties(packet, options))
    except ValueError:
        return False, []
    lengths = gain_map_metadata.lengths_in(packet)
    return claims or any(semantic == "GainMap" for semantic, _ in lengths), lengths


def _metadata_in(
    path: str | os.PathLike[str], header: Header, options: ReadOptions
) -> tuple[GainMapMetadata, str] | None:
    """The parameters a gain map carries: ISO 21496-1 before XMP, as Ultra HDR 1.1 wants; None where it has neither."""
    block = header.first(APP2, jpeg_segments.ISO_GAIN_MAP)
    where = f"gain map at byte {header.begin}"
    try:
        if block is not None and len(block) > len(gain_map_metadata.VERSION):
            where += ", ISO 21496-1 block"
            return gain_map_metadata.from_iso(block), "ISO 21496-1"
        packet = header.first(APP1, jpeg_segments.XMP)
        if packet is None or b"hdr-gain-map" not in packet:
            return None
        where += ", XMP"
        return gain_map_metadata.metadata_in(xmp.properties(packet, options)), "XMP"
    except ValueError as error:
        raise FormatError(path, FORMAT, where, "parameters that make sense", str(error)) from None


def _candidates(
    base: Header, lengths: list[tuple[str, int]], file: BinaryIO, size: int, claims: bool
) -> Iterator[tuple[int, int]]:
    """Where a second picture may begin and end, the likeliest first."""
    for segment in base.segments:
        if segment.marker == APP2 and (index := segment.behind(jpeg_segments.MPF)) is not None:
            # Offsets count from the byte order behind the segment's name.
            origin = segment.offset + 4 + len(jpeg_segments.MPF)
            yield from ((origin + offset, origin + offset + length) for offset, length in _entries(index))
    end = size
    for semantic, length in reversed(lengths):
        if semantic == "GainMap":
            yield end - length, end
        end -= length
    if not claims:
        return
    file.seek(0)
    data = file.read(min(size, jpeg_segments.most_bytes(base)))
    if (length := jpeg_segments.length_of(data, base.scan)) is not None:
        offset = length
        for semantic, listed in lengths:
            if semantic == "GainMap":
                yield offset, offset + listed
            offset += listed
        place = data.find(b"\xff\xd8\xff", length, length + _SCANNED)
        if place >= 0:
            yield place, size


def _entries(index: bytes) -> list[tuple[int, int]]:
    """(offset, length) of each picture in a multi-picture index but the first; none where it is damaged."""
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(index[:4])
    if order is None:
        return []
    try:
        (start,) = struct.unpack_from(order + "I", index, 4)
        (count,) = struct.unpack_from(order + "H", index, start)
        for place in range(start + 2, start + 2 + 12 * min(count, _MOST_TAGS), 12):
            tag, _, length, offset = struct.unpack_from(order + "HHII", index, place)
            if tag == _ENTRIES:
                pictures = range(offset + 16, offset + 16 * min(length // 16, _MOST_ENTRIES), 16)
                listed = [struct.unpack_from(order + "III", index, entry) for entry in pictures]
                return [(begin, size) for _, size, begin in listed]
    except struct.error:
        pass
    return []


def index_of(base_length: int, map_length: int, offset: int) -> bytes:
    """The payload of the multi-picture segment of two JPEGs, one behind the other.

    base_length : of the first picture with this segment, bytes
    map_length : of the second
    offset : of this segment's marker in the file
    """
    begin = base_length - (offset + 4 + len(jpeg_segments.MPF))
    entries = 8 + 2 + 3 * 12 + 4  # behind header and folder
    return jpeg_segments.MPF + b"".join(
        (
            struct.pack(">2sHIH", b"MM", 42, 8, 3),
            struct.pack(">HHI4s", 0xB000, 7, 4, b"0100"),  # MPFVersion
            struct.pack(">HHII", _INDEX, 4, 1, 2),
            struct.pack(">HHIII", _ENTRIES, 7, 32, entries, 0),
            struct.pack(">IIIHH", _PRIMARY_TYPE, base_length, 0, 0, 0),
            struct.pack(">IIIHH", 0, map_length, begin, 0, 0),
        )
    )


def assembled(base: bytes, gain_map: bytes, heads: Sequence[bytes]) -> bytes:
    """The file of both JPEGs with the multi-picture index.

    base : without the segments of metadata that go ahead of all it has, `heads`
    gain_map : whole
    """
    ahead = b"".join(heads)
    length_of_index = len(jpeg_segments.segment(APP2, index_of(2**16, 0, 0)))
    base_length = len(base) + len(ahead) + length_of_index
    index = jpeg_segments.segment(APP2, index_of(base_length, len(gain_map), 2 + len(ahead)))
    return jpeg_segments.with_segments(base, [ahead, index]) + gain_map
