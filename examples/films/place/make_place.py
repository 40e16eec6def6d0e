"""Photograph the hall and bake the photographs onto its model: `python make_place.py` writes out/place.glb.

Five photographs of high dynamic range, by our own path tracer, stand for a photographer's; new views are held against
the true hall seen from there.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hall import CAMERAS, camera, hall, surfaces

import relume as rl

OUT = Path(__file__).parent / "out"
NEW = [camera((0.6, 1.4, 1.6), (0, 0.9, -1.5)), camera((-1.2, 1.3, 1.0), (0.8, 0.7, -1.2))]


def photograph(view: rl.Camera, name: str, samples: int) -> rl.RadianceMap:
    """The hall as a camera sees it, kept in out/photographs."""
    path = OUT / "photographs" / f"{name}.exr"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        made = rl.render(hall(), view, rl.Mitsuba(samples=samples, denoise=True))
        rl.write(path, rl.RadianceMap(made.radiance))
    return rl.read_radiance(path)


def decibels(picture: np.ndarray, truth: np.ndarray, where: np.ndarray) -> float:
    """PSNR of the pictures developed so that the truth's brightest hundredth is white."""
    white = np.quantile(truth, 0.99)
    shown, wanted = (np.clip(each / white, 0, 1) ** (1 / 2.2) for each in (picture, truth))
    return float(-10 * np.log10(np.mean((shown - wanted)[where] ** 2)))


def main(samples: int = 64) -> None:
    """Make the place, and say how near new views are to the truth."""
    taken = tuple(
        rl.renderers.ProjectedPhotograph(view, photograph(view, f"photograph_{index}", samples), f"photograph {index}")
        for index, view in enumerate(CAMERAS)
    )
    place = rl.renderers.bake(surfaces(painted=False), taken)
    written = rl.report.write_place(OUT / "place.glb", place)
    print(f"{written.main}: {len(taken)} photographs, {place.holes:.1%} of the surface seen in none and filled")
    projected = rl.Scene(hall().light, local=surfaces(painted=False))
    for index, view in enumerate(NEW):
        truth = photograph(view, f"new_{index}", samples).radiance
        shown = rl.render(projected, view, rl.renderers.ProjectiveTexture(taken, samples=2))
        seen = shown.matte > 0.999
        rl.write(OUT / f"new_{index}.exr", rl.RadianceMap(shown.radiance))
        print(f"new view {index}: {decibels(shown.radiance, truth, seen):.1f} dB where seen ({seen.mean():.0%} of it)")


if __name__ == "__main__":
    main()
