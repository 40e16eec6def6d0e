"""The ball of one photograph, looked at while its rim is being drawn: where it is, and the light that it would show."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl
from relume.studio.pictures import open_picture
from relume.studio.words import in_the_page

ROWS = 128
"""Of the map that is shown beside the ball: drawn in a quarter of a second."""

USUAL_LENS = 1.2
"""Focal length where none is known, in lengths of the longer side: a camera's usual lens."""


def unwrapped(path: Path, rim: Sequence[float] | None, target: Path) -> dict[str, Any]:
    """Find the ball in a photograph, or take a rim as it is drawn, and write the light that it shows.

    path : one photograph of the ball; an encoded one is taken to be sRGB, as no response is known yet
    rim : x, y, radius in pixels, or three points or more; None to search
    target : .exr, a lat-long map seen from in front of the ball: the middle of the map lies behind it
    Returns the circle, how much of the rim was seen, and doubts, for JSON. Raises RelumeError, ValueError.
    """
    picture = open_picture(path)
    pixels = picture.layers[0].pixels
    light = rl.RadianceMap(np.maximum(np.nan_to_num(pixels), 0))
    outline = None if rim is None else _drawn(rim)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        view = rl.unwrap_ball(
            light, camera=np.array([0.0, 0.0, 1.0]), centre=np.zeros(3), outline=outline, name=path.name,
            focal_length=picture.focal_length or USUAL_LENS * max(light.size),
        )  # fmt: skip
        probe = rl.probe.blend_views([view], size=ROWS)
    rl.write(target, rl.as_radiance_map(probe.light))
    found = view.outline
    return {
        "rim": [round(float(each), 2) for each in (*found.centre, found.radius)],
        "points": np.round(found.points[:: max(1, len(found.points) // 72)], 2).tolist(),
        "coverage": round(float(found.coverage), 3),
        "unseen": round(float(probe.unseen_solid_angle), 3),
        "doubts": [in_the_page(str(each.message)) for each in caught],
    }


def _drawn(rim: Sequence[float]) -> Any:
    if len(rim) == 3 and rim[2] > 0:
        return rl.probe.outline_of_circle(*rim)
    if len(rim) >= 6 and len(rim) % 2 == 0:
        return rl.probe.outline_through(np.reshape(np.array(rim, np.float64), (-1, 2)))
    raise ValueError("a rim is x, y and radius, or three points or more, in pixels")
