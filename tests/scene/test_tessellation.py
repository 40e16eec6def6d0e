"""Patches and polygons as triangles: on the surface, as large as it, with its normals, whatever their corners do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.renderers.raytrace.lamps import painted
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh, Patches, Polygon, Sphere, read_patches
from relume.scene.shapes.tessellation import as_mesh, tessellated, triangles_of, triangulated

GREY = Diffuse((0.5, 0.5, 0.5))
ARC = 4 / 3 * (np.sqrt(2) - 1)
"""Of a cubic's handles that follow a quarter of a circle to 0.03 % of its radius."""
ROUND = np.array([[1, 0], [1, ARC], [ARC, 1], [0, 1]])


def octant() -> np.ndarray:
    """An eighth of a unit ball round the origin, a corner of which is the point +Y: (1, 4, 4, 3), outward."""
    # u from the equator to the pole, v round it from +Z to +X.
    ring, height = ROUND[:, 0], ROUND[:, 1]
    x = ring[:, None] * ROUND[:, 1]
    z = ring[:, None] * ROUND[:, 0]
    return np.stack([x, np.broadcast_to(height[:, None], x.shape), z], axis=-1)[None, :, ::-1]


def areas(mesh: Mesh) -> np.ndarray:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    return np.cross(b - a, c - a) / 2


def test_a_patch_becomes_its_surface_with_its_normals_and_its_own_texture_coordinates():
    mesh = tessellated(Patches(octant(), GREY, "ball"))
    assert (mesh.vertices.shape, mesh.name) == ((33 * 33, 3), "ball")
    assert mesh.normals is not None and mesh.uv is not None
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 1, atol=6e-4)
    # Normals are exact: of this surface, which is a ball's to a part of a thousand.
    np.testing.assert_allclose(mesh.normals, mesh.vertices, atol=4e-3)
    assert areas(mesh).sum(axis=0) @ np.ones(3) == pytest.approx(3 * np.pi / 4, rel=1e-3)
    # v runs the other way round, so that it is outward; the equator's end at +X is the lower left corner.
    corner = np.flatnonzero(np.all(mesh.uv == 0, axis=1))
    np.testing.assert_allclose(mesh.vertices[corner], [[1, 0, 0]], atol=1e-6)
    assert mesh.uv[33 * 16].tolist() == [0.5, 0]


def test_normals_of_triangles_and_of_vertices_point_the_same_way():
    mesh = tessellated(Patches(octant(), GREY))
    assert mesh.normals is not None
    flat = areas(mesh)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.einsum("ij,ikj->ik", flat, mesh.normals[mesh.faces]).min() > 0.999


def test_a_side_that_is_one_point_has_the_normal_of_what_is_beside_it():
    # The pole lies towards +X; far away as well, where coordinates have fewer digits behind the point.
    for away in (0.0, 1e6):
        mesh = tessellated(Patches(octant()[..., [1, 2, 0]] + away, GREY), 31)
        assert mesh.normals is not None and mesh.uv is not None
        pole = mesh.normals[mesh.uv[:, 0] == 1]
        assert len(pole) == 32
        np.testing.assert_allclose(pole, np.broadcast_to([1, 0, 0], (32, 3)), atol=1e-4)


def test_triangles_without_area_are_left_out():
    # At the pole one of the two triangles of each of 32 cells is a line.
    assert len(tessellated(Patches(octant(), GREY)).faces) == 2 * 32 * 32 - 32
    line = np.zeros((1, 4, 4, 3))
    line[..., 0] = np.arange(4)
    both = tessellated(Patches(np.concatenate([octant(), line]), GREY), 4)
    assert len(both.faces) == 2 * 16 - 4 and np.all(np.isfinite(both.normals if both.normals is not None else np.nan))


def test_patches_join_into_one_mesh():
    moved = np.concatenate([octant(), octant() + np.array([0, 5, 0])])
    mesh = tessellated(Patches(moved, GREY), 8)
    assert len(mesh.vertices) == 2 * 81 and mesh.faces.max() == 161
    assert np.ptp(mesh.vertices[mesh.faces[len(mesh.faces) // 2 :]][..., 1]) < 1.01  # no triangle between the two


def test_newells_teapot_is_smooth_everywhere(shared: Path):
    mesh = tessellated(Patches(read_patches(shared / "data/meshes/teapot_patches/teapot.bpt"), GREY))
    assert mesh.normals is not None
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
    flat = areas(mesh)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.einsum("ij,ikj->ik", flat, mesh.normals[mesh.faces]).min() > 0.9


def test_less_than_one_cell_is_refused():
    with pytest.raises(ValueError, match="0 cells along a patch"):
        tessellated(Patches(octant(), GREY), 0)


SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
CHEVRON = [[0, 0], [2, 0], [1, 1], [2, 2], [0, 2]]
COMB = [[0, 0], [7, 0], [7, 3], [6, 3], [6, 1], [5, 1], [5, 3], [4, 3], [4, 1], [3, 1], [3, 3], [2, 3], [2, 1],
        [1, 1], [1, 3], [0, 3]]  # fmt: skip
FRAME = [[0, 0], [3, 0], [3, 3], [0, 3], [0, 0], [1, 1], [1, 2], [2, 2], [2, 1], [1, 1]]
"""A square with a square hole, to which one cut leads."""
SPIRAL = [[0, 0], [4, 0], [4, 4], [1, 4], [1, 2], [2, 2], [2, 3], [3, 3], [3, 1], [0, 1]]


def star(points: int) -> list[list[float]]:
    angle = np.arange(2 * points) * np.pi / points
    radius = np.where(np.arange(2 * points) % 2, 0.3, 1.0)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]).tolist()


@pytest.mark.parametrize(
    ("outline", "area"),
    [
        (SQUARE, 1.0),
        (CHEVRON, 3.0),
        (COMB, 15.0),
        (FRAME, 8.0),
        (SPIRAL, 10.0),
        (star(7), 14 / 2 * 0.3 * np.sin(np.pi / 7)),
        ([[0, 0], [0.5, 0], [1, 0], [1, 0], [1, 1], [0, 1], [0, 0.25]], 1.0),  # on its sides, and reported twice
    ],
    ids=["square", "chevron", "comb", "frame", "spiral", "star", "with vertices that say nothing"],
)
def test_a_polygon_is_cut_into_triangles_that_fill_it_once(outline: list[list[float]], area: float):
    points = np.array(outline, float)
    faces = triangles_of(points)
    a, b, c = np.moveaxis(points[faces], 1, 0)
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert twice.min() > 0 and twice.sum() / 2 == pytest.approx(area)
    # No point anywhere lies in two of them, and those in one are those inside the polygon, by the crossings' number.
    grid = np.random.default_rng(1).uniform(-1, 7, (20000, 1, 2))
    inside = [
        (q - p)[:, 0] * (grid[..., 1] - p[:, 1]) - (q - p)[:, 1] * (grid[..., 0] - p[:, 0]) > 0
        for p, q in ((a, b), (b, c), (c, a))
    ]
    counts = np.all(inside, axis=0).sum(axis=1)
    ends = np.roll(points, -1, axis=0)
    rises = (points[:, 1] > grid[..., 1]) != (ends[:, 1] > grid[..., 1])
    slope = (ends[:, 0] - points[:, 0]) / np.where(ends[:, 1] == points[:, 1], 1, ends[:, 1] - points[:, 1])
    right = points[:, 0] + (grid[..., 1] - points[:, 1]) * slope > grid[..., 0]
    np.testing.assert_array_equal(counts, np.sum(rises & right, axis=1) % 2)
    assert counts.sum() > 100


def test_an_outline_that_crosses_itself_is_refused_by_its_name():
    with pytest.raises(ValueError, match="crosses itself; split it"):
        triangles_of(np.array([[0, 0], [3, 3], [3, 0], [0, 2]], float)[::-1])
    bow = np.array([[0, 0, 0], [3, 3, 0], [3, 0, 0], [0, 2, 0]], float)
    with pytest.raises(ValueError, match="'bow': its outline crosses itself"):
        triangulated(Polygon(bow, GREY, "bow"))


def test_a_polygon_in_space_keeps_its_side_and_has_the_texture_coordinates_that_rays_see():
    # A chevron that leans, reported from a point on its side.
    u, v = np.array([0.6, 0, -0.8]), np.array([0.48, 0.8, 0.36])
    flat = np.array(CHEVRON[1:] + CHEVRON[:1], float)
    polygon = Polygon(np.array([5, -2, 1]) + flat[:, :1] * u + flat[:, 1:] * v, GREY, "chevron")
    mesh = triangulated(polygon)
    assert mesh.normals is None and mesh.uv is not None and mesh.name == "chevron"
    np.testing.assert_allclose(areas(mesh).sum(axis=0), polygon.area_vector, atol=1e-6)
    middles = mesh.vertices[mesh.faces].mean(axis=1).astype(np.float64)
    away = np.cross(u, v)
    hits = RayCaster.of([polygon]).nearest(middles + away, np.broadcast_to(-away, middles.shape).copy())
    seen = Surfaces.of([polygon]).at(middles + away, np.broadcast_to(-away, middles.shape).copy(), hits)
    assert np.all(hits.shape == 0)
    np.testing.assert_allclose(seen.uv, mesh.uv[mesh.faces].mean(axis=1), atol=1e-6)
    np.testing.assert_allclose(seen.geometric_normal, np.broadcast_to(away, middles.shape), atol=1e-9)


@pytest.mark.parametrize(("quartered", "allowed"), [(2, 0.02), (4, 6e-3)])
def test_an_image_goes_round_a_ball_without_a_seam(quartered: int, allowed: float):
    """Inside every triangle the interpolated coordinates are those of the place, also where u ends and at the poles."""
    ball = as_mesh(Sphere((1, 2, 3), 0.5, Diffuse(np.ones((4, 8, 3)))), quartered)
    assert ball.uv is not None and ball.normals is not None
    for weights in ([0.98, 0.01, 0.01], [0.01, 0.98, 0.01], [0.01, 0.01, 0.98], [0.5, 0.25, 0.25], [0.1, 0.5, 0.4]):
        place = np.einsum("k,fkc->fc", weights, ball.vertices[ball.faces].astype(np.float64)) - [1, 2, 3]
        x, y, z = (place / np.linalg.norm(place, axis=1, keepdims=True)).T
        u, v = np.einsum("k,fkc->fc", weights, ball.uv[ball.faces].astype(np.float64)).T
        off = (u - 0.5 - np.arctan2(x, -z) / (2 * np.pi) + 0.5) % 1 - 0.5
        assert np.abs(off * np.hypot(x, z)).max() < allowed
        assert np.abs(v - 0.5 - np.arcsin(y) / np.pi).max() < allowed
    # New vertices lie where the old ones do, and stand behind them.
    plain = as_mesh(Sphere((1, 2, 3), 0.5, GREY), quartered)
    assert plain.normals is not None and plain.uv is not None and len(plain.vertices) == 10 * 4**quartered + 2
    np.testing.assert_array_equal(ball.vertices[: len(plain.vertices)], plain.vertices)
    np.testing.assert_array_equal(ball.uv[: len(plain.uv)], plain.uv)
    np.testing.assert_array_equal(ball.vertices[ball.faces], plain.vertices[plain.faces])
    np.testing.assert_array_equal(ball.normals[ball.faces], plain.normals[plain.faces])


def test_an_image_is_the_same_on_both_sides_of_a_seam():
    """Looked up by rays from either side, a ball of triangles shows what the true ball shows: no third colour."""
    rows = np.zeros((16, 32, 3))
    rows[..., 0] = np.linspace(0.2, 0.8, 16)[:, None]
    rows[:, 10:22, 2] = 1.0  # in front, far from the seam at +Z
    sphere = Sphere((0, 0, 0), 1.0, Diffuse(rows))
    way = np.array([[x, y, -1.0] for x in (-0.05, -0.01, 0.01, 0.05) for y in (-0.8, 0, 0.8)])
    directions = way / np.linalg.norm(way, axis=1, keepdims=True)
    shown = []
    for shape in (as_mesh(sphere), sphere):
        hits = RayCaster.of((shape,)).nearest(-3 * directions, directions)
        at = Surfaces.of((shape,)).at(-3 * directions, directions, hits)
        shown.append(painted(rows)(at.uv))
    assert np.all(shown[0][:, 2] == 0)
    np.testing.assert_allclose(shown[0], shown[1], atol=0.01)
