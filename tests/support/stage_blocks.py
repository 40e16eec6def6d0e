"""Stages for the tests of blocks: a ball under many lights, and fields of which a part cannot be read."""

from __future__ import annotations

import os
import secrets
import signal
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.lightstage.field.field import Derived, Noise, Pictures, ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh
from relume.sphere.environment_map import EnvironmentMap
from small_stages import normals

SIZE = (96, 40)
"""Rows and columns."""


def camera() -> Camera:
    rows, columns = SIZE
    return Camera.looking_at(np.array([0, 0, 4.0]), np.zeros(3), width=columns, height=rows, focal_length=66.0)


def ball(count: int, noise: Noise | None = Noise(1e-6, 1e-4)) -> Pictures:
    """A ball of coloured paint with highlights, a mirror's spikes on some of its pixels, under lights all around."""
    directions = even_directions(count)
    normal = normals(camera())
    shown = normal.any(axis=-1, keepdims=True)
    cosines = np.maximum(np.einsum("nk,yxk->nyx", directions, normal), 0)
    values = cosines[..., None] * np.array([0.2, 0.12, 0.05]) + 0.4 * cosines[..., None] ** 60
    values[:, 40:44, 10:30] = 30 * cosines[:, 40:44, 10:30, None] ** 4000
    values += np.random.default_rng(3).random(values.shape) * 1e-3 * shown
    return Pictures(values.astype(np.float32), StageLights.towards(directions), camera(), noise)


def mesh() -> Mesh:
    """Of the ball."""
    import trimesh

    made = trimesh.creation.icosphere(4)
    return Mesh(np.asarray(made.vertices, np.float32), np.asarray(made.faces, np.int32), Diffuse(np.full(3, 0.5)))


def light(seed: int = 0) -> EnvironmentMap:
    return EnvironmentMap(np.random.default_rng(seed).random((16, 32, 3), np.float32) ** 4)


@dataclass(frozen=True, eq=False)
class Failing(Derived):
    """A field of which some of the lights, or of the rows, cannot be read."""

    field: ReflectanceField
    lights_lost: range = range(0)
    rows_lost: range = range(0)

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        if overlap(lights, self.lights_lost) or overlap(rows, self.rows_lost):
            raise ValueError("this part of the disk is lost; mend it")
        return self.field.block(lights, rows)


@dataclass(frozen=True, eq=False)
class Killing(Derived):
    """A field that kills the worker that reads some of its lights for the first time, as kill -9 does."""

    field: ReflectanceField
    lights_deadly: range
    folder: Path

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        (self.folder / f"{lights.start}.{os.getpid()}").touch()
        if overlap(lights, self.lights_deadly) and len(list(self.folder.glob(f"{lights.start}.*"))) == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        return self.field.block(lights, rows)


@dataclass(frozen=True, eq=False)
class Counted(Derived):
    """A field that leaves a file in a folder, by (lights, rows), for every part that is asked for, in any process."""

    field: ReflectanceField
    folder: Path

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        name = f"{lights.start}-{lights.stop}.{rows.start}-{rows.stop}.{os.getpid()}.{secrets.token_hex(4)}"
        (self.folder / name).touch()
        return self.field.block(lights, rows)

    def times(self) -> np.ndarray:
        """How often each light's row was asked for, (N, H)."""
        count = np.zeros((len(self.lights), self.shape[0]), int)
        for path in self.folder.iterdir():
            lights, rows = (slice(*map(int, part.split("-"))) for part in path.name.split(".")[:2])
            count[lights, rows] += 1
        return count


def overlap(first: slice, second: range) -> bool:
    return first.start < second.stop and second.start < first.stop
