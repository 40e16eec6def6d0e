"""ICC profiles of screens, made: three primaries and the sRGB curve, version 4 (ICC.1:2022)."""

from __future__ import annotations

import hashlib
import struct

import numpy as np

from relume.image.primaries import Primaries, adaptation

_PCS = (0.9642, 1.0, 0.8249)  # XYZ of the connection space's white, as profiles write it (7.2.16)
_CURVE = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)  # IEC 61966-2-1 as parametricCurveType 3 (10.18)
_MADE = (2026, 1, 1, 0, 0, 0)  # fixed, so that the same picture makes the same file
_UNPROTECTED = "No copyright, use freely"
_PROFILE_ID = slice(84, 100)
_OUTSIDE_ID = (slice(44, 48), slice(64, 68), _PROFILE_ID)  # flags, intent and itself are 0 when it is made (7.2.18)


def screen_profile(primaries: Primaries, name: str) -> bytes:
    """The profile of a screen of these primaries and sRGB's curve; `name` is what programs show, in ASCII."""
    to_pcs = adaptation(primaries.white, (_PCS[0] / sum(_PCS), _PCS[1] / sum(_PCS)))
    columns = (to_pcs @ primaries.to_xyz()).T
    curve = b"para" + bytes(4) + struct.pack(">HH", 3, 0) + _fixed(_CURVE)
    tags = {
        b"desc": _text(name),
        b"cprt": _text(_UNPROTECTED),
        b"wtpt": _xyz(_PCS),
        b"chad": b"sf32" + bytes(4) + _fixed(to_pcs.ravel()),
        **{channel: _xyz(column) for channel, column in zip((b"rXYZ", b"gXYZ", b"bXYZ"), columns, strict=True)},
        b"rTRC": curve,
        b"gTRC": curve,
        b"bTRC": curve,
    }
    contents = list(dict.fromkeys(tags.values()))
    begin = 128 + 4 + 12 * len(tags)
    places = {}
    for content in contents:
        places[content] = begin
        begin += -(-len(content) // 4) * 4
    table = struct.pack(">I", len(tags))
    table += b"".join(struct.pack(">4sII", tag, places[content], len(content)) for tag, content in tags.items())
    body = table + b"".join(content + bytes(-len(content) % 4) for content in contents)
    profile = bytearray(_header(128 + len(body)) + body)
    hashed = bytearray(profile)
    for part in _OUTSIDE_ID:
        hashed[part] = bytes(part.stop - part.start)
    profile[_PROFILE_ID] = hashlib.md5(hashed, usedforsecurity=False).digest()
    return bytes(profile)


def _header(size: int) -> bytes:
    """Of a version 4.4 profile of a screen (7.2)."""
    head = struct.pack(">I4sI4s4s4s6H4s", size, bytes(4), 0x04400000, b"mntr", b"RGB ", b"XYZ ", *_MADE, b"acsp")
    return head + bytes(28) + _fixed(_PCS) + bytes(48)


def _text(text: str) -> bytes:
    """A multiLocalizedUnicodeType of one language (10.15)."""
    letters = text.encode("utf-16-be")
    return b"mluc" + struct.pack(">IIIHHII", 0, 1, 12, 0x656E, 0x5553, len(letters), 28) + letters


def _xyz(values: object) -> bytes:
    return b"XYZ " + bytes(4) + _fixed(values)


def _fixed(values: object) -> bytes:
    """Signed numbers of 16 bits before the point and 16 behind it (4.6)."""
    numbers = np.rint(np.asarray(values, np.float64).ravel() * 65536).astype(int)
    return struct.pack(f">{numbers.size}i", *numbers)
