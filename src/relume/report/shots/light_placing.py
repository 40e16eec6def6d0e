"""Where a light has to be for a point of an object to mirror it into the camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.project.place_tables import distant_scene
from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.shot import Shot
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Box, Dome
from relume.scene.shapes.shapes import Mesh

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class MirroredLight:
    """A point of an object that the camera sees, and where what it mirrors comes from.

    point : metres, world
    normal : there, unit, towards the camera
    direction : unit, towards the light, as the shot's map has directions: from where the light was measured
    """

    point: Triple
    normal: Triple
    direction: Triple


def mirrored_light(shot: Shot, camera: Camera, x: float, y: float) -> MirroredLight | None:
    """What the object at a pixel of the plate mirrors into the camera; None where there is no object.

    shot : the shot, whose light and objects are taken
    camera : the plate's
    x, y : pixels, from the upper left corner
    In a room or a dome (`light.distant`) the light is where the mirrored ray meets its walls. Raises RelumeError.
    """
    at = np.array([[x, y]], np.float64)
    ray, eye = camera.rays_through(at)[0], camera.eyes(at)[0]
    ray /= np.linalg.norm(ray)
    hits = [hit for mesh in placed_meshes(shot) if (hit := _nearest(mesh, eye, ray)) is not None]
    if not hits:
        return None
    distance, normal = min(hits, key=lambda hit: hit[0])
    point = eye + distance * ray
    normal = normal if normal @ ray < 0 else -normal
    towards = ray - 2 * (ray @ normal) * normal
    distant = distant_scene(shot.light.distant, shot.folder)
    if isinstance(distant, Box | Dome):
        # The map knows the wall by its direction from the probe.
        towards = point + float(distant.distances(point, towards)) * towards - _probe(shot)
    return MirroredLight(_triple(point), _triple(normal), _triple(towards / np.linalg.norm(towards)))


def _probe(shot: Shot) -> np.ndarray:
    """Where the light was measured."""
    light, asked = shot.light, shot.camera.of_ball
    if light.ball is not None:
        raised = 0.0 if asked is None else asked.raised or 0.0
        return np.array(light.ball.centre or (0.0, light.ball.radius + raised, 0.0))
    return np.array(light.probe or (0.0, 0.0, 0.0))


def _nearest(mesh: Mesh, origin: np.ndarray, ray: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Distance to a mesh along a ray, and the shading normal there; None for a miss (Möller & Trumbore 1997)."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(ray, second)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / (first * across).sum(-1)
        away = origin - corners[:, 0]
        u = (away * across).sum(-1) * scale
        over = np.cross(away, first)
        v = (over @ ray) * scale
        distances = (over * second).sum(-1) * scale
        met = np.flatnonzero((u >= 0) & (v >= 0) & (u + v <= 1) & (distances > 1e-6))
    if not met.size:
        return None
    hit = met[np.argmin(distances[met])]
    if mesh.normals is None:
        normal = np.cross(first[hit], second[hit])
    else:
        weights = np.array([1 - u[hit] - v[hit], u[hit], v[hit]])
        normal = weights @ mesh.normals[mesh.faces[hit]].astype(np.float64)
    return float(distances[hit]), normal / np.linalg.norm(normal)


def _triple(values: np.ndarray) -> Triple:
    x, y, z = (float(each) for each in values)
    return x, y, z
