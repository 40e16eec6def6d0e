"""A small light stage on disk: a Lambertian ball under 24 lights, whose pictures under any light are known."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.image.files import write
from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.cameras.camera import Camera

LIGHTS = 24
ALBEDO = np.array([0.7, 0.4, 0.3])
CAMERA = {"position": [0.0, 0.0, 4.0], "look_at": [0.0, 0.0, 0.0], "hfov_deg": 36.0}
SIZE = (32, 24)


@dataclass(frozen=True, eq=False)
class SeparatedPictures:
    """A field whose two parts are known."""

    diffuse: Pictures
    specular: Pictures


def chosen(lights: StageLights, which: np.ndarray) -> StageLights:
    """The lights of these indices, with cells of their own."""
    return StageLights.towards(lights.directions[which], tuple(lights.names[i] for i in which))


def camera(width: int = SIZE[0], height: int = SIZE[1]) -> Camera:
    focal = width / 2 / np.tan(np.radians(CAMERA["hfov_deg"]) / 2)
    return Camera.looking_at(np.array(CAMERA["position"]), np.zeros(3), width=width, height=height, focal_length=focal)


def grid_directions(rows: int, columns: int, first: float = 0.0) -> np.ndarray:
    """Directions (rows · columns, 3): inclination from +Y, azimuth from +Z towards +X and `first` steps on."""
    inclination, azimuth = np.meshgrid(
        np.pi * (np.arange(rows) + 0.5) / rows, 2 * np.pi * (np.arange(columns) + first) / columns, indexing="ij"
    )
    ring = np.sin(inclination)
    return np.stack([ring * np.sin(azimuth), np.cos(inclination), ring * np.cos(azimuth)], axis=-1).reshape(-1, 3)


def normals(view: Camera | None = None, least: float = 0.0) -> np.ndarray:
    """Of the unit ball at the origin, (H, W, 3); 0 beside it.

    view : the camera; the stage's own unless given
    least : what is left of half a chord, squared, below which a pixel is beside it
    """
    view = camera() if view is None else view
    rays = view.rays()
    along = rays @ view.position
    inside = along**2 - view.position @ view.position + 1
    points = view.position + (-along - np.sqrt(np.maximum(inside, 0)))[..., None] * rays
    return np.where((inside > least)[..., None], points, 0.0)


def lit(direction: np.ndarray) -> np.ndarray:
    """The ball under parallel light of irradiance 1, (H, W, 3), with a trace of it everywhere, as lenses leave."""
    return (1e-5 + np.maximum(normals() @ direction, 0)[..., None] * ALBEDO / np.pi).astype(np.float32)


def write_stage(folder: Path, count: int = LIGHTS, **changes: object) -> Path:
    """Write pictures and stage.json, whose keys `changes` replace."""
    folder.mkdir(parents=True, exist_ok=True)
    lights = []
    for index, direction in enumerate(even_directions(count)):
        write(folder / f"light_{index:02d}.exr", RadianceMap(lit(direction)))
        lights.append({"file": f"light_{index:02d}.exr", "direction": direction.tolist()})
    stage = {"lights": lights, "cameras": {"front": CAMERA}} | changes
    (folder / "stage.json").write_text(json.dumps(stage), "utf-8")
    return folder
