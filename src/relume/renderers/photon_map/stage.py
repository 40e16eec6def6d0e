"""A scene as photons meet it: what a ray meets first, what it is made of there, and where mirrors and glass send it.

Three kinds of surface: those that scatter light evenly (Lambert), smooth mirrors, and smooth glass. What is between
bodies may be a fog (`Scene.medium`); what glass is filled with absorbs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relume.errors import UnsupportedScene, warn
from relume.light.reflection.convolution import as_latlong
from relume.light.reflection.weights import Fresnel
from relume.renderers.diffuse.checks import require_far_light, require_lit
from relume.renderers.raytrace.lamps import Ball, Distant, Environment, Lamp, Surface, lamp_of, painted
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.renderers.unsupported import refused_light, renderer_of, unsupported_features
from relume.scene.materials.materials import Diffuse, Material, is_image
from relume.scene.materials.media import Medium
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import AnyMaterial, Patches, Plane, Shape
from relume.scene.shapes.tessellation import tessellated
from relume.sphere.sampling import BrightDirections

NOTHING, EVEN, MIRROR, GLASS = 0, 1, 2, 3
"""Kinds of what a ray meets."""
WHOSE = "a photon map"
SMOOTH = 0.03
"""Roughness below which glass and mirrors are smooth: finer than any picture shows."""


class Met(NamedTuple):
    """What N rays met.

    distance : (N,) metres, ∞ where nothing is
    shape : (N,) int32, its place among the shapes, −1 for nothing
    kind : (N,) int8
    point : (N, 3) metres, world
    normal : (N, 3) unit, for shading, on the ray's side; `true_normal` is the geometric one
    inside : (N,) bool, whether the surface was met from behind; `within` whether the way there was through glass
    colour : (N, 3) what the surface gives back of light
    glow : (N, 3) radiance that it sends out towards the ray's origin
    """

    distance: np.ndarray
    shape: np.ndarray
    kind: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    true_normal: np.ndarray
    inside: np.ndarray
    colour: np.ndarray
    glow: np.ndarray

    @property
    def within(self) -> np.ndarray:
        return self.inside & (self.kind == GLASS)


@dataclass(frozen=True, eq=False)
class Stage:
    """Shapes, and what each is made of, in tables.

    ball : round all shapes and near lamps; so far a fog reaches
    near : metres, closer than which a ray does not meet the surface that it leaves
    kind, ior : (S + 1,), the last where nothing is met; absorption : (S + 1, 3) per metre, of what fills the body
    colours, glows : of each shape by its texture coordinates
    """

    caster: RayCaster
    surfaces: Surfaces
    ball: Ball
    near: float
    kind: np.ndarray
    ior: np.ndarray
    absorption: np.ndarray
    colours: tuple[Callable[[np.ndarray], np.ndarray], ...]
    glows: tuple[Callable[[np.ndarray], np.ndarray], ...]
    medium: Medium | None
    threads: int | None

    @staticmethod
    def of(shapes: Sequence[Shape], ball: Ball, medium: Medium | None, threads: int | None) -> Stage:
        """The stage of these shapes; raises UnsupportedScene naming the material that photons cannot meet."""
        shapes = [tessellated(shape) if isinstance(shape, Patches) else shape for shape in shapes]
        materials = [shape.material for shape in shapes]
        kind = np.array([*map(_kind, materials), NOTHING], np.int8)
        media = [material.medium if isinstance(material, Material) else None for material in materials]
        absorption = np.array([*((0.0, 0.0, 0.0) if m is None else m.absorption for m in media), (0.0, 0.0, 0.0)])
        colours = [m.reflectance if isinstance(m, Diffuse) else getattr(m, "base_color", 0.0) for m in materials]
        glows = [getattr(material, "emission", (0.0, 0.0, 0.0)) for material in materials]
        return Stage(
            RayCaster.of(shapes), Surfaces.of(shapes), ball, 1e-7 * ball[1], kind,
            np.array([*(getattr(material, "ior", 1.0) for material in materials), 1.0]), absorption,
            tuple(map(painted, colours)), tuple(map(painted, glows)), medium, threads,
        )  # fmt: skip

    def meet(self, origins: np.ndarray, directions: np.ndarray) -> Met:
        """What rays from (N, 3) along unit directions (N, 3) meet first."""
        hits = self.caster.nearest(origins, directions, beyond=self.near, threads=self.threads)
        at = self.surfaces.at(origins, directions, hits, threads=self.threads)
        there = hits.shape >= 0
        inside = np.einsum("ij,ij->i", at.geometric_normal, directions) > 0
        side = np.where(inside, -1.0, 1.0)[:, None]
        true, normal = side * at.geometric_normal, side * at.shading_normal
        # Interpolated normals lean away from rays that graze the mesh.
        normal = np.where(np.einsum("ij,ij->i", normal, directions)[:, None] < 0, normal, true)
        colour, glow = np.zeros_like(at.point), np.zeros_like(at.point)
        for shape in np.unique(hits.shape[there]):
            here = np.flatnonzero(hits.shape == shape)
            colour[here], glow[here] = self.colours[shape](at.uv[here]), self.glows[shape](at.uv[here])
        glow[inside] = 0
        return Met(hits.distance, hits.shape, self.kind[hits.shape], at.point, normal, true, inside, colour, glow)

    def hazy(
        self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray, within: np.ndarray | bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where on rays (N, 3) the fog begins and how long it lasts, metres (N,), up to what is so far away (N,).

        within : (N,) bool, whether the way is in glass, where there is none
        """
        away = origins - self.ball[0]
        middle = -np.einsum("ij,ij->i", away, directions)
        half = np.sqrt(np.maximum(self.ball[1] ** 2 - np.einsum("ij,ij->i", away, away) + middle**2, 0))
        begin = np.maximum(middle - half, 0)
        length = np.maximum(np.minimum(middle + half, far) - begin, 0)
        return begin, np.where(within, 0.0, length) if self.medium is not None else np.zeros(len(far))

    def left(self, length: np.ndarray) -> np.ndarray:
        """The share (N, 3) of light that so many metres (N,) of fog let through (Beer and Lambert)."""
        return np.exp(-np.multiply.outer(length, self.medium.extinction if self.medium else (0.0, 0.0, 0.0)))

    def clearness(self, met: Met) -> np.ndarray:
        """What is left of light (N, 3) that went through the body whose wall was met from inside (Beer's law)."""
        depth = np.where(met.within, met.distance, 0.0)[:, None]
        return np.exp(-self.absorption[met.shape] * depth)

    def glanced(
        self, directions: np.ndarray, met: Met, random: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where smooth surfaces send rays: unit directions (N, 3), their share (N, 3), and by how much radiance seen
        along them is squeezed (N,). Chance chooses reflection or refraction, each as often as Fresnel says.
        """
        normal, cosine = met.normal, -np.einsum("ij,ij->i", directions, met.normal)
        glass = met.kind == GLASS
        ratio = np.where(glass, self.ior[met.shape], 1.0)
        ratio = np.where(met.inside, 1 / ratio, ratio)
        reflects = np.ones(len(glass))
        for value in np.unique(ratio[glass]):
            here = glass & (ratio == value)
            reflects[here] = Fresnel(float(value))(cosine[here])
        through = random.random(len(glass)) >= reflects
        under = np.sqrt(np.maximum(ratio**2 - 1 + cosine**2, 0))
        turned = directions + 2 * cosine[:, None] * normal
        bent = (directions + (cosine - under)[:, None] * normal) / ratio[:, None]
        ways = np.where(through[:, None], bent, turned)
        # Glass colours what goes through, by half at either wall; mirrors what they reflect.
        share = np.where(through[:, None], np.sqrt(met.colour), np.where(glass[:, None], 1.0, met.colour))
        return ways / np.linalg.norm(ways, axis=1, keepdims=True), share, np.where(through, ratio**-2, 1.0)

    def sees(self, points: np.ndarray, normals: np.ndarray | float, directions: np.ndarray, far: np.ndarray):
        """(N,) bool, whether nothing stands between surface points and what is so many metres away from them."""
        origins, far = points + self.near * normals, np.maximum(far - 4 * self.near, 0)
        return ~self.caster.occluded(origins, directions, far, threads=self.threads)


def _kind(material: AnyMaterial) -> int:
    """What photons take a material for; raises UnsupportedScene for what they cannot meet."""
    name = getattr(material, "name", "")
    if isinstance(material, Diffuse):
        return EVEN
    if not isinstance(material, Material):
        raise UnsupportedScene(
            f"a photon map has no place for the {type(material).__name__} material {name!r}; {renderer_of(material)}, "
            "or diffuse surfaces"
        )
    left_out = {*unsupported_features(material)} - {"emission"}
    if not np.any(material.through):
        left_out -= {"specular"}
    if material.medium is not None and not any(material.medium.scattering):
        left_out -= {"what fills the body"}
    if left_out:
        raise _refused(f"{', '.join(sorted(left_out))} of the material {name!r}")
    if any(is_image(value) for value in (material.metallic, material.roughness, material.transmission)):
        raise _refused(f"images of metallic, roughness or transmission of the material {name!r}")
    smooth = material.roughness < SMOOTH
    if material.metallic == 1 and smooth:
        return MIRROR
    if material.through == 1 and smooth:
        return GLASS
    bare = bool(np.all(np.asarray(material.specular) == 0))
    if material.metallic == 0 and material.transmission == 0 and (bare or material.emits):
        if not bare:
            warn(f"a photon map does not show the gloss of the lamp {name!r}; specular = 0 says that it has none")
        return EVEN
    raise _refused(f"the gloss of the material {name!r}", "specular = 0, smooth mirrors, smooth glass and ")


def _refused(what: str, otherwise: str = "") -> UnsupportedScene:
    for_all = "use rl.Mitsuba (--renderer mitsuba)"
    return UnsupportedScene(f"{WHOSE} has no place for {what}; {for_all}, or {otherwise}diffuse surfaces")


def lamps_of(scene: Scene) -> tuple[Lamp, ...]:
    """All that shines in a scene; raises UnsupportedScene naming a lamp that sends no photons."""
    shining = [(shape, shape.material) for shape in (*scene.local, *scene.objects)]
    lamps: list[Lamp] = [Surface(s, m.emission) for s, m in shining if isinstance(m, Material) and m.emits]
    for light in scene.lights:
        if (lamp := lamp_of(light)) is None:
            raise refused_light(light, scene.lights, WHOSE)
        lamps.append(lamp)
    require_far_light(scene, WHOSE)
    if np.any(scene.light.radiance):
        lamps.append(Environment(BrightDirections.of(as_latlong(scene.light))))
    far = any(isinstance(lamp, Distant | Environment) for lamp in lamps)
    if far and any(isinstance(shape, Plane) and shape.size is None for shape, _ in shining):
        raise UnsupportedScene("photons from infinity would be spread over a plane without an edge; give it a size")
    require_lit(bool(lamps))
    return tuple(lamps)
