"""Where the lights of pictures stood, as `relume stage import` is told: a file, mirrored balls, or a spinning lamp."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from relume.errors import InvalidStage, OutputNotWritten, UnreadableFile

if TYPE_CHECKING:
    import numpy as np

    from relume.lightstage.acquire.ball_highlights import MirrorBall
    from relume.lightstage.acquire.rotating_arm import RotatingArm
    from relume.lightstage.acquire.stage_file import Stage
    from relume.scene.cameras.camera import Camera

VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")


def stage_of_list(folder: Path, listed: Path, leave_out: Sequence[Path] = ()) -> Stage:
    """The pictures of a folder under lights that an .lp or a plain list of directions names, in their order.

    leave_out : pictures that are of no light
    """
    from relume.lightstage.acquire.light_files import LIST, read_directions, read_lp
    from relume.lightstage.acquire.stage_file import LightEntry, Stage

    if listed.suffix.lower() == LIST:
        named = read_lp(listed)
        entries = [
            LightEntry({"": (Path(name.replace("\\", "/")).name,)}, tuple(direction))
            for name, direction in zip(named.names, named.directions.tolist(), strict=True)
        ]
        return Stage(tuple(entries))
    paths, directions = pictures_in(folder, leave_out), read_directions(listed)
    if len(paths) != len(directions):
        raise InvalidStage(f"{listed}: {len(directions)} directions for the {len(paths)} pictures in {folder}")
    pairs = zip(paths, directions.tolist(), strict=True)
    return Stage(tuple(LightEntry({"": (path.name,)}, tuple(direction)) for path, direction in pairs))


def stage_of_balls(
    folder: Path,
    words: Sequence[str],
    elsewhere: Sequence[Path],
    field_of_view: float | None,
    leave_out: Sequence[Path],
) -> tuple[Stage, dict[str, object]]:
    """The pictures of a folder under lights found in mirrored balls, and what was found.

    words : "find", "X,Y,RADIUS" in pixels or "X,Y,RADIUS=METRES" of each ball
    elsewhere : folders of pictures of the balls under the same lights in the same order, one for all or one for each;
        none where the balls are in the subject's own pictures
    leave_out : pictures that are of no light
    field_of_view : of the camera, across, radians; None for one far away
    Where it is told and the balls are in metres, the origin is the mean of their centres, and the stage has a camera.
    """
    import numpy as np

    from relume.lightstage.acquire.ball_highlights import read_ball, unit_mean
    from relume.lightstage.acquire.near_lights import light_places
    from relume.lightstage.acquire.stage_file import LightEntry, Stage, View

    paths = pictures_in(folder, leave_out)
    names = [path.name for path in paths]
    shown = _shown(words, elsewhere, paths)
    balls = [ball_of(word, pictures, field_of_view) for word, pictures in zip(words, shown, strict=True)]
    readings = [
        read_ball((_pixels(path) for path in pictures), ball, [path.name for path in pictures])
        for ball, pictures in zip(balls, shown, strict=True)
    ]
    metric = field_of_view is not None and all("=" in word for word in words)
    facts: dict[str, object] = {
        "balls": [[round(float(v), 2) for v in (*ball.outline.centre, ball.outline.radius)] for ball in balls]
    }
    if len(balls) > 1:
        mean = unit_mean(readings)
        apart = [np.degrees(np.arccos(np.clip((each.directions * mean).sum(-1), -1, 1))).max() for each in readings]
        facts["balls differ by, degrees"] = [round(float(v), 2) for v in apart]
    middle = np.mean([ball.centre for ball in balls], axis=0)
    cameras = {}
    if metric:
        assert field_of_view is not None
        # The readings' frame is the camera's own, which looks along −Z.
        x, y, z = (-middle).tolist()
        cameras["front"] = View((x, y, z), (x, y, z - 1), field_of_view)
    if len(balls) > 1 and metric:
        places = light_places(readings, names)
        positions = places.positions - middle
        facts["rays meet within, metres"] = float(f"{places.residuals.max():.3g}")
        entries = [LightEntry({"": (n,)}, position=tuple(p)) for n, p in zip(names, positions.tolist(), strict=True)]
        return Stage(tuple(entries), cameras), facts
    directions = readings[0].directions if len(balls) == 1 else unit_mean(readings)
    pairs = zip(names, directions.tolist(), strict=True)
    return Stage(tuple(LightEntry({"": (name,)}, tuple(direction)) for name, direction in pairs), cameras), facts


def camera_ahead(stage: Stage, source: Path, field_of_view: float, distance: float) -> Stage:
    """The stage with a camera on +Z that looks at the origin along −Z.

    field_of_view : across, radians
    distance : metres
    Raises ValueError where the stage tells its cameras.
    """
    from relume.lightstage.acquire.stage_file import View

    if stage.cameras:
        raise ValueError(f"--field-of-view: {source} tells its own camera; leave --field-of-view out")
    return replace(stage, cameras={"front": View((0.0, 0.0, distance), (0.0, 0.0, 0.0), field_of_view)})


@dataclass(frozen=True)
class FilmCourse:
    """How a film's lamp went, and how many lights of each ring are kept."""

    stage: RotatingArm
    columns: int


def film_course(text: str, start: float, azimuth: float, clockwise: bool) -> FilmCourse:
    """The course of --film, whose rings start at an azimuth in degrees; raises ValueError."""
    import numpy as np

    from relume.lightstage.acquire.rotating_arm import RotatingArm, SteadyRotation

    try:
        rings, columns, frames = (float(word) for word in text.split(","))
        if not (1 <= rings < np.inf and 1 <= columns < np.inf and 0 < frames < np.inf) or rings % 1 or columns % 1:
            raise ValueError
    except ValueError:
        raise ValueError(f'--film: "{text}" is no course; write RINGS,COLUMNS,FRAMES, like 32,64,72') from None
    course = RotatingArm(
        SteadyRotation(1 / frames, start), int(rings), float(np.pi / (2 * rings)), float(np.pi / rings),
        float(np.radians(azimuth)), clockwise,
    )  # fmt: skip
    return FilmCourse(course, int(columns))


@contextmanager
def filmed_stage(
    source: Path, out: Path, course: FilmCourse | None, leave_out: Sequence[Path]
) -> Iterator[tuple[Stage, Path] | None]:
    """The stage of a film and where its frames are; None where there is no film.

    Those of a video lie beside the store only as long as this lasts. Raises InvalidStage where the film does not go
    round the stage, UnreadableFile, OutputNotWritten.
    """
    if course is None:
        yield None
        return
    from relume.lightstage.acquire.rotating_arm_film import frame_paths, stage_of_frames, unpack_video
    from relume.lightstage.acquire.stage_file import read_stage_file

    if source.is_dir():
        passed = {path.resolve() for path in leave_out}
        paths = [path for path in frame_paths(source) if path.resolve() not in passed]
        yield stage_of_frames(paths, course.stage, course.columns), source
        return
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        place = tempfile.TemporaryDirectory(prefix=f".{out.name}.frames_", dir=out.parent)
    except OSError as error:
        raise OutputNotWritten(f"{out.parent}: cannot be written: {error.strerror}; choose another place") from None
    with place as folder:
        file = unpack_video(source, folder, course.stage, course.columns)
        yield read_stage_file(file), file


def work_of_film(video: Path, course: FilmCourse) -> dict[str, object]:
    """What a video would come to, from looking at all its frames and keeping none: facts for a dry run."""
    from relume.lightstage.acquire.rotating_arm_film import video_frames

    count, size = 0, [0, 0]
    for frame in video_frames(video):
        count, size = count + 1, [frame.shape[1], frame.shape[0]]
    _, lights = course.stage.grid_lights(course.columns, count)
    values = len(lights) * size[0] * size[1] * 3 * 4
    return {"frames": count, "lights": len(lights), "size": size, "values as floats": f"{values / (1 << 20):.3g} MiB"}


def _shown(words: Sequence[str], elsewhere: Sequence[Path], paths: list[Path]) -> list[list[Path]]:
    """The pictures in which each ball is looked for."""
    if not elsewhere:
        return [paths] * len(words)
    if len(elsewhere) not in (1, len(words)):
        raise ValueError(f"--ball-pictures: {len(elsewhere)} folders for {len(words)} balls; give one, or one for each")
    found = [pictures_in(folder) for folder in elsewhere]
    for folder, pictures in zip(elsewhere, found, strict=True):
        if len(pictures) != len(paths):
            raise InvalidStage(
                f"{folder}: {len(pictures)} pictures of the ball, {len(paths)} of the subject; give one a light"
            )
    return found * len(words) if len(found) == 1 else found


def ball_of(word: str, paths: Sequence[Path], field_of_view: float | None) -> MirrorBall:
    """A ball that is told, or sought in the pictures; raises ValueError, and BallNotFound where it is sought."""
    import numpy as np

    from relume.lightstage.acquire.ball_highlights import MirrorBall, find_ball
    from relume.probe.ball.silhouette import outline_of_circle

    first = _pixels(paths[0])
    camera = None if field_of_view is None else _camera(first.shape, field_of_view)
    place, equals, radius = word.partition("=")
    try:
        metres = float(radius) if equals else 1.0
        circle = None if place == "find" else [float(each) for each in place.split(",")]
        if not 0 < metres < np.inf or not (circle is None or (len(circle) == 3 and np.isfinite(circle).all())):
            raise ValueError
        outline = None if circle is None else outline_of_circle(*circle)
    except ValueError:
        raise ValueError(
            f'--ball: "{word}" is no ball; write X,Y,RADIUS in pixels, or find; with its radius, X,Y,RADIUS=METRES'
        ) from None
    if outline is None:
        outline = find_ball((_pixels(path) for path in paths), focal_length=camera and camera.focal_length)
    return MirrorBall(outline, camera, metres)


def _camera(shape: tuple[int, ...], field_of_view: float) -> Camera:
    import numpy as np

    from relume.scene.cameras.camera import Camera

    height, width = shape[:2]
    return Camera(width, height, float(width / 2 / np.tan(field_of_view / 2)), np.zeros(3), np.eye(3))


def pictures_in(folder: Path, leave_out: Sequence[Path] = ()) -> list[Path]:
    """The pictures of a folder in the order of their names, 9 before 10, but for some."""
    from relume.capture.exposure.folder import name_order
    from relume.lightstage.acquire.read_stage import PICTURES

    passed = {path.resolve() for path in leave_out}
    found = [
        path
        for path in folder.iterdir()
        if path.suffix.lower() in PICTURES and not path.name.startswith(".") and path.resolve() not in passed
    ]
    masks = [path for path in found if path.stem.endswith("mask")]
    if masks:
        warnings.warn(f"{folder}: {masks[0].name} is taken for a mask and is no light's picture", stacklevel=2)
    kept = sorted((path for path in found if path not in masks), key=name_order)
    if not kept:
        raise UnreadableFile(f"{folder}: no pictures; it holds none of {', '.join(PICTURES)}")
    return kept


def _pixels(path: Path) -> np.ndarray:
    from relume.image import files

    return files.read_radiance(path).radiance if files.has_radiance(path) else files.read_photograph(path).pixels
