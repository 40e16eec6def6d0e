"""The EXIF of a photograph, written: the tags that `relume.image.files.metadata.exif` reads, laid out by our own TIFF.

Not Pillow's, because that turns every letter beyond ASCII into "?". Texts are UTF-8, as most cameras and programs write
and read them where EXIF 2.32 has ASCII alone (EXIF 3.0 has a type for it, which older readers pass over).
"""

from __future__ import annotations

from fractions import Fraction

from relume.image.files.metadata import gps
from relume.image.files.metadata.attributes import EXIF
from relume.image.files.metadata.exif_attributes import ASCII, RATIONAL, SHORT, is_of_exif, rationals
from relume.image.files.tiff.writing import EXIF_FOLDER, Tags, exif_block
from relume.image.photograph import Exposure, Photograph, Settings

_EXPOSURE_TIME, _F_NUMBER, _ISO, _ISO_SPEED = 0x829A, 0x829D, 0x8827, 0x8833
_FOCAL_LENGTH, _FOCAL_LENGTH_35MM = 0x920A, 0xA405
_TAKEN, _TAKEN_FRACTION, _WHITE_BALANCE, _BIAS = 0x9003, 0x9291, 0xA403, 0x9204
_LONG, _SIGNED_RATIONAL = 4, 10
_FULL_FRAME = 36.0  # mm, the longer side to which FocalLengthIn35mmFilm refers

_Values = dict[int, tuple[int, list[float] | bytes]]


def encoded(photograph: Photograph) -> bytes:
    """EXIF of a photograph's exposure, settings, camera and focal length, such that reading gives the same again.

    As a PNG holds it, without `exif_attributes.HEAD`; b"" where nothing is known. Raises ValueError for an ISO that is
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
    values = {EXIF[name]: (ASCII, _text(text)) for name, text in texts.items() if text}
    main: dict[int, tuple[int, list[float] | bytes] | Tags] = {}
    main.update({tag: value for tag, value in values.items() if not is_of_exif(tag)})
    folder: _Values = {tag: value for tag, value in values.items() if is_of_exif(tag)}
    folder |= _of_exposure(photograph.exposure) | _of_settings(settings)
    if photograph.focal_length is not None:
        millimetres = photograph.focal_length * _FULL_FRAME / max(photograph.size)
        folder.setdefault(_FOCAL_LENGTH, (RATIONAL, rationals([millimetres])))
        folder[_FOCAL_LENGTH_35MM] = _whole(round(millimetres))
    if position := gps.tags_of(settings.latitude, settings.longitude):
        main[gps.FOLDER] = position
    return main, folder


def _of_exposure(exposure: Exposure | None) -> _Values:
    if exposure is None:
        return {}
    folder: _Values = {_EXPOSURE_TIME: (RATIONAL, rationals([exposure.seconds]))}
    if exposure.f_number is not None:
        folder[_F_NUMBER] = (RATIONAL, rationals([exposure.f_number]))
    if exposure.iso is not None:
        if exposure.iso != int(exposure.iso):
            raise ValueError(f"iso is {exposure.iso}; EXIF holds whole numbers only: round it first")
        folder[_ISO] = _whole(min(int(exposure.iso), 65535))
        if exposure.iso >= 65535:  # the 16-bit tag is full: the true value stands beside it
            folder[_ISO_SPEED] = _whole(int(exposure.iso))
    return folder


def _of_settings(settings: Settings) -> _Values:
    folder: _Values = {}
    if settings.taken is not None:
        folder[_TAKEN] = (ASCII, _text(settings.taken.strftime("%Y:%m:%d %H:%M:%S")))
        if settings.taken.microsecond:
            folder[_TAKEN_FRACTION] = (ASCII, _text(f"{settings.taken.microsecond:06d}".rstrip("0")))
    if settings.automatic_white is not None:
        folder[_WHITE_BALANCE] = _whole(0 if settings.automatic_white else 1)
    if settings.bias is not None:
        bias = Fraction(settings.bias).limit_denominator(1000)
        folder[_BIAS] = (_SIGNED_RATIONAL, [bias.numerator, bias.denominator])
    if settings.focal_length is not None:
        folder[_FOCAL_LENGTH] = (RATIONAL, rationals([settings.focal_length]))
    return folder


def _whole(number: int) -> tuple[int, list[float]]:
    return (SHORT if number < 2**16 else _LONG), [number]


def _text(text: str) -> bytes:
    return text.encode("utf-8", "replace") + b"\0"
