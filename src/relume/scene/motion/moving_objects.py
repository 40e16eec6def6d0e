"""Objects that move: turned rigidly about a point, or going round a vertical axis while a movie runs."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from relume.scene.materials.bumps import BumpMap, Wrinkles
from relume.scene.materials.materials import Material
from relume.scene.materials.reflective import Layer, Reflective
from relume.scene.materials.whitted import Checks, WhittedMaterial
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import AnyMaterial, Mesh, Polygon, Solid, Sphere
from relume.sphere.directions import UP, rotation_about


@dataclass(frozen=True)
class ObjectOrbit:
    """An object goes round a vertical axis and turns with it, as a moon does, counter-clockwise seen from above.

    centre : a point of the axis, metres
    turns : full turns in all; negative ones clockwise
    """

    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turns: float = 1.0

    def at(self, solid: Solid, share: float) -> Solid:
        """The object after this share of the way."""
        return turned(solid, rotation_about(UP, 2 * np.pi * self.turns * share), self.centre)


def turned(solid: Solid, rotation: np.ndarray, about: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Solid:
    """The solid turned rigidly, its images with it; checks and waves lie in space and stay (`left_in_space`).

    rotation : (3, 3), active
    about : the point that stays where it is, metres
    Raises ValueError for a sphere with an image that does not turn about the vertical: its poles stand up.
    """
    centre = np.asarray(about, np.float64)

    def moved(points: np.ndarray) -> np.ndarray:
        return centre + (points - centre) @ rotation.T

    if isinstance(solid, Sphere):
        x, y, z = moved(np.asarray(solid.centre, np.float64))
        material = _images_turned(solid.material, rotation, solid.name)
        return replace(solid, centre=(float(x), float(y), float(z)), material=material)
    if isinstance(solid, Mesh):
        normals = None if solid.normals is None else (solid.normals @ rotation.T).astype(np.float32)
        return replace(solid, vertices=moved(solid.vertices).astype(np.float32), normals=normals)
    if isinstance(solid, Polygon):
        return replace(solid, vertices=moved(solid.vertices))
    return replace(solid, control=moved(solid.control))


def turned_scene(scene: Scene, rotation: np.ndarray, about: tuple[float, float, float]) -> Scene:
    """The scene with its objects turned; the same one where nothing turns."""
    if np.array_equal(rotation, np.eye(3)):
        return scene
    return replace(scene, objects=tuple(turned(solid, rotation, about) for solid in scene.objects))


def left_in_space(solids: Iterable[Solid]) -> list[str]:
    """The names of those whose checks or waves lie in space, so that they move through them."""
    return [solid.name for solid in solids if _lies_in_space(solid.material)]


def columns_turned(image: np.ndarray, angle: float) -> np.ndarray:
    """A lat-long image (H, W, …) after a turn about +Y, counter-clockwise seen from above, in radians.

    The columns move to smaller ones; what falls between two is shared, so that nothing of the image's sum is lost.
    """
    whole, part = divmod(image.shape[1] * (1 - angle / (2 * np.pi) % 1), 1)
    near, far = (np.roll(image, int(whole) + step, axis=1) for step in (0, 1))
    return near if part == 0 else near * (1 - part) + far * part


def _lies_in_space(material: AnyMaterial) -> bool:
    return isinstance(getattr(material, "diffuse", None), Checks) or isinstance(
        getattr(material, "bumps", None), Wrinkles
    )


def _images_turned(value: Any, rotation: np.ndarray, name: str) -> Any:
    """A sphere's material, or a part of one, its lat-long images turned; the same one where it holds none."""
    if isinstance(value, np.ndarray) and value.ndim > 1:
        if not np.allclose(rotation @ UP, UP, atol=1e-9):
            raise ValueError(f"{name!r} is a sphere with an image, whose poles stand up; turn it about +Y only")
        return columns_turned(value, float(np.arctan2(rotation[0, 2], rotation[0, 0]))).astype(value.dtype)
    if isinstance(value, tuple):
        parts = tuple(_images_turned(part, rotation, name) for part in value)
        return value if all(a is b for a, b in zip(parts, value, strict=True)) else parts
    if not isinstance(value, Material | Reflective | WhittedMaterial | Layer | BumpMap):
        return value
    held = {field.name: getattr(value, field.name) for field in fields(value)}
    after = {key: _images_turned(part, rotation, name) for key, part in held.items()}
    changed = {key: part for key, part in after.items() if part is not held[key]}
    with warnings.catch_warnings():
        # What is to be said of the coefficients was said when they were given.
        warnings.simplefilter("ignore", UserWarning)
        return replace(value, **changed) if changed else value
