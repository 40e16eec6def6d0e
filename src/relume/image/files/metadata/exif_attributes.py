"""EXIF and the attributes of a radiance map: the same facts by two names (`attributes.EXIF`).

`value_of` and `text_of` are how text becomes the value of a tag and comes back, in a TIFF as in a JPEG.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from relume.image.files.metadata import gps
from relume.image.files.metadata.attributes import EXIF

ASCII, SHORT, RATIONAL = 2, 3, 5  # TIFF 6.0, section 2
HEAD = b"Exif\0\0"
"""What stands ahead of EXIF in a JPEG's segment (CIPA DC-008, 4.7.2)."""
_RATIONALS = ("exposure_time", "f_number", "focal_length")
_FIRST = 0x8298  # tags from Copyright on, in `EXIF`, are of the EXIF folder; those before it of the first, as in a TIFF
_MOST_TEXT = 4096  # characters of one value, as most programs show


def is_of_exif(tag: int) -> bool:
    """Whether a tag of `EXIF` stands in the EXIF folder, and not in the first (CIPA DC-008, 4.6.4)."""
    return tag > _FIRST


def letters(stored: bytes) -> str:
    """A text as most write it today, in UTF-8, and else in Latin-1, as many did; EXIF itself has ASCII alone."""
    try:
        return stored.decode("utf-8")
    except UnicodeDecodeError:
        return stored.decode("latin-1")


def value_of(name: str, text: str) -> tuple[int, list[float] | bytes] | None:
    """An attribute as the type and value of its tag; None where the tag cannot hold it."""
    if name in _RATIONALS or name == "iso":
        try:
            number = float(text)
        except ValueError:
            return None
        if name == "iso":
            return (SHORT, [int(number)]) if 1 <= number <= 65535 and number == int(number) else None
        return (RATIONAL, rationals([number])) if 2**-31 < number < 2**31 else None
    encoded = text.encode("utf-8", "replace")
    return (ASCII, encoded + b"\0") if encoded else None


def text_of(name: str, values: Sequence[float] | bytes) -> str:
    """The text that the values of a tag mean, "" for none; numbers with the digits that float32 holds."""
    numeric = name in _RATIONALS or name == "iso"
    if isinstance(values, bytes):
        return "" if numeric else "; ".join(_parts(name, values))
    if not values or not numeric:
        return ""
    # A rational as it is written is two integers; as it is read it is one number.
    number = values[0] / values[1] if name in _RATIONALS and len(values) == 2 else values[0]
    with np.errstate(over="ignore"):
        single = np.float32(number)
    return str(single).removesuffix(".0") if 0 < single < np.inf else ""


def _parts(name: str, values: bytes) -> list[str]:
    """The texts in an ASCII value: one, but two of a copyright, photographer and editor (CIPA DC-008, 4.6.4)."""
    parts = values.split(b"\0")[: 2 if name == "copyright" else 1]
    return [text for part in parts if (text := letters(part).strip())]


def rationals(numbers: Sequence[float]) -> list[float]:
    """Numerators and denominators of the fractions nearest to the numbers whose terms fit 32 bits."""
    terms: list[float] = []
    for number in numbers:
        fraction = Fraction(number).limit_denominator(max(1, int(2**31 / max(1.0, number))))
        terms += [fraction.numerator, fraction.denominator]
    return terms


def attributes_of(tags: Mapping[int, object]) -> dict[str, str]:
    """The attributes in EXIF tags, as text; what is empty, no number or 0 where a number is due is left out.

    tags : by number, as `exif.tags` gives them
    """
    found = {name: _text(name, tags.get(tag)) for name, tag in EXIF.items()}
    return {name: text[:_MOST_TEXT] for name, text in found.items() if text} | position_in(tags.get(gps.FOLDER))


def position_in(folder: object) -> dict[str, str]:
    """The attributes latitude and longitude in a GPS folder, tags by number; none where it is no folder."""
    found = gps.position_of(folder) if isinstance(folder, Mapping) else {}
    return {name: gps.text_of(degrees) for name, degrees in found.items()}


def _text(name: str, value: object) -> str:
    if isinstance(value, tuple) and value:
        value = value[0]
    if isinstance(value, str):
        return text_of(name, value.strip("\0 ").encode("utf-8", "replace"))
    try:
        return text_of(name, [float(value)])  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return ""
