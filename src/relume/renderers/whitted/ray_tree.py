"""The tree of rays behind one pixel (Whitted 1980, Fig. 2 and 3), and where a picture's time goes (§4)."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from relume.renderers.whitted.antialiasing import Traced, Tracer
from relume.renderers.whitted.kernel_data import EYE, REFLECTED, REFRACTED, SHADOW, Record, Settings
from relume.renderers.whitted.whitted import PreparedWhitted
from relume.scene.cameras.camera import Camera

ROOM = 100_000
"""Nodes of a tree that are kept; more can neither be drawn nor read."""
GRID = (64, 48)
"""Samples whose rays are timed for the breakdown."""
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class RayTree:
    """N rays with the nodes that they lead to, parents before their children.

    start, end : (N, 3) metres, world; a ray that leaves the scene ends a while outside
    kind : (N,) EYE, REFLECTED (the S term), REFRACTED (T) or SHADOW, towards a light
    parent : (N,) the ray at whose end each begins; −1 for the eye's
    shape : (N,) what it ends on, in the order of the scene's local shapes and objects; −1 for none
    light : (N,) the light that a shadow ray goes to, else −1; the scene's own, then the constellation's. Through a
        transparent shape it goes on as a ray of its own
    weight : (N, 3) share of the pixel that the intensity at its end has
    intensity : (N, 3) radiance at the node by eq. 2; what a shadow ray adds to its node
    sent : (N, 3) what each adds to the pixel without its children
    """

    start: np.ndarray
    end: np.ndarray
    kind: np.ndarray
    parent: np.ndarray
    shape: np.ndarray
    light: np.ndarray
    weight: np.ndarray
    intensity: np.ndarray
    sent: np.ndarray

    def children(self, node: int) -> np.ndarray:
        """The rays that begin where this one ends."""
        return np.flatnonzero(self.parent == node)


@dataclass(frozen=True)
class Breakdown:
    """Shares of the time a picture takes, which add up to 1 (§4: 0.13, 0.75 and 0.12), and that time.

    overhead : choosing samples, halving squares, adding up
    intersection : where rays meet shapes
    shading : eq. 2
    seconds : of one core, other programs not counted
    rays : all of them
    """

    overhead: float
    intersection: float
    shading: float
    seconds: float
    rays: int


def ray_tree(prepared: PreparedWhitted, camera: Camera, at: tuple[float, float], *, seed: int = 0) -> RayTree:
    """The tree of the sample at pixel coordinates (x, y), x right and y down; raises ValueError outside the picture."""
    x, y = at
    if not (0 <= x <= camera.width and 0 <= y <= camera.height):
        raise ValueError(f"pixel {x:g},{y:g} lies outside the picture of {camera.width}×{camera.height}")
    record = prepared.recorded(camera, np.array([[x, y]], np.float64), seed, ROOM)
    count = int(record.count[0])
    parent, weight, sent = record.parent[:count], record.weight[:count], record.sent[:count]
    total = sent.copy()
    for node in range(count - 1, 0, -1):
        total[parent[node]] += total[node]
    kind = record.kind[:count]
    # A shadow ray has no eq. 2 of its own: it brings a light's share to the node it comes from.
    node = np.arange(count)
    while np.any(within := kind[node] == SHADOW):
        node = np.where(within, parent[node], node)
    divisor = weight[node]
    intensity = np.divide(total, divisor, out=np.zeros_like(total), where=divisor > 0)
    return RayTree(
        record.ends[:count, :3], record.ends[:count, 3:], kind, parent, record.shape[:count],
        record.light[:count], weight, intensity, sent,
    )  # fmt: skip


def breakdown(prepared: PreparedWhitted, camera: Camera, *, seed: int = 0) -> Breakdown:
    """Measure where the time of a picture goes, on one core: the whole, its trees alone, their rays alone."""
    alone = _Timed(replace(prepared.method, threads=1), prepared.scene)
    x, y = ((np.arange(count) + 0.5) / count for count in GRID)
    across, down = np.meshgrid(x * camera.width, y * camera.height)
    points = np.column_stack([across.ravel(), down.ravel()])
    record = alone.recorded(camera, points, seed, int(alone.traced(camera, points, seed)[2].sum()))
    count = int(record.count[0])
    alone.render(camera, seed=seed)
    alone.spent.clear()
    begin = time.thread_time()
    rays = alone.render(camera, seed=seed).rays
    seconds = time.thread_time() - begin
    assert rays is not None
    total = int(rays.sum())
    trees = sum(alone.spent)
    # The rays of the grid stand for all: they are of the same kinds, in the same proportions.
    meetings = _seconds_of_meetings(alone, record, count, alone.settings(camera, seed)) / count * total
    meetings = min(meetings, trees)
    return Breakdown((seconds - trees) / seconds, meetings / seconds, (trees - meetings) / seconds, seconds, total)


@dataclass(frozen=True, eq=False)
class _Timed(PreparedWhitted):
    """Notes the time that its trees take."""

    spent: list[float] = field(default_factory=list)

    def tracer(self, camera: Camera, seed: int, record: Record | None = None) -> Tracer:
        follow = super().tracer(camera, seed, record)

        def timed(points: np.ndarray) -> Traced:
            begin = time.thread_time()
            traced = follow(points)
            self.spent.append(time.thread_time() - begin)
            return traced

        return timed


def _seconds_of_meetings(prepared: PreparedWhitted, record: Record, count: int, settings: Settings) -> float:
    """How long it takes to find only the intersections of recorded rays."""
    start, kind, limits = record.ends[:count, :3], record.kind[:count], record.limits[:count]
    towards = record.ends[:count, 3:] - start
    length = np.linalg.norm(towards, axis=1, keepdims=True)
    directions = np.divide(towards, length, out=np.tile([0.0, 1.0, 0.0], (count, 1)), where=length > 0)
    origins = start + limits[:, :1] * directions
    nearest = (kind != SHADOW) | settings.clear
    cone = {"footprint": settings.footprint, "threads": 1}
    first = origins[nearest], directions[nearest]
    others = origins[~nearest], directions[~nearest], limits[~nearest, 1]

    times = []
    # The first round may compile.
    for _ in range(1 + ROUNDS):
        begin = time.thread_time()
        prepared.caster.nearest(*first, **cone)
        prepared.caster.occluded(*others, **cone)
        times.append(time.thread_time() - begin)
    return float(np.median(times[1:]))


NAMES = {EYE: "eye", REFLECTED: "S", REFRACTED: "T", SHADOW: "L"}
"""The terms of eq. 2 that rays stand for."""
