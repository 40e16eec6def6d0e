"""Many files on a cluster, each made from its own: converted, probed, developed; the bits are those of one process."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from command_line import printed, refused, reported
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.virtual_camera.lens.glare.eye import EyeGlare
from synthetic import lobes, photograph_ball

pytest.importorskip("distributed", reason="Dask distributed is not installed: pip install 'relume[cluster]'")


def bits(folder: Path) -> dict[str, bytes]:
    """Every file of results by its name."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}


@pytest.fixture(scope="module")
def maps(tmp_path_factory) -> Path:
    """Four light maps in a folder and one inside it; the second ends early."""
    folder = tmp_path_factory.mktemp("maps")
    (folder / "inside").mkdir()
    for index, name in enumerate(("a", "b", "c", "inside/d")):
        light = np.random.default_rng(index).random((8, 16, 3)).astype(np.float32)
        files.write(folder / f"{name}.hdr", rl.as_radiance_map(rl.EnvironmentMap(light)))
    torn = folder / "b.hdr"
    torn.write_bytes(torn.read_bytes()[:200])
    (folder / "readme.txt").write_text("no picture")
    return folder


@pytest.fixture(scope="module")
def frames(tmp_path_factory) -> list[Path]:
    """Six frames that become brighter; the third is black and the fifth no picture."""
    folder = tmp_path_factory.mktemp("frames")
    rows = np.linspace(0.1, 1.0, 24, dtype=np.float32)[:, None, None] * np.ones((1, 32, 3), np.float32)
    paths = [folder / f"f{index}.exr" for index in range(6)]
    for index, path in enumerate(paths):
        files.write(path, RadianceMap(np.roll(rows, index, axis=0) * np.float32(0 if index == 2 else 2.0**index)))
    paths[4].write_bytes(b"no picture")
    return paths


# Converting


@pytest.mark.parametrize(
    ("conversion", "ending", "written"),
    [
        (rl.light.FormatChange(), ".pfm", {"a.pfm", "c.pfm", "d.pfm"}),
        (
            rl.light.MapConversion(faces=True, mapping=rl.mappings.mapping_named("strip"), size=8), ".exr",
            {f"{name}_{face}.exr" for name in "acd" for face in ("px", "nx", "py", "ny", "pz", "nz")},
        ),
        (rl.light.ViewOutOfMap(rl.light.CameraView((0.1, 0, 0)), (6, 4)), ".exr", {"a.exr", "c.exr", "d.exr"}),
    ],
    ids=["format", "faces", "view"],
)  # fmt: skip
def test_converted_files_have_the_same_bits_and_a_bad_one_is_named(maps, two, tmp_path, conversion, ending, written):
    made = {}
    for name, cluster in (("here", None), ("there", two)):
        with pytest.raises(rl.errors.Incomplete) as raised:
            rl.light.convert_each([maps], tmp_path / name, conversion, ending=ending, cluster=cluster)
        assert [failed for failed, _ in raised.value.failed] == ["b.hdr"]
        made[name] = bits(tmp_path / name)
    assert made["here"].keys() == written
    assert made["here"] == made["there"]


def test_what_was_converted_is_kept_and_what_is_missing_is_made(maps, two, tmp_path, capsys):
    good = tmp_path / "in"
    shutil.copytree(maps, good)
    (good / "b.hdr").unlink()
    words = ["convert", good, "-o", good / "out", "--each"]
    assert reported(words, capsys)["kept from before"] == 0
    (good / "out" / "c.exr").unlink()
    made = rl.light.convert_each([good], good / "out", cluster=two)
    assert [(each.target.name, each.kept) for each in made] == [("a.exr", True), ("c.exr", False), ("d.exr", True)]
    assert made[0].facts["kept"] == {"exact": True}
    # A file that changed, and another setting, are other work.
    files.write(good / "a.hdr", RadianceMap(np.ones((8, 16, 3), np.float32)))
    assert [each.kept for each in rl.light.convert_each([good], good / "out")] == [False, True, True]
    brighter = rl.light.convert_each([good], good / "out", rl.light.FormatChange(stops=1))
    assert not any(each.kept for each in brighter)
    assert rl.read_radiance(good / "out" / "a.exr").radiance.max() == 2.0


def test_the_command_converts_each_and_ends_with_4_where_one_failed(maps, tmp_path, capsys):
    err = printed(["convert", maps, "-o", tmp_path / "out", "--each", "--to", "angular"], capsys, 4).err
    assert "relume: 1 of 4 failed: b.hdr (" in err and "the others are done" in err
    assert rl.read_environment(tmp_path / "out" / "a.exr").mapping.name == "angular"
    out = printed(["convert", maps, "-o", tmp_path / "none", "--each", "--dry-run"], capsys).out
    assert out.count(".exr") == 4 and not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["a.hdr", "-o", "map.exr", "--each"], "with --each it is a folder"),
        (["a.hdr", "-o", "map.exr", "--cluster", "local"], "--cluster is for many files"),
        (["a.hdr", "-o", "map.exr", "--ending", ".hdr"], "--ending is for many files"),
        (["a.hdr", "-o", "out", "--each", "--ending", ".gif"], "ending .gif: not a format for this"),
        (["a.hdr", "-o", "out", "--each", "--put", "c.hdr"], "--put is for one map"),
        (["-o", "out", "--each", "--labelled"], "--labelled is one map"),
        (["a.hdr", "-o", ".", "--each", "--ending", ".hdr"], "a.hdr: the input itself"),
        (["nowhere", "-o", "out", "--each"], "nowhere: no such file or folder"),
        (["a.hdr", "copy/a.hdr", "-o", "out", "--each"], "would both be written as a.exr"),
    ],
)
def test_what_cannot_be_done_to_many_files_is_refused_before_any_work(
    words, reason, maps, tmp_path, capsys, monkeypatch
):
    shutil.copytree(maps, tmp_path / "in")
    shutil.copytree(maps, tmp_path / "in" / "copy")
    monkeypatch.chdir(tmp_path / "in")
    assert reason in refused(["convert", *words], capsys)
    assert not (tmp_path / "in" / "out").exists()


# Probing


def photographed(folder: Path, camera: tuple[float, float, float] = (0.0, 0.17, 1.0)) -> None:
    """A radiance map of a ball of 5 cm in a folder, 60 pixels wide."""
    folder.mkdir(parents=True)
    picture = photograph_ball(lobes, np.array(camera), width=60, height=60, focal_length=540.0)
    files.write(folder / "map.exr", picture)


PLACES: dict[str, Any] = {"camera": (0.0, 0.17, 1.0), "settings": rl.probe.ProbeSettings(size=16, radius=0.05)}


def test_every_place_gets_its_map_and_a_bad_one_is_named(two, tmp_path, capsys):
    photographed(tmp_path / "in" / "a")
    (tmp_path / "in" / "torn").mkdir()
    (tmp_path / "in" / "torn" / "map.exr").write_bytes((tmp_path / "in/a/map.exr").read_bytes()[:900])
    assert [place.name for place in rl.probe.find_places([tmp_path / "in"])] == ["a", "torn"]
    for name, cluster in (("here", None), ("there", two)):
        with pytest.raises(rl.errors.Incomplete) as raised, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rl.probe.probe_each([tmp_path / "in"], tmp_path / name, **PLACES, cluster=cluster)
        ((place, why),) = raised.value.failed
        assert place == "torn" and "damaged EXR" in why
    assert bits(tmp_path / "here") == bits(tmp_path / "there")
    assert bits(tmp_path / "here").keys() == {"a.exr"}
    # A second run makes nothing anew, and says again what is doubtful.
    shutil.rmtree(tmp_path / "in" / "torn")
    words = ["probe", tmp_path / "in", "-o", tmp_path / "here", "--each", "--camera", "0,0.17,1", "--radius", "0.05"]
    said = printed([*words, "--size", "16", "--accept", "-v"], capsys)
    assert "kept from before  1" in said.out and "relume: note: a: 0." in said.err


@pytest.mark.slow
def test_a_place_with_a_folder_for_each_view_becomes_one_map(tmp_path):
    photographed(tmp_path / "in" / "hall" / "front")
    photographed(tmp_path / "in" / "hall" / "side", (1.0, 0.17, 0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        (made,) = rl.probe.probe_each([tmp_path / "in"], tmp_path / "out", **PLACES, turns=(0.0, np.pi / 2))
    assert made.target.name == "hall.exr" and len(made.facts["balls"]) == 2
    assert made.facts["camera places given"]


def test_a_place_with_a_bracket_and_folders_is_refused_by_name(tmp_path, capsys):
    (tmp_path / "in" / "hall" / "views").mkdir(parents=True)
    files.write(tmp_path / "in" / "hall" / "loose.exr", RadianceMap(np.ones((8, 8, 3), np.float32)))
    line = printed(["probe", tmp_path / "in", "-o", tmp_path / "out", "--each"], capsys, 4).err
    assert "holds loose.exr and the folder views" in line
    assert "--pick is of one ball" in refused(["probe", tmp_path, "-o", "out", "--each", "--pick", "auto"], capsys)
    words = ["probe", tmp_path / "in", "-o", tmp_path / "a.exr", "--cluster", "local"]
    assert "--cluster is for many balls" in refused(words, capsys)


# Developing


@pytest.mark.parametrize("glare", [False, True], ids=["no lens", "glare"])
def test_frames_adapt_on_a_cluster_as_in_one_process(frames, two, tmp_path, glare):
    camera = rl.VirtualCamera(glare=EyeGlare() if glare else None, tone=rl.tone.HistogramAdjustment())
    settings = rl.DevelopSettings(rl.CameraPreset(camera=camera), luminance=50.0, settling=0.1)
    for name, cluster in (("here", None), ("there", two)):
        with pytest.raises(rl.errors.Incomplete) as raised:
            rl.develop_sequence(frames, tmp_path / name, settings, cluster=cluster)
        assert [failed for failed, _ in raised.value.failed] == ["f4.exr"]
    here, there = bits(tmp_path / "here"), bits(tmp_path / "there")
    assert here == there and here.keys() == {f"f{index}.png" for index in (0, 1, 2, 3, 5)}
    # They are the frames that one call in memory makes of the same pictures.
    readable = [path for index, path in enumerate(frames) if index != 4][:4]
    views = [settings.view(rl.read_radiance(frames[0]), camera)] * 4
    pictures = camera.tone_map_frames(map(rl.read_radiance, readable), views, settling=0.1)
    for path, picture in zip(readable, pictures, strict=True):
        written = rl.read_photograph(tmp_path / "here" / f"{path.stem}.png").pixels
        np.testing.assert_array_equal(written, picture.photograph().pixels)
    # Alone the frames after the first would come out otherwise.
    alone = camera.tone_map(rl.read_radiance(frames[3]), views[0]).photograph().pixels
    assert (alone != rl.read_photograph(tmp_path / "here" / "f3.png").pixels).any()


def test_only_frames_whose_adaptation_changed_are_developed_again(frames, two, tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    good = [Path(shutil.copy2(path, folder)) for path in frames]
    shutil.copy(frames[3], good[4])
    out, settings = tmp_path / "out", rl.DevelopSettings(settling=0.1)
    assert rl.develop_sequence(good, out, settings)["kept from before"] == 0
    before = bits(out)
    assert rl.develop_sequence(good, out, settings)["kept from before"] == 6
    (out / "f1.png").unlink()
    assert rl.develop_sequence(good, out, settings, cluster=two)["kept from before"] == 5
    assert bits(out) == before
    # The fourth becomes darker: those before it stay, those after it adapt to it.
    files.write(good[3], RadianceMap(rl.read_radiance(good[3]).radiance / 16))
    assert rl.develop_sequence(good, out, settings, cluster=two)["kept from before"] == 3
    anew = bits(out)
    assert [name for name in before if before[name] == anew[name]] == ["f0.png", "f1.png", "f2.png"]
    rl.develop_sequence(good, tmp_path / "again", settings)
    assert bits(tmp_path / "again") == anew


def test_a_movie_by_workers_is_the_one_of_one_process(frames, two, tmp_path):
    good = [path for index, path in enumerate(frames) if index != 4]
    here = rl.develop_sequence(good, tmp_path / "here.mp4")
    there = rl.develop_sequence(good, tmp_path / "there.mp4", cluster=two)
    assert (tmp_path / "here.mp4").read_bytes() == (tmp_path / "there.mp4").read_bytes()
    assert here["white in the worst frame"] == there["white in the worst frame"]
    assert not list(tmp_path.glob(".there*"))


def test_pictures_that_are_no_frames_are_developed_each_by_itself(frames, two, tmp_path, capsys):
    words = ["develop", frames[0].parent, "-o", tmp_path / "out", "--each"]
    err = printed(words, capsys, 4).err
    assert "2 of 6 failed" in err and "f2.exr is black everywhere" in err and "f4.exr" in err
    with pytest.raises(rl.errors.Incomplete):
        rl.develop_sequence([frames[0].parent], tmp_path / "there", each=True, cluster=two)
    assert bits(tmp_path / "out") == bits(tmp_path / "there")
    rl.develop_file(frames[5], tmp_path / "alone.png")
    assert (tmp_path / "out" / "f5.png").read_bytes() == (tmp_path / "alone.png").read_bytes()
    assert "--cluster is for many pictures" in refused(
        ["develop", frames[0], "-o", tmp_path / "a.png", "--cluster", "local"], capsys
    )
