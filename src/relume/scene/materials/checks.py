"""What the numbers of a material may be: ranges and shapes, with one wording for all faults."""

from __future__ import annotations

from typing import Any

import numpy as np

Colour = tuple[float, float, float]


def triple(values: Any) -> Colour:
    """Three numbers as a tuple of floats."""
    r, g, b = (float(value) for value in values)
    return r, g, b


def check_range(field: str, value: Any, name: str, lowest: float, highest: float) -> None:
    """Raises ValueError unless every number lies within `lowest` and `highest`; not a number lies nowhere."""
    array = np.asarray(value)
    if array.size and array.min() >= lowest and array.max() <= highest:
        return
    if array.size == 0:
        got = "empty"
    elif array.size <= 3:
        got = str(array.tolist())
    else:
        got = f"an image from {array.min():g} to {array.max():g}"
    expected = f"{lowest:g} to {highest:g}" if np.isfinite(highest) else f"{lowest:g} or more"
    raise ValueError(f"{field} of material {name!r} is {got}; expected {expected}")


def check_shape(field: str, value: Any, name: str, channels: int) -> None:
    """Raises ValueError unless the value is a colour or (H, W, 3) for 3 channels, a number or (H, W) for 1."""
    shape = np.shape(value)
    fits = (shape == (3,) or (len(shape) == 3 and shape[2] == 3)) if channels == 3 else len(shape) in (0, 2)
    if not fits:
        expected = "three numbers or an image (H, W, 3)" if channels == 3 else "a number or an image (H, W)"
        raise ValueError(f"{field} of material {name!r} has the shape {shape}; expected {expected}")
