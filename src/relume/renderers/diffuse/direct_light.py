"""Light that reaches a surface straight from its source: irradiance from lamps, the environment map, points and suns.

Every source is sampled by itself, lamps by their triangles in proportion to power, the map in proportion to its
brightness; a shadow ray says whether the surface sees it. Without bias.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from relume.image.colour import luminance
from relume.light.sampling import EnvironmentSampler
from relume.renderers.diffuse.random_numbers import spread, within_triangles
from relume.renderers.diffuse.scenes import DiffuseScene, Seen, as_mesh, emission_of, looked_up, shines
from relume.scene.lights import DistantLight, PointLight

AT_ONCE = 1 << 18
"""Shadow rays that are followed together: what is known of them takes some tens of megabytes."""

LEAST = 0.01
"""Share of a map's mean that is drawn of a black pixel too."""


@dataclass(frozen=True, eq=False)
class LampTriangles:
    """The L triangles of all that shines.

    corners : (L, 3, 3) metres; normal : (L, 3) to the side that shines; area : (L,) m²
    uv : (L, 3, 2); shape : (L,) which of the scene's
    share : (L,) of all lamps' power, by luminance
    """

    corners: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    uv: np.ndarray
    shape: np.ndarray
    share: np.ndarray


@dataclass(frozen=True, eq=False)
class DirectLight:
    """The sources of a scene, ready to be asked what of them arrives."""

    scene: DiffuseScene

    def irradiance(self, at: Seen, samples: int, random: np.random.Generator, *, lamps: bool = True) -> np.ndarray:
        """Irradiance (N, 3) on surfaces straight from lights: π·L under an even map that nothing hides.

        at : where, and on which side
        samples : shadow rays to lamps, and as many to the map, for each place
        lamps : False leaves out surfaces that shine
        """
        total = np.zeros((len(at.point), 3))
        for begin in range(0, len(total), max(AT_ONCE // samples, 1)):
            part = at.only(np.arange(begin, min(begin + max(AT_ONCE // samples, 1), len(total))))
            for arriving in self._sources(part, samples, random, lamps):
                total[begin : begin + len(part.point)] += arriving
        return total

    def _sources(self, at: Seen, samples: int, random: np.random.Generator, lamps: bool) -> Iterator[np.ndarray]:
        if lamps and len(self.lamps.area):
            yield self._from_lamps(at, spread(random, samples, 3, len(at.point)))
        if self._sampler is not None:
            yield self._from_sky(at, spread(random, samples, 2, len(at.point)))
        yield from (self._from_light(at, light) for light in self.scene.lights)

    @cached_property
    def lamps(self) -> LampTriangles:
        """All surfaces that shine, as triangles with an area."""
        rows: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
        for index, shape in enumerate(self.scene.shapes):
            if not shines(shape.material):
                continue
            mesh = as_mesh(shape)
            corners = np.asarray(mesh.vertices, np.float64)[mesh.faces]
            uv = np.zeros((len(corners), 3, 2)) if mesh.uv is None else np.asarray(mesh.uv, np.float64)[mesh.faces]
            emission = np.asarray(emission_of(shape.material), np.float64).reshape(-1, 3).mean(axis=0)
            rows.append((corners, uv, np.full(len(corners), index), np.full(len(corners), luminance(emission))))
        empty = (np.zeros((0, 3, 3)), np.zeros((0, 3, 2)), np.zeros(0, np.int64), np.zeros(0))
        corners, uv, shape, bright = (np.concatenate(part) for part in zip(empty, *rows, strict=True))
        across = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(across, axis=-1)
        there = area > 0
        power = (area * bright)[there]
        return LampTriangles(
            corners[there], across[there] / area[there, None], area[there], uv[there], shape[there],
            power / max(power.sum(), 1e-300),
        )  # fmt: skip

    @cached_property
    def _sampler(self) -> EnvironmentSampler | None:
        return None if self.scene.sky is None else EnvironmentSampler(self.scene.sky, _brightness)

    def _from_lamps(self, at: Seen, u: np.ndarray) -> np.ndarray:
        """∫ L cos θ cos θ′ / r² dA by S points of the lamps each; u : (N, S, 3)."""
        count, samples = u.shape[:2]
        lamps, flat = self.lamps, u.reshape(-1, 3)
        which = np.minimum(np.searchsorted(np.cumsum(lamps.share), flat[:, 0], side="right"), len(lamps.share) - 1)
        points, weights = within_triangles(flat[:, 1:], lamps.corners[which])
        way = points - np.repeat(at.point, samples, axis=0)
        squared = np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
        direction = way / np.sqrt(squared)[:, None]
        here = np.einsum("ij,ij->i", direction, np.repeat(at.normal, samples, axis=0))
        there = -np.einsum("ij,ij->i", direction, lamps.normal[which])
        weight = np.maximum(here, 0) * np.maximum(there, 0) / squared * lamps.area[which] / lamps.share[which]
        arriving = self._unhidden(at, samples, direction, np.sqrt(squared), weight)
        uv = np.einsum("nk,nkx->nx", weights, lamps.uv[which])
        radiance = np.zeros((len(which), 3))
        for index in np.unique(lamps.shape):
            mine = lamps.shape[which] == index
            radiance[mine] = looked_up(emission_of(self.scene.shapes[index].material), uv[mine])
        return (arriving[:, None] * radiance).reshape(count, samples, 3).mean(axis=1)

    def _from_sky(self, at: Seen, u: np.ndarray) -> np.ndarray:
        """∫ L cos θ dω over the environment map, by S directions each; u : (N, S, 2)."""
        count, samples = u.shape[:2]
        assert self._sampler is not None
        assert self.scene.sky is not None
        direction, density = self._sampler.sample(u.reshape(-1, 2))
        here = np.einsum("ij,ij->i", direction, np.repeat(at.normal, samples, axis=0))
        weight = np.maximum(here, 0) / density
        arriving = self._unhidden(at, samples, direction, np.inf, weight)
        radiance = self.scene.sky.lookup(direction)
        return (arriving[:, None] * radiance).reshape(count, samples, 3).mean(axis=1)

    def _from_light(self, at: Seen, light: PointLight | DistantLight) -> np.ndarray:
        """Irradiance from a point or a distant light, which has no size."""
        if isinstance(light, DistantLight):
            towards = np.array(light.towards, np.float64)
            direction = np.broadcast_to(towards / np.linalg.norm(towards), at.point.shape)
            distance, arriving = np.full(len(at.point), np.inf), np.broadcast_to(light.irradiance, at.point.shape)
        else:
            way = np.asarray(light.position) - at.point
            distance = np.maximum(np.linalg.norm(way, axis=-1), 1e-150)
            direction = way / distance[:, None]
            arriving = light.falloff.at(distance)[:, None] * light.intensity
        cosine = np.maximum(np.einsum("ij,ij->i", direction, at.normal), 0)
        return self._unhidden(at, 1, direction, distance, cosine)[:, None] * arriving

    def _unhidden(
        self, at: Seen, samples: int, direction: np.ndarray, distance: np.ndarray | float, weight: np.ndarray
    ) -> np.ndarray:
        """The weights (N·S,) of ways that nothing hides; 0 of the others, and of those below the surface itself."""
        origin, normal = np.repeat(at.point, samples, axis=0), np.repeat(at.geometric, samples, axis=0)
        above = np.einsum("ij,ij->i", direction, normal) > 0
        asked = np.flatnonzero(above & (weight > 0) & np.repeat(at.hit, samples))
        limits = np.broadcast_to(distance, weight.shape)[asked]
        kept = np.zeros(len(weight))
        if asked.size:
            free = ~self.scene.blocked(origin[asked], normal[asked], np.ascontiguousarray(direction[asked]), limits)
            kept[asked] = weight[asked] * free
        return kept


def _brightness(radiance: np.ndarray) -> np.ndarray:
    """What pixels of a map are drawn in proportion to: nowhere 0, for the light between two pixels belongs to both."""
    channels = radiance.astype(np.float64).sum(axis=-1)
    return channels + LEAST * channels.mean()
