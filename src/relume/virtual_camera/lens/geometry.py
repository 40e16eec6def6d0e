"""Where a lens draws what a pinhole would have drawn elsewhere: distortion and lateral colour, in one resampling."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from relume.image.bands import in_threads
from relume.scene.cameras.distortion import Distortion
from relume.virtual_camera.protocols import Relative
from relume.virtual_camera.view import View


@dataclass(frozen=True)
class RadialScale:
    """By how much one colour is drawn larger than green: r·(1 + a + b r² + c r⁴).

    scale : a, at the axis; 0.0005 is 1.5 pixels at the corner of a picture 6000 wide (a plain zoom lens)
    k1, k2 : b and c; r is the distance from the axis in units of the focal length, as in `Distortion`
    """

    scale: float = 0.0
    k1: float = 0.0
    k2: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.scale) and self.scale > -1):
            raise ValueError(f"a colour drawn larger by {self.scale}; expected a fraction above −1, such as 0.0005")
        self._radial()

    def scaled(self, points: np.ndarray) -> np.ndarray:
        """Where this colour is drawn of points (…, 2) that green draws; NaN beyond the fold."""
        return self._radial().distorted(points) * (1 + self.scale)

    def unscaled(self, points: np.ndarray) -> np.ndarray:
        """Where green draws what this colour draws at points (…, 2); NaN where there is no such place."""
        return self._radial().undistorted(np.asarray(points, np.float64) / (1 + self.scale))

    def _radial(self) -> Distortion:
        return Distortion(k1=self.k1 / (1 + self.scale), k2=self.k2 / (1 + self.scale))


@dataclass(frozen=True)
class LateralColour:
    """Red and blue beside green, which stays: what lens databases call TCA.

    red, blue : how these are drawn
    """

    red: RadialScale = field(default_factory=RadialScale)
    blue: RadialScale = field(default_factory=RadialScale)


SPACING = 1 / 128
"""Focal lengths between the places that are computed, at least 2 pixels: cubics between them follow a strong barrel
lens (k1 −0.3, 70° across) to 3e-4 pixels of a picture 6000 wide."""


@dataclass(frozen=True)
class LensGeometry(Relative):
    """A lens that bends straight lines and draws its colours at different sizes.

    distortion : Brown's, as of a calibrated `Camera`; none if not given
    lateral : lateral chromatic aberration, after the distortion; none if not given
    centre : where the axis meets the picture, as a fraction of width and height, from the top left

    Each colour is interpolated once, by cubics (Keys 1981) kept between the darkest and the brightest of the four
    pixels around, so that no ring and no negative light appears beside a sun. Radiance stays radiance: what is drawn
    larger is as bright as before. Where the lens sees farther than the picture, the picture's edge is drawn out.
    """

    distortion: Distortion | None = None
    lateral: LateralColour | None = None
    centre: tuple[float, float] = (0.5, 0.5)

    def __post_init__(self) -> None:
        if not (len(self.centre) == 2 and np.all(np.isfinite(self.centre))):
            raise ValueError(f"the centre is {self.centre}; expected two fractions of width and height")

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 as the lens draws it.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        Raises ValueError where the lens's model folds over within the picture.
        """
        out = self._resampled(radiance, view, undo=False)
        if np.isnan(out[0]).any() or np.isnan(out[-1]).any() or np.isnan(out[:, [0, -1]]).any():
            raise ValueError(
                f"{self.distortion} with {self.lateral} folds over within a picture of {out.shape[1]}×{out.shape[0]} "
                f"pixels and focal length {view.focal_length:g}; check the coefficients and the field of view"
            )
        return out

    def undo(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 as a pinhole draws it; NaN in the colours that the photograph does not show.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        return self._resampled(radiance, view, undo=True)

    def _resampled(self, radiance: np.ndarray, view: View, *, undo: bool) -> np.ndarray:
        # Numba is imported only where a kernel is used.
        from relume.virtual_camera.lens.geometry_kernels import _resample

        if self.distortion is None and self.lateral is None:
            return radiance.copy()
        pixels = np.ascontiguousarray(radiance)
        places = self._places(pixels.shape[1], pixels.shape[0], view.focal_length, undo)
        out = np.empty_like(pixels)
        in_threads(lambda a, b: _resample(pixels, places, undo, a, b, out), pixels.shape[0], chunk=32)
        return out

    def _places(self, width: int, height: int, focal_length: float, undo: bool) -> np.ndarray:
        """Where each colour of a coarse grid's points is fetched (1 or 3, rows, columns, 2), pixels from the corner."""
        # The grid ends at the picture's border: beyond it the model may fold.
        spacing = max(SPACING * focal_length, 2.0)
        x, y = (np.linspace(0, side, max(int(np.ceil(side / spacing)) + 1, 4)) for side in (width, height))
        axis = np.array([width, height]) * self.centre
        points = (np.stack(np.meshgrid(x, y), axis=-1) - axis) / focal_length
        scales = [None] if self.lateral is None else [self.lateral.red, None, self.lateral.blue]
        return np.stack([axis + focal_length * self._fetched(points, scale, undo) for scale in scales])

    def _fetched(self, points: np.ndarray, scale: RadialScale | None, undo: bool) -> np.ndarray:
        if undo:
            drawn = points if self.distortion is None else self.distortion.distorted(points)
            return drawn if scale is None else scale.scaled(drawn)
        green = points if scale is None else scale.unscaled(points)
        return green if self.distortion is None else self.distortion.undistorted(green)
