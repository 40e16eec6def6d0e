"""A light probe's map and the place where it was taken; the walls that it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.light.constellations.placement import point
from relume.renderers.mitsuba.distant import require_inside
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Box, Distant, Dome, Enclosure
from relume.scene.shapes.shapes import Mesh
from relume.sphere.environment_map import EnvironmentMap

APART = 1e-3
"""Metres: probes that are nearer stood at one place."""


@dataclass(frozen=True, eq=False)
class PlacedProbe:
    """A light probe's map and where it was taken.

    light : the map, in the world's axes
    position : metres, world
    variance : of the radiance, of its shape; None where it is not known
    name : what messages call it, as its file is named; "probe 1" and so on unless given
    """

    light: EnvironmentMap
    position: tuple[float, float, float]
    variance: np.ndarray | None = None
    name: str = ""

    def __post_init__(self) -> None:
        point(self.position, "position of a probe")
        if self.variance is not None and self.variance.shape != self.light.radiance.shape:
            raise ValueError(
                f"variance has shape {self.variance.shape}; expected the radiance's {self.light.radiance.shape}"
            )


@dataclass(frozen=True, eq=False)
class WallsOf:
    """Where rays meet a distant scene that is not at infinity, and which way it faces there."""

    distant: Box | Dome | Enclosure
    caster: RayCaster | None
    facing: np.ndarray | None

    @staticmethod
    def of(distant: Box | Dome | Enclosure) -> WallsOf:
        """The walls, a mesh's ready to be asked."""
        if not isinstance(distant, Enclosure):
            return WallsOf(distant, None, None)
        a, b, c = np.moveaxis(np.asarray(distant.vertices, np.float64)[distant.faces], 1, 0)
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-30)
        caster = RayCaster.of([Mesh(distant.vertices, distant.faces, Diffuse((0.0, 0.0, 0.0)))])
        return WallsOf(distant, caster, normal)

    def met(self, origin: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (N,), metres, of rays (N, 3) from one place, and unit normals (N, 3), of either side."""
        if self.caster is not None and self.facing is not None:
            hits = self.caster.nearest(origin, directions)
            if not np.all(np.isfinite(hits.distance)):
                raise ValueError(
                    f"the distant scene is open: {np.mean(~np.isfinite(hits.distance)):.1%} of the directions from "
                    f"{np.round(origin, 3).tolist()} meet none of its faces; close the mesh"
                )
            return hits.distance, self.facing[hits.primitive]
        assert not isinstance(self.distant, Enclosure)
        distance = self.distant.distances(origin, directions)
        ends = origin + distance[:, None] * directions
        if isinstance(self.distant, Dome):
            return distance, (ends - np.array(self.distant.centre)) / self.distant.radius
        gaps = np.minimum(np.abs(ends - np.array(self.distant.low)), np.abs(ends - np.array(self.distant.high)))
        return distance, np.eye(3)[np.argmin(gaps, axis=-1)]

    def shown_to(self, origin: np.ndarray, directions: np.ndarray, distances: np.ndarray) -> np.ndarray:
        """Whether a place sees points (N,) of the walls; of a box and a dome it sees all."""
        if self.caster is None:
            return np.ones(len(directions), bool)
        return self.caster.nearest(origin, directions).distance > 0.999 * distances


def names_of(probes: Sequence[PlacedProbe]) -> tuple[str, ...]:
    """What messages call each of several probes, no two alike; those without a name are counted from 1."""
    names = [probe.name for probe in probes]
    return tuple(
        (f"{name} (probe {number})" if names.count(name) > 1 else name) if name else f"probe {number}"
        for number, name in enumerate(names, 1)
    )


def require_probes(probes: Sequence[PlacedProbe], at: tuple[float, float, float], distant: Distant) -> None:
    """Raise ValueError for no probes, maps of different units, two at one place, and places outside of the scene."""
    if not probes:
        raise ValueError("there are no probes; give maps and the places where they were taken")
    units = {probe.light.unit for probe in probes}
    if len(units) > 1:
        raise ValueError(f"the probes' maps are in {' and in '.join(sorted(units))}; give all of them in one unit")
    names = names_of(probes)
    for number, (name, probe) in enumerate(zip(names, probes, strict=True)):
        for other, earlier in zip(names, probes[:number], strict=False):
            if np.linalg.norm(np.subtract(probe.position, earlier.position)) < APART:
                raise ValueError(f"{other} and {name} both stood at {list(probe.position)}; leave one out")
        try:
            require_inside(distant, probe.position)
        except ValueError:
            raise ValueError(
                f"{name} at {list(probe.position)} is outside of the distant scene; both are in metres, world"
            ) from None
    try:
        require_inside(distant, at)
    except ValueError:
        raise ValueError(
            f"the light is wanted at {[round(float(v), 3) for v in at]}, which is outside of the distant scene; give "
            "a place within it, metres"
        ) from None
