"""What a photograph's EXIF tells: exposure, settings, camera, orientation; read and written through Pillow.

Pillow and not OpenImageIO, because it keeps rationals exact (OpenImageIO hands 1/60 over as a 32-bit float, and a
bracket written and read again would change its exposures). Tags and units: EXIF 2.32 (CIPA DC-008).
"""

from __future__ import annotations

import math
import os
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from fractions import Fraction
from typing import BinaryIO

import PIL
from PIL import Image, JpegImagePlugin, PngImagePlugin
from PIL.TiffImagePlugin import IFDRational

from relume.image.files.signatures import one_line
from relume.image.files.tiff_writing import Tags
from relume.image.photograph import Exposure, Photograph, Settings

_MAKE, _MODEL, _ORIENTATION, _EXIF_IFD = 0x010F, 0x0110, 0x0112, 0x8769
_EXPOSURE_TIME, _F_NUMBER, _ISO, _ISO_SPEED, _EXPOSURE_INDEX = 0x829A, 0x829D, 0x8827, 0x8833, 0x8832
_FOCAL_LENGTH, _FOCAL_LENGTH_35MM, _MAKER_NOTE, _PIXEL_WIDTH = 0x920A, 0xA405, 0x927C, 0xA002
_PLANE_RESOLUTION, _PLANE_UNIT = 0xA20E, 0xA210
_TAKEN, _TAKEN_FRACTION, _WHITE_BALANCE, _BIAS = 0x9003, 0x9291, 0xA403, 0x9204
_LENS, _SERIAL, _SHUTTER_SPEED = 0xA434, 0xA431, 0x9201
_MILLIMETRES = {2: 25.4, 3: 10.0, 4: 1.0}
_SMALL_SENSOR, _SHORT_LENS = 6.0, 12.0  # mm
_FULL_FRAME = 36.0  # mm, the longer side to which FocalLengthIn35mmFilm refers

# Image.open would refuse above 179 million pixels what our own limits allow; these read the header alone.
_OPENERS = {"JPEG": JpegImagePlugin.JpegImageFile, "PNG": PngImagePlugin.PngImageFile}
# Of tags with more values than they should have, none of which is read here; and of animations, which are not read.
_HARMLESS = ("Metadata Warning", "Invalid APNG")
_PILLOW = os.path.dirname(PIL.__file__)
_HEARING = threading.Lock()  # what is heard of warnings is one list of the whole process


def tags(path: str | os.PathLike[str], kind: str) -> dict[int, object]:
    """All tags of a JPEG, PNG, TIFF or raw TIFF by number, those of the EXIF folder among them.

    Warns where they are damaged; what is not is still told.
    """
    damage: list[str] = []
    found: dict[int, object] = {}
    try:
        with heard(damage), open(path, "rb") as file:
            if kind in _OPENERS:
                with _OPENERS[kind](file) as image:
                    # The base class's method: that of PNG decodes the whole picture in search of a late chunk.
                    exif = Image.Image.getexif(image)
            else:  # only the tags: Pillow tells of pixels it could not decode on the error output
                exif = _of_tiff(file)
            found.update(exif)
            found.update(exif.get_ifd(_EXIF_IFD))
    except Exception as error:  # Pillow raises SyntaxError, struct.error, KeyError and others for damaged tags
        warnings.warn(f"{path}: its EXIF cannot be read ({one_line(error)}); exposure unknown", stacklevel=4)
        return {}
    if damage:
        warnings.warn(f"{path}: its EXIF is damaged ({one_line(damage[0])}); exposure may be missing", stacklevel=4)
    return found


def _of_tiff(file: BinaryIO) -> Image.Exif:
    exif = Image.Exif()
    head = file.read(16)
    order = "little" if head[:2] == b"II" else "big"
    if int.from_bytes(head[2:4], order) == 43:
        exif.endian, exif.bigtiff = "<" if order == "little" else ">", True
        exif.load_from_fp(file, int.from_bytes(head[8:16], order))
    else:
        file.seek(0)
        exif.load_from_fp(file)
    return exif


def exposure_of(tags: dict[int, object]) -> Exposure | None:
    """Shutter, aperture and ISO; None where the exposure time is missing or no positive number."""
    seconds = _positive(tags, _EXPOSURE_TIME)
    iso = _positive(tags, _ISO)
    if iso == 65535:  # the 16-bit tag is full: the true value stands beside it
        iso = _positive(tags, _ISO_SPEED) or _positive(tags, _EXPOSURE_INDEX) or iso
    return Exposure(seconds, _positive(tags, _F_NUMBER), iso, "EXIF") if seconds else None


def settings_of(tags: dict[int, object]) -> Settings:
    """When and how else the photograph was made; None for each thing that is missing or senseless."""
    white = tags.get(_WHITE_BALANCE)
    return Settings(
        taken=_taken(tags),
        automatic_white={0: True, 1: False}.get(white) if isinstance(white, int) else None,
        bias=_number(tags, _BIAS),
        lens=_text(tags, _LENS) or None,
        serial=_text(tags, _SERIAL) or None,
        focal_length=_positive(tags, _FOCAL_LENGTH),
    )


def shutter_speed_of(tags: dict[int, object]) -> float | None:
    """ShutterSpeedValue, −log₂ of the exposure time in seconds (APEX); None where it is missing."""
    return _number(tags, _SHUTTER_SPEED)


def camera_of(tags: dict[int, object]) -> str:
    """Make and model, the make once where the model repeats it; "" where unknown."""
    make, model = _text(tags, _MAKE), _text(tags, _MODEL)
    return model if model.startswith(make) else f"{make} {model}".strip()


def focal_length_of(tags: dict[int, object], width: int, height: int) -> float | None:
    """Focal length in pixels of a picture of that size, None where the tags do not tell it.

    FocalLengthIn35mmFilm comes first: it survives resizing. It is an integer, so where FocalLength rounds to it the
    camera is full-frame and the finer FocalLength is meant. FocalPlaneXResolution counts pixels of the sensor, and
    editors keep it when they resize (a 640-pixel copy would come out 8 times too long); so it is believed only where
    the maker's note is still there, the recorded width is this file's, and the sensor it makes is no telephone's behind
    a lens of a big camera.
    """
    focal, focal_35mm = _positive(tags, _FOCAL_LENGTH), _positive(tags, _FOCAL_LENGTH_35MM)
    if focal_35mm:
        finer = focal if focal and round(focal) == focal_35mm else focal_35mm
        return finer / _FULL_FRAME * max(width, height)
    resolution = _positive(tags, _PLANE_RESOLUTION)
    if focal and resolution and _MAKER_NOTE in tags and tags.get(_PIXEL_WIDTH) == width:
        per_millimetre = resolution / _MILLIMETRES.get(int(_positive(tags, _PLANE_UNIT) or 2), 25.4)
        if width / per_millimetre >= _SMALL_SENSOR or focal <= _SHORT_LENS:
            return focal * per_millimetre
    return None


def orientation_of(tags: dict[int, object]) -> int:
    """The EXIF orientation, 1 to 8; 1, upright, where it is missing or senseless."""
    value = int(_positive(tags, _ORIENTATION) or 1)
    return value if value in range(1, 9) else 1


def encoded(photograph: Photograph) -> bytes:
    """EXIF of a photograph's exposure, settings, camera and focal length, such that reading gives the same again.

    Raises ValueError for an ISO that is no whole number: the tag holds none.
    """
    return _exif_of(photograph).tobytes()


def folders(photograph: Photograph) -> tuple[Tags, Tags]:
    """As `encoded`, the tags of a TIFF's own folder and those of its EXIF folder."""
    exif = _exif_of(photograph)
    main = {tag: _typed(tag, value) for tag, value in exif.items() if tag != _EXIF_IFD}
    return main, {tag: _typed(tag, value) for tag, value in exif.get_ifd(_EXIF_IFD).items()}


def _typed(tag: int, value: object) -> tuple[int, list[float] | bytes]:
    """A value with its TIFF type: text, signed or unsigned rational, or whole number."""
    if isinstance(value, IFDRational):
        return 10 if tag == _BIAS else 5, [int(value.numerator), int(value.denominator)]
    if isinstance(value, int):
        return (3, [value]) if value < 2**16 else (4, [value])
    return 2, str(value).encode() + b"\0"


def _exif_of(photograph: Photograph) -> Image.Exif:
    """The tags of a photograph.

    Where the focal length in pixels is known the file tells that of a full-frame camera of the same view, in place of
    `Settings.focal_length`: only so does it keep more than its two leading digits.
    """
    exif = Image.Exif()
    make, _, model = photograph.camera.partition(" ")
    exif.update({tag: text for tag, text in ((_MAKE, make), (_MODEL, model)) if text})
    folder = exif.get_ifd(_EXIF_IFD)
    if exposure := photograph.exposure:
        folder[_EXPOSURE_TIME] = _rational(exposure.seconds)
        if exposure.f_number is not None:
            folder[_F_NUMBER] = _rational(exposure.f_number)
        if exposure.iso is not None:
            if exposure.iso != int(exposure.iso):
                raise ValueError(f"iso is {exposure.iso}; EXIF holds whole numbers only: round it first")
            folder[_ISO] = min(int(exposure.iso), 65535)
            if exposure.iso >= 65535:
                folder[_ISO_SPEED] = int(exposure.iso)
    _encode_settings(folder, photograph.settings)
    if photograph.focal_length is not None:
        millimetres = photograph.focal_length * _FULL_FRAME / max(photograph.size)
        folder[_FOCAL_LENGTH] = _rational(millimetres)
        folder[_FOCAL_LENGTH_35MM] = round(millimetres)
    return exif


@contextmanager
def heard(damage: list[str]) -> Iterator[None]:
    """Add what Pillow warns of to `damage`, but for what does no harm; warnings of others meanwhile are passed on."""
    caught: list[warnings.WarningMessage] = []
    try:
        with _HEARING, warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield
    finally:
        for warning in caught:
            text = str(warning.message)
            if not warning.filename.startswith(_PILLOW):
                warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
            elif not text.startswith(_HARMLESS):
                damage.append(text)


def _encode_settings(folder: dict[int, object], settings: Settings) -> None:
    if settings.taken is not None:
        folder[_TAKEN] = settings.taken.strftime("%Y:%m:%d %H:%M:%S")
        if settings.taken.microsecond:
            folder[_TAKEN_FRACTION] = f"{settings.taken.microsecond:06d}".rstrip("0")
    if settings.automatic_white is not None:
        folder[_WHITE_BALANCE] = 0 if settings.automatic_white else 1
    if settings.bias is not None:
        folder[_BIAS] = IFDRational(Fraction(settings.bias).limit_denominator(1000))
    folder.update({tag: text for tag, text in ((_LENS, settings.lens), (_SERIAL, settings.serial)) if text})
    if settings.focal_length is not None:
        folder[_FOCAL_LENGTH] = _rational(settings.focal_length)


def _taken(tags: dict[int, object]) -> datetime | None:
    try:
        taken = datetime.strptime(_text(tags, _TAKEN), "%Y:%m:%d %H:%M:%S")
    except ValueError:  # cameras without a clock write blanks or zeros
        return None
    # The digits stand behind the decimal point: "02" is two hundredths.
    digits = _text(tags, _TAKEN_FRACTION)
    return taken.replace(microsecond=int(f"{digits[:6]:0<6}")) if digits.isdecimal() else taken


def _text(tags: dict[int, object], tag: int) -> str:
    return str(tags.get(tag, "")).strip("\0 ")


def _number(tags: dict[int, object], tag: int) -> float | None:
    value = tags.get(tag)
    if isinstance(value, tuple) and value:
        value = value[0]
    try:
        number = float(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) else None


def _positive(tags: dict[int, object], tag: int) -> float | None:
    number = _number(tags, tag)
    return number if number is not None and number > 0 else None


def _rational(value: float) -> IFDRational:
    """The fraction nearest to `value` whose terms fit 32 bits, so that 1/60 s is written as 1/60."""
    fraction = Fraction(value).limit_denominator(max(1, int(2**31 / max(1.0, value))))
    return IFDRational(fraction.numerator, fraction.denominator)
