"""What the virtual camera has to know of a picture beside its radiance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.colour import luminance

FIELD_OF_VIEW = np.radians(50.0)
"""Horizontal, of a picture that names none: that of a 39 mm lens on 35 mm film, between the usual 35 and 50 mm."""
SUPPOSED_LUMINANCE = 100.0
"""cd/m², the log mean of a relative map that is shown to an eye: a lit room seen by day."""


@dataclass(frozen=True, eq=False)
class View:
    """A picture's lens, unit and planes.

    focal_length : pixels; sets what angle a pixel covers in the middle of the picture
    luminance_scale : cd/m² per unit of radiance
    depth : (H, W) float32, metres along the viewing axis, infinity for the distance; None where unknown
    motion : (H, W, 2) float32, pixels right and down by which each pixel moves while the shutter is open; None where
        nothing is known to move
    seed : of everything that is drawn at random
    frame : of a sequence: grain is another in each, while an eye's needles stay
    settled : cd/m² that the eye has settled on over a sequence; None where it settles on the picture itself
    """

    focal_length: float
    luminance_scale: float = 1.0
    depth: np.ndarray | None = None
    motion: np.ndarray | None = None
    seed: int = 0
    frame: int = 0
    settled: float | None = None

    def __post_init__(self) -> None:
        for name in ("focal_length", "luminance_scale"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} is {getattr(self, name)}; expected a positive number")
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}; expected 0 or more")

    @property
    def grain_seed(self) -> int:
        """The seed of grain and noise, another for every frame."""
        return self.seed + self.frame

    @property
    def degrees_per_pixel(self) -> float:
        """The angle that a pixel in the middle of the picture covers, degrees."""
        return float(np.degrees(np.arctan(1 / self.focal_length)))


def require_size(depth: np.ndarray, shape: tuple[int, int]) -> None:
    """Raise ValueError for a depth map of another shape, (rows, columns), than the picture's."""
    if depth.shape != shape:
        raise ValueError(
            f"the depth map is {depth.shape[1]}×{depth.shape[0]} pixels and the picture {shape[1]}×{shape[0]}; "
            "render or resize it to the picture's size"
        )


def log_mean(light: np.ndarray) -> float:
    """The geometric mean of what is above 0, in the unit of `light`; 1 where nothing is."""
    known = light[(light > 0) & np.isfinite(light)]
    return float(np.exp(np.log(known).mean(dtype=np.float64))) if known.size else 1.0


def seen_luminance(radiance: np.ndarray, view: View) -> float:
    """The log mean luminance, cd/m², of a picture (H, W, 3): what an eye in front of it is used to.

    From a quarter of a million pixels, enough for a mean.
    """
    stride = max(1, int(np.sqrt(radiance.shape[0] * radiance.shape[1] / 2.5e5)))
    return view.luminance_scale * log_mean(luminance(radiance[::stride, ::stride]))
