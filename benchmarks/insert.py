"""What objects change of a room, by three renderers: efficiency = 1 / (mean squared error × seconds), two cores.

    python benchmarks/insert.py [--bpy PYTHON]        # without it, Cycles is left out

One scene for all: the light measured from examples/room at infinity, a diffuse table, the five objects; 384×256. The
error is that of the signed difference with − without, all channels, over the pixels that no object touches, against
each renderer's own long render from other seeds. Two pictures of Mitsuba are measured against relume's long render,
which has the same mean (tests/physics/test_differential_against_subtraction.py). Seconds: of one call, median of three,
kernels already compiled; "net" takes off the same call with the fewest samples, and so loading and building.
RELUME_BENCH_WIDTH makes the picture smaller for a trial.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from insert_scenes import Cycles, room
from measured import Rows, asked

import relume as rl
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import _mitsuba
from relume.renderers.mitsuba.scene import scene_dictionary

REFERENCE = 16
"""How many times as long the references take; their own noise adds a sixteenth to the errors, alike for all."""
WIDTH = int(os.environ.get("RELUME_BENCH_WIDTH", "384"))
BOUNCES = 12

Estimate = Callable[[int, int], tuple[np.ndarray, float]]
"""From samples and a seed: the difference (H, W, 3) and the seconds it took."""


@dataclass(frozen=True)
class Way:
    """A way to find the difference.

    samples, fewest : rays a pixel, so many that it takes 5 to 10 s on two cores at 384×256, and the least it can do
    reference : the name of the way whose long render is its truth
    """

    name: str
    estimate: Estimate
    samples: int
    fewest: int
    reference: str


@dataclass(frozen=True)
class Row:
    """What was measured of one way.

    error : mean squared error
    typical : the same without the worst hundredth of the values, which fireflies decide
    """

    way: Way
    seconds: float
    net: float
    error: float
    typical: float


def denoised_difference(change) -> np.ndarray:
    """Light taken and light added, each through Open Image Denoise; unchanged pixels stay 0."""
    import mitsuba_oidn

    guides = [np.ascontiguousarray(np.clip(change.albedo, 0, 1)), np.ascontiguousarray(change.normal)]
    more, less = (np.ascontiguousarray(np.maximum(sign * change.difference, 0)) for sign in (1, -1))
    smooth = np.subtract(*(np.asarray(mitsuba_oidn.denoise(part, *guides, hdr=True)) for part in (more, less)))
    return np.where(np.any(change.difference != 0, axis=-1, keepdims=True), smooth, 0)


def ours(scene: rl.Scene, camera: rl.Camera, denoise: bool) -> Estimate:
    def estimate(samples: int, seed: int) -> tuple[np.ndarray, float]:
        start = time.perf_counter()
        change = Differential(samples=samples, depth=BOUNCES).change(scene, camera, seed=seed)
        difference = denoised_difference(change) if denoise else change.difference
        return difference.astype(np.float64), time.perf_counter() - start

    return estimate


def path_pair(scene: rl.Scene, camera: rl.Camera, sampler: str, same_seed: bool) -> Estimate:
    """Mitsuba's own path tracer, as fast as it goes: no other planes, passes of at most 64 rays a pixel."""
    with _mitsuba(None, None) as mi:
        path = mi.load_dict({"type": "path", "max_depth": BOUNCES + 1, "rr_depth": 8})
        worlds = []
        for each in (scene, scene.without_objects()):
            dictionary = scene_dictionary(mi, each, camera)
            dictionary["sensor"]["sampler"] = {"type": sampler}
            worlds.append(mi.load_dict(dictionary))

    def picture(mi, world, samples: int, seed: int) -> np.ndarray:
        passes = max(round(samples / 64), 1)
        total = np.zeros((camera.height, camera.width, 3))
        for index in range(passes):
            total += np.array(
                mi.render(world, integrator=path, spp=samples // passes, seed=(seed * 1009 + index) % 2**31)
            )
        return total / passes

    def estimate(samples: int, seed: int) -> tuple[np.ndarray, float]:
        with _mitsuba(None, None) as mi:
            start = time.perf_counter()
            with_ = picture(mi, worlds[0], samples, 2 * seed)
            without = picture(mi, worlds[1], samples, 2 * seed + (0 if same_seed else 1))
            return with_ - without, time.perf_counter() - start

    return estimate


def denoise_pair(with_: rl.Render, without: rl.Render) -> tuple[rl.Render, rl.Render]:
    """The same two renders with less noise.

    The picture without objects is denoised alone, and so is what the objects cover. Beside them the light that they
    take and the light that they add are denoised each on its own: the noise that both renders share has cancelled
    there. Pixels where the two were equal stay equal to the bit.
    """
    import mitsuba_oidn

    def clean(radiance: np.ndarray, guide: rl.Render) -> np.ndarray:
        picture = np.ascontiguousarray(np.maximum(radiance, 0), np.float32)
        albedo, normal = (np.ascontiguousarray(p, np.float32) for p in (guide.albedo, guide.normal))
        return np.asarray(mitsuba_oidn.denoise(picture, np.clip(albedo, 0, 1), normal, hdr=True))

    smooth = clean(without.radiance, without)
    difference = with_.radiance - without.radiance
    covered = clean(with_.radiance, with_)
    cover = with_.matte[..., None]
    outside = difference * (1 - cover)
    beside = smooth + clean(np.maximum(outside, 0), with_) - clean(np.maximum(-outside, 0), with_)
    equal = (cover == 0) & np.all(difference == 0, axis=-1, keepdims=True)
    radiance = np.where(equal, smooth, cover * covered + (1 - cover) * beside)
    return replace(with_, radiance=radiance.astype(np.float32)), replace(without, radiance=smooth)


def denoised_pair(scene: rl.Scene, camera: rl.Camera) -> Estimate:
    """relume's plain subtraction: two renders of one seed, their difference denoised."""

    def estimate(samples: int, seed: int) -> tuple[np.ndarray, float]:
        start = time.perf_counter()
        first = rl.Mitsuba(samples, depth=BOUNCES).render(scene, camera, seed=seed)
        again = replace(rl.Mitsuba(samples, depth=BOUNCES), passes=first.passes)
        second = again.render(scene.without_objects(), camera, seed=seed)
        first, second = denoise_pair(first, second)
        return first.radiance.astype(np.float64) - second.radiance, time.perf_counter() - start

    return estimate


def cycles(peer: Cycles, scene: rl.Scene, camera: rl.Camera, *, catcher: bool, same_seed: bool, denoise: bool):
    """Blender's ways. The shadow catcher's pass is a factor on the plate: what it changes is plate · (factor − 1)."""

    def job(name: str, samples: int, seed: int, objects: bool) -> dict:
        return {"name": name, "samples": samples, "seed": seed, "objects": objects, "catcher": catcher,
                "denoise": denoise, "bounces": BOUNCES}  # fmt: skip

    plate: list[np.ndarray] = []

    def estimate(samples: int, seed: int) -> tuple[np.ndarray, float]:
        # The first picture of a process builds the scene's trees, so one of a single sample goes before.
        warm = [job("warm", 1, 1, True), job("warm_without", 1, 1, catcher)]
        if catcher:
            done = peer.pictures(scene, camera, [*warm, job("with", samples, seed, True)])
            layers, seconds = done["with"]
            if not plate:
                plate.append(long_plate(peer, scene, camera))
            return plate[0] * (layers["Shadow Catcher"] - 1), seconds
        other = seed if same_seed else seed + 7919
        pair = [job("with", samples, seed, True), job("without", samples, other, False)]
        done = peer.pictures(scene, camera, [*warm, *pair])
        (with_, first), (without, second) = done["with"], done["without"]
        return with_["Combined"][..., :3] - without["Combined"][..., :3], first + second

    return estimate


def long_plate(peer: Cycles, scene: rl.Scene, camera: rl.Camera) -> np.ndarray:
    """The real scene alone as the photograph would have it: nearly without noise."""
    job = {"name": "plate", "samples": 1024, "seed": 4711, "objects": False, "catcher": False, "denoise": False,
           "bounces": BOUNCES}  # fmt: skip
    return peer.pictures(scene, camera, [job])["plate"][0]["Combined"][..., :3]


def measured(way: Way, truth: np.ndarray, beside: np.ndarray) -> Row:
    """Three runs; the medians of their errors and seconds."""
    way.estimate(way.fewest, 1)  # compiles
    least = float(np.median([way.estimate(way.fewest, seed)[1] for seed in (1, 2, 3)]))
    runs = [way.estimate(way.samples, seed) for seed in (11, 12, 13)]
    squares = [np.sort(((difference - truth)[beside] ** 2).ravel()) for difference, _ in runs]
    seconds = float(np.median([s for _, s in runs]))
    error, typical = (float(np.median([s[: round(len(s) * share)].mean() for s in squares])) for share in (1, 0.99))
    return Row(way, seconds, max(seconds - least, 1e-9), error, typical)


def main(rows: Rows, python: str | None, quick: bool) -> None:
    scene, camera = room(96 if quick else WIDTH)
    own = ours(scene, camera, False)
    matte = Differential(samples=64).change(scene, camera, seed=5).matte
    ways = [
        Way("relume, differential", own, 64, 4, "relume"),
        Way(
            "Mitsuba with − without, independent seeds",
            path_pair(scene, camera, "independent", False),
            128,
            4,
            "relume",
        ),
        Way("the same, multi-jittered", path_pair(scene, camera, "multijitter", False), 128, 4, "relume"),
        Way("Mitsuba with − without, one seed", path_pair(scene, camera, "independent", True), 128, 4, "relume"),
    ]
    cleaned = [
        Way("relume, differential + OIDN", ours(scene, camera, True), 64, 4, "relume"),
        Way("Mitsuba with − without, one seed + OIDN", denoised_pair(scene, camera), 128, 4, "relume"),
    ]
    longer = 1 if quick else REFERENCE
    truths = {"relume": own(64 * longer, 1001)[0]}
    if python is not None:
        peer = Cycles(python)

        def way(catcher: bool, same: bool, denoise: bool) -> Estimate:
            return cycles(peer, scene, camera, catcher=catcher, same_seed=same, denoise=denoise)

        ways += [
            Way("Cycles, shadow catcher", way(True, False, False), 64, 1, "Cycles, catcher"),
            Way("Cycles with − without, two seeds", way(False, False, False), 48, 1, "Cycles, pair"),
            Way("Cycles with − without, one seed", way(False, True, False), 48, 1, "Cycles, pair"),
        ]
        cleaned += [
            Way("Cycles, shadow catcher + OIDN", way(True, False, True), 64, 1, "Cycles, catcher"),
            Way("Cycles with − without, one seed + OIDN", way(False, True, True), 48, 1, "Cycles, pair"),
        ]
        truths["Cycles, catcher"] = way(True, False, False)(64 * longer, 1001)[0]
        truths["Cycles, pair"] = way(False, False, False)(48 * longer, 1001)[0]
    print(f"{camera.width}×{camera.height}, {BOUNCES} bounces, {os.cpu_count()} processors")
    print("Last columns: 1 / (error × net seconds), the first row = 1; the same without the worst hundredth of values.")
    print("| | rays a pixel | seconds (net) | mean squared error | without the worst 1 % | efficiency | without 1 % |")
    print("|---|---|---|---|---|---|---|")
    for group in (ways, cleaned):
        first: Row | None = None
        for each in group:
            row = measured(each, truths[each.reference], matte == 0)
            if first is not None:
                what = f"what objects change, {each.samples} samples: efficiency by {each.name}"
                goal = "change_cycles" if "Cycles" in each.name else "change_mitsuba"
                better = row.typical * row.net / (first.typical * first.net)
                rows.value(f"{what}, without the worst 1 %, long references", better, "×", goal=goal)
            first = first or row
            shares = [
                first.error * first.net / (row.error * row.net),
                first.typical * first.net / (row.typical * row.net),
            ]
            times = f"{row.seconds:.1f} ({row.net:.1f}) | {row.error:.3g} | {row.typical:.3g}"
            listed = " | ".join(f"{share:.3g} = 1/{1 / share:.3g}" for share in shares)
            print(f"| {each.name} | {each.samples} | {times} | {listed} |", flush=True)
    for name, truth in truths.items():
        print(f"mean difference beside the objects, {name}: {truth[matte == 0].mean(0).round(4).tolist()}")


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--bpy", metavar="PYTHON", help="an interpreter that has bpy")
    options = parser.parse_args()
    main(Rows(options.rows), options.bpy, options.quick)
