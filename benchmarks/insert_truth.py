"""The renderer alone: given the true light and reflectance, how near is what it changes to what Cycles says?

    python benchmarks/insert_truth.py PYTHON_WITH_BPY COMPARE_TO_TRUTH.py [samples]

The measured room light at infinity, a diffuse table and five objects, exactly the same for both renderers, traced by
Cycles without a denoiser. Once with every object diffuse, where the two models are one formula, and once with the
objects' own materials, where plastic and rough metal differ between the two by design. Cycles traces each picture
twice: half of the difference of its two answers is the noise of their mean, which no renderer can be nearer to than.
The shoot's own truth is denoised by Cycles, so it cannot show this.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from insert_scenes import Cycles, room

import relume as rl
from relume.renderers.mitsuba.differential import Differential

WIDTH = int(os.environ.get("RELUME_BENCH_WIDTH", "96"))
"""Small, so that Cycles can trace thousands of rays a pixel: its caustics need them."""
BOUNCES = 12
OURS = 2048
"""Rays a pixel of relume: its own noise is then well below that of Cycles."""


def diffuse(scene: rl.Scene) -> rl.Scene:
    """The same shapes, each of one diffuse colour."""
    colours = ((0.8, 0.7, 0.2), (0.2, 0.6, 0.8), (0.5, 0.5, 0.5), (0.8, 0.2, 0.2), (0.7, 0.7, 0.7))
    objects = tuple(
        replace(mesh, material=rl.Diffuse(colours[index % len(colours)])) for index, mesh in enumerate(scene.objects)
    )
    return replace(scene, objects=objects)


def truths(peer: Cycles, scene: rl.Scene, camera: rl.Camera, samples: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Two pictures with the objects and two without, from seeds of their own."""
    jobs = [
        {"name": f"{name}{half}", "samples": samples, "seed": 10 * half + objects, "objects": objects,
         "catcher": False, "denoise": False, "bounces": BOUNCES}
        for name, objects in (("with", True), ("without", False)) for half in (1, 2)
    ]  # fmt: skip
    done = peer.pictures(scene, camera, jobs)
    seen = {name: layers["Combined"][..., :3] for name, (layers, _) in done.items()}
    return [seen["with1"], seen["with2"]], [seen["without1"], seen["without2"]]


def compared(peer: Cycles, compare: str, scene: rl.Scene, camera: rl.Camera, samples: int) -> str:
    """The line that the shoots' own tool prints, and how far Cycles is from itself."""
    with_, without = truths(peer, scene, camera, samples)
    plate, full = np.mean(without, axis=0), np.mean(with_, axis=0)
    change = Differential(samples=OURS, depth=BOUNCES).change(scene, camera, seed=1)
    matte = change.matte[..., None]
    composite = plate * (1 - matte) + change.difference + change.objects
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        planes = {
            "plate": plate, "with_all": full, "mask_all": np.repeat(matte, 3, -1), "composite": composite,
        }  # fmt: skip
        for name, plane in planes.items():
            rl.write(folder / f"{name}.exr", rl.RadianceMap(np.maximum(plane, 0).astype(np.float32)))
        run = [sys.executable, compare, str(folder / "composite.exr"), str(folder)]
        line = subprocess.run(run, capture_output=True, text=True, check=True).stdout.strip()
    around = (change.matte < 0.01) & (np.abs(full - plate).sum(-1) / (plate.sum(-1) + 1e-6) > 0.03)
    halves = [a - b for a, b in zip(with_, without, strict=True)]
    noise = np.abs(halves[0] - halves[1])[around].sum() / 2 / np.abs(full - plate)[around].sum()
    own = np.sqrt(2 / np.pi) * np.sqrt(change.difference_variance[around]).sum() / np.abs(full - plate)[around].sum()
    return f"{line}\n    effect_error of noise alone: Cycles {noise:.4f}, relume {own:.4f}"


def main(python: str, compare: str, samples: int) -> None:
    peer = Cycles(python)
    scene, camera = room(WIDTH)
    print(f"{camera.width}×{camera.height}; Cycles 2 × {samples} rays a pixel, relume {OURS}")
    print("objects all diffuse:\n   ", compared(peer, compare, diffuse(scene), camera, samples), flush=True)
    print("objects as they are:\n   ", compared(peer, compare, scene, camera, 4 * samples), flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 3 or not all(Path(p).is_file() for p in sys.argv[1:3]):
        print(__doc__)
    else:
        main(sys.argv[1], sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 2048)
