"""How near is `relume insert` to the truth of every virtual shoot?

    PYTHON benchmarks/shoots/measure.py FOLDER COMPARE_TO_TRUTH.py [NAME …] [--samples N …] [--relume COMMAND]

PYTHON has NumPy, SciPy, OpenEXR, Pillow and scikit-image; it needs no relume, which runs as COMMAND (`relume` unless
given). FOLDER is where make.py put the shoots, or lies a link to another shoot of their layout, whose folder then holds
its own shot.toml. FOLDER/NAME/out_N gets the composite. Printed for every shoot and number of samples, two rows:

- object and effect, error and bias, as COMPARE_TO_TRUTH.py has them, and what it says of the truth's second seed taken
  for a composite: the truth's own noise, √2 times, below which no renderer can come;
- PSNR and SSIM over the objects as the objects-with-lighting benchmark has them (Ummenhofer et al. 2024): encoded by
  a gamma of 2.2, one exposure fitted to what is not white, no colours balanced; the truth is exposed so that 98 % of
  the objects' values are below white. The second seed's own stand in brackets.

The second row has the truth as the camera's lens passes it. Photographs are darker towards their corners, a composite
keeps the plate as it was photographed, and make.py's truth has none of that: the plate alone errs by it.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from scipy.optimize import minimize_scalar
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from virtual_camera import CAMERAS

HERE = Path(__file__).parent
GAMMA = 2.2


def read(path: Path) -> np.ndarray:
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        pixels = next(channels[k].pixels for k in ("RGB", "RGBA") if k in channels)
    return pixels[..., :3].astype(np.float32)


def objects_with_lighting(ours: np.ndarray, truth: np.ndarray, inside: np.ndarray) -> tuple[float, float]:
    """PSNR and SSIM over the pixels `inside`."""

    def encoded(linear: np.ndarray) -> np.ndarray:
        return np.clip(np.maximum(linear, 0) ** np.float32(1 / GAMMA), 0, 1).astype(np.float32)

    shown = encoded(truth / np.quantile(truth[inside], 0.98))
    fitted = inside & (shown.max(-1) < 1)

    def error(stops: float) -> float:
        return float(np.abs(encoded(ours[fitted] * np.float32(2**stops)) - shown[fitted]).mean())

    start = np.log2(np.median(shown[fitted]) ** GAMMA / np.median(ours[fitted]))
    stops = minimize_scalar(error, bracket=(start - 1, start + 1)).x
    picture = encoded(ours * np.float32(2**stops))
    psnr = peak_signal_noise_ratio(shown[inside], picture[inside], data_range=1.0)
    mask = inside[..., None].astype(np.float32)
    _, map_ = structural_similarity(picture * mask, shown * mask, channel_axis=-1, full=True, data_range=1.0)
    return float(psnr), float(map_[inside].mean())


def through_lens(truth: Path, passed: np.ndarray, folder: Path) -> Path:
    """The truth (H, W, 3) as a lens passes it, (H, W, 1), in another folder."""
    for path in truth.glob("*.exr"):
        pixels = read(path) * (1 if path.name.startswith("mask") else passed)
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels, np.float32)}) as file:
            file.write(str(folder / path.name))
    return folder


def compared(tool: Path, composite: Path, truth: Path) -> dict[str, float]:
    """What the shoots' own program says, and PSNR and SSIM."""
    run = [sys.executable, str(tool), str(composite), str(truth), "--json"]
    numbers = json.loads(subprocess.run(run, capture_output=True, text=True, check=True).stdout)
    inside = read(truth / "mask_all.exr").mean(-1) > 0.99
    psnr, ssim = objects_with_lighting(read(composite), read(truth / "with_all.exr"), inside)
    return {**numbers, "psnr": psnr, "ssim": ssim}


def inserted(relume: list[str], folder: Path, samples: int) -> tuple[Path, float]:
    """The composite, made by the command line, and its seconds; what relume noted stands in notes.txt beside it."""
    ours = HERE / f"{folder.name}.toml"
    if ours.is_file():
        shutil.copy(ours, folder / "shot.toml")
    out = folder / f"out_{samples}"
    out.mkdir(exist_ok=True)
    start = time.perf_counter()
    run = [*relume, "insert", str(folder / "shot.toml"), "-o", str(out), "--samples", str(samples)]
    done = subprocess.run(run, capture_output=True, text=True)
    (out / "notes.txt").write_text(re.sub(r"\x1b\[[0-9;]*m", "", done.stdout + done.stderr))
    if done.returncode not in (0, 4):  # 4: done, with doubts
        raise SystemExit(f"{folder.name}: exit {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return out / "composite.exr", time.perf_counter() - start


def measured(tool: Path, composite: Path, truth: Path) -> tuple[dict[str, float], dict[str, float] | None]:
    """The composite's numbers, and those of the truth's second seed where there is one."""
    second = truth / "with_all_2.exr"
    return compared(tool, composite, truth), compared(tool, second, truth) if second.is_file() else None


def row(name: str, ours: dict[str, float], noise: dict[str, float] | None) -> str:
    def beside(key: str, form: str) -> str:
        return form.format(ours[key]) + ("" if noise is None else f" ({form.format(noise[key])})")

    cells = [beside("object_error", "{:.3f}"), beside("effect_error", "{:.3f}")]
    cells += [f"{ours[key]:+.3f}" for key in ("object_bias", "effect_bias")]
    cells += [beside("psnr", "{:.1f}"), beside("ssim", "{:.3f}")]
    return f"| {name} | " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("compare", type=Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--samples", type=int, nargs="+", default=[64])
    parser.add_argument("--relume", default="relume")
    parser.add_argument("--again", action="store_true", help="measure the composites that are there")
    given: Any = parser.parse_args()
    names = given.names or sorted(path.parent.name for path in given.folder.glob("*/truth"))
    print("| shoot, rays a pixel | object error | effect error | object bias | effect bias | PSNR, dB | SSIM |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for name in names:
        folder = given.folder / name
        truth = folder / "truth"
        for samples in given.samples:
            composite, seconds = folder / f"out_{samples}/composite.exr", 0.0
            if not given.again:
                composite, seconds = inserted(given.relume.split(), folder, samples)
            print(row(f"{name}, {samples}", *measured(given.compare, composite, truth)), flush=True)
            if name in CAMERAS:
                with tempfile.TemporaryDirectory() as beside:
                    seen = through_lens(truth, CAMERAS[name].passed(*read(composite).shape[:2]), Path(beside))
                    numbers = measured(given.compare, composite, seen)
                print(row("the truth through the lens", *numbers), flush=True)
            print(f"{name}, {samples}: {seconds:.0f} s", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
