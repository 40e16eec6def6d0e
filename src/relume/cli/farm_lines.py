"""Options and lines for render farms: which frames a command makes, and how far it is.

Lines on standard output that begin with `openjd_progress:`, `openjd_status:` and `openjd_fail:` are taken by a farm
that follows Open Job Description ("How Jobs Are Run", stdout messages).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

import relume as rl
from relume.cli.console import OutputOptions, progress

CHUNK = 4


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
            help="Measure light, camera and reflectance and keep them in the folder, and render nothing: commands with "
            "--frames, started afterwards at the same time, do none of it again.",
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
            yield FarmLines(_print)

    @contextmanager
    def failing(self) -> Iterator[None]:
        """Say to a farm why the block failed."""
        try:
            yield
        except Exception as error:
            if self.progress is not None:
                _print(f"openjd_fail: {' '.join(rl.errors.printable(str(error)).split())}")
            raise


class FarmLines:
    """How far a job is: of all frames where there are several, else of the render.

    say : takes a line
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._said = -1
        self._stage = ""
        self._frames = False

    def __call__(self, stage: str, share: float) -> None:
        """A stage is as far as this."""
        if stage == "frames":
            self._frames = True
        elif stage != self._stage and share < 1:
            self._stage = stage
            self._say(f"openjd_status: {stage}")
        if stage == "frames" or (stage == "render" and not self._frames):
            percent = int(100 * share)
            if percent > self._said:
                self._said = percent
                self._say(f"openjd_progress: {min(percent, 100)}")


def _print(line: str) -> None:
    print(line, flush=True)
