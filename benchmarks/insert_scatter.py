"""What objects change of a room, by three renderers: efficiency = 1 / (error × seconds), from the scatter of seeds.

    python benchmarks/insert_scatter.py [--bpy PYTHON] [--quick]  # without an interpreter that has bpy no Cycles

One scene for all: the light measured from examples/room at infinity, a diffuse table, the five objects. All ways are
without bias, so that the variance over a few seeds is the error; no long references are needed. Of the pixels that no
object covers: the mean of squares, the same without the worst hundredth of the pixels, which fireflies decide, and
both relative to the square of the radiance that is seen there (relMSE). Seconds: of one call with the scene loaded and
kernels compiled, its trees built; Cycles keeps its from the picture before. By turns, but for Cycles, whose pictures
are all made by one process. Last, how much of a pass is its start. Once more at the size of the room's plate, where
relume spreads its rays by the noise (docs/decisions/0077), as it does for pictures of so many pixels.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from insert_scenes import Cycles, room
from measured import Rows, asked

import relume as rl
from relume.renderers.mitsuba.denoise import denoised
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import _mitsuba
from relume.renderers.mitsuba.scene import scene_dictionary

BOUNCES = 12
WORST = 0.01
A_PASS = 64
"""Rays a pixel that Mitsuba's pictures are made of at once."""

Estimate = Callable[[int, int], tuple[np.ndarray, float]]
"""From samples and a seed: the difference (H, W, 3) and the seconds it took."""
Runs = list[tuple[np.ndarray, float]]


@dataclass(frozen=True)
class Way:
    """A way to find the difference."""

    name: str
    estimate: Estimate


def ours(scene: rl.Scene, camera: rl.Camera, clean: bool = False, plate: np.ndarray | None = None) -> Estimate:
    """relume's change, of a scene made ready; cleaned as `relume insert` does where no plate is known."""
    ready = Differential(depth=BOUNCES).prepare(scene, camera)

    def estimate(samples: int, seed: int) -> tuple[np.ndarray, float]:
        start = time.perf_counter()
        asked = Differential(samples=samples, depth=BOUNCES)
        change = asked.change(scene, camera, seed=seed, prepared=ready, plate=plate)
        change = denoised(change) if clean else change
        return change.difference.astype(np.float64), time.perf_counter() - start

    return estimate


def _worlds(mi: Any, scenes: Sequence[rl.Scene], camera: rl.Camera, sampler: str) -> tuple[Any, list[Any]]:
    path = mi.load_dict({"type": "path", "max_depth": BOUNCES + 1, "rr_depth": 8})
    worlds = []
    for each in scenes:
        dictionary = scene_dictionary(mi, each, camera)
        dictionary["sensor"]["sampler"] = {"type": sampler}
        worlds.append(mi.load_dict(dictionary))
    return path, worlds


def _picture(mi: Any, path: Any, world: Any, samples: int, seed: int) -> np.ndarray:
    """Of at most A_PASS rays a pixel at once."""
    passes = max(round(samples / A_PASS), 1)
    seeds = [(seed * 1009 + index) % 2**31 for index in range(passes)]
    return np.mean(
        [np.array(mi.render(world, integrator=path, spp=samples // passes, seed=each)) for each in seeds], axis=0
    )


def path_pair(scene: rl.Scene, camera: rl.Camera, sampler: str, same_seed: bool) -> Estimate:
    """Mitsuba's own path tracer with the objects and without, as fast as it goes: no other planes."""
    with _mitsuba(None, None) as mi:
        path, worlds = _worlds(mi, (scene, scene.without_objects()), camera, sampler)

    def estimate(samples: int, seed: int) -> tuple[np.ndarray, float]:
        with _mitsuba(None, None) as mi:
            start = time.perf_counter()
            with_ = _picture(mi, path, worlds[0], samples, 2 * seed)
            without = _picture(mi, path, worlds[1], samples, 2 * seed + (0 if same_seed else 1))
            return with_ - without, time.perf_counter() - start

    return estimate


def plate_of(scene: rl.Scene, camera: rl.Camera) -> np.ndarray:
    """The radiance of the room without the objects, nearly without noise."""
    with _mitsuba(None, None) as mi:
        path, worlds = _worlds(mi, (scene.without_objects(),), camera, "multijitter")
        return _picture(mi, path, worlds[0], 256, 5)


def seen_beside(scene: rl.Scene, camera: rl.Camera) -> tuple[np.ndarray, rl.Change]:
    """Which pixels no object covers, and a change with planes to guide a denoiser."""
    change = Differential(samples=16).change(scene, camera, seed=5)
    cover = sum(Differential(samples=16, quick=True).change(scene, camera, seed=seed).matte for seed in (6, 7, 8))
    return (change.matte + cover) == 0, change


def cycles_ways(
    peer: Cycles, scene: rl.Scene, camera: rl.Camera, plate: np.ndarray, samples: int, seeds: Sequence[int],
    denoise: bool,
) -> dict[str, Runs]:  # fmt: skip
    """Cycles' shadow catcher, whose pass is a factor on the plate, and its pictures with and without the objects."""

    def job(name: str, number: int, seed: int, objects: bool, catcher: bool) -> dict[str, Any]:
        return {"name": name, "samples": number, "seed": seed, "objects": objects, "catcher": catcher,
                "denoise": denoise, "bounces": BOUNCES}  # fmt: skip

    # The first picture of a kind builds its trees, so one of a single sample goes before.
    jobs = []
    for kind, objects, catcher in (("catcher", True, True), ("with", True, False), ("without", False, False)):
        jobs.append(job(f"warm_{kind}", 1, 1, objects, catcher))
        jobs += [job(f"{kind}_{seed}", samples, seed + 7919 * (not objects), objects, catcher) for seed in seeds]
    done = peer.pictures(scene, camera, jobs)
    caught, pairs = [], []
    for seed in seeds:
        layers, seconds = done[f"catcher_{seed}"]
        caught.append((plate * (layers["Shadow Catcher"][..., :3] - 1), seconds))
        (with_, first), (without, second) = done[f"with_{seed}"], done[f"without_{seed}"]
        pairs.append((with_["Combined"][..., :3] - without["Combined"][..., :3], first + second))
    return {"Cycles, shadow catcher": caught, "Cycles, with and without": pairs}


def two_sided(difference: np.ndarray, seconds: float, guides: rl.Change) -> tuple[np.ndarray, float]:
    """Light taken and light added, each through Open Image Denoise; unchanged pixels stay 0."""
    import mitsuba_oidn

    start = time.perf_counter()
    planes = [np.ascontiguousarray(np.clip(guides.albedo, 0, 1)), np.ascontiguousarray(guides.normal)]
    parts = [np.ascontiguousarray(np.maximum(sign * difference, 0), np.float32) for sign in (1, -1)]
    smooth = np.subtract(*(np.asarray(mitsuba_oidn.denoise(part, *planes, hdr=True)) for part in parts))
    clean = np.where(np.any(difference != 0, axis=-1, keepdims=True), smooth, 0).astype(np.float64)
    return clean, seconds + time.perf_counter() - start


def compiled(ways: Sequence[Way], samples: int) -> None:
    """Run each way once, which compiles what another number of samples asks for."""
    for way in ways:
        way.estimate(samples, 1)


def compared(ways: Sequence[Way], samples: int, seeds: Sequence[int]) -> dict[str, Runs]:
    """The runs of each way, by turns."""
    runs: dict[str, Runs] = {way.name: [] for way in ways}
    for seed in seeds:
        for way in ways:
            runs[way.name].append(way.estimate(samples, seed))
    return runs


def error_rows(runs: Runs, plate: np.ndarray, beside: np.ndarray, truth: np.ndarray | None = None) -> dict[str, float]:
    """Error × seconds by each measure; the scatter of the runs, or what they are away from a truth."""
    seconds = float(np.median([each for _, each in runs]))
    differences = np.stack([difference for difference, _ in runs])[:, beside]
    squares = differences.var(axis=0, ddof=1) if truth is None else np.square(differences - truth[beside]).mean(axis=0)
    squares = squares.mean(axis=-1)
    relative = squares / np.square(plate[beside].mean(axis=-1))
    found = {}
    for name, values in (("squares", squares), ("relMSE", relative)):
        kept = np.sort(values)[: round(len(values) * (1 - WORST))]
        found |= {f"{name}, 99 %": float(kept.mean()) * seconds, name: float(values.mean()) * seconds}
    return found


def start_share(scene: rl.Scene, camera: rl.Camera, samples: int) -> float:
    """How much of the time of a change is what starting its passes takes: that of the same kernels over four pixels."""
    ready = Differential(depth=BOUNCES).prepare(scene, camera)
    change = Differential(samples=samples, depth=BOUNCES).change(scene, camera, seed=1, prepared=ready)
    a_pass = max(samples // change.passes, 1)
    launches = -(-change.passes // ready.together(a_pass))
    with _mitsuba(None, None):
        times = {}
        for name, count in (("whole", None), ("start", 4)):
            for _ in range(3):
                begun = time.perf_counter()
                pixels = np.arange(camera.width * camera.height)[:count]
                ready.of_pixels(pixels, a_pass, 3)
                ready._lit(16, [3]) if count else ready.lit(a_pass, 3)
                times[name] = time.perf_counter() - begun
    whole = times["start"] * launches + (times["whole"] - times["start"]) * change.passes
    return 100 * times["start"] * launches / whole


def main(rows: Rows, bpy: str | None, quick: bool) -> None:
    if quick:
        at_size(rows, bpy, 128, (64,), (11, 12))
    else:
        at_size(rows, bpy, 256, (32, 64, 256), (11, 12, 13))
        at_size(rows, bpy, 768, (64,), (11, 12, 13), ", 768 wide")
    if bpy is None:
        rows.absent("change, Cycles", "no --bpy was given", goal="change_cycles")


def at_size(
    rows: Rows, bpy: str | None, width: int, counts: Sequence[int], seeds: Sequence[int], size: str = ""
) -> None:
    """The rows of pictures so wide."""
    scene, camera = room(width)
    plate = plate_of(scene, camera)
    beside, _ = seen_beside(scene, camera)
    ways = [
        Way("relume", ours(scene, camera, plate=plate)),
        Way("two Mitsuba renders", path_pair(scene, camera, "multijitter", same_seed=False)),
        Way("two Mitsuba renders of one seed", path_pair(scene, camera, "multijitter", same_seed=True)),
    ]
    for samples in counts:
        if samples <= A_PASS:  # more are passes of as many
            compiled(ways, samples)
        runs = compared(ways, samples, seeds)
        if bpy is not None:
            runs |= cycles_ways(Cycles(bpy), scene, camera, plate, samples, seeds, denoise=False)
        found = {name: error_rows(each, plate, beside) for name, each in runs.items()}
        for name, measures in found.items():
            if name == "relume":
                continue
            goal = "change_cycles" if "Cycles" in name else "change_mitsuba"
            for measure, theirs in measures.items():
                mine = found["relume"][measure]
                rows.value(
                    f"change{size}, {samples} samples, {measure}", theirs / mine, "×",
                    goal=goal if "99 %" in measure else "", peer=name, ours=mine, theirs=theirs, note="error × seconds",
                )  # fmt: skip
        rows.value(f"starting the passes of {samples} samples{size}", start_share(scene, camera, samples), "%",
                   goal="pass_start")  # fmt: skip


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--bpy", metavar="PYTHON", help="an interpreter that has bpy; without it Cycles is left out")
    options = parser.parse_args()
    main(Rows(options.rows), options.bpy, options.quick)
