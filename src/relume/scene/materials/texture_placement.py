"""Bringing the textures of one mesh to plain images that repeat over one set of texture coordinates."""

from __future__ import annotations

import numpy as np

from relume.scene.gltf.textures import MIRROR, REPEAT, Texture

LARGEST = 8192
"""Pixels along a side beyond which an image is not spread out: 8192² of float32 colour are 800 MB."""


def placed(textures: dict[str, Texture], uv: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, tuple[str, ...]]:
    """The textures' pixels and texture coordinates so that every image lies plainly on the mesh and repeats.

    textures : by name, all of the same set of coordinates
    uv : (N, 2) that set, glTF's (v downwards)
    Returns the images, (N, 2) coordinates, and what could not be done, in words: spreading beyond LARGEST pixels.
    """
    first = next(iter(textures.values()))
    if all(each.same_place(first) for each in textures.values()):
        uv = uv @ first.matrix[:, :2].T + first.matrix[:, 2]
        if not _leaves(uv) or all(each.wraps == (REPEAT, REPEAT) for each in textures.values()):
            return {name: each.pixels for name, each in textures.items()}, uv, ()
        tiled = True
    else:
        tiled = False
    low, tiles = _tiles(uv)
    sizes = {name: _size(each, tiles, tiled) for name, each in textures.items()}
    if max(max(size) for size in sizes.values()) > LARGEST:
        return {name: each.pixels for name, each in textures.items()}, uv, ("the wrapping of its textures",)
    if tiled:
        images = {name: _spread(each, low, tiles) for name, each in textures.items()}
    else:
        images = {name: _resampled(each, low, tiles, sizes[name]) for name, each in textures.items()}
    return images, (uv - low) / tiles, ()


def _leaves(uv: np.ndarray) -> bool:
    # A thousandth of a picture beyond its edge is an exporter's rounding, not a wish to go on.
    return bool(uv.min() < -1e-3 or uv.max() > 1 + 1e-3)


def _tiles(uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whole pictures that the coordinates reach over: the first of them, and how many, along u and v."""
    low = np.floor(uv.min(axis=0) + 1e-3)
    return low, np.maximum(np.ceil(uv.max(axis=0) - 1e-3) - low, 1)


def _size(texture: Texture, tiles: np.ndarray, tiled: bool) -> tuple[int, int]:
    """(height, width) of the image that covers all tiles at the texture's own fineness."""
    height, width = texture.pixels.shape[:2]
    fineness = np.ones(2) if tiled else np.maximum(np.linalg.norm(texture.matrix[:, :2], axis=0), 1e-6)
    return int(np.ceil(height * tiles[1] * fineness[1])), int(np.ceil(width * tiles[0] * fineness[0]))


def _wrapped(index: np.ndarray, count: int, wrap: int) -> np.ndarray:
    """The pixel that stands for each whole `index`, which may lie outside."""
    if wrap == REPEAT:
        return index % count
    if wrap == MIRROR:
        index = index % (2 * count)
        return np.minimum(index, 2 * count - 1 - index)
    return np.clip(index, 0, count - 1)


def _spread(texture: Texture, low: np.ndarray, tiles: np.ndarray) -> np.ndarray:
    """The picture over whole tiles, pixel by pixel."""
    height, width = texture.pixels.shape[:2]
    columns = _wrapped(np.arange(int(tiles[0]) * width) + int(low[0]) * width, width, texture.wraps[0])
    rows = _wrapped(np.arange(int(tiles[1]) * height) + int(low[1]) * height, height, texture.wraps[1])
    return texture.pixels[rows[:, None], columns]


def _resampled(texture: Texture, low: np.ndarray, tiles: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """The picture over whole tiles of the untransformed coordinates, bilinearly."""
    height, width = texture.pixels.shape[:2]
    v, u = np.meshgrid((np.arange(size[0]) + 0.5) / size[0], (np.arange(size[1]) + 0.5) / size[1], indexing="ij")
    at = np.stack([u, v], axis=-1) * tiles + low
    at = at @ texture.matrix[:, :2].T + texture.matrix[:, 2]
    at = at * [width, height] - 0.5
    corner = np.floor(at).astype(int)
    part = (at - corner)[..., None].astype(np.float32)
    columns = [_wrapped(corner[..., 0] + step, width, texture.wraps[0]) for step in (0, 1)]
    rows = [_wrapped(corner[..., 1] + step, height, texture.wraps[1]) for step in (0, 1)]
    upper, lower = (
        texture.pixels[row, columns[0]] * (1 - part[..., 0, :]) + texture.pixels[row, columns[1]] * part[..., 0, :]
        for row in rows
    )
    return upper * (1 - part[..., 1, :]) + lower * part[..., 1, :]
