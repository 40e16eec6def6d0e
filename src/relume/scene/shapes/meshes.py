"""Reading meshes: glTF with its physically based materials, OBJ with its .mtl, PLY, STL and USD."""

from __future__ import annotations

import io
import json
import logging
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image.colour import decode_srgb
from relume.scene.gltf.document import GltfDocument, read_document
from relume.scene.gltf.materials import READ, GltfMaterial, read_materials
from relume.scene.gltf.vertices import plain_vertices
from relume.scene.gltf.writing import glb_bytes
from relume.scene.materials.materials import Material
from relume.scene.materials.mtl import read_mtl_materials
from relume.scene.shapes.shapes import Mesh, carried
from relume.scene.shapes.vertex_colours import with_face_colours, with_vertex_colours
from relume.scene.usd.meshes import read_usd_meshes
from relume.scene.usd.stage import SUFFIXES as USD_SUFFIXES

GREY = Material((0.5, 0.5, 0.5), roughness=1.0, name="grey")
"""What a mesh without a material is made of."""
WHITE = Material(roughness=1.0, name="vertex colours")
"""What one is made of that has colours at its vertices: they are all of its looks."""
_COLOURS = "_VERTEX_COLOURS"


def read_meshes(path: str | Path) -> tuple[Mesh, ...]:
    """Read every mesh of a file, placed by the file's own transforms, metres, +Y up.

    path : .glb, .gltf, .obj, .ply, .stl, or USD, which needs the extra `usd`

    Materials of glTF, of OBJ's .mtl and of USD come with their images. What of a file is not rendered is said in one
    warning.
    Raises UnreadableFile when the file is missing, damaged, of an unknown kind or holds no triangles, or when a
    picture of its materials is missing.
    """
    path = Path(path)
    if not path.is_file():
        raise UnreadableFile(f"{path}: no such mesh file; check the path")
    try:
        if path.suffix.lower() in USD_SUFFIXES:
            found, lost = read_usd_meshes(path)
        else:
            scene, materials, lost = _loaded(path)
            found = _placed(path, scene, materials, lost)
    except UnreadableFile:
        raise
    except Exception as error:  # trimesh and OpenUSD raise whatever their parsers do
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UnreadableFile(f"{path}: not a readable mesh ({reason}); export it again as .glb") from None
    for mesh in found:
        _check_extent(path, mesh.name, mesh.vertices, np.eye(4)[:3])
    meshes = [part for mesh in found for part in with_mirrored_apart(mesh)]
    if not meshes:
        raise UnreadableFile(f"{path}: holds no triangles; export the object's mesh")
    if lost:
        said = "; ".join(f"{part}: {', '.join(dict.fromkeys(words))}" for part, words in lost.items())
        warn(f"{path}: not rendered {said}")
    return tuple(meshes)


def _placed(path: Path, scene: Any, materials: dict[str, GltfMaterial | Material], lost: Lost) -> list[Mesh]:
    """The meshes of a trimesh scene in the world; what is lost of their materials is added to `lost`."""
    meshes = []
    for node in sorted(scene.graph.nodes_geometry):
        world_from_mesh, name = scene.graph[node]
        geometry = scene.geometry[name]
        if len(getattr(geometry, "faces", ())):
            _check_extent(path, str(node), np.asarray(geometry.vertices), np.asarray(world_from_mesh)[:3])
            mesh, unplaced = _mesh(geometry, np.asarray(world_from_mesh), materials, str(node))
            if unplaced and isinstance(mesh.material, Material):
                lost.setdefault(f'of material "{mesh.material.name}"', []).extend(unplaced)
            meshes.append(mesh)
    return meshes


Lost = dict[str, list[str]]
"""What is not rendered, by the part of the file that it belongs to."""


def _loaded(path: Path) -> tuple[Any, dict[str, GltfMaterial | Material], Lost]:
    """The file as a trimesh scene, its materials by the names that trimesh knows them by, and what is lost of it."""
    import trimesh
    from trimesh.resolvers import FilePathResolver

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    kind = path.suffix.lower().lstrip(".")
    if kind not in ("glb", "gltf", "obj", "ply", "stl"):
        raise ValueError(f"files of kind .{kind} are not read; use .glb, .gltf, .obj, .ply, .stl or .usd")
    materials: dict[str, GltfMaterial | Material] = {}
    lost: Lost = {}
    if kind in ("glb", "gltf"):
        document = read_document(path)
        header = document.header
        _check_readable(header)
        read = read_materials(document)
        materials = {str(index): material for index, material in enumerate(read)}
        lost = {f'of material "{each.numbers.name}"': list(each.lost) for each in read if each.lost}
        if parts := _unread_primitives(header):
            lost["of its meshes"] = parts
        plain_vertices(document)
        data = _bare(document, read)
        kind = "gltf" if document.chunks is None else "glb"
    else:
        data = path.read_bytes()
    if kind == "obj":
        found, missing = read_mtl_materials(path, data)
        materials = {**found}
        if missing:
            lost["of its materials, whose files are missing"] = list(missing)
    resolver = FilePathResolver(str(path))
    scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=resolver)
    return scene, materials, lost


def _bare(document: GltfDocument, materials: tuple[GltfMaterial, ...]) -> bytes:
    """The file without pictures, each material named by its index, each mesh with the coordinates it uses.

    trimesh keeps names of materials but not their extensions, and only the first set of texture coordinates.
    """
    header = document.header
    for primitive in (p for mesh in header.get("meshes", []) for p in mesh["primitives"]):
        attributes = primitive["attributes"]
        used = materials[primitive["material"]].coordinates if "material" in primitive else 0
        if used and f"TEXCOORD_{used}" in attributes:
            attributes["TEXCOORD_0"] = attributes[f"TEXCOORD_{used}"]
        elif used:
            attributes.pop("TEXCOORD_0", None)
        # trimesh would make colours the whole of the looks; what begins with a bar it hands over as it is.
        if "COLOR_0" in attributes:
            attributes[_COLOURS] = attributes.pop("COLOR_0")
    for key in ("materials", "textures", "images", "samplers", "extensionsRequired"):
        header.pop(key, None)
    if materials:
        header["materials"] = [{"name": str(index)} for index in range(len(materials))]
    return json.dumps(header).encode() if document.chunks is None else glb_bytes(header, document.chunks)


def _check_readable(header: dict[str, Any]) -> None:
    """Raises ValueError for what trimesh would read as zeros, without a word."""
    if lacking := sorted(set(header.get("extensionsRequired", [])) - READ):
        raise ValueError(f"it requires {', '.join(lacking)}, which is not read: leave it out")


def _check_extent(path: Path, name: str, vertices: np.ndarray, placement: np.ndarray) -> None:
    finite = np.all(np.isfinite(vertices)) and np.all(np.isfinite(placement))
    if not finite or not np.ptp(vertices, axis=0).any() or np.linalg.det(placement[:, :3]) == 0:
        raise UnreadableFile(f"{path}: mesh {name!r} has no extent, or not a finite one; check it and export it again")


def _mesh(
    geometry: Any, world_from_mesh: np.ndarray, materials: dict[str, GltfMaterial | Material], name: str
) -> tuple[Mesh, tuple[str, ...]]:
    """The mesh in the world, and what of its material does not lie on it."""
    own = np.asarray(geometry.vertex_normals) if "vertex_normals" in geometry._cache.cache else None
    placed = carried(np.asarray(geometry.vertices), np.asarray(geometry.faces), own, world_from_mesh)
    vertices, faces, normals = placed
    material: Material = GREY
    uv, lost = None, ()
    visual = geometry.visual
    if visual.kind == "texture":
        found = materials.get(str(getattr(getattr(visual, "material", None), "name", "")), GREY)
        uv = None if visual.uv is None else np.asarray(visual.uv, np.float64)
        if isinstance(found, GltfMaterial):
            # glTF's texture coordinates go downwards; ours and trimesh's upwards.
            material, down, lost = found.on(None if uv is None else uv * [1, -1] + [0, 1])
            uv = None if down is None else down * [1, -1] + [0, 1]
        else:
            material = found
    uv = None if uv is None else uv.astype(np.float32)
    return _coloured(Mesh(vertices, faces, material, normals, uv, name), geometry, lost)


def _coloured(mesh: Mesh, geometry: Any, lost: tuple[str, ...]) -> tuple[Mesh, tuple[str, ...]]:
    """The mesh with the colours of its vertices or faces, and what of them does not lie on it.

    glTF's are linear (§3.7.2.1); those of PLY and OBJ are codes of sRGB, as scanners and their programs write them.
    """
    visual, stored = geometry.visual, geometry.vertex_attributes.get(_COLOURS)
    if stored is None and visual.kind not in ("vertex", "face"):
        return mesh, lost
    bare = replace(mesh, material=WHITE) if mesh.material is GREY else mesh
    if visual.kind == "face":
        return with_face_colours(bare, decode_srgb(np.asarray(visual.face_colors)[:, :3] / 255)), lost
    if stored is None:
        return with_vertex_colours(bare, decode_srgb(np.asarray(visual.vertex_colors)[:, :3] / 255)), lost
    if any(isinstance(getattr(mesh.material, field.name), np.ndarray) for field in fields(mesh.material)):
        return mesh, (*lost, "COLOR_0 beside textures")
    stored = np.asarray(stored)
    top = 1.0 if stored.dtype.kind == "f" else float(np.iinfo(stored.dtype).max)
    if stored.shape[1] == 4 and stored[:, 3].min() < top:
        lost = (*lost, "the alpha of COLOR_0")
    return with_vertex_colours(bare, stored[:, :3] / top), lost


def _unread_primitives(header: dict[str, Any]) -> list[str]:
    primitives = [p for mesh in header.get("meshes", []) for p in mesh["primitives"]]
    attributes = {name for primitive in primitives for name in primitive["attributes"]}
    lost = {name for name in attributes if name.startswith(("COLOR_", "JOINTS_")) and name != "COLOR_0"}
    lost |= {"morph targets" for primitive in primitives if primitive.get("targets")}
    return sorted(lost)


def with_mirrored_apart(mesh: Mesh) -> tuple[Mesh, ...]:
    """The mesh itself, or, where its normal map lies mirrored on some triangles, those as a mesh of their own.

    glTF's bitangent points up in the picture. A renderer that takes the cross product of the normal and the tangent
    has it downwards on triangles whose texture is mirrored; their own normal map has its y turned over.
    """
    material = mesh.material
    if mesh.uv is None or not isinstance(material, Material) or material.normal is None:
        return (mesh,)
    a, b, c = (mesh.uv[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    mirrored = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    if not mirrored.any():
        return (mesh,)
    turned = _part(mesh, mirrored, replace(material, normal=material.normal * np.array([1, -1, 1], np.float32)))
    if mirrored.all():
        return (turned,)
    return _part(mesh, ~mirrored, material), turned


def _part(mesh: Mesh, chosen: np.ndarray, material: Material) -> Mesh:
    kept, faces = np.unique(mesh.faces[chosen], return_inverse=True)
    return replace(
        mesh,
        vertices=mesh.vertices[kept],
        faces=faces.reshape(-1, 3).astype(np.int32),
        material=material,
        normals=None if mesh.normals is None else mesh.normals[kept],
        uv=None if mesh.uv is None else mesh.uv[kept],
    )
