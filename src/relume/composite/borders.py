"""Which parts of the place should be local: what the objects still change where a real surface ends.

The local scene is what the objects affect (Debevec 1998, §4), and how far it reaches is the user's guess; the paper
leaves it to future work to find it. A render says it: where the change has not died away at a surface's border, the
composite shows an edge there, and how fast it falls towards the border says how much wider the surface should be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.composite.surface.projection import triangles_of_shape
from relume.composite.surface.recovery import called
from relume.image.colour import luminance
from relume.image.mapped_arrays import give_back_read
from relume.image.radiance import RadianceMap
from relume.image.resizing import resized_rows
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh, Plane, Shape, Sphere

ACROSS = 640
"""Pixels of the picture in which borders are followed, at most: the change varies slowly there."""
VISIBLE = 0.005
"""Share of the plate below which nobody sees an edge, however little noise there is."""
SPACING = 2.0
"""Pixels between places along a border."""
GROUP = 12
"""Places whose change is averaged: an edge as short as that, two dozen pixels, is seen."""
STRIP = (1.5, 6.0)
"""Pixels from the border within which its change is taken; nearer, a pixel shows what is beyond as well."""
DEPTHS = 28
"""Distances at which the change is followed inwards."""
SURELY = 3.0
"""Standard errors from which on a change is more than the render's noise."""
FEWEST = 4
"""Distances of a profile that a power is fitted to."""
SLOWEST, FASTEST = 0.7, 6.0
"""Powers of distance: what falls slower does not end, as a sun's shadow under a tall thing; what falls faster is the
edge of a shadow, behind which something fainter may follow."""
FURTHEST = 3.0
"""Times its own size that a surface is asked to grow, at most; beyond, the fit says nothing."""


@dataclass(frozen=True)
class BorderChange:
    """A border of a real surface at which the objects still change the picture.

    surface : its number among the local surfaces, and what it is called
    side : of it in the picture: left, right, upper or lower
    change : there, as a share of the plate; below 0 where light is taken
    noise : of the plate there, as a share
    wider : metres by which the surface should reach further for the change to die away; None where it does not fall
    """

    surface: int
    name: str
    side: str
    change: float
    noise: float
    wider: float | None

    def line(self) -> str:
        """It in a sentence."""
        if self.wider is None:
            remedy = "it does not fall off towards it: make the surface much wider there"
        else:
            remedy = f"make it {_rounded_up(self.wider):g} m wider there"
        return (
            f"the change at the {self.side} border of {self.name} is {abs(self.change):.1%} of the plate, above its "
            f"noise of {self.noise:.1%}; {remedy}, or describe what lies beyond as [[local]]"
        )


def changed_borders(
    change: Change, plate: RadianceMap, camera: Camera, local: Sequence[Shape], objects: Sequence[Shape]
) -> tuple[BorderChange, ...]:
    """The borders of real surfaces at which the change is above the plate's noise, the greatest first.

    change : what the objects change, of the plate's size
    plate : where its variance is known its noise is that; else it is measured between neighbouring pixels
    local : the surfaces; planes without an end, closed meshes and spheres have no border
    objects : what changes the picture; the change is taken to fall by a power of the distance from the nearest one

    A border along which another local surface is seen, as where a table's edge stands before a floor, is none.
    """
    small = _Small.of(change, plate, camera)
    corners = [np.asarray(triangles_of_shape(each).vertices, np.float64) for each in objects]
    middles = np.array([(each.min(axis=0) + each.max(axis=0)) / 2 for each in corners]).reshape(-1, 3)
    caster, found = RayCaster.of(local), []
    for index, shape in enumerate(local):
        if isinstance(shape, Sphere) or (isinstance(shape, Plane) and shape.size is None):
            continue
        mesh = triangles_of_shape(shape)
        size = float(np.linalg.norm(np.ptp(np.asarray(mesh.vertices, np.float64), axis=0)))
        sides: dict[str, BorderChange] = {}
        for start, end, inward in _open_edges(mesh):
            for each in _along(small, caster, index, (start, end, inward), size, middles):
                if each[0] not in sides or abs(each[1]) > abs(sides[each[0]].change):
                    sides[each[0]] = BorderChange(index, called(local, index), *each)
        found += sides.values()
    return tuple(sorted(found, key=lambda each: -abs(each.change)))


@dataclass(frozen=True, eq=False)
class _Small:
    """The pictures at the size at which borders are followed.

    camera : of that size
    difference, plate : (h, w) luminance
    clear : (h, w) bool, where no object covers the pixel or one beside it
    noise : (h, w) of the plate's own pixels, as a share, of those that were measured; infinite where none was
    """

    camera: Camera
    difference: np.ndarray
    plate: np.ndarray
    clear: np.ndarray
    noise: np.ndarray

    @staticmethod
    def of(change: Change, plate: RadianceMap, camera: Camera) -> _Small:
        from scipy.ndimage import maximum_filter

        width = min(ACROSS, camera.width)
        height = max(1, round(camera.height * width / camera.width))

        def planes(rows: slice) -> np.ndarray:
            shown = luminance(np.nan_to_num(plate.radiance[rows])).astype(np.float64)
            noise = _noise(shown, None if plate.variance is None else plate.variance[rows])
            # White and black pixels of a plate have a variance without bound.
            measured = np.isfinite(noise)
            lit = change.matte[rows], luminance(change.difference[rows]), shown
            made = np.stack([each.astype(np.float32) for each in (*lit, measured, np.where(measured, noise, 0))], -1)
            give_back_read(change.matte, change.difference)
            return made

        small = resized_rows(planes, (camera.width, camera.height), width, height).astype(np.float64)
        matte, difference, shown, share, known = np.ascontiguousarray(np.moveaxis(small, -1, 0))
        covered = np.asarray(maximum_filter(matte > 1e-3, 3), bool)
        mean = np.divide(known, share, where=share > 1e-3, out=np.full_like(share, np.inf))
        return _Small(camera.resized(width, height), difference, shown, ~covered, mean)


def _noise(shown: np.ndarray, variance: np.ndarray | None) -> np.ndarray:
    """The noise of pixels that show so much, (h, w), as a share of it; by their variance (h, w, 3) if it is known."""
    if variance is None:
        # Differences between neighbours: noise, and the pattern that hides an edge as noise does.
        off = np.abs(np.diff(shown, axis=1, append=shown[:, -1:])) / np.sqrt(2)
        return 1.4826 * off / np.maximum(shown, 1e-30)
    return np.sqrt(luminance(np.maximum(variance, 0))) / np.maximum(shown, 1e-30)


def _open_edges(mesh: Mesh) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Edges of one triangle only: both ends (3,), and the unit vector into the surface across the edge."""
    points, same = np.unique(np.round(np.asarray(mesh.vertices, np.float64), 6), axis=0, return_inverse=True)
    faces = same.reshape(-1)[mesh.faces]
    edges = np.concatenate([faces[:, [0, 1, 2]], faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]])
    _, which, count = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_inverse=True, return_counts=True)
    result = []
    for first, second, third in edges[count[which.reshape(-1)] == 1]:
        start, end = points[first], points[second]
        along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-30)
        inward = points[third] - start
        inward = inward - (inward @ along) * along
        length = float(np.linalg.norm(inward))
        if length > 0:
            result.append((start, end, inward / length))
    return result


def _along(
    small: _Small, caster: RayCaster, index: int, edge: tuple[np.ndarray, np.ndarray, np.ndarray], size: float,
    middles: np.ndarray,
) -> list[tuple[str, float, float, float | None]]:  # fmt: skip
    """Side, change, noise and how much wider, at groups of places along an edge of local surface number `index`."""
    start, end, inward = edge
    camera = small.camera
    with np.errstate(invalid="ignore", divide="ignore"):
        ends = camera.project(np.stack([start, end]))
    reach = float(np.linalg.norm(ends[1] - ends[0])) if np.all(np.isfinite(ends)) else 4.0 * ACROSS
    count = int(np.clip(reach / SPACING, GROUP, 4 * ACROSS))
    border = start + ((np.arange(count) + 0.5) / count)[:, None] * (end - start)
    # The size of a pixel there, seen across the edge, and distances inwards that grow from it.
    step = np.minimum(np.linalg.norm(border - camera.eyes_towards(border), axis=-1) / camera.focal_length, size / 50)
    step *= _pixels_of(camera, border, border + step[:, None] * inward)
    ladder = np.geomspace(STRIP[0], np.maximum(size / 2 / np.median(step), 4 * STRIP[1]), DEPTHS)
    points = border[:, None] + (step[:, None] * ladder)[..., None] * inward
    difference, plate, noise = _looked_up(small, caster, index, points)
    beyond = border - 2 * step[:, None] * inward
    eyes = camera.eyes_towards(beyond)
    ends_here = ~np.isfinite(caster.nearest(eyes, _ways(beyond, eyes)).distance) & _in_frame(camera, beyond)
    sides = _sides(camera, border, inward * step[:, None])
    known, near = np.isfinite(difference) & ends_here[:, None], ladder <= STRIP[1]
    found = []
    for first in range(0, count - GROUP // 2, GROUP):
        group, middle = slice(first, first + GROUP), min(first + GROUP // 2, count - 1)
        if known[group][:, near].sum() < GROUP:
            continue
        grain = float(np.median(noise[group][known[group] & near]))
        limit = max(VISIBLE, grain)
        profile = _profile(difference[group], plate[group], known[group], near, limit)
        if profile is not None:
            here, law = _fallen(profile, border[middle], points[middle], middles, limit)
            if abs(here) >= limit:
                found.append((sides[middle], here, grain, _wider(law, border[middle], -inward, size)))
    return found


def _profile(
    difference: np.ndarray, plate: np.ndarray, known: np.ndarray, near: np.ndarray, limit: float
) -> tuple[float, np.ndarray] | None:
    """The change at a piece of border, and (K,) further in, as shares of the plate; None where it is below a limit."""
    some = known & near
    relative = difference[some] / np.maximum(plate[some].mean(), 1e-30)
    here, error = float(relative.mean()), float(relative.std()) / np.sqrt(len(relative) / GROUP)
    if abs(here) < limit or abs(here) < SURELY * error:
        return None
    sums = np.where(known, np.stack([difference, plate]), 0).sum(axis=1)
    seen = known.sum(axis=0) >= GROUP // 3
    return here, np.where(seen, sums[0] / np.maximum(sums[1], 1e-30), np.nan)


@dataclass(frozen=True, eq=False)
class _Law:
    """A change that falls by a power of the distance from an object's middle, to `end` metres from there."""

    middle: np.ndarray
    end: float


def _fallen(
    profile: tuple[float, np.ndarray], border: np.ndarray, points: np.ndarray, middles: np.ndarray, limit: float
) -> tuple[float, _Law | None]:
    """The change at the border itself, and how it falls; None where it does not.

    A shadow under a wide light, and light that an object reflects, fall about as distance³; by which power they do here
    is fitted between the border and half the way to the object, for nearer its own shape counts.
    """
    here, inwards = profile
    if not len(middles):
        return here, None
    middle = middles[np.argmin(np.linalg.norm(middles - border, axis=-1))]
    away, from_border = np.linalg.norm(points - middle, axis=-1), float(np.linalg.norm(border - middle))
    with np.errstate(invalid="ignore"):
        good = (inwards * np.sign(here) > 0) & (away > 0.5 * from_border) & (away < from_border)
    # What is beyond the object on the same line is not on the way to it.
    good &= np.arange(len(away)) < np.argmin(away)
    if good.sum() < FEWEST:
        return here, None
    x, y = np.log(away[good]), np.log(np.abs(inwards[good]))
    power = float(np.polyfit(x, y, 1)[0])
    if -power < SLOWEST:
        return here, None
    power = min(-power, FASTEST)
    # Through the middle of the points, whatever the power was held to.
    level = float(np.exp(y.mean() + power * x.mean()))
    here = float(np.sign(here)) * level * from_border**-power
    return here, _Law(middle, (level / limit) ** (1 / power))


def _wider(law: _Law | None, border: np.ndarray, outward: np.ndarray, size: float) -> float | None:
    """Metres outwards from a border to where the change has fallen to the limit."""
    if law is None:
        return None
    off = border - law.middle
    along = float(off @ outward)
    wider = -along + float(np.sqrt(max(along**2 + law.end**2 - float(off @ off), 0.0)))
    return wider if 0 < wider < FURTHEST * size else None


def _looked_up(
    small: _Small, caster: RayCaster, index: int, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The change, the plate and its noise at points (N, K, 3) of a surface; NaN where the camera does not see them."""
    camera, flat = small.camera, points.reshape(-1, 3)
    eyes = camera.eyes_towards(flat)
    hits = caster.nearest(eyes, _ways(flat, eyes))
    away = np.linalg.norm(flat - eyes, axis=-1)
    seen = (hits.shape == index) & (np.abs(hits.distance - away) < 2e-3 * away) & _in_frame(camera, flat)
    with np.errstate(invalid="ignore", divide="ignore"):
        at = np.nan_to_num(camera.project(flat))
    x, y = (at[:, i].clip(0, n - 1).astype(int) for i, n in ((0, camera.width), (1, camera.height)))
    seen &= small.clear[y, x]
    planes = (np.where(seen, plane[y, x], np.nan) for plane in (small.difference, small.plate, small.noise))
    difference, plate, noise = (plane.reshape(points.shape[:2]) for plane in planes)
    return difference, plate, noise


def _ways(points: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    ways = points - eyes
    return ways / np.maximum(np.linalg.norm(ways, axis=-1, keepdims=True), 1e-30)


def _in_frame(camera: Camera, points: np.ndarray) -> np.ndarray:
    ahead = (points - np.array(camera.position)) @ -camera.rotation[:, 2] > 0
    with np.errstate(invalid="ignore", divide="ignore"):
        at = np.nan_to_num(camera.project(points), nan=-1.0)
    return ahead & np.all((at >= 0) & (at < [camera.width, camera.height]), axis=-1)


def _pixels_of(camera: Camera, places: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """By what a short way should be longer to be seen a pixel long; 1 where it is not seen, 8 at most."""
    with np.errstate(invalid="ignore", divide="ignore"):
        long = np.linalg.norm(camera.project(moved) - camera.project(places), axis=-1)
    return np.where(np.isfinite(long), 1 / np.clip(long, 1 / 8, None), 1.0)


def _sides(camera: Camera, border: np.ndarray, inward: np.ndarray) -> list[str]:
    """On which side of the surface places of its border lie, as the picture shows it."""
    with np.errstate(invalid="ignore", divide="ignore"):
        way = np.nan_to_num(camera.project(border - inward) - camera.project(border))
    across = np.abs(way[:, 0]) > np.abs(way[:, 1])
    return [
        ("right" if x > 0 else "left") if wide else ("lower" if y > 0 else "upper")
        for (x, y), wide in zip(way, across, strict=True)
    ]


def _rounded_up(value: float) -> float:
    """To one significant figure, so that it does not promise more than a fit can say."""
    scale = 10 ** np.floor(np.log10(value))
    return float(np.ceil(value / scale - 1e-6) * scale)
