"""Constellations: the three methods' time on a 4k map, and how well they light surfaces, against plain NumPy.

`python benchmarks/constellation.py [FOLDER]`: maps, .exr or .hdr, lat-long, to be lit by; `--accuracy`: ../shared/data.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from measured import Rows, asked
from rounds import turns

from relume.errors import SunNotFound
from relume.image.files import read_radiance
from relume.light.constellations.cells import cells_of
from relume.light.constellations.constellation import Constellation, constellation, irradiance_error
from relume.light.constellations.k_means import KMeans
from relume.light.constellations.rectangles import MedianCut, VarianceMinimisation
from relume.light.constellations.residual import key_lights
from relume.light.suns.extraction import extract_sun
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap

METHODS = {"median cut": MedianCut(), "variance": VarianceMinimisation(), "k-means": KMeans()}
COUNTS = (16, 64, 256)


def naive_median_cut(light: EnvironmentMap, levels: int) -> Constellation:
    """2^levels lights by equal cuts of a plain array, as HDR Toolbox and its like have them; no summed-area table."""
    rows, columns = light.radiance.shape[:2]
    areas = light.mapping.solid_angles(rows)
    flux = light.radiance.astype(np.float64) * areas[..., None]
    weights = flux @ [0.2126, 0.7152, 0.0722]
    rings = np.sin(np.pi * (np.arange(rows) + 0.5) / rows)
    boxes = [(0, rows, 0, columns)]
    for _ in range(levels):
        halves = []
        for top, bottom, left, right in boxes:
            part = weights[top:bottom, left:right]
            wide = (right - left) * rings[(top + bottom) // 2] > bottom - top
            if min(part.shape) < 1 or max(part.shape) < 2:
                halves.append((top, bottom, left, right))
                continue
            along = np.cumsum(part.sum(axis=0 if wide else 1))
            cut = int(np.clip(np.searchsorted(along, along[-1] / 2) + 1, 1, len(along) - 1))
            if wide:
                halves += [(top, bottom, left, left + cut), (top, bottom, left + cut, right)]
            else:
                halves += [(top, top + cut, left, right), (top + cut, bottom, left, right)]
        boxes = halves
    directions, irradiance = [], []
    for top, bottom, left, right in boxes:
        part = weights[top:bottom, left:right]
        whole = max(part.sum(), 1e-300)
        row = (part.sum(axis=1) @ (np.arange(top, bottom) + 0.5)) / whole
        column = (part.sum(axis=0) @ (np.arange(left, right) + 0.5)) / whole
        directions.append(light.mapping.directions(np.array([column / columns, row / rows])))
        irradiance.append(flux[top:bottom, left:right].sum(axis=(0, 1)))
    return Constellation(np.array(directions), np.array(irradiance))


def seconds(work, times: int = 7) -> list[float]:
    """Seconds on the clock of several after one that compiles."""
    work()
    taken = []
    for _ in range(times):
        start = time.perf_counter()
        work()
        taken.append(time.perf_counter() - start)
    return taken


def four_k() -> EnvironmentMap:
    """4096 × 2048 pixels of sky, ground, noise and a sun of four pixels."""
    random = np.random.default_rng(4)
    rows = 2048
    height = np.cos(np.pi * (np.arange(rows) + 0.5) / rows)[:, None, None]
    sky = np.where(height > 0, np.array([0.3, 0.5, 1.0]) * (1.2 - height), np.array([0.15, 0.12, 0.08]))
    radiance = (sky * random.uniform(0.5, 1.5, (rows, 2 * rows, 1))).astype(np.float32)
    radiance[600:602, 1500:1502] = 2e5
    return EnvironmentMap(radiance)


def maps(folder: Path) -> dict[str, EnvironmentMap]:
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix not in (".exr", ".hdr"):
            continue
        try:
            picture = read_radiance(path)
            if picture.size[0] == 2 * picture.size[1] and np.isfinite(picture.radiance).all():
                found[path.name] = as_environment(replace(picture, radiance=np.maximum(picture.radiance, 0)))
        except ValueError:
            continue
    return found


def speed(rows: Rows) -> None:
    """64 lights of a 4k map by each method and by plain NumPy, by turns; key lights and sun."""
    light = four_k()
    works = {name: lambda m=method: constellation(light, 64, m) for name, method in METHODS.items()}
    times = turns(works | {"naive": lambda: naive_median_cut(light, 6)}, 3)
    for name in METHODS:
        rows.ratio(f"64 lights of a map 4096 wide, {name}", times[name], "median cut by plain NumPy", times["naive"])
    for name, work in {
        "sums alone": lambda: cells_of(light),
        "key lights": lambda: key_lights(light, 64),
        "sun": lambda: extract_sun(light),
    }.items():
        rows.value(f"a map 4096 wide, {name}", seconds(work, 3), "s")


def accuracy(given: Path | None) -> None:
    """Tables of how well the methods light surfaces, of every map in a folder."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = given or default
    found = {name: each for part in ("hdri", "probes") for name, each in maps(folder / part).items()} or maps(folder)
    found.pop("spot1Lux.hdr", None)  # a single pixel
    print("\nirradiance error, mean / largest of 512 normals, percent of the map's mean irradiance")
    print(f"{'':<28}" + "".join(f"{f'{name} {count}':>17}" for count in COUNTS for name in ("naive", *METHODS)))
    sums = []
    for name, each in found.items():
        row = []
        for count in COUNTS:
            row.append(irradiance_error(each, naive_median_cut(each, count.bit_length() - 1)))
            row += [irradiance_error(each, constellation(each, count, method)) for method in METHODS.values()]
        sums.append(row)
        print(f"{name:<28}" + "".join(f"{100 * mean:10.2f} /{100 * worst:5.1f}" for mean, worst in row))
    print(f"{'mean':<28}" + "".join(f"{100 * mean:10.2f} /{100 * worst:5.1f}" for mean, worst in np.mean(sums, axis=0)))

    print("\nkey lights above 4 × the mean of the residual, and the residual: share in 64 lights; error, percent")
    for name, each in found.items():
        key = key_lights(each, 64)
        mean, worst = irradiance_error(each, key.lights, key.residual)
        share = key.lights.total().sum() / each.total().sum()
        print(f"{name:<28}{100 * share:6.1f} %{100 * mean:8.3f} /{100 * worst:6.2f}")

    print("\nsuns: height and angle to the right, degrees; diameter; share; error of sun and rest, percent")
    for name, each in found.items():
        try:
            taken = extract_sun(each)
        except SunNotFound as error:
            print(f"{name:<28}{error}")
            continue
        (sun,) = taken.suns
        x, y, z = sun.direction
        worst = irradiance_error(each, taken.lights(), taken.rest)[1]
        print(
            f"{name:<28}{np.degrees(np.arcsin(y)):7.2f}{np.degrees(np.arctan2(x, -z)):9.2f}"
            f"{np.degrees(2 * sun.angular_radius):8.2f}{100 * sun.share:8.1f} %{100 * worst:8.3f}"
        )


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("folder", nargs="?", type=Path, help="of maps, to measure how well the methods light surfaces")
    parser.add_argument("--accuracy", action="store_true", help="the same of the maps in ../shared/data")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    speed(Rows(options.rows))
    if options.accuracy or options.folder:
        accuracy(options.folder)
