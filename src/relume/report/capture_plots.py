"""Drawings of a measurement, as bytes of PNG: false colour, noise, alignment, ghosts and what was clipped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.image.colour import encode_srgb, luminance
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.report.plots import CHANNELS, WIDEST, encoded, encoded_figure, in_squares, smaller

MARKS = {SATURATED: (0.86, 0.1, 0.1), BLACK: (0.1, 0.35, 0.95), OUTSIDE: (0.2, 0.65, 0.2)}
"""Colours of what was saturated, black and outside in every photograph."""
GHOST = (1.0, 0.2, 0.8)


def false_colour(picture: RadianceMap) -> bytes:
    """Luminance in false colour on a logarithmic scale, with the scale beside it (Debevec & Malik 1997, Fig. 8d)."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    light = luminance(smaller(picture.radiance))
    if picture.clipped is not None:
        light[smaller((picture.clipped == OUTSIDE)[..., None].astype(np.float32))[..., 0] > 0.5] = np.nan
    seen = light[light > 0]
    low, high = np.percentile(seen, (0.05, 100)) if seen.size else (0.1, 1.0)
    figure = Figure(figsize=(9, 8 * light.shape[0] / light.shape[1] + 0.2), dpi=100, layout="constrained")
    axis = figure.subplots()
    axis.set_axis_off()
    # NaN, which is outside, stays white.
    image = axis.imshow(np.maximum(light, low), norm=LogNorm(low, max(high, 1.001 * low)), cmap="turbo")
    scale = figure.colorbar(image, ax=axis, fraction=0.046, pad=0.02, ticks=LogLocator(numticks=9))
    scale.set_label(f"luminance, {picture.unit}", fontsize=8)
    scale.ax.tick_params(labelsize=8)
    return encoded_figure(figure)


def relative_error(picture: RadianceMap) -> bytes:
    """Where the radiance is how uncertain: standard error over radiance, as a picture and against the radiance."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter

    assert picture.variance is not None
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.sqrt(picture.variance) / picture.radiance
    figure = Figure(figsize=(11, 3.6), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.2))
    shown = smaller(np.where(np.isfinite(relative), relative, np.nan)).max(axis=2)
    known = shown[np.isfinite(shown) & (shown > 0)]
    low, high = (float(p) for p in 100 * np.percentile(known, (1, 99))) if known.size else (0.1, 100.0)
    norm = LogNorm(low, max(high, 1.001 * low))
    image = left.imshow(100 * shown, norm=norm, cmap="viridis", interpolation="nearest")
    left.set_axis_off()
    scale = figure.colorbar(image, ax=left, fraction=0.046, pad=0.02)
    scale.set_label("standard error, % of the radiance", fontsize=8)
    # Most scales span less than two decades, in which powers of ten alone are one tick or none.
    scale.ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    scale.ax.yaxis.set_major_formatter("{x:g}")
    scale.ax.yaxis.set_minor_formatter(NullFormatter())
    scale.ax.tick_params(labelsize=7)
    for channel, (name, colour) in enumerate(CHANNELS):
        known = np.isfinite(relative[..., channel]) & (picture.radiance[..., channel] > 0)
        radiance, error = picture.radiance[..., channel][known], relative[..., channel][known]
        if radiance.size < 100:
            continue
        low, high = np.percentile(radiance, (0.1, 99.95))
        edges = np.geomspace(low, high, 41)
        bins = np.digitize(radiance, edges)
        medians = [np.median(error[bins == i]) if (bins == i).sum() > 20 else np.nan for i in range(1, 41)]
        right.loglog(np.sqrt(edges[1:] * edges[:-1]), 100 * np.array(medians), color=colour, lw=1.5, label=name)
    right.set_xlabel(f"radiance, {picture.unit}", fontsize=8)
    right.set_ylabel("median standard error, %", fontsize=8)
    right.yaxis.set_major_formatter("{x:g}")
    right.yaxis.set_minor_formatter("{x:g}")
    right.tick_params(labelsize=7, which="both")
    right.grid(alpha=0.25, which="both")
    if right.lines:
        right.legend(fontsize=7)
    return encoded_figure(figure)


def arrows(radiance: np.ndarray, fields: Sequence[tuple[str, np.ndarray]]) -> bytes:
    """How each photograph lay: arrows from where a point is to where that photograph showed it, all equally enlarged.

    fields : name and displacement (rows, columns, 2) in pixels (x to the right, y down) on an even grid
    """
    from matplotlib.figure import Figure

    height, width = radiance.shape[:2]
    columns = min(3 if len(fields) <= 6 else 5, len(fields))
    rows = -(-len(fields) // columns)
    figure = Figure(
        figsize=(11, 11 / columns * height / width * rows + 0.4 * rows + 0.3), dpi=100, layout="constrained"
    )
    axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    backdrop = 0.55 * _preview(radiance)
    longest = [float(np.hypot(field[..., 0], field[..., 1]).max()) for _, field in fields]
    enlarged = max(1.0, 0.1 * width / max(*longest, 1e-6))
    letters = int(95 / columns)  # of 8 points that fit over a panel
    for axis in axes:
        axis.set_axis_off()
    for axis, (name, field), length in zip(axes, fields, longest, strict=False):
        y = (np.arange(field.shape[0]) + 0.5) * height / field.shape[0]
        x = (np.arange(field.shape[1]) + 0.5) * width / field.shape[1]
        axis.imshow(backdrop, extent=(0, width, height, 0))
        axis.quiver(
            x, y, enlarged * field[..., 0], enlarged * field[..., 1],
            angles="xy", scale_units="xy", scale=1, color="#00e5ff", width=0.006,
        )  # fmt: skip
        axis.set_title(f"{_shortened(name, letters)}\nup to {length:.2f} px", fontsize=7)
    figure.suptitle(f"arrows drawn × {enlarged:.3g}", fontsize=8)
    return encoded_figure(figure)


def _shortened(name: str, letters: int) -> str:
    """A name's end: photographs of one camera differ there."""
    return name if len(name) <= letters else "…" + name[1 - letters :]


def marked(radiance: np.ndarray, masks: Sequence[tuple[np.ndarray, tuple[float, float, float]]]) -> bytes:
    """The picture in grey with masks (H, W) over it in their colours."""
    shown = np.repeat(luminance(_preview(radiance))[..., None], 3, axis=2) * 0.8 + 0.1
    for mask, colour in masks:
        # A single pixel of a large picture is not lost when it is made smaller.
        covered = in_squares(mask[..., None], -(-mask.shape[1] // WIDEST)).any((1, 3))
        shown = np.where(covered, 0.25 * shown + 0.75 * np.array(colour), shown)
    return encoded(np.rint(255 * np.clip(shown, 0, 1)).astype(np.uint8))


def clipped_marks(picture: RadianceMap) -> bytes:
    """What no photograph measured: saturated red, black blue, outside green."""
    assert picture.clipped is not None
    return marked(picture.radiance, [(picture.clipped == mark, colour) for mark, colour in MARKS.items()])


def _preview(radiance: np.ndarray) -> np.ndarray:
    """A small picture in 0…1 in which dark and bright places are both seen: radiance over itself plus its median."""
    small = np.maximum(smaller(radiance), 0)
    middle = float(np.median(luminance(small))) or 1.0
    return encode_srgb(small / (small + 2 * middle))
