"""The textures of a glTF file: their pictures, decoded, with how each lies on the mesh."""

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

    def same_place(self, other: Texture) -> bool:
        """Whether both lie on the mesh in the same way, but for their wraps."""
        return bool(np.allclose(self.matrix, other.matrix, atol=1e-7))


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
