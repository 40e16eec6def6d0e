"""The mesh of a scan written, and normals for one read."""

from __future__ import annotations

import os

import numpy as np

from relume.errors import UnreadableFile
from relume.image import files
from relume.lightstage.geometry.merging import MergedScan
from relume.lightstage.geometry.scan import Scan
from relume.scene.gltf.writing import write_glb


def write_scan(path: str | os.PathLike[str], scanned: Scan | MergedScan) -> None:
    """Write a scan's mesh, whole or not at all.

    path : .glb
    scanned : one scan, or several that were merged
    Raises OutputNotWritten.
    """
    write_glb(path, (scanned.mesh,))


def read_normals(path: str | os.PathLike[str]) -> np.ndarray:
    """The normals (H, W, 3) of the maps that `write_surface` wrote, 0 where unknown.

    path : its maps.exr
    Raises UnreadableFile.
    """
    layers = files.read_layers(path)
    if "normal" not in layers or layers["normal"].shape[-1] != 3:
        raise UnreadableFile(f'{path}: has no layer "normal"; give maps.exr, as `relume stage separate` writes it')
    return layers["normal"]
