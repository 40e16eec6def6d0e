"""A picture in a notebook: the canvas of `relume view` with the picture in the page itself, without a server."""

from __future__ import annotations

import base64
import html
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import relume as rl
from relume.studio.pictures import TILE, Layer, halved

PAGE = Path(__file__).parent / "page"
MODULES = ("shaders.js", "programs.js", "source.js", "measured.js", "canvas.js", "notebook.js")
"""Each after those it imports."""
LARGEST_SIDE = 1024
"""Pixels kept along the longer side: about 6 MB in a notebook."""


Picture = rl.RadianceMap | rl.EnvironmentMap | rl.Render | np.ndarray


@dataclass(frozen=True)
class Shown:
    """What `show` gives back: a notebook draws it, with exposure, pan, zoom and the values of pixels.

    page : HTML that holds all it needs
    height : of its frame, pixels of the screen
    """

    page: str
    height: int

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.page, quote=True)}" title="relume" sandbox="allow-scripts" '
            f'style="width: 100%; height: {self.height}px; border: 0"></iframe>'
        )


def show(
    picture: rl.RadianceMap | rl.EnvironmentMap | rl.Render | np.ndarray,
    *,
    stops: float | None = None,
    height: int = 480,
) -> Shown:
    """Draw a radiance map, an environment map, a render or linear pixels (H, W, 3) in a notebook.

    The page needs nothing from any network and goes with the notebook; pictures larger than 1024 pixels are in it at a
    half, a quarter … of their size, and it says so.

    picture : what is drawn; arrays count as relative radiance
    stops : exposure to begin with; the median is middle grey unless given
    height : of the frame, pixels of the screen
    Raises ValueError for anything else.
    """
    pixels, unit = _pixels_of(picture)
    reduced = 1
    kept = pixels
    while max(kept.shape[:2]) > LARGEST_SIDE:
        kept, reduced = halved(kept), 2 * reduced
    layer = Layer("picture", kept)
    tiles = {
        f"{level}/{column}/{row}": base64.b64encode(layer.tile(level, column, row)).decode()
        for level, small in enumerate(layer.levels)
        for column in range(-(-small.shape[1] // TILE))
        for row in range(-(-small.shape[0] // TILE))
    }
    smallest, largest, odd = layer.extent
    median = layer.median
    facts = {
        "layer": {
            "name": layer.name, "digest": layer.digest, "half": layer.halves, "scale": layer.scale,
            "sizes": [[level.shape[1], level.shape[0]] for level in layer.levels],
            "smallest": smallest, "largest": largest, "median": layer.median, "odd": odd, "marked": False,
        },
        "stops": stops if stops is not None else float(np.log2(0.18 / median)) if median > 0 else 0.0,
        "unit": unit, "reduced": reduced, "size": [pixels.shape[1], pixels.shape[0]],
        "inside": isinstance(picture, rl.EnvironmentMap) and picture.mapping.name == "latlong",
        "tiles": tiles,
    }  # fmt: skip
    modules = {name: (PAGE / name).read_text(encoding="utf-8") for name in MODULES}
    content = json.dumps({"facts": facts, "modules": modules}).replace("<", "\\u003c")
    page = (PAGE / "notebook.html").read_text(encoding="utf-8").replace("CONTENT", content, 1)
    return Shown(page, height)


def _pixels_of(picture: Picture) -> tuple[np.ndarray, str]:
    values = picture if isinstance(picture, np.ndarray) else getattr(picture, "radiance", None)
    if not isinstance(values, np.ndarray) or values.ndim != 3 or values.shape[2] != 3 or values.size == 0:
        found = f"of shape {values.shape}" if isinstance(values, np.ndarray) else f"of type {type(picture).__name__}"
        raise ValueError(
            f"the picture is {found}; show a radiance map, an environment map, a render, or linear pixels (H, W, 3)"
        )
    return np.ascontiguousarray(values, np.float32), str(getattr(picture, "unit", "relative"))
