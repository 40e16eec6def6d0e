"""Patches and polygons as triangles, for renderers that know nothing else."""

from __future__ import annotations

import numpy as np

from relume.scene.materials.materials import is_image
from relume.scene.shapes.shapes import Mesh, Patches, Polygon, Shape, Sphere

CELLS = 32
"""Along each side of a patch: a quarter of a circle is followed to 0.0003 of its radius."""
NUDGE = 1e-5
"""How far into a patch, in u and v, the normal is taken where the patch has none: at a side that is a single point."""
NOTHING = 1e-12
"""Areas to u and v below this share of the patch's size squared are what rounding leaves of none."""
ROUND = 4
"""How often the 20 triangles of a ball are quartered: its outline is then off by a thousandth of its radius."""


def tessellated(patches: Patches, cells: int = CELLS) -> Mesh:
    """The patches as a mesh of cells² squares each, with the exact normals and each patch's own (u, v).

    At a corner or a side where the patch has no normal, the mesh has the one beside it. Triangles without area are
    left out. Raises ValueError for less than one cell.
    """
    if cells < 1:
        raise ValueError(f"{cells} cells along a patch; expected 1 or more")
    along = np.linspace(0, 1, cells + 1)
    inward = along + NUDGE * np.sign(0.5 - along)
    points, normals = _points(patches.control, along), _normals(patches.control, along)
    beside = _normals(patches.control, inward)
    normals = np.where(np.any(normals, axis=-1, keepdims=True), normals, beside)
    # What is a line has no normal anywhere, and no triangle.
    normals = np.where(np.any(normals, axis=-1, keepdims=True), normals, [0.0, 1.0, 0.0])
    uv = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1)
    vertices = points.reshape(-1, 3).astype(np.float32)
    faces = _squares(cells, len(patches.control))
    a, b, c = np.moveaxis(vertices[faces].astype(np.float64), 1, 0)
    faces = faces[np.any(np.cross(b - a, c - a), axis=-1)]
    every_uv = np.broadcast_to(uv, (len(patches.control), *uv.shape)).reshape(-1, 2).astype(np.float32)
    return Mesh(vertices, faces, patches.material, normals.reshape(-1, 3).astype(np.float32), every_uv, patches.name)


def triangulated(polygon: Polygon) -> Mesh:
    """The polygon as a flat mesh with its texture coordinates; raises ValueError where it crosses itself."""
    normal = polygon.area_vector / np.linalg.norm(polygon.area_vector)
    edges = np.roll(polygon.vertices, -1, axis=0) - polygon.vertices
    lengths = np.linalg.norm(edges, axis=-1)
    first = edges[np.argmax(lengths > 1e-12 * lengths.max())]  # a vertex may stand twice in a row
    along = first - (first @ normal) * normal
    along /= np.linalg.norm(along)
    flat = polygon.vertices @ np.stack([along, np.cross(normal, along)], axis=1)
    try:
        faces = triangles_of(flat)
    except ValueError as error:
        raise ValueError(f"{polygon.name!r}: {error}") from None
    uv = (flat - flat.min(axis=0)) / np.ptp(flat, axis=0)
    vertices = polygon.vertices.astype(np.float32)
    return Mesh(vertices, faces, polygon.material, None, uv.astype(np.float32), polygon.name)


def as_mesh(shape: Shape, quartered: int = ROUND) -> Mesh:
    """Any shape as triangles; a plane as the rectangle of its extent, a ball as 20 triangles `quartered` so often."""
    if isinstance(shape, Mesh):
        return shape
    if isinstance(shape, Patches):
        return tessellated(shape)
    if isinstance(shape, Polygon):
        return triangulated(shape)
    if isinstance(shape, Sphere):
        return _ball(shape, quartered)
    x, z = np.array(shape.extent) / 2
    corners = np.array([[-x, shape.height, z], [x, shape.height, z], [x, shape.height, -z], [-x, shape.height, -z]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(corners.astype(np.float32), faces, shape.material, uv=uv, name="plane")


def _ball(sphere: Sphere, quartered: int) -> Mesh:
    """A sphere as the quartered faces of an icosahedron, with its own normals and lat-long texture coordinates.

    Where an image's end meets its beginning, and at the poles, triangles that show one have vertices of their own.
    """
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=quartered)
    normals, faces = np.asarray(ball.vertices, np.float64), np.asarray(ball.faces, np.int32)
    x, y, z = normals.T
    uv = np.stack([0.5 + np.arctan2(x, -z) / (2 * np.pi), np.arctan2(np.hypot(x, z), -y) / np.pi], axis=-1)
    vertices = np.asarray(sphere.centre) + sphere.radius * normals
    if any(map(is_image, vars(sphere.material).values())):
        faces, uv, whose = _unwrapped(faces, uv)
        vertices, normals = vertices[whose], normals[whose]
    return Mesh(
        vertices.astype(np.float32), faces, sphere.material, normals.astype(np.float32), uv.astype(np.float32),
        sphere.name,
    )  # fmt: skip


def _unwrapped(faces: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Faces (F, 3) that interpolate u the short way round, coordinates (V, 2), and whose vertex each then is (V,).

    New vertices follow the old ones: u beyond 1 where a triangle crosses the seam, as images repeat; and at a pole,
    where every u is right, the mean of the triangle's two others.
    """
    corners = uv[faces]
    u = corners[..., 0]
    pole = np.abs(corners[..., 1] - 0.5) > 0.5 - 1e-9
    # The seam, by the corners that have a u of their own.
    known = np.where(pole, np.nan, u)
    crosses = np.nanmax(known, axis=1) - np.nanmin(known, axis=1) > 0.5
    turned = np.where(crosses[:, None] & (known < 0.5), known + 1, known)
    turned = np.where(pole, np.nanmean(turned, axis=1)[:, None], turned)
    # One new vertex for all triangles that want the same u of the same old one.
    rows, columns = np.nonzero(turned != u)
    keys, inverse = np.unique(
        np.stack([faces[rows, columns].astype(np.float64), turned[rows, columns]]), axis=1, return_inverse=True
    )
    faces, whose = faces.copy(), keys[0].astype(np.int64)
    faces[rows, columns] = len(uv) + inverse.reshape(-1)
    more = np.stack([keys[1], uv[whose, 1]], axis=-1)
    return faces, np.concatenate([uv, more]), np.concatenate([np.arange(len(uv)), whose])


def _points(control: np.ndarray, along: np.ndarray) -> np.ndarray:
    """(P, n, n, 3), metres, at all pairs of u and v."""
    weights = _weights(along)
    return np.einsum("ui,vj,pijk->puvk", weights, weights, control)


def _normals(control: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Unit normals (P, n, n, 3) at all pairs of u and v; 0 where the patch has none."""
    weights, slopes = _weights(along), _slopes(along)
    # From a corner of its own, so that a patch far from the origin is as exact.
    near = control - control[:, :1, :1]
    across = np.cross(
        np.einsum("ui,vj,pijk->puvk", slopes, weights, near), np.einsum("ui,vj,pijk->puvk", weights, slopes, near)
    )
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    size = np.ptp(near, axis=(1, 2)).max(axis=-1)[:, None, None, None]
    return np.where(length > NOTHING * size**2, across / np.maximum(length, 1e-300), 0)


def _weights(t: np.ndarray) -> np.ndarray:
    """Bernstein's cubic polynomials at (n,) parameters, (n, 4)."""
    s = 1 - t
    return np.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3], axis=-1)


def _slopes(t: np.ndarray) -> np.ndarray:
    """Their derivatives, (n, 4)."""
    s = 1 - t
    return np.stack([-3 * s * s, 3 * s * (s - 2 * t), 3 * t * (2 * s - t), 3 * t * t], axis=-1)


def _squares(cells: int, count: int) -> np.ndarray:
    """Two triangles a cell of `count` grids of vertices, in rows of constant u: (2·cells²·count, 3) int32."""
    lower = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    a, b, c, d = lower, lower + cells + 1, lower + cells + 2, lower + 1
    one = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    shift = np.arange(count)[:, None, None] * (cells + 1) ** 2
    return (one + shift).reshape(-1, 3).astype(np.int32)


def triangles_of(points: np.ndarray) -> np.ndarray:
    """Triangles (M, 3) int32, counter-clockwise, that fill a polygon which need not be convex.

    points : (N, 2), counter-clockwise; those between two others on a line, and repeated ones, may be among them
    Raises ValueError where no ear is left, which only a polygon that crosses itself comes to.
    """
    points = np.asarray(points, np.float64)
    # Twice an area that rounding may take for one.
    nothing = 1e-14 * np.ptp(points, axis=0).max() ** 2
    left, triangles = list(range(len(points))), []
    while len(left) > 2:
        ring = np.array(left)
        before, after = np.roll(ring, 1), np.roll(ring, -1)
        areas = _twice_areas(points[before], points[ring], points[after])
        flat = np.flatnonzero(np.abs(areas) <= nothing)
        if flat.size:
            del left[int(flat[0])]
            continue
        # The widest ear first, so that slivers come last, where nothing else is left.
        shapely = [i for i in np.argsort(-_sines(points[before], points[ring], points[after])) if areas[i] > 0]
        ear = next((i for i in shapely if _is_ear(points, ring, int(i))), None)
        if ear is None:
            raise ValueError("its outline crosses itself; split it into polygons that do not")
        triangles.append((before[ear], ring[ear], after[ear]))
        del left[int(ear)]
    return np.array(triangles, np.int32).reshape(-1, 3)


def _is_ear(points: np.ndarray, ring: np.ndarray, i: int) -> bool:
    """Whether no other vertex lies in the triangle of the vertices i − 1, i and i + 1, or on its new side."""
    corners = points[ring[i - 1]], points[ring[i]], points[ring[(i + 1) % len(ring)]]
    a, b, c = corners
    # A vertex where a corner is may be the same one repeated, and bars nothing.
    others = points[ring][~np.any([np.all(points[ring] == corner, axis=-1) for corner in corners], axis=0)]
    inside = (_twice_areas(a, b, others) >= 0) & (_twice_areas(b, c, others) >= 0) & (_twice_areas(c, a, others) >= 0)
    return not np.any(inside)


def _twice_areas(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Of triangles, positive where they are counter-clockwise."""
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])


def _sines(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """A measure of how far triangles are from slivers: twice the area by the longest side squared."""
    sides = [np.sum((p - q) ** 2, axis=-1) for p, q in ((a, b), (b, c), (c, a))]
    return _twice_areas(a, b, c) / np.maximum(np.max(sides, axis=0), 1e-300)
