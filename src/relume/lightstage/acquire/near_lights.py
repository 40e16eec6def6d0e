"""Where near lights stand: the rays on which several mirrored balls show one lamp meet there. Metres, world frame."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from relume.lightstage.acquire.ball_highlights import BallReadings

PARALLEL = np.radians(0.5)
"""Rays that differ by less, the error of a highlight's place on a ball, do not determine how far away a light is."""


def light_places(readings: Sequence[BallReadings], names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """The points (N, 3) nearest to the rays that balls mirror, by least squares, and how far they are from their rays.

    readings : of two balls or more, in metres and one world; one row a light
    The distances (N,) are root mean squares, metres. Raises ValueError for fewer than two balls and for rays that meet
    behind the balls. Warns of lights whose rays are nearly parallel: their distance is a guess.
    """
    if len(readings) < 2 or len({len(reading.places) for reading in readings}) != 1:
        raise ValueError(
            f"{len(readings)} balls with {[len(reading.places) for reading in readings]} readings; a place needs two "
            "balls or more, and as many readings of each"
        )
    places = np.stack([reading.places for reading in readings], axis=1)
    rays = np.stack([reading.directions for reading in readings], axis=1)
    # Σ (I − d dᵀ)(p − o) = 0: the squared distances to all rays are least.
    across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
    positions = np.linalg.solve(across.sum(axis=1), (across @ places[..., None]).sum(axis=1))[..., 0]
    offset = positions[:, None] - places
    residuals = np.sqrt(((across @ offset[..., None])[..., 0] ** 2).sum(axis=-1).mean(axis=1))
    parallax = np.arccos(np.clip((rays[:, :, None] * rays[:, None]).sum(axis=-1), -1, 1)).max(axis=(1, 2))
    _check_rays((offset * rays).sum(axis=-1).min(axis=1), parallax, names)
    return positions, residuals


def _check_rays(ahead: np.ndarray, parallax: np.ndarray, names: Sequence[str]) -> None:
    """Refuse rays that run apart, and warn of those that are too parallel for a distance."""
    measurable = parallax >= PARALLEL
    apart = measurable & (ahead <= 0)
    if np.any(apart):
        odd = names[int(np.argmax(apart))]
        raise ValueError(f"{odd}: the balls' rays run apart; check the balls' circles, their order and their radii")
    if not measurable.all():
        warnings.warn(
            f"{names[int(np.argmin(measurable))]}: the balls' rays are parallel within half a degree "
            f"({(~measurable).sum()} such lights), so that its distance is a guess; put the balls farther apart, or "
            "treat it as a distant light",
            stacklevel=3,
        )
