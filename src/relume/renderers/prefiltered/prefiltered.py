"""The renderer `Prefiltered`: shading by look-up in reflection maps (Miller & Hoffman 1984, §3).

What it cannot show, as the paper says: objects do not see themselves or each other, neither in mirrors nor as shadow,
and all of a scene's light comes from infinity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from relume.errors import UnsupportedScene, warn
from relume.light.reflection.brdf import Reflectance
from relume.light.reflection.convolution import as_latlong
from relume.light.reflection.glossy import AZIMUTHS, GlossyMap, glossy_map
from relume.light.reflection.reflection_map import reflection_map
from relume.renderers.prefiltered.filters import Filter, Plain, Preintegrated, Spans, background
from relume.renderers.prefiltered.glossy_kernel import lookup_glossy
from relume.renderers.prefiltered.materials import ShadedLayer, layers_of
from relume.renderers.prefiltered.shading_inputs import GBuffer, Samples, Term, term
from relume.renderers.raytrace.visibility import Seen, Stage
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress, Render
from relume.renderers.unsupported import light_name, renderer_for
from relume.scene.cameras.camera import Camera
from relume.scene.lights import RectangleLight, SphereLight
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.materials.reflective import Reflective
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.scene import Infinite, Scene
from relume.scene.shapes.shapes import Patches, Polygon, Solid, Sphere
from relume.sphere.bilinear_kernels import padded
from relume.sphere.environment_map import EnvironmentMap

_BAND = 2**19
"""Pixels of a picture that are shaded at once: each takes 400 bytes until it is done."""
LOOK_UPS = 8
"""Look-ups in a glossy map along each side of a pixel, at most, where the normal turns within it."""


@dataclass(frozen=True)
class Prefiltered(Renderer):
    """Reflection maps: a few look-ups a pixel, however much the surroundings hold.

    filter : how pixels read the maps; pre-integrated sums unless given, which keep small lights whole
    background : show the light behind the objects, as the other renderers do; False leaves all black but the objects,
        for matting over a plate
    threads : all cores unless given; the pixels do not depend on it
    """

    filter: Filter = Preintegrated()
    background: bool = True
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.threads is not None and self.threads < 1:
            raise ValueError(f"threads is {self.threads}; expected at least 1, or none for all cores")

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """Make the tables and render one picture; there is no noise, and `seed` changes nothing.

        scene, camera : what is rendered, and whose picture it is
        progress : called with the share of the work that is done, 0 to 1
        """
        return self.prepared(scene).render(camera, progress=progress)

    def prepared(self, scene: Scene) -> Prepared:
        """Everything that does not depend on the camera, for many pictures of one scene (§3, lines 1 to 3)."""
        shapes = (*scene.local, *scene.objects)
        materials = _mappable(scene)
        if len(shapes) > 1 or not all(_is_convex(shape) for shape in scene.objects):
            names = ", ".join(shape.name for shape in scene.objects[:4]) + ("…" if len(scene.objects) > 4 else "")
            warn(
                f"reflection maps show no shadows and no reflections of objects in themselves or each other ({names}); "
                "light transport and ray tracing do (--renderer mitsuba, --renderer whitted)"
            )
        shading = Shading.of(materials, scene.light, self.filter, self.threads)
        return Prepared(self, scene, Stage.of(shapes), shading)


@dataclass(frozen=True, eq=False)
class Shading:
    """The tables of several materials under one light.

    layers : for each material its layers, each with its table as the filter reads it
    first : (materials,) the index of the first material that is the same one
    """

    layers: tuple[tuple[tuple[ShadedLayer, Any], ...], ...]
    first: np.ndarray
    filter: Filter
    threads: int | None = None

    @staticmethod
    def of(
        materials: Sequence[Material | Diffuse | Reflective],
        light: EnvironmentMap,
        filter: Filter = Plain(),
        threads: int | None = None,
        *,
        azimuths: int = AZIMUTHS,
    ) -> Shading:
        """Make the tables; materials with the same lobe share one.

        azimuths : of three-dimensional maps (`glossy_map`); more where a bare sun stands low behind the object
        """
        tables: dict[object, Any] = {}

        def table(layer: ShadedLayer) -> Any:
            lobe = layer.layer.lobe
            if lobe not in tables:
                if isinstance(lobe, Reflectance):
                    tables[lobe] = glossy_map(light, lobe, azimuths=azimuths)
                else:
                    tables[lobe] = filter.prepared(reflection_map(light, lobe).table)
            return tables[lobe]

        layers = tuple(tuple((layer, table(layer)) for layer in layers_of(material)) for material in materials)
        # Objects of one material are shaded together.
        first = np.array([[other is material for other in materials].index(True) for material in materials], np.int32)
        return Shading(layers, first, filter, threads)

    def shade(self, pixels: GBuffer) -> np.ndarray:
        """Line 9 for every pixel of a G-buffer: radiance (H, W, 3) float32, 0 where it holds no surface.

        Raises ValueError where a pixel names a material that is not there.
        """
        if pixels.surface.size and pixels.surface.max() >= len(self.layers):
            raise ValueError(
                f"the G-buffer names material {pixels.surface.max()} of {len(self.layers)}; they are numbered from 0"
            )
        named = np.unique(pixels.surface[pixels.surface >= 0])
        if pixels.uv is None and any(layer.has_image for index in named for layer, _ in self.layers[index]):
            raise ValueError(
                "a material has an image, but the G-buffer has no uv; give its texture coordinates (H, W, 2)"
            )
        uv = np.zeros((pixels.surface.size, 2)) if pixels.uv is None else pixels.uv.reshape(-1, 2)
        return self.light(pixels.samples(), uv).reshape(*pixels.surface.shape, 3)

    def light(self, samples: Samples, uv: np.ndarray) -> np.ndarray:
        """Radiance (P, 3) float32 of samples with texture coordinates (P, 2)."""
        material = samples.surface
        if np.any(self.first != np.arange(len(self.first))):
            # Of samples that see nothing, −1, the last entry says that they belong to no material.
            material = np.append(self.first, np.int32(-1))[samples.surface]
        if isinstance(self.filter, Plain) and (even := self._even(uv)):
            return self.filter.shaded(samples, material, even, self.threads)[:, :3]
        light, spans = np.zeros((len(samples.normal), 4), np.float32), Spans(samples, self.threads)
        for index, layers in enumerate(self.layers):
            chosen = np.flatnonzero(material == index).astype(np.int32)
            if not chosen.size:
                continue
            looked_up = []
            for layer, table in layers:
                part, lit = self._part(layer, uv, chosen, len(light))
                if isinstance(table, GlossyMap):
                    self._add_glossy(light, lit, spans, part, table)
                else:
                    looked_up.append((lit, part, table))
            self.filter.add_all(light, spans, looked_up)
        return light[:, :3]

    def _even(self, uv: np.ndarray) -> list[tuple[int, Term, Any]] | None:
        """The terms of all materials with their numbers and tables; None where one varies over the surface or has a
        three-dimensional map."""
        parts, nobody = [], np.zeros(0, np.int32)
        for index in np.unique(self.first):
            for layer, table in self.layers[index]:
                if layer.has_image or isinstance(table, GlossyMap):
                    return None
                colour, rim = layer.colour(uv, nobody), layer.rim(uv, nobody)
                parts.append((int(index), term(layer.layer, colour, rim), table))
        return parts

    def _part(self, layer: ShadedLayer, uv: np.ndarray, chosen: np.ndarray, count: int) -> tuple[Term, np.ndarray]:
        """A layer's term, and which of the chosen samples it gives light to."""
        colour, rim = layer.colour(uv, chosen), layer.rim(uv, chosen)
        part = term(layer.layer, *(_scattered(each, chosen, count) for each in (colour, rim)))
        # Of a term without colours of its own the colour is everywhere the same.
        return part, chosen[np.any(colour + rim, axis=1)] if len(part.colour) else chosen

    def _add_glossy(self, light: np.ndarray, chosen: np.ndarray, spans: Spans, part: Term, table: GlossyMap) -> None:
        most = 1 if isinstance(self.filter, Plain) else LOOK_UPS
        tilts, tables, samples = table.tilts.astype(np.float32), table.padded, spans.samples
        spans.add(
            light, chosen, part, lambda seen, here: lookup_glossy(seen, here, samples, tables, tilts, most), chunk=4096
        )


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scene with its tables and its tree of bounding boxes: pictures from here on cost their pixels only."""

    renderer: Prefiltered
    scene: Scene
    stage: Stage
    shading: Shading

    @cached_property
    def background(self) -> np.ndarray:
        """The light as kernels look it up."""
        return padded(as_latlong(self.scene.light).radiance)

    def render(
        self,
        camera: Camera,
        *,
        turn: np.ndarray | None = None,
        about: tuple[float, float, float] = (0.0, 0.0, 0.0),
        progress: Progress | None = None,
    ) -> Render:
        """One picture (§3, lines 5 to 9).

        turn : (3, 3) rotation of everything but the light and the camera; none unless given
        about : the point that it leaves where it is, metres
        """
        turned, height = np.eye(3) if turn is None else turn, camera.height
        step = max(1, _BAND // camera.width)
        if step >= height:
            whole = self._rows(camera, turned, np.asarray(about))
        else:
            colour, plain = (height, camera.width, 3), (height, camera.width)
            whole = Render(
                radiance=np.empty(colour, np.float32), variance=np.empty(colour, np.float32),
                matte=np.empty(plain, np.float32), depth=np.empty(plain, np.float32),
                normal=np.empty(colour, np.float32), albedo=np.empty(colour, np.float32),
            )  # fmt: skip
            for top in range(0, height, step):
                # An edge is found by the rows on both of its sides.
                first, last = max(top - 1, 0), min(top + step + 1, height)
                part = self._rows(camera.window(0, first, camera.width, last - first), turned, np.asarray(about))
                for name in ("radiance", "variance", "normal", "albedo", "matte", "depth"):
                    getattr(whole, name)[top : top + step] = getattr(part, name)[top - first : top - first + step]
                if progress:
                    progress(top / height)
        if progress:
            progress(1.0)
        return whole

    def _rows(self, camera: Camera, turn: np.ndarray, about: np.ndarray) -> Render:
        """One picture at once."""
        seen = self.stage.seen(camera, turn, about, self.renderer.threads)
        light = self.shading.light(seen.samples, seen.uv)
        if self.renderer.background:
            missed = np.flatnonzero(seen.samples.surface < 0)
            light[missed] = background(self.background, seen.rays[missed], self.renderer.threads)
        else:
            # What is not an object is the plate's: it would be there twice.
            light[seen.samples.surface < len(self.scene.local)] = 0
        return self._render(seen, light, camera)

    def _render(self, seen: Seen, light: np.ndarray, camera: Camera) -> Render:
        hit = (seen.samples.surface >= 0) * seen.share
        objects = (seen.samples.surface >= len(self.scene.local)) * seen.share
        covered = _gathered(hit, seen, camera)
        distance = _gathered(np.where(hit > 0, seen.distance, 0) * hit, seen, camera)
        albedo = np.zeros_like(light)
        for index, layers in enumerate(self.shading.layers):
            here = np.flatnonzero(seen.samples.surface == index)
            for layer, _ in layers if here.size else ():
                albedo[here] += layer.colour(seen.uv, here) * np.reshape(layer.layer.weight(np.ones(1)), (1, -1))
        radiance = _gathered(light * seen.share[:, None], seen, camera)
        return Render(
            radiance,
            np.zeros_like(radiance),
            np.minimum(_gathered(objects, seen, camera), 1),
            (distance / np.maximum(covered, 1e-12)).astype(np.float32),
            _gathered(seen.samples.normal * hit[:, None], seen, camera),
            _gathered(albedo * hit[:, None], seen, camera),
        )


def _mappable(scene: Scene) -> list[Material | Diffuse | Reflective]:
    """The materials of all shapes; raises UnsupportedScene for what no reflection map holds."""
    if not isinstance(scene.distant, Infinite):
        raise UnsupportedScene(
            "reflection maps hold light from infinity alone, and this scene's is on walls; use rl.Mitsuba "
            "(--renderer mitsuba), or an Infinite distant scene"
        )
    if scene.medium is not None:
        raise UnsupportedScene(
            "reflection maps hold light that meets nothing on its way, and a medium fills this scene; use rl.Mitsuba "
            "(--renderer mitsuba), or leave the medium out"
        )
    if scene.lights:
        # Where it can, the one that is as fast.
        sized = any(isinstance(light, SphereLight | RectangleLight) for light in scene.lights)
        use = renderer_for(scene.lights) if sized else "use rl.Whitted (--renderer whitted)"
        raise UnsupportedScene(
            "reflection maps hold light from infinity alone, and this scene has lights of its own "
            f"({light_name(scene.lights[0])}); {use}"
        )
    materials = []
    for shape in (*scene.local, *scene.objects):
        if isinstance(shape.material, WhittedMaterial):
            raise UnsupportedScene(
                f"reflection maps cannot shade the whitted material {shape.material.name!r}; "
                "use rl.Whitted (--renderer whitted), or a glossy or mirror material"
            )
        if isinstance(shape.material, Ward):
            raise UnsupportedScene(
                f"reflection maps cannot shade the Ward surface {shape.material.name!r}; "
                "use rl.Mitsuba (--renderer mitsuba), or a glossy material with the lobe ward"
            )
        if isinstance(shape.material, MeasuredBRDF | ABCFacets):
            raise UnsupportedScene(
                f"reflection maps cannot shade the measured surface {shape.material.name!r}; "
                "use rl.Mitsuba (--renderer mitsuba), or a glossy material"
            )
        materials.append(shape.material)
    return materials


def _is_convex(shape: Solid) -> bool:
    """Whether a solid fills its convex hull, or is flat; of patches nobody knows."""
    if isinstance(shape, Sphere | Polygon):
        return True
    if isinstance(shape, Patches):
        return False
    a, b, c = np.moveaxis(np.asarray(shape.vertices, np.float64)[shape.faces], 1, 0)
    try:
        hull = ConvexHull(np.unique(shape.vertices, axis=0)).volume
    except QhullError:
        return True
    return bool(abs(np.einsum("ij,ij->", a, np.cross(b, c)) / 6) > 0.999 * hull)


def _gathered(values: np.ndarray, seen: Seen, camera: Camera) -> np.ndarray:
    """Sums of samples' values over their pixels, (H, W) or (H, W, 3) float32."""
    shape, count = (camera.height, camera.width), camera.height * camera.width
    if values.ndim == 1:
        return np.bincount(seen.pixel, values, count).reshape(shape).astype(np.float32)
    planes = [np.bincount(seen.pixel, plane, count) for plane in values.T]
    return np.stack(planes, axis=-1).reshape(*shape, 3).astype(np.float32)


def _scattered(colours: np.ndarray, chosen: np.ndarray, count: int) -> np.ndarray:
    """Colours of the chosen samples in their places among all; a single one stays single."""
    if len(colours) == 1:
        return colours
    everywhere = np.zeros((count, 3), np.float32)
    everywhere[chosen] = colours
    return everywhere
