"""The materials that an object of a shot may have, as balls under the light that was measured there."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.shot import Shot
from relume.project.stages import Stages
from relume.renderers.prefiltered.material_balls import Shown, left_out, material_radiance
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.materials.presets import PRESETS
from relume.sphere.directions import rotation_about
from relume.sphere.environment_map import EnvironmentMap

SIZE = 64
"""Pixels: enough to see materials apart at a glance, and made in seconds."""
LARGEST = 512
Named = tuple[str, dict[str, Any], int | None, Shown]
"""A ball's name, what the shot file says for it, whose own it is, and the material."""


@dataclass(frozen=True, eq=False)
class MaterialBall:
    """A material under the shot's light.

    name : the preset's, or the object's mesh file with what it has
    table : what `objects.material` of the shot file has to be for it
    object : the object whose own material it is, from 0; None for what any object may have
    radiance : (S, S, 3) float32, in the light's unit, as the shot's camera sees a ball
    matte : (S, S) float32, the share of a pixel that the ball covers
    left_out : what of the material the ball does not show, or shows by a stand-in
    """

    name: str
    table: dict[str, Any]
    object: int | None
    radiance: np.ndarray
    matte: np.ndarray
    left_out: tuple[str, ...]


def material_balls(
    shot: Shot,
    light: EnvironmentMap,
    camera: Camera,
    out: str | os.PathLike[str] | None = None,
    *,
    size: int = SIZE,
) -> tuple[MaterialBall, ...]:
    """Balls of the shot's own materials and of all presets under its light, by reflection maps (Miller & Hoffman 1984).

    shot : as `read_shot` or `Shot.new` made it
    light : as it was measured; the shot's `turn`, `heading` and `exposure` are applied to it
    camera : the plate's, whose view the balls are seen from
    out : the shot's folder of results, for the balls to be kept with its stages; nothing is kept unless given
    size : pixels; 64 unless given
    Raises ValueError for a size that is none, RelumeError.
    """
    if not 2 <= size <= LARGEST:
        raise ValueError(f"balls are {size} pixels wide; expected 2 to {LARGEST}")
    turned = np.radians(shot.light.turn + shot.light.heading)
    # Light and eye turn together: into the frame that the light was measured in.
    into = rotation_about([0, 1, 0], -float(turned)) @ camera.rotation
    own = _own(shot)
    presets: list[Named] = [(name, {"preset": name}, None, PRESETS[name]) for name in sorted(PRESETS)]

    def made(found: list[Named]) -> tuple[np.ndarray, np.ndarray]:
        return material_radiance(light, tuple(material for *_, material in found), size, into)

    # Those of the presets are kept: the shot's own change with every edit, and are few.
    if out is None:
        known, matte = made(presets)
    else:
        made_from = [light, size, into, [material for *_, material in presets]]
        (known, matte), _ = Stages(Path(out) / "stages").get("material_balls", made_from, lambda: made(presets))
    radiance = np.concatenate([made(own)[0], known]) * np.float32(2.0**shot.light.exposure)
    return tuple(
        MaterialBall(name, table, number, each, matte, left_out(material))
        for (name, table, number, material), each in zip([*own, *presets], radiance, strict=True)
    )


def _own(shot: Shot) -> list[Named]:
    """What each object's mesh has by itself, and what the shot makes of it where that is no preset alone."""
    found: list[Named] = []
    for number, given in enumerate(shot.objects):
        plain = given.model_copy(update={"material": type(given.material)()})
        table = given.material.model_dump(exclude_none=True)
        name = Path(given.mesh).stem
        found.append((f"{name}, its own", {}, number, _largest(shot, plain)))
        if set(table) - {"preset"}:
            found.append((f"{name}, as in the shot", _plain(table), number, _largest(shot, given)))
    return found


def _largest(shot: Shot, given: Any) -> Shown:
    """The material of an object's mesh with the largest surface, without what a ball has no place for."""
    meshes = placed_meshes(shot.model_copy(update={"objects": [given]}))

    def area(mesh: Any) -> float:
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=-1).sum())

    material = max(meshes, key=area).material
    return material if isinstance(material, Shown) else Material(name=material.name)


def _plain(table: dict[str, Any]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in table.items()}
