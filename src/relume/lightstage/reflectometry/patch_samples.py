"""What a patch reflects, measured in one plane: a lamp and a camera that turn about it (Debevec et al. 2000, Fig. 10).

Angles are from the patch's normal, in the plane of lamp, camera and normal, positive to one side and negative to the
other, as the paper's ±(0, 22.5, 45 …) degrees are. A sample is the radiance of the patch by the lamp's irradiance on a
surface that faces it: f cos θi.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FEWEST = 20
"""Samples: a fit has six parameters, and noise wants some more."""
NORMAL = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class PatchSamples:
    """What a patch reflects of light from one angle towards another.

    incidence, viewing : (N,) radians from the normal, signed, within a right angle; equal where lamp and camera stand
        in one direction
    values : (N, 3), radiance by irradiance at normal incidence, linear Rec. 709
    deviation : (N, 3), their standard deviations

    Raises ValueError for too few samples, angles beyond the horizon, and values that are no numbers.
    """

    incidence: np.ndarray
    viewing: np.ndarray
    values: np.ndarray
    deviation: np.ndarray

    def __post_init__(self) -> None:
        count = len(self.incidence)
        shapes = [each.shape for each in (self.viewing, self.values, self.deviation)]
        if shapes != [(count,), (count, 3), (count, 3)]:
            raise ValueError(f"{count} angles of incidence, but angles of view, values and deviations are {shapes}")
        if count < FEWEST:
            raise ValueError(f"{count} samples of the patch; a fit needs {FEWEST}, better some hundred")
        for name in ("incidence", "viewing"):
            steep = np.abs(getattr(self, name)) >= np.pi / 2
            if not np.all(np.isfinite(getattr(self, name))) or steep.any():
                raise ValueError(f"{int(steep.sum())} angles of {name} are 90° from the normal or more; leave them out")
        if not np.all(np.isfinite(self.values)) or not np.all(self.deviation > 0):
            raise ValueError("some samples are no numbers, or have no deviation above 0")

    @property
    def light(self) -> np.ndarray:
        """Directions towards the lamp (N, 3), the normal +Z."""
        return in_plane(self.incidence)

    @property
    def view(self) -> np.ndarray:
        """Directions towards the camera (N, 3), the normal +Z."""
        return in_plane(self.viewing)


def in_plane(angles: np.ndarray) -> np.ndarray:
    """Unit directions (…, 3) at signed angles from +Z towards +X."""
    return np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=-1)
