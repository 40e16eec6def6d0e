"""One picture at several stops on a sheet: what its darks and lights hold (as in Tchou & Debevec 2001, Fig. 1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.resizing import resized
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.tone.display.lettering import Words, lettered

_PAGE, _GAP, _CAPTION, _POINTS = 28, 12, 26, 10.0


def stops_sheet(
    picture: RadianceMap,
    stops: Sequence[float] = (-4, -3, -2, -1, 0, 1, 2, 3, 4),
    film: Film | Callable[[np.ndarray], Photograph] = Film(),
    *,
    columns: int | None = None,
    width: int = 420,
) -> Photograph:
    """A sheet of the picture developed at each of `stops`, "−4" to "+4" below them.

    stops : factors of two that the radiance is multiplied by; four each way show 8 stops more than one photograph
    film : what develops it: a film, or a function of radiance (H, W, 3) float32 that gives an 8-bit photograph
    columns : None makes the sheet about as many wide as high
    width : of each picture, pixels, not above its own; larger ones are made smaller in linear light, before the film

    Raises ValueError for no stops, and for a function whose photographs are not 8-bit or of another size.
    """
    if not len(stops):
        raise ValueError("no stops are given; expected one or more, as (-2, 0, 2)")
    if width < 1 or (columns is not None and columns < 1):
        raise ValueError(f"width is {width} and columns {columns}; expected 1 or more")
    across, down = picture.size
    wide = min(width, across)
    small = resized(RadianceMap(picture.radiance), wide, max(1, round(down * wide / across))).radiance
    high = small.shape[0]
    columns = columns or int(np.ceil(np.sqrt(len(stops))))
    rows = -(-len(stops) // columns)
    size = (rows * (high + _CAPTION + _GAP) + _GAP, columns * (wide + _GAP) + _GAP, 3)
    page = np.full(size, _PAGE, np.uint8)
    words = []
    for index, stop in enumerate(stops):
        y, x = _GAP + index // columns * (high + _CAPTION + _GAP), _GAP + index % columns * (wide + _GAP)
        page[y : y + high, x : x + wide] = _developed(small * np.float32(2.0**stop), film)
        words.append(Words(x + wide / 2, y + high + 5, _signed(stop), _POINTS, align="center"))
    return Photograph(lettered(page, words), "stops")


def _developed(radiance: np.ndarray, film: Film | Callable[[np.ndarray], Photograph]) -> np.ndarray:
    shown = (develop(radiance, film) if isinstance(film, Film) else film(radiance)).pixels
    if shown.dtype != np.uint8 or shown.shape != radiance.shape:
        raise ValueError(f"the film gave {shown.shape} {shown.dtype}; expected {radiance.shape} uint8")
    return shown


def _signed(stop: float) -> str:
    return f"{stop:+g}".replace("-", "−") if stop else "0"
