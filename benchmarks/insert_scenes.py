"""Scenes that several renderers are given alike: the room of examples/room, and how a scene is handed to Cycles."""

from __future__ import annotations

import json
import subprocess
import tempfile
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

import relume as rl
from relume.light.reflection.convolution import as_latlong
from relume.renderers.renderer import ConstantRenderer

ROOM = Path(__file__).parents[1] / "examples/room"
HERE = Path(__file__).parent
REFLECTANCE = (0.331, 0.199, 0.126)


def room(width: int = 384) -> tuple[rl.Scene, rl.Camera]:
    """The measured room: light at infinity, the table of one diffuse reflectance, five objects; `width` pixels wide."""
    scene, camera = _measured()
    share = width / camera.width
    height = round(camera.height * share)
    return scene, replace(camera, width=width, height=height, focal_length=camera.focal_length * share)


@lru_cache(maxsize=1)
def _measured() -> tuple[rl.Scene, rl.Camera]:
    """The same as wide as it was photographed."""
    shot = rl.read_shot(ROOM / "shot.toml")
    # The mean that the recovery finds under light at infinity; the fake renderer lights nothing to find it by.
    table = shot.local[0].model_copy(update={"reflectance": REFLECTANCE, "gloss": False})
    shot = shot.model_copy(update={"local": [table]})
    with tempfile.TemporaryDirectory() as folder:
        done = rl.insert(shot, folder, renderer=ConstantRenderer())
    plane = rl.Plane(rl.Diffuse(REFLECTANCE), (1.7, 1.0))
    objects = tuple(mesh for one in sorted((ROOM / "objects").glob("*.glb")) for mesh in rl.read_meshes(one))
    return rl.Scene(done.calibrated.probe.light, (plane,), objects), done.camera


def pack(scene: rl.Scene, camera: rl.Camera, path: Path) -> None:
    """Everything of a scene in one file of arrays, for a Python without relume."""
    arrays: dict[str, Any] = {
        "light": as_latlong(scene.light).radiance.astype(np.float32),
        "camera.position": np.asarray(camera.position, np.float64),
        "camera.rotation": np.asarray(camera.rotation, np.float64),
    }
    surfaces = []
    for index, shape in enumerate((*scene.local, *scene.objects)):
        key = f"s{index}"
        mesh = _quadrangle(shape) if isinstance(shape, rl.Plane) else shape
        assert isinstance(mesh, rl.Mesh), "Cycles has no exact spheres; give meshes"
        arrays |= {f"{key}.vertices": mesh.vertices.astype(np.float64), f"{key}.faces": mesh.faces}
        for part in ("normals", "uv"):
            if getattr(mesh, part) is not None:
                arrays[f"{key}.{part}"] = getattr(mesh, part)
        table = _material(mesh.material)
        colour = "reflectance" if "reflectance" in table else "base_color"
        if isinstance(table.get(colour), np.ndarray):
            arrays[f"{key}.image"], table[colour] = table[colour], None
        surfaces.append({"key": key, "name": mesh.name, "object": index >= len(scene.local), "material": table})
    lights = [{k: v for k, v in vars(light).items() if isinstance(v, tuple | float)} for light in scene.lights]
    table = {"width": camera.width, "height": camera.height, "focal_length": camera.focal_length}
    arrays["tables"] = np.array(json.dumps({"camera": table, "surfaces": surfaces, "lights": lights}))
    np.savez(path, **arrays)


def _material(material: Any) -> dict[str, Any]:
    if isinstance(material, rl.Diffuse):
        return {"reflectance": tuple(map(float, material.reflectance))}
    if material.emits:
        return {"emission": tuple(map(float, material.emission))}
    colour = material.base_color
    return {
        "base_color": colour if isinstance(colour, np.ndarray) else tuple(map(float, colour)),
        "metallic": float(material.metallic), "roughness": float(material.roughness),
        "transmission": float(material.transmission), "ior": float(material.ior),
    }  # fmt: skip


def _quadrangle(plane: rl.Plane) -> rl.Mesh:
    x, z = np.array(plane.extent) / 2
    corners = np.array([[-x, plane.height, z], [x, plane.height, z], [x, plane.height, -z], [-x, plane.height, -z]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return rl.Mesh(corners.astype(np.float32), faces, plane.material, uv=uv, name="plane")


@dataclass(frozen=True)
class Cycles:
    """Blender's renderer.

    python : the interpreter of an environment that has bpy
    processors : whether seconds are those of the processors, which other work beside it changes little
    """

    python: str
    processors: bool = False

    def pictures(
        self, scene: rl.Scene, camera: rl.Camera, jobs: list[dict[str, Any]]
    ) -> dict[str, tuple[dict[str, np.ndarray], float]]:
        """The layers of each job (see insert_cycles.py) and its seconds, by name."""
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            pack(scene, camera, folder / "scene.npz")
            (folder / "jobs.json").write_text(json.dumps(jobs))
            run = [self.python, str(HERE / "insert_cycles.py"), str(folder)]
            done = subprocess.run(run, capture_output=True, text=True)
            if done.returncode or not (folder / "seconds.json").is_file():
                raise SystemExit(f"Cycles did not run:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
            seconds = json.loads((folder / "seconds.json").read_text())
            return {name: (_layers(folder / f"{name}.exr"), times[self.processors]) for name, times in seconds.items()}


def _layers(path: Path) -> dict[str, np.ndarray]:
    """(H, W, n) float64 of each layer, by its name without the view layer's."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        planes = {
            name: channel.pixels.astype(np.float64) for part in file.parts for name, channel in part.channels.items()
        }
    layers: dict[str, list[tuple[int, np.ndarray]]] = {}
    for name, plane in planes.items():
        pieces = name.split(".")
        layers.setdefault(pieces[-2], []).append(("RGBAXYZV".index(pieces[-1]), plane))
    return {
        name: np.stack([p for _, p in sorted(parts, key=lambda item: item[0])], -1) for name, parts in layers.items()
    }
