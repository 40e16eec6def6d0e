"""The contact sheet: balls of every surface with their captions, below the light they are seen in."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from relume.image import files
from relume.image.colour import luminance
from relume.image.photograph import Photograph
from relume.renderers.prefiltered.contact_sheet import Ball, balls
from relume.report.plots import exposed_at
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_points
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.tone.display.lettering import Words, lettered

COLUMNS = 6
_MAP_COLUMNS = 4
_GAP, _MARGIN, _CAPTION = 28, 40, 58
_PAGE, _INK, _FAINT = 28, "#e8e6e1", "#9a978f"
NOTES = (
    "",
    "Above left, I: the environment map, its middle −Z,",
    "+X to its right. The balls are seen along −Z: their",
    "middles show what is behind the viewer, their rims",
    "what is behind them.",
    "",
    "D  I blurred by Lambert's law, looked up by N",
    "S  I blurred by the lobe, looked up by R",
    "N  the normal, E the way to the eye,",
    "R = 2(E·N)N − E",
)


def draw_reflection_sheet(
    path: str | os.PathLike[str],
    light: EnvironmentMap,
    title: str,
    stops: float = 0.0,
    progress: Callable[[float], None] = lambda share: None,
) -> None:
    """Write a picture, .png or .jpg, of balls of every surface under a map.

    path : .png or .jpg
    light : the map
    title : what the light is, as its file's name
    stops : to brighten by; at 0 the mean of the Lambert ball is middle grey
    progress : called with the share of the work that is done, 0 to 1
    """
    path = Path(path)
    made = balls(light, progress=progress)
    lambert = next(ball for ball in made if ball.caption == "Lambert")
    files.write(path, contact_sheet(made, light, exposed_for(lambert).brighter(stops), title))


def exposed_for(ball: Ball) -> Film:
    """The film on which the mean of a ball, the Lambert one, is middle grey."""
    return exposed_at(float((luminance(ball.radiance) * ball.matte).sum() / ball.matte.sum()))


def contact_sheet(balls: Sequence[Ball], light: EnvironmentMap, film: Film, title: str) -> Photograph:
    """The sheet as a picture: the map on top, then the balls in rows of six, all developed on one film.

    title : what the light is, as its file's name
    """
    size = balls[0].radiance.shape[0]
    rows, step = -(-len(balls) // COLUMNS), size + _GAP
    map_height = (_MAP_COLUMNS * step - _GAP) // 2
    top = _MARGIN + map_height + _GAP
    page = np.full((top + rows * (size + _CAPTION) + _MARGIN // 2, 2 * _MARGIN + COLUMNS * step - _GAP, 3), _PAGE)
    shown = develop(_seen(light, map_height), film).pixels
    page[_MARGIN : _MARGIN + map_height, _MARGIN : _MARGIN + 2 * map_height] = shown
    notes = (f"One light, one exposure: radiance {1 / film.exposure:.3g} is white.", *NOTES)
    beside = _MARGIN + _MAP_COLUMNS * step
    words = [Words(beside, _MARGIN + 4, title, 14, _INK)]
    words += [Words(beside, _MARGIN + 42 + 22 * line, note, 9, _FAINT) for line, note in enumerate(notes)]
    for index, ball in enumerate(balls):
        y, x = top + index // COLUMNS * (size + _CAPTION), _MARGIN + index % COLUMNS * step
        here = page[y : y + size, x : x + size]
        here[:] = np.rint(_PAGE + ball.matte[..., None] * (develop(ball.radiance, film).pixels - float(_PAGE)))
        words.append(Words(x, y + size + 6, ball.caption, 10, _INK))
        words.append(Words(x, y + size + 25, ball.section, 8, _FAINT))
    return Photograph(lettered(page.astype(np.uint8), words), "contact sheet")


def _seen(light: EnvironmentMap, height: int) -> np.ndarray:
    """The map as a lat-long picture of that height, a pixel being the mean of some look-ups."""
    finer = int(np.clip(np.ceil(light.size / height), 1, 6))
    points = pixel_points(LatLong(), height, finer)
    return light.lookup(LatLong().directions(points)).reshape(height, finer, 2 * height, finer, 3).mean((1, 3))
