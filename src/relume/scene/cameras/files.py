"""Cameras that other programs wrote: glTF, USD, Blender by a script, fSpy, Nuke; and those of modelled places."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from relume.errors import UnreadableFile
from relume.scene.cameras.blender import blender_span, read_blender_camera
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fspy import read_fspy
from relume.scene.cameras.nuke_chan import read_chan, read_chan_camera
from relume.scene.cameras.numbered_place import camera_at_frame, numbered_cameras
from relume.scene.cameras.pose import UpAxis, require_aspect, the_only
from relume.scene.cameras.usd import read_usd_camera, usd_span
from relume.scene.gltf.animation import read_animation
from relume.scene.gltf.camera import read_gltf_camera
from relume.scene.places.reading import read_place

KINDS = ".glb, .gltf, .usd, .usda, .usdc, .usdz, .chan, .fspy, .json or .toml (a place)"
NUMBERED = (".chan", ".toml")
"""Suffixes of files whose cameras go by the numbers of frames, and not by seconds."""


def read_camera(
    path: str | Path,
    width: int,
    height: int,
    *,
    name: str | None = None,
    up: UpAxis | None = None,
    unit: float | None = None,
    time: float | None = None,
    frame: float | None = None,
    focal_length: float | None = None,
) -> Camera:
    """Read a camera from a file of another program, by its suffix, for a picture of width × height pixels.

    path : .glb or .gltf with a perspective camera, USD, .fspy or fSpy's .json, camera.json of `blender_camera_script`,
        .chan of Nuke; or a place file, .toml, that `model_place` has solved or that names photogrammetry (COLMAP). Its
        camera is that of the photograph's size, or of the same picture in another one
    width, height : of the picture, pixels
    name : of the camera, where a file of several kinds can hold more than one (glTF, USD); of the place's photograph
    up : the axis of the file's frame that points up, "y" or "z"; what the format or the file says unless given
    unit : metres to a unit of the file; what the format or the file says unless given
    time : seconds since the file's motion began, for a camera that moves in it (glTF, USD, Blender); before the first
        key and after the last it rests. Unless given the camera stands where the file has it at rest
    frame : of the numbers that a .chan file gives its lines, or that the names of a place's photographs end with; not
        needed where there is one
    focal_length : pixels, for a .chan file that has no field of view
    Raises UnreadableFile for a file that cannot be used, and for a time, frame or focal length that it has no use for.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    # Files whose cameras go by frames.
    if suffix in NUMBERED and time is not None:
        raise UnreadableFile(f"{path}: its cameras go by frames; leave time out")
    if suffix == ".chan":
        if name is not None:
            raise UnreadableFile(f"{path}: holds one camera; leave the name {name!r} out")
        return read_chan_camera(path, width, height, up, unit, frame, focal_length)
    if focal_length is not None or (frame is not None and suffix not in NUMBERED):
        what = "focal length" if focal_length is not None else "frame"
        raise UnreadableFile(f"{path}: files of this kind are not asked for a {what}; leave it out")
    # Files that may hold several cameras.
    if suffix in (".glb", ".gltf"):
        return read_gltf_camera(path, width, height, name, up, unit, time)
    if suffix in (".usda", ".usd", ".usdc", ".usdz"):
        return read_usd_camera(path, width, height, name, up, unit, time)
    if suffix == ".toml":
        return _of_place(path, (width, height), name, up, unit, frame)
    # Files that hold one.
    if suffix not in (".fspy", ".json"):
        kind = f"of kind {suffix}" if suffix else "without a suffix"
        raise UnreadableFile(f"{path}: no camera is read from files {kind}; use {KINDS}")
    if name is not None:
        raise UnreadableFile(f"{path}: holds one camera only; leave the name {name!r} out")
    if suffix == ".json" and not _is_fspy(path):
        return read_blender_camera(path, width, height, up, unit, time)
    return read_fspy(path, width, height, up=up, unit=unit)


def motion_span(path: str | Path, name: str | None = None) -> tuple[float, float] | None:
    """When the motion of a file's camera begins and ends; None where nothing in it moves.

    Frames of a .chan file and of a place's photographs, by their numbers; of other files seconds, as
    `read_camera(time=…)` counts them.
    Raises UnreadableFile.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".chan":
        frames = read_chan(path).frames
        return float(frames[0]), float(frames[-1])
    if suffix == ".toml":
        numbers = list(numbered_cameras(path, read_place(path).photographs))
        return float(numbers[0]), float(numbers[-1])
    if suffix in (".glb", ".gltf"):
        animation = read_animation(path)
        times = [] if animation is None else [track.times for node in animation.nodes for track in node.tracks.values()]
        return (0.0, float(max(each[-1] for each in times))) if times else None
    if suffix in (".usda", ".usd", ".usdc", ".usdz"):
        return usd_span(path, name)
    if suffix == ".json" and not _is_fspy(path):
        return blender_span(path)
    return None


def require_frames(path: str | Path, frames: Iterable[float]) -> None:
    """Raises UnreadableFile for the first of these frames at which a .chan file or a place has no camera.

    Other files have one at any time.
    """
    path = Path(path)
    if path.suffix.lower() == ".chan":
        chan = read_chan(path)
        for frame in frames:
            chan.require(frame)
    elif path.suffix.lower() == ".toml":
        cameras = numbered_cameras(path, read_place(path).photographs)
        for frame in frames:
            camera_at_frame(path, cameras, frame)


def _of_place(
    path: Path, size: tuple[int, int], name: str | None, up: UpAxis | None, unit: float | None, frame: float | None
) -> Camera:
    """The camera of one of a place's photographs."""
    if up is not None or unit is not None:
        raise UnreadableFile(f"{path}: a place is in metres, +Y up; leave up and unit out")
    photographs = read_place(path).photographs
    if frame is not None and name is None:
        camera = camera_at_frame(path, numbered_cameras(path, photographs), frame)
    else:
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
