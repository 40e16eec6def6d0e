"""The errors a caller would catch, each message with what, where and what to do; and `warn`, for what is only doubtful.

    RelumeError
    ├── UnreadableFile      a photograph, map or mesh is missing, damaged or of a kind relume does not read
    │   └── FormatError     its format is broken: where, what was expected there and what was found
    ├── NotABracket         photographs that cannot be merged: no exposure, different sizes, nothing well exposed
    ├── BallNotFound        no mirrored ball is seen in the photograph
    ├── NotAPanorama        views that make no panorama: too few, or without overlap
    ├── SunNotFound         no sun or lamp stands out of an environment map
    ├── LampsNotMatched     two probes share no lamp that could be located
    ├── SunNotRecovered     the radiance of a clipped sun cannot be recovered from the readings
    ├── GridNotFound        no calibration grid is seen in the photograph
    ├── InvalidShot         the shot file has an unknown key, a missing one or a wrong value
    ├── InvalidScene        the scene file has an unknown key, a missing one or a wrong value
    ├── InvalidPlace        the place file has an unknown key or name, or its marks do not determine the place
    ├── InvalidStage        the folder or file of a light stage has an unknown key, a missing light, or other pictures
    ├── UnsupportedScene    a renderer was given something it cannot render
    ├── CannotResume        what an interrupted render kept belongs to another render
    ├── Interrupted         a long job was stopped from outside; what was done is kept
    ├── ClusterUnusable     no scheduler answers, or its workers cannot do the work
    ├── Incomplete          some of many tasks failed, and the others are done; it names them
    ├── IncompleteSequence  frames of a sequence are missing; the message names them
    ├── DoubtfulResult      all was done and written, but the result should not be used unseen
    └── OutputNotWritten    a file or folder could not be written

A wrong call (an array of the wrong shape, a negative size) raises ``ValueError``: got, expected, remedy.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

_PACKAGE = f"{Path(__file__).parent}{os.sep}"
_KEPT_BACK: ContextVar[list[Doubt] | None] = ContextVar("kept back", default=None)
# Unicode: C0, DEL and C1; line and paragraph separators; embeddings, overrides and isolates of direction.
_UNPRINTABLE = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u061c\u202a-\u202e\u2066-\u2069]+")


class RelumeError(Exception):
    """Something relume was given cannot be used; the message is one line for a person."""

    def __init__(self, message: object = "") -> None:
        super().__init__(printable(str(message)))


class UnreadableFile(RelumeError):
    """A photograph, map or mesh is missing, damaged or of a kind relume does not read."""


class FormatError(UnreadableFile):
    """A picture file breaks its format: it is damaged, cut short, or claims what cannot be.

    path, format : the file, and what it is ("Radiance", "EXR", …)
    where : the byte, line, field or part
    expected, found : there
    remedy : what to do about it
    """

    def __init__(
        self,
        path: object,
        format: str,
        where: str,
        expected: str,
        found: str,
        remedy: str = "copy it again from where it came",
    ) -> None:
        super().__init__(f"{path}: damaged {format}, {where}: expected {expected}, found {found}; {remedy}")
        self.path, self.format, self.where, self.expected, self.found = str(path), format, where, expected, found
        self.remedy = remedy

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return FormatError, (self.path, self.format, self.where, self.expected, self.found, self.remedy)


class NotABracket(RelumeError):
    """The photographs cannot be merged: no exposure, different sizes, nothing well exposed."""


class BallNotFound(RelumeError):
    """No mirrored ball is seen in the photograph.

    candidates : (x, y, radius) of what is round in it, pixels, the likeliest first; each can be picked
    radiance : (H, W, 3) in which they were sought, or None
    remedy : the end of the message: how the ball is picked, by options of `relume probe` or keys of the shot file; ""
        where none does
    """

    def __init__(
        self, message: str, candidates: tuple[tuple[float, float, float], ...] = (), radiance: object | None = None,
        remedy: str = "",
    ) -> None:  # fmt: skip
        super().__init__(f"{message}; {remedy}" if remedy else message)
        self.candidates, self.radiance, self.remedy = candidates, radiance, remedy

    @property
    def found(self) -> str:
        """The message without its remedy."""
        return str(self).removesuffix(f"; {self.remedy}")

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return BallNotFound, (self.found, self.candidates, self.radiance, self.remedy)


class NotAPanorama(RelumeError):
    """Views that make no panorama: too few, without a field of view, or without overlap."""


class SunNotFound(RelumeError):
    """No sun or lamp stands out of an environment map."""


class LampsNotMatched(RelumeError):
    """Two probes share no lamp that could be located."""


class SunNotRecovered(RelumeError):
    """The radiance of a clipped sun cannot be recovered: nothing is clipped, or the readings do not see it."""


class GridNotFound(RelumeError):
    """No calibration grid is seen in the photograph."""


class InvalidShot(RelumeError):
    """The shot file has an unknown key, a missing one or a wrong value."""


class InvalidScene(RelumeError):
    """The scene file has an unknown key, a missing one or a wrong value, or names a file that cannot be used."""


class InvalidPlace(RelumeError):
    """The place file has an unknown key or name, or its marks do not determine the place; the message names what."""


class InvalidStage(RelumeError):
    """The folder or file of a light stage has an unknown key, a missing light, or pictures that do not match it."""


class UnsupportedScene(RelumeError):
    """A renderer was given something it cannot render."""


class CannotResume(RelumeError):
    """What an interrupted render kept belongs to another render; the message names what differs."""


class Interrupted(RelumeError):
    """A long job was stopped from outside, by Ctrl-C or a request to end; what was done is kept.

    passes, of : how many of how many passes are done
    signal : the number of the signal that stopped it, 2 for Ctrl-C and 15 for a request to end
    kept : where what was done lies, or None where nothing was kept
    """

    def __init__(self, passes: int, of: int, signal: int, kept: object | None) -> None:
        state = (
            f"{passes} of {of} passes are kept in {kept}; give the same command again" if kept else "nothing is kept"
        )
        super().__init__(f"interrupted; {state}")
        self.passes, self.of, self.signal, self.kept = passes, of, signal, kept

    @property
    def exit_code(self) -> int:
        """What a shell expects of a program that a signal ended: 130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + self.signal

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return Interrupted, (self.passes, self.of, self.signal, self.kept)


class ClusterUnusable(RelumeError):
    """No scheduler answers, or its workers lack what the work takes: version, memory, files, variant."""


class Incomplete(RelumeError):
    """Some of many tasks failed; the others are done, and stay.

    failed : (name, why) of each that failed, in the order of the tasks
    results : one a task, None where it failed
    """

    def __init__(self, failed: Sequence[tuple[str, str]], results: Sequence[object]) -> None:
        first, *others = failed
        names = ", ".join(name for name, _ in failed[:3]) + (f" and {len(failed) - 3} more" if len(failed) > 3 else "")
        why = f"{first[0]}: {first[1]}" if others else first[1]
        super().__init__(f"{len(failed)} of {len(results)} failed: {names} ({why}); the others are done")
        self.failed, self.results = tuple(failed), results

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return Incomplete, (self.failed, self.results)


class DoubtfulResult(RelumeError):
    """All was done and written, but something makes the result worse than it looks; the message names it."""


class IncompleteSequence(RelumeError):
    """Frames of a sequence are not there, or were made from something else; the message names them."""


class OutputNotWritten(RelumeError):
    """A file or folder could not be written."""


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Put the name of one of many jobs before the message of an error that ends it."""
    try:
        yield
    except Interrupted:
        raise
    except (RelumeError, ValueError) as error:
        if not str(error).startswith(f"{name}: "):
            error.args = (f"{name}: {error}",)
        raise


def printable(text: str) -> str:
    """A text that stays on its line and moves no cursor, whatever names out of files are in it.

    Each run of control characters, line ends and marks of writing direction becomes one blank.
    """
    return _UNPRINTABLE.sub(" ", text)


def warn(message: str, effect: float | None = None) -> None:
    """Warn at the first line outside relume, however deep in it the warning arises.

    message : one line: what, where, what to do
    effect : by what share the light in the result is likely wrong for it; None where there is no estimate
    """
    if (kept := _KEPT_BACK.get()) is not None:
        kept.append(Doubt(printable(message), effect))
        return
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        frame, level = frame.f_back, level + 1
    warnings.warn(DoubtWarning(printable(message), effect), stacklevel=level)


@contextmanager
def doubts_kept_back() -> Iterator[list[Doubt]]:
    """What this thread warns of inside, kept in a list, for threads whose work goes on side by side.

    Python's own way to catch warnings is one for all threads. Nothing inside may gather doubts by `GatheredDoubts`.
    """
    kept: list[Doubt] = []
    before = _KEPT_BACK.set(kept)
    try:
        yield kept
    finally:
        _KEPT_BACK.reset(before)


class DoubtWarning(UserWarning):
    """A warning with an estimate of its effect; see `Doubt`."""

    def __init__(self, message: str, effect: float | None = None) -> None:
        super().__init__(message)
        self.effect = effect

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return DoubtWarning, (str(self), self.effect)


WRONG = 0.25
"""The effect from which on a result is wrong and not only a little worse: a third of a stop, which an eye sees beside
the photograph."""
UNKNOWN = 0.02
"""The effect that a doubt without an estimate counts as where doubts are ranked: below whatever was found to matter."""


@dataclass(frozen=True)
class Doubt:
    """What a user should know of a result, and how much it matters.

    line : what, where and what to do, one line
    effect : by what share the light in the result is likely wrong for it, 0.1 being 10 per cent: a rough estimate, half
        or twice the truth. What makes the picture wrong in another way, such as an object that hovers, counts as what
        disturbs as much. None where there is no estimate
    """

    line: str
    effect: float | None = None

    @property
    def wrong(self) -> bool:
        """Whether the result should not be used without looking at it."""
        return self.effect is not None and self.effect >= WRONG

    @property
    def words(self) -> str:
        """The line with the effect, where that is known and not too small to name."""
        if self.effect is None or self.effect < 0.005:
            return self.line
        return f"{self.line} [{per_cent(self.effect)} of the light]"


def per_cent(effect: float) -> str:
    """An effect in words: about 7 %, about 30 %, more than 100 %; what is below `WRONG` never reads as that."""
    if effect > 1:
        return "more than 100 %"
    if effect < 0.095:
        return f"about {100 * effect:.1g} %"
    return f"about {max(10, 5 * int(20 * effect + 1e-9))} %"


def ranked(doubts: Iterable[Doubt]) -> tuple[Doubt, ...]:
    """Each of `doubts` once, those of the greatest effect first; of two with one line the greater effect stays."""
    best: dict[str, Doubt] = {}
    for doubt in doubts:
        before = best.get(doubt.line)
        if before is None or (before.effect or 0.0) < (doubt.effect or 0.0):
            best[doubt.line] = doubt
    return tuple(sorted(best.values(), key=lambda doubt: -(UNKNOWN if doubt.effect is None else doubt.effect)))


def doubt_of(warning: object) -> Doubt:
    """A caught warning's message as a doubt."""
    return Doubt(str(warning), warning.effect if isinstance(warning, DoubtWarning) else None)


class GatheredDoubts:
    """Gathers what is warned of inside `with GatheredDoubts() as gathered` as doubts: `gathered.doubts` afterwards.

    Where the job inside fails there is no result to hold them, and they are warnings again before its error: they often
    say why it failed.
    """

    doubts: tuple[Doubt, ...] = ()

    def __enter__(self) -> GatheredDoubts:
        self._catching = warnings.catch_warnings(record=True)
        self._caught = self._catching.__enter__()
        warnings.simplefilter("always", UserWarning)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._catching.__exit__(kind, error, at)
        caught = self._caught or ()
        self.doubts = tuple(doubt_of(each.message) for each in caught if issubclass(each.category, UserWarning))
        for each in caught:
            if not issubclass(each.category, UserWarning):  # of other libraries: it says nothing of the light
                warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
        if not isinstance(error, Exception):
            return
        for doubt in ranked(self.doubts):
            with suppress(DoubtWarning):  # where warnings are errors: the job's own error is the one to raise
                warn(doubt.line, doubt.effect)
