"""A shot's sequence as a job for a render farm: what it needs, looked up in the shot, and the folder that holds it."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath

from relume.errors import UnreadableFile, warn
from relume.export.openjd.bundle import write_bundle
from relume.export.openjd.template import Job
from relume.export.openjd.template import JobSettings as JobSettings
from relume.project.forecast import memory_for
from relume.project.insertion.frame_shots import at_frame
from relume.project.insertion.photographs import plate_size, read_photographs
from relume.project.insertion.sequence import chosen_frames, files_named_in, strings_in
from relume.project.shot_file.sequence_table import frames_as_text
from relume.project.shot_file.shot import Shot, read_shot


@dataclass(frozen=True)
class WrittenJob:
    """What `write_job` wrote.

    folder : holds template.json, lists of commands and README.md
    frames, tasks : how many
    memory : bytes that a task takes
    facts : by their names, for a person or a machine
    """

    folder: Path
    frames: int
    tasks: int
    memory: float
    facts: dict[str, object]


def write_job(
    shot: str | Path, folder: str | Path, *, out: str | Path | None = None, frames: str | Iterable[int] | None = None,
    chunk: int = 4, settings: JobSettings = JobSettings(), force: bool = False,
) -> WrittenJob:  # fmt: skip
    """Write a folder from which render farms insert a shot's frames: OpenJD template, commands and README.

    shot : the file
    out : the folder for the frames; `folder`/out unless given
    frames : these alone, as "1-9x2,12" or by their numbers
    chunk : frames a task
    settings : that all commands are given
    force : replace a job that is there

    Warns of absolute paths in the shot, which a farm cannot map. Raises RelumeError, OutputNotWritten; ValueError for
    frames that the sequence has not, and for a chunk below 1.
    Raises UnreadableFile where a file that the shot names is missing, as it would be on the farm.
    """
    shot, folder = Path(os.path.abspath(shot)), Path(folder)
    if chunk < 1:
        raise ValueError(f"chunk is {chunk}; give 1 frame a task or more")
    read = read_shot(shot)
    numbers = tuple(chosen_frames(read, frames))
    # All that would fail on the farm for want of a file fails here.
    if missing := [name for name in read.named_files() if not (read.folder / name).exists()]:
        raise UnreadableFile(f"{read.folder / missing[0]}: no such file; check the shot file {shot}")
    width, height = plate_size(read_photographs(at_frame(read, numbers[0])))
    if absolute := sorted(set(_absolute(read))):
        warn(
            f"the shot names {len(absolute)} absolute {'path' if len(absolute) == 1 else 'paths'}, which every machine "
            f"must have, and no farm maps: {', '.join(absolute)}; name files by where they are from the shot file"
        )
    where = folder / "out" if out is None else Path(out)
    job = Job(shot, Path(os.path.abspath(where)), numbers, chunk, memory_for(width * height), settings)
    folders = [read.folder / text for text in strings_in(read) if text.strip("./\\") and (read.folder / text).is_dir()]
    write_bundle(job, folder, [Path(os.path.abspath(path)) for path in [*files_named_in(read), *folders]], force)
    return WrittenJob(
        folder, len(numbers), len(job.chunks), job.memory,
        {
            "job": str(folder), "frames": frames_as_text(numbers), "tasks": len(job.chunks),
            "memory a task": f"{job.memory / 1e9:.2g} GB", "pictures": str(job.out), "how": str(folder / "README.md"),
        },
    )  # fmt: skip


def _absolute(shot: Shot) -> Iterator[str]:
    """The absolute paths that a shot names, of whatever system."""
    for text in strings_in(shot):
        if PurePosixPath(text).is_absolute() or PureWindowsPath(text).is_absolute():
            yield text
