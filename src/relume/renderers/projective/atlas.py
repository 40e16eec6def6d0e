"""The texture atlas of a mesh: each of its flat parts laid down in one picture, to scale, with a rim round it.

Places that are modelled from photographs are blocks, so flat parts are few and large, and nothing is stretched; a
curved surface is a part a triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.scene.shapes.shapes import Mesh

RIM = 2
"""Texels round each part: a bilinear look-up reaches one beyond it."""
COPLANAR = 1e-4
"""Sine of the angle up to which triangles that share an edge lie in one plane."""
INWARD = 1e-3
"""Share of a triangle by which a texel's point stays within it: on its very edge the next wall hides it."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """A mesh laid down in a picture, and the point of its surface that each used texel stands for.

    mesh : with texture coordinates of its own; vertices are doubled where parts meet
    size : (width, height), texels
    rows, columns : (T,) of the texels that are used
    points, normals : (T, 3) float64, metres, world
    inner : (T,) bool, whether the texel's middle lies on the surface; others are the rim
    faces : (T,) of the mesh
    texel : metres
    """

    mesh: Mesh
    size: tuple[int, int]
    rows: np.ndarray
    columns: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    inner: np.ndarray
    faces: np.ndarray
    texel: float


def atlas_of(mesh: Mesh, texel: float, largest: int) -> Atlas:
    """The atlas of a mesh whose texels are so many metres wide, or wider where its side would exceed `largest`."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    normals, _ = face_normals(mesh)
    part = flat_parts(mesh, normals)
    flat = laid_down(corners, normals, part)
    while True:
        placed, size = packed(flat / texel, part)
        if max(size) <= largest:
            break
        texel *= max(1.05, max(size) / largest)
    rows, columns, faces, weights, inner = covered(placed, size)
    points = np.einsum("tc,tcx->tx", weights, corners[faces])
    uv = placed / size * [1, -1] + [0, 1]
    laid = Mesh(
        np.ascontiguousarray(corners.reshape(-1, 3), np.float32),
        np.arange(3 * len(mesh.faces), dtype=np.int32).reshape(-1, 3),
        mesh.material,
        None if mesh.normals is None else np.ascontiguousarray(mesh.normals[mesh.faces].reshape(-1, 3)),
        uv.reshape(-1, 2).astype(np.float32),
        mesh.name,
    )
    return Atlas(laid, size, rows, columns, points, normals[faces], inner, faces, texel)


def face_normals(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (M, 3) of a mesh's triangles, 0 for those without area, and their areas (M,), m²."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=-1)
    return across / np.maximum(length, 1e-300)[:, None], length / 2


def flat_parts(mesh: Mesh, normals: np.ndarray) -> np.ndarray:
    """The number (M,) of the flat part that each triangle belongs to: joined to its neighbours in one plane."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    # Vertices at equal places are one: meshes from files have them doubled along edges.
    _, welded = np.unique(mesh.vertices.round(7) + 0.0, axis=0, return_inverse=True)
    faces = welded.reshape(-1)[mesh.faces]
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort(edges.T)
    edges, owner = edges[order], owner[order]
    same = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
    first, second = owner[same], owner[same + 1]
    level = np.linalg.norm(np.cross(normals[first], normals[second]), axis=-1) < COPLANAR
    level &= np.einsum("ij,ij->i", normals[first], normals[second]) > 0
    joined = coo_matrix((np.ones(level.sum()), (first[level], second[level])), shape=(len(faces), len(faces)))
    return connected_components(joined, directed=False)[1]


def laid_down(corners: np.ndarray, normals: np.ndarray, part: np.ndarray) -> np.ndarray:
    """The corners (M, 3, 2) of triangles in the plane of their part, metres, x right and y down from its corner."""
    _, first = np.unique(part, return_index=True)
    normal = normals[first][part]
    # Up in the picture is up in the world, or −Z on a floor.
    up = np.where(np.abs(normal[:, 1:2]) > 0.9, [[0.0, 0.0, -1.0]], [[0.0, 1.0, 0.0]])
    right = np.cross(up, normal)
    right /= np.maximum(np.linalg.norm(right, axis=-1, keepdims=True), 1e-300)
    down = -np.cross(normal, right)
    flat = np.stack([np.einsum("mcx,mx->mc", corners, axis) for axis in (right, down)], axis=-1)
    low = np.full((len(first), 2), np.inf)
    np.minimum.at(low, part, flat.min(axis=1))
    return flat - low[part][:, None]


def packed(flat: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, tuple[int, int]]:
    """Corners (M, 3, 2) in the picture, texels, and its size: parts in rows, the highest first."""
    count = part.max() + 1
    extent = np.zeros((count, 2))
    np.maximum.at(extent, part, flat.max(axis=1))
    sizes = np.ceil(extent).astype(int) + 2 * RIM + 1
    width = max(int(np.ceil(np.sqrt(1.1 * sizes.prod(axis=1).sum()))), int(sizes[:, 0].max()))
    place, x, y, shelf = np.zeros((count, 2)), 0, 0, 0
    for index in np.lexsort((np.arange(count), -sizes[:, 1])):
        if x + sizes[index, 0] > width:
            x, y, shelf = 0, y + shelf, 0
        place[index] = x + RIM, y + RIM
        x, shelf = x + sizes[index, 0], max(shelf, sizes[index, 1])
    return flat + place[part][:, None], (width, int(y + shelf))


def covered(
    placed: np.ndarray, size: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns, triangle, weights (T, 3) of its corners, and whether it is inside, of each used texel."""
    width, height = size
    owner = np.full((height, width), -1)
    outside = np.full((height, width), np.inf)
    weights = np.zeros((height, width, 3))
    for index, corners in enumerate(placed):
        low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - RIM, 0)
        high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + RIM, size)
        x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
        shares, away = nearest_in(corners, np.stack([x, y], axis=-1))
        window = slice(low[1], high[1]), slice(low[0], high[0])
        better = (away < outside[window]) & (away <= RIM)
        owner[window][better], outside[window][better], weights[window][better] = index, away[better], shares[better]
    rows, columns = np.nonzero(owner >= 0)
    inside = weights[rows, columns]
    inside = np.maximum(inside, INWARD)
    inside /= inside.sum(axis=-1, keepdims=True)
    return rows, columns, owner[rows, columns], inside, outside[rows, columns] <= 0


def nearest_in(corners: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights (…, 3) of the corners (3, 2) at the point of a triangle nearest to each point (…, 2), and how far it is.

    0 inside. A triangle without area gives infinity.
    """
    a, b, c = corners
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if area == 0:
        return np.zeros((*points.shape[:-1], 3)), np.full(points.shape[:-1], np.inf)
    weights = np.zeros((*points.shape[:-1], 3))
    for k, (p, q) in enumerate(((b, c), (c, a), (a, b))):
        weights[..., k] = ((p[0] - points[..., 0]) * (q[1] - points[..., 1])
                           - (p[1] - points[..., 1]) * (q[0] - points[..., 0])) / area  # fmt: skip
    away = np.where((weights >= 0).all(axis=-1), 0.0, np.inf)
    # Outside, the nearest point lies on one of the edges.
    out = away > 0
    for k, (p, q) in enumerate(((b, c), (c, a), (a, b))):
        side = q - p
        along = np.clip((points - p) @ side / max(float(side @ side), 1e-300), 0, 1)
        gap = np.linalg.norm(p + along[..., None] * side - points, axis=-1)
        nearer = out & (gap < away)
        away[nearer] = gap[nearer]
        edge = np.zeros((int(nearer.sum()), 3))
        edge[:, (k + 1) % 3], edge[:, (k + 2) % 3] = 1 - along[nearer], along[nearer]
        weights[nearer] = edge
    return weights, away
