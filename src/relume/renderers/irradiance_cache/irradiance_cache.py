"""The renderer `IrradianceCache`: indirect light is worked out at few places and interpolated between them.

Ward, Rubinstein & Clear 1988 ("A ray tracing solution for diffuse interreflection"): it varies slowly where surfaces
are far apart, so that it is kept and used again. Ward & Heckbert 1992: its gradients, from the same rays. Light that
comes straight from lamps and from the environment map varies fast, and is sampled at every pixel.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from relume.cluster.attempt import threads as worker_threads
from relume.renderers.diffuse.checks import require_pinhole, require_seed, require_whole
from relume.renderers.diffuse.direct_light import DirectLight
from relume.renderers.diffuse.pixels import PixelSamples, gathered, picture
from relume.renderers.diffuse.scenes import DiffuseScene, Seen
from relume.renderers.irradiance_cache.records import Cache, Filling
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress, Render
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene

RING, DOT = 0.06, 0.12
"""Of a drawn record: the width of its circle and the radius of its middle, over the radius of its disc."""


@dataclass(frozen=True)
class IrradianceCache(Renderer):
    """An irradiance cache, for scenes of diffuse surfaces (Ward, Rubinstein & Clear 1988).

    error : a, which decides how far a record may be used: up to a times the harmonic mean of the distances that it
        sees. Smaller is finer and slower
    rays : from each record; their noise falls with the root of their number
    nearest, farthest : shares of the scene's longest side between which that mean is kept
    bounces : reflections by surfaces on the way from direct light to what is seen; 0 shows direct light alone
    shadow_rays : from each sample of a pixel to lamps, and as many to the map
    samples : rays a pixel, rounded up to a square
    gather : rays of a final gathering at each of them, which reads the cache where they end; 0 reads it where one looks
    records : draw where the records that are seen lie: their middles, and the circles within which they are used
    threads : all cores unless given; the pixels do not depend on it
    """

    error: float = 0.25
    rays: int = 512
    nearest: float = 0.03
    farthest: float = 0.5
    bounces: int = 16
    shadow_rays: int = 4
    samples: int = 4
    gather: int = 0
    records: bool = False
    threads: int | None = None

    def __post_init__(self) -> None:
        require_whole(self, rays=8, bounces=0, shadow_rays=1, samples=1, gather=0, threads=1)
        if not 0 < self.error <= 1:
            raise ValueError(f"error is {self.error}; expected a number above 0, and 1 at most")
        if not 0 < self.nearest <= self.farthest < np.inf:
            raise ValueError(
                f"nearest {self.nearest} and farthest {self.farthest}; expected shares above 0, the first no larger"
            )

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """Fill a cache for what the camera sees, and show it, as `Renderer.render`; `seed` is that of all rays."""
        report = progress or (lambda share: None)
        prepared = self.prepared(scene, camera, seed=seed)
        prepared.cache  # noqa: B018 - filled here, so that the progress is true
        report(0.5)
        return prepared.render(progress=lambda share: report(0.5 + share / 2))

    def prepared(self, scene: Scene, camera: Camera, *, seed: int = 0) -> PreparedCache:
        """A scene and what sees it, for which records are made when they are first needed.

        camera : for whose picture records will be made
        seed : of all rays
        Raises UnsupportedScene for what is not diffuse, and for a lens with an aperture.
        """
        require_seed(seed)
        require_pinhole(camera, "the irradiance cache")
        ready = DiffuseScene.of(scene, "the irradiance cache", self.threads or worker_threads())
        return PreparedCache(self, ready, PixelSamples(camera, int(np.ceil(np.sqrt(self.samples))), seed))


@dataclass(frozen=True, eq=False)
class PreparedCache:
    """A scene, the samples of a camera's pixels, and the cache for what they see."""

    method: IrradianceCache
    scene: DiffuseScene
    pixels: PixelSamples

    @cached_property
    def cache(self) -> Cache:
        """The records, filled."""
        method, size = self.method, self.scene.size
        filling = Filling(
            self.scene, method.error, method.rays, method.nearest * size, method.farthest * size,
            max(method.bounces, 1), self.pixels.seed,
        )  # fmt: skip
        return filling.cache(self._looked_at())

    def _looked_at(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Places and normals that the pixels' samples see: few of them first, all over the picture."""
        camera = self.pixels.camera
        y, x = np.divmod(np.arange(camera.width * camera.height), camera.width)
        # The largest power of two, to 16, that divides both: pixels on a coarse grid come before those between.
        fineness = np.minimum(np.gcd(x | 16, 16), np.gcd(y | 16, 16))
        order = np.argsort(-fineness, kind="stable")
        for cell in range(self.pixels.side**2):
            seen = self.scene.look(*self.pixels.rays(cell), leaving=False)
            there = order[seen.hit[order]]
            yield seen.point[there], seen.normal[there]

    def render(self, *, progress: Progress | None = None) -> Render:
        """What the camera sees."""
        return picture(self.scene, self.pixels, self._shade, progress)

    def _shade(self, seen: Seen, random: np.random.Generator) -> np.ndarray:
        """The radiance (N, 3) that surfaces reflect towards the eye."""
        arriving = DirectLight(self.scene).irradiance(seen, self.method.shadow_rays, random)
        if self.method.bounces and self.method.gather:
            ends = partial(self._at_ends, random=random)
            arriving += gathered(self.scene, seen, self.method.gather, random, ends)
        elif self.method.bounces:
            arriving += self.cache.at(seen.point, seen.normal)
        shown = seen.reflectance / np.pi * arriving
        return self._with_circles(seen, shown) if self.method.records else shown

    def _at_ends(self, met: Seen, random: np.random.Generator) -> np.ndarray:
        """Irradiance (N, 3) where the rays of a gathering end: direct light and the cache."""
        arriving = DirectLight(self.scene).irradiance(met, 1, random)
        return arriving if self.method.bounces == 1 else arriving + self.cache.at(met.point, met.normal, looser=True)

    def _with_circles(self, seen: Seen, shown: np.ndarray) -> np.ndarray:
        """The same with the records that the eye's rays made: dots and circles, white on dark and dark on bright."""
        cache = self.cache
        first, record, _ = cache.octree.weights(seen.point, seen.normal, cache.error, self.scene.threads)
        row = np.repeat(np.arange(len(seen.point)), np.diff(first))
        tree = cache.octree.tree
        away = np.linalg.norm(seen.point[row] - tree.place[record], axis=-1) / (tree.reach[record] * cache.error)
        marked = ((away > 1 - RING) | (away < DOT)) & (record < cache.seen)
        where = np.unique(row[marked])
        bright = shown[where].mean(axis=-1, keepdims=True) > 0.2
        # The picture adds the emission.
        shown[where] = np.where(bright, 0.0, 1.0) - seen.emission[where]
        return shown
