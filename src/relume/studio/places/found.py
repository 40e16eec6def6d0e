"""What was found of a place as the page shows it: edges in each photograph, distances of marks, sizes, cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import relume as rl

PIECES = 24
"""Of a straight edge that a lens bends, or of which a part lies behind the camera."""


def found_facts(path: Path) -> dict[str, Any]:
    """What was found, for JSON; raises RelumeError where nothing was, or the blocks have changed since."""
    place = rl.scene.read_place(path)
    distances: dict[str, Any] = {}
    for mark in place.marks:
        of_block = distances.setdefault(mark.photograph, {}).setdefault(mark.block, {})
        of_block[mark.edge] = [round(float(each), 3) for each in mark.distances]
    return {
        "lines": {each.name: _lines(place, each.camera) for each in place.photographs},
        "distances": distances,
        "blocks": {each.name: {"size": each.size.tolist(), "deviation": each.deviation.tolist()}
                   for each in place.blocks},
        "cameras": {each.name: _camera(each) for each in place.photographs},
        "chi_square": place.chi_square, "freedom": place.freedom, "doubts": place.doubts,
    }  # fmt: skip


def _camera(photograph: rl.scene.PlacePhotograph) -> dict[str, Any]:
    camera, deviation = photograph.camera, photograph.deviation
    return {
        "residual": photograph.residual, "focal_length": camera.focal_length,
        "position": camera.position.tolist(), "position_deviation": deviation.position,
        "rotation_deviation": float(np.degrees(deviation.rotation)),
        "focal_length_deviation": deviation.focal_length,
    }  # fmt: skip


def _lines(place: rl.scene.Place, camera: rl.Camera) -> dict[str, Any]:
    """Each block's edges and corners, pixels, where the camera sees them; what it does not see is left out."""
    found: dict[str, Any] = {}
    for block in place.blocks:
        edges = {name: _line(camera, points) for name, points in block.edges.items()}
        corners = {name: _line(camera, point[None]) for name, point in block.corners.items()}
        found[block.name] = {name: line for name, line in (edges | corners).items() if line}
    return found


def _line(camera: rl.Camera, points: np.ndarray) -> list[list[float]]:
    seen = camera.project(points)
    if len(points) == 2 and (camera.distortion is not None or not np.isfinite(seen).all()):
        seen = camera.project(np.linspace(points[0], points[1], PIECES + 1))
    return np.round(seen[np.isfinite(seen).all(-1)], 2).tolist()
