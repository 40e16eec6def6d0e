"""The surface where a ray meets it: point, normals, texture coordinates and how the surface runs along them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from relume.image.bands import in_threads
from relume.image.kernel import inlined, kernel
from relume.renderers.raytrace.kernel import unowned
from relume.renderers.raytrace.patch_point import tangents_and_normal
from relume.renderers.raytrace.polygon_kernel import polygon_frame
from relume.renderers.raytrace.raycast import Hits, checked_rays
from relume.scene.shapes.shapes import Mesh, Patches, Plane, Polygon, Shape, Sphere

_MESH, _SPHERE, _PLANE, _POLYGON, _PATCHES = 0, 1, 2, 3, 4


class SurfacePoints(NamedTuple):
    """The surface at N hits; zeros in the rows of rays that met nothing.

    point : (N, 3) float64, metres, world
    geometric_normal : (N, 3) float64 unit vectors, outward: towards those who see the face counter-clockwise, +Y of
        a plane
    shading_normal : (N, 3) float64 unit vectors, the mesh's own interpolated, or else the geometric ones
    uv : (N, 2) float32 texture coordinates, (0, 0) the lower left corner; on a plane +X is right and −Z is up;
        0 where a mesh has none
    dp_du, dp_dv : (N, 3) float64, metres to a unit of u and of v; 0 where a mesh has no texture coordinates
    """

    point: np.ndarray
    geometric_normal: np.ndarray
    shading_normal: np.ndarray
    uv: np.ndarray
    dp_du: np.ndarray
    dp_dv: np.ndarray


class Surfaces(NamedTuple):
    """Shapes made ready to be asked about hits: the F faces and V vertices of all meshes, one after the other.

    kind : (S,) int8, what each shape is
    first : (S,) int64, a mesh's first row in `faces`; where the others' measures begin
    measures : (M,) float64, metres: a sphere's centre and radius, a plane's lengths along x and z, a polygon's frame,
        the patches' control points
    smooth, textured : (S,) bool, whether a mesh has normals, and texture coordinates
    faces : (F, 3) int32, rows in the next three
    vertices : (V, 3) float32, metres
    normals : (V, 3) float32, 0 where there are none
    uv : (V, 2) float32, 0 where there are none
    """

    kind: np.ndarray
    first: np.ndarray
    measures: np.ndarray
    smooth: np.ndarray
    textured: np.ndarray
    faces: np.ndarray
    vertices: np.ndarray
    normals: np.ndarray
    uv: np.ndarray

    @staticmethod
    def of(shapes: Sequence[Shape]) -> Surfaces:
        """The surfaces of these shapes, in the order that was given to `RayCaster.of`.

        Raises ValueError where a mesh has not a normal, or not a texture coordinate, for each vertex.
        """
        kind, first = np.zeros(len(shapes), np.int8), np.zeros(len(shapes), np.int64)
        measures, face, vertex = [], 0, 0
        smooth, textured = np.zeros(len(shapes), bool), np.zeros(len(shapes), bool)
        faces, vertices = [np.zeros((0, 3), np.int32)], [np.zeros((0, 3), np.float32)]
        normals, uv = [np.zeros((0, 3), np.float32)], [np.zeros((0, 2), np.float32)]
        for i, shape in enumerate(shapes):
            first[i] = len(measures)
            if isinstance(shape, Sphere):
                kind[i] = _SPHERE
                measures += [*shape.centre, shape.radius]
            elif isinstance(shape, Plane):
                kind[i] = _PLANE
                measures += shape.extent
            elif isinstance(shape, Polygon):
                kind[i] = _POLYGON
                measures += polygon_frame(shape).tolist()
            elif isinstance(shape, Patches):
                kind[i] = _PATCHES
                measures += np.ravel(shape.control).tolist()
            else:
                first[i], smooth[i], textured[i] = face, shape.normals is not None, shape.uv is not None
                faces.append(np.asarray(shape.faces + vertex, np.int32))
                vertices.append(np.asarray(shape.vertices, np.float32))
                normals.append(_of_each_vertex(shape, "normals", 3))
                uv.append(_of_each_vertex(shape, "uv", 2))
                face, vertex = face + len(shape.faces), vertex + len(shape.vertices)
        tables = (np.concatenate(table) for table in (faces, vertices, normals, uv))
        return Surfaces(kind, first, np.array(measures, np.float64), smooth, textured, *tables)

    def at(self, origins: ArrayLike, directions: ArrayLike, hits: Hits, *, threads: int | None = None) -> SurfacePoints:
        """The surface where these rays met it.

        origins, directions : as given to `RayCaster.nearest`
        hits : what it answered
        threads : at most this many; as many as there are cores for None
        """
        origins, directions = checked_rays(origins, directions)
        count = len(hits.shape)
        if len(directions) != count:
            raise ValueError(f"there are {count} hits of {len(directions)} rays; expected those of the same rays")
        if count and hits.shape.max() >= len(self.kind):
            raise ValueError(f"a hit is on shape {hits.shape.max()} of {len(self.kind)}; expected hits on these shapes")
        point, geometric, shading, dp_du, dp_dv = (np.zeros((count, 3)) for _ in range(5))
        points = SurfacePoints(point, geometric, shading, np.zeros((count, 2), np.float32), dp_du, dp_dv)
        rays = (origins, directions)
        in_threads(lambda begin, end: _describe(rays, hits, self, begin, end, points), count, threads)
        return points


def _of_each_vertex(mesh: Mesh, name: str, width: int) -> np.ndarray:
    """A mesh's `normals` or `uv` as float32, zeros where it has none."""
    values = getattr(mesh, name)
    expected = (len(mesh.vertices), width)
    if values is None:
        return np.zeros(expected, np.float32)
    if values.shape != expected:
        raise ValueError(f"{name} of {mesh.name!r} are {values.shape}; expected {expected}, one for each vertex")
    return np.asarray(values, np.float32)


@kernel
def _describe(rays, hits, tables, begin, end, points):
    """Write the surface at hits begin … end."""
    origins, directions = rays
    distance, shape, primitive, barycentric = hits
    kind, first, measures, smooth, textured, faces, vertices, normals, mesh_uv = unowned(tables)
    point, geometric_normal, shading_normal, uv, dp_du, dp_dv = points
    for i in range(begin, end):
        s = shape[i]
        if s < 0:
            continue
        j = i if len(origins) > 1 else 0
        here = (
            origins[j, 0] + distance[i] * directions[i, 0],
            origins[j, 1] + distance[i] * directions[i, 1],
            origins[j, 2] + distance[i] * directions[i, 2],
        )
        second, third = barycentric[i, 0], barycentric[i, 1]
        geometric, shading, at, along_u, along_v = surface_at(
            kind, first, measures, smooth, textured, faces, vertices, normals, mesh_uv,
            s, primitive[i], second, third, here, True,
        )  # fmt: skip
        for k in range(3):
            point[i, k], geometric_normal[i, k], shading_normal[i, k] = here[k], geometric[k], shading[k]
            dp_du[i, k], dp_dv[i, k] = along_u[k], along_v[k]
        uv[i, 0], uv[i, 1] = at


@inlined
def surface_at(
    kind, first, measures, smooth, textured, faces, vertices, normals, mesh_uv,
    s, primitive, second, third, point, textures,
):  # fmt: skip
    """A point's geometric and shading normal, texture coordinates, ∂P/∂u and ∂P/∂v: three triples, a pair between.

    The arrays of `Surfaces` come first; then shape, primitive and weights of a hit, where it is, and whether its
    texture coordinates are wanted: a sphere's cost as much as all else.
    """
    x, y, z = point
    geometric, shading = (0.0, 1.0, 0.0), (0.0, 1.0, 0.0)
    uv, dp_du, dp_dv = (0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if kind[s] == _PLANE:
        along_x, along_z = measures[first[s]], measures[first[s] + 1]
        uv = (0.5 + x / along_x, 0.5 - z / along_z)
        dp_du, dp_dv = (along_x, 0.0, 0.0), (0.0, 0.0, -along_z)
    elif kind[s] == _SPHERE:
        radius = measures[first[s] + 3]
        x, y, z = _unit(x - measures[first[s]], y - measures[first[s] + 1], z - measures[first[s] + 2])
        geometric, shading = (x, y, z), (x, y, z)
        if textures:
            ring = np.sqrt(x * x + z * z)
            # At a pole every longitude is right; 0 is taken.
            sine, cosine = (x / ring, -z / ring) if ring > 0 else (0.0, 1.0)
            uv = (max(0.5 + np.arctan2(sine, cosine) / (2 * np.pi), 0.0), np.arctan2(ring, -y) / np.pi)
            dp_du = (-2 * np.pi * radius * z, 0.0, 2 * np.pi * radius * x)
            dp_dv = (-np.pi * radius * y * sine, np.pi * radius * ring, np.pi * radius * y * cosine)
    elif kind[s] == _POLYGON:
        i = first[s]
        geometric = (measures[i], measures[i + 1], measures[i + 2])
        shading = geometric
        x, y, z = x - measures[i + 3], y - measures[i + 4], z - measures[i + 5]
        dp_du, dp_dv = (
            (measures[i + 6], measures[i + 7], measures[i + 8]),
            (measures[i + 9], measures[i + 10], measures[i + 11]),
        )
        uv = (_share_along(x, y, z, dp_du), _share_along(x, y, z, dp_dv))
    elif kind[s] == _PATCHES:
        dp_du, dp_dv, geometric = tangents_and_normal(measures, first[s] + 48 * primitive, second, third)
        shading, uv = geometric, (second, third)
    else:
        face = first[s] + primitive
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        weight = 1 - second - third
        bx, by, bz = _edge(vertices, a, b)
        cx, cy, cz = _edge(vertices, a, c)
        geometric = _unit(by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx)
        shading = geometric
        if smooth[s]:
            mean = _unit(
                weight * normals[a, 0] + second * normals[b, 0] + third * normals[c, 0],
                weight * normals[a, 1] + second * normals[b, 1] + third * normals[c, 1],
                weight * normals[a, 2] + second * normals[b, 2] + third * normals[c, 2],
            )
            # Of files whose faces go round the other way the normals mean less than the faces do.
            agree = mean[0] * geometric[0] + mean[1] * geometric[1] + mean[2] * geometric[2]
            if agree > 0:
                shading = mean
            elif agree < 0:
                shading = (-mean[0], -mean[1], -mean[2])
        if textured[s]:
            uv = (
                weight * mesh_uv[a, 0] + second * mesh_uv[b, 0] + third * mesh_uv[c, 0],
                weight * mesh_uv[a, 1] + second * mesh_uv[b, 1] + third * mesh_uv[c, 1],
            )
            # The edges are dp/du Δu + dp/dv Δv; Cramer's rule.
            bu, bv = np.float64(mesh_uv[b, 0]) - mesh_uv[a, 0], np.float64(mesh_uv[b, 1]) - mesh_uv[a, 1]
            cu, cv = np.float64(mesh_uv[c, 0]) - mesh_uv[a, 0], np.float64(mesh_uv[c, 1]) - mesh_uv[a, 1]
            determinant = bu * cv - bv * cu
            if determinant != 0:
                bu, bv, cu, cv = bu / determinant, bv / determinant, cu / determinant, cv / determinant
                dp_du = (cv * bx - bv * cx, cv * by - bv * cy, cv * bz - bv * cz)
                dp_dv = (bu * cx - cu * bx, bu * cy - cu * by, bu * cz - cu * bz)
    return geometric, shading, uv, dp_du, dp_dv


@inlined
def _share_along(x, y, z, side):
    """How far the vector goes along a side, in lengths of it."""
    squared = side[0] * side[0] + side[1] * side[1] + side[2] * side[2]
    return (x * side[0] + y * side[1] + z * side[2]) / squared


@inlined
def _edge(vertices, a, b):
    """From vertex a to vertex b."""
    return (
        np.float64(vertices[b, 0]) - vertices[a, 0],
        np.float64(vertices[b, 1]) - vertices[a, 1],
        np.float64(vertices[b, 2]) - vertices[a, 2],
    )


@inlined
def _unit(x, y, z):
    """The vector at unit length; 0 where it has none."""
    length = np.sqrt(x * x + y * y + z * z)
    scale = 1 / length if length > 0 else 0.0
    return x * scale, y * scale, z * scale
