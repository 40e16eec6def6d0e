"""Coverage of objects that have holes in them: rays go on through where a material's alpha says nothing is there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relume.image.bilinear import bilinear
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import AnyMaterial


def repeated(image: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """What looks an image (H, W) or (H, W, C) up, bilinearly, at texture coordinates (P, 2).

    (0, 0) is the image's lower left corner, (1, 1) its upper right one, where it begins anew.
    """
    rows, columns = image.shape[:2]
    tiled = np.pad(image, ((1, 1), (1, 1)) + ((0, 0),) * (image.ndim - 2), mode="wrap")

    def looked_up(uv: np.ndarray) -> np.ndarray:
        # Images begin with the upper row.
        return bilinear(tiled, uv[:, 0] % 1 * columns + 1, (1 - uv[:, 1] % 1) * rows + 1)

    return looked_up


BEYOND = 1e-6
"""Share of a ray's way that it goes on after a hole, so that it does not meet the same surface again."""
LAYERS = 256
"""Surfaces that a ray passes at most; one that is let through so often has met hardly anything that is there."""


def is_pierced(material: AnyMaterial) -> bool:
    """Whether light goes straight on through a part of the surface."""
    return isinstance(material, Material) and bool(np.any(np.asarray(material.alpha) < 1))


def coverage(scene: Scene, camera: Camera, samples: int = 64, seed: int = 0) -> np.ndarray:
    """The share (H, W) float32 of each pixel that objects cover before real surfaces do, with their alpha.

    samples : rays a pixel; 64 estimate it to 0.06 where half is covered
    """
    # The ray caster is imported only where it is used: it imports Numba.
    from relume.renderers.raytrace.raycast import RayCaster
    from relume.renderers.raytrace.surface import Surfaces

    shapes = (*scene.local, *scene.objects)
    caster, surfaces = RayCaster.of(shapes), Surfaces.of(shapes)
    random = np.random.default_rng([seed, 0x616C])
    covered = np.zeros(camera.width * camera.height)
    for _ in range(samples):
        origins, directions = _rays(camera, random)
        pixel, met_after = np.arange(len(directions)), 0.0
        for _ in range(LAYERS):
            hits = caster.nearest(origins, directions, beyond=met_after)
            there = np.flatnonzero(hits.shape >= len(scene.local))
            if not there.size:
                break
            points = surfaces.at(origins, directions, hits)
            stopped = random.random(len(there)) < _alpha(shapes, hits.shape[there], points.uv[there])
            covered[pixel[there[stopped]]] += 1
            going = there[~stopped]
            if not going.size:
                break
            met_after = BEYOND * float(hits.distance[going].max())
            pixel, origins, directions = pixel[going], points.point[going], directions[going]
    return (covered / samples).reshape(camera.height, camera.width).astype(np.float32)


def _rays(camera: Camera, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """One ray through a place by chance in each pixel, and through one of the aperture."""
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    within = np.stack([x.ravel(), y.ravel()], axis=-1) + random.random((x.size, 2))
    directions = camera.rays_through(within)
    origins = camera.eyes(within)
    if camera.aperture > 0:
        radius, angle = camera.aperture * np.sqrt(random.random(x.size)), 2 * np.pi * random.random(x.size)
        right, up, backward = camera.rotation.T
        across = (radius * np.cos(angle))[:, None] * right + (radius * np.sin(angle))[:, None] * up
        # All rays of a pixel meet in the plane in focus; at infinity they are parallel.
        directions = directions - across * ((-directions @ backward) / camera.focus)[:, None]
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        origins = origins + across
    return origins, directions


def _alpha(shapes: tuple, met: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """How much is there of the surfaces that were met, at their texture coordinates."""
    there = np.ones(len(met))
    for index in np.unique(met):
        material = shapes[index].material
        if is_pierced(material):
            here = met == index
            alpha = np.asarray(material.alpha, np.float64)
            there[here] = alpha if alpha.ndim == 0 else repeated(alpha)(uv[here])
    return there
