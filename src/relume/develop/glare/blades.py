"""The iris of a lens: its blades, how round they make it, and how light of any wavelength is diffracted by it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SUBSAMPLES = 4
"""Across a cell of the drawn aperture, where its edge passes."""


@dataclass(frozen=True)
class Iris:
    """An opening between blades.

    blades : their number; six is commonest in lenses for 35 mm film
    roundness : of the opening; 0 a polygon, 1 a circle. Each blade's edge is an arc of that share of a blade's turn
    rotation : radians from right to down, of the first blade's middle
    """

    blades: int = 6
    roundness: float = 0.0
    rotation: float = 0.0

    def __post_init__(self) -> None:
        if self.blades < 3:
            raise ValueError(f"an iris of {self.blades} blades; expected 3 or more, or roundness 1 for a circle")
        if not 0 <= self.roundness <= 1:
            raise ValueError(f"roundness is {self.roundness}; expected 0 for a polygon to 1 for a circle")
        if not np.isfinite(self.rotation):
            raise ValueError(f"rotation is {self.rotation}; expected radians")

    @property
    def curved(self) -> bool:
        return self.half_arc > 1e-6

    @property
    def half_arc(self) -> float:
        """Radians by which an edge's normal turns to either side of the edge's middle."""
        return self.roundness * np.pi / self.blades

    @property
    def corner(self) -> float:
        """Radius of the corners of an opening with the area of a circle of diameter 1, as f-numbers promise it."""
        half = np.pi / self.blades
        # The polygon's triangles, and a segment of a circle on each side.
        area = self.blades * np.sin(half) * np.cos(half)
        if self.curved:
            radius = np.sin(half) / np.sin(self.half_arc)
            area += self.blades * radius**2 * (self.half_arc - np.sin(self.half_arc) * np.cos(self.half_arc))
        return float(np.sqrt(np.pi / 4 / area))

    @property
    def edge(self) -> float:
        """Length of one blade's edge, in diameters of that circle."""
        chord = 2 * self.corner * np.sin(np.pi / self.blades)
        return float(chord * self.half_arc / np.sin(self.half_arc)) if self.curved else float(chord)

    @property
    def edge_radius(self) -> float:
        """Radius of a blade's edge, in the same diameters; infinite where it is straight."""
        chord = 2 * self.corner * np.sin(np.pi / self.blades)
        return float(chord / 2 / np.sin(self.half_arc)) if self.curved else np.inf

    def drawn(self, size: int) -> np.ndarray:
        """(size, size) float64, the covered share of each cell; the square has sides of 2 `corner`."""
        fine = size * SUBSAMPLES
        places = ((np.arange(fine) + 0.5) / fine * 2 - 1) * self.corner
        x, y = np.meshgrid(places, places)
        inside = np.ones((fine, fine), bool)
        half = np.pi / self.blades
        apothem = self.corner * np.cos(half)
        for blade in range(self.blades):
            turn = self.rotation + 2 * half * blade
            out, along = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
            if self.curved:
                radius = self.edge_radius
                middle = apothem - radius * np.cos(self.half_arc)
                bulge = np.sqrt(np.maximum(radius**2 - along**2, 0))
                inside &= out <= middle + bulge
            else:
                inside &= out <= apothem
        return inside.reshape(size, SUBSAMPLES, size, SUBSAMPLES).mean((1, 3))
