"""EXIF and the attributes of a radiance map: the same facts by two names (`attributes.EXIF`); EXIF of a photograph.

`value_of` and `text_of` are how text becomes the value of a tag and comes back, in a TIFF as in a JPEG. `encoded` lays
the tags that `metadata.exif` reads out by our own TIFF. Not by Pillow's, because that turns every letter beyond ASCII
into "?". Texts are UTF-8, as most cameras and programs write and read them where EXIF 2.32 has ASCII alone (EXIF 3.0
has a type for it, which older readers pass over).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from relume.image.files.metadata import gps
from relume.image.files.metadata.attributes import EXIF
from relume.image.files.tiff.writing import EXIF_FOLDER, Tags, exif_block
from relume.image.photograph import Exposure, Photograph, Settings

ASCII, SHORT, RATIONAL = 2, 3, 5  # TIFF 6.0, section 2
_LONG, _SIGNED_RATIONAL = 4, 10
HEAD = b"Exif\0\0"
"""What stands ahead of EXIF in a JPEG's segment (CIPA DC-008, 4.7.2)."""
_RATIONALS = ("exposure_time", "f_number", "focal_length")
_FIRST = 0x8298  # tags from Copyright on, in `EXIF`, are of the EXIF folder; those before it of the first, as in a TIFF
_MOST_TEXT = 4096  # characters of one value, as most programs show
# The tags that are no attributes of a radiance map.
ISO_SPEED, FOCAL_LENGTH_35MM, TAKEN_FRACTION, WHITE_BALANCE, BIAS = 0x8833, 0xA405, 0x9291, 0xA403, 0x9204
FULL_FRAME = 36.0  # mm, the longer side to which FocalLengthIn35mmFilm refers

_Values = dict[int, tuple[int, list[float] | bytes]]


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
    return _ascii(text) if text else None


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


def encoded(photograph: Photograph) -> bytes:
    """EXIF of a photograph's exposure, settings, camera and focal length, such that reading gives the same again.

    As a PNG holds it, without `HEAD`; b"" where nothing is known. Raises ValueError for an ISO that is
    no whole number: the tag holds none.
    """
    main, folder = folders(photograph)
    return exif_block({**main, **({EXIF_FOLDER: folder} if folder else {})})


def folders(photograph: Photograph) -> tuple[Tags, Tags]:
    """As `encoded`, the tags of a TIFF's own folder and those of its EXIF folder.

    The focal length in pixels is written as that of a full-frame camera of the same view, a whole number of mm. Where
    the lens's own is not known it takes its place too: only so are more than two leading digits kept.
    """
    make, model = photograph.make_and_model
    settings = photograph.settings
    texts = {
        "camera_make": make,
        "camera": model,
        "lens": settings.lens,
        "serial": settings.serial,
        "owner": settings.owner,
        "copyright": settings.copyright,
        "comments": settings.comments,
    }
    values = {EXIF[name]: _ascii(text) for name, text in texts.items() if text}
    main: dict[int, tuple[int, list[float] | bytes] | Tags] = {}
    main.update({tag: value for tag, value in values.items() if not is_of_exif(tag)})
    folder: _Values = {tag: value for tag, value in values.items() if is_of_exif(tag)}
    folder |= _of_exposure(photograph.exposure) | _of_settings(settings)
    if photograph.focal_length is not None:
        millimetres = photograph.focal_length * FULL_FRAME / max(photograph.size)
        folder.setdefault(EXIF["focal_length"], (RATIONAL, rationals([millimetres])))
        folder[FOCAL_LENGTH_35MM] = _whole(round(millimetres))
    if position := gps.tags_of(settings.latitude, settings.longitude):
        main[gps.FOLDER] = position
    return main, folder


def _of_exposure(exposure: Exposure | None) -> _Values:
    if exposure is None:
        return {}
    folder: _Values = {EXIF["exposure_time"]: (RATIONAL, rationals([exposure.seconds]))}
    if exposure.f_number is not None:
        folder[EXIF["f_number"]] = (RATIONAL, rationals([exposure.f_number]))
    if exposure.iso is not None:
        if exposure.iso != int(exposure.iso):
            raise ValueError(f"iso is {exposure.iso}; EXIF holds whole numbers only: round it first")
        folder[EXIF["iso"]] = _whole(min(int(exposure.iso), 65535))
        if exposure.iso >= 65535:  # the 16-bit tag is full: the true value stands beside it
            folder[ISO_SPEED] = _whole(int(exposure.iso))
    return folder


def _of_settings(settings: Settings) -> _Values:
    folder: _Values = {}
    if settings.taken is not None:
        folder[EXIF["taken"]] = _ascii(settings.taken.strftime("%Y:%m:%d %H:%M:%S"))
        if settings.taken.microsecond:
            folder[TAKEN_FRACTION] = _ascii(f"{settings.taken.microsecond:06d}".rstrip("0"))
    if settings.automatic_white is not None:
        folder[WHITE_BALANCE] = _whole(0 if settings.automatic_white else 1)
    if settings.bias is not None:
        bias = Fraction(settings.bias).limit_denominator(1000)
        folder[BIAS] = (_SIGNED_RATIONAL, [bias.numerator, bias.denominator])
    if settings.focal_length is not None:
        folder[EXIF["focal_length"]] = (RATIONAL, rationals([settings.focal_length]))
    return folder


def _whole(number: int) -> tuple[int, list[float]]:
    return (SHORT if number < 2**16 else _LONG), [number]


def _ascii(text: str) -> tuple[int, bytes]:
    return ASCII, text.encode("utf-8", "replace") + b"\0"
