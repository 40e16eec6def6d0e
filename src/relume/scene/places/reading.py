"""Places from their files, for whatever needs their cameras or their shapes."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from relume.errors import InvalidPlace
from relume.scene.places.building import built
from relume.scene.places.marked import place_marks
from relume.scene.places.photogrammetry.reading import KnownDistance, read_photogrammetry
from relume.scene.places.place import CameraDeviation, Place, PlacePhotograph
from relume.scene.places.place_tables import PhotogrammetryTable, camera_of, read_tables
from relume.scene.places.quantities import modelled
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh


def read_place(path: str | os.PathLike[str]) -> Place:
    """Read a place file that `model_place` has written, or one that names photogrammetry made elsewhere.

    path : the place file, .toml

    Its covariance is not in the file; each size and each camera has its deviation. Distances of marks are those of the
    marks as the file has them now.
    Raises InvalidPlace where nothing was found yet, or the blocks or photographs have changed since.
    """
    path = Path(path)
    tables = read_tables(path)
    if tables.photogrammetry is not None:
        return _of_photogrammetry(path, tables.photogrammetry)
    found = tables.found
    if found is None:
        raise InvalidPlace(f"{path}: nothing was found in it yet; run `relume model {path.name} -o {path.name}` first")
    try:
        model = modelled(tables.blocks)
        if new := [block.name for block in model.blocks if block.name not in found.blocks]:
            raise ValueError(f"block {new[0]!r} was added since it was solved; run `relume model` again")
        blocks = [built(block, found.blocks[block.name]) for block in model.blocks]
    except ValueError as error:
        raise InvalidPlace(f"{path}: {error}") from None
    photographs = []
    for table in tables.photographs:
        if table.name not in found.cameras:
            raise InvalidPlace(f"{path}: photograph {table.name!r} was added since; run `relume model` again")
        seen = found.cameras[table.name]
        camera = camera_of(table, seen.size, seen.focal_length, np.array(seen.position), np.array(seen.rotation))
        deviation = CameraDeviation(
            seen.position_deviation, float(np.radians(seen.rotation_deviation)), seen.focal_length_deviation
        )
        marks = sum(len(points) for edges in tables.marks.get(table.name, {}).values() for points in edges.values())
        photographs.append(
            PlacePhotograph(table.name, path.parent / table.file, camera, deviation, seen.residual, marks)
        )
    try:
        given = place_marks(tables, blocks, photographs)
    except ValueError as error:
        raise InvalidPlace(f"{path}: {error}") from None
    return Place(
        tuple(blocks), tuple(photographs), chi_square=found.chi_square, freedom=found.freedom, doubts=found.doubts,
        marks=given,
    )  # fmt: skip


def read_shapes(path: str | os.PathLike[str]) -> tuple[Mesh, ...]:
    """The meshes of a mesh file; of a place file, .toml, one of all blocks.

    One surface, for a plate shows few blocks well: what it does not show then takes its reflectance from the rest.
    """
    path = Path(path)
    if path.suffix.lower() != ".toml":
        return read_meshes(path)
    parts = read_place(path).meshes()
    if not parts:
        raise InvalidPlace(f"{path}: the place has no mesh; name one in its file")
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=True)]
    vertices = np.concatenate([part.vertices for part in parts])
    return (Mesh(vertices, np.concatenate(faces).astype(np.int32), parts[0].material, name=path.stem),)


def _of_photogrammetry(path: Path, table: PhotogrammetryTable) -> Place:
    folder = path.parent
    scale: float | KnownDistance | None = table.metres_per_unit
    if table.between is not None and table.metres is not None:
        scale = KnownDistance(*table.between, table.metres)
    try:
        return read_photogrammetry(
            folder / table.model, scale=scale, up=table.up,
            mesh=None if table.mesh is None else folder / table.mesh,
            photographs=None if table.photographs is None else folder / table.photographs,
        )  # fmt: skip
    except ValueError as error:
        raise InvalidPlace(f"{path}: {error}") from None
