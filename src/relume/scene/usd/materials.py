"""The materials of a USD file: UsdPreviewSurface with its textures, and what of one cannot be rendered.

Specification: "UsdPreviewSurface Specification", 2.6. Other shaders (MaterialX, OSL) are named as lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.image import files
from relume.image.colour import decode_srgb
from relume.image.files.photographs.texture_pixels import texture_pixels
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Material

_COLOURS = ("diffuseColor", "emissiveColor")
_UNREAD = ("displacement", "occlusion")  # light makes its own occlusion
_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}


@dataclass(frozen=True, eq=False)
class UsdMaterial:
    """A material read, the primvar with its texture coordinates, and what of it is lost, in words.

    surface : None where the file has no UsdPreviewSurface for it
    """

    surface: Material | None
    coordinates: str = ""
    lost: tuple[str, ...] = ()


def read_material(path: Path, shade: Any, asset_resolver: Any, bound: Any) -> UsdMaterial:
    """A `UsdShade.Material`; raises UnreadableFile where a picture of one cannot be had."""
    name = bound.GetPrim().GetName()
    shader = bound.ComputeSurfaceSource()[0]
    if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface":
        return UsdMaterial(None, lost=("its shader, which is no UsdPreviewSurface",))
    reader = _Reader(path, shade, asset_resolver, [], [])
    got = {
        key: reader.value(shader, key, default)
        for key, default in {
            "diffuseColor": (0.18, 0.18, 0.18), "emissiveColor": (0.0, 0.0, 0.0), "metallic": 0.0, "roughness": 0.5,
            "clearcoat": 0.0, "clearcoatRoughness": 0.01, "opacity": 1.0, "opacityThreshold": 0.0, "ior": 1.5,
            "normal": None, "useSpecularWorkflow": 0, "opacityMode": "transparent",
        }.items()
    }  # fmt: skip
    lost = reader.lost
    if got["useSpecularWorkflow"]:
        lost.append("specularColor")
    lost += [key for key in _UNREAD[:1] if (each := shader.GetInput(key)) and each.HasConnectedSource()]
    colour, opacity, transmission = got["diffuseColor"], got["opacity"], 0.0
    cut = float(got["opacityThreshold"])
    if cut > 0:
        opacity = (np.asarray(opacity) >= cut).astype(np.float32)
        opacity = float(opacity) if opacity.ndim == 0 else opacity
    elif not isinstance(opacity, np.ndarray) and opacity < 1 and got["opacityMode"] == "transparent":
        # A body that light goes through, and not one that is there in part.
        opacity, transmission = 1.0, 1 - float(opacity)
        colour = (1.0, 1.0, 1.0) if transmission == 1 else colour
    surface = Material(
        base_color=_shares(colour), emission=_colour(got["emissiveColor"]), metallic=_shares(got["metallic"]),
        roughness=_shares(got["roughness"]), clearcoat=_shares(got["clearcoat"]),
        clearcoat_roughness=_shares(got["clearcoatRoughness"]), alpha=_shares(opacity), transmission=transmission,
        ior=max(float(got["ior"]), 1.0) if not isinstance(got["ior"], np.ndarray) else 1.5,
        normal=None if not isinstance(got["normal"], np.ndarray) else _unit_vectors(got["normal"]), name=name,
    )  # fmt: skip
    return UsdMaterial(surface, next(iter(reader.coordinates), ""), tuple(lost))


@dataclass(frozen=True, eq=False)
class _Reader:
    """Reads the inputs of one material's shader, and notes what is lost and the primvars that place its pictures."""

    path: Path
    shade: Any
    asset_resolver: Any
    lost: list[str]
    coordinates: list[str]

    def value(self, shader: Any, key: str, default: Any) -> Any:
        """A number, a text or a triple, or an image (H, W) or (H, W, 3) float32."""
        given = shader.GetInput(key)
        if not given:
            return default
        producers = self.shade.Utils.GetValueProducingAttributes(given)
        if not producers:
            return default
        first = producers[0]
        if self.shade.Utils.GetType(first.GetName()) == self.shade.AttributeType.Output:
            texture = self.shade.Shader(first.GetPrim())
            if texture.GetIdAttr().Get() == "UsdUVTexture":
                return self.image(texture, key, first.GetBaseName())
            self.lost.append(f"what {key} is connected to")
            return default
        value = first.Get()
        if value is None:
            return default
        return triple(np.asarray(value, np.float64)) if np.ndim(value) == 1 else value

    def image(self, texture: Any, key: str, channel: str) -> np.ndarray:
        """A texture's picture in linear values, times its scale and plus its bias."""
        stored = self.pixels(texture, key)
        space = str(self.value(texture, "sourceColorSpace", "auto"))
        # Pictures of 8 bits for colours are codes; shares that a picture of colours holds are not, whatever it says.
        if space == "sRGB" or (space == "auto" and key in _COLOURS):
            stored = np.concatenate([decode_srgb(stored[..., :3]), stored[..., 3:]], axis=-1)
        scale, bias = (self.four(texture, name, default) for name, default in (("scale", 1.0), ("bias", 0.0)))
        stored = (stored * scale + bias).astype(np.float32)
        self.note_coordinates(texture, key)
        return stored[..., :3] if channel == "rgb" else stored[..., _CHANNELS.get(channel, 0)]

    def four(self, texture: Any, name: str, default: float) -> np.ndarray:
        given = texture.GetInput(name)
        value = given.Get() if given else None
        return np.full(4, default, np.float32) if value is None else np.asarray(value, np.float32)

    def pixels(self, texture: Any, key: str) -> np.ndarray:
        given = texture.GetInput("file")
        producers = self.shade.Utils.GetValueProducingAttributes(given) if given else []
        asset = producers[0].Get() if producers else None
        place = "" if asset is None else asset.resolvedPath or asset.path
        try:
            if Path(place).suffix.lower() == ".exr" and Path(place).is_file():
                linear = files.read_radiance(place).radiance
                return np.concatenate([linear, np.ones_like(linear[..., :1])], axis=-1)
            resolver = self.asset_resolver.GetResolver()
            opened = resolver.OpenAsset(self.asset_resolver.ResolvedPath(place)) if place else None
            if opened is None:
                raise ValueError("no such file")
            return texture_pixels(bytes(opened.GetBuffer()))
        except Exception as error:  # a picture library raises whatever its parsers do
            reason = " ".join(str(error).split()) or type(error).__name__
            shown = Path(place).name or "none"
            raise UnreadableFile(
                f"{self.path}: the picture of {key}, {shown}, cannot be read ({reason}); is it beside the file?"
            ) from None

    def note_coordinates(self, texture: Any, key: str) -> None:
        """The primvar that places the picture; another than that of the first picture is lost."""
        given = texture.GetInput("st")
        producers = self.shade.Utils.GetValueProducingAttributes(given) if given else []
        reader = self.shade.Shader(producers[0].GetPrim()) if producers else None
        if reader and reader.GetIdAttr().Get() == "UsdTransform2d":
            self.lost.append(f"the UsdTransform2d of {key}")
            inner = self.shade.Utils.GetValueProducingAttributes(reader.GetInput("in"))
            reader = self.shade.Shader(inner[0].GetPrim()) if inner else None
        name = str(self.value(reader, "varname", "st")) if reader else "st"
        self.coordinates.append(name)
        if name != self.coordinates[0]:
            self.lost.append(f"{key} (of other texture coordinates than the first)")


def _shares(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.clip(value, 0, 1).astype(np.float32)
    return triple(np.clip(value, 0, 1)) if np.ndim(value) else float(np.clip(value, 0, 1))


def _colour(value: Any) -> Any:
    return np.maximum(value, 0).astype(np.float32) if isinstance(value, np.ndarray) else triple(np.maximum(value, 0))


def _unit_vectors(vectors: np.ndarray) -> np.ndarray:
    # Files without scale and bias mean the usual packing all the same.
    vectors = 2 * vectors - 1 if vectors.min() >= 0 else vectors
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), np.array([0, 0, 1])).astype(np.float32)
