"""Mattes of real things that stand in front of the objects: read from a painting, and split off the plate."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.image import files
from relume.image.files.signatures import MAPS

SOLID = 0.98
"""Share of a pixel that a thing covers from which on the pixel shows nothing else: 5 of 255 values of a painting."""


def read_matte(path: str | Path, size: tuple[int, int]) -> np.ndarray:
    """A painted matte, (H, W) float32 from 0 to 1; soft edges are kept.

    path : a PNG with alpha (the alpha is the matte), or a grey PNG, TIFF, JPEG or EXR, white where the thing is. Values
        are shares and not light, so no curve is taken off them
    size : (width, height) in pixels of the plate

    Raises UnreadableFile for another size, colours, and EXR values beyond 0 to 1.
    """
    kind = files.kind_of(path)
    if kind in MAPS:
        values = _grey(path, files.read_radiance(path).radiance).astype(np.float32)
        if not (np.isfinite(values).all() and values.min() >= 0 and values.max() <= 1):
            raise UnreadableFile(f"{path}: a matte with values beyond 0 to 1; save the share that the thing covers")
    else:
        values = _painted(path, kind)
    height, width = values.shape
    if (width, height) != size:
        raise UnreadableFile(
            f"{path}: the matte is {width}×{height}, the plate {size[0]}×{size[1]}; paint it over the plate itself"
        )
    return values


def solid_foreground(plate: np.ndarray, occluder: np.ndarray) -> np.ndarray:
    """The part of the plate's light that comes from what is in front, a·F, (H, W, 3) float64.

    plate : (H, W, 3) radiance
    occluder : (H, W), a: the share of each pixel that things in front cover, 0 to 1

    F of a pixel that is covered partly is taken from the nearest one that is covered whole; the mix then is as the
    plate's own at most. Where a thing is nowhere whole, F is the plate's own value (Porter & Duff 1984 ask for F; a
    matte without one can only guess it).
    """
    share = np.clip(occluder, 0, 1)[..., None].astype(np.float64)
    whole = occluder >= SOLID
    partly = (occluder > 0) & ~whole
    own = share * plate
    if not partly.any() or not whole.any():
        return own
    from scipy.ndimage import distance_transform_edt

    rows, columns = np.asarray(distance_transform_edt(~whole, return_distances=False, return_indices=True))
    nearest = plate[rows[partly], columns[partly]].astype(np.float64)
    own[partly] = np.minimum(share[partly] * nearest, np.maximum(plate[partly], 0))
    return own


def _painted(path: str | Path, kind: str) -> np.ndarray:
    """Alpha where a PNG has it, else its grey."""
    from relume.image.files.photographs.photographs import read_png

    pixels = read_png(path) if kind == "PNG" else files.read_photograph(path).pixels
    alpha = kind == "PNG" and pixels.shape[2] in (2, 4)
    shares = pixels[..., -1] if alpha else _grey(path, pixels)
    return (shares / np.iinfo(pixels.dtype).max).astype(np.float32)


def _grey(path: str | Path, pixels: np.ndarray) -> np.ndarray:
    # JPEG gives grey colours of a value or two.
    if np.ptp(pixels.astype(np.float64), axis=2).max() > (2 if pixels.dtype == np.uint8 else 1e-3 * pixels.max()):
        raise UnreadableFile(f"{path}: a matte in colours; save it grey, white in front, or with alpha")
    return pixels[..., min(1, pixels.shape[2] - 1)]
