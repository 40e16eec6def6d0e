"""What the engine for many machines costs and gains.

`python benchmarks/cluster.py [empty | sequence | still | brackets]`, all of them unless named:

empty : milliseconds a task of the scheduler and the wire, at ten thousand tasks that do nothing
sequence : sixteen frames of a small shot by one worker and by two, in pairs, since other work shares the machine
still : the room at a quarter of its pixels, its passes by one process, by one worker and by two, in turn
brackets : a thousand small brackets of one camera, one of them damaged, merged by two workers
Each line says the machine's load while it ran.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / "support"), str(Path(__file__).parents[1] / "tests")]

import relume as rl  # noqa: E402
from relume.cluster import connect, run_tasks  # noqa: E402

FRAMES, PAIRS = 16, int(os.environ.get("PAIRS", "3"))
STILL = int(os.environ.get("SAMPLES", "64"))
"""Rays a pixel of the still."""
SEQUENCE = """
[[objects.keyframes]]
frame = 1
translate = [0, 0, 0]
[[objects.keyframes]]
frame = 16
translate = [0.2, 0, 0]
[sequence]
frames = "1-16"
"""


def nothing(task: int) -> int:
    return task


def said(words: str) -> None:
    print(f"{words} (load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores)", flush=True)


def empty(count: int = 10_000) -> None:
    for workers in (1, 2):
        with connect(f"local:{workers}") as cluster:
            run_tasks(nothing, range(100), cluster=cluster)
            wall, processor = time.perf_counter(), time.process_time()
            assert run_tasks(nothing, range(count), cluster=cluster) == list(range(count))
            wall, processor = time.perf_counter() - wall, time.process_time() - processor
        each = f"{1e3 * wall / count:.1f} ms a task, {1e3 * processor / count:.1f} of it processor time here"
        said(f"{count} empty tasks, {workers} workers: {each}")


def sequence(folder: Path) -> None:
    from small_shot import write_small_shot

    path = write_small_shot(folder / "shot")
    text = path.read_text().replace("samples = 8", "samples = 16")
    keys, frames = SEQUENCE.split("[sequence]")
    path.write_text(text.replace("[match]", f"{keys}[match]") + f"\n[sequence]{frames}")
    shot = rl.read_shot(path)
    seconds: dict[int, list[float]] = {1: [], 2: []}
    busiest: dict[int, list[float]] = {1: [], 2: []}
    for pair in range(PAIRS):
        for workers in (1, 2):
            with connect(f"local:{workers}") as cluster:
                out = folder / f"out_{pair}_{workers}"
                # Each worker compiles and loads once.
                rl.insert_frames(shot, out / "warm", frames=list(range(1, 2 * workers + 1)), cluster=cluster, threads=1)
                before: Any = cluster.client.run(time.process_time)
                begun = time.perf_counter()
                rl.insert_frames(shot, out / "made", cluster=cluster, threads=1)
                seconds[workers].append(time.perf_counter() - begun)
                after: Any = cluster.client.run(time.process_time)
                busiest[workers].append(max(after[each] - before[each] for each in after))
                words = f"{seconds[workers][-1]:.1f} s, the busiest worker's processor {busiest[workers][-1]:.1f} s"
                said(f"{FRAMES} frames, {workers} workers: {words}")
    made = [folder / f"out_{pair}_{workers}/made" for pair in range(PAIRS) for workers in (1, 2)]
    names = [f"frame_{number:04d}/composite.exr" for number in range(1, FRAMES + 1)]
    for name in names:
        assert len({(each / name).read_bytes() for each in made}) == 1, f"{name}: the bits differ"
    best = max(one / two for one, two in zip(seconds[1], seconds[2], strict=True))
    work = min(busiest[1]) / min(busiest[2])
    said(f"two workers: {best:.2f} times as fast in the best pair, {work:.2f} by processor time; the bits are the same")


def still(folder: Path) -> None:
    from relume.renderers.progressive.accumulation import RenderSession
    from relume.renderers.progressive.pass_workers import PassWorkers

    warm = rl.Differential(samples=2, threads=1)
    renderer = rl.Differential(samples=STILL, threads=1)
    prepared = rl.prepare_shot(rl.read_shot(Path(__file__).parents[1] / "examples/room/shot.toml"), folder / "room")
    camera = prepared.camera.resized(prepared.camera.width // 2, prepared.camera.height // 2)
    plate = prepared.plate.radiance[: 2 * camera.height : 2, : 2 * camera.width : 2]
    seconds: dict[int, list[float]] = {0: [], 1: [], 2: []}
    busiest: dict[int, list[float]] = {1: [], 2: []}
    made: set[bytes] = set()

    def rendered(renderer: rl.Differential, workers: PassWorkers | None = None) -> float:
        begun = time.perf_counter()
        change = renderer.change(prepared.scene, camera, plate=plate, watch=RenderSession(workers=workers))
        if renderer is not warm:
            made.add(change.objects.tobytes() + change.difference.tobytes() + change.difference_variance.tobytes())
        return time.perf_counter() - begun

    size = f"the room at {camera.width} × {camera.height}, {STILL} rays"
    for _ in range(PAIRS):
        rendered(warm)
        seconds[0].append(rendered(renderer))
        said(f"{size}, one process with one thread: {seconds[0][-1]:.1f} s")
        for count in (1, 2):
            with connect(f"local:{count}") as cluster:
                workers = PassWorkers(cluster, folder / "parts")
                # Each worker compiles and loads once.
                rendered(warm, workers)
                before: Any = cluster.client.run(time.process_time)
                here = time.process_time()
                seconds[count].append(rendered(renderer, workers))
                here = time.process_time() - here
                after: Any = cluster.client.run(time.process_time)
                busiest[count].append(max(after[each] - before[each] for each in after))
            words = f"the busiest worker's processor {busiest[count][-1]:.1f} s, that of who adds up {here:.1f} s"
            said(f"{size}, {count} workers: {seconds[count][-1]:.1f} s, {words}")
    assert len(made) == 1, "the bits differ"
    best = max(one / two for one, two in zip(seconds[1], seconds[2], strict=True))
    work = min(busiest[1]) / min(busiest[2])
    said(f"two workers: {best:.2f} times as fast in the best pair, {work:.2f} by processor time; the bits are the same")


def brackets(folder: Path, count: int = 1000) -> None:
    from small_brackets import write_brackets

    write_brackets(folder / "in", count, bad=count // 2)
    # One camera took them all: its response is recovered once.
    profile = folder / "camera.json"
    rl.capture.merge_shoot(rl.capture.plan_merge([folder / "in/room_0001"], folder / "a.exr", save_profile=profile))
    begun = time.perf_counter()
    try:
        rl.capture.merge_each([folder / "in"], folder / "out", profile=profile, cluster="local:2")
    except rl.errors.Incomplete as error:
        written = len(list((folder / "out").glob("*.exr")))
        said(f"{written} of {count} brackets in {time.perf_counter() - begun:.0f} s; {error}")


if __name__ == "__main__":
    import warnings

    warnings.simplefilter("ignore")
    asked = sys.argv[1:] or ["empty", "sequence", "still", "brackets"]
    with tempfile.TemporaryDirectory() as scratch:
        for name in asked:
            if name == "empty":
                empty()
            else:
                {"sequence": sequence, "still": still, "brackets": brackets}[name](Path(scratch))
