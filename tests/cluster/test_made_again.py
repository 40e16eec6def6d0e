"""What was made of files is made again where what it was made from changed, and is read no oftener than needed."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from command_line import refused, reported
from relume.cluster.file_tasks import FileTask
from relume.cluster.tasks import run_tasks
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.project.developing import frames as frames_module
from relume.virtual_camera.lens.glare.eye import EyeGlare
from small_brackets import write_brackets


@pytest.fixture(params=["merge", "probe"])
def remade(request, tmp_path, monkeypatch) -> Callable[[], list[bool]]:
    """Make everything of a folder of two brackets, each listed; whether each was kept from before."""
    write_brackets(tmp_path / "in", 2)

    def unwrapped(task: FileTask) -> dict[str, Any]:
        task.targets[0].write_bytes(b"a map")
        return {}

    # Which photographs show a ball is of no account here.
    monkeypatch.setattr(importlib.import_module("relume.probe.probe_each"), "_probed", unwrapped)
    each: Any = rl.capture.merge_each if request.param == "merge" else rl.probe.probe_each

    def make() -> list[bool]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return [made.kept for made in each([tmp_path / "in"], tmp_path / "out")]

    return make


def test_a_corrected_list_of_exposures_makes_anew_what_it_is_beside(remade, tmp_path):
    listed = tmp_path / "in" / "room_0001" / "exposures.csv"
    assert remade() == [False, False]
    assert remade() == [True, True]
    listed.write_text("frame_0.png 1/256\nframe_1.png 1/32\nframe_2.png 1/4\n")
    assert remade() == [False, True]
    before = _seen(tmp_path)
    listed.write_text("frame_0.png 1/128\nframe_1.png 1/16\nframe_2.png 1/2\n")
    assert remade() == [False, True]
    after = _seen(tmp_path)
    if before and after:
        np.testing.assert_allclose(before / after, 2.0, rtol=1e-3)
    assert remade() == [True, True]
    listed.unlink()
    assert remade() == [False, True]


def _seen(folder: Path) -> float | None:
    """The mean radiance of the map of the first bracket; None where it is no map."""
    path = folder / "out" / "room_0001-frame_0-frame_2.exr"
    return float(rl.read_radiance(path).radiance.mean()) if path.exists() else None


def brightening(folder: Path, count: int = 4, black: tuple[int, ...] = ()) -> list[Path]:
    """Frames that become brighter, some of them black."""
    folder.mkdir()
    rows = np.linspace(0.1, 1.0, 24, dtype=np.float32)[:, None, None] * np.ones((1, 32, 3), np.float32)
    paths = [folder / f"f{index}.exr" for index in range(count)]
    for index, path in enumerate(paths):
        files.write(path, RadianceMap(rows * np.float32(0 if index in black else 2.0**index)))
    return paths


@pytest.fixture
def reads(monkeypatch) -> list[Path]:
    """Which frames are read by the steps that workers do; these are done in this process."""
    read: list[Path] = []
    reading = frames_module.read_scene_light

    def noted(path: Path, *rest: Any, **more: Any) -> RadianceMap:
        read.append(path)
        return reading(path, *rest, **more)

    def here(
        function: Any, tasks: Any, *, cluster: Any = None, memory: Any = None, paths: Any = (), **more: Any
    ) -> Any:
        return run_tasks(function, tasks, **more)

    monkeypatch.setattr(frames_module, "read_scene_light", noted)
    monkeypatch.setattr(frames_module, "connect", nullcontext)
    monkeypatch.setattr(frames_module, "run_tasks", here)
    return read


# slow: [no lens] goes red for the same break; glare by workers is in
# tests/cluster/test_files.py::test_frames_adapt_on_a_cluster_as_in_one_process[glare].
@pytest.mark.parametrize(
    "glare", [pytest.param(False, id="no lens"), pytest.param(True, id="glare", marks=pytest.mark.slow)]
)
def test_a_second_run_by_workers_reads_no_frame_that_is_there(glare, reads, tmp_path):
    paths = brightening(tmp_path / "in")
    camera = rl.VirtualCamera(glare=EyeGlare() if glare else None, tone=rl.tone.HistogramAdjustment())
    settings = rl.DevelopSettings(rl.CameraPreset(camera=camera), luminance=50.0, settling=0.1)
    rl.develop_sequence(paths, tmp_path / "out", settings, cluster="workers")
    assert set(reads) == set(paths)
    reads.clear()
    again = rl.develop_sequence(paths, tmp_path / "out", settings, cluster="workers")
    assert again["kept from before"] == 4 and reads == []
    # Of a frame that changed the measurement is taken, and what adapts to it is developed.
    files.write(paths[2], RadianceMap(rl.read_radiance(paths[2]).radiance / 16))
    assert rl.develop_sequence(paths, tmp_path / "out", settings, cluster="workers")["kept from before"] == 2
    assert paths[2] in reads and paths[0] not in reads and paths[1] not in reads


@pytest.mark.parametrize("cluster", [None, "workers"])
def test_a_sequence_that_begins_black_or_with_no_picture_is_developed(cluster, reads, tmp_path):
    paths = brightening(tmp_path / "in", 5, black=(0, 1))
    settings = rl.DevelopSettings(settling=0.1)
    facts = rl.develop_sequence(paths, tmp_path / "fade", settings, cluster=cluster)
    assert facts["frames"] == 5
    assert not rl.read_photograph(tmp_path / "fade" / "f1.png").pixels.any()
    # From the first light on it is the sequence that begins there.
    rl.develop_sequence(paths[2:], tmp_path / "lit", settings)
    fade, lit = (rl.read_photograph(tmp_path / name / "f2.png").pixels for name in ("fade", "lit"))
    np.testing.assert_array_equal(fade, lit)
    paths[0].write_bytes(b"no picture")
    with pytest.raises(rl.errors.Incomplete) as raised:
        rl.develop_sequence(paths, tmp_path / "torn", settings, cluster=cluster)
    assert [name for name, _ in raised.value.failed] == ["f0.exr"]
    assert (tmp_path / "torn" / "f4.png").exists()


def test_a_sequence_without_any_light_is_refused_by_its_first_frame(tmp_path, capsys):
    paths = brightening(tmp_path / "in", 2, black=(0, 1))
    assert "f0.exr is black everywhere" in refused(["develop", *paths, "-o", tmp_path / "out.mp4"], capsys)


@pytest.mark.parametrize("command", ["develop", "convert"])
def test_outputs_among_the_inputs_are_refused_at_once(command, tmp_path, capsys, monkeypatch):
    brightening(tmp_path / "in", 2)
    monkeypatch.chdir(tmp_path)
    for given in ("in", tmp_path / "in"):
        line = refused([command, given, "-o", "in/", "--each"], capsys)
        assert "both the folder of the inputs and that of the outputs" in line and "choose another -o" in line
    assert sorted(path.name for path in (tmp_path / "in").iterdir()) == ["f0.exr", "f1.exr"]


def test_what_would_be_developed_is_listed(tmp_path, capsys):
    paths = brightening(tmp_path / "in", 3)
    for given in ([tmp_path / "in", "--each"], paths):
        facts = reported(["develop", *given, "-o", tmp_path / "out/", "--dry-run"], capsys)
        assert [Path(each).name for each in facts["files"]] == ["f0.png", "f1.png", "f2.png"]
    assert not (tmp_path / "out").exists()


def test_views_that_would_count_as_places_are_warned_of(tmp_path):
    for name in ("hall/front", "hall/side", "yard"):
        (tmp_path / name).mkdir(parents=True)
        files.write(tmp_path / name / "map.exr", RadianceMap(np.ones((8, 8, 3), np.float32)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [place.name for place in rl.probe.find_places([tmp_path])] == ["hall", "yard"]
    with pytest.warns(UserWarning, match=r"hall: front, side in it count as a place each.* give the folder above"):
        found = rl.probe.find_places([tmp_path / "hall", tmp_path / "yard"])
    assert [place.name for place in found] == ["front", "side", "yard"]
