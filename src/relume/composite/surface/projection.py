"""Laying the photograph on the real surfaces that it shows: texture coordinates by projection (Debevec 1998, §4).

Texture coordinates are linear over a triangle and a camera's picture of it is not, so triangles are split until the
difference is a tenth of a pixel; and split again along the frame of the picture and where one surface hides another,
so that what the photograph shows and what it does not are surfaces of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.errors import warn
from relume.image.resizing import resized_rows
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import AnyMaterial, Mesh, Patches, Plane, Polygon, Shape, Sphere
from relume.scene.shapes.tessellation import tessellated, triangulated

STRAIGHT = 0.1
"""Pixels by which the texture may be off in the middle of an edge."""
SEAM = 1.0
"""Pixels within which the frame, and the outline of what hides a surface, is followed."""
LONGEST = 16.0
"""Pixels of the longest edge where other surfaces may hide this one: what is smaller may be overlooked."""
MOST = 400_000
"""Triangles of one surface; a 768×512 picture of a floor with a table on it needs about 30 000."""
COARSE = 512
"""Pixels across of a photograph that lights other surfaces."""
NEAR = 1e-3
"""Metres before the camera at which a surface ends for it."""


@dataclass(frozen=True, eq=False)
class Projected:
    """A surface as the photograph shows it.

    seen : what the photograph shows, its texture coordinates those of the photograph, (0, 0) its lower left corner;
        None where it shows nothing
    unseen : what lies outside of the frame, behind the camera, or behind another surface; None where there is nothing
    """

    seen: Mesh | None
    unseen: Mesh | None


def projected(shape: Shape, camera: Camera, others: Sequence[Shape] = ()) -> Projected:
    """Split a real surface into what the photograph shows, with the photograph's texture coordinates, and the rest.

    others : the other real surfaces, which may hide this one
    Where `MOST` triangles do not do, the texture is off by more than a tenth of a pixel and a warning says so.
    A sphere becomes a mesh. Both sides of a plane or a polygon count; of a closed mesh the camera sees the front.
    """
    mesh = triangles_of_shape(shape)
    corners = np.asarray(mesh.vertices, np.float64)[mesh.faces]
    normals = None if mesh.normals is None else np.asarray(mesh.normals, np.float64)[mesh.faces]
    # Attributes travel with the corners, so that splitting treats them alike.
    soup = _with_area(corners if normals is None else np.concatenate([corners, normals], axis=-1))
    outside = []
    for plane in _frustum(camera):
        soup, away = _cut(soup, plane)
        outside.append(away)
    # What lies in one plane does not hide itself, and a grazing ray would not be sure of that.
    hiding = [*others] if _flat(corners) else [mesh, *others]
    hidden_by = _Sight(camera, hiding) if hiding else None
    soup = _split(soup, camera, hidden_by, mesh.name)
    middle = soup[..., :3].mean(1)
    shown = _in_frame(camera, camera.project(middle))
    if hidden_by is not None:
        shown &= hidden_by.visible(middle)
    seen = _mesh(soup[shown], mesh, camera)
    unseen = _mesh(np.concatenate([soup[~shown], *outside]), mesh, None)
    return Projected(seen, unseen)


def shining(
    local: Sequence[Shape], index: int, camera: Camera, radiance: np.ndarray, parts: np.ndarray
) -> list[Shape]:  # fmt: skip
    """The real surfaces, all but one of them lamps that shine as the photograph shows them.

    index : of the one that stays as it is and comes first, which the others light: a table before a backdrop
    radiance : (H, W, 3) of the photograph
    parts : (H, W) int, the surface that each pixel shows
    What the photograph does not show of a surface shines as the median of what it does, and not at all where it shows
    nothing of it. They send alike in all directions and only from their front.
    """
    if len(local) == 1:
        return [local[index]]  # nothing lights it: no small photograph is needed
    step = max(1, max(radiance.shape) // COARSE)
    height, width = (max(1, side // step) for side in radiance.shape[:2])
    # Means over areas: a lamp of a few pixels sends what it sends, wherever it lies.
    size = radiance.shape[1], radiance.shape[0]
    picture = resized_rows(lambda rows: np.maximum(radiance[rows], 0, dtype=np.float32), size, width, height)
    result = [local[index]]
    for number, shape in enumerate(local):
        if number == index:
            continue
        piece = projected(shape, camera, [other for other in local if other is not shape])
        there = parts == number
        middle = [max(float(np.median(radiance[..., c][there])), 0.0) for c in range(3)] if there.any() else (0.0,) * 3
        for mesh, light in ((piece.seen, picture), (piece.unseen, triple(middle))):
            if mesh is not None:
                result.append(replace(mesh, material=Material((0.0, 0.0, 0.0), emission=light)))
    return result


def box_mesh(low: Sequence[float], high: Sequence[float], material: AnyMaterial, name: str = "box") -> Mesh:
    """A box that stands straight in the world, as twelve triangles that face outwards.

    low, high : two opposite corners, metres, world
    Raises ValueError unless each of low is below that of high.
    """
    if not np.all(np.subtract(high, low) > 0):
        raise ValueError(f"a box from {tuple(low)} to {tuple(high)}; expected each of low below that of high, metres")
    corners = np.array([[(low, high)[(i >> axis) & 1][axis] for axis in range(3)] for i in range(8)], np.float32)
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))], np.int32)
    return Mesh(corners, faces, material, name=name)


def triangles_of_shape(shape: Shape) -> Mesh:
    """Any shape as triangles; a sphere to a ten-thousandth of its radius."""
    if isinstance(shape, Mesh):
        return shape
    if isinstance(shape, Plane):
        x, z = np.array(shape.extent) / 2
        y = shape.height
        corners = np.array([[-x, y, -z], [-x, y, z], [x, y, z], [x, y, -z]])
        return Mesh(
            corners.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32), shape.material, name="plane"
        )
    if isinstance(shape, Polygon):
        return triangulated(shape)
    if isinstance(shape, Patches):
        return tessellated(shape)
    return _globe(shape)


def _globe(sphere: Sphere) -> Mesh:
    rows = 128
    polar = np.linspace(0, np.pi, rows + 1)[:, None]
    turn = np.linspace(0, 2 * np.pi, 2 * rows + 1)[None, :]
    normals = np.stack(
        np.broadcast_arrays(np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)), -1
    )
    corner = (np.arange(rows)[:, None] * (2 * rows + 1) + np.arange(2 * rows)).ravel()
    below = corner + 2 * rows + 1
    first, second = np.stack([corner, below, corner + 1], 1), np.stack([corner + 1, below, below + 1], 1)
    faces = np.concatenate([first[2 * rows :], second[: -2 * rows]]).astype(np.int32)
    flat = normals.reshape(-1, 3)
    vertices = (np.array(sphere.centre) + sphere.radius * flat).astype(np.float32)
    return Mesh(vertices, faces, sphere.material, flat.astype(np.float32), name=sphere.name)


def _flat(corners: np.ndarray) -> bool:
    """Whether the triangles lie in one plane, so that none of them hides another."""
    first = corners[0] - corners[0, 0]
    normal = np.cross(first[1], first[2])
    length = np.linalg.norm(normal)
    reach = np.abs(corners - corners[0, 0]).max()
    return bool(length > 0 and np.abs((corners - corners[0, 0]) @ (normal / length)).max() < 1e-6 * reach)


def _frustum(camera: Camera) -> list[tuple[np.ndarray, float]]:
    """(normal, offset) of five planes round all that the picture shows; inside is normal · x > offset."""
    x, y = np.linspace(0, camera.width, 65), np.linspace(0, camera.height, 65)
    sides = [(x, 0.0), (x, float(camera.height)), (0.0, y), (float(camera.width), y)]
    rim = np.concatenate([np.stack(np.broadcast_arrays(*side), -1) for side in sides])
    rays = camera.rays_through(rim) @ camera.rotation
    across, up = rays[:, 0] / -rays[:, 2], rays[:, 1] / -rays[:, 2]
    local = [
        ((0.0, 0.0, -1.0), NEAR),
        ((1.0, 0.0, across.min()), 0.0),
        ((-1.0, 0.0, -across.max()), 0.0),
        ((0.0, 1.0, up.min()), 0.0),
        ((0.0, -1.0, -up.max()), 0.0),
    ]
    # With a rolling shutter as far out as the row does that starts furthest out.
    planes, eyes = [], np.unique(camera.eyes(rim), axis=0)
    for normal, offset in local:
        world = camera.rotation @ np.array(normal)
        planes.append((world, float(min(world @ eye for eye in eyes) + offset)))
    return planes


def _cut(soup: np.ndarray, plane: tuple[np.ndarray, float]) -> tuple[np.ndarray, np.ndarray]:
    """The parts of triangles (N, 3, C) on the inner and on the outer side of a plane."""
    height = soup[..., :3] @ plane[0] - plane[1]
    # A corner as good as on the plane is on it, or slivers without area would appear.
    height[np.abs(height) < 1e-9 * (1 + np.abs(soup[..., :3]).max(-1))] = 0
    inner, outer = np.all(height >= 0, axis=1), np.all(height <= 0, axis=1)
    crossed = np.logical_not(np.logical_or(inner, outer))
    if not crossed.any():
        return soup[~outer], soup[outer]
    triangles, height = soup[crossed], height[crossed]
    # Turn each so that the corner alone on its side comes first; one on the plane keeps the second company.
    side = np.sign(height)
    lone = np.argmax(side * np.where(side.sum(1) > 0, -1, 1)[:, None] > 0, axis=1)
    balanced = side.sum(1) == 0
    lone = np.where(balanced, np.argmax(side > 0, axis=1), lone)
    a, b, c = _turned(triangles, lone)
    ha, hb, hc = _turned(height[..., None], lone)
    ab = a + ha / (ha - hb) * (b - a)
    ac = a + ha / (ha - hc) * (c - a)
    tip = np.stack([a, ab, ac], axis=1)
    trunk = np.concatenate([np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)])
    above = ha[:, 0] > 0
    twice = np.concatenate([above, above])
    inside, outside = np.concatenate([tip[above], trunk[~twice]]), np.concatenate([tip[~above], trunk[twice]])
    return (
        np.concatenate([soup[inner & ~outer], _with_area(inside)]),
        np.concatenate([soup[outer], _with_area(outside)]),
    )


def _with_area(soup: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(soup[..., :3], 1, 0)
    return soup[np.linalg.norm(np.cross(b - a, c - a), axis=-1) > 0]


class _Sight:
    """What of the surfaces the camera sees."""

    def __init__(self, camera: Camera, shapes: Sequence[Shape]) -> None:
        self.camera, self.caster = camera, RayCaster.of(shapes)

    def visible(self, points: np.ndarray) -> np.ndarray:
        """(N,) bool; points on a surface are not hidden by that surface itself."""
        eyes = self.camera.eyes_towards(points)
        way = points - eyes
        distance = np.linalg.norm(way, axis=-1)
        # float32 corners are off by 1e-7 of their distance from the origin.
        slack = 1e-5 * (distance + np.abs(points).max(initial=0))
        return ~self.caster.occluded(eyes, way / distance[:, None], np.maximum(distance - slack, 0))


def _split(soup: np.ndarray, camera: Camera, sight: _Sight | None, name: str) -> np.ndarray:
    """Halve edges until texture and seams are right, each edge in both of its triangles, so that there are no gaps."""
    marks = np.zeros((0, 3), bool)
    while len(soup):
        marks = np.concatenate([marks, _edges(soup[len(marks) :], camera, sight)])
        if not marks.any():
            return soup
        marks = _agreed(soup, marks, camera)
        if len(soup) + marks.sum() > MOST:
            warn(
                f"{name!r}: {MOST} triangles do not follow the photograph to {STRAIGHT} pixels on this surface; "
                "give it a size, or a simpler mesh"
            )
            return soup
        whole = ~marks.any(1)
        halves = _halved(soup[~whole], marks[~whole])
        # Triangles that stay whole were judged already and come first.
        soup, marks = np.concatenate([soup[whole], halves]), marks[whole]
    return soup


def _agreed(soup: np.ndarray, marks: np.ndarray, camera: Camera) -> np.ndarray:
    """With the longest edge of every triangle that has a marked one, and each edge alike in both its triangles.

    Without the longest, a thin triangle could be halved for ever at its short side.
    """
    corners = soup[..., :3]
    ends = np.roll(corners, -1, axis=1)
    middle = np.ascontiguousarray(0.5 * (corners + ends) + 0.0).reshape(-1, 3)  # no −0, whose bits differ
    _, edge = np.unique(middle.view(np.dtype((np.void, 24))).ravel(), return_inverse=True)
    at = camera.project(corners)
    length = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=-1)
    longest = np.arange(3) == np.argmax(length, axis=1)[:, None]
    count = 0
    while count != (count := int(marks.sum())):
        marks = marks | (longest & marks.any(1, keepdims=True))
        marked = np.bincount(edge, marks.ravel(), minlength=edge.max() + 1) > 0
        marks = marked[edge].reshape(-1, 3)
    return marks


def _edges(soup: np.ndarray, camera: Camera, sight: _Sight | None) -> np.ndarray:
    """(N, 3) bool: whether the edge from corner i to corner i + 1 is to be halved."""
    corners = soup[..., :3]
    ends = np.roll(corners, -1, axis=1)
    # Halves of an edge must not depend on which of its triangles asks.
    middle = 0.5 * (corners + ends)
    at, at_middle = camera.project(corners), camera.project(middle)
    at_end = np.roll(at, -1, axis=1)
    long = np.linalg.norm(at_end - at, axis=-1)
    bent = np.linalg.norm(at_middle - 0.5 * (at + at_end), axis=-1) > STRAIGHT
    inside = _in_frame(camera, at, 1e-6)
    seam = inside != np.roll(inside, -1, axis=1)
    result = bent | (seam & (long > SEAM))
    # Beyond a curved frame (a lens that distorts) nothing needs to be exact.
    result &= (inside | np.roll(inside, -1, axis=1) | _in_frame(camera, at_middle)) | (long > LONGEST)
    if sight is not None:
        shown = sight.visible(corners.reshape(-1, 3)).reshape(corners.shape[:2])
        change = shown != np.roll(shown, -1, axis=1)
        result &= np.any(shown, axis=1, keepdims=True)
        result |= (change & (long > SEAM)) | (long > LONGEST)
    return result


def _halved(soup: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Triangles (N, 3, C) with one, two or three marked edges (N, 3), in two, three or four."""
    one, two, three = (edges.sum(1) == count for count in (1, 2, 3))
    a, b, c = _turned(soup[one], np.argmax(edges[one], axis=1))
    ab = 0.5 * (a + b)
    parts = [(a, ab, c), (ab, b, c)]
    # The edge that stays whole goes last: from c to a.
    a, b, c = _turned(soup[two], (np.argmin(edges[two], axis=1) + 1) % 3)
    ab, bc = 0.5 * (a + b), 0.5 * (b + c)
    parts += [(ab, b, bc), (a, ab, bc), (a, bc, c)]
    a, b, c = np.moveaxis(soup[three], 1, 0)
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    parts += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def _turned(soup: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(soup, turn[..., None], axis=1), 1, 0)
    return a, b, c


def _in_frame(camera: Camera, at: np.ndarray, margin: float = 0.0) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return np.all((at >= -margin) & (at <= np.array([camera.width, camera.height]) + margin), axis=-1)


def _mesh(soup: np.ndarray, like: Mesh, camera: Camera | None) -> Mesh | None:
    """The triangles with shared corners; with the picture's texture coordinates where a camera is given."""
    if not len(soup):
        return None
    flat = soup.reshape(-1, soup.shape[-1]).astype(np.float32)
    unique, index = np.unique(flat, axis=0, return_inverse=True)
    vertices = np.ascontiguousarray(unique[:, :3])
    uv = None
    if camera is not None:
        at = camera.project(vertices)
        uv = np.clip(at / [camera.width, camera.height], 0, 1)
        uv = np.ascontiguousarray(uv * [1, -1] + [0, 1], np.float32)
    normals = None
    if unique.shape[1] > 3:
        length = np.linalg.norm(unique[:, 3:], axis=-1, keepdims=True)
        normals = (unique[:, 3:] / np.maximum(length, 1e-20)).astype(np.float32)
    faces = index.reshape(-1, 3).astype(np.int32)
    return Mesh(vertices, faces, like.material, normals, uv, like.name)
