"""Mappings: time of conversions, and filtering against 256 look-ups a pixel, beside another tool where it is named.

Run as `python benchmarks/mappings.py [--skylibs PYTHON]`: PYTHON is an interpreter that has skylibs, which then
converts the same maps in a process of its own, by turns with ours.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from measured import Rows, asked

import relume as rl
from relume.sphere.mappings.cubes import Strip
from relume.sphere.mappings.discs import Angular
from relume.sphere.mappings.mapping import LatLong, pixel_points

SKYLIBS = """
import sys, time
import numpy as np
from envmap import EnvironmentMap
light, size, out = np.load(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
for _ in sys.stdin:
    source = EnvironmentMap(light.copy(), "latlong")
    begin = time.perf_counter()
    result = source.convertTo("angular", size)
    print(time.perf_counter() - begin, flush=True)
np.save(out, result.data)
"""


def seconds(work: Callable[[], object], times: int = 7) -> list[float]:
    """Seconds of several after one that compiles."""
    work()
    return [taken(work) for _ in range(times)]


def taken(work: Callable[[], object]) -> float:
    """Seconds of one run."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def textured(rows: int) -> rl.EnvironmentMap:
    """Noise with detail down to the pixel, and a sun."""
    random = np.random.default_rng(0)
    radiance = random.random((rows, 2 * rows, 3), np.float32) ** 4
    radiance[rows // 3, rows // 2] = 1e5
    return rl.EnvironmentMap(radiance)


def zone_plate(rows: int) -> rl.EnvironmentMap:
    """Rings round −Z that grow finer up to two pixels a ring, a quarter of the sphere away."""
    towards = LatLong().directions(pixel_points(LatLong(), rows))
    angle = np.arccos(np.clip(-towards[..., 2], -1, 1))
    wave = 0.5 + 0.5 * np.cos(rows * angle**2 / np.pi)
    return rl.EnvironmentMap(np.repeat(wave[..., None], 3, 2).astype(np.float32))


def truth(light: rl.EnvironmentMap, size: int, cells: int = 16) -> np.ndarray:
    """Each pixel of an angular map as the mean, by solid angle, of 256 bilinear look-ups."""
    mapping, result = Angular(), np.zeros((size, size, 3))
    steps = (np.arange(cells) + 0.5) / cells
    for row in range(size):
        v = (row + np.repeat(steps, size * cells)) / size
        u = np.tile((np.arange(size)[:, None] + steps).ravel() / size, cells)
        towards = mapping.directions(np.stack([u, v], -1))
        weight = np.nan_to_num(np.sinc(2 * np.hypot(u - 0.5, v - 0.5)))
        weight = np.where(np.isnan(towards[..., 0]), 0, weight)[:, None]
        found = light.lookup(np.nan_to_num(towards, nan=0.57735)) * weight
        found, weight = (a.reshape(cells, size, cells, -1).sum((0, 2)) for a in (found, weight))
        result[row] = found / np.maximum(weight, 1e-300)
    return result


def by_skylibs(
    python: str, light: rl.EnvironmentMap, size: int, times: int = 1, before: Callable[[], object] = lambda: None
) -> tuple[np.ndarray, list[float]]:
    """skylibs' angular map, and its seconds of each of `times` turns, `before` each of which our own work is done."""
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "light.npy", Path(folder) / "angular.npy"
        np.save(given, light.radiance)
        words = [python, "-c", SKYLIBS, str(given), str(size), str(made)]
        taken = []
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdin is not None and process.stdout is not None
            for _ in range(times):
                before()
                process.stdin.write("again\n")
                process.stdin.flush()
                taken.append(float(process.stdout.readline()))
        return np.load(made), taken


def filtering(name: str, light: rl.EnvironmentMap, size: int, python: str | None) -> None:
    """Root mean square errors on the inner nine tenths of an angular map, where pixels are not slivers."""
    expected = truth(light, size)
    inner = np.hypot(*np.moveaxis(pixel_points(Angular(), size) - 0.5, -1, 0)) < 0.45
    makers = {"relume": light.remapped(Angular(), size).radiance}
    if python:
        makers["skylibs"] = by_skylibs(python, light, size)[0]
    errors = {maker: float(np.sqrt(np.mean((made - expected)[inner] ** 2))) for maker, made in makers.items()}
    print(f"{name} to angular {size}: error " + ", ".join(f"{maker} {error:.2g}" for maker, error in errors.items()))


def main(rows: Rows, python: str | None, quick: bool) -> None:
    light, what = textured(1024), "lat-long 2048×1024 to angular 1024²"

    ours = seconds(lambda: light.remapped(Angular(), 1024))
    if python:
        again: list[float] = []
        _, theirs = by_skylibs(
            python, light, 1024, 8, lambda: again.append(taken(lambda: light.remapped(Angular(), 1024)))
        )
        rows.ratio(what, again[1:], "skylibs", theirs[1:], goal="mapping")
    else:
        rows.value(what, ours, "s")
        rows.absent(f"{what}, skylibs", "no interpreter with skylibs was given (--skylibs)", goal="mapping")
    if quick:
        return
    plain = rl.EnvironmentMap(np.minimum(textured(256).radiance, 1))
    filtering("noise 512×256", plain, 96, python)
    filtering("zone plate 512×256", zone_plate(256), 96, python)
    large = textured(4096)
    for side in (1024, 2048, 4096):
        times = seconds(lambda side=side: large.remapped(Strip(), side), 3)
        rows.value(f"lat-long 8192×4096 to six faces of {side}", times, "s", limit="≤ 1")


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--skylibs", metavar="PYTHON", help="an interpreter that has skylibs")
    options = parser.parse_args()
    main(Rows(options.rows), options.skylibs, options.quick)
