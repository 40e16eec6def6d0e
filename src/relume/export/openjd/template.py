"""The job of a sequence: what its commands are, and the template by which a farm gives them.

Open Job Description, revision jobtemplate-2023-09 with the extension TASK_CHUNKING. The template is JSON, which is the
other form that the specification allows.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any

from relume.project.shot_file.sequence_table import frames_as_text

MAKER = "relume insert"
"""What the name of every template begins with: by it a folder is known as a job of ours."""
LONGEST_NAME = 120
SECONDS = 300
"""That a task should take: a farm that measures makes its chunks so."""
DAY = 86400


@dataclass(frozen=True)
class JobSettings:
    """Options of `relume insert` that all commands of a job are given; None and False are left out.

    samples, seed, noise, threads, accept : as the options of these names
    """

    samples: int | None = None
    seed: int | None = None
    noise: float | None = None
    threads: int | None = None
    accept: bool = False

    def words(self) -> list[str]:
        """The options as words of a command, but `accept`."""
        numbers = {"samples": self.samples, "seed": self.seed, "noise": self.noise, "threads": self.threads}
        return [word for name, value in numbers.items() if value is not None for word in (f"--{name}", f"{value:g}")]


@dataclass(frozen=True)
class Job:
    """A sequence as a job.

    shot, out : absolute, as this machine names them
    frames : rising
    chunk : frames a task
    memory : bytes that a task takes
    """

    shot: Path
    out: Path
    frames: tuple[int, ...]
    chunk: int
    memory: float
    settings: JobSettings = JobSettings()

    @property
    def name(self) -> str:
        """Without what a template would replace, and short enough for one."""
        plain = re.sub(r"[^\w .()+=,@/-]+", "_", f"{self.shot.parent.name}/{self.shot.name}")
        return f"{MAKER} {plain}"[:LONGEST_NAME]

    @property
    def megabytes(self) -> int:
        """Of memory, in units of 2²⁰ bytes."""
        return ceil(self.memory / 2**20)

    @property
    def chunks(self) -> tuple[str, ...]:
        """The frames of each task."""
        starts = range(0, len(self.frames), self.chunk)
        return tuple(frames_as_text(self.frames[start : start + self.chunk]) for start in starts)

    def prepare(self, shot: str, out: str) -> list[str]:
        """The words of the command that comes first. A doubt stops the job here, before the frames, unless accepted."""
        return [*self._words(shot, out), "--prepare", *self._accept()]

    def make(self, shot: str, out: str, frames: str) -> list[str]:
        """That makes frames; what is doubtful in one is said at the end."""
        return [*self._words(shot, out), "--frames", frames, "--accept"]

    def assemble(self, shot: str, out: str, frames: str) -> list[str]:
        """That comes last."""
        return [*self._words(shot, out), "--frames", frames, "--assemble", *self._accept()]

    def _words(self, shot: str, out: str) -> list[str]:
        return ["insert", shot, "-o", out, *self.settings.words()]

    def _accept(self) -> list[str]:
        return ["--accept"] if self.settings.accept else []


def template_of(job: Job) -> dict[str, Any]:
    """The job template. Shot and Out are paths, which a farm maps to its own; what the shot names lies beside it."""
    shot, out, frames = "{{Param.Shot}}", "{{Param.Out}}", "{{Param.Frames}}"
    chunks = {
        "name": "Frame",
        "type": "CHUNK[INT]",
        "range": frames,
        "chunks": {
            "defaultTaskCount": job.chunk, "targetRuntimeSeconds": SECONDS, "rangeConstraint": "NONCONTIGUOUS",
        },
    }  # fmt: skip
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": job.name,
        "description": "Inserts objects into every frame of a shot. README.md in this folder says how it is run.",
        "parameterDefinitions": _parameters(job),
        "steps": [
            _step("Prepare", job, job.prepare(shot, out)),
            _step("Frames", job, job.make(shot, out, "{{Task.Param.Frame}}"), after="Prepare", parameters=[chunks]),
            _step("Assemble", job, job.assemble(shot, out, frames), after="Frames"),
        ],
    }


def _parameters(job: Job) -> list[dict[str, Any]]:
    files = [{"label": "Shot files", "patterns": ["*.toml"]}]
    return [
        {
            "name": "Shot", "type": "PATH", "objectType": "FILE", "dataFlow": "IN",
            "description": "The shot file. What it names lies beside it.",
            "userInterface": {"control": "CHOOSE_INPUT_FILE", "label": "Shot", "fileFilters": files},
        },
        {
            "name": "Out", "type": "PATH", "objectType": "DIRECTORY", "dataFlow": "OUT", "default": "out",
            "description": "The folder for the frames, which every machine writes to.",
            "userInterface": {"control": "CHOOSE_DIRECTORY", "label": "Pictures"},
        },
        {
            "name": "Frames", "type": "STRING", "default": frames_as_text(job.frames), "minLength": 1,
            "description": "Numbers and ranges, as 1-100, 1-100:2 or 3,5-8.",
            "userInterface": {"control": "LINE_EDIT", "label": "Frames"},
        },
        {
            "name": "Relume", "type": "STRING", "default": "relume", "minLength": 1,
            "description": "The command; with its whole path where it is not on the machines' PATH.",
            "userInterface": {"control": "LINE_EDIT", "label": "relume"},
        },
    ]  # fmt: skip


def _step(
    name: str, job: Job, words: Sequence[str], after: str | None = None, parameters: Sequence[dict[str, Any]] = ()
) -> dict[str, Any]:
    """One step: a command that says how far it is, may take a day, and is asked to end before it is made to."""
    run = {
        "command": "{{Param.Relume}}",
        "args": [*words, "--progress", "openjd"],
        "timeout": DAY,
        "cancelation": {"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": 30},
    }
    amounts = [
        {"name": "amount.worker.vcpu", "min": job.settings.threads or 1},
        {"name": "amount.worker.memory", "min": job.megabytes},
    ]
    return {
        "name": name,
        **({} if after is None else {"dependencies": [{"dependsOn": after}]}),
        "hostRequirements": {"amounts": amounts},
        **({"parameterSpace": {"taskParameterDefinitions": list(parameters)}} if parameters else {}),
        "script": {"actions": {"onRun": run}},
    }
