"""Lights placed in space: where lamps stand, not only from where they shine (Debevec 1998, §5; *Fiat Lux*, 1999).

A constellation is what one point sees. Where its lights stand at walls of a known room, or where two probes see the
same lamps (`relume.light.constellations.triangulation`), they light every other place too, nearer lamps more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.light.constellations.constellation import Constellation


@dataclass(frozen=True, eq=False)
class PlacedLights:
    """Lights that shine from places, alike in all directions: irradiance is intensity/distance².

    positions : (N, 3) float64, metres, world
    intensity : (N, 3) float64, irradiance on a surface a metre away that faces the light: the map's unit times m² (a
        sphere of radiance L and radius r has π r² L); candela where that is cd/m²
    radii : (N,) float64, metres, of evenly shining spheres; 0 for a point. None where all are points
    """

    positions: np.ndarray
    intensity: np.ndarray
    radii: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.positions.ndim != 2 or self.positions.shape[1] != 3 or self.intensity.shape != self.positions.shape:
            raise ValueError(
                f"positions are {self.positions.shape} and intensity {self.intensity.shape}; expected (N, 3) both"
            )
        if not np.all(np.isfinite(self.positions)):
            raise ValueError("positions hold NaN or infinite values; a light without a place is a distant one")
        if not np.all(np.isfinite(self.intensity)) or np.any(self.intensity < 0):
            raise ValueError("intensity holds negative or non-finite values; light must be finite and not below 0")
        if self.radii is not None:
            count = (len(self.positions),)
            if self.radii.shape != count or not np.all((self.radii >= 0) & (self.radii < np.inf)):
                raise ValueError(f"radii are {self.radii.tolist()}; expected {count[0]} of them, in metres, from 0 on")

    def seen_from(self, place: ArrayLike) -> Constellation:
        """What a place gets from them, nothing in the way: parallel lights for whatever is small there.

        place : (3,), metres

        Raises ValueError for a place at one of the lights, or within its sphere.
        """
        ways = self.positions - point(place, "place")
        distances = np.linalg.norm(ways, axis=-1)
        radii = np.zeros(len(distances)) if self.radii is None else self.radii
        if np.any(distances <= radii):
            raise ValueError(f"the place {np.asarray(place).tolist()} is in a light; choose another")
        # A sphere gives what a point of the same intensity gives, however near it is (π L sin² of its angular radius).
        irradiance = self.intensity / distances[:, None] ** 2
        angular_radii = np.arcsin(radii / distances)
        # The solid angle of a disc of angular radius a is 4π sin²(a/2).
        solid_angles = 4 * np.pi * np.sin(angular_radii / 2) ** 2
        return Constellation(ways / distances[:, None], irradiance, angular_radii, solid_angles)


@dataclass(frozen=True, eq=False)
class Placement:
    """The lights of a constellation in two parts, none lost.

    points : those that have a place
    distant : those that have none, the sun above all
    """

    points: PlacedLights
    distant: Constellation


def placed_in_box(
    lights: Constellation, probe: ArrayLike, box: tuple[ArrayLike, ArrayLike], distant: Sequence[int] = ()
) -> Placement:
    """Every light where its ray from the probe meets the walls of a room; the probe gets what it got.

    probe : (3,), metres, where the map was taken
    box : the room's lowest corner (3,) and its highest, metres; the world's axes run along its walls
    distant : the numbers of lights that stay distant, like the sun through a window

    The intensity is E·d². Lights that have an angular radius become spheres that look as large from the probe.
    Raises ValueError for a box that has no inside, a probe that is not in it, and numbers of lights there are not.
    Source: Debevec 1998, §5: what the ball shows is mapped onto the walls and ceiling of a finite room.
    """
    low, high = point(box[0], "box, low"), point(box[1], "box, high")
    at = point(probe, "probe")
    if np.any(low >= high):
        raise ValueError(f"the box is from {low.tolist()} to {high.tolist()}; give its lowest corner, then its highest")
    if np.any(at <= low) or np.any(at >= high):
        raise ValueError(
            f"the probe at {at.tolist()} is not inside the box from {low.tolist()} to {high.tolist()}; its walls are "
            "where the light comes from"
        )
    count = len(lights.directions)
    if any(not 0 <= number < count for number in distant):
        raise ValueError(f"distant lights are {list(distant)}; of {count} lights the numbers are from 0 to {count - 1}")
    stays = np.zeros(count, bool)
    stays[list(distant)] = True
    near = chosen(lights, np.flatnonzero(~stays))
    walls = np.where(near.directions > 0, high, low) - at
    with np.errstate(divide="ignore"):
        distances = np.min(np.abs(walls) / np.abs(near.directions), axis=-1)
    points = PlacedLights(
        at + distances[:, None] * near.directions,
        near.irradiance * distances[:, None] ** 2,
        radii_at(near, distances),
    )
    return Placement(points, chosen(lights, np.flatnonzero(stays)))


def chosen(lights: Constellation, numbers: np.ndarray) -> Constellation:
    """Some of the lights, in the order of their `numbers` (M,); pixels of the others belong to none (−1)."""
    labels = lights.labels
    if labels is not None:
        rank = np.full(len(lights.directions) + 1, -1, np.int32)
        rank[numbers] = np.arange(len(numbers), dtype=np.int32)
        labels = rank[labels]
    return Constellation(
        lights.directions[numbers],
        lights.irradiance[numbers],
        None if lights.angular_radii is None else lights.angular_radii[numbers],
        None if lights.solid_angles is None else lights.solid_angles[numbers],
        labels,
    )


def radii_at(lights: Constellation, distances: np.ndarray) -> np.ndarray | None:
    """Metres (N,): the radii of spheres that have the lights' angular radii at distances (N,); None where unknown."""
    # What is spread over more than a half space is no sphere; it is not let nearer than the probe.
    return None if lights.angular_radii is None else distances * np.sin(np.minimum(lights.angular_radii, np.pi / 2))


def point(value: ArrayLike, name: str) -> np.ndarray:
    """(3,) float64; raises ValueError that names it where it is no place."""
    array = np.asarray(value, np.float64)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise ValueError(f"{name} is {np.asarray(value).tolist()}; expected three finite lengths in metres")
    return array
