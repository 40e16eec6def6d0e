"""The commands, run in this process: what they print, their exit codes, and one line for every fault."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relume.cli import COMMANDS, main
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.image.radiance import RadianceMap

ROOM = Path(__file__).parents[2] / "examples" / "room"
PLATE = [str(p) for p in sorted((ROOM / "plate").glob("*.jpg"))]


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int = 2) -> str:
    """Run a command that must fail with `code`; its one line on standard error."""
    assert main(arguments) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1 and captured.err.startswith("relume: "), captured.err
    assert "Traceback" not in captured.err
    return captured.err


def test_help_names_every_command_and_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in COMMANDS)
    assert not any(name in text for name in ("convert ", "studio", "stage "))


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    assert f"Usage: relume {name}" in capsys.readouterr().out


def test_merge_writes_radiance_variance_and_mask_and_info_tells_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, response = tmp_path / "plate.exr", tmp_path / "response.json"
    assert main(["merge", *PLATE, "-o", str(out), "--save-response", str(response), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told["exposures"].values()) == ["0.25 s", "1 s", "4 s", "16 s"]
    assert list(read_layers(out)) == ["radiance", "variance", "clipped"]
    assert main(["info", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == "radiance map"

    # A photograph developed through its own response at its own exposure is the photograph again.
    exposure = read_photograph(PLATE[2]).exposure
    assert exposure is not None
    picture = tmp_path / "again.png"
    words = ["develop", str(out), "-o", str(picture), "--response", str(response), "--seconds", str(exposure.factor)]
    assert main(words) == 0
    difference = read_photograph(picture).pixels.astype(int) - read_photograph(PLATE[2]).pixels
    assert np.median(np.abs(difference)) <= 1


def test_merge_takes_times_instead_of_exif_and_scales_by_them(tmp_path: Path) -> None:
    bare = []
    for index, path in enumerate(PLATE):
        bare.append(tmp_path / f"{index}.png")
        write(bare[-1], replace(read_photograph(path), exposure=None))
    words = ["merge", *map(str, bare), "-q", "-o"]
    assert main([*words, str(tmp_path / "a.exr"), "--times", "1/4,1,4,16"]) == 0
    assert main([*words, str(tmp_path / "b.exr"), "--times", "1/2 2 8 32"]) == 0
    ratio = read_radiance(tmp_path / "a.exr").radiance / read_radiance(tmp_path / "b.exr").radiance
    assert np.median(ratio) == pytest.approx(2, rel=1e-5)


def test_times_given_to_the_wrong_photographs_are_doubted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["merge", *PLATE, "-o", str(tmp_path / "a.exr"), "--times"]
    assert main([*words, "1/4,1,4,16"]) == 0
    assert "fits badly" not in capsys.readouterr().err
    assert main([*words, "4,1/4,16,1"]) == 0
    assert "fits badly" in capsys.readouterr().err


def test_probe_finds_the_ball_and_writes_a_map_that_remembers_its_mapping(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    balls = [sorted((ROOM / f).glob("*.jpg")) for f in ("ball_0", "ball_90")]
    words = ["probe", *map(str, balls[0]), "--second", *map(str, balls[1]), "--camera", "0,0.12,1"]
    words += ["--second-camera", "1,0.12,0", "--size", "64", "-o", str(tmp_path / "light.hdr"), "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert [b["radius"] for b in told["balls"]] == pytest.approx([296, 296], rel=0.006)
    assert read_radiance(tmp_path / "light.hdr").size == (128, 64)


def test_info_tells_a_photograph_and_the_system(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", PLATE[0]]) == 0
    assert "768, 512" in capsys.readouterr().out
    assert main(["info", "--system", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["variant"] in ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")


def test_dry_runs_write_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["merge", *PLATE, "-o", str(tmp_path / "a.exr"), "--dry-run"]) == 0
    assert main(["insert", str(ROOM / "shot.toml"), "-o", str(tmp_path / "out"), "--dry-run"]) == 0
    assert main(["probe", *PLATE, "-o", str(tmp_path / "l.exr"), "--dry-run"]) == 0
    assert list(tmp_path.iterdir()) == [] and "would write" in capsys.readouterr().out


def test_wrong_words_are_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "a.exr")
    assert "bogus" in refused(["bogus"], capsys)
    assert "--out" in refused(["merge", PLATE[0]], capsys)
    assert "none.jpg: no such file" in refused(["merge", "none.jpg", "-o", out], capsys)
    assert "1/x" in refused(["merge", *PLATE, "-o", out, "--times", "1/x"], capsys)
    assert "2 times were given for 4" in refused(["merge", *PLATE, "-o", out, "--times", "1,2"], capsys)
    assert ".exr or .hdr" in refused(["merge", *PLATE, "-o", str(tmp_path / "a.png")], capsys)
    assert "--camera" in refused(["probe", *PLATE, "-o", out, "--camera", "here"], capsys)
    assert "--system" in refused(["info"], capsys)
    assert list(tmp_path.iterdir()) == []


def test_bad_photographs_are_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "a.exr")
    photograph = read_photograph(PLATE[1])

    def made(name: str, pixels: np.ndarray, seconds: float | None) -> str:
        exposure = photograph.exposure
        assert exposure is not None
        changed = replace(exposure, seconds=seconds) if seconds else None
        write(tmp_path / name, replace(photograph, pixels=pixels, exposure=changed))
        return str(tmp_path / name)

    bare = made("bare.jpg", photograph.pixels, None)
    line = refused(["merge", bare, PLATE[2], "-o", out], capsys)
    assert "bare.jpg" in line and "--times" in line
    small = made("small.jpg", photograph.pixels[:100], 2.0)
    assert "small.jpg" in refused(["merge", small, PLATE[2], "-o", out], capsys)
    white = [made(f"w{t}.jpg", np.full_like(photograph.pixels, 255), t) for t in (1.0, 4.0)]
    refused(["merge", *white, "-o", out], capsys)
    response = tmp_path / "r.json"
    assert main(["merge", *PLATE, "-o", out, "--save-response", str(response), "-q"]) == 0
    assert "shorter" in refused(["merge", *white, "-o", out, "--response", str(response)], capsys)
    black = [made(f"b{t}.jpg", np.zeros_like(photograph.pixels), t) for t in (1.0, 4.0)]
    assert "longer" in refused(["merge", *black, "-o", out, "--response", str(response)], capsys)
    torn = tmp_path / "torn.jpg"
    torn.write_bytes(Path(PLATE[0]).read_bytes()[:20000])
    assert "torn.jpg" in refused(["merge", str(torn), PLATE[2], "-o", out], capsys)
    assert "no mirrored ball" in refused(["probe", *PLATE, "-o", out], capsys)


def test_a_bad_shot_is_refused_in_one_line_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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


def test_outputs_that_cannot_be_written_exit_with_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "grey.exr", RadianceMap(np.full((8, 8, 3), 0.18, np.float32)))
    (tmp_path / "file").write_text("")
    refused(["insert", str(ROOM / "shot.toml"), "-o", str(tmp_path / "file" / "out")], capsys, 3)
    refused(["develop", str(tmp_path / "grey.exr"), "-o", str(tmp_path / "nowhere" / "a.png")], capsys, 3)


def test_a_fault_of_ours_is_one_line_too(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    import relume.cli.info

    def broken(*_: object, **__: object) -> None:
        raise KeyError("something\nwith lines")

    monkeypatch.setattr(relume.cli.info, "tell", broken)
    assert "fault in relume" in refused(["info", PLATE[0]], capsys, 1)


def test_the_installed_command_runs_and_loads_nothing_heavy_for_help() -> None:
    program = (
        "import sys; from relume.cli import main; main(['--help']); "
        "print([m for m in ('numpy', 'scipy', 'mitsuba', 'cv2', 'pydantic', 'matplotlib') if m in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=os.environ, check=True)
    assert ran.stdout.rstrip().endswith("[]")
