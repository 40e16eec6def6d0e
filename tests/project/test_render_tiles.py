"""A large plate in tiles: the picture that one render would make, finished part by part."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from relume.errors import DoubtWarning, OutputNotWritten, warn
from relume.project.insertion import render_tiles
from relume.project.insertion.render_tiles import change_in_tiles, forget_tiles, is_large
from relume.project.stages import Stages
from relume.renderers.mitsuba.denoise import denoised
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.progressive.accumulation import RenderSession
from relume.renderers.progressive.convergence import Sums
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

LIGHT = EnvironmentMap(1 + np.random.default_rng(1).random((8, 16, 3)).astype(np.float32))
BALL = sphere(Diffuse((0.2, 0.5, 0.8)), centre=(0.0, 0.5, 0.0), radius=0.5, fine=3)
SCENE = Scene(LIGHT, (Plane(Diffuse((0.6, 0.5, 0.4)), (4.0, 4.0)),), (BALL,))
CAMERA = Camera.looking_at(np.array([0, 1.5, 5]), np.array([0, 0.5, 0]), width=90, height=60, focal_length=120)
PLATE = np.full((60, 90, 3), 0.6, np.float32)
RENDERER = Differential(samples=64)


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tiles of 30 pixels, for a picture four times as large as is looked at."""
    for name, value in {"VIEWED": 1350, "SIDE": 32, "BORDER": 4, "PILOT": 400}.items():
        monkeypatch.setattr(render_tiles, name, value)


def in_tiles(folder: Path, renderer: Differential = RENDERER, **others) -> Change:
    settings = {
        "seed": 1, "made_from": "this", "stages": Stages(folder), "watch": RenderSession(folder / "render.passes"),
        "finish": lambda part: lambda change: change, "first": None, "progress": lambda share: None,
    }  # fmt: skip
    return change_in_tiles(renderer, SCENE, CAMERA, PLATE, **(settings | others))


def cleaned(part: tuple[slice, slice]) -> Callable[[Change], Change]:
    return lambda change: denoised(change, PLATE[part])


@pytest.fixture(scope="module")
def whole() -> Change:
    return RENDERER.change(SCENE, CAMERA, seed=7)


def test_a_picture_in_tiles_is_the_picture_in_one(tmp_path, whole):
    assert is_large(CAMERA)
    shown: list[Sums] = []
    change = in_tiles(tmp_path, first=shown.append)
    # The small render comes first, of the same aspect, and after its first pass.
    assert {each.mean("matte").shape for each in shown} == {(16, 24)} and shown[0].passes == 1 < shown[-1].passes
    # Edges lie where they lie in one picture; the rest agrees to its noise.
    assert np.abs(change.matte - whole.matte).mean() < 0.02
    inside = whole.matte == 1
    assert np.allclose(change.depth[inside], whole.depth[inside], atol=0.02)
    for plane in ("objects", "difference"):
        one, other = (getattr(each, plane) for each in (change, whole))
        variance = sum(getattr(each, f"{plane}_variance").sum(dtype=np.float64) for each in (change, whole))
        assert abs(one.sum(dtype=np.float64) - other.sum(dtype=np.float64)) < 5 * np.sqrt(variance)
        assert np.abs(one - other).mean() < 0.25 * np.abs(other).mean()
    # A quarter of the rays: those of the picture that is looked at.
    assert 8 <= change.samples <= 24


def test_tiles_get_rays_by_their_noise(tmp_path):
    rays: list[tuple[tuple[int, int], int]] = []
    in_tiles(tmp_path, finish=lambda part: lambda change: rays.append((change.matte.shape, change.samples)) or change)
    assert len(rays) == 6
    counts = [samples for _, samples in rays]
    # Most for the tile in the middle below the ball's middle, fewest where hardly anything changes.
    assert max(counts) > 2 * min(counts) and min(counts) >= 2


def test_tiles_are_the_same_on_any_threads_and_after_an_interruption(tmp_path):
    class Stopped(Exception):
        pass

    def cancel(share: float) -> None:
        if share >= 0.6:
            raise Stopped

    straight = in_tiles(tmp_path / "one", Differential(samples=32, threads=1), finish=cleaned)
    with pytest.raises(Stopped):
        in_tiles(tmp_path / "two", Differential(samples=32, threads=2), finish=cleaned, progress=cancel)
    assert list((tmp_path / "two").glob("render_tile_*.npz"))
    made: list[Change] = []
    resumed = in_tiles(
        tmp_path / "two",
        Differential(samples=32, threads=2),
        finish=lambda part: lambda change: made.append(change) or cleaned(part)(change),
    )
    # Tiles that were put away are not rendered again.
    assert 0 < len(made) < 6
    for plane in ("objects", "difference", "matte", "depth"):
        assert np.array_equal(getattr(straight, plane), getattr(resumed, plane)), plane
    forget_tiles(Stages(tmp_path / "two"))
    assert not list((tmp_path / "two").iterdir())


def test_a_noise_that_tiles_do_not_reach_is_said_once(tmp_path):
    with pytest.warns(UserWarning, match="not reached in [1-6] of 6 parts") as said:
        in_tiles(tmp_path, Differential(samples=16, noise=1e-4))
    assert len(said) == 1


def test_what_tiles_warned_of_is_said_again_by_a_render_that_goes_on(tmp_path):
    def finish(part: tuple[slice, slice]) -> Callable[[Change], Change]:
        def doubting(change: Change) -> Change:
            warn("the light is doubtful", 0.3)
            return change

        return doubting

    for _ in range(2):
        with pytest.warns(DoubtWarning, match="the light is doubtful") as said:
            in_tiles(tmp_path, Differential(samples=16), finish=finish)
        assert [getattr(each.message, "effect", None) for each in said] == [0.3]


def test_a_disk_without_room_is_said_before_anything_is_traced(tmp_path, monkeypatch):
    monkeypatch.setattr(render_tiles, "disk_usage", lambda folder: SimpleNamespace(free=2 * 80 * 60 * 90 - 1))
    with pytest.raises(OutputNotWritten, match=r"0.0 GB are needed .* make room"):
        in_tiles(tmp_path)
    assert not list(tmp_path.glob("render_tile*"))


def test_a_window_sees_what_the_picture_shows_there():
    window = CAMERA.window(30, 20, 25, 15)
    assert (window.width, window.height) == (25, 15)
    assert window.rays() == pytest.approx(CAMERA.rays()[20:35, 30:55], abs=1e-12)


def test_what_another_render_left_of_a_part_costs_that_part_alone(tmp_path):
    class Stopped(Exception):
        pass

    def stop(share: float) -> None:
        if share > 0.55:
            raise Stopped

    with pytest.raises(Stopped):
        in_tiles(tmp_path, Differential(samples=64), progress=stop)
    (left,) = tmp_path.glob("render.tile_*")
    made: list[Change] = []
    with pytest.warns(UserWarning, match="cannot resume the saved render: .*that part of the picture starts over"):
        in_tiles(tmp_path, Differential(samples=32), finish=lambda part: lambda change: made.append(change) or change)
    assert len(made) == 6 and not left.exists()
