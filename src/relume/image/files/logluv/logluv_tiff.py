"""LogLuv TIFF: log luminance and CIE u′v′ of every pixel in 32 or 24 bits, or luminance alone in 16 (Larson 1998).

A luminance step is 0.27 % (1.1 % in 24 bits) and a code stands for its middle, so that nothing is off by more than half
of that, nor biased over many values; u′ and v′ are off by at most 0.00122 (0.00175), evenly over many colours but one
and the same way for each: see `codes`. The pixels are CIE XYZ in the file: on reading they
become Rec. 709, and the white that the file names becomes D65. STONITS makes luminance cd/m².
"""

from __future__ import annotations

import math
import os

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image.bands import in_threads
from relume.image.files.encodings import LogLuv
from relume.image.files.logluv import blocks as logluv_blocks
from relume.image.files.logluv import codes as logluv_codes
from relume.image.files.logluv.blocks import Blocks, blocks_of
from relume.image.files.logluv.codes import lines
from relume.image.files.metadata.attributes import warn_of_losses
from relume.image.files.read_options import ReadOptions
from relume.image.files.tiff import layout as tiff_layout
from relume.image.files.tiff.attributes import STONITS, WHITE_POINT, attributes_of, scale_of, tags_of
from relume.image.files.tiff.directories import Folder, read_folders
from relume.image.files.tiff.writing import picture_tags, write_tiff
from relume.image.primaries import REC709, adaptation
from relume.image.radiance import OUTSIDE, RadianceMap

_DOUBLE = 12
_SAFE_SCALE = 1e15  # cd/m² of luminance 1, up to which no word is beyond float32
_LOWEST = 0.0048  # y of the violet end of the spectrum (CIE 15:2004): no light is lower
_STRONGEST = 100  # in a matrix that adapts any light there is; that for deepest red has 19
_ROUNDING = 1 + 1e-9  # so that a maximum of a power of two is not taken for just less
_STRIP = 2**18  # bytes of words in a strip: 64 KiB or less when packed, and enough strips for every core


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RadianceMap:
    """The radiance map in a LogLuv or LogL TIFF, in cd/m² where it has STONITS.

    Colours outside Rec. 709 have negative channels, negative luminance stays. Warns of a white other than D65, which is
    adapted, and of codes that no colour has. Raises FormatError, UnreadableFile.
    """
    folder, blocks = header(path, options)
    scale = scale_of(path, folder)
    matrix, white = to_d65(path, folder, blocks)
    luminances, colours = tables(blocks, matrix)
    rows = logluv_blocks.find(path, blocks, options)
    from relume.image.files.logluv import kernels

    picture = np.empty((blocks.layout.height, blocks.layout.width, 3), np.float32)
    with np.errstate(over="ignore"):
        bright = (luminances * (scale or 1.0)).astype(np.float32)
    shown = colours.astype(np.float32)
    strange = rows.paint(picture, lambda words, part: kernels.paint(words, bright, shown, part))
    if scale is not None and scale > _SAFE_SCALE and not np.all(np.isfinite(picture)):
        raise UnreadableFile(f"{path}: times its STONITS of {scale:g}, pixels are beyond float32; correct it")
    if strange:
        warn(
            f"{path}: {strange} of {picture[..., 0].size} pixels have a code that no colour has; read as neutral: the "
            "file may be damaged"
        )
    with open(path, "rb") as file:
        attributes = attributes_of(path, file, folder, options)
    return RadianceMap(
        tiff_layout.upright(picture, tiff_layout.orientation_of(folder)),
        clipped=_outside(path, rows, folder),
        unit="relative" if scale is None else "cd/m²",
        attributes=attributes | white,
    )


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """What kind of LogLuv a file is, from its tags alone; raises FormatError, UnreadableFile."""
    _, blocks = header(path, options)
    parts = ["LogL, 16 bits" if blocks.bits == 16 else f"LogLuv, {blocks.bits} bits"]
    if blocks.layout.tiled:
        parts.append(f"tiled {blocks.layout.block[0]} × {blocks.layout.block[1]}")
    return ", ".join(parts)


def header(path: str | os.PathLike[str], options: ReadOptions) -> tuple[Folder, Blocks]:
    """The first picture's tags, and where its pixels are."""
    folders = read_folders(path, options)
    if len(folders) > 1:
        warn(f"{path}: the first of its {len(folders)} pictures is read; split it for the others")
    return folders[0], blocks_of(path, folders[0], os.path.getsize(path), options)


def tables(blocks: Blocks, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The luminance of each upper half of a word, (65536,), and the linear Rec. 709 colour of each lower, (N, 3).

    matrix : (3, 3) on XYZ, that takes the file's white to D65
    """
    luminances = logluv_codes.scale_of(blocks.bits).luminances()
    if blocks.bits == 16:
        return luminances, np.ones((1, 3))
    return luminances, logluv_codes.colours(blocks.bits) @ (np.linalg.inv(REC709.to_xyz()) @ matrix).T


def to_d65(path: str | os.PathLike[str], folder: Folder, blocks: Blocks) -> tuple[np.ndarray, dict[str, str]]:
    """(3, 3) on XYZ that takes the file's white to D65, and the attribute that keeps that white where it was another.

    A file that names no white is taken as it is: its XYZ are those of the light itself.
    """
    white = folder.values.get(WHITE_POINT)
    if white is None or blocks.bits == 16:
        return np.eye(3), {}
    x, y = (*white, 0.0, 0.0)[:2] if isinstance(white, tuple) else (0.0, 0.0)
    seen = _LOWEST <= y and 0 < x < 1 - y
    with np.errstate(all="ignore"):
        matrix = adaptation((x, y), REC709.white) if seen else np.eye(3)
    if not (seen and np.all(np.abs(matrix) < _STRONGEST)):
        warn(f"{path}: its white is {x:.4g} {y:.4g} (x, y), which no light has; read as D65")
        return np.eye(3), {}
    if np.array_equal(matrix, np.eye(3)):
        return matrix, {}
    warn(f"{path}: its white is {x:.4g} {y:.4g} (x, y); adapted to D65", 0.0)
    return matrix, {"white": f"{x:.6g} {y:.6g}"}


def _outside(path: str | os.PathLike[str], rows: logluv_blocks.Rows, folder: Folder) -> np.ndarray | None:
    if not np.any(rows.places < 0):
        return None
    missing = rows.missing()
    count = int(np.count_nonzero(missing.any(axis=1)))
    warn(f"{path}: {count} of its {rows.blocks.layout.height} rows are missing, and marked so", float(missing.mean()))
    marks = np.where(missing, np.uint8(OUTSIDE), np.uint8(0))
    return tiff_layout.upright(marks, tiff_layout.orientation_of(folder))


def write(path: str | os.PathLike[str], image: RadianceMap, encoding: LogLuv = LogLuv()) -> None:
    """Write a radiance map as LogLuv of encoding.bits, with D65 as its white and STONITS where it is in cd/m².

    A colour that no code holds becomes the nearest one, and a luminance too small becomes 0: both are counted in a
    warning. In 24 bits, a map in cd/m² is divided by a power of two that takes its maximum to between 8 and 16.

    Raises ValueError for pixels that are NaN, infinite or too bright, or negative in 24 bits; OutputNotWritten.
    """
    scale = 1.0
    if encoding.bits == 24 and image.unit == "cd/m²":
        scale = _fitting_scale(image.radiance)
    words = _words(path, image.radiance, encoding.bits, scale)
    warn_of_losses(path, image, None)
    rows = max(1, _STRIP // (4 * words.shape[1]))
    main, exif = tags_of(image)
    # Bits and sample format are as libtiff writes them, whatever the coding.
    tags = picture_tags(
        image.size,
        1 if encoding.bits == 16 else 3,
        16,
        rows=rows,
        compression=logluv_blocks.PACKED_24 if encoding.bits == 24 else logluv_blocks.RUNS,
        photometric=logluv_blocks.LOG_L if encoding.bits == 16 else logluv_blocks.LOG_LUV,
        sample_format=tiff_layout.SIGNED,
    )
    unit = {STONITS: (_DOUBLE, [scale])} if image.unit == "cd/m²" else {}
    write_tiff(path, {**main, **tags, **unit}, logluv_blocks.packed(words, encoding.bits, rows), exif)


def _fitting_scale(radiance: np.ndarray) -> float:
    """The power of two that divides the largest luminance to between 8 and 16, where 24 bits end."""
    weights = REC709.to_xyz()[1]
    with np.errstate(invalid="ignore"):  # what is not finite is refused later
        largest = max(float(np.max(row @ weights)) for row in radiance)
    if not (math.isfinite(largest) and largest > 0):
        return 1.0
    return 2.0 ** (math.frexp(largest * _ROUNDING)[1] - 4)


def _words(path: str | os.PathLike[str], radiance: np.ndarray, bits: int, scale: float) -> np.ndarray:
    """(H, W) uint32; raises ValueError for pixels that have none, and warns of those that lose something."""
    from relume.image.files.logluv import kernels

    height, width = radiance.shape[:2]
    words = np.empty(height * width, np.uint32)
    pixels = radiance.reshape(-1, 3)
    levels = logluv_codes.scale_of(bits)
    gamut = lines() if bits == 24 else (np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64))
    to_xyz = REC709.to_xyz() / scale

    def encode(begin: int, end: int) -> np.ndarray:
        doubts = np.zeros(kernels.KINDS, np.int64)
        parts = (levels.steps, levels.lowest, levels.codes, levels.signed)
        kernels.encode(pixels[begin:end], to_xyz, parts, *gamut, words[begin:end], doubts)
        return doubts

    doubts = np.sum(in_threads(encode, len(pixels)), axis=0).tolist()
    most, least = scale * 2.0 ** (levels.codes / levels.steps - levels.lowest), scale * 2.0**-levels.lowest
    wider = "write 32 bits (--as logluv32)" if bits == 24 else "write .exr"
    for doubt, what, remedy in (
        (kernels.NOT_FINITE, "are NaN or infinite", "write .exr"),
        (kernels.TOO_BRIGHT, f"are brighter than {most:.4g}", f"lower its exposure, or {wider}"),
        (kernels.NEGATIVE, "have a negative luminance", "write 32 bits (--as logluv32)"),
    ):
        if doubts[doubt]:
            raise ValueError(
                f"{doubts[doubt]} of {len(pixels)} pixels {what}, which LogLuv of {bits} bits does not hold; {remedy}"
            )
    for doubt, what in (
        (kernels.TOO_DARK, f"are darker than {least:.4g} and become 0; {wider} to keep them"),
        (kernels.COLOURED, "have a colour, of which 16 bits keep nothing; write 32 bits (--as logluv32)"),
        (kernels.NO_SUCH_COLOUR, "have a colour that LogLuv does not hold, and get the nearest; .exr keeps it"),
    ):
        if doubts[doubt] and not (doubt == kernels.COLOURED and bits != 16):
            warn(f"{path}: {doubts[doubt]} of {len(pixels)} pixels {what}")
    return words.reshape(height, width)
