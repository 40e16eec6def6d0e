"""`run_tasks`: a function of many tasks, in this process or by the workers of a cluster, with the same results."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from relume.cluster.attempt import attempt
from relume.cluster.connection import Cluster, connect
from relume.cluster.spreading import Spreading
from relume.cluster.tally import Tally, TaskProgress
from relume.cluster.workers import check_workers
from relume.errors import DoubtWarning, Incomplete, warn

if TYPE_CHECKING:
    from distributed import Client

Task = TypeVar("Task")
Result = TypeVar("Result")


def run_tasks(
    function: Callable[[Task], Result], tasks: Sequence[Task], *, names: Sequence[str] | None = None,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None, tries: int = 3, memory: int | None = None,
    progress: TaskProgress | None = None, paths: Sequence[str | os.PathLike[str]] = (),
) -> list[Result]:  # fmt: skip
    """The results of a function of every task, in the order of the tasks, whoever did them.

    function : of a module, and pure: it writes its own files, whole or not at all, and returns few facts; it may be
        done twice where a worker dies
    tasks : values that can be pickled; small, for what is shared lies in files
    names : of each task, for people
    cluster : None does them in this process, one after another; else as in `connect`
    tries : a task that fails is tried again, by another worker where there is one, until it was tried so often; not
        where its input is at fault, and not in this process
    memory : bytes that a task takes; workers with less are refused before anything starts
    progress : called after every task with (done, failed, to go, seconds left or None)
    paths : files and folders that every worker must see, else refused before anything starts

    Warnings of all tasks are warned of once each. Raises Incomplete after all others are done where some failed, and
    ClusterUnusable; Interrupted and KeyboardInterrupt end it.
    """
    tasks = list(tasks)
    called = [f"task {index + 1}" for index in range(len(tasks))] if names is None else list(names)
    if len(called) != len(tasks):
        raise ValueError(f"{len(called)} names for {len(tasks)} tasks; give one a task")
    if tries < 1:
        raise ValueError(f"tries is {tries}; give 1 or more")
    if cluster is None:
        tally = Tally(len(tasks), [progress] if progress else [])
        tally.say()
        for index, task in enumerate(tasks):
            tally.settle(index, attempt(function, task))
        return _results(tally, called)
    with connect(cluster) as connected:
        if memory or paths:
            seen = [Path(path).absolute() for path in paths]
            check_workers(connected.client, memory=memory, paths=seen)
        tally = Tally(len(tasks), [each for each in (progress, connected.progress) if each])
        tally.say()
        Spreading(connected.client, function, tasks, tries, memory, tally).run()
    return _results(tally, called)


def _results(tally: Tally, names: Sequence[str]) -> list[Any]:
    """The results in order; warns of what was warned of, and raises Incomplete."""
    outcomes = [tally.outcomes[index] for index in range(tally.count)]
    results = [outcome.result for outcome in outcomes]
    failed = [
        (name, outcome.failed.removeprefix(f"{name}: "))
        for name, outcome in zip(names, outcomes, strict=True)
        if outcome.failed
    ]
    # Where warnings are errors, a failure is the one to raise.
    with suppress(DoubtWarning) if failed else nullcontext():
        for line, effect in dict.fromkeys(doubt for outcome in outcomes for doubt in outcome.doubts):
            warn(line, effect)
    if failed:
        raise Incomplete(failed, results)
    return results
