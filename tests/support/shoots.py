"""Small shoots for what reads, measures and reports: a textured scene with a lamp, and its photographs as files."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dng_files import sensed, write_dng
from moving_scenes import CAMERA, background
from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.exposure.folder import expand
from relume.image import files
from relume.image.photograph import Exposure, Photograph
from synthetic import VirtualCamera

SECONDS = tuple(2.0 ** (-stop) for stop in range(9, 1, -1))
"""Eight photographs a stop apart, the shortest first."""
MAKER = "Virtual One"


def textured(width: int = 180, height: int = 120, *, stops: float = 6.0, seed: int = 1) -> np.ndarray:
    """Rough walls (H, W, 3) float32 over `stops`, the brightest near 30: edges everywhere, as photographs have them."""
    return background(np.random.default_rng(seed), (height, width), stops).astype(np.float32)


def real_bracket(shared: Path, name: str, *, sidecars: bool = True) -> Bracket:
    """One of the real brackets, without what is said of its colour profile."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*colour profile")
        ignore = (0, 0, 255) if name == "memorial" else None
        return read_bracket(expand([shared / "data/brackets" / name]), ignore=ignore, sidecars=sidecars)


def named(bracket: Bracket, prefix: str = "", *, camera: str = "", **fields: object) -> Bracket:
    """The bracket with a prefix to its photographs' names, and fields of them replaced."""
    return Bracket(
        tuple(replace(p, name=prefix + p.name, camera=camera, **fields) for p in bracket.photographs)  # type: ignore[arg-type]
    )


def exposed(
    scene: np.ndarray,
    exposures: Sequence[Exposure],
    *,
    camera: VirtualCamera = CAMERA,
    prefix: str = "frame_",
    maker: str = MAKER,
    seed: int = 0,
) -> tuple[Photograph, ...]:
    """The scene at each exposure, in their order."""
    return tuple(
        replace(camera.photograph(scene, exposure, name=f"{prefix}{i}.png", seed=100 * seed + i), camera=maker)
        for i, exposure in enumerate(exposures)
    )


def written(folder: Path, photographs: Sequence[Photograph]) -> list[str]:
    """The photographs as files in `folder`; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for photograph in photographs:
        path = folder / photograph.name
        files.write(path, replace(photograph, name=str(path)))
        paths.append(str(path))
    return paths


def raw_files(folder: Path, instants: Sequence[np.ndarray], seconds: Sequence[float]) -> list[Path]:
    """DNG files of luminances (H, W), one an exposure; 1 is white at one second, whatever the aperture they say."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for index, (light, t) in enumerate(zip(instants, seconds, strict=True)):
        paths.append(write_dng(folder / f"raw_{index}.dng", sensed(light, t, seed=index), seconds=t))
    return paths
