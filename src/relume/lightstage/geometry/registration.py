"""Scans of one subject laid on each other where they show the same surface: what the cameras' places are wrong by.

Each point of a scan is laid on the plane through the nearest point of another (Chen & Medioni 1992), for points that
both scans see, all scans together. Planes let surfaces slide along each other, which points would not; what the shape
does not determine, as the turn of a ball, stays as it was calibrated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.sparse import csgraph
from scipy.spatial import KDTree

from relume.errors import warn
from relume.lightstage.geometry.fusion import smoothed_normals
from relume.lightstage.geometry.meshing import surface_normals
from relume.lightstage.geometry.scan import Scan
from relume.lightstage.geometry.triangulation import ScannedPoints
from relume.sphere.directions import rotation_angle, rotation_from_vector

STEPS = 60
"""Of laying on, at most; some 15 are needed."""
STILL = 1e-7
"""Metres and radians: a step below which nothing moves any more."""
RIM = 3
"""Pixels from where a scan ends: what lies beyond would be laid on its edge."""
SMOOTHING = 1.5
"""Pixels, of the normals: a plane through noisy neighbours leans."""
FACING = np.cos(np.radians(50))
"""Between normals of points that are the same place: the front of an ear is not its back."""
LOSS = 2.0
"""Deviations at which a point counts half."""
OPEN = 0.001
"""Of the best determined motion's strength: what is held less is noise of the normals, by which a ball would turn."""
LEAST_DEVIATION = 2e-5
"""Metres: exact scans must not make an infinite weight."""


@dataclass(frozen=True)
class RegistrationSettings:
    """How scans are laid on each other.

    reach : metres by which places may be wrong: farther points are no partners; rather less than a subject is thick
    points : of each scan, taken evenly
    least_overlap : of either scan's points, the share that must have a partner in the other. With 0.13, the head from
        two sides 90° apart, a scan was laid 1.8 mm beside its place; with 0.24, 75° apart, less than 0.1 mm. A small
        part that lies wholly within a scan of all is laid on that
    least_points : of the chosen points that must have one: fewer hold six numbers by their noise
    """

    reach: float = 0.012
    points: int = 6000
    least_overlap: float = 0.15
    least_points: int = 60


@dataclass(frozen=True, eq=False)
class RegisteredScans:
    """Scans where they agree, in the frame of the first, which is not moved.

    scans : moved, with their cameras
    shifts : (N,) metres that each scan's middle was moved
    turns : (N,) radians that each was turned
    overlap : (N,) share of each scan's points that another shows
    before, after : deviation of points from the planes of their partners, metres, by the median: some have none
    """

    scans: tuple[Scan, ...]
    shifts: np.ndarray
    turns: np.ndarray
    overlap: np.ndarray
    before: float
    after: float

    def facts(self) -> dict[str, object]:
        """What a user should know: millimetres and degrees."""
        return {
            "views moved, mm": [float(f"{1e3 * each:.2g}") for each in self.shifts],
            "views turned, degrees": [float(f"{np.degrees(each):.2g}") for each in self.turns],
            "seen by another view too": [float(f"{each:.2g}") for each in self.overlap],
            "views apart before and after, deviation, mm": [
                float(f"{1e3 * each:.2g}") for each in (self.before, self.after)
            ],
        }


@dataclass(frozen=True, eq=False)
class _Cloud:
    """A scan's inner points and normals (M, 3), a tree of them, and every so many of them to be laid on others."""

    points: np.ndarray
    normals: np.ndarray
    tree: KDTree
    chosen: np.ndarray


@dataclass(frozen=True, eq=False)
class _Partners:
    """Points of one scan (M, 3) with those of another and their normals, all where the scans lie now."""

    first: int
    second: int
    points: np.ndarray
    partners: np.ndarray
    normals: np.ndarray
    share: float

    @property
    def distance(self) -> np.ndarray:
        return np.einsum("mk,mk->m", self.points - self.partners, self.normals)


def register_scans(scans: Sequence[Scan], settings: RegistrationSettings = RegistrationSettings()) -> RegisteredScans:
    """Scans of one subject in one frame, moved so that they agree where several show the same surface.

    scans : two or more, as `scan(camera=…)` places them, wrong by `reach` at most
    settings : how far places may be wrong, and how much scans have to share
    The first stays. Raises ValueError for fewer than two, and for scans that show too little of what others show; warns
    where they have not settled.
    Source: Chen & Medioni 1992, "Object modelling by registration of multiple range images"; the reach closes in, as
    in Zhang 1994.
    """
    if len(scans) < 2:
        raise ValueError(f"{len(scans)} scans; give two or more to lay on each other")
    clouds = [_cloud(each, settings.points) for each in scans]
    turns, shifts = np.tile(np.eye(3), (len(scans), 1, 1)), np.zeros((len(scans), 3))
    every = np.concatenate([cloud.points[cloud.chosen] for cloud in clouds])
    middle, size = every.mean(axis=0), float(np.sqrt(3 * every.var(axis=0).mean()))
    reach, before, spacing = settings.reach, np.nan, _spacing(clouds)
    _require_overlap(len(scans), _partners(clouds, turns, shifts, reach), settings)
    for _ in range(STEPS):
        partners = _partners(clouds, turns, shifts, reach)
        distance = np.concatenate([each.distance for each in partners])
        deviation = max(_deviation(distance), LEAST_DEVIATION)
        before = _deviation(distance) if np.isnan(before) else before
        step = _step(len(scans), partners, middle, size, deviation)
        for index in range(1, len(scans)):
            turn = rotation_from_vector(step[index, :3])
            turns[index] = turn @ turns[index]
            shifts[index] = turn @ (shifts[index] - middle) + middle + step[index, 3:]
        # As far as points are apart along the surface they need not be across it.
        closer = max(0.7 * reach, 8 * deviation, 4 * spacing)
        if np.abs(step).max() < STILL and closer >= reach:
            break
        reach = min(reach, closer)
    else:
        warn(
            f"the scans had not settled after {STEPS} steps of laying them on each other; the last moved them by "
            f"{1e3 * np.abs(step).max():.2g} mm or mrad: look whether they agree"
        )
    partners = _partners(clouds, turns, shifts, reach)
    distance = np.concatenate([each.distance for each in partners])
    moved = tuple(_moved(each, turn, shift) for each, turn, shift in zip(scans, turns, shifts, strict=True))
    middles = np.stack([cloud.points.mean(axis=0) for cloud in clouds])
    gone = np.linalg.norm(np.einsum("nij,nj->ni", turns, middles) + shifts - middles, axis=-1)
    return RegisteredScans(
        moved, gone, np.array([rotation_angle(turn) for turn in turns]), _overlap(len(scans), partners), before,
        _deviation(distance),
    )  # fmt: skip


def _deviation(distance: np.ndarray) -> float:
    """The standard deviation of a normal distribution with the median of these."""
    return 1.4826 * float(np.median(np.abs(distance)))


def _cloud(scanned: Scan, count: int) -> _Cloud:
    there = np.isfinite(scanned.surface[..., 0])
    inner = np.asarray(ndimage.distance_transform_edt(np.pad(there, 1)))[1:-1, 1:-1] > RIM
    normals = surface_normals(scanned.surface, scanned.rig.camera)
    known = np.isfinite(normals[..., 0])
    smooth = smoothed_normals(np.nan_to_num(normals), known, SMOOTHING)
    inner &= known
    points = scanned.surface[inner]
    if len(points) < 100:
        raise ValueError(f"a scan has {len(points)} points inside its rim; too few to be laid on another")
    chosen = np.arange(0, len(points), max(1, len(points) // count))
    return _Cloud(points, smooth[inner], KDTree(points), chosen)


def _spacing(clouds: Sequence[_Cloud]) -> float:
    """Metres between neighbouring points, the median of all."""
    return float(np.median([np.median(cloud.tree.query(cloud.points[cloud.chosen], 2)[0][:, 1]) for cloud in clouds]))


def _partners(clouds: Sequence[_Cloud], turns: np.ndarray, shifts: np.ndarray, reach: float) -> list[_Partners]:
    """Of each scan's points the nearest of every other scan, within reach and facing alike."""
    found = []
    for first, one in enumerate(clouds):
        points = one.points[one.chosen] @ turns[first].T + shifts[first]
        normals = one.normals[one.chosen] @ turns[first].T
        for second, other in enumerate(clouds):
            if first == second:
                continue
            apart, nearest = other.tree.query((points - shifts[second]) @ turns[second], distance_upper_bound=reach)
            near = np.flatnonzero(np.isfinite(apart))
            partner = nearest[near]
            facing = other.normals[partner] @ turns[second].T
            same = np.einsum("mk,mk->m", facing, normals[near]) > FACING
            near, partner = near[same], partner[same]
            there = other.points[partner] @ turns[second].T + shifts[second]
            found.append(_Partners(first, second, points[near], there, facing[same], len(near) / len(points)))
    return found


def _overlap(count: int, partners: Sequence[_Partners]) -> np.ndarray:
    """The share of each scan's points that the one that shows most of them shows."""
    shares = np.zeros(count)
    for each in partners:
        shares[each.first] = max(shares[each.first], each.share)
    return shares


def _require_overlap(count: int, partners: Sequence[_Partners], settings: RegistrationSettings) -> None:
    """Refuse scans that nothing joins to the first."""
    enough = np.zeros((count, count), bool)
    for each in partners:
        enough[each.first, each.second] = (
            each.share >= settings.least_overlap and len(each.points) >= settings.least_points
        )
    pieces = csgraph.connected_components(enough | enough.T, directed=False)[1]
    if lost := [f"view {i + 1}" for i in range(count) if pieces[i] != pieces[0]]:
        across = [each for each in partners if pieces[each.first] != pieces[each.second]]
        most = max(across, key=lambda each: each.share)
        raise ValueError(
            f"{', '.join(lost)}: {most.share:.0%} of the points, {len(most.points)}, lie within "
            f"{1e3 * settings.reach:.3g} mm of the other views' surface; {settings.least_overlap:.0%}, and "
            f"{settings.least_points} points, are needed to lay them on it; take views nearer to each other, or keep "
            "them as their cameras are placed (--no-register)"
        )


def _step(count: int, partners: Sequence[_Partners], middle: np.ndarray, size: float, deviation: float) -> np.ndarray:
    """Small turns about the middle, and shifts, (count, 6), that lessen the distances; the first's are 0.

    size : of the subject, metres, by which a turn moves its surface
    """
    normal, right = np.zeros((6 * count, 6 * count)), np.zeros(6 * count)
    for each in partners:
        distance = each.distance / deviation
        weight = 1 / (1 + (distance / LOSS) ** 2)
        slope = np.concatenate([np.cross(each.points - middle, each.normals), each.normals], axis=1) / deviation
        block = (weight[:, None] * slope).T @ slope
        first, second = slice(6 * each.first, 6 * each.first + 6), slice(6 * each.second, 6 * each.second + 6)
        pull = slope.T @ (weight * distance)
        normal[first, first] += block
        normal[second, second] += block
        normal[first, second] -= block
        normal[second, first] -= block
        right[first] -= pull
        right[second] += pull
    # In these directions alone: what the surfaces leave open stays as the cameras were placed.
    scale = np.tile(np.repeat([1 / size, 1.0], 3), count - 1)
    strength, ways = np.linalg.eigh(scale[:, None] * normal[6:, 6:] * scale)
    known = strength > OPEN * strength[-1]
    along = (ways[:, known].T @ (scale * right[6:])) / strength[known]
    return np.concatenate([np.zeros(6), scale * (ways[:, known] @ along)]).reshape(count, 6)


def _moved(scanned: Scan, turn: np.ndarray, shift: np.ndarray) -> Scan:
    """A scan carried along, with its rig."""
    mesh, points, camera = scanned.mesh, scanned.points, scanned.rig.camera
    normals = None if mesh.normals is None else (mesh.normals @ turn.T).astype(np.float32)
    vertices = (mesh.vertices.astype(np.float64) @ turn.T + shift).astype(np.float32)
    carried = ScannedPoints(points.points @ turn.T + shift, turn @ points.covariance @ turn.T, points.gap)
    placed = replace(camera, position=turn @ camera.position + shift, rotation=turn @ camera.rotation)
    return replace(
        scanned, mesh=replace(mesh, vertices=vertices, normals=normals), points=carried,
        surface=scanned.surface @ turn.T + shift, rig=scanned.rig.placed(placed),
    )  # fmt: skip
