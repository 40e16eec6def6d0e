"""Shapes taken apart into what a tree of boxes holds: triangles, spheres, polygons and leaves of patches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.image.kernel import exact_kernel
from relume.renderers.raytrace.kernel import LEAF, POLYGON, SPHERE
from relume.renderers.raytrace.patch_leaves import split
from relume.renderers.raytrace.polygon_kernel import polygon_measures
from relume.scene.shapes.shapes import Mesh, Patches, Plane, Polygon, Shape, Sphere

FARTHEST = 1e15
"""Metres from the origin within which every shape has to lie, so that areas stay finite."""


@dataclass(frozen=True, eq=False)
class Primitives:
    """P primitives of all shapes but planes; triangles come first.

    corners : (P, 9) float32, the triangles' vertices, metres; 0 for others
    form : (P,) int32, −1 for a triangle; or else its kind, and where its measures begin, a multiple of 4
    shape, primitive : (P,) int32, as `Hits` holds them
    boxes : (P, 6) float32, low x, y, z and high x, y, z, a little wider than the primitives are
    area : (P,) bool, whether it has one
    measures : (M,) float64, what the kernels of spheres, polygons and leaves take
    """

    corners: np.ndarray
    form: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    boxes: np.ndarray
    area: np.ndarray
    measures: np.ndarray

    @staticmethod
    def of(shapes: Sequence[Shape]) -> Primitives:
        """The primitives of these shapes.

        Raises ValueError for a shape that is not finite and near, and for faces that name no vertex.
        """
        meshes = [(i, shape) for i, shape in enumerate(shapes) if isinstance(shape, Mesh)]
        solids = [(i, *_solid_of(shape)) for i, shape in enumerate(shapes) if not isinstance(shape, Mesh | Plane)]
        triangles = np.concatenate([np.zeros((0, 9), np.float32), *(_corners_of(mesh) for _, mesh in meshes)])
        numbers = [np.arange(len(mesh.faces)) for _, mesh in meshes] + [solid[4] for solid in solids]
        shape = np.repeat([i for i, *_ in (*meshes, *solids)], [len(each) for each in numbers])
        forms, begin = [np.full(len(triangles), -1)], 0
        for _, kind, _, measures, _ in solids:
            count, width = measures.shape
            forms.append(begin + width * np.arange(count) + kind)
            begin += count * width

        boxes = np.concatenate([np.zeros((len(triangles), 6)), *(solid[2] for solid in solids)])
        area = np.ones(len(boxes), bool)
        _enclose(triangles, boxes, area)
        return Primitives(
            np.concatenate([triangles, np.zeros((len(boxes) - len(triangles), 9), np.float32)]),
            np.concatenate(forms).astype(np.int32),
            shape.astype(np.int32),
            np.concatenate([np.zeros(0, np.int32), *numbers]).astype(np.int32),
            _widened(boxes),
            area,
            np.concatenate([np.zeros(0), *(solid[3].ravel() for solid in solids)]),
        )


def _corners_of(mesh: Mesh) -> np.ndarray:
    """The vertices of every triangle, (M, 9) float32."""
    vertices = np.asarray(mesh.vertices, np.float32)
    if not np.all(np.abs(vertices) <= FARTHEST):
        raise ValueError(f"vertices of {mesh.name!r} are not all finite and within {FARTHEST:g} m; mend the mesh")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(vertices):
        raise ValueError(
            f"faces of {mesh.name!r} name vertices {mesh.faces.min()} to {mesh.faces.max()}; "
            f"expected 0 to {len(vertices) - 1}"
        )
    return vertices[mesh.faces].reshape(-1, 9)


def _solid_of(shape: Sphere | Polygon | Patches) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """A shape as N primitives: their kind as kernels store it; boxes (N, 6), low x, y, z and high x, y, z; what the
    kind's kernel takes (N, W), W a multiple of 4; and their numbers (N,) as `Hits` holds them."""
    primitive = np.zeros(1, np.int32)
    if isinstance(shape, Sphere):
        kind, centre = SPHERE, np.array(shape.centre, np.float64)
        boxes = np.concatenate([centre - shape.radius, centre + shape.radius])[None]
        measures = np.array([[*shape.centre, shape.radius]], np.float64)
    elif isinstance(shape, Polygon):
        kind = POLYGON
        boxes = np.concatenate([shape.vertices.min(axis=0), shape.vertices.max(axis=0)])[None]
        measures = polygon_measures(shape)[None]
        measures = np.concatenate([measures, np.zeros((1, -measures.size % 4))], axis=1)
    else:
        leaves = split(shape)
        kind, boxes, measures, primitive = LEAF, leaves.boxes, leaves.measures, leaves.patch
    if not np.all(np.abs(boxes) <= FARTHEST):
        raise ValueError(f"{shape.name!r} reaches beyond {FARTHEST:g} m; scale the scene to metres")
    return kind, boxes, measures, primitive


@exact_kernel
def _enclose(corners, boxes, area):
    """Write the box round each triangle, and whether it has an area."""
    for i in range(len(corners)):
        a = (np.float64(corners[i, 0]), np.float64(corners[i, 1]), np.float64(corners[i, 2]))
        b = (np.float64(corners[i, 3]), np.float64(corners[i, 4]), np.float64(corners[i, 5]))
        c = (np.float64(corners[i, 6]), np.float64(corners[i, 7]), np.float64(corners[i, 8]))
        for j in range(3):
            boxes[i, j], boxes[i, j + 3] = min(a[j], b[j], c[j]), max(a[j], b[j], c[j])
        px, py, pz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        qx, qy, qz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        area[i] = py * qz != pz * qy or pz * qx != px * qz or px * qy != py * qx


def _widened(boxes: np.ndarray) -> np.ndarray:
    """The boxes as float32, wider by more than a triangle test can err to the side, and by what rounding may take."""
    wider = np.empty(boxes.shape, np.float32)
    _widen(boxes, wider)
    return wider


@exact_kernel
def _widen(boxes, wider):
    """`_widened`, into `wider`."""
    for i in range(len(boxes)):
        margin = 1e-6 * max(
            boxes[i, 3] - boxes[i, 0], boxes[i, 4] - boxes[i, 1], boxes[i, 5] - boxes[i, 2], 0.0
        )  # fmt: skip
        for j in range(3):
            low, high = boxes[i, j], boxes[i, j + 3]
            wider[i, j] = low - margin - 1.2e-7 * abs(low)
            wider[i, j + 3] = high + margin + 1.2e-7 * abs(high)
