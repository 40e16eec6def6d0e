"""How far the shapes of a scene reach."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.scene.lights import PointLight, RectangleLight, SphereLight
from relume.scene.scene import Enclosure, Infinite, Scene
from relume.scene.shapes.shapes import Plane, Shape, bounding_sphere, bounds


def corners(shape: Shape) -> np.ndarray:
    """Points (N, 3) that span a shape: its corners, or those of the box round it."""
    if isinstance(shape, Plane):
        x, z = np.array(shape.extent) / 2
        return np.array([[i * x, shape.height, j * z] for i in (-1, 1) for j in (-1, 1)])
    low, high = bounds([shape])
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def sphere_round(shape: Shape) -> tuple[np.ndarray, float]:
    """The centre (3,) and radius, metres, of a sphere around a shape."""
    if isinstance(shape, Plane):
        return np.array([0.0, shape.height, 0.0]), float(np.hypot(*shape.extent)) / 2
    return bounding_sphere(shape)


def sphere_round_shapes(shapes: Sequence[Shape]) -> tuple[np.ndarray, float]:
    """The same around several shapes, of which there is at least one, about the middle of their box."""
    spheres = [sphere_round(shape) for shape in shapes]
    every = np.concatenate([corners(shape) for shape in shapes])
    middle = (every.min(axis=0) + every.max(axis=0)) / 2
    return middle, max(float(np.linalg.norm(centre - middle)) + radius for centre, radius in spheres)


def sphere_round_all(scene: Scene) -> tuple[np.ndarray, float]:
    """The same about all shapes and near lamps, about the middle of their box: how far an infinite scene's fog reaches.

    Raises ValueError where there is nothing that has a place.
    """
    spheres = [sphere_round(shape) for shape in (*scene.local, *scene.objects)]
    for light in scene.lights:
        if isinstance(light, SphereLight):
            spheres.append((np.asarray(light.position, np.float64), light.radius))
        elif isinstance(light, RectangleLight):
            spheres.append((np.asarray(light.position, np.float64), float(np.hypot(*light.size)) / 2))
        elif isinstance(light, PointLight):
            spheres.append((np.asarray(light.position, np.float64), 0.0))
    if not spheres:
        raise ValueError(
            "a medium fills a scene without shapes and near lamps, and its light comes from infinity: give the medium "
            "an end by a near distant scene (Dome, Box), or shapes"
        )
    places = [corners(shape) for shape in (*scene.local, *scene.objects)]
    places += [np.array([centre - radius, centre + radius]) for centre, radius in spheres[len(places) :]]
    every = np.concatenate(places)
    middle = (every.min(axis=0) + every.max(axis=0)) / 2
    return middle, min(
        max(float(np.linalg.norm(centre - middle)) + radius for centre, radius in spheres) * (1 + 1e-4),
        float(np.linalg.norm(every - middle, axis=1).max()) * (1 + 1e-4),
    )


def sticks_out(scene: Scene) -> bool:
    """Whether real surfaces reach through the walls of a near distant scene."""
    if isinstance(scene.distant, Infinite):
        return False
    if isinstance(scene.distant, Enclosure):
        return bool(scene.local)
    probe = np.array(scene.probe, np.float64)
    for shape in scene.local:
        points = corners(shape)
        away = np.linalg.norm(points - probe, axis=-1, keepdims=True)
        reach = scene.distant.distances(probe, (points - probe) / np.maximum(away, 1e-12))
        if np.any(away[..., 0] > reach * (1 + 1e-6)):
            return True
    return False
