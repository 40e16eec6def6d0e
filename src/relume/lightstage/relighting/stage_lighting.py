"""The light that shines on a stage's subject: environment maps, light sets and lamps, which are summed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.light.constellations.constellation import Constellation
from relume.lightstage.direct_light.light_directions import DirectedLight, quadtree_lights
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Interpolation, Smooth
from relume.lightstage.relighting.irradiances import (
    at_middle,
    constellation_irradiances,
    irradiances,
    lamp_irradiances,
)
from relume.scene.lights import DistantLight, PointLight
from relume.sphere.directions import required_rotation, rotation_about
from relume.sphere.environment_map import EnvironmentMap


@dataclass(frozen=True, eq=False)
class StageLighting:
    """What shines on the subject; all of it is summed.

    maps : environment maps, in one unit
    light_sets : lights far away, as `relume lights` finds them in a map
    lamps : far away, or at places in metres from the subject's middle
    lamp_diameter : apparent diameter of each lamp, radians
    rotation : (3, 3), active, which turns maps and light sets; None for none
    Raises ValueError for no light, and for maps in two units.
    """

    maps: tuple[EnvironmentMap, ...] = ()
    light_sets: tuple[Constellation, ...] = ()
    lamps: tuple[DistantLight | PointLight, ...] = ()
    lamp_diameter: float = 0.0
    rotation: np.ndarray | None = None

    def __post_init__(self) -> None:
        if not (self.maps or self.light_sets or self.lamps):
            raise ValueError("no light is given; expected an environment map, a light set or a lamp")
        if len({each.unit for each in self.maps}) > 1:
            raise ValueError("one environment map is in cd/m² and another relative; they cannot be summed")
        if not 0 <= self.lamp_diameter < np.pi:
            raise ValueError(f"lamp_diameter is {self.lamp_diameter}; expected radians, 0 … π")
        if self.rotation is not None:
            required_rotation(self.rotation)

    @property
    def unit(self) -> str:
        """Of the radiance that the light gives."""
        return self.maps[0].unit if self.maps else "relative"

    def rotated(self, rotation: np.ndarray) -> StageLighting:
        """The same with maps and light sets turned further; lamps stay."""
        return replace(self, rotation=rotation if self.rotation is None else rotation @ self.rotation)

    def turntable(self, frames: int) -> tuple[StageLighting, ...]:
        """The light of each frame while maps and light sets turn once about the vertical, right-handed."""
        turns = 2 * np.pi * np.arange(frames) / frames
        return tuple(self.rotated(rotation_about((0.0, 1.0, 0.0), turn)) for turn in turns)

    def irradiances(self, lights: StageLights, by: Interpolation = Smooth()) -> np.ndarray:
        """What each light of a stage has to give, (N, 3), shared out by an interpolation."""
        total = np.zeros((len(lights), 3))
        for light in self.maps:
            total += irradiances(lights, light, by, self.rotation)
        for light_set in self._turned_sets():
            total += constellation_irradiances(lights, light_set, by)
        for lamp in self.lamps:
            total += lamp_irradiances(lights, lamp, by, radius=self.lamp_diameter / 2)
        return total

    def directed(self) -> DirectedLight:
        """The same light as directions, for direct light on a mesh."""
        turn = np.eye(3) if self.rotation is None else self.rotation
        parts = [quadtree_lights(light).turned(turn) for light in self.maps]
        for light_set in self._turned_sets():
            count = len(light_set.directions)
            radii = np.zeros(count) if light_set.angular_radii is None else light_set.angular_radii
            parts.append(DirectedLight(light_set.directions, light_set.irradiance, radii))
        for lamp in self.lamps:
            towards, irradiance = at_middle(lamp)
            parts.append(DirectedLight(towards[None], irradiance[None], np.array([self.lamp_diameter / 2])))
        return DirectedLight.of(parts)

    def _turned_sets(self) -> Sequence[Constellation]:
        if self.rotation is None:
            return self.light_sets
        return [replace(each, directions=each.directions @ self.rotation.T) for each in self.light_sets]


def as_lighting(light: StageLighting | EnvironmentMap) -> StageLighting:
    """The light itself, or that of an environment map; raises ValueError for anything else."""
    if isinstance(light, EnvironmentMap):
        return StageLighting((light,))
    if not isinstance(light, StageLighting):
        raise ValueError(
            f"the light is of type {type(light).__name__}; give an EnvironmentMap, which rl.read_environment reads, "
            "or a StageLighting"
        )
    return light
