"""The film of a spinning stage, as a video or as a folder of frames, made into a stage that can be relit.

Video frames are 8-bit sRGB as players show them; those of the grid are written as PNG, one pass through the film, so
that nothing has to be held in memory. PyAV is imported at first use.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from relume.capture.exposure.folder import name_order
from relume.errors import BallNotFound, InvalidStage, UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.lightstage.acquire.ball_highlights import MirrorBall, find_highlight
from relume.lightstage.acquire.rotating_arm import RotatingArm
from relume.lightstage.acquire.stage_file import LightEntry, Stage
from relume.lightstage.field.lights import StageLights

FRAMES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr", ".hdr")


def video_frames(path: str | os.PathLike[str]) -> Iterator[np.ndarray]:
    """The frames of a video one after another, (H, W, 3) uint8 sRGB.

    Raises UnreadableFile for what is missing, damaged or no video; ValueError where PyAV is missing.
    """
    try:
        import av
        from av.error import FFmpegError
    except ImportError:
        raise ValueError('a video needs PyAV, which is not installed: pip install "relume[video]"') from None
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise UnreadableFile(f"{path}: holds no pictures; give the video")
            for frame in container.decode(video=0):
                yield frame.to_ndarray(format="rgb24")
    except (OSError, FFmpegError) as error:
        reason = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise UnreadableFile(f"{path}: cannot be read as a video: {reason}; copy it again") from None


def lamp_directions(pictures: Iterable[np.ndarray], ball: MirrorBall) -> np.ndarray:
    """Where a mirrored ball shows the lamp in each frame (H, W, 3) of a film: (N, 3) unit, NaN where it shows none."""
    directions = []
    for picture in pictures:
        try:
            point = find_highlight(picture, ball.outline)
        except BallNotFound:
            directions.append(np.full(3, np.nan))
        else:
            directions.append(ball.reflections(np.array([point]))[1][0])
    return np.array(directions).reshape(-1, 3)


def frame_paths(folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """The frames in a folder in the order of their names, 9 before 10; raises InvalidStage where there are none."""
    found = [path for path in Path(folder).iterdir() if path.suffix.lower() in FRAMES and not path.name.startswith(".")]
    if not found:
        raise InvalidStage(f"{folder}: no frames; it holds none of {', '.join(FRAMES)}")
    return tuple(sorted(found, key=name_order))


def stage_of_frames(paths: Sequence[Path], course: RotatingArm, columns: int) -> Stage:
    """The stage of a film's frames, all in one folder and in their order, `columns` lights a ring; none is read.

    Raises InvalidStage where the film does not go round the stage.
    """
    frames, lights = course.grid_lights(columns, len(paths))
    return _stage([paths[frame].name for frame in frames], lights)


def unpack_video(video: str | os.PathLike[str], folder: Path, course: RotatingArm, columns: int) -> Stage:
    """Write the frames of a stage's grid, `columns` lights a ring, as PNG to a folder, and give the stage of them.

    Raises InvalidStage where the film does not go round the stage, UnreadableFile, OutputNotWritten.
    """
    frame_count = sum(1 for _ in video_frames(video))
    frames, lights = course.grid_lights(columns, frame_count)
    names = {int(frame): f"{name}.png" for frame, name in zip(frames, lights.names, strict=True)}
    for index, pixels in enumerate(video_frames(video)):
        if index in names:
            files.write(folder / names[index], Photograph(pixels, names[index]))
    return _stage(list(names.values()), lights)


def _stage(names: list[str], lights: StageLights) -> Stage:
    entries = tuple(
        LightEntry({"": (file,)}, (x, y, z), name=name, solid_angle=float(angle))
        for file, name, (x, y, z), angle in zip(
            names, lights.names, lights.directions.tolist(), lights.solid_angles, strict=True
        )
    )
    return Stage(entries, grid=lights.grid)
