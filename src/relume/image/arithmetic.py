"""Arithmetic between radiance maps, and between maps and constants, in linear light with honest units and marks.

Errors of two maps are taken for independent. A pixel keeps a mark where either map has one: of two bounds that go the
same way the result is a bound, of two that oppose each other nothing is known (OUTSIDE). A negative factor turns a
bound round; one that is negative in some channels only leaves OUTSIDE, since marks are of whole pixels; times 0 every
pixel is known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from relume.errors import warn
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap

Operand = RadianceMap | float | tuple[float, float, float]
"""A map of the same size, or a constant for all channels, or one a channel."""
Pair = Callable[[np.ndarray, np.ndarray], np.ndarray]

_LAYOUT = {"orientation": "for", "mirror": "mirrored in"}
"""Attributes besides the mapping that say where a file's pixels look, and their names in messages."""
_OPPOSITE = np.array([0, BLACK, SATURATED, OUTSIDE], np.uint8)


def added(first: RadianceMap, second: Operand) -> RadianceMap:
    """first + second; maps must be of one unit, a constant is of the first map's. Raises ValueError."""
    return _combined(first, second, np.add, lambda a, b, va, vb: va + vb, _same_unit)


def subtracted(first: RadianceMap, second: Operand) -> RadianceMap:
    """first − second, negative where the second is brighter; maps must be of one unit. Raises ValueError."""
    return _combined(first, second, np.subtract, lambda a, b, va, vb: va + vb, _same_unit, opposing=True)


def multiplied(first: RadianceMap, second: Operand) -> RadianceMap:
    """first × second; a relative map or a constant is a plain factor, cd/m² times cd/m² is refused. Raises ValueError.

    A factor that is a power of two changes no digit.
    """
    return _combined(
        first,
        second,
        np.multiply,
        lambda a, b, va, vb: a * a * vb + b * b * va + va * vb,
        _unit_of_product,
        factors=True,
    )


def divided(first: RadianceMap, second: Operand) -> RadianceMap:
    """first ÷ second; cd/m² by cd/m² is relative, relative by cd/m² is refused.

    Where a divisor is 0 the result is 0 and the pixel marked OUTSIDE, with a warning that counts them. Raises
    ValueError, for a constant 0 too.
    """
    constant = None if isinstance(second, RadianceMap) else _constant(second)
    if constant is not None and not constant.all():
        raise ValueError(f"division by {second}; give a divisor other than 0")
    divisor = second.radiance if isinstance(second, RadianceMap) else constant
    none = np.broadcast_to(np.asarray(divisor) == 0, first.radiance.shape) if divisor is not None else np.zeros(1, bool)

    def quotient(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.divide(a, b, out=np.zeros(np.broadcast_shapes(a.shape, b.shape)), where=b != 0)

    def variance(a: np.ndarray, b: np.ndarray, va: np.ndarray, vb: np.ndarray) -> np.ndarray:
        return np.where(b != 0, (va + quotient(a, b) ** 2 * vb) / np.where(b != 0, b * b, 1), np.inf)

    result = _combined(first, second, quotient, variance, _unit_of_quotient, opposing=True, factors=True)
    lost = none.any(-1)
    if constant is None and lost.any():
        warn(f"the divisor is 0 in {int(lost.sum())} pixels; they are 0 and marked as not seen")
        marks = np.zeros(lost.shape, np.uint8) if result.clipped is None else result.clipped.copy()
        marks[lost] = OUTSIDE
        result = replace(result, clipped=marks)
    return result


def darker(first: RadianceMap, second: Operand) -> RadianceMap:
    """The lesser of both, channel by channel; maps must be of one unit. Raises ValueError."""
    return _combined(first, second, np.minimum, lambda a, b, va, vb: np.where(a <= b, va, vb), _same_unit)


def brighter(first: RadianceMap, second: Operand) -> RadianceMap:
    """The greater of both, channel by channel; maps must be of one unit. Raises ValueError."""
    return _combined(first, second, np.maximum, lambda a, b, va, vb: np.where(a >= b, va, vb), _same_unit)


def average(pictures: Sequence[RadianceMap]) -> RadianceMap:
    """The mean of maps of one size and unit, its variance that of a mean of independent errors. Raises ValueError."""
    if not pictures:
        raise ValueError("no maps to average; give at least one")
    result = pictures[0]
    for picture in pictures[1:]:
        result = added(result, picture)
    return multiplied(result, 1 / len(pictures)) if len(pictures) > 1 else result


def without_negative(picture: RadianceMap) -> RadianceMap:
    """The map with negative radiance set to 0, with a warning that counts the pixels and the light removed."""
    below = picture.radiance < 0
    if not below.any():
        return picture
    depth = -float(picture.radiance.min())
    warn(
        f"{int(below.any(-1).sum())} of {below[..., 0].size} pixels came out negative, down to −{depth:.4g}, and are "
        "set to 0"
    )
    return replace(picture, radiance=np.maximum(picture.radiance, np.float32(0)))


def _combined(
    first: RadianceMap,
    second: Operand,
    operation: Pair,
    variance: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    unit: Callable[[RadianceMap, RadianceMap], str],
    *,
    opposing: bool = False,
    factors: bool = False,
) -> RadianceMap:
    """One operation on all planes.

    variance : of the result from both values and both variances
    opposing : whether a bound of the second works the other way, as in a difference
    factors : whether the sign of each turns the other's bounds round, as in a product
    """
    if isinstance(second, RadianceMap):
        _require_alike(first, second)
        named, other, spread = unit(first, second), second.radiance.astype(np.float64), second.variance
    else:
        named, other, spread = first.unit, _constant(second), np.zeros(3)
    light = first.radiance.astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        exact = operation(light, other)
        radiance = exact.astype(np.float32)
    beyond = np.count_nonzero(np.isinf(radiance) & np.isfinite(light))
    if beyond:
        raise ValueError(f"{beyond} values are beyond float32, 3.4e38; scale the maps down first")
    known = first.variance is not None and spread is not None
    if not known and (first.variance is not None or (isinstance(second, RadianceMap) and spread is not None)):
        warn("only one of the maps has a variance, so the result has none")
    noise = None
    if first.variance is not None and spread is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            noise = variance(light, other, first.variance.astype(np.float64), spread.astype(np.float64))
        # An unknown error times nothing is no error.
        noise = np.nan_to_num(np.broadcast_to(noise, light.shape), nan=0.0, posinf=np.inf).astype(np.float32)
    marks = [first.clipped, second.clipped if isinstance(second, RadianceMap) else None]
    if factors:
        marks = [_turned(marks[0], other, marks[1]), _turned(marks[1], light, marks[0])]
    return replace(first, radiance=radiance, variance=noise, clipped=_marks(marks, opposing), unit=named)


def _turned(marks: np.ndarray | None, factor: np.ndarray, of_factor: np.ndarray | None) -> np.ndarray | None:
    """What marks (H, W) say once their pixels are multiplied by a factor (H, W, 3) or (3,) with marks of its own."""
    if marks is None or np.all(factor > 0):
        return marks
    falls, rises = (factor < 0).any(-1), (factor > 0).any(-1)
    result = np.where(falls, _OPPOSITE[marks], marks)
    result[falls & rises & (marks != 0)] = OUTSIDE
    nothing = (factor == 0).all(-1) & (True if of_factor is None else of_factor == 0)
    result[np.broadcast_to(nothing, marks.shape)] = 0
    return result


def _marks(marks: list[np.ndarray | None], opposing: bool) -> np.ndarray | None:
    first, second = marks
    if second is not None and opposing:
        second = _OPPOSITE[second]
    if first is None or second is None:
        return first if second is None else second
    both = np.maximum(first, second)
    # Only where both are marked, and differently, is nothing known.
    both[(first != 0) & (second != 0) & (first != second)] = OUTSIDE
    return both


def _constant(value: float | tuple[float, float, float]) -> np.ndarray:
    constant = np.broadcast_to(np.asarray(value, np.float64), (3,)) if np.ndim(value) == 0 else np.asarray(value, float)
    if constant.shape != (3,) or not np.all(np.isfinite(constant)):
        raise ValueError(f"the constant is {value}; expected one number, or red, green and blue")
    return constant


def _require_alike(first: RadianceMap, second: RadianceMap) -> None:
    if first.size != second.size:
        sizes = " and ".join(f"{width}×{height}" for width, height in (first.size, second.size))
        raise ValueError(f"the maps are {sizes} pixels; resize one of them first")
    if not all("mapping" in picture.attributes for picture in (first, second)):
        return
    layouts = [
        " ".join([a["mapping"], *(f"{word} {a[key]}" for key, word in _LAYOUT.items() if key in a)])
        for a in (first.attributes, second.attributes)
    ]
    if layouts[0] != layouts[1]:
        raise ValueError(f"the maps are laid out as {layouts[0]} and {layouts[1]}; convert one of them first")


def _same_unit(first: RadianceMap, second: RadianceMap) -> str:
    if first.unit != second.unit:
        raise ValueError(f"the maps are in {first.unit} and {second.unit}; scale the relative one to cd/m² first")
    return first.unit


def _unit_of_product(first: RadianceMap, second: RadianceMap) -> str:
    if first.unit == second.unit == "cd/m²":
        raise ValueError("cd/m² times cd/m² is no radiance; one of the maps must be relative")
    return "relative" if first.unit == second.unit else "cd/m²"


def _unit_of_quotient(first: RadianceMap, second: RadianceMap) -> str:
    if second.unit == "cd/m²" and first.unit == "relative":
        raise ValueError("a relative map divided by one in cd/m² is no radiance; exchange them, or scale the first")
    return "relative" if first.unit == second.unit else first.unit
