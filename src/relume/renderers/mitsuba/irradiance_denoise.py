"""Denoising a picture of irradiance, which is smooth but for shadows, by Open Image Denoise."""

from __future__ import annotations

import numpy as np


def smoothed(picture: np.ndarray, normal: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """The picture (H, W, 3) without its noise, float32; edges of the guides are kept.

    picture : 0 or more; textures must have been divided out, so that what is left to see is light
    normal : (H, W, 3), world
    parts : (H, W) int, another number for each surface
    """
    import mitsuba_oidn

    guide = (0.2 + 0.6 * (parts % 4) / 3).astype(np.float32)
    albedo = np.ascontiguousarray(np.broadcast_to(guide[..., None], picture.shape))
    light = np.ascontiguousarray(np.maximum(picture, 0), np.float32)
    return np.asarray(mitsuba_oidn.denoise(light, albedo, np.ascontiguousarray(normal, np.float32), hdr=True))
