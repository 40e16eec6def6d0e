"""Whole pictures by `rl.Mitsuba` and by Blender's Cycles: the Cornell box, light through glass, balls in a place.

    python benchmarks/natural_light.py [--bpy PYTHON] [--quick]      # without it, Cycles is left out

Efficiency = 1 / (error × seconds), of relMSE and of mean squared error, each also without the worst hundredth of the
values, which fireflies decide. Both renderers trace all light, with 12 bounces and nothing clamped. Seconds are of the
processors, of one call after a warm one, the median of three seeds.

The error is the distance to long renders, 64 times as many rays a pixel: to each renderer's own, so that neither is
blamed for the other's model, but below the glass to relume's for both: Cycles' long one has not found the light there
(`rl.Mitsuba`'s is checked against Mitsuba's `ptracer`). Where no Cycles is given, the long render is left out and the
error is the variance over the seeds. The means of both say whether the two render the same thing.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from insert_scenes import Cycles
from measured import Rows, asked
from natural_light_scenes import cornell_box, glass_caustic, natural_light

import relume as rl
from relume.renderers.mitsuba.denoise import denoised_render

BOUNCES, SEEDS, LONG = 12, (11, 12, 13), 64
HIDDEN = ("glass caustic",)
"""Scenes of which Cycles' own long render misses most of the light that is asked for."""
QUICK = "--quick" in sys.argv
WIDTH = 96 if QUICK else 256
Estimate = Callable[[int, int], tuple[np.ndarray, float]]
"""From samples and a seed: the picture (H, W, 3) and the seconds it took."""


@dataclass(frozen=True)
class Row:
    """What was measured of one way to render a scene; the second of each pair is without the worst hundredth."""

    name: str
    samples: int
    seconds: float
    squared: tuple[float, float]
    relative: tuple[float, float]
    mean: float


def ours(scene: rl.Scene, camera: rl.Camera, denoise: bool) -> Estimate:
    """By relume."""

    def estimate(samples: int, seed: int) -> tuple[np.ndarray, float]:
        begun = time.process_time()
        picture = rl.Mitsuba(samples=samples, depth=BOUNCES).render(scene, camera, seed=seed)
        if denoise:
            picture = denoised_render(picture)
        return picture.radiance.astype(np.float64), time.process_time() - begun

    return estimate


def theirs(peer: Cycles, scene: rl.Scene, camera: rl.Camera, denoise: bool) -> Estimate:
    """By Cycles, in a process whose first picture builds the scene."""

    def job(name: str, samples: int, seed: int) -> dict[str, object]:
        return {"name": name, "samples": samples, "seed": seed, "objects": True, "catcher": False,
                "denoise": denoise, "bounces": BOUNCES}  # fmt: skip

    def estimate(samples: int, seed: int) -> tuple[np.ndarray, float]:
        done = peer.pictures(scene, camera, [job("warm", 1, 1), job("picture", samples, seed)])
        layers, seconds = done["picture"]
        return layers["Combined"][..., :3], seconds

    return estimate


def trimmed(values: np.ndarray) -> tuple[float, float]:
    """The mean of all, and of all but the largest hundredth."""
    rising = np.sort(values.ravel())
    return float(rising.mean()), float(rising[: round(0.99 * rising.size)].mean())


def measured(name: str, estimate: Estimate, samples: int, truth: np.ndarray | None) -> Row:
    """Three pictures of other seeds: against a truth, or against each other where there is none."""
    estimate(4, 1)
    runs = [estimate(samples, seed) for seed in SEEDS]
    pictures = np.stack([picture for picture, _ in runs])
    mean = pictures.mean(0)
    squares = pictures.var(0, ddof=1) if truth is None else ((pictures - truth) ** 2).mean(0)
    level = mean if truth is None else truth
    relative = squares / (level**2 + 1e-2 * float(level.mean()) ** 2)
    seconds = float(np.median([each for _, each in runs]))
    return Row(name, samples, seconds, trimmed(squares), trimmed(relative), float(mean.mean()))


def printed(rows: Rows, title: str, row: Row, first: Row) -> None:
    """One row of a table; how many times as efficient relume is, by each measure."""
    pairs = zip((*row.relative, *row.squared), (*first.relative, *first.squared), strict=True)
    times = [theirs * row.seconds / (own * first.seconds) for theirs, own in pairs]
    figures = f"{row.seconds:.2f} | {row.relative[0]:.3g} | {row.relative[1]:.3g}"
    listed = " | ".join(f"{each:.3g}" for each in times)
    print(f"| {row.name} | {row.samples} | {figures} | {listed} | {row.mean:.5g} |", flush=True)
    if row is not first:
        for measure, better in zip(("relMSE", "relMSE without 1 %", "MSE", "MSE without 1 %"), times, strict=True):
            what = f"{title}, {row.samples} samples: efficiency by {row.name}, {measure}"
            rows.value(what, better, "×", ours=first.seconds, peer=row.name, theirs=row.seconds, limit="≥ 5")


def main(rows: Rows, python: str | None) -> None:
    peer = None if python is None else Cycles(python, processors=True)
    scenes = {"Cornell box": cornell_box, "glass caustic": glass_caustic, "natural light": natural_light}
    samples = 16 if QUICK else 64
    print(f"{WIDTH} pixels wide, {BOUNCES} bounces, {os.cpu_count()} processors")
    print("The four last but one: how often relume is as efficient, by relMSE, without 1 %, by MSE, without 1 %.")
    for title, make in scenes.items():
        scene, camera = make(WIDTH)
        truths: list[np.ndarray | None] = [None, None]
        if peer is not None:
            own = ours(scene, camera, False)(LONG * samples, 1001)[0]
            other = own if title in HIDDEN else theirs(peer, scene, camera, False)(LONG * samples, 1001)[0]
            truths = [own, other]
        for denoise in (False, True):
            print(f"\n{title}{', denoised' if denoise else ''}\n")
            print("| | rays a pixel | seconds | relMSE | without 1 % | × | × | × | × | mean |\n|" + "---|" * 10)
            ways = [("relume", ours(scene, camera, denoise))]
            if peer is not None:
                ways.append(("Cycles", theirs(peer, scene, camera, denoise)))
            first: Row | None = None
            for (name, way), truth in zip(ways, truths, strict=False):
                row = measured(name, way, samples, truth)
                first = first or row
                printed(rows, f"{title}{', denoised' if denoise else ''}", row, first)


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--bpy", metavar="PYTHON", help="an interpreter that has bpy")
    options = parser.parse_args()
    main(Rows(options.rows), options.bpy)
