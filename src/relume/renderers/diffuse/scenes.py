"""A scene of diffuse surfaces made ready for rays, and one line that refuses by name what is not diffuse.

Surfaces reflect from both sides and shine from their outer side alone, as Mitsuba's do here. Radiance of a surface is
its emission and ρ/π times its irradiance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from relume.errors import UnsupportedScene
from relume.light.reflection.convolution import as_latlong
from relume.renderers.diffuse.checks import require_far_light, require_lit
from relume.renderers.raytrace.lamps import Distant, Environment, Point, Surface, lamp_of, painted
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.renderers.unsupported import refused_light, renderer_of, unsupported_features
from relume.scene.lights import AmbientLight, DistantLight, PointLight
from relume.scene.materials.checks import Colour
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import AnyMaterial, Patches, Plane, Shape, Sphere
from relume.scene.shapes.tessellation import as_mesh
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.sampling import BrightDirections

NEAR = 1e-6
"""Share of the scene's size: a ray that starts on a surface does not meet it again before that."""


class Seen(NamedTuple):
    """What N rays meet; rows of rays that met nothing hold zeros.

    hit : (N,) bool
    shape, primitive : (N,) int32; barycentric : (N, 2); distance : (N,) metres, ∞ where nothing was met: as `Hits`
    front : (N,) bool, whether the outer side was met
    point : (N, 3) metres, world
    normal, geometric : (N, 3) unit vectors towards the side that was met: for shading, and of the surface itself
    reflectance, emission : (N, 3), ρ, and the radiance that is sent back along the ray
    """

    hit: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    barycentric: np.ndarray
    distance: np.ndarray
    front: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    geometric: np.ndarray
    reflectance: np.ndarray
    emission: np.ndarray

    @staticmethod
    def places(points: np.ndarray, normals: np.ndarray) -> Seen:
        """Places (N, 3) on flat, black surfaces of these unit normals."""
        count = len(points)
        black, number, true = np.zeros((count, 3)), np.zeros(count, np.int32), np.ones(count, bool)
        return Seen(true, number, number, black[:, :2], number, true, points, normals, normals, black, black)

    def only(self, which: np.ndarray) -> Seen:
        """Some of the rows."""
        return Seen(*(plane[which] for plane in self))


@dataclass(frozen=True, eq=False)
class DiffuseScene:
    """Shapes that are diffuse, and their lights.

    shapes : the local scene's, then the objects
    local : how many are the local scene's
    sky : the environment map; None where it is black
    lights : points and distant lights
    threads : all cores for None
    free : spheres and rectangles of light, which take no light and hide nothing, as lamps
    """

    shapes: tuple[Shape, ...]
    local: int
    sky: EnvironmentMap | None
    lights: tuple[PointLight | DistantLight, ...]
    threads: int | None = None
    free: tuple[Surface, ...] = ()

    @staticmethod
    def of(scene: Scene, whose: str, threads: int | None = None) -> DiffuseScene:
        """The scene as `whose` renderer sees it; raises UnsupportedScene naming what it cannot show."""
        require_far_light(scene, whose)
        if scene.medium is not None:
            raise UnsupportedScene(
                f"{whose} shows surfaces in clear air, and a medium fills this scene; use rl.Mitsuba "
                "(--renderer mitsuba), or leave the medium out"
            )
        for light in scene.lights:
            if isinstance(light, AmbientLight):
                raise refused_light(light, scene.lights, whose)
        shapes = (*scene.local, *scene.objects)
        for shape in shapes:
            if (why := not_diffuse(shape.material)) is not None:
                raise UnsupportedScene(
                    f"{whose} shows diffuse surfaces alone, and the material of {_name(shape)!r} has {why}; "
                    f"{renderer_of(shape.material)}, or a diffuse material (of pbr: specular = 0)"
                )
        lit = bool(np.any(scene.light.radiance))
        require_lit(lit or bool(scene.lights) or any(shines(shape.material) for shape in shapes))
        # What shines is sampled by its triangles, so that rays have to meet the same ones.
        ready = tuple(as_mesh(shape) if shines(shape.material) else shape for shape in shapes)
        lights = tuple(light for light in scene.lights if isinstance(light, PointLight | DistantLight))
        lamps = (lamp_of(light) for light in scene.lights)
        free = tuple(lamp for lamp in lamps if isinstance(lamp, Surface) and lamp.flux > 0)
        return DiffuseScene(ready, len(scene.local), scene.light if lit else None, lights, threads, free)

    @cached_property
    def caster(self) -> RayCaster:
        """The one tree over all shapes."""
        return RayCaster.of(self.shapes)

    @cached_property
    def size(self) -> float:
        """The longest side of the box round all but endless ground, metres; 1 where there is nothing else."""
        bounded = (shape for shape in self.shapes if not isinstance(shape, Plane) or shape.size is not None)
        corners = [corner for shape in bounded for corner in _box(shape)]
        return float(np.ptp(corners, axis=0).max()) if corners else 1.0

    @cached_property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """The low and the high corner (3,), metres, of the box round all shapes."""
        corners = np.array([corner for shape in self.shapes for corner in _box(shape)]).reshape(-1, 3)
        return (corners.min(axis=0), corners.max(axis=0)) if len(corners) else (np.zeros(3), np.ones(3))

    @cached_property
    def shining(self) -> tuple[Surface, ...]:
        """All surfaces that shine, as lamps."""
        lamps = [Surface(shape, emission_of(shape.material)) for shape in self.shapes if shines(shape.material)]
        return tuple(lamp for lamp in lamps if lamp.flux > 0)

    @cached_property
    def sizeless(self) -> tuple[Point | Distant, ...]:
        """Points and distant lights as lamps."""
        return tuple(Point(light) if isinstance(light, PointLight) else Distant(light) for light in self.lights)

    @cached_property
    def sky_lamp(self) -> Environment | None:
        """The environment map as a lamp."""
        return None if self.sky is None else Environment(BrightDirections.of(as_latlong(self.sky)))

    @cached_property
    def _lit(self) -> RayCaster | None:
        return RayCaster.of(tuple(lamp.shape for lamp in self.free)) if self.free else None

    @cached_property
    def _surfaces(self) -> Surfaces:
        return Surfaces.of(self.shapes)

    def look(self, origins: np.ndarray, directions: np.ndarray, *, leaving: bool = True) -> Seen:
        """What rays (N, 3) meet; `leaving` says that they start on a surface, which they do not meet again.

        Rays that do not, from an eye, see free lamps too: their light is added to the emission of what lies behind.
        """
        beyond = NEAR * self.size if leaving else 0.0
        hits = self.caster.nearest(origins, directions, beyond=beyond, threads=self.threads)
        there = self._surfaces.at(origins, directions, hits, threads=self.threads)
        front = np.einsum("ij,ij->i", there.geometric_normal, directions) <= 0
        side = np.where(front, 1.0, -1.0)[:, None]
        reflectance, emission = (np.zeros((len(directions), 3)) for _ in range(2))
        for index in np.unique(hits.shape[hits.shape >= 0]):
            here = np.flatnonzero(hits.shape == index)
            material = self.shapes[index].material
            reflectance[here] = painted(reflectance_of(material))(there.uv[here])
            if shines(material):
                emission[here] = painted(emission_of(material))(there.uv[here]) * front[here, None]
        if self._lit is not None and not leaving:
            lamp = self._lit.nearest(origins, directions, threads=self.threads)
            at = Surfaces.of(tuple(lamp.shape for lamp in self.free)).at(
                origins, directions, lamp, threads=self.threads
            )
            faces = np.einsum("ij,ij->i", at.geometric_normal, directions) < 0
            for index, each in enumerate(self.free):
                emission[(lamp.shape == index) & (lamp.distance < hits.distance) & faces] += each.emission
        return Seen(
            hits.shape >= 0, hits.shape, hits.primitive, hits.barycentric, hits.distance, front, there.point,
            side * there.shading_normal, side * there.geometric_normal, reflectance, emission,
        )  # fmt: skip

    def blocked(
        self, origins: np.ndarray, normals: np.ndarray, directions: np.ndarray, distances: object
    ) -> np.ndarray:
        """Whether something lies on ways (N, 3) from surfaces of these geometric normals, shorter than distances."""
        step = NEAR * self.size
        limits = np.maximum(np.asarray(distances, np.float64) - 2 * step, 0)
        return self.caster.occluded(origins + step * normals, directions, limits, threads=self.threads)


def not_diffuse(material: AnyMaterial) -> str | None:
    """What of a material is not diffuse, in a few words; None of a diffuse one."""
    if isinstance(material, Diffuse):
        return None
    if not isinstance(material, Material):
        return f"the reflection of a {type(material).__name__}"
    others = [name for name in unsupported_features(material) if name not in ("emission", "specular")]
    if np.any(material.through):
        others.insert(0, "transmission")
    if np.any(np.asarray(material.metallic) > 0):
        others.insert(0, "the reflection of a metal")
    elif np.any(np.asarray(material.specular) > 0):
        others.insert(0, "specular reflection")
    return ", ".join(others) or None


def shines(material: AnyMaterial) -> bool:
    """Whether a surface sends out light of its own."""
    return isinstance(material, Material) and material.emits


def reflectance_of(material: AnyMaterial) -> object:
    """The reflectance of a material that is diffuse: a colour or an image."""
    if isinstance(material, Diffuse):
        return material.reflectance
    assert isinstance(material, Material)
    return material.base_color


def emission_of(material: AnyMaterial) -> Colour | np.ndarray:
    """The radiance that a surface sends out: a colour or an image."""
    return material.emission if isinstance(material, Material) else (0.0, 0.0, 0.0)


def _name(shape: Shape) -> str:
    return getattr(shape.material, "name", "") or getattr(shape, "name", "the ground plane")


def _box(shape: Shape) -> Sequence[np.ndarray]:
    """Two corners of a box round a shape."""
    if isinstance(shape, Sphere):
        return np.asarray(shape.centre) - shape.radius, np.asarray(shape.centre) + shape.radius
    points = (shape.control if isinstance(shape, Patches) else as_mesh(shape).vertices).reshape(-1, 3)
    return points.min(axis=0), points.max(axis=0)
