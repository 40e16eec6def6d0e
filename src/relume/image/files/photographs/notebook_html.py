"""What a notebook shows of a value: a small picture at a fair exposure and a few facts, as HTML of its own."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from html import escape

import numpy as np

from relume.image.colour import encode_srgb, luminance
from relume.image.files.photographs import png

WIDEST = 320
"""Pixels of the picture: some 100 kB, so that a notebook of many values stays small."""
GREY = 0.18
COLOURS = ("#c0392b", "#27803f", "#2c5fb3")
PLOT = (320, 200)


def picture_html(radiance: np.ndarray, facts: Mapping[str, str]) -> str:
    """Radiance (H, W, 3) developed so that the median of what shines is middle grey, with facts beside it.

    What is no number is magenta. The exposure is among the facts, in stops.
    """
    step = max(1, -(-max(radiance.shape[:2]) // WIDEST))
    room = [(0, -size % step) for size in radiance.shape[:2]]
    small = np.pad(radiance.astype(np.float32), (*room, (0, 0)), mode="edge")
    # Means: a smaller picture of the same light.
    height, width = small.shape[:2]
    small = small.reshape(height // step, step, width // step, step, 3).mean(axis=(1, 3))
    odd = ~np.isfinite(small).all(axis=-1)
    level = luminance(np.where(odd[..., None], 0, small))
    lit = level[level > 0]
    stops = float(np.log2(GREY / np.median(lit))) if lit.size else 0.0
    seen = encode_srgb(np.clip(np.where(odd[..., None], 0, small) * np.float32(2.0**stops), 0, 1))
    codes = np.rint(255 * seen).astype(np.uint8)
    codes[odd] = (255, 0, 255)
    picture = base64.b64encode(png.encode(codes, b"")).decode("ascii")
    shown = f'<img alt="developed at {stops:+.1f} stops" src="data:image/png;base64,{picture}">'
    return laid_out(shown, {**facts, "shown at": f"{stops:+.1f} stops"})


def curves_html(values: np.ndarray, curves: np.ndarray, facts: Mapping[str, str]) -> str:
    """Curves (3, N) over values (N,) as a drawing, red, green and blue, with facts beside it."""
    width, height = PLOT
    step = max(1, len(values) // 128)
    x = (values[::step] - values[0]) / max(float(np.ptp(values)), 1e-12)
    low, high = float(curves.min()), float(curves.max())
    lines = []
    for curve, colour in zip(curves, COLOURS, strict=True):
        y = (curve[::step] - low) / max(high - low, 1e-12)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x * width, (1 - y) * height, strict=True))
        lines.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
    drawing = (
        f'<svg role="img" aria-label="curves" width="{width}" height="{height}" viewBox="-2 -2 {width + 4} '
        f'{height + 4}"><rect width="{width}" height="{height}" fill="none" stroke="#8888"/>{"".join(lines)}</svg>'
    )
    return laid_out(drawing, facts)


def laid_out(shown: str, facts: Mapping[str, str]) -> str:
    """A picture's HTML and facts, escaped, side by side."""
    rows = "".join(
        f'<tr><th style="text-align: left">{escape(name)}</th><td style="text-align: left">{escape(text)}</td></tr>'
        for name, text in facts.items()
    )
    return f'<div style="display: flex; gap: 1em; align-items: flex-start">{shown}<table>{rows}</table></div>'


def three(values: np.ndarray) -> str:
    """Red, green and blue to four digits."""
    return " ".join(f"{value:.4g}" for value in np.asarray(values, np.float64))
