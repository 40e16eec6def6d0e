"""Values that say nothing, filled from the same pixel under the lights around.

A reflectance function is smooth over the sphere where it is not shadowed, so a value that a bar hid or flare washed out
("ignored in the lighting analysis", Debevec et al. 2000, Fig. 4) is foretold from the pixel's other values by kriging
with an unknown mean: exact where a value is, linear in the values, and never beyond what the lights used show.
Distances between directions are chords of the unit sphere.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from relume.lightstage.field.lights import StageLights

_NUGGET = 1e-9
_FEWEST = 4
_NEIGHBOURS = 16
"""Nearest lights that are asked; 16 are two rings of a grid, and more change nothing that can be seen."""
_CORRELATION_LENGTH = 0.7
"""Of reflectance functions, as a chord of the unit sphere (radians for small angles). On a rendered head the error
varies by less than a tenth from 0.3 to 3."""


def filled(values: np.ndarray, masked: np.ndarray, lights: StageLights, which: slice = slice(None)) -> np.ndarray:
    """The values of the lights `which`, (M, rows, columns, 3) float32, with the masked ones filled.

    values : (N, rows, columns, 3), of all lights
    masked : (N, rows, columns) bool, True where a value says nothing
    Raises ValueError where a pixel is masked under every light: no sample shows what it looks like.
    """
    wanted = range(len(lights))[which]
    result = values[which].astype(np.float32)
    if not masked[which].any():
        return result
    _require_something(masked, wanted)
    flat, hidden = values.reshape(len(lights), -1, 3), masked.reshape(len(lights), -1)
    chords = np.sqrt(np.maximum(2 - 2 * lights.directions @ lights.directions.T, 0))
    into = result.reshape(len(wanted), -1, 3)
    for place, light in enumerate(wanted):
        nearest = np.argsort(chords[light], kind="stable")
        nearest = nearest[nearest != light]
        for pixels, used in _groups(hidden, np.flatnonzero(hidden[light]), nearest):
            shown = flat[used[:, None], pixels]
            foretold = np.einsum("k,kpc->pc", _weights(chords, light, used), shown)
            into[place, pixels] = np.clip(foretold, shown.min(axis=0), shown.max(axis=0))
    return result


def _groups(hidden: np.ndarray, pixels: np.ndarray, nearest: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pixels with the same lights to ask, and these lights, nearest first.

    Where too few of the nearest lights say anything, twice as many are looked at, and so on.
    """
    reach = _NEIGHBOURS
    while len(pixels):
        asked = nearest[:reach]
        open_ = ~hidden[asked[:, None], pixels]
        enough = np.ones(len(pixels), bool) if reach >= len(nearest) else open_.sum(axis=0) >= _FEWEST
        patterns, group = np.unique(np.packbits(open_[:, enough], axis=0), axis=1, return_inverse=True)
        for index, pattern in enumerate(patterns.T):
            bits = np.unpackbits(pattern, count=len(asked)).astype(bool)
            yield pixels[enough][group.ravel() == index], asked[bits][:_NEIGHBOURS]
        pixels, reach = pixels[~enough], reach * 2


def _weights(chords: np.ndarray, light: int, used: np.ndarray) -> np.ndarray:
    """Weights (K,) that sum to 1: ordinary kriging, whose mean is unknown and held by a Lagrange multiplier."""
    count = len(used)
    system = np.ones((count + 1, count + 1))
    system[:count, :count] = _covariance(chords[np.ix_(used, used)]) + _NUGGET * np.eye(count)
    system[count, count] = 0
    return np.linalg.solve(system, np.append(_covariance(chords[used, light]), 1.0))[:count]


def _covariance(chords: np.ndarray) -> np.ndarray:
    """Matérn's of order 3/2, for functions with one derivative; smoother or rougher kernels are no better here."""
    scaled = np.sqrt(3) * chords / _CORRELATION_LENGTH
    return (1 + scaled) * np.exp(-scaled)


def _require_something(masked: np.ndarray, wanted: range) -> None:
    """Raises ValueError where a pixel of a wanted light is masked under every light."""
    nothing = masked.all(axis=0)
    if len(wanted) and nothing.any():
        row, column = np.argwhere(nothing)[0]
        raise ValueError(
            f"{int(nothing.sum())} pixels are masked under all {len(masked)} lights, the first in column {column} of "
            f"row {row} of the block, so no sample shows what they look like; leave them unmasked"
        )
