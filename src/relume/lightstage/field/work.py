"""What relighting or storing a field takes: values, memory and time, measured on some of its rows."""

from __future__ import annotations

import time
from dataclasses import dataclass

from relume.lightstage.field.field import ReflectanceField


@dataclass(frozen=True)
class Work:
    """What reading a whole field takes.

    lights, shape : how many lights, and (rows, columns)
    allowed : bytes of memory
    seconds : about; None where it was not measured
    """

    lights: int
    shape: tuple[int, int]
    allowed: int
    seconds: float | None

    @property
    def value_bytes(self) -> int:
        """Of all values as floats."""
        return self.lights * self.shape[0] * self.shape[1] * 3 * 4

    @property
    def memory(self) -> int:
        return min(self.value_bytes, self.allowed)


def estimate_work(field: ReflectanceField, memory: int, more_seconds: float = 0.0) -> Work:
    """What reading the field takes; the time is that of some rows, times the rest.

    memory : bytes that may be used
    more_seconds : of other work
    """
    rows = field.shape[0]
    some = min(rows, 4)
    first = _seconds(field, slice(0, some))
    # The first rows of a folder cost reading its pictures, which those after them may find in memory.
    after = _seconds(field, slice(some, 2 * some)) if rows > some else 0.0
    return Work(len(field.lights), field.shape, memory, first + after * (rows / some - 1) + more_seconds)


def _seconds(field: ReflectanceField, rows: slice) -> float:
    begin = time.perf_counter()
    field.block(slice(0, len(field.lights)), rows)
    return time.perf_counter() - begin
