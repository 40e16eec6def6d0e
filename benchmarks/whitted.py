"""Whitted's renderer against POV-Ray 3.7, in one run: time, error and rays for the paper's figures, the teapot and a
mesh of 100,000 triangles.

    python benchmarks/whitted.py            # times, at the tolerances of AS_FINE
    python benchmarks/whitted.py --errors   # and what those come from: errors, rays; some ten minutes longer

Errors are root mean square, of display values (sRGB, clipped to 0…1), against each program's own 256 samples a pixel,
over every fourth band of eight rows. Both programs' runs alternate, for a machine's speed may change meanwhile. Without
POV-Ray only ours is measured.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh
from measured import Rows, asked
from povray import ADAPTIVE, PROGRAM, Traced, scene_text, traced
from ray_casting import dented_ball

import relume as rl
from relume.image.colour import encode_srgb
from relume.renderers.whitted.antialiasing import Antialiasing
from relume.scene.lights import Unattenuated

FIGURES = Path(__file__).parents[1] / "examples" / "whitted"
MINUTES = {"figure_6": 44, "figure_7": 74, "figure_8": 122}
"""What the paper's figures took on a VAX-11/780 (§4)."""
ROUNDS = 5
BAND, EVERY = 8, 32
"""Rows of a band in which errors are measured, and from where to where they repeat."""
FINE = 16
"""Samples along each side of a pixel for the truth."""
GRIDS = (1, 2, 3, 4, 6, 8)
"""Uniform samples along each side of a pixel."""
CORES = os.cpu_count() or 1
TOLERANCES = (0.4, 0.3, 0.2, 0.15, 0.12)
AS_FINE = {"figure_6": 0.2, "figure_7": 0.4, "figure_8": 0.4, "teapot": 0.4, "ball_of_100488_triangles": 0.4}
"""POV-Ray's +R3 halves a pixel's square twice; its error is met with the first of the tolerances that is no worse, as
`--errors` finds it. Neither error depends on the machine."""
PEER_CONTRIBUTION = 1 / 255
"""POV-Ray's adc_bailout, below which it cuts a branch off."""
BALL = """
[camera]
position = [1.6, 1.5, 4.2]
target = [0.5, 0.05, 0]
[light]
colour = [0.1, 0.15, 0.3]
[[lights]]
kind = "point"
position = [-5, 8, 6]
intensity = [2.6, 2.5, 2.3]
falloff = "none"
[[lights]]
kind = "ambient"
radiance = [0.2, 0.2, 0.2]
[materials.glossy]
kind = "whitted"
diffuse = [0.5, 0.12, 0.06]
specular = 0.3
exponent = 80
[materials.mirror]
kind = "whitted"
diffuse = [0.05, 0.05, 0.05]
specular = 0.85
[materials.floor]
kind = "whitted"
diffuse = { checks = [[0.6, 0.58, 0.5], [0.15, 0.2, 0.25]], size = 0.6 }
specular = 0.1
[[local]]
shape = "plane"
size = [20, 20]
height = -1.11
material = "floor"
[[objects]]
mesh = "ball.ply"
material = "glossy"
[[objects]]
sphere = { centre = [1.7, -0.41, -1.2], radius = 0.7 }
material = "mirror"
[whitted]
depth = 5
constellation = 0
"""


def seconds(work: Callable[[], object]) -> float:
    """Wall time of one run."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def command(path: Path) -> float:
    """Wall time of `relume render` in a fresh process, its kernels kept."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["render", str(path), "-o", str(Path(folder) / "picture.png"), "-q"]
        start = time.perf_counter()
        run = [sys.executable, "-c", f"from relume.cli import main; main({words!r})"]
        subprocess.run(run, check=True, capture_output=True)
        return time.perf_counter() - start


def shown(linear: np.ndarray) -> np.ndarray:
    """Display values, 0 to 1."""
    return encode_srgb(np.clip(np.asarray(linear, np.float64), 0, 1))


def bands(height: int) -> np.ndarray:
    """(R,) the rows in which errors are measured."""
    return np.flatnonzero(np.arange(height) % EVERY < BAND)


def rms(seen: np.ndarray, truth: np.ndarray) -> float:
    """Root mean square difference of display values, over the bands' rows."""
    return float(np.sqrt(np.mean((shown(seen) - shown(truth)) ** 2)))


def rays_of(picture: rl.Render) -> np.ndarray:
    """(H, W) how many rays each pixel took."""
    assert picture.rays is not None
    return picture.rays


def millions(picture: rl.Render) -> str:
    return f"{np.sum(rays_of(picture)) / 1e6:.2f}"


@dataclass(frozen=True, eq=False)
class Subject:
    """A scene file and its pictures."""

    path: Path

    @cached_property
    def file(self) -> rl.SceneFile:
        return rl.read_scene(self.path)

    def picture(self, method: rl.Whitted | None = None) -> rl.Render:
        """Ours, as the scene file sets it unless given; the tree is built too."""
        return (method or self.file.whitted).render(self.file.scene, self.file.camera)

    def uniform(self, grid: int) -> tuple[np.ndarray, int]:
        """The bands' rows (R, W, 3), each pixel the mean of grid × grid single rays, and how many rays that took."""
        camera = self.file.camera
        fine = camera.resized(camera.width * grid, camera.height * grid)
        prepared = replace(self.file.whitted, antialiasing=None).prepared(self.file.scene)
        means, rays = [], 0
        for top in range(0, camera.height, EVERY):
            bottom = min(top + BAND, camera.height)
            part = prepared.render(fine, region=(0, top * grid, fine.width, bottom * grid))
            means.append(part.radiance.reshape(bottom - top, grid, camera.width, grid, 3).mean(axis=(1, 3)))
            rays += int(np.sum(rays_of(part)))
        return np.concatenate(means), rays

    def peer(self, options: tuple[str, ...] = ADAPTIVE, size: int = 1) -> Traced:
        """POV-Ray's, at `size` times the pixels each way."""
        camera = self.file.camera
        text = scene_text(self.file.scene, camera, self.file.whitted.depth)
        return traced(text, camera.width * size, camera.height * size, options, CORES)

    def peer_truth(self) -> np.ndarray:
        """The bands' rows of POV-Ray's 256 samples: it takes 8 × 8 at most, so the picture is made twice as large."""
        camera = self.file.camera
        pixels = self.peer(("+AM1", "+A0.0", f"+R{FINE // 2}", "-J"), size=2).pixels
        return pixels.reshape(camera.height, 2, camera.width, 2, 3).mean(axis=(1, 3))[bands(camera.height)]


def uniform_rays(errors: list[float], rays: list[int], error: float) -> float:
    """How many rays uniform sampling needs for an error, between the grids that were tried or beyond the last."""
    # Errors fall along the list and rays rise; both go as powers of the grid.
    order = slice(None, None, -1)
    if error < errors[-1]:
        steepness = np.log(rays[-1] / rays[-2]) / np.log(errors[-2] / errors[-1])
        return float(rays[-1] * (errors[-1] / error) ** steepness)
    return float(np.exp(np.interp(np.log(error), np.log(errors[order]), np.log(rays[order]))))


def as_fine_as_peer(subject: Subject, truth: np.ndarray, its_error: float) -> tuple[float, float] | None:
    """The coarsest tolerance whose error is not above POV-Ray's, and that error."""
    rows = bands(subject.file.camera.height)
    for tolerance in TOLERANCES:
        antialiasing = Antialiasing(subdivisions=2, tolerance=tolerance)
        method = replace(subject.file.whitted, antialiasing=antialiasing, contribution=PEER_CONTRIBUTION)
        if (error := rms(subject.picture(method).radiance[rows], truth)) <= its_error:
            return tolerance, error
    return None


def timed(table: Rows, subject: Subject, rounds: int) -> None:
    """Times, by turns: ours as the scene file sets it, ours as fine as POV-Ray's adaptive picture, and POV-Ray's."""
    name, file = subject.path.stem, subject.file
    tolerance = Antialiasing(subdivisions=2, tolerance=AS_FINE[name])
    as_fine = replace(file.whitted, antialiasing=tolerance, contribution=PEER_CONTRIBUTION)
    once, _ = subject.picture(), subject.picture(as_fine)
    ours, alike, peers = [], [], []
    for _ in range(rounds):
        ours.append(seconds(subject.picture))
        alike.append(seconds(lambda: subject.picture(as_fine)))
        if PROGRAM is not None:
            peers.append(subject.peer())
    said = f"by default {statistics.median(ours):.3g} s, {millions(once)} million rays"
    if name in MINUTES:
        said += f", the paper's {MINUTES[name]} min"
    what = f"Whitted, {name}, like for like"
    if peers:
        traces = [peer.trace for peer in peers]
        table.ratio(what, alike, "POV-Ray's trace", traces, goal="whitted", note=said)
    else:
        table.value(what, alike, "s", note=said)
    if rounds == ROUNDS and peers:
        whole = [command(subject.path) for _ in range(3)]
        walls = [peer.wall for peer in peers[:3]]
        table.ratio(f"Whitted, {name}, the whole command", whole, "POV-Ray's", walls)


def errors(table: Rows, subject: Subject) -> None:
    """Which tolerance is as fine as POV-Ray's picture, and how many rays are saved; takes minutes."""
    name, file, rows = subject.path.stem, subject.file, bands(subject.file.camera.height)
    truth, _ = subject.uniform(FINE)
    once = subject.picture()
    error = rms(once.radiance[rows], truth)
    print(f"{name}: {millions(once)} million rays, error {error:.4f}")
    grids = [subject.uniform(grid) for grid in GRIDS]
    needed = uniform_rays([rms(seen, truth) for seen, _ in grids], [count for _, count in grids], error)
    share = float(np.sum(rays_of(once)[rows])) / needed
    table.value(f"Whitted, {name}, adaptive rays of uniform ones", 100 * share, "%", limit="≤ 35")
    if PROGRAM is None:
        return
    peer = subject.peer()
    its_error = rms(peer.pixels[rows], subject.peer_truth())
    found = as_fine_as_peer(subject, truth, its_error)
    print(f"  POV-Ray {peer.rays / 1e6:.2f} million rays besides shadows', error {its_error:.4f}")
    if found is None or found[0] != AS_FINE[name]:
        raise SystemExit(f"{name}: as fine as POV-Ray is {found}; AS_FINE says {AS_FINE[name]}")
    print(f"  as fine: tolerance {found[0]}, error {found[1] / its_error:.2f} of its")
    alike = subject.picture(replace(file.whitted, attenuation=Unattenuated()))
    print(f"  the two pictures differ by {np.mean(np.abs(shown(alike.radiance) - shown(peer.pixels))):.4f} on average")


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--errors", action="store_true", help="errors and rays, not times")
    options = parser.parse_args()
    table = Rows(options.rows)
    if PROGRAM is None:
        table.absent("Whitted against POV-Ray", "POV-Ray is not installed (povray)", goal="whitted")
    with tempfile.TemporaryDirectory() as folder:
        ball, mesh = Path(folder) / "ball_of_100488_triangles.toml", dented_ball(159)
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(Path(folder) / "ball.ply")
        ball.write_text(BALL)
        for path in (*(FIGURES / f"{name}.toml" for name in (*MINUTES, "teapot")), ball):
            if options.errors:
                errors(table, Subject(path))
            else:
                timed(table, Subject(path), 1 if options.quick else ROUNDS)
