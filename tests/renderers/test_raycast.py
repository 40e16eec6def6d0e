"""Rays against slow twins, through edges and vertices, from and along surfaces; and what is found where they hit."""

import math
from typing import Any

import numpy as np
import pytest
import trimesh

import naive
import solids
from relume.renderers.raytrace import bvh
from relume.renderers.raytrace.bvh import LARGEST_LEAF, build_tree
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh, Patches, Plane, Polygon, Sphere
from relume.sphere.directions import normalised, rotation_about

GREY = Diffuse((0.5, 0.5, 0.5))
X, Y, Z = np.eye(3)
ORIGIN = np.zeros(3)


def soup(count, seed, *, size=0.5, spread=1.0, name="soup"):
    """Unconnected triangles."""
    random = np.random.default_rng(seed)
    middles = random.normal(scale=spread, size=(count, 1, 3))
    vertices = (middles + random.normal(scale=size, size=(count, 3, 3))).reshape(-1, 3)
    return Mesh(vertices.astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3), GREY, name=name)


def mesh_of(vertices, faces, *, normals=None, uv=None):
    vertices, normals, uv = (None if v is None else np.array(v, np.float32) for v in (vertices, normals, uv))
    assert vertices is not None
    return Mesh(vertices, np.array(faces, np.int32), GREY, normals, uv)


def triangle(*corners, **given):
    return mesh_of(corners, [[0, 1, 2]], **given)


def rays(count, seed, *, spread=3.0):
    random = np.random.default_rng(seed)
    return random.normal(scale=spread, size=(count, 3)), normalised(random.normal(size=(count, 3)))


def rays_at(mesh, count, seed):
    """Rays at points in and round the triangles of a mesh."""
    random = np.random.default_rng(seed)
    corners = mesh.vertices.astype(np.float64)[mesh.faces[random.integers(len(mesh.faces), size=count)]]
    targets = np.sum(corners * random.dirichlet([1, 1, 1], size=count)[..., None], axis=1)
    targets += random.normal(scale=0.1, size=(count, 3))
    origins = random.normal(scale=3, size=(count, 3))
    return origins, normalised(targets - origins)


def agrees_with_twin(shapes, origins, directions):
    """Hold the fast answer against the slow one; how many rays met something."""
    hits = RayCaster.of(shapes).nearest(origins, directions)
    slow = [naive.nearest_hit(shapes, o, d) for o, d in zip(origins, directions, strict=True)]
    distance, shape, primitive = (np.array(column) for column in zip(*slow, strict=True))
    np.testing.assert_array_equal(hits.shape, shape)
    np.testing.assert_array_equal(hits.primitive, primitive)
    np.testing.assert_allclose(hits.distance, distance, rtol=1e-9)
    return int(np.sum(hits.shape >= 0))


# --- against the slow twin -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 9, 300])
def test_triangles_are_met_as_the_slow_twin_meets_them(count):
    mesh = soup(count, seed=count)
    assert 50 < agrees_with_twin([mesh], *rays_at(mesh, 600, seed=1)) < 600


def test_spheres_planes_and_several_meshes_are_met_as_the_slow_twin_meets_them():
    random = np.random.default_rng(5)
    spheres = [Sphere(tuple(random.normal(scale=2, size=3)), random.uniform(0.05, 0.8), GREY) for _ in range(60)]
    planes = [Plane(GREY, (3.0, 2.0), height=-1.0), Plane(GREY, (1.0, 4.0), height=0.5), Plane(GREY, height=-4.0)]
    shapes = [soup(40, seed=6), *planes[:2], *spheres, soup(30, seed=7), planes[2]]
    assert 500 < agrees_with_twin(shapes, *rays(1500, seed=8)) < 1500


def test_small_things_far_away_are_met_as_the_slow_twin_meets_them():
    shapes = [soup(50, seed=9, size=1e-3, spread=1e-2), Sphere((0.0, 0.0, 0.0), 0.02, GREY)]
    directions = normalised(np.random.default_rng(10).normal(size=(500, 3)))
    targets = np.random.default_rng(11).normal(scale=0.01, size=(500, 3))
    origins = targets - 1000 * directions
    hits = RayCaster.of(shapes).nearest(origins, directions)
    slow = np.array([naive.nearest_hit(shapes, o, d)[0] for o, d in zip(origins, directions, strict=True)])
    # Coordinates of a kilometre end 1e-13 m from where they should; a sphere's rim may turn that into its square root.
    either = np.isfinite(hits.distance) & np.isfinite(slow)
    assert np.sum(np.isfinite(hits.distance) != np.isfinite(slow)) == 0 and np.sum(either) > 300
    np.testing.assert_allclose(hits.distance[either], slow[either], atol=1e-6, rtol=0)


def test_the_middle_of_a_small_sphere_a_thousand_kilometres_away_is_met_on_its_surface():
    hits = RayCaster.of([Sphere((0.0, 0.0, -1e6), 1e-3, GREY)]).nearest(ORIGIN, [[0, 0, -1]])
    assert hits.distance[0] == pytest.approx(1e6 - 1e-3, abs=1e-9)


def test_shapes_that_shrink_by_halves_are_all_met():
    # Such a tree is deep: a cut through the middle of all sets one aside.
    steps = 2.0 ** -np.arange(60)
    shapes = [triangle((s, -s / 9, 0), (s + s / 9, -s / 9, 0), (s, s / 9, 0)) for s in steps]
    caster = RayCaster.of(shapes)
    assert caster.geometry.depth > 12
    origins = np.stack([1.01 * steps, 0 * steps, 1 + 0 * steps], axis=-1)
    np.testing.assert_array_equal(caster.nearest(origins, np.tile(-Z, (60, 1))).shape, np.arange(60))


# --- the tree --------------------------------------------------------------------------------------------------------


def leaves_of(tree):
    """(first, count) of every leaf, each found with its box inside those above it."""
    everything = np.array([-np.inf, np.inf] * 3)
    found, pending = [], [(tree.root, everything)]
    while pending:
        reference, box = pending.pop()
        if reference < 0:
            found.append((~reference >> 3, ~reference & 7, box))
        else:
            for child in range(4):
                inner = tree.boxes[reference, child::4]
                if inner[0] == np.inf:
                    continue
                assert np.all(inner[::2] >= box[::2]) and np.all(inner[1::2] <= box[1::2])
                pending.append((tree.children[reference, child], inner))
    return found


@pytest.mark.parametrize("count", [2, 5, 1000])
@pytest.mark.parametrize("where", ["apart", "coincident", "in a row"])
def test_each_primitive_is_in_one_leaf_whose_box_encloses_it(count, where):
    random = np.random.default_rng(count)
    middles = random.normal(size=(count, 3)) * {"apart": 1, "coincident": 0, "in a row": [0, 0, 1]}[where]
    sizes = random.uniform(0, 0.1, size=(count, 3))
    boxes = np.concatenate([middles - sizes, middles + sizes], axis=1).astype(np.float32)
    tree = build_tree(boxes)
    leaves = leaves_of(tree)
    assert sorted(tree.order) == list(range(count))
    assert sorted(np.concatenate([np.arange(first, first + n) for first, n, _ in leaves])) == list(range(count))
    for first, n, box in leaves:
        assert 1 <= n <= LARGEST_LEAF
        for primitive in tree.order[first : first + n]:
            assert np.all(boxes[primitive, :3] >= box[::2]) and np.all(boxes[primitive, 3:] <= box[1::2])


def test_a_tree_built_in_parts_is_the_tree_built_in_one_go(monkeypatch):
    random = np.random.default_rng(1)
    middles = random.normal(size=(3000, 3)) * [4, 1, 0.2]
    middles[:500] = 0.5
    boxes = np.concatenate([middles - 0.05, middles + 0.05], axis=1).astype(np.float32)
    build, fold, built, handed = bvh._build, bvh._fold, [], []

    def building(*work: Any) -> Any:
        built.append(work[4:6])
        return build(*work)

    def folding(nodes: np.ndarray, children: np.ndarray, root: int, depth: int, *wide: np.ndarray) -> Any:
        # The depth is room that is set aside: a shallower one would be written beyond.
        handed.append((root, depth, len(wide[0])))
        return fold(nodes, children, root, depth, *wide)

    monkeypatch.setattr(bvh, "_build", building)
    monkeypatch.setattr(bvh, "_fold", folding)
    whole = build_tree(boxes)
    assert built == [(0, 3000)]
    monkeypatch.setattr(bvh, "PART", 10)
    for parts in (2, 16, 100):
        monkeypatch.setattr(bvh, "PARTS", parts)
        built.clear()
        tree = build_tree(boxes)
        pieces = sorted(built[1:])
        assert len(pieces) >= parts and all(end - begin <= 3000 // parts for begin, end in pieces)
        assert handed[-1] == handed[0]
        for name in ("boxes", "children", "order", "root", "depth"):
            np.testing.assert_array_equal(getattr(tree, name), getattr(whole, name), err_msg=f"{name}, {parts} parts")


def test_the_tree_spares_a_ray_most_of_the_triangles():
    # What the heuristic is for: boxes met by a ray count with their area, in units of the whole.
    ball = solids.sphere(GREY, fine=5)
    tree = RayCaster.of([ball]).geometry
    boxes = tree.boxes.reshape(-1, 6, 4).transpose(0, 2, 1)[np.isfinite(tree.boxes[:, :4])].reshape(-1, 3, 2)
    sides = boxes[..., 1] - boxes[..., 0]
    areas = 2 * np.sum(sides * np.roll(sides, 1, axis=-1), axis=-1)
    assert len(boxes) > len(ball.faces) / LARGEST_LEAF - 1
    assert areas.sum() / 24 < 21  # of 24 m² round the ball; halves of the triangles in random order have 4000


# --- no cracks -------------------------------------------------------------------------------------------------------


def leaks(mesh, inside, targets):
    """How many rays from points inside a closed mesh towards points on it meet nothing, and how many rays."""
    caster, missed, cast = RayCaster.of([mesh]), 0, 0
    for origin in inside:
        towards = targets - origin
        length = np.linalg.norm(towards, axis=-1)
        hits = caster.nearest(origin, towards / length[:, None])
        missed += int(np.sum(~(np.abs(hits.distance - length) < 1e-5)))
        cast += len(targets)
    return missed, cast


def test_a_million_rays_at_the_edges_and_vertices_of_a_closed_mesh_all_hit():
    random = np.random.default_rng(12)
    mesh = solids.sphere(GREY, centre=(0.3, -0.2, 0.7), radius=1.3)
    vertices = mesh.vertices.astype(np.float64)
    start, end = np.moveaxis(vertices[trimesh.Trimesh(vertices, mesh.faces, process=False).edges_unique], 1, 0)
    share = random.random((len(start), 1))
    targets = np.concatenate([vertices, (start + end) / 2, start + share * (end - start)])
    inside = mesh.vertices.mean(0) + random.uniform(-0.4, 0.4, size=(60, 3))
    missed, cast = leaks(mesh, inside, targets)
    assert cast > 1_000_000
    assert missed == 0


def test_rays_along_the_axes_through_edges_and_vertices_all_hit():
    # An octahedron's vertices lie on the axes and its edges in their planes; every product in a test is exact or 0.
    mesh = mesh_of(
        [X, -X, Y, -Y, Z, -Z], [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    )
    vertices = mesh.vertices.astype(np.float64)
    targets = np.concatenate([vertices, normalised(X + Y + np.array([Z, -Z])), (X + np.array([Y, Z, -Y])) / 2])
    caster = RayCaster.of([mesh])
    assert np.all(np.isfinite(caster.nearest(ORIGIN, normalised(targets)).distance))
    for axis in (*np.eye(3), *-np.eye(3)):
        for aside in (ORIGIN, 0.25 * np.roll(axis, 1), 0.5 * np.roll(axis, 2), -0.0 * axis):
            # Signed zeros, too.
            for zero in (0.0, -0.0):
                hits = caster.nearest(aside - 3 * axis, np.where(axis == 0, zero, axis)[None])
                assert hits.distance[0] == pytest.approx(2 + np.abs(aside).sum(), abs=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_parallel_rays_through_the_corners_and_edges_of_a_flat_grid_all_hit(axis, sign):
    # The grid is as flat as a box can be and every ray runs along the sides of boxes.
    steps = np.arange(-8, 9, dtype=np.float32)
    first, second = (g.ravel() for g in np.meshgrid(steps, steps, indexing="ij"))
    vertices = np.roll(np.stack([np.full_like(first, 2.0), first, second], axis=-1), axis, axis=1)
    caster = RayCaster.of([mesh_of(vertices, solids.grid_faces(16, 16))])
    halves = np.arange(-16, 17) / 2
    first, second = (g.ravel() for g in np.meshgrid(halves, halves, indexing="ij"))
    origins = np.roll(np.stack([np.full_like(first, 2 - 5 * sign), first, second], axis=-1), axis, axis=1)
    direction = np.roll([sign, 0.0, -0.0], axis)
    hits = caster.nearest(origins, np.tile(direction, (len(origins), 1)))
    np.testing.assert_array_equal(hits.distance, 5.0)


def test_rays_just_inside_the_rim_of_a_sphere_hit():
    # The boxes are in single precision, the spheres in double: a nanometre of a sphere must not stand out of its box.
    centres = np.random.default_rng(38).uniform(-99, 99, size=(500, 3))
    caster = RayCaster.of([Sphere((x, y, z), 0.3, GREY) for x, y, z in centres])
    for axis, aside in ((Z, X), (Z, -X), (X, Y), (X, -Y), (Y, Z), (Y, -Z)):
        origins = centres + (0.3 - 1e-9) * aside - axis
        hits = caster.nearest(origins, np.tile(axis, (500, 1)))
        assert np.all(hits.distance < 1.001)


def test_rays_at_an_edge_much_longer_than_its_triangles_are_wide_all_hit():
    # A triangle test errs in proportion to the edge's length; a box whose side is the edge must not be surer of itself.
    across = np.arange(-8.0, 9.0)
    vertices = [(x, 0, z) for z in (-1000, 1000) for x in across]
    caster, random = RayCaster.of([mesh_of(vertices, solids.grid_faces(1, 16))]), np.random.default_rng(13)
    origins = np.concatenate([random.normal(size=(100_000, 3)), random.normal(scale=(1, 1e-3, 1), size=(100_000, 3))])
    targets = np.stack([np.zeros(200_000), np.zeros(200_000), random.uniform(-500, 500, 200_000)], axis=-1)
    assert np.all(caster.nearest(origins, normalised(targets - origins)).shape == 0)


# --- from, along and inside surfaces ---------------------------------------------------------------------------------


def test_a_ray_that_starts_on_a_surface_does_not_meet_it_again():
    shapes = [triangle((-1, 0, -1), (1, 0, -1), (0, 0, 1)), Plane(GREY, (2.0, 2.0), height=-1.0)]
    away, through = RayCaster.of(shapes).nearest(ORIGIN, [Y, -Y]).distance
    assert away == np.inf
    assert through == 1.0


def test_hits_up_to_a_distance_are_ignored_when_asked():
    caster = RayCaster.of([Sphere((0.0, 0.0, 0.0), 1.0, GREY), Plane(GREY, height=-3.0), *two_layers()])
    down = [-Y]
    far = [caster.nearest(4 * Y, down, beyond=beyond).distance[0] for beyond in (0, 1.9, 2, 3, 5, 6.5, 7)]
    assert far == [2, 2, 3, 5, 6.5, 7, np.inf]


def two_layers():
    return [triangle((-9, y, -9), (9, y, -9), (0, y, 9)) for y in (2.0, -2.5)]


def test_a_ray_inside_a_sphere_meets_its_far_side():
    caster = RayCaster.of([Sphere((1.0, 2.0, 3.0), 2.0, GREY)])
    origins = np.array([[1, 2, 3], [1, 2, 4.5], [1, 2, 5.5], [1, 2, 0.5]])
    np.testing.assert_allclose(caster.nearest(origins, np.tile(Z, (4, 1))).distance, [2, 0.5, np.inf, 0.5])


def test_surfaces_are_met_from_both_sides():
    shapes = [triangle((-1, 1, -1), (1, 1, -1), (0, 1, 1)), Plane(GREY, (2.0, 2.0), height=-1.0)]
    np.testing.assert_array_equal(RayCaster.of(shapes).nearest(ORIGIN, [Y, -Y]).shape, [0, 1])
    below = RayCaster.of(shapes).nearest([0, -2, 0], [Y])
    assert (below.distance[0], below.shape[0]) == (1.0, 1)


def test_a_plane_ends_at_its_extent():
    caster = RayCaster.of([Plane(GREY, (2.0, 4.0), height=1.0), Plane(GREY)])
    origins = np.array([[0.99, 5, 0], [1.01, 5, 0], [0, 5, -1.99], [0, 5, -2.01], [499, 5, 0], [501, 5, 0]])
    hits = caster.nearest(origins, np.tile(-Y, (6, 1)))
    np.testing.assert_array_equal(hits.shape, [0, 1, 0, 1, 1, -1])
    assert caster.nearest([0, 1, 0], [X]).shape[0] == -1, "a ray in the plane's own height"


def test_triangles_without_area_are_never_hit_and_keep_their_number():
    vertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0], [0, 0, 0.5], [0, 0, 0.25], [0, 0, 0.75], [0.1, 0, 0.5]]
    faces = [[3, 3, 3], [3, 4, 5], [3, 6, 3], [0, 1, 2]]
    hits = RayCaster.of([mesh_of(vertices, faces)]).nearest([[0, 0, 2], [0.05, 0, 2]], [-Z, -Z])
    np.testing.assert_array_equal(hits.distance, [2, 2])
    np.testing.assert_array_equal(hits.primitive, [3, 3])
    slivers = RayCaster.of([mesh_of(vertices, faces[:3])])
    assert np.all(slivers.nearest(*rays(1000, seed=13)).shape == -1)
    assert np.all(slivers.nearest([0, 0, 2], normalised(np.array(vertices[3:]) - [0, 0, 2])).shape == -1)


def test_rays_at_triangles_whose_corners_are_in_line_do_not_hit():
    random = np.random.default_rng(37)
    start, step = random.integers(-99, 99, size=(2, 2000, 1, 3))
    corners = (start + step * np.array([[0], [3], [7]])) / 64
    targets = (start + step * random.uniform(0, 7, size=(2000, 1, 1)))[:, 0] / 64
    slivers = mesh_of(corners.reshape(-1, 3), np.arange(6000).reshape(-1, 3))
    origins = random.normal(scale=9, size=(2000, 3))
    assert np.all(RayCaster.of([slivers]).nearest(origins, normalised(targets - origins)).shape == -1)


def test_a_hundred_triangles_in_one_place_are_met_there():
    one = soup(1, seed=14)
    many = Mesh(one.vertices, np.tile(one.faces, (100, 1)), GREY)
    origins, directions = rays(300, seed=15, spread=1.0)
    np.testing.assert_array_equal(
        RayCaster.of([many]).nearest(origins, directions).distance,
        RayCaster.of([one]).nearest(origins, directions).distance,
    )


def test_no_shapes_are_never_hit():
    caster = RayCaster.of([])
    hits = caster.nearest(ORIGIN, np.eye(3))
    np.testing.assert_array_equal(hits.distance, [np.inf] * 3)
    np.testing.assert_array_equal(hits.shape, [-1] * 3)
    np.testing.assert_array_equal(caster.occluded(ORIGIN, np.eye(3)), [False] * 3)
    assert np.all(Surfaces.of([]).at(ORIGIN, np.eye(3), hits).shading_normal == 0)


def test_no_rays_hit_nothing():
    caster = RayCaster.of([soup(5, seed=1)])
    assert caster.nearest(ORIGIN, np.zeros((0, 3))).shape.shape == (0,)
    assert caster.occluded(ORIGIN, np.zeros((0, 3))).shape == (0,)


# --- occlusion, threads ----------------------------------------------------------------------------------------------


def mixed():
    return [soup(200, seed=16), Sphere((0.5, 0.5, 0.5), 0.7, GREY), Plane(GREY, (5.0, 5.0), height=-1.0)]


def test_a_ray_is_occluded_where_the_nearest_hit_is_nearer_than_its_end():
    caster, (origins, directions) = RayCaster.of(mixed()), rays(5000, seed=17)
    distance = caster.nearest(origins, directions).distance
    np.testing.assert_array_equal(caster.occluded(origins, directions), distance < np.inf)
    for ends in (2.0, np.random.default_rng(18).uniform(0, 6, size=5000), distance, distance * (1 + 1e-9)):
        occluded = caster.occluded(origins, directions, ends)
        np.testing.assert_array_equal(occluded, distance < ends)
        assert occluded.dtype == bool
    assert not np.any(caster.occluded(origins, directions, 0.0))


def test_hits_do_not_depend_on_the_number_of_threads():
    caster, (origins, directions) = RayCaster.of(mixed()), rays(70_000, seed=19)
    one = caster.nearest(origins, directions, threads=1)
    for threads in (2, 5, None):
        other = caster.nearest(origins, directions, threads=threads)
        for name in ("distance", "shape", "primitive", "barycentric"):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))
    surfaces = Surfaces.of(mixed())
    alone, together = (surfaces.at(origins, directions, one, threads=threads).point for threads in (1, 3))
    np.testing.assert_array_equal(together, alone)
    np.testing.assert_array_equal(
        caster.occluded(origins, directions, 2.0, threads=1), caster.occluded(origins, directions, 2.0, threads=3)
    )


def test_rays_from_one_point_are_as_rays_from_that_point_each():
    caster, (_, directions) = RayCaster.of(mixed()), rays(1000, seed=20)
    one = caster.nearest([3.0, 0.5, 0.0], directions)
    np.testing.assert_array_equal(
        caster.nearest(np.tile([3.0, 0.5, 0.0], (1000, 1)), directions).distance, one.distance
    )


# --- where they hit --------------------------------------------------------------------------------------------------


def hits_on(shapes, origins, directions):
    hits = RayCaster.of(shapes).nearest(origins, directions)
    return hits, Surfaces.of(shapes).at(origins, directions, hits)


def test_barycentric_coordinates_lead_to_the_point():
    mesh, (origins, directions) = soup(300, seed=21), rays(3000, seed=22, spread=1.0)
    hits, surface = hits_on([mesh], origins, directions)
    met = hits.shape >= 0
    assert met.sum() > 500
    second, third = hits.barycentric[met].T.astype(np.float64)
    weights = np.stack([1 - second - third, second, third], axis=-1)
    assert weights.min() > -1e-6
    corners = mesh.vertices[mesh.faces[hits.primitive[met]]].astype(np.float64)
    np.testing.assert_allclose(np.einsum("nk,nkj->nj", weights, corners), surface.point[met], atol=2e-6)
    np.testing.assert_allclose(surface.point[met], (origins + hits.distance[:, None] * directions)[met], atol=1e-12)


def test_rays_that_meet_nothing_have_zeros():
    hits, surface = hits_on(mixed(), *rays(500, seed=23))
    missed = hits.shape < 0
    assert 0 < missed.sum() < 500
    for values in (surface.point, surface.geometric_normal, surface.shading_normal, surface.uv, surface.dp_du):
        assert np.all(values[missed] == 0)
    assert np.all(hits.primitive[missed] == 0) and np.all(hits.barycentric[missed] == 0)


def test_a_counter_clockwise_face_has_its_normal_towards_the_viewer():
    shapes = [triangle((-1, -1, 0), (1, -1, 0), (0, 1, 0)), Plane(GREY, height=-5.0)]
    _, surface = hits_on(shapes, [[0, 0, 1], [0, 0, -1], [3, 0, 0], [3, -9, 0]], [-Z, Z, -Y, Y])
    np.testing.assert_allclose(surface.geometric_normal, [Z, Z, Y, Y])
    np.testing.assert_allclose(surface.shading_normal, [Z, Z, Y, Y])


def test_a_sphere_has_its_normal_outward():
    centre = np.array([1.0, 2.0, 3.0])
    directions = normalised(np.random.default_rng(24).normal(size=(100, 3)))
    _, surface = hits_on([Sphere(tuple(centre), 2.5, GREY)], centre, directions)
    np.testing.assert_allclose(surface.geometric_normal, directions, atol=1e-12)
    np.testing.assert_allclose(surface.shading_normal, directions, atol=1e-12)
    np.testing.assert_allclose(surface.point, centre + 2.5 * directions, atol=1e-12)


def test_shading_normals_are_the_vertices_normals_weighed_and_normalised():
    mesh = triangle((0, 0, 0), (4, 0, 0), (0, 4, 0), normals=[[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    # Weights ¼, ½, ¼ at (2, 1).
    _, surface = hits_on([mesh], [[2, 1, 1], [1e-9, 1e-9, 1]], [-Z, -Z])
    np.testing.assert_allclose(surface.shading_normal[0], np.array([2, 1, 1]) / math.sqrt(6), atol=1e-6)
    np.testing.assert_allclose(surface.shading_normal[1], Z, atol=1e-6)
    np.testing.assert_allclose(surface.geometric_normal, [Z, Z])


def test_normals_that_cancel_leave_the_geometric_one():
    mesh = triangle((0, 0, 0), (4, 0, 0), (0, 4, 0), normals=np.zeros((3, 3)))
    np.testing.assert_allclose(hits_on([mesh], [1, 1, 1], [-Z])[1].shading_normal, [Z])


def test_smooth_normals_of_a_fine_ball_are_those_of_a_sphere():
    ball = solids.sphere(GREY, centre=(0, 1, 0))
    _, surface = hits_on([ball], [0, 1, 0], normalised(np.random.default_rng(25).normal(size=(1000, 3))))
    outward = normalised(surface.point - [0, 1, 0])
    assert np.min(np.sum(surface.shading_normal * outward, -1)) > 1 - 1e-6
    assert np.min(np.sum(surface.geometric_normal * outward, -1)) < 1 - 1e-4


@pytest.mark.parametrize(
    ("direction", "uv"),
    [
        (-Z, (0.5, 0.5)),
        (X, (0.75, 0.5)),
        (-X, (0.25, 0.5)),
        (X - Z, (0.625, 0.5)),
        (Y - Z, (0.5, 0.75)),
        (-Y - Z, (0.5, 0.25)),
        (Y, (0.5, 1)),
        (-Y, (0.5, 0)),
        (-X + 1e-9 * Z - 2 * X, (0.25, 0.5)),
        (Z - 1e-9 * X, (0, 0.5)),
    ],
)
def test_a_sphere_has_the_texture_coordinates_of_a_lat_long_map(direction, uv):
    _, surface = hits_on([Sphere((1.0, 2.0, 3.0), 2.0, GREY)], [1, 2, 3], normalised(direction)[None])
    np.testing.assert_allclose(surface.uv[0], uv, atol=1e-6)


def test_a_plane_shows_an_image_with_plus_x_right_and_minus_z_up():
    origins = [[0, 1, 0], [1, 1, 0], [0, 1, -2], [-0.5, 1, 1]]
    _, surface = hits_on([Plane(GREY, (2.0, 4.0))], origins, np.tile(-Y, (4, 1)))
    np.testing.assert_allclose(surface.uv, [(0.5, 0.5), (1, 0.5), (0.5, 1), (0.25, 0.25)])
    np.testing.assert_allclose(surface.dp_du, np.tile([2, 0, 0], (4, 1)))
    np.testing.assert_allclose(surface.dp_dv, np.tile([0, 0, -4], (4, 1)))


def textured(mesh, seed):
    """The mesh with texture coordinates at random."""
    uv = np.random.default_rng(seed).random((len(mesh.vertices), 2)).astype(np.float32)
    return Mesh(mesh.vertices, mesh.faces, GREY, uv=uv)


def sheet():
    """A patch that is a little bent."""
    x, y = np.meshgrid(np.linspace(-4, 5, 4), np.linspace(-3, 4, 4), indexing="ij")
    return np.stack([x, y, 2 + 0.1 * x * y / 4 - 0.02 * x**2], axis=-1)[None]


@pytest.mark.parametrize(
    "shape",
    [
        Sphere((0.2, 0.1, -0.3), 1.5, GREY),
        Plane(GREY, (6.0, 9.0), height=-2.0),
        textured(triangle((-4, -3, 2), (5, -2, 1), (0, 6, 3)), 26),
        Polygon(np.array([(-4, -3, 2), (5, -3, 1), (5, 4, 1), (0, 1, 14 / 9), (-4, 6, 2)], float), GREY),
        Patches(sheet(), GREY),
    ],
    ids=["sphere", "plane", "mesh", "polygon", "patches"],
)
def test_the_derivatives_lead_from_one_hit_to_the_next(shape):
    # p(u + Δu, v + Δv) − p(u, v) = dp/du Δu + dp/dv Δv, but for the curvature of a sphere.
    random = np.random.default_rng(28)
    origins, directions = rays(2000, seed=29, spread=0.5)
    aside = normalised(directions + random.normal(scale=2e-4, size=directions.shape))
    hits, here = hits_on([shape], origins, directions)
    beside, there = hits_on([shape], origins, aside)
    # Away from poles, where u is steep, from the seam, and from grazing, where hits are far apart.
    slope = np.abs(np.sum(here.geometric_normal * directions, axis=-1))
    both = (hits.shape >= 0) & (beside.shape >= 0) & (np.abs(here.geometric_normal[:, 1]) < 0.9) & (slope > 0.3)
    if isinstance(shape, Plane):
        both = (hits.shape >= 0) & (beside.shape >= 0) & (slope > 0.3)
    change = (there.uv.astype(np.float64) - here.uv)[both]
    assert both.sum() > 50
    expected = here.dp_du[both] * change[:, :1] + here.dp_dv[both] * change[:, 1:]
    seamless = np.abs(change[:, 0]) < 0.5
    # uv, single precision, is asked to 6e-8 of some metres.
    np.testing.assert_allclose(expected[seamless], (there.point - here.point)[both][seamless], atol=6e-6)
    assert np.linalg.norm(expected[seamless], axis=-1).max() > 1e-3


def test_texture_coordinates_of_a_mesh_are_weighed():
    mesh = triangle((0, 0, 0), (4, 0, 0), (0, 4, 0), uv=[[0, 0], [1, 0], [0, 2]])
    _, surface = hits_on([mesh], [2, 1, 1], [-Z])
    np.testing.assert_allclose(surface.uv[0], [0.5, 0.5])
    np.testing.assert_allclose(surface.dp_du[0], [4, 0, 0])
    np.testing.assert_allclose(surface.dp_dv[0], [0, 2, 0])


def test_a_mesh_without_texture_coordinates_has_neither_them_nor_derivatives():
    bare, flat = triangle((0, 0, 0), (4, 0, 0), (0, 4, 0)), textured(soup(1, 30), 31)
    folded = triangle((0, 0, 0), (4, 0, 0), (0, 4, 0), uv=[[0.5, 0.5]] * 3)
    for mesh, uv in ((bare, 0.0), (folded, 0.5)):
        _, surface = hits_on([flat, mesh], [1, 1, 9], [-Z])
        np.testing.assert_allclose(surface.uv[0], uv)
        assert np.all(surface.dp_du == 0) and np.all(surface.dp_dv == 0)


def test_each_of_several_meshes_has_its_own_vertices():
    turn = rotation_about(Y, 0.5)
    shapes = [soup(20, seed=32), Sphere((9.0, 9.0, 9.0), 0.1, GREY), textured(soup(30, seed=33), 34)]
    hits, surface = hits_on(shapes, rays(500, seed=35)[0], rays(500, seed=35)[1] @ turn.T)
    for number in (0, 2):
        mesh, mine = shapes[number], hits.shape == number
        assert isinstance(mesh, Mesh) and mine.sum() > 10
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces[hits.primitive[mine]]].astype(np.float64), 1, 0)
        np.testing.assert_allclose(surface.geometric_normal[mine], normalised(np.cross(b - a, c - a)), atol=1e-9)
    assert np.all(surface.uv[hits.shape == 0] == 0) and np.all(surface.uv[hits.shape == 2] > 0)


# --- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("origins", "directions", "message"),
    [
        (ORIGIN, Z, r"directions are \(3,\); expected \(N, 3\)"),
        (ORIGIN, np.ones((4, 2)), r"directions are \(4, 2\)"),
        (np.zeros((2, 3)), np.eye(3), r"origins are \(2, 3\); expected \(3,\) or \(3, 3\)"),
        (np.zeros((1, 3)), np.eye(3), r"origins are \(1, 3\)"),
        (ORIGIN, [X, 2 * Y], r"direction 1 is .*; expected unit length"),
        (ORIGIN, [X, ORIGIN], "direction 1 is"),
        (ORIGIN, [[np.nan, 1, 0]], "direction 0 is"),
        (ORIGIN, [[np.inf, 0, 0]], "direction 0 is"),
        ([0, np.nan, 0], np.eye(3), "some origins are not finite"),
        ([0, np.inf, 0], np.eye(3), "some origins are not finite"),
    ],
)
def test_rays_that_are_none_are_refused(origins, directions, message):
    caster = RayCaster.of([soup(3, seed=36)])
    with pytest.raises(ValueError, match=message):
        caster.nearest(origins, directions)
    with pytest.raises(ValueError, match=message):
        caster.occluded(origins, directions)


@pytest.mark.parametrize("distances", [-1.0, [1.0, -1.0, 1.0], np.nan, [1.0, np.nan, 1.0], [1.0, 1.0], np.ones((3, 1))])
def test_distances_that_are_none_are_refused(distances):
    with pytest.raises(ValueError, match="distances"):
        RayCaster.of([]).occluded(ORIGIN, np.eye(3), distances)


@pytest.mark.parametrize("beyond", [-1.0, np.nan, np.inf])
def test_ignoring_hits_up_to_no_distance_is_refused(beyond):
    with pytest.raises(ValueError, match="beyond is"):
        RayCaster.of([]).nearest(ORIGIN, np.eye(3), beyond=beyond)


def test_meshes_that_cannot_be_cast_at_are_refused_by_name():
    for value in (np.nan, np.inf, 1e20):
        with pytest.raises(ValueError, match="vertices of 'mesh' are not all finite"):
            RayCaster.of([triangle((0, 0, 0), (1, 0, 0), (0, value, 0))])
    for wrong in (-1, 3):
        with pytest.raises(ValueError, match="faces of 'mesh' name vertices"):
            RayCaster.of([mesh_of(np.eye(3), [[0, 1, wrong]])])
    with pytest.raises(ValueError, match="'sphere' reaches beyond"):
        RayCaster.of([Sphere((1e20, 0.0, 0.0), 1.0, GREY)])
    with pytest.raises(ValueError, match=r"uv of 'mesh' are \(2, 2\); expected \(3, 2\)"):
        Surfaces.of([triangle(X, Y, Z, uv=np.zeros((2, 2)))])
    with pytest.raises(ValueError, match="normals of 'mesh'"):
        Surfaces.of([triangle(X, Y, Z, normals=np.zeros((2, 3)))])


def test_hits_of_other_rays_or_shapes_are_refused():
    shapes = [Plane(GREY), Plane(GREY, height=1.0)]
    hits = RayCaster.of(shapes).nearest([0, 2, 0], [-Y])
    with pytest.raises(ValueError, match="there are 1 hits of 2 rays"):
        Surfaces.of(shapes).at([0, 2, 0], [-Y, -Y], hits)
    with pytest.raises(ValueError, match="a hit is on shape 1 of 1"):
        Surfaces.of(shapes[:1]).at([0, 2, 0], [-Y], hits)


def test_boxes_of_the_wrong_kind_are_refused():
    with pytest.raises(ValueError, match=r"boxes are float64 \(2, 6\); expected float32 \(P, 6\)"):
        build_tree(np.zeros((2, 6)))
