"""What a TIFF of radiance tells beside its pixels: attributes, primaries and unit, and the tags that hold them.

Attributes that have a tag of TIFF or EXIF go there, for other programs; all that a tag does not give back to the last
letter goes into an XMP packet too, under "relume:", and comes back from there.
"""

from __future__ import annotations

import os
import warnings
from fractions import Fraction
from typing import BinaryIO

import numpy as np

from relume.errors import FormatError
from relume.image.files import attributes as names
from relume.image.files import xmp
from relume.image.files.reading import Reading
from relume.image.files.tiff_folders import Folder, folder_at
from relume.image.files.tiff_writing import EXIF_FOLDER, Tags
from relume.image.primaries import REC709, Primaries
from relume.image.radiance import RadianceMap

WHITE_POINT, PRIMARIES, XMP, STONITS = 318, 319, 700, 37439
_BYTE, _ASCII, _SHORT, _RATIONAL, _DOUBLE = 1, 2, 3, 5, 12
_RATIONALS = ("exposure_time", "f_number", "focal_length")
_EXIF = 0x8298  # tags from Copyright on, in `names.EXIF`, are of the EXIF folder; those before it of TIFF itself


def tags_of(image: RadianceMap) -> tuple[Tags, Tags]:
    """The tags of a map's unit, primaries and attributes: those of its folder, and those of its EXIF folder."""
    main: dict[int, tuple[int, list[float] | bytes]] = {
        names.EXIF["software"]: (_ASCII, b"relume\0"),
        WHITE_POINT: (_RATIONAL, _rationals(REC709.white)),
        PRIMARIES: (_RATIONAL, _rationals((*REC709.red, *REC709.green, *REC709.blue))),
    }
    if image.unit == "cd/m²":
        main[STONITS] = (_DOUBLE, [1.0])
    exif: dict[int, tuple[int, list[float] | bytes]] = {}
    rest = {}
    for name, text in image.attributes.items():
        tag, typed = names.EXIF.get(name, 0), _typed(name, text)
        if tag and typed is not None:
            (exif if tag > _EXIF else main)[tag] = typed
        if not tag or typed is None or _told(name, typed[1]) != text:
            rest[name] = text
    if rest:
        main[XMP] = (_BYTE, xmp.packet(rest))
    return main, exif


def attributes_of(
    path: str | os.PathLike[str], file: BinaryIO, folder: Folder, reading: Reading = Reading()
) -> dict[str, str]:
    """The attributes in a TIFF that is open; warns where its EXIF or XMP is damaged and left out."""
    exif = None
    if places := folder.integers(EXIF_FOLDER):
        try:
            exif = folder_at(path, file, places[0], reading)
        except FormatError as error:
            warnings.warn(f"{path}: its EXIF is left out: {error.where} is damaged", stacklevel=4)
    found = {}
    for name, tag in names.EXIF.items():
        source = exif if tag > _EXIF and exif is not None else folder
        text = _told(name, source.values.get(tag, ()))
        if text and (name, text) != ("software", "relume"):
            found[name] = text
    return found | _in_packet(path, folder, reading)


def primaries_of(path: str | os.PathLike[str], folder: Folder) -> Primaries:
    """The primaries that a TIFF names, those of Rec. 709 where it names none; warns where they make no sense."""
    corners, white = folder.values.get(PRIMARIES, ()), folder.values.get(WHITE_POINT, ())
    if isinstance(corners, bytes) or len(corners) != 6:
        return REC709
    try:
        return Primaries.of((*corners, *(white if len(white) == 2 else REC709.white)))
    except ValueError as error:
        warnings.warn(f"{path}: {error}; taken for Rec. 709", stacklevel=4)
        return REC709


def scale_of(path: str | os.PathLike[str], folder: Folder) -> float | None:
    """The luminance of RGB (1, 1, 1), cd/m², which STONITS tells; None where it is missing. Raises FormatError."""
    if STONITS not in folder.values:
        return None
    scale = folder.number(STONITS)
    if scale is None or not 0 < scale < float("inf"):
        raise FormatError(path, "TIFF", f"tag {STONITS} (STONITS)", "a luminance above 0", str(scale))
    return scale


def _in_packet(path: str | os.PathLike[str], folder: Folder, reading: Reading) -> dict[str, str]:
    packet = folder.values.get(XMP, ())
    packet = packet if isinstance(packet, bytes) else bytes(int(byte) & 0xFF for byte in packet)
    if not packet:
        return {}
    try:
        return xmp.attributes(packet, reading)
    except ValueError as error:
        warnings.warn(f"{path}: {error}; what it tells is left out", stacklevel=5)
        return {}


def _typed(name: str, text: str) -> tuple[int, list[float] | bytes] | None:
    """A text with the type of its tag; None where the tag cannot hold it."""
    if name in _RATIONALS or name == "iso":
        try:
            number = float(text)
        except ValueError:
            return None
        if name == "iso":
            return (_SHORT, [int(number)]) if 1 <= number <= 65535 and number == int(number) else None
        return (_RATIONAL, _rationals([number])) if 2**-31 < number < 2**31 else None
    encoded = text.encode("utf-8", "replace")
    return (_ASCII, encoded + b"\0") if encoded else None


def _told(name: str, values: tuple[float, ...] | list[float] | bytes) -> str:
    """The text that the values of a tag mean, "" for none; numbers with the digits that float32 holds."""
    if isinstance(values, bytes):
        numeric = name in _RATIONALS or name == "iso"
        return "" if numeric else values.split(b"\0")[0].decode("utf-8", "replace").strip()
    if not values or not (name in _RATIONALS or name == "iso"):
        return ""
    # A rational as it is written is two integers; as it is read it is one number.
    number = values[0] / values[1] if name in _RATIONALS and len(values) == 2 else values[0]
    with np.errstate(over="ignore"):
        single = np.float32(number)
    return str(single).removesuffix(".0") if 0 < single < np.inf else ""


def _rationals(numbers: tuple[float, ...] | list[float]) -> list[float]:
    """Numerators and denominators of the fractions nearest to the numbers whose terms fit 32 bits."""
    terms: list[float] = []
    for number in numbers:
        fraction = Fraction(number).limit_denominator(max(1, int(2**31 / max(1.0, number))))
        terms += [fraction.numerator, fraction.denominator]
    return terms
