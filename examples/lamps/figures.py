"""The picture of lamps in docs/how-to/natural-light: `python examples/lamps/figures.py [FOLDER]`, two minutes."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import relume as rl

HERE = Path(__file__).parent
EXPOSURES = {"caustics": 1.9, "milk": 2.1, "fog": 0.7}
SIZE = (400, 300)


def shown(name: str) -> np.ndarray:
    """A scene rendered, denoised and developed, (300, 400, 3) uint8."""
    read = rl.read_scene(HERE / f"{name}.toml")
    picture = rl.render(read.scene, read.camera.resized(*SIZE), rl.Mitsuba(samples=100, denoise=True))
    return rl.develop(picture.radiance, rl.Film(EXPOSURES[name])).pixels


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images")
    out.mkdir(parents=True, exist_ok=True)
    rl.write(out / "lamps.jpg", rl.Photograph(np.concatenate([shown(name) for name in EXPOSURES], axis=1), "lamps"))
