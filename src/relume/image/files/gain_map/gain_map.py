"""JPEGs with a gain map: an ordinary picture that every program shows, and beside it what makes it radiance.

Ultra HDR 1.1 (parameters in XMP) and ISO 21496-1 (a binary block), read and written. They are graded for a display:
their light is read at full strength, relative to the base's white, and marked as `rendition: display`. Files in which
relume once wrote radiance carry the factor that it was multiplied by, and give it back.

libultrahdr 1.4 (imagecodecs) reads a phone's file alike (99 of 100 pixels within 2 %), and refuses one of Adobe's,
whose base has no hdrgm:Version; so the reader is our own.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

import numpy as np

from relume.errors import FormatError, UnreadableFile, warn
from relume.image.files.atomic import replacing
from relume.image.files.gain_map import layout as gain_map_layout
from relume.image.files.gain_map.layout import Layout
from relume.image.files.gain_map.metadata import LARGEST_SCALE, SCALE, UNIT
from relume.image.files.metadata import xmp
from relume.image.files.photographs import jpeg_segments
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount, refuse_absurd_size
from relume.image.radiance import RadianceMap

_APPLE = b"http://ns.apple.com/HDRGainMap/"
"""The namespace in the XMP of the second picture of a telephone's JPEG, whose range its maker's note holds."""
_PICTURES = ("base picture", "gain map")


def is_present(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a JPEG that has, or claims, a gain map, by headers alone; never raises."""
    try:
        with open(path, "rb") as file:
            return gain_map_layout.located(path, file, ReadOptions()) is not None
    except FormatError as error:
        return error.format == gain_map_layout.FORMAT
    except Exception:  # whatever a file does; reading it says what is wrong
        return False


def has_any(path: str | os.PathLike[str]) -> bool:
    """Whether a JPEG has a gain map of any kind, also Apple's own, which `read` does not read; never raises."""
    try:
        return is_present(path) or _APPLE in Path(path).read_bytes()
    except OSError:
        return False


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """A few words: "gain map of 2.2 stops, XMP, grey, 1020 x 768"; raises UnreadableFile."""
    with open(path, "rb") as file:
        layout = _layout(path, file, options)
    stops = max(layout.metadata.high)
    colours = "grey" if layout.map.channels == 1 else "colour"
    return f"gain map of {stops:.1f} stops, {layout.form}, {colours}, {layout.map.width} x {layout.map.height}"


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RadianceMap:
    """The bright picture of a JPEG with a gain map, upright, in Rec. 709 primaries, 1 = the base's white.

    Of a file in which relume wrote radiance it is that, in its unit. Warns of a file made for displays, of other
    primaries, and of a profile that is not understood, which is taken for sRGB.
    Raises UnreadableFile for a file without a gain map, damaged ones, and those whose base is the bright picture: that
    has a curve which 8 bits of sRGB are not.
    """
    with open(path, "rb") as file:
        layout = _layout(path, file, options)
        headers = (layout.base, layout.map)
        ends = (layout.base_end, layout.map_end)
        for header, end, what in zip(headers, ends, _PICTURES, strict=True):
            _refuse_unusable(path, header, end - header.begin, f"its {what}", options)
        jpegs = [_bytes(file, header, end) for header, end in zip(headers, ends, strict=True)]
    own = _own(layout.packet, options)
    if any(header.stray for header in headers):
        warn(f"{path}: has stray bytes among its headers; look whether the picture is whole")
    # Only now: these load libraries, and a header that claims too much is refused before.
    from relume.image.files.gain_map import applying as gain_map_applying
    from relume.image.files.metadata import exif, exif_attributes
    from relume.image.files.photographs import jpeg_decoding
    from relume.image.files.tiff.layout import upright
    from relume.image.primaries import REC709

    codes = [jpeg_decoding.decoded(path, *one) for one in zip(jpegs, headers, _PICTURES, strict=True)]
    del jpegs
    given = gain_map_applying.pictures(
        path, codes[0], codes[1], layout.metadata, layout.base.profile, layout.map.profile
    )
    radiance = gain_map_applying.bright(given)
    tags = exif.tags(path, "JPEG") if layout.base.first(jpeg_segments.APP1, jpeg_segments.EXIF) else {}
    attributes = {**exif_attributes.attributes_of(tags), **own}
    scale, unit = attributes.pop(SCALE, None), attributes.pop(UNIT, "relative")
    if scale is None:
        attributes["rendition"] = "display"
        unit = "relative"
        warn(f"{path}: made for displays, its light is not measured")
    else:
        radiance /= np.float32(scale)
    if not given.gain_primaries.is_close(REC709):
        attributes["primaries"] = given.gain_primaries.text
        warn(
            f"{path}: its primaries are {given.gain_primaries.text} (x, y of R, G, B, white); converted to Rec. 709",
            0.0,
        )
    del codes, given
    return RadianceMap(upright(radiance, exif.orientation_of(tags)), unit=unit, attributes=attributes)


def write_rendition(path: str | os.PathLike[str], bright: np.ndarray, base: np.ndarray, quality: int = 95) -> None:
    """Write a JPEG of a picture made for displays, with a gain map from it to the same for brighter ones.

    bright : (H, W, 3) float32, linear Rec. 709, 1 = the base's white, finite and at least 0
    base : (H, W, 3) uint8 sRGB

    Warns where more than 5 % of the bright one's luminance is lost in 1 pixel of 100.
    Raises ValueError for a size that no JPEG has, OutputNotWritten.
    """
    from relume.image.files.gain_map import encoding as gain_map_encoding

    data, losses = gain_map_encoding.encoded_rendition(path, bright, base, quality)
    with replacing(path) as temporary:
        temporary.write_bytes(data)
    if losses:
        warn(f"{path}: {losses}")


def _layout(path: str | os.PathLike[str], file: BinaryIO, options: ReadOptions) -> Layout:
    layout = gain_map_layout.located(path, file, options)
    if layout is None:
        raise UnreadableFile(f"{path}: a JPEG without a gain map, so a photograph; merge a bracket for radiance")
    if layout.metadata.base_is_bright:
        raise UnreadableFile(
            f"{path}: its base is the picture for bright displays and its gain map leads down from it, which relume "
            "does not read; export it with a base for ordinary displays"
        )
    return layout


def _refuse_unusable(
    path: str | os.PathLike[str], header: jpeg_segments.Header, stored: int, what: str, options: ReadOptions
) -> None:
    """Raise UnreadableFile where one of the JPEGs is too large, or neither grey nor of three channels."""
    refuse_absurd_size(path, header.width, header.height, options, where=what)
    refuse_absurd_amount(path, header.width * header.height * 12, stored, options)  # as three floats
    if header.channels not in (1, 3):
        raise UnreadableFile(f"{path}: {what} has {header.channels} channels, not 1 or 3; convert it to RGB")


def _bytes(file: BinaryIO, header: jpeg_segments.Header, end: int) -> bytes:
    """One JPEG of the file; of a file with other things behind it, no more than it can need."""
    file.seek(header.begin)
    return file.read(min(end - header.begin, jpeg_segments.most_bytes(header)))


def _own(packet: bytes | None, options: ReadOptions) -> dict[str, str]:
    """The attributes of a file of ours; none where the packet is damaged or its scale makes no sense."""
    try:
        own = xmp.attributes(packet, options) if packet is not None else {}
        known = own.get(UNIT) in ("relative", "cd/m²")
        if SCALE in own and not (known and 1 / LARGEST_SCALE <= float(own[SCALE]) <= LARGEST_SCALE):
            return {}
    except ValueError:
        return {}
    return own
