"""The markers of a JPEG, listed and put together; nothing here decodes a pixel (ITU-T T.81, annex B).

Every length is held against the file before it is used: a segment may claim to reach beyond it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO

from relume.errors import FormatError
from relume.image.files.read_options import ReadOptions

APP0, APP1, APP2, APP14 = 0xE0, 0xE1, 0xE2, 0xEE
EXIF, XMP = b"Exif\0\0", b"http://ns.adobe.com/xap/1.0/\0"  # CIPA DC-008, 4.7.2; XMP part 3, 1.1.3
ICC, MPF = b"ICC_PROFILE\0", b"MPF\0"  # ICC.1:2022, B.4; CIPA DC-007, 5.2
ISO_GAIN_MAP = b"urn:iso:std:iso:ts:21496:-1\0"  # ISO 21496-1, annex C
_START, _SCAN, _END = 0xD8, 0xDA, 0xD9
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_KEPT = _FRAMES | {APP1, APP2}
_MOST_SEGMENTS = 4096  # 16 MiB of metadata make 256 full ones
_MOST_STRAY = 8192
_ALONE = (0x01, *range(0xD0, 0xD8))  # markers without a length: table B.1
_LARGEST = 65533  # bytes behind a segment's length
# In the scans a 0xFF is followed by 0 where it is data, by D0 to D7 where decoding may restart.
_NEXT_MARKER = re.compile(rb"\xff([^\x00\xd0-\xd7\xff])")


@dataclass(frozen=True)
class Segment:
    """One marker of a JPEG's header and what stands behind its length.

    marker : the byte behind 0xFF
    offset : of its 0xFF in the file
    payload : what it holds; empty for kinds that nobody asks for
    """

    marker: int
    offset: int
    payload: bytes

    def behind(self, identifier: bytes) -> bytes | None:
        """What follows `identifier` at the payload's start; None where it is another kind of segment."""
        return self.payload[len(identifier) :] if self.payload.startswith(identifier) else None


@dataclass(frozen=True)
class Header:
    """The segments of one JPEG up to its first scan.

    begin, scan : offsets in the file of the JPEG and of its first scan's marker
    width, height, channels : as its frame says
    segments : all of them, the scan's marker the last
    stray : bytes between them that belong to none
    """

    begin: int
    scan: int
    width: int
    height: int
    channels: int
    segments: tuple[Segment, ...]
    stray: int = 0

    def first(self, marker: int, identifier: bytes) -> bytes | None:
        """What follows `identifier` in the first segment that has it; None where none has."""
        found = (s.behind(identifier) for s in self.segments if s.marker == marker)
        return next((payload for payload in found if payload is not None), None)

    @property
    def profile(self) -> bytes | None:
        """The ICC profile, put together from its numbered pieces; None where there is none or a piece is missing."""
        pieces = [p for s in self.segments if s.marker == APP2 and (p := s.behind(ICC)) is not None and len(p) > 2]
        pieces.sort(key=lambda piece: piece[0])
        if not pieces or [piece[0] for piece in pieces] != list(range(1, pieces[0][1] + 1)):
            return None
        return b"".join(piece[2:] for piece in pieces)


def header_at(path: str | os.PathLike[str], file: BinaryIO, begin: int, options: ReadOptions) -> Header:
    """The header of the JPEG that begins at byte `begin` of an open file; raises FormatError where it is broken.

    A few stray bytes between the segments are passed over, as decoders do, and counted.
    """
    size = file.seek(0, os.SEEK_END)
    offset, kept, filling, stray, frame = begin + 2, 0, 0, 0, None
    segments: list[Segment] = []
    file.seek(begin)
    if (start := file.read(2)) != bytes((0xFF, _START)):
        raise _damaged(path, begin, "the start of an image, ff d8", start.hex(" ") or "the end of the file")
    while True:
        file.seek(offset)
        head = file.read(4)
        if head[:2] == b"\xff\xff" and filling < _MOST_SEGMENTS:  # a fill byte before a marker
            offset, filling = offset + 1, filling + 1
            continue
        if len(head) == 4 and stray < _MOST_STRAY and (head[0] != 0xFF or head[1] == 0):
            offset, stray = offset + 1, stray + 1
            continue
        if len(head) < 4 or head[0] != 0xFF:
            raise _damaged(path, offset, "a marker", head.hex(" ") or "the end of the file")
        if head[1] in _ALONE and stray < _MOST_STRAY:
            offset, stray = offset + 2, stray + 2
            continue
        marker, length = head[1], int.from_bytes(head[2:])
        if marker in (_END, _START, 0, 0xFF) or length < 2 or offset + 2 + length > size:
            raise _damaged(path, offset, f"a segment within the {size} bytes", f"marker {marker:02x}, length {length}")
        payload = file.read(length - 2) if marker in _KEPT else b""
        kept += len(payload)
        segments.append(Segment(marker, offset, payload))
        if kept > options.metadata or len(segments) > _MOST_SEGMENTS:
            most = f"at most {options.metadata} bytes in {_MOST_SEGMENTS} segments of metadata"
            raise _damaged(path, offset, most, "more")
        if marker in _FRAMES:
            frame = _frame(path, segments[-1])
        if marker == _SCAN:
            if frame is None:
                raise _damaged(path, offset, "a frame before the first scan", "none")
            return Header(begin, offset, *frame, tuple(segments), stray)
        offset += 2 + length


def _frame(path: str | os.PathLike[str], segment: Segment) -> tuple[int, int, int]:
    """Width, height and channels (T.81, B.2.2)."""
    payload = segment.payload
    if len(payload) < 6 or payload[0] != 8:
        raise _damaged(path, segment.offset, "a frame of 8 bits a channel", payload[:6].hex(" "))
    return int.from_bytes(payload[3:5]), int.from_bytes(payload[1:3]), payload[5]


def _damaged(path: str | os.PathLike[str], offset: int, expected: str, found: str) -> FormatError:
    return FormatError(path, "JPEG", f"byte {offset}", expected, found)


def length_of(jpeg: bytes, scan: int) -> int | None:
    """Bytes up to and with the end of the image, whose first scan is at byte `scan`; None where it never ends."""
    offset = scan
    for _ in range(_MOST_SEGMENTS):
        offset += 2 + int.from_bytes(jpeg[offset + 2 : offset + 4])
        found = _NEXT_MARKER.search(jpeg, offset)
        if found is None:
            return None
        if found[1][0] == _END:
            return found.end()
        offset = found.end() - 2
    return None


def most_bytes(header: Header) -> int:
    """The most bytes that a JPEG of such a frame can take: 27 bits a value (T.81, annex F), stuffed, and its header."""
    return header.scan - header.begin + 8 * max(header.channels, 3) * (header.width + 16) * (header.height + 16) + 65536


def segment(marker: int, payload: bytes) -> bytes:
    """The bytes of one segment; raises ValueError for more than 65,533 bytes of payload."""
    if len(payload) > _LARGEST:
        raise ValueError(f"a segment of {len(payload)} bytes; a JPEG's holds at most {_LARGEST}")
    return bytes((0xFF, marker)) + (len(payload) + 2).to_bytes(2) + payload


def with_segments(jpeg: bytes, added: Sequence[bytes]) -> bytes:
    """A JPEG with segments put right behind its start, ahead of all it has."""
    return jpeg[:2] + b"".join(added) + jpeg[2:]


def without_metadata(jpeg: bytes, header: Header) -> bytes:
    """A JPEG without stray bytes, comments and APP segments, but for those that say how its colours are stored.

    jpeg : whole; header : its own
    """
    pieces = [jpeg[:2]]
    for one in header.segments[:-1]:
        # JFIF and Adobe say whether the channels are YCbCr.
        if one.marker in (APP0, APP14) or not (0xE0 <= one.marker <= 0xEF or one.marker == 0xFE):
            begin = one.offset - header.begin
            pieces.append(jpeg[begin : begin + 2 + int.from_bytes(jpeg[begin + 2 : begin + 4])])
    return b"".join([*pieces, jpeg[header.scan - header.begin :]])
