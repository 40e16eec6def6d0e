"""What a photograph's EXIF holds: exposure, settings, camera, orientation; read through Pillow.

Pillow and not OpenImageIO, because it keeps rationals exact (OpenImageIO hands 1/60 over as a 32-bit float, and a
bracket written and read again would change its exposures). `exif_attributes` writes the same tags. Tags and units: EXIF
2.32 (CIPA DC-008).
"""

from __future__ import annotations

import math
import os
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import TYPE_CHECKING, BinaryIO

import PIL

from relume.errors import warn
from relume.image.files.metadata import exif_attributes, gps
from relume.image.files.metadata.attributes import EXIF
from relume.image.files.metadata.exif_attributes import letters
from relume.image.files.signatures import one_line
from relume.image.photograph import Exposure, Settings, named

if TYPE_CHECKING:
    from PIL import Image

# Pillow's parts are loaded where they are used: whoever writes a photograph, or reads no EXIF, needs none of them.

ORIENTATION, _EXIF_IFD, _EXPOSURE_INDEX, _SHUTTER_SPEED = 0x0112, 0x8769, 0x8832, 0x9201
_MAKER_NOTE, _PLANE_RESOLUTION, _PLANE_UNIT = 0x927C, 0xA20E, 0xA210
_PIXEL_WIDTH, _PIXEL_HEIGHT, _COLOUR_SPACE = 0xA002, 0xA003, 0xA001
INTEROPERABILITY = 0xA005
"""The folder that names the rules a file follows, R98 for sRGB and R03 for Adobe RGB (CIPA DC-008, 4.6.8)."""
_MARGINS = 0.02  # of a side: pixels at the sensor's rim that one program shows and another does not
_MILLIMETRES = {2: 25.4, 3: 10.0, 4: 1.0}
_SMALL_SENSOR, _SHORT_LENS = 6.0, 12.0  # mm

# Of tags with more values than they should have, none of which is read here; and of animations, which are not read.
_HARMLESS = ("Metadata Warning", "Invalid APNG")
_PILLOW = os.path.dirname(PIL.__file__)
_HEARING = threading.Lock()  # what is heard of warnings is one list of the whole process


def tags(path: str | os.PathLike[str], kind: str) -> dict[int, object]:
    """All tags of a JPEG, PNG, TIFF or raw TIFF by number, those of the EXIF folder among them.

    The values of `gps.FOLDER` and of INTEROPERABILITY are those folders, tags by number. Texts are read as UTF-8, where
    they are none as Latin-1. Warns where they are damaged, and returns the others.
    """

    def opened(found: dict[int, object], damage: list[str]) -> None:
        with open(path, "rb") as file:
            if kind in ("JPEG", "PNG"):
                from PIL import Image

                with _opened(file, kind) as image:
                    # The base class's method: that of PNG decodes the whole picture in search of a late chunk.
                    _collect(Image.Image.getexif(image), found, damage)
            else:  # only the tags: Pillow prints about pixels it cannot decode
                _collect(_of_tiff(file), found, damage)

    return _gathered(path, opened)


def _opened(file: BinaryIO, kind: str) -> Image.Image:
    """A JPEG or a PNG, its header alone. Image.open would refuse above 179 million pixels what our limits allow."""
    if kind == "JPEG":
        from PIL.JpegImagePlugin import JpegImageFile

        return JpegImageFile(file)
    from PIL.PngImagePlugin import PngImageFile

    return PngImageFile(file)


def tags_in(path: str | os.PathLike[str], block: bytes) -> dict[int, object]:
    """As `tags`, of the block of EXIF that a decoder found in a file; none where it is empty."""

    def opened(found: dict[int, object], damage: list[str]) -> None:
        from PIL import Image

        exif = Image.Exif()
        exif.load(block)
        _collect(exif, found, damage)

    return _gathered(path, opened) if block else {}


def _gathered(
    path: str | os.PathLike[str], opened: Callable[[dict[int, object], list[str]], None]
) -> dict[int, object]:
    damage: list[str] = []
    found: dict[int, object] = {}
    try:
        with heard(damage):
            opened(found, damage)
    except Exception as error:  # Pillow raises SyntaxError, struct.error, KeyError and others for damaged tags
        warn(f"{path}: its EXIF cannot be read ({one_line(error)}); exposure unknown")
        return {}
    if damage:
        warn(f"{path}: its EXIF is damaged ({one_line(damage[0])}); exposure may be missing")
    # Pillow takes every byte for a letter of Latin-1, so that none is lost.
    return {tag: letters(v.encode("latin-1", "replace")) if isinstance(v, str) else v for tag, v in found.items()}


def _collect(exif: Image.Exif, found: dict[int, object], damage: list[str]) -> None:
    found.update(exif)
    found.update(exif.get_ifd(_EXIF_IFD))
    if gps.FOLDER in exif:
        found[gps.FOLDER] = _folder_in(exif, gps.FOLDER, damage)
    if INTEROPERABILITY in found:
        found[INTEROPERABILITY] = _folder_in(exif, INTEROPERABILITY, damage)


def _folder_in(exif: Image.Exif, folder: int, damage: list[str]) -> dict[int, object]:
    """A folder of its own; a damaged one costs no other tag."""
    try:
        return exif.get_ifd(folder)
    except Exception as error:  # as in `_gathered`
        damage.append(one_line(error))
        return {}


def _of_tiff(file: BinaryIO) -> Image.Exif:
    from PIL import Image

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
    seconds = _positive(tags, EXIF["exposure_time"])
    iso = _positive(tags, EXIF["iso"])
    if iso == 65535:  # the 16-bit tag is full: the true value stands beside it
        iso = _positive(tags, exif_attributes.ISO_SPEED) or _positive(tags, _EXPOSURE_INDEX) or iso
    return Exposure(seconds, _positive(tags, EXIF["f_number"]), iso, "EXIF") if seconds else None


def settings_of(tags: dict[int, object]) -> Settings:
    """When and how else the photograph was made; None for each thing that is missing or senseless."""
    white, place = tags.get(exif_attributes.WHITE_BALANCE), tags.get(gps.FOLDER)
    position = gps.position_of(place) if isinstance(place, dict) else {}
    return Settings(
        taken=_taken(tags),
        automatic_white={0: True, 1: False}.get(white) if isinstance(white, int) else None,
        bias=_number(tags, exif_attributes.BIAS),
        lens=_text(tags, EXIF["lens"]) or None,
        serial=_text(tags, EXIF["serial"]) or None,
        focal_length=_positive(tags, EXIF["focal_length"]),
        make=_text(tags, EXIF["camera_make"]) or None,
        model=_text(tags, EXIF["camera"]) or None,
        owner=_text(tags, EXIF["owner"]) or None,
        copyright=_text(tags, EXIF["copyright"]) or None,
        comments=_text(tags, EXIF["comments"]) or None,
        latitude=position.get("latitude"),
        longitude=position.get("longitude"),
    )


def shutter_speed_of(tags: dict[int, object]) -> float | None:
    """ShutterSpeedValue, −log₂ of the exposure time in seconds (APEX); None where it is missing."""
    return _number(tags, _SHUTTER_SPEED)


def camera_of(tags: dict[int, object]) -> str:
    """Make and model, the make once where the model repeats it; "" where unknown."""
    return named(_text(tags, EXIF["camera_make"]), _text(tags, EXIF["camera"]))


def focal_length_of(tags: dict[int, object], width: int, height: int) -> float | None:
    """Focal length in pixels of a picture of that size, None where the tags do not give it.

    FocalLengthIn35mmFilm comes first: it survives resizing. It is an integer, so where FocalLength rounds to it the
    camera is full-frame and the finer FocalLength is meant. FocalPlaneXResolution counts pixels of the sensor, and
    editors keep it when they resize (a 640-pixel copy would come out 8 times too long); so it is believed only where
    the maker's note is still there, the recorded width is this file's or that of what it was cropped from, and the
    sensor it makes is no telephone's behind a lens of a big camera. Both are of the whole picture: see `whole_size`.
    """
    focal, focal_35mm = _positive(tags, EXIF["focal_length"]), _positive(tags, exif_attributes.FOCAL_LENGTH_35MM)
    if (whole := whole_size(tags, width, height)) is None:
        return None
    if focal_35mm:
        finer = focal if focal and round(focal) == focal_35mm else focal_35mm
        return finer / exif_attributes.FULL_FRAME * max(whole)
    resolution = _positive(tags, _PLANE_RESOLUTION)
    if focal and resolution and _MAKER_NOTE in tags and tags.get(_PIXEL_WIDTH) in (width, whole[0]):
        per_millimetre = resolution / _MILLIMETRES.get(int(_positive(tags, _PLANE_UNIT) or 2), 25.4)
        if whole[0] / per_millimetre >= _SMALL_SENSOR or focal <= _SHORT_LENS:
            return focal * per_millimetre
    return None


def whole_size(tags: dict[int, object], width: int, height: int) -> tuple[int, int] | None:
    """Width and height of the picture of which one of that size is all or a crop, in pixels of this one.

    Editors that crop leave PixelXDimension and PixelYDimension as the camera wrote them, or write the crop's. Where
    both are of another shape, and the file's fit into them, it was cropped from them. Of their shape it was resized,
    and is whole: nobody can see of a crop of the same shape that it is one. None for a picture that is larger in one
    direction than its camera's: stitched, or set into another.
    """
    recorded = [int(_positive(tags, tag) or 0) for tag in (_PIXEL_WIDTH, _PIXEL_HEIGHT)]
    if min(recorded) < 1:
        return width, height
    # Some programs turn the pixels and leave the tags, or the other way round.
    shapes = [(recorded[0], recorded[1]), (recorded[1], recorded[0])]
    for across, down in shapes:
        margins = abs(width / across - 1) < _MARGINS and abs(height / down - 1) < _MARGINS
        if margins or abs(width * down - height * across) <= max(across, down):
            return width, height
    return next((shape for shape in shapes if shape[0] >= width and shape[1] >= height), None)


def uncropped_of(tags: dict[int, object], width: int, height: int) -> tuple[int, int] | None:
    """The size of the picture from which one of that size was cropped; None where it was not, or nothing says so."""
    whole = whole_size(tags, width, height)
    return None if whole == (width, height) else whole


def is_adobe_rgb(tags: dict[int, object]) -> bool:
    """Whether EXIF names Adobe RGB (1998): by InteroperabilityIndex R03 (CIPA DC-008, 4.6.8), or by ColorSpace 2.

    The latter is in no standard, but some cameras and Windows write it.
    """
    folder = tags.get(INTEROPERABILITY)
    index = folder.get(1) if isinstance(folder, dict) else None
    named = index.strip("\0 ") if isinstance(index, str) else ""
    return named == "R03" or tags.get(_COLOUR_SPACE) == 2


def orientation_of(tags: dict[int, object]) -> int:
    """The EXIF orientation, 1 to 8; 1, upright, where it is missing or senseless."""
    value = int(_positive(tags, ORIENTATION) or 1)
    return value if value in range(1, 9) else 1


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


def _taken(tags: dict[int, object]) -> datetime | None:
    try:
        taken = datetime.strptime(_text(tags, EXIF["taken"]), "%Y:%m:%d %H:%M:%S")
    except ValueError:  # cameras without a clock write blanks or zeros
        return None
    # The digits stand behind the decimal point: "02" is two hundredths.
    digits = _text(tags, exif_attributes.TAKEN_FRACTION)
    return taken.replace(microsecond=int(f"{digits[:6]:0<6}")) if digits.isdecimal() else taken


def _text(tags: dict[int, object], tag: int) -> str:
    text = str(tags.get(tag, "")).strip("\0 ")
    # Photographer and editor, a NUL between them (CIPA DC-008, 4.6.4).
    return "; ".join(filter(None, (part.strip() for part in text.split("\0")))) if tag == EXIF["copyright"] else text


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
