"""What a script of this folder has measured, as rows: printed, and written as lines of JSON where `--rows` asks for it.

`run_all.py` collects them. A row is written as soon as it is measured, so that a script which fails later, or is
stopped, has not worked in vain.
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True)
class Row:
    """One figure.

    seen, unit : what counts; a ratio (×) is the peer's by ours, so that above 1 ours is better
    goal : a key of `goals.GOALS`, or empty
    limit : what is asked where `goals.GOALS` does not list it, such as "≤ 0.5"
    ours, theirs, peer : what a ratio is of, seconds unless the note says otherwise
    least, most : the spread of `seen`
    note : one sentence; of a row without a figure, why there is none
    """

    what: str
    seen: float | None
    unit: str
    goal: str = ""
    limit: str = ""
    ours: float | None = None
    peer: str = ""
    theirs: float | None = None
    least: float | None = None
    most: float | None = None
    note: str = ""

    def __str__(self) -> str:
        if self.seen is None:
            return f"{self.what}: not measured, {self.note}"
        words = f"{self.what}: {figure(self.seen)} {self.unit}"
        if self.least is not None and self.most is not None and self.least < self.most:
            words += f" ({figure(self.least)}–{figure(self.most)})"
        if self.peer and self.ours is not None and self.theirs is not None:
            words += f"; ours {figure(self.ours)}, {self.peer} {figure(self.theirs)}"
        return words + (f"; {self.note}" if self.note else "")


@dataclass(frozen=True)
class Result:
    """What came of a script.

    state : "done", or why it is not
    others : share of the machine's processors that other programs took meanwhile; None where nothing says
    """

    file: str
    state: str
    seconds: float
    others: float | None
    day: str
    quick: bool
    rows: tuple[Row, ...] = ()
    commit: str = ""
    """Of the checkout that was measured; ends with "+" where files of it had changed."""


@dataclass(frozen=True)
class Rows:
    """Where rows go: to the terminal, and to a file unless that is None."""

    path: Path | None = None

    def add(self, row: Row) -> None:
        print(row, flush=True)
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(row), ensure_ascii=False) + "\n")

    def ratio(
        self, what: str, ours: Sequence[float], peer: str, theirs: Sequence[float], *,
        goal: str = "", limit: str = "", note: str = "",
    ) -> None:  # fmt: skip
        """How many times as long a peer takes: the median over the turns, each turn's times beside each other."""
        times = [their / our for our, their in zip(ours, theirs, strict=True)]
        self.add(
            Row(
                what, statistics.median(times), "×", goal, limit, statistics.median(ours), peer,
                statistics.median(theirs), min(times), max(times), note,
            )
        )  # fmt: skip

    def value(
        self, what: str, seen: float | Sequence[float], unit: str, *, goal: str = "", limit: str = "",
        spread: tuple[float, float] | None = None, ours: float | None = None, peer: str = "",
        theirs: float | None = None, note: str = "",
    ) -> None:  # fmt: skip
        """Any other figure; of several runs their median."""
        if isinstance(seen, Sequence):
            spread, seen = (min(seen), max(seen)), statistics.median(seen)
        least, most = spread or (None, None)
        self.add(Row(what, seen, unit, goal, limit, ours, peer, theirs, least, most, note))

    def absent(self, what: str, why: str, *, goal: str = "") -> None:
        """A figure that there is not, and why."""
        self.add(Row(what, None, "", goal, note=why))


def read_rows(path: Path) -> list[Row]:
    """The rows of a file that `Rows` wrote; none where there is no file."""
    if not path.is_file():
        return []
    return [Row(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]


def asked(described: str | None) -> argparse.ArgumentParser:
    """A parser that knows what every script here knows: `--quick` and `--rows PATH`."""
    parser = argparse.ArgumentParser(description=described, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smaller and fewer, a minute at most: is all in order?")
    parser.add_argument("--rows", type=Path, metavar="PATH", help="also append what is measured there, a line a row")
    return parser


def figure(value: float) -> str:
    """Three significant digits, and all of those before the point."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{float(f'{value:.3g}'):g}"
