"""One task, done once: its result, or why it failed, and what was warned of; in this process or in a Dask worker.

A worker does one task at a time, whatever number of threads Dask gave it: renderers have state of the whole process,
and a task takes the worker's share of the machine's cores, `threads`.
"""

from __future__ import annotations

import pickle
import threading
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from relume.cluster.program import program
from relume.errors import (
    ClusterUnusable,
    Interrupted,
    OutputNotWritten,
    RelumeError,
    UnreadableFile,
    doubt_of,
    printable,
)

_ONE = threading.RLock()
_SHARE: dict[str, int] = {}
SPARE = 0.8
"""The share of a worker's limit of memory from which on Dask gives it nothing more to do."""


@dataclass(frozen=True)
class Needs:
    """What a worker must be for a task: of this program, and with so many bytes for it; None asks for no memory."""

    program: str
    memory: int | None


@dataclass(frozen=True)
class Outcome:
    """What came of a task.

    failed : why there is no result, one line
    again : whether another worker might do it: not where the input is at fault
    unfit : whether the worker itself is at fault, so that the try does not count
    doubts : (line, effect) of each warning
    worker : the address of the worker; "" for this process
    """

    result: Any = None
    failed: str | None = None
    again: bool = False
    unfit: bool = False
    doubts: tuple[tuple[str, float | None], ...] = ()
    worker: str = ""


def threads() -> int | None:
    """How many threads a task in this worker may use; None outside a worker: all cores."""
    return _SHARE.get("threads")


def set_threads(count: int) -> None:
    """Give this worker's tasks so many threads."""
    _SHARE["threads"] = count


def attempt(function: Callable[[Any], Any], task: Any, needs: Needs | None = None) -> Outcome:
    """Do a task. `needs` is checked first, where it is given: in a worker."""
    worker = "" if needs is None else _address()
    if needs is not None and (fault := _unfit(needs)):
        return Outcome(failed=fault, again=True, unfit=True, worker=worker)
    with _ONE, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        try:
            result, failed, again = function(task), None, False
        except Interrupted:
            raise
        except ClusterUnusable as error:
            # This machine is not one for the task.
            return Outcome(failed=reason(error), again=True, unfit=needs is not None, worker=worker)
        except Exception as error:
            result, failed, again = None, reason(error), may_go_elsewhere(error)
        doubts = [doubt_of(each.message) for each in caught if issubclass(each.category, UserWarning)]
    return Outcome(result, failed, again, False, tuple((each.line, each.effect) for each in doubts), worker)


def attempt_packed(packed: bytes, program: str, memory: int | None) -> Outcome:
    """`attempt` of a pickled (function, task), in a worker."""
    try:
        function, task = pickle.loads(packed)
    except Exception as error:
        here = f"{reason(error)}: the worker lacks what the task is made of"
        return Outcome(failed=here, again=True, worker=_address())
    return attempt(function, task, Needs(program, memory))


def reason(error: BaseException) -> str:
    """Why a task failed, in one line."""
    if isinstance(error, MemoryError):
        return "not enough memory"
    if isinstance(error, OSError) and not isinstance(error, RelumeError):
        return printable(f"{error.filename}: {error.strerror}" if error.filename else f"{error.strerror or error}")
    text = " ".join(printable(str(error)).split())
    if isinstance(error, RelumeError | ValueError):
        return text
    trace, place = error.__traceback__, ""
    while trace is not None:
        place = f", {Path(trace.tb_frame.f_code.co_filename).name} line {trace.tb_lineno}"
        trace = trace.tb_next
    return f"a fault: {type(error).__name__}: {text}{place}"


def may_go_elsewhere(error: Exception) -> bool:
    """Whether another machine might do what failed here: it may see a file, have a disk with room, or more memory."""
    if type(error) in (UnreadableFile, OutputNotWritten):
        return True
    return not isinstance(error, RelumeError | ValueError)


def _unfit(needs: Needs) -> str:
    """What of this worker does not do for the task, or ""."""
    if program() != needs.program:
        return f"a worker runs {program()}, and this is {needs.program}; install the same relume everywhere"
    limit = _memory_limit()
    if needs.memory and limit and needs.memory > SPARE * limit:
        return too_little("a worker", needs.memory, limit)
    return ""


def too_little(name: str, memory: int, limit: int) -> str:
    """That a worker has too little memory, in a line."""
    return (
        f"a task takes {memory / 1e9:.2g} GB, and {name} may use {SPARE * limit / 1e9:.2g} of its "
        f"{limit / 1e9:.2g} GB; start workers with more (--memory-limit), or fewer on a machine"
    )


def _memory_limit() -> int:
    from distributed import get_worker

    try:
        return int(get_worker().memory_manager.memory_limit or 0)
    except ValueError:  # in no worker
        return 0


def _address() -> str:
    from distributed import get_worker

    try:
        return get_worker().address
    except ValueError:
        return ""
