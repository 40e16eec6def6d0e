"""Photons drawn: where they landed as points, and the discs from whose photons light is estimated as circles."""

from __future__ import annotations

import numpy as np

from relume.renderers.photon_map.photon_map import PhotonStep
from relume.renderers.photon_map.tracing import Photons
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene
from relume.sphere.directions import normalised


def drawn_photons(photons: Photons, scene: Scene, camera: Camera) -> np.ndarray:
    """A picture (H, W, 3) float32 of the photons that the camera sees, each a point of its own colour.

    photons : of one pass
    scene : in which they fly
    camera : whose picture it is

    The colour's brightest channel is 1, for photons are about equally strong: density is what shows the light.
    """
    picture = np.zeros((camera.height, camera.width, 3), np.float32)
    at = camera.project(photons.position)
    with np.errstate(invalid="ignore"):
        shown = np.flatnonzero(np.all((at >= 0) & (at < [camera.width, camera.height]), axis=1))
    eyes = camera.eyes(at[shown])
    way = photons.position[shown] - eyes
    distance = np.linalg.norm(way, axis=1)
    hidden = RayCaster.of((*scene.local, *scene.objects)).occluded(eyes, normalised(way), distance * (1 - 1e-4))
    shown = shown[~hidden]
    column, row = at[shown].astype(int).T
    power = photons.power[shown]
    np.maximum.at(picture, (row, column), power / np.maximum(power.max(axis=1, keepdims=True), 1e-30))
    return picture


def drawn_discs(step: PhotonStep, camera: Camera, every: int = 24) -> np.ndarray:
    """The picture (H, W, 3) of a `step` with the disc of each `every`-th pixel both ways drawn as a white circle.

    camera : whose picture it is
    """
    picture, white = step.render.radiance.copy(), float(np.percentile(step.render.radiance, 99))
    places = camera.eyes(camera.middles()) + camera.rays() * step.render.depth[..., None]
    for row in range(every // 2, camera.height, every):
        for column in range(every // 2, camera.width, every):
            radius = step.radius[row, column]
            away = np.linalg.norm(places - places[row, column], axis=-1)
            level = np.einsum("ijk,k->ij", step.render.normal, step.render.normal[row, column]) > 0.9
            # A pixel wide, as the picture shows it there.
            width = step.render.depth[row, column] / camera.focal_length
            picture[level & (np.abs(away - radius) < 0.7 * width) & (radius > 0)] = white
    return picture
