"""One picture by many workers: its parts come back in any order, and the bits are those of one process."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from cluster_tasks import Numbered, begun, by_hand
from command_line import refused
from relume.cli import main
from relume.errors import Incomplete
from relume.project.insertion import render_tiles
from relume.renderers.mitsuba import differential
from relume.renderers.mitsuba.differential import Differential, Lit, SomePixels
from relume.renderers.progressive.accumulation import NO_SESSION, RenderSession, accumulate, pass_seed
from relume.renderers.progressive.convergence import Sums, Target, standard_error
from relume.renderers.progressive.pass_workers import Parts, PassWorkers, WholePasses
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from small_shot import write_small_shot
from solids import sphere

pytest.importorskip("distributed", reason="Dask distributed is not installed: pip install 'relume[cluster]'")
PASSES, SEED = 11, 3
SEEDS = tuple(pass_seed(SEED, index) for index in range(PASSES))
LIGHT = EnvironmentMap(np.random.default_rng(1).random((16, 32, 3)).astype(np.float32) ** 40 + 0.1)
"""Dim, with a few small lamps."""
GLASS = sphere(Material(metallic=0.0, roughness=0.0, transmission=1.0), centre=(0, 0.5, 0), radius=0.5, fine=2)
SCENE = Scene(LIGHT, (Plane(Diffuse((0.6, 0.5, 0.4)), (4.0, 4.0)),), (GLASS,))
CAMERA = Camera.looking_at(np.array([0, 1.5, 5]), np.array([0, 0.5, 0]), width=48, height=32, focal_length=60)
TOML = """
[camera]
position = [0, 1, 4]
target = [0, 0.5, 0]
field_of_view = 40
size = [200, 150]
[light]
map = "light.exr"
[materials.paint]
kind = "diffuse"
reflectance = [0.5, 0.4, 0.3]
[[objects]]
sphere = { centre = [0, 0.5, 0], radius = 0.5 }
material = "paint"
"""


@contextmanager
def unheard() -> Iterator[None]:
    """Doubts of small pictures are not what these tests are about."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def summed(workers: PassWorkers | None, passes: Numbered, watch: RenderSession = NO_SESSION, **others) -> Sums:
    """The sum of passes of noise, here or by workers."""
    given = {"passes": PASSES, "seed": SEED, "key": {"scene": "noise"}, "watch": watch} | others
    if workers is None:
        return accumulate(passes.trace, **given)
    with workers.sharing(passes) as parts:
        return accumulate(WholePasses(parts, SEEDS), **given)


def same(one: Change, other: Change) -> None:
    for field in fields(Change):
        mine, yours = getattr(one, field.name), getattr(other, field.name)
        assert np.array_equal(mine, yours), field.name


def test_passes_that_come_back_in_another_order_are_added_in_their_own(two, tmp_path):
    numbered = Numbered(str(tmp_path), SEEDS)
    here, there = summed(None, numbered), summed(PassWorkers(two, tmp_path / "parts"), numbered)
    assert there.passes == PASSES
    for name, plane in here.planes().items():
        assert np.array_equal(plane, there.planes()[name]), name
    # Each pass was traced once by the workers, and each of them made the scene ready once.
    assert [len(begun(tmp_path, index)) for index in range(PASSES)] == [2] * PASSES
    assert len(begun(tmp_path, 10**6)) <= 2
    assert not list((tmp_path / "parts").iterdir())


def test_a_render_stops_at_the_pass_at_which_one_process_stops(two, tmp_path):
    numbered = Numbered(str(tmp_path), SEEDS)
    target = Target(0.2, standard_error, confirmations=1)
    here = summed(None, numbered, target=target)
    there = summed(PassWorkers(two, tmp_path / "parts"), numbered, target=target)
    assert there.passes == here.passes < PASSES
    assert np.array_equal(here.totals["radiance"], there.totals["radiance"])


def test_a_render_that_was_stopped_goes_on_by_workers(two, tmp_path):
    class Stopped(Exception):
        pass

    def stop(share: float) -> None:
        if share > 0.4:
            raise Stopped

    numbered = Numbered(str(tmp_path), SEEDS)
    workers, watch = PassWorkers(two, tmp_path / "parts"), RenderSession(tmp_path / "state")
    (tmp_path / "parts" / ".relume-parts-0123").mkdir(parents=True)
    with pytest.raises(Stopped):
        summed(workers, numbered, watch, progress=stop)
    before = [len(begun(tmp_path, index)) for index in range(5)]
    resumed = summed(workers, numbered, watch)
    # The five passes that were kept are not traced again.
    assert [len(begun(tmp_path, index)) for index in range(5)] == before
    assert np.array_equal(resumed.totals["radiance"], summed(None, numbered).totals["radiance"])
    # Nothing is left there, either by this process or by one that was killed.
    assert not list((tmp_path / "parts").iterdir())


def test_a_pass_that_fails_is_named_and_those_before_it_are_kept(two, tmp_path):
    numbered = Numbered(str(tmp_path), SEEDS, fails=SEEDS[6])
    workers, watch = PassWorkers(two, tmp_path / "parts"), RenderSession(tmp_path / "state")
    with pytest.raises(Incomplete, match=r"1 of 4 failed: pass 7 \(nothing is seen in this pass\)"):
        summed(workers, numbered, watch)
    assert not list((tmp_path / "parts").iterdir())
    summed(workers, Numbered(str(tmp_path), SEEDS), watch)
    assert len(begun(tmp_path, 3)) == 1 and len(begun(tmp_path, 6)) == 2


@pytest.mark.slow
def test_a_worker_that_is_killed_changes_no_bit(tmp_path):
    for name in ("cluster", "tasks"):
        (tmp_path / name).mkdir()
    numbered = Numbered(str(tmp_path / "tasks"), SEEDS, dies=True)
    with by_hand(tmp_path / "cluster", workers=2) as started:
        there = summed(PassWorkers(started.address, tmp_path / "parts"), numbered)
        assert [process.poll() for process in started.processes].count(-signal.SIGKILL) == 1
    assert [len(begun(tmp_path / "tasks", index)) for index in range(PASSES)] == [1, 2] + [1] * (PASSES - 2)
    here = summed(None, Numbered(str(tmp_path / "tasks"), SEEDS))
    assert np.array_equal(here.totals["radiance"], there.totals["radiance"])


@pytest.fixture
def neediest(monkeypatch: pytest.MonkeyPatch) -> Differential:
    """A renderer whose later passes go to some pixels even in a tiny picture."""
    monkeypatch.setattr(differential, "SPREAD_RAYS", 5600)
    monkeypatch.setattr(differential, "FEWEST_RAYS", 100)
    return Differential(samples=128)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[list[object]]:
    """What workers are asked for, round by round."""
    rounds: list[list[object]] = []
    traced = Parts.traced

    def noted(self: Parts, parts: Sequence[object], *rest: Any, **more: Any) -> list[Path]:
        rounds.append(list(parts))
        return traced(self, parts, *rest, **more)

    monkeypatch.setattr(Parts, "traced", noted)
    return rounds


def test_whole_passes_and_shares_of_the_neediest_pixels_have_the_bits_of_one_process(two, neediest, asked, tmp_path):
    workers = PassWorkers(two, tmp_path)
    here = neediest.change(SCENE, CAMERA, seed=5)
    there = neediest.change(SCENE, CAMERA, seed=5, watch=RenderSession(workers=workers))
    same(here, there)
    # Passes of all pixels, both at once; then two shares of a pass, and the light that the glass gathers.
    assert {type(part) for part in asked[0]} == {int} and len(asked[0]) == 2
    assert [type(part) for part in asked[-1]] == [SomePixels, SomePixels, Lit]
    # What the shares of a pass read, no other pass is given by that name.
    read = [{part.chosen for part in each if isinstance(part, SomePixels)} for each in asked]
    assert len(read[-1]) == 1 and sum(map(len, read)) == len(set.union(*read)) > 1
    # Once here and once by workers: glass gathers light, or the last of them would hold nothing.
    assert float(here.difference.max()) > 0


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 8])
def test_by_one_worker_and_by_eight_the_bits_are_the_same(count, neediest, tmp_path):
    workers = PassWorkers(f"local:{count}", tmp_path)
    same(
        neediest.change(SCENE, CAMERA, seed=5),
        neediest.change(SCENE, CAMERA, seed=5, watch=RenderSession(workers=workers)),
    )


def test_a_still_has_the_bits_of_one_process(two, tmp_path):
    shot = rl.read_shot(write_small_shot(tmp_path / "shot"))
    shares: list[float] = []
    with unheard():
        rl.insert(shot, tmp_path / "here")
        made = rl.insert(
            shot, tmp_path / "there", cluster=two,
            progress=lambda step, share: shares.append(share) if step == "render" else None,
        )  # fmt: skip
        again = rl.insert(shot, tmp_path / "there", cluster=two)
    for name in ("composite.exr", "composite.png", "layers.exr", "light.exr"):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes(), name
    assert "render" not in made.kept and "render" in again.kept
    assert shares == sorted(shares) and len(set(shares)) >= 5
    assert not list((tmp_path / "there").rglob(".relume*"))


@pytest.mark.slow
def test_the_parts_of_a_large_plate_have_the_bits_of_one_process(two, asked, tmp_path, monkeypatch):
    for name, value in {"VIEWED": 6144, "SIDE": 64, "BORDER": 8, "PILOT": 1000}.items():
        monkeypatch.setattr(render_tiles, name, value)
    shares: list[float] = []
    shot = rl.read_shot(write_small_shot(tmp_path / "shot"))
    with unheard():
        rl.insert(shot, tmp_path / "here")
        rl.insert(
            shot, tmp_path / "there", cluster=two,
            progress=lambda step, share: shares.append(share) if step == "render" else None,
        )  # fmt: skip
    assert [len(each) for each in asked] == [6]
    assert shares == sorted(shares) and len(set(shares)) >= 7 and shares[-1] == 1
    for name in ("composite.exr", "composite.png", "layers.exr"):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes(), name
    assert not list((tmp_path / "there").rglob("render_tile*"))


@pytest.mark.parametrize("renderer", ["whitted", "mitsuba"])
def test_one_picture_of_a_scene_has_the_bits_of_one_process(renderer, two, tmp_path):
    rl.write(tmp_path / "light.exr", rl.as_radiance_map(LIGHT))
    (tmp_path / "scene.toml").write_text(TOML)
    read = rl.read_scene(tmp_path / "scene.toml", size=None if renderer == "whitted" else (48, 32))
    region = (10, 5, 190, 145) if renderer == "whitted" else None
    samples = 16 if renderer == "mitsuba" else None
    settings = rl.RenderSettings(renderer=renderer, region=region, samples=samples)
    rl.render_scene(read, tmp_path / "here.exr", settings)
    shares: list[float] = []
    rl.render_scene(
        read, tmp_path / "there.exr", settings, cluster=two, report=lambda name, share: shares.append(share)
    )
    assert (tmp_path / "here.exr").read_bytes() == (tmp_path / "there.exr").read_bytes()
    assert shares == sorted(shares) and shares[-1] == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["here.exr", "light.exr", "scene.toml", "there.exr"]


def test_pictures_without_parts_are_refused(tmp_path, capsys):
    rl.write(tmp_path / "light.exr", rl.as_radiance_map(LIGHT))
    (tmp_path / "scene.toml").write_text(TOML)
    read = rl.read_scene(tmp_path / "scene.toml")
    with pytest.raises(ValueError, match="prefiltered maps has no parts"):
        rl.render_scene(read, tmp_path / "a.exr", rl.RenderSettings(renderer="prefiltered"), cluster="local:2")
    shot = rl.read_shot(write_small_shot(tmp_path / "shot"))
    with pytest.raises(ValueError, match="ConstantRenderer has none"):
        rl.insert(shot, tmp_path / "out", renderer=rl.renderers.ConstantRenderer(), cluster="local:2")
    with pytest.raises(ValueError, match="a quick look"):
        rl.insert(shot, tmp_path / "out", preview=True, cluster="local:2")
    words = [
        "render",
        tmp_path / "scene.toml",
        "-o",
        tmp_path / "a.exr",
        "--environment",
        "0,0,0",
        "--cluster",
        "local:2",
    ]
    assert "neither an environment map nor a tree" in refused(words, capsys)
    words = ["insert", tmp_path / "shot/shot.toml", "-o", tmp_path / "out", "--preview", "--cluster", "local:2"]
    assert "--cluster renders, and --preview does not" in refused(words, capsys)


@pytest.mark.slow
def test_the_command_makes_a_still_by_workers(tmp_path, capsys):
    path = write_small_shot(tmp_path / "shot")
    for out, words in {"here": [], "there": ["--cluster", "local:2"]}.items():
        assert main(["insert", str(path), "-o", str(tmp_path / out), "--accept", *words]) == 0
    err = capsys.readouterr().err
    assert "the scheduler is tcp://" in err and "render" in err
    assert (tmp_path / "here/composite.exr").read_bytes() == (tmp_path / "there/composite.exr").read_bytes()
