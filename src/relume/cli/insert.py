"""`relume insert`: a shot file, or a plate, a ball and an object in; a composite out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

import relume as rl
from relume.cli.arguments import Accept, ClusterWord, DryRun, Threads, require_files
from relume.cli.console import OutputOptions, finish, force, print_facts, progress, spread, warnings_as_doubts
from relume.cli.option_types import Seconds, TimesFromNames, numbers
from relume.cli.stage_lines import FarmLines

SHOT_FILE = "shot.toml"
CHUNK = 4
"""Frames a task of a job for a render farm."""


@Parameter(name="*")
@dataclass(frozen=True)
class NewShot:
    """A shot without a file: it is written to shot.toml in the folder."""

    plate: Annotated[
        list[Path] | None,
        Parameter(help="The photograph that receives the objects, or its bracket.", negative="", consume_multiple=True),
    ] = None
    ball: Annotated[
        list[Path] | None,
        Parameter(
            help="A bracket of a mirrored ball where the objects shall stand, by the plate's camera from the plate's "
            "place; every folder is a further view.",
            negative="",
            consume_multiple=True,
        ),
    ] = None
    object: Annotated[
        list[Path] | None,
        Parameter(help="Meshes to stand in the ball's place, side by side.", negative="", consume_multiple=True),
    ] = None
    radius: Annotated[
        float | None, Parameter(validator=Number(gt=0), help="The ball's radius in metres; 0.05 unless given.")
    ] = None
    foot: Annotated[
        tuple[float, float] | None,
        numbers("X,Y", like="750,812", help="Where a stand under the ball meets the table, pixels of the plate."),
    ] = None
    rim: Annotated[
        tuple[float, float, float] | None,
        numbers(
            "X,Y,RADIUS", like="750,549,70",
            help="Where the plate would show the ball, pixels, where only crops of it exist.",
        ),
    ] = None  # fmt: skip
    light: Annotated[
        Path | None,
        Parameter(
            help="A finished map as light. With it --ball is one photograph that shows where the camera stood, or is "
            "left out."
        ),
    ] = None
    surface_reflectance: Annotated[
        float | None,
        Parameter(
            validator=Number(gt=0, lte=1),
            help="Share of light that the surface under the objects gives back (white paper 0.8, light wood 0.4, "
            "asphalt 0.1), where no exposure says how bright the light is.",
        ),
    ] = None
    times: Annotated[
        Seconds | None,
        Parameter(
            help="Exposure times: of the ball's photographs, as they are given, a folder's by name, 9 before 10; or of "
            "the plate's and then the ball's."
        ),
    ] = None
    times_from_names: TimesFromNames = False
    force: Annotated[bool, Parameter(negative="", help="Replace another shot.toml, or with --job another job.")] = False

    def given(self) -> list[str]:
        """The options that were."""
        names = [field.name for field in fields(self) if field.name != "force"]
        return [f"--{name.replace('_', '-')}" for name in names if getattr(self, name) not in (None, False)]

    def shot(self, path: Path | None) -> rl.Shot:
        """The shot, written to its file unless that is None."""
        return rl.Shot.new(
            path, plate=self.plate or [], balls=self.ball or [], objects=self.object or [], light=self.light,
            radius=self.radius, foot=self.foot, rim=self.rim, times=self.times, times_from_names=self.times_from_names,
            surface_reflectance=self.surface_reflectance, force=self.force,
        )  # fmt: skip


@Parameter(name="*")
@dataclass(frozen=True)
class FarmOptions:
    """Parts of a job, for many processes and machines."""

    frames: Annotated[
        str | None,
        Parameter(
            help="Of the shot's [sequence] these frames alone, as 3,5-8 or 1-100x2; the movie and the report, which "
            "all share, are not written."
        ),
    ] = None
    prepare: Annotated[
        bool,
        Parameter(
            negative="",
            help="Measure light, camera and reflectance, keep them in the folder, and render nothing. Commands "
            "with --frames that start afterwards, many at once, do none of it again.",
        ),
    ] = False
    assemble: Annotated[
        bool,
        Parameter(
            negative="",
            help="Make no frame, and write the movie and the report of those that are there; exit code 4 where one is "
            "missing.",
        ),
    ] = False
    job: Annotated[
        Path | None,
        Parameter(
            help="Do nothing now, and write a folder from which render farms do it: a template of Open Job Description "
            "(OpenJD), lists of commands for Slurm, GNU parallel, OpenCue and Deadline, and a README.md. Without -o "
            "the frames go to JOB/out."
        ),
    ] = None
    chunk: Annotated[
        int | None, Parameter(validator=Number(gte=1), help=f"With --job: frames a task, {CHUNK} unless given.")
    ] = None
    cluster: ClusterWord = None
    progress: Annotated[
        Literal["openjd"] | None,
        Parameter(help="Print progress for a farm on standard output: openjd_progress and openjd_status lines."),
    ] = None

    def check(self, output: OutputOptions, others: dict[str, object]) -> None:
        """Refuse options that contradict one another.

        others : options of other kinds of work, which go with none of these
        """
        parts = {"--prepare": self.prepare, "--assemble": self.assemble, "--job": self.job is not None}
        given = [name for name, value in (parts | others).items() if value]
        if len(given) > 1 and given[0] in parts:
            raise ValueError(f"{given[0]} and {given[1]} are different jobs; give one of them")
        if self.frames is not None and given and given[0] not in ("--assemble", "--job"):
            raise ValueError(f"--frames makes frames, and {given[0]} does not; leave one of them out")
        if self.cluster is not None and given:
            raise ValueError(f"--cluster renders, and {given[0]} does not; leave one of them out")
        if self.chunk is not None and self.job is None:
            raise ValueError("--chunk is for --job; leave it out")
        if self.progress is not None and output.json:
            raise ValueError("--progress and --json both write to standard output; give one of them")

    @contextmanager
    def watching(self, output: OutputOptions) -> Iterator[Callable[[str, float], None]]:
        """A callback for the stages of a job, as the other commands have it, or for a farm."""
        if self.progress is None:
            with progress(output) as report:
                yield report
        else:
            yield FarmLines(partial(print, flush=True))

    @contextmanager
    def failing(self, output: OutputOptions) -> Iterator[None]:
        """Say to a farm why the block failed."""
        try:
            yield
        except Exception as error:
            if self.progress is not None and not output.json:
                print(f"openjd_fail: {' '.join(rl.errors.printable(str(error)).split())}", flush=True)
            raise


def insert(
    shot: Annotated[Path | None, Parameter(help="The shot file, .toml.")] = None,
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(alias="-o", help="The folder for composite.exr, composite.png, report.html and the rest."),
    ] = None,
    new: NewShot = NewShot(),
    farm: FarmOptions = FarmOptions(),
    samples: Annotated[
        int | None, Parameter(validator=Number(gte=2), help="Rays a pixel, instead of the shot file's.")
    ] = None,
    seed: Annotated[
        int | None, Parameter(validator=Number(gte=0), help="The renderer's seed, instead of the shot file's.")
    ] = None,
    noise: Annotated[
        float | None,
        Parameter(validator=Number(gt=0), help="Stop once the expected error is below this share, like 0.01."),
    ] = None,
    to: Annotated[
        Literal["blender", "usd", "mitsuba"] | None,
        Parameter(help="Export the shot for this program instead of rendering it: its files go to the folder."),
    ] = None,
    restart: Annotated[bool, Parameter(negative="", help="Discard the saved state of an interrupted render.")] = False,
    preview: Annotated[
        bool,
        Parameter(
            negative="",
            help="A quick look with few rays over a small copy of the plate: preview.png. The first takes as long "
            "as finding the light, which the job itself then need not do; the next takes a few seconds.",
        ),
    ] = False,
    threads: Threads = None,
    accept: Accept = False,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Insert the objects of a shot into its photograph, lit by the light photographed there.

    The shot is a file, or --plate, --ball (or --light) and --object, of which shot.toml is written into the folder.
    Stages are kept in the output folder: a second run redoes only what changed, and an interrupted render is resumed.
    A shot with a [sequence] is made frame by frame, by as many processes as are given the same folder. A result that
    is wrong rather than a little worse is written all the same, with exit code 4.
    """
    with farm.failing(output), warnings_as_doubts(output) as doubts:
        # The shot: a file, or one that is written here.
        if shot is None and not new.given():
            raise ValueError("no shot; give a shot file, or --plate, --ball (or --light) and --object")
        if shot is not None and new.given():
            raise ValueError(f"{new.given()[0]} and the shot file {shot} both describe the shot; give one of them")
        if shot is not None and new.force and farm.job is None:
            raise ValueError(f"--force replaces a shot.toml that is written, and {shot} is given; leave one out")
        farm.check(output, {"--to": to, "--preview": preview, "--dry-run": dry_run})
        if farm.job is not None:
            settings = rl.report.JobSettings(samples, seed, noise, threads, accept)
            _job(shot, out, farm, settings, output, force=new.force)
            finish(output, doubts, accept=True)
            return
        if out is None:
            raise ValueError("no -o; give the folder for the pictures")
        read = rl.read_shot(shot) if shot is not None else new.shot(None if dry_run else out / SHOT_FILE)
        table = read.with_render(samples=samples, seed=seed, noise=noise)
        # The job.
        if dry_run:
            found = _dry_run(table, out, output)
        elif preview:
            if to is not None or table.sequence is not None:
                other = "--to" if to is not None else "the shot's [sequence]"
                raise ValueError(f"--preview shows one picture, and {other} asks for more; leave one of them out")
            found = _preview(table, out, output, threads)
        elif to is not None:
            with progress(output) as report:
                prepared = rl.prepare_shot(table, out, progress=report)
            made = rl.export_shot(prepared, out, to)
            lacking = {"not held": list(made.not_held)} if output.json else {}
            print_facts(output, {"written": str(made.main), **lacking})
            found = ()
        elif farm.prepare:
            found = _prepare(table, out, output, farm)
        elif table.sequence is not None or farm.frames is not None or farm.assemble:
            found = _sequence(table, out, output, threads, restart, farm)
        else:
            found = inserted(table, out, output, threads, restart, farm)
        # What of it to doubt.
        # The report holds what the job itself doubts, not what was said before and after it.
        bare = dry_run or preview or farm.prepare or farm.frames is not None or to is not None
        page = None if bare or doubts else out / "report.html"
        finish(output, [*doubts, *found], accept=accept or dry_run or preview, rest=page)


def _job(
    shot: Path | None, out: Path | None, farm: FarmOptions, settings: rl.report.JobSettings, output: OutputOptions,
    force: bool,
) -> None:  # fmt: skip
    """A folder for a render farm instead of the pictures."""
    if shot is None or farm.job is None:
        raise ValueError("--job needs a shot file; write one with --plate, --object and -o, without --job")
    made = rl.report.write_job(
        shot, farm.job, out=out, frames=farm.frames, chunk=farm.chunk or CHUNK, settings=settings, force=force
    )
    print_facts(output, made.facts)


def _dry_run(shot: rl.Shot, out: Path, output: OutputOptions) -> Sequence[rl.errors.Doubt]:
    """What the photographs show, in seconds: frames and times, the board, the balls."""
    # Of a sequence with plates the frames name the photographs, which are checked frame by frame.
    plates = [] if shot.sequence is not None and shot.sequence.plates is not None else shot.plate.photographs
    require_files([*shot.files(plates), *(shot.folder / name for name in shot.named_files())])
    with progress(output) as report:
        checked = rl.report.check_shot(shot, progress=report)
    print_facts(output, {"would write": str(out), **checked.facts})
    return checked.doubts


def _preview(shot: rl.Shot, out: Path, output: OutputOptions, threads: int | None) -> Sequence[rl.errors.Doubt]:
    """A quick look at what the whole job would make."""
    with progress(output) as report:
        result = rl.insert(shot, out, threads=threads, progress=report, preview=True)
    print_facts(
        output,
        {
            "picture": str(out / "preview.png"),
            "radiance": str(out / "preview.exr"),
            "pixels": f"{result.camera.width} × {result.camera.height}",
            "seconds": round(sum(result.seconds.values()), 1),
        },
    )
    return result.doubts


def _prepare(shot: rl.Shot, out: Path, output: OutputOptions, farm: FarmOptions) -> Sequence[rl.errors.Doubt]:
    """Everything but the frames."""
    first = None if shot.sequence is None else shot.sequence.frames[0]
    with farm.watching(output) as report:
        prepared = rl.prepare_shot(shot, out, frame=first, progress=report)
    print_facts(
        output, {"prepared": str(out / "stages"), "camera": [round(float(v), 4) for v in prepared.camera.position]}
    )
    return ()


def _sequence(
    shot: rl.Shot, out: Path, output: OutputOptions, threads: int | None, restart: bool, farm: FarmOptions
) -> Sequence[rl.errors.Doubt]:
    """Make every frame that is not there yet, or those that are asked for."""
    with spread(farm.cluster, output, farm.watching) as (workers, report):
        made = rl.insert_frames(
            shot, out, frames=farm.frames, assemble=farm.assemble, threads=threads, progress=report, restart=restart,
            force=force, finished=rl.write_report, cluster=workers,
        )  # fmt: skip
    whole = farm.frames is None or farm.assemble
    if whole:
        rl.write_report(made, out)
    movie = str(made.movie) if made.movie is not None else "none"
    print_facts(
        output,
        {
            "frames": len(made.frames),
            "kept from before": sum(frame.kept for frame in made.frames),
            **({"movie": movie, "report": str(out / "report.html")} if whole else {}),
            "seconds": round(sum(frame.seconds for frame in made.frames), 1),
        },
    )
    return made.doubts


def inserted(
    shot: rl.Shot,
    out: Path,
    output: OutputOptions,
    threads: int | None,
    restart: bool = False,
    farm: FarmOptions = FarmOptions(),
) -> Sequence[rl.errors.Doubt]:
    """Insert the objects, write the report and print where everything is; returns what to doubt."""
    with spread(farm.cluster, output, farm.watching, tasks=False) as (workers, report):
        result = rl.insert(
            shot, out, threads=threads, progress=report, restart=restart, force=force, cluster=workers
        )  # fmt: skip
        report("report", 0.0)
        rl.write_report(result, out)
        report("report", 1.0)
    recovered = result.place.recovered
    surfaces = () if recovered is None else recovered.surfaces
    print_facts(
        output,
        {
            "picture": str(out / "composite.png"),
            "radiance": str(out / "composite.exr"),
            "layers": str(out / "layers.exr"),
            "light": str(out / "light.exr"),
            "report": str(out / "report.html"),
            "camera": [round(float(v), 4) for v in result.camera.position],
            "reflectance": [[round(v, 4) for v in each.reflectance] for each in surfaces if each.reflectance],
            "rays a pixel": result.change.samples,
            "seconds": round(sum(result.seconds.values()), 1),
            "kept from before": list(result.kept),
            **({"notes": [each.words for each in result.doubts]} if output.json else {}),
        },
    )
    return result.doubts
