"""Radiance maps as TIFF of floats: 32 bits written, bit for bit; 16, 24, 32 and 64 bits read.

Format: TIFF 6.0 with SampleFormat 3, and Adobe's technical note 3 for the predictor. Attributes, primaries and unit:
see `tiff.attributes`.
"""

from __future__ import annotations

import os

import numpy as np

from relume.errors import FormatError, UnreadableFile, warn
from relume.image.bands import in_threads
from relume.image.files.encodings import FloatTIFF
from relume.image.files.metadata.attributes import scale_by, warn_of_losses
from relume.image.files.read_options import OR_SALVAGE, ReadOptions
from relume.image.files.tiff.attributes import attributes_of, primaries_of, scale_of, tags_of
from relume.image.files.tiff.directories import Folder, read_folders
from relume.image.files.tiff.layout import (
    LZW,
    NONE,
    OLD_ZIP,
    PACKBITS,
    ZIP,
    Layout,
    layout_of,
    orientation_of,
    pages_of,
    upright,
)
from relume.image.files.tiff.samples import pieces, predicted
from relume.image.files.tiff.writing import picture_tags, write_tiff
from relume.image.primaries import REC709, between, converted
from relume.image.radiance import OUTSIDE, RadianceMap

_BITS = (16, 24, 32, 64)
_FLOAT, _GREY, _RGB, _PREDICTED = 3, 1, 2, 3
_STRIP = 2**19  # bytes before compression: some hundred strips to share among cores, and none too short to pack well
_LEVEL = 4  # of libdeflate: half the time of zlib at the same level, for smaller files


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RadianceMap:
    """The radiance map in the first page of a TIFF of floats, upright; NaN and infinity are kept.

    Grey becomes three equal channels. STONITS makes the unit cd/m²; other primaries are converted to Rec. 709, with
    a warning, as are pages and channels left out. Raises UnreadableFile for damage, for what `options` does not
    allow, and for doubles that float32 cannot hold.
    """
    folders, layout, size = _judged(path, options)
    folder = folders[0]
    rows = layout.rows_within(size)
    if rows < layout.height and not options.salvage:
        found = f"the end of the file, after {rows} of {layout.height} rows"
        raise FormatError(path, "TIFF", f"byte {size}", "more pixels", found, OR_SALVAGE)
    pixels = _pixels(path, folder, layout, rows)
    scale = scale_of(path, folder)
    if scale is not None and scale != 1:
        scale_by(path, pixels, scale, "STONITS")
    clipped = None
    if rows < layout.height:
        warn(
            f"{path}: ends early; {layout.height - rows} of {layout.height} rows are missing",
            (layout.height - rows) / layout.height,
        )
        clipped = np.zeros(pixels.shape[:2], np.uint8)
        clipped[rows:] = OUTSIDE
    if (pages := pages_of(folders)) > 1:
        warn(f"{path}: only the first of its {pages} pages is read")
    with open(path, "rb") as file:
        attributes = attributes_of(path, file, folder, options)
    orientation = orientation_of(folder)
    image = RadianceMap(
        upright(pixels, orientation),
        clipped=None if clipped is None else upright(clipped, orientation),
        unit="relative" if scale is None else "cd/m²",
        attributes=attributes,
    )
    return _in_rec709(path, folder, layout, image)


def write(path: str | os.PathLike[str], image: RadianceMap, encoding: FloatTIFF = FloatTIFF()) -> None:
    """Write a radiance map as 32-bit floats, every bit of them kept, with its unit and attributes.

    Variance and the marks of clipped pixels are not kept, with a warning. Raises OutputNotWritten.
    """
    import imagecodecs

    warn_of_losses(path, image, None)
    width, height = image.size
    rows = max(1, _STRIP // (12 * width))
    main, exif = tags_of(image)
    tags = picture_tags(
        image.size,
        3,
        32,
        rows=rows,
        compression=ZIP if encoding.compressed else NONE,
        photometric=_RGB,
        sample_format=_FLOAT,
        predictor=_PREDICTED if encoding.compressed else 1,
    )
    pixels = np.ascontiguousarray(image.radiance, "<f4")

    def strip(begin: int, end: int) -> bytes | memoryview:
        if not encoding.compressed:
            return pixels[begin:end].data.cast("B")
        return bytes(imagecodecs.deflate_encode(predicted(pixels[begin:end]), level=_LEVEL))

    write_tiff(path, {**tags, **main}, in_threads(strip, height, chunk=rows), exif)


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """What kind of float TIFF a file is, from its tags alone: "float, 32 bits, ZIP"."""
    folders, layout, _ = _judged(path, options)
    words = [f"float, {layout.bits} bits, {layout.packing}"]
    if layout.samples - layout.extra == 1:
        words.append("grey")
    if layout.tiled:
        words.append(f"tiled {layout.block[0]} × {layout.block[1]}")
    if folders[0].order == ">":
        words.append("big-endian")
    if (pages := pages_of(folders)) > 1:
        words.append(f"{pages} pages")
    return ", ".join(words)


def _judged(path: str | os.PathLike[str], options: ReadOptions) -> tuple[list[Folder], Layout, int]:
    """The folders, the layout of the first page and the size of a file that this module decodes."""
    size = os.path.getsize(path)
    folders = read_folders(path, options)
    layout = layout_of(path, folders[0], size, options)
    if layout.sample_format != _FLOAT or layout.bits not in _BITS:
        what = f"{layout.bits} bits of sample format {layout.sample_format}"
        raise UnreadableFile(f"{path}: a TIFF of {what}; relume reads floats of 16, 24, 32 or 64: save it as those")
    if layout.compression not in (NONE, ZIP, OLD_ZIP, LZW, PACKBITS):
        what = f"{'tiles of ' if layout.tiled else ''}floats of {layout.bits} bits by {layout.packing}"
        raise UnreadableFile(
            f"{path}: packs {what}; relume reads uncompressed, ZIP, LZW and PackBits: save it as those"
        )
    allowed = (1,) if layout.compression in (NONE, PACKBITS) else (1, _PREDICTED)
    if layout.predictor not in allowed:
        raise FormatError(path, "TIFF", "tag 317 (predictor)", " or ".join(map(str, allowed)), str(layout.predictor))
    colours = layout.samples - layout.extra
    if (layout.photometric, colours) not in ((_GREY, 1), (_RGB, 3), (-1, 1), (-1, 3)):
        what = f"{colours} channels of photometric interpretation {layout.photometric}"
        raise UnreadableFile(f"{path}: has {what}; relume reads RGB and grey of black 0: save it as those")
    return folders, layout, size


def _pixels(path: str | os.PathLike[str], folder: Folder, layout: Layout, rows: int) -> np.ndarray:
    """(H, W, 3) float32 as stored, 0 from row `rows` on; warns of channels left out."""
    pixels = np.zeros((layout.height, layout.width, 3), np.float32)
    colours = layout.samples - layout.extra
    beyond = opaque = 0
    for piece in pieces(path, folder.order, layout, rows):
        deep, wide, samples = piece.values.shape
        shown = pixels[piece.top : piece.top + deep, piece.left : piece.left + wide]
        given = piece.values[..., : max(colours - piece.first, 0)]
        target = shown if colours == 1 and given.size else shown[..., piece.first : piece.first + given.shape[-1]]
        with np.errstate(over="ignore", invalid="ignore"):
            target[...] = given
        if layout.bits == 64:
            stored = target[..., : given.shape[-1]]
            beyond += np.count_nonzero(np.isinf(stored)) - np.count_nonzero(np.isinf(given))
        if layout.extra and piece.first <= colours < piece.first + samples:
            opaque += np.count_nonzero(piece.values[..., colours - piece.first] == 1)
    if beyond:
        raise UnreadableFile(f"{path}: {beyond} of its doubles are beyond float32, 3.4e38; scale it down first")
    seen_through = rows * layout.width - opaque if layout.extra else 0
    if seen_through:
        warn(f"{path}: alpha is left out, though {seen_through} pixels are not opaque")
    if layout.extra > 1:
        warn(f"{path}: {layout.extra - 1} channels beside its colours and alpha are left out")
    return pixels


def _in_rec709(path: str | os.PathLike[str], folder: Folder, layout: Layout, image: RadianceMap) -> RadianceMap:
    given = primaries_of(path, folder)
    if layout.samples - layout.extra == 1 or given.is_close(REC709):
        return image
    warn(f"{path}: its primaries are {given.text} (x, y of R, G, B, white); converted to Rec. 709")
    return converted(image, between(given, REC709), given)
