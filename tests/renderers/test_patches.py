"""Rays against bicubic patches: outlines, seams, poles and places, on Newell's teapot and against fine triangles."""

import math
from pathlib import Path

import numpy as np
import pytest

import naive
from relume.renderers.raytrace import patch_leaves
from relume.renderers.raytrace.patch_kernel import AXIS, BENT, BENT_AROUND, CENTRE, FRAME, LIMITS, RADIUS
from relume.renderers.raytrace.patch_leaves import split
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh, Patches, Plane, Polygon, Sphere, read_patches
from relume.sphere.directions import normalised, rotation_about
from solids import grid_faces, quad

GREY = Diffuse((0.5, 0.5, 0.5))
X, Y, Z = np.eye(3)
TEAPOT = Path(__file__).resolve().parents[2] / "examples" / "whitted" / "teapot.bpt"
UPRIGHT = rotation_about(X, -math.pi / 2)
SIZE = 6.5  # metres from handle to spout
RIM, BODY, HANDLE, SPOUT = range(4), range(4, 12), range(12, 16), range(16, 20)
LID, BOTTOM = range(20, 28), range(28, 32)
TURN, SHIFT = rotation_about(normalised(X - 2 * Y + Z), 0.9), np.array([0.3, -0.7, 0.9])
ARC = 4 / 3 * (math.sqrt(2) - 1)
"""Of a cubic's handles that follow a quarter of a circle to 0.03 % of its radius."""


def teapot(scale=1.0):
    return Patches(scale * read_patches(TEAPOT) @ UPRIGHT.T, GREY, name="teapot")


def weights(t):
    t = np.asarray(t, float)
    return np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=-1)


def slopes(t):
    t = np.asarray(t, float)
    return 3 * np.stack([-((1 - t) ** 2), (1 - t) * (1 - 3 * t), t * (2 - 3 * t), t**2], axis=-1)


def at(net, u, v, along_u=weights, along_v=weights):
    """Points, or derivatives, of patches (N, 4, 4, 3) each at its own (u, v)."""
    return np.einsum("ni,nj,nijk->nk", along_u(u), along_v(v), np.asarray(net, float))


def normals(net, u, v):
    return np.cross(at(net, u, v, slopes, weights), at(net, u, v, weights, slopes))


def fine(control, count=64, begin=(0.0, 0.0), length=1.0):
    """Patches as 2·count² triangles each; or only the part of them from `begin`, so long in u and v."""
    u, v = (start + length * np.arange(count + 1) / count for start in begin)
    points = np.einsum("ui,vj,pijk->puvk", weights(u), weights(v), control)
    faces = np.concatenate([grid_faces(count, count) + k * (count + 1) ** 2 for k in range(len(control))])
    return Mesh(points.reshape(-1, 3).astype(np.float32), faces.astype(np.int32), GREY)


def hits_of(patches, origins, directions, **given):
    return RayCaster.of([patches]).nearest(origins, directions, **given)


def some_rays(patches, count, seed):
    """Rays at places all over the patches, from all around."""
    random = np.random.default_rng(seed)
    which = random.integers(len(patches.control), size=count)
    targets = at(patches.control[which], *random.random((2, count))) + random.normal(scale=0.05, size=(count, 3))
    origins = patches.control.mean(axis=(0, 1, 2)) + 8 * normalised(random.normal(size=(count, 3)))
    return origins, normalised(targets - origins)


# --- the teapot's data -----------------------------------------------------------------------------------------------


def test_the_teapot_is_newell_s():
    control = read_patches(TEAPOT)
    assert control.shape == (32, 4, 4, 3)
    np.testing.assert_array_equal(control.reshape(-1, 3).min(axis=0), [-3, -2, 0])
    np.testing.assert_array_equal(control.reshape(-1, 3).max(axis=0), [3.525, 2, 3.15])
    # The rim's corner, a handle's, the spout's lip, the knob's top and the bottom's middle.
    for point in ([1.4, 0, 2.4], [-1.6, 0, 2.025], [3.525, 0, 2.49375], [0, 0, 3.15], [0, 0, 0]):
        assert np.any(np.all(control == point, axis=-1)), point


@pytest.mark.parametrize("name", ["teapot.bpt", "teapot_yzcs.bpt"])
def test_the_teapot_has_the_numbers_of_published_copies(shared, name):
    path = shared / "data" / "meshes" / "teapot_patches" / name
    if not path.is_file():
        pytest.skip(f"{path.name} is not among the sample files")
    # Ours has u and v exchanged, so that outside is outside.
    np.testing.assert_array_equal(read_patches(TEAPOT), read_patches(path).transpose(0, 2, 1, 3))


def test_every_patch_of_the_teapot_has_its_normals_outward():
    control = read_patches(TEAPOT)
    u, v = np.meshgrid(*[np.linspace(0.01, 0.99, 40)] * 2, indexing="ij")
    # Of a normal that nowhere turns round, one that is known is enough: at v, in the middle of u, it points …
    known = {RIM: (0.5, "up"), BODY: (0.5, "out"), HANDLE: (0.5, "ring"), SPOUT: (0.1, "ring"), BOTTOM: (0.5, "down")}
    known |= {LID[:4]: (0.3, "out"), LID[4:]: (0.5, "up")}
    checked = 0
    for numbers, (place, way) in known.items():
        for number in numbers:
            net = np.broadcast_to(control[number], (u.size, 4, 4, 3))
            outward = normalised(normals(net, u.ravel(), v.ravel())).reshape(40, 40, 3)
            for axis in (0, 1):
                following = np.take(outward, range(1, 40), axis), np.take(outward, range(39), axis)
                assert np.min(np.sum(following[0] * following[1], axis=-1)) > 0.5, number
            point, normal = at(net[:1], [0.5], [place])[0], normals(net[:1], [0.5], [place])[0]
            middle = at(control[[number, number ^ 1]], [0.5, 0.5], [place, place]).mean(axis=0)
            from_inside = {"up": Z, "down": -Z, "out": point * (1, 1, 0), "ring": point - middle}[way]
            cosine = normalised(normal) @ normalised(from_inside)
            assert cosine > 0.5, number
            checked += 1
    assert checked == 32


# --- outlines --------------------------------------------------------------------------------------------------------


def outline(caster, camera, lines, *, upright):
    """Where rays along lines of a picture begin or end to hit, by halving: line, whether it begins, place; pixels.

    upright : whether the lines are columns
    """
    eye = camera.position
    count = camera.height if upright else camera.width
    places = np.arange(count) + 0.5

    def is_hit(line, place):
        point = np.stack([line, place] if upright else [place, line], axis=-1)
        return caster.nearest(eye, camera.rays_through(point)).shape >= 0

    hit = is_hit(*(g.ravel() for g in np.meshgrid(lines, places, indexing="ij"))).reshape(len(lines), count)
    row, before = np.nonzero(hit[:, 1:] != hit[:, :-1])
    line, begins, low, high = np.asarray(lines)[row], hit[row, before + 1], places[before], places[before + 1]
    for _ in range(24):
        middle = (low + high) / 2
        later = is_hit(line, middle) == begins
        low, high = np.where(later, low, middle), np.where(later, middle, high)
    return line, begins, (low + high) / 2


def distances_of_outlines(patches, mesh, camera, every):
    """How far in pixels the outline of patches is from that of a mesh, along lines that cross it rather than follow it;
    and how many crossings have no counterpart within a pixel."""
    casters = RayCaster.of([patches]), RayCaster.of([mesh])
    found, lost = [], 0
    for upright in (False, True):
        lines = np.arange(every / 2, camera.width if upright else camera.height, every)
        one, other = (outline(caster, camera, lines, upright=upright) for caster in casters)
        aside = outline(casters[1], camera, lines + 0.25, upright=upright)
        for line, begins, place in zip(*other, strict=True):
            steep = nearest_place(aside, line + 0.25, begins, place)
            if steep < 0.375:  # three pixels to two lines
                gap = nearest_place(one, line, begins, place)
                lost += gap >= 1
                found.append(min(gap, 1))
    return np.array(found), lost


def nearest_place(crossings, line, begins, place):
    lines, beginnings, places = crossings
    return np.min(np.abs(places[(lines == line) & (beginnings == begins)] - place), initial=np.inf)


def seen_from(position, target, zoom):
    return Camera.looking_at(np.array(position, float), target, width=640, height=480, focal_length=700.0 * zoom)


@pytest.mark.parametrize(("zoom", "target"), [(1, (0.2, 1.4, 0)), (4, (2.9, 2.3, 0))])
def test_outlines_are_those_of_a_fine_mesh(zoom, target):
    camera, patches = seen_from((1, 4.5, 8), target, zoom), teapot()
    coarse, _ = distances_of_outlines(patches, fine(patches.control, 32), camera, every=8)
    distances, lost = distances_of_outlines(patches, fine(patches.control, 64), camera, every=8)
    print(f"zoom {zoom}: {len(distances)} crossings, {distances.max():.4f} pixels at most, {lost} without counterpart")
    assert len(distances) > 100
    assert lost == 0
    assert distances.max() < 0.1
    # What is left is the mesh's own: halves of its edges are out by a quarter.
    assert coarse.mean() / distances.mean() > 3.5


def test_an_outline_looked_at_a_thousand_times_nearer_is_as_smooth():
    # Along the spout, so that nothing but the body makes the outline where it is widest.
    patches, eye = teapot(), np.array([40.0, 0.9, 0.0])
    whole = Camera.looking_at(eye, np.array([0, 0.9, 0]), width=640, height=480, focal_length=4000.0)
    caster = RayCaster.of([patches])
    _, begins, place = outline(caster, whole, [240.5], upright=False)
    edge = camera_towards(whole, place[~begins][-1], 240.5)
    lines, begins, places = outline(caster, edge, np.arange(5.5, 480, 10), upright=False)
    assert len(places) == 48 and not np.any(begins)
    # Five millimetres of a profile that is round on a metre: a parabola to much less than a pixel of 0.01 mm.
    off = places - np.polynomial.Polynomial.fit(lines, places, 2)(lines)
    print(f"{np.abs(off).max():.5f} pixels off the parabola, which is {np.ptp(places):.2f} pixels high")
    assert np.abs(off).max() < 0.01 < np.ptp(places)
    # And it is where a mesh of the very place has it.
    inside = edge.rays_through(np.array([[places[24] - 1, lines[24]]]))
    hit = caster.nearest(eye, inside)
    u, v = hit.barycentric[0]
    part = fine(patches.control[hit.primitive], begin=(u - 1 / 64, v - 1 / 64), length=1 / 32)
    _, begins, same = outline(RayCaster.of([part]), edge, lines, upright=False)
    np.testing.assert_allclose(same[~begins], places, atol=0.1)


def camera_towards(camera, x, y):
    """A camera in the same place that looks at that pixel through a lens a thousand times as long."""
    target = camera.position + camera.rays_through(np.array([x, y]))
    return Camera.looking_at(camera.position, target, width=640, height=480, focal_length=1000 * camera.focal_length)


def test_an_outline_is_out_by_no_more_than_half_the_footprint():
    patches, eye, footprint = teapot(), np.array([1.0, 4.5, 8.0]), 5e-4
    caster, camera = RayCaster.of([patches]), seen_from((1, 4.5, 8), (0.2, 1.4, 0), 1)
    directions = camera.rays().reshape(-1, 3)
    exact, rough = (caster.nearest(eye, directions, footprint=each) for each in (0, footprint))
    differ = ~np.isclose(exact.distance, rough.distance, rtol=1e-6)
    assert 10 < differ.sum() < 100
    # So near to an outline is each ray that differs that another within half a footprint meets something else.
    changes = np.zeros(differ.sum(), bool)
    for radius in (0.1, 0.25, 0.5):
        for angle in np.arange(32) * math.pi / 16:
            aside = footprint * radius * (math.cos(angle) * X + math.sin(angle) * Y)
            hits = caster.nearest(eye, normalised(directions[differ] + aside), footprint=0)
            changes |= ~np.isclose(hits.distance, exact.distance[differ], rtol=2e-3)
    assert np.all(changes)
    finer = caster.nearest(eye, directions, footprint=2e-5)
    assert np.sum(finer.shape != exact.shape) <= 2


# --- seams and poles -------------------------------------------------------------------------------------------------


def leaks(caster, origins, targets):
    """How many rays towards targets meet nothing up to there."""
    towards = targets - origins
    length = np.linalg.norm(towards, axis=-1)
    hits = caster.nearest(origins, towards / length[:, None])
    return int(np.sum(~(hits.distance <= length + 1e-4)))


def in_body(count, seed):
    """Places inside the teapot's body, and away from its lid."""
    random = np.random.default_rng(seed)
    angle, radius = random.uniform(0, 2 * math.pi, count), np.sqrt(random.uniform(0, 1, count))
    return np.stack([radius * np.cos(angle), random.uniform(0.3, 1.5, count), radius * np.sin(angle)], axis=-1)


CLOSED = (*BODY, *BOTTOM)


def test_no_ray_from_inside_the_body_leaves_it():
    patches, random = teapot(), np.random.default_rng(1)
    which = random.choice(CLOSED, 200_000)
    targets = at(patches.control[which], *random.random((2, 200_000)))
    assert leaks(RayCaster.of([patches]), in_body(200_000, 2), targets) == 0


def test_no_ray_at_the_body_from_outside_enters_it():
    patches, random = teapot(), np.random.default_rng(3)
    targets = in_body(200_000, 4)
    away = normalised(random.normal(size=(200_000, 3)))
    away[:, 1] = -np.abs(away[:, 1])  # from below, where there is no gap round a lid
    assert leaks(RayCaster.of([patches]), targets + 20 * away, targets) == 0


def test_no_ray_slips_through_a_seam():
    # The borders of patches, of leaves, and of the pieces of leaves, all of which are at u or v of some sixty-fourths.
    patches, random = teapot(), np.random.default_rng(5)
    seams, along = np.arange(65) / 64, random.random((len(CLOSED), 65, 24))
    which = np.repeat(CLOSED, 65 * 24)
    fixed = np.broadcast_to(seams[:, None], along.shape).ravel()
    caster, inside = RayCaster.of([patches]), in_body(len(which), 6)
    for u, v in ((fixed, along.ravel()), (along.ravel(), fixed)):
        targets = at(patches.control[which], u, v)
        assert leaks(caster, inside, targets) == 0
        assert leaks(caster, targets - 30 * normalised(inside - targets), targets) == 0
    corners = at(patches.control[which], fixed, random.integers(0, 65, len(which)) / 64)
    assert leaks(caster, inside, corners) == 0
    # From far away a millimetre is rounded to fewer digits.
    assert leaks(caster, corners - 1e7 * normalised(inside - corners), corners) == 0


def test_every_ray_at_a_pole_meets_it():
    # Away from the origin, where nothing is exactly 0.
    moved = Patches(teapot().control @ TURN.T + SHIFT, GREY)
    caster, surfaces, random = RayCaster.of([moved]), Surfaces.of([moved]), np.random.default_rng(7)
    for pole, up in ((3.15 * Y, Y), (0 * Y, -Y)):
        origins = pole + random.normal(size=(20_000, 3)) * (1, 0.5, 1) + 4 * up
        origins = np.concatenate([origins, pole + np.outer(np.arange(1, 9), up)]) @ TURN.T + SHIFT
        towards = pole @ TURN.T + SHIFT - origins
        length = np.linalg.norm(towards, axis=-1)
        hits = caster.nearest(origins, towards / length[:, None])
        np.testing.assert_allclose(hits.distance, length, rtol=1e-9)
        surface = surfaces.at(origins, towards / length[:, None], hits)
        np.testing.assert_allclose(surface.geometric_normal, np.tile(TURN @ up, (len(length), 1)), atol=1e-3)


# --- where they are met ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_hits_lie_on_the_patch_at_their_u_and_v(scale):
    patches = teapot(scale)
    origins, directions = some_rays(teapot(), 50_000, 8)
    origins = origins * scale
    hits = hits_of(patches, origins, directions)
    met = hits.shape == 0
    assert met.mean() > 0.5
    u, v = hits.barycentric[met].T
    assert min(u.min(), v.min()) >= 0 and max(u.max(), v.max()) <= 1
    points = (origins + hits.distance[:, None] * directions)[met]
    off = np.linalg.norm(at(patches.control[hits.primitive[met]], u, v) - points, axis=-1)
    assert off.max() <= 1e-9 * SIZE * scale
    surface = Surfaces.of([patches]).at(origins, directions, hits)
    np.testing.assert_allclose(surface.point[met], points, atol=1e-12 * scale)
    np.testing.assert_allclose(surface.uv[met], hits.barycentric[met], atol=1e-7)


def test_patches_are_met_where_fine_triangles_are():
    patches = teapot()
    origins, directions = some_rays(patches, 20_000, 9)
    hits, mesh = hits_of(patches, origins, directions), hits_of(fine(patches.control), origins, directions)
    both = (hits.shape >= 0) & (mesh.shape >= 0)
    assert both.mean() > 0.7
    assert np.sum((hits.shape >= 0) != (mesh.shape >= 0)) < 40  # that graze an outline
    slope = np.abs(np.sum(Surfaces.of([patches]).at(origins, directions, hits).geometric_normal * directions, axis=-1))
    off = np.abs(hits.distance[both] - mesh.distance[both])
    near = off < 0.05
    assert np.mean(near) > 0.998
    assert np.max((off * slope[both])[near]) < 1e-3
    same = hits.primitive[both] == mesh.primitive[both] // (2 * 64**2)
    assert np.mean(same[near]) > 0.999


def test_the_normal_and_derivatives_are_the_patch_s_own():
    patches = teapot()
    origins, directions = some_rays(patches, 20_000, 10)
    hits = hits_of(patches, origins, directions)
    surface = Surfaces.of([patches]).at(origins, directions, hits)
    met = hits.shape == 0
    nets, (u, v) = patches.control[hits.primitive[met]], hits.barycentric[met].T
    np.testing.assert_allclose(surface.dp_du[met], at(nets, u, v, slopes, weights), atol=1e-12)
    np.testing.assert_allclose(surface.dp_dv[met], at(nets, u, v, weights, slopes), atol=1e-12)
    cosines = np.sum(surface.geometric_normal[met] * normalised(normals(nets, u, v)), axis=-1)
    assert cosines.min() > 1 - 1e-12
    np.testing.assert_array_equal(surface.shading_normal, surface.geometric_normal)
    assert np.all(surface.geometric_normal[~met] == 0)


def test_each_of_several_shapes_has_its_own_patches():
    first, second = teapot(), Patches(teapot().control[4:8] + 7 * X, GREY)
    shapes = [Sphere((0.0, -5.0, 0.0), 1.0, GREY), first, Plane(GREY, (30.0, 30.0), height=-9.0), second]
    origins, directions = some_rays(second, 2000, 11)
    hits = RayCaster.of(shapes).nearest(origins, directions)
    surface = Surfaces.of(shapes).at(origins, directions, hits)
    for number, patches in ((1, first), (3, second)):
        mine = hits.shape == number
        assert mine.sum() > 30
        on = at(patches.control[hits.primitive[mine]], *hits.barycentric[mine].T)
        np.testing.assert_allclose(on, surface.point[mine], atol=1e-9)


def test_a_ray_that_leaves_a_patch_meets_what_is_behind_it():
    patches = teapot()
    origins, directions = some_rays(patches, 5000, 12)
    caster = RayCaster.of([patches])
    hits = caster.nearest(origins, directions)
    met = hits.shape == 0
    points = (origins + hits.distance[:, None] * directions)[met]
    beyond = caster.nearest(points, directions[met], beyond=1e-6)
    mesh = RayCaster.of([fine(patches.control)]).nearest(points, directions[met], beyond=0.02)
    far = (mesh.distance > 0.05) & (beyond.distance > 0.05)
    assert far.sum() > 2000 and np.sum(np.isfinite(mesh.distance[far])) > 1500
    agrees = np.isclose(beyond.distance, mesh.distance, atol=2e-3) | (beyond.shape < 0) & (mesh.shape < 0)
    assert np.mean(agrees[far]) > 0.99


# --- occlusion, threads ----------------------------------------------------------------------------------------------


def test_patches_occlude_where_they_are_met_before_the_end():
    patches = teapot()
    caster, (origins, directions) = RayCaster.of([patches]), some_rays(patches, 20_000, 13)
    distance = caster.nearest(origins, directions).distance
    assert 1000 < np.sum(distance < np.inf) < 19_900
    np.testing.assert_array_equal(caster.occluded(origins, directions), distance < np.inf)
    for ends in (8.0, distance, distance * (1 + 1e-9)):
        np.testing.assert_array_equal(caster.occluded(origins, directions, ends), distance < ends)


def test_hits_on_patches_do_not_depend_on_the_number_of_threads():
    patches = teapot()
    caster, (origins, directions) = RayCaster.of([patches]), some_rays(patches, 140_000, 14)
    one = caster.nearest(origins, directions, threads=1)
    for threads in (2, 3, None):
        other = caster.nearest(origins, directions, threads=threads)
        for name in ("distance", "shape", "primitive", "barycentric"):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))


@pytest.mark.parametrize("footprint", [-1e-6, np.nan, np.inf])
def test_a_footprint_that_is_no_angle_is_refused(footprint):
    with pytest.raises(ValueError, match="footprint is"):
        RayCaster.of([]).nearest(Z, [-Z], footprint=footprint)


# --- flat, folded, degenerate ----------------------------------------------------------------------------------------


def raised(steps, height):
    """Control points over a square grid of these steps, at this height."""
    x, y = np.meshgrid(steps, steps, indexing="ij")
    return np.stack([x, y, np.broadcast_to(height, x.shape)], axis=-1)


def flat_patch(corners):
    """The patch of straight lines between four corners: at (0, 0), (1, 0), (1, 1) and (0, 1)."""
    a, b, c, d = np.asarray(corners, float)
    u, v = (g[..., None] for g in np.meshgrid(*[np.arange(4) / 3] * 2, indexing="ij"))
    return ((1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d)[None]


SQUARE = np.array([(-1, -1, 0), (2, -0.5, 0), (1.5, 1, 0), (-0.5, 2, 0)], float)


def test_a_flat_patch_is_met_where_its_polygon_and_its_triangles_are():
    corners = (SQUARE @ rotation_about(normalised(X + Y - 2 * Z), 0.8).T).astype(np.float32).astype(float)
    shapes = [
        Patches(flat_patch(corners), GREY),
        Polygon(corners, GREY),
        quad(corners, GREY),
    ]
    random = np.random.default_rng(15)
    origins = random.normal(scale=3, size=(20_000, 3))
    directions = normalised(random.normal(size=(20_000, 3)) - origins)
    one, two, three = (RayCaster.of([shape]).nearest(origins, directions) for shape in shapes)
    assert 4000 < np.sum(two.shape == 0) < 16_000
    np.testing.assert_array_equal(one.shape, two.shape)
    np.testing.assert_array_equal(one.shape, three.shape)
    # Four corners in single precision are not quite in one plane.
    np.testing.assert_allclose(one.distance, two.distance, rtol=1e-4)
    np.testing.assert_allclose(one.distance, three.distance, rtol=1e-4)
    surfaces = [Surfaces.of([s]).at(origins, directions, h) for s, h in zip(shapes[:2], (one, two), strict=True)]
    np.testing.assert_allclose(surfaces[0].geometric_normal, surfaces[1].geometric_normal, atol=1e-6)


def test_a_ray_in_the_plane_of_a_flat_patch_does_not_meet_it():
    caster = RayCaster.of([Patches(flat_patch(SQUARE), GREY)])
    angle = np.linspace(0, 2 * math.pi, 500)
    directions = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    for footprint in (1e-6, 0):
        assert np.all(caster.nearest(-3 * directions, directions, footprint=footprint).shape == -1)


def test_a_ray_that_touches_a_cylinder_along_a_line_is_answered():
    # Every piece of that line is touched; a search that went on to the smallest of them would not end.
    profile = np.array([(0, 1), (ARC, 1), (1, ARC), (1, 0)])
    length = np.arange(4.0)[:, None, None]
    net = np.concatenate([np.tile(profile, (4, 1, 1)), np.tile(length, (1, 4, 1))], axis=-1)
    caster = RayCaster.of([Patches(net[None], GREY)])
    origins = np.array([[0, 1, -5], [1, 0, -5], [0.5, 2, -5], [0.5, 2, 1]])
    directions = np.array([Z, Z, Z, -Y])
    for footprint in (1e-6, 0):
        hits = caster.nearest(origins, directions, footprint=footprint)
        np.testing.assert_array_equal(hits.shape[2:], [-1, 0])


def pole_patch():
    """A quarter of a dome: the edge v = 1 is one point, +Y, and v = 0 a quarter of a circle in y = 0; outward."""
    ring, height = np.array([1, 1, ARC, 0]), np.array([0, ARC, 1, 1])
    around = np.array([(0, 1), (ARC, 1), (1, ARC), (1, 0)])
    x, z = (around[:, None, axis] * ring for axis in (0, 1))
    return np.stack([x, np.broadcast_to(height, x.shape), z], axis=-1)[None]


def test_a_pole_has_the_normal_of_what_is_around_it():
    patches = Patches(pole_patch() @ TURN.T + SHIFT, GREY)
    spread = np.concatenate([[0], 10.0 ** np.arange(-18, -2, 0.25)])
    targets = np.stack([0.6 * spread, np.ones_like(spread), 0.8 * spread], axis=-1)
    origins, directions = (targets + 2 * Y) @ TURN.T + SHIFT, np.tile(-TURN @ Y, (len(spread), 1))
    hits = hits_of(patches, origins, directions)
    np.testing.assert_allclose(hits.distance, 2, atol=1e-4)
    assert hits.barycentric[0, 1] == pytest.approx(1, abs=1e-6)
    surface = Surfaces.of([patches]).at(origins, directions, hits)
    np.testing.assert_allclose(np.linalg.norm(surface.geometric_normal, axis=-1), 1, atol=1e-12)
    # A dome's normal is its place, to what four arcs of a cubic are out; nearer to the pole rounding is as much.
    np.testing.assert_allclose(surface.geometric_normal @ TURN, targets, atol=2e-3)


def strange_patches():
    """Patches whose points coincide, or lie anywhere: (N, 4, 4, 3)."""
    random = np.random.default_rng(16)
    steps = raised(np.arange(4.0), 0)
    nets = random.normal(size=(6, 4, 4, 3)) * 0.3 + steps
    nets[0, 0] = nets[0, 0, 0]  # an edge is a point
    nets[1, :, 3] = nets[1, 0, 3]
    nets[2, :, 0], nets[2, :, 3] = nets[2, 0, 0], nets[2, 0, 3]  # two are
    nets[3, 0], nets[3, :, 0] = nets[3, 0, 0], nets[3, 0, 0]  # neighbours are
    nets[4, 3], nets[4, 2] = nets[4, 0], nets[4, 1]  # it closes on itself
    nets[5, 1, 1] += 4 * X  # it folds over
    wild = [random.normal(size=(4, 4, 3)) * spread + steps for spread in (0.5, 0.7, 0.7, 1.1, 1.1, 1.1)]
    return np.concatenate([nets, wild])


@pytest.mark.parametrize("finest", [patch_leaves.FINEST, 1])
@pytest.mark.parametrize("number", range(12))
def test_strange_patches_are_met_where_fine_triangles_are(number, finest, monkeypatch):
    # Leaves that are not nearly flat are there for the worst of patches; here, for all.
    monkeypatch.setattr(patch_leaves, "FINEST", finest)
    net = strange_patches()[number]
    patches, mesh = Patches(net[None], GREY), RayCaster.of([fine(net[None], 128)])
    origins, directions = some_rays(patches, 4000, 17 + number)
    hits, slow = hits_of(patches, origins, directions), mesh.nearest(origins, directions)
    # Where the triangles say the same of all rays near by, they say the truth.
    sure = np.ones(len(origins), bool)
    for nudge in 0.002 * np.concatenate([np.eye(3), -np.eye(3)]):
        aside = mesh.nearest(origins, normalised(directions + nudge))
        sure &= np.isclose(aside.distance, slow.distance, atol=0.05)
    assert np.sum(sure) > 2000 and np.sum(sure & (slow.shape == 0)) > 700
    np.testing.assert_allclose(hits.distance[sure], slow.distance[sure], atol=0.01)
    met = hits.shape >= 0
    on = at(np.broadcast_to(net, (int(np.sum(met)), 4, 4, 3)), *hits.barycentric[met].T)
    off = on - (origins + hits.distance[:, None] * directions)[met]
    assert np.abs(off).max() < 1e-8


def test_patches_without_area_are_never_met_and_keep_the_others_numbers():
    line = np.broadcast_to(np.linspace(-1, 1, 4)[:, None, None] * X, (4, 4, 3))
    patches = Patches(np.concatenate([line[None], flat_patch(SQUARE) - Z, line[None].transpose(0, 2, 1, 3)]), GREY)
    hits = hits_of(patches, [[0, 0, 3], [0.5, 0, 3], [9, 0, 3]], np.tile(-Z, (3, 1)))
    np.testing.assert_allclose(hits.distance, [4, 4, np.inf])
    np.testing.assert_array_equal(hits.primitive, [1, 1, 0])
    assert np.all(hits_of(Patches(line[None], GREY), [[0, 0, 3]], [-Z]).shape == -1)


# --- leaves ----------------------------------------------------------------------------------------------------------


def test_leaves_tile_their_patches_and_are_enclosed_by_their_measures():
    patches = teapot()
    leaves, random = split(patches), np.random.default_rng(18)
    areas = np.bincount(leaves.patch, leaves.span[:, 2] * leaves.span[:, 3], minlength=32)
    np.testing.assert_allclose(areas, 1, rtol=1e-12)
    measures, count = leaves.measures, len(leaves.patch)
    whole = patches.control[leaves.patch]
    low, high = np.zeros((count, 3)), np.zeros((count, 3))
    for _ in range(40):
        u, v = random.random((2, count))
        points = at(leaves.net, u, v)
        begin, length = leaves.span[:, :2], leaves.span[:, 2:]
        u_of_patch, v_of_patch = (begin + length * np.stack([u, v], axis=-1)).T
        np.testing.assert_allclose(points, at(whole, u_of_patch, v_of_patch), atol=1e-14)
        from_centre = points - measures[:, CENTRE : CENTRE + 3]
        assert np.all(np.linalg.norm(from_centre, axis=-1) <= measures[:, RADIUS])
        boxes = leaves.boxes
        assert np.all(points >= boxes[:, :3] - 1e-15) and np.all(points <= boxes[:, 3:] + 1e-15)
        local = np.einsum("lij,lj->li", measures[:, FRAME : FRAME + 9].reshape(-1, 3, 3), from_centre)
        limits = measures[:, LIMITS : LIMITS + 6].reshape(-1, 3, 2)
        assert np.all(local >= limits[..., 0]) and np.all(local <= limits[..., 1])
        low, high = np.minimum(low, local), np.maximum(high, local)
        for around, bent in ((0.0, BENT), (1 / 8, BENT_AROUND)):
            nearby = (1 + 2 * around) * np.stack([u, v]) - around
            cosine = np.sum(normalised(normals(leaves.net, *nearby)) * measures[:, AXIS : AXIS + 3], axis=-1)
            known = measures[:, bent] <= 1
            assert known.mean() > 0.9
            assert np.all(np.sqrt(1 - np.minimum(cosine[known], 1) ** 2) <= measures[known, bent] + 1e-7)
            assert np.all(cosine[known] > 0)
    # And not by far: the sides of their own boxes are about one, and they are flat.
    assert np.median(high[:, 0] - low[:, 0]) > 0.85 and np.median(high[:, 1] - low[:, 1]) > 0.85
    assert np.median(high[:, 2] - low[:, 2]) < 0.1


# --- with other shapes -----------------------------------------------------------------------------------------------


def test_scenes_of_all_shapes_are_met_as_the_slow_twin_meets_them():
    random = np.random.default_rng(19)
    bowl = raised(np.linspace(-1, 1, 4), random.normal(scale=0.6, size=(4, 4)))
    star = np.stack(
        [(1 + 0.6 * (-1.0) ** np.arange(10)) * f(np.arange(10) * math.pi / 5) for f in (np.cos, np.sin)]
        + [np.zeros(10)],
        -1,
    )
    triangles = random.normal(scale=0.8, size=(12, 1, 3)) + random.normal(scale=0.3, size=(12, 3, 3))
    shapes = [
        Polygon(star @ rotation_about(X, 0.7).T - 0.5 * Z, GREY),
        Patches(np.stack([bowl, bowl[::-1] + np.array([0.3, 0.2, 1])]), GREY),
        Mesh(triangles.reshape(-1, 3).astype(np.float32), np.arange(36, dtype=np.int32).reshape(-1, 3), GREY),
        Plane(GREY, (4.0, 3.0), height=-1.5),
        Sphere((0.5, 0.5, 0.8), 0.5, GREY),
    ]
    origins = random.normal(scale=3, size=(1200, 3))
    directions = normalised(random.normal(scale=0.7, size=(1200, 3)) - origins)
    caster = RayCaster.of(shapes)
    hits = caster.nearest(origins, directions)
    # Triangles between points of a patch are within 2 mm of it: an answer counts that is right for a ray so near.
    nudges = [0, *(0.001 * normalised(n) for n in random.normal(size=(12, 3)))]
    nearby = [caster.nearest(origins, normalised(directions + nudge)) for nudge in nudges]
    wrong = 0
    for i, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        distance, shape, primitive = naive.nearest_hit(shapes, origin, direction)
        if shape in (-1, 1) or hits.shape[i] == 1:
            said = [(h.distance[i], h.shape[i], h.primitive[i]) for h in nearby]
            wrong += not any(s == shape and p == primitive and (s < 0 or abs(d - distance) < 0.02) for d, s, p in said)
        else:
            assert (hits.shape[i], hits.primitive[i]) == (shape, primitive)
            assert hits.distance[i] == pytest.approx(distance, rel=1e-9)
    assert wrong == 0
    np.testing.assert_array_equal(np.unique(hits.shape), np.arange(-1, 5))
    assert np.sum(hits.shape == 1) > 200
