"""What reports draw with: response curves over their data, pictures of radiance as PNG, figures as SVG."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from relume.image.bands import BAND
from relume.image.files.photographs import png
from relume.image.mapped_arrays import give_back_read
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relume.capture.response.calibration import Calibration

CHANNELS = (("red", "#c0392b"), ("green", "#27803f"), ("blue", "#2c5fb3"))
MIDDLE_GREY = 0.18
WIDEST = 1024
"""Pictures in the report are made at most this wide, so that the page stays a few megabytes."""


def response_plot(calibration: Calibration) -> bytes:
    """The curves over the observations, channel by channel with twice their standard error, and all together.

    After Debevec & Malik 1997, Fig. 7.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 3.2), dpi=110, layout="constrained")
    axes = figure.subplots(1, 4, sharex=True, sharey=True)
    values = np.arange(calibration.response.levels)
    curves = calibration.response.log_exposure
    errors = np.zeros_like(curves) if calibration.error is None else np.nan_to_num(calibration.error)
    for axis, (name, colour), curve, error, samples in zip(
        axes, CHANNELS, curves, errors, calibration.samples, strict=False
    ):
        axis.fill_betweenx(values, curve - 2 * error, curve + 2 * error, color=colour, alpha=0.25, lw=0)
        kept = samples[:: max(1, len(samples) // 2000)]
        axis.plot(kept[:, 0], kept[:, 1], "o", ms=2.5, mfc="none", mec="#999999", mew=0.4, alpha=0.6)
        for each in (axis, axes[3]):
            each.plot(curve, values, color=colour, lw=1.5)
        axis.set_title(name, fontsize=9)
    axes[3].set_title("red, green, blue", fontsize=9)
    middle = calibration.response.log_exposure[:, 4:-1]
    # Where a film's fog makes the curve level it goes on for ever; what was observed ends sooner.
    darkest = min(float(np.percentile(samples[:, 0], 0.5)) for samples in calibration.samples if len(samples))
    axes[0].set_xlim(max(float(middle.min()), darkest) - 0.3, float(middle.max()) + 0.5)
    axes[0].set_ylim(0, calibration.response.levels - 1)
    axes[0].set_ylabel("pixel value Z")
    for axis in axes:
        axis.set_xlabel("ln exposure X", fontsize=8)
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=7)
    return encoded_figure(figure)


def encoded_figure(figure: Figure, format: str = "png") -> bytes:
    """A file of this format, "png" or "svg", the same bytes for the same figure, whose layout then stands."""
    if format == "png":
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas = FigureCanvasAgg(figure)
        # `savefig` draws all twice, and lays it out each time: a third more time for the same pixels.
        if (layout := figure.get_layout_engine()) is not None:
            layout.execute(figure)
            figure.set_layout_engine("none")
        canvas.draw()
        return png.encode(np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3]))
    stream = io.BytesIO()
    figure.savefig(stream, format=format, metadata={"Date": None})
    return stream.getvalue()


def exposed_at(radiance: float) -> Film:
    """The film on which this radiance is middle grey."""
    return Film(MIDDLE_GREY / radiance) if radiance > 0 else Film()


def exposed(radiance: np.ndarray, white: float) -> bytes:
    """Radiance shown on the sRGB curve with `white` just white."""
    return encoded(develop(smaller(radiance), Film(1 / max(white, 1e-30))).pixels)


def signed(difference: np.ndarray, scale: float) -> bytes:
    """A signed difference about middle grey, as the paper's Fig. 8f: darker is light taken, brighter light added."""
    values = 0.5 + 0.5 * smaller(difference) / max(scale, 1e-30)
    return encoded(np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8))


def grey(image: np.ndarray) -> bytes:
    """Values from 0 to 1 as grey (a matte)."""
    values = np.rint(255 * np.clip(smaller(image[..., None]), 0, 1)).astype(np.uint8)
    return encoded(np.repeat(values, 3, axis=2))


def encoded(pixels: np.ndarray) -> bytes:
    """A PNG of 8-bit pixels."""
    return png.encode(np.ascontiguousarray(smaller(pixels)))


def smaller(image: np.ndarray) -> np.ndarray:
    """The image (H, W, C) at most `WIDEST` wide, by the means of squares of pixels."""
    step = -(-image.shape[1] // WIDEST)
    if step == 1:
        return image
    squares = in_squares(image, step)
    result = np.empty((squares.shape[0], squares.shape[2], squares.shape[4]), image.dtype)
    # In bands, between which what was read of a large plate's planes goes from memory.
    rows = max(1, BAND // (step * image.shape[1]))
    for top in range(0, len(squares), rows):
        result[top : top + rows] = squares[top : top + rows].mean((1, 3)).astype(image.dtype)
        give_back_read(image)
    return result


def in_squares(image: np.ndarray, step: int) -> np.ndarray:
    """Squares of step × step pixels, (rows, step, columns, step, C); a remainder at the right and below is left out."""
    rows, columns = image.shape[0] // step, image.shape[1] // step
    return image[: rows * step, : columns * step].reshape(rows, step, columns, step, image.shape[2])


def borders(labels: np.ndarray) -> np.ndarray:
    """Where the label (H, W) is not that of the pixel to the right or below."""
    found = np.zeros(labels.shape, bool)
    found[:, :-1] |= labels[:, :-1] != labels[:, 1:]
    found[:-1] |= labels[:-1] != labels[1:]
    return found


def block_means(image: np.ndarray, side: int) -> np.ndarray:
    """Means (rows, columns, C) of squares of pixels, those at the right and lower rim of what is left there."""
    tops, lefts = (np.arange(0, length, side) for length in image.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(image, tops, axis=0), lefts, axis=1)
    high, wide = np.diff(np.append(tops, image.shape[0])), np.diff(np.append(lefts, image.shape[1]))
    return sums / np.multiply.outer(high, wide)[..., None]
