"""Records: where irradiance is known, from which rays, and how it is worked out bounce by bounce.

First only geometry is looked at. Where the eye's rays fall a record is made as soon as no other may be used there; its
rays fall on surfaces, where records for their light are made in the same way, until all rays end near a record. Then
light goes round: what a record's rays bring is what the surfaces that they met reflect, of direct light and of the
records near them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from relume.renderers.diffuse.direct_light import DirectLight
from relume.renderers.diffuse.scenes import DiffuseScene, Seen
from relume.renderers.irradiance_cache.hemisphere import Hemisphere
from relume.renderers.irradiance_cache.octree import Octree

LOOSER = 2.0
"""The error that records for the light of other records' rays may have, over that of those that are seen."""
SPARSER = 4
"""The share of rays that they need."""
WIDER = 16
"""How much farther they may be used: on open ground there is little to see, and much ground."""


@dataclass(frozen=True, eq=False)
class Group:
    """K records with hemispheres of the same cells, and what their rays met.

    hemisphere : the cells
    place, normal : (K, 3); seen : K·M·N rows
    closeness : (K, M·N) 1/r per metre, at most that of the least reach
    """

    hemisphere: Hemisphere
    place: np.ndarray
    normal: np.ndarray
    seen: Seen
    closeness: np.ndarray


@dataclass(frozen=True, eq=False)
class Cache:
    """R records, ready to be asked.

    octree : of their places
    error : a, the error that a record may have where it is used
    seen : how many the eye's rays made; they come first
    irradiance : (R, 3) what surfaces send there, direct light left out
    turning, moving : (R, 3 axes, 3 channels) gradients
    threads : all cores for None
    """

    octree: Octree
    error: float
    seen: int
    irradiance: np.ndarray
    turning: np.ndarray
    moving: np.ndarray
    threads: int | None

    def at(self, places: np.ndarray, normals: np.ndarray, *, looser: bool = False) -> np.ndarray:
        """Indirect irradiance (N, 3), interpolated with gradients (Ward & Heckbert 1992, eq. 5)."""
        error = self.error * (LOOSER if looser else 1)
        first, record, weight = self.octree.weights(places, normals, error, self.threads)
        row = np.repeat(np.arange(len(places)), np.diff(first))
        tree = self.octree.tree
        away, turn = places[row] - tree.place[record], np.cross(tree.normal[record], normals[row])
        values = self.irradiance[record]
        values = values + np.einsum("nx,nxc->nc", away, self.moving[record])
        values = np.maximum(values + np.einsum("nx,nxc->nc", turn, self.turning[record]), 0) * weight[:, None]
        return np.stack([np.bincount(row, values[:, k], len(places)) for k in range(3)], axis=-1)


@dataclass(frozen=True, eq=False)
class Filling:
    """How a cache is filled: `IrradianceCache`'s settings, and the scene.

    nearest, farthest : metres between which a record's reach is kept
    """

    scene: DiffuseScene
    error: float
    rays: int
    nearest: float
    farthest: float
    bounces: int
    seed: int

    def cache(self, looked_at: Iterator[tuple[np.ndarray, np.ndarray]]) -> Cache:
        """A cache for places and normals that are looked at, one batch (N, 3), (N, 3) after the other."""
        fine, coarse = Hemisphere.of(self.rays), Hemisphere.of(max(self.rays // SPARSER, 8))
        octree = Octree(*self.scene.box, LOOSER * self.error * WIDER * self.farthest)
        made = [self._records(octree, *batch, fine, self.error, self.farthest) for batch in looked_at]
        groups = [group for group in made if len(group.place)]
        seen, waiting = octree.records, list(groups)
        while waiting and self.bounces > 1:
            met = waiting.pop(0).seen
            there = met.only(np.flatnonzero(met.hit))
            more = self._records(octree, there.point, there.normal, coarse, LOOSER * self.error, WIDER * self.farthest)
            if len(more.place):
                groups.append(more)
                waiting.append(more)
        return self._lit(octree, groups, seen)

    def _records(
        self, octree: Octree, places: np.ndarray, normals: np.ndarray, hemisphere: Hemisphere, error: float,
        farthest: float,
    ) -> Group:  # fmt: skip
        """New records, wherever none of the octree's may be used with this error, in the order of the places."""
        chosen = np.zeros(0, np.int64)
        parts, close = (
            [self.scene.look(places[:0], normals[:0])],
            [np.zeros((0, hemisphere.rings * hemisphere.sectors))],
        )
        index = octree.first_bare(places, normals, 0, error)
        while index < len(places):
            random = np.random.default_rng([self.seed, 0x7265636F, octree.records])
            directions = hemisphere.directions(normals[index], random)
            met = self.scene.look(np.tile(places[index], (len(directions), 1)), directions)
            # R_i: the harmonic mean of the distances, within limits.
            near = np.minimum(1 / np.maximum(met.distance, 1e-30), 1 / self.nearest)
            reach = float(np.clip(1 / max(float(near.mean()), 1e-30), self.nearest, farthest))
            octree.insert(places[index], normals[index], reach, LOOSER * self.error * reach)
            chosen = np.append(chosen, index)
            parts.append(met)
            close.append(near[None])
            index = octree.first_bare(places, normals, index + 1, error)
        seen = Seen(*(np.concatenate(planes) for planes in zip(*parts, strict=True)))
        return Group(hemisphere, places[chosen], normals[chosen], seen, np.concatenate(close))

    def _lit(self, octree: Octree, groups: list[Group], seen: int) -> Cache:
        """Light sent round between the records, a bounce at a time; and the gradients of what arrives."""
        direct, random = DirectLight(self.scene), np.random.default_rng([self.seed, 0x6C697420])
        reflected = [group.seen.reflectance / np.pi for group in groups]
        straight = [direct.irradiance(group.seen, 1, random) for group in groups]
        radiance = [share * light for share, light in zip(reflected, straight, strict=True)]
        between = [self._between(octree, group) for group in groups] if self.bounces > 1 else []
        for _ in range(self.bounces - 1):
            known = _joined(groups, radiance)
            radiance = [
                share * (light + matrix @ known)
                for share, light, matrix in zip(reflected, straight, between, strict=True)
            ]
        turning, moving = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 3))]
        for group, light in zip(groups, radiance, strict=True):
            cells = light.reshape(len(group.place), -1, 3)
            turning.append(group.hemisphere.turning(cells, group.normal))
            moving.append(group.hemisphere.moving(cells, group.closeness, group.normal))
        # No gradient is steeper than what takes the irradiance to 0 or doubles it at the end of a record's disc.
        irradiance, steps = _joined(groups, radiance), np.concatenate(moving)
        change = np.linalg.norm(steps, axis=1) * octree.tree.reach[: len(steps), None] * self.error
        steps = steps * np.minimum(1, irradiance / np.maximum(change, 1e-300))[:, None]
        return Cache(octree, self.error, seen, irradiance, np.concatenate(turning), steps, self.scene.threads)

    def _between(self, octree: Octree, group: Group) -> csr_array:
        """The matrix from records to where a group's rays ended; rows of rays that met nothing are 0."""
        there = np.flatnonzero(group.seen.hit)
        met = group.seen.only(there)
        first, record, weight = octree.weights(met.point, met.normal, LOOSER * self.error, self.scene.threads)
        count = np.zeros(len(group.seen.hit), np.int64)
        count[there] = np.diff(first)
        rows = np.concatenate([[0], np.cumsum(count)])
        return csr_array((weight, record, rows), shape=(len(count), octree.records))


def _joined(groups: list[Group], radiance: list[np.ndarray]) -> np.ndarray:
    """Every record's irradiance (R, 3) from its rays' radiance."""
    pairs = zip(groups, radiance, strict=True)
    every = [group.hemisphere.irradiance(light.reshape(len(group.place), -1, 3)) for group, light in pairs]
    return np.concatenate([np.zeros((0, 3)), *every])
