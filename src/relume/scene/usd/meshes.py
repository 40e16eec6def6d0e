"""The meshes of any USD file (.usd, .usda, .usdc, .usdz): triangles in metres, +Y up, with their materials.

What the file would not render is left out: what is invisible, guides and proxies. Surfaces of subdivision are shown as
their cages, smoothly shaded; polygons are cut into triangles from their first corner.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh, carried
from relume.scene.shapes.vertex_colours import with_corner_colours
from relume.scene.usd.materials import UsdMaterial, read_material
from relume.scene.usd.stage import stage_of

_Y_FROM_Z = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
_PURPOSES = ("default", "render")
_UNREAD = ("PointInstancer", "BasisCurves", "NurbsPatch", "Points", "Sphere", "Cube", "Cylinder", "Cone", "Capsule")
_BARE = Material((0.5, 0.5, 0.5), roughness=1.0, name="grey")
_PAINTED = Material(roughness=1.0, name="display colour")

Lost = dict[str, list[str]]


def read_usd_meshes(path: Path) -> tuple[list[Mesh], Lost]:
    """Every mesh that the file would render, placed at its first time, and what of the file is lost, by its part.

    Raises UnreadableFile where the file is damaged, a picture of its materials is missing, or OpenUSD is.
    """
    with stage_of(path, "Usd", "UsdGeom", "UsdShade", "Ar") as (stage, usd, geometry, shade, resolver):
        scale = float(geometry.GetStageMetersPerUnit(stage))
        upright = _Y_FROM_Z if geometry.GetStageUpAxis(stage) == "Z" else np.eye(4)
        placing = np.diag([scale, scale, scale, 1.0]) @ upright
        time = usd.TimeCode.EarliestTime()
        reader = _Meshes(path, geometry, shade, resolver, time, geometry.XformCache(time), placing)
        meshes: list[Mesh] = []
        for prim in stage.Traverse(usd.TraverseInstanceProxies()):
            imageable = geometry.Imageable(prim)
            if not imageable or not prim.IsA(geometry.Boundable):
                continue
            if imageable.ComputeVisibility(time) == "invisible" or imageable.ComputePurpose() not in _PURPOSES:
                continue
            if prim.IsA(geometry.Mesh):
                meshes += reader.of(prim)
            elif prim.GetTypeName() in _UNREAD:
                reader.lose("of the stage", f"{prim.GetTypeName()} {prim.GetName()}")
        return meshes, reader.lost


@dataclass(frozen=True, eq=False)
class _Values:
    """A primvar: its values, how they lie, and which of them each place has."""

    values: np.ndarray
    interpolation: str
    indices: np.ndarray | None

    def at(self, faces: np.ndarray, points: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """The number of the value at each corner of triangles (T, 3); arguments alike, of what the corner is of."""
        which = {"constant": np.zeros_like(points), "uniform": faces, "faceVarying": corners}
        number = which.get(self.interpolation, points)
        return number if self.indices is None else self.indices[number]


class _Meshes:
    """Reads the meshes of one stage; a material is read once."""

    def __init__(
        self, path: Path, geometry: Any, shade: Any, resolver: Any, time: Any, places: Any, placing: np.ndarray
    ) -> None:
        self._path, self._geometry, self._shade, self._resolver = path, geometry, shade, resolver
        self._time, self._places, self._placing = time, places, placing
        self._materials: dict[str, UsdMaterial] = {}
        self.lost: Lost = {}

    def lose(self, part: str, *words: str) -> None:
        self.lost.setdefault(part, []).extend(words)

    def of(self, prim: Any) -> list[Mesh]:
        """The meshes of one prim, one for each material that is bound to faces of it."""
        mesh, name = self._geometry.Mesh(prim), prim.GetName()
        points = np.asarray(mesh.GetPointsAttr().Get(self._time) or [], np.float64).reshape(-1, 3)
        counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(self._time) or [], np.int64)
        indices = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(self._time) or [], np.int64)
        if counts.sum() != len(indices) or (len(indices) and not 0 <= indices.min() <= indices.max() < len(points)):
            raise ValueError(f"the faces of {name} do not fit its points")
        faces, corners = _triangles(counts)
        if holes := mesh.GetHoleIndicesAttr().Get(self._time):
            kept = ~np.isin(faces, np.asarray(holes))
            faces, corners = faces[kept], corners[kept]
        if not len(faces):
            return []
        if mesh.GetOrientationAttr().Get(self._time) == "leftHanded":
            corners = corners[:, ::-1]
        smooth = str(mesh.GetSubdivisionSchemeAttr().Get(self._time)) != "none"
        if smooth:
            self.lose("of its meshes", f"the subdivision of {name}")
        normals = _smooth_normals(points, indices[corners]) if smooth else self._normals(mesh, prim)
        world = self._placing @ np.array(self._places.GetLocalToWorldTransform(prim)).T
        made = []
        for bound, chosen in self._bindings(prim, len(counts), faces):
            part = _Part(points, indices, faces[chosen], corners[chosen], normals, world, name)
            made.append(self._made(prim, part, bound))
        return made

    def _normals(self, mesh: Any, prim: Any) -> _Values | None:
        """Of the primvar, which goes first, or of the attribute."""
        found = self._primvar(prim, "normals")
        if found is not None:
            return found
        values = mesh.GetNormalsAttr().Get(self._time)
        return None if not values else _Values(np.asarray(values, np.float64), mesh.GetNormalsInterpolation(), None)

    def _primvar(self, prim: Any, name: str) -> _Values | None:
        primvar = self._geometry.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        values = primvar.Get(self._time) if primvar and primvar.HasValue() else None
        if values is None or np.ndim(values) != 2 or not len(values):
            return None
        indices = primvar.GetIndices(self._time) if primvar.IsIndexed() else None
        array = None if indices is None or not len(indices) else np.asarray(indices, np.int64)
        return _Values(np.asarray(values, np.float64), str(primvar.GetInterpolation()), array)

    def _bindings(self, prim: Any, count: int, faces: np.ndarray) -> list[tuple[Any, np.ndarray]]:
        """Each bound material, or None, and the triangles (T,) bool that it is on."""
        binding = self._shade.MaterialBindingAPI(prim)
        rest, found = np.ones(count, bool), []
        for subset in binding.GetMaterialBindSubsets():
            listed = np.zeros(count, bool)
            listed[np.asarray(subset.GetIndicesAttr().Get(self._time) or [], np.int64)] = True
            listed &= rest
            rest &= ~listed
            found.append((self._shade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()[0], listed[faces]))
        found.append((binding.ComputeBoundMaterial()[0], rest[faces]))
        return [(bound if bound else None, chosen) for bound, chosen in found if chosen.any()]

    def _made(self, prim: Any, part: _Part, bound: Any) -> Mesh:
        found = UsdMaterial(None) if bound is None else self._material(bound)
        colours = self._primvar(prim, "displayColor") if found.surface is None else None
        coordinates = self._primvar(prim, found.coordinates) if found.coordinates else None
        surface = found.surface or (_BARE if colours is None else _PAINTED)
        if found.coordinates and coordinates is None:
            self.lose(f"of mesh {part.name}", "textures without coordinates")
            surface = _without_pictures(surface)
        mesh = part.mesh(surface, coordinates)
        if colours is None:
            return mesh
        numbers = colours.at(np.repeat(part.faces[:, None], 3, axis=1), part.indices[part.corners], part.corners)
        shown = colours.values[numbers]
        # Placing may have turned the corners of each triangle round.
        return with_corner_colours(mesh, shown[:, ::-1] if part.is_mirrored else shown)

    def _material(self, bound: Any) -> UsdMaterial:
        key = str(bound.GetPath())
        if key not in self._materials:
            read = read_material(self._path, self._shade, self._resolver, bound)
            if read.lost:
                self.lose(f'of material "{bound.GetPrim().GetName()}"', *read.lost)
            self._materials[key] = read
        return self._materials[key]


@dataclass(frozen=True, eq=False)
class _Part:
    """Triangles of one prim with one material.

    points : (N, 3); indices : of each corner of the polygons, its point
    faces : (T,) the polygon of each triangle; corners : (T, 3) its corners
    normals : None for flat faces
    world : (4, 4) to metres, +Y up
    """

    points: np.ndarray
    indices: np.ndarray
    faces: np.ndarray
    corners: np.ndarray
    normals: _Values | None
    world: np.ndarray
    name: str

    @property
    def is_mirrored(self) -> bool:
        """Whether the world sees the mesh mirrored."""
        return bool(np.linalg.det(self.world[:3, :3]) < 0)

    def mesh(self, material: Material, coordinates: _Values | None) -> Mesh:
        """The triangles in the world; corners that are alike in all are one vertex, in the order of the triangles."""
        points = self.indices[self.corners]
        faces = np.repeat(self.faces[:, None], 3, axis=1)
        given = [each for each in (self.normals, coordinates) if each is not None]
        numbers = [points, *(each.at(faces, points, self.corners) for each in given)]
        rows = np.stack([each.ravel() for each in numbers], axis=1)
        kept, inverse = np.unique(rows, axis=0, return_inverse=True)
        columns = iter(kept.T)
        vertices = self.points[next(columns)]
        normals = None if self.normals is None else self.normals.values[next(columns)]
        uv = None if coordinates is None else coordinates.values[next(columns)][:, :2].astype(np.float32)
        placed = carried(vertices, inverse.reshape(-1, 3), normals, self.world)
        return Mesh(placed[0], placed[1], material, placed[2], uv, self.name)


def _without_pictures(material: Material) -> Material:
    """The material with each picture's mean in its place, where nothing says how it lies."""
    changes: dict[str, Any] = {}
    for field in fields(material):
        value = getattr(material, field.name)
        if isinstance(value, np.ndarray):
            mean = value.mean((0, 1), dtype=np.float64)
            changes[field.name] = None if field.name == "normal" else triple(mean) if mean.ndim else float(mean)
    return replace(material, **changes)


def _triangles(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The polygon (T,) of each triangle of a fan, and its corners (T, 3) in the list of all corners."""
    cut = np.maximum(counts - 2, 0)
    faces = np.repeat(np.arange(len(counts)), cut)
    first = (np.cumsum(counts) - counts)[faces]
    step = np.arange(len(faces)) - np.repeat(np.cumsum(cut) - cut, cut)
    return faces, np.stack([first, first + step + 1, first + step + 2], axis=1)


def _smooth_normals(points: np.ndarray, triangles: np.ndarray) -> _Values:
    """At each point, the mean of its triangles' by their areas."""
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    area = np.cross(b - a, c - a)
    total = np.zeros_like(points)
    for corner in range(3):
        np.add.at(total, triangles[:, corner], area)
    return _Values(total, "vertex", None)
