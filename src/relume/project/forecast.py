"""What an insertion will take: rays, minutes, memory and room on the disk, before anything of it is done.

Rays and their speed come from a small render of the objects on grey surfaces under a lamp: where they are in the
picture decides, and how costly they are. The rest grows with the plate as it did where it was measured.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path
from shutil import disk_usage

import numpy as np

from relume.errors import GatheredDoubts, OutputNotWritten, RelumeError
from relume.project.insertion.render_tiles import VIEWED, is_large, shares_of_tiles
from relume.project.shot_file.shot import Shot
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.progressive.allocation import weighed_variance
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh
from relume.sphere.environment_map import EnvironmentMap

PROBE, PROBE_RAYS = 400_000, 4
"""Pixels and rays a pixel of the small render, so many that starting it is not what takes the time."""
LAMP = 100.0
"""Radiance of a lamp above, in light of 1: most places have one, and it decides where shadows and noise are."""
GREY = 0.3
"""Reflectance of the real surfaces in it."""
DISK = 440
"""Bytes a pixel that an insertion holds on the disk at most: plate 25, denoised 25, reflectance 37, render 80, pictures
12, nine photographs of 16 bits 54; and either the render's parts 92 and its planes 80, or what was matched to the plate
52, the composite, the model and its variance 60, and the layers 56. Some is to spare."""
START, A_MEGAPIXEL = 25.0, 8.0
"""Seconds of two cores for all but the rays: balls, light and gloss, and what is done to each pixel of the plate. The
room took 16 s at 0.4 megapixels, all of its kernels compiled before, and 214 at 24."""
SMALL_MEMORY, LARGE_MEMORY = (0.9, 0.9), (2.3, 0.07)
"""Gigabytes of memory, and more for each megapixel: of one render, and of a large plate, rendered in parts."""


@dataclass(frozen=True)
class Forecast:
    """What an insertion will take, roughly.

    rays : a pixel, on average
    total : of them all
    seconds : on this machine, as busy as it was
    memory, disk : bytes
    """

    rays: float
    total: float
    seconds: float
    memory: float
    disk: float


def forecast(shot: Shot, camera: Camera, meshes: Sequence[Mesh], threads: int | None = None) -> Forecast | None:
    """What the insertion of these objects will take; None where nothing can be rendered to see it.

    camera : the plate's
    """
    megapixels = camera.width * camera.height / 1e6
    try:
        with GatheredDoubts():
            rays, speed = _probed(shot, camera, meshes, threads)
    except (RelumeError, ValueError):
        return None
    total = rays * megapixels * 1e6
    return Forecast(
        rays, total, START + A_MEGAPIXEL * megapixels + total / speed,
        memory_for(camera.width * camera.height), DISK * megapixels * 1e6,
    )  # fmt: skip


def memory_for(pixels: int) -> float:
    """Bytes of memory that an insertion into a plate of so many pixels takes."""
    fixed, each = LARGE_MEMORY if pixels > VIEWED else SMALL_MEMORY
    return 1e9 * (fixed + each * pixels / 1e6)


def _probed(shot: Shot, camera: Camera, meshes: Sequence[Mesh], threads: int | None) -> tuple[float, float]:
    """Rays a pixel on average, and how many are traced in a second."""
    surfaces = (shape for table in shot.surfaces() for shape in table.shapes(shot.folder))
    local = tuple(replace(shape, material=Diffuse((GREY, GREY, GREY))) for shape in surfaces)
    light = np.ones((16, 32, 3), np.float32)
    light[3:5, 10:12] = LAMP
    scene = Scene(EnvironmentMap(light), local, tuple(meshes))
    shrunk = min(1.0, sqrt(PROBE / (camera.width * camera.height)))
    small = camera.resized(max(1, round(camera.width * shrunk)), max(1, round(camera.height * shrunk)))
    # A few pixels compile what the others run.
    pilot = Differential(PROBE_RAYS, depth=shot.render.depth, threads=threads)
    prepared = pilot.prepare(scene, small)
    pilot.change(scene, small.resized(8, 8), prepared=prepared)
    begun = time.perf_counter()
    ends = [begun]
    # Passes are traced at once, so that the time between them says nothing; depth and normals come after the last.
    noise = pilot.change(scene, small, prepared=prepared, progress=lambda _: ends.append(time.perf_counter()))
    speed = noise.samples * small.width * small.height / max(ends[-1] - begun, 1e-3)
    grey = np.broadcast_to(np.float32(GREY), (small.height, small.width, 3))
    if is_large(camera):
        shares, areas = shares_of_tiles(noise, grey, camera, shot.render.samples)
        return float(np.average(shares, weights=areas)), speed
    # What moves while the shutter is open gets all its rays: each pass sees another moment.
    if shot.sequence is not None and shot.sequence.shutter is not None:
        return float(shot.render.samples), speed
    seen = noise.objects + noise.difference + (1 - noise.matte[..., None]) * grey
    variance = weighed_variance(seen, noise.objects_variance + noise.difference_variance)
    asked = Differential(shot.render.samples, shot.render.noise)
    return min(asked.expected_samples(camera, variance), float(shot.render.samples)), speed


def require_room(out: Path, pixels: int) -> None:
    """Raise OutputNotWritten where the disk would be full in the middle of the job.

    out : the job's folder, which may not be there yet; what an earlier run left in it counts as room
    pixels : of the plate
    """
    existing = next(path for path in (out, *out.absolute().parents) if path.is_dir())
    left = sum(path.stat().st_size for path in (out / "stages").glob("*.npz"))
    needed, free = DISK * pixels, disk_usage(existing).free + left
    if free < needed:
        raise OutputNotWritten(
            f"{out}: a plate of {pixels / 1e6:.3g} megapixels needs up to {needed / 1e9:.2g} GB there while it is "
            f"worked on, and {free / 1e9:.2g} GB are free; make room, or choose another -o"
        )
