"""Light transport by Mitsuba 3 (path tracing): the renderer of the main job.

Only `render/mitsuba*` imports Mitsuba and Dr.Jit, and only when something is rendered.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from relume.render.mitsuba_scene import matte_dictionary, scene_dictionary
from relume.render.mitsuba_variant import choose_variant
from relume.render.renderer import Progress, Render
from relume.scene.camera import Camera
from relume.scene.scene import Scene

PASS_RAYS = 4_000_000
"""Rays traced at once; 4 million keep a pass under about half a gigabyte."""
MATTE_SAMPLES = 64
"""Rays a pixel for the matte and the other planes: coverage to about a hundredth at edges."""


@dataclass(frozen=True)
class Mitsuba:
    """Unidirectional path tracing with multiple importance sampling of the light.

    samples : rays a pixel, at most; 256 shows little noise on what the light reaches directly
    noise : stop earlier, once the standard error of the picture's mean pixel is below this share of it; None traces
        all samples
    depth : bounces before a path ends; 12 lets light into and out of glass before and behind glass
    variant : Mitsuba's variant; chosen for this machine unless given
    threads : all cores unless given; the pixels do not depend on it
    """

    samples: int = 256
    noise: float | None = None
    depth: int = 12
    variant: str | None = None
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.samples < 2 or self.depth < 1 or (self.noise is not None and not self.noise > 0):
            raise ValueError(
                f"samples {self.samples}, depth {self.depth}, noise {self.noise}; expected at least 2, 1 and above 0"
            )
        if self.threads is not None and self.threads < 1:
            raise ValueError(f"threads is {self.threads}; expected at least 1, or none for all cores")

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """Render in passes of equal size; the passes' scatter is the variance."""
        with _mitsuba(self.variant, self.threads) as mi:
            world = mi.load_dict(scene_dictionary(mi, scene, camera))
            path = mi.load_dict({"type": "path", "max_depth": self.depth + 1, "rr_depth": 8})
            radiance, variance, samples = self._accumulated(
                lambda spp, s: np.array(mi.render(world, integrator=path, spp=spp, seed=s), np.float64),
                camera,
                seed,
                progress or (lambda share: None),
            )
            depth, normal, albedo = _planes(mi, world, camera, seed)
            matte = _matte(mi, scene, camera, seed)
        return Render(radiance, variance, matte, depth, normal, albedo, samples)

    def _accumulated(
        self, trace: Callable[[int, int], np.ndarray], camera: Camera, seed: int, progress: Progress
    ) -> tuple[np.ndarray, np.ndarray, int]:
        per_pass = max(1, min(self.samples // 2, PASS_RAYS // (camera.width * camera.height)))
        passes = -(-self.samples // per_pass)
        total = np.zeros((camera.height, camera.width, 3))
        squares = np.zeros_like(total)
        done = 0
        for index in range(passes):
            picture = trace(per_pass, _pass_seed(seed, index))[..., :3]
            total += picture
            squares += picture**2
            done = index + 1
            progress(done / passes)
            if self.noise is not None and done >= 4 and _relative_error(total, squares, done) < self.noise:
                break
        mean = total / done
        variance = np.maximum(squares / done - mean**2, 0) / max(done - 1, 1)
        progress(1.0)
        return mean.astype(np.float32), variance.astype(np.float32), done * per_pass


def _relative_error(total: np.ndarray, squares: np.ndarray, count: int) -> float:
    mean = total / count
    error = np.sqrt(np.maximum(squares / count - mean**2, 0) / (count - 1))
    return float(error.mean() / max(mean.mean(), 1e-30))


def _pass_seed(seed: int, index: int) -> int:
    """One seed a pass, the same with and without objects, far from those of neighbouring seeds."""
    return int(np.random.SeedSequence([seed, index]).generate_state(1)[0])


def _planes(mi: Any, world: Any, camera: Camera, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    integrator = mi.load_dict({"type": "aov", "aovs": "depth:depth,normal:sh_normal,albedo:albedo"})
    spp = max(1, min(MATTE_SAMPLES, PASS_RAYS // (camera.width * camera.height)))
    planes = np.array(mi.render(world, integrator=integrator, spp=spp, seed=_pass_seed(seed, 0)), np.float32)
    # The first three channels are the nested integrator's picture where there is one.
    depth, normal, albedo = np.split(planes[..., -7:], [1, 4], axis=-1)
    return depth[..., 0], normal, albedo


def _matte(mi: Any, scene: Scene, camera: Camera, seed: int) -> np.ndarray:
    matte = np.zeros((camera.height, camera.width))
    if not scene.objects:
        return matte.astype(np.float32)
    world = mi.load_dict(matte_dictionary(mi, scene, camera))
    whiteness = mi.load_dict({"type": "aov", "aovs": "albedo:albedo"})
    per_pass = max(1, min(MATTE_SAMPLES, PASS_RAYS // (camera.width * camera.height)))
    passes = -(-MATTE_SAMPLES // per_pass)
    for index in range(passes):
        picture = np.array(mi.render(world, integrator=whiteness, spp=per_pass, seed=_pass_seed(seed, index)))
        matte += picture[..., -3]
    return np.clip(matte / passes, 0, 1).astype(np.float32)


@contextmanager
def _mitsuba(variant: str | None, threads: int | None) -> Iterator[Any]:
    """Mitsuba with its variant and threads set for as long as it is used."""
    mi, dr, chosen = _imported(variant)
    variant_before, threads_before = mi.variant(), dr.thread_count()
    mi.set_variant(chosen)
    dr.set_thread_count(threads or threads_before)
    try:
        yield mi
    finally:
        dr.set_thread_count(threads_before)
        if variant_before is not None and variant_before != chosen:
            mi.set_variant(variant_before)


@lru_cache
def _imported(variant: str | None) -> tuple[Any, Any, str]:
    choice = choose_variant()
    # Dr.Jit reads the path when it is imported.
    if choice.library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = choice.library
    import drjit
    import mitsuba

    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba, drjit, variant or choice.name
