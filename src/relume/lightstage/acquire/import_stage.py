"""Importing a stage: finding its lights, calibrating its pictures and keeping them in a store."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from relume.errors import OutputNotWritten, UnreadableFile, warn
from relume.image.files.video import VIDEOS
from relume.lightstage.acquire.calibration import Calibration
from relume.lightstage.acquire.encoding import PhotographEncoding
from relume.lightstage.acquire.film_import import FilmCourse, filmed_stage, measure_film
from relume.lightstage.acquire.import_corrections import Corrections, correct
from relume.lightstage.acquire.import_lights import (
    Ball,
    BallFindings,
    camera_ahead,
    masks_in,
    radii_of,
    stage_of_balls,
    stage_of_list,
)
from relume.lightstage.acquire.read_stage import find_stage_file, open_pictures, read_stage, stage_geometry
from relume.lightstage.acquire.stage_file import Stage, TargetCard
from relume.lightstage.acquire.store import is_store
from relume.lightstage.acquire.store_building import build_store, file_facts
from relume.lightstage.acquire.store_place import as_place
from relume.lightstage.acquire.store_place import described as described_at
from relume.lightstage.acquire.strobe_arm import StrobeArm
from relume.lightstage.blocks import Cluster
from relume.lightstage.field.field import ReflectanceField, Work, estimate_work
from relume.lightstage.relighting.relighting import MEMORY, Progress

DTYPES = {"half": np.float16, "float": np.float32, "8bit": np.uint8}


@dataclass(frozen=True)
class ImportSettings:
    """How a stage is imported.

    balls : mirrored or matte balls in which the lights are found; which of the two is seen in their shading
    ball_pictures : folders with pictures of the balls under the same lights in the same order, where the balls are not
        in the subject's own pictures; one for all or one for each
    ball_radii : of the balls themselves, metres, where their circles do not say it; one for all or one for each
    lights : an .lp, or a list of directions in the order of the pictures' names
    film : the course of a filmed rotating light arm, or an arm of strobes, of which each frame shows one
    camera : whose pictures, where the stage has several
    field_of_view : of the camera, across, radians, for `balls` and `camera_distance`; far away unless given
    camera_distance : from the subject, metres, of a camera on +Z that looks along −Z
    encoding : of photographs: srgb, linear or a response file; as stage.json says, else srgb
    corrections : of the pictures; its `target` is that of stage.json unless given
    dtype : how values are kept; "8bit" with a scale for each picture
    memory : bytes for pictures; 2 GiB unless given

    Raises ValueError for what cannot go together.
    """

    balls: tuple[Ball, ...] = ()
    ball_pictures: tuple[Path, ...] = ()
    ball_radii: tuple[float, ...] = ()
    lights: Path | None = None
    film: FilmCourse | StrobeArm | None = None
    camera: str | None = None
    field_of_view: float | None = None
    camera_distance: float | None = None
    encoding: str | None = None
    corrections: Corrections = Corrections()
    dtype: Literal["half", "float", "8bit"] = "half"
    memory: int = 2 * MEMORY

    def __post_init__(self) -> None:
        film_ball = isinstance(self.film, FilmCourse) and self.film.frames is None
        if bool(self.balls and not film_ball) + (self.lights is not None) + (self.film is not None) > 1:
            raise ValueError("balls, lights and a film each say where the lights are; give one of them")
        if film_ball and len(self.balls) != 1:
            raise ValueError(
                f"a film without its frames a turn, and {len(self.balls)} balls; give the frames, or one ball in the "
                "film that shows the lamp"
            )
        if self.ball_pictures and (film_ball or not self.balls):
            raise ValueError('pictures of balls without balls; give each ball\'s circle, or "find", and no film')
        if self.ball_radii and (len(self.ball_radii) not in (1, len(self.balls)) or not min(self.ball_radii) > 0):
            raise ValueError(
                f"{len(self.ball_radii)} radii for {len(self.balls)} balls, the least {min(self.ball_radii)} metres; "
                "give one above 0 for all, or one for each"
            )
        if self.field_of_view is not None and not 0 < self.field_of_view < np.pi:
            degrees = np.degrees(self.field_of_view)
            raise ValueError(f"the field of view is {degrees:g} degrees; give more than 0 and less than 180")
        if self.camera_distance is not None:
            if not 0 < self.camera_distance < np.inf:
                raise ValueError(f"the camera's distance is {self.camera_distance}; give metres above 0")
            if self.field_of_view is None:
                raise ValueError("the camera's distance without its field of view; give both")
            if self.balls and not film_ball and None not in radii_of(self.balls, self.ball_radii):
                raise ValueError("balls in metres place the camera; leave the camera's distance or the metres out")
        elif self.field_of_view is not None and not self.balls:
            raise ValueError("the field of view without balls or the camera's distance; give the distance too")


@dataclass(frozen=True, eq=False)
class Imported:
    """What was imported, or would be.

    lights, shape : how many lights, and (rows, columns) of the pictures
    field : as it is stored; None where only a film's frames were counted
    balls : what balls showed
    target, calibration : the card, and what was measured on it
    film_frames : of a film that was counted only
    work : what an import would take; None after one
    """

    lights: int
    shape: tuple[int, int]
    field: ReflectanceField | None = None
    balls: BallFindings | None = None
    target: TargetCard | None = None
    calibration: Calibration | None = None
    film_frames: int | None = None
    work: Work | None = None


def import_stage(
    pictures: str | os.PathLike[str],
    out: str | os.PathLike[str],
    settings: ImportSettings = ImportSettings(),
    *,
    dry_run: bool = False,
    cluster: Cluster = None,
    progress: Progress | None = None,
) -> Imported:
    """Find the lights of a stage, calibrate its pictures, fill invalid samples, and write a store.

    pictures : a folder with stage.json or an .lp, such a file, a store or its URL, a folder of pictures, or a film
    out : the store, as *.zarr, or its fsspec URL; an incomplete one of the same import is resumed
    settings : lights, corrections, and how values are kept
    cluster : whose workers write groups of lights, as `relume.cluster.run_tasks` takes it; this process for None, with
        the same bytes. Incomplete names the lights that failed; the same import again does these alone
    dry_run : nothing is written; what the import would find and take is measured
    progress : called with the share of the work that is done, 0 to 1
    Overexposed samples of photographs are filled from neighbouring lights, always.
    Raises InvalidStage, UnreadableFile, BallNotFound, ValueError, CannotResume, OutputNotWritten.
    """
    source, store, corrections = as_place(pictures), as_place(out), settings.corrections
    _check_paths(source, store, settings)
    # A video is only counted, so that a dry run writes no frames.
    if dry_run and settings.film is not None and isinstance(source, Path) and not source.is_dir():
        ball = settings.balls[0] if settings.balls else None
        frames, lights, shape = measure_film(source, settings.film, ball, settings.field_of_view)
        return Imported(lights, shape, film_frames=frames, work=Work(lights, shape, settings.memory, None))
    with _described(source, store, settings) as (described, balls, known):
        # The field as it was taken, then corrected.
        field, own_card, subject = _field(source, described, settings, known)
        corrections = corrections if corrections.target else replace(corrections, target=own_card)
        mesh, light_radius = stage_geometry(source)
        field, calibration = correct(field, corrections, mesh, subject)
        found = Imported(len(field.lights), field.shape, field, balls, corrections.target, calibration)
        if dry_run:
            return replace(found, work=estimate_work(field, settings.memory))
        # The store, keyed by the settings and the files that they name.
        options = asdict(replace(settings, memory=0, dtype="half"))
        masks = [ball for ball in settings.balls if isinstance(ball, Path)]
        named = (corrections.ambient, corrections.mask, corrections.board, settings.lights, *masks)
        at_url = isinstance(source, str)
        seen = [each for each in (None if at_url else source, *named, *settings.ball_pictures) if each]
        build_store(
            field,
            store,
            dtype=DTYPES[settings.dtype],
            max_memory=settings.memory,
            progress=progress,
            made_from=[repr(options), file_facts(seen), *([source, described_at(source)] if at_url else [])],
            mesh=mesh,
            light_radius=light_radius,
            cluster=cluster,
        )
    return found


def _check_paths(source: Path | str, out: Path | str, settings: ImportSettings) -> None:
    """Refuse what cannot be, before any work."""
    if isinstance(source, str):
        if not is_store(source):
            raise UnreadableFile(f"{source}: no store of a reflectance field; of pictures give their folder")
        if settings.balls or settings.lights or settings.film:
            raise ValueError(f"{source} is a store, which keeps its lights; leave balls, lights and a film out")
    elif not source.exists():
        raise UnreadableFile(f"{source}: no such folder or file; check the path")
    else:
        _check_source(source, settings)
    if isinstance(out, Path) and out.exists() and not out.is_dir():
        raise OutputNotWritten(f"{out}: a file, not a store; choose another name")
    for folder in (*settings.ball_pictures, *([settings.corrections.board] if settings.corrections.board else [])):
        if not folder.is_dir():
            raise UnreadableFile(f"{folder}: no such folder; name the folder of the pictures")
    for file in (settings.lights, settings.corrections.ambient):
        if file is not None and not file.is_file():
            raise UnreadableFile(f"{file}: no such file; check the path")


def _check_source(source: Path, settings: ImportSettings) -> None:
    if (settings.lights or (settings.balls and not settings.film)) and not source.is_dir():
        raise UnreadableFile(f"{source}: a file; with balls or a list of lights give the folder of the pictures")
    if source.suffix.lower() in VIDEOS and settings.film is None:
        raise ValueError(f"{source}: a film; give the course of its lamp too: rings, columns and frames a turn")


@contextmanager
def _described(
    source: Path | str, out: Path | str, settings: ImportSettings
) -> Iterator[tuple[tuple[Stage, Path] | None, BallFindings | None, Collection[Path]]]:
    """The stage and the place of its pictures where settings give them, what balls showed, and pictures of no light."""
    if isinstance(source, str):
        yield None, None, []
        return
    corrections = settings.corrections
    beside = (corrections.ambient, corrections.mask, *settings.balls)
    left = [path for path in beside if isinstance(path, Path) and path.is_file()]
    known = [*left, *masks_in(source)] if source.is_dir() else left
    if settings.film is not None:
        # Most frames of a film are between those of the grid.
        known = [*left, *(source.iterdir() if source.is_dir() else [])]
        ball = settings.balls[0] if settings.balls else None
        near = out if isinstance(out, Path) else Path(tempfile.gettempdir()) / Path(out).name
        with filmed_stage(source, near, settings.film, ball, settings.field_of_view, left) as described:
            yield described, None, known
    elif settings.balls:
        # A matte ball's shading is read in light, not in codes.
        encoding = PhotographEncoding.named(_encoding_word(settings.encoding or "srgb"), source)
        stage, found = stage_of_balls(
            source,
            settings.balls,
            settings.ball_pictures,
            settings.field_of_view,
            left,
            encoding,
            settings.ball_radii,
        )
        yield (stage, source), found, known
    elif settings.lights is not None:
        yield (stage_of_list(source, settings.lights, left), source), None, known
    else:
        yield None, None, left


def _field(
    source: Path | str, described: tuple[Stage, Path] | None, settings: ImportSettings, known: Collection[Path]
) -> tuple[ReflectanceField, TargetCard | None, tuple[float, float, float]]:
    """The field as it was taken, the card of its stage file, and the subject's middle.

    described : the stage and its pictures' place where settings give them; None where the source does
    known : files that are meant to be of no light
    """
    encoding, angle, distance = settings.encoding, settings.field_of_view, settings.camera_distance
    if described is None and is_store(source):
        if encoding is not None:
            raise ValueError(f"{source} is a store, whose values are linear; leave the encoding out")
        if angle is not None:
            raise ValueError(f"{source} is a store, which keeps its camera; leave the field of view out")
        return read_stage(source, settings.camera), None, (0.0, 0.0, 0.0)
    assert isinstance(source, Path)
    stage, place = find_stage_file(source) if described is None else described
    if encoding is not None:
        stage = replace(stage, encoding=_encoding_word(encoding))
    elif place.suffix.lower() != ".json":
        _warn_of_tone(stage, place)
    if stage.target is not None and len(stage.lights[0].files) > 1:
        raise ValueError(
            f'{place}: its "target" is of one camera\'s pictures, and it has {", ".join(stage.lights[0].files)}; take '
            "it out, and give the target with each import"
        )
    if angle is not None and distance is not None:
        stage = camera_ahead(stage, place, angle, distance)
    return open_pictures(stage, place, settings.camera, kept=0, known=known), stage.target, stage.subject


def _encoding_word(encoding: str) -> str:
    """The encoding as a stage says it: a response by its absolute path."""
    return encoding if encoding in ("srgb", "linear") else str(Path(encoding).resolve())


def _warn_of_tone(stage: Stage, place: Path) -> None:
    """Warn of JPEGs whose tone curve nobody gave: cameras bend it away from sRGB."""
    names = [name for entry in stage.lights for each in entry.files.values() for name in each]
    tones = [name for name in names if Path(name).suffix.lower() in (".jpg", ".jpeg")]
    if tones:
        warn(
            f"{place}: {len(tones)} JPEGs such as {tones[0]} are read as sRGB, a guess: cameras bend their tone "
            "curves, and light and dark then come out wrong by some tenths; give the camera's response, as a merge of "
            "a bracket recovers it, or say srgb where that is known"
        )
