"""Bicubic Bézier patches, as Newell's teapot of 1975 is made of, and the files that hold them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relume.errors import UnreadableFile

if TYPE_CHECKING:
    from relume.scene.shapes.shapes import AnyMaterial


@dataclass(frozen=True, eq=False)
class Patches:
    """Bicubic Bézier patches, exactly: their outlines are smooth at any distance.

    control : (P, 4, 4, 3) float64 control points, metres, world; [p, i, j] goes with u = i/3 and v = j/3, and
        outside is where ∂P/∂u × ∂P/∂v points
    material : what they are made of
    name : for messages

    Texture coordinates are each patch's own (u, v).
    """

    control: np.ndarray
    material: AnyMaterial
    name: str = "patches"

    def __post_init__(self) -> None:
        if self.control.ndim != 4 or self.control.shape[1:] != (4, 4, 3) or not len(self.control):
            raise ValueError(
                f"control points of {self.name!r} are {self.control.shape}; expected (P, 4, 4, 3), sixteen a patch"
            )
        if not np.all(np.isfinite(self.control)):
            raise ValueError(f"some control points of {self.name!r} are not finite; expected metres")
        flat = np.ptp(self.control.reshape(len(self.control), 16, 3), axis=1).max(axis=1) == 0
        if np.any(flat):
            raise ValueError(f"patch {int(np.argmax(flat))} of {self.name!r} is a single point; remove it")


def read_patches(path: str | Path) -> np.ndarray:
    """Control points (P, 4, 4, 3) of a .bpt file: the number of patches, then each one's degrees and 16 points.

    Raises UnreadableFile when the file is missing or is no such list.
    """
    path = Path(path)
    if not path.is_file():
        raise UnreadableFile(f"{path}: no such file of patches; check the path")
    try:
        words = path.read_text(encoding="utf-8").split()
        count = int(words[0])
        table = np.array(words[1:], np.float64).reshape(count, 2 + 48)
    except (OSError, ValueError, IndexError, UnicodeDecodeError):
        raise UnreadableFile(
            f"{path}: not a list of bicubic patches; expected their number, then for each the degrees 3 3 and 16 points"
        ) from None
    if count < 1 or not np.all((table[:, :2] == 3) | (table[:, :2] == 4)) or not np.all(np.isfinite(table)):
        raise UnreadableFile(f"{path}: holds no patches, others than bicubic ones (3 3), or points that are not finite")
    return table[:, 2:].reshape(count, 4, 4, 3)
