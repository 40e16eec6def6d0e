"""The textures of a glTF file: their pictures, decoded, and brought to plain images over one set of coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.image.files.photographs.texture_pixels import texture_pixels
from relume.scene.gltf.document import GltfDocument

CLAMP, MIRROR, REPEAT = 33071, 33648, 10497
"""How a texture goes on outside of 0 to 1 (glTF 2.0, §5.26)."""
ENCODINGS = ("EXT_texture_webp",)
"""Extensions that name another picture of a texture, which is read."""


@dataclass(frozen=True, eq=False)
class Texture:
    """One picture and how it lies on a mesh.

    pixels : (H, W, 4) float32, 0 to 1 as stored, upper row first
    wraps : how it goes on along u and v
    matrix : (2, 3), from the mesh's texture coordinates (glTF's, v downwards) to the picture's (KHR_texture_transform)
    coordinates : the number of the set of texture coordinates
    """

    pixels: np.ndarray
    wraps: tuple[int, int]
    matrix: np.ndarray
    coordinates: int


def read_texture(document: GltfDocument, info: dict[str, Any], words: str) -> Texture:
    """The texture that a textureInfo of the file means.

    words : what it is, for messages, like: baseColorTexture of its material 'paint'
    Raises UnreadableFile when the picture is missing, damaged or of a kind that is not read.
    """
    header, path = document.header, document.path
    try:
        texture = header["textures"][info["index"]]
        named = [texture["extensions"][name]["source"] for name in ENCODINGS if name in texture.get("extensions", {})]
        if not named and "source" not in texture:
            kinds = ", ".join(texture.get("extensions", {})) or "no source"
            raise UnreadableFile(f"{path}: the {words} is stored as {kinds}, which is not read; use PNG or JPEG")
        image = header["images"][(named or [texture.get("source")])[0]]
        sampler = header["samplers"][texture["sampler"]] if "sampler" in texture else {}
        data = document.fetched(image["uri"]) if "uri" in image else document.view(image["bufferView"])
        pixels = texture_pixels(data)
    except UnreadableFile:
        raise
    except Exception as error:  # a picture library raises whatever its parsers do
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UnreadableFile(
            f"{path}: the {words} cannot be read ({reason}); is its picture beside the file?"
        ) from None
    transform = info.get("extensions", {}).get("KHR_texture_transform", {})
    return Texture(
        pixels,
        (sampler.get("wrapS", REPEAT), sampler.get("wrapT", REPEAT)),
        _matrix(transform),
        transform.get("texCoord", info.get("texCoord", 0)),
    )


def _matrix(transform: dict[str, Any]) -> np.ndarray:
    """Translation · rotation · scale; the rotation is counter-clockwise as seen, with v downwards."""
    (x, y), angle = transform.get("scale", [1, 1]), transform.get("rotation", 0)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, sine], [-sine, cosine]]) * [x, y]
    return np.column_stack([turn, transform.get("offset", [0, 0])])


LARGEST_SPREAD = 8192
"""Pixels along a side beyond which an image is not spread out: 8192² of float32 colour are 800 MB."""


def placed(textures: dict[str, Texture], uv: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, tuple[str, ...]]:
    """The textures' pixels and texture coordinates so that every image lies plainly on the mesh and repeats.

    textures : by name, all of the same set of coordinates
    uv : (N, 2) that set, glTF's (v downwards)
    Returns the images, (N, 2) coordinates, and what could not be done, in words: spreading beyond
    LARGEST_SPREAD pixels.
    """
    first = next(iter(textures.values()))
    # Whether all lie on the mesh in the same way, but for their wraps.
    tiled = all(np.allclose(each.matrix, first.matrix, atol=1e-7) for each in textures.values())
    if tiled:
        uv = uv @ first.matrix[:, :2].T + first.matrix[:, 2]
        # A thousandth of a picture beyond its edge is an exporter's rounding, not a wish to go on.
        leaves = uv.min() < -1e-3 or uv.max() > 1 + 1e-3
        if not leaves or all(each.wraps == (REPEAT, REPEAT) for each in textures.values()):
            return {name: each.pixels for name, each in textures.items()}, uv, ()
    # Whole pictures that the coordinates reach over: the first of them, and how many, along u and v.
    low = np.floor(uv.min(axis=0) + 1e-3)
    tiles = np.maximum(np.ceil(uv.max(axis=0) - 1e-3) - low, 1)
    sizes = {name: _size(each, tiles, tiled) for name, each in textures.items()}
    if max(max(size) for size in sizes.values()) > LARGEST_SPREAD:
        return {name: each.pixels for name, each in textures.items()}, uv, ("the wrapping of its textures",)
    if tiled:
        images = {name: _spread(each, low, tiles) for name, each in textures.items()}
    else:
        images = {name: _resampled(each, low, tiles, sizes[name]) for name, each in textures.items()}
    return images, (uv - low) / tiles, ()


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
