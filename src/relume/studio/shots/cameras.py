"""Cameras as a page has them: as JSON and back; the one that sees a chequered board, while that is being described."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl


def camera_facts(camera: rl.Camera) -> dict[str, Any]:
    """A camera for JSON: rotation by rows, world from camera; distortion in OpenCV's coefficients."""
    lens = camera.distortion
    return {
        "size": [camera.width, camera.height], "focal_length": camera.focal_length, "centre": camera.principal_point,
        "position": camera.position.tolist(), "rotation": camera.rotation.tolist(),
        "distortion": None if lens is None else [lens.k1, lens.k2, lens.p1, lens.p2, lens.k3],
    }  # fmt: skip


def camera_of(facts: Mapping[str, Any]) -> rl.Camera:
    """The camera of those facts."""
    lens, (width, height), (x, y) = facts["distortion"], facts["size"], facts["centre"]
    return rl.Camera(
        width=width, height=height, focal_length=facts["focal_length"], centre=(x, y),
        position=np.array(facts["position"]), rotation=np.array(facts["rotation"]),
        distortion=None if lens is None else rl.scene.Distortion(*lens),
    )  # fmt: skip


def board_camera(path: Path, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The camera that sees the board so, for JSON; the board's own surface is the ground.

    asked : squares, the long side first, and the side of one in metres; focal_length in pixels, the EXIF's unless given
    Raises GridNotFound, UnreadableFile, ValueError.
    """
    squares, square, focal_length = asked.get("squares"), asked.get("square"), asked.get("focal_length")
    if (
        not isinstance(squares, list)
        or len(squares) != 2
        or not all(isinstance(n, int) and 3 <= n < 100 for n in squares)
    ):
        raise ValueError("squares are two whole numbers from 3 on, the long side first")
    if not isinstance(square, int | float) or square <= 0:
        raise ValueError("square is the side of one in metres, like 0.03")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        photograph = rl.read_photograph(path)
        found = rl.camera_from_grid(
            photograph, squares=(squares[0], squares[1]), square=float(square), focal_length=focal_length
        )
    return camera_facts(found)
