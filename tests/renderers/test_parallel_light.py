"""Shadows of parallel light against rays, a slow twin and a closed form."""

from __future__ import annotations

import numpy as np
import pytest

import naive
import solids
from relume.renderers.raytrace import parallel_light
from relume.renderers.raytrace.closing import alike, closing_triangles, facing_cones, unit_normals
from relume.renderers.raytrace.parallel_light import Shadows
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh, Sphere
from relume.sphere.directions import normalised

GREY = Diffuse((0.5, 0.5, 0.5))
UP = np.array([0.0, 1.0, 0.0])


def triangles(count: int, seed: int, *, size: float = 0.5, offset: float = 0.0) -> Mesh:
    random = np.random.default_rng(seed)
    corners = random.normal(size=(count, 1, 3)) + random.normal(scale=size, size=(count, 3, 3)) + offset
    return Mesh(corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3), GREY)


def by_rays(caster: RayCaster, points: np.ndarray, direction: np.ndarray) -> np.ndarray:
    return caster.occluded(points, np.tile(direction, (len(points), 1)))


@pytest.mark.parametrize("count", [2, 15, 16, 17, 400])
def test_shadows_are_those_of_the_slow_twin(count: int) -> None:
    mesh, random = triangles(count, count, size=3.0 if count == 2 else 0.5), np.random.default_rng(2)
    shadows, points = Shadows.of(RayCaster.of([mesh])), random.normal(scale=1.0, size=(60, 3))
    hidden = []
    for direction in normalised(random.normal(size=(4, 3))):
        hidden.append(shadows.over(points, direction))
        slow = [np.isfinite(naive.nearest_hit([mesh], point, direction)[0]) for point in points]
        np.testing.assert_array_equal(hidden[-1], slow)
    assert 0 < np.mean(hidden) < 1


@pytest.mark.parametrize("offset", [0.0, 300.0])
@pytest.mark.parametrize("size", [0.02, 0.3, 5.0])
def test_shadows_are_those_of_rays(size: float, offset: float) -> None:
    mesh, random = triangles(3000, 7, size=size, offset=offset), np.random.default_rng(3)
    caster = RayCaster.of([mesh])
    shadows, points = Shadows.of(caster), random.normal(scale=1.5, size=(2000, 3)) + offset
    for direction in [UP, -UP, np.array([1.0, 0.0, 0.0]), *normalised(random.normal(size=(6, 3)))]:
        np.testing.assert_array_equal(shadows.over(points, direction), by_rays(caster, points, direction))


def test_points_a_hair_off_a_surface_are_as_rays_find_them() -> None:
    ball = solids.sphere(GREY)
    caster, random = RayCaster.of([ball]), np.random.default_rng(5)
    corners = ball.vertices.astype(np.float64)[ball.faces]
    normals = normalised(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    inside = np.einsum("fkc,fk->fc", corners, random.dirichlet([1, 1, 1], size=len(corners)))
    for away in (1e-5, -1e-5):
        points = inside + away * normals
        for direction in normalised(random.normal(size=(4, 3))):
            hidden = Shadows.of(caster).over(points, direction)
            np.testing.assert_array_equal(hidden, by_rays(caster, points, direction))
            # A convex body throws its shadow on the far side; from inside it is everywhere.
            clear = np.abs(normals @ direction) > 0.05
            np.testing.assert_array_equal(hidden[clear], ((normals @ direction < 0) | (away < 0))[clear])


def test_a_square_throws_a_square_shadow() -> None:
    corners = np.array([[-1, 1, -1], [-1, 1, 1], [1, 1, 1], [1, 1, -1]], np.float32)
    square = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GREY)
    x, z = np.meshgrid(np.linspace(-3, 3, 78), np.linspace(-3, 3, 78))
    points = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    hidden = Shadows.of(RayCaster.of([square])).over(points, normalised(np.array([1.0, 1.0, 0.5])))
    crossing = points + np.array([1.0, 1.0, 0.5])
    np.testing.assert_array_equal(hidden, np.abs(crossing[:, [0, 2]]).max(axis=1) < 1)
    # What lies behind a point is not in its way.
    assert not Shadows.of(RayCaster.of([square])).over(points + 2 * UP, UP).any()


def test_few_points_and_no_triangles_are_no_special_case() -> None:
    shadows = Shadows.of(RayCaster.of([triangles(200, 1)]))
    assert shadows.over(np.zeros((0, 3)), UP).shape == (0,)
    for points in (np.zeros((1, 3)), np.zeros((5, 3)), np.array([[0.0, 0, 0], [0, 5, 0]])):
        expected = by_rays(RayCaster.of([triangles(200, 1)]), points, UP)
        np.testing.assert_array_equal(shadows.over(points, UP), expected)
    flat = Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32), GREY)
    assert not Shadows.of(RayCaster.of([flat])).over(np.ones((4, 3)), UP).any()


def test_what_cannot_be_is_refused() -> None:
    shadows = Shadows.of(RayCaster.of([triangles(5, 1)]))
    with pytest.raises(ValueError, match="expected unit length"):
        shadows.over(np.zeros((1, 3)), 2 * UP)
    with pytest.raises(ValueError, match="finite metres"):
        shadows.over(np.full((1, 3), np.nan), UP)
    with pytest.raises(ValueError, match=r"outside is \(3,\)"):
        shadows.over(np.zeros((2, 3)), UP, np.ones(3, bool))
    with pytest.raises(ValueError, match="cast rays"):
        Shadows.of(RayCaster.of([Sphere((0.0, 0.0, 0.0), 1.0, GREY)]))


def holed(ball: Mesh, *, turned: bool = False) -> Mesh:
    """A ball without the faces about +Z, counter-clockwise from the inside if `turned`."""
    faces = ball.faces[ball.vertices[ball.faces][..., 2].mean(axis=1) < 0.8]
    return Mesh(ball.vertices, faces[:, ::-1] if turned else faces, GREY)


def moved(mesh: Mesh, by: tuple[float, float, float]) -> Mesh:
    return Mesh(mesh.vertices + np.array(by, np.float32), mesh.faces, GREY)


def closed_bodies() -> dict[str, list[Mesh]]:
    ball = solids.sphere(GREY)
    return {
        "a ball": [ball],
        "two that overlap": [ball, moved(ball, (0.9, 0.5, 0.0))],
        "one with a hole": [holed(ball), moved(ball, (2.2, 0.0, 0.5))],
        "inside out, with a hole": [holed(ball, turned=True)],
        "an open bowl about a ball": [holed(ball), Mesh(0.4 * ball.vertices, ball.faces, GREY)],
    }


@pytest.mark.parametrize("few", [0, 2000], ids=["left over to triangles", "left over to rays"])
@pytest.mark.parametrize("name", closed_bodies())
def test_points_known_to_be_outside_are_as_rays_find_them(name: str, few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel_light, "_FEW", few)
    meshes, random, eye = closed_bodies()[name], np.random.default_rng(11), np.array([0.5, 1.0, 6.0])
    caster = RayCaster.of(meshes)
    shadows = Shadows.of(caster)
    off = [random.normal(scale=1.2, size=(2000, 3))]
    for mesh in meshes:
        corners = mesh.vertices.astype(np.float64)[mesh.faces]
        normals = normalised(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        off += [(corners.mean(axis=1) + away * normals)[::7] for away in (1e-5, -1e-5)]
    points = np.concatenate(off)
    outside = shadows.outside(points, eye)
    # More than half, as only then half of the triangles are asked.
    points = np.concatenate([points[outside], points[~outside][: np.count_nonzero(outside) // 2]])
    outside = shadows.outside(points, eye)
    assert 0.6 < outside.mean() < 0.7
    for direction in [UP, -UP, np.array([0.0, 0.0, 1.0]), *normalised(random.normal(size=(5, 3)))]:
        hidden = shadows.over(points, direction, outside)
        np.testing.assert_array_equal(hidden, by_rays(caster, points, direction))


def test_outside_is_what_an_eye_outside_sees() -> None:
    ball, eye = solids.sphere(GREY), np.array([0.0, 0.0, 5.0])
    shadows = Shadows.of(RayCaster.of([ball]))
    points = np.array([[0, 0, 2.0], [0, 0, 0.5], [0, 0, -2.0], [3, 0, 0]])
    assert shadows.outside(points, eye).tolist() == [True, False, False, True]
    assert not shadows.outside(points, [0.0, 0.0, 0.9]).any()
    # Through a hole the inside is seen, and is inside all the same.
    bowl = Shadows.of(RayCaster.of([holed(ball)]))
    assert not RayCaster.of([holed(ball)]).occluded(points[1:2], [[0.0, 0.0, 1.0]]).any()
    assert bowl.outside(points, eye).tolist() == [True, False, False, True]
    # Loose triangles close nothing.
    assert not Shadows.of(RayCaster.of([triangles(50, 1)])).outside(points, eye).any()


def test_holes_are_closed_by_a_triangle_for_each_edge_of_their_rims() -> None:
    ball = solids.sphere(GREY)
    corners = ball.vertices[ball.faces].reshape(-1, 9)
    assert closing_triangles(corners).shape == (0, 9)
    assert closing_triangles(corners[:0]).shape == (0, 9)
    closing = closing_triangles(corners[1:])
    assert closing.shape == (3, 9)
    np.testing.assert_allclose(closing[:, 6:], np.tile(corners[0].reshape(3, 3).mean(axis=0), (3, 1)), atol=1e-6)
    # The same side is outside: the three have the area and the normal of the one that is missing.
    a, b, c = (closing[:, i : i + 3].astype(float) for i in (0, 3, 6))
    p, q, r = corners[0].reshape(3, 3).astype(float)
    np.testing.assert_allclose(np.cross(b - a, c - a).sum(axis=0), np.cross(q - p, r - p), atol=1e-7)
    assert closing_triangles(np.concatenate([corners[1:], closing])).shape == (0, 9)
    holes = np.concatenate([corners[1:40], corners[60:]])
    assert closing_triangles(np.concatenate([holes, closing_triangles(holes)])).shape == (0, 9)


def test_cones_hold_the_normals_of_their_triangles() -> None:
    corners = solids.sphere(GREY)
    corners = corners.vertices[corners.faces].reshape(-1, 9)
    order = alike(corners, 8)
    assert sorted(order) == list(range(len(corners)))
    cones, normals = facing_cones(corners[order], 8), unit_normals(corners[order])
    for direction in normalised(np.random.default_rng(1).normal(size=(40, 3))):
        faces = cones[:, :3] @ direction > cones[:, 3]
        least = np.minimum.reduceat(normals @ direction, np.arange(0, len(normals), 8))
        assert not (faces & (least <= 0)).any()
        # What is left are those that face both ways, or nearly.
        assert (faces | (least < 0.5)).all()
