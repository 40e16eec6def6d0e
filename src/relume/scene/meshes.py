"""Reading meshes: glTF with its physically based materials; OBJ, PLY and STL as shapes of one grey material."""

from __future__ import annotations

import io
import json
import logging
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.image.colour import decode_srgb
from relume.scene.materials import Material
from relume.scene.shapes import Mesh

GREY = Material((0.5, 0.5, 0.5), roughness=1.0, name="grey")
"""What a mesh without a material is made of."""
RENDERED = {"KHR_materials_transmission", "KHR_materials_ior"}
"""Extensions of glTF that are read; a file that requires another, such as compressed vertices, is refused."""
UNDERSTOOD = {
    "name", "extras", "doubleSided", "pbrMetallicRoughness", "extensions", "alphaMode", "alphaCutoff", "emissiveFactor",
    "occlusionTexture", "KHR_materials_transmission", "KHR_materials_ior", "KHR_materials_emissive_strength",
}  # fmt: skip
"""Parts of a glTF material that are rendered or mean nothing to light transport; a warning names any other."""


def read_meshes(path: str | Path) -> tuple[Mesh, ...]:
    """Read every mesh of a file, placed by the file's own transforms, metres, +Y up.

    Raises UnreadableFile when the file is missing, damaged, of an unknown kind or holds no triangles.
    """
    path = Path(path)
    if not path.is_file():
        raise UnreadableFile(f"{path}: no such mesh file; check the path")
    try:
        scene, descriptions = _loaded(path)
    except Exception as error:  # trimesh raises whatever its parsers do
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UnreadableFile(f"{path}: not a readable mesh ({reason}); export it again as .glb") from None
    materials = {index: _material(path, d) for index, d in descriptions.items()}
    wanted = {
        (str(index), key): f"{key} of its material {d.get('name', index)!r}"
        for index, d in descriptions.items()
        for key in ("baseColorTexture", "metallicRoughnessTexture")
        if key in d.get("pbrMetallicRoughness", {})
    }
    meshes = []
    for node in sorted(scene.graph.nodes_geometry):
        world_from_mesh, name = scene.graph[node]
        geometry = scene.geometry[name]
        source = getattr(geometry.visual, "material", None)
        for (index, key), words in wanted.items():
            if getattr(source, "name", None) == index and getattr(source, key, None) is None:
                raise UnreadableFile(f"{path}: the {words} cannot be read; is its picture beside the file?")
        if len(getattr(geometry, "faces", ())):
            _check_extent(path, str(node), np.asarray(geometry.vertices), np.asarray(world_from_mesh)[:3])
            meshes.append(_mesh(geometry, np.asarray(world_from_mesh), materials, str(node)))
    if not meshes:
        raise UnreadableFile(f"{path}: holds no triangles; export the object's mesh")
    return tuple(meshes)


def _loaded(path: Path) -> tuple[Any, dict[int, dict[str, Any]]]:
    """The file as a trimesh scene, and the glTF descriptions of its materials by their index."""
    import trimesh
    from trimesh.resolvers import FilePathResolver

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    kind, data = path.suffix.lower().lstrip("."), path.read_bytes()
    if kind not in ("glb", "gltf", "obj", "ply", "stl"):
        raise ValueError(f"files of kind .{kind} are not read; use .glb, .gltf, .obj, .ply or .stl")
    descriptions: dict[int, dict[str, Any]] = {}
    if kind in ("glb", "gltf"):
        data, descriptions, header = _with_numbered_materials(data, kind)
        _warn_of_primitives(path, header)
    resolver = FilePathResolver(str(path))
    scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=resolver)
    return scene, descriptions


def _with_numbered_materials(data: bytes, kind: str) -> tuple[bytes, dict[int, dict[str, Any]], dict[str, Any]]:
    """The file with each material named by its index, since trimesh keeps names but not extensions."""
    if kind == "glb":
        if data[:4] != b"glTF" or len(data) < 20:
            raise ValueError("no glTF header")
        length = struct.unpack_from("<I", data, 12)[0]
        text, rest = data[20 : 20 + length], data[20 + length :]
    else:
        text, rest = data, b""
    header = json.loads(text)
    _check_readable(header)
    descriptions = dict(enumerate(header.get("materials", [])))
    header["materials"] = [d | {"name": str(index)} for index, d in descriptions.items()]
    if not descriptions:
        del header["materials"]
    text = json.dumps(header).encode()
    if kind == "gltf":
        return text, descriptions, header
    text += b" " * (-len(text) % 4)
    size = 20 + len(text) + len(rest)
    return struct.pack("<4sIII4s", b"glTF", 2, size, len(text), b"JSON") + text + rest, descriptions, header


def _check_readable(header: dict[str, Any]) -> None:
    """Raises ValueError for what trimesh would read as zeros or as whole numbers, without a word."""
    if lacking := sorted(set(header.get("extensionsRequired", [])) - RENDERED):
        raise ValueError(f"it requires {', '.join(lacking)}, which is not read: leave it out")
    accessors = header.get("accessors", [])
    for primitive in (p for mesh in header.get("meshes", []) for p in mesh["primitives"]):
        for name in {"POSITION", "NORMAL", "TEXCOORD_0"} & set(primitive["attributes"]):
            if accessors[primitive["attributes"][name]].get("normalized"):
                raise ValueError(f"its {name} is quantised, which is not read: store 32-bit floats")


def _check_extent(path: Path, name: str, vertices: np.ndarray, placement: np.ndarray) -> None:
    finite = np.all(np.isfinite(vertices)) and np.all(np.isfinite(placement))
    if not finite or not np.ptp(vertices, axis=0).any() or np.linalg.det(placement[:, :3]) == 0:
        raise UnreadableFile(f"{path}: mesh {name!r} has no extent, or not a finite one; check it and export it again")


def _material(path: Path, description: dict[str, Any]) -> Material:
    """The material's numbers; its images come with the mesh."""
    pbr = description.get("pbrMetallicRoughness", {})
    extensions = description.get("extensions", {})
    name = description.get("name", "")
    lost = {*description, *extensions} - UNDERSTOOD
    if any(description.get("emissiveFactor", [])):
        lost.add("emission")
    if description.get("alphaMode", "OPAQUE") != "OPAQUE":
        lost.add("alpha")
    if "transmissionTexture" in extensions.get("KHR_materials_transmission", {}):
        lost.add("transmissionTexture")
    for texture in (pbr.get("baseColorTexture", {}), pbr.get("metallicRoughnessTexture", {})):
        lost |= {key for key in texture.get("extensions", {})} | ({"texCoord"} if texture.get("texCoord") else set())
    if lost:
        warnings.warn(f'{path}: not rendered of material "{name}": {", ".join(sorted(lost))}', stacklevel=4)
    transmission = extensions.get("KHR_materials_transmission", {})
    return Material(
        base_color=tuple(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]),
        metallic=float(pbr.get("metallicFactor", 1)),
        roughness=float(pbr.get("roughnessFactor", 1)),
        transmission=float(transmission.get("transmissionFactor", 0)),
        ior=float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5)),
        name=name,
    )


def _mesh(geometry: Any, world_from_mesh: np.ndarray, materials: dict[int, Material], name: str) -> Mesh:
    turn = world_from_mesh[:3, :3]
    vertices = np.asarray(geometry.vertices) @ turn.T + world_from_mesh[:3, 3]
    faces = np.asarray(geometry.faces)
    if np.linalg.det(turn) < 0:
        faces = faces[:, ::-1]
    normals = None
    if "vertex_normals" in geometry._cache.cache:
        normals = np.asarray(geometry.vertex_normals) @ np.linalg.inv(turn)
        normals = (normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)).astype(np.float32)
    visual = geometry.visual
    material, uv = GREY, None
    if visual.kind == "texture":
        source = getattr(visual, "material", None)
        key = str(getattr(source, "name", ""))
        material = materials.get(int(key), GREY) if key.isdigit() else GREY
        if visual.uv is not None:
            uv = np.asarray(visual.uv, np.float32)
            material = _with_images(material, source)
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32), material, normals, uv, name)


def _warn_of_primitives(path: Path, header: dict[str, Any]) -> None:
    attributes = {name for mesh in header.get("meshes", []) for p in mesh["primitives"] for name in p["attributes"]}
    lost = {name for name in attributes if name.startswith(("COLOR_", "JOINTS_"))}
    lost |= {"morph targets" for mesh in header.get("meshes", []) for p in mesh["primitives"] if p.get("targets")}
    if lost:
        warnings.warn(f"{path}: not rendered of its meshes: {', '.join(sorted(lost))}", stacklevel=5)


def _with_images(material: Material, source: Any) -> Material:
    """The material with its base colour and metallic–roughness images multiplied by its numbers, as glTF says."""
    base: Any = material.base_color
    metallic: Any = material.metallic
    roughness: Any = material.roughness
    picture = getattr(source, "baseColorTexture", None)
    if picture is not None:
        base = decode_srgb(np.asarray(picture.convert("RGB")) / 255) * np.asarray(material.base_color)
    picture = getattr(source, "metallicRoughnessTexture", None)
    if picture is not None:
        packed = np.asarray(picture.convert("RGB")).astype(np.float32) / 255
        roughness, metallic = packed[..., 1] * material.roughness, packed[..., 2] * material.metallic
    return Material(
        np.asarray(base, np.float32) if np.ndim(base) > 1 else base,
        metallic,
        roughness,
        material.transmission,
        material.ior,
        material.name,
    )
