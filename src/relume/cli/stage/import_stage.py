"""`relume stage import`: pictures under one light at a time in, a calibrated store that is quick to relight out."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import ClusterWord, DryRun
from relume.cli.console import OutputOptions, print_facts, spread, warnings_as_notes
from relume.cli.option_types import numbers
from relume.cli.stage.options import MEMORY, Camera, MaxMemory, place, rounded, work_facts

Circle = tuple[float, float, float]


@Parameter(name="*")
@dataclass(frozen=True)
class FilmOptions:
    """How the lamp of a filmed rotating arm went."""

    film: Annotated[
        tuple[int, int, float] | tuple[int, int] | None,
        numbers(
            "RINGS,COLUMNS[,FRAMES]",
            like="32,64,72",
            above=0,
            help="The course of a filmed lamp on a rotating arm: rings from top to bottom, lights a ring that are "
            "kept, and frames a turn. Without FRAMES, rate, start and rings are found from --ball in the film.",
        ),
    ] = None
    strobes: Annotated[
        tuple[int, int] | None,
        numbers(
            "LAMPS,COLUMNS",
            like="30,64",
            above=0,
            help="A film, or numbered photographs, of an arm of strobes that turns once while its lamps flash in "
            "sequence from the top, a frame a flash (Light Stage 2): lamps on the arm, and sequences a turn.",
        ),
    ] = None
    stepped: Annotated[
        bool, Parameter(negative="", help="The arm of --strobes stands still during a sequence of flashes.")
    ] = False
    film_start: Annotated[float, Parameter(help="The film's frame at which the lamp starts.")] = 0.0
    film_azimuth: Annotated[
        float, Parameter(allow_leading_hyphen=True, help="Where each ring starts, degrees from +Z towards +X.")
    ] = 0.0
    clockwise: Annotated[bool, Parameter(negative="", help="The film's lamp turns from +Z towards −X.")] = False

    def course(self) -> rl.lightstage.FilmCourse | rl.lightstage.StrobeArm | None:
        """The same as a setting of the library."""
        azimuth = radians(self.film_azimuth)
        if self.strobes is not None:
            if self.film is not None:
                raise ValueError("--film and --strobes: give one of them")
            if self.film_start != int(self.film_start):
                raise ValueError(f"--film-start is {self.film_start}; with --strobes give a whole frame")
            drift = 0.0 if self.stepped else 1.0
            return rl.lightstage.StrobeArm(*self.strobes, int(self.film_start), azimuth, self.clockwise, drift)
        if self.film is None:
            return None
        rings, columns, *frames = self.film
        turn = frames[0] if frames else None
        return rl.lightstage.FilmCourse(int(rings), int(columns), turn, self.film_start, azimuth, self.clockwise)


@Parameter(name="*")
@dataclass(frozen=True)
class CorrectionOptions:
    """What is corrected in the pictures."""

    ambient: Annotated[
        Path | None, Parameter(help="A picture with all lights off, which is subtracted from every other.")
    ] = None
    target: Annotated[
        tuple[tuple[int, int, int, int], float] | None,
        numbers(
            "LEFT,TOP,WIDTH,HEIGHT=REFLECTANCE",
            like="40,60,80,80=0.9",
            help="A white or grey card in the pictures: every light's colour and intensity are measured on it and "
            "divided out; that of stage.json unless given.",
        ),
    ] = None
    board: Annotated[
        Path | None,
        Parameter(
            help="A folder with a picture of a white board in the subject's place under each light, in the same "
            "order: how unevenly each light shines is measured on it and divided out."
        ),
    ] = None
    near_fall_off: Annotated[
        bool,
        Parameter(
            negative="",
            help="Divide out the fall-off of near lamps over the subject; needs their places, in stage.json or by "
            "balls in metres, and a camera.",
        ),
    ] = False
    mask: Annotated[
        Path | None,
        Parameter(
            help="White where samples are invalid: one picture, which leaves those pixels black, or a folder with one "
            "a light, whose samples are filled from neighbouring lights."
        ),
    ] = None
    flare: Annotated[
        bool, Parameter(negative="", help="Drop and fill lights that shine into the lens, and their flare.")
    ] = False
    lamp_size: Annotated[float, Parameter(help="Apparent diameter of the lamps, degrees, for --flare.")] = 2.0
    bars: Annotated[bool, Parameter(negative="", help="Drop and fill the shadow of the stage's own bar.")] = False
    noise: Annotated[
        tuple[float, float] | None,
        numbers(
            "CONSTANT,SLOPE",
            like="1e-6,2e-4",
            help="Variance of the pictures' values, CONSTANT + SLOPE times the value; estimated from the pictures "
            "unless given.",
        ),
    ] = None
    no_noise: Annotated[bool, Parameter(negative="", help="Leave the noise unknown.")] = False

    def corrections(self) -> rl.lightstage.Corrections:
        """The same as a setting of the library."""
        if self.noise is not None and self.no_noise:
            raise ValueError("--noise and --no-noise: give one of them")
        return rl.lightstage.Corrections(
            ambient=self.ambient,
            target=None if self.target is None else rl.lightstage.TargetCard(*self.target),
            board=self.board,
            near_fall_off=self.near_fall_off,
            mask=self.mask,
            flare=self.flare,
            lamp_diameter=radians(self.lamp_size),
            bars=self.bars,
            noise=None if self.noise is None else rl.lightstage.Noise(*self.noise),
            estimate_noise=not self.no_noise,
        )


Source = Annotated[
    Path | str,
    Parameter(
        converter=place,
        n_tokens=1,
        help="A folder with stage.json or an .lp, such a file, a folder of pictures, or a film of a stage.",
    ),
]
Store = Annotated[
    Path | str,
    Parameter(
        alias="-o",
        converter=place,
        n_tokens=1,
        help="The store to write, like cat.zarr or s3://bucket/cat.zarr; an incomplete store is resumed.",
    ),
]


def import_stage(
    source: Source,
    /,
    *,
    out: Store,
    ball: Annotated[
        list[tuple[Circle, float] | Circle | Literal["find"] | Path] | None,
        numbers(
            "X,Y,RADIUS[=METRES]",
            like="1510,980,64",
            words=("find",),
            help="Find the lights in a mirrored or matte ball: its circle in pixels, a picture that is white on "
            "it, or find, which seeks it; again for each ball, also find. Balls with their radii in metres and "
            "--field-of-view give places, not only directions.",
        ),
    ] = None,
    ball_pictures: Annotated[
        list[Path] | None,
        Parameter(
            negative="",
            help="A folder with pictures of the ball under the same lights in the same order, where it is not in the "
            "subject's own, matched by name or else by order; again for each ball.",
        ),
    ] = None,
    ball_radius: Annotated[
        list[float] | None,
        Parameter(
            negative="",
            help="The ball's own radius in metres, where --ball does not say it; again for each, sought ones from left "
            "to right.",
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
            help="From the camera to the subject, metres, where neither stage.json nor balls in metres give it: with "
            "--field-of-view the camera is known and looks at the subject along -Z."
        ),
    ] = None,
    film: FilmOptions = FilmOptions(),
    corrections: CorrectionOptions = CorrectionOptions(),
    encoding: Annotated[
        str | None,
        Parameter(
            help="Of photographs: srgb, linear, or a response that `relume merge` recovered (.json); as stage.json "
            "says, else srgb."
        ),
    ] = None,
    dtype: Annotated[
        Literal["half", "float", "8bit"], Parameter(help="How values are kept; 8bit with a scale for each picture.")
    ] = "half",
    camera: Camera = None,
    max_memory: MaxMemory = MEMORY,
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Import a light stage: find its lights, calibrate its pictures, fill invalid samples, keep it in a store.

    A store is quick to relight, whatever its size. Overexposed samples of photographs are dropped and filled from
    neighbouring lights.
    """
    with warnings_as_notes(output):
        # What is asked for.
        settings = rl.lightstage.ImportSettings(
            balls=tuple(_ball(each) for each in ball or ()),
            ball_pictures=tuple(ball_pictures or ()),
            ball_radii=tuple(ball_radius or ()),
            lights=lights,
            film=film.course(),
            camera=camera,
            field_of_view=None if field_of_view is None else radians(field_of_view),
            camera_distance=camera_distance,
            encoding=encoding,
            corrections=corrections.corrections(),
            dtype=dtype,
            memory=max_memory,
        )
        # The import, or what it would find and take.
        with spread(None if dry_run else cluster, output) as (workers, report):
            done = rl.lightstage.import_stage(
                source,
                out,
                settings,
                dry_run=dry_run,
                cluster=workers,
                progress=lambda share: report("importing", share),
            )
        # What was found.
        first: dict[str, object] = {"would write": str(out)} if dry_run else {"written": str(out)}
        work = work_facts(done.work) if done.work else {"lights": done.lights, "size": list(done.shape[::-1])}
        print_facts(output, {**first, **work, **_facts(done)})


def _ball(given: Any) -> rl.lightstage.BallCircle | Path | Literal["find"]:
    """A ball of --ball."""
    if given == "find" or isinstance(given, Path):
        return given
    (x, y, radius), metres = given if len(given) == 2 else (given, None)
    return rl.lightstage.BallCircle(x, y, radius, metres)


def _facts(done: rl.lightstage.Imported) -> dict[str, object]:
    """What was found, as the command prints it."""
    import numpy as np

    facts: dict[str, object] = {}
    if done.film_frames is not None:
        facts["frames"] = done.film_frames
    if done.balls is not None:
        facts["balls"] = [[round(value, 2) for value in circle] for circle in done.balls.circles]
        if any(done.balls.matte):
            facts["balls are"] = ["matte" if matte else "mirrored" for matte in done.balls.matte]
        if done.balls.disagreement:
            apart = np.degrees(done.balls.disagreement)
            facts["balls differ by, degrees"] = [round(float(angle), 2) for angle in apart]
        if done.balls.ray_miss is not None:
            facts["rays meet within, metres"] = float(f"{done.balls.ray_miss:.3g}")
    if done.target is not None and done.calibration is not None:
        facts["target"] = f"{','.join(map(str, done.target.rectangle))}={done.target.reflectance:g}"
        facts["irradiance, median"] = rounded(np.median(done.calibration.irradiances, axis=0))
        facts["lights not on the target"] = int((~done.calibration.measured).sum())
    if done.field is not None and done.field.noise is not None:
        facts["noise"] = rounded((done.field.noise.constant, done.field.noise.slope), 3)
    return facts
