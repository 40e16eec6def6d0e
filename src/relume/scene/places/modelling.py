"""A place modelled from marked photographs: the place file in, blocks and cameras out, and the file with both."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from relume.errors import InvalidPlace, RelumeError, warn
from relume.image import files
from relume.image.files.signatures import MAPS, kind_of
from relume.scene.materials.materials import Diffuse
from relume.scene.places.place import CameraDeviation, Place, PlaceBlock, PlacePhotograph
from relume.scene.places.place_tables import FoundBlock, PlaceTables, read_tables
from relume.scene.places.quantities import SoughtBlock, modelled
from relume.scene.places.solving import PhotographFacts, Solution, camera_of, residual_of, solved
from relume.scene.places.writing import found_text, require_mesh_suffix, without_found, write_meshes
from relume.scene.shapes.shapes import Mesh
from relume.sphere.directions import rotation_about

GREY = Diffuse((0.5, 0.5, 0.5))
"""What blocks are made of until somebody knows better."""


def model_place(
    path: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    export: str | os.PathLike[str] | None = None,
) -> Place:
    """Find the cameras and the blocks' sizes of a place file from the edges marked in its photographs.

    path : the place file, TOML: photographs, blocks with their constraints, marks; see docs/light.md
    out : where to write it with what was found, in the same folder; nothing is written unless given
    export : a mesh file for the blocks: .glb, .obj, .usda or .usd
    All cameras and sizes are found together, so that marked points lie nearest to the projected edges (Debevec, Taylor
    & Malik 1996, §2.4); what the photographs do not agree on is named in `doubts`.
    Raises InvalidPlace, one line: a wrong key or name, a size or camera that the marks do not determine, a photograph
    of another place; UnreadableFile, OutputNotWritten.
    """
    path = Path(path)
    if export is not None:
        require_mesh_suffix(Path(export))
    if out is not None and Path(out).absolute().parent != path.absolute().parent:
        raise ValueError(f"{out}: files are named from the place file's folder; write it into {path.absolute().parent}")
    tables = read_tables(path)
    facts = tuple(_facts(path, table.file, table.size) for table in tables.photographs)
    try:
        solution = solved(tables, facts)
    except ValueError as error:
        raise InvalidPlace(f"{path}: {error}") from None
    place = _place(path, tables, facts, solution)
    for doubt in place.doubts:
        warn(f"{path}: {doubt}")
    if out is not None:
        text = without_found(path.read_text(encoding="utf-8"))
        files.write_text(out, text + found_text(place, _found_blocks(tables, solution)))
    if export is not None:
        write_meshes(Path(export), place.meshes())
    return place


def read_place(path: str | os.PathLike[str]) -> Place:
    """Read a place file that `model_place` has written: blocks and cameras, but for the covariance.

    Raises InvalidPlace where nothing was found yet, or the blocks or photographs have changed since.
    """
    path = Path(path)
    tables = read_tables(path)
    found = tables.found
    if found is None:
        raise InvalidPlace(f"{path}: nothing was found in it yet; run `relume model {path.name} -o {path.name}` first")
    try:
        model = modelled(tables.blocks)
    except ValueError as error:
        raise InvalidPlace(f"{path}: {error}") from None
    blocks, photographs = [], []
    for block in model.blocks:
        if block.name not in found.blocks:
            raise InvalidPlace(f"{path}: block {block.name!r} was added since it was solved; run `relume model` again")
        blocks.append(_built(block, found.blocks[block.name]))
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
    return Place(
        tuple(blocks), tuple(photographs), chi_square=found.chi_square, freedom=found.freedom, doubts=found.doubts
    )


def _facts(path: Path, file: str, size: tuple[int, int] | None) -> PhotographFacts:
    """Size and EXIF focal length of a photograph; the file may be missing where the place file gives its size."""
    picture = path.parent / file
    if size is not None and not picture.exists():
        return PhotographFacts(size)
    if kind_of(picture) in MAPS:
        height, width = files.read(picture).radiance.shape[:2]
        found = PhotographFacts((width, height))
    else:
        photograph = files.read_photograph(picture)
        found = PhotographFacts(photograph.size, photograph.focal_length)
    if size is not None and size != found.size:
        raise InvalidPlace(
            f"{path}: {file} has {found.size[0]}×{found.size[1]} pixels, not {size[0]}×{size[1]}; the marks are of the "
            "size that is given: mark the picture itself, or leave size out"
        )
    return found


def _found_blocks(tables: PlaceTables, solution: Solution) -> dict[str, FoundBlock]:
    """Each block's size with its deviations, low corner and turn."""
    fit, values = solution.fit, solution.values
    count = len(fit.model.lengths)
    one, spread = np.concatenate([[1.0], values[:count]]), solution.covariance[:count, :count]
    angles = fit.angles(values)
    found = {}
    for block in fit.model.blocks:
        size, low = (np.stack([fit.model.row(q) for q in three]) for three in (block.size, block.low))
        deviation = np.sqrt(np.maximum(np.einsum("ip,pq,iq->i", size[:, 1:], spread, size[:, 1:]), 0))
        found[block.name] = FoundBlock(
            size=_three(size @ one), deviation=_three(deviation), low=_three(low @ one),
            turn=float(np.degrees(angles[block.turn])),
        )  # fmt: skip
    return found


def _place(path: Path, tables: PlaceTables, facts: tuple[PhotographFacts, ...], solution: Solution) -> Place:
    fit, values = solution.fit, solution.values
    found = _found_blocks(tables, solution)
    rotations, (_, positions, focal) = fit.rotations(values), fit.cameras(values)
    deviations = np.sqrt(np.diag(solution.covariance))
    photographs = []
    for k, table in enumerate(tables.photographs):
        first = fit.first_camera + 6 * k
        lens = fit.views[k].lens
        deviation = CameraDeviation(
            float(np.linalg.norm(deviations[first + 3 : first + 6])),
            float(np.linalg.norm(deviations[first : first + 3])),
            0.0 if lens is None else float(focal[k] * deviations[fit.first_lens + lens]),
        )
        camera = camera_of(table, facts[k].size, float(focal[k]), positions[k], rotations[k])
        marks = int(np.sum(fit.marks.photograph == k) + np.sum(fit.marks.corner_photograph == k))
        residual = residual_of(fit, solution.residuals, k)
        photographs.append(PlacePhotograph(table.name, path.parent / table.file, camera, deviation, residual, marks))
    return Place(
        tuple(_built(block, found[block.name]) for block in fit.model.blocks), tuple(photographs),
        solution.covariance, solution.names, solution.chi_square, solution.freedom, solution.doubts,
    )  # fmt: skip


def _built(block: SoughtBlock, found: FoundBlock) -> PlaceBlock:
    """The block in the world."""
    size, body = np.array(found.size), block.body
    if np.any(size < 0):
        raise InvalidPlace(f"block {block.name!r} came out inside out, {list(size)} m; are its marks named the right way?")
    upright = rotation_about([0.0, 1.0, 0.0], float(np.radians(found.turn)))
    points = (np.array(found.low) + body.vertices * size) @ upright.T
    faces = body.triangles
    a, b, c = (body.vertices[faces[:, i]] for i in range(3))
    whole = np.any(np.cross(b - a, c - a), axis=-1)  # a cone's tip has triangles without area
    mesh = Mesh(points.astype(np.float32), faces[whole], GREY, name=block.name)
    return PlaceBlock(
        block.name, block.kind, mesh, size, np.array(found.deviation),
        {name: points[i] for name, i in body.corners.items()},
        {name: points[list(ring)] for name, ring in body.edges.items()},
    )  # fmt: skip


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z
