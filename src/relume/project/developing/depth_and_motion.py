"""The planes that may accompany a picture on the command line: its depth, and how its pixels move."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from relume.errors import UnreadableFile

if TYPE_CHECKING:
    import numpy as np

Along = Literal["axis", "rays"]
DEPTH_NAMES = ("depth", "Depth", "Z", "z", "ViewLayer.Depth")
OURS = ({"objects", "matte", "difference", "depth"}, {"radiance", "matte", "depth", "normal"})
"""Layers that `relume insert` and `relume render` write together; their depth is along each pixel's ray."""
MOTION_NAMES = ("motion", "Motion", "vector", "Vector", "forward")
_COLOURS = ("R", "G", "B", "A", "Y", "RY", "BY")


def read_depth(path: Path, focal_length: float, along: Along | None = None) -> np.ndarray:
    """Depth (H, W) float32, metres along the viewing axis, from an EXR's layer of that name, or its only one.

    focal_length : pixels, by which distances along rays become depths
    along : what the file's metres are along; None for rays in layers of relume's own, else the axis, as most programs
        write

    0, and what is not finite, is the distance: renderers write either where nothing was hit. Raises UnreadableFile.
    """
    import numpy as np

    layers, planes = _layer(path, DEPTH_NAMES, "--depth", "a channel of metres")
    depth = planes.get("R", next(iter(planes.values())))
    if (depth < 0).any():
        raise UnreadableFile(f"--depth {path}: has depths below 0; expected metres before the camera")
    depth = np.where(np.isfinite(depth) & (depth > 0), depth, np.inf).astype(np.float32)
    if (along or ("rays" if any(own <= layers for own in OURS) else "axis")) == "axis":
        return depth
    height, width = depth.shape
    y, x = np.ogrid[0.5 - height / 2 : height / 2, 0.5 - width / 2 : width / 2]
    return (depth / np.sqrt(1 + (x**2 + y**2) / focal_length**2)).astype(np.float32)


def read_motion(path: Path) -> np.ndarray:
    """Motion (H, W, 2) float32, pixels right and down during the exposure, from R and G of an EXR's layer of that name,
    or its only one; raises UnreadableFile."""
    import numpy as np

    _, planes = _layer(path, MOTION_NAMES, "--vectors", "channels R and G of pixels right and down")
    if not {"R", "G"} <= planes.keys():
        held = ", ".join(planes)
        raise UnreadableFile(f"--vectors {path}: holds only {held}; motion needs two, right in R and down in G")
    return np.stack([planes["R"], planes["G"]], axis=-1).astype(np.float32)


def _layer(path: Path, names: tuple[str, ...], option: str, wanted: str) -> tuple[set[str], dict[str, np.ndarray]]:
    """The names of all layers, and the planes by letter of the one that is asked for."""
    from relume.image import files

    if (kind := files.kind_of(path)) != "EXR":
        raise UnreadableFile(f"{option} {path}: a {kind} file; expected an EXR with {wanted}")
    layers = _planes(path)
    for name in names:
        if name in layers:
            return set(layers), layers[name]
    if len(layers) == 1:
        return set(layers), next(iter(layers.values()))
    raise UnreadableFile(f"{option} {path}: has no layer named {names[0]} but {', '.join(layers)}; name it so")


def _planes(path: Path) -> dict[str, dict[str, np.ndarray]]:
    """Planes (H, W) by the names of their layers and channels: a layer is a part, what stands before a channel's last
    dot, or a channel that is no colour, as Z."""
    from relume.image.files.exr import picture as exr_picture
    from relume.image.files.exr.parts import read_parts, warn_of_overscan

    layers: dict[str, dict[str, np.ndarray]] = {}
    for index, part in enumerate(read_parts(path)):
        warn_of_overscan(path, part.header)
        for channel in part.channels:
            before, _, letter = channel.rpartition(".")
            if letter in ("RY", "BY"):
                continue
            own = part.name or f"part {index}"
            layer = before or (own if letter in _COLOURS or len(part.channels) == 1 else letter)
            layers.setdefault(layer, {})[letter] = exr_picture.plane(path, part, channel)
    return layers
