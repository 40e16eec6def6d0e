"""What `relume model` writes: the place file with what was found, and the blocks as a mesh file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from relume.image import files
from relume.scene.gltf.writing import write_glb
from relume.scene.places.place import Place
from relume.scene.places.place_tables import FoundBlock
from relume.scene.shapes.shapes import Mesh

BEGINNING = "# Found by `relume model`, which writes all below anew; lengths are metres, angles degrees."
SUFFIXES = (".glb", ".obj", ".usda", ".usd")


def without_found(text: str) -> str:
    """A place file's text but for what was found before; marks and comments stay as they are."""
    return text.split(BEGINNING)[0].rstrip() + "\n\n"


def found_text(place: Place, blocks: dict[str, FoundBlock]) -> str:
    """The tables of what was found, TOML."""
    lines = [BEGINNING, "[found]", f"chi_square = {place.chi_square:.6g}", f"freedom = {place.freedom}"]
    lines.append(f"doubts = {json.dumps(list(place.doubts), ensure_ascii=False)}")
    for photograph in place.photographs:
        camera, deviation = photograph.camera, photograph.deviation
        rows = ", ".join(_row(row) for row in camera.rotation)
        lines += [
            "",
            f"[found.cameras.{json.dumps(photograph.name)}]",
            f"position = {_row(camera.position)}",
            f"rotation = [{rows}]",
            f"size = [{camera.width}, {camera.height}]",
            f"focal_length = {float(camera.focal_length)!r}",
            f"position_deviation = {deviation.position:.3g}",
            f"rotation_deviation = {np.degrees(deviation.rotation):.3g}",
            f"focal_length_deviation = {deviation.focal_length:.3g}",
            f"residual = {photograph.residual:.3g}",
        ]
    for name, block in blocks.items():
        lines += ["", f"[found.blocks.{json.dumps(name)}]"]
        lines += [f"{key} = {_row(getattr(block, key))}" for key in ("size", "deviation", "low")]
        lines.append(f"turn = {block.turn!r}")
    return "\n".join(lines) + "\n"


def _row(values: Sequence[float] | np.ndarray) -> str:
    return f"[{', '.join(repr(float(v)) for v in values)}]"


def require_mesh_suffix(path: Path) -> None:
    """Raises ValueError for a mesh file of a kind that is not written."""
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{path}: meshes are written as {', '.join(SUFFIXES)}; give it one of these suffixes")


def write_meshes(path: Path, meshes: Sequence[Mesh]) -> None:
    """Write meshes without textures by the suffix, whole or not at all; raises OutputNotWritten."""
    require_mesh_suffix(path)
    if path.suffix.lower() == ".glb":
        write_glb(path, meshes)
    elif path.suffix.lower() == ".obj":
        files.write_text(path, _obj(meshes))
    else:
        files.write_text(path, _usda(meshes))


def _obj(meshes: Sequence[Mesh]) -> str:
    lines, first = ["# metres, +Y up"], 1
    for mesh in meshes:
        lines.append(f"o {mesh.name}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces + first).tolist()]
        first += len(mesh.vertices)
    return "\n".join(lines) + "\n"


def _usda(meshes: Sequence[Mesh]) -> str:
    lines = [
        '#usda 1.0\n(\n    defaultPrim = "Place"\n    metersPerUnit = 1\n    upAxis = "Y"\n)\n',
        'def Xform "Place"\n{',
    ]
    for number, mesh in enumerate(meshes):
        points = ", ".join(f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in mesh.vertices.tolist())
        name = f"block_{number:02d}_" + "".join(c if c.isascii() and c.isalnum() else "_" for c in mesh.name)
        lines += [
            f'    def Mesh "{name}"\n    {{',
            '        uniform token subdivisionScheme = "none"',
            f"        point3f[] points = [{points}]",
            f"        int[] faceVertexCounts = {[3] * len(mesh.faces)}",
            f"        int[] faceVertexIndices = {mesh.faces.reshape(-1).tolist()}",
            "    }",
        ]
    return "\n".join([*lines, "}"]) + "\n"
