"""Lateral chromatic aberration: red and blue drawn a little larger or smaller than green."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from relume.scene.cameras.distortion import Distortion


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
