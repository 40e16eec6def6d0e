"""Where the lights of pictures stood: from a list, from mirrored balls, or from the course of a rotating light arm."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from relume.capture.exposure.folder import name_order
from relume.errors import BallNotFound, InvalidStage, OutputNotWritten, UnreadableFile, warn
from relume.image import files
from relume.lightstage.acquire.ball_highlights import (
    BallReadings,
    MirrorBall,
    find_ball,
    light_places,
    outline_of_mask,
    read_ball,
    unit_mean,
)
from relume.lightstage.acquire.ball_shading import read_shading
from relume.lightstage.acquire.encoding import PhotographEncoding
from relume.lightstage.acquire.light_files import LIST, read_directions, read_lp
from relume.lightstage.acquire.read_stage import PICTURES
from relume.lightstage.acquire.rotating_arm import (
    RotatingArm,
    SteadyRotation,
    fit_rings,
    fit_rotation,
    frame_paths,
    lamp_directions,
    stage_of_frames,
    unpack_video,
    video_frames,
)
from relume.lightstage.acquire.stage_file import LightEntry, Stage, StageCamera, stage_towards
from relume.probe.ball.silhouette import outline_of_circle
from relume.scene.cameras.camera import Camera

MATTE = 0.8
"""From which share of a ball's shading on, in most of its pictures, that of a matte ball explains it."""
_SHADED = 0.5
"""The least share in a single picture of such a ball."""
_TRIED = 5
VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")


@dataclass(frozen=True)
class BallCircle:
    """A mirrored ball's circle in the pictures: its middle and radius in pixels.

    metres : the ball's own radius; None where unknown, and directions alone are found
    """

    x: float
    y: float
    radius: float
    metres: float | None = None

    def __post_init__(self) -> None:
        if not (self.radius > 0 and (self.metres is None or self.metres > 0)):
            raise ValueError(f"a ball of radius {self.radius} pixels, {self.metres} metres; expected radii above 0")


Ball = BallCircle | Path | Literal["find"]
"""A circle, a picture that is white on the ball and black beside it, or a search."""


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


@dataclass(frozen=True)
class BallFindings:
    """What mirrored balls showed.

    circles : x, y and radius of each ball, pixels
    disagreement : the largest angle of each ball's directions to the mean of all, radians; empty for one ball
    ray_miss : metres within which the rays of the balls meet at each lamp; None where only directions are found
    matte : of each ball, whether it is matte, so that its shading was read instead of a highlight
    """

    circles: tuple[tuple[float, float, float], ...]
    disagreement: tuple[float, ...] = ()
    ray_miss: float | None = None
    matte: tuple[bool, ...] = ()


def stage_of_list(folder: Path, listed: Path, leave_out: Sequence[Path]) -> Stage:
    """The pictures of a folder, but for some, under lights that an .lp or a plain list of directions names in order."""
    if listed.suffix.lower() == LIST:
        names, directions = read_lp(listed)
        return stage_towards([Path(name.replace("\\", "/")).name for name in names], directions)
    paths, directions = pictures_in(folder, leave_out), read_directions(listed)
    if len(paths) != len(directions):
        raise InvalidStage(f"{listed}: {len(directions)} directions for the {len(paths)} pictures in {folder}")
    return stage_towards([path.name for path in paths], directions)


def stage_of_balls(
    folder: Path,
    balls: Sequence[Ball],
    elsewhere: Sequence[Path],
    field_of_view: float | None,
    leave_out: Sequence[Path],
    encoding: PhotographEncoding = PhotographEncoding(),
) -> tuple[Stage, BallFindings]:
    """The pictures of a folder, but for some, under lights found in balls, and what the balls showed.

    Arguments as of `ImportSettings`. Where the field of view is given and the balls are in metres, the origin is the
    mean of their centres, and the stage has a camera.
    """
    paths = pictures_in(folder, leave_out)
    names = [path.name for path in paths]
    # Each ball reads its own pictures.
    shown = _pictures_of_balls(len(balls), elsewhere, paths)
    sought = [pictures for ball, pictures in zip(balls, shown, strict=True) if ball == "find"]
    if any(sought.count(pictures) > 1 for pictures in sought):
        raise ValueError(f"{sought[0][0].parent}: two balls are sought in the same pictures; give each its circle")
    mirrors = [_placed(ball, pictures, field_of_view) for ball, pictures in zip(balls, shown, strict=True)]
    readings = [_read(pictures, mirror, encoding) for mirror, pictures in zip(mirrors, shown, strict=True)]
    found = BallFindings(
        tuple((float(x), float(y), float(each.outline.radius)) for each in mirrors for x, y in [each.outline.centre]),
        _disagreement(readings) if len(balls) > 1 else (),
        matte=tuple(each.matte for each in readings),
    )
    # Balls in metres before a known camera place that camera.
    metric = field_of_view is not None and in_metres(balls)
    middle, cameras = np.mean([mirror.centre for mirror in mirrors], axis=0), {}
    if metric:
        assert field_of_view is not None
        # The readings' frame is the camera's own, which looks along −Z.
        x, y, z = (-middle).tolist()
        cameras["front"] = StageCamera((x, y, z), (x, y, z - 1), field_of_view)
    # Several such balls place the lamps; else their mean direction counts.
    if len(balls) > 1 and metric:
        positions, distances = light_places(readings, names)
        pairs = zip(names, (positions - middle).tolist(), strict=True)
        entries = [LightEntry({"": (name,)}, position=tuple(place)) for name, place in pairs]
        return Stage(tuple(entries), cameras), replace(found, ray_miss=float(distances.max()))
    directions = readings[0].directions if len(balls) == 1 else unit_mean(readings)
    return stage_towards(names, directions, cameras), found


def _placed(ball: Ball, pictures: list[Path], field_of_view: float | None) -> MirrorBall:
    """A ball in its pictures; raises BallNotFound, naming their folder."""
    folder = pictures[0].parent
    # What is of no light, as a picture under the room's, may show the ball best.
    others = [path for path in _pictures_there(folder) if path not in pictures and not path.stem.endswith("mask")]
    try:
        return mirror_ball(ball, lambda: map(_pixels, pictures), field_of_view, str(folder), map(_pixels, others))
    except BallNotFound as error:
        raise BallNotFound(f"{error}; or give the ball's circle, or a mask that is white on it") from None


def _read(paths: Sequence[Path], ball: MirrorBall, encoding: PhotographEncoding) -> BallReadings:
    """What a ball shows of the lights: a mirrored one its highlights, a matte one its shading.

    Raises BallNotFound, naming the picture, where it shows neither.
    """
    # Some pictures say whether it is matte, so that each of the others is looked at in one way.
    some = paths[:: max(1, len(paths) // _TRIED)]
    explained = [read_shading(_light(path, encoding), ball)[1] for path in some]
    if float(np.median(explained)) < MATTE:
        return read_ball(map(_pixels, paths), ball, [str(path) for path in paths])
    found = [read_shading(_light(path, encoding), ball) for path in paths]
    for path, (_, share) in zip(paths, found, strict=True):
        if share < _SHADED:
            raise BallNotFound(
                f"{path}: the matte ball is not shaded as by one lamp; did its light shine alone, and is the encoding "
                "right?"
            )
    return BallReadings(np.tile(ball.centre, (len(paths), 1)), np.array([towards for towards, _ in found]), matte=True)


def in_metres(balls: Sequence[Ball]) -> bool:
    """Whether the own radius of every ball is known."""
    return all(isinstance(ball, BallCircle) and ball.metres is not None for ball in balls)


def camera_ahead(stage: Stage, source: Path, field_of_view: float, distance: float) -> Stage:
    """The stage with a camera on +Z that looks at the origin along −Z; raises ValueError where it has one."""
    if stage.cameras:
        raise ValueError(f"{source} has a camera of its own; leave the field of view and the camera's distance out")
    return replace(stage, cameras={"front": StageCamera((0.0, 0.0, distance), (0.0, 0.0, 0.0), field_of_view)})


@contextmanager
def filmed_stage(
    source: Path,
    out: Path,
    course: FilmCourse,
    ball: Ball | None,
    field_of_view: float | None,
    leave_out: Sequence[Path],
) -> Iterator[tuple[Stage, Path]]:
    """The stage of a filmed rotating arm, and where its frames are: those of a video lie beside `out` meanwhile.

    source : a video, or the folder of its frames
    Raises InvalidStage where the film does not go round the stage, UnreadableFile, OutputNotWritten.
    """
    if source.is_dir():
        passed = {path.resolve() for path in leave_out}
        paths = [path for path in frame_paths(source) if path.resolve() not in passed]
        arm = _arm(course, ball, lambda: map(_pixels, paths), field_of_view)
        yield stage_of_frames(paths, arm, course.columns), source
        return
    arm = _arm(course, ball, lambda: video_frames(source), field_of_view)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        place = tempfile.TemporaryDirectory(prefix=f".{out.name}.frames_", dir=out.parent)
    except OSError as error:
        raise OutputNotWritten(f"{out.parent}: cannot be written: {error.strerror}; choose another place") from None
    with place as folder:
        yield unpack_video(source, Path(folder), arm, course.columns), Path(folder)


def measure_film(
    video: Path, course: FilmCourse, ball: Ball | None, field_of_view: float | None
) -> tuple[int, int, tuple[int, int]]:
    """Frames, lights and (rows, columns) of a video, from looking at all its frames and keeping none."""
    arm = _arm(course, ball, lambda: video_frames(video), field_of_view)
    count, shape = 0, (0, 0)
    for frame in video_frames(video):
        count, shape = count + 1, (frame.shape[0], frame.shape[1])
    return count, len(arm.grid_lights(course.columns, count)[1]), shape


def mirror_ball(
    ball: Ball,
    pictures: Callable[[], Iterable[np.ndarray]],
    field_of_view: float | None,
    name: str = "pictures",
    others: Iterable[np.ndarray] = (),
) -> MirrorBall:
    """A ball as the camera sees it, given or sought in the pictures; raises ValueError and BallNotFound.

    name : of the pictures, for messages
    others : as of `find_ball`
    """
    camera = None
    if field_of_view is not None:
        height, width = next(iter(pictures())).shape[:2]
        camera = Camera(width, height, float(width / 2 / np.tan(field_of_view / 2)), np.zeros(3), np.eye(3))
    if isinstance(ball, Path):
        return MirrorBall(outline_of_mask(files.read_photograph(ball).pixels, str(ball)), camera)
    if isinstance(ball, BallCircle):
        return MirrorBall(outline_of_circle(ball.x, ball.y, ball.radius), camera, ball.metres or 1.0)
    outline = find_ball(pictures(), name, camera and camera.focal_length, others)
    return MirrorBall(outline, camera)


def pictures_in(folder: Path, leave_out: Sequence[Path] = ()) -> list[Path]:
    """The pictures of a folder in the order of their names, 9 before 10, but for some; warns of masks."""
    passed = {path.resolve() for path in leave_out}
    found = [path for path in _pictures_there(folder) if path.resolve() not in passed]
    masks = masks_in(folder)
    if masks:
        warn(f"{folder}: {masks[0].name} is taken for a mask and is no light's picture")
    kept = sorted((path for path in found if path not in masks), key=name_order)
    if not kept:
        within = sorted(each.name for each in folder.iterdir() if each.is_dir() and _pictures_there(each))
        raise UnreadableFile(
            f"{folder}: no pictures; it holds none of {', '.join(PICTURES)}"
            + (f", but its folders {', '.join(within[:4])} do: name the subject's" if within else "")
        )
    return kept


def masks_in(folder: Path) -> list[Path]:
    """The pictures of a folder whose names end in "mask"."""
    return [path for path in _pictures_there(folder) if path.stem.endswith("mask")]


def _pictures_there(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.suffix.lower() in PICTURES and not path.name.startswith(".")]


def _pictures_of_balls(count: int, elsewhere: Sequence[Path], paths: list[Path]) -> list[list[Path]]:
    """The pictures in which each ball is looked for, one a picture of the subject and in their order."""
    if not elsewhere:
        return [paths] * count
    if len(elsewhere) not in (1, count):
        raise ValueError(f"{len(elsewhere)} folders of pictures for {count} balls; give one, or one for each")
    found = [_paired(folder, paths) for folder in elsewhere]
    return found * count if len(found) == 1 else found


def _paired(folder: Path, paths: list[Path]) -> list[Path]:
    """The pictures of a ball in another folder: those of the same names, whatever their format, else all in order."""
    pictures = pictures_in(folder)
    named, wanted = {path.stem: path for path in pictures}, [path.stem for path in paths]
    if len(named) == len(pictures) and set(wanted) <= set(named):
        if odd := [path.name for path in pictures if path.stem not in set(wanted)]:
            warn(f"{folder}: {odd[0]} has no namesake among the subject's pictures ({len(odd)} such); it is no light's")
        return [named[stem] for stem in wanted]
    if len(pictures) != len(paths):
        alone = sorted(set(named) ^ set(wanted))
        raise InvalidStage(
            f"{folder}: {len(pictures)} pictures of the ball, {len(paths)} of the subject; give one a light"
            + (f" (only one of the folders has {', '.join(alone)})" if 0 < len(alone) <= 3 else "")
        )
    return pictures


def _disagreement(readings: Sequence[BallReadings]) -> tuple[float, ...]:
    mean = unit_mean(readings)
    return tuple(float(np.arccos(np.clip((each.directions * mean).sum(-1), -1, 1)).max()) for each in readings)


def _arm(
    course: FilmCourse, ball: Ball | None, frames: Callable[[], Iterable[np.ndarray]], field_of_view: float | None
) -> RotatingArm:
    mirror = None if ball is None else mirror_ball(ball, frames, field_of_view)
    return course.arm(frames(), mirror)


def _light(path: Path, encoding: PhotographEncoding) -> np.ndarray:
    """The scene-linear values of a picture."""
    if files.has_radiance(path):
        return files.read_radiance(path).radiance
    return encoding.linearised(files.read_photograph(path))


def _pixels(path: Path) -> np.ndarray:
    return files.read_radiance(path).radiance if files.has_radiance(path) else files.read_photograph(path).pixels
