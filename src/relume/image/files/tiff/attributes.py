"""The metadata of a TIFF of radiance: attributes, primaries and unit, and the tags that hold them.

Attributes that have a tag of TIFF or EXIF go there, for other programs; all that a tag does not give back to the last
letter goes into an XMP packet too, under "relume:", and comes back from there.
"""

from __future__ import annotations

import os
from typing import BinaryIO

from relume.errors import FormatError, warn
from relume.image.files.metadata import attributes as names
from relume.image.files.metadata import gps, xmp
from relume.image.files.metadata.exif_attributes import (
    ASCII,
    RATIONAL,
    is_of_exif,
    position_in,
    rationals,
    text_of,
    value_of,
)
from relume.image.files.read_options import ReadOptions
from relume.image.files.tiff.directories import Folder, folder_at
from relume.image.files.tiff.writing import EXIF_FOLDER, Tags
from relume.image.primaries import REC709, Primaries
from relume.image.radiance import RadianceMap

WHITE_POINT, PRIMARIES, XMP, STONITS = 318, 319, 700, 37439
_BYTE, _DOUBLE = 1, 12


def tags_of(image: RadianceMap) -> tuple[Tags, Tags]:
    """The tags of a map's unit, primaries and attributes: those of its folder, and those of its EXIF folder."""
    main: dict[int, tuple[int, list[float] | bytes] | Tags] = {
        names.EXIF["software"]: (ASCII, b"relume\0"),
        WHITE_POINT: (RATIONAL, rationals(REC709.white)),
        PRIMARIES: (RATIONAL, rationals((*REC709.red, *REC709.green, *REC709.blue))),
    }
    if image.unit == "cd/m²":
        main[STONITS] = (_DOUBLE, [1.0])
    exif: dict[int, tuple[int, list[float] | bytes] | Tags] = {}
    position = gps.of_texts(image.attributes)
    if position:
        main[gps.FOLDER] = gps.tags_of(**position)
    rest = {}
    for name, text in image.attributes.items():
        tag, value = names.EXIF.get(name, 0), value_of(name, text)
        if tag and value is not None:
            (exif if is_of_exif(tag) else main)[tag] = value
        if name in position and gps.text_of(position[name]) == text:
            continue
        if not tag or value is None or text_of(name, value[1]) != text:
            rest[name] = text
    if rest:
        main[XMP] = (_BYTE, xmp.packet(rest))
    return main, exif


def attributes_of(
    path: str | os.PathLike[str], file: BinaryIO, folder: Folder, options: ReadOptions = ReadOptions()
) -> dict[str, str]:
    """The attributes in a TIFF that is open; warns where its EXIF or XMP is damaged and left out."""
    exif = _folder_of(path, file, folder, EXIF_FOLDER, "EXIF", options)
    position = _folder_of(path, file, folder, gps.FOLDER, "GPS position", options)
    found = {}
    for name, tag in names.EXIF.items():
        source = exif if is_of_exif(tag) and exif is not None else folder
        text = text_of(name, source.values.get(tag, ()))
        if text and (name, text) != ("software", "relume"):
            found[name] = text
    if position is not None:
        found |= position_in(position.values)
    return found | _in_packet(path, folder, options)


def _folder_of(
    path: str | os.PathLike[str], file: BinaryIO, folder: Folder, tag: int, what: str, options: ReadOptions
) -> Folder | None:
    """The folder to which a tag leads; None where there is none or, with a warning, a damaged one."""
    if places := folder.integers(tag):
        try:
            return folder_at(path, file, places[0], options)
        except FormatError as error:
            warn(f"{path}: its {what} is left out: {error.where} is damaged")
    return None


def primaries_of(path: str | os.PathLike[str], folder: Folder) -> Primaries:
    """The primaries that a TIFF names, those of Rec. 709 where it names none; warns where they make no sense."""
    corners, white = folder.values.get(PRIMARIES, ()), folder.values.get(WHITE_POINT, ())
    if isinstance(corners, bytes) or len(corners) != 6:
        return REC709
    try:
        return Primaries.of((*corners, *(white if len(white) == 2 else REC709.white)))
    except ValueError as error:
        warn(f"{path}: {error}; taken for Rec. 709")
        return REC709


def scale_of(path: str | os.PathLike[str], folder: Folder) -> float | None:
    """The luminance of RGB (1, 1, 1), cd/m², in STONITS; None where it is missing. Raises FormatError."""
    if STONITS not in folder.values:
        return None
    scale = folder.number(STONITS)
    if scale is None or not 0 < scale < float("inf"):
        raise FormatError(path, "TIFF", f"tag {STONITS} (STONITS)", "a luminance above 0", str(scale))
    return scale


def _in_packet(path: str | os.PathLike[str], folder: Folder, options: ReadOptions) -> dict[str, str]:
    packet = folder.values.get(XMP, ())
    packet = packet if isinstance(packet, bytes) else bytes(int(byte) & 0xFF for byte in packet)
    if not packet:
        return {}
    try:
        return xmp.attributes(packet, options)
    except ValueError as error:
        warn(f"{path}: {error}; its attributes are left out")
        return {}
