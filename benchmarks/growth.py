"""How time grows: each kernel at 1/16 to 4 times its size, the time of one pixel, ray or light, and the exponent.

    python benchmarks/growth.py [--only WORD …]

Time is that of the processors, so that other programs count for less; the median of a few runs after one that compiles.
The exponent is that of a power fitted to the three larger sizes: 1 where twice as much takes twice as long, less where
something is done once for all. Above 1.1 is worse than linear; n log n over a factor of 16 looks like 1.1 at the sizes
here, and what outgrows the caches on the way can look like as much.
"""

from __future__ import annotations

import statistics
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from insert_scenes import ROOM
from measured import Rows, asked, figure
from merging import bracket_of, scene, srgb_response
from ray_casting import EYE, dented_ball
from reflection_maps import gentle, lamps

import relume as rl
from relume.capture.alignment.alignment import align
from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.capture.response.calibration import recover_response
from relume.image import files
from relume.image.files.encodings import LogLuv, OpenEXR, RadianceHDR
from relume.image.photograph import Exposure, Photograph
from relume.light.constellations.constellation import constellation
from relume.light.constellations.rectangles import MedianCut
from relume.light.reflection.lobes import Lambert, Phong
from relume.light.reflection.reflection_map import reflection_map
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.low_rank import compress_low_rank
from relume.lightstage.relighting.relighting import weighted_sum
from relume.probe.ball.outline import find_outline
from relume.renderers.mitsuba.denoise import denoised_render
from relume.renderers.prefiltered.filters import Plain
from relume.renderers.prefiltered.prefiltered import Shading
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.results import Render
from relume.scene.materials.reflective import glossy
from relume.sphere.mappings.discs import Angular
from relume.virtual_camera.lens.glare.eye import EyeGlare
from relume.virtual_camera.tone.ferwerda import Ferwerda
from relume.virtual_camera.tone.histogram.adjustment import HistogramAdjustment
from relume.virtual_camera.tone.metered import MeteredExposure
from relume.virtual_camera.tone.pattanaik.pattanaik import Pattanaik
from relume.virtual_camera.tone.reinhard import Reinhard, ReinhardLocal
from relume.virtual_camera.tone.tumblin_rushmeier import TumblinRushmeier
from relume.virtual_camera.virtual_camera import VirtualCamera

SHARES = (1 / 16, 1 / 4, 1, 4)
FITTED = 3
"""The larger sizes, to which the power is fitted: at the smallest what is done once for all counts most."""
LINEAR = 1.1
ENOUGH = 1.0
"""Seconds after which no further run is asked for."""
Made = tuple[float, Callable[[], object]]
"""How many pixels, rays or lights, and the work on them."""


@lru_cache(maxsize=8)
def picture(pixels: float) -> np.ndarray:
    """(H, W, 3) float32, about so many pixels of light as a photograph has it, 3 : 2."""
    height = max(16, round((pixels / 1.5) ** 0.5))
    return scene(height * 3 // 2, height)


def of_photographs(work: Callable[[Bracket], object], pixels: float) -> Made:
    bracket = bracket_of(picture(pixels), 5)
    return bracket.photographs[0].pixels.size / 3, lambda: work(bracket)


def hand_held(pixels: float) -> Made:
    """Five exposures, each moved by some pixels."""
    radiance, frames = picture(pixels * 1.1), []
    rows, columns = (length - 40 for length in radiance.shape[:2])
    for index, (dx, dy) in enumerate(((20, 20), (27, 9), (3, 31), (15, 24), (33, 12))):
        part = np.ascontiguousarray(radiance[dy : dy + rows, dx : dx + columns])
        exposed = bracket_of(part, index + 1).photographs[index]
        frames.append(Photograph(exposed.pixels, f"{index}.jpg", Exposure(2.0 ** -(index + 1))))
    bracket = Bracket(tuple(frames))
    return rows * columns, lambda: align(bracket)


def of_maps(work: Callable[[rl.EnvironmentMap], object], pixels: float) -> Made:
    light = lamps(round((pixels / 2) ** 0.5))
    return light.radiance.size / 3, lambda: work(light)


def shaded(pixels: float) -> Made:
    seen = gentle(round((pixels * 16 / 9) ** 0.5), round((pixels * 9 / 16) ** 0.5))
    samples, uv = seen.samples(), np.zeros((seen.surface.size, 2))
    shading = Shading.of([glossy(specular=Phong(50))], lamps(128), Plain())
    return seen.surface.size, lambda: shading.light(samples, uv)


def field(lights: float, pixels: float) -> Pictures:
    """Pictures of noise over something smooth, as low rank wants them."""
    generator, count, side = np.random.default_rng(0), round(lights), round(pixels**0.5)
    bases, weights = generator.random((12, side, side, 3), np.float32), generator.random((count, 12), np.float32)
    values = np.tensordot(weights, bases, 1) + 0.02 * generator.random((count, side, side, 3), np.float32)
    return Pictures(values.astype(np.float32), StageLights.towards(generator.normal(size=(count, 3))))


def relit(lights: float) -> Made:
    pictures = field(lights, 96 * 96)
    irradiances = np.random.default_rng(1).random((len(pictures.lights), 3))
    return len(irradiances), lambda: weighted_sum(pictures, irradiances)


def low_rank(lights: float, pixels: float, by: str) -> Made:
    pictures = field(lights, pixels)
    return lights if by == "light" else pictures.values[0].size / 3, lambda: compress_low_rank(pictures, rank=6)


def of_files(encoding: Any, suffix: str, reading: bool, folder: Path, pixels: float) -> Made:
    radiance = picture(pixels)
    path, image = folder / f"{radiance.shape[1]}{suffix}", rl.RadianceMap(np.clip(radiance, 0.01, 15))
    files.write(path, image, encoding)
    count = radiance.size / 3
    if reading:
        return count, lambda: files.read_radiance(path)
    return count, lambda: files.write(path, image, encoding)


def rays(count: float) -> Made:
    side = round((count * 3 / 4) ** 0.5)
    camera = rl.Camera.looking_at(EYE, np.zeros(3), width=side * 4 // 3, height=side, focal_length=1.25 * side)
    directions, caster = camera.rays().reshape(-1, 3), RayCaster.of([dented_ball(159)])
    return len(directions), lambda: caster.nearest(EYE, directions)


def triangles(count: float, building: bool) -> Made:
    mesh = dented_ball(max(4, round((count / 4) ** 0.5)))
    camera = rl.Camera.looking_at(EYE, np.zeros(3), width=160, height=120, focal_length=150)
    directions, caster = camera.rays().reshape(-1, 3), RayCaster.of([mesh])
    if building:
        return len(mesh.faces), lambda: RayCaster.of([mesh])
    return len(mesh.faces), lambda: caster.nearest(EYE, directions)


def whitted(pixels: float) -> Made:
    file = rl.read_scene(ROOM.parent / "whitted" / "figure_8.toml")
    width = round((pixels * 4 / 3) ** 0.5)
    camera = file.camera.resized(width, width * 3 // 4)
    return width * camera.height, lambda: file.whitted.render(file.scene, camera)


def toned(tone: Any, pixels: float) -> Made:
    radiance = rl.RadianceMap(100 * picture(pixels), unit="cd/m²")
    camera = VirtualCamera(tone=tone)
    return radiance.radiance.size / 3, lambda: camera.tone_map(radiance).photograph()


def glare(pixels: float) -> Made:
    radiance = rl.RadianceMap(100 * picture(pixels), unit="cd/m²")
    part, view = EyeGlare(adaptation=100.0), VirtualCamera().view(radiance)
    return radiance.radiance.size / 3, lambda: part.apply(radiance.radiance, view)


def denoise(pixels: float) -> Made:
    radiance = picture(pixels)
    flat = np.ones(radiance.shape[:2], np.float32)
    normal = np.broadcast_to(np.array([0, 0, 1], np.float32), radiance.shape).copy()
    render = Render(radiance, radiance * 0, flat, flat, normal, np.minimum(radiance, 1))
    return flat.size, lambda: denoised_render(render)


def ball(unwrapped: bool, pixels: float) -> Made:
    """A photograph of the room's ball, larger and smaller."""
    photograph = files.read_photograph(ROOM / "ball_0" / "IMG_0005.jpg").pixels
    scale = (pixels * 3 / photograph.size) ** 0.5
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    sized = cv2.resize(photograph, None, fx=scale, fy=scale, interpolation=way)
    radiance = ((sized / 255.0) ** 2.2).astype(np.float32)
    if not unwrapped:
        return sized.size / 3, lambda: find_outline(radiance)
    outline = find_outline(radiance)
    image, camera, centre = rl.RadianceMap(radiance), np.array([0, 1.0, 2.0]), np.array([0, 0.1, 0])
    return sized.size / 3, lambda: rl.unwrap_ball(image, camera=camera, centre=centre, radius=0.05, outline=outline)


def kernels(folder: Path) -> dict[str, tuple[str, float, Callable[[float], Made]]]:
    """By name: of what the time is told, the size, and what makes the work at a size."""
    two = 2e6
    table: dict[str, tuple[str, float, Callable[[float], Made]]] = {
        "merge of five": ("pixel", two, lambda n: of_photographs(lambda b: merge(b, srgb_response()), n)),
        "response of five": ("pixel", two, lambda n: of_photographs(recover_response, n)),
        "align five": ("pixel", two / 2, hand_held),
        "lat-long to angular": ("pixel", two, lambda n: of_maps(lambda m: m.remapped(Angular(), m.size // 2), n)),
        "irradiance of a map": ("pixel", two / 4, lambda n: of_maps(lambda m: reflection_map(m, Lambert()), n)),
        "specular map, Phong 50": ("pixel", two / 4, lambda n: of_maps(lambda m: reflection_map(m, Phong(50), 128), n)),
        "shading, D + S": ("pixel", two / 4, shaded),
        "median cut, the map": ("pixel", two, lambda n: of_maps(lambda m: constellation(m, 64, MedianCut()), n)),
        "median cut, the lights": ("light", 256, lambda n: median_cut(round(n))),
        "relighting": ("light", 256, relit),
        "low rank, the pixels": ("pixel", 128 * 128, lambda n: low_rank(128, n, "pixel")),
        "low rank, the lights": ("light", 128, lambda n: low_rank(n, 96 * 96, "light")),
        "rays": ("ray", 80_000, rays),
        "a ray's triangles": ("triangle", 100_000, lambda n: triangles(n, False)),
        "building a tree": ("triangle", 100_000, lambda n: triangles(n, True)),
        "Whitted, figure 8": ("pixel", 80_000, whitted),
        "glare of the eye": ("pixel", two / 2, glare),
        "denoise": ("pixel", two / 8, denoise),
        "outline of a ball": ("pixel", two / 4, lambda n: ball(False, n)),
        "unwrap a ball": ("pixel", two / 4, lambda n: ball(True, n)),
    }
    for name, encoding, suffix in (
        ("RGBE", RadianceHDR(), ".hdr"),
        ("LogLuv 32", LogLuv(32), ".tif"),
        ("EXR, float", OpenEXR(), ".exr"),
    ):
        for reading in (False, True):
            words = f"{name}, {'read' if reading else 'written'}"
            table[words] = (
                "pixel", two / 2, lambda n, e=encoding, s=suffix, r=reading: of_files(e, s, r, folder, n),
            )  # fmt: skip
    tones = (MeteredExposure(), Reinhard(), ReinhardLocal(), HistogramAdjustment(), TumblinRushmeier(), Ferwerda())
    for tone in (*tones, Pattanaik()):
        table[f"develop, {type(tone).__name__}"] = ("pixel", two / 2, lambda n, t=tone: toned(t, n))
    return table


def median_cut(count: int) -> Made:
    light = lamps(512)
    return count, lambda: constellation(light, count, MedianCut())


def seconds(work: Callable[[], object], times: int) -> float:
    """Processor time, the median of a few after one that compiles; of long work fewer."""
    start = time.process_time()
    work()
    first, taken = time.process_time() - start, []
    while len(taken) < times and (not taken or first + sum(taken) < ENOUGH):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return statistics.median(taken)


def grown(rows: Rows, name: str, of: str, works: Iterable[Made], times: int) -> None:
    """One row: the exponent, and nanoseconds of one at each size."""
    counts, taken = [], []
    for count, work in works:
        counts.append(count)
        taken.append(seconds(work, times))
    exponent = float(np.polyfit(np.log(counts[-FITTED:]), np.log(taken[-FITTED:]), 1)[0])
    each = ", ".join(figure(1e9 * spent / count) for spent, count in zip(taken, counts, strict=True))
    note = f"{each} ns a {of} of {figure(counts[0])} to {figure(counts[-1])}"
    rows.value(f"growth, {name}", exponent, "", limit=f"≤ {LINEAR}", note=note)


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--only", nargs="+", metavar="WORD", help="kernels with one of these in their names")
    options = parser.parse_args()
    warnings.simplefilter("ignore")  # small pictures hold few pixels to go by
    # Quickly: the two smallest sizes, where what is done once for all counts most.
    shares, runs = (SHARES[:2], 1) if options.quick else (SHARES, 3)
    with tempfile.TemporaryDirectory() as place:
        for title, (of_one, size, make) in kernels(Path(place)).items():
            if not options.only or any(word in title for word in options.only):
                grown(Rows(options.rows), title, of_one, (make(size * share) for share in shares), runs)
