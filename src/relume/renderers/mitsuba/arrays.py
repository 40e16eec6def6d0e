"""Arrays in Mitsuba's words: numbers, colours and images as its textures, and triangles as its meshes."""

from __future__ import annotations

from typing import Any

import numpy as np

from relume.scene.materials.materials import Colour
from relume.scene.shapes.shapes import Mesh

ALIGNMENT = 64
"""Bytes: what the widest vectors of a processor hold."""


def rgb(colour: Colour | np.ndarray) -> dict[str, Any]:
    """A colour in Mitsuba's words."""
    return {"type": "rgb", "value": [float(channel) for channel in colour]}


def texture_words(mi: Any, value: Any) -> Any:
    """What a plugin's parameter is set to: a number, a colour, or a bitmap of linear values that repeats.

    value : a number, a triple, or an image (H, W) or (H, W, 3)
    """
    array = np.asarray(value, np.float32)
    if array.ndim == 0:
        return float(array)
    if array.ndim == 1:
        return rgb(array)
    return _bitmap_words(mi, array)


def texture(mi: Any, value: Any) -> Any:
    """The same as a texture of its own, for plugins written in Python."""
    array = np.asarray(value, np.float32)
    if array.ndim == 0:
        return mi.load_dict({"type": "uniform", "value": float(array)})
    if array.ndim == 1:
        # An image of one pixel is bounded by nothing: `rgb` would have to be below 1.
        array = array[None, None]
    return mi.load_dict(_bitmap_words(mi, array))


def _bitmap_words(mi: Any, image: np.ndarray) -> dict[str, Any]:
    bitmap = mi.Bitmap(np.ascontiguousarray(image if image.ndim == 3 else image[..., None]))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True}


def aligned(values: np.ndarray, kind: type[np.generic]) -> np.ndarray:
    """All values in one row, of a kind, in memory that begins where Dr.Jit's own does.

    Dr.Jit takes NumPy's memory as it lies, and compiles other kernels where it lies otherwise.
    """
    flat = np.ravel(values)
    memory = np.empty(flat.size * np.dtype(kind).itemsize + ALIGNMENT, np.uint8)
    skipped = -memory.ctypes.data % ALIGNMENT
    row = memory[skipped : len(memory) - ALIGNMENT + skipped].view(kind)
    row[:] = flat
    return row


def triangles(mi: Any, mesh: Mesh, parts: dict[str, Any]) -> Any:
    """Triangles as a Mitsuba mesh, with the surface, emitter and medium that `parts` says; `uv` as Mitsuba has it."""
    properties = mi.Properties()
    for name, words in parts.items():
        properties[name] = mi.load_dict(words) if isinstance(words, dict) else words
    arrays = {"vertex_positions": mesh.vertices, "vertex_normals": mesh.normals, "vertex_texcoords": mesh.uv}
    built = mi.Mesh(
        mesh.name, len(mesh.vertices), len(mesh.faces), props=properties,
        has_vertex_normals=mesh.normals is not None, has_vertex_texcoords=mesh.uv is not None,
    )  # fmt: skip
    parameters = mi.traverse(built)
    parameters["faces"] = aligned(mesh.faces, np.uint32)
    for name, values in arrays.items():
        if values is not None:
            parameters[name] = aligned(values, np.float32)
    parameters.update()
    return built
