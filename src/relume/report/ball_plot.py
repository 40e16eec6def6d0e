"""A mirrored ball's rim as it was taken, or what it might be, drawn on its photographs: `relume probe --picture`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.errors import BallNotFound
from relume.image.colour import luminance
from relume.probe.ball.silhouette import Cone
from relume.probe.ball.unwrapping import BallView
from relume.report.plots import encoded_figure, exposed_at, smaller
from relume.virtual_camera.developing import develop

MARGIN = 0.25
"""Radii shown beside the ball: enough to see what is behind it go on."""
_RIM, _RIVAL = "#00e0ff", "#ffb000"


def rim_plot(views: Sequence[BallView], names: Sequence[str]) -> bytes:
    """Each view's ball with its rim, and the curves that might be the rim instead, as bytes of PNG.

    views : of the ball
    names : of the views, as many

    The pictures are developed so that the median of the ball is middle grey.
    """
    from matplotlib.figure import Figure

    across = min(len(views), 3)
    down = -(-len(views) // across)
    figure = Figure(figsize=(7.0 * across, 7.5 * down), dpi=100, layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for axis in panels:
        axis.set_axis_off()
    for axis, view, name in zip(panels, views, names, strict=False):
        _draw(axis, view, name)
    return encoded_figure(figure)


def candidates_plot(refused: BallNotFound) -> bytes:
    """The picture in which no ball was found with the round things that it offers as picks, numbered, as bytes of PNG.

    refused : the error that was raised
    Raises ValueError for a refusal that holds no picture.
    """
    from matplotlib.figure import Figure

    if not isinstance(refused.radiance, np.ndarray):
        raise ValueError("the refusal holds no picture to draw on; find the ball with `probe_ball`")
    light = refused.radiance[..., :3]
    height, width = light.shape[:2]
    small = smaller(light)
    figure = Figure(figsize=(10.0, 10.0 * height / width + 0.8), dpi=100, layout="constrained")
    axis = figure.subplots()
    axis.set_axis_off()
    pixels = develop(small, exposed_at(float(np.median(luminance(small))))).pixels
    axis.imshow(pixels, extent=(0, width, height, 0), interpolation="nearest")
    turns = np.linspace(0, 2 * np.pi, 361)
    for number, (x, y, radius) in enumerate(refused.candidates, 1):
        axis.plot(x + radius * np.cos(turns), y + radius * np.sin(turns), color=_RIM if number == 1 else _RIVAL, lw=1.2)
        axis.text(x, y - radius, f" {number}: {x:.0f},{y:.0f},{radius:.0f} ", color="black", fontsize=9,
                  backgroundcolor=_RIM if number == 1 else _RIVAL, ha="center", clip_on=True)  # fmt: skip
    axis.set_xlim(0, width)
    axis.set_ylim(height, 0)
    words = "round things that may be picked (x,y,radius)" if refused.candidates else "nothing round is seen"
    axis.set_title(f"no mirrored ball found: {words}", fontsize=10)
    return encoded_figure(figure)


def _draw(axis, view: BallView, name: str) -> None:
    width, height = view.picture.size
    (x, y), radius = view.outline.centre, view.outline.radius
    reach = (1 + MARGIN) * radius
    left, right = max(int(x - reach), 0), min(int(np.ceil(x + reach)), width)
    top, bottom = max(int(y - reach), 0), min(int(np.ceil(y + reach)), height)
    light = view.picture.radiance[top:bottom, left:right]
    down, across = np.ogrid[top + 0.5 : bottom, left + 0.5 : right]
    inside = luminance(light)[np.hypot(across - x, down - y) < radius]
    middle = float(np.median(inside)) if inside.size else 0.0
    axis.imshow(develop(light, exposed_at(middle)).pixels, extent=(left, right, bottom, top), interpolation="nearest")
    turns = np.linspace(0, 2 * np.pi, 361)
    for rival_x, rival_y, rival in view.outline.rivals[:2]:
        axis.plot(rival_x + rival * np.cos(turns), rival_y + rival * np.sin(turns), "--", color=_RIVAL, lw=0.9)
    rim, _ = Cone(view.axis, view.distance).silhouette((width, height), view.focal_length)
    rim = np.concatenate([rim, rim[:1]])
    axis.plot(rim[:, 0], rim[:, 1], color=_RIM, lw=0.9)
    axis.set_xlim(left, right)
    axis.set_ylim(bottom, top)
    words = f"{name}\nx {x:.1f}, y {y:.1f}, radius {radius:.1f}"
    axis.set_title(words + ("; dashed: seen about as well" if view.outline.rivals else ""), fontsize=9)
