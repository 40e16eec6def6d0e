"""A camera of a USD file in text form (.usda)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose import UpAxis, pose, warn_of_aspect
from relume.scene.cameras.usda import Prim, read_usda
from relume.scene.gltf.camera import rotation_from_quaternion
from relume.sphere.directions import rotation_about

CENTIMETRE = 0.01
"""USD's unit where a file says nothing."""
FALLBACKS = {
    "focalLength": 50.0,
    "horizontalAperture": 20.955,
    "verticalAperture": 15.2908,
    "horizontalApertureOffset": 0.0,
    "verticalApertureOffset": 0.0,
    "fStop": 0.0,
    "focusDistance": 0.0,
}
"""UsdGeomCamera's own values for what a file leaves out."""
RESET = "!resetXformStack!"
INVERT = "!invert!"


def read_usd_camera(
    path: str | Path,
    width: int,
    height: int,
    *,
    name: str | None = None,
    up: UpAxis | None = None,
    unit: float | None = None,
) -> Camera:
    """Read a perspective camera of a .usda file; its horizontal field of view is that of the picture.

    name : of the camera's prim; not needed where there is one only
    up, unit : what points up, and metres to a unit; the file's own upAxis and metersPerUnit unless given
    A camera that moves is taken where it first is, with a warning; references and variants are not followed.
    Raises UnreadableFile for another form of USD, or where there is no such camera or several to choose from.
    """
    path = Path(path)
    layer = read_usda(path, _text(path))
    found = _cameras(layer, ())
    names = [chain[-1].name for chain in found]
    chosen = [chain for chain in found if name in (None, chain[-1].name)]
    if not found:
        raise UnreadableFile(f"{path}: holds no camera; export it with its cameras, without references")
    if len(chosen) != 1:
        fault = "holds" if name is None else f"{len(chosen)} of its cameras are named {name!r}; it holds"
        raise UnreadableFile(f"{path}: {fault} {', '.join(map(repr, names))}; give the name of one")
    taken = _Values(path)
    chain = chosen[0]
    lens = {key: taken.number(chain[-1], key, fallback) for key, fallback in FALLBACKS.items()}
    if chain[-1].attributes.get("projection", "perspective") != "perspective":
        raise UnreadableFile(f"{path}: camera {chain[-1].name!r} is not perspective; export a perspective camera")
    focal, across, down = lens["focalLength"], lens["horizontalAperture"], lens["verticalAperture"]
    if not (focal > 0 and across > 0 and down > 0):
        raise UnreadableFile(f"{path}: a lens of {focal} on a sensor of {across}×{down}; expected numbers above 0")
    warn_of_aspect(path, (width, height), across / down, "its horizontal field of view")
    metres = unit or float(layer.metadata.get("metersPerUnit", CENTIMETRE))
    axis = up or ("z" if str(layer.metadata.get("upAxis", "Y")).upper() == "Z" else "y")
    matrix = np.eye(4)
    for prim in chain:
        own, reset = taken.matrix(prim)
        matrix = own if reset else matrix @ own
    position, rotation = pose(path, matrix, axis, metres)
    pixels = width / across
    shifts = lens["horizontalApertureOffset"], lens["verticalApertureOffset"]
    centre = (width / 2 - shifts[0] * pixels, height / 2 + shifts[1] * pixels)
    # Lens and sensor are in tenths of a unit, the distance in focus in units.
    aperture = focal / 10 * metres / (2 * lens["fStop"]) if lens["fStop"] > 0 else 0.0
    focus = lens["focusDistance"] * metres if lens["focusDistance"] > 0 else np.inf
    return Camera(
        width, height, focal * pixels, position, rotation,
        centre if any(shifts) else None, aperture=aperture if np.isfinite(focus) else 0.0, focus=focus,
    )  # fmt: skip


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    if data[:8] == b"PXR-USDC" or data[:2] == b"PK":
        raise UnreadableFile(f"{path}: is not USD's text form; convert it with: usdcat {path.name} -o camera.usda")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        raise UnreadableFile(f"{path}: is not text; convert it with: usdcat {path.name} -o camera.usda") from None


def _cameras(prim: Prim, above: tuple[Prim, ...]) -> list[tuple[Prim, ...]]:
    """Every camera with the prims that it lies in, outermost first."""
    chain = (*above, prim)
    own = [chain] if prim.kind == "Camera" else []
    return own + [found for child in prim.children for found in _cameras(child, chain)]


@dataclass(frozen=True)
class _Values:
    """Attributes of a file's prims, at their first time where they have several."""

    path: Path

    def of(self, prim: Prim, name: str) -> Any:
        if name in prim.attributes:
            return prim.attributes[name]
        samples = prim.attributes.get(f"{name}.timeSamples")
        if not isinstance(samples, dict) or not samples:
            return None
        times = sorted(time for time in samples if isinstance(time, float))
        if len(times) > 1:
            warnings.warn(
                f"{self.path}: {prim.name}'s {name} changes with time; it is taken where it is at {times[0]:g}",
                stacklevel=4,
            )
        return samples[times[0]] if times else None

    def number(self, prim: Prim, name: str, fallback: float) -> float:
        value = self.of(prim, name)
        if value is None:
            return fallback
        if not isinstance(value, float) or not np.isfinite(value):
            raise UnreadableFile(f"{self.path}: {prim.name}'s {name} is {value!r}; expected a number")
        return value

    def matrix(self, prim: Prim) -> tuple[np.ndarray, bool]:
        """A prim's matrix of column vectors in the prim above it, and whether it leaves out all that is above."""
        total, reset = np.eye(4), False
        order = self.of(prim, "xformOpOrder") or []
        for name in order if isinstance(order, list) else [order]:
            if name == RESET:
                total, reset = np.eye(4), True
                continue
            plain = str(name).removeprefix(INVERT)
            value = self.of(prim, plain)
            kind = plain.removeprefix("xformOp:").split(":")[0]
            try:
                step = _operation(kind, value)
                total = total @ (np.linalg.inv(step) if str(name).startswith(INVERT) else step)
            except (KeyError, TypeError, ValueError, np.linalg.LinAlgError):
                raise UnreadableFile(
                    f"{self.path}: {prim.name}'s {plain} is {value!r}, which places nothing; export it as one matrix"
                ) from None
        return total, reset


def _operation(kind: str, value: Any) -> np.ndarray:
    """The matrix of one xformOp; angles are degrees. Raises KeyError, TypeError or ValueError for none that is one."""
    numbers = np.array(value, np.float64)
    matrix = np.eye(4)
    if kind == "transform":
        # USD multiplies row vectors.
        return numbers.reshape(4, 4).T
    if kind == "translate":
        matrix[:3, 3] = numbers.reshape(3)
    elif kind == "scale":
        matrix[:3, :3] = np.diag(numbers.reshape(3))
    elif kind == "orient":
        matrix[:3, :3] = rotation_from_quaternion(*numbers.reshape(4))
    elif kind.startswith("rotate"):
        axes = kind.removeprefix("rotate")
        if not axes:
            raise KeyError(kind)
        # rotateXYZ turns about x first; its numbers are named x, y, z whatever the order.
        for axis in axes:
            index = "XYZ".index(axis)
            angle = float(numbers) if len(axes) == 1 else float(numbers.reshape(3)[index])
            matrix[:3, :3] = rotation_about(np.eye(3)[index], np.radians(angle)) @ matrix[:3, :3]
    else:
        raise KeyError(kind)
    return matrix
