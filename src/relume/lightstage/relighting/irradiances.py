"""Any light, as what each light of a stage has to give of it.

E_i, (N, 3), is the irradiance with which light i stands for its part of the sphere: the light L is integrated with
the weight that directions ω give to light i, E_i = ∫ L(ω) w_i(ω) dω (Debevec et al. 2000, eq. 4, where w_i is 1 in the
light's cell and 0 elsewhere). Maps are summed over all their pixels, never looked up at single directions.
"""

from __future__ import annotations

import numpy as np

from relume.light.constellations.constellation import Constellation
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Interpolation, Smooth
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.lights import DistantLight, PointLight
from relume.sphere.directions import normalised, required_rotation, rotation_between
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import pixel_points

_FINER = 8
"""Directions to a cell's breadth, at least: a map coarser than the stage is integrated over parts of its pixels."""
_LARGEST = 32
_DISC = 256


def irradiances(
    lights: StageLights, light: EnvironmentMap, by: Interpolation = Smooth(), rotation: np.ndarray | None = None
) -> np.ndarray:
    """What each light of a stage gives of an environment map: (N, 3) float64, in the map's unit times sr.

    rotation : (3, 3), active, by which the map is turned first; its pixels stay what they are
    by : how directions between the lights are shared out. Smooth by default, which is right for reflectance functions
        that are; `NearestLight()` is the paper's
    Their sum is the map's `total()`, to rounding.
    """
    directions, flux = _parts(lights, light)
    if rotation is not None:
        directions = directions @ required_rotation(rotation).T
    return by.gathered(lights, directions, flux)


def constellation_irradiances(lights: StageLights, light: Constellation, by: Interpolation = Smooth()) -> np.ndarray:
    """What each light of a stage gives of parallel lights, those with a size spread over their discs: (N, 3)."""
    radii = np.zeros(len(light.directions)) if light.angular_radii is None else light.angular_radii
    discs = [_disc(towards, radius) for towards, radius in zip(light.directions, radii, strict=True)]
    counts = [len(disc) for disc in discs]
    power = (light.irradiance / np.array(counts)[:, None]).repeat(counts, axis=0)
    return by.gathered(lights, np.concatenate([*discs, np.zeros((0, 3))]), power)


def lamp_irradiances(
    lights: StageLights, lamp: DistantLight | PointLight, by: Interpolation = Smooth(), *, radius: float = 0.0
) -> np.ndarray:
    """What each light of a stage gives of one lamp: (N, 3).

    radius : angular, of the even disc that the lamp is spread over, radians
    The field is one of distant light, so that a near lamp shines on all of the subject as on its middle.
    Raises ValueError for a lamp that stands in the subject's middle.
    """
    towards, irradiance = at_middle(lamp)
    return by.weights(lights, _disc(towards, radius)).mean(axis=0)[:, None] * irradiance


def at_middle(lamp: DistantLight | PointLight) -> tuple[np.ndarray, np.ndarray]:
    """The unit direction (3,) from the subject's middle towards a lamp and the irradiance (3,) that it gives there.

    Raises ValueError for a lamp that stands there.
    """
    if isinstance(lamp, DistantLight):
        return normalised(lamp.towards), np.asarray(lamp.irradiance, np.float64)
    place = np.asarray(lamp.position, np.float64)
    distance = float(np.linalg.norm(place))
    if distance == 0:
        raise ValueError(f"a lamp at {lamp.position} that holds the subject at (0.0, 0.0, 0.0); move it away")
    return place / distance, np.asarray(lamp.intensity, np.float64) * lamp.falloff.at(np.array(distance))


def _disc(towards: np.ndarray, radius: float) -> np.ndarray:
    """Directions (n, 3) spread evenly over the cap of an angular radius about a direction."""
    if radius == 0:
        return np.asarray(towards, np.float64)[None]
    return even_directions(_DISC, radius) @ rotation_between((0.0, 1.0, 0.0), towards).T


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
