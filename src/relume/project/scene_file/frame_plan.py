"""Which frames a scene file is rendered into: those of its sequence, or pictures of a turntable or an orbit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from relume.project.scene_file.scene_file import SceneFile
from relume.project.scene_file.settings import RenderSettings
from relume.project.shot_file.sequence_table import frames_as_text, frames_in
from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Shutter
from relume.scene.scene import Scene

if TYPE_CHECKING:
    from relume.renderers.turntable import Orbit, Turntable

PICTURES = (".exr", ".hdr", ".png", ".jpg", ".jpeg")
PREVIEW = ".preview.png"
"""What the name of a picture under way ends in."""
RATE = 24.0
"""Frames a second of a motion: cinema's."""


@dataclass(frozen=True, eq=False)
class FramePlan:
    """The frames to be made, and what is seen in each.

    numbers : of the frames; of a motion from 1 to `count`
    names : of all frames that its folder may hold; more than `numbers` where a part of a sequence is asked for
    motion : of all objects or the camera; None for a sequence, and where only the file's orbits move
    count : of a motion; None for a sequence
    rate : a second
    shutter : of a sequence; None for frames without blur
    """

    numbers: tuple[int, ...]
    names: tuple[int, ...]
    motion: Orbit | Turntable | None = None
    count: int | None = None
    rate: float = RATE
    shutter: Shutter | None = None

    def moment(self, read: SceneFile, number: float) -> tuple[Scene, Camera]:
        """The scene and the camera of a frame, or between two; the very same ones where nothing moves."""
        from relume.renderers.turntable import Turntable
        from relume.scene.motion.moving_objects import turned_scene

        if self.count is None:
            return read.at_frame(number)
        share = (number - 1) / self.count
        scene, camera = read.at(share), read.camera
        if self.motion is not None:
            camera, turn = self.motion.at(camera, share)
            if isinstance(self.motion, Turntable):
                scene = turned_scene(scene, turn, self.motion.centre)
        return scene, camera


def frame_plan(read: SceneFile, out: Path, settings: RenderSettings) -> FramePlan | None:
    """The frames that the settings and the output's name ask for; None for the one picture of a file without any.

    Raises ValueError for settings, frames and names that do not go together.
    """
    picture = out.suffix.lower() in PICTURES
    if settings.in_sequence(read):
        return _of_sequence(read, out, settings, picture)
    for name in ("motion", "degrees"):
        if getattr(settings, name) is not None and settings.frames is None:
            raise ValueError(f"{name} is about a motion; give --frames N too (frames)")
    if settings.frames is None:
        if out.suffix.lower() == ".mp4":
            raise ValueError(f"{out}: a movie needs --frames N (frames), or a [sequence] in the scene file")
        return None
    if picture:
        raise ValueError(f"{out}: with --frames give a folder for numbered pictures, or an .mp4")
    count = _count(settings.frames)
    if settings.degrees is not None and settings.motion is None and read.moves:
        raise ValueError("degrees say how far a motion goes, and the scene file's orbits say that; give the motion too")
    motion = None if read.moves and settings.motion is None else _motion(read, settings)
    numbers = tuple(range(1, count + 1))
    return FramePlan(numbers, numbers, motion, count)


def require_own_frames(folder: Path, plan: FramePlan, suffix: str) -> None:
    """Raises ValueError where a folder holds frames that are none of the plan's."""
    names = {f"frame_{number:04d}{suffix}" for number in plan.names}
    there = (path.name for path in folder.glob(f"frame_*{suffix}") if not path.name.endswith(PREVIEW))
    if left := sorted(name for name in there if name not in names):
        raise ValueError(f"{folder}: holds frames of another movie, from {left[0]} on; remove them")


def chosen_numbers(every: Sequence[int], frames: int | str | None) -> tuple[int, ...]:
    """The frames of a sequence that are asked for, or all; raises ValueError for one that it has not."""
    if frames is None:
        return tuple(every)
    asked = sorted(set(frames_in(str(frames))))
    if unknown := sorted(set(asked).difference(every)):
        what = f"frame {unknown[0]} is" if len(unknown) == 1 else f"frames {frames_as_text(unknown)} are"
        raise ValueError(f"{what} not in the [sequence], which has {frames_as_text(every)}")
    return tuple(asked)


def _of_sequence(read: SceneFile, out: Path, settings: RenderSettings, picture: bool) -> FramePlan:
    sequence = read.sequence
    assert sequence is not None  # in_sequence
    every = sequence.table.frames
    numbers = chosen_numbers(every, settings.frames)
    if picture and settings.frames is None:
        numbers = numbers[:1]
    if picture and len(numbers) > 1:
        raise ValueError(f"{out}: of {len(numbers)} frames; give a folder for them, an .mp4, or one frame")
    return FramePlan(numbers, every, rate=float(sequence.table.rate), shutter=sequence.shutter)


def _count(frames: int | str) -> int:
    try:
        count = int(frames)
    except ValueError:
        raise ValueError(
            f"--frames {frames}: without a [sequence] in the scene file it is the number of pictures of a motion, as 48"
        ) from None
    if count < 1:
        raise ValueError(f"--frames {count}: expected 1 or more")
    return count


def _motion(read: SceneFile, settings: RenderSettings) -> Orbit | Turntable:
    """The motion about the middle of the scene's objects, a turntable unless given."""
    from relume.renderers import turntable as motions
    from relume.scene.shapes.shapes import bounds

    x, y, z = bounds(read.scene.objects).mean(axis=0)
    angle = math.radians(360.0 if settings.degrees is None else settings.degrees)
    kind = motions.Orbit if settings.motion == "orbit" else motions.Turntable
    return kind((float(x), float(y), float(z)), angle)
