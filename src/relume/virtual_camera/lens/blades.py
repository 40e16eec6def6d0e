"""The opening between the blades of an iris: the shape of a light out of focus, and of what diffracts a sharp one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CORNERS = 720
"""Corners of the outline: an arc between two of them is a chord to 1e-5 of the disc's radius."""
SUBSAMPLES = 4
"""Across a cell of the drawn opening, where its edge passes."""


@dataclass(frozen=True)
class Blades:
    """An iris, as the camera sees it from behind.

    count : of the blades, at least 3; 0 for a round opening; six are commonest in lenses for 35 mm film
    curvature : of their edges: 0 straight, a polygon with corners; 1 a circle. Each edge is an arc that turns by that
        share of 2π / count
    rotation : radians, anticlockwise in the picture; at 0 a corner points right

    Round by default: an iris shows once it is stopped down. All lengths are in diameters of the round opening of the
    same area: the f-number says how much light passes, so openings of one f-number have one area, whatever their
    shape.
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

    @property
    def edges(self) -> int:
        """How many arcs or straight lines bound the opening: a round one is two half circles."""
        return self.count or 2

    @property
    def normals(self) -> np.ndarray:
        """The angles (edges,) in which the middles of the edges look, radians anticlockwise from the right."""
        return self.rotation + np.pi / self.edges * (2 * np.arange(self.edges) + 1)

    @property
    def half_arc(self) -> float:
        """Radians by which an edge's normal turns to either side of the edge's middle."""
        return (self.curvature if self.count else 1.0) * np.pi / self.edges

    @property
    def curved(self) -> bool:
        """Whether the edges are arcs."""
        return self.half_arc > 1e-6

    @property
    def corner(self) -> float:
        """Distance of the corners from the lens's axis."""
        half = np.pi / self.edges
        # The polygon's triangles, and a segment of a circle on each side.
        area = self.edges * np.sin(half) * np.cos(half)
        if self.curved:
            radius = np.sin(half) / np.sin(self.half_arc)
            area += self.edges * radius**2 * (self.half_arc - np.sin(self.half_arc) * np.cos(self.half_arc))
        return float(np.sqrt(np.pi / 4 / area))

    @property
    def edge(self) -> float:
        """Length of one edge."""
        chord = 2 * self.corner * np.sin(np.pi / self.edges)
        return float(chord * self.half_arc / np.sin(self.half_arc)) if self.curved else float(chord)

    @property
    def edge_radius(self) -> float:
        """Radius of an edge; infinite where it is straight."""
        chord = 2 * self.corner * np.sin(np.pi / self.edges)
        return float(chord / 2 / np.sin(self.half_arc)) if self.curved else np.inf

    def outline(self) -> np.ndarray:
        """Corners (N, 2) of the opening of a lens of radius 1, x right and y down, round the axis: its area is π."""
        steps = self.edges * -(-CORNERS // self.edges)
        angle = 2 * np.pi * np.arange(steps) / steps
        sector = 2 * np.pi / self.edges
        from_middle = angle % sector - sector / 2
        apothem = self.corner * np.cos(sector / 2)
        radius = np.full(steps, self.corner)
        if not self.curved:
            radius = apothem / np.cos(from_middle)
        elif self.half_arc < sector / 2:
            middle = apothem - self.edge_radius * np.cos(self.half_arc)
            across = middle * np.sin(from_middle)
            radius = middle * np.cos(from_middle) + np.sqrt(self.edge_radius**2 - across**2)
        x, y = radius * np.cos(angle + self.rotation), -radius * np.sin(angle + self.rotation)
        # Chords cut a little off an arc.
        area = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
        return np.stack([x, y], axis=-1) * np.sqrt(np.pi / area)

    def draw(self, size: int) -> np.ndarray:
        """The covered share of each cell of a square of 2 `corner`, (size, size) float64, from its top down."""
        fine = size * SUBSAMPLES
        places = ((np.arange(fine) + 0.5) / fine * 2 - 1) * self.corner
        x, y = np.meshgrid(places, -places)
        inside = np.ones((fine, fine), bool)
        apothem = self.corner * np.cos(np.pi / self.edges)
        for normal in self.normals:
            out, along = x * np.cos(normal) + y * np.sin(normal), y * np.cos(normal) - x * np.sin(normal)
            if self.curved:
                middle = apothem - self.edge_radius * np.cos(self.half_arc)
                inside &= out <= middle + np.sqrt(np.maximum(self.edge_radius**2 - along**2, 0))
            else:
                inside &= out <= apothem
        return inside.reshape(size, SUBSAMPLES, size, SUBSAMPLES).mean((1, 3))
