"""Colours at the vertices of a mesh, as scans and sculptures have them, made a texture that every renderer reads.

Each triangle has a square of texels of its own: its corners stand on the middles of three of them, and a bilinear
look-up between is the straight interpolation of its three colours. Behind the long side, where no ray looks but the
interpolation reaches, the same plane goes on, cut off at 0 and 1.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.errors import warn
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh

_FINE = 2**18  # triangles up to which a square has 4 × 4 texels, so that the cut moves no colour by more than 1/12
_EVEN = 1 / 512  # of white: colours that differ by less are one


def with_vertex_colours(mesh: Mesh, colours: np.ndarray) -> Mesh:
    """The mesh with its base colour times colours at its vertices, (N, 3) linear Rec. 709 from 0 to 1.

    Its texture coordinates become those of the squares, so that its material may hold no images; corners that triangles
    shared are apart. A mesh of one colour stays as it is, and its material takes the colour.
    """
    return _painted(mesh, _shares(mesh, colours)[mesh.faces])


def with_face_colours(mesh: Mesh, colours: np.ndarray) -> Mesh:
    """The same of colours of its faces, (M, 3)."""
    return _painted(mesh, np.repeat(_shares(mesh, colours)[:, None], 3, axis=1))


def with_corner_colours(mesh: Mesh, colours: np.ndarray) -> Mesh:
    """The same of colours of the corners of its faces, (M, 3, 3)."""
    return _painted(mesh, _shares(mesh, colours))


def _shares(mesh: Mesh, colours: np.ndarray) -> np.ndarray:
    """The colours as shares of the light that a surface sends back, 0 to 1; warns of others, which are cut off."""
    given = np.asarray(colours, np.float32)
    if not np.isfinite(given).all():
        warn(f"{mesh.name or 'a mesh'}: some of its vertex colours are no numbers, and count as black")
        given = np.nan_to_num(given, nan=0.0, posinf=1.0, neginf=0.0)
    odd = given.max(initial=0) if given.max(initial=0) > 1 + _EVEN else given.min(initial=0)
    if odd > 1 or odd < -_EVEN:
        warn(
            f"{mesh.name or 'a mesh'}: vertex colours such as {odd:.3g} are cut to 0 … 1, for no surface sends back "
            "more than it gets; divide them by their greatest, or make them codes of sRGB"
        )
    return np.clip(given, 0, 1)


def _painted(mesh: Mesh, corners: np.ndarray) -> Mesh:
    """Corners (M, 3, 3): of each triangle, of each of its corners, a colour."""
    assert isinstance(mesh.material, Material)  # as every reader of meshes makes them
    factor = np.asarray(mesh.material.base_color, np.float32)
    if np.ptp(corners.reshape(-1, 3), axis=0).max() < _EVEN:
        return replace(mesh, material=replace(mesh.material, base_color=triple(factor * corners[0, 0])))
    # A square of texels for each triangle, in rows.
    count = len(corners)
    side = 4 if count <= _FINE else 2
    columns = int(np.ceil(np.sqrt(count)))
    rows = -(-count // columns)
    steps = np.linspace(0, 1, side, dtype=np.float32)
    across, down = steps[None, None, :, None], steps[None, :, None, None]
    first, second, third = (corners[:, corner, None, None] for corner in range(3))
    squares = np.zeros((rows * columns, side, side, 3), np.float32)
    squares[:count] = np.clip(first + across * (second - first) + down * (third - first), 0, 1)
    image = squares.reshape(rows, columns, side, side, 3).swapaxes(1, 2).reshape(rows * side, columns * side, 3)
    # The corners on the middles of texels: first at the top left, second to its right, third below.
    row, column = np.divmod(np.arange(count), columns)
    places = np.array([[0, 0], [side - 1, 0], [0, side - 1]]) + 0.5
    texels = side * np.stack([column, row], axis=1)[:, None] + places
    uv = texels / [columns * side, rows * side] * [1, -1] + [0, 1]
    return replace(
        mesh,
        vertices=mesh.vertices[mesh.faces].reshape(-1, 3),
        faces=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        material=replace(mesh.material, base_color=image * factor),
        normals=None if mesh.normals is None else mesh.normals[mesh.faces].reshape(-1, 3),
        uv=uv.reshape(-1, 2).astype(np.float32),
    )
