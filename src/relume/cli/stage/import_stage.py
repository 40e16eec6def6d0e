"""`relume stage import`: pictures under one light at a time in, a calibrated store that is quick to relight out."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from relume.cli.arguments import DryRun, require_files
from relume.cli.console import OutputOptions, print_facts, progress, warnings_as_notes
from relume.cli.stage.import_cleaning import mended
from relume.cli.stage.import_lights import (
    VIDEOS,
    camera_ahead,
    film_course,
    filmed_stage,
    stage_of_balls,
    stage_of_list,
    work_of_film,
)
from relume.cli.stage.options import Camera, MaxMemory, bytes_of, work_of
from relume.errors import OutputNotWritten, UnreadableFile

if TYPE_CHECKING:
    from relume.lightstage.acquire.stage_file import Stage, TargetCard
    from relume.lightstage.field.field import Noise, ReflectanceField


def import_stage(
    source: Annotated[
        Path,
        Parameter(help="A folder with stage.json or an .lp, such a file, a folder of pictures, or a film of a stage."),
    ],
    /,
    *,
    out: Annotated[
        Path, Parameter(alias="-o", help="The store to write, like cat.zarr; a store cut short is gone on with.")
    ],
    ball: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            help="Find the lights in a mirrored ball: find, or its X,Y,RADIUS in pixels; again for each "
            "ball. Balls with their radii in metres (X,Y,RADIUS=METRES) and --field-of-view tell places, not only "
            "directions.",
        ),
    ] = None,
    ball_pictures: Annotated[
        list[Path] | None,
        Parameter(
            negative="",
            help="A folder with pictures of the ball under the same lights in the same order, where it is not in the "
            "subject's own; again for each ball.",
        ),
    ] = None,
    lights: Annotated[
        Path | None,
        Parameter(help="The lights in an .lp, or a list of directions in the order of the pictures' names."),
    ] = None,
    field_of_view: Annotated[
        float | None,
        Parameter(help="Of the camera, across, degrees, for --ball and --camera-distance; far away unless given."),
    ] = None,
    camera_distance: Annotated[
        float | None,
        Parameter(
            help="How far the camera stands from the subject, metres, where neither stage.json nor balls in metres "
            "tell: with --field-of-view it is known and looks at the subject along -Z."
        ),
    ] = None,
    film: Annotated[
        str | None,
        Parameter(
            help="The course of a film's lamp, RINGS,COLUMNS,FRAMES: rings from top to bottom, lights a ring that are "
            "kept, and frames a turn."
        ),
    ] = None,
    film_start: Annotated[float, Parameter(help="The film's frame at which the lamp starts.")] = 0.0,
    film_azimuth: Annotated[
        float, Parameter(allow_leading_hyphen=True, help="Where each ring starts, degrees from +Z towards +X.")
    ] = 0.0,
    clockwise: Annotated[bool, Parameter(negative="", help="The film's lamp turns from +Z towards −X.")] = False,
    ambient: Annotated[
        Path | None, Parameter(help="A picture with all lights off, which is taken from every other.")
    ] = None,
    target: Annotated[
        str | None,
        Parameter(
            help="A white or grey card in the pictures, LEFT,TOP,WIDTH,HEIGHT=REFLECTANCE: every light's colour and "
            "intensity are measured on it and divided out; that of stage.json unless given."
        ),
    ] = None,
    encoding: Annotated[
        str | None,
        Parameter(
            help="What photographs' values stand for: srgb, linear, or a response that `relume merge` recovered "
            "(.json); as stage.json says, else srgb."
        ),
    ] = None,
    mask: Annotated[
        Path | None,
        Parameter(
            help="White where values say nothing: one picture, which leaves those pixels black, or a folder with one a "
            "light, whose values are filled from the lights around."
        ),
    ] = None,
    flare: Annotated[
        bool, Parameter(negative="", help="Leave out, and fill, lights that shine into the lens, and their flare.")
    ] = False,
    lamp_size: Annotated[float, Parameter(help="Apparent diameter of the lamps, degrees, for --flare.")] = 2.0,
    bars: Annotated[
        bool, Parameter(negative="", help="Leave out, and fill, the shadow of the stage's own bar.")
    ] = False,
    noise: Annotated[
        str | None,
        Parameter(
            help="Variance of the pictures' values as CONSTANT,SLOPE, which is CONSTANT + SLOPE times the value; seen "
            "in the pictures unless given."
        ),
    ] = None,
    no_noise: Annotated[bool, Parameter(negative="", help="Leave the noise unknown.")] = False,
    dtype: Annotated[
        Literal["half", "float", "8bit"], Parameter(help="How values are kept; 8bit with a scale for each picture.")
    ] = "half",
    camera: Camera = None,
    max_memory: MaxMemory = "2G",
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Bring in a light stage: find its lights, calibrate its pictures, mend what says nothing, keep it in a store.

    A store is quick to relight, whatever its size. Overexposed values of photographs are left out and filled from the
    lights around.
    """
    import numpy as np

    from relume.lightstage.acquire.read_stage import stage_geometry
    from relume.lightstage.acquire.store_building import build_store, file_facts

    with warnings_as_notes(output):
        memory = bytes_of(max_memory, "--max-memory")
        _check(source, out, ball, ball_pictures, lights, film, ambient)
        _check_camera(field_of_view, camera_distance, ball)
        told_noise = _noise(noise, no_noise)
        course = None if film is None else film_course(film, film_start, film_azimuth, clockwise)
        if dry_run and course is not None and not source.is_dir():
            print_facts(output, {"would write": str(out), **work_of_film(source, course)})
            return
        angle = None if field_of_view is None else float(np.radians(field_of_view))
        left = [path for path in (ambient, mask) if path is not None and path.is_file()]
        # Of a film most frames are between those of the grid.
        known = [*left, *(source.iterdir() if course is not None and source.is_dir() else [])]
        facts: dict[str, object] = {}
        with filmed_stage(source, out, course, left) as stage_of_film:
            described = stage_of_film
            if ball:
                stage, facts = stage_of_balls(source, ball, ball_pictures or [], angle, left)
                described = stage, source
            elif lights is not None:
                described = stage_of_list(source, lights, left), source
            field, card = _field(source, described, camera, angle, camera_distance, known, encoding)
            if target is not None:
                card = _card(target)
            field, told = mended(field, ambient, card, mask, flare, lamp_size, bars, told_noise, no_noise)
            facts |= told
            if dry_run:
                print_facts(output, {"would write": str(out), **work_of(field, memory), **facts})
                return
            kinds = {"half": np.float16, "float": np.float32, "8bit": np.uint8}
            mesh, light_radius = stage_geometry(source)
            options = [ball, ball_pictures, lights, field_of_view, camera_distance, film, film_start, film_azimuth]
            options += [clockwise, ambient, target, encoding, mask, flare, lamp_size, bars, noise, no_noise, camera]
            seen = [source, *(each for each in (ambient, mask, lights) if each), *(ball_pictures or [])]
            with progress(output) as report:
                build_store(
                    field, out, dtype=kinds[dtype], max_memory=memory,
                    progress=lambda share: report("importing", share),
                    made_from=[[str(each) for each in options], file_facts(seen)],
                    mesh=mesh, light_radius=light_radius,
                )  # fmt: skip
        print_facts(
            output, {"written": str(out), "lights": len(field.lights), "size": list(field.shape[::-1]), **facts}
        )


def _check(
    source: Path, out: Path, ball: list[str] | None, ball_pictures: list[Path] | None, lights: Path | None,
    film: str | None, ambient: Path | None,
) -> None:  # fmt: skip
    """Refuse what cannot be, before any work."""
    if not source.exists():
        raise UnreadableFile(f"{source}: no such folder or file; check the path")
    if (ball is not None) + (lights is not None) + (film is not None) > 1:
        raise ValueError("--ball, --lights and --film: give one of them")
    if (ball or lights) and not source.is_dir():
        raise UnreadableFile(f"{source}: a file; with --ball or --lights give the folder of the pictures")
    if source.suffix.lower() in VIDEOS and film is None:
        raise ValueError(f"{source}: a film; tell its lamp's course with --film RINGS,COLUMNS,FRAMES")
    if out.exists() and not out.is_dir():
        raise OutputNotWritten(f"-o {out}: a file, not a store; choose another name")
    if ball_pictures and not ball:
        raise ValueError("--ball-pictures are for --ball; give --ball find, or its circle")
    for folder in ball_pictures or []:
        if not folder.is_dir():
            raise UnreadableFile(f"{folder}: no such folder; --ball-pictures names one")
    require_files([path for path in (lights, ambient) if path])


def _check_camera(field_of_view: float | None, distance: float | None, ball: list[str] | None) -> None:
    """Refuse a camera that is told by half, or twice."""
    if field_of_view is not None and not 0 < field_of_view < 180:
        raise ValueError(f"--field-of-view is {field_of_view}; give degrees above 0 and below 180")
    if distance is not None:
        if not 0 < distance < float("inf"):
            raise ValueError(f"--camera-distance is {distance}; give metres above 0")
        if field_of_view is None:
            raise ValueError("--camera-distance tells no camera by itself; give --field-of-view too")
        if ball and all("=" in word for word in ball):
            raise ValueError("--camera-distance: balls in metres tell it already; leave one of both out")
    elif field_of_view is not None and not ball:
        raise ValueError("--field-of-view tells no camera by itself; give --camera-distance too")


def _noise(text: str | None, unknown: bool) -> Noise | None:
    """The noise of --noise."""
    from relume.lightstage.field.field import Noise

    if text is None:
        return None
    if unknown:
        raise ValueError("--noise and --no-noise: give one of them")
    try:
        constant, slope = (float(word) for word in text.split(","))
        return Noise(constant, slope)
    except ValueError:
        raise ValueError(
            f'--noise: "{text}" is no variance; write CONSTANT,SLOPE, two numbers of 0 or more, like 1e-6,2e-4'
        ) from None


def _field(
    source: Path,
    described: tuple[Stage, Path] | None,
    camera: str | None,
    field_of_view: float | None,
    distance: float | None,
    known: Collection[Path],
    encoding: str | None,
) -> tuple[ReflectanceField, TargetCard | None]:
    """The field as it was taken, and the card that its stage file tells of.

    described : the stage and its pictures' place where options tell them; None where the source does
    known : files that are meant to be of no light
    """
    from relume.lightstage.acquire import read_stage as reading
    from relume.lightstage.acquire.store import is_store

    if described is None and is_store(source):
        if encoding is not None:
            raise ValueError(f"--encoding: {source} is a store, whose values are linear; leave --encoding out")
        if field_of_view is not None:
            raise ValueError(f"--field-of-view: {source} is a store, which keeps its camera; leave --field-of-view out")
        return reading.read_stage(source, camera), None
    stage, place = reading.described(source) if described is None else described
    if encoding is not None:
        word = encoding if encoding in ("srgb", "linear") else str(Path(encoding).resolve())
        stage = replace(stage, encoding=word)
    if stage.target is not None and len(stage.lights[0].files) > 1:
        raise ValueError(
            f'{place}: its "target" is of one camera\'s pictures, and it has {", ".join(stage.lights[0].files)}; take '
            "it out, and give --target with each import"
        )
    if field_of_view is not None and distance is not None:
        stage = camera_ahead(stage, place, field_of_view, distance)
    return reading.open_pictures(stage, place, camera, kept=0, known=known), stage.target


def _card(text: str) -> TargetCard:
    """The card of --target."""
    from relume.lightstage.acquire.stage_file import TargetCard

    place, equals, reflectance = text.partition("=")
    try:
        left, top, width, height = (int(word) for word in place.split(","))
        share = float(reflectance)
        if not equals or min(left, top) < 0 or min(width, height) < 1 or not 0 < share <= 1:
            raise ValueError
    except ValueError:
        raise ValueError(
            f'--target: "{text}" is no card; write LEFT,TOP,WIDTH,HEIGHT=REFLECTANCE, like 40,60,80,80=0.9'
        ) from None
    return TargetCard((left, top, width, height), share)
