"""Words on a page of pixels, by matplotlib's own fonts: the same on every machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

_DPI = 100


@dataclass(frozen=True)
class Words:
    """A line of text on a page.

    x, y : pixels from the page's left and top, of the point that `align` and `level` name
    points : size; at 100 dots an inch one point is 1.39 pixels
    colour : as matplotlib has them, "#e8e6e1"
    """

    x: float
    y: float
    text: str
    points: float = 10.0
    colour: str = "#e8e6e1"
    align: Literal["left", "center", "right"] = "left"
    level: Literal["top", "center", "bottom"] = "top"


def lettered(page: np.ndarray, words: Sequence[Words]) -> np.ndarray:
    """The page (H, W, 3) uint8 with words on it, its other pixels untouched."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    height, width = page.shape[:2]
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
    canvas = FigureCanvasAgg(figure)
    figure.figimage(page)
    for one in words:
        place = (one.x / width, 1 - one.y / height)
        figure.text(*place, one.text, fontsize=one.points, color=one.colour, va=one.level, ha=one.align)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
