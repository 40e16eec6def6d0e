"""The renderer `Whitted`: the recursive ray tracer of 1980, whole, on kernels of today.

What it shows: shadows, true reflection and refraction, seen again in each other. What it does not, as the paper says:
light that diffuse surfaces send to each other, and light that glass or mirrors gather on them (caustics).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from relume.cluster.attempt import threads as worker_threads
from relume.errors import UnsupportedScene, warn
from relume.image.bands import in_threads
from relume.light.reflection.convolution import as_latlong
from relume.renderers.progressive.pass_workers import PassWorkers
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress, Render
from relume.renderers.whitted.antialiasing import Antialiasing, Small, Traced, Tracer, sampled, write_layers
from relume.renderers.whitted.kernel import CHANNELS, MOST_RAYS, trace
from relume.renderers.whitted.kernel_data import Record, Settings, attenuation_code, empty_record, light_table, view_of
from relume.renderers.whitted.materials import material_tables
from relume.scene.cameras.camera import Camera
from relume.scene.lights import Attenuation, RectangleLight, SphereLight, Unattenuated
from relume.scene.scene import Infinite, Scene
from relume.scene.shapes.shapes import Mesh, Sphere, bounding_sphere
from relume.sphere.bilinear_kernels import padded

BAND = 1 << 14
"""Pixels that a thread works on at once: what it knows of their samples stays in the processor's cache."""
FINEST = 1 / 64
"""Patches are subdivided to this share of a pixel."""
SMALL = 1.0
"""Pixels: a sphere of a smaller radius may slip between the corners, which are √2 apart."""
DARK = 0.1
"""Differences below this share of the picture's typical radiance are seen less and less."""
Keeper = Callable[[int, np.ndarray, np.ndarray], None]
"""Keeps a band: its first row, means (H, W, CHANNELS) and rays (H, W)."""


@dataclass(frozen=True)
class Whitted(Renderer):
    """Recursive ray tracing with Whitted's shading at every node (Whitted 1980, eq. 2).

    depth : nodes from a tree's root to its farthest leaf, at most; 8 lets light through two glasses, one behind the
        other, with what they reflect of each other
    contribution : branches that carry less than this share of the pixel are cut off; the step of an 8-bit picture is
        four times as much
    attenuation : between a tree's nodes; none unless given, for radiance does not fall along a ray. The paper's is
        `Linear`
    antialiasing : None for one ray through the middle of each pixel
    constellation : distant lights that stand for the environment map where surfaces are diffuse; 0 lets it be seen
        in mirrors and behind all things, but light nothing
    rays : perturbed rays at a glossy or frosted surface that is seen directly; one at others
    clear_shadows : light goes straight through transparent shapes, dimmed by k_t; False gives them full shadows
    background : show the light behind the objects, where nothing is; it is seen in and through them all the same
    threads : all cores unless given; the pixels do not depend on it
    """

    depth: int = 8
    contribution: float = 1 / 1024
    attenuation: Attenuation = Unattenuated()
    antialiasing: Antialiasing | None = Antialiasing()
    constellation: int = 64
    rays: int = 16
    clear_shadows: bool = True
    background: bool = True
    threads: int | None = None

    def __post_init__(self) -> None:
        for name, least, most in (("depth", 1, 1000), ("constellation", 0, 65536), ("rays", 1, 65536)):
            value = getattr(self, name)
            if not isinstance(value, int) or not least <= value <= most:
                raise ValueError(f"{name} is {value}; expected a whole number from {least} to {most}")
        if not 0 <= self.contribution < 1:
            raise ValueError(f"contribution is {self.contribution}; expected a share of the pixel from 0 to 1")
        if self.threads is not None and self.threads < 1:
            raise ValueError(f"threads is {self.threads}; expected at least 1, or none for all cores")

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """Render one picture, as `Renderer.render`; `seed` turns the perturbations of glossy and frosted surfaces."""
        return self.prepared(scene).render(camera, seed=seed, progress=progress)

    def prepared(self, scene: Scene) -> PreparedWhitted:
        """Everything that does not depend on the camera, for many pictures of one scene.

        Raises UnsupportedScene for a distant scene that is not at infinity, for lamps that have a size, and
        for a medium between the shapes.
        """
        if not isinstance(scene.distant, Infinite):
            raise UnsupportedScene(
                "Whitted's method sees its light map at infinity, and this scene's is on walls; use rl.Mitsuba "
                "(--renderer mitsuba), or an Infinite distant scene"
            )
        if any(isinstance(light, SphereLight) for light in scene.lights):
            raise UnsupportedScene(
                "Whitted's lights have no size, and one of the scene's is a sphere; use rl.Mitsuba "
                "(--renderer mitsuba), or a PointLight of intensity π·radius² times its radiance"
            )
        if any(isinstance(light, RectangleLight) for light in scene.lights):
            raise UnsupportedScene(
                "Whitted's lights have no size, and one of the scene's is a rectangle; use rl.Mitsuba "
                "(--renderer mitsuba), or PointLights"
            )
        if scene.medium is not None:
            raise UnsupportedScene(
                "Whitted's rays meet nothing between shapes, and a medium fills this scene; use rl.Mitsuba "
                "(--renderer mitsuba), or leave the medium out"
            )
        return PreparedWhitted(self, scene)


@dataclass(frozen=True, eq=False)
class PreparedWhitted:
    """A scene as kernels read it; its parts are made when they are first needed."""

    method: Whitted
    scene: Scene

    @cached_property
    def caster(self) -> RayCaster:
        """The one tree over all objects."""
        shapes = (*self.scene.local, *self.scene.objects)
        caster = RayCaster.of(shapes)
        triangles = np.flatnonzero(caster.geometry.form < 0)
        kept = np.bincount(caster.geometry.shape[triangles], minlength=len(shapes))
        for solid, count in zip(self.scene.objects, kept[len(self.scene.local) :], strict=True):
            if isinstance(solid, Mesh) and (flat := len(solid.faces) - count):
                warn(
                    f"{flat} of the {len(solid.faces)} triangles of {solid.name!r} have no area and are left out; "
                    "mend the mesh if it should have them"
                )
        return caster

    @cached_property
    def tables(self) -> tuple:
        """What `trace` takes between the view and the settings."""
        shapes = (*self.scene.local, *self.scene.objects)
        materials = [shape.material for shape in shapes]
        different = list({id(material): material for material in materials}.values())
        which = np.array([[m is d for d in different].index(True) for m in materials], np.int64)
        coefficients, pictures, bumps = material_tables(different)
        lights = light_table(self.scene, self.method.constellation)
        if not len(lights.place) and not np.any(lights.ambient) and not np.any(self.scene.light.radiance):
            raise UnsupportedScene("nothing shines in this scene: it has no lights and its light map is black; add one")
        sky = as_latlong(self.scene.light).radiance if np.any(self.scene.light.radiance) else np.zeros((0, 0, 3))
        entries = padded(sky).reshape(-1) if sky.size else np.zeros(0, np.float32)
        surfaces = (*Surfaces.of(shapes), self.caster.primitive, which)
        return (
            self.caster.geometry, surfaces, coefficients, pictures, bumps, lights, (entries, len(sky))
        )  # fmt: skip

    def render(
        self,
        camera: Camera,
        *,
        seed: int = 0,
        progress: Progress | None = None,
        region: tuple[int, int, int, int] | None = None,
        workers: PassWorkers | None = None,
    ) -> Render:
        """One picture, or only the part of it from `region`'s left and top to its right and bottom, in pixels.

        workers : who traces bands of its rows; None traces them here
        """
        if not isinstance(seed, int) or not 0 <= seed < 2**63:
            raise ValueError(f"seed is {seed}; expected a whole number from 0, below 2⁶³")
        left, top, right, bottom = region or (0, 0, camera.width, camera.height)
        if not (0 <= left < right <= camera.width and 0 <= top < bottom <= camera.height):
            raise ValueError(
                f"region {left},{top},{right},{bottom} of a picture of {camera.width}×{camera.height} pixels; "
                "expected left < right and top < bottom within it"
            )
        # The view, and what decides where pixels are halved: typical radiance, and small objects.
        self._look_from(camera, seed)
        reference, small = self._typical(camera, seed), self._small(camera)
        view = View(camera, (left, top, right, bottom), seed, small, reference)
        radiance, normal, albedo = (np.empty((bottom - top, right - left, 3), np.float32) for _ in range(3))
        matte, depth = (np.empty((bottom - top, right - left), np.float32) for _ in range(2))
        rays = np.empty(matte.shape, np.int32)

        def keep(begin: int, means: np.ndarray, taken: np.ndarray) -> None:
            write_layers(means, begin, radiance, matte, depth, normal, albedo)
            rays[begin : begin + len(taken)] = taken

        if workers is None:
            longest = self._in_bands(view, 0, bottom - top, keep, progress)
        else:
            shared = SharedByRows(self.method, self.scene, view)
            longest = _rows_by_workers(workers, shared, keep, progress)
        if longest >= MOST_RAYS:
            warn(f"a tree grew to {longest} rays and was cut; lower the depth or raise the contribution")
        # Pages of zeros cost nothing before they are read. Perturbed normals leave noise, and nobody has measured it.
        rough = np.any(self.tables[2].roughness)
        variance = np.full(radiance.shape, np.nan, np.float32) if rough else np.zeros(radiance.shape, np.float32)
        count = max(round(float(rays.mean())), 1)
        return Render(radiance, variance, matte, depth, normal, albedo, samples=count, rays=rays)

    def rows(self, view: View, first: int, last: int) -> tuple[np.ndarray, np.ndarray, int]:
        """Rows of what is looked at: means (H, W, C) and rays (H, W) of their pixels, and the rays of the longest tree.

        `first` and `last` count from the top of the region; the same for a row, whichever are asked for with it.
        """
        left, _, right, _ = view.region
        means = np.empty((last - first, right - left, CHANNELS), np.float32)
        rays = np.empty(means.shape[:2], np.int32)

        def keep(begin: int, part: np.ndarray, taken: np.ndarray) -> None:
            means[begin : begin + len(part)], rays[begin : begin + len(part)] = part, taken

        return means, rays, self._in_bands(view, first, last, keep, None)

    def _in_bands(self, view: View, first: int, last: int, keep: Keeper, progress: Progress | None) -> int:
        """Rows, by bands in threads, each given to `keep` as it is done; the rays of the longest tree."""
        left, top, right, _ = view.region
        done: list[int] = []
        longest: list[int] = []
        follow = self.tracer(view.camera, view.seed)

        def work(begin: int, end: int) -> None:
            def noting(points: np.ndarray) -> Traced:
                results = follow(points)
                longest.append(int(results[2].max(initial=0)))
                return results

            rows = (left, top + first + begin, right, top + first + end)
            keep(begin, *self._band(noting, rows, view.small, view.reference))
            done.append(end - begin)
            if progress:
                progress(sum(done) / (last - first))

        in_threads(work, last - first, self._threads, chunk=view.rows_of_a_band)
        return max(longest)

    @property
    def _threads(self) -> int | None:
        return self.method.threads or worker_threads()

    def _band(
        self, trace: Tracer, region: tuple[int, int, int, int], small: Small, reference: float
    ) -> tuple[np.ndarray, np.ndarray]:
        if self.method.antialiasing is not None:
            return sampled(trace, region, self.method.antialiasing, small, reference)
        left, top, right, bottom = region
        x, y = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5)
        values, _, counts = trace(np.column_stack([x.ravel(), y.ravel()]))
        return values.reshape(*x.shape, CHANNELS), counts.reshape(x.shape)

    def traced(self, camera: Camera, points: np.ndarray, seed: int = 0) -> Traced:
        """The trees of samples at pixel coordinates (N, 2), on this thread."""
        return self.tracer(camera, seed)(points)

    def tracer(self, camera: Camera, seed: int, record: Record | None = None) -> Tracer:
        """`traced`, for many calls; threads may share it where no nodes are recorded."""
        view, settings, nodes = view_of(camera), self.settings(camera, seed), record or empty_record()

        def follow(points: np.ndarray) -> Traced:
            count = len(points)
            results = np.empty((count, CHANNELS), np.float32), np.empty(count, np.int64), np.empty(count, np.int32)
            trace(points, view, *self.tables, settings, 0, count, results, nodes)
            return results

        return follow

    def recorded(self, camera: Camera, points: np.ndarray, seed: int, room: int) -> Record:
        """The first `room` nodes of the trees of samples at pixel coordinates (N, 2), one behind the other."""
        record = empty_record(room)
        self.tracer(camera, seed, record)(points)
        return record

    def settings(self, camera: Camera, seed: int) -> Settings:
        """The method's numbers as the kernel takes them."""
        m = self.method
        law, reach = attenuation_code(m.attenuation)
        coefficients = self.tables[2]
        clear = m.clear_shadows and bool(np.any(coefficients.transmission))
        # Of the types that the kernel is kept for: given a whole number it would be compiled anew, 20 s.
        return Settings(
            m.depth, float(m.contribution), law, float(reach), m.rays, clear, m.background, len(self.scene.local),
            FINEST / camera.focal_length, seed,
        )  # fmt: skip

    def _typical(self, camera: Camera, seed: int) -> float:
        """A share of the whole picture's typical radiance, so that a region is the same as when all is rendered."""
        if self.method.antialiasing is None:
            return 0.0
        x, y = np.meshgrid((np.arange(32) + 0.5) / 32 * camera.width, (np.arange(24) + 0.5) / 24 * camera.height)
        brightest = self.traced(camera, np.column_stack([x.ravel(), y.ravel()]), seed)[0][:, :3].max(axis=1)
        lit = brightest[brightest > 0]
        return DARK * float(np.median(lit)) if lit.size else 0.0

    def _small(self, camera: Camera) -> Small:
        """The objects whose bounding spheres are smaller than the distance of samples (§3)."""
        bounds = [bounding_sphere(solid) for solid in self.scene.objects]
        centres = np.array([centre for centre, _ in bounds]).reshape(-1, 3)
        seen = camera.project(centres)
        distance = np.linalg.norm(centres - camera.position, axis=1)
        radius = np.array([radius for _, radius in bounds]) / np.maximum(distance, 1e-30) * camera.focal_length
        small = (radius < SMALL) & np.all(np.isfinite(seen), axis=1)
        return Small(seen[small], radius[small])

    def _look_from(self, camera: Camera, seed: int) -> None:
        """Warn of an eye inside glass: what it sees is bent by a surface that the picture does not show."""
        shapes = (*self.scene.local, *self.scene.objects)
        coefficients, which = self.tables[2], self.tables[1][10]
        transparent = np.any(coefficients.transmission > 0, axis=1)[which]
        # A hollow in glass is a shape whose inside is the thinner.
        glass = transparent & (coefficients.ior > 1)[which]
        if not np.any(glass):
            return
        balls = [
            (shape.radius, index)
            for index, shape in enumerate(shapes)
            if isinstance(shape, Sphere) and np.linalg.norm(camera.position - np.asarray(shape.centre)) < shape.radius
        ]
        innermost = [index for _, index in sorted(balls) if transparent[index]][:1]
        around = [i for i in innermost if glass[i]] if innermost else self._met_from_within(camera, seed, glass)
        for index in around[:1]:
            warn(
                f"the camera stands inside {getattr(shapes[index], 'name', 'the plane')!r}, which is transparent: the "
                "picture shows what is seen from in there; move the camera out unless that is meant"
            )

    def _met_from_within(self, camera: Camera, seed: int, glass: np.ndarray) -> list[int]:
        """The glass whose inside is met first in most of six directions, none of which is straight up or down."""
        met: list[int] = []
        for axis in np.concatenate([np.eye(3) + 0.1, -np.eye(3) - 0.1]):
            ahead = Camera.looking_at(camera.position, camera.position + axis, width=1, height=1, focal_length=1.0)
            record = self.recorded(ahead, np.array([[0.5, 0.5]]), seed, 1)
            shape = int(record.shape[0])
            met.append(shape if shape >= 0 and record.inside[0] and glass[shape] else -1)
        return [shape for shape in set(met) - {-1} if met.count(shape) >= 4]


@dataclass(frozen=True, eq=False)
class View:
    """What of a scene is looked at.

    region : left, top, right and bottom in pixels
    small : objects that may slip between samples
    reference : the share of typical radiance below which differences count less
    """

    camera: Camera
    region: tuple[int, int, int, int]
    seed: int
    small: Small
    reference: float

    @property
    def rows_of_a_band(self) -> int:
        """How many rows a thread works on at once."""
        return max(BAND // (self.region[2] - self.region[0]), 1)


@dataclass(frozen=True, eq=False)
class SharedByRows:
    """What bands of rows share, for workers; each is a part, by its first row and the one after its last."""

    method: Whitted
    scene: Scene
    view: View

    def ready(self) -> Callable[[tuple[int, int]], dict[str, np.ndarray]]:
        """The function of a band."""
        prepared = self.method.prepared(self.scene)
        _ = prepared.tables

        def trace(rows: tuple[int, int]) -> dict[str, np.ndarray]:
            means, rays, longest = prepared.rows(self.view, *rows)
            return {"means": means, "rays": rays, "longest": np.array(longest)}

        return trace


def _rows_by_workers(workers: PassWorkers, shared: SharedByRows, keep: Keeper, progress: Progress | None) -> int:
    """As `_in_bands` for all rows, from the top, whoever was first."""
    _, top, _, bottom = shared.view.region
    step = shared.view.rows_of_a_band
    rows = [(begin, min(begin + step, bottom - top)) for begin in range(0, bottom - top, step)]

    def counted(done: int, failed: int, to_go: int, left: float | None) -> None:
        if progress:
            progress((done + failed) / len(rows))

    longest = 0
    with workers.sharing(shared) as parts:
        names = [f"rows {top + begin} to {top + end - 1}" for begin, end in rows]
        for (begin, _), file in zip(rows, parts.traced(rows, names, counted), strict=True):
            band = parts.taken(file)
            keep(begin, band["means"], band["rays"])
            longest = max(longest, int(band["longest"]))
    return longest
