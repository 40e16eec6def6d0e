"""The lights of a stage: where each stands, and how much of the sphere it speaks for.

Directions are unit vectors from the subject *towards* the light, in the world's frame (`sphere.directions`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.lightstage.relighting.voronoi_cells import voronoi_solid_angles
from relume.sphere.directions import normalised


@dataclass(frozen=True, eq=False)
class StageLights:
    """Lights that were lit one at a time.

    directions : (N, 3) float64, unit, towards each light
    solid_angles : (N,) float64, sr, of each light's cell; they sum to 4π (`StageLights.towards` finds them)
    names : what each light is called, unique: the name of its picture's file unless something better is known
    positions : (N, 3) metres, for near lights; None where only directions are known
    grid : (rows, columns) where the lights are a grid of inclination and azimuth, light row·columns + column, row 0
        nearest +Y; None else
    """

    directions: np.ndarray
    solid_angles: np.ndarray
    names: tuple[str, ...]
    positions: np.ndarray | None = None
    grid: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        count = len(self.names)
        if count == 0 or self.directions.shape != (count, 3) or self.solid_angles.shape != (count,):
            raise ValueError(
                f"{count} lights with directions {self.directions.shape} and solid angles {self.solid_angles.shape}; "
                "expected one name, one direction and one solid angle a light"
            )
        if not np.allclose(np.linalg.norm(self.directions, axis=1), 1, atol=1e-6):
            raise ValueError("a direction of a light is not a unit vector; normalise it")
        if len(set(self.names)) != count:
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise ValueError(f'two lights are called "{twice}"; give each its own name')
        if self.positions is not None and self.positions.shape != (count, 3):
            raise ValueError(f"positions are {self.positions.shape}; expected ({count}, 3)")
        if self.grid is not None and self.grid[0] * self.grid[1] != count:
            raise ValueError(f"a grid of {self.grid[0]} × {self.grid[1]} lights, but there are {count}")

    def __len__(self) -> int:
        return len(self.names)

    @staticmethod
    def towards(
        directions: np.ndarray,
        names: tuple[str, ...] | None = None,
        *,
        positions: np.ndarray | None = None,
        grid: tuple[int, int] | None = None,
    ) -> StageLights:
        """Lights in directions (N, 3) of any length; solid angles are those of their spherical Voronoi cells.

        directions : (N, 3) towards the lights, of any length above 0
        names : "0", "1", … unless given
        positions, grid : as of the lights themselves
        Raises ValueError for a direction without length and for two lights in one place.
        """
        array = np.asarray(directions, np.float64).reshape(-1, 3)
        lengths = np.linalg.norm(array, axis=1)
        called = names or tuple(str(i) for i in range(len(array)))
        if not np.all(np.isfinite(lengths)) or not np.all(lengths > 0):
            odd = int(np.argmax(~(np.isfinite(lengths) & (lengths > 0))))
            raise ValueError(f'the light "{called[odd]}" has the direction {array[odd].tolist()}; give it a length')
        unit = normalised(array)
        return StageLights(unit, voronoi_solid_angles(unit, called), called, positions, grid)
