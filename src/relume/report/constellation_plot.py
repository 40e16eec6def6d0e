"""A constellation drawn over its map: the regions' borders, and a disc for each light, as large as it is strong."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from relume.image import files
from relume.image.colour import luminance
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.residual import glow_level
from relume.light.light_set import LightSet
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

WIDE = 1600
"""Pixels across the picture, about."""
LARGEST = 900.0
"""Square points of the strongest light's disc."""
CAPTION = 0.35
"""Inches above the map."""


def draw_lights(path: Path, made: LightSet, title: str = "") -> None:
    """Write a picture of a map with its regions and lights to a .png."""
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
    picture = develop(_sized(light.radiance), Film(0.18 / mean)).pixels.astype(np.float32) / 255
    if lights.labels is not None:
        picture[_borders(_thinned(lights.labels))] = (0.1, 0.9, 0.9)
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
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


def _sized(radiance: np.ndarray) -> np.ndarray:
    """The map at about the picture's size: blocks of pixels averaged, or pixels repeated."""
    rows, columns = radiance.shape[:2]
    step = -(-columns // WIDE)
    if step == 1:
        return _thinned(radiance)
    edges = np.add.reduceat(radiance.astype(np.float64), np.arange(0, rows, step), axis=0)
    sums = np.add.reduceat(edges, np.arange(0, columns, step), axis=1)
    high, wide = (np.diff(np.append(np.arange(0, count, step), count)) for count in (rows, columns))
    return sums / np.multiply.outer(high, wide)[..., None]


def _thinned(image: np.ndarray) -> np.ndarray:
    """Every so many pixels of a large image, each several times of a small one."""
    step, times = -(-image.shape[1] // WIDE), max(WIDE // image.shape[1], 1)
    return np.repeat(np.repeat(image[::step, ::step], times, axis=0), times, axis=1)


def _borders(labels: np.ndarray) -> np.ndarray:
    """Where the label is not that of the pixel to the right or below."""
    borders = np.zeros(labels.shape, bool)
    borders[:, :-1] |= labels[:, :-1] != labels[:, 1:]
    borders[:-1] |= labels[:-1] != labels[1:]
    return borders
