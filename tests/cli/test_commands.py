"""The commands, run in this process: what they print, their exit codes, and one line for every fault."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from command_line import printed, refused, reported
from relume.cli import COMMANDS, main
from relume.image.files import read_radiance, write
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap

ROOM = Path(__file__).parents[2] / "examples" / "room"
PLATE = [str(p) for p in sorted((ROOM / "plate").glob("*.jpg"))]


def test_help_names_every_command_and_no_other(capsys):
    text = printed(["--help"], capsys).out
    listed = re.findall(r"^│ ([a-z]+) {2,}\S", text, re.MULTILINE)
    assert sorted(listed) == sorted(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name, capsys):
    text = printed([name, "--help"], capsys).out
    assert f"Usage: relume {name}" in text
    assert "--empty-" not in text  # of cyclopts itself, for lists that nobody empties


@pytest.mark.parametrize(
    ("command", "options"),
    {
        "probe": ("--camera X,Y,Z", "--turn", "--reflectance", "--pick", "--times"),
        "render": ("--size", "--region", "--tree", "--environment"),
        "lights": ("--at", "--box", "--second-at"),
        "merge": ("--times", "--ignore", "--spot"),
        "info": ("--float-size",),
        "edit": ("--crop", "--add"),
        "reflect": ("phong:N", "--brdf", "--cube", "--mirror", "--sheet", "--normalisation"),
    }.items(),
)
def test_help_shows_options_and_the_forms_of_their_words(command, options, capsys):
    text = printed([command, "--help"], capsys).out
    assert [option for option in options if option not in text] == []


@pytest.mark.slow  # a lone view's map, and two views: test_probe.py; these balls: tests/probe/test_outline.py
def test_probe_finds_the_ball_and_writes_a_map_that_remembers_its_mapping(tmp_path, capsys):
    balls = [sorted((ROOM / f).glob("IMG_000[357].jpg")) for f in ("ball_0", "ball_90")]
    words = ["probe", *map(str, balls[0]), "--second", *map(str, balls[1]), "--camera", "0,0.12,1"]
    words += ["--second-camera", "1,0.12,0", "--size", "64", "-o", str(tmp_path / "light.hdr")]
    assert [b["radius"] for b in reported(words, capsys)["balls"]] == pytest.approx([296, 296], rel=0.006)
    assert read_radiance(tmp_path / "light.hdr").size == (128, 64)


def test_info_says_a_photograph_a_map_and_the_system(tmp_path, capsys):
    assert "768 × 512" in printed(["info", PLATE[0]], capsys).out
    write(tmp_path / "grey.exr", RadianceMap(np.full((8, 8, 3), 0.18, np.float32)))
    assert reported(["info", str(tmp_path / "grey.exr")], capsys)["kind"] == "radiance map"


def test_info_says_of_this_machine_what_a_report_of_a_fault_needs(capsys):
    said = reported(["info", "--system"], capsys)
    assert said["variant"] in ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")
    assert f"numpy {np.__version__}" in said["libraries"] and "missing" not in said["libraries"]
    assert said["python"].startswith(platform.python_version()) and said["system"] == platform.platform()
    assert "video" in said["extras"] and "dev" not in said["extras"]


def test_dry_runs_write_nothing(tmp_path, capsys):
    # That of `insert` is looked at in test_insert.py.
    assert main(["probe", PLATE[2], "-o", str(tmp_path / "l.exr"), "--dry-run"]) == 0
    assert list(tmp_path.iterdir()) == [] and "would write" in capsys.readouterr().out


def test_wrong_words_are_refused_in_one_line(tmp_path, capsys):
    out = str(tmp_path / "a.exr")
    assert "bogus" in refused(["bogus"], capsys)
    assert "--camera" in refused(["probe", *PLATE, "-o", out, "--camera", "here"], capsys)
    assert "no mirrored ball" in refused(["probe", PLATE[2], "-o", out], capsys)
    assert "--system" in refused(["info"], capsys)
    assert list(tmp_path.iterdir()) == []


def test_a_bad_shot_is_refused_in_one_line_and_leaves_nothing(tmp_path, capsys):
    shutil.copytree(ROOM, tmp_path / "room")
    shot, out = tmp_path / "room" / "shot.toml", tmp_path / "out"
    good = shot.read_text()

    def with_shot(old: str, new: str) -> str:
        assert old in good
        shot.write_text(good.replace(old, new, 1))
        line = refused(["insert", str(shot), "-o", str(out)], capsys)
        assert not out.exists()
        return line

    assert "did you mean samples" in with_shot("samples =", "sample =")
    assert "no such mesh" in with_shot("suzanne_plastic.glb", "nobody.glb")
    (tmp_path / "room/objects/empty.obj").write_text("# nothing\n")
    assert "empty.obj" in with_shot("suzanne_plastic.glb", "empty.obj")
    assert "no such photographs" in with_shot("ball_0/*.jpg", "ball_7/*.jpg")


def test_outputs_that_cannot_be_written_exit_with_3(tmp_path, capsys):
    write(tmp_path / "grey.exr", RadianceMap(np.full((8, 8, 3), 0.18, np.float32)))
    (tmp_path / "file").write_text("")
    refused(["insert", str(ROOM / "shot.toml"), "-o", str(tmp_path / "file" / "out")], capsys, 3)
    refused(["develop", str(tmp_path / "grey.exr"), "-o", str(tmp_path / "nowhere" / "a.png")], capsys, 3)


def test_a_fault_of_ours_is_one_line_too(monkeypatch, capsys):
    import relume.cli.info

    def broken(*_: object, **__: object) -> None:
        raise KeyError("something\nwith lines")

    monkeypatch.setattr(relume.cli.info, "print_facts", broken)
    assert "fault in relume" in refused(["info", PLATE[0]], capsys, 1)
    assert "Traceback" in printed(["info", PLATE[0], "-v"], capsys, 1).err


def test_a_command_that_is_interrupted_says_so_and_that_it_goes_on(monkeypatch, capsys):
    import relume.cli.info

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(relume.cli.info, "print_facts", interrupted)
    assert "give the same command again" in refused(["info", PLATE[0]], capsys, 130)


def test_bad_input_has_no_traceback_with_verbose_but_a_value_error_may_be_a_fault(monkeypatch, capsys):
    import relume.cli.info

    refused(["info", "absent.exr", "-v"], capsys)
    monkeypatch.setattr(relume.cli.info, "print_facts", lambda *_, **__: np.zeros(2) + np.zeros(3))
    assert "could not be broadcast" in refused(["info", PLATE[0]], capsys)
    assert "Traceback" in printed(["info", PLATE[0], "-v"], capsys, 2).err


def test_the_installed_command_runs_and_loads_nothing_heavy_for_help():
    program = (
        "import sys; from relume.cli import main; main(['--help']); "
        "print([m for m in ('numpy', 'scipy', 'mitsuba', 'cv2', 'pydantic', 'matplotlib') if m in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=os.environ, check=True)
    assert ran.stdout.rstrip().endswith("[]")


def test_a_damaged_picture_that_openimageio_had_open_is_refused_in_one_line(tmp_path):
    whole = tmp_path / "damaged.tif"
    write(whole, Photograph(np.random.default_rng(0).integers(0, 255, (64, 64, 3)).astype(np.uint8)))
    data = bytearray(whole.read_bytes())
    data[200:2000] = bytes(1800)
    whole.write_bytes(data)
    # As the installed command: what is left of an opened picture is complained of at the process's own end.
    program = "import sys; from relume.cli import main; sys.exit(main())"
    ran = subprocess.run([sys.executable, "-c", program, "info", str(whole)], capture_output=True, text=True)
    assert (ran.returncode, ran.stdout, ran.stderr.count("\n")) == (2, "", 1), ran.stderr
    assert "damaged TIFF, its pixels" in ran.stderr


@pytest.mark.parametrize("letters", ["ascii", "cp1252"])
def test_a_pipe_of_few_letters_gets_escapes_and_no_fault(letters: str) -> None:
    program = "import sys; from relume.cli import main; sys.exit(main(['convert', '--help']))"
    made = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, env={**os.environ, "PYTHONIOENCODING": letters}
    )
    assert (made.returncode, made.stderr) == (0, b"")
    assert rb"\u2212" in made.stdout and b"Convert pictures between formats" in made.stdout
