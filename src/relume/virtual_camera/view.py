"""What the virtual camera has to know of a picture beside its radiance."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from relume.image.colour import luminance
from relume.image.radiance import RadianceMap

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


def view_of(
    picture: RadianceMap,
    *,
    field_of_view: float = FIELD_OF_VIEW,
    luminance_scale: float | None = None,
    depth: np.ndarray | None = None,
    motion: np.ndarray | None = None,
    seed: int = 0,
    absolute: bool = False,
) -> View:
    """The view of a picture, its planes checked.

    field_of_view : horizontal, radians, below π
    luminance_scale : cd/m² per unit of a relative map; None for the rule under `absolute`
    absolute : whether luminances in cd/m² will be asked for, as by the models of the eye. A relative map without a
        scale is then taken to have the log mean SUPPOSED_LUMINANCE, with a warning

    Raises ValueError for planes of another size than the picture, for depths that are not positive, and for a scale
    with a map that is in cd/m² already.
    """
    width, height = picture.size
    if not 0 < field_of_view < np.pi:
        raise ValueError(f"field_of_view is {np.degrees(field_of_view):g}°; expected more than 0° and less than 180°")
    if depth is not None:
        if depth.shape != (height, width):
            raise ValueError(
                f"the depth map is {depth.shape[1]}×{depth.shape[0]} pixels and the picture {width}×{height}; "
                "render or resize it to the picture's size"
            )
        if not np.all(depth > 0):
            y, x = np.argwhere(~(depth > 0))[0]
            raise ValueError(f"the depth at x {x}, y {y} is {depth[y, x]}; expected metres above 0, or infinity")
    if motion is not None and (motion.shape != (height, width, 2) or not np.all(np.isfinite(motion))):
        raise ValueError(f"motion is {motion.shape}; expected finite ({height}, {width}, 2), pixels right and down")
    if picture.unit == "cd/m²" and luminance_scale is not None:
        raise ValueError("the picture is in cd/m² already; a luminance scale belongs to relative maps alone")
    scale = 1.0 if luminance_scale is None else luminance_scale
    if absolute and luminance_scale is None and picture.unit != "cd/m²":
        scale = SUPPOSED_LUMINANCE / log_mean(luminance(picture.radiance))
        warnings.warn(
            f"the picture's unit is relative: its log mean is taken to be {SUPPOSED_LUMINANCE:g} cd/m², a lit room; "
            "give cd/m² per unit if you know it (--luminance)",
            stacklevel=2,
        )
    focal_length = width / 2 / np.tan(field_of_view / 2)
    return View(float(focal_length), float(scale), depth, motion, seed)


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
