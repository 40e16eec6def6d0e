"""Image files: time of reading and writing 24 megapixels beside other programs, and the memory that reading takes.

Run as `python benchmarks/files.py [--megapixels 24] [--rounds 3] [FORMAT …]`. All work by turns in one process, each
once beforehand; medians. Every writer's file is flushed to the disk, as ours always are. A ratio is the peer's time by
ours, so above 1 ours is quicker; on a busy machine that of processor time is better. OpenImageIO reads LogLuv as 8-bit
values only; OpenCV gives its light, as libtiff decodes it. Memory is the peak of a process of its own
above what it held before, by the size of the decoded picture.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from argparse import SUPPRESS
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from measured import Rows, asked

import relume as rl
from relume.errors import RelumeError
from relume.image import files
from relume.image.files.encodings import PFM, Encoding, FloatTIFF, LogLuv, OpenEXR, RadianceHDR, RawFloat

oiio: Any = None
with suppress(ImportError):
    oiio = import_module("OpenImageIO")

Work = Callable[[], object]


@dataclass(frozen=True)
class Format:
    """One row of the table: how a picture is written by us, and what the peers are asked for.

    oiio : the type that OpenImageIO writes, and its attributes; None where it does not write the format
    opencv_settings : TIFF tag 259 and a LogLuv compression
    """

    name: str
    file: str
    encoding: Encoding
    picture: str = "photograph"
    oiio: tuple[str, dict[str, str]] | None = None
    opencv_reads: bool = False
    opencv_writes: bool = False
    oiio_reads: bool = True
    copied: bool = False
    opencv_settings: tuple[int, ...] = ()


FORMATS = (
    Format("RGBE", "a.hdr", RadianceHDR(), oiio=("float", {}), opencv_reads=True, opencv_writes=True),
    Format("RGBE, smooth", "b.hdr", RadianceHDR(), "smooth", ("float", {}), True, True),
    Format("RGBE, flat", "c.hdr", RadianceHDR(compressed=False), oiio=("float", {}), opencv_reads=True),
    Format("LogLuv 32", "d.tif", LogLuv(32), opencv_reads=True, opencv_writes=True, opencv_settings=(259, 34676)),
    Format(
        "LogLuv 24", "e.tif", LogLuv(24), "dull", opencv_reads=True, opencv_writes=True, opencv_settings=(259, 34677)
    ),
    Format("PFM", "f.pfm", PFM(), oiio=("float", {}), opencv_reads=True, opencv_writes=True, copied=True),
    Format("PFM, big-endian", "g.pfm", PFM(big_endian=True), opencv_reads=True, copied=True),
    Format("raw float", "h.float", RawFloat(), "square", oiio_reads=False, copied=True),
    Format("EXR, float", "i.exr", OpenEXR(), oiio=("float", {"compression": "zip"})),
    Format("EXR, half", "j.exr", OpenEXR(half=True), oiio=("half", {"compression": "zip"})),
    Format(
        "float TIFF, ZIP",
        "k.tif",
        FloatTIFF(),
        oiio=("float", {"compression": "zip"}),
        opencv_reads=True,
    ),
    Format("float TIFF, flat", "l.tif", FloatTIFF(compressed=False), oiio=("float", {"compression": "none"})),
)


def photograph(width: int, height: int) -> np.ndarray:
    """A bright sky over a dark ground, with shadows, grain as of a good camera, and a sun that halves still hold."""
    generator = np.random.default_rng(7)
    y, x = np.ogrid[:height, :width]
    y, x = (y / height).astype(np.float32), (x / width).astype(np.float32)
    light = np.where(y < 0.55, 4 - 5 * y, 0.2 + 0.3 * y) * (1 + 0.5 * np.sin(23 * x) * np.sin(31 * y * x))
    light += 2e4 * np.exp(-((x - 0.7) ** 2 + (y - 0.2) ** 2) / 2e-5)
    tint = np.stack([0.8 + 0.4 * y + 0 * x, 0.9 + 0.1 * x + 0 * y, 1.2 - 0.7 * y + 0 * x], -1)
    grain = generator.standard_normal((height, width, 3), np.float32)
    return np.maximum(light[..., None] * tint * (1 + 0.02 * grain), 1e-4).astype(np.float32)


def pictures(megapixels: float) -> dict[str, np.ndarray]:
    """By name: a photograph; the same within what LogLuv 24 holds; one without noise, for runs; one that is square."""
    height = max(8, round((megapixels * 1e6 / 1.5) ** 0.5))
    width = height * 3 // 2
    taken = photograph(width, height)
    smooth = np.empty_like(taken)
    smooth[:] = np.linspace(4, 0.1, height, dtype=np.float32)[:, None, None] * np.array([0.8, 0.9, 1], np.float32)
    smooth[height // 3 : height // 2, width // 4 : width // 3] = 20, 18, 15
    side = int((width * height) ** 0.5)
    square = np.resize(taken, (side, side, 3))
    return {"photograph": taken, "smooth": smooth, "dull": np.clip(taken, 0.01, 15), "square": square}


def flushed(path: Path, write: Work) -> Work:
    """`write`, then the file at `path` to the disk."""

    def work() -> None:
        assert write() is not False
        handle = os.open(path, os.O_RDWR)
        os.fsync(handle)
        os.close(handle)

    return work


def writes_by_oiio(path: Path, pixels: np.ndarray, kind: str, attributes: dict[str, str]) -> Work:
    def work() -> bool:
        output = oiio.ImageOutput.create(str(path))
        specification = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, kind)
        for name, value in attributes.items():
            specification.attribute(name, value)
        return output.open(str(path), specification) and output.write_image(pixels) and output.close()

    return flushed(path, work)


def reads_by_oiio(path: Path) -> Work:
    def work() -> None:
        source = oiio.ImageInput.open(str(path))
        if source is None or source.read_image(oiio.FLOAT) is None:
            raise ValueError(f"OpenImageIO reads no {path.suffix} of this kind: {oiio.geterror()[:100]}")

    return work


def reads_by_opencv(path: Path) -> Work:
    def work() -> None:
        if cv2.imread(str(path), cv2.IMREAD_UNCHANGED) is None:
            raise ValueError(f"OpenCV reads no {path.suffix} of this kind")

    return work


def peers(chosen: Format, folder: Path, pixels: np.ndarray) -> tuple[dict[str, Work], dict[str, Work]]:
    """Those who read and those who write, by name."""
    path, theirs = folder / chosen.file, folder / f"their-{chosen.file}"
    readers, writers = {}, {}
    copying = flushed(theirs, lambda: shutil.copyfile(path, theirs))
    if chosen.copied:
        readers["copying the file"] = writers["copying the file"] = copying
    if chosen.opencv_reads:
        readers["OpenCV"] = reads_by_opencv(path)
    if chosen.opencv_writes:
        turned, settings = np.ascontiguousarray(pixels[..., ::-1]), chosen.opencv_settings
        writers["OpenCV"] = flushed(theirs, lambda: cv2.imwrite(str(theirs), turned, settings))
    if oiio is not None and chosen.oiio_reads:
        readers["OpenImageIO"] = reads_by_oiio(path)
    if oiio is not None and chosen.oiio is not None:
        writers["OpenImageIO"] = writes_by_oiio(theirs, pixels, *chosen.oiio)
    return readers, writers


def timed(work: Work) -> tuple[float, float]:
    """Seconds, of the clock and of the processors."""
    clock, processors = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - clock, time.process_time() - processors


def by_turns(ours: Work, theirs: dict[str, Work], rounds: int) -> dict[str, list[tuple[float, float]]]:
    """Seconds of the clock and of the processors of every round, by name; a peer that fails is left out with a line."""
    works = {"ours": ours}
    ours()
    for name, work in theirs.items():
        try:
            work()
        except (ValueError, AssertionError, cv2.error) as error:
            print(f"  {name} is left out: {' '.join(str(error).split()) or 'it fails'}")
        else:
            works[name] = work
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            taken[name].append(timed(work))
    return taken


def show(rows: Rows, what: str, megapixels: float, taken: dict[str, list[tuple[float, float]]]) -> None:
    """A row for each peer: the ratio by the clock, and that of processor time in its note."""
    ours = taken.pop("ours")
    clock = [wall for wall, _ in ours]
    if not taken:
        speed = f"{megapixels / statistics.median(clock):.0f} megapixels a second"
        rows.value(what, clock, "s", note=speed)
    for name, theirs in taken.items():
        busy = statistics.median(their / our for (_, our), (_, their) in zip(ours, theirs, strict=True))
        goal = "exr_write" if what.startswith("EXR") and what.endswith("write") and name == "OpenImageIO" else ""
        rows.ratio(what, clock, name, [wall for wall, _ in theirs], goal=goal, note=f"by processor time {busy:.2f} ×")


def peak(path: Path, small: Path, picture: np.ndarray) -> float | None:
    """What reading takes at most beyond a small file of the kind, by the size of the decoded picture."""
    if not Path("/proc/self/status").exists():
        return None
    words = [sys.executable, __file__, "--read", str(small), str(path)]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    return int(said) * 1024 / picture.nbytes


def read_alone(small: str, path: str) -> None:
    """Print how many KiB more than a small file of the same kind a large one takes at most."""
    warnings.simplefilter("ignore")
    files.read_radiance(small)  # what is imported and compiled, once, is no part of it
    before = most_held()
    files.read_radiance(path)
    print(most_held() - before)


def most_held() -> int:
    """KiB; not ru_maxrss, which a process inherits from the one that started it."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split("VmHWM:")[1].split()[0])


def run(rows: Rows, chosen: Format, folder: Path, picture: np.ndarray, rounds: int) -> None:
    path, small = folder / chosen.file, folder / f"small-{chosen.file}"
    image = rl.RadianceMap(picture)
    files.write(small, rl.RadianceMap(np.ascontiguousarray(picture[:64, :64])), chosen.encoding)
    files.write(path, image, chosen.encoding)
    megapixels, (readers, writers) = picture.size / 3e6, peers(chosen, folder, picture)
    show(rows, f"{chosen.name}, read", megapixels, by_turns(lambda: files.read_radiance(path), readers, rounds))
    show(
        rows,
        f"{chosen.name}, write",
        megapixels,
        by_turns(lambda: files.write(path, image, chosen.encoding), writers, rounds),
    )
    size = path.stat().st_size
    if (held := peak(path, small, picture)) is not None:
        note = f"{size / 1e6:.0f} MB"
        rows.value(f"{chosen.name}, memory of reading by the picture's", held, "×", limit="≤ 2", note=note)


def main(rows: Rows, megapixels: float, rounds: int, names: list[str]) -> None:
    warnings.simplefilter("ignore")  # of what formats do not keep
    made = pictures(megapixels)
    height, width, _ = made["photograph"].shape
    print(f"{width} x {height} pixels, medians of {rounds}" + ("" if oiio else "; OpenImageIO is not installed"))
    for chosen in FORMATS:
        if names and not any(name.lower() in chosen.name.lower() for name in names):
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                run(rows, chosen, Path(folder), made[chosen.picture], rounds)
            except (ImportError, RelumeError, ValueError) as error:
                print(f"{chosen.name} is left out: {error}")


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--megapixels", type=float)
    parser.add_argument("--rounds", type=int)
    parser.add_argument("--read", nargs=2, help=SUPPRESS)
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help="only those with this in their names")
    given = parser.parse_args()
    if given.read:
        read_alone(*given.read)
    else:
        megapixels, rounds = given.megapixels or (2 if given.quick else 24), given.rounds or (1 if given.quick else 3)
        main(Rows(given.rows), megapixels, rounds, given.formats)
