"""Directions drawn in proportion to a map's brightness, with their density: for Monte Carlo sums over its light.

A pixel is chosen by inverting the running sums of brightness × solid angle, first over rows, then along one; within
the pixel every direction is equally likely, so that the density over solid angle is the same all over it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from relume.image.bands import in_threads
from relume.image.colour import luminance
from relume.image.kernel import exact_kernel, exact_small
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, Mapping

_ROUNDS = 100_000
"""Draws after which something must be wrong: the least likely pixel needs some thousand."""
# A hair within the pixel: beyond its edge another face of a cube may begin.
_EDGES = np.array([1e-6, 0.25, 0.5, 0.75, 1 - 1e-6])
_CORNERS = np.stack(np.meshgrid(_EDGES, _EDGES), axis=-1).reshape(-1, 2)
"""Points of a pixel whose directions show how far it reaches."""
_MARGIN = 0.1
"""Share of its extent by which a pixel's box is widened each way: its edges are curved between those points. Twice
what the mirror ball's rim needs."""
_WIDE = 0.1
"""Cosine from its middle to which a pixel reaches in a map of hardly any pixels: its box is the sphere."""


@dataclass(frozen=True, eq=False)
class EnvironmentSampler:
    """Importance sampling of an environment map, in any mapping.

    light : the map; pixels without brightness are never drawn
    brightness : of radiance (…, 3), (…), finite and not below 0; luminance, so that what is seen is least noisy. For
        an unbiased sum of all channels it must not be 0 where any of them is not

    Raises ValueError for a map without any brightness: there is nothing to draw.
    """

    light: EnvironmentMap
    brightness: Callable[[np.ndarray], np.ndarray] = luminance

    def __post_init__(self) -> None:
        values = self._values
        if not (np.all(np.isfinite(values)) and values.min() >= 0):
            raise ValueError("brightness is negative or not finite somewhere; it must be finite and 0 or more")
        if self._marginal[-1] <= 0:
            raise ValueError("the map is black all over; there is no direction to draw from it")

    def sample(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unit directions (N, 3) and their density per steradian (N,), both float64.

        u : (N, 2) numbers in [0, 1), independent or well spread; the same ones give the same directions. The second
            chooses the row, the first the place along it, so that neighbours in u are neighbours in the map

        Raises ValueError for another shape, or numbers outside.
        """
        u = np.ascontiguousarray(u, np.float64)
        if u.ndim != 2 or u.shape[1] != 2:
            raise ValueError(f"u has shape {u.shape}; expected (N, 2)")
        if u.size and not (u.min() >= 0 and u.max() < 1):
            raise ValueError(f"u lies in [{u.min()}, {u.max()}]; expected [0, 1)")
        marginal, conditional = self._marginal, self._conditional
        rows, columns, within = np.empty(len(u), np.int64), np.empty(len(u), np.int64), np.empty((len(u), 2))
        in_threads(lambda begin, end: _choose(u, marginal, conditional, rows, columns, within, begin, end), len(u))
        density = self._density[rows, columns]
        if isinstance(self.light.mapping, LatLong):
            return _within_latlong(rows, columns, within, self.light.size), density
        return _within_pixels(self.light.mapping, self.light.size, rows, columns, within), density

    def pdf(self, directions: np.ndarray) -> np.ndarray:
        """The density per steradian (…,) with which `sample` draws unit directions (…, 3); ∫ pdf dω = 1."""
        rows, columns = self._density.shape
        j, i = _pixels(self.light.mapping, np.asarray(directions, np.float64), rows, columns)
        return np.where(j >= 0, self._density[j, i], 0.0)

    @cached_property
    def _values(self) -> np.ndarray:
        return np.asarray(self.brightness(self.light.radiance), np.float64)

    @cached_property
    def _areas(self) -> np.ndarray:
        return self.light.mapping.solid_angles(self.light.size)

    @cached_property
    def _conditional(self) -> np.ndarray:
        """Running sums of brightness × solid angle along every row: (rows, columns + 1), from 0."""
        sums = np.zeros((self._values.shape[0], self._values.shape[1] + 1))
        np.cumsum(self._values * self._areas, axis=1, out=sums[:, 1:])
        return sums

    @cached_property
    def _marginal(self) -> np.ndarray:
        """Running sums over rows: (rows + 1,), from 0."""
        return np.concatenate([[0.0], np.cumsum(self._conditional[:, -1])])

    @cached_property
    def _density(self) -> np.ndarray:
        return np.where(self._areas > 0, self._values / self._marginal[-1], 0.0)


def _pixels(mapping: Mapping, directions: np.ndarray, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Row and column (…) of the pixels that show directions (…, 3); −1 where none does."""
    points = mapping.image_points(directions)
    seen = ~np.isnan(points[..., 0])
    scaled = np.where(seen[..., None], points, 0) * (columns, rows)
    i, j = (np.clip(scaled[..., k].astype(int), 0, (columns, rows)[k] - 1) for k in (0, 1))
    return np.where(seen, j, -1), i


def _within_latlong(rows: np.ndarray, columns: np.ndarray, within: np.ndarray, size: int) -> np.ndarray:
    """Directions uniform over the pixels of a lat-long map: uniform in longitude and in the height y."""
    longitude = (columns + within[:, 0]) * (np.pi / size) - np.pi
    heights = np.cos(np.pi / size * np.arange(size + 1))
    y = heights[rows] + within[:, 1] * (heights[rows + 1] - heights[rows])
    ring = np.sqrt(np.maximum(1 - y * y, 0))
    return np.stack([ring * np.sin(longitude), y, -ring * np.cos(longitude)], axis=-1)


def _within_pixels(
    mapping: Mapping, size: int, rows: np.ndarray, columns: np.ndarray, within: np.ndarray
) -> np.ndarray:
    """Directions uniform over pixels of any mapping: drawn in a box about the pixel until one falls inside."""
    shape = mapping.shape(size)
    pixels, inverse = np.unique(rows * shape[1] + columns, return_inverse=True)
    boxes = pixel_boxes(mapping, size, *np.divmod(pixels, shape[1]))
    frames, low, high = (part[inverse] for part in boxes)
    directions = np.empty((len(rows), 3))
    waiting, numbers = np.arange(len(rows)), within
    for turn in range(_ROUNDS):
        longitude, height = np.moveaxis(low[waiting] + numbers * (high[waiting] - low[waiting]), -1, 0)
        ring = np.sqrt(np.maximum(1 - height * height, 0))
        local = np.stack([ring * np.cos(longitude), ring * np.sin(longitude), height], axis=-1)
        drawn = np.einsum("nij,ni->nj", frames[waiting], local)
        directions[waiting] = drawn
        j, i = _pixels(mapping, drawn, *shape)
        missed = (j != rows[waiting]) | (i != columns[waiting])
        waiting = waiting[missed]
        if not waiting.size:
            return directions
        numbers = _hashed(within[waiting], turn)
    raise RuntimeError(f"{len(waiting)} pixels of a {mapping.name} map could not be found again in it")


def pixel_boxes(
    mapping: Mapping, size: int, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A box of directions round each of N pixels: frames (N, 3, 3), lowest and highest (N, 2).

    The rows of a frame are its middle, its long axis and its pole. The box is bounded by longitudes along the long
    axis and by heights, the sine of the latitude, so that what is uniform in both is uniform in solid angle.
    """
    shape = np.array(mapping.shape(size))[::-1]
    points = (np.stack([columns, rows], axis=-1)[:, None] + _CORNERS) / shape
    shown = mapping.directions(mapping.shown(points))
    missing = np.isnan(shown[..., :1])
    middles = np.where(missing, 0, shown).sum(1) / (~missing).sum(1)
    middles /= np.maximum(np.linalg.norm(middles, axis=-1, keepdims=True), 1e-300)
    wide = np.nanmin((shown * middles[:, None]).sum(-1), axis=-1) < _WIDE
    middles[wide] = (0.0, 0.0, 1.0)
    spread = np.where(missing, 0, shown - middles[:, None])
    _, axes = np.linalg.eigh(np.einsum("npi,npj->nij", spread, spread))
    along = axes[..., 2] - (axes[..., 2] * middles).sum(-1, keepdims=True) * middles
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    frames = np.stack([middles, along, np.cross(middles, along)], axis=1)
    local = np.einsum("nij,npj->npi", frames, np.where(missing, middles[:, None], shown))
    extents = np.stack([np.arctan2(local[..., 1], local[..., 0]), local[..., 2]], axis=-1)
    low, high = extents.min(1), extents.max(1)
    margin = _MARGIN * np.maximum(high - low, 0.2 * (high - low).max(-1, keepdims=True))
    frames[wide], low[wide], high[wide] = np.eye(3), (-np.pi, -1), (np.pi, 1)
    return frames, np.maximum(low - margin, [-np.pi, -1]), np.minimum(high + margin, [np.pi, 1])


def _hashed(numbers: np.ndarray, turn: int) -> np.ndarray:
    """New numbers in [0, 1) that look independent of these, (N, 2): SplitMix64 of their bits (Steele et al. 2014)."""
    bits = np.ascontiguousarray(numbers).view(np.uint64)
    mixed = bits ^ (bits[:, ::-1] * np.uint64(0xD1342543DE82EF95))
    mixed += np.array([(turn + 1) * 0x9E3779B97F4A7C15 % 2**64, (turn + 1) * 0xC2B2AE3D27D4EB4F % 2**64], np.uint64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    mixed ^= mixed >> np.uint64(31)
    return (mixed >> np.uint64(11)) * 2.0**-53


# Sums must be compared as they are: a black pixel whose ends were rounded apart could be drawn.
@exact_kernel
def _choose(u, marginal, conditional, rows, columns, within, begin, end):
    for n in range(begin, end):
        value = u[n, 1] * marginal[-1]
        row = _last_not_above(marginal, value)
        rows[n] = row
        within[n, 1] = _place(marginal, row, value)
        value = u[n, 0] * conditional[row, -1]
        column = _last_not_above(conditional[row], value)
        columns[n] = column
        within[n, 0] = _place(conditional[row], column, value)


@exact_small
def _last_not_above(sums, value):
    """The last k with sums[k] ≤ value < sums[k + 1]: never a step without height."""
    low, high = 0, len(sums) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if sums[middle] <= value:
            low = middle
        else:
            high = middle
    # u·total may round up to the total; the last step with height is meant.
    while low > 0 and sums[low + 1] <= sums[low]:
        low -= 1
    return low


@exact_small
def _place(sums, k, value):
    """Where in the step the value lies, below 1 also after rounding."""
    return min(max((value - sums[k]) / (sums[k + 1] - sums[k]), 0.0), 1 - 2.0**-53)
