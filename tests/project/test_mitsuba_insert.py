"""The job with the real renderer, small: what the objects leave alone stays the plate to the bit, however rendered."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from relume.cli import main
from relume.export.shot_files import SHOT_FORMATS
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.project.insertion import render_change, render_tiles
from relume.project.insertion.insert import insert
from relume.project.insertion.outcome import Inserted
from relume.project.shot_file.shot import Shot, read_shot
from relume.renderers.progressive.convergence import Sums
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap

OBJECT = Path(__file__).parents[2] / "examples/room/objects/cube_gold.glb"
SHOT = f"""
[plate]
photographs = "plate.exr"
[camera]
pose = {{ position = [0.2, 0.6, 1.0], look_at = [0.2, 0.0, 0.1] }}
focal_length = 80
[light]
map = "light.exr"
[match]
sharpness = false
[[local]]
shape = "plane"
size = [1.0, 1.0]
[[objects]]
mesh = "{OBJECT}"
[render]
samples = 64
preview = false
"""
MATCHED = {"grain": True, "sharpness": 0.6}


def small_shot_in(folder: Path, **render: float) -> Path:
    """A plate of random radiance, on which a table stands, under a light with a bright half."""
    generator = np.random.default_rng(3)
    write(folder / "plate.exr", RadianceMap(generator.uniform(0.2, 0.4, (48, 64, 3)).astype(np.float32)))
    light = np.ones((16, 32, 3), np.float32)
    light[:, 20:28] = 4
    write(folder / "light.exr", as_radiance_map(EnvironmentMap(light)))
    path = folder / "shot.toml"
    path.write_text(SHOT + "".join(f"{key} = {value}\n" for key, value in render.items()), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Shot, Path, Inserted]:
    """The shot, the folder that keeps its stages, and the outcome."""
    folder = tmp_path_factory.mktemp("small")
    shot = read_shot(small_shot_in(folder))
    return shot, folder / "out", insert(shot, folder / "out")


def changed(shot: Shot, table: str, **values: object) -> Shot:
    return shot.model_copy(update={table: getattr(shot, table).model_copy(update=values)})


@pytest.mark.parametrize("denoise", [False, True])
@pytest.mark.parametrize("noise", [None, 0.2])
@pytest.mark.parametrize("match", [{}, MATCHED], ids=["plain", "matched"])
def test_a_real_render_leaves_the_plate_to_the_bit_where_nothing_changed(
    made: tuple[Shot, Path, Inserted], tmp_path: Path, noise: float | None, denoise: bool, match: dict[str, object]
) -> None:
    shot, out, _ = made
    # The plain render is kept already; the others have their own.
    folder = out if not (denoise or noise) else tmp_path / "out"
    result = insert(changed(changed(shot, "render", noise=noise, denoise=denoise), "match", **match), folder)
    matte, difference = result.change.matte, result.change.difference
    untouched = (matte == 0) & np.all(difference == 0, axis=-1)
    # Beside the table nothing can change.
    assert untouched.mean() > 0.05 and (matte > 0.9).sum() > 20
    assert np.array_equal(result.composite[untouched], result.plate.radiance[untouched])
    assert np.abs(result.composite - result.plate.radiance)[matte > 0.9].mean() > 0.05
    # The cube's shadow.
    assert difference[matte == 0].min() < -0.02
    assert 2 <= result.change.passes and result.change.samples <= 64


def test_the_composite_is_what_the_layers_add_up_to(made: tuple[Shot, Path, Inserted]) -> None:
    _, _, result = made
    change, plate = result.change, result.plate.radiance.astype(np.float64)
    expected = (1 - change.matte[..., None]) * plate + change.difference + change.objects
    expected = np.maximum(expected, 0)
    assert np.all(np.abs(result.composite - expected) <= np.maximum(1e-6 * expected, 1e-7))


def test_what_an_occluder_covers_is_the_plate_to_the_bit(made: tuple[Shot, Path, Inserted], tmp_path: Path) -> None:
    shot, out, before = made
    painted = np.zeros((48, 64, 3), np.uint8)
    # Covering the left half of the cube, half transparent along its edge.
    middle = int(np.argwhere(before.change.matte > 0.9)[:, 1].mean())
    painted[:, :middle], painted[:, middle] = 255, 128
    write(tmp_path / "front.png", Photograph(painted))
    result = insert(changed(shot, "match", occluder=str(tmp_path / "front.png")), out)
    assert "render" in result.kept
    assert np.array_equal(result.composite[:, :middle], before.plate.radiance[:, :middle])
    assert np.array_equal(result.composite[:, middle + 1 :], before.composite[:, middle + 1 :])
    assert not result.change.matte[:, :middle].any() and (before.change.matte[:, :middle] > 0.9).any()
    half = before.change.matte[:, middle] * (1 - 128 / 255)
    assert result.change.matte[:, middle] == pytest.approx(half, rel=1e-5)


def test_by_ratio_the_plate_keeps_its_share_of_the_light(made: tuple[Shot, Path, Inserted], tmp_path: Path) -> None:
    shot, out, _ = made
    out = shutil.copytree(out, tmp_path / "out")  # another table is another render; the folder keeps one
    # Of one colour, the recovered table is not the patterned plate: the sum and the ratio differ.
    even = shot.model_copy(update={"local": [shot.local[0].model_copy(update={"reflectance": "recover even"})]})
    result = insert(changed(even, "match", mode="ratio"), out)
    without, change = result.composited.without.astype(np.float64), result.change
    shadow = (change.matte == 0) & (change.difference.max(-1) < -0.01)
    assert shadow.sum() > 20
    share = (without + change.difference) / without
    assert result.composite[shadow] == pytest.approx((share * result.plate.radiance)[shadow], rel=0.03)
    added = result.plate.radiance + change.difference
    assert np.abs(added - result.composite)[shadow].max() > 0.01


def test_an_object_out_of_the_picture_is_reported(made: tuple[Shot, Path, Inserted], tmp_path: Path) -> None:
    shot, _, _ = made
    moved = [shot.objects[0].model_copy(update={"translate": (0.0, 0.0, 50.0)})]
    table = shot.render.model_copy(update={"samples": 16})
    result = insert(shot.model_copy(update={"render": table, "objects": moved}), tmp_path / "out")
    assert any("no object is seen" in note for note in result.notes)
    assert any("behind the camera" in note for note in result.notes)


def test_a_place_without_surfaces_is_noted_and_keeps_the_plate_beside_the_objects(
    made: tuple[Shot, Path, Inserted], tmp_path: Path
) -> None:
    shot, _, _ = made
    result = insert(changed(shot.model_copy(update={"local": []}), "render", samples=16), tmp_path / "out")
    assert any("no local surface" in note for note in result.notes) and result.place.recovered is None
    beside = result.change.matte == 0
    assert np.array_equal(result.composite[beside], result.plate.radiance[beside])


@pytest.mark.parametrize("name", SHOT_FORMATS)
def test_a_shot_is_handed_over_whole_and_not_rendered(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    shot, out = small_shot_in(tmp_path), tmp_path / name
    # The plate is of chance, so it does not show the light that it is given; that is accepted.
    assert main(["insert", str(shot), "-o", str(out), "--to", name, "--json", "--accept"]) == 0
    reports = json.loads(capsys.readouterr().out)
    assert (
        Path(reports["written"]) == out / SHOT_FORMATS[name].main
        and (out / SHOT_FORMATS[name].main).stat().st_size > 100
    )
    assert not (out / "composite.exr").exists() and not (out / "stages" / "render.npz").exists()


INTERRUPTED = """
import os, signal, sys
from relume.cli import main
from relume.project.insertion.render_change import Previews
show = Previews.__call__
def shown(self, sums):
    show(self, sums)
    Previews.__call__ = show  # one Ctrl-C: a second one ends the process at once
    os.kill(os.getpid(), signal.SIGINT)
Previews.__call__ = shown
signal.signal(signal.SIGINT, signal.default_int_handler)  # as at a terminal, however this suite was started
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.skipif(os.name == "nt", reason="signals are POSIX's")
def test_a_render_that_was_interrupted_goes_on_to_the_same_bits(
    made: tuple[Shot, Path, Inserted], tmp_path: Path
) -> None:
    shot = small_shot_in(tmp_path)
    shot.write_text(shot.read_text().replace("preview = false\n", ""))
    out = tmp_path / "out"
    command = ["insert", str(shot), "-o", str(out), "--json", "--accept"]
    child = subprocess.run([sys.executable, "-c", INTERRUPTED, *command], capture_output=True, text=True, timeout=300)
    assert child.returncode == 130, child.stderr
    assert "interrupted" in child.stderr and "same command again" in child.stderr
    assert (out / "preview.exr").exists()
    assert (out / "stages" / "render.passes").exists() and not (out / "composite.exr").exists()
    assert main(command) == 0
    assert not (out / "stages" / "render.passes").exists() and not (out / "preview.exr").exists()
    # The same shot in one go, which shows no previews.
    change, result = made[2].change, made[2]
    assert change.passes > 1
    assert np.array_equal(read_radiance(out / "composite.exr").radiance, result.composite)
    layers = read_layers(out / "layers.exr")
    for name in ("objects", "difference", "matte", "depth", "normal", "albedo"):
        assert np.array_equal(layers[name], getattr(change, name)), name
    assert np.array_equal(layers["variance"], change.objects_variance + change.difference_variance)


def test_a_large_plate_is_rendered_in_tiles_and_leaves_none_behind(
    made: tuple[Shot, Path, Inserted], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shot, _, whole = made
    for name, value in {"VIEWED": 1000, "SIDE": 24, "BORDER": 4, "PILOT": 300}.items():
        monkeypatch.setattr(render_tiles, name, value)
    seen: set[tuple[int, ...]] = set()
    seen_by = render_change.Previews.__call__

    def look(self: render_change.Previews, sums: Sums) -> None:
        seen_by(self, sums)
        seen.add(read_photograph(self.folder / "preview.png").pixels.shape[:2])

    monkeypatch.setattr(render_change.Previews, "__call__", look)
    tiled = insert(changed(shot, "render", preview=True, denoise=True), tmp_path / "out")
    # The first picture is a small one; what is not covered or changed stays the plate to the bit.
    assert seen == {(15, 20)}
    same = (tiled.change.matte == 0) & np.all(tiled.change.difference == 0, axis=-1)
    assert same.any() and np.array_equal(tiled.composite[same], tiled.plate.radiance[same])
    assert np.abs(tiled.change.matte - whole.change.matte).mean() < 0.02
    assert tiled.change.objects.sum() == pytest.approx(whole.change.objects.sum(), rel=0.1)
    assert tiled.change.samples < whole.change.samples
    assert not [path.name for path in (tmp_path / "out/stages").iterdir() if "tile" in path.name]
