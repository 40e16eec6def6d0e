"""A reflectance field without what is no part of it: the room's own light, and pixels that do not belong."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.lightstage.acquire.picture_folder import PictureFolder
from relume.lightstage.field.field import Derived, ReflectanceField


@dataclass(frozen=True, eq=False)
class WithoutAmbient(Derived):
    """The field less a picture; noise may leave values below 0, which keep their mean right.

    The noise is the field's; the ambient picture's own, one for all, is not counted.

    field : as taken
    ambient : (H, W, 3) float32 radiance, as of the pictures before they were divided by their lights' irradiances
    irradiances : (N, 3), those
    """

    field: ReflectanceField
    ambient: np.ndarray
    irradiances: np.ndarray

    @staticmethod
    def of(field: PictureFolder, path: Path) -> WithoutAmbient:
        """A folder's field less the light of a picture that was taken with all lights off."""
        return WithoutAmbient(field, field.beside(path), field.irradiances)

    def __post_init__(self) -> None:
        if self.ambient.shape != (*self.field.shape, 3):
            height, width = self.ambient.shape[:2]
            raise ValueError(
                f"the ambient picture is {width}×{height}; expected {self.field.shape[1]}×{self.field.shape[0]}"
            )

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        share = self.ambient[rows] / self.irradiances[lights, None, None].astype(np.float32)
        return self.field.block(lights, rows) - share


@dataclass(frozen=True, eq=False)
class WithoutPixels(Derived):
    """The field with pixels black under every light.

    field : as taken
    left_out : (H, W) bool
    """

    field: ReflectanceField
    left_out: np.ndarray

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        return np.where(self.left_out[rows][None, ..., None], np.float32(0), self.field.block(lights, rows))
