"""The renderer `Radiosity`: diffuse light exchanged between patches, then looked at from anywhere.

Goral et al. 1984 ("Modeling the interaction of light between diffuse surfaces"), Cohen et al. 1986 (patches and
elements) and 1988 (progressive refinement, the ambient term). The picture interpolates between the elements'
vertices, shows the patches as they are, or gathers once more at every pixel.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from relume.cluster.attempt import threads as worker_threads
from relume.errors import UnsupportedScene
from relume.renderers.diffuse.checks import require_pinhole, require_seed, require_whole
from relume.renderers.diffuse.direct_light import DirectLight
from relume.renderers.diffuse.pixels import PixelSamples, gathered, picture
from relume.renderers.diffuse.scenes import DiffuseScene, Seen
from relume.renderers.radiosity.elements import Elements
from relume.renderers.radiosity.solution import Shooting, Shots, ambient
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress, Render
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane

PATCHES_ACROSS, ELEMENTS_ACROSS = 4, 8
"""Into how many parts the longest side of a scene is divided, unless lengths are given."""
LINE = 0.04
"""Half the width of an outline, in a patch's height over that side."""


@dataclass(frozen=True)
class Radiosity(Renderer):
    """Radiosity by progressive refinement, for scenes of diffuse surfaces (Cohen et al. 1988).

    patch, element : the longest side of the triangles that shoot and of those that receive, metres; a quarter and an
        eighth of the scene's longest side unless given
    refinements : how often elements are halved where they differ from their neighbours, and all is solved anew
    contrast : the share of the mean irradiance by which an edge's ends may differ before it is halved
    rays : for all the light that lamps send out; noise falls with their root
    unshot : the share of light at which the shooting ends
    ambient : add what unshot light will have brought
    samples : rays a pixel, rounded up to a square
    gather : rays of a final gathering at each of them, where lamps then throw sharp shadows; 0 interpolates
        between the elements' vertices
    flat : show each element in one colour
    outlines : draw the elements' sides, as radiosity is taught
    threads : all cores unless given; the pixels do not depend on it
    """

    patch: float | None = None
    element: float | None = None
    refinements: int = 2
    contrast: float = 0.5
    rays: int = 400_000
    unshot: float = 1e-3
    ambient: bool = True
    samples: int = 4
    gather: int = 0
    flat: bool = False
    outlines: bool = False
    threads: int | None = None

    def __post_init__(self) -> None:
        require_whole(self, refinements=0, rays=1, samples=1, gather=0, threads=1)
        for name in ("patch", "element", "contrast", "unshot"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise ValueError(f"{name} is {value}; expected a number above 0")
        if self.gather and (self.flat or self.outlines):
            raise ValueError("a final gathering shows no elements; leave out gather, or flat and outlines")

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """Solve the scene and look at it, as `Renderer.render`; `seed` is that of the rays."""
        report = progress or (lambda share: None)
        solved = self.prepared(scene, seed=seed)
        solved.solution  # noqa: B018 - solved here, so that the progress is true
        report(0.5)
        return solved.render(camera, progress=lambda share: report(0.5 + share / 2))

    def prepared(self, scene: Scene, *, seed: int = 0) -> PreparedRadiosity:
        """A scene to be solved once and looked at from many places.

        seed : of the rays
        Raises UnsupportedScene for what is not diffuse, and for a plane without a size, which has no patches.
        """
        require_seed(seed)
        if any(isinstance(shape, Plane) and shape.size is None for shape in scene.local):
            raise UnsupportedScene(
                "Radiosity divides surfaces into patches, and the ground plane has no end; give it a size, or use "
                "rl.renderers.IrradianceCache"
            )
        return PreparedRadiosity(self, DiffuseScene.of(scene, "Radiosity", self.threads or worker_threads()), seed)


@dataclass(frozen=True, eq=False)
class Step:
    """What patches have shot until now.

    shots : how many; left : the share of all light that is unshot
    """

    shots: int
    left: float
    _look: Callable[[], np.ndarray]

    @cached_property
    def radiance(self) -> np.ndarray:
        """What the camera sees of it: (H, W, 3) float32, rendered when it is first asked for."""
        return self._look()


@dataclass(frozen=True, eq=False)
class PreparedRadiosity:
    """A scene divided and, once it is asked for, solved."""

    method: Radiosity
    scene: DiffuseScene
    seed: int

    @cached_property
    def coarse(self) -> Elements:
        """The elements before any are refined."""
        patch = self.method.patch or self.scene.size / PATCHES_ACROSS
        return Elements.of(self.scene, patch, self.method.element or min(patch, self.scene.size / ELEMENTS_ACROSS))

    @cached_property
    def solution(self) -> tuple[Elements, Shots]:
        """The elements in the end, and what they hold."""
        elements = self.coarse
        for rounds in range(self.method.refinements + 1):
            state = deque(self._shooting(elements, rounds).shots(), maxlen=1).pop()
            if rounds < self.method.refinements:
                elements = elements.refined(self._uneven(elements, state))
        return elements, state

    def steps(self, camera: Camera, *, every: int = 1) -> Iterator[Step]:
        """The coarse elements while they are solved: before the first shot, and after each `every` shots.

        Raises ValueError for less than one shot.
        """
        if every < 1:
            raise ValueError(f"every is {every}; expected at least one shot between two pictures")
        for state in self._shooting(self.coarse, 0).shots():
            if state.count % every == 0 or state.left <= self.method.unshot:
                look = partial(self._picture, camera, self.coarse, state, None)
                yield Step(state.count, state.left, lambda look=look: look().radiance)

    def render(self, camera: Camera, *, progress: Progress | None = None) -> Render:
        """The solved scene as a camera sees it."""
        return self._picture(camera, *self.solution, progress)

    def _shooting(self, elements: Elements, rounds: int) -> Shooting:
        method = self.method
        return Shooting(self.scene, elements, method.rays, method.unshot, self.seed + (rounds << 32))

    def _uneven(self, elements: Elements, state: Shots) -> np.ndarray:
        """The edges (T, 3) whose ends differ too much, unless they are short already."""
        fronts = elements.at_vertices(state.irradiance).mean(axis=-1)
        lit = fronts[fronts > 0]
        mean = float(lit.mean()) if lit.size else 1.0
        differ = np.abs(np.roll(fronts, -1, axis=1) - fronts) > self.method.contrast * mean
        front, back = np.split(differ, 2)
        return front | back

    def _picture(self, camera: Camera, elements: Elements, state: Shots, progress: Progress | None) -> Render:
        require_pinhole(camera, "Radiosity")
        method = self.method
        divided = replace(self.scene, shapes=elements.meshes)
        shown = Shown(divided, elements, state.irradiance + ambient(elements, state) * method.ambient, method)
        side = int(np.ceil(np.sqrt(method.samples)))
        return picture(divided, PixelSamples(camera, side, self.seed), shown.shade, progress)


@dataclass(frozen=True, eq=False)
class Shown:
    """What is seen of elements' sides that hold `irradiance` (2T, 3)."""

    scene: DiffuseScene
    elements: Elements
    irradiance: np.ndarray
    method: Radiosity

    def shade(self, seen: Seen, random: np.random.Generator) -> np.ndarray:
        """The radiance (N, 3) that surfaces reflect towards the eye."""
        if self.method.gather:
            arriving = DirectLight(self.scene).irradiance(seen, max(self.method.gather // 4, 4), random)
            arriving += gathered(self.scene, seen, self.method.gather, random, self._between_vertices)
            return seen.reflectance / np.pi * arriving
        arriving = self.irradiance[self._sides(seen)] if self.method.flat else self._between_vertices(seen)
        shown = seen.reflectance / np.pi * arriving
        line = self.method.outlines & (_weights(seen).min(axis=-1) < LINE)
        return np.where(line[:, None], -seen.emission, shown)

    def _sides(self, seen: Seen) -> np.ndarray:
        triangle = self.elements.first[seen.shape] + seen.primitive
        return np.where(seen.front, triangle, triangle + len(self.elements.area))

    @cached_property
    def _vertices(self) -> np.ndarray:
        return self.elements.at_vertices(self.irradiance)

    def _between_vertices(self, seen: Seen) -> np.ndarray:
        """Irradiance (N, 3) interpolated linearly (Gouraud)."""
        return np.einsum("nk,nkc->nc", _weights(seen), self._vertices[self._sides(seen)])


def _weights(seen: Seen) -> np.ndarray:
    """How much each corner of a triangle counts at a place in it, (N, 3)."""
    second, third = seen.barycentric.T
    return np.stack([1 - second - third, second, third], axis=-1)
