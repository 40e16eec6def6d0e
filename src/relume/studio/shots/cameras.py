"""Cameras as a page has them: as JSON and back."""

from __future__ import annotations

from collections.abc import Mapping
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
