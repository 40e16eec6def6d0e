"""Values that say nothing, filled from the same pixel under the lights around.

A reflectance function is smooth over the sphere where it is not shadowed, so a value that a bar hid or flare washed out
("ignored in the lighting analysis", Debevec et al. 2000, Fig. 4) is foretold from the pixel's other values by kriging
with an unknown mean: exact where a value is, linear in the values, and never beyond what the lights used show.
Distances between directions are chords of the unit sphere.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from relume.lightstage.field.lights import StageLights

_NUGGET = 1e-9
_FEWEST = 4


@dataclass(frozen=True)
class Filling:
    """How a value is foretold from the lights around.

    neighbours : nearest lights that are asked; 16 are two rings of a grid, and more change nothing that can be seen
    correlation_length : of reflectance functions, as a chord of the unit sphere (radians for small angles); the kernel
        is Matérn's of order 3/2, for functions with one derivative. 0.7 because on a rendered head the error
        varies by less than a tenth from 0.3 to 3, and smoother or rougher kernels (5/2, exponential) are no better
    """

    neighbours: int = 16
    correlation_length: float = 0.7

    def __post_init__(self) -> None:
        if self.neighbours < 1 or not 0 < self.correlation_length < np.inf:
            raise ValueError(f"{self}: expected at least one neighbour and a correlation length above 0")

    def filled(
        self, values: np.ndarray, masked: np.ndarray, lights: StageLights, which: slice = slice(None)
    ) -> np.ndarray:
        """The values of the lights `which`, (M, rows, columns, 3) float32, with the masked ones filled.

        values : (N, rows, columns, 3), of all lights
        masked : (N, rows, columns) bool, True where a value says nothing
        Raises ValueError where a pixel is masked under every light: no sample shows what it looks like.
        """
        if (
            values.ndim != 4
            or values.shape[3] != 3
            or values.shape[0] != len(lights)
            or masked.shape != values.shape[:3]
        ):
            raise ValueError(
                f"values are {values.shape} and their mask {masked.shape}; expected ({len(lights)} lights, rows, "
                "columns, 3) and the same without the 3"
            )
        wanted = range(len(lights))[which]
        result = values[which].astype(np.float32)
        if not masked[which].any():
            return result
        _require_something(masked, wanted)
        flat, hidden = values.reshape(len(lights), -1, 3), masked.reshape(len(lights), -1)
        chords = _chords(lights.directions)
        into = result.reshape(len(wanted), -1, 3)
        for place, light in enumerate(wanted):
            nearest = np.argsort(chords[light], kind="stable")
            nearest = nearest[nearest != light]
            for pixels, used in self._groups(hidden, np.flatnonzero(hidden[light]), nearest):
                shown = flat[used[:, None], pixels]
                foretold = np.einsum("k,kpc->pc", self._weights(chords, light, used), shown)
                into[place, pixels] = np.clip(foretold, shown.min(axis=0), shown.max(axis=0))
        return result

    def _groups(
        self, hidden: np.ndarray, pixels: np.ndarray, nearest: np.ndarray
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Pixels with the same lights to ask, and these lights, nearest first.

        Where too few of the nearest lights say anything, twice as many are looked at, and so on.
        """
        reach = self.neighbours
        while len(pixels):
            asked = nearest[:reach]
            open_ = ~hidden[asked[:, None], pixels]
            enough = np.ones(len(pixels), bool) if reach >= len(nearest) else open_.sum(axis=0) >= _FEWEST
            patterns, group = np.unique(np.packbits(open_[:, enough], axis=0), axis=1, return_inverse=True)
            for index, pattern in enumerate(patterns.T):
                bits = np.unpackbits(pattern, count=len(asked)).astype(bool)
                yield pixels[enough][group.ravel() == index], asked[bits][: self.neighbours]
            pixels, reach = pixels[~enough], reach * 2

    def _weights(self, chords: np.ndarray, light: int, used: np.ndarray) -> np.ndarray:
        """Weights (K,) that sum to 1: ordinary kriging, whose mean is unknown and held by a Lagrange multiplier."""
        count = len(used)
        system = np.ones((count + 1, count + 1))
        system[:count, :count] = self._covariance(chords[np.ix_(used, used)]) + _NUGGET * np.eye(count)
        system[count, count] = 0
        return np.linalg.solve(system, np.append(self._covariance(chords[used, light]), 1.0))[:count]

    def _covariance(self, chords: np.ndarray) -> np.ndarray:
        scaled = np.sqrt(3) * chords / self.correlation_length
        return (1 + scaled) * np.exp(-scaled)


def _chords(directions: np.ndarray) -> np.ndarray:
    return np.sqrt(np.maximum(2 - 2 * directions @ directions.T, 0))


def _require_something(masked: np.ndarray, wanted: range) -> None:
    """Raises ValueError where a pixel of a wanted light is masked under every light."""
    nothing = masked.all(axis=0)
    if len(wanted) and nothing.any():
        row, column = np.argwhere(nothing)[0]
        raise ValueError(
            f"{int(nothing.sum())} pixels are masked under all {len(masked)} lights, the first in column {column} of "
            f"row {row} of the block, so no sample shows what they look like; leave them unmasked"
        )
