"""`relume reflect` and `relume stage relight` under maps that follow one another."""

from pathlib import Path

import numpy as np
import pytest

from command_line import printed, refused, reported
from relume.image.files import read_radiance, write
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from small_stages import write_stage


@pytest.fixture
def probe(tmp_path: Path) -> Path:
    """Maps 9 to 11, even light of 1, 3 and 2."""
    (tmp_path / "probe").mkdir()
    for number, value in ((9, 1.0), (10, 3.0), (11, 2.0)):
        light = EnvironmentMap(np.full((8, 16, 3), value, np.float32))
        write(tmp_path / "probe" / f"m{number}.exr", as_radiance_map(light))
    return tmp_path / "probe"


def diffuse(folder: Path) -> list[float]:
    """A pixel of the diffuse table of each picture, in shares of the first's."""
    folders = sorted(each for each in folder.iterdir() if each.name.startswith("frame_"))
    found = np.array([read_radiance(each / "diffuse.exr").radiance[3, 3, 0] for each in folders])
    return (found / found[0]).tolist()


def test_each_map_of_a_folder_has_its_reflection_maps(probe: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    words = ["reflect", probe, "-o", tmp_path / "out", "--rows", "8"]
    facts = reported(words, capsys)
    assert (facts["pictures"], facts["kept from before"]) == (3, 0)
    np.testing.assert_allclose(diffuse(tmp_path / "out"), [1, 3, 2], rtol=1e-4)
    # A map that changes makes its picture again, and no other.
    light = EnvironmentMap(np.full((8, 16, 3), 7, np.float32))
    write(probe / "m10.exr", as_radiance_map(light))
    assert reported(words, capsys)["kept from before"] == 2
    np.testing.assert_allclose(diffuse(tmp_path / "out"), [1, 7, 2], rtol=1e-4)


def test_slow_maps_are_interpolated_between(probe: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    words = ["reflect", probe, "--rows", "8", "--rate", "12", "-o", tmp_path / "out"]
    assert reported(words, capsys)["pictures"] == 5
    np.testing.assert_allclose(diffuse(tmp_path / "out"), [1, 2, 3, 2.5, 2], rtol=1e-4)
    held = ["reflect", probe, "--rows", "8", "--rate", "12", "--interpolation", "none", "-o", tmp_path / "held"]
    reported(held, capsys)
    np.testing.assert_allclose(diffuse(tmp_path / "held"), [1, 1, 3, 3, 2], rtol=1e-4)


def test_a_stage_is_relit_by_a_film_of_maps(probe: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    write_stage(tmp_path / "stage", 6)
    found = {}
    for name, more in (("each", []), ("slow", ["--rate", "12"])):
        words = ["stage", "relight", tmp_path / "stage", "--light", probe, "-o", tmp_path / name, *more]
        assert reported(words, capsys)["pictures"] == (3 if name == "each" else 5)
        pictures = sorted((tmp_path / name).glob("frame_*.exr"))
        found[name] = np.array([read_radiance(path).radiance.mean() for path in pictures])
    # By the number of the map, and not as names are sorted.
    np.testing.assert_allclose(found["each"] / found["each"][0], [1, 3, 2], rtol=1e-4)
    np.testing.assert_allclose(found["slow"] / found["slow"][0], [1, 2, 3, 2.5, 2], rtol=1e-4)


def test_what_is_warned_of_for_every_frame_is_one_note(probe: Path, capsys: pytest.CaptureFixture[str]):
    scene = probe.parent / "scene.toml"
    ball = 'sphere = { centre = [CENTRE, 0, 0], radius = 0.5 }\nmaterial = "chrome"\n'
    scene.write_text(
        "[camera]\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\nsize = [16, 12]\n"
        '[light]\nmaps = "probe/*.exr"\n[sequence]\nframes = "1-3"\n[materials.chrome]\nkind = "mirror"\n'
        + "".join(f"[[objects]]\n{ball.replace('CENTRE', str(x))}" for x in (-1, 1))
    )
    err = printed(["render", scene, "-o", probe.parent / "out", "--renderer", "prefiltered"], capsys).err
    assert err.count("show no shadows") == 1


def test_options_of_a_film_are_refused_for_one_map(probe: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    one = probe / "m9.exr"
    out = ["-o", tmp_path / "out"]
    assert "--rate is of maps that change" in refused(["reflect", one, "--rate", "3", *out], capsys)
    assert "--cluster is for the pictures" in refused(["reflect", one, "--cluster", "local", *out], capsys)
    assert "--sheet is of one map" in refused(["reflect", probe, *out, "--sheet"], capsys)
    (probe / "m10.exr").unlink()
    assert "the map of number 10 is missing" not in refused(["reflect", probe, "--rate", "-1", *out], capsys)
    write(probe / "m12.exr", as_radiance_map(EnvironmentMap(np.ones((8, 16, 3), np.float32))))
    assert "the map of number 10 is missing" in refused(["reflect", probe, *out], capsys)
    assert not (tmp_path / "out").exists()
