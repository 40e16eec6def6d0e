"""The pictures of docs/how-to/whitted.md: `python examples/whitted/figures.py OUT/`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import relume as rl
from relume.project.scene_file.metering import metered_scene
from relume.renderers.whitted.ray_tree import ray_tree
from relume.report.ray_tree_plot import tree_plot

HERE = Path(__file__).parent
SHEET = ("figure_6", "figure_7", "figure_8", "teapot")
PIXEL = (330.5, 215.5)
"""Of figure 8: through the bubble, towards the mirrored sphere."""


def pixels(read: rl.SceneFile, picture: rl.Render) -> np.ndarray:
    """A render as `relume render` would develop it."""
    return rl.develop(picture.radiance, metered_scene(read.scene)).pixels


def rays_shown(rays: np.ndarray) -> np.ndarray:
    """How many rays each pixel asked for, black for one and white for a thousand."""
    shade = np.log10(np.maximum(rays, 1)) / 3
    return np.repeat(np.rint(255 * np.clip(shade, 0, 1)).astype(np.uint8)[..., None], 3, axis=2)


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/whitted")
    out.mkdir(parents=True, exist_ok=True)
    reads = {name: rl.read_scene(HERE / f"{name}.toml") for name in SHEET}
    renders = {name: rl.render(read.scene, read.camera, read.whitted) for name, read in reads.items()}
    shown = [pixels(reads[name], renders[name]) for name in SHEET]
    sheet = np.concatenate([np.concatenate(shown[:2], axis=1), np.concatenate(shown[2:], axis=1)])
    rl.write(out / "whitted_figures.jpg", rl.Photograph(sheet, "figures"))
    rays = renders["figure_8"].rays
    assert rays is not None
    rl.write(out / "whitted_rays.jpg", rl.Photograph(rays_shown(rays), "rays"))
    read = reads["figure_8"]
    tree = ray_tree(read.whitted.prepared(read.scene), read.camera, PIXEL)
    drawing = tree_plot(tree, read.scene, metered_scene(read.scene), "figure_8.toml, pixel 330,215")
    (out / "whitted_tree.png").write_bytes(drawing)
