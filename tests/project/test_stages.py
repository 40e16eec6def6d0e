"""Kept results: a value comes back from its arrays as it was, and is redone where what made it changed."""

from __future__ import annotations

import gc
import threading
import warnings
import weakref
from dataclasses import dataclass, fields, is_dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relume.composite.surface.gloss import FittedGloss, Gloss, glossy
from relume.composite.surface.recovery import RecoveredLocal, RecoveredSurface
from relume.errors import warn
from relume.image import mapped_arrays
from relume.image.mapped_arrays import Mapped
from relume.image.photograph import Settings
from relume.probe.ball.blending import Probe
from relume.project.stages import Stages, Steps, packed, unpacked
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.environment_map import EnvironmentMap

GENERATOR = np.random.default_rng(1)
ALBEDO, WITHOUT, LIGHT = (GENERATOR.random((5, 7, 3)).astype(np.float32) for _ in range(3))
GLOSS = Gloss(0.0412, 0.173)
MESH = Mesh(
    GENERATOR.random((4, 3)).astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32), glossy(ALBEDO, GLOSS),
    None, GENERATOR.random((4, 2)).astype(np.float32),
)  # fmt: skip
LOCAL = RecoveredLocal(
    (
        RecoveredSurface(None, None, None, 0, None, None, (Plane(Diffuse((0.5, 0.4, 0.3))),)),
        RecoveredSurface(
            (0.1, 0.2, 1 / 3), (0.1, 0.2, 1.1), (0.01, 0.02, 0.03), 9, GLOSS,
            FittedGloss(GLOSS, 0.003, 0.02, 1234, 0.04, 2, ("a note",)), (MESH,),
        ),
    ),
    ALBEDO, WITHOUT, np.eye(5, 7, dtype=bool), LIGHT, 3, 0.0012, ("one", "two"),
)  # fmt: skip
PROBE = Probe(EnvironmentMap(np.ones((4, 8, 3), np.float32)), (0.0, 0.1), 0.2, 0.3, np.ones((4, 8), np.float32))


def same(one: Any, other: Any) -> bool:
    """Whether two values are of the same types and contents all through."""
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if is_dataclass(one) and not isinstance(one, type):
        return type(one) is type(other) and all(
            same(getattr(one, each.name), getattr(other, each.name)) for each in fields(one)
        )
    if isinstance(one, list | tuple):
        return type(one) is type(other) and len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(each, other[key]) for key, each in one.items())
    return type(one) is type(other) and one == other


@pytest.mark.parametrize(
    "value",
    [
        LOCAL,
        PROBE,
        None,
        "text",
        (1, 2.5, [True, None]),
        {"a": (1 / 3, np.eye(2))},
        (np.array(["é"]), float("inf")),
        Settings(datetime(2026, 11, 2, 10, 0, 3, 250_000), lens="50 mm"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_value_comes_back_to_the_bit(value: Any) -> None:
    assert same(value, unpacked(packed(value)))


def test_a_recovered_scene_is_kept_in_its_file_to_the_bit(tmp_path: Path) -> None:
    def again() -> RecoveredLocal:
        pytest.fail("made again")

    assert same(LOCAL, Steps(Stages(tmp_path)).keep("local", {"a": 1}, lambda: LOCAL))
    steps = Steps(Stages(tmp_path))
    back = steps.keep("local", {"a": 1}, again)
    assert steps.kept == ["local"] and back is not LOCAL and same(LOCAL, back)
    mesh = back.surfaces[1].shapes[0]
    assert isinstance(mesh, Mesh) and np.array_equal(mesh.vertices, MESH.vertices)
    assert same(mesh.material, glossy(ALBEDO, GLOSS))


def test_an_array_that_stands_twice_is_packed_once() -> None:
    arrays = packed(LOCAL)
    assert sum(array.shape == ALBEDO.shape for array in arrays.values()) == 3
    back = unpacked(arrays)
    assert back.surfaces[1].shapes[0].material.base_color is back.albedo


def test_arrays_are_given_up_at_once_when_they_were_kept() -> None:
    array = np.zeros(5)
    held = weakref.ref(array)
    gc.disable()
    try:
        kept = packed((1, {"a": array}))
        assert unpacked(kept)[1]["a"] is array
        del array, kept
        assert held() is None
    finally:
        gc.enable()


@dataclass(frozen=True)
class Foreign:
    value: int = 1


def test_values_that_are_not_ours_are_refused() -> None:
    with pytest.raises(TypeError, match="object"):
        packed(object())
    with pytest.raises(ValueError, match="no class of relume"):
        unpacked(packed(Foreign()))


def test_a_result_is_kept_with_its_warnings_until_what_made_it_changes(tmp_path: Path) -> None:
    def make() -> np.ndarray:
        warnings.warn("doubtful", stacklevel=2)
        return np.arange(3)

    for settings, kept in (({"a": 1}, []), ({"a": 1}, ["step"]), ({"a": 2}, [])):
        steps = Steps(Stages(tmp_path))
        with pytest.warns(UserWarning, match="doubtful"):
            assert steps.keep("step", settings, make).tolist() == [0, 1, 2]
        assert steps.kept == kept
    # A damaged file is made again.
    (tmp_path / "step.npz").write_bytes((tmp_path / "step.npz").read_bytes()[:100])
    with pytest.warns(UserWarning, match="doubtful"):
        Steps(Stages(tmp_path)).keep("step", {"a": 2}, make)


def test_a_step_that_was_begun_goes_on_beside_others_and_keeps_its_warnings_for_its_turn(tmp_path: Path) -> None:
    other, threads = threading.Event(), []

    def make() -> np.ndarray:
        threads.append(threading.current_thread())
        assert other.wait(10)  # for a step that is made meanwhile
        warn("doubtful", 0.1)
        return np.arange(3)

    steps = Steps(Stages(tmp_path))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        steps.begin("step", {"a": 1}, make)
        steps.keep("other", {}, lambda: [other.set()])
    with pytest.warns(UserWarning, match="doubtful"):
        assert steps.keep("step", {"a": 1}, make).tolist() == [0, 1, 2]
    assert len(threads) == 1 and threads[0] is not threading.main_thread() and list(steps.seconds) == ["other", "step"]
    # What is kept is not begun.
    again = Steps(Stages(tmp_path))
    again.begin("step", {"a": 1}, make)
    with pytest.warns(UserWarning, match="doubtful"):
        assert again.keep("step", {"a": 1}, make).tolist() == [0, 1, 2]
    assert len(threads) == 1 and again.kept == ["step"]


def test_what_a_step_that_was_begun_raises_comes_at_its_turn(tmp_path: Path) -> None:
    steps = Steps(Stages(tmp_path))
    steps.begin("step", {}, lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        steps.keep("step", {}, lambda: 1.0)
    assert steps.keep("step", {}, lambda: 1.0) == 1.0


def test_what_was_read_for_the_key_goes_from_memory_before_the_step_works(tmp_path, monkeypatch) -> None:
    done: list[str] = []
    monkeypatch.setattr(Mapped, "release", lambda self: done.append("release"))
    assert Stages(tmp_path).get("step", {"a": 1}, lambda: len(done)) == (1, False)


def test_a_large_array_is_put_away_where_nothing_was_kept_yet(tmp_path, monkeypatch) -> None:
    """All steps of a frame may be those of others, in whose folders they are found."""
    monkeypatch.setattr(mapped_arrays, "LARGE", 100)
    stages = Stages(tmp_path / "frame" / "stages")
    small, large = np.zeros(3), np.arange(200.0)
    assert stages.put_away(small) is small and not stages.folder.exists()
    assert stages.put_away(large).tolist() == large.tolist() and stages.folder.is_dir()
