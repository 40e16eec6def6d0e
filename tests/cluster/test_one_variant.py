"""All parts of a picture are traced by one of Mitsuba's variants, whatever a worker's machine would choose."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relume.cluster.attempt import Needs, attempt
from relume.cluster.program import program
from relume.errors import ClusterUnusable
from relume.project.insertion import render_tiles
from relume.project.insertion.render_tiles import SharedByTiles, change_in_tiles
from relume.project.stages import Stages
from relume.renderers.mitsuba import variant as mitsuba_variant
from relume.renderers.mitsuba.differential import ChangeParts, Differential
from relume.renderers.mitsuba.path_tracer import Mitsuba, PlainPasses
from relume.renderers.mitsuba.variant import choose_llvm, choose_variant
from relume.renderers.progressive.accumulation import RenderSession
from relume.renderers.progressive.fingerprint import render_key
from relume.renderers.progressive.pass_workers import PassWorkers
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

pytest.importorskip("distributed", reason="Dask distributed is not installed: pip install 'relume[cluster]'")
GREY = Diffuse((0.6, 0.5, 0.4))
SCENE = Scene(
    EnvironmentMap(np.ones((4, 8, 3), np.float32)), (Plane(GREY, (4.0, 4.0)),),
    (sphere(GREY, centre=(0, 0.5, 0), radius=0.5, fine=1),),
)  # fmt: skip
CAMERA = Camera.looking_at(np.array([0, 1.5, 5]), np.array([0, 0.5, 0]), width=24, height=16, focal_length=30)


class Given(Exception):
    """What workers would share; nothing is traced."""


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> RenderSession:
    """A render's session with workers that stop it as they are given something."""

    def given(self: PassWorkers, divisible: Any) -> None:
        raise Given(divisible)

    monkeypatch.setattr(PassWorkers, "sharing", given)
    return RenderSession(workers=PassWorkers("nowhere", tmp_path))


def in_tiles(watch: RenderSession, folder: Path) -> None:
    change_in_tiles(
        Differential(samples=4), SCENE, CAMERA, np.ones((16, 24, 3), np.float32), seed=1, made_from="this",
        stages=Stages(folder), watch=watch, finish=lambda part: lambda change: change, first=None,
        progress=lambda share: None,
    )  # fmt: skip


@pytest.mark.parametrize(
    "render",
    [
        lambda watch, folder: Differential(samples=4).change(SCENE, CAMERA, watch=watch),
        lambda watch, folder: Mitsuba(samples=4).render(SCENE, CAMERA, watch=watch),
        in_tiles,
    ],
    ids=["change", "picture", "tiles"],
)
def test_workers_are_given_the_variant_of_the_process_that_gives_the_work(render, watch, tmp_path, monkeypatch):
    monkeypatch.setattr(render_tiles, "PILOT", 100)
    with pytest.raises(Given) as stopped:
        render(watch, tmp_path)
    (shared,) = stopped.value.args
    assert shared.renderer.variant == choose_variant().name


def shared_of(renderer: Any, folder: Path) -> list[Any]:
    return [
        PlainPasses(Mitsuba(samples=4, variant=renderer.variant), SCENE, CAMERA, 1),
        ChangeParts(renderer, SCENE, CAMERA, 4, False),
        SharedByTiles(renderer, SCENE, CAMERA, folder),
    ]


def test_a_worker_without_that_variant_is_refused_in_one_line_and_others_are_tried(tmp_path, monkeypatch):
    monkeypatch.setattr(mitsuba_variant, "_cuda_answers", lambda: False)
    for shared in shared_of(Differential(samples=4, variant="cuda_ad_rgb"), tmp_path):
        ready: Callable[[Any], Any] = lambda task: task.ready()  # noqa: E731
        outcome = attempt(ready, pickle.loads(pickle.dumps(shared)), Needs(program(), None))
        assert outcome.failed is not None and "\n" not in outcome.failed
        assert "cannot render by Mitsuba's cuda_ad_rgb as this machine does: no NVIDIA GPU answers" in outcome.failed
        assert outcome.unfit and outcome.again


def test_a_machine_with_a_gpu_renders_by_llvm_where_that_is_asked_of_it(monkeypatch):
    monkeypatch.setattr(mitsuba_variant, "_cuda_answers", lambda: True)
    monkeypatch.setattr(mitsuba_variant, "_unfailing", lambda: ["/usr/lib/libLLVM.so.19.1"])
    assert (choose_variant().name, choose_variant().library) == ("cuda_ad_rgb", None)
    assert (choose_llvm().name, choose_llvm().library) == ("llvm_ad_rgb", "/usr/lib/libLLVM.so.19.1")
    monkeypatch.setattr(mitsuba_variant, "_unfailing", lambda: ["/usr/lib/libLLVM-14.so.1"])
    with pytest.raises(ClusterUnusable, match="libLLVM 14 is too old"):
        PlainPasses(Mitsuba(samples=4, variant="llvm_ad_rgb"), SCENE, CAMERA, 1).ready()


def test_a_kept_render_is_of_the_variant_that_made_it():
    keys = [render_key("scene", CAMERA, Mitsuba(variant=each), 0) for each in (None, choose_variant().name, "other")]
    assert keys[0] == keys[1] != keys[2]
