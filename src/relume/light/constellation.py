"""Constellation of lights: distant lights that stand for an illumination map, by median cut (Debevec 2005).

The map is cut into rectangles, across their longer side where that halves their light, and a light stands in the
middle of the light of each. Debevec cuts every rectangle equally often, so that all lights are alike strong; here
the next to be cut is the one of the largest product of strength and extent: any number of lights is possible, and a
sun with a rectangle of its own is not cut up any further while the sky is still coarse (of 64 lights under a clear
sky, irradiance errs by 0.8 % instead of 1.2 %).
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from relume._kernel import in_threads, kernel
from relume.image.colour import LUMINANCE_WEIGHTS
from relume.sphere.illumination import IlluminationMap
from relume.sphere.mappings import LatLong

DARK = 1e-12
"""A rectangle with less than this share of the light may owe it to the rounding of running sums: it is looked at."""

Rectangle = tuple[int, int, int, int]
"""Top, bottom, left and right: rows and columns from and up to, the latter excluded."""


@dataclass(frozen=True, eq=False)
class Constellation:
    """Parallel lights, in the order of falling strength times extent.

    directions : (N, 3) float64, unit, towards the lights
    irradiance : (N, 3) float64, on a surface that faces the light; their sum is the map's ∫ L dω
    """

    directions: np.ndarray
    irradiance: np.ndarray


def constellation(light: IlluminationMap, count: int = 64) -> Constellation:
    """At most `count` lights with all of a map's light, each in the mean direction of the light it stands for.

    They are fewer only where the map has fewer bright pixels; a black map has none. A map in another mapping is
    remapped to a lat-long of as many rows.

    Raises ValueError when no light is asked for.
    """
    if count < 1:
        raise ValueError(f"a constellation of {count} lights; expected 1 or more, like 64")
    latlong = light if isinstance(light.mapping, LatLong) else light.remapped(LatLong())
    radiance = np.ascontiguousarray(latlong.radiance, np.float32)
    areas = np.ascontiguousarray(LatLong().solid_angles(light.size)[:, 0])
    rectangles = _cut(radiance, _running_sums(radiance, areas), count)
    sums = in_threads(
        lambda n, _: _gathered(radiance, areas, LUMINANCE_WEIGHTS, *rectangles[n]), len(rectangles), chunk=1
    )
    moments = np.reshape([moment for _, moment in sums], (-1, 3))
    lengths = np.linalg.norm(moments, axis=-1, keepdims=True)
    # Light from everywhere alike has no mean direction; the middle of its rectangle is as good as any.
    middles = np.reshape([_middle(rectangle, light.size) for rectangle in rectangles], (-1, 3))
    strengths = np.reshape([flux @ LUMINANCE_WEIGHTS for flux, _ in sums], (-1, 1))
    directions = np.where(lengths > 1e-6 * strengths, moments / np.maximum(lengths, 1e-300), middles)
    irradiance = np.reshape([flux for flux, _ in sums], (-1, 3))
    if latlong is not light:
        # Pixels were rounded on the way to the lat-long map.
        irradiance = irradiance * light.total() / np.maximum(irradiance.sum(0), 1e-300)
    return Constellation(directions, irradiance)


def _cut(radiance: np.ndarray, table: np.ndarray, count: int) -> list[Rectangle]:
    """The rectangles of the map, none of them black."""
    rows, columns = radiance.shape[:2]

    def black(rectangle: Rectangle) -> bool:
        top, bottom, left, right = rectangle
        little = _strength(table, rectangle) <= DARK * table[-1, -1]
        return bool(little) and not radiance[top:bottom, left:right].any()

    def entry(rectangle: Rectangle) -> tuple[float, Rectangle]:
        return -_strength(table, rectangle) * max(_extent(rectangle, rows)), rectangle

    whole = (0, rows, 0, columns)
    waiting, done = [] if black(whole) else [entry(whole)], []
    while waiting and len(waiting) + len(done) < count:
        first = heapq.heappop(waiting)
        top, bottom, left, right = first[1]
        if bottom - top == right - left == 1:
            done.append(first)
            continue
        for half in _halves(table, first[1]):
            if not black(half):
                heapq.heappush(waiting, entry(half))
    return [rectangle for _, rectangle in sorted(waiting + done)]


def _strength(table: np.ndarray, rectangle: Rectangle) -> float:
    top, bottom, left, right = rectangle
    return max(float(table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left]), 0.0)


def _halves(table: np.ndarray, rectangle: Rectangle) -> tuple[Rectangle, Rectangle]:
    """A rectangle cut across its longer side, where the light of both halves is most nearly the same."""
    top, bottom, left, right = rectangle
    height, width = _extent(rectangle, len(table) - 1)
    if right - left == 1 or (height >= width and bottom - top > 1):
        before = table[top + 1 : bottom, right] - table[top + 1 : bottom, left]
        start, whole = table[top, right] - table[top, left], table[bottom, right] - table[bottom, left]
        middle = top + 1 + int(np.argmin(np.abs(before - (start + whole) / 2)))
        return (top, middle, left, right), (middle, bottom, left, right)
    before = table[bottom, left + 1 : right] - table[top, left + 1 : right]
    start, whole = table[bottom, left] - table[top, left], table[bottom, right] - table[top, right]
    middle = left + 1 + int(np.argmin(np.abs(before - (start + whole) / 2)))
    return (top, bottom, left, middle), (top, bottom, middle, right)


def _extent(rectangle: Rectangle, rows: int) -> tuple[float, float]:
    """Radians that a rectangle is high and wide, the latter along its middle row."""
    top, bottom, left, right = rectangle
    pixel = np.pi / rows
    return pixel * (bottom - top), pixel * (right - left) * float(np.sin(pixel * (top + bottom) / 2))


def _middle(rectangle: Rectangle, rows: int) -> np.ndarray:
    top, bottom, left, right = rectangle
    return LatLong().directions(np.array([(left + right) / (4 * rows), (top + bottom) / (2 * rows)]))


def _running_sums(radiance: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """The summed-area table of luminance × solid angle, (H + 1, W + 1): entry (i, j) is of rows < i, columns < j."""
    rows, columns = radiance.shape[:2]
    table = np.empty((rows + 1, columns + 1))
    table[0], table[:, 0] = 0, 0
    in_threads(lambda begin, end: _sum_along(radiance, areas, LUMINANCE_WEIGHTS, table, begin, end), rows, chunk=64)
    in_threads(lambda begin, end: _sum_down(table, begin, end), columns, chunk=512)
    return table


@kernel
def _sum_along(radiance, areas, weights, table, begin, end):
    red, green, blue = weights[0], weights[1], weights[2]
    for i in range(begin, end):
        running = 0.0
        for k in range(radiance.shape[1]):
            pixel = red * radiance[i, k, 0] + green * radiance[i, k, 1] + blue * radiance[i, k, 2]
            running += areas[i] * pixel
            table[i + 1, k + 1] = running


@kernel
def _sum_down(table, begin, end):
    for i in range(2, table.shape[0]):
        for k in range(begin + 1, end + 1):
            table[i, k] += table[i - 1, k]


@kernel
def _gathered(radiance, areas, weights, top, bottom, left, right):
    """∫ L dω (3,) of a rectangle, and ∫ ω dω weighted by luminance (3,), both float64."""
    rows = radiance.shape[0]
    flux, moment = np.zeros(3), np.zeros(3)
    pixel = np.pi / rows
    longitudes = pixel * (np.arange(left, right) + 0.5) - np.pi
    sines, cosines = np.sin(longitudes), np.cos(longitudes)
    for i in range(top, bottom):
        red = green = blue = across = along = 0.0
        for k in range(left, right):
            r, g, b = np.float64(radiance[i, k, 0]), np.float64(radiance[i, k, 1]), np.float64(radiance[i, k, 2])
            red, green, blue = red + r, green + g, blue + b
            luminance = weights[0] * r + weights[1] * g + weights[2] * b
            across += luminance * sines[k - left]
            along += luminance * cosines[k - left]
        polar = pixel * (i + 0.5)
        ring = np.sin(polar) * areas[i]
        flux += areas[i] * np.array((red, green, blue))
        luminance = weights[0] * red + weights[1] * green + weights[2] * blue
        moment += np.array((ring * across, np.cos(polar) * areas[i] * luminance, -ring * along))
    return flux, moment
