"""Passes by Mitsuba's own path tracers, for machines on which Dr.Jit compiles nothing (its scalar variants).

What relume's own transport adds is not there: light that lamps without size send through smooth glass, and off mirrors,
and into bodies that scatter it, is lost, which is warned of; a medium between bodies and lens distortion are refused.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isqrt
from typing import Any

import numpy as np

from relume.errors import UnsupportedScene, warn
from relume.renderers.mitsuba.limits import FAIR, MATTE_SAMPLES, PASS_RAYS, WALK
from relume.renderers.mitsuba.materials import filling
from relume.renderers.mitsuba.scene import matte_dictionary, scene_dictionary, surfaces_dictionary
from relume.renderers.progressive.accumulation import Planes, pass_seed
from relume.renderers.raytrace.alpha_coverage import coverage, is_pierced
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight, PointLight, RectangleLight, SphereLight
from relume.scene.materials.materials import Material
from relume.scene.scene import Scene


def trace_of(mi: Any, scene: Scene, camera: Camera, depth: int, side: int) -> Callable[[int], Planes]:
    """The function of a pass's seed, of side² rays a pixel. Raises UnsupportedScene; warns of light that is lost."""
    if scene.medium is not None:
        raise UnsupportedScene(
            "the scalar variant of Mitsuba shows no medium between bodies; install LLVM 16 or newer, or leave "
            "scene.medium out"
        )
    small = any(isinstance(light, PointLight | DistantLight) for light in scene.lights)
    clear = [m for shape in (*scene.local, *scene.objects) if isinstance(m := shape.material, Material) and _sends(m)]
    if small and clear:
        warn(
            f"the scalar variant of Mitsuba loses the light that points and suns send through {clear[0].name!r} and "
            "off smooth mirrors; install LLVM 16 or newer, or use lamps that have a size"
        )
    world = mi.load_dict(scene_dictionary(mi, scene, finer(camera, side), media=True))
    path = mi.load_dict(integrator(scene, depth))
    return lambda seed: {"radiance": _cells_mean(_traced(mi, world, path, seed), side)}


def integrator(scene: Scene, depth: int) -> dict[str, Any]:
    """Mitsuba's path tracer, or the one that also goes through what fills bodies and through lamps."""
    media = [medium for shape in (*scene.local, *scene.objects) if (medium := filling(shape.material)) is not None]
    if not media and not any(isinstance(light, SphereLight | RectangleLight) for light in scene.lights):
        return {"type": "path", "max_depth": depth + 1, "rr_depth": 8}
    if any(any(medium.scattering) for medium in media):
        return {"type": "volpathmis", "max_depth": depth + 1 + WALK, "rr_depth": FAIR}
    return {"type": "volpathmis", "max_depth": depth + 1, "rr_depth": 8}


def guides_of(mi: Any, scene: Scene, camera: Camera, seed: int) -> dict[str, np.ndarray]:
    """The planes depth, normal, albedo and matte."""
    fine = finer(camera, side_of(camera, MATTE_SAMPLES))
    world = mi.load_dict(surfaces_dictionary(mi, scene, fine, media=True))
    depth, normal, albedo = _planes(mi, world, camera, seed)
    return {"depth": depth, "normal": normal, "albedo": albedo, "matte": _matte(mi, scene, camera, seed)}


def _sends(material: Material) -> bool:
    """Whether a surface sends light on in one direction."""
    metal = np.any(np.asarray(material.metallic) > 0) and np.any(np.asarray(material.roughness) == 0)
    return bool(np.any(material.through)) or bool(metal)


def side_of(camera: Camera, samples: int) -> int:
    """Cells along each side of a pixel, so that a pass of one ray a cell has no more than `samples` and PASS_RAYS."""
    return max(1, isqrt(min(samples, PASS_RAYS // (camera.width * camera.height))))


def finer(camera: Camera, side: int) -> Camera:
    """The same camera with side² pixels for each of its own.

    One ray goes through each of them, so that no two threads ever add to the same pixel, in whatever order.
    """
    return camera.resized(camera.width * side, camera.height * side)


def _traced(mi: Any, world: Any, integrator: Any, seed: int) -> np.ndarray:
    return np.array(mi.render(world, integrator=integrator, spp=1, seed=seed))


def _cells_mean(picture: np.ndarray, side: int, hit: np.ndarray | None = None) -> np.ndarray:
    """The mean over each pixel's cells in a fixed order; over those that `hit` something only, where that is given."""
    total, count = 0.0, 0.0
    for row in range(side):
        for column in range(side):
            cell = picture[row::side, column::side].astype(np.float64)
            total = total + cell
            count = count + (1.0 if hit is None else hit[row::side, column::side])
    return np.asarray(total / np.maximum(count, 1))


def _planes(mi: Any, world: Any, camera: Camera, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    integrator = mi.load_dict({"type": "aov", "aovs": "depth:depth,normal:sh_normal,albedo:albedo"})
    side = side_of(camera, MATTE_SAMPLES)
    # The first three channels are the nested integrator's picture where there is one.
    planes = _traced(mi, world, integrator, pass_seed(seed, 0))[..., -7:]
    depth = _cells_mean(planes[..., 0], side, planes[..., 0] > 0)
    normal, albedo = np.split(_cells_mean(planes[..., 1:], side), 2, axis=-1)
    return depth.astype(np.float32), normal.astype(np.float32), albedo.astype(np.float32)


def _matte(mi: Any, scene: Scene, camera: Camera, seed: int) -> np.ndarray:
    if not scene.objects:
        return np.zeros((camera.height, camera.width), np.float32)
    side = side_of(camera, MATTE_SAMPLES)
    if any(is_pierced(shape.material) for shape in scene.objects):
        return coverage(scene, camera, MATTE_SAMPLES, seed)
    world = mi.load_dict(matte_dictionary(mi, scene, finer(camera, side)))
    whiteness = mi.load_dict({"type": "aov", "aovs": "albedo:albedo"})
    passes = -(-MATTE_SAMPLES // side**2)
    pictures = (_traced(mi, world, whiteness, pass_seed(seed, index))[..., -3] for index in range(passes))
    matte = sum(_cells_mean(picture, side) for picture in pictures) / passes
    return np.clip(matte, 0, 1).astype(np.float32)
