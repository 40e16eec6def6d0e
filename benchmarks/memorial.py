"""The paper's Fig. 7 and 8 again, from its own photographs, beside OpenCV's (Debevec & Malik 1997, §3).

Needs the Stanford Memorial Church bracket; draws out/memorial/{curves,false_colour}.png and prints the ranges.
    python benchmarks/memorial.py FOLDER
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import cv2
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from relume.capture.exposure.bracket import read_bracket
from relume.capture.merging import merge
from relume.capture.response.calibration import recover_response
from relume.image import files
from relume.image.colour import luminance
from relume.image.radiance import OUTSIDE

OUT = Path("out/memorial")
COLOURS = (("red", "#c0392b"), ("green", "#27803f"), ("blue", "#2c5fb3"))


def orders(light: np.ndarray, where: np.ndarray) -> float:
    """Orders of magnitude from the darkest to the brightest thousandth but for strays."""
    low, high = np.percentile(light[where & (light > 0)], (0.1, 99.99))
    return float(np.log10(high / low))


def curves(axes, log_exposure: np.ndarray, samples, title: str) -> None:
    """Fig. 7 (a–d): each curve over its data, and all three together."""
    for axis, (name, colour), curve, data in zip(axes, COLOURS, log_exposure, samples, strict=False):
        if data is not None:
            kept = data[:: max(1, len(data) // 1500)]
            axis.plot(kept[:, 0], kept[:, 1], "o", ms=2.5, mfc="none", mec="#999999", mew=0.4)
        for each in (axis, axes[3]):
            each.plot(curve, np.arange(256), color=colour, lw=1.5)
        axis.set_title(f"{title}: {name}", fontsize=9)
    axes[3].set_title(f"{title}: all", fontsize=9)
    for axis in axes:
        axis.set_xlim(-8, 4)
        axis.set_ylim(0, 255)
        axis.grid(alpha=0.25)
        axis.set_xlabel("ln exposure X", fontsize=8)


def main(folder: Path) -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    bracket = read_bracket(sorted(folder.glob("memorial*.png")), ignore=(0, 0, 255))
    start = time.perf_counter()
    calibration = recover_response(bracket)
    middle = time.perf_counter()
    picture = merge(bracket, calibration.response)
    ours = middle - start, time.perf_counter() - middle

    images = [p.pixels for p in bracket.photographs]
    times = np.array([p.exposure.seconds for p in bracket.photographs if p.exposure], np.float32)
    start = time.perf_counter()
    table = cv2.createCalibrateDebevec(samples=70).process(images, times)
    middle = time.perf_counter()
    other = cv2.createMergeDebevec().process(images, times, table)
    theirs = middle - start, time.perf_counter() - middle

    peer = np.log(np.maximum(table[:, 0, :].T, 1e-9))
    peer -= peer[:, 127:128]
    figure = Figure(figsize=(13, 6.4), dpi=110, layout="constrained")
    axes = figure.subplots(2, 4, sharex=True, sharey=True)
    curves(axes[0], calibration.response.log_exposure, calibration.samples, "relume")
    curves(axes[1], peer, (None, None, None), f"OpenCV {cv2.__version__}")
    axes[0, 0].set_ylabel("pixel value Z")
    figure.savefig(OUT / "curves.png")

    assert picture.clipped is not None
    where = picture.clipped != OUTSIDE
    published = files.read_radiance(folder / "memorial.hdr").radiance
    maps = {"relume": picture.radiance, f"OpenCV {cv2.__version__}": other, "published": published}
    figure = Figure(figsize=(13, 6.6), dpi=110, layout="constrained")
    for axis, (name, radiance) in zip(figure.subplots(1, 3), maps.items(), strict=True):
        light = np.maximum(luminance(radiance), 1e-12)
        inside = where if light.shape == where.shape else np.ones(light.shape, bool)
        middle_light = float(np.median(light[inside]))
        image = axis.imshow(light / middle_light, norm=LogNorm(3e-3, 3e3), cmap="turbo")
        axis.set_title(f"{name}: {orders(light, inside):.2f} orders", fontsize=10)
        axis.set_axis_off()
        falls = 0 if name == "published" else int((np.diff(maps_curves(name, calibration, peer), axis=1) <= 0).sum())
        print(f"{name:16s} {orders(light, inside):.2f} orders of magnitude (0.1 to 99.99 %), "
              f"{light[inside].max() / light[inside].min():.3g} in all; curve falls at {falls} values")  # fmt: skip
    figure.colorbar(image, ax=figure.axes, fraction=0.02, label="luminance over its median")
    figure.savefig(OUT / "false_colour.png")
    print(f"response and merge: relume {ours[0]:.3f} + {ours[1]:.3f} s, OpenCV {theirs[0]:.3f} + {theirs[1]:.3f} s")

    # How far each is from the published map, a scale a channel being free.
    for name, radiance in maps.items():
        if name != "published" and published.shape == radiance.shape:
            good = (where & (published.min(-1) > 0) & (radiance.min(-1) > 0))[..., None].repeat(3, -1)
            ratio = np.where(good, np.log(np.maximum(radiance, 1e-12) / np.maximum(published, 1e-12)), np.nan)
            ratio -= np.nanmedian(ratio, axis=(0, 1))
            print(f"{name:16s} against the published map: median |ln ratio| {np.nanmedian(np.abs(ratio)):.3f}")


def maps_curves(name: str, calibration, peer: np.ndarray) -> np.ndarray:
    return calibration.response.log_exposure if name == "relume" else peer


if __name__ == "__main__":
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        print(__doc__)
    else:
        main(Path(sys.argv[1]))
