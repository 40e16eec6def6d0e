"""Motion: many pictures of one prepared scene, the camera going round it or the objects turning (§3, line 4)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from relume.render.mapped import Prepared
from relume.render.renderer import Render
from relume.scene.camera import Camera
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
        moved = replace(camera, position=centre + turn @ (camera.position - centre), rotation=turn @ camera.rotation)
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


def frames(prepared: Prepared, camera: Camera, motion: Orbit | Turntable, count: int) -> Iterator[Render]:
    """Pictures of a motion, one after the other; tables and tree are those of `prepared`, made once.

    Raises ValueError for less than one frame.
    """
    if count < 1:
        raise ValueError(f"{count} frames; expected 1 or more")
    for index in range(count):
        moved, turn = motion.at(camera, index / count)
        yield prepared.render(moved, turn=turn, about=motion.centre)
