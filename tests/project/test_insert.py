"""The main job with the fake renderer: outputs, kept stages, one scale of plate and light, what adding nothing does."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidShot, NotABracket, OutputNotWritten, UnreadableFile
from relume.image import bands, mapped_arrays
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.project.insertion import render_change
from relume.project.insertion.insert import insert
from relume.project.insertion.outcome import Inserted
from relume.project.shot_file.shot import Object, read_shot
from relume.renderers.renderer import ConstantRenderer

Room = tuple[Inserted, Path]
FAKE = ConstantRenderer((3.0, 2.0, 1.0))


def test_the_job_writes_every_output_whole_and_no_temporary_file(room: Room) -> None:
    _, out = room
    names = sorted(p.name for p in out.iterdir())
    assert names == [
        "composite.exr",
        "composite.png",
        "layers.exr",
        "light.exr",
        "report.html",
        "response.json",
        "stages",
    ]
    assert sorted(p.name for p in (out / "stages").iterdir()) == [
        "denoised.npz", "light.npz", "match.npz", "plate.npz", "reflectance.npz", "render.npz", "response.npz",
    ]  # fmt: skip


def test_a_render_is_forgotten_only_once_it_is_kept(
    copied_room: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a preview that another program has open on Windows would cost all of it."""
    path, out = copied_room
    (out / "stages" / "render.npz").unlink(missing_ok=True)
    kept: list[bool] = []
    monkeypatch.setattr(render_change, "forget", lambda watch: kept.append((out / "stages" / "render.npz").is_file()))
    insert(read_shot(path), out, renderer=FAKE)
    assert kept == [True]


def test_pixels_that_no_object_covers_or_changes_are_the_plate_to_the_bit(room: Room) -> None:
    result, out = room
    composite = read_radiance(out / "composite.exr").radiance
    matte = result.change.matte
    untouched = matte == 0
    assert untouched.mean() > 0.8
    assert np.array_equal(composite[untouched], result.plate.radiance[untouched])
    # As sharp as the plate, the fake's square has a soft edge; within it is itself, at the edge it covers its share.
    assert 0.05 < (matte == 1).mean() < 0.12 and ((matte > 0) & (matte < 1)).any()
    assert np.allclose(composite[matte == 1], [3.0, 2.0, 1.0])
    blended = matte[..., None] * np.array([3.0, 2.0, 1.0]) + (1 - matte[..., None]) * result.plate.radiance
    assert np.allclose(composite, blended, rtol=1e-5)


def test_a_shot_without_objects_gives_the_plate_back_exactly(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    shot = read_shot(path).model_copy(update={"objects": []})
    result = insert(shot, out, renderer=FAKE)
    assert np.array_equal(result.composite, result.plate.radiance)
    assert np.array_equal(read_photograph(out / "composite.png").pixels, result.composited.before.pixels)


def test_the_developed_plate_looks_like_the_photograph_it_came_from(room: Room, half_room: Path) -> None:
    result, _ = room
    photographs = [read_photograph(p).pixels.astype(int) for p in sorted((half_room / "plate").glob("*.jpg"))]
    differences = [float(np.median(np.abs(p - result.composited.before.pixels))) for p in photographs]
    assert min(differences) <= 1


def test_layers_hold_what_the_design_names(room: Room) -> None:
    layers = read_layers(room[1] / "layers.exr")
    assert list(layers) == [
        "with", "without", "objects", "difference", "matte", "depth", "normal", "albedo", "variance", "reflectance",
    ]  # fmt: skip
    # The model with the objects is the one without them, changed as the plate is.
    kept = (1 - layers["matte"][..., None]) * layers["without"]
    assert np.allclose(layers["with"], kept + layers["difference"] + layers["objects"], rtol=1e-6)
    assert np.allclose(layers["without"], [3.0, 2.0, 1.0]) and not layers["difference"].any()
    assert np.allclose(layers["objects"], layers["matte"][..., None] * [3.0, 2.0, 1.0])


def test_a_second_run_redoes_nothing_and_writes_the_same_bytes(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    before = {n: (out / n).read_bytes() for n in ("composite.exr", "composite.png", "light.exr", "layers.exr")}
    result = insert(read_shot(path), out, renderer=FAKE)
    assert set(result.kept) == {"response", "plate", "denoised", "light", "reflectance", "render", "match"}
    assert all((out / n).read_bytes() == data for n, data in before.items())


def test_rows_at_a_time_and_with_its_planes_in_files_a_job_writes_the_same_bytes(
    copied_room: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, out = copied_room
    before = {n: (out / n).read_bytes() for n in ("composite.exr", "composite.png", "light.exr", "layers.exr")}
    monkeypatch.setattr(bands, "BAND", 50_000)
    monkeypatch.setattr(mapped_arrays, "LARGE", 100_000)
    for stage in ("denoised", "reflectance", "render"):
        (out / "stages" / f"{stage}.npz").unlink()
    result = insert(read_shot(path), out, renderer=FAKE)
    assert set(result.kept) == {"response", "plate", "light", "match"}
    assert (not mapped_arrays.MAPS) or isinstance(result.change.normal.base, np.memmap)
    assert all((out / n).read_bytes() == data for n, data in before.items())


def test_only_what_changed_is_redone(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    shot = read_shot(path)
    moved = shot.model_copy(update={"objects": [Object(mesh="objects/cube_gold.glb", translate=(0.0, 0.0, 0.1))]})
    assert set(insert(moved, out, renderer=FAKE).kept) == {
        "response",
        "plate",
        "denoised",
        "light",
        "reflectance",
        "match",
    }
    noisier = shot.model_copy(update={"plate": shot.plate.model_copy(update={"denoise": False})})
    assert set(insert(noisier, out, renderer=FAKE).kept) == {"response", "plate", "light"}


def test_a_damaged_kept_stage_is_made_again(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    kept = out / "stages" / "render.npz"
    kept.write_bytes(kept.read_bytes()[:1000])
    assert "render" not in insert(read_shot(path), out, renderer=FAKE).kept


def test_the_camera_and_light_of_the_room_are_where_they_were_measured(room: Room) -> None:
    result, _ = room
    # The window lies towards −X and the bulb up, to the right and behind the grid: both seen in the photographs.
    light = result.calibrated.probe.light
    window, bulb = light.lookup(np.array([[-0.95, 0.25, -0.1], [0.45, 0.7, -0.55]]))
    dark = light.lookup(np.array([0.0, 0.2, 1.0]))
    assert window.sum() > 5 * dark.sum()
    brightest = np.unravel_index(np.argmax(light.radiance.sum(-1)), light.radiance.shape[:2])
    assert light.radiance.shape == (128, 256, 3)
    x, y, z = light.mapping.directions(np.array([(brightest[1] + 0.5) / 256, (brightest[0] + 0.5) / 128]))
    assert x > 0.3 and y > 0.5 and z < -0.2 and bulb.sum() > 0
    assert result.camera.position == pytest.approx([0.25, 0.55, 1.15], abs=0.003)


def test_the_report_is_one_page_that_needs_nothing_else(room: Room) -> None:
    page = (room[1] / "report.html").read_text()
    sources = re.findall(r'src="([^"]*)"', page)
    # Two photographs, two planes of change, two of surfaces, three exposures of light, one curve.
    assert len(sources) == 10 and all(s.startswith("data:image/png;base64,") for s in sources)
    # Among megabytes of base64 any four letters come up by chance.
    words = re.sub(r"base64,[^\"]*", "", page)
    assert "http" not in words and "Energy audit" in page and "Virtual curve_a" in page


def test_a_photograph_that_is_missing_stops_the_job_before_anything_is_written(
    copied_room: tuple[Path, Path], tmp_path: Path
) -> None:
    path, _ = copied_room
    for photograph in (path.parent / "plate").glob("*.jpg"):
        photograph.unlink()
    with pytest.raises(UnreadableFile, match=r"plate/\*\.jpg: no such photographs"):
        insert(read_shot(path), tmp_path / "new", renderer=FAKE)
    assert not (tmp_path / "new").exists()


def test_an_output_folder_that_is_a_file_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputNotWritten, match="is not a folder"):
        insert(read_shot(Path(__file__).parents[2] / "examples/room/shot.toml"), tmp_path / "file" / "out")


def test_a_grid_of_another_size_than_the_plate_is_refused(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    shot = read_shot(path)
    grid = shot.camera.grid
    assert grid is not None
    other = grid.model_copy(update={"photograph": "ball_0/IMG_0001.jpg"})
    with pytest.raises(InvalidShot, match=r"320×320.*384×256"):
        insert(shot.model_copy(update={"camera": shot.camera.model_copy(update={"grid": other})}), out, renderer=FAKE)


def test_a_radiance_map_is_a_plate_and_a_map_is_light(room: Room, copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    shot = read_shot(path)
    plate = shot.plate.model_copy(update={"photographs": [str(room[1] / "composite.exr")], "denoise": False})
    light = type(shot.light)(map=str(room[1] / "light.exr"))
    result = insert(shot.model_copy(update={"plate": plate, "light": light, "objects": []}), out, renderer=FAKE)
    assert np.array_equal(result.composite, read_radiance(room[1] / "composite.exr").radiance)
    assert result.calibrated.cameras == {}
    with pytest.raises(InvalidShot, match=r"plate\.denoise"):
        noisy = plate.model_copy(update={"denoise": True})
        insert(shot.model_copy(update={"plate": noisy, "light": light}), out, renderer=FAKE)


def test_ball_photographs_without_exposure_ask_for_times(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    for photograph in sorted((path.parent / "ball_0").glob("*.jpg")):
        write(photograph, replace(read_photograph(photograph), exposure=None))
    with pytest.raises(NotABracket, match=r"IMG_0001\.jpg.*--times"):
        insert(read_shot(path), out, renderer=FAKE)


def test_times_for_the_plate_alone_are_refused_when_the_balls_say_an_aperture(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    shot = read_shot(path)
    timed = shot.plate.model_copy(update={"times": [0.25, 1.0, 4.0, 16.0]})
    with pytest.raises(NotABracket, match="f_number"):
        insert(shot.model_copy(update={"plate": timed}), out, renderer=FAKE)


def test_a_plate_in_candelas_is_not_mixed_with_relative_light(
    room: tuple[Inserted, Path], copied_room: tuple[Path, Path]
) -> None:
    path, out = copied_room
    shot = read_shot(path)
    write(out / "absolute.exr", replace(read_radiance(room[1] / "composite.exr"), unit="cd/m²"))
    plate = shot.plate.model_copy(update={"photographs": [str(out / "absolute.exr")], "denoise": False})
    # The light of the balls as it was measured: without the plate's photographs it would be measured anew.
    light = type(shot.light)(map=str(room[1] / "light.exr"))
    with pytest.raises(InvalidShot, match=r"cd/m².*relative"):
        insert(shot.model_copy(update={"plate": plate, "light": light}), out, renderer=FAKE)


def test_a_ball_camera_that_stood_elsewhere_is_reported(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    shot = read_shot(path)
    assert shot.light.balls is not None
    mirrored = shot.light.balls[1].model_copy(update={"camera": (-1.0, 0.17, 0.0)})
    light = shot.light.model_copy(update={"balls": [shot.light.balls[0], mirrored], "size": 64})
    result = insert(shot.model_copy(update={"light": light}), out, renderer=FAKE)
    assert any("check where its camera stood" in note for note in result.notes)


def test_the_picture_is_the_photograph_itself_where_nothing_changed(room: Room, half_room: Path) -> None:
    result, _ = room
    photographs = [read_photograph(path).pixels for path in sorted((half_room / "plate").glob("*.jpg"))]
    assert any((result.composited.before.pixels == photograph).all() for photograph in photographs)
    untouched = result.change.matte == 0
    assert (result.picture.pixels[untouched] == result.composited.before.pixels[untouched]).all()
