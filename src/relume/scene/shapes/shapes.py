"""Shapes with their materials, in world coordinates (metres, +Y up)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.materials.reflective import Reflective
from relume.scene.materials.whitted import WhittedMaterial

AnyMaterial = Material | Diffuse | Ward | MeasuredBRDF | ABCFacets | Reflective | WhittedMaterial


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles.

    vertices : (N, 3) float32, metres, world
    faces : (M, 3) int32, counter-clockwise from outside
    material : what it is made of
    normals : (N, 3) float32 unit vectors for smooth shading, or None for flat faces
    uv : (N, 2) float32 texture coordinates, (0, 0) the lower left corner, or None
    name : for messages
    """

    vertices: np.ndarray
    faces: np.ndarray
    material: AnyMaterial
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None
    name: str = "mesh"

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or not len(self.vertices):
            raise ValueError(f"vertices of {self.name!r} are {self.vertices.shape}; expected (N, 3)")
        if self.faces.ndim != 2 or self.faces.shape[1] != 3 or not len(self.faces):
            raise ValueError(f"faces of {self.name!r} are {self.faces.shape}; expected (M, 3)")

    @cached_property
    def _extent(self) -> tuple[np.ndarray, np.ndarray, float]:
        """The lowest and the highest corner of its box, and the radius of a sphere about its middle.

        Kept, as a renderer asks some seven times: of millions of triangles each takes a twentieth of building the tree.
        """
        points = self.vertices.astype(np.float64)
        low, high = points.min(axis=0), points.max(axis=0)
        return low, high, float(np.linalg.norm(points - (low + high) / 2, axis=1).max())


@dataclass(frozen=True)
class Plane:
    """The horizontal plane y = `height`, whole or a rectangle of it.

    material : what it is made of
    size : (along x, along z) in metres, centred on the y axis; None for one so large that its edge is the horizon
    height : y, metres
    """

    material: AnyMaterial
    size: tuple[float, float] | None = None
    height: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite(self.height):
            raise ValueError(f"height of the plane is {self.height}; expected metres")
        if self.size is not None and not all(0 < s < np.inf for s in self.size):
            raise ValueError(f"size of the plane is {self.size}; expected two positive lengths in metres")

    @property
    def extent(self) -> tuple[float, float]:
        """The lengths along x and z that a renderer should make it, metres; a kilometre passes for the horizon."""
        return self.size if self.size is not None else (1000.0, 1000.0)


@dataclass(frozen=True)
class Sphere:
    """A sphere with an exact surface, not made of triangles.

    centre : metres, world
    radius : metres
    material : what it is made of
    name : for messages

    Texture coordinates are a lat-long map's: (0, 0) the lower left corner, the middle towards −Z, the top row at +Y.
    """

    centre: tuple[float, float, float]
    radius: float
    material: AnyMaterial
    name: str = "sphere"

    def __post_init__(self) -> None:
        if len(self.centre) != 3 or not np.all(np.isfinite(self.centre)):
            raise ValueError(f"centre of {self.name!r} is {self.centre}; expected three lengths in metres")
        if not 0 < self.radius < np.inf:
            raise ValueError(f"radius of {self.name!r} is {self.radius}; expected a positive length in metres")


@dataclass(frozen=True, eq=False)
class Polygon:
    """A flat polygon, which need not be convex.

    vertices : (N, 3) float64, metres, world; counter-clockwise as seen from outside, in one plane
    material : what it is made of
    name : for messages

    Texture coordinates go from 0 to 1 over the rectangle around it whose u runs along its first edge.
    """

    vertices: np.ndarray
    material: AnyMaterial
    name: str = "polygon"

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or len(self.vertices) < 3:
            raise ValueError(f"{self.name!r} has {len(self.vertices)} vertices; expected three or more, of x, y and z")
        if not np.all(np.isfinite(self.vertices)):
            raise ValueError(f"some vertices of {self.name!r} are not finite; expected metres")
        size = np.ptp(self.vertices, axis=0).max()
        area = np.linalg.norm(self.area_vector)
        if not area > 1e-12 * size**2:
            raise ValueError(f"{self.name!r} has no area; its vertices lie on a line or cross over")
        off = np.abs((self.vertices - self.vertices.mean(axis=0)) @ (self.area_vector / area)).max()
        if off > 1e-6 * size:
            raise ValueError(f"vertices of {self.name!r} are up to {off:g} m out of one plane; split it into triangles")

    @property
    def area_vector(self) -> np.ndarray:
        """The area times the outward normal, (3,) (Newell's method)."""
        around = self.vertices - self.vertices[0]
        return 0.5 * np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)


@dataclass(frozen=True, eq=False)
class Patches:
    """Bicubic Bézier patches, exactly: their outlines are smooth at any distance.

    control : (P, 4, 4, 3) float64 control points, metres, world; [p, i, j] goes with u = i/3 and v = j/3, and
        outside is where ∂P/∂u × ∂P/∂v points
    material : what they are made of
    name : for messages

    Texture coordinates are each patch's own (u, v).
    """

    control: np.ndarray
    material: AnyMaterial
    name: str = "patches"

    def __post_init__(self) -> None:
        if self.control.ndim != 4 or self.control.shape[1:] != (4, 4, 3) or not len(self.control):
            raise ValueError(
                f"control points of {self.name!r} are {self.control.shape}; expected (P, 4, 4, 3), sixteen a patch"
            )
        if not np.all(np.isfinite(self.control)):
            raise ValueError(f"some control points of {self.name!r} are not finite; expected metres")
        flat = np.ptp(self.control.reshape(len(self.control), 16, 3), axis=1).max(axis=1) == 0
        if np.any(flat):
            raise ValueError(f"patch {int(np.argmax(flat))} of {self.name!r} is a single point; remove it")


Shape = Mesh | Plane | Sphere | Polygon | Patches
Solid = Mesh | Sphere | Polygon | Patches
"""What an object may be; a plane is a real surface of the local scene."""


def read_patches(path: str | Path) -> np.ndarray:
    """Control points (P, 4, 4, 3) of a .bpt file: the number of patches, then each one's degrees and 16 points.

    path : the file, .bpt
    Raises UnreadableFile when the file is missing or is no such list.
    """
    path = Path(path)
    if not path.is_file():
        raise UnreadableFile(f"{path}: no such file of patches; check the path")
    try:
        words = path.read_text(encoding="utf-8").split()
        count = int(words[0])
        table = np.array(words[1:], np.float64).reshape(count, 2 + 48)
    except (OSError, ValueError, IndexError, UnicodeDecodeError):
        raise UnreadableFile(
            f"{path}: not a list of bicubic patches; expected their number, then for each the degrees 3 3 and 16 points"
        ) from None
    if count < 1 or not np.all((table[:, :2] == 3) | (table[:, :2] == 4)) or not np.all(np.isfinite(table)):
        raise UnreadableFile(f"{path}: holds no patches, others than bicubic ones (3 3), or points that are not finite")
    return table[:, 2:].reshape(count, 4, 4, 3)


def bounds(solids: Iterable[Solid]) -> np.ndarray:
    """The lowest and the highest corner (2, 3), metres, of the box round solids; two origins where there are none.

    Patches are held by the box of their control points.
    """
    points = [np.stack(solid._extent[:2]) if isinstance(solid, Mesh) else _points(solid) for solid in solids]
    every = np.concatenate(points) if points else np.zeros((1, 3))
    return np.stack([every.min(axis=0), every.max(axis=0)])


def bounding_sphere(solid: Solid) -> tuple[np.ndarray, float]:
    """The centre (3,) and radius, metres, of a sphere around an object: about the middle of its box."""
    if isinstance(solid, Sphere):
        return np.array(solid.centre, np.float64), solid.radius
    if isinstance(solid, Mesh):
        low, high, radius = solid._extent
        return (low + high) / 2, radius
    points = _points(solid)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre, float(np.linalg.norm(points - centre, axis=1).max())


def carried(
    vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray | None, matrix: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """A mesh's vertices, faces and unit normals carried by a matrix (4, 4); where it mirrors, faces stay outward."""
    turn = matrix[:3, :3]
    if np.linalg.det(turn) < 0:
        faces = faces[:, ::-1]
    if normals is not None:
        normals = normals @ np.linalg.inv(turn)
        normals = (normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)).astype(np.float32)
    moved = vertices @ turn.T + matrix[:3, 3]
    return moved.astype(np.float32), np.ascontiguousarray(faces, np.int32), normals


def _points(solid: Solid) -> np.ndarray:
    if isinstance(solid, Sphere):
        return np.add.outer([-solid.radius, solid.radius], np.asarray(solid.centre, np.float64))
    points = solid.vertices if isinstance(solid, Mesh | Polygon) else solid.control
    return points.reshape(-1, 3).astype(np.float64)
