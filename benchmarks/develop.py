"""Developing 24 megapixels, and glare at 3840×2160, against the same by other tools: medians of rounds by turns.

numpy.power for plain exposure and sRGB, OpenCV's TonemapReinhard for Reinhard's global operator, and, where it is
installed, `luminance-hdr-cli` for the operators that both have, as whole processes from the same .hdr to the same kind
of file (--processes does these alone). Peak memory of each step (VmHWM, in a process of its own) over the picture's
bytes, its input included. The picture is made: 24 megapixels of noise with a range of 10⁵ and a lamp.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from argparse import SUPPRESS
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from measured import Rows, asked
from rounds import turns

from relume.image import files
from relume.image.radiance import RadianceMap
from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.glare.camera import CameraGlare
from relume.virtual_camera.lens.glare.eye import EyeGlare
from relume.virtual_camera.tone.display.encoding import Srgb, encoded
from relume.virtual_camera.tone.ferwerda import Ferwerda
from relume.virtual_camera.tone.histogram.adjustment import HistogramAdjustment
from relume.virtual_camera.tone.histogram.curve import HumanContrast
from relume.virtual_camera.tone.metered import MeteredExposure
from relume.virtual_camera.tone.pattanaik.pattanaik import Pattanaik
from relume.virtual_camera.tone.reinhard import Reinhard, ReinhardLocal
from relume.virtual_camera.tone.tumblin_rushmeier import TumblinRushmeier
from relume.virtual_camera.virtual_camera import VirtualCamera

SIZE, GLARE_SIZE = (6000, 4000), (3840, 2160)
PHOTOGRAPH = "photograph: checked, metered, exposed, 8 bits"
TONES: dict[str, Any] = {
    "plain exposure": MeteredExposure(),
    "Reinhard, global": Reinhard(),
    "Reinhard, local": ReinhardLocal(),
    "histogram adjustment": HistogramAdjustment(),
    "histogram adjustment, human contrast": HistogramAdjustment(contrast=HumanContrast()),
    "Tumblin & Rushmeier": TumblinRushmeier(),
    "Ferwerda, without acuity and colour": Ferwerda(acuity=False, colour=False),
    "Pattanaik": Pattanaik(),
}
GLARES: dict[str, Any] = {
    "eye by day": EyeGlare(adaptation=100.0),
    "eye at night": EyeGlare(adaptation=0.001),
    "camera, seven blades": CameraGlare(Blades(7), f_number=16.0),
}


def made(size: tuple[int, int]) -> RadianceMap:
    """A picture in cd/m² with a range of 10⁵ and a lamp."""
    width, height = size
    generator = np.random.default_rng(0)
    coarse = np.exp(generator.normal(3, 1.2, (height // 40, width // 40, 3))).astype(np.float32)
    radiance = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    np.maximum(radiance, 0.05, out=radiance)
    for row in range(0, height, 500):
        band = radiance[row : row + 500]
        band *= np.exp(0.05 * generator.standard_normal(band.shape, dtype=np.float32))
    radiance[height // 4 : height // 4 + 20, width // 3 : width // 3 + 20] = 30_000
    return RadianceMap(radiance, unit="cd/m²")


def power(radiance: np.ndarray, gain: float) -> np.ndarray:
    """Plain exposure and sRGB by numpy.power."""
    linear = np.clip(radiance * np.float32(gain), 0, 1)
    return np.rint(
        255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055)
    ).astype(np.uint8)


def race(rows: Rows) -> None:
    """Seconds of every step, and what the peers take."""
    picture = made(SIZE)
    radiance = picture.radiance
    gain = VirtualCamera().tone_map(picture).gain
    peer = cv2.createTonemapReinhard(gamma=1.0, intensity=0.0, light_adapt=0.0, color_adapt=0.0)
    works: dict[str, Callable[[], Any]] = {
        "table, exposure and sRGB": lambda: encoded(radiance, Srgb(), gain=gain),
        "numpy.power, the same": lambda: power(radiance, gain),
        "OpenCV's TonemapReinhard": lambda: peer.process(radiance),
    }
    for name, tone in TONES.items():
        camera = VirtualCamera(tone=tone)
        works[name] = lambda camera=camera: camera.tone_map(picture).values
    camera = VirtualCamera()
    works[PHOTOGRAPH] = lambda: camera.tone_map(picture).photograph()
    times = turns(works)
    print_times(f"{SIZE[0]}×{SIZE[1]}", {name: statistics.median(each) for name, each in times.items()})
    for ours, peer, limit in (
        ("table, exposure and sRGB", "numpy.power, the same", "≥ 5"),
        ("Reinhard, global", "OpenCV's TonemapReinhard", "≥ 2"),
    ):
        rows.ratio(f"develop 24 megapixels, {ours}", times[ours], peer, times[peer], limit=limit)
    for name, limit in (("histogram adjustment", "≤ 1"), ("histogram adjustment, human contrast", "≤ 1")):
        rows.value(f"develop 24 megapixels, {name}", times[name], "s", limit=limit)
    for name in ("Tumblin & Rushmeier", "Ferwerda, without acuity and colour", "Pattanaik", "Reinhard, local"):
        rows.value(f"develop 24 megapixels, {name}", times[name], "s")
    rows.value("develop 24 megapixels to 8 bits, plain", times[PHOTOGRAPH], "s", limit="≤ 0.25")


def race_of_glares(rows: Rows) -> None:
    """Seconds of each glare, its point spread made anew each time."""
    small = made(GLARE_SIZE)
    view = VirtualCamera().view(small)
    turn = count()

    def anew(part: Any) -> None:
        # Another focal length by a hair, so that no point spread is kept from the round before.
        part.apply(small.radiance, replace(view, focal_length=view.focal_length * (1 + 1e-6 * next(turn))))

    glares = {name: (lambda part=part: anew(part)) for name, part in GLARES.items()}
    for name, each in turns(glares, 3).items():
        rows.value(f"glare at {GLARE_SIZE[0]}×{GLARE_SIZE[1]}, {name}", each, "s", limit="≤ 2.5")


def whole_processes(rows: Rows, size: tuple[int, int], rounds: int) -> None:
    """From .hdr to .jpg as whole processes, against Luminance HDR's command line."""
    if (peer := shutil.which("luminance-hdr-cli")) is None:
        rows.absent("relume develop against Luminance HDR", "luminance-hdr-cli is not installed", goal="develop")
        return
    relume = str(Path(sys.executable).with_name("relume"))
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        files.write(place / "in.hdr", made(size))
        environment = os.environ | {"QT_QPA_PLATFORM": "offscreen", "HOME": folder}
        operators = {
            "reinhard": ["reinhard02"],
            "reinhard-local": ["reinhard02", "--tmoR02Scales", "true"],
            "ferwerda": ["ferwerda"],
        }
        for ours, theirs in operators.items():
            words = [relume, "develop", "in.hdr", "-o", f"{ours}.jpg", "--tone", ours, "-q"]
            others = [peer, "-l", "in.hdr", "--tmo", *theirs, "-o", f"{ours}_peer.jpg"]
            works: dict[str, Callable[[], Any]] = {
                "ours": lambda words=words: run(words, place, environment),
                "theirs": lambda words=others: run(words, place, environment),
            }
            times = turns(works, rounds)
            goal = "develop" if ours == "reinhard" else ""
            what = f"relume develop --tone {ours}, the whole process, .hdr to .jpg"
            rows.ratio(what, times["ours"], "Luminance HDR", times["theirs"], goal=goal)


def run(words: list[str], folder: Path, environment: dict[str, str]) -> None:
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}: {done.stderr[-500:]}")


def print_times(title: str, seconds: dict[str, float]) -> None:
    print(title)
    for name, each in seconds.items():
        print(f"  {name.ljust(48)} {each:8.3f} s")


def peak(name: str) -> None:
    """In a process of its own: how far memory grows over what it was with the picture, over the picture's bytes."""
    picture = made(GLARE_SIZE if name in GLARES else SIZE)
    if name in GLARES:
        part, view = GLARES[name], VirtualCamera().view(picture)
        tiny = np.ones((64, 64, 3), np.float32)
        part.apply(tiny, view)
        before = status("VmRSS")
        restart_peak()
        part.apply(picture.radiance, view)
    else:
        camera = VirtualCamera(tone=TONES[name])
        camera.tone_map(RadianceMap(np.ones((64, 64, 3), np.float32), unit="cd/m²")).photograph()
        before = status("VmRSS")
        restart_peak()
        camera.tone_map(picture).photograph()
    grown = (status("VmHWM") - before) * 1024 + picture.radiance.nbytes
    print(f"  {name.ljust(48)} {grown / picture.radiance.nbytes:8.2f} pictures")


def status(key: str) -> int:
    """kB, from the kernel."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key):
            return int(line.split()[1])
    raise SystemExit(f"no {key} on this system")


def restart_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--processes", action="store_true", help="only the whole processes")
    parser.add_argument("--peak", help=SUPPRESS)
    options = parser.parse_args()
    table = Rows(options.rows)
    if options.peak:
        peak(options.peak)
    elif options.processes or options.quick:
        whole_processes(table, (1500, 1000) if options.quick else SIZE, 1 if options.quick else 3)
    else:
        race(table)
        race_of_glares(table)
        whole_processes(table, SIZE, 3)
        print("peak memory, the input included")
        for each in (*TONES, *GLARES):
            subprocess.run([sys.executable, __file__, "--peak", each], check=True)
