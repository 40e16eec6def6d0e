"""What goes into Whitted's kernel besides shapes and materials, lights and settings, and the nodes that come out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from relume.errors import UnsupportedScene
from relume.light.constellations.constellation import constellation
from relume.scene.cameras.camera import Camera
from relume.scene.lights import (
    AmbientLight,
    Attenuation,
    DistantLight,
    Light,
    Linear,
    RectangleLight,
    SphereLight,
    SquareLaw,
)
from relume.scene.scene import Scene

NONE, LINEAR, SQUARE, DISTANT = 0, 1, 2, 3
"""How a light falls with distance; distant light has none."""


class LightTable(NamedTuple):
    """L lights one behind the other, and ambient light.

    place : (L, 3) position, or the unit direction towards a distant light
    strength : (L, 3) irradiance at a metre, or of distant light, divided by π: eq. 1's light
    falloff, reach : (L,) one of the four; metres
    shines : (L,) whether its highlight is seen; a constellation's light is seen by the rays that reach the map
    ambient : (3,) radiance
    """

    place: np.ndarray
    strength: np.ndarray
    falloff: np.ndarray
    reach: np.ndarray
    shines: np.ndarray
    ambient: np.ndarray


def light_table(scene: Scene, count: int) -> LightTable:
    """The scene's own lights, then `count` lights at most that stand for its environment map (`constellation`)."""
    own = [_row(light) for light in scene.lights if not isinstance(light, AmbientLight)]
    shines = [1.0] * len(own)
    if count and np.any(scene.light.radiance):
        stars = constellation(scene.light, count)
        own += [(*d, *(e / np.pi), DISTANT, 0.0) for d, e in zip(stars.directions, stars.irradiance, strict=True)]
        shines += [0.0] * len(stars.directions)
    table = np.array(own, np.float64).reshape(-1, 8)
    ambient = sum((np.array(light.radiance) for light in scene.lights if isinstance(light, AmbientLight)), np.zeros(3))
    return LightTable(
        table[:, :3].copy(), table[:, 3:6].copy(), table[:, 6].astype(np.int64), table[:, 7].copy(),
        np.array(shines, np.float64), np.asarray(ambient, np.float64),
    )  # fmt: skip


def attenuation_code(attenuation: Attenuation) -> tuple[int, float]:
    """The number of a law of distance and its reach."""
    if isinstance(attenuation, Linear):
        return LINEAR, attenuation.reach
    return (SQUARE if isinstance(attenuation, SquareLaw) else NONE), 0.0


def _row(light: Light) -> Sequence[float]:
    if isinstance(light, DistantLight):
        towards = np.array(light.towards, np.float64)
        return (*(towards / np.linalg.norm(towards)), *(np.array(light.irradiance) / np.pi), DISTANT, 0.0)
    # Lamps that have a size are refused before.
    assert not isinstance(light, AmbientLight | SphereLight | RectangleLight)
    return (*light.position, *(np.array(light.intensity) / np.pi), *attenuation_code(light.falloff))


EYE, REFLECTED, REFRACTED, SHADOW = 0, 1, 2, 3
"""Kinds of rays."""


class Settings(NamedTuple):
    """What the kernel follows a tree by."""

    depth: int
    contribution: float
    attenuation: int
    reach: float
    rays: int
    clear: bool
    background: bool
    first_object: int
    footprint: float
    seed: int


class Record(NamedTuple):
    """The nodes of one sample's tree, for who wants to see it; empty arrays where nobody does.

    ends : (N, 6) where each ray begins and ends, metres
    weight : (N, 3) share of the pixel that the node's intensity has
    sent : (N, 3) what the node itself adds to the pixel, without its children
    parent, kind, shape, light : (N,); a shape of −1 is none, a blocked light's ray ends at its blocker
    inside : (N,) whether the shape is met from within
    limits : (N, 2) the interval of distances in which each ray was traced
    count : (1,) nodes so far
    """

    ends: np.ndarray
    weight: np.ndarray
    sent: np.ndarray
    parent: np.ndarray
    kind: np.ndarray
    shape: np.ndarray
    light: np.ndarray
    inside: np.ndarray
    limits: np.ndarray
    count: np.ndarray


def empty_record(size: int = 0) -> Record:
    """Room for this many nodes of a tree."""
    return Record(
        np.empty((size, 6)), np.empty((size, 3)), np.empty((size, 3)), np.empty(size, np.int64),
        np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size, np.int64), np.zeros(size, np.bool_),
        np.empty((size, 2)),
        np.zeros(1, np.int64),
    )  # fmt: skip


def view_of(camera: Camera) -> np.ndarray:
    """The camera as sixteen numbers: eye, rotation in rows, focal length, principal point.

    Raises UnsupportedScene for a lens that distorts, has an aperture or moves while its rows are read.
    """
    if camera.distortion is not None or camera.aperture > 0 or camera.rolling is not None:
        what = "distorts" if camera.distortion is not None else "has an aperture" if camera.aperture > 0 else "moves"
        raise UnsupportedScene(
            f"Whitted's camera is a pinhole, and this one's lens {what}; use rl.Mitsuba (--renderer mitsuba), or a "
            "camera without"
        )
    point = camera.principal_point
    return np.array([*camera.position, *np.ravel(camera.rotation), camera.focal_length, *point, 0.0], np.float64)
