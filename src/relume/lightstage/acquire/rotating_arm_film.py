"""The film of a spinning stage, as a video or as a folder of frames, made into a stage that can be relit.

Video frames are 8-bit sRGB as players show them; those of the grid are written as PNG beside a `stage.json`, one pass
through the film, so that nothing has to be held in memory. PyAV is imported at first use.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from relume.capture.exposure.folder import name_order
from relume.errors import BallNotFound, InvalidStage, OutputNotWritten, UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.lightstage.acquire.ball_highlights import HighlightSearch, MirrorBall, find_highlight
from relume.lightstage.acquire.rotating_arm import RotatingArm
from relume.lightstage.acquire.stage_file import STAGE_FILE, LightEntry, Stage, StageCamera, write_stage_file
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
        raise UnreadableFile(f"{path}: cannot be read as a video: {_reason(error)}; copy it again") from None


def lamp_directions(
    pictures: Iterable[np.ndarray], ball: MirrorBall, search: HighlightSearch = HighlightSearch()
) -> np.ndarray:
    """Where a mirrored ball shows the lamp in each frame, (N, 3) unit, NaN where it shows none.

    pictures : (H, W, 3) of all frames in their order, as `video_frames` gives them; `fit_rotation` finds
        rate and start from what comes out
    """
    directions = []
    for picture in pictures:
        try:
            point = find_highlight(picture, ball.outline, search=search)
        except BallNotFound:
            directions.append(np.full(3, np.nan))
        else:
            directions.append(ball.reflections(np.array([point]))[1][0])
    return np.array(directions).reshape(-1, 3)


def frame_paths(folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """The frames in a folder in the order of their names, 9 before 10; raises InvalidStage where there are none."""
    if not Path(folder).is_dir():
        raise InvalidStage(f"{folder}: no such folder; name the folder of the frames, or the video")
    found = [path for path in Path(folder).iterdir() if path.suffix.lower() in FRAMES and not path.name.startswith(".")]
    if not found:
        raise InvalidStage(f"{folder}: no frames; it holds none of {', '.join(FRAMES)}")
    return tuple(sorted(found, key=name_order))


def stage_of_frames(
    paths: Sequence[Path], course: RotatingArm, columns: int, view: StageCamera | None = None, encoding: str = "srgb"
) -> Stage:
    """The stage of a folder of frames, for a stage file beside them; no picture is read or copied.

    paths : all frames of the film in their order, in one folder
    columns : lights a ring
    Raises InvalidStage where the film does not go round the stage.
    """
    frames, lights = course.grid_lights(columns, len(paths))
    return _stage([paths[frame].name for frame in frames], lights, view, encoding)


def unpack_video(
    video: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    course: RotatingArm,
    columns: int,
    view: StageCamera | None = None,
) -> Path:
    """Write the frames of a stage's grid as PNG to a folder, and its stage file last; gives that file's path.

    folder : made where it is missing; without a stage file it is not complete
    columns : lights a ring
    Raises InvalidStage where the film does not go round the stage, UnreadableFile, OutputNotWritten.
    """
    frame_count = sum(1 for _ in video_frames(video))
    frames, lights = course.grid_lights(columns, frame_count)
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{place}: cannot be made: {error.strerror}; choose another place") from error
    names = {int(frame): f"{name}.png" for frame, name in zip(frames, lights.names, strict=True)}
    for index, pixels in enumerate(video_frames(video)):
        if index in names:
            files.write(place / names[index], Photograph(pixels, names[index]))
    write_stage_file(place / STAGE_FILE, _stage(list(names.values()), lights, view, "srgb"))
    return place / STAGE_FILE


def _stage(names: list[str], lights: StageLights, view: StageCamera | None, encoding: str) -> Stage:
    entries = tuple(
        LightEntry({"": (file,)}, (x, y, z), name=name, solid_angle=float(angle))
        for file, name, (x, y, z), angle in zip(
            names, lights.names, lights.directions.tolist(), lights.solid_angles, strict=True
        )
    )
    return Stage(entries, {} if view is None else {"front": view}, lights.grid, encoding)


def _reason(error: Any) -> str:
    return " ".join(str(getattr(error, "strerror", None) or error).split())
