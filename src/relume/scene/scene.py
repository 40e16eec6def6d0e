"""A scene: the real surfaces, the objects added to them, and the light of the distant scene (Debevec 1998, §4).

A probe records from which directions light comes to one place. Where it comes *from* decides what other places get:
each shape of the distant scene says where a ray from the probe ends (§5.1, Fig. 5). These shapes shine and take no
light: they are not part of the local scene, and hide nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from relume.scene.lights import Light
from relume.scene.materials.media import Medium
from relume.scene.shapes.shapes import Shape, Solid
from relume.sphere.environment_map import EnvironmentMap

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Infinite:
    """Everything is so far away that every place sees the same light."""


@dataclass(frozen=True)
class Dome:
    """A sphere around the scene.

    radius : metres
    centre : metres, world
    """

    radius: float
    centre: Point = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not 0 < self.radius < np.inf or not np.all(np.isfinite(self.centre)):
            raise ValueError(f"a dome of radius {self.radius} about {self.centre}; expected metres")

    def distances(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """How far rays from inside go to it, metres.

        origins, directions : (…, 3) metres, and unit
        """
        away = np.asarray(origins, np.float64) - np.array(self.centre)
        along = (away * directions).sum(-1)
        return -along + np.sqrt(np.maximum(along**2 - (away**2).sum(-1) + self.radius**2, 0))


@dataclass(frozen=True)
class Box:
    """A room: a box that stands straight in the world.

    low, high : two opposite corners, metres, world
    """

    low: Point
    high: Point

    def __post_init__(self) -> None:
        size = np.subtract(self.high, self.low)
        if not np.all((size > 0) & np.isfinite(size)):
            raise ValueError(f"a box from {self.low} to {self.high}; expected each of low below that of high, metres")

    def distances(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """How far rays from inside go to its walls, metres.

        origins, directions : (…, 3) metres, and unit
        """
        origins, directions = np.asarray(origins, np.float64), np.asarray(directions, np.float64)
        wall = np.where(directions > 0, np.array(self.high), np.array(self.low))
        with np.errstate(divide="ignore", invalid="ignore"):
            ways = np.where(directions == 0, np.inf, (wall - origins) / directions)
        return ways.min(-1)


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Any closed mesh around the scene.

    vertices : (N, 3) float32, metres, world
    faces : (M, 3) int32, in any order
    """

    vertices: np.ndarray
    faces: np.ndarray

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise ValueError(f"vertices {self.vertices.shape} and faces {self.faces.shape}; expected (N, 3) and (M, 3)")
        if not np.all(np.isfinite(self.vertices)):
            raise ValueError("vertices of the distant scene hold NaN or infinity; expected metres")


Distant = Infinite | Dome | Box | Enclosure


@dataclass(frozen=True, eq=False)
class Scene:
    """What a renderer renders.

    light : the distant scene, as `probe` sees it
    local : real surfaces that the objects affect
    objects : what is added; a renderer's matte is their coverage
    lights : others than the distant scene
    distant : onto what the light is projected; at infinity, where every place sees the same, unless given
    probe : where the light was measured, metres, world; means nothing for a distant scene at infinity
    medium : what fills all space outside of bodies, as fog does; None for clear air. It ends at the walls of a near
        distant scene. Through an endless fog no light of infinity would arrive: with an infinite distant scene it ends
        at the sphere about all shapes and near lamps
    """

    light: EnvironmentMap
    local: tuple[Shape, ...] = ()
    objects: tuple[Solid, ...] = ()
    lights: tuple[Light, ...] = ()
    distant: Distant = Infinite()
    probe: Point = (0.0, 0.0, 0.0)
    medium: Medium | None = None

    def adding(self, *objects: Solid) -> Scene:
        """The same scene with more objects."""
        return replace(self, objects=(*self.objects, *objects))

    def without_objects(self) -> Scene:
        """The real scene alone."""
        return replace(self, objects=())

    def with_local(self, local: Iterable[Shape]) -> Scene:
        """The same scene over other real surfaces, `local`."""
        return replace(self, local=tuple(local))
