"""Scene files and shot files written for a test: read back, or refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from relume.errors import InvalidScene
from relume.project.scene_file.scene_file import SceneFile, read_scene
from relume.project.shot_file.shot import Shot, read_shot

SHOT_HEAD = """
[plate]
photographs = "plate.exr"
[camera]
pose = { position = [0, 1, 3], look_at = [0, 0, 0] }
focal_length = 100
[light]
map = "light.exr"
"""
"""How a small shot begins: a plate, a camera a metre up that looks at the origin, and a map."""
SCENE_CAMERA = """
[camera]
position = [0, 1, 4]
target = [0, 0.5, 0]
"""
"""The camera of small scenes, which looks at `SCENE_BALL`."""
SCENE_BALL = """
[[objects]]
sphere = { centre = [0, 0.5, 0], radius = 0.5 }
material = "ball"
"""
FAR_CAMERA = """
[camera]
position = [0, 0, 6]
target = [0, 0, 0]
field_of_view = 40
size = [40, 30]
"""
"""The camera of small scenes with something of 1 m about the origin."""


def scene_of(folder: Path, text: str) -> SceneFile:
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return read_scene(folder / "scene.toml")


def refusal(folder: Path, text: str) -> str:
    """The line that refuses a scene file, after the file's name."""
    with pytest.raises(InvalidScene) as caught:
        scene_of(folder, text)
    line = str(caught.value)
    assert "\n" not in line and line.startswith(f"{folder / 'scene.toml'}: ")
    return line.removeprefix(f"{folder / 'scene.toml'}: ")


def shot_of(folder: Path, text: str) -> Shot:
    (folder / "shot.toml").write_text(text, encoding="utf-8")
    return read_shot(folder / "shot.toml")
