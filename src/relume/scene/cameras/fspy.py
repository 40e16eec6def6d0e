"""The camera of an fSpy project, or of the camera parameters that fSpy exports as JSON."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import FormatError, UnreadableFile, warn
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose import WORLD_FROM, UpAxis, pose, require_aspect

UNITS = {
    "Millimeters": 0.001,
    "Centimeters": 0.01,
    "Meters": 1.0,
    "Kilometers": 1000.0,
    "Inches": 0.0254,
    "Feet": 0.3048,
    "Miles": 1609.344,
}
"""Metres to fSpy's units of the reference distance; the international inch, foot and mile."""
HEADER = struct.Struct("<4sIII")
"""fSpy's project file, version 1: "fspy", version, bytes of JSON, bytes of the picture; then both."""


def read_fspy(
    path: str | Path, width: int, height: int, *, up: UpAxis | None = None, unit: float | None = None
) -> Camera:
    """Read the camera of an fSpy project (.fspy) or of its exported parameters (.json).

    width, height : of the picture it was made from, or of the same picture in another size
    up : the axis that was assigned to what stands upright; "z" unless given, which fSpy and Blender begin with
    unit : metres to a unit; from the project's reference distance unless given
    Raises UnreadableFile for another kind of file, a project that fSpy could not solve, or one of another picture.
    """
    path = Path(path)
    state = _state(path)
    parameters = state.get("cameraParameters", state if "cameraTransform" in state else None)
    if not isinstance(parameters, dict):
        raise UnreadableFile(f"{path}: fSpy has not solved this project; draw its lines until it shows a camera")
    try:
        field = float(parameters["horizontalFieldOfView"])
        principal = parameters["principalPoint"]
        across, upward = float(principal["x"]), float(principal["y"])
        made_for = float(parameters["imageWidth"]), float(parameters["imageHeight"])
        rows = parameters["cameraTransform"]["rows"]
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: no camera of fSpy's ({error}); save it again with fSpy 1") from None
    if not 0 < field < np.pi or not np.isfinite([across, upward]).all():
        raise UnreadableFile(f"{path}: a field of view of {field} radians; expected between 0 and π: solve it again")
    require_aspect(path, (width, height), made_for)
    axis = up or "z"
    position, rotation = pose(path, rows, axis, unit or _unit(path, state))
    _warn_of_tilt(path, rotation, axis)
    # fSpy's image plane reaches from −1 to 1 along the picture's longer side, y up.
    half = max(width, height) / 2
    centre = (width / 2 + across * half, height / 2 - upward * half)
    shifted = abs(across) + abs(upward) > 1e-9
    focal_length = width / 2 / np.tan(field / 2)
    return Camera(width, height, float(focal_length), position, rotation, centre if shifted else None)


def _state(path: Path) -> dict[str, Any]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    if path.suffix.lower() != ".json":
        if len(data) < HEADER.size or data[:4] != b"fspy":
            raise UnreadableFile(f"{path}: not an fSpy project; save one with fSpy, or export its parameters as .json")
        _, version, length, _ = HEADER.unpack_from(data)
        if version != 1:
            raise UnreadableFile(f"{path}: an fSpy project of version {version}; only 1 is read: export its parameters")
        if len(data) < HEADER.size + length:
            raise FormatError(path, "fSpy project", "its JSON", f"{length} bytes", f"{len(data) - HEADER.size}")
        data = data[HEADER.size : HEADER.size + length]
    try:
        state = json.loads(data)
    except (RecursionError, ValueError) as error:
        raise UnreadableFile(f"{path}: not valid JSON ({error}); save it again with fSpy") from None
    if not isinstance(state, dict):
        raise UnreadableFile(f"{path}: no camera of fSpy's; export fSpy's camera parameters")
    return state


def _unit(path: Path, state: dict[str, Any]) -> float:
    settings = state.get("calibrationSettingsBase")
    settings = settings if isinstance(settings, dict) else {}
    name = str(settings.get("referenceDistanceUnit", ""))
    if settings.get("referenceDistanceAxis") and name in UNITS:
        return UNITS[name]
    warn(
        f"{path}: holds no reference distance in a unit of length; its units are taken as metres: give one in fSpy "
        "and use the project itself, or give unit"
    )
    return 1.0


def _warn_of_tilt(path: Path, rotation: np.ndarray, axis: UpAxis) -> None:
    """Warn where the other axis stands more nearly upright in the photograph: the world would lie on its side."""
    other: UpAxis = "y" if axis == "z" else "z"
    # The camera's up in the file's frame.
    up = WORLD_FROM[axis].T @ rotation[:, 1]
    if up["xyz".index(other)] > up["xyz".index(axis)]:
        warn(
            f"{path}: its {other.upper()} axis is more upright in the photograph than its {axis.upper()}; "
            f'give up = "{other}" if that is the one that points up'
        )
