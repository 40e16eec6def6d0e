"""Light as a scene itself sends it to a point: six renders on the faces of a cube, and its lamps splatted.

Miller & Hoffman (1984), §5.2: simulated environments.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from relume.errors import UnsupportedScene, warn
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress
from relume.scene.cameras.camera import Camera
from relume.scene.lights import AmbientLight, DistantLight, RectangleLight, SphereLight
from relume.scene.materials.materials import Material
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Shape
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import OUTWARD, CubeCross, Strip, VerticalCubeCross
from relume.sphere.mappings.mapping import LatLong, Mapping

NEAR = 1e-6
"""Metres: a lamp nearer than this lies at the point itself, where it has no direction."""


@dataclass(frozen=True, eq=False)
class Arrival:
    """What a lamp that has no size sends to a point.

    towards : unit vector to it
    irradiance : (3,) on a surface that faces it, in the light's unit
    """

    towards: np.ndarray
    irradiance: np.ndarray


def environment(
    scene: Scene,
    point: ArrayLike,
    renderer: Renderer,
    *,
    size: int = 512,
    mapping: Mapping = LatLong(),
    seed: int = 0,
    progress: Progress | None = None,
) -> EnvironmentMap:
    """The environment map of a scene seen from a point in it.

    point : metres, world; the object that the map is to light should not be in the scene, nor the point in a shape
    renderer : of the six faces; what it shows is what the map holds
    size : rows of the map. The six faces that are rendered are, in their middles, where they are coarsest, as fine as
        that: as a lat-long's horizon, as the middles of a cube's own faces, as any other mapping's mean
    mapping : of the map
    seed : the faces' are different ones made from it

    The scene's own light map is seen behind its shapes. Lamps without size, points and suns, which no picture shows,
    are added at the direction they come from: their irradiance at the point, intensity/distance² for the square law,
    over the solid angle of the pixels about it, so that the map's total grows by exactly that much. Those behind a
    shape are left out, wholly, however clear it is, with a warning. Ambient light is in the map as far as surfaces
    show it, and lamps that have a size, spheres and rectangles of light, are seen in the
    pictures.
    Raises UnsupportedScene where the renderer cannot shade the scene, ValueError for a lamp at the point.
    """
    place = np.asarray(point, np.float64)
    if place.shape != (3,) or not np.all(np.isfinite(place)):
        raise ValueError(f"point is {point}; expected three finite lengths in metres")
    if size < 2:
        raise ValueError(f"size is {size}; expected at least 2 rows")
    # Refused before six pictures are rendered.
    lamps = arrivals(scene, place)
    if lamps:
        _require_clear_air(scene)
    side = _side(mapping, size)
    unfolded = np.zeros((*CubeCross().shape(3 * side), 3), np.float32)
    for face in range(6):
        report = None if progress is None else (lambda share, done=face: progress((done + share) / 6))
        own = int(np.random.SeedSequence([seed, face]).generate_state(1)[0])
        picture = renderer.render(scene, face_camera(face, place, side), seed=own, progress=report)
        row, column = CubeCross.cells[face] * side
        unfolded[row : row + side, column : column + side] = picture.radiance
    if not np.all(np.isfinite(unfolded)):
        raise ValueError(f"the renderer saw values that are not finite from {place.tolist()}; is the point in a shape?")
    seen = EnvironmentMap(np.maximum(unfolded, 0), CubeCross(), scene.light.unit).remapped(mapping, size)
    return seen if not lamps else replace(seen, radiance=seen.radiance + splatted(lamps, mapping, size).radiance)


def _require_clear_air(scene: Scene) -> None:
    if scene.medium is not None:
        raise UnsupportedScene(
            "points of light and suns are added to an environment map as they shine through clear air, and the scene "
            "has a medium; leave the medium out, or give the lamps a size (spheres or rectangles of light)"
        )


def _side(mapping: Mapping, size: int) -> int:
    """Pixels across a cube's face that are in its middle, where they are 2/side radians wide, as fine as a map's."""
    rows = mapping.shape(size)[0]
    if isinstance(mapping, CubeCross | VerticalCubeCross | Strip):
        return rows // mapping.grid[0]
    if isinstance(mapping, LatLong):
        # Its mean would count the crowded pixels at the poles.
        return int(np.ceil(2 * rows / np.pi))
    areas = mapping.solid_angles(size)
    return int(np.ceil(2 * np.sqrt(np.count_nonzero(areas) / areas.sum())))


def face_camera(face: int, point: np.ndarray, side: int) -> Camera:
    """The camera that sees one face of the cube round a point, `side` pixels wide, as `CubeCross` lays it out."""
    right, down = CubeCross.axes.right[face], CubeCross.axes.down[face]
    return Camera(side, side, side / 2, point, np.stack([right, -down, -OUTWARD[face]], axis=1))


def arrivals(scene: Scene, point: np.ndarray) -> list[Arrival]:
    """What the scene's points of light and suns send to a point, but for those behind a shape.

    Spheres and rectangles of light are not among them: renderers that know them show them.
    """
    found: list[Arrival] = []
    distances: list[float] = []
    for light in scene.lights:
        if isinstance(light, AmbientLight | SphereLight | RectangleLight):
            continue
        if isinstance(light, DistantLight):
            found.append(Arrival(normalised(light.towards), np.asarray(light.irradiance, np.float64)))
            distances.append(np.inf)
            continue
        way = np.asarray(light.position, np.float64) - point
        distance = float(np.linalg.norm(way))
        if distance < NEAR:
            raise ValueError(
                f"the point of light at {light.position} is where the environment is looked at from, so it has no "
                "direction; move one of them"
            )
        falloff = float(light.falloff.at(np.array(distance)))
        found.append(Arrival(way / distance, np.asarray(light.intensity, np.float64) * falloff))
        distances.append(distance)
    shapes = (*scene.local, *scene.objects)
    if not found or not shapes:
        return found
    # The ray caster is imported only where it is used: it imports Numba.
    from relume.renderers.raytrace.raycast import RayCaster

    directions = np.stack([arrival.towards for arrival in found])
    met = RayCaster.of(shapes).nearest(point, directions)
    behind = met.distance < np.array(distances) * (1 - 1e-9)
    clear = sum(bool(hidden) and _is_clear(shapes[index]) for hidden, index in zip(behind, met.shape, strict=True))
    if clear:
        warn(
            f"{clear} of the scene's lamps shine through something transparent; they are left out of the map, which "
            "has no way of bending their light"
        )
    return [arrival for arrival, hidden in zip(found, behind, strict=True) if not hidden]


def splatted(lamps: Sequence[Arrival], mapping: Mapping = LatLong(), size: int = 512) -> EnvironmentMap:
    """A map of lamps alone, black elsewhere; its total is the sum of their irradiance.

    Each falls on the four pixels of a lat-long map about its direction, in shares that put its mean there; that map is
    then brought into the mapping.
    """
    rows, columns = LatLong().shape(size)
    flux = np.zeros((rows, columns, 3))
    for lamp in lamps:
        u, v = LatLong().image_points(lamp.towards)
        x, y = u * columns - 0.5, v * rows - 0.5
        left, top = int(np.floor(x)), int(np.floor(y))
        for row, down in ((top, 1 - (y - top)), (top + 1, y - top)):
            for column, across in ((left, 1 - (x - left)), (left + 1, x - left)):
                # Over a pole the neighbour is in the same row, on the other side.
                turned = column if 0 <= row < rows else column + columns // 2
                flux[min(max(row, 0), rows - 1), turned % columns] += down * across * lamp.irradiance
    radiance = flux / LatLong().solid_angles(size)[..., None]
    light = EnvironmentMap(radiance.astype(np.float32))
    return light if isinstance(mapping, LatLong) else light.remapped(mapping, size)


def _is_clear(shape: Shape) -> bool:
    material = shape.material
    if isinstance(material, Material | WhittedMaterial):
        return bool(np.any(np.asarray(material.transmission) > 0))
    return False
