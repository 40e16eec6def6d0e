"""`relume develop`: pictures, sequences and the way back, and what is refused."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from command_line import refused
from relume.cli import main
from relume.cli.develop_planes import read_depth, read_motion
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap


def window(path: Path, brightness: float = 40.0, unit: str = "relative") -> Path:
    """A dim room with a bright window."""
    radiance = np.full((32, 48, 3), 0.2, np.float32)
    radiance[8:16, 20:28] = brightness
    files.write(path, RadianceMap(radiance, unit=unit))
    return path


def told(capsys: pytest.CaptureFixture[str]) -> dict:
    return json.loads(capsys.readouterr().out)


def test_a_picture_with_everything_beside_it(tmp_path, capsys):
    room = window(tmp_path / "room.exr")
    words = [
        "--tone",
        "reinhard",
        "--set",
        "tone.key=0.36",
        "--sheet",
        str(tmp_path / "sheet.png"),
        "--stops",
        "-2,0,2",
    ]
    words += ["--false-colour", str(tmp_path / "false.png"), "--report", str(tmp_path / "report.html"), "--json"]
    assert main(["develop", str(room), "-o", str(tmp_path / "out.png"), *words]) == 0
    facts = told(capsys)
    assert facts["tone"] == "Reinhard" and facts["white"] == 0
    picture = files.read_photograph(tmp_path / "out.png").pixels
    assert picture.shape == (32, 48, 3) and picture[10, 22].min() > picture[0, 0].max() > 0
    assert {p.name for p in tmp_path.iterdir()} == {"room.exr", "out.png", "sheet.png", "false.png", "report.html"}
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("<img") >= 6 and "http" not in page.replace("http-equiv", "")


def test_absolute_exposure_by_shutter_aperture_and_iso(tmp_path, capsys):
    room = window(tmp_path / "room.exr", unit="cd/m²")
    # ISO 12232: 78 · 4² / (0.65 · 100 · 0.5) = 38.4 cd/m² saturate.
    words = ["--shutter", "1/2", "--aperture", "4", "--iso", "100", "--json"]
    assert main(["develop", str(room), "-o", str(tmp_path / "a.png"), *words]) == 0
    assert told(capsys)["white"] == pytest.approx(64 / (32 * 48))
    pixels = files.read_photograph(tmp_path / "a.png").pixels
    assert pixels[0, 0, 0] == round(255 * (1.055 * (0.2 / 38.4) ** (1 / 2.4) - 0.055)) == 16
    assert main(["develop", str(room), "-o", str(tmp_path / "b.png"), *words, "--exposure", "-1"]) == 0
    assert told(capsys)["white"] == 0


def test_the_way_back(tmp_path, capsys):
    room = window(tmp_path / "room.exr", brightness=0.9)
    look = ["--tone", "exposure", "--set", "tone.kind='fixed'", "--vignetting", "--field-of-view", "60"]
    assert main(["develop", str(room), "-o", str(tmp_path / "a.png"), *look]) == 0
    back = ["develop", str(tmp_path / "a.png"), "-o", str(tmp_path / "back.exr"), "--undo", "--vignetting"]
    assert main([*back, "--field-of-view", "60", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert facts["undone"] == ["CosineFourth"] and facts["response"] == "sRGB"
    before, after = (files.read_radiance(tmp_path / name).radiance for name in ("room.exr", "back.exr"))
    assert np.abs(after / before - 1).max() < 0.012  # half a step of sRGB at 0.2 · cos⁴ of the corner's 35°


def test_a_sequence_is_steadied_and_keeps_its_names(tmp_path, capsys):
    for index, level in enumerate([1.0, 2.0, 1.0]):
        files.write(tmp_path / f"f{index}.exr", RadianceMap(np.full((8, 8, 3), level, np.float32)))
    frames = [str(tmp_path / f"f{index}.exr") for index in range(3)]
    grey = ["--tone", "exposure", "--set", "tone.grey=0.18"]
    assert main(["develop", *frames, "-o", str(tmp_path / "out"), *grey, "-q"]) == 0
    greys = [int(files.read_photograph(tmp_path / "out" / f"f{index}.png").pixels[0, 0, 0]) for index in range(3)]
    assert greys[1] > greys[0] and abs(greys[2] - greys[0]) <= 4
    assert main(["develop", *frames, "-o", str(tmp_path / "alone"), "--settling", "0", *grey, "-q"]) == 0
    alone = [int(files.read_photograph(tmp_path / "alone" / f"f{index}.png").pixels[0, 0, 0]) for index in range(3)]
    assert alone[0] == alone[1] == alone[2]


def test_presets_can_be_told_and_used(tmp_path, capsys):
    assert main(["develop", "--list-presets", "--json"]) == 0
    assert "night" in told(capsys)
    room = window(tmp_path / "room.exr")
    assert main(["develop", str(room), "-o", str(tmp_path / "a.png"), "--preset", "slide", "--dry-run", "--json"]) == 0
    assert told(capsys)["tone"] == "Darkroom" and not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tone", "reinhard", "--film", "slide"], "--tone and --film"),
        (["--focus", "2"], "--focus needs --aperture"),
        (["--iso", "100"], "--iso is the sensitivity of --shutter"),
        (["--move", "a"], r'--move: "a"; write 2 numbers'),
        (["--set", "tone"], "expected KEY=VALUE"),
        (["--set", "tone.kind='reinhart'"], "tone.kind: got 'reinhart'"),
        (["--preset", "nothing"], "no such preset"),
        (["--display", "pq"], r"a picture for PQ is written to .avif"),
        (["--sheet", "sheet.txt"], "must end in .png"),
        (["--stops", "x", "--sheet", "sheet.png"], "--stops"),
        (["--seconds", "1"], "--seconds is the exposure on --response"),
        (["--field-of-view", "200"], "field_of_view is 200°"),
        (["--soft", "2"], "soft_focus.share"),
    ],
)
def test_what_cannot_be_is_one_line_and_no_file(tmp_path, capsys, words, message):
    room = window(tmp_path / "room.exr")
    line = refused(["develop", str(room), "-o", str(tmp_path / "out.png"), *words], capsys)
    assert re.search(message, line), line
    assert [p.name for p in tmp_path.iterdir()] == ["room.exr"]


def test_bad_radiance_is_named_or_repaired(tmp_path, capsys):
    radiance = np.full((8, 8, 3), 0.5, np.float32)
    radiance[2, 5] = np.nan
    files.write(tmp_path / "bad.exr", RadianceMap(radiance))
    words = ["develop", str(tmp_path / "bad.exr"), "-o", str(tmp_path / "a.png")]
    assert "bad.exr: the radiance at x 5, y 2 is (nan" in refused(words, capsys)
    assert main([*words, "--repair"]) == 0
    assert "1 pixels that were no number were replaced" in capsys.readouterr().err
    assert np.ptp(files.read_photograph(tmp_path / "a.png").pixels) == 0
    files.write(tmp_path / "black.exr", RadianceMap(np.zeros((8, 8, 3), np.float32)))
    assert "black everywhere" in refused(
        ["develop", str(tmp_path / "black.exr"), "-o", str(tmp_path / "b.png")], capsys
    )
    files.write(tmp_path / "photo.png", Photograph(np.zeros((8, 8, 3), np.uint8), "photo"))
    assert "a photograph where a radiance map" in refused(
        ["develop", str(tmp_path / "photo.png"), "-o", str(tmp_path / "b.png")], capsys
    )


def test_planes_beside_a_picture(tmp_path, capsys):
    depth = np.full((32, 48), 2.0, np.float32)
    depth[:4] = 0
    files.write_layers(tmp_path / "layers.exr", {"with": np.ones((32, 48, 3), np.float32), "depth": depth})
    read = read_depth(tmp_path / "layers.exr", 24.0)
    assert np.isinf(read[0, 0]) and read[9, 9] == 2
    # Along a ray 23.5 pixels across and 15.5 down, of 24 along the axis.
    along = read_depth(tmp_path / "layers.exr", 24.0, "rays")
    assert along[-1, -1] == pytest.approx(2 * 24 / np.sqrt(24**2 + 23.5**2 + 15.5**2))
    ours = {name: np.ones((32, 48), np.float32) for name in ("objects", "matte", "difference", "depth")}
    files.write_layers(tmp_path / "ours.exr", ours)
    assert read_depth(tmp_path / "ours.exr", 24.0)[0, 0] < 1 == read_depth(tmp_path / "ours.exr", 24.0, "axis")[0, 0]
    files.write_layers(tmp_path / "small.exr", {"depth": depth[:16]})
    room = window(tmp_path / "room.exr")
    words = ["develop", str(room), "-o", str(tmp_path / "a.png"), "--focus", "1", "--aperture", "2", "--lens", "50"]
    line = refused([*words, "--depth", str(tmp_path / "small.exr")], capsys)
    assert "the depth map is 48×16 pixels and the picture 48×32" in line
    assert "depth" in refused(words, capsys)
    files.write_layers(tmp_path / "motion.exr", {"motion": np.ones((32, 48, 3), np.float32)})
    assert read_motion(tmp_path / "motion.exr").shape == (32, 48, 2)
    with pytest.raises(UnreadableFile, match="no layer named motion but with, depth"):
        read_motion(tmp_path / "layers.exr")
