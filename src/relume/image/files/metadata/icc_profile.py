"""ICC profiles of pictures as cameras and screens have them, read and made: three primaries and three curves.

Other profiles (tables in place of primaries, grey, CMYK) are not understood here, and said to be not. Those made have
the sRGB curve, version 4. Format: ICC.1:2022.
"""

from __future__ import annotations

import hashlib
import io
import struct
from dataclasses import dataclass

import numpy as np

from relume.image.colour import decode_srgb
from relume.image.files.signatures import one_line
from relume.image.primaries import ADOBE_RGB, REC709, Primaries, adaptation

_D50 = (0.3457, 0.3585)  # the white of profiles' connection space, ICC.1:2022, 7.2.16
_MOST_TAGS = 256
_PCS = (0.9642, 1.0, 0.8249)  # XYZ of the connection space's white, as profiles write it (7.2.16)
_CURVE = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)  # IEC 61966-2-1 as parametricCurveType 3 (10.18)
_MADE = (2026, 1, 1, 0, 0, 0)  # fixed, so that the same picture makes the same file
ADOBE_GAMMA = 2 + 51 / 256
"""From codes of Adobe RGB (1998) to light (Adobe RGB (1998) Color Image Encoding, 4.3.4.2)."""
_UNPROTECTED = "No copyright, use freely"
_PROFILE_ID = slice(84, 100)
_OUTSIDE_ID = (slice(44, 48), slice(64, 68), _PROFILE_ID)  # flags, intent and itself are 0 when it is made (7.2.18)


@dataclass(frozen=True, eq=False)
class Profile:
    """What codes stand for.

    primaries : of the linear values
    curves : (levels, 3) float32, linear R, G and B of each code, nominally in [0, 1]; 256 levels of 8 bits
    """

    primaries: Primaries
    curves: np.ndarray


def srgb(levels: int = 256) -> Profile:
    """sRGB, which is meant where a picture has no profile."""
    curve = decode_srgb(np.linspace(0, 1, levels))
    return Profile(REC709, np.repeat(curve[:, None], 3, axis=1).astype(np.float32))


def parsed(profile: bytes, levels: int = 256) -> Profile | None:
    """A profile of primaries and curves; None for a damaged one and for every other kind.

    levels : codes of a channel, 256 or 65536
    """
    try:
        return _parsed(profile, levels)
    except (struct.error, ValueError, ArithmeticError, np.linalg.LinAlgError):
        return None


def _parsed(profile: bytes, levels: int) -> Profile | None:
    if profile[16:24] != b"RGB XYZ " or profile[36:40] != b"acsp":
        return None
    tags: dict[bytes, bytes] = {}
    (count,) = struct.unpack_from(">I", profile, 128)
    for place in range(132, 132 + 12 * min(count, _MOST_TAGS), 12):
        name, offset, size = struct.unpack_from(">4sII", profile, place)
        tags[name] = profile[offset : offset + size]
    if not {b"rXYZ", b"gXYZ", b"bXYZ", b"rTRC", b"gTRC", b"bTRC"} <= tags.keys() or b"A2B0" in tags:
        return None
    colorants = np.column_stack([_numbers(tags[name], 3, 8) for name in (b"rXYZ", b"gXYZ", b"bXYZ")])
    codes = np.linspace(0, 1, levels)
    with np.errstate(all="ignore"):
        curves = np.column_stack([_curve(tags[name], codes) for name in (b"rTRC", b"gTRC", b"bTRC")])
    if not np.all(np.isfinite(curves)) or curves.min() < -1 or curves.max() > 2:
        return None
    # White is light, and more than black.
    if np.any(curves[-1] <= np.maximum(curves[0], 0)):
        return None
    return Profile(_primaries(colorants, tags.get(b"chad")), curves.astype(np.float32))


def _primaries(colorants: np.ndarray, chad: bytes | None) -> Primaries:
    """The primaries before they were adapted to D50, by the profile's own matrix or else from D65 by Bradford's."""
    matrix = _numbers(chad, 9, 8).reshape(3, 3) if chad else adaptation(REC709.white, _D50)
    native = np.linalg.solve(matrix, np.column_stack([colorants, colorants.sum(1)]))
    return Primaries.of((native[:2] / native.sum(0)).T)


def _curve(tag: bytes, codes: np.ndarray) -> np.ndarray:
    """Linear values of codes, by a curveType or a parametricCurveType (10.6, 10.18)."""
    if tag[:4] == b"curv":
        (count,) = struct.unpack_from(">I", tag, 8)
        if count == 0:
            return codes
        if count == 1:
            return codes ** (struct.unpack_from(">H", tag, 12)[0] / 256)
        samples = np.frombuffer(tag, ">u2", count, 12) / 65535
        return np.interp(codes, np.linspace(0, 1, count), samples)
    if tag[:4] != b"para":
        raise ValueError("a curve of an unknown kind")
    (kind,) = struct.unpack_from(">H", tag, 8)
    g, a, b, c, d, e, f = np.append(_numbers(tag, (1, 3, 4, 5, 7)[kind] if kind < 5 else 99, 12), np.zeros(7))[:7]
    if kind == 0:
        return codes**g
    if kind in (1, 2):
        # Type 1 ends at 0 below −b/a, type 2 at c.
        return np.where(codes >= -b / a, np.maximum(a * codes + b, 0) ** g + c, c)
    return np.where(codes >= d, np.maximum(a * codes + b, 0) ** g + e, c * codes + f)


def _numbers(tag: bytes, count: int, offset: int) -> np.ndarray:
    """(count,) of signed numbers of 16 bits before the point and 16 behind it."""
    return np.array(struct.unpack_from(f">{count}i", tag, offset)) / 65536


def screen_profile(primaries: Primaries, name: str, gamma: float | None = None) -> bytes:
    """The profile of a screen of these primaries; `name` is what programs show, in ASCII.

    gamma : the exponent from codes to light, held to 1/256; the sRGB curve unless given
    """
    to_pcs = adaptation(primaries.white, (_PCS[0] / sum(_PCS), _PCS[1] / sum(_PCS)))
    columns = (to_pcs @ primaries.to_xyz()).T
    if gamma is None:
        curve = b"para" + bytes(4) + struct.pack(">HH", 3, 0) + _fixed(_CURVE)
    else:
        curve = b"curv" + bytes(4) + struct.pack(">IH", 1, round(256 * gamma))
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


def adobe_rgb() -> bytes:
    """The profile of a photograph that only its EXIF says to be of Adobe RGB (1998)."""
    return screen_profile(ADOBE_RGB, "Adobe RGB (1998)", ADOBE_GAMMA)


def description(profile: bytes) -> str:
    """What programs show a profile as, in one line; "damaged" where it holds no name that can be read."""
    from PIL import ImageCms

    try:
        shown = ImageCms.getProfileDescription(ImageCms.ImageCmsProfile(io.BytesIO(profile)))
    except (ImageCms.PyCMSError, OSError, ValueError, TypeError):
        return "damaged"
    return one_line(shown)


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
