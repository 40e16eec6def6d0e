"""A light map at three exposures with its axes, as bytes of PNG: what `relume info --draw` shows."""

from __future__ import annotations

import io

import numpy as np

from relume.image.colour import luminance
from relume.image.radiance import OUTSIDE, SATURATED
from relume.sphere.audit import AXES, Audit
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

STOPS = (4, 0, -4)
"""Brightest first: what hides in the dark, the whole, and what the lamps are."""
MIDDLE_GREY = 0.18
_WIDEST = 900
_MARKS = ((SATURATED, "#ff3030", "clipped: a lower bound"), (OUTSIDE, "#30a0ff", "seen by no view: filled in"))


def light_plot(light: EnvironmentMap, title: str) -> bytes:
    """The map as its file lays it out, at three exposures, each axis of the world marked, over its energy audit.

    At 0 stops the mean radiance, by solid angle, is middle grey.
    """
    from matplotlib.figure import Figure

    measured = light.audit()
    mean = float(luminance(measured.total)) / float(light.mapping.solid_angles(light.size).sum())
    rows, columns = light.radiance.shape[:2]
    step = max(1, -(-columns // _WIDEST))
    aspect = columns / rows
    # Wide maps are stacked, others stand side by side.
    down, across = (3, 1) if aspect > 1.4 else (1, 3)
    width = 9.0 if across == 1 else 12.0
    height = down * (width / across) / aspect + 0.35 * down + 1.0
    figure = Figure(figsize=(width, height), dpi=100, layout="constrained")
    figure.suptitle(f"{title}: {light.mapping.name}, {columns}×{rows}, {light.unit}", fontsize=11)
    pictures = figure.subplots(down, across, squeeze=False).ravel()
    for axis, stops in zip(pictures, STOPS, strict=True):
        film = Film(2.0**stops * MIDDLE_GREY / mean) if mean > 0 else Film()
        axis.imshow(develop(_smaller(light.radiance, step), film).pixels, extent=(0, 1, 1, 0), aspect=1 / aspect)
        _mark_unmeasured(axis, light, step)
        _name_axes(axis, light)
        axis.set_title(f"{_signed(stops)} stops: radiance {1 / film.exposure:.3g} is white", fontsize=8)
        axis.set_axis_off()
    figure.supxlabel(_in_words(measured), fontsize=8)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


def _smaller(radiance: np.ndarray, step: int) -> np.ndarray:
    """The mean of step × step pixels; a remainder at the right and below is left out."""
    rows, columns = radiance.shape[0] // step, radiance.shape[1] // step
    return radiance[: rows * step, : columns * step].reshape(rows, step, columns, step, 3).mean((1, 3))


def _mark_unmeasured(axis, light: EnvironmentMap, step: int) -> None:
    if light.clipped is None:
        return
    for code, colour, _ in _MARKS:
        here = light.clipped[::step, ::step] == code
        if here.any() and not here.all():
            rows, columns = here.shape
            axis.contour(
                (np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows, here, [0.5], colors=colour,
                linewidths=0.8,
            )  # fmt: skip


def _name_axes(axis, light: EnvironmentMap) -> None:
    for name in AXES:
        direction = np.zeros(3)
        direction["XYZ".index(name[1])] = 1.0 if name[0] == "+" else -1.0
        x, y = light.mapping.image_points(direction)
        if not np.isfinite(x):
            continue
        label = name.replace("-", "−")
        axis.plot(x, y, "+", color="white", ms=7, mew=2.5, clip_on=False)
        axis.plot(x, y, "+", color="black", ms=6, mew=1, clip_on=False)
        # Where the axis lies on the picture's border the name goes inwards.
        side, lift = ("right" if x > 0.9 else "left"), (-1 if y > 0.9 else 1)
        axis.annotate(
            label, (x, y), xytext=(-5 if side == "right" else 5, -4 * lift), textcoords="offset points", fontsize=8,
            ha=side, va="top" if lift > 0 else "bottom", color="white",
            bbox={"boxstyle": "round,pad=0.1", "fc": "black", "ec": "none", "alpha": 0.55},
        )  # fmt: skip


def _in_words(measured: Audit) -> str:
    facts = measured.facts()
    lines = [f"total {facts['total']}   peak {facts['peak']} towards {facts['peak direction']}"]
    up, down = measured.irradiance[2], measured.irradiance[3]
    lines.append("irradiance from above " + _three(up) + ", from below " + _three(down))
    marked = {SATURATED: measured.clipped, OUTSIDE: measured.unseen}
    lines += [f"{marked[code]:.3g} sr {words}" for code, _, words in _MARKS if marked[code]]
    return "\n".join(lines)


def _signed(stops: int) -> str:
    return f"{stops:+d}".replace("-", "−") if stops else "0"


def _three(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
