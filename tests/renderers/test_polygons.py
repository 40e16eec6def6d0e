"""Rays against flat polygons: concave, tilted, edge-on, edge to edge, and against the slow twin."""

import math

import numpy as np
import pytest

import naive
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Plane, Polygon, Sphere
from relume.sphere.directions import normalised, rotation_about
from solids import quad

GREY = Diffuse((0.5, 0.5, 0.5))
X, Y, Z = np.eye(3)
TILT = rotation_about(normalised(X + 2 * Y - Z), 1.1)
# An L: six units' area of the square of nine.
ELL = np.array([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)], float)
IN_ELL = [(0.5, 0.5), (2.9, 0.5), (0.5, 2.9), (0.99, 0.99), (0.99, 1.01)]
OUT_OF_ELL = [(1.01, 1.01), (2, 2), (-0.01, 1), (3.01, 0.5), (0.5, 3.01), (1.5, -0.01)]


def polygon(flat, *, turn=np.eye(3), at=(0, 0, 0)):
    """A polygon of points in the plane z = 0, turned and moved."""
    flat = np.asarray(flat, float)
    return Polygon(np.concatenate([flat, np.zeros((len(flat), 1))], axis=1) @ turn.T + at, GREY)


def star(count, seed):
    """A star-shaped polygon of `count` vertices round the origin, within 1."""
    random = np.random.default_rng(seed)
    angle, radius = np.sort(random.uniform(0, 2 * math.pi, count)), random.uniform(0.1, 1, count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def place(points, turn=TILT, at=(0.3, -0.2, 0.7)):
    """Points of the plane z = 0, turned and moved as the polygons are."""
    return np.concatenate([points, np.zeros((len(points), 1))], axis=1) @ turn.T + at


def rays_at(targets, seed, spread=3.0):
    origins = np.random.default_rng(seed).normal(scale=spread, size=targets.shape)
    return origins, normalised(targets - origins)


# --- inside and outside ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [np.eye(3), TILT, rotation_about(Y, math.pi / 2), rotation_about(X, math.pi / 2)])
@pytest.mark.parametrize("reverse", [False, True])
def test_a_concave_polygon_is_met_inside_and_not_where_it_turns_in(turn, reverse):
    flat = ELL[::-1] if reverse else ELL
    caster = RayCaster.of([polygon(flat, turn=turn, at=(0.3, -0.2, 0.7))])
    for points, expected in ((IN_ELL, True), (OUT_OF_ELL, False)):
        targets = place(np.array(points), turn)
        for seed in range(20):
            origins, directions = rays_at(targets, seed)
            hits = caster.nearest(origins, directions)
            np.testing.assert_array_equal(hits.shape == 0, expected)
            if expected:
                np.testing.assert_allclose(hits.distance, np.linalg.norm(targets - origins, axis=-1), rtol=1e-12)


@pytest.mark.parametrize("count", [3, 4, 9, 40])
def test_polygons_are_met_as_the_slow_twin_meets_them(count):
    shapes = [
        polygon(star(count, 100 * count + k), turn=TILT @ rotation_about(X, k), at=(k / 3, 0, 0)) for k in range(9)
    ]
    random = np.random.default_rng(count)
    origins, directions = rays_at(random.normal(scale=0.8, size=(400, 3)) + X, count + 1)
    hits = RayCaster.of(shapes).nearest(origins, directions)
    slow = [naive.nearest_hit(shapes, o, d) for o, d in zip(origins, directions, strict=True)]
    distance, shape, _ = (np.array(column) for column in zip(*slow, strict=True))
    np.testing.assert_array_equal(hits.shape, shape)
    np.testing.assert_allclose(hits.distance, distance, rtol=1e-9)
    assert 30 < np.sum(hits.shape >= 0) < 390
    assert np.all(hits.primitive == 0) and np.all(hits.barycentric == 0)


def test_a_polygon_is_met_where_its_two_triangles_are():
    corners = place(np.array([(-1, -1), (2, -0.5), (1.5, 1), (-0.5, 2)], float))
    origins, directions = rays_at(np.random.default_rng(1).normal(size=(5000, 3)), 2)
    one = RayCaster.of([Polygon(corners.astype(np.float32).astype(float), GREY)]).nearest(origins, directions)
    two = RayCaster.of([quad(corners, GREY)]).nearest(origins, directions)
    assert 500 < np.sum(two.shape == 0) < 4500
    np.testing.assert_array_equal(one.shape, two.shape)
    # Corners in single precision are not quite in one plane.
    np.testing.assert_allclose(one.distance, two.distance, rtol=1e-4)


def test_with_two_polygons_edge_to_edge_no_ray_slips_between():
    # A dented sheet of triangles: every inner edge belongs to two of different planes, every inner vertex to six.
    random = np.random.default_rng(3)
    steps = np.arange(9.0)
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)
    grid[1:-1, 1:-1] += random.uniform(-0.3, 0.3, size=(7, 7, 2))
    heights = random.normal(scale=0.3, size=(9, 9))
    points = np.concatenate([grid, heights[..., None]], axis=-1) @ TILT.T
    corner = [(i, j) for i in range(8) for j in range(8)]
    shapes = []
    for i, j in corner:
        a, b, c, d = points[i, j], points[i + 1, j], points[i + 1, j + 1], points[i, j + 1]
        shapes += [Polygon(np.array([a, b, c]), GREY), Polygon(np.array([c, d, a]), GREY)]
    caster = RayCaster.of(shapes)
    starts, ends = points[1:-1, 1:-2].reshape(-1, 3), points[1:-1, 2:-1].reshape(-1, 3)
    share = random.random((len(starts), 1))
    targets = np.concatenate([starts, ends, starts + share * (ends - starts), (starts + ends) / 2])
    origins = np.array([4, 4, 9]) @ TILT.T + random.normal(size=(300, 1, 3))
    directions = normalised(targets - origins).reshape(-1, 3)
    hits = caster.nearest(np.repeat(origins[:, 0], len(targets), axis=0), directions)
    assert len(directions) > 30_000
    assert np.all(hits.shape >= 0)


def test_a_ray_in_a_polygon_s_own_plane_does_not_meet_it():
    caster = RayCaster.of([polygon(ELL)])
    origins = np.array([[-1, 0.5, 0], [0.5, 0.5, 0], [-1, -1, 0], [0.5, -1, 0]])
    directions = normalised([[1, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert np.all(caster.nearest(origins, directions).shape == -1)


def test_a_ray_nearly_in_its_plane_meets_it_no_farther_than_it_reaches():
    # A vertex of double precision is 1e-16 out of the plane, and this ray climbs as little.
    shape = polygon([(0, 0), (1, 0), (1, 1), (0, 1)], turn=TILT)
    caster = RayCaster.of([shape])
    random = np.random.default_rng(4)
    targets = place(random.uniform(0, 1, size=(5000, 2)), at=(0, 0, 0))
    turns = random.uniform(0, 2 * np.pi, 5000)
    along = place(np.stack([np.cos(turns), np.sin(turns)], axis=-1), at=(0, 0, 0))
    rise = 10.0 ** random.uniform(-18, -8, size=(5000, 1)) * TILT[:, 2]
    directions = normalised(along + rise)
    hits = caster.nearest(targets - 3 * directions, directions)
    met = hits.shape == 0
    assert met.sum() > 1000
    assert np.all(np.abs(hits.distance[met] - 3) < 1.5)


def test_polygons_that_coincide_with_others_belong_to_the_first():
    square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    flat = polygon(square, turn=rotation_about(X, -math.pi / 2))
    directions = normalised(np.random.default_rng(5).normal(size=(500, 3)) * 0.2 - Y)
    for shapes in ([flat, Plane(GREY, (9.0, 9.0))], [Plane(GREY, (9.0, 9.0)), flat]):
        assert np.all(RayCaster.of(shapes).nearest(0.5 * Y, directions).shape == 0)


# --- with others -----------------------------------------------------------------------------------------------------


def test_a_polygon_occludes_where_it_is_met_before_the_end():
    shapes = [polygon(star(12, 6), turn=TILT), Sphere((0.4, 0.2, 0.1), 0.3, GREY)]
    caster = RayCaster.of(shapes)
    origins, directions = rays_at(np.random.default_rng(7).normal(scale=0.5, size=(3000, 3)), 8)
    distance = caster.nearest(origins, directions).distance
    assert 300 < np.sum(distance < np.inf) < 2700
    for ends in (np.inf, 2.5, distance, distance * (1 + 1e-9)):
        np.testing.assert_array_equal(caster.occluded(origins, directions, ends), distance < ends)


def test_a_polygon_beyond_every_measure_is_refused_by_name():
    with pytest.raises(ValueError, match="'polygon' reaches beyond 1e\\+15 m"):
        RayCaster.of([polygon(ELL * 1e16)])


# --- the surface -----------------------------------------------------------------------------------------------------


def surface_of(shape, origins, directions):
    hits = RayCaster.of([shape]).nearest(origins, directions)
    assert np.all(hits.shape == 0)
    return Surfaces.of([shape]).at(origins, directions, hits)


def test_the_normal_points_to_those_who_see_it_counter_clockwise():
    for flat, normal in ((ELL, Z), (ELL[::-1], -Z)):
        surface = surface_of(polygon(flat), [[0.5, 0.5, 2], [0.5, 0.5, -2]], np.array([-Z, Z]))
        np.testing.assert_allclose(surface.geometric_normal, [normal, normal], atol=1e-15)
        np.testing.assert_allclose(surface.shading_normal, [normal, normal], atol=1e-15)


def test_texture_coordinates_go_over_the_rectangle_whose_u_runs_along_the_first_edge():
    # The first edge is 5 m from (0, 0) along (3, 4); a vertex lies 5 m beyond its end, and one 10 m to its left.
    along, left = np.array([0.6, 0.8]), np.array([-0.8, 0.6])
    flat = np.array([0 * along, 5 * along, 10 * along + 4 * left, 10 * left])
    shape = polygon(flat, turn=TILT, at=(1, 2, 3))
    targets = place(np.array([2.5 * along + 2 * left, 5 * along + 5 * left]), at=(1, 2, 3))
    surface = surface_of(shape, targets + TILT[:, 2], np.tile(-TILT[:, 2], (2, 1)))
    np.testing.assert_allclose(surface.uv, [(0.25, 0.2), (0.5, 0.5)], atol=1e-6)
    np.testing.assert_allclose(surface.dp_du, np.tile(place(10 * along[None], at=(0, 0, 0)), (2, 1)), atol=1e-12)
    np.testing.assert_allclose(surface.dp_dv, np.tile(place(10 * left[None], at=(0, 0, 0)), (2, 1)), atol=1e-12)


def test_a_vertex_reported_twice_changes_nothing():
    once, twice = polygon(ELL, turn=TILT), polygon(np.concatenate([ELL[:1], ELL]), turn=TILT)
    origins, directions = rays_at(place(np.random.default_rng(9).uniform(0, 3, size=(400, 2)), at=(0, 0, 0)), 10)
    one, two = (RayCaster.of([shape]).nearest(origins, directions) for shape in (once, twice))
    np.testing.assert_array_equal(one.shape, two.shape)
    np.testing.assert_allclose(one.distance, two.distance, rtol=1e-14)
    assert 100 < np.sum(one.shape == 0) < 300
    first, second = (Surfaces.of([shape]).at(origins, directions, one) for shape in (once, twice))
    np.testing.assert_allclose(first.uv, second.uv, atol=1e-7)
