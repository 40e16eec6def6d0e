"""Words on a page of pixels, in the font that matplotlib brings: the same on every machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import numpy as np

_DPI = 100


@dataclass(frozen=True)
class Words:
    """A line of text on a page.

    x, y : pixels from the page's left and top, of the point that `align` and `level` name
    points : size; at 100 dots an inch one point is 1.39 pixels
    colour : "#e8e6e1"
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
    # Drawn by Pillow: to import matplotlib's figures takes longer than to draw many pages.
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(page)
    draw = ImageDraw.Draw(image)
    for one in words:
        # Laid out by Pillow itself: libraqm, where a machine has FriBiDi for it, sets letters closer together.
        font = ImageFont.truetype(_font(), one.points * _DPI / 72, layout_engine=ImageFont.Layout.BASIC)
        left, top, right, bottom = font.getbbox(one.text, anchor="ls")
        # As high as a line, whichever letters it has.
        _, highest, _, lowest = font.getbbox("lp", anchor="ls")
        top, bottom = min(top, highest), max(bottom, lowest)
        x = one.x - {"left": left, "center": (left + right) / 2, "right": right}[one.align]
        y = one.y - {"top": top, "center": (top + bottom) / 2, "bottom": bottom}[one.level]
        draw.text((x, y), one.text, font=font, fill=one.colour, anchor="ls")
    return np.array(image)


@cache
def _font() -> str:
    """The file of DejaVu Sans among matplotlib's, which is found without its import."""
    found = find_spec("matplotlib")
    assert found is not None and found.origin is not None
    return str(Path(found.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf")
