"""The sun taken out of a map: a distant light, and the map without it (course slides 5; Debevec 2005).

A sun, or a lamp, is a compact patch far brighter than everything else. Its pixels are filled from what surrounds them,
and the light carries what that takes away: both together have the map's light exactly, in every channel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import SunNotFound
from relume.image.colour import LUMINANCE_WEIGHTS, luminance
from relume.image.radiance import SATURATED
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.residual import glow_level
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.inpainting import mean_by_distance
from relume.sphere.mappings.mapping import LatLong, shown

FINEST = np.pi / 512
"""Radians: pixels that are no farther than that from touching are of one source."""
PLATEAU = 4
"""Times the largest pixel: so much of the very same, highest value is no chance; it clipped, or was drawn."""
LEAST = 0.01
"""Of the map's light: a source with less is a glint or a star, not what lights the place."""
RING = 3
"""Pixels round a patch that it is filled from."""
MOST_ROUND = 2000
"""Pixels of the ring, at most; more make a fill no smoother."""


@dataclass(frozen=True, eq=False)
class Sun:
    """A compact source as parallel light.

    direction : (3,), unit, towards its middle
    irradiance : (3,), on a surface that faces it, in the map's unit times sr; lux where that is cd/m²
    angular_radius : radians of an even disc as bright as its brightest pixel that gives this light
    share : of the map's light, by luminance
    clipped : the map says that its radiance is a lower bound
    flat : its highest radiance is the very same over several pixels, as where a photograph clipped unmarked
    """

    direction: np.ndarray
    irradiance: np.ndarray
    angular_radius: float
    share: float
    clipped: bool
    flat: bool


@dataclass(frozen=True, eq=False)
class Extracted:
    """Suns, the strongest first, and the map without them."""

    suns: tuple[Sun, ...]
    rest: EnvironmentMap

    def lights(self) -> Constellation:
        """The suns as a constellation."""
        radii = np.array([sun.angular_radius for sun in self.suns])
        return Constellation(
            np.stack([sun.direction for sun in self.suns]),
            np.stack([sun.irradiance for sun in self.suns]),
            radii,
            4 * np.pi * np.sin(radii / 2) ** 2,
        )


def extract_sun(
    light: EnvironmentMap, count: int = 1, contrast: float = 16.0, widest: float = np.radians(5)
) -> Extracted:
    """The strongest compact source of a map, or the `count` strongest, and the map without it.

    light : in any mapping, which the rest keeps; what was saturated there and is filled is no longer marked so
    count : sources at most; fewer where fewer stand out
    contrast : how many times brighter than the mean of all that is not a source a source has to be. 16, four stops,
        is more than sky, lit ground and walls differ by
    widest : angular radius in radians of an even disc as spread out as what is still compact: 5° is a lamp near by; a
        window is not parallel light

    Raises SunNotFound where none stands out, ValueError for a count, a contrast or a width that cannot be.
    """
    if count < 1 or not contrast > 1 or not widest > 0:
        raise ValueError(
            f"{count} suns, {contrast} times brighter than the rest, {widest} rad wide; expected 1 or more suns, more "
            "than 1 time, a positive angle"
        )
    values, areas = luminance(light.radiance), light.mapping.solid_angles(light.size)
    level = glow_level(values, areas, contrast)
    bright = (values > level) & shown(areas)
    patches = _patches(light, bright)
    whole = float(light.total() @ LUMINANCE_WEIGHTS)
    rest, suns, wide = light.radiance.astype(np.float32), [], 0.0
    # Fill first and measure then: what the fill takes away is what the sun gives.
    patches.sort(key=lambda patch: -float(np.sum((values[patch] - level) * areas[patch])))
    for patch in patches:
        if len(suns) == count:
            break
        if float(np.sum(values[patch] * areas[patch])) < LEAST * whole:
            continue
        # A ring of compression artefacts may have a channel far above the level; the fill must be no source itself.
        fill = np.minimum(np.minimum(_filled(light, patch, bright), np.float32(level)), light.radiance[patch])
        sun, reach = _sun(light, patch, fill, whole)
        if reach > widest:
            wide = max(wide, reach)
        elif sun.share >= LEAST:
            rest[patch] = fill
            suns.append(sun)
    if not suns:
        raise SunNotFound(_why_no_sun(float(values.max(initial=0)), level, wide, contrast))
    clipped = light.clipped
    if clipped is not None:
        clipped = np.where(np.any(rest != light.radiance, axis=-1) & (clipped == SATURATED), 0, clipped)
        clipped = clipped.astype(np.uint8)
    suns.sort(key=lambda sun: -sun.share)
    return Extracted(tuple(suns), EnvironmentMap(rest, light.mapping, light.unit, clipped))


def _patches(light: EnvironmentMap, bright: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The bright pixels that hang together on the sphere, whatever their mapping: rows and columns of each patch."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    rows, columns = np.nonzero(bright)
    if not len(rows):
        return []
    directions, extents = _directions_of(light, (rows, columns)), _extents_of(light, (rows, columns))
    # Of large maps, and round the poles of a lat-long, many pixels lie in one little cube: they count as one.
    cubes = np.floor(directions / FINEST).astype(np.int64) + 1024
    _, cube, held = np.unique(cubes @ [2**22, 2**11, 1], return_inverse=True, return_counts=True)
    middles = np.stack([np.bincount(cube, directions[:, k]) for k in range(3)], axis=-1) / held[:, None]
    reach = np.zeros(len(held))
    np.maximum.at(reach, cube, extents)
    near = KDTree(middles).query_ball_point(middles, 1.3 * reach + FINEST)
    ends = np.repeat(np.arange(len(held)), [len(each) for each in near])
    links = coo_array((np.ones(len(ends), np.int8), (ends, np.concatenate(near).astype(np.int64))), (len(held),) * 2)
    number, labels = connected_components(links, directed=False)
    order = np.argsort(labels[cube], kind="stable")
    breaks = np.cumsum(np.bincount(labels[cube], minlength=number))[:-1]
    return list(zip(np.split(rows[order], breaks), np.split(columns[order], breaks), strict=True))


def _sun(
    light: EnvironmentMap, patch: tuple[np.ndarray, np.ndarray], fill: np.ndarray, whole: float
) -> tuple[Sun, float]:
    """What a patch has more than its fill, as parallel light; and the radius of an even disc that is as spread out."""
    areas = light.mapping.solid_angles(light.size)[patch]
    values = light.radiance[patch]
    excess = values.astype(np.float64) - fill
    flux = excess * areas[:, None]
    strength = flux @ LUMINANCE_WEIGHTS
    moment = strength @ _directions_of(light, patch)
    length, amount = float(np.linalg.norm(moment)), float(strength.sum())
    disc = amount / max(float((excess @ LUMINANCE_WEIGHTS).max()), 1e-300)
    clipped = light.clipped is not None and bool(np.any(light.clipped[patch] == SATURATED))
    highest = np.all(values == values[np.argmax(luminance(values))], axis=-1)
    flat = bool(areas[highest].sum() >= PLATEAU * light.mapping.solid_angles(light.size).max())
    # The solid angle of a disc of angular radius a is 4π sin²(a/2).
    radius = 2 * float(np.arcsin(np.sqrt(min(disc / (4 * np.pi), 1.0))))
    reach = 2 * float(np.arcsin(np.sqrt(np.clip(1 - length / max(amount, 1e-300), 0, 1))))
    sun = Sun(moment / max(length, 1e-300), flux.sum(axis=0), radius, amount / whole, clipped, flat)
    return sun, max(reach, radius)


def _why_no_sun(highest: float, level: float, wide: float, contrast: float) -> str:
    if wide:
        return (
            f"no sun stands out: the brightest source is {2 * np.degrees(wide):.0f}° wide, no parallel light; "
            "make a constellation of the map instead"
        )
    if highest > level:
        return "no sun stands out: what is far brighter than the rest gives too little light; make a constellation"
    return (
        f"no sun stands out: nothing is {contrast:g} times brighter than the rest; it may have clipped, or be hidden; "
        "make a constellation of the map instead"
    )


def _filled(light: EnvironmentMap, patch: tuple[np.ndarray, np.ndarray], bright: np.ndarray) -> np.ndarray:
    """Radiance (M, 3) float32 for the pixels of a patch, from those round it that are not bright.

    patch : rows and columns
    bright : (rows, columns), what belongs to a source, this or another

    Each pixel is the mean of the ring, weighted by 1/distance⁴ on the sphere (Shepard 1968): near the rim it is what is
    there, so that no edge shows, and a horizon goes through. Black where nothing surrounds it.
    """
    ring = _ring(light, patch, bright)
    if not len(ring[0]):
        return np.zeros((len(patch[0]), 3), np.float32)
    step = -(-len(ring[0]) // MOST_ROUND)
    ring = (ring[0][::step], ring[1][::step])
    around, inside = _directions_of(light, ring), _directions_of(light, patch)
    return mean_by_distance(inside, around, light.radiance[ring], power=4).astype(np.float32)


def _directions_of(
    light: EnvironmentMap, pixels: tuple[np.ndarray, np.ndarray], down: float = 0.5, right: float = 0.5
) -> np.ndarray:
    """The unit directions (M, 3) of some pixels given by row and column: of their middles, or of other points."""
    rows, columns = light.radiance.shape[:2]
    points = np.stack([(pixels[1] + right) / columns, (pixels[0] + down) / rows], axis=-1)
    return light.mapping.directions(light.mapping.shown(points))


def _extents_of(light: EnvironmentMap, pixels: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The longer side of each pixel on the sphere, a chord (M,): near the rims of discs they are long and thin."""
    high = _directions_of(light, pixels, down=0.99) - _directions_of(light, pixels, down=0.01)
    wide = _directions_of(light, pixels, right=0.99) - _directions_of(light, pixels, right=0.01)
    return np.maximum(np.linalg.norm(high, axis=-1), np.linalg.norm(wide, axis=-1))


def _ring(
    light: EnvironmentMap, patch: tuple[np.ndarray, np.ndarray], bright: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The pixels round a patch, in its image; in a lat-long round the seam too."""
    rows, columns = bright.shape
    near = np.zeros_like(bright)
    for down in range(-RING, RING + 1):
        for across in range(-RING, RING + 1):
            row, column = patch[0] + down, patch[1] + across
            if isinstance(light.mapping, LatLong):
                column = column % columns
            inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            near[row[inside], column[inside]] = True
    row, column = np.nonzero(near & ~bright & shown(light.mapping.solid_angles(rows)))
    return row, column
