"""The pixels of one JPEG among several in a file: decoded alone, and refused where data is missing or altered.

OpenImageIO decodes, because it reports a hole in the data, which Pillow takes for whole. It opens files only, and of
one with a gain map it gives what its own library makes of both pictures; so the JPEG is given to it alone, in a
temporary file without metadata.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from relume.errors import FormatError, UnreadableFile
from relume.image.files.photographs.jpeg_segments import Header, without_metadata
from relume.image.files.signatures import one_line


def decoded(path: str | os.PathLike[str], jpeg: bytes, header: Header, what: str) -> np.ndarray:
    """(H, W, 1 or 3) uint8 of one JPEG; raises FormatError where it is damaged.

    jpeg : the bytes of this JPEG alone, of which `header` is the header
    what : "base picture", for the message
    """
    where = f"{what} at byte {header.begin}"
    try:
        with tempfile.TemporaryDirectory(prefix="relume-") as folder:
            alone = Path(folder, "alone.jpg")
            alone.write_bytes(without_metadata(jpeg, header))
            pixels, complaint = _opened(alone)
    except OSError as error:
        raise UnreadableFile(f"{path}: no temporary file for its {what}: {one_line(error)}; make room") from None
    if pixels is None or complaint:
        raise FormatError(path, "JPEG", where, "whole data", one_line(complaint) or "no pixels")
    if pixels.dtype != np.uint8 or pixels.size != header.width * header.height * header.channels:
        found = f"{pixels.shape} {pixels.dtype}"
        expected = f"{header.width} x {header.height} pixels of {header.channels} channels of 8 bits"
        raise FormatError(path, "JPEG", where, expected, found)
    return pixels.reshape(header.height, header.width, header.channels)


def _opened(alone: Path) -> tuple[np.ndarray | None, str]:
    import OpenImageIO as oiio

    source = oiio.ImageInput.open(str(alone))
    if source is None:
        return None, oiio.geterror().replace(f'"{alone}"', "it")
    try:
        spec = source.spec()
        pixels = source.read_image(0, 0, 0, spec.nchannels, spec.format)
        return pixels, source.geterror().replace(f' ("{alone}")', "")
    finally:
        source.close()
