"""The pictures of radiosity and the irradiance cache in docs: `python examples/cornell_box/figures.py OUT/`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import relume as rl

HERE = Path(__file__).parent
SIZE = 200
STEPS = (1, 20, 200)
"""Shots after which the box is shown."""


def pixels(radiance: np.ndarray) -> np.ndarray:
    """Radiance as an sRGB picture (H, W, 3) uint8; what is brighter than 1 is white."""
    linear = np.clip(radiance, 0, 1)
    curved = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(255 * curved).astype(np.uint8)


def written(out: Path, name: str, pictures: list[np.ndarray]) -> None:
    """Pictures side by side."""
    sheet = np.concatenate([pixels(picture) for picture in pictures], axis=1)
    rl.write(out / name, rl.Photograph(np.ascontiguousarray(sheet), name))


def radiosity_figures(out: Path, scene: rl.Scene, camera: rl.Camera) -> None:
    """The steps with and without the ambient term, then patches, interpolation and a final gathering."""
    flat = rl.renderers.Radiosity(flat=True, outlines=True, samples=9)
    for name, method in (("shots", replace(flat, ambient=False)), ("ambient", flat)):
        shown = []
        for step in method.prepared(scene).steps(camera):
            if step.shots in STEPS:
                shown.append(step.radiance)
            if step.shots == STEPS[-1]:
                break
        written(out, f"radiosity_{name}.jpg", shown)
    kinds = (flat, replace(flat, flat=False, outlines=False), rl.renderers.Radiosity(gather=64, samples=16))
    written(out, "radiosity.jpg", [rl.render(scene, camera, kind).radiance for kind in kinds])


def cache_figures(out: Path, scene: rl.Scene, camera: rl.Camera) -> None:
    """Direct light, the records, and the picture."""
    method = rl.renderers.IrradianceCache(samples=9)
    kinds = (replace(method, bounces=0), replace(method, records=True, error=0.4), replace(method, shadow_rays=16))
    written(out, "irradiance_cache.jpg", [rl.render(scene, camera, kind).radiance for kind in kinds])


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/cornell_box")
    out.mkdir(parents=True, exist_ok=True)
    read = rl.read_scene(HERE / "measured.toml")
    camera = read.camera.resized(SIZE, SIZE)
    radiosity_figures(out, read.scene, camera)
    cache_figures(out, read.scene, camera)
