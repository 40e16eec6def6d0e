"""Where a photograph was taken: the GPS folder of EXIF, and the texts that radiance maps keep (CIPA DC-008, 4.6.6)."""

from __future__ import annotations

import math
from collections.abc import Mapping

from relume.image.files.tiff.writing import Tags

FOLDER = 0x8825
"""The tag that leads to the folder."""

_VERSION = 0
_COORDINATES = {"latitude": (1, "N", "S", 90.0), "longitude": (3, "E", "W", 180.0)}  # hemispheres: tags 1 and 3
_ASCII, _BYTE, _RATIONAL = 2, 1, 5
_FINEST = 10**6  # parts of an arc second, each 0.03 mm on the ground
_DIGITS = 9  # of a degree behind the point: 0.1 mm


def position_of(values: Mapping[int, object]) -> dict[str, float]:
    """Latitude and longitude, degrees north and east, in a folder's values by tag; without what makes no sense."""
    found = {name: _degrees(values, *of) for name, of in _COORDINATES.items()}
    return {name: degrees for name, degrees in found.items() if degrees is not None}


def tags_of(latitude: float | None = None, longitude: float | None = None) -> Tags:
    """The folder of a position in degrees north and east; empty where neither is known.

    A coordinate comes back rounded to 10⁻⁹ of a degree.
    """
    tags: dict[int, tuple[int, list[float] | bytes]] = {}
    for degrees, (tag, plus, minus, _) in zip((latitude, longitude), _COORDINATES.values(), strict=True):
        if degrees is None:
            continue
        minutes, seconds = divmod(round(abs(degrees) * 3600 * _FINEST), 60 * _FINEST)
        tags[tag] = (_ASCII, (minus if degrees < 0 else plus).encode() + b"\0")
        tags[tag + 1] = (_RATIONAL, [minutes // 60, 1, minutes % 60, 1, seconds, _FINEST])
    return {_VERSION: (_BYTE, [2, 3, 0, 0]), **tags} if tags else {}


def text_of(degrees: float) -> str:
    """Degrees as an attribute of a radiance map has them: "-122.259972"."""
    return f"{degrees:.{_DIGITS}f}".rstrip("0").rstrip(".")


def of_texts(attributes: Mapping[str, str]) -> dict[str, float]:
    """The latitude and longitude in a radiance map's attributes; without what is no such number."""
    found = {}
    for name, (*_, most) in _COORDINATES.items():
        try:
            degrees = float(attributes[name])
        except (KeyError, ValueError):
            continue
        if abs(degrees) <= most:
            found[name] = degrees
    return found


def _degrees(values: Mapping[int, object], tag: int, plus: str, minus: str, most: float) -> float | None:
    hemisphere, parts = values.get(tag), values.get(tag + 1)
    if isinstance(hemisphere, bytes):
        hemisphere = hemisphere.decode("latin-1")
    if not isinstance(hemisphere, str) or not isinstance(parts, tuple) or not 1 <= len(parts) <= 3:
        return None
    sign = {plus: 1, minus: -1}.get(hemisphere.strip("\0 ").upper())
    try:
        degrees = sum(float(part) / 60**place for place, part in enumerate(parts))
    except (TypeError, ValueError, ArithmeticError):
        return None
    return None if sign is None or not (math.isfinite(degrees) and degrees <= most) else sign * round(degrees, _DIGITS)
