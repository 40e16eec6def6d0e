"""Cameras that other programs wrote: glTF, USD, Blender by way of a script, fSpy; and those of modelled places."""

from __future__ import annotations

import json
from pathlib import Path

from relume.errors import UnreadableFile
from relume.scene.cameras.blender import read_blender_camera
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fspy import read_fspy
from relume.scene.cameras.pose import UpAxis, require_aspect, the_only
from relume.scene.cameras.usd import read_usd_camera
from relume.scene.gltf.camera import read_gltf_camera
from relume.scene.places.reading import read_place

KINDS = ".glb, .gltf, .usd, .usda, .usdc, .usdz, .fspy, .json or .toml (a place)"


def read_camera(
    path: str | Path,
    width: int,
    height: int,
    *,
    name: str | None = None,
    up: UpAxis | None = None,
    unit: float | None = None,
    time: float | None = None,
) -> Camera:
    """Read a camera from a file of another program, by its suffix, for a picture of width × height pixels.

    .glb, .gltf : a perspective camera of glTF; .usd, .usda, .usdc, .usdz : of USD; .fspy : an fSpy project;
    .json : fSpy's exported parameters, or what `blender_camera_script` writes in Blender; .toml : a place file that
    `model_place` has solved, of the photograph's size or of the same picture in another one
    name : of the camera, where a file of several kinds can hold more than one (glTF, USD); of the place's photograph
    up : the axis of the file's frame that points up, "y" or "z"; what the format or the file says unless given
    unit : metres to a unit of the file; what the format or the file says unless given
    time : seconds since the file's motion began, for a camera that moves in it (glTF, USD, Blender); before the first
        key and after the last it rests. Unless given the camera stands where the file has it at rest
    Raises UnreadableFile for a file that cannot be used.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in (".glb", ".gltf"):
        return read_gltf_camera(path, width, height, name, up, unit, time)
    if suffix in (".usda", ".usd", ".usdc", ".usdz"):
        return read_usd_camera(path, width, height, name, up, unit, time)
    if suffix == ".toml":
        return _of_place(path, (width, height), name, up, unit)
    if suffix not in (".fspy", ".json"):
        kind = f"of kind {suffix}" if suffix else "without a suffix"
        raise UnreadableFile(f"{path}: no camera is read from files {kind}; use {KINDS}")
    if name is not None:
        raise UnreadableFile(f"{path}: holds one camera only; leave the name {name!r} out")
    if suffix == ".json" and not _is_fspy(path):
        return read_blender_camera(path, width, height, up, unit, time)
    return read_fspy(path, width, height, up=up, unit=unit)


def _of_place(path: Path, size: tuple[int, int], name: str | None, up: UpAxis | None, unit: float | None) -> Camera:
    """The camera of one of a place's photographs."""
    if up is not None or unit is not None:
        raise UnreadableFile(f"{path}: a place is in metres, +Y up; leave up and unit out")
    photographs = read_place(path).photographs
    chosen = [each for each in photographs if name in (None, each.name)]
    camera = the_only(path, chosen or photographs, name if chosen else None, (p.name for p in photographs)).camera
    require_aspect(path, size, (camera.width, camera.height))
    return camera.resized(*size)


def _is_fspy(path: Path) -> bool:
    """Whether a JSON file has what fSpy exports; the readers say what is wrong with one that has not."""
    try:
        found = json.loads(path.read_bytes())
    except (OSError, RecursionError, ValueError):
        return False
    return isinstance(found, dict) and ("cameraTransform" in found or "cameraParameters" in found)
