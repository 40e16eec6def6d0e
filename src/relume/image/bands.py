"""Work on every core: on a picture some rows at a time, so that what that takes in between does not grow with the
picture, and on a few things side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextvars import copy_context
from typing import TypeVar

from relume.errors import Doubt, doubts_kept_back, warn

Result = TypeVar("Result")

BAND = 2**18
"""Pixels of a band: a plane of it in float64 colour is 6 MB, which a core's share of the cache about holds."""
SMALL = 2**21
"""Pixels of a picture up to which several are worked on side by side. Larger ones keep every core busy one by one, and
memory holds what one of them takes in between."""


def in_threads(
    work: Callable[[int, int], Result], count: int, threads: int | None = None, *, chunk: int = 65536
) -> list[Result]:
    """Call `work(begin, end)` for chunks of 0…count on every core; the results, in the chunks' order.

    The chunks do not depend on the number of threads, so neither do sums over their results.
    """
    begins = range(0, count, chunk)
    workers = min(threads or os.cpu_count() or 1, len(begins))
    if workers <= 1:
        return [work(begin, min(begin + chunk, count)) for begin in begins]
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(lambda begin: work(begin, min(begin + chunk, count)), begins))


def in_bands(height: int, width: int, work: Callable[[slice], Result]) -> list[Result]:
    """Call `work(rows)` for the bands of a picture on every core; the results, from the top band down."""
    # The threads take NumPy's error state along.
    context = copy_context()
    return in_threads(
        lambda begin, end: context.copy().run(work, slice(begin, end)), height, chunk=max(1, BAND // max(width, 1))
    )


def side_by_side(works: Sequence[Callable[[], Result]], pixels: int = 0) -> list[Result]:
    """What each work gives, all done at once on every core; warnings come in the order of the works, after all.

    pixels : of the largest picture that any works on; above SMALL they are done one after another
    Of works that fail the first one's error is raised. None may gather doubts by `GatheredDoubts`.
    """
    context = copy_context()
    kept: list[list[Doubt]] = [[] for _ in works]

    def work(begin: int, end: int) -> Result:
        def quietly() -> Result:
            with doubts_kept_back() as kept[begin]:
                return works[begin]()

        return context.copy().run(quietly)

    try:
        return in_threads(work, len(works), 1 if pixels > SMALL else None, chunk=1)
    finally:
        for doubts in kept:
            for doubt in doubts:
                warn(doubt.line, doubt.effect)
