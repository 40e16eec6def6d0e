"""The picture of docs/how-to/light/wavelength.md: `python examples/spectral/figures.py OUT/`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import relume as rl
from relume.renderers.mitsuba.denoise import denoised_render

HERE = Path(__file__).parent
SHEET = {"prism": (256, 0.11), "diamond": (128, 0.75), "metals": (64, 1.1)}
"""Samples a pixel, and the exposure of each."""
SIZE = (400, 300)


def shown(name: str) -> np.ndarray:
    """A scene rendered, denoised and developed, (300, 400, 3) uint8."""
    read = rl.read_scene(HERE / f"{name}.toml")
    samples, exposure = SHEET[name]
    camera = read.camera.resized(*SIZE) if name != "diamond" else read.camera.resized(SIZE[1], SIZE[1])
    picture = denoised_render(rl.render(read.scene, camera, rl.Mitsuba(samples=samples)))
    pixels = rl.develop(picture.radiance, rl.Film(exposure)).pixels
    across = (SIZE[0] - pixels.shape[1]) // 2
    return np.pad(pixels, ((0, 0), (across, across), (0, 0)))


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/spectral")
    out.mkdir(parents=True, exist_ok=True)
    sheet = np.concatenate([shown(name) for name in SHEET], axis=1)
    rl.write(out / "spectral.jpg", rl.Photograph(sheet, "spectral"))
