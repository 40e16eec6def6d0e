"""Lines that say how far a long job is: for a log the stage, its share and the time left; for a farm its own form."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Lock, Thread

EVERY = 15.0
"""Seconds between two lines of a stage under way, at least: someone who looks is not left to wonder."""
STEP = 0.05
"""Share of a stage from which on a line is due, and seconds after which one is due anyway: an hour is sixty lines."""
SELDOM = 60.0
RECENT = 90.0
"""Seconds from whose progress the time left is reckoned: parts of a picture take unlike times."""
ENOUGH = 5.0
"""Seconds of progress from which on it is reckoned at all."""

LOOK = 1.0
"""Seconds between two looks at what is due."""


class StageLines:
    """What is known of the stages of a job, and the lines that are due.

    every : whether the beginning and the end of every stage are said, or those alone that take more than EVERY seconds
    say : takes a line
    clock : seconds
    """

    def __init__(self, every: bool, say: Callable[[str], None], clock: Callable[[], float] = time.perf_counter) -> None:
        self._every, self._say, self._clock = every, say, clock
        self._lock = Lock()
        self._begun: dict[str, float] = {}
        self._ended: set[str] = set()
        self._shares: dict[str, deque[tuple[float, float]]] = {}
        self._said: dict[str, tuple[float, float]] = {}

    def __call__(self, stage: str, share: float) -> None:
        """A stage is as far as this."""
        with self._lock:
            now = self._clock()
            if stage in self._ended and share > 0:
                return  # what a stage says after its end is not news
            if stage not in self._begun:
                self._ended.discard(stage)
                self._begun[stage] = now
                self._said[stage] = now, share
                self._shares[stage] = deque([(now, share)])
                if share < 1:
                    if self._every:
                        self._say(f"{stage} …")
                    return
            if share >= 1:
                seconds = now - self._begun.pop(stage)
                if self._every or seconds >= EVERY:
                    self._say(f"{stage}: {seconds:.1f} s")
                self._ended.add(stage)
                return
            self._add(stage, now, share)
            self._line_if_due(stage, now)

    def look(self) -> None:
        """Say what is due of stages that say nothing themselves."""
        with self._lock:
            now = self._clock()
            for stage in self._begun:
                self._line_if_due(stage, now)

    def _add(self, stage: str, now: float, share: float) -> None:
        shares = self._shares[stage]
        shares.append((now, share))
        while len(shares) > 2 and now - shares[1][0] > RECENT:
            shares.popleft()

    def _line_if_due(self, stage: str, now: float) -> None:
        then, before = self._said[stage]
        share = self._shares[stage][-1][1]
        waited = now - then
        if waited < EVERY or (waited < SELDOM and 0 < share < before + STEP):
            return
        self._said[stage] = now, share
        begun = now - self._begun[stage]
        if share <= 0:
            self._say(f"{stage}, {in_words(begun)} so far")
            return
        left = self._left(stage, now)
        after = f", about {in_words(left)} left" if left is not None else ""
        self._say(f"{stage} {100 * share:.0f} %, {in_words(begun)} so far{after}")

    def _left(self, stage: str, now: float) -> float | None:
        """Seconds until the stage ends, by its latest progress; None where there was too little."""
        shares = self._shares[stage]
        (first, low), (last, high) = shares[0], shares[-1]
        if last - first < ENOUGH or high <= low:
            return None
        return max(0.0, (last - first) * (1 - high) / (high - low) - (now - last))


class FarmLines:
    """How far a job is, for a render farm: of all frames where there are several, else of the render.

    A farm that follows Open Job Description takes lines of standard output that begin with `openjd_progress:`,
    `openjd_status:` and `openjd_fail:` ("How Jobs Are Run", stdout messages).

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


def in_words(seconds: float) -> str:
    """A length of time as one says it: 40 s, 3 min, 1 h 20 min."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"


@contextmanager
def stage_lines(every: bool) -> Iterator[StageLines]:
    """The same on standard error, with a thread that looks after stages which are silent for long."""
    lines = StageLines(every, lambda line: print(f"relume: {line}", file=sys.stderr, flush=True))
    done = Event()

    def watch() -> None:
        while not done.wait(LOOK):
            lines.look()

    thread = Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield lines
    finally:
        done.set()
        thread.join()
