"""The picture so far, written while a render runs."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import OutputNotWritten
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.renderers.progressive.accumulators import Sums
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film


@dataclass(frozen=True, eq=False)
class Previews:
    """Writes preview.exr and preview.png, each whole at every moment; for `Watch.preview`.

    folder : is there
    composed : makes the scene-linear composite (H, W, 3) from the sums so far
    film : develops it
    unit : of the composite
    """

    folder: Path
    composed: Callable[[Sums], np.ndarray]
    film: Film
    unit: str = "relative"

    def __call__(self, sums: Sums) -> None:
        """Write them; a disk that is full costs the preview, which is told, and not the render."""
        composite = np.asarray(self.composed(sums), np.float32)
        try:
            files.write(self.folder / "preview.exr", RadianceMap(composite, unit=self.unit))
            files.write(self.folder / "preview.png", develop(composite, self.film))
        except OutputNotWritten as error:
            warnings.warn(f"no preview: {error}", stacklevel=2)

    def remove(self) -> None:
        """Remove them, once the result itself is there."""
        for name in ("preview.exr", "preview.png"):
            (self.folder / name).unlink(missing_ok=True)


def composed_change(sums: Sums, plate: np.ndarray) -> np.ndarray:
    """The composite of the planes objects, difference and matte so far over a plate (H, W, 3), all of one unit."""
    matte = sums.mean("matte")[..., None]
    return plate * (1 - matte) + sums.mean("difference") + sums.mean("objects")
