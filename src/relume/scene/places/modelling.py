"""A place modelled from marked photographs: the place file in, blocks and cameras out, and the file with both."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from relume.errors import InvalidPlace, warn
from relume.image import files
from relume.scene.places.building import built
from relume.scene.places.marked import place_marks
from relume.scene.places.photographs import PhotographFacts, photograph_facts
from relume.scene.places.place import CameraDeviation, Place, PlacePhotograph
from relume.scene.places.place_tables import FoundBlock, PlaceTables, camera_of, read_tables
from relume.scene.places.reading import read_place
from relume.scene.places.solving import Solution, residual_of, solved
from relume.scene.places.writing import found_text, require_mesh_suffix, without_found, write_meshes


def model_place(
    path: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    export: str | os.PathLike[str] | None = None,
) -> Place:
    """Find the cameras and the blocks' sizes of a place file from the edges marked in its photographs.

    path : the place file, TOML: photographs, blocks with their constraints, marks; the how-to page on places shows one
    out : where to write it with what was found, in the same folder; nothing is written unless given
    export : a mesh file for the blocks: .glb, .obj, .usda or .usd
    All cameras and sizes are found together, so that marked points lie nearest to the projected edges (Debevec, Taylor
    & Malik 1996, §2.4); what the photographs do not agree on is named in `doubts`.
    Raises InvalidPlace, one line: a wrong key or name, a size or camera that the marks do not determine, a photograph
    of another place; UnreadableFile, OutputNotWritten.
    """
    if export is not None:
        require_mesh_suffix(Path(export))
    place, text = modelled(Path(path), out)
    if out is not None:
        files.write_text(out, text)
    if export is not None:
        if not place.blocks:
            raise InvalidPlace(f"{export}: the place has no mesh to export; name one in its file")
        write_meshes(Path(export), place.meshes())
    return place


def modelled(path: Path, out: str | os.PathLike[str] | None) -> tuple[Place, str]:
    """What `model_place` finds, and the place file's text with it, of which nothing is written yet.

    out : where that is to be written, if anywhere
    Raises what `model_place` raises but OutputNotWritten.
    """
    if out is not None and Path(out).absolute().parent != path.absolute().parent:
        raise ValueError(f"{out}: files are named from the place file's folder; write it into {path.absolute().parent}")
    tables = read_tables(path)
    if tables.photogrammetry is not None:
        if out is not None:
            raise ValueError(
                f"{path}: its cameras are those of {tables.photogrammetry.model}; there is nothing to find"
            )
        return read_place(path), ""
    facts = tuple(_facts(path, table.file, table.size) for table in tables.photographs)
    try:
        solution = solved(tables, facts)
        place = _place(path, tables, facts, solution)
    except ValueError as error:
        raise InvalidPlace(f"{path}: {error}") from None
    for doubt in place.doubts:
        warn(f"{path}: {doubt}")
    text = without_found(path.read_text(encoding="utf-8"))
    return place, text + found_text(place, _found_blocks(tables, solution))


def _facts(path: Path, file: str, size: tuple[int, int] | None) -> PhotographFacts:
    """Size and EXIF focal length of a photograph; the file may be missing where the place file gives its size."""
    picture = path.parent / file
    if size is not None and not picture.exists():
        return PhotographFacts(size)
    found = photograph_facts(picture)
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
    blocks = tuple(built(block, found[block.name]) for block in fit.model.blocks)
    return Place(
        blocks, tuple(photographs), solution.covariance, solution.names, solution.chi_square, solution.freedom,
        solution.doubts, marks=place_marks(tables, blocks, photographs),
    )  # fmt: skip


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z
