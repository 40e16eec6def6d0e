"""Nine camera raws of 45 megapixels merged and written: the most memory held (limit 3 GB), and the time of each stage.

The files are written first, by another process, so that what is measured is the merge alone.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from argparse import SUPPRESS
from pathlib import Path

import numpy as np
from measured import Rows, asked

WIDTH, HEIGHT, FRAMES = 8256, 5504, 9


def write_bracket(folder: Path, height: int) -> list[Path]:
    """DNG files one stop apart of a sweep from shadow to lamp, 90 MB each, one in memory at a time."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
    from dng_files import sensed, write_dng

    paths = []
    for frame in range(FRAMES):
        seconds, path = 2.0**-frame, folder / f"frame_{frame}.dng"
        mosaic = np.empty((height, WIDTH), np.uint16)
        for begin in range(0, height, 256):
            y, x = np.mgrid[begin : min(begin + 256, height), :WIDTH]
            radiance = 60 * 2.0 ** (14 * (x / WIDTH - 1)) * (1 + 0.3 * np.sin(y / 37) * np.sin(x / 23))
            mosaic[begin : begin + 256] = sensed(radiance, seconds, seed=1000 * frame + begin)
        paths.append(write_dng(path, mosaic, seconds=seconds, f_number=1.0))
    return paths


def peak() -> float:
    """The most memory this process has held, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


def merge_and_write(rows: Rows, folder: Path) -> None:
    """The measured process: what the command does with raw files."""
    from relume.capture.raw.merging import calibrate_raw, merge_raw
    from relume.image import files

    paths = sorted(folder.glob("*.dng"))
    start = time.perf_counter()
    print(f"{peak():6.2f} GB  after importing")
    calibration = calibrate_raw(paths)
    print(f"{peak():6.2f} GB  {time.perf_counter() - start:6.1f} s  exposures and noise of {len(paths)} frames")
    merged = merge_raw(paths, calibration=calibration)
    print(f"{peak():6.2f} GB  {time.perf_counter() - start:6.1f} s  merged, {merged.size[0]} × {merged.size[1]}")
    files.write(folder / "merged.exr", merged)
    what = f"nine raws of {merged.size[0] * merged.size[1] / 1e6:.0f} megapixels merged and written"
    rows.value(f"{what}, most memory", peak(), "GB", limit="≤ 3")
    rows.value(what, time.perf_counter() - start, "s")


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--merge", type=Path, help=SUPPRESS)
    options = parser.parse_args()
    if options.merge:
        merge_and_write(Rows(options.rows), options.merge)
    else:
        with tempfile.TemporaryDirectory() as place:
            write_bracket(Path(place), HEIGHT // 16 if options.quick else HEIGHT)
            kept = ["--rows", str(options.rows)] if options.rows else []
            subprocess.run([sys.executable, __file__, "--merge", place, *kept], check=True)
