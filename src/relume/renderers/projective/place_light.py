"""The light of a baked place: what arrives at a point, its lamps and windows, and surfaces of it that take light.

*Fiat Lux* (Debevec 1999) took the bright windows of a basilica out of its radiance and put area lights where they are:
what they light is then without noise, and the glow that is left is even.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.ndimage import binary_dilation, label

from relume.errors import warn
from relume.image.colour import luminance
from relume.light.constellations.residual import glow_level
from relume.renderers.projective.atlas import RIM
from relume.renderers.projective.baking import BakedMesh, BakedPlace, filled
from relume.renderers.raytrace.alpha_coverage import repeated
from relume.renderers.raytrace.raycast import Hits, RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.scene.lights import RectangleLight
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh

CLEAR = 1e-3
"""Metres by which a lamp hangs before the wall that it was part of."""
PANE = 0.5
"""Of a bright spot's own brightness, where it ends: what is dimmer, such as the bars of a window, parts its panes."""
LEAST_POWER = 0.01
"""Of the strongest spot's power, that a spot needs to be a lamp: others are the glow about it."""
BURIED = 0.05
"""Of a surface's median irradiance: a place that gets less lies below something that stands on it."""
SPOTS = 64
"""Places of a lamp that are looked at for the irradiance of a surface."""
PLACES = 1500
"""Of a surface whose irradiance is found; between them it changes smoothly."""


@dataclass(frozen=True, eq=False)
class PlaceLights:
    """A place's light in two parts, which together are its radiance.

    lights : rectangles where its windows and lamps are, brightest first; each shines with what is above `level`
    residual : the place with nothing brighter there
    level : luminance, in the place's unit
    """

    lights: tuple[RectangleLight, ...]
    residual: BakedPlace
    level: float


def place_lights(
    place: BakedPlace, count: int = 16, contrast: float = 4.0, leave_out: Sequence[str] = ()
) -> PlaceLights:
    """The windows and lamps of a place as rectangles of light in their places, and the glow that is left.

    place : as `bake` or `place_of` made it
    count : rectangles at most; dimmer spots stay in the residual
    contrast : what is brighter than so many times the mean of the residual is a lamp, as in `light.key_lights`
    leave_out : names of meshes that keep their bright spots, as sunlit ones that reflect what they get

    A bright spot becomes the rectangle of its second moments along the edges of the smallest rectangle about it, which
    sends out what the spot sends above the level.
    Raises ValueError for no lights and a negative contrast. Source: Debevec, *Fiat Lux* (SIGGRAPH 99).
    """
    if count < 1:
        raise ValueError(f"lights of the place are {count}; expected 1 or more, like 16")
    values = np.concatenate([luminance(part.radiance[part.used]) for part in place.parts])
    areas = np.concatenate([np.full(int(part.used.sum()), part.texel**2) for part in place.parts])
    level = glow_level(values, areas, contrast)
    sources = [part for part in place.parts if part.mesh.name not in leave_out]
    spots = sorted((spot for part in sources for spot in _spots(part, level)), key=lambda spot: -spot.power)
    kept = [spot for spot in spots[:count] if spot.power > LEAST_POWER * spots[0].power]
    parts = tuple(_without(part, [spot for spot in kept if spot.part is part], level) for part in place.parts)
    return PlaceLights(tuple(spot.light() for spot in kept), replace(place, parts=parts), level)


@dataclass(frozen=True, eq=False)
class _Spot:
    """A bright spot of a mesh.

    inside : (H, W) bool
    excess : (T, 3), radiance above the level
    """

    part: BakedMesh
    inside: np.ndarray
    excess: np.ndarray

    @property
    def power(self) -> float:
        return float(luminance(self.excess).sum() * self.part.texel**2)

    def light(self) -> RectangleLight:
        points = self.part.points[self.inside].astype(np.float64)
        normal = self.part.normals[self.part.faces[self.inside][0]]
        middle = points.mean(axis=0)
        sides = _edges(points - middle, normal, self.part.texel)
        # A rectangle's variance along a side is a twelfth of its square; a texel's own is in it.
        lengths = np.sqrt(12 * ((points - middle) @ sides.T).var(axis=0) + self.part.texel**2)
        (height, up), (width, _) = sorted(zip(lengths, sides, strict=True), key=lambda side: side[0])
        radiance = self.excess.sum(axis=0) * self.part.texel**2 / (width * height)
        return RectangleLight(
            triple(middle + CLEAR * normal), triple(normal), (float(width), float(height)), triple(radiance), triple(up)
        )


def _edges(points: np.ndarray, normal: np.ndarray, texel: float) -> np.ndarray:
    """Unit directions (2, 3) along the edges of a spot, of points (N, 3) on a surface of a normal.

    Those of the smallest rectangle about it: the axes of its moments are any two of a square, or of a disc.
    """
    along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    along /= np.linalg.norm(along)
    plane = np.stack([along, np.cross(normal, along)])
    corners = cv2.boxPoints(cv2.minAreaRect((points @ plane.T / texel).astype(np.float32)))
    edges = corners[1:3] - corners[:2]
    longest = edges[np.argmax(np.linalg.norm(edges, axis=1))].astype(np.float64)
    # A lone texel has no edge.
    along = longest / length if (length := np.linalg.norm(longest)) > 0 else np.array([1.0, 0.0])
    return np.stack([along, [-along[1], along[0]]]) @ plane


def _labelled(inside: np.ndarray) -> tuple[np.ndarray, int]:
    """The number (H, W) of the patch that each texel inside belongs to, from 1, and how many there are."""
    found = label(inside, np.ones((3, 3)))
    assert isinstance(found, tuple)
    return found


def _spots(part: BakedMesh, level: float) -> list[_Spot]:
    # More than rounding above it, where a spot was taken off already.
    bright = part.used & (luminance(part.radiance) > level * (1 + 1e-3))
    found, count = _labelled(bright)
    values, spots = luminance(part.radiance), []
    for number in range(1, count + 1):
        whole = found == number
        panes, most = _labelled(whole & (values > PANE * np.quantile(values[whole], 0.9)))
        for pane in range(1, most + 1):
            inside = panes == pane
            shown = part.radiance[inside].astype(np.float64)
            spots.append(_Spot(part, inside, shown * (1 - level / luminance(shown))[:, None]))
    return spots


def _without(part: BakedMesh, spots: Sequence[_Spot], level: float) -> BakedMesh:
    """The mesh with nothing above the level at these spots and on the rims beside them."""
    if not spots:
        return part
    inside = np.any([spot.inside for spot in spots], axis=0)
    inside |= binary_dilation(inside, iterations=RIM) & ~part.used
    values = luminance(part.radiance)
    share = np.where(inside, np.minimum(1, level / np.maximum(values, 1e-30)), 1)
    return part.shining(part.radiance * share[..., None])


class Arriving:
    """A place made ready to be asked what light arrives along rays."""

    def __init__(self, place: BakedPlace) -> None:
        self.caster, self.surfaces = RayCaster.of(place.meshes()), Surfaces.of(place.meshes())
        self.images = [repeated(part.radiance) for part in place.parts]

    def along(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """The radiance (N, 3) that comes against rays; 0 from where nothing is met, and from backs of surfaces."""
        hits = self.caster.nearest(origins, directions, beyond=CLEAR)
        found = np.zeros((len(directions), 3))
        met = np.flatnonzero(hits.shape >= 0)
        if not met.size:
            return found
        chosen = origins if np.ndim(origins) == 1 else origins[met]
        points = self.surfaces.at(chosen, directions[met], Hits(*(part[met] for part in hits)))
        front = np.einsum("ij,ij->i", points.geometric_normal, directions[met]) < 0
        for index, image in enumerate(self.images):
            here = np.flatnonzero(front & (hits.shape[met] == index))
            found[met[here]] = image(points.uv[here])
        return found


def place_irradiance(
    place: BakedPlace, points: np.ndarray, normals: np.ndarray, rays: int = 1024, leave_out: Sequence[str] = ()
) -> np.ndarray:
    """The irradiance (N, 3) that a place gives at points (N, 3) in it, of unit normals (N, 3): ∫ L cos θ dω.

    place : as `bake` or `place_of` made it
    points, normals : (N, 3) metres and (N, 3) unit, world
    rays : of each point for the glow, by a low-discrepancy sequence; lamps are looked at on their own
    leave_out : names of meshes whose bright spots are glow as well, as in `place_lights`
    """
    from scipy.stats import qmc

    lamps = place_lights(place, leave_out=leave_out)
    glow, total = Arriving(lamps.residual), np.zeros((len(points), 3))
    sample = qmc.Sobol(2, rng=0).random(rays)
    radius, angle = np.sqrt(sample[:, 0]), 2 * np.pi * sample[:, 1]
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - sample[:, 0])], axis=-1)
    local /= np.linalg.norm(local, axis=-1, keepdims=True)
    for index, (point, normal) in enumerate(zip(points, normals, strict=True)):
        side = np.cross(normal, [1.0, 0, 0] if abs(normal[0]) < 0.7 else [0, 1.0, 0])
        side /= np.linalg.norm(side)
        total[index] = np.pi * glow.along(point, local @ np.stack([side, np.cross(normal, side), normal])).mean(axis=0)
    for light in lamps.lights:
        total += _from_rectangle(light, glow.caster, points, normals)
    return total


def _from_rectangle(light: RectangleLight, caster: RayCaster, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """What a rectangle gives: Σ L cos θ cos θ' A / d² over its spots, where nothing stands between."""
    from scipy.stats import qmc

    spots = (qmc.Sobol(2, rng=1).random(SPOTS) - 0.5) * light.size
    total = np.zeros(len(points))
    for spot in np.array(light.position) + spots @ light.frame[:, :2].T:
        away = spot - points
        distance = np.maximum(np.linalg.norm(away, axis=-1), CLEAR)
        directions = away / distance[:, None]
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        cosines = np.maximum(np.einsum("ij,ij->i", directions, normals), 0) * np.maximum(
            -directions @ light.frame[:, 2], 0
        )
        there = np.flatnonzero(cosines > 0)
        open_ = ~caster.occluded(points[there] + CLEAR * normals[there], directions[there], distance[there] - 2 * CLEAR)
        total[there] += open_ * cosines[there] / distance[there] ** 2
    area = light.size[0] * light.size[1]
    return total[:, None] * np.array(light.radiance) * area / SPOTS


def receiving(place: BakedPlace, names: Sequence[str], rays: int = 1024) -> tuple[Mesh, ...]:
    """The place's meshes, of which the named ones take light: they reflect what makes them look as they were baked.

    place : as `bake` or `place_of` made it
    names : of meshes; all others shine
    rays : as in `place_irradiance`

    A surface of radiance L under the irradiance E of all the rest is given the reflectance π L / E (Debevec 1998, §7),
    so that objects throw shadows on it and colour it. What would reflect more than all light is held there, warned of.
    Raises ValueError for a name that no mesh has.
    """
    there = [part.mesh.name for part in place.parts]
    if unknown := sorted(set(names) - set(there)):
        raise ValueError(f"the place has no mesh {unknown[0]!r}; it has {', '.join(there)}")
    return tuple(
        _reflecting(place, part, names, rays) if part.mesh.name in names else part.mesh for part in place.parts
    )


def _reflecting(place: BakedPlace, part: BakedMesh, names: Sequence[str], rays: int) -> Mesh:
    rows, columns = np.nonzero(part.used)
    chosen = np.arange(0, len(rows), max(1, len(rows) // PLACES))
    points = part.points[rows[chosen], columns[chosen]].astype(np.float64)
    normals = part.normals[part.faces[rows[chosen], columns[chosen]]]
    # A sunlit patch of a surface that takes light is no lamp: right before an uneven one it would outshine all.
    irradiance = place_irradiance(place, points + CLEAR * normals, normals, rays, names)
    known = part.faces >= 0
    reflectance = np.zeros(part.radiance.shape, np.float32)
    # Below what stands on it no light arrives, nor is anything seen: what lies beside must not be thought as dark.
    open_ = luminance(irradiance) > BURIED * np.median(luminance(irradiance))
    open_ = open_ if open_.any() else np.ones(len(points), bool)
    arriving = filled(part.points[known].astype(np.float64), points[open_], irradiance[open_])
    reflectance[known] = np.pi * part.radiance[known] / np.maximum(arriving, 1e-30)
    if (over := float((reflectance[part.used & part.seen] > 1).any(axis=-1).mean())) > 0.02:
        warn(
            f"{over:.0%} of {part.mesh.name!r} would reflect more than the light it gets and are held at all of it: "
            "the place lacks light that no photograph shows, or the mesh shines itself"
        )
    return replace(part.mesh, material=Diffuse(np.minimum(reflectance, 1)))
