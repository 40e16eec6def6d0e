"""What the commands say and how: one line an error, notes, JSON for machines, progress bars on a terminal only."""

from __future__ import annotations

import json
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import relume as rl
import relume.cluster as machines
from relume.cli.stage_lines import stage_lines

_LONG = 96
"""Characters of a fact that a terminal shows on one line, beside its name."""
SAID = 2
"""Doubts that a command says; more are not read. Those that make the result wrong are always said."""


@Parameter(name="*")
@dataclass(frozen=True)
class OutputOptions:
    """How a command behaves, the same for every command."""

    json: Annotated[bool, Parameter(negative="", help="Print the result as JSON, for machines.")] = False
    verbose: Annotated[bool, Parameter(alias="-v", negative="", help="Say more; show where a fault arose.")] = False
    quiet: Annotated[bool, Parameter(alias="-q", negative="", help="Say nothing but errors.")] = False


def version() -> str:
    """relume's version."""
    from importlib.metadata import version as of_package

    return of_package("relume")


def _shows_all_letters() -> bool:
    """Whether standard output takes every letter; where not, JSON escapes what the next program reads back."""
    return (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"


def refuse(message: str, code: int, hint: str = "") -> int:
    """Print one line on standard error and return the exit code."""
    line = " ".join(rl.errors.printable(message).split())
    print(f"relume: {line}" + (f" ({hint})" if hint else ""), file=sys.stderr)
    return code


def refuse_error(error: Exception, *, verbose: bool) -> int:
    """Turn any error into one line and its exit code; with `verbose` where a fault of relume arose comes before."""
    if isinstance(error, rl.errors.OutputNotWritten):
        return refuse(str(error), 3)
    if isinstance(error, rl.errors.DoubtfulResult | rl.errors.IncompleteSequence):
        return refuse(str(error), 4)
    if isinstance(error, rl.errors.Incomplete):
        for name, why in error.failed if len(error.failed) > 1 else ():
            refuse(f"{name}: {why}", 4)
        return refuse(str(error), 4)
    if isinstance(error, rl.errors.Interrupted):
        return refuse(str(error), error.exit_code)
    if isinstance(error, rl.errors.RelumeError):
        return refuse(str(error), 2)
    if isinstance(error, MemoryError):
        return refuse("not enough memory; use smaller pictures or fewer at a time", 2)
    if verbose:  # a ValueError may be one of another library, met by a fault of ours
        traceback.print_exc()
    if isinstance(error, ValueError):
        return refuse(str(error), 2)
    return refuse(
        f"a fault in relume itself, please report it: {type(error).__name__}: {error}", 1, "-v shows where it arose"
    )


@contextmanager
def warnings_as_notes(output: OutputOptions) -> Iterator[None]:
    """Show warnings as notes of one line; what is warned of for every frame is one note."""
    shown: set[str] = set()

    def show(message: Warning | str, *_: object, **__: object) -> None:
        if str(message) not in shown:
            shown.add(str(message))
            note(output, str(message))

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show
        yield


@contextmanager
def warnings_as_doubts(output: OutputOptions) -> Iterator[list[rl.errors.Doubt]]:
    """Gather warnings as doubts, for `finish` to rank; where the command fails they are notes before its error."""
    doubts: list[rl.errors.Doubt] = []
    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = lambda message, *_, **__: doubts.append(rl.errors.doubt_of(message))
        try:
            yield doubts
        except rl.errors.DoubtfulResult:
            raise
        except Exception:
            note(output, *(doubt.line for doubt in rl.errors.ranked(doubts)))
            raise


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


def finish(
    output: OutputOptions, doubts: Sequence[str | rl.errors.Doubt], *, accept: bool = False, rest: Path | None = None
) -> None:
    """End a command whose result is written: note the doubts that matter most; raise DoubtfulResult where one makes
    the result wrong, unless accepted.

    doubts : a text is one that makes it wrong
    rest : the report that holds the others; -v notes them all
    """
    texts = {each for each in doubts if isinstance(each, str)}
    found = rl.errors.ranked(
        each if isinstance(each, rl.errors.Doubt) else rl.errors.Doubt(each, 1.0) for each in doubts
    )
    words = {each: each.line if each.line in texts else each.words for each in found}
    wrong = [each for each in found if each.wrong]
    refused = bool(wrong) and not accept
    # Those that make it wrong are all said; of the others as many as make two.
    shown = found if output.verbose else found[: max(SAID, len(wrong))]
    if len(shown) > 1 or not refused:
        note(output, *(words[each] for each in shown))
    if hidden := len(found) - len(shown):
        what, them = ("doubt", "it") if hidden == 1 else ("doubts", "them")
        where = f"-v shows {them}" if rest is None else f"{rest} has {them}, and -v shows {them}"
        note(output, f"{hidden} lesser {what}: {where}")
    if not refused:
        return
    line = words[wrong[0]]
    if len(wrong) > 1:
        every = f": {' | '.join(words[each] for each in wrong)}" if output.quiet else ", noted above"
        line = f"{len(wrong)} doubts{every}"
    raise rl.errors.DoubtfulResult(f"{line} (all was written; --accept takes it as it is)")


def finish_each(
    output: OutputOptions, made: Sequence[Any], out: Path, what: str, doubts: list[rl.errors.Doubt], *,
    dry_run: bool = False, accept: bool = False,
) -> None:  # fmt: skip
    """End a command that makes files each by itself: how many, and what is doubtful of which.

    made : as `rl.light.convert_each` returns them
    what : they are made from, in the plural
    """
    if dry_run:
        print_facts(output, {"would write": len(made), "files": [str(each.target) for each in made]})
        finish(output, doubts, accept=True)
        return
    kept = sum(each.kept for each in made)
    print_facts(output, {"written": str(out), what: len(made), "kept from before": kept})
    wrong = [f"{each.target.name}: {line}" for each in made for line in each.facts.get("doubts", ())]
    finish(output, [*doubts, *wrong], accept=accept)


def print_facts(output: OutputOptions, lines: Mapping[str, object], *, title: str = "") -> None:
    """Print a result: JSON for machines, else a line a fact."""
    if output.json:
        print(json.dumps(dict(lines), ensure_ascii=not _shows_all_letters(), default=str))
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
    """A callback for the stages of a job: bars on a terminal, lines in a log; with -v of every stage, anywhere."""
    if output.quiet or (output.json and not output.verbose):
        yield lambda stage, share: None
        return
    if output.verbose or not sys.stderr.isatty():
        with stage_lines(every=output.verbose) as lines:
            yield lines
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bars:
        tasks: dict[str, Any] = {}

        def report(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=1.0)
            bars.update(tasks[stage], completed=share)

        yield report


@contextmanager
def spread(
    word: str | None, output: OutputOptions, plain: Callable[..., Any] = progress, *, tasks: bool = True
) -> Iterator[tuple[machines.Cluster | None, Callable[[str, float], None]]]:
    """What --cluster asks for, connected, and a callback for stages; without it None, and the callback of `plain`.

    tasks : whether on a cluster one bar counts the tasks of all workers, and the callback of stages does nothing; False
        for one picture, whose stages are shown as ever
    """
    if word is None:
        with plain(output) as advance:
            yield None, advance
        return
    with ExitStack() as stack:
        count, advance = None, lambda stage, share: None
        if tasks:
            count = stack.enter_context(_counted(output))
        else:
            advance = stack.enter_context(plain(output))
        cluster = stack.enter_context(machines.connect(word, progress=count))
        shown = f"; what each worker does: {cluster.dashboard}" if cluster.dashboard else ""
        note(output, f"the scheduler is {cluster.address}{shown}")
        yield cluster, advance


@contextmanager
def _counted(output: OutputOptions) -> Iterator[Callable[[int, int, int, float | None], None]]:
    """A callback that shows how many tasks are done, failed and to go; lines where no terminal is."""
    if output.quiet or output.json or not sys.stderr.isatty():
        with progress(output) as lines:

            def counted(done: int, failed: int, to_go: int, left: float | None) -> None:
                lines("tasks", (done + failed) / max(1, done + failed + to_go))

            yield counted
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("connecting")

        def drawn(done: int, failed: int, to_go: int, left: float | None) -> None:
            words = f"{done} done, {failed} failed, {to_go} to go"
            words += "" if left is None or not to_go else f", about {left:.0f} s left"
            bars.update(task, completed=done + failed, total=done + failed + to_go, description=words)

        yield drawn


@contextmanager
def one_by_one(advance: Callable[[str, float], None]) -> Iterator[Callable[[str], None]]:
    """A callback for steps that are only named as they begin: each ends as the next one begins, the last at the end."""
    before: list[str] = []

    def begin(step: str) -> None:
        for name in before:
            advance(name, 1.0)
        before[:] = [step]
        advance(step, 0.0)

    yield begin
    for name in before:
        advance(name, 1.0)


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{rl.errors.printable(str(k))} {_shown(v)}" for k, v in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(_shown(v) for v in value) or "none"
    return "none" if value is None else rl.errors.printable(str(value))
