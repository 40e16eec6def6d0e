"""Work on a picture some rows at a time, so that what it takes in between does not grow with the picture."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import copy_context
from typing import TypeVar

Result = TypeVar("Result")

BAND = 2**18
"""Pixels of a band: a plane of it in float64 colour is 6 MB, which a core's share of the cache about holds."""


def in_bands(height: int, width: int, work: Callable[[slice], Result]) -> list[Result]:
    """Call `work(rows)` for the bands of a picture on every core; the results, from the top band down."""
    from relume.image.kernel import in_threads

    # The threads take NumPy's error state along.
    context = copy_context()
    return in_threads(
        lambda begin, end: context.copy().run(work, slice(begin, end)), height, chunk=max(1, BAND // max(width, 1))
    )
