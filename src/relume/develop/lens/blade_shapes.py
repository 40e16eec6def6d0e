"""The opening between the blades of an iris: the shape as which a lens draws a light that is out of focus."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CORNERS = 720
"""Corners of the outline: an arc between two of them is a chord to 1e-5 of the disc's radius."""


@dataclass(frozen=True)
class Blades:
    """An iris, as the camera sees it from behind.

    count : of the blades, at least 3; 0 for a round opening
    curvature : of their edges: 0 straight, a polygon with corners; 1 round
    rotation : radians, anticlockwise in the picture; at 0 a corner points right

    Round unless told: an iris shows once it is stopped down. Half-round edges are a matter of taste, not of a law.
    """

    count: int = 0
    curvature: float = 0.0
    rotation: float = 0.0

    def __post_init__(self) -> None:
        if self.count != 0 and self.count < 3:
            raise ValueError(f"{self.count} blades; expected at least 3, or 0 for a round opening")
        if not 0 <= self.curvature <= 1:
            raise ValueError(f"the blades' curvature is {self.curvature}; expected 0 (straight) to 1 (round)")
        if not np.isfinite(self.rotation):
            raise ValueError(f"the blades' rotation is {self.rotation}; expected radians")

    def outline(self) -> np.ndarray:
        """Corners (N, 2) of the opening, x right and y down, round the lens's axis: its area is π.

        The f-number tells how much light passes, so openings of one f-number have one area, whatever their shape.
        """
        steps = CORNERS if self.count == 0 else self.count * -(-CORNERS // self.count)
        angle = 2 * np.pi * np.arange(steps) / steps
        radius = np.ones(steps)
        if self.count:
            sector = 2 * np.pi / self.count
            from_middle = angle % sector - sector / 2
            straight = np.cos(sector / 2) / np.cos(from_middle)
            radius = (1 - self.curvature) * straight + self.curvature
        x, y = radius * np.cos(angle + self.rotation), -radius * np.sin(angle + self.rotation)
        area = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
        return np.stack([x, y], axis=-1) * np.sqrt(np.pi / area)
