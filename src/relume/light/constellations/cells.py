"""A map's light summed up in the cells of a lat-long grid: what every constellation is made from.

Cells hold sums, not samples: whatever is made of whole cells carries its light exactly. A map of another mapping is
not remapped for it: each of its pixels goes to the cell it points into.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads
from relume.image.colour import LUMINANCE_WEIGHTS
from relume.image.kernel import kernel
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions, shown

MOST_ROWS = 512
"""Cells from pole to pole, at most: 0.35° each, far less than what a light stands for."""


@dataclass(frozen=True, eq=False)
class Cells:
    """The light in each cell of a grid of R × C, in double precision.

    flux : (R, C, 3), ∫ L dω
    moment : (R, C, 3), ∫ Y ω dω, weighted by luminance
    areas : (R, C), steradians of the pixels in each cell
    polar, longitude : (R + 1,), (C + 1,), radians of the edges, from +Y down and from −Z to the right
    of_pixels : the map's rows and columns, and the number of each pixel's cell, −1 where the image shows nothing;
        or how many pixels each side a cell of a lat-long map has
    """

    flux: np.ndarray
    moment: np.ndarray
    areas: np.ndarray
    polar: np.ndarray
    longitude: np.ndarray
    shape: tuple[int, int]
    of_pixels: np.ndarray | int

    @property
    def luminance(self) -> np.ndarray:
        """∫ Y dω of every cell, (R, C)."""
        return self.flux @ LUMINANCE_WEIGHTS

    def directions(self) -> np.ndarray:
        """The middles of the cells, (R, C, 3), unit."""
        polar, longitude = (self.polar[:-1] + self.polar[1:]) / 2, (self.longitude[:-1] + self.longitude[1:]) / 2
        ring = np.sin(polar)[:, None]
        up = np.broadcast_to(np.cos(polar)[:, None], (len(polar), len(longitude)))
        return np.stack([ring * np.sin(longitude), up, -ring * np.cos(longitude)], axis=-1)

    def in_pixels(self, values: np.ndarray) -> np.ndarray:
        """What cells hold (R, C), at every pixel of the map; −1 where its image shows none."""
        if isinstance(self.of_pixels, int):
            tall = np.repeat(values, self.of_pixels, axis=0)[: self.shape[0]]
            return np.repeat(tall, self.of_pixels, axis=1)[:, : self.shape[1]]
        return np.append(values.ravel(), np.asarray(-1, values.dtype))[self.of_pixels]


def cells_of(light: EnvironmentMap, most: int = MOST_ROWS) -> Cells:
    """The light of a map in cells, `most` from pole to pole at most; a pixel each where the map is a small lat-long."""
    if not isinstance(light.mapping, LatLong):
        return _gathered(light, most)
    radiance = np.ascontiguousarray(light.radiance, np.float32)
    rows, columns = radiance.shape[:2]
    block = -(-rows // most)
    areas = np.ascontiguousarray(light.mapping.solid_angles(rows)[:, 0])
    polar, longitude = np.pi * (np.arange(rows) + 0.5) / rows, np.pi * ((np.arange(columns) + 0.5) / rows - 1)
    across, along = np.sin(longitude), -np.cos(longitude)
    high, wide = -(-rows // block), -(-columns // block)
    sums = np.empty((high, wide, 6))
    in_threads(
        lambda begin, end: _sum_blocks(
            radiance, areas, LUMINANCE_WEIGHTS, np.sin(polar), np.cos(polar), across, along, block, begin, end, sums
        ),
        high,
        chunk=16,
    )
    edges = np.minimum(np.arange(high + 1) * block, rows) * np.pi / rows
    sides = (np.minimum(np.arange(wide + 1) * block, columns) / rows - 1) * np.pi
    solid = (np.cos(edges[:-1]) - np.cos(edges[1:]))[:, None] * np.diff(sides)
    return Cells(sums[..., :3], sums[..., 3:], solid, edges, sides, (rows, columns), block)


def _gathered(light: EnvironmentMap, most: int) -> Cells:
    """The cells of a map in another mapping: as many as it has pixels, so that most have one."""
    directions, areas = pixel_directions(light.mapping, light.size), light.mapping.solid_angles(light.size)
    seen = shown(areas)
    rows = int(np.clip(np.sqrt(np.count_nonzero(seen) / 2), 1, most))
    points = LatLong().image_points(directions) * (2 * rows, rows)
    column, row = np.moveaxis(np.clip(points, 0, (2 * rows - 1, rows - 1)).astype(np.int64), -1, 0)
    number = np.where(seen, row * 2 * rows + column, -1)
    flat, solid = number[seen], areas[seen]

    def summed(values: np.ndarray) -> np.ndarray:
        return np.bincount(flat, values, 2 * rows * rows).reshape(rows, 2 * rows)

    flux = light.radiance[seen].astype(np.float64) * solid[:, None]
    moment = directions[seen] * (flux @ LUMINANCE_WEIGHTS)[:, None]
    return Cells(
        np.stack([summed(flux[:, k]) for k in range(3)], axis=-1),
        np.stack([summed(moment[:, k]) for k in range(3)], axis=-1),
        summed(solid),
        np.linspace(0, np.pi, rows + 1),
        np.linspace(-np.pi, np.pi, 2 * rows + 1),
        (light.radiance.shape[0], light.radiance.shape[1]),
        number,
    )


@kernel
def _sum_blocks(radiance, areas, weights, ring, up, across, along, block, begin, end, sums):
    rows, columns = radiance.shape[:2]
    red_weight, green_weight, blue_weight = weights[0], weights[1], weights[2]
    for i in range(begin, end):
        sums[i] = 0
        for row in range(i * block, min((i + 1) * block, rows)):
            area = areas[row]
            for j in range(sums.shape[1]):
                red = green = blue = right = back = 0.0
                for column in range(j * block, min((j + 1) * block, columns)):
                    r, g = np.float64(radiance[row, column, 0]), np.float64(radiance[row, column, 1])
                    b = np.float64(radiance[row, column, 2])
                    red, green, blue = red + r, green + g, blue + b
                    pixel = red_weight * r + green_weight * g + blue_weight * b
                    right += pixel * across[column]
                    back += pixel * along[column]
                sums[i, j, 0] += area * red
                sums[i, j, 1] += area * green
                sums[i, j, 2] += area * blue
                sums[i, j, 3] += area * ring[row] * right
                pixel = red_weight * red + green_weight * green + blue_weight * blue
                sums[i, j, 4] += area * up[row] * pixel
                sums[i, j, 5] += area * ring[row] * back
