"""Drawings of a light map, as bytes of PNG: with its axes (`relume info --draw`), and with the lights found in it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relume.image import files
from relume.image.colour import luminance
from relume.image.radiance import OUTSIDE, SATURATED
from relume.light.constellations.residual import glow_level
from relume.report.page import triple
from relume.report.plots import block_means, borders, encoded_figure, exposed_at, in_squares
from relume.sphere.audit import AXES, Audit
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.developing import develop

if TYPE_CHECKING:
    from relume.light.constellations.constellation import Constellation
    from relume.light.light_set import LightSet

STOPS = (4, 0, -4)
"""Brightest first: what hides in the dark, the whole, and what the lamps are."""
_WIDEST = 900
WIDE = 1600
"""Pixels across the picture of a constellation, about."""
LARGEST = 900.0
"""Square points of the strongest light's disc."""
CAPTION = 0.35
"""Inches above its map."""
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
    shown = in_squares(light.radiance, step).mean((1, 3))
    for axis, stops in zip(pictures, STOPS, strict=True):
        film = exposed_at(mean * 2.0**-stops)
        axis.imshow(develop(shown, film).pixels, extent=(0, 1, 1, 0), aspect=1 / aspect)
        _mark_unmeasured(axis, light, step)
        _name_axes(axis, light)
        axis.set_title(f"{_signed(stops)} stops: radiance {1 / film.exposure:.3g} is white", fontsize=8)
        axis.set_axis_off()
    figure.supxlabel(_in_words(measured), fontsize=8)
    return encoded_figure(figure)


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
    lines.append(f"irradiance from above {triple(up)}, from below {triple(down)}")
    marked = {SATURATED: measured.clipped, OUTSIDE: measured.unseen}
    lines += [f"{marked[code]:.3g} sr {words}" for code, _, words in _MARKS if marked[code]]
    return "\n".join(lines)


def _signed(stops: int) -> str:
    return f"{stops:+d}".replace("-", "−") if stops else "0"


def draw_lights(path: str | os.PathLike[str], made: LightSet, title: str = "") -> None:
    """Write a picture of a map with its regions and lights to a .png.

    path : .png
    made : the map with its lights, as `make_lights` made them
    title : above the drawing
    Raises OutputNotWritten.
    """
    path = Path(path)
    with files.replacing(path) as temporary:
        temporary.write_bytes(lights_plot(made.light, made.lights, title))


def lights_plot(light: EnvironmentMap, lights: Constellation, title: str = "") -> bytes:
    """The map, the borders of the regions and the lights as bytes of PNG, in the map's own mapping.

    Discs have the lights' colours, and areas in proportion to their irradiance; a cross marks each middle. The map is
    exposed for what is not a source: the mean of that becomes middle grey.
    """
    from matplotlib.figure import Figure

    rows, columns = light.radiance.shape[:2]
    values, areas = luminance(light.radiance), light.mapping.solid_angles(light.size)
    mean = glow_level(values, areas, 4.0) / 4 or float(values.max(initial=0)) or 1.0
    picture = develop(_sized(light.radiance), exposed_at(mean)).pixels.astype(np.float32) / 255
    if lights.labels is not None:
        picture[borders(_thinned(lights.labels))] = (0.1, 0.9, 0.9)
    wide = 12.0
    high = wide * rows / columns
    figure = Figure(figsize=(wide, high + CAPTION), dpi=WIDE / wide)
    axis = figure.add_axes((0, 0, 1, high / (high + CAPTION)))
    axis.imshow(picture, extent=(0, 1, 1, 0), aspect="auto", interpolation="antialiased")
    axis.set_axis_off()
    if len(lights.directions):
        u, v = np.moveaxis(light.mapping.image_points(lights.directions), -1, 0)
        strength = luminance(lights.irradiance)
        colours = lights.irradiance / np.maximum(lights.irradiance.max(axis=-1, keepdims=True), 1e-300)
        axis.scatter(u, v, s=LARGEST * strength / strength.max(), c=colours, ec="black", lw=0.8, alpha=0.85)
        axis.scatter(u, v, s=14, marker="+", c="#d0006f", lw=0.8)
    axis.set_xlim(0, 1)
    axis.set_ylim(1, 0)
    figure.text(0.01, 1 - 0.5 * CAPTION / (high + CAPTION), title, va="center", fontsize=10)
    return encoded_figure(figure)


def _sized(radiance: np.ndarray) -> np.ndarray:
    """The map at about the picture's size: blocks of pixels averaged, or pixels repeated."""
    step = -(-radiance.shape[1] // WIDE)
    return _thinned(radiance) if step == 1 else block_means(radiance.astype(np.float64), step)


def _thinned(image: np.ndarray) -> np.ndarray:
    """Every so many pixels of a large image, each several times of a small one."""
    step, times = -(-image.shape[1] // WIDE), max(WIDE // image.shape[1], 1)
    return np.repeat(np.repeat(image[::step, ::step], times, axis=0), times, axis=1)
