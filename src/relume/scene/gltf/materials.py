"""The materials of a glTF file: its numbers, its textures, and what of it cannot be rendered."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from relume.image import files
from relume.image.colour import decode_srgb
from relume.scene.gltf.document import GltfDocument
from relume.scene.gltf.textures import Texture, placed, read_texture
from relume.scene.gltf.writing import RADIANCE
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Material

READ = {
    "KHR_materials_transmission", "KHR_materials_ior", "KHR_materials_volume", "KHR_materials_clearcoat",
    "KHR_materials_sheen", "KHR_materials_anisotropy", "KHR_materials_specular", "KHR_materials_emissive_strength",
    "KHR_materials_dispersion", "KHR_texture_transform", "EXT_texture_webp", "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
}  # fmt: skip
"""Extensions of glTF that are read; a file that requires another, such as EXT_meshopt_compression, is refused."""
PARTS = {
    "name", "extras", "doubleSided", "pbrMetallicRoughness", "extensions", "alphaMode", "alphaCutoff", "emissiveFactor",
    "emissiveTexture", "normalTexture", "occlusionTexture",
}  # fmt: skip
"""Parts of a glTF material that are read or mean nothing to light transport: light makes its own occlusion."""
UNREAD_TEXTURES = {
    "KHR_materials_clearcoat": ("clearcoatNormalTexture",),
    "KHR_materials_anisotropy": ("anisotropyTexture",),
}
"""Textures of read extensions that are not; a volume is as thick as its mesh."""
TEXTURES = {
    "baseColorTexture": ("pbrMetallicRoughness",),
    "metallicRoughnessTexture": ("pbrMetallicRoughness",),
    "normalTexture": (),
    "emissiveTexture": (),
    "transmissionTexture": ("extensions", "KHR_materials_transmission"),
    "clearcoatTexture": ("extensions", "KHR_materials_clearcoat"),
    "clearcoatRoughnessTexture": ("extensions", "KHR_materials_clearcoat"),
    "sheenColorTexture": ("extensions", "KHR_materials_sheen"),
    "sheenRoughnessTexture": ("extensions", "KHR_materials_sheen"),
    "specularTexture": ("extensions", "KHR_materials_specular"),
    "specularColorTexture": ("extensions", "KHR_materials_specular"),
}
"""Where each texture that is read stands in a material."""


@dataclass(frozen=True, eq=False)
class GltfMaterial:
    """A material as the file describes it, before it lies on a mesh.

    numbers : its factors alone
    description : the file's own words
    textures : by glTF's names
    lost : what is not rendered of it, in words
    radiance : (H, W, 3) what it sends out, from a file beside, in place of the emissive texture of 8 bits; or None
    """

    numbers: Material
    description: dict[str, Any]
    textures: dict[str, Texture] = field(default_factory=dict)
    lost: tuple[str, ...] = ()
    radiance: np.ndarray | None = None

    @property
    def coordinates(self) -> int:
        """The set of texture coordinates that its textures use."""
        return next((texture.coordinates for texture in self.textures.values()), 0)

    def on(self, uv: np.ndarray | None) -> tuple[Material, np.ndarray | None, tuple[str, ...]]:
        """The material with its images over a mesh, the mesh's texture coordinates for them, and what is lost.

        uv : (N, 2) in glTF's words, v downwards; without them the numbers stand alone
        """
        if uv is None or not self.textures:
            return self.numbers, uv, () if uv is not None or not self.textures else ("textures without coordinates",)
        images, uv, lost = placed(self.textures, uv)
        material = _with_images(self.numbers, self.description, images)
        return material if self.radiance is None else replace(material, emission=self.radiance), uv, lost


def read_materials(document: GltfDocument) -> tuple[GltfMaterial, ...]:
    """Every material of a glTF file; raises UnreadableFile where a picture of one cannot be had."""
    return tuple(
        _read(document, index, description) for index, description in enumerate(document.header.get("materials", []))
    )


def _read(document: GltfDocument, index: int, description: dict[str, Any]) -> GltfMaterial:
    name = description.get("name", index)
    textures: dict[str, Texture] = {}
    for key, place in TEXTURES.items():
        if (info := _within(description, *place).get(key)) is not None:
            textures[key] = read_texture(document, info, f"{key} of its material {name!r}")
    extensions = description.get("extensions", {})
    lost = ({*description} - PARTS) | ({*extensions} - READ)
    lost |= {key for part, keys in UNREAD_TEXTURES.items() for key in keys if key in extensions.get(part, {})}
    used = next((texture.coordinates for texture in textures.values()), 0)
    other = [key for key, texture in textures.items() if texture.coordinates != used]
    lost |= {f"{key} (of another set of texture coordinates than the first)" for key in other}
    kept = {key: texture for key, texture in textures.items() if key not in other}
    radiance, missing = _radiance(document, description)
    return GltfMaterial(_numbers(description), description, kept, (*sorted(lost), *missing), radiance)


def _radiance(document: GltfDocument, description: dict[str, Any]) -> tuple[np.ndarray | None, tuple[str, ...]]:
    """What a file beside holds of the material's emission, and what is lost where it is missing."""
    extras = description.get("extras")
    name = extras.get(RADIANCE) if isinstance(extras, dict) else None
    if not isinstance(name, str) or "emissiveTexture" not in description:
        return None, ()
    beside = document.path.parent / Path(name).name
    if not beside.is_file():
        return None, (f"its radiance in {name}, which is missing (8 bits of it are shown)",)
    return files.read_radiance(beside).radiance, ()


def _within(description: dict[str, Any], *place: str) -> dict[str, Any]:
    for key in place:
        description = description.get(key, {})
    return description


def _numbers(description: dict[str, Any]) -> Material:
    """The material of its factors alone."""
    pbr = description.get("pbrMetallicRoughness", {})
    extensions = description.get("extensions", {})

    def of(extension: str, key: str, default: float) -> float:
        return float(extensions.get(f"KHR_materials_{extension}", {}).get(key, default))

    volume = extensions.get("KHR_materials_volume")
    strength = of("emissive_strength", "emissiveStrength", 1)
    return Material(
        base_color=triple(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]),
        metallic=float(pbr.get("metallicFactor", 1)),
        roughness=float(pbr.get("roughnessFactor", 1)),
        transmission=of("transmission", "transmissionFactor", 0),
        # 0 means "reflects all" to glTF, for which no index of refraction stands.
        ior=max(of("ior", "ior", 1.5), 1.0),
        name=str(description.get("name", "")),
        emission=triple(np.multiply(description.get("emissiveFactor", (0, 0, 0)), strength)),
        alpha=_alpha(description, float(pbr.get("baseColorFactor", [1, 1, 1, 1])[3])),
        clearcoat=of("clearcoat", "clearcoatFactor", 0),
        clearcoat_roughness=of("clearcoat", "clearcoatRoughnessFactor", 0),
        sheen_color=triple(extensions.get("KHR_materials_sheen", {}).get("sheenColorFactor", (0, 0, 0))),
        sheen_roughness=of("sheen", "sheenRoughnessFactor", 0),
        anisotropy=of("anisotropy", "anisotropyStrength", 0),
        anisotropy_rotation=of("anisotropy", "anisotropyRotation", 0),
        specular=of("specular", "specularFactor", 1),
        specular_color=triple(extensions.get("KHR_materials_specular", {}).get("specularColorFactor", (1, 1, 1))),
        # A volume of no thickness is a sheet; without the extension a body stays a body, as modellers mean glass.
        thin=volume is not None and not volume.get("thicknessFactor", 0) > 0,
        attenuation_color=triple((volume or {}).get("attenuationColor", (1, 1, 1))),
        attenuation_distance=float((volume or {}).get("attenuationDistance", np.inf)),
        dispersion=of("dispersion", "dispersion", 0),
    )


def _alpha(description: dict[str, Any], alpha: Any) -> Any:
    """What is there of a surface whose alpha is a number or an image."""
    mode = description.get("alphaMode", "OPAQUE")
    if mode == "OPAQUE":
        return 1.0
    if mode == "MASK":
        cut = np.asarray(alpha) >= description.get("alphaCutoff", 0.5)
        return cut.astype(np.float32) if cut.ndim else float(cut)
    return alpha


def _with_images(material: Material, description: dict[str, Any], images: dict[str, np.ndarray]) -> Material:
    """The material with its images multiplied by its numbers, channel by channel as glTF packs them."""
    changes: dict[str, Any] = {}
    for key, (name, channel) in {
        "transmissionTexture": ("transmission", 0),
        "clearcoatTexture": ("clearcoat", 0),
        "clearcoatRoughnessTexture": ("clearcoat_roughness", 1),
        "sheenRoughnessTexture": ("sheen_roughness", 3),
        "specularTexture": ("specular", 3),
    }.items():
        if key in images:
            changes[name] = images[key][..., channel] * np.float32(getattr(material, name))
    for key, name in {
        "baseColorTexture": "base_color",
        "emissiveTexture": "emission",
        "sheenColorTexture": "sheen_color",
        "specularColorTexture": "specular_color",
    }.items():
        if key in images:
            changes[name] = _coloured(images[key], getattr(material, name))
    if (base := images.get("baseColorTexture")) is not None:
        factor = description.get("pbrMetallicRoughness", {}).get("baseColorFactor", [1, 1, 1, 1])[3]
        changes["alpha"] = _alpha(description, base[..., 3] * np.float32(factor))
    if (packed := images.get("metallicRoughnessTexture")) is not None:
        changes["roughness"] = packed[..., 1] * np.float32(material.roughness)
        changes["metallic"] = packed[..., 2] * np.float32(material.metallic)
    if (bumps := images.get("normalTexture")) is not None:
        changes["normal"] = _normals(bumps, description["normalTexture"].get("scale", 1))
    return replace(material, **changes)


def _coloured(picture: np.ndarray, factor: Any) -> np.ndarray:
    return np.asarray(decode_srgb(picture[..., :3]) * np.asarray(factor), np.float32)


def _normals(picture: np.ndarray, scale: float) -> np.ndarray:
    """Unit vectors: x and y scaled, as glTF 2.0 §3.9.3 says."""
    vectors = (2 * picture[..., :3] - 1) * np.array([scale, scale, 1], np.float32)
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    flat = np.array([0, 0, 1], np.float32)
    return np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), flat).astype(np.float32)
