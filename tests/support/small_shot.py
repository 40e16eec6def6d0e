"""A shot of 192 × 128 pixels that renders in seconds: a plate, a light and a camera that are given, and a ball."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

import relume as rl

TEXT = """\
# a small shot
[plate]
photographs = ["plate.exr"]

[camera]
pose = { position = [0.1, 0.5, 1.0], look_at = [0.0, 0.0, 0.0] }   # by tape measure
focal_length = 200

[light]
map = "light.exr"
scale = 1.0

[[local]]
shape = "plane"
size = [1.0, 0.8]
reflectance = [0.3, 0.3, 0.3]

[[objects]]   # a ball
mesh = "objects/ball.glb"

[match]
grain = false
sharpness = false

[render]
samples = 8
preview = false
"""


def write_small_shot(folder: Path) -> Path:
    """Write the shot and all that it names into a folder; returns the shot file."""
    (folder / "objects").mkdir(parents=True, exist_ok=True)
    y, x = np.mgrid[:128, :192]
    checks = 1 + 0.1 * ((x // 8 + y // 8) % 2)[..., None]
    rl.write(folder / "plate.exr", rl.RadianceMap((0.3 * checks * [1, 0.9, 0.8]).astype(np.float32)))
    light = np.full((32, 64, 3), 0.3, np.float32)
    light[4:8, 20:24] = 40
    rl.write(folder / "light.exr", rl.as_radiance_map(rl.EnvironmentMap(light)))
    ball = trimesh.creation.icosphere(2, 0.05).apply_translation([0, 0.05, 0])
    (folder / "objects" / "ball.glb").write_bytes(bytes(ball.export(file_type="glb")))
    (folder / "shot.toml").write_text(TEXT, encoding="utf-8")
    return folder / "shot.toml"


def camera() -> rl.Camera:
    """The shot's camera."""
    return rl.Camera.looking_at(np.array([0.1, 0.5, 1.0]), np.zeros(3), width=192, height=128, focal_length=200)
