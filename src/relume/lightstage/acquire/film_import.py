"""Where the lights of a film stood: the course of a rotating light arm, given or seen in a ball."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from relume.errors import OutputNotWritten
from relume.image.files.video import video_frames
from relume.lightstage.acquire.ball_highlights import MirrorBall
from relume.lightstage.acquire.import_lights import Ball, mirror_ball, pixels_of
from relume.lightstage.acquire.rotating_arm import (
    GridLights,
    RotatingArm,
    SteadyRotation,
    fit_rings,
    fit_rotation,
    frame_paths,
    lamp_directions,
    stage_of_frames,
    unpack_video,
)
from relume.lightstage.acquire.stage_file import Stage
from relume.lightstage.acquire.strobe_arm import StrobeArm


@dataclass(frozen=True)
class FilmCourse:
    """How the lamp of a filmed rotating light arm went, and how many lights of each ring are kept.

    rings : from top to bottom
    columns : lights a ring
    frames : a turn; None where a mirrored ball in the film shows the rate, the start and the rings
    start : the frame, with its fraction, in which the first ring begins
    azimuth : where each ring begins, radians from +Z towards +X
    clockwise : the lamp turns from +Z towards −X
    """

    rings: int
    columns: int
    frames: float | None = None
    start: float = 0.0
    azimuth: float = 0.0
    clockwise: bool = False

    def __post_init__(self) -> None:
        if self.rings < 1 or self.columns < 1 or (self.frames is not None and not 0 < self.frames < np.inf):
            raise ValueError(f"{self.rings} rings of {self.columns} lights, {self.frames} frames a turn; expected ≥ 1")

    def arm(self, pictures: Iterable[np.ndarray], ball: MirrorBall | None) -> RotatingArm:
        """The course of the arm; where `frames` is None it is found from the ball in the film's pictures."""
        band = float(np.pi / self.rings)
        if self.frames is not None:
            rotation = SteadyRotation(1 / self.frames, self.start)
            return RotatingArm(rotation, self.rings, band / 2, band, self.azimuth, self.clockwise)
        if ball is None:
            raise ValueError("the film's frames a turn are not given; give them, or the circle of a ball in the film")
        directions = lamp_directions(pictures, ball)
        rotation = fit_rotation(directions, start_azimuth=self.azimuth, clockwise=self.clockwise)
        # A lamp, or a film, that begins with the first ring passes the start just before it is seen, not a turn later.
        turn = 1 / rotation.revolutions_per_frame
        earlier, column = rotation.start - turn, turn / self.columns
        seen_at_once = np.flatnonzero(np.isfinite(directions).all(axis=1))[0] - earlier <= column
        too_short = rotation.start + self.rings * turn - column > len(directions) - 1
        if seen_at_once or (too_short and earlier >= -column):
            rotation = replace(rotation, start=earlier)
        first, step = fit_rings(directions, rotation)
        # What the ball shows is off by a little: a ring at the pole stays at the pole.
        first = float(np.clip(first, 0, np.pi))
        step = min(step, (np.pi - first) / max(self.rings - 1, 1))
        return RotatingArm(rotation, self.rings, first, step, self.azimuth, self.clockwise)


@contextmanager
def filmed_stage(
    source: Path,
    out: Path,
    course: FilmCourse | StrobeArm,
    ball: Ball | None,
    field_of_view: float | None,
    leave_out: Sequence[Path],
) -> Iterator[tuple[Stage, Path]]:
    """The stage of a filmed arm, of one lamp or of strobes, and where its frames are: a video's beside `out` meanwhile.

    source : a video, or the folder of its frames
    Raises InvalidStage where the film does not go round the stage, UnreadableFile, OutputNotWritten.
    """
    if source.is_dir():
        passed = {path.resolve() for path in leave_out}
        paths = [path for path in frame_paths(source) if path.resolve() not in passed]
        yield stage_of_frames(paths, _grid(course, ball, lambda: map(pixels_of, paths), field_of_view)), source
        return
    grid = _grid(course, ball, lambda: video_frames(source), field_of_view)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        place = tempfile.TemporaryDirectory(prefix=f".{out.name}.frames_", dir=out.parent)
    except OSError as error:
        raise OutputNotWritten(f"{out.parent}: cannot be written: {error.strerror}; choose another place") from None
    with place as folder:
        yield unpack_video(source, Path(folder), grid), Path(folder)


def measure_film(
    video: Path, course: FilmCourse | StrobeArm, ball: Ball | None, field_of_view: float | None
) -> tuple[int, int, tuple[int, int]]:
    """Frames, lights and (rows, columns) of a video, from looking at all its frames and keeping none."""
    grid = _grid(course, ball, lambda: video_frames(video), field_of_view)
    count, shape = 0, (0, 0)
    for frame in video_frames(video):
        count, shape = count + 1, (frame.shape[0], frame.shape[1])
    return count, len(grid(count)[1]), shape


def _grid(
    course: FilmCourse | StrobeArm,
    ball: Ball | None,
    frames: Callable[[], Iterable[np.ndarray]],
    field_of_view: float | None,
) -> GridLights:
    if isinstance(course, StrobeArm):
        return course.grid_lights
    mirror = None if ball is None else mirror_ball(ball, frames, field_of_view)
    return partial(course.arm(frames(), mirror).grid_lights, course.columns)
