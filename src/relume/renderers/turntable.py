"""Motion: many pictures of one scene, the camera going round it or objects turning (Miller & Hoffman 1984, §3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.renderers.prefiltered.prefiltered import Prepared
from relume.renderers.results import Progress, Render
from relume.renderers.whitted.whitted import PreparedWhitted, Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.motion.moving_objects import turned_scene
from relume.scene.scene import Scene
from relume.sphere.directions import UP, rotation_about


@dataclass(frozen=True)
class Orbit:
    """The camera goes round a vertical axis, counter-clockwise seen from above; the light and the objects stay.

    centre : a point of the axis, metres
    angle : all the way, radians; the last frame of a full turn stops one short of the first, so that it loops
    """

    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angle: float = 2 * np.pi

    def at(self, camera: Camera, share: float) -> tuple[Camera, np.ndarray]:
        """The camera and the shapes' turn after this share of the way."""
        turn = rotation_about(UP, self.angle * share)
        centre = np.asarray(self.centre)
        rolling = None if camera.rolling is None else camera.rolling.carried(turn)
        moved = replace(
            camera,
            position=centre + turn @ (camera.position - centre),
            rotation=turn @ camera.rotation,
            rolling=rolling,
        )
        return moved, np.eye(3)


@dataclass(frozen=True)
class Turntable:
    """All shapes turn about a vertical axis, counter-clockwise seen from above; the light and the camera stay.

    centre : a point of the axis, metres
    angle : all the way, radians
    """

    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angle: float = 2 * np.pi

    def at(self, camera: Camera, share: float) -> tuple[Camera, np.ndarray]:
        """The camera and the shapes' turn after this share of the way."""
        return camera, rotation_about(UP, self.angle * share)


def frames(
    prepared: Prepared, camera: Camera, motion: Orbit | Turntable, count: int, only: Sequence[int] | None = None
) -> Iterator[Render]:
    """Pictures of a motion, one after the other; tables and tree are those of `prepared`, made once.

    only : these frames, from 0; all unless given
    Raises ValueError for less than one frame.
    """
    _check(count)
    for index in range(count) if only is None else only:
        moved, turn = motion.at(camera, index / count)
        yield prepared.render(moved, turn=turn, about=motion.centre)


def traced_frames(
    renderer: Whitted,
    scene_at: Callable[[float], Scene],
    camera: Camera,
    motion: Orbit | Turntable | None,
    count: int,
    *,
    seed: int = 0,
    region: tuple[int, int, int, int] | None = None,
    progress: Progress | None = None,
    only: Sequence[int] | None = None,
) -> Iterator[Render]:
    """Pictures of a scene that changes, by Whitted's tree; tables are made anew only where the scene is another.

    scene_at : the scene after a share of the way, 0 to 1; the very same one where nothing has moved
    motion : on top of that; on a turntable stand the objects, the real surfaces stay
    region : left, top, right and bottom, pixels
    only : these frames, from 0; all unless given
    Raises ValueError for less than one frame.
    """
    _check(count)
    prepared: PreparedWhitted | None = None
    for index in range(count) if only is None else only:
        scene, seen_from = scene_at(index / count), camera
        if motion is not None:
            seen_from, turn = motion.at(camera, index / count)
            scene = turned_scene(scene, turn, motion.centre)
        if prepared is None or prepared.scene is not scene:
            prepared = renderer.prepared(scene)

        def within(share: float, done: int = index) -> None:
            if progress:
                progress((done + share) / count)

        yield prepared.render(seen_from, seed=seed, region=region, progress=within)


def _check(count: int) -> None:
    if count < 1:
        raise ValueError(f"{count} frames; expected 1 or more")
