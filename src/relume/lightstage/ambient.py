"""A reflectance field without the light that was in every picture: the room's own, taken once with all lights off."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.lightstage.field import Noise, ReflectanceField
from relume.lightstage.folder import PictureFolder
from relume.lightstage.lights import StageLights
from relume.scene.camera import Camera


@dataclass(frozen=True, eq=False)
class WithoutAmbient:
    """The field less a picture; noise may leave values below 0, which keep their mean right.

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

    @property
    def lights(self) -> StageLights:
        return self.field.lights

    @property
    def shape(self) -> tuple[int, int]:
        return self.field.shape

    @property
    def camera(self) -> Camera | None:
        return self.field.camera

    @property
    def noise(self) -> Noise | None:
        """That of the field; the ambient picture's own, one for all, is not counted."""
        return self.field.noise

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        share = self.ambient[rows] / self.irradiances[lights, None, None].astype(np.float32)
        return self.field.block(lights, rows) - share
