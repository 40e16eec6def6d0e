"""A baked place in a file that other programs read, with its textures beside it: `write_place`."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.export.parts import Part
from relume.export.usd.surfaces import mesh_of_part
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.renderers.projective.baking import BakedPlace
from relume.scene.gltf.writing import write_glb
from relume.scene.shapes.shapes import Mesh


@dataclass(frozen=True)
class PlaceFiles:
    """What `write_place` wrote.

    main : the file to open
    textures : beside it, an EXR a mesh of its radiance
    masks : beside it, a PNG a mesh, white where no photograph shows the surface
    holes : the share of the surface that no photograph shows and that was filled, 0 to 1
    """

    main: Path
    textures: tuple[Path, ...]
    masks: tuple[Path, ...]
    holes: float


def write_place(path: str | os.PathLike[str], place: BakedPlace) -> PlaceFiles:
    """Write a baked place as glTF (.glb) or USD (.usda), with its radiance in full precision in EXR files beside it.

    path : the main file, .glb or .usda
    place : as `bake` made it

    A .glb holds the textures in 8 bits for any viewer, cut off above the brightest hundredth, and names the EXRs,
    which `read_meshes` takes instead; USD refers to them. A PNG each shows the holes that were filled. They are written
    one by one, the main one last. Raises ValueError for another suffix, OutputNotWritten.
    """
    path = Path(path)
    require_place_suffix(path)
    kind = path.suffix.lower()
    names = _names(place)
    parts = [replace(part, mesh=replace(part.mesh, name=name)) for part, name in zip(place.parts, names, strict=True)]
    textures = {name: f"{path.stem}_{name}_emissiveColor.exr" for name in names}
    masks = {name: path.parent / f"{path.stem}_{name}_holes.png" for name in names}
    for part in parts:
        files.write(path.parent / textures[part.mesh.name], RadianceMap(part.radiance, unit=place.unit))
        holes = np.where(part.used & ~part.seen, 255, 0).astype(np.uint8)
        files.write(masks[part.mesh.name], Photograph(np.repeat(holes[..., None], 3, axis=-1)))
    if kind == ".glb":
        write_glb(path, [part.mesh for part in parts], radiance=textures)
    else:
        with files.replacing(path) as temporary:
            Path(temporary).write_text(_layer(path, [part.mesh for part in parts], textures), encoding="utf-8")
    return PlaceFiles(path, tuple(path.parent / name for name in textures.values()), tuple(masks.values()), place.holes)


def require_place_suffix(path: Path) -> None:
    """Raises ValueError for a file of a kind that a baked place is not written as."""
    if path.suffix.lower() not in (".glb", ".usda"):
        raise ValueError(f"{path}: a place is written as .glb or .usda; give it one of these suffixes")


def _names(place: BakedPlace) -> list[str]:
    """A name of each mesh that files and USD take: letters, digits and underscores, no two alike in any case.

    Wall and wall are one file on macOS and Windows.
    """
    found: list[str] = []
    taken = set[str]()
    for part in place.parts:
        word = re.sub(r"[^A-Za-z0-9]+", "_", part.mesh.name).strip("_") or "mesh"
        word = f"mesh_{word}" if word[0].isdigit() else word
        name, number = word, len(found)
        while name.casefold() in taken:
            name, number = f"{word}_{number}", number + 1
        taken.add(name.casefold())
        found.append(name)
    return found


def _layer(path: Path, meshes: list[Mesh], textures: dict[str, str]) -> str:
    prims = "".join(
        mesh_of_part("Place/Parts", Part(mesh.name, mesh, True), path.parent, images=textures) for mesh in meshes
    )
    return (
        '#usda 1.0\n(\n    defaultPrim = "Place"\n'
        '    doc = "A place written by relume: what photographs showed of it, as light that its surfaces send out."\n'
        '    metersPerUnit = 1\n    upAxis = "Y"\n)\n\n'
        f'def Xform "Place"\n{{\n    def Xform "Parts"\n    {{\n{prims}    }}\n}}\n'
    )
