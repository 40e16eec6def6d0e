"""The protocol of renderers: scene and camera in, `Render` or `Change` out. `ConstantRenderer` is a fake."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.errors import warn
from relume.renderers.progressive.accumulation import NO_SESSION, RenderSession
from relume.renderers.results import Change, Progress, Render
from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Shutter
from relume.scene.scene import Scene

Moments = Callable[[float], tuple[Scene, Camera]]
"""The scene and the camera at a moment: a share of a frame's time."""


class Renderer(Protocol):
    """A frozen value with its settings as fields; pass it to `render`.

    Derive from this class and write `render`. `change` then subtracts two renders, unless it is written too.
    """

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """Render `scene` seen by `camera`.

        seed : of what is random
        progress : called with the share of the work that is done, 0 to 1
        Raises UnsupportedScene naming what it cannot shade.
        """
        ...

    def change(
        self,
        scene: Scene,
        camera: Camera,
        *,
        seed: int = 0,
        progress: Progress | None = None,
        watch: RenderSession = NO_SESSION,
        plate: np.ndarray | None = None,
        moments: Moments | None = None,
        shutter: Shutter = Shutter(0.0, 0.0),
    ) -> Change:
        """What the scene's objects change of what the camera sees: this default subtracts two renders.

        seed : of what is random
        progress : called with the share of the work that is done, 0 to 1
        watch : what goes on around a long render: a state kept on disk, previews. The default keeps and shows nothing
        plate : (H, W, 3) what is seen without the objects, for a renderer that stops at a share of noise
        moments : the scene and the camera at each moment of the exposure, where something moves; `scene` and `camera`
            are those in its middle. The default warns, and shows the middle
        shutter : which moments

        Raises UnsupportedScene naming what cannot be shaded.
        """
        if moments is not None:
            warn(
                f"{type(self).__name__} does not blur what moves: the frame shows the middle of its exposure; "
                "rl.Differential blurs it"
            )
        return subtracted(self, scene, camera, seed=seed, progress=progress)


def render(
    scene: Scene, camera: Camera, renderer: Renderer, *, seed: int = 0, progress: Progress | None = None
) -> Render:
    """Render a scene; the same seed gives the same pixels, however many threads work.

    scene : light, objects and local surfaces, metres
    camera : whose picture it is
    renderer : how, with its quality: `Mitsuba`, `Prefiltered`, `Whitted` or one of `rl.renderers`
    seed : of what is random
    progress : called with the share of the work that is done, 0 to 1
    Raises UnsupportedScene for what the renderer does not know.
    """
    return renderer.render(scene, camera, seed=seed, progress=progress)


def subtracted(
    renderer: Renderer, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None
) -> Change:
    """The change as the difference of two renders with the same random numbers (Debevec 1998, §6).

    What the objects leave alone cancels to the bit where a renderer's paths are the same in both.
    """
    report = progress or (lambda share: None)
    with_ = renderer.render(scene, camera, seed=seed, progress=lambda share: report(share / 2))
    without = renderer.render(
        scene.without_objects(), camera, seed=seed, progress=lambda share: report(0.5 + share / 2)
    )
    cover = with_.matte[..., None]
    return Change(
        objects=cover * with_.radiance,
        difference=(1 - cover) * (with_.radiance - without.radiance),
        matte=with_.matte,
        depth=with_.depth,
        normal=with_.normal,
        albedo=with_.albedo,
        objects_variance=cover**2 * with_.variance,
        difference_variance=(1 - cover) ** 2 * (with_.variance + without.variance),
        samples=with_.samples,
        passes=with_.passes,
    )


@dataclass(frozen=True)
class ConstantRenderer(Renderer):
    """The public fake: every pixel has the same radiance, and the matte covers the middle ninth when objects are there.

    radiance : per channel
    """

    radiance: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """A flat picture of the camera's size, by `Renderer.render`."""
        shape = (camera.height, camera.width)
        matte = np.zeros(shape, np.float32)
        if scene.objects:
            rows, columns = shape[0] // 3, shape[1] // 3
            matte[rows : shape[0] - rows, columns : shape[1] - columns] = 1
        flat = np.broadcast_to(np.array(self.radiance, np.float32), (*shape, 3)).copy()
        if progress:
            progress(1.0)
        empty = np.zeros((*shape, 3), np.float32)
        return Render(flat, empty, matte, matte, empty, empty)
