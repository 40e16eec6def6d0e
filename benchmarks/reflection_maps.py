"""Reflection maps: making tables, shading a G-buffer, maps of any size.

python benchmarks/reflection_maps.py            # times
python benchmarks/reflection_maps.py --errors   # antialiasing against 1,024 samples a pixel, and what it takes
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np
from measured import Rows, asked

import relume as rl
from relume.light.reflection.lobes import Lambert, Mirror, Phong
from relume.light.reflection.reflection_map import reflection_map
from relume.renderers.prefiltered.filters import Filter, Mip, Plain, Preintegrated, Quadrilateral, Subdivision
from relume.renderers.prefiltered.prefiltered import Shading
from relume.renderers.prefiltered.shading_inputs import GBuffer, Samples
from relume.renderers.raytrace.visibility import Stage
from relume.scene.materials.bumps import Wrinkles
from relume.scene.materials.reflective import Layer, Reflective, glossy
from relume.sphere.mappings.mapping import LatLong, pixel_points

FINE = 32
"""Samples along each side of a pixel for the truth."""


def median_time(work: Callable[[], object], times: int = 7) -> float:
    """Seconds, the median of several after one that compiles."""
    work()
    taken = []
    for _ in range(times):
        begin = time.perf_counter()
        work()
        taken.append(time.perf_counter() - begin)
    return statistics.median(taken)


def lamps(rows: int) -> rl.EnvironmentMap:
    """A dim textured room with eight small lamps."""
    random = np.random.default_rng(4)
    directions = LatLong().directions(pixel_points(LatLong(), rows)).astype(np.float32)
    waves, phases = random.normal(size=(12, 3)) * 6, random.uniform(0, 2 * np.pi, 12)
    texture = sum(np.sin(directions @ wave + phase) for wave, phase in zip(waves, phases, strict=True))
    light = np.maximum(0.2 + 0.15 * directions[..., 1] + 0.03 * texture, 0.02)[..., None] * np.array([1, 0.95, 0.85])
    for _ in range(8):
        towards = random.normal(size=3)
        towards[1] = abs(towards[1])
        towards /= np.linalg.norm(towards)
        glow = 200 * random.uniform(0.3, 1) * np.exp(-(1 - directions @ towards) / (0.5 * 0.012**2))
        light += glow[..., None] * random.uniform(0.6, 1, 3)
    return rl.EnvironmentMap(light.astype(np.float32))


def gentle(width: int = 1280, height: int = 720) -> GBuffer:
    """A G-buffer that a big ball fills."""
    x, y = np.meshgrid((np.arange(width) + 0.5 - width / 2) / 740, (height / 2 - np.arange(height) - 0.5) / 740)
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0.01))], axis=-1)
    view = np.stack([-0.2 * x, -0.2 * y, np.ones_like(x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    view /= np.linalg.norm(view, axis=-1, keepdims=True)
    return GBuffer(normal, view, np.zeros((height, width), np.int32))


def shading_time(material: Reflective, light: rl.EnvironmentMap, way: Filter) -> float:
    """Seconds to shade the gentle G-buffer, tables and samples made before."""
    pixels = gentle()
    samples, uv = pixels.samples(), np.zeros((pixels.surface.size, 2))
    shading = Shading.of([material], light, way)
    return median_time(lambda: shading.light(samples, uv), 15)


def antialiasing(material: Reflective, light: rl.EnvironmentMap, title: str) -> None:
    """Error against 1,024 samples and time, for a field of small balls of this material."""
    balls = tuple(rl.Sphere((2.2 * i, 2.2 * j, 0.0), 1.0, material) for i in range(-3, 4) for j in range(-2, 3))
    camera = rl.Camera.looking_at(np.array([0, 0, 60.0]), np.zeros(3), width=560, height=400, focal_length=2180)
    stage = Stage.of(balls)
    corners = np.stack(np.meshgrid(np.arange(561.0), np.arange(401.0)), axis=-1)
    seen = stage.samples(camera, camera.position, np.eye(3), corners[None], None)
    plain = Shading.of([material] * len(balls), light, Plain())
    truth, cover = np.zeros((400, 560, 3)), np.zeros((400, 560))
    fine = camera.resized(560 * FINE, 400 * FINE)
    for row in range(0, 400, 4):
        x, y = np.meshgrid(np.arange(560 * FINE) + 0.5, np.arange(row * FINE, (row + 4) * FINE) + 0.5)
        rays = fine.rays_through(np.stack([x, y], axis=-1).reshape(-1, 2))
        normal, to_eye, surface, uv, _ = stage.look(camera.position, rays, np.eye(3), None)
        middles = Samples(normal, to_eye, surface, np.zeros((0, 4), np.int32), normal, to_eye, surface)
        truth[row : row + 4] = plain.light(middles, uv).reshape(4, FINE, 560, FINE, 3).mean((1, 3))
        cover[row : row + 4] = (surface >= 0).reshape(4, FINE, 560, FINE).mean((1, 3))
    inside = cover == 1
    samples = seen.samples._replace(surface=np.where(inside.reshape(-1), seen.samples.surface, -1).astype(np.int32))
    ways: tuple[Filter, ...] = (
        Plain(),
        Subdivision(4),
        Subdivision(6),
        Subdivision(),
        Quadrilateral(),
        Preintegrated(),
        Mip(),
    )
    print(f"{title}: {inside.sum()} pixels; error is mean |error| over mean, against {FINE**2} samples")
    fast = 0.0
    for way in ways:
        shading = Shading.of([material] * len(balls), light, way)
        times = 3 if isinstance(way, Subdivision | Quadrilateral) else 9
        taken = median_time(lambda shading=shading: shading.light(samples, seen.uv), times)
        light_seen = shading.light(samples, seen.uv).reshape(400, 560, 3)
        error = np.abs(light_seen - truth)[inside].mean() / truth[inside].mean()
        fast = fast or taken
        print(
            f"  {way!s:24} error {error:.4f}  {taken / inside.sum() * 1e9:9.0f} ns a pixel  {taken / fast:8.1f} × plain"
        )


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--errors", action="store_true", help="errors of antialiasing; takes minutes")
    options = parser.parse_args()
    rows = Rows(options.rows)
    room = lamps(1024)
    if options.errors:
        antialiasing(Reflective((Layer(Phong(1000)),)), room, "small glossy balls (Phong, n = 1000)")
        antialiasing(Reflective((Layer(Mirror()),), Wrinkles(0.004, 0.5)), room, "small wrinkled mirrors")
        raise SystemExit
    diffuse, specular = Lambert(), Phong(50)
    taken = median_time(lambda: reflection_map(room, diffuse))
    rows.value("D, 36×72 from 2048×1024", taken, "s", limit="≤ 0.15")
    taken = median_time(lambda: reflection_map(room, specular, 256))
    rows.value("S, Phong n = 50, 256×512 from 2048×1024", taken, "s", limit="≤ 1")
    satin = glossy(specular=Phong(50))
    taken = shading_time(satin, room, Plain())
    rows.value("shading 1280×720, bilinear D + S", 1 / taken, "frames/s", goal="shading", note=f"{taken * 1e3:.1f} ms")
    if options.quick:
        raise SystemExit
    for name, material, way in (
        ("D + S, plain", satin, Plain()),
        ("mirror, plain", Reflective((Layer(Mirror()),)), Plain()),
        ("mirror, pre-integrated", Reflective((Layer(Mirror()),)), Preintegrated()),
        ("mirror, MIP", Reflective((Layer(Mirror()),)), Mip()),
    ):
        small, large = (shading_time(material, lamps(rows), way) for rows in (128, 4096))
        rows.value(f"shading under a map 8192 wide against one 256 wide, {name}", large / small, "×", limit="≤ 1.2")
