"""Light that reaches a surface straight from its source: irradiance from lamps, the environment map, points and suns.

Of the surfaces that shine each sample takes one, in proportion to its power; the map is drawn in proportion to its
brightness. A shadow ray says whether the surface sees it. Without bias.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from relume.renderers.diffuse.scenes import DiffuseScene, Seen
from relume.renderers.raytrace.lamps import Reaching, Surface
from relume.sphere.sampling import chosen, sequences

AT_ONCE = 1 << 18
"""Shadow rays that are followed together: what is known of them takes some tens of megabytes."""


@dataclass(frozen=True, eq=False)
class DirectLight:
    """The sources of a scene, ready to be asked what of them arrives."""

    scene: DiffuseScene

    def irradiance(self, at: Seen, samples: int, random: np.random.Generator, *, lamps: bool = True) -> np.ndarray:
        """Irradiance (N, 3) on surfaces straight from lights: π·L under an even map that nothing hides.

        at : where, and on which side
        samples : shadow rays to lamps, and as many to the map, for each place
        lamps : False leaves out surfaces that shine; lamps without a body stay
        """
        total = np.zeros((len(at.point), 3))
        for begin in range(0, len(total), max(AT_ONCE // samples, 1)):
            part = at.only(np.arange(begin, min(begin + max(AT_ONCE // samples, 1), len(total))))
            for arriving in self._sources(part, samples, random, lamps):
                total[begin : begin + len(part.point)] += arriving
        return total

    def _sources(self, at: Seen, samples: int, random: np.random.Generator, lamps: bool) -> Iterator[np.ndarray]:
        count, scene = len(at.point), self.scene
        surfaces = scene.shining + scene.free if lamps else scene.free
        if surfaces:
            u = sequences(random, samples, Surface.numbers, count).reshape(-1, Surface.numbers)
            yield self._arriving(at, samples, _from_one_of(surfaces, u, np.repeat(at.point, samples, axis=0)))
        if scene.sky_lamp is not None:
            u = sequences(random, samples, scene.sky_lamp.numbers, count).reshape(-1, scene.sky_lamp.numbers)
            yield self._arriving(at, samples, scene.sky_lamp.reaching(u, np.repeat(at.point, samples, axis=0)))
        for light in scene.sizeless:
            yield self._arriving(at, 1, light.reaching(np.empty((count, 0)), at.point))

    def _arriving(self, at: Seen, samples: int, light: Reaching) -> np.ndarray:
        """The irradiance (N, 3) of S samples each, (N·S, …), where nothing hides them from the surface."""
        cosine = np.einsum("ij,ij->i", light.directions, np.repeat(at.normal, samples, axis=0))
        free = self._unhidden(at, samples, light, np.maximum(cosine, 0))
        return (free[:, None] * light.irradiance).reshape(len(at.point), samples, 3).mean(axis=1)

    def _unhidden(self, at: Seen, samples: int, light: Reaching, weight: np.ndarray) -> np.ndarray:
        """The weights (N·S,) of ways that nothing hides; 0 of the others, and of those below the surface itself."""
        origin, normal = np.repeat(at.point, samples, axis=0), np.repeat(at.geometric, samples, axis=0)
        above = np.einsum("ij,ij->i", light.directions, normal) > 0
        shines = np.any(light.irradiance > 0, axis=1)
        asked = np.flatnonzero(above & shines & (weight > 0) & np.repeat(at.hit, samples))
        kept = np.zeros(len(weight))
        if asked.size:
            directions = np.ascontiguousarray(light.directions[asked])
            kept[asked] = weight[asked] * ~self.scene.blocked(
                origin[asked], normal[asked], directions, light.distance[asked]
            )
        return kept


def _from_one_of(lamps: tuple[Surface, ...], u: np.ndarray, points: np.ndarray) -> Reaching:
    """Light at points (N, 3) by a sample of one lamp each, as often as its flux says; u : (N, 3)."""
    steps = np.cumsum([lamp.flux for lamp in lamps])
    which = chosen(u[:, 0], steps)
    share = np.diff(steps, prepend=0.0) / steps[-1]
    # What is left of the number that chose the lamp is as good as new.
    low = (steps[which] / steps[-1]) - share[which]
    again = np.column_stack([np.clip((u[:, 0] - low) / share[which], 0, 1 - 2.0**-53), u[:, 1:]])
    found = Reaching(np.zeros((len(u), 3)), np.full(len(u), np.inf), np.zeros((len(u), 3)))
    for index in np.unique(which):
        mine = np.flatnonzero(which == index)
        light = lamps[index].reaching(again[mine], points[mine])
        found.directions[mine], found.distance[mine] = light.directions, light.distance
        found.irradiance[mine] = light.irradiance / share[index]
    return found
