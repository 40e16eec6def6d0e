"""EXIF and the attributes of a radiance map: the same facts by two names (`relume.image.files.attributes.EXIF`)."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from relume.image.files.attributes import EXIF

_FOLDER = 0x8769  # of EXIF's own tags; those below stand in the first folder, CIPA DC-008, 4.6.4
_FIRST = {0x010E, 0x010F, 0x0110, 0x0131, 0x013B}
_RATIONAL = {"exposure_time", "f_number", "focal_length"}
_MOST_TEXT = 4096  # characters of one value; a whole segment holds 65,533 bytes


def attributes_of(tags: Mapping[int, object]) -> dict[str, str]:
    """The attributes that EXIF tags tell, as text; what is empty, no number or 0 where a number is due is left out.

    tags : by number, as `exif.tags` gives them
    """
    told: dict[str, str] = {}
    for name, tag in EXIF.items():
        value = tags.get(tag)
        if isinstance(value, tuple) and value:
            value = value[0]
        if name in _RATIONAL or name == "iso":
            try:
                number = float(value)  # pyright: ignore[reportArgumentType]
            except (TypeError, ValueError, ZeroDivisionError):
                continue
            if 0 < number < float("inf"):
                told[name] = f"{number:.9g}"
        elif isinstance(value, str) and (text := value.strip("\0 ")):
            told[name] = text[:_MOST_TEXT]
    return told


def encoded(attributes: Mapping[str, str]) -> bytes:
    """EXIF of those attributes that it has a tag for and that it can hold; b"" where there are none."""
    exif = Image.Exif()
    folder = exif.get_ifd(_FOLDER)
    for name, tag in EXIF.items():
        value = _value(name, attributes.get(name, ""))
        if value is not None:
            (exif if tag in _FIRST else folder)[tag] = value
    return exif.tobytes() if len(exif) or len(folder) else b""


def _value(name: str, text: str) -> object:
    """A tag's value; None for a text that it cannot hold as it is."""
    if name in _RATIONAL or name == "iso":
        try:
            number = float(text)
            if not 0 < number < 2**31:
                return None
            if name == "iso":
                return int(number) if number == int(number) and number < 2**16 else None
            # The fraction nearest to it whose terms fit 32 bits, so that 1/60 s is written as 1/60.
            fraction = Fraction(number).limit_denominator(max(1, min(10**6, int(2**31 / max(1.0, number)))))
            return IFDRational(fraction.numerator, fraction.denominator) if fraction else None
        except ValueError:
            return None
    return text if text and text.isascii() and "\0" not in text and len(text) <= _MOST_TEXT else None
