"""Numbers, colours and images of materials as Mitsuba's textures."""

from __future__ import annotations

from typing import Any

import numpy as np

from relume.scene.materials.materials import Colour


def rgb(colour: Colour | np.ndarray) -> dict[str, Any]:
    """A colour in Mitsuba's words."""
    return {"type": "rgb", "value": [float(channel) for channel in colour]}


def texture_words(mi: Any, value: Any) -> Any:
    """What a plugin's parameter is set to: a number, a colour, or a bitmap of linear values that repeats.

    value : a number, a triple, or an image (H, W) or (H, W, 3)
    """
    array = np.asarray(value, np.float32)
    if array.ndim == 0:
        return float(array)
    if array.ndim == 1:
        return rgb(array)
    return _bitmap_words(mi, array)


def texture(mi: Any, value: Any) -> Any:
    """The same as a texture of its own, for plugins written in Python."""
    array = np.asarray(value, np.float32)
    if array.ndim == 0:
        return mi.load_dict({"type": "uniform", "value": float(array)})
    if array.ndim == 1:
        # An image of one pixel is bounded by nothing: `rgb` would have to be below 1.
        array = array[None, None]
    return mi.load_dict(_bitmap_words(mi, array))


def _bitmap_words(mi: Any, image: np.ndarray) -> dict[str, Any]:
    bitmap = mi.Bitmap(np.ascontiguousarray(image if image.ndim == 3 else image[..., None]))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True}
