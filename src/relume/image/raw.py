"""What a sensor read, before any colour was made of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.photograph import Exposure, Settings


@dataclass(frozen=True, eq=False)
class RawPhotograph:
    """A camera raw: one value a photosite behind a Bayer pattern of colour filters, linear in the light.

    mosaic : (H, W) uint16, the lit part of the sensor, seen upright
    pattern : (2, 2) int, the channel, 0 red, 1 green, 2 blue, of the photosites at even and odd rows and columns
    black : (2, 2) float64, the value that no light gives, of the same photosites
    white : the value at which photosites are saturated
    matrix : (3, 3) float64, balanced camera colours → Rec. 709; its rows sum to 1, so that neutral stays neutral
    daylight : (3,) float64, what camera colours are multiplied by so that light of Rec. 709's white (D65) is neutral;
        the least of them is 1
    as_shot : (3,) float64, the same of the white that the camera set or its user chose; None where the file has none
    name : the file it came from, for messages
    exposure : shutter, aperture, ISO; None where the file has none
    camera : make and model, "" where unknown
    focal_length : in pixels, None where unknown
    settings : what else the file stores
    """

    mosaic: np.ndarray
    pattern: np.ndarray
    black: np.ndarray
    white: float
    matrix: np.ndarray
    daylight: np.ndarray
    as_shot: np.ndarray | None = None
    name: str = "raw"
    exposure: Exposure | None = None
    camera: str = ""
    focal_length: float | None = None
    settings: Settings = Settings()

    def __post_init__(self) -> None:
        if self.mosaic.ndim != 2 or self.mosaic.dtype != np.uint16 or min(self.mosaic.shape) < 6:
            raise ValueError(f"mosaic is {self.mosaic.shape} {self.mosaic.dtype}; a raw is (H, W) uint16, 6 at least")
        if not is_bayer(self.pattern):
            raise ValueError(f"pattern is {self.pattern}; a Bayer pattern has greens on a diagonal, a red and a blue")
        for field, shape in (("black", (2, 2)), ("matrix", (3, 3)), ("daylight", (3,))):
            if getattr(self, field).shape != shape:
                raise ValueError(f"{field} is {getattr(self, field).shape}; expected {shape}")
        if not np.all(self.black < self.white):
            raise ValueError(f"black is {self.black}, white {self.white}; white must be above black")

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.mosaic.shape[1], self.mosaic.shape[0]


def is_bayer(pattern: np.ndarray) -> bool:
    """Whether a (2, 2) pattern of channels has greens on one diagonal and a red and a blue on the other."""
    pattern = np.asarray(pattern)
    if pattern.shape != (2, 2):
        return False
    diagonals = [pattern.diagonal().tolist(), pattern[:, ::-1].diagonal().tolist()]
    return any(greens == [1, 1] and sorted(others) == [0, 2] for greens, others in (diagonals, diagonals[::-1]))
