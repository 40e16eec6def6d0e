"""What is compiled for a scene serves the next: moved objects, another camera, another light need no new kernels."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from relume.renderers.mitsuba.arrays import aligned
from relume.renderers.mitsuba.differential import Differential
from relume.scene.cameras.camera import Camera
from relume.scene.lights import SphereLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Box, Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

LARGE = 1000
"""Operations of a kernel from which on it takes a second to compile."""
FLOOR = Plane(Diffuse((0.6, 0.5, 0.4)), (3.0, 3.0))


def seen_from(x: float) -> Camera:
    return Camera.looking_at(np.array([x, 0.9, 2.2]), np.array([0, 0.25, 0]), width=24, height=16, focal_length=24 + x)


def scene(x: float, lamp: tuple[float, float, float] = (0.8, 1.5, -0.5), wall: float = 2.0, rows: int = 8) -> Scene:
    light = np.full((rows, 2 * rows, 3), 0.3, np.float32)
    light[2, 3] = 40.0 + x
    glass = sphere(Material(roughness=0.0, transmission=1.0), centre=(x, 0.3, 0), radius=0.3, fine=2)
    grey = sphere(Diffuse((0.5, 0.5, 0.5)), centre=(-0.7, 0.25, x), radius=0.25, fine=2)
    return Scene(
        EnvironmentMap(light), (FLOOR,), (glass, grey), (SphereLight(lamp, 0.1 + x / 10, (30.0 + x, 20.0, 10.0)),),
        Box((-wall, -0.5, -wall), (wall, 2.5, 3.0)), (0.1 * x, 0.3, 0.0),
    )  # fmt: skip


@pytest.fixture
def history(mi: Any) -> Any:
    """Gives the large kernels that were compiled since it was last asked."""
    import drjit as dr

    before = dr.flag(dr.JitFlag.KernelHistory)
    dr.set_flag(dr.JitFlag.KernelHistory, True)

    def compiled() -> list[int]:
        kernels = [each for each in dr.kernel_history() if each.get("operation_count", 0) > LARGE]
        return [each["operation_count"] for each in kernels if not each["cache_hit"]]

    yield compiled
    dr.kernel_history_clear()
    dr.set_flag(dr.JitFlag.KernelHistory, before)


def test_a_moved_object_another_camera_and_another_light_compile_nothing(history):
    renderer = Differential(samples=4, depth=4)
    renderer.change(scene(0.1), seen_from(0.3), seed=1)
    history()
    for other, camera in (
        (scene(0.25), seen_from(0.3)),
        (scene(0.25), seen_from(-0.4)),
        (scene(0.25, (-0.3, 1.2, 0.4), 2.3), seen_from(-0.4)),
        (replace(scene(0.25), probe=(0.2, 0.1, 0.1)), seen_from(-0.4)),
        (scene(0.25, rows=11), seen_from(-0.4)),
    ):
        renderer.change(other, camera, seed=2)
        assert history() == []


def test_more_samples_another_depth_and_another_size_compile_nothing(history):
    """Nothing of a picture's size, its samples or its depth may be compiled in: each would be a kernel of its own."""
    Differential(samples=4, depth=4).change(scene(0.1), seen_from(0.3), seed=1)
    history()
    Differential(samples=12, depth=4).change(scene(0.1), seen_from(0.3), seed=1)
    assert history() == []
    # A pass alone, as those over chosen pixels are.
    Differential(samples=4, depth=4, quick=True).change(scene(0.1), seen_from(0.3), seed=1)
    assert history() == []
    larger = replace(seen_from(0.3), width=30, height=21)
    Differential(samples=8, depth=4).change(scene(0.1), larger, seed=1)
    assert history() == []
    Differential(samples=4, depth=5).change(scene(0.1), seen_from(0.3), seed=1)
    assert history() == []


@pytest.mark.parametrize("skipped", range(4))
def test_what_dr_jit_takes_over_begins_where_its_own_memory_would(skipped):
    values = np.arange(20.0).reshape(4, 5)[:, skipped % 5 :]
    row = aligned(values, np.float32)
    assert row.dtype == np.float32 and row.shape == (values.size,)
    assert np.array_equal(row, values.ravel()) and row.ctypes.data % 64 == 0
