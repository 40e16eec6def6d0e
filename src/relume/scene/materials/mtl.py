"""The materials of OBJ files: a .mtl's Phong words as glTF's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.image.colour import decode_srgb
from relume.image.files.photographs.texture_pixels import texture_pixels
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Material


def read_mtl_materials(path: Path, data: bytes) -> tuple[dict[str, Material], tuple[str, ...]]:
    """The materials of the .mtl files that an OBJ names, by name, and those of the files that are missing.

    Kd the base colour, Ke the emission, Ni the index of refraction, d or Tr the alpha, Pr and Pm (an extension of the
    format) roughness and metallic, map_Kd the base colour's picture. Without Pr, Ns gives the roughness: of Blinn's
    exponent n a microfacet width of √(2/(n + 2)); a Ks of 0 means no gloss. A .mtl without Ns is matt.
    Raises UnreadableFile where a picture cannot be had.
    """
    found: dict[str, Material] = {}
    missing: list[str] = []
    for line in data.decode("utf-8", "replace").splitlines():
        key, _, rest = line.strip().partition(" ")
        if key != "mtllib":
            continue
        library = path.parent / rest.strip()
        if library.is_file():
            found |= _library(library)
        else:
            missing.append(rest.strip())
    return found, tuple(missing)


def _library(path: Path) -> dict[str, Material]:
    entries: dict[str, dict[str, str]] = {}
    current: dict[str, str] = {}
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        key, _, rest = line.split("#", 1)[0].strip().partition(" ")
        if key == "newmtl":
            current = entries.setdefault(rest.strip(), {})
        elif key:
            current[key] = rest.strip()
    return {name: _material(path, name, entry) for name, entry in entries.items()}


def _material(path: Path, name: str, entry: dict[str, str]) -> Material:
    try:
        material = _of_numbers(name, entry)
    except (ValueError, IndexError) as error:
        raise UnreadableFile(f"{path}: the material {name!r} cannot be read ({error}); export it again") from None
    if "map_Kd" not in entry:
        return material
    picture = path.parent / entry["map_Kd"].split()[-1].replace("\\", "/")
    colours = _picture(path, name, picture) * np.asarray(material.base_color, np.float32)
    return replace(material, base_color=colours)


def _of_numbers(name: str, entry: dict[str, str]) -> Material:
    def numbers(key: str, default: str) -> list[float]:
        return [float(part) for part in entry.get(key, default).split()]

    changes: dict[str, Any] = {"base_color": triple((numbers("Kd", "0.8 0.8 0.8") * 3)[:3])}
    if "Pr" in entry:
        changes["roughness"] = numbers("Pr", "1")[0]
    elif "Ns" in entry:
        changes["roughness"] = float(min((2 / (max(numbers("Ns", "0")[0], 0) + 2)) ** 0.25, 1))
    if "Ks" in entry and not any(numbers("Ks", "0")):
        changes["specular"] = 0.0
    changes["metallic"] = numbers("Pm", "0")[0]
    changes["emission"] = triple((numbers("Ke", "0 0 0") * 3)[:3])
    changes["ior"] = max(numbers("Ni", "1.5")[0], 1.0)
    changes["alpha"] = 1 - numbers("Tr", "0")[0] if "d" not in entry else numbers("d", "1")[0]
    return Material(**changes, name=name)


def _picture(path: Path, name: str, picture: Path) -> np.ndarray:
    try:
        return np.asarray(decode_srgb(texture_pixels(picture.read_bytes())[..., :3]), np.float32)
    except Exception as error:  # a picture library raises whatever its parsers do
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UnreadableFile(
            f"{path}: the map_Kd of its material {name!r}, {picture.name}, cannot be read ({reason}); "
            "is it beside the file?"
        ) from None
