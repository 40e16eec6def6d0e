"""Photogrammetry made elsewhere as a place: its cameras, points and mesh in metres, +Y up."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.cameras.camera import Camera
from relume.scene.places.photogrammetry.colmap import read_colmap
from relume.scene.places.photogrammetry.gltf import read_gltf_views
from relume.scene.places.photogrammetry.model import DOWN_AND_AHEAD, FoundModel
from relume.scene.places.photogrammetry.sfm_json import read_sfm_json
from relume.scene.places.place import UNKNOWN_DEVIATION, Place, PlaceBlock, PlacePhotograph
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh, carried
from relume.sphere.directions import rotation_between

End = str | int | tuple[float, float, float]
"""A photograph's camera by its file's name, a point by its number, or a place in the model's own unit."""


@dataclass(frozen=True)
class KnownDistance:
    """A distance that was measured at the place.

    start, end : between which cameras, numbered points or places of the model
    metres : between them
    """

    start: End
    end: End
    metres: float

    def __post_init__(self) -> None:
        if not 0 < self.metres < np.inf:
            raise ValueError(f"a known distance of {self.metres} m; expected metres, more than 0")


def read_photogrammetry(
    path: str | os.PathLike[str],
    *,
    scale: float | KnownDistance | None = None,
    up: tuple[float, float, float] | None = None,
    mesh: str | os.PathLike[str] | None = None,
    photographs: str | os.PathLike[str] | None = None,
) -> Place:
    """Read what a program of photogrammetry found in photographs as a place in metres, +Y up.

    path : a folder of COLMAP's (cameras, images and points3D, .bin or .txt), the .json or .sfm of Meshroom or OpenMVG,
        or a glTF file whose cameras are named as the photographs
    scale : metres to a unit of the model, or a known distance; no such program knows it. glTF is in metres
    up : what points up, in the model's frame; against y, as the first camera has it, unless given; +y of glTF
    mesh : the mesh that the program made, in the model's frame; becomes the place's blocks
    photographs : their folder; that of the model unless given. The files need not be there
    Deviations and residuals are not known, NaN. Raises UnreadableFile for a model that is damaged, without a camera or
    of a lens that is not read, ValueError for one without scale.
    """
    path = Path(path)
    folder = path if path.is_dir() else path.parent
    folder = folder if photographs is None else Path(photographs)
    found = _read(path, folder)
    unit = _unit(path, found, scale)
    turn = _turn(found.up if up is None else up)
    views = []
    for view in found.views:
        camera = Camera(
            *view.size, view.focal, unit * turn @ view.position, turn @ view.rotation.T @ DOWN_AND_AHEAD, view.centre,
            view.distortion,
        )  # fmt: skip
        views.append(PlacePhotograph(view.name, folder / view.name, camera, UNKNOWN_DEVIATION, float("nan"), 0))
    matrix = np.eye(4)
    matrix[:3, :3] = unit * turn
    meshes = () if mesh is None else tuple(_carried(each, matrix) for each in read_meshes(Path(mesh)))
    blocks = tuple(_block(each) for each in meshes)
    return Place(blocks, tuple(views), points=unit * found.points @ turn.T)


def _read(path: Path, photographs: Path) -> FoundModel:
    if path.is_dir():
        return read_colmap(path)
    if not path.is_file():
        raise UnreadableFile(f"{path}: no such model of photogrammetry; check the path")
    suffix = path.suffix.lower()
    if suffix in (".bin", ".txt"):
        return read_colmap(path.parent)
    if suffix in (".json", ".sfm"):
        return read_sfm_json(path)
    if suffix in (".glb", ".gltf"):
        return read_gltf_views(path, photographs)
    raise UnreadableFile(
        f"{path}: no model of photogrammetry; give COLMAP's folder, Meshroom's or OpenMVG's .json, or glTF"
    )


def _unit(path: Path, found: FoundModel, scale: float | KnownDistance | None) -> float:
    """Metres to a unit of the model."""
    if scale is None and not found.scaled:
        raise ValueError(
            f"{path}: photogrammetry has no scale; give the metres of one unit, or a distance that was measured "
            "between two cameras or points"
        )
    if not isinstance(scale, KnownDistance):
        unit = 1.0 if scale is None else float(scale)
        if not 0 < unit < np.inf:
            raise ValueError(f"{path}: a scale of {unit:g} metres to a unit; expected a number above 0")
        return unit
    apart = float(np.linalg.norm(_place(path, found, scale.end) - _place(path, found, scale.start)))
    if not apart > 0:
        raise ValueError(f"{path}: {scale.start!r} and {scale.end!r} are the same place; give two that lie apart")
    return scale.metres / apart


def _place(path: Path, found: FoundModel, end: End) -> np.ndarray:
    if isinstance(end, str):
        for view in found.views:
            if end in (view.name, Path(view.name).stem):
                return view.position
        if end.isdecimal():
            return _place(path, found, int(end))
        names = ", ".join(view.name for view in found.views[:5])
        raise ValueError(f"{path}: no camera of a photograph {end!r}; it holds {names}{', …' * (len(found.views) > 5)}")
    if isinstance(end, int):
        rows = np.flatnonzero(found.numbers == end)
        if not len(rows):
            raise ValueError(f"{path}: no point {end}; it holds {len(found.numbers)} points")
        return found.points[rows[0]]
    return np.asarray(end, np.float64)


def _turn(up: tuple[float, float, float]) -> np.ndarray:
    """World from the model's frame, for what points up in it; of y down and looking ahead, half a turn about x."""
    direction = np.asarray(up, np.float64)
    if direction.shape != (3,) or not 0 < np.linalg.norm(direction) < np.inf:
        raise ValueError(f"up is {up}; expected a direction of the model's frame, like (0, -1, 0)")
    first = DOWN_AND_AHEAD if direction[1] < 0 else np.eye(3)
    return rotation_between(first @ direction, (0.0, 1.0, 0.0)) @ first


def _carried(mesh: Mesh, matrix: np.ndarray) -> Mesh:
    vertices, faces, normals = carried(mesh.vertices.astype(np.float64), mesh.faces, mesh.normals, matrix)
    return Mesh(vertices, faces, mesh.material, normals, mesh.uv, mesh.name)


def _block(mesh: Mesh) -> PlaceBlock:
    size = np.ptp(mesh.vertices.astype(np.float64), axis=0)
    return PlaceBlock(mesh.name, "mesh", mesh, size, np.full(3, np.nan), {}, {})
