"""A camera and a projector that keep their places to each other, as a file."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.image import files
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion


@dataclass(frozen=True, eq=False)
class ScannerRig:
    """A camera and a projector, which is a camera that shows its picture; metres, one frame.

    camera, projector : with their lenses and places
    residual : root mean square of the board's corners about what the rig explains, in camera and projector pixels;
        None for a rig that was given
    focal_deviation : relative standard deviation of both focal lengths, by the corners' scatter: that of a subject's
        distance is about the same; None where it is not known
    """

    camera: Camera
    projector: Camera
    residual: tuple[float, float] | None = None
    focal_deviation: tuple[float, float] | None = None

    def facts(self) -> dict[str, object]:
        """What a user should know of a calibrated rig; nothing of one that was given."""
        facts: dict[str, object] = {}
        if self.residual is not None:
            facts["rig's residual, camera and projector, pixels"] = [float(f"{each:.2g}") for each in self.residual]
        if self.focal_deviation is not None:
            known = [float(f"{100 * each:.2g}") for each in self.focal_deviation]
            facts["focal lengths, and so the distance, known within, %"] = known
        return facts

    def placed(self, camera: Camera) -> ScannerRig:
        """The same rig in the frame in which its camera stands as `camera` does; the lens stays the rig's own."""
        turn = camera.rotation @ self.camera.rotation.T
        moved = camera.position + turn @ (self.projector.position - self.camera.position)
        return replace(
            self,
            camera=replace(self.camera, position=np.asarray(camera.position, np.float64), rotation=camera.rotation),
            projector=replace(self.projector, position=moved, rotation=turn @ self.projector.rotation),
        )


def write_rig(path: str | os.PathLike[str], rig: ScannerRig) -> None:
    """Write a rig as JSON, whole or not at all.

    path : .json
    rig : as `calibrate_rig` found it
    Raises OutputNotWritten.
    """
    table = {
        "camera": _table(rig.camera), "projector": _table(rig.projector), "residual": rig.residual,
        "focal_deviation": rig.focal_deviation,
    }  # fmt: skip
    files.write_text(path, json.dumps(table, indent=1) + "\n")


def read_rig(path: str | os.PathLike[str]) -> ScannerRig:
    """The rig in a file that `write_rig` wrote.

    path : .json
    Raises UnreadableFile.
    """
    try:
        table = json.loads(Path(path).read_text("utf-8"))
        return ScannerRig(
            _camera(table["camera"]),
            _camera(table["projector"]),
            _pair(table.get("residual")),
            _pair(table.get("focal_deviation")),
        )
    except FileNotFoundError:
        raise UnreadableFile(
            f"{path}: no such file; give the rig's file, or photographs of a board to calibrate it with"
        ) from None
    except KeyError as error:
        raise UnreadableFile(f"{path}: the key {error} is missing; `relume stage scan --boards` writes it") from None
    except (OSError, AttributeError, IndexError, TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: not a rig ({error}); `relume stage scan --boards` writes one") from None


def _pair(values: Any) -> tuple[float, float] | None:
    return None if values is None else (float(values[0]), float(values[1]))


def _table(camera: Camera) -> dict[str, Any]:
    table: dict[str, Any] = {
        "size": [camera.width, camera.height],
        "focal_length": float(camera.focal_length),
        "position": np.asarray(camera.position, np.float64).tolist(),
        "rotation": np.asarray(camera.rotation, np.float64).tolist(),
        "centre": [float(value) for value in camera.principal_point],
    }
    if camera.distortion is not None:
        table["distortion"] = asdict(camera.distortion)
    return table


def _camera(table: dict[str, Any]) -> Camera:
    rotation, position = np.array(table["rotation"], np.float64), np.array(table["position"], np.float64)
    if rotation.shape != (3, 3) or position.shape != (3,) or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6:
        raise ValueError("a position is three numbers, and a rotation three rows at right angles")
    width, height = (int(value) for value in table["size"])
    across, down = (float(value) for value in table["centre"])
    lens = Distortion(**table["distortion"]) if table.get("distortion") else None
    return Camera(width, height, float(table["focal_length"]), position, rotation, (across, down), lens)
