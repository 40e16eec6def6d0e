"""Relighting 2,048 pictures of 480×720 in 8 bits (2.1 GB), against reading that array once through NumPy.

"Reading" is measured three ways: the array's file from the page cache (`np.fromfile`), and passes over the array in
memory (`max`, `bitwise_or.reduce`). By turns, five rounds in one run, medians. Then compressed pictures of the head in
../shared/stages, resized to 480×720 (288 lights), under the light of maps in ../shared/data/hdri: pictures a second,
and error Σ|difference| / Σ|exact|. With --memory: how far a process grows that builds and relights a store four times
as large as its `max_memory`, beyond what it held after its imports.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from argparse import SUPPRESS
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numba
import numpy as np
from measured import Rows, asked
from rounds import ROUNDS, by_turns, turns
from scipy.spatial import KDTree

from relume.image.files import read_radiance
from relume.lightstage.acquire.store import read_store
from relume.lightstage.acquire.store_building import build_store
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.cosine import compress_cosine
from relume.lightstage.relighting.low_rank import compress_low_rank
from relume.lightstage.relighting.relighting import weighted_sum, weighted_sums
from relume.sphere.environment_files import as_environment
from relume.sphere.mappings.mapping import pixel_directions

ROWS, COLUMNS = 480, 720
SHARED = Path(__file__).resolve().parents[1] / "shared"
if not SHARED.exists():
    SHARED = Path(__file__).resolve().parents[2] / "shared"
MAPS = ("three/royal_esplanade_1k.hdr", "three/quarry_01_1k.hdr", "spruit_sunrise/spruit_sunrise_1k.hdr")


def race(rows: Rows, folder: Path, count: int) -> None:
    generator = np.random.default_rng(0)
    values = np.empty((count, ROWS, COLUMNS, 3), np.uint8)
    for picture in values:
        picture[:] = generator.integers(0, 256, picture.shape, dtype=np.uint8)
    file = folder / "values.bin"
    values.tofile(file)
    lights = StageLights.towards(generator.normal(size=(count, 3)))
    field = Pictures(values, lights, scale=np.full(count, 1 / 255, np.float32))
    irradiances = generator.random((count, 3))
    times = turns(
        {
            "relume, relit": lambda: weighted_sum(field, irradiances),
            "np.fromfile, page cache": lambda: np.fromfile(file, np.uint8),
            "values.max()": lambda: values.max(),
            "np.bitwise_or.reduce": lambda: np.bitwise_or.reduce(values, axis=None),
        }
    )
    ours = times.pop("relume, relit")
    print(f"{count} lights × {ROWS}×{COLUMNS}×3 uint8, {values.nbytes / 1e9:.2f} GB, median of {ROUNDS} by turns")
    for name, each in times.items():
        goal = "relighting" if "bitwise" in name else ""
        slower = [mine / theirs for mine, theirs in zip(ours, each, strict=True)]
        rows.value(
            f"relighting {count} lights of 8 bits, by the time of {name}", slower, "×", goal=goal,
            ours=float(np.median(ours)), peer=name, theirs=float(np.median(each)),
        )  # fmt: skip


def compressed(rows: Rows) -> None:
    stage = SHARED / "stages" / "head"
    listed = json.loads((stage / "stage.json").read_text())["lights"]
    pictures = [read_radiance(stage / light["file"]).radiance for light in listed]
    values = np.stack([cv2.resize(p, (COLUMNS, ROWS), interpolation=cv2.INTER_LINEAR) for p in pictures])
    directions = np.array([light["direction"] for light in listed])
    field = Pictures(values, StageLights.towards(directions, grid=(12, 24)))
    light_of = {Path(name).stem: irradiances_of(SHARED / "data" / "hdri" / name, directions) for name in MAPS}
    exact = {name: weighted_sum(field, light).radiance for name, light in light_of.items()}
    makes: list[tuple[str, Callable[[], Any], str]] = [
        ("cosine", lambda: compress_cosine(field), ""),
        ("low rank", lambda: compress_low_rank(field), ""),
        ("low rank, 3 % of the root mean square lost", lambda: compress_low_rank(field, error=0.03), "low_rank"),
    ]
    for label, make, goal in makes:
        start = time.perf_counter()
        found: Any = make()
        built = time.perf_counter() - start
        print(f"{label}: {found.byte_count / 1e6:.0f} of {values.nbytes / 1e6:.0f} MB, built in {built:.0f} s")
        print(f"  {found.error}")
        errors = []
        for name, light in light_of.items():
            difference = np.abs(found.relight(light).radiance.astype(np.float64) - exact[name])
            errors.append(100 * difference.sum() / exact[name].sum(dtype=np.float64))
            print(f"  {name}: error {errors[-1]:.2f} %")
        each = by_turns({"": lambda found=found, light=light_of["quarry_01_1k"]: found.relight(light)})[""]
        note = f"errors up to {max(errors):.2f} %, {found.byte_count / 1e6:.0f} MB"
        rows.value(f"288 lights at 480×720 relit, {label}", 1 / each, "pictures/s", goal=goal, note=note)


def irradiances_of(path: Path, directions: np.ndarray) -> np.ndarray:
    """Irradiances (N, 3) of a map, each of its pixels given to the nearest light."""
    light = as_environment(read_radiance(path))
    nearest = KDTree(directions).query(pixel_directions(light.mapping, light.size).reshape(-1, 3))[1]
    flux = light.radiance * light.mapping.solid_angles(light.size)[..., None]
    return np.stack([np.bincount(nearest, flux[..., c].ravel(), len(directions)) for c in range(3)], axis=1)


class Made:
    """A field of noise that is made when it is asked for, so that nothing but the store holds it."""

    def __init__(self, count: int) -> None:
        self.lights = StageLights.towards(np.random.default_rng(0).normal(size=(count, 3)))
        self.shape, self.camera, self.noise = (ROWS, COLUMNS), None, None

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        values = np.empty((lights.stop - lights.start, rows.stop - rows.start, COLUMNS, 3), np.float32)
        for index, picture in enumerate(values):
            np.random.default_rng(lights.start + index).random(out=picture, dtype=np.float32)
        return values


def memory(folder: Path, work: str, cap: int, kind: str) -> None:
    """One line: how far this process grew beyond what it held when everything was imported and compiled."""
    count = int(4 * cap / (ROWS * COLUMNS * 3 * np.dtype(kind).itemsize))
    small = Pictures(
        np.ones((5, 9, 9, 3), np.float32), StageLights.towards(np.random.default_rng(0).normal(size=(5, 3)))
    )
    build_store(small, folder / f"small-{work}", dtype=kind)
    weighted_sum(read_store(folder / f"small-{work}"), np.ones((5, 3)))
    field: Any = Made(count) if work == "build" else read_store(folder / "large")
    light = np.full((count, 3), 1 / count)
    Path("/proc/self/clear_refs").write_text("5")  # the peak is counted from here
    before = status("VmRSS")
    if work == "build":
        build_store(field, folder / "large", dtype=kind, max_memory=cap)
    elif work == "relight":
        weighted_sum(field, light, memory=cap)
    else:
        for _ in weighted_sums(field, np.stack([light] * 12), memory=cap):
            pass
    grown = status("VmHWM") - before
    print(
        f"  {work} {kind}: store {4 * cap / 1e6:.0f} MB, cap {cap / 1e6:.0f} MB, "
        f"grew {grown / 1e6:.0f} MB: {grown / cap:.2f}"
    )


def status(key: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith(key)).split()[1]) * 1024


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--memory", action="store_true", help="only how far processes grow")
    parser.add_argument("--grow", nargs=4, help=SUPPRESS)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if options.grow:
            memory(Path(options.grow[0]), options.grow[1], int(options.grow[2]), options.grow[3])
        elif options.memory:
            for kind in ("uint8", "float16"):
                for work in ("build", "relight", "sequence"):
                    folder = Path(name) / kind
                    folder.mkdir(exist_ok=True)
                    words = [sys.executable, __file__, "--grow", str(folder), work, "256000000", kind]
                    subprocess.run(words, check=True)
        else:
            print(f"NumPy {np.__version__}, Numba {numba.__version__}, {os.cpu_count()} cores")
            rows = Rows(options.rows)
            race(rows, Path(name), 256 if options.quick else 2048)
            if (SHARED / "stages").exists() and not options.quick:
                compressed(rows)
