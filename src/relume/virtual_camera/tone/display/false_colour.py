"""Luminance in false colours, beside a scale that says what each stands for (Debevec & Malik 1997, Fig. 8d)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.image.colour import luminance
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.virtual_camera.tone.display.lettering import Words, lettered

_LEVELS = 256
_DARKEST = 0.1  # % of the lit pixels that may lie below the scale: a few specks would stretch it over decades
_PAGE, _UNKNOWN, _CONTOUR = 28, 128, 255
_PLAIN = 540  # rows of a picture whose scale is lettered in 10 points; others in proportion
_LOWEST_PAGE = 200
_ROWS = 64


def false_colour(
    picture: RadianceMap,
    *,
    low: float | None = None,
    high: float | None = None,
    colours: str = "turbo",
    contours: Sequence[float] = (),
) -> Photograph:
    """The picture with its luminance as colours on a logarithmic scale, and that scale with its decades at the right.

    low, high : luminance at both ends, in the picture's unit; what is beyond has the colour of its end. None takes
        the luminance that 0.1 % of the lit pixels are below, and that of the brightest pixel
    colours : a colour map of matplotlib. "turbo" has many hues, so that a colour is found again on the scale; "inferno"
        is the glow of a hot body, which stays in order when it is printed in grey
    contours : luminances along which a white line is drawn

    Black is black, and NaN is grey. Raises ValueError for a picture without light unless both ends are given, ends that
    are not 0 < low < high, and an unknown colour map.
    """
    import matplotlib

    if colours not in matplotlib.colormaps:
        raise ValueError(f'colours is "{colours}"; matplotlib has no such map: give "turbo", "viridis" or "inferno"')
    light = luminance(picture.radiance)
    low, high = _ends(light, low, high)
    table = np.rint(255 * matplotlib.colormaps[colours](np.linspace(0, 1, _LEVELS))[:, :3]).astype(np.uint8)
    scale = max(0.6, light.shape[0] / _PLAIN)
    height, width = max(light.shape[0], _LOWEST_PAGE), light.shape[1]
    page = np.full((height, width + round(150 * scale), 3), _PAGE, np.uint8)
    shown = page[: light.shape[0], :width]
    for begin in range(0, light.shape[0], _ROWS):
        shown[begin : begin + _ROWS] = _coloured(light[begin : begin + _ROWS], low, high, table)
    if contours:
        shown[_lines(light, np.sort(np.asarray(contours, np.float64)))] = _CONTOUR
    return Photograph(_with_scale(page, width, scale, low, high, table, picture.unit), "false colour")


def _ends(light: np.ndarray, low: float | None, high: float | None) -> tuple[float, float]:
    if low is None or high is None:
        lit = light[(light > 0) & np.isfinite(light)]
        if not lit.size:
            raise ValueError("the picture has no light to take a scale from; give low and high")
        brightest = float(lit.max())
        if high is None:
            high = brightest if low is None else max(brightest, 2 * low)
        if low is None:
            low = min(float(np.percentile(lit, _DARKEST)), high / 2)
    if not (0 < low < high < np.inf):
        raise ValueError(f"the scale is from {low:g} to {high:g}; expected 0 < low < high")
    return low, high


def _coloured(light: np.ndarray, low: float, high: float, table: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 of (H, W) luminance."""
    known = np.where(light > 0, light, low).astype(np.float64)
    share = np.log(np.clip(known, low, high) / low) / np.log(high / low)
    rows = table[np.rint((_LEVELS - 1) * share).astype(np.intp)]
    rows[light <= 0] = 0
    rows[np.isnan(light)] = _UNKNOWN
    return rows


def _lines(light: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """(H, W) bool, where a level lies between a pixel and its neighbour at the right or below."""
    above = np.searchsorted(levels, light, side="right")
    lines = np.zeros(light.shape, bool)
    lines[:, :-1] |= above[:, 1:] != above[:, :-1]
    lines[:-1] |= above[1:] != above[:-1]
    return lines


def _with_scale(
    page: np.ndarray, left: int, scale: float, low: float, high: float, table: np.ndarray, unit: str
) -> np.ndarray:
    margin, points = round(28 * scale), 10 * scale
    top, bottom = round(52 * scale), page.shape[0] - round(24 * scale)
    bar = slice(left + margin, left + margin + round(26 * scale))
    page[top:bottom, bar] = table[np.linspace(_LEVELS - 1, 0, bottom - top).round().astype(int)][:, None]
    words = [Words(bar.start, round(16 * scale), unit, points)]
    for level in ticks(low, high):
        y = bottom - 1 - round((bottom - top - 1) * np.log(level / low) / np.log(high / low))
        page[y, bar.stop : bar.stop + round(8 * scale)] = 255
        words.append(Words(bar.stop + round(14 * scale), y, _name(level), points, level="center"))
    return lettered(page, words)


def ticks(low: float, high: float) -> list[float]:
    """The decades from low to high; where these are fewer than two, 1, 2 and 5 of each; else both ends."""
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    for steps in ((1,), (1, 2, 5)):
        # Through text, as 10 ** −1 and 5 · 10 ** −2 are not what 0.1 and 0.05 are read as.
        found = [level for power in powers for step in steps if low <= (level := float(f"{step}e{power}")) <= high]
        if len(found) > 1:
            return found
    return [low, high]


def _name(level: float) -> str:
    if 1e-3 <= level < 1e5:
        return f"{level:.4g}" if level < 1e4 else f"{level:.0f}"
    mantissa, power = f"{level:.2e}".split("e")
    step = f"{float(mantissa):g}"
    return f"$10^{{{int(power)}}}$" if step == "1" else f"${step}·10^{{{int(power)}}}$"
