"""The light that shines on a stage's subject, and what each light of the stage has to give of it.

E_i, (N, 3), is the irradiance with which light i stands for its part of the sphere: the light L is integrated with
the weight that directions ω give to light i, E_i = ∫ L(ω) w_i(ω) dω (Debevec et al. 2000, eq. 4, where w_i is 1 in the
light's cell and 0 elsewhere). Maps are summed over all their pixels, never looked up at single directions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.light.constellations.constellation import Constellation
from relume.lightstage.direct_light.light_directions import DirectedLight, quadtree_lights
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Interpolation, Smooth
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.lights import DistantLight, PointLight
from relume.sphere.directions import normalised, required_rotation, rotation_about, rotation_between
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import pixel_points

_FINER = 8
"""Directions to a cell's breadth, at least: a map coarser than the stage is integrated over parts of its pixels."""
_LARGEST = 32
_DISC = 256


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
        """The unit of the radiance that the light gives."""
        return self.maps[0].unit if self.maps else "relative"

    def rotated(self, rotation: np.ndarray) -> StageLighting:
        """The same lighting with maps and light sets turned further by `rotation` (3, 3), active; lamps stay."""
        return replace(self, rotation=rotation if self.rotation is None else rotation @ self.rotation)

    def turntable(self, frames: int) -> tuple[StageLighting, ...]:
        """The light of each of `frames` while maps and light sets turn once about the vertical, right-handed."""
        turns = 2 * np.pi * np.arange(frames) / frames
        return tuple(self.rotated(rotation_about((0.0, 1.0, 0.0), turn)) for turn in turns)

    def irradiances(self, lights: StageLights, by: Interpolation = Smooth()) -> np.ndarray:
        """What each light of a stage has to give, (N, 3).

        lights : the stage's
        by : how directions between the lights are shared out
        """
        total = np.zeros((len(lights), 3))
        for light in self.maps:
            total += irradiances(lights, light, by, self.rotation)
        for light in self._parallel():
            total += _disc_irradiances(lights, light, by)
        return total

    def directed(self, leaves: int = 1500) -> DirectedLight:
        """The same light as directions, for direct light on a mesh; a map by about so many `leaves`."""
        turn = np.eye(3) if self.rotation is None else self.rotation
        parts = [quadtree_lights(light, leaves).turned(turn) for light in self.maps]
        return DirectedLight.of([*parts, *self._parallel()])

    def _parallel(self) -> list[DirectedLight]:
        """Light sets, turned, and lamps."""
        turn, parts = np.eye(3) if self.rotation is None else self.rotation, []
        for each in self.light_sets:
            radii = np.zeros(len(each.directions)) if each.angular_radii is None else each.angular_radii
            parts.append(DirectedLight(each.directions, each.irradiance, radii).turned(turn))
        for lamp in self.lamps:
            towards, irradiance = _at_middle(lamp)
            parts.append(DirectedLight(towards[None], irradiance[None], np.array([self.lamp_diameter / 2])))
        return parts


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


def irradiances(
    lights: StageLights, light: EnvironmentMap, by: Interpolation = Smooth(), rotation: np.ndarray | None = None
) -> np.ndarray:
    """What each light of a stage gives of an environment map: (N, 3) float64, in the map's unit times sr.

    lights : the stage's
    light : the map
    rotation : (3, 3), active, by which the map is turned first; its pixels stay what they are
    by : how directions between the lights are shared out. Smooth by default, which is right for reflectance functions
        that are; `NearestLight()` is the paper's
    Their sum is the map's `total()`, to rounding.
    """
    directions, flux = _parts(lights, light)
    if rotation is not None:
        directions = directions @ required_rotation(rotation).T
    return by.gathered(lights, directions, flux)


def _parts(lights: StageLights, light: EnvironmentMap) -> tuple[np.ndarray, np.ndarray]:
    """Directions (M, 3) and their radiance × solid angle (M, 3), of the pixels that shine or of parts of them."""
    breadth = np.sqrt(lights.solid_angles.min())
    areas = light.mapping.solid_angles(light.size)
    parts = int(np.clip(np.ceil(_FINER * np.sqrt(areas.max()) / breadth), 1, _LARGEST))
    points = pixel_points(light.mapping, light.size, parts)
    directions = light.mapping.directions(light.mapping.shown(points))
    flux = (light.radiance.astype(np.float64) * areas[..., None]).repeat(parts, 0).repeat(parts, 1) / parts**2
    # Within a pixel of a lat-long map its parts differ in solid angle; near the poles by as much as they are high.
    if parts > 1:
        fine = light.mapping.solid_angles(light.size * parts)
        coarse = areas.repeat(parts, 0).repeat(parts, 1) / parts**2
        flux *= np.where(coarse > 0, fine / np.where(coarse > 0, coarse, 1), 0)[..., None]
    lit = flux.any(axis=-1)
    return directions[lit], flux[lit]


def _disc_irradiances(lights: StageLights, light: DirectedLight, by: Interpolation) -> np.ndarray:
    """What each light of a stage gives of parallel lights, those with a size spread over their discs: (N, 3)."""
    discs = [
        even_directions(_DISC, radius) @ rotation_between((0.0, 1.0, 0.0), towards).T if radius else towards[None]
        for towards, radius in zip(light.directions, light.radii, strict=True)
    ]
    counts = [len(disc) for disc in discs]
    power = (light.irradiances / np.array(counts)[:, None]).repeat(counts, axis=0)
    return by.gathered(lights, np.concatenate([*discs, np.zeros((0, 3))]), power)


def _at_middle(lamp: DistantLight | PointLight) -> tuple[np.ndarray, np.ndarray]:
    """The unit direction (3,) from the subject's middle towards a lamp and the irradiance (3,) that it gives there.

    The field is one of distant light, so that a near lamp shines on all of the subject as on its middle.
    Raises ValueError for a lamp that stands there.
    """
    if isinstance(lamp, DistantLight):
        return normalised(lamp.towards), np.asarray(lamp.irradiance, np.float64)
    place = np.asarray(lamp.position, np.float64)
    distance = float(np.linalg.norm(place))
    if distance == 0:
        raise ValueError(f"a lamp at {lamp.position} that holds the subject at (0.0, 0.0, 0.0); move it away")
    return place / distance, np.asarray(lamp.intensity, np.float64) * lamp.falloff.at(np.array(distance))
