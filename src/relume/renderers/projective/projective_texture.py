"""`ProjectiveTexture`: a place as photographs of it show it, from where none was taken (Debevec et al. 1996, §4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.projective.baking import BakedPlace, bake, filled
from relume.renderers.projective.blending import VIEWS, blended
from relume.renderers.projective.photographs import ProjectedPhotograph, Projector, projectors
from relume.renderers.raytrace.raycast import Hits, RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress, Render
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh

HOLE_TEXELS = 128
"""Texels along a side of the coarse textures that fill holes: the same for every camera, so that nothing flickers."""
AT_ONCE = 500_000
"""Points that are looked at at a time: each takes some hundred bytes a photograph."""


@dataclass(frozen=True, eq=False)
class ProjectiveTexture(Renderer):
    """A scene's real surfaces as photographs of them show them, by projective, view-dependent texture mapping.

    photographs : of the place, with the cameras that took them
    views : photographs that a point is blended of at most; 3 are enough to pass from one to the next without a leap
    samples : along each side of a pixel. 1, in its middle, gives a photograph's own camera that very photograph; 2
        smooths outlines as seen from elsewhere

    Source: Debevec, Taylor & Malik 1996 (view-dependent texture mapping); Debevec, Yu & Borshukov 1998.
    """

    photographs: tuple[ProjectedPhotograph, ...]
    views: int = VIEWS
    samples: int = 1

    def __post_init__(self) -> None:
        if self.views < 1 or self.samples < 1:
            raise ValueError(f"views {self.views}, samples {self.samples}; expected 1 or more of each")

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """The scene's real surfaces, meshes, as the camera sees them, as by `Renderer.render`; then the scene's light.

        The render's `matte` is the share of each pixel that photographs show. The rest of the surfaces is a hole,
        filled from the nearest places that are shown. Albedo is 0: what is seen is light.
        Raises UnsupportedScene for objects, for other surfaces than meshes, and for a lens with an aperture.
        """
        meshes = _place(scene, camera)
        ready = _prepared(meshes, self.photographs)
        height, width = camera.height, camera.width
        planes = {name: np.zeros((height * width, 3)) for name in ("radiance", "normal")}
        sums = {name: np.zeros(height * width) for name in ("matte", "depth", "hit")}
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        for step in range(self.samples**2):
            shift = (np.array(divmod(step, self.samples)) + 0.5) / self.samples
            rays = camera.rays_through(np.stack([x + shift[1], y + shift[0]], axis=-1)).reshape(-1, 3)
            for begin in range(0, len(rays), AT_ONCE):
                part = slice(begin, begin + AT_ONCE)
                radiance, seen, normal, depth = ready.look(scene, camera, rays[part], self.views)
                planes["radiance"][part] += radiance
                planes["normal"][part] += normal
                sums["matte"][part] += seen
                sums["depth"][part] += depth
                sums["hit"][part] += depth > 0
                if progress:
                    progress((step + (begin + len(rays[part])) / len(rays)) / self.samples**2)
        count = self.samples**2
        picture = {name: (plane / count).reshape(height, width, 3).astype(np.float32) for name, plane in planes.items()}
        depth = sums["depth"] / np.maximum(sums["hit"], 1)
        matte, depth = ((each).reshape(height, width).astype(np.float32) for each in (sums["matte"] / count, depth))
        empty = np.zeros((height, width, 3), np.float32)
        return Render(picture["radiance"], empty, matte, depth, picture["normal"], empty, samples=count)


def _place(scene: Scene, camera: Camera) -> tuple[Mesh, ...]:
    """The meshes of a place that photographs are projected onto; raises UnsupportedScene."""
    if scene.objects:
        raise UnsupportedScene(
            "photographs show the place and not what was never in it; bake the place (rl.renderers.bake) and render "
            "the objects among its meshes by rl.Mitsuba"
        )
    if camera.aperture > 0:
        raise UnsupportedScene("projected photographs show what a pinhole sees; use an aperture of 0")
    meshes = tuple(shape for shape in scene.local if isinstance(shape, Mesh))
    if not meshes or len(meshes) < len(scene.local):
        raise UnsupportedScene("photographs are projected onto meshes; give the place's as the scene's real surfaces")
    return meshes


@dataclass(frozen=True, eq=False)
class _Ready:
    """Meshes and photographs made ready for any camera, and what fills their holes."""

    caster: RayCaster
    surfaces: Surfaces
    among: tuple[Projector, ...]
    coarse: BakedPlace

    def look(
        self, scene: Scene, camera: Camera, rays: np.ndarray, views: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Radiance, whether a photograph shows it, normal and depth (0 for nothing) along rays (N, 3)."""
        hits = self.caster.nearest(camera.position, rays)
        met = np.flatnonzero(hits.shape >= 0)
        radiance, seen = np.zeros((len(rays), 3)), np.zeros(len(rays), bool)
        normal, depth = np.zeros((len(rays), 3)), np.zeros(len(rays))
        if len(met) < len(rays):
            beyond = np.flatnonzero(hits.shape < 0)
            radiance[beyond] = scene.light.lookup(rays[beyond])
        if met.size:
            surface = self.surfaces.at(camera.position, rays[met], Hits(*(part[met] for part in hits)))
            blend = blended(self.among, surface.point, surface.geometric_normal, camera, views)
            radiance[met], seen[met] = blend.radiance, blend.seen
            normal[met], depth[met] = surface.geometric_normal, hits.distance[met]
            holes = met[~blend.seen]
            radiance[holes] = self._fill(surface.point[~blend.seen], hits.shape[holes])
        return radiance, seen, normal, depth

    def _fill(self, points: np.ndarray, shape: np.ndarray) -> np.ndarray:
        """What is about points (N, 3) of meshes (N,) that no photograph shows."""
        found = np.zeros((len(points), 3))
        for index in np.unique(shape):
            here = shape == index
            found[here] = filled(points[here], *self.coarse.known(int(index)))
        return found


@lru_cache(maxsize=1)
def _prepared(meshes: tuple[Mesh, ...], photographs: tuple[ProjectedPhotograph, ...]) -> _Ready:
    """Kept for the next frame of the same place."""
    caster = RayCaster.of(meshes)
    among = projectors(photographs, caster)
    coarse = bake(meshes, photographs, largest=HOLE_TEXELS)
    return _Ready(caster, Surfaces.of(meshes), among, coarse)
