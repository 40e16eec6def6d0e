"""A photograph: encoded pixel values with the exposure that made them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Exposure:
    """How much light the sensor was given: shutter, aperture and sensitivity.

    seconds : exposure time Δt, s
    f_number : aperture N; None for a lens that tells none
    iso : sensitivity S; None where the camera tells none
    """

    seconds: float
    f_number: float | None = None
    iso: float | None = None

    def __post_init__(self) -> None:
        for name in ("seconds", "f_number", "iso"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}; an exposure needs a positive {name}")

    @property
    def factor(self) -> float:
        """Pixel exposure per unit of radiance, Δt · (S/100) / N²; an unknown S is 100, an unknown N is 1.

        Reciprocity (Debevec & Malik 1997, §2.1) extended over aperture and gain, so that brackets taken at
        different settings share one scale.
        """
        return self.seconds * (self.iso or 100.0) / 100.0 / (self.f_number or 1.0) ** 2


@dataclass(frozen=True, eq=False)
class Photograph:
    """Encoded pixels as a camera wrote them, with what the file tells of how they were made.

    pixels : (H, W, 3) uint8 or uint16, encoded by the camera's response
    name : the file it came from, for messages
    exposure : shutter, aperture, ISO; None where the file tells none
    camera : make and model, "" where unknown; photographs of one camera share a response
    focal_length : in pixels of this photograph's width, None where unknown
    """

    pixels: np.ndarray
    name: str = "photograph"
    exposure: Exposure | None = None
    camera: str = ""
    focal_length: float | None = None

    def __post_init__(self) -> None:
        if self.pixels.ndim != 3 or self.pixels.shape[2] != 3 or self.pixels.dtype not in (np.uint8, np.uint16):
            raise ValueError(
                f"pixels are {self.pixels.shape} {self.pixels.dtype}; a photograph is (H, W, 3) uint8 or uint16"
            )

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]
