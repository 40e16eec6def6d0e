"""What the commands say and how: one line an error, notes, JSON for machines, progress bars on a terminal only."""

from __future__ import annotations

import json
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version as _version
from typing import Annotated, Any

from cyclopts import Parameter

import relume as rl

_LONG = 96
"""Characters of a fact that a terminal shows on one line, beside its name."""


@Parameter(name="*")
@dataclass(frozen=True)
class OutputOptions:
    """How a command behaves, the same for every command."""

    json: Annotated[bool, Parameter(negative="", help="Print the result as JSON, for machines.")] = False
    verbose: Annotated[bool, Parameter(alias="-v", negative="", help="Say more; show where a fault arose.")] = False
    quiet: Annotated[bool, Parameter(alias="-q", negative="", help="Say nothing but errors.")] = False


def version() -> str:
    """relume's version."""
    return _version("relume")


def refuse(message: str, code: int, hint: str = "") -> int:
    """Print one line on standard error and return the exit code."""
    line = " ".join(rl.errors.printable(message).split())
    print(f"relume: {line}" + (f" ({hint})" if hint else ""), file=sys.stderr)
    return code


def refuse_error(error: Exception, *, verbose: bool) -> int:
    """Turn any error into one line and its exit code; with `verbose` where it arose comes before."""
    if verbose:
        traceback.print_exc()
    if isinstance(error, rl.errors.OutputNotWritten):
        return refuse(str(error), 3)
    if isinstance(error, rl.errors.DoubtfulResult):
        return refuse(str(error), 4)
    if isinstance(error, rl.errors.Interrupted):
        return refuse(str(error), error.exit_code)
    if isinstance(error, rl.errors.RelumeError | ValueError):
        return refuse(str(error), 2)
    if isinstance(error, MemoryError):
        return refuse("not enough memory; use smaller pictures or fewer at a time", 2)
    return refuse(
        f"a fault in relume itself, please report it: {type(error).__name__}: {error}", 1, "-v shows where it arose"
    )


@contextmanager
def warnings_as_notes(output: OutputOptions) -> Iterator[None]:
    """Show warnings as notes of one line."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = lambda message, *_, **__: note(output, str(message))
        yield


def force(number: int, words: str) -> None:
    """End a long render in time: by this process's own end, said in one line."""
    if words:
        print(f"relume: {words}", file=sys.stderr, flush=True)
    os._exit(128 + number)


def note(output: OutputOptions, *lines: str) -> None:
    """Lines the user should know, on standard error."""
    if not output.quiet:
        for line in lines:
            print(f"relume: note: {' '.join(rl.errors.printable(line).split())}", file=sys.stderr)


def finish(output: OutputOptions, doubts: Sequence[str], *, accept: bool = False) -> None:
    """End a command whose result is written: note its doubts; raise DoubtfulResult unless accepted."""
    if accept or len(doubts) > 1:
        note(output, *doubts)
    if not doubts or accept:
        return
    line = doubts[0] if len(doubts) == 1 else f"{len(doubts)} doubts, noted above"
    if output.quiet and len(doubts) > 1:
        line = f"{len(doubts)} doubts: {' | '.join(doubts)}"
    raise rl.errors.DoubtfulResult(f"{line} (all was written; --accept takes it as it is)")


def print_facts(output: OutputOptions, lines: Mapping[str, object], *, title: str = "") -> None:
    """Print a result: JSON for machines, else a line a fact."""
    if output.json:
        print(json.dumps(dict(lines), ensure_ascii=False, default=str))
    elif not output.quiet:
        if title:
            print(title)
        _print_lines(lines, "  ")


def _print_lines(lines: Mapping[str, object], indent: str) -> None:
    """A line a fact; numbers of several kinds under one name have lines of their own where one would be too long."""
    named = {rl.errors.printable(str(key)): value for key, value in lines.items()}
    width = max((len(key) for key in named), default=0)
    for key, value in named.items():
        text = _shown(value)
        several = isinstance(value, Mapping) and any(isinstance(v, Mapping | list | tuple) for v in value.values())
        if isinstance(value, Mapping) and several and len(text) > _LONG:
            print(f"{indent}{key}")
            _print_lines(value, indent + "  ")
        else:
            print(f"{indent}{key.ljust(width)}  {text}")


@contextmanager
def progress(output: OutputOptions) -> Iterator[Callable[[str, float], None]]:
    """A callback for the stages of a job, shown as bars on a terminal and as nothing elsewhere."""
    if output.quiet or output.json or not sys.stderr.isatty():
        yield lambda stage, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bars:
        tasks: dict[str, Any] = {}

        def report(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=1.0)
            bars.update(tasks[stage], completed=share)

        yield report


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{rl.errors.printable(str(k))} {_shown(v)}" for k, v in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(_shown(v) for v in value) or "none"
    return "none" if value is None else rl.errors.printable(str(value))
