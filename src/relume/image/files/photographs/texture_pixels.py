"""Pictures of materials, which lie in the buffers of mesh files as often as beside them: bytes to numbers."""

from __future__ import annotations

import io

import numpy as np


def texture_pixels(data: bytes) -> np.ndarray:
    """A texture's picture as stored, without any conversion of its colours.

    data : the bytes of a PNG, JPEG or WebP
    Returns (H, W, 4) float32 from 0 to 1, upper row first; grey in three channels, alpha 1 where the file has none.
    Raises what Pillow raises for bytes that are none.
    """
    from PIL import Image

    with Image.open(io.BytesIO(data)) as picture:
        if picture.mode.startswith("I"):  # 16 bits of grey, which Pillow would clip to 8
            grey = np.asarray(picture, np.float32)[..., None] / 65535
            return np.concatenate([grey, grey, grey, np.ones_like(grey)], axis=-1)
        return np.asarray(picture.convert("RGBA")).astype(np.float32) / 255
