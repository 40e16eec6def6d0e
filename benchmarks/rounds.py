"""Works measured by turns, so that what else a machine does falls on all of them alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

ROUNDS = 5


def turns(works: dict[str, Callable[[], Any]], rounds: int = ROUNDS) -> dict[str, list[float]]:
    """Seconds of each in every round, one after the other; a first round is not counted."""
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for turn in range(rounds + 1):
        for name, work in works.items():
            start = time.perf_counter()
            result = work()
            taken = time.perf_counter() - start
            # What it gave is freed by nobody's clock.
            del result
            if turn:
                seconds[name].append(taken)
    return seconds


def by_turns(works: dict[str, Callable[[], Any]]) -> dict[str, float]:
    """Median seconds of each, by turns."""
    return {name: statistics.median(each) for name, each in turns(works).items()}
