"""Places of a real surface that the photograph and the light probe both show, and what each sees there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.composite.surface.projection import triangles_of_shape
from relume.image.bilinear import bilinear
from relume.image.radiance import RadianceMap
from relume.light.reflection.convolution import as_latlong
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene
from relume.sphere.mappings.mapping import LatLong, pixel_points

ROWS = 96
"""Of the lat-long grid of places: cells of 1.9°."""
FINER = 4
"""Rays a cell along each side, so that both views are averaged over the same piece of the surface."""
CLEAR = 3.0
"""Radii of the ball round its foot that are left out: there it hides light, and mirrors some."""
SURE = 0.3
"""Confidence from which on the probe's map is sharp enough to be compared."""
CELL = 12
"""Grid steps (22°) along each side of a group of places whose errors may go together."""
BLUR = 1.5
"""Pixels of the probe's map that its outline of the surface blurs over: a half of the pixel and one of the look-up."""
MOST = 900
"""Places of a photograph without a probe."""


@dataclass(frozen=True, eq=False)
class ViewOfProbe:
    """How a probe's map shows the surface below it.

    confidence : (rows, columns) as `Probe.confidence`, at any size of a lat-long map
    radius : of the ball, metres; what lies within three radii of its foot is left out, as the ball hides light there
    mirrored_at, nearness : as `Probe` has them, for the map shows what is near from the ball's surface and not from its
        centre: of a table a few radii away the places differ by a tenth of their distance. None and 0 for a map that
        was seen from one point
    """

    confidence: np.ndarray
    radius: float
    mirrored_at: np.ndarray | None = None
    nearness: float = 0.0

    def rays(self, centre: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """From where, and along which unit vectors, the map's directions (…, 3) were seen: (…, 3) each, world."""
        if self.mirrored_at is None:
            return np.broadcast_to(centre, directions.shape), directions
        wide = np.concatenate([self.mirrored_at[:, -1:], self.mirrored_at, self.mirrored_at[:, :1]], axis=1)
        points = LatLong().image_points(directions) * [self.mirrored_at.shape[1], len(self.mirrored_at)]
        place = np.asarray(bilinear(wide, points[..., 0] + 1, points[..., 1]), np.float64)
        way = directions - self.nearness * place
        return centre + self.radius * place, way / np.linalg.norm(way, axis=-1, keepdims=True)


@dataclass(frozen=True, eq=False)
class Shared:
    """Places on a surface.

    points, normals : (N, 3), metres and unit vectors, world
    seen_from : (N, 3) from where on the ball the probe shows them, metres, world; the camera's place without a probe
    plate, probe : (N, 3) radiance that the photograph and the probe show there; the plate's twice without a probe
    cells : (N,) int, groups of neighbouring places
    """

    points: np.ndarray
    normals: np.ndarray
    seen_from: np.ndarray
    plate: np.ndarray
    probe: np.ndarray
    cells: np.ndarray


def common_points(
    plate: RadianceMap,
    camera: Camera,
    scene: Scene,
    index: int,
    usable: np.ndarray,
    view: ViewOfProbe,
) -> Shared:
    """Places of local surface `index` that the probe sees surely and the plate shows at usable pixels.

    No place is taken where the map's pixels mix the surface with what is beside it: at grazing angles its outline is
    near, and a tenth of the bright floor behind a table looks like gloss.
    """
    fine = LatLong().directions(pixel_points(LatLong(), ROWS * FINER))
    caster = RayCaster.of(scene.local)
    probe = np.array(scene.probe, np.float64)
    places, ways = view.rays(probe, fine)
    hits = caster.nearest(places.reshape(-1, 3), ways.reshape(-1, 3))
    distance = hits.distance.reshape(fine.shape[:2])
    on_it = _well_inside((hits.shape == index).reshape(distance.shape), as_latlong(scene.light).size)
    points = places + np.where(on_it, distance, 1.0)[..., None] * ways
    on_it &= np.linalg.norm((points - probe)[..., [0, 2]], axis=-1) > CLEAR * view.radius
    sure = values_at(view.confidence[..., None].astype(np.float64), LatLong().image_points(fine))[..., 0]
    on_it &= sure > SURE
    at = camera.project(points)
    on_it &= shown_at(camera, caster, points, at, usable, index)
    seen = _cells(on_it).all((1, 3))
    if not seen.any():
        empty = np.zeros((0, 3))
        return Shared(empty, empty, empty, empty, empty, np.zeros(0, int))
    from_plate = values_at(plate.radiance, np.nan_to_num(at) / [camera.width, camera.height])
    from_probe = scene.light.lookup(fine)
    mean = [np.asarray(_cells(each).mean((1, 3)))[seen] for each in (points, places, from_plate, from_probe)]
    row, column = np.nonzero(seen)
    cells = np.unique((row // CELL) * ROWS + column // CELL, return_inverse=True)[1]
    normals = normals_at(scene, index, probe, mean[0])
    middle, seen_from, of_plate, of_probe = mean
    return Shared(middle, normals, seen_from, of_plate, of_probe, cells)


def plate_points(plate: RadianceMap, camera: Camera, scene: Scene, index: int, usable: np.ndarray) -> Shared:
    """Places of local surface `index` spread over the usable pixels of the plate."""
    step = max(1, int(np.sqrt(usable.sum() / MOST)))
    row, column = np.nonzero(usable)
    chosen = (row % step == 0) & (column % step == 0)
    row, column = row[chosen], column[chosen]
    at = np.stack([column + 0.5, row + 0.5], axis=-1)
    rays, eyes = camera.rays_through(at), camera.eyes(at)
    hits = RayCaster.of(scene.local).nearest(eyes, rays)
    on_it = hits.shape == index
    eyes = eyes[on_it]
    points = eyes + hits.distance[on_it, None] * rays[on_it]
    seen = plate.radiance[row[on_it], column[on_it]].astype(np.float64)
    side = max(1, max(usable.shape) // 8)
    cells = np.unique((row[on_it] // side) * 64 + column[on_it] // side, return_inverse=True)[1]
    return Shared(points, normals_at(scene, index, eyes, points), eyes, seen, seen, cells)


def _well_inside(shown: np.ndarray, rows: int) -> np.ndarray:
    """(h, w) bool: what of a surface in a lat-long grid lies off its outline in a map of so many rows."""
    from scipy.ndimage import minimum_filter

    reach = int(np.ceil(BLUR * len(shown) / rows))
    wrapped = np.pad(np.pad(shown, ((reach, reach), (0, 0)), mode="edge"), ((0, 0), (reach, reach)), mode="wrap")
    return minimum_filter(wrapped, 2 * reach + 1)[reach:-reach, reach:-reach]


def normals_at(scene: Scene, index: int, eye: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Unit normals on the side of the eye, (3,), or of each point's, (N, 3)."""
    mesh = triangles_of_shape(scene.local[index])
    way = points - eye
    distance = np.linalg.norm(way, axis=-1, keepdims=True)
    hits = RayCaster.of([mesh]).nearest(eye, way / distance)
    a, b, c = np.moveaxis(np.asarray(mesh.vertices, np.float64)[mesh.faces[hits.primitive]], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return normal * np.where((normal * way).sum(-1, keepdims=True) > 0, -1, 1)


def shown_at(
    camera: Camera, caster: RayCaster, points: np.ndarray, at: np.ndarray, usable: np.ndarray, index: int
) -> np.ndarray:
    """Whether the plate shows the very points, at usable pixels."""
    with np.errstate(invalid="ignore"):
        inside = np.all((at >= 0) & (at < [camera.width, camera.height]), axis=-1)
    pixel = np.where(inside[..., None], np.nan_to_num(at), 0).astype(int)
    result = inside & usable[pixel[..., 1], pixel[..., 0]]
    eyes = camera.eyes(at[result])
    way = points[result] - eyes
    distance = np.linalg.norm(way, axis=-1)
    hits = caster.nearest(eyes, way / distance[:, None])
    result[result] = (hits.shape == index) & (np.abs(hits.distance - distance) < 1e-3 * distance)
    return result


def _cells(fine: np.ndarray) -> np.ndarray:
    return fine.reshape(ROWS, FINER, 2 * ROWS, FINER, *fine.shape[2:])


def values_at(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Bilinear values at (…, 2) shares of an image's width and height."""
    rows, columns = image.shape[:2]
    x = np.clip(points[..., 0] * columns, 0.5, columns - 0.5)
    y = np.clip(points[..., 1] * rows, 0.5, rows - 0.5)
    return np.asarray(bilinear(image, x, y), np.float64)
