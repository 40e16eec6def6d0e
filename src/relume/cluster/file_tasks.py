"""`make_each`: many files, each made from its own inputs by itself, in this process or by the workers of a cluster."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.cluster.claims import held
from relume.cluster.records import key_of, record, recorded
from relume.cluster.tasks import run_tasks
from relume.errors import GatheredDoubts, Incomplete, UnreadableFile, warn

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class FileTask:
    """A file to be made from others.

    name : for people
    sources : files that it depends on; where one changes it is made again
    targets : what is written; mostly one file
    value : what else it depends on, pickled with the task
    beside : files that were found beside the sources and are read with them, such as lists of exposures
    """

    name: str
    sources: tuple[Path, ...]
    targets: tuple[Path, ...]
    value: Any
    beside: tuple[Path, ...] = ()
    settings_key: str = ""


@dataclass(frozen=True)
class FileMade:
    """A file that was made from others.

    target : the file, the first where there are several
    kept : whether an earlier run had made it
    facts : what is known of it, by name
    """

    target: Path
    kept: bool
    facts: dict[str, Any]


def make_each(
    make: Callable[[FileTask], dict[str, Any]], tasks: Sequence[FileTask], out: Path, *, step: str,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None, memory: int | None = None,
    progress: Progress = lambda step, share: None, failed: Sequence[tuple[str, str]] = (),
    dry_run: bool = False,
) -> tuple[FileMade, ...]:  # fmt: skip
    """Make every file that is not there as an earlier run with the same sources and settings left it.

    make : of a module; writes the targets of a task, whole or not at all, and returns facts of JSON
    out : folder of all targets, absolute; held against a second run
    step : called by `progress` with the share of files that are settled
    memory : bytes that a task takes, asked of workers alone
    failed : (name, why) of what failed before it could become a task
    dry_run : check names, and make nothing

    What is warned of is warned of again where a file is kept, with its name. Raises Incomplete, with the others
    made, where some failed; ValueError for two files of one name and for an output that is an input; OutputNotWritten,
    ClusterUnusable.
    """
    refuse_clashes(tasks)
    if dry_run:
        return tuple(FileMade(task.targets[0], False, {}) for task in tasks)
    keys: dict[int, str] = {}  # most tasks share one value
    for task in tasks:
        if id(task.value) not in keys:
            keys[id(task.value)] = hashlib.sha256(pickle.dumps((make.__qualname__, task.value))).hexdigest()
    given = [(make, replace(task, settings_key=keys[id(task.value)])) for task in tasks]
    left_out, results = list(failed), []
    with held(out) as lock:
        progress(step, 0.0)
        try:
            results += run_tasks(
                _made, given, names=[task.name for task in tasks], cluster=cluster,
                memory=None if cluster is None else memory, paths=[lock, *(tasks[0].sources[:1] if tasks else ())],
                progress=lambda done, failed, to_go, left: progress(step, (done + failed) / max(1, len(tasks))),
            )  # fmt: skip
        except Incomplete as error:
            left_out += error.failed
            results += error.results
    if left_out:
        raise Incomplete(left_out, [*results, *(None for _ in failed)])
    return tuple(results)


def _made(given: tuple[Callable[[FileTask], dict[str, Any]], FileTask]) -> FileMade:
    """Make the files of one task, unless that was done."""
    make, task = given
    for source in task.sources:
        if not source.is_file():
            raise UnreadableFile(f"{source}: no such file; check the path")
    beside = [path for path in task.beside if path.is_file()]
    key = key_of([*task.sources, *beside], task.settings_key, [target.name for target in task.targets])
    found = [recorded(target, key) for target in task.targets]
    kept = all(found)
    if not kept:
        with GatheredDoubts() as gathered:
            facts = json.loads(json.dumps(make(task), default=str))
        found = [{"facts": facts, "doubts": [[each.line, each.effect] for each in gathered.doubts]}]
        for target in task.targets:
            record(target, key, found[0])
    for line, effect in found[0]["doubts"]:
        warn(with_name(task.name, line), effect)
    return FileMade(task.targets[0], kept, found[0]["facts"])


def with_name(name: str, line: str) -> str:
    """A line about one of many files, with its name in front."""
    return line if line.startswith(f"{name}:") else f"{name}: {line}"


def refuse_clashes(tasks: Sequence[FileTask]) -> None:
    """Refuse two files of one name, also where case does not count, and an output that is an input."""
    sources = {source.resolve() for task in tasks for source in task.sources}
    of_target: dict[str, FileTask] = {}
    for task in tasks:
        for target in task.targets:
            if target.resolve() in sources:
                raise ValueError(f"{target}: the input itself; choose another folder, so that the original is kept")
            other = of_target.setdefault(str(target).casefold(), task)
            if other is not task:
                raise ValueError(
                    f"{other.sources[0]} and {task.sources[0]} would both be written as {target.name}; rename one, "
                    "or give their folders one by one"
                )
