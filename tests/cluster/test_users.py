"""What runs on a cluster writes the bits of one process: brackets of a folder, frames of a shot, frames of a scene."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import relume as rl
from command_line import printed, refused
from relume.capture.brackets.folder_of_brackets import find_brackets
from relume.cli import main
from relume.cluster import held
from small_brackets import write_brackets
from small_shot import write_small_shot
from toml_files import FAR_CAMERA

pytest.importorskip("distributed", reason="Dask distributed is not installed: pip install 'relume[cluster]'")
SCENE = (
    FAR_CAMERA
    + """\
[light]
map = "light.exr"
[materials.chrome]
kind = "mirror"
[[objects]]
sphere = { centre = [1, 0, 0], radius = 1 }
material = "chrome"
"""
)
SEQUENCE = """
[[objects.keyframes]]
frame = 1
translate = [0, 0, 0]
[[objects.keyframes]]
frame = 3
translate = [0.1, 0, 0]

[match]"""


@pytest.fixture(scope="module")
def brackets(tmp_path_factory) -> tuple[Path, Path]:
    """A folder of seven brackets, the fourth damaged, and the profile of their camera."""
    folder = tmp_path_factory.mktemp("brackets")
    write_brackets(folder / "in", 7, bad=4)
    profile = folder / "camera.json"
    with unheard():
        rl.capture.merge_shoot(
            rl.capture.plan_merge([folder / "in/room_0001"], folder / "one.exr", save_profile=profile)
        )
    return folder / "in", profile


@contextmanager
def unheard() -> Iterator[None]:
    """Doubts of small pictures are not what these tests are about."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def bits(folder: Path, pattern: str) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.glob(pattern))}


def test_a_bad_bracket_is_named_and_all_others_are_written(brackets, two, tmp_path, capsys):
    folder, profile = brackets
    command = ["merge", folder, "--each", "--profile", profile, "-o"]
    err = printed([*command, tmp_path / "here"], capsys, 4).err
    assert "relume: 1 of 7 failed: room_0004-frame_0-frame_2 (" in err and "damaged PNG, byte 700" in err
    with unheard(), pytest.raises(rl.errors.Incomplete) as raised:
        rl.capture.merge_each([folder], tmp_path / "there", profile=profile, cluster=two)
    assert [name for name, _ in raised.value.failed] == ["room_0004-frame_0-frame_2"]
    here, there = bits(tmp_path / "here", "*.exr"), bits(tmp_path / "there", "*.exr")
    assert here.keys() == there.keys() == {f"room_{n:04d}-frame_0-frame_2.exr" for n in (1, 2, 3, 5, 6, 7)}
    assert here == there
    # Of what is there nothing is done again; once the bad one is mended it alone is.
    copy = tmp_path / "mended"
    shutil.copytree(folder, copy)
    for path in copy.rglob("*.png"):
        shutil.copystat(folder / path.relative_to(copy), path)
    damaged = copy / "room_0004" / "frame_1.png"
    shutil.copy(copy / "room_0003" / "frame_1.png", damaged)
    out = tmp_path / "out"
    with unheard():
        made = rl.capture.merge_each([copy], out, profile=profile)
    assert [each.kept for each in made] == [False] * 7
    (out / "room_0002-frame_0-frame_2.exr").unlink()
    with unheard():
        again = rl.capture.merge_each([copy], out, profile=profile, cluster=two)
    assert [each.kept for each in again] == [n != 2 for n in range(1, 8)]
    # Other settings are another job.
    with unheard():
        other = rl.capture.merge_each([copy], out, profile=profile, settings=rl.capture.MergeSettings(deghost=False))
    assert not any(each.kept for each in other)


def test_a_photograph_that_is_none_takes_its_bracket_down_and_no_other(tmp_path):
    for folder in write_brackets(tmp_path / "apart", 2):
        for path in folder.iterdir():
            shutil.copy(path, tmp_path / f"{folder.name}_{path.name}")
    shutil.rmtree(tmp_path / "apart")
    assert len(find_brackets([tmp_path], tmp_path / "out").groups) == 2
    torn = tmp_path / "room_0001_frame_1.png"
    torn.write_bytes(torn.read_bytes()[:20])
    found = find_brackets([tmp_path], tmp_path / "out")
    assert [group[0].name for group in found.groups] == ["room_0002_frame_0.png"]
    ((name, why),) = found.failed
    assert name == "room_0001_frame_0-room_0001_frame_2" and "room_0001_frame_1.png" in why


def test_a_folder_in_use_is_refused_by_name(brackets, tmp_path, capsys):
    folder, profile = brackets
    with held(tmp_path):
        line = refused(["merge", folder, "--each", "--profile", profile, "-o", tmp_path], capsys, 3)
    assert "in use by process" in line


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--cluster", "local:2"], "--cluster is for many brackets"),
        (["--each", "--times", "1,2,3"], "--times is of one shoot"),
        (["--each", "-o", "map.exr"], "with --each it is a folder"),
    ],
)
def test_options_of_one_shoot_and_of_many_are_not_mixed(words, reason, brackets, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = [] if "-o" in words else ["-o", "out"]
    assert reason in refused(["merge", brackets[0], *words, *out], capsys)


def test_the_brackets_are_listed_by_a_dry_run(brackets, tmp_path, capsys):
    out = printed(["merge", brackets[0], "--each", "-o", tmp_path / "out", "--dry-run"], capsys).out
    assert "would write" in out and out.count("frame_2.exr") == 7
    assert not (tmp_path / "out").exists()


def test_frames_of_a_scene_have_the_same_bits(tmp_path, two, capsys):
    light = np.linspace(0, 1, 16 * 32 * 3, dtype=np.float32).reshape(16, 32, 3)
    rl.write(tmp_path / "light.exr", rl.as_radiance_map(rl.EnvironmentMap(light)))
    (tmp_path / "scene.toml").write_text(SCENE)
    assert main(["render", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "here"), "--frames", "5"]) == 0
    read, settings = rl.read_scene(tmp_path / "scene.toml"), rl.RenderSettings(frames=5)
    for name in ("there", "there.mp4", "there"):
        rl.render_scene(read, tmp_path / name, settings, cluster=two)
    rl.render_scene(read, tmp_path / "here.mp4", settings)
    assert bits(tmp_path / "here", "*.png") == bits(tmp_path / "there", "*.png")
    assert len(bits(tmp_path / "here", "*.png")) == 5
    assert (tmp_path / "here.mp4").read_bytes() == (tmp_path / "there.mp4").read_bytes()
    assert not list(tmp_path.glob(".there*"))


@pytest.mark.slow
def test_frames_of_a_shot_have_the_same_bits(tmp_path, two):
    path = write_small_shot(tmp_path / "shot")
    path.write_text(path.read_text().replace("[match]", SEQUENCE.lstrip("\n")) + '\n[sequence]\nframes = "1-3"\n')
    shot = rl.read_shot(path)
    with unheard():
        here = rl.insert_frames(shot, tmp_path / "here")
        there = rl.insert_frames(shot, tmp_path / "there", cluster=two)
        again = rl.insert_frames(shot, tmp_path / "there", cluster=two)
    for name in ("composite.exr", "composite.png", "layers.exr", "light.exr"):
        pictures = bits(tmp_path / "here", f"frame_*/{name}")
        assert len(pictures) == 3
        assert pictures == bits(tmp_path / "there", f"frame_*/{name}")
    assert [frame.number for frame in there.frames] == [1, 2, 3]
    assert [frame.kept for frame in there.frames] == [False] * 3
    assert [frame.kept for frame in again.frames] == [True] * 3
    assert here.notes == there.notes
