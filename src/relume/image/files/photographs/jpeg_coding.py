"""What a JPEG did to its pixels: its quantisation and colour resolution, and the same done to other pixels."""

from __future__ import annotations

import io
import os
import warnings

import numpy as np

from relume.image.photograph import JpegCoding

_KNOWN = (0, 1, 2)
"""Pillow's numbers of 4:4:4, 4:2:2 and 4:2:0."""


def coding_of(path: str | os.PathLike[str]) -> JpegCoding | None:
    """The coding of a JPEG in colour, from its header; None for one whose colour resolution is none of the usual."""
    from PIL import JpegImagePlugin

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with open(path, "rb") as file, JpegImagePlugin.JpegImageFile(file) as picture:
                subsampling = JpegImagePlugin.get_sampling(picture)
                tables = [tuple(table) for _, table in sorted(picture.quantization.items())]
                usual = picture.mode == "RGB" and subsampling in _KNOWN and 1 <= len(tables) <= 3
        except (OSError, SyntaxError, ValueError):
            return None
    return JpegCoding(tuple(tables), subsampling) if usual else None


def coded(pixels: np.ndarray, coding: JpegCoding) -> np.ndarray:
    """Pixels (H, W, 3) uint8 as a JPEG of that coding gives them back."""
    from PIL import Image

    file = io.BytesIO()
    tables = [list(table) for table in coding.quantisation]
    Image.fromarray(np.ascontiguousarray(pixels)).save(file, "JPEG", qtables=tables, subsampling=coding.subsampling)
    return np.asarray(Image.open(file))
