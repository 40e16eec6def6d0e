"""What a large plate costs: seconds, memory, and noise in the picture that is looked at, beside the room at its size.

    python benchmarks/large_plates.py [MEGAPIXELS …]        # 24 and 48 unless given
    python benchmarks/large_plates.py --insert MEGAPIXELS   # the whole job, from photographs to files: 48 is 8485×5657

The room of examples/room at light at infinity with its five objects, denoised; the plate is the model's own picture of
the table, even. Each size runs in a process of its own, whose peak of memory it is. Noise is that of a second seed: the
mean absolute difference of two denoised changes, both shrunk to the room's own size, over the mean radiance where they
change anything. "First" is when the small render was there to look at.
"""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from argparse import SUPPRESS
from pathlib import Path

import numpy as np
from insert_scenes import REFLECTANCE, ROOM, room
from measured import Rows, asked
from PIL import Image

import relume as rl
from relume.project.insertion.render_tiles import change_in_tiles, is_large
from relume.project.stages import Stages
from relume.renderers.mitsuba.denoise import denoised
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.progressive.accumulation import NO_SESSION
from relume.renderers.results import Change

SAMPLES = 64
OWN = 768
"""Pixels across of examples/room."""
NOISE = 1.2
"""Standard deviation of the pixel values' noise that enlarged photographs are given."""


def rendered(across: int, seed: int) -> tuple[Change, np.ndarray, float, float]:
    """The change, the plate, and the seconds until it was there and until there was something to look at."""
    scene, camera = room(across)
    level = np.pi / 4 * scene.light.total() / np.pi * REFLECTANCE
    plate = np.broadcast_to(level.astype(np.float32), (camera.height, camera.width, 3))
    seen: list[float] = []
    start, spent = time.perf_counter(), time.process_time()
    renderer = Differential(SAMPLES)
    if not is_large(camera):
        change = denoised(renderer.change(scene, camera, seed=seed, plate=plate))
    else:
        with tempfile.TemporaryDirectory() as folder:
            change = change_in_tiles(
                renderer, scene, camera, plate, seed=seed, made_from="", stages=Stages(Path(folder)), watch=NO_SESSION,
                finish=denoised,
                first=lambda small: seen.append(time.perf_counter() - start), progress=lambda share: None,
            )  # fmt: skip
    taken = time.perf_counter() - start
    print(f"processor {time.process_time() - spent:.0f} s", file=sys.stderr)
    return change, plate, taken, seen[0] if seen else taken


def shrunk(picture: np.ndarray, across: int) -> np.ndarray:
    """Means over whole squares of pixels, about so many across."""
    step = picture.shape[1] // across
    rows, columns = (length // step for length in picture.shape[:2])
    return picture[: rows * step, : columns * step].reshape(rows, step, columns, step, -1).mean((1, 3))


def measured(across: int, seed: int, path: str) -> None:
    """One render in this process; the picture's change as it is looked at goes to `path`."""
    change, plate, taken, first = rendered(across, seed)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    small = {name: shrunk(getattr(change, name), OWN) for name in ("objects", "difference")}
    small["matte"] = shrunk(change.matte[..., None], OWN)
    small["plate"] = plate[: len(small["matte"]), : small["matte"].shape[1]]
    np.savez(path, **small)  # pyright: ignore[reportArgumentType]
    print(
        json.dumps({"size": change.matte.shape[::-1], "rays": change.samples, "s": taken, "first": first, "GB": peak})
    )


def main(sizes: list[float]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for megapixels in (0, *sizes):
            across = round(np.sqrt(megapixels * 1e6 * 1.5)) if megapixels else OWN
            pictures = []
            for seed in (1, 2):
                path = f"{folder}/{seed}.npz"
                run = [sys.executable, __file__, "--one", str(across), str(seed), path]
                line = json.loads(subprocess.run(run, capture_output=True, text=True, check=True).stdout)
                with np.load(path) as planes:
                    pictures.append({name: planes[name].astype(np.float64) for name in planes.files})
            one, other = (p["objects"] + p["difference"] + (1 - p["matte"]) * p["plate"] for p in pictures)
            changed = np.abs(one - pictures[0]["plate"]).sum(-1) > 0.03 * pictures[0]["plate"].sum(-1)
            noise = np.abs(one - other)[changed].mean() / np.sqrt(2) / one[changed].mean()
            print(f"{line['size'][0]}×{line['size'][1]}: {line['s']:.0f} s, first {line['first']:.1f} s, "
                  f"{line['GB']:.1f} GB, {line['rays']} rays a pixel, noise {noise:.2%}", flush=True)  # fmt: skip


def enlarged_room(across: int, folder: Path) -> Path:
    """The shot file of a copy of examples/room whose plate and board are so wide, with noise of their own."""
    shutil.copytree(ROOM, folder)
    generator = np.random.default_rng(1)
    for path in (*(folder / "plate").glob("*.jpg"), folder / "plate_grid.jpg"):
        with Image.open(path) as photograph:
            exif = photograph.info["exif"]
            height = round(across * photograph.height / photograph.width)
            larger = photograph.resize((across, height), Image.Resampling.BICUBIC)
        noise = NOISE * generator.standard_normal((larger.height, larger.width, 3), np.float32)
        values = np.clip(np.rint(np.asarray(larger) + noise), 0, 255).astype(np.uint8)
        Image.fromarray(values).save(path, quality=95, subsampling=0, exif=exif)
    return folder / "shot.toml"


def insertion(rows: Rows, megapixels: float) -> None:
    """The whole job in this process: a line for each step, its processor time and the most memory so far."""
    across = round(np.sqrt(megapixels * 1e6 * 1.5))
    begun: dict[str, float] = {}

    def report(step: str, share: float) -> None:
        now = time.process_time()
        spent = now - begun.setdefault(step, now)
        if share == 1:
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
            print(f"{step:12} {spent:6.1f} s of processor time, {peak:.2f} GB so far", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        shot = rl.read_shot(enlarged_room(across, Path(folder) / "room"))
        start, spent = time.perf_counter(), time.process_time()
        done = rl.insert(shot, Path(folder) / "out", progress=report)
        rl.write_report(done, Path(folder) / "out")
        what = f"insert into a plate of {done.camera.width}×{done.camera.height}, from photographs to files"
        note = f"{time.process_time() - spent:.0f} s of processor time"
        rows.value(what, time.perf_counter() - start, "s", note=note)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
        rows.value(f"{what}, most memory", peak, "GB", goal="large_plate" if megapixels >= 48 else "")


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("sizes", nargs="*", type=float, metavar="MEGAPIXELS")
    parser.add_argument("--insert", type=float, metavar="MEGAPIXELS", help="the whole job; quickly: of a sixteenth")
    parser.add_argument("--one", nargs=3, help=SUPPRESS)
    options = parser.parse_args()
    if options.one:
        measured(int(options.one[0]), int(options.one[1]), options.one[2])
    elif options.insert:
        insertion(Rows(options.rows), options.insert / (16 if options.quick else 1))
    else:
        main(options.sizes or ([1.0] if options.quick else [24.0, 48.0]))
