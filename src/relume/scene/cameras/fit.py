"""A camera found from a photograph, and how far the photograph is from what it explains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from relume.scene.cameras.camera import Camera


@dataclass(frozen=True, eq=False)
class CameraFit:
    """A camera and the points of the photograph that it was fitted to.

    camera : as found
    points : (N, 2) pixels, where the photograph has them; none for a camera that was given, not found
    offsets : (N, 2) pixels, from there to where the camera has them
    outline : of what the points are drawn along, "the ball's rim"; offsets from a fitted curve measure nothing
    """

    camera: Camera
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    offsets: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    outline: str = ""

    @property
    def residual(self) -> float | None:
        """The root mean square of the offsets' lengths, pixels; None where nothing was measured."""
        return float(np.sqrt(np.mean(np.sum(self.offsets**2, axis=-1)))) if len(self.points) else None

    @property
    def worst(self) -> float | None:
        """The longest offset, pixels; None where nothing was measured."""
        return float(np.linalg.norm(self.offsets, axis=-1).max()) if len(self.points) else None

    @property
    def agreement(self) -> str:
        """The residuals in words, for a report."""
        if self.residual is None:
            return "given, not measured"
        if self.outline:
            return f"{self.outline}, {np.ptp(self.points[:, 0]):.0f} pixels across"
        return f"{len(self.points)} points, off by {self.residual:.2f} pixels (RMS), {self.worst:.2f} at worst"


@dataclass(frozen=True, eq=False)
class Minimum:
    """What a least-squares fit found.

    values : (N,) the unknowns
    deviations : (N,) their standard deviations; infinite where the measurements do not determine one
    """

    values: np.ndarray
    deviations: np.ndarray


def least_squares(errors: Callable[[np.ndarray], np.ndarray], start: np.ndarray, noise: float) -> Minimum:
    """The unknowns that make the sum of squared errors smallest, from a start near them.

    errors : of unknowns (N,), (M,) pixels
    start : (N,); the size of an unknown's steps is that of 1 there, so scale them
    noise : standard deviation that an error has at least, pixels; a fit to few points looks better than it is
    The deviations are those of the Jacobian's covariance at the minimum.
    """
    from scipy.optimize import least_squares as minimise

    found = minimise(errors, start, method="trf", xtol=1e-14, ftol=1e-14, gtol=1e-14, x_scale="jac")
    spare = max(len(found.fun) - len(start), 1)
    deviation = max(noise, float(np.sqrt(np.sum(found.fun**2) / spare)))
    _, singular, axes = np.linalg.svd(found.jac, full_matrices=False)
    with np.errstate(divide="ignore"):
        weights = np.where(singular > 1e-12 * singular[0], 1 / singular, np.inf)
    with np.errstate(invalid="ignore"):
        spread = np.nan_to_num((axes * weights[:, None]) ** 2, nan=0.0, posinf=np.inf).sum(0)
    return Minimum(found.x, deviation * np.sqrt(spread))
