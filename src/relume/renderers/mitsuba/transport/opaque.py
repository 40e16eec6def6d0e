"""Numbers that Dr.Jit reads from memory: one that is compiled into a kernel makes a new kernel of each value.

Kernels take seconds to compile, and moved objects, another camera or another light then need none.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import drjit as dr
import mitsuba as mi


def number(value: float) -> Any:
    """A `mi.Float` of one entry."""
    return dr.opaque(mi.Float, float(value))


def point(values: Iterable[float]) -> Any:
    """A `mi.Point3f`."""
    return mi.Point3f(*map(number, values))


def matrix(rows: Iterable[Iterable[float]]) -> Any:
    """A `mi.Matrix3f`, given by its rows."""
    return mi.Matrix3f(*(number(each) for row in rows for each in row))


def sphere(centre: Iterable[float], radius: float) -> tuple[Any, Any]:
    """A centre and a radius."""
    return point(centre), number(radius)


def grey(colour: Any) -> Any:
    """The mean of a colour's channels; Dr.Jit's own has the number of rays compiled in, a new kernel for each."""
    return (colour.x + colour.y + colour.z) * (1 / 3)
