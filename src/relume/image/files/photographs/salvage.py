"""What is left of a JPEG, PNG or TIFF that ends early: the rows that are there, where these are known for certain."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relume.errors import FormatError, UnreadableFile
from relume.image.files.photographs import png
from relume.image.files.photographs.form import Form
from relume.image.files.read_options import ReadOptions
from relume.image.files.signatures import one_line
from relume.image.files.tiff.directories import read_folders
from relume.image.files.tiff.layout import NONE
from relume.image.files.tiff.samples import pieces

if TYPE_CHECKING:
    import OpenImageIO as oiio

PROFILE = 34675  # ICC.1:2022, B.3
_CUT_JPEG = "Premature end of JPEG file"


@dataclass(frozen=True, eq=False)
class Salvaged:
    """The rows from the top that a file holds.

    pixels : (rows, W, channels) uint8 or uint16
    height : of the whole picture
    profile : the ICC profile, None where there is none
    """

    pixels: np.ndarray
    height: int
    profile: bytes | None = None


def salvaged(path: str | os.PathLike[str], kind: str, form: Form, options: ReadOptions) -> Salvaged | None:
    """The rows of a photograph that ends early; None of one that does not, which is read as any other.

    Raises UnreadableFile where no row is there, or unknown which are: a progressive JPEG, an interlaced PNG.
    """
    found = {"JPEG": _jpeg, "PNG": _png, "TIFF": _tiff}[kind](path, form, options)
    if found is not None and not len(found.pixels):
        raise UnreadableFile(f"{path}: ends before its first rows are whole; copy it again from where it came")
    return found


def _jpeg(path: str | os.PathLike[str], form: Form, options: ReadOptions) -> Salvaged | None:
    """Row after row, until the decoder says that the data is at its end.

    It says so when it asks for data that is not there, before it makes a row of what it fills in.
    """
    data = Path(path).read_bytes()
    if form.gain_map or b"\xff\xd9" in data[-1024:]:
        return None
    if form.packing:
        raise _unknown_rows(path, "a progressive JPEG")
    source = opened(path, "picture")
    try:
        spec = source.spec()
        rows = []
        for y in range(spec.height):
            row = source.read_scanline(y, 0, spec.format)
            complaint = source.geterror()
            if row is None or complaint:
                if complaint and _CUT_JPEG not in complaint:
                    return None  # damaged otherwise too: refused as any other
                break
            rows.append(row.reshape(spec.width, spec.nchannels))
    finally:
        source.close()
    pixels = np.array(rows).reshape(len(rows), form.width, -1 if rows else 3)
    return Salvaged(pixels, form.height, embedded_profile(spec))


def _png(path: str | os.PathLike[str], form: Form, options: ReadOptions) -> Salvaged | None:
    """What the data inflates to, as far as it goes."""
    header, chunks = png.header(path), png.chunks(path)
    if chunks.end is None:
        return None
    if header.interlaced:
        raise _unknown_rows(path, "an interlaced PNG")
    rows = png.whole_rows(path, header, chunks)
    return None if rows is None else Salvaged(rows, form.height, png.profile(chunks, options))


def _tiff(path: str | os.PathLike[str], form: Form, options: ReadOptions) -> Salvaged | None:
    layout = form.layout
    assert layout is not None
    rows = layout.rows_within(os.path.getsize(path))
    if rows == form.height:
        return None
    folder = read_folders(path, options)[0]
    profile = folder.values.get(PROFILE)
    profile = profile if isinstance(profile, bytes) else None
    plain = layout.sample_format == 1 and layout.bits in (8, 16) and layout.photometric in (1, 2)
    if plain and layout.compression == NONE:
        pixels = np.empty((rows, form.width, form.channels), f"u{layout.bits // 8}")
        for piece in pieces(path, folder.order, layout, rows):
            deep, wide, samples = piece.values.shape
            target = pixels[piece.top : piece.top + deep, piece.left : piece.left + wide]
            target[..., piece.first : piece.first + samples] = piece.values
        return Salvaged(pixels, form.height, profile)
    return Salvaged(_rows(path, rows // layout.block[1] * layout.block[1]), form.height, profile)


def _rows(path: str | os.PathLike[str], count: int) -> np.ndarray:
    """The upper rows of a TIFF, (count, W, channels) uint8 or uint16."""
    import OpenImageIO as oiio

    source = opened(path, "picture")
    try:
        spec = source.spec()
        if spec.format not in (oiio.UINT8, oiio.UINT16):
            raise UnreadableFile(f"{path}: has pixels of {spec.format}, not 8 or 16 bits; convert it to EXR")
        if not count:
            return np.empty((0, spec.width, spec.nchannels), np.uint8)
        if spec.tile_width:
            read = source.read_tiles(0, spec.width, 0, count, 0, 1, 0, spec.nchannels, spec.format)
        else:
            read = source.read_scanlines(0, count, 0, 0, spec.nchannels, spec.format)
        complaint = one_line(source.geterror())
    finally:
        source.close()
    if read is None or complaint:
        raise FormatError(path, "picture", f"rows 0 to {count - 1}", "whole data", complaint or "none")
    return read.reshape(count, spec.width, spec.nchannels)


def embedded_profile(spec: oiio.ImageSpec) -> bytes | None:
    """The ICC profile of a file that OpenImageIO has opened, None where it has none."""
    found = spec.getattribute("ICCProfile")
    return None if found is None else np.asarray(found, np.uint8).tobytes()


def opened(path: str | os.PathLike[str], kind: str) -> oiio.ImageInput:
    """A file as OpenImageIO decodes it; raises FormatError where it does not."""
    import OpenImageIO as oiio

    wanted = oiio.ImageSpec()
    wanted.attribute("oiio:UnassociatedAlpha", 1)  # else colours come multiplied by alpha
    source = oiio.ImageInput.open(str(path), wanted)
    if source is None:
        raise FormatError(path, kind, "its header", "a sound one", one_line(oiio.geterror()))
    return source


def _unknown_rows(path: str | os.PathLike[str], what: str) -> UnreadableFile:
    return UnreadableFile(f"{path}: {what} that ends early, whose whole rows are unknown; copy it again")
