"""Radiance pictures (.hdr, .pic): a shared exponent for R, G, B or X, Y, Z, read and written without a library.

A pixel is three mantissas m and one exponent e; its value is m·2^(e−136), 0 where e = 0 (Ward, "Real Pixels", Graphics
Gems II, 1991). Writing rounds to nearest, so m itself is the value without bias, and a file read and written again
keeps its codes. Writers that truncate mean m + ½ (`ReadOptions(mantissa_middle=True)`). EXPOSURE and COLORCORR lines
give what the pixels were multiplied by; all of them are divided out.

XYZE is CIE XYZ seen under the white of equal energy: as in Radiance's ra_xyze, colours are adapted between it and the
white of R = G = B = 1, so that what is neutral in one is neutral in the other.
"""

from __future__ import annotations

import mmap
import os
from math import prod

import numpy as np

from relume.errors import FormatError, warn
from relume.image.files.atomic import replacing
from relume.image.files.encodings import RadianceHDR
from relume.image.files.hdr.header import FORMAT, Header, header_of, kept_attributes, read_header
from relume.image.files.hdr.scanlines import DARKEST, along, decode, encoded
from relume.image.files.metadata.attributes import warn_of_losses
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount, refuse_absurd_size
from relume.image.primaries import EQUAL_ENERGY, REC709, adaptation, between
from relume.image.radiance import OUTSIDE, RadianceMap

_UPRIGHT = ("-Y", "+X")
_LARGE = 2**24  # bytes


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RadianceMap:
    """The radiance map in a Radiance picture, RGBE or XYZE, of any axis order; its colours become Rec. 709.

    options : limits; salvage; whether mantissas mean the middle of their step
    Header variables become attributes: pixel_aspect (a pixel's width by its height), view, camera, taken, software,
    owner, and others by their own name. Primaries that are not named are taken for Rec. 709, as everywhere but in
    Radiance itself. Warns of primaries that were converted, and of a file that was salvaged.

    Raises FormatError for a damaged file and a truncated one that is not to be salvaged, UnreadableFile for one beyond
    the limits.
    """
    # The header, and its claims held against the limits.
    stored = os.path.getsize(path)
    with open(path, "rb") as file:
        header = read_header(path, file, options)
        refuse_absurd_size(path, *header.size, options)
        pixels = header.lines * header.length
        refuse_absurd_amount(path, 12 * pixels, stored, options)
        # Nothing beyond the longest form there is, a run for every byte, belongs to the picture.
        file.seek(header.start)
        data = _zeros((min(8 * pixels + 4 * header.lines, max(0, stored - header.start)),), np.uint8)
        data = data[: file.readinto(data.data)]
    # The pixels, in Rec. 709.
    width, height = header.size
    radiance = _zeros((height, width, 3), np.float32)
    given = header.primaries
    if header.xyz:
        matrix = _from_xyz(given.white if given else EQUAL_ENERGY)
    else:
        matrix = None if given is None or given.is_close(REC709) else between(given, REC709)
    whole = decode(
        path,
        data,
        header.start,
        radiance,
        header.axes,
        scale=header.scale,
        middle=0.5 if options.mantissa_middle else 0.0,
        matrix=matrix,
        salvage=options.salvage,
    )
    _refuse_overflow(path, radiance, header, matrix)
    # The metadata, and warnings of what was converted or is missing.
    attributes = dict(header.attributes)
    if given is not None and not given.is_close(REC709):
        attributes["primaries"] = given.text
        if not header.xyz:
            what = f"{given.text} (x, y of R, G, B, white)"
            warn(f"{path}: its primaries are {what}; converted to Rec. 709", 0.0)
    if header.gamma:
        what = f"a GAMMA of {header.gamma[:20]}"
        warn(f"{path}: its header names {what}; its pixels are taken to be linear all the same")
    clipped = None
    if whole < header.lines:
        clipped = np.zeros((height, width), np.uint8)
        along(clipped, header.axes)[whole:] = OUTSIDE
        what = f"{header.lines - whole} of {header.lines} scan lines are missing"
        warn(f"{path}: ends early; {what}: they are 0 and marked as outside", (header.lines - whole) / header.lines)
    return RadianceMap(radiance, clipped=clipped, unit=header.unit, attributes=attributes)


def write(path: str | os.PathLike[str], image: RadianceMap, encoding: RadianceHDR = RadianceHDR()) -> None:
    """Write a radiance map, each mantissa rounded to nearest: an error of at most 1/256 of the pixel's largest channel.

    encoding : RGBE or XYZE, in new runs or flat
    All attributes but those with "=" in their name are kept, on one line each. Warns of what is not: planes of variance
    and of clipped pixels; and counts the pixels darker than RGBE holds, which become 0.

    Raises ValueError for a map without pixels and for pixels that the format cannot hold: negative, NaN, infinite or
    above 1.7e38; OutputNotWritten.
    """
    if 0 in image.size:
        raise ValueError(f"the map has {image.size[0]} x {image.size[1]} pixels; a .hdr file has one or more")
    pieces, unfit, dark = encoded(
        image.radiance, matrix=_FROM_REC709 if encoding.xyz else None, compressed=encoding.compressed
    )
    pixels = image.radiance[..., 0].size
    if unfit:
        what = "pixels are negative in X, Y or Z" if encoding.xyz else "pixels are negative"
        remedy = "write .exr" if encoding.xyz else "write .exr, or XYZE where they are colours beyond Rec. 709"
        raise ValueError(
            f"{unfit} of {pixels} {what}, NaN, infinite or above 1.7e38; a .hdr file holds none of these: {remedy}"
        )
    if dark:
        what = f"{dark} of {pixels} pixels are darker than {DARKEST:.2g} and become 0"
        warn(f"{path}: {what}; .exr keeps them")
    warn_of_losses(path, image, kept_attributes(image))
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(header_of(image, xyz=encoding.xyz))
        for piece in pieces:
            file.write(piece.data)


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """The form of the pixels, like "RGBE, new runs", and the order of the axes where it is not "-Y +X".

    Raises FormatError for a damaged header. Whether lines are flat is inferred from the size of the file.
    """
    with open(path, "rb") as file:
        header = read_header(path, file, options)
        file.seek(header.start)
        head = file.read(4)
    if head == bytes((2, 2, header.length >> 8 & 255, header.length & 255)) and 8 <= header.length <= 32767:
        form = "new runs"
    else:
        stored = os.path.getsize(path) - header.start
        form = "flat" if stored >= 4 * header.lines * header.length else "old runs"
    words = ["XYZE" if header.xyz else "RGBE", form]
    return ", ".join(words + ([] if header.axes == _UPRIGHT else [" ".join(header.axes)]))


def _zeros(shape: tuple[int, ...], kind: type[np.generic]) -> np.ndarray:
    """Zeros in the system's usual pages.

    For a large array NumPy asks for pages of 2 MB. Each is cleared whole before the first of its bytes is written, and
    has left the cache till then; bytes and pixels here are written once, from end to end.
    """
    size = np.dtype(kind).itemsize * prod(shape)
    if size < _LARGE or not hasattr(mmap, "MAP_PRIVATE"):
        return np.zeros(shape, kind)
    try:
        pages = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    except OSError:  # where memory is short NumPy says so by the error that callers know
        return np.zeros(shape, kind)
    return np.frombuffer(pages, kind).reshape(shape)


def _from_xyz(white: tuple[float, float]) -> np.ndarray:
    return np.linalg.inv(REC709.to_xyz()) @ adaptation(white, REC709.white)


_FROM_REC709 = np.linalg.inv(_from_xyz(EQUAL_ENERGY))


def _refuse_overflow(
    path: str | os.PathLike[str], radiance: np.ndarray, header: Header, matrix: np.ndarray | None
) -> None:
    """Raise FormatError where exposures or primaries take values beyond float32; few files have any that come near."""
    gain = 1.0 if matrix is None else float(np.abs(matrix).sum(1).max())
    if gain * 2.0**127 < np.finfo(np.float32).max * header.scale.min():
        return
    beyond = np.count_nonzero(~np.isfinite(radiance))
    if beyond:
        where = "its pixels, without exposure and in Rec. 709"
        raise FormatError(path, FORMAT, where, "values within float32", f"{beyond} beyond", "mend its EXPOSURE lines")
