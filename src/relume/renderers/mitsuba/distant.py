"""The distant scene in Mitsuba's words: what the probe saw, on the walls where it saw it (Debevec 1998, Fig. 5).

The walls become a mesh whose vertices stand where a lat-long grid of rays from the probe ends. A wall's texture
coordinates are therefore the probe's own directions, the map needs no resampling, and every direction has one place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.errors import warn
from relume.light.reflection.convolution import as_latlong
from relume.renderers.mitsuba.arrays import triangles
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Distant, Dome, Enclosure, Infinite, Scene
from relume.scene.shapes.shapes import Mesh, Polygon, Shape, Sphere
from relume.sphere.bilinear_kernels import padded
from relume.sphere.mappings.mapping import LatLong

ROWS = 96
"""Of the grid. Cells of 1.9° change what arrives by less than 0.1 %, and trace twice as fast as ones of 0.7°."""
LEAP = 2.0
"""Ratio of the distances of neighbouring cells from which on one wall hides another: a wall that a cell of 1.9° sees at
2° from its own plane changes by less."""


@dataclass(frozen=True, eq=False)
class Walls:
    """The part of a distant scene that its probe sees, as triangles.

    vertices : (N, 3) float32, metres, world
    faces : (M, 3) int32, counter-clockwise as the probe sees them
    uv : (N, 2) float32, the direction from the probe as a place in a lat-long map, (0, 0) its upper left corner
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray


def walls(distant: Distant, probe: tuple[float, float, float], rows: int = ROWS) -> Walls:
    """What `probe` sees of a distant scene that is not at infinity.

    rows : of the grid, from pole to pole; twice as many columns
    Warns where a part of the mesh hides another from the probe: nothing was measured there, and the walls between are
    drawn from the edge of the one to the other. Raises ValueError where the probe stands outside.
    """
    if isinstance(distant, Infinite):
        raise ValueError("a distant scene at infinity has no walls; give a Dome, a Box or an Enclosure")
    require_inside(distant, probe)
    u, v = np.arange(2 * rows + 1) / (2 * rows), np.arange(rows + 1) / rows
    # A pole is one place with many directions u; each of its triangles takes the one in its own middle.
    across = np.broadcast_to(u, (rows + 1, 2 * rows + 1)).copy()
    across[[0, -1]] += 0.5 / (2 * rows)
    uv = np.stack([across, np.broadcast_to(v[:, None], across.shape)], axis=-1).reshape(-1, 2)
    directions = LatLong().directions(uv)
    distance = wall_distances(distant, np.array(probe), directions)
    if not np.all(np.isfinite(distance)):
        raise ValueError(
            f"the distant scene is open: {np.mean(~np.isfinite(distance)):.1%} of the directions from the probe at "
            f"{tuple(probe)} meet none of its faces; close the mesh"
        )
    grid = distance.reshape(rows + 1, -1)
    steps = np.concatenate([np.ravel(np.diff(np.log(grid), axis=0)), np.ravel(np.diff(np.log(grid), axis=1))])
    if isinstance(distant, Enclosure) and np.abs(steps).max() > np.log(LEAP):
        warn(
            "parts of the distant scene's mesh are hidden from the probe: their light is drawn out from the edges that "
            "hide them; take a simpler mesh, or put the probe where it sees all of it"
        )
    corner = (np.arange(rows)[:, None] * (2 * rows + 1) + np.arange(2 * rows)).ravel()
    below = corner + 2 * rows + 1
    # Seen from inside, u runs to the right and v down. At a pole one of a cell's two triangles has no area.
    upper, lower = np.stack([corner, below, corner + 1], axis=1), np.stack([corner + 1, below, below + 1], axis=1)
    top = np.stack([corner, below, below + 1], axis=1)[: 2 * rows]
    faces = np.concatenate([top, upper[2 * rows :], lower[2 * rows : -2 * rows]])
    vertices = np.array(probe) + distance[:, None] * directions
    return Walls(vertices.astype(np.float32), faces.astype(np.int32), uv.astype(np.float32))


def wall_distances(distant: Distant, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How far rays (N, 3) from inside a finite distant scene go to it, metres; ∞ through an Enclosure's holes.

    origins : (N, 3) or (3,), metres, world
    """
    if isinstance(distant, Infinite):
        return np.full(len(directions), np.inf)
    if not isinstance(distant, Enclosure):
        return distant.distances(origins, directions)
    mesh = Mesh(distant.vertices, distant.faces, Diffuse((0.0, 0.0, 0.0)))
    return RayCaster.of([mesh]).nearest(origins, directions).distance


def require_inside(distant: Distant, probe: tuple[float, float, float], shapes: tuple[Shape, ...] = ()) -> None:
    """Raise ValueError unless the probe, and all of the shapes, are inside the distant scene.

    Real surfaces may stick out of it, as a floor that reaches to the horizon does, and are not to be given.
    """
    if isinstance(distant, Infinite):
        return
    if not _inside(distant, np.array([probe], np.float64))[0]:
        raise ValueError(f"the probe at {tuple(probe)} is outside of the distant scene; both are in metres, world")
    for shape in shapes:
        points = _outermost(shape)
        out = ~_inside(distant, points)
        if out.any():
            where = np.round(points[np.argmax(out)], 3).tolist()
            raise ValueError(
                f"{getattr(shape, 'name', 'an object')!r} reaches out of the distant scene, to {where}; "
                "what stands on its wall touches it: make the distant scene a millimetre larger, or move the object"
            )


def _inside(distant: Distant, points: np.ndarray) -> np.ndarray:
    if isinstance(distant, Enclosure):
        # From inside, a ray either way meets the mesh an odd number of times; one hit each way is what we can ask.
        ways = np.array([[0.36, 0.48, 0.8], [-0.36, -0.48, -0.8]])
        hits = [wall_distances(distant, points, np.broadcast_to(way, points.shape)) for way in ways]
        return np.all(np.isfinite(hits), axis=0)
    if isinstance(distant, Dome):
        return np.linalg.norm(points - np.array(distant.centre), axis=-1) < distant.radius
    assert not isinstance(distant, Infinite)
    return np.all((points > np.array(distant.low)) & (points < np.array(distant.high)), axis=-1)


def _outermost(shape: Shape) -> np.ndarray:
    if isinstance(shape, Mesh | Polygon):
        return np.asarray(shape.vertices, np.float64)
    if isinstance(shape, Sphere):
        return np.array(shape.centre) + shape.radius * np.concatenate([np.eye(3), -np.eye(3)])
    return np.asarray(getattr(shape, "control", np.zeros((1, 3))), np.float64).reshape(-1, 3)


def distant_shape(mi: Any, scene: Scene) -> Any:
    """The walls as a Mitsuba mesh that shines inwards with the probe's map and reflects nothing."""
    built, pixels = walls(scene.distant, scene.probe), as_latlong(scene.light).radiance
    # One more pixel round the seam and over the poles, so that bilinear look-up is that of `EnvironmentMap`.
    bitmap = mi.Bitmap(np.ascontiguousarray(padded(pixels)[..., :3]))
    rows, columns = pixels.shape[:2]
    place = (built.uv * [columns, rows] + 1) / [columns + 2, rows + 2]
    radiance = {"type": "bitmap", "bitmap": bitmap, "raw": True, "wrap_mode": "clamp"}
    parts = {"emitter": {"type": "area", "radiance": radiance}, "bsdf": {"type": "diffuse", "reflectance": 0.0}}
    return triangles(mi, Mesh(built.vertices, built.faces, Diffuse((0.0, 0.0, 0.0)), uv=place, name="distant"), parts)
