"""Where the lights of pictures stood: from a list, or from balls in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from relume.capture.exposure.folder import name_order
from relume.errors import BallNotFound, InvalidStage, UnreadableFile, warn
from relume.image import files
from relume.lightstage.acquire.ball_highlights import (
    BallReadings,
    MirrorBall,
    light_places,
    outline_of_mask,
    read_ball,
    unit_mean,
)
from relume.lightstage.acquire.ball_search import find_ball, find_balls
from relume.lightstage.acquire.ball_shading import read_shading
from relume.lightstage.acquire.encoding import PhotographEncoding
from relume.lightstage.acquire.light_files import LIST, read_directions, read_lp
from relume.lightstage.acquire.read_stage import PICTURES
from relume.lightstage.acquire.stage_file import LightEntry, Stage, StageCamera, stage_towards
from relume.probe.ball.silhouette import Outline, outline_of_circle
from relume.scene.cameras.camera import Camera

MATTE = 0.8
"""From which share of a ball's shading on, in most of its pictures, that of a matte ball explains it."""
_SHADED = 0.5
"""The least share in a single picture of such a ball."""
_TRIED = 5


@dataclass(frozen=True)
class BallCircle:
    """A mirrored ball's circle in the pictures: its middle and radius in pixels.

    x, y, radius : pixels, from the upper left corner
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
    radii: Sequence[float] = (),
) -> tuple[Stage, BallFindings]:
    """The pictures of a folder, but for some, under lights found in balls, and what the balls showed.

    Arguments as of `ImportSettings`. Where the field of view is given and the balls are in metres, the origin is the
    mean of their centres, and the stage has a camera.
    """
    paths = pictures_in(folder, leave_out)
    names = [path.name for path in paths]
    # Each ball reads its own pictures.
    shown = _pictures_of_balls(len(balls), elsewhere, paths)
    metres = radii_of(balls, radii)
    mirrors = _placed(balls, shown, metres, field_of_view, encoding)
    readings = [_read(pictures, mirror, encoding) for mirror, pictures in zip(mirrors, shown, strict=True)]
    found = BallFindings(
        tuple((float(x), float(y), float(each.outline.radius)) for each in mirrors for x, y in [each.outline.centre]),
        _disagreement(readings) if len(balls) > 1 else (),
        matte=tuple(each.matte for each in readings),
    )
    # Balls in metres before a known camera place that camera.
    metric = field_of_view is not None and None not in metres
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


def _placed(
    balls: Sequence[Ball],
    shown: Sequence[list[Path]],
    metres: Sequence[float | None],
    field_of_view: float | None,
    encoding: PhotographEncoding,
) -> list[MirrorBall]:
    """The balls in their pictures, those that are sought in the same ones from left to right.

    Raises BallNotFound, naming the folder.
    """
    mirrors = {
        index: mirror_ball(ball, partial(map, pixels_of, shown[index]), field_of_view, radius=metres[index])
        for index, ball in enumerate(balls)
        if ball != "find"
    }
    for index, ball in enumerate(balls):
        if index in mirrors:
            continue
        pictures, folder = shown[index], shown[index][0].parent
        # What is of no light, as a picture under the room's, may show the ball best.
        others = [path for path in _pictures_there(folder) if path not in pictures and not path.stem.endswith("mask")]
        together = [k for k, its in enumerate(shown) if its == pictures]
        sought = [k for k in together if k not in mirrors]
        taken = [mirrors[k].outline for k in together if k in mirrors]
        seen, looked_at = partial(map, pixels_of, pictures), map(pixels_of, others)
        try:
            if len(together) == 1:
                mirrors[index] = mirror_ball(ball, seen, field_of_view, str(folder), looked_at, metres[index])
                continue
            camera = _camera_of(seen, field_of_view)
            some = pictures[:: max(1, len(pictures) // _TRIED)]
            outlines = find_balls(
                seen(), len(sought), partial(_lamps, some, camera, encoding), str(folder),
                camera and camera.focal_length, looked_at, taken,
            )  # fmt: skip
        except BallNotFound as error:
            words = "or give the ball's circle, or a mask that is white on it"
            raise BallNotFound(f"{error}; {words}" if len(together) == 1 else str(error)) from None
        mirrors |= {k: MirrorBall(each, camera, metres[k] or 1.0) for k, each in zip(sought, outlines, strict=True)}
    return [mirrors[index] for index in range(len(balls))]


def _lamps(paths: Sequence[Path], camera: Camera | None, encoding: PhotographEncoding, outline: Outline) -> np.ndarray:
    """The directions (N, 3) to the lamps of some pictures that a ball of this outline shows."""
    return _read(paths, MirrorBall(outline, camera), encoding).directions


def _read(paths: Sequence[Path], ball: MirrorBall, encoding: PhotographEncoding) -> BallReadings:
    """What a ball shows of the lights: a mirrored one its highlights, a matte one its shading.

    Raises BallNotFound, naming the picture, where it shows neither.
    """
    # Some pictures say whether it is matte, so that each of the others is looked at in one way.
    some = paths[:: max(1, len(paths) // _TRIED)]
    explained = [read_shading(_light(path, encoding), ball)[1] for path in some]
    if float(np.median(explained)) < MATTE:
        return read_ball(map(pixels_of, paths), ball, [str(path) for path in paths])
    found = [read_shading(_light(path, encoding), ball) for path in paths]
    for path, (_, share) in zip(paths, found, strict=True):
        if share < _SHADED:
            raise BallNotFound(
                f"{path}: the matte ball is not shaded as by one lamp; did its light shine alone, and is the encoding "
                "right?"
            )
    return BallReadings(np.tile(ball.centre, (len(paths), 1)), np.array([towards for towards, _ in found]), matte=True)


def radii_of(balls: Sequence[Ball], radii: Sequence[float] = ()) -> tuple[float | None, ...]:
    """The own radius of each ball in metres, None where it is unknown.

    radii : of those that do not say it themselves; one for all, or one for each
    """
    given = radii if len(radii) == len(balls) else [radii[0] if radii else None] * len(balls)
    own = (ball.metres if isinstance(ball, BallCircle) else None for ball in balls)
    return tuple(metres or radius for metres, radius in zip(own, given, strict=True))


def camera_ahead(stage: Stage, source: Path, field_of_view: float, distance: float) -> Stage:
    """The stage with a camera on +Z that looks at the origin along −Z; raises ValueError where it has one."""
    if stage.cameras:
        raise ValueError(f"{source} has a camera of its own; leave the field of view and the camera's distance out")
    return replace(stage, cameras={"front": StageCamera((0.0, 0.0, distance), (0.0, 0.0, 0.0), field_of_view)})


def mirror_ball(
    ball: Ball,
    pictures: Callable[[], Iterable[np.ndarray]],
    field_of_view: float | None,
    name: str = "pictures",
    others: Iterable[np.ndarray] = (),
    radius: float | None = None,
) -> MirrorBall:
    """A ball as the camera sees it, given or sought in the pictures; raises ValueError and BallNotFound.

    name : of the pictures, for messages
    others : as of `find_ball`
    radius : of the ball itself, metres, where it is known
    """
    camera = _camera_of(pictures, field_of_view)
    if isinstance(ball, Path):
        outline = outline_of_mask(files.read_photograph(ball).pixels, str(ball))
    elif isinstance(ball, BallCircle):
        outline = outline_of_circle(ball.x, ball.y, ball.radius)
    else:
        outline = find_ball(pictures(), name, camera and camera.focal_length, others)
    return MirrorBall(outline, camera, radius or 1.0)


def _camera_of(pictures: Callable[[], Iterable[np.ndarray]], field_of_view: float | None) -> Camera | None:
    """The camera of pictures, at the origin and along −Z, where its field of view is known."""
    if field_of_view is None:
        return None
    height, width = next(iter(pictures())).shape[:2]
    return Camera(width, height, float(width / 2 / np.tan(field_of_view / 2)), np.zeros(3), np.eye(3))


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


def _light(path: Path, encoding: PhotographEncoding) -> np.ndarray:
    """The scene-linear values of a picture."""
    if files.has_radiance(path):
        return files.read_radiance(path).radiance
    return encoding.linearised(files.read_photograph(path))


def pixels_of(path: Path) -> np.ndarray:
    """The values of a picture as it stores them: radiance, or a photograph's codes."""
    return files.read_radiance(path).radiance if files.has_radiance(path) else files.read_photograph(path).pixels
