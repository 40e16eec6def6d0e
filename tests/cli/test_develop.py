"""`relume develop`: pictures, sequences and the way back, and what is refused."""

import re
from pathlib import Path

import numpy as np
import pytest

from command_line import printed, refused, reported
from moving_scenes import known_response
from relume.capture.response.camera_profile import CameraProfile, write_profile
from relume.cli import main
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.project.developing.depth_and_motion import read_depth, read_motion


def window(path: Path, brightness: float = 40.0, unit: str = "relative") -> Path:
    """A dim room with a bright window."""
    radiance = np.full((32, 48, 3), 0.2, np.float32)
    radiance[8:16, 20:28] = brightness
    files.write(path, RadianceMap(radiance, unit=unit))
    return path


def test_a_picture_with_everything_beside_it(tmp_path, capsys):
    room = window(tmp_path / "room.exr")
    words = ["--tone", "reinhard", "--set", "tone.key=0.36", "--sheet", tmp_path / "sheet.png", "--stops", "-2,0,2"]
    words += ["--false-colour", tmp_path / "false.png", "--report", tmp_path / "report.html"]
    facts = reported(["develop", room, "-o", tmp_path / "out.png", *words], capsys)
    assert facts["tone"] == "Reinhard" and facts["white"] == 0
    picture = files.read_photograph(tmp_path / "out.png").pixels
    assert picture.shape == (32, 48, 3) and picture[10, 22].min() > picture[0, 0].max() > 0
    assert {p.name for p in tmp_path.iterdir()} == {"room.exr", "out.png", "sheet.png", "false.png", "report.html"}
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("<img") >= 6 and "http" not in page.replace("http-equiv", "")


def test_absolute_exposure_by_shutter_aperture_and_iso(tmp_path, capsys):
    room = window(tmp_path / "room.exr", unit="cd/m²")
    # ISO 12232, standard output: 10 · 4² / (0.65 · 100 · 0.5) = 4.923 cd/m² make 118, of which 0.2 are 0.00736.
    words = ["develop", room, "-o", tmp_path / "a.png", "--shutter", "1/2", "--aperture", "4", "--iso", "100"]
    assert reported(words, capsys)["white"] == pytest.approx(64 / (32 * 48))
    pixels = files.read_photograph(tmp_path / "a.png").pixels
    assert pixels[0, 0, 0] == round(255 * (1.055 * 0.00736 ** (1 / 2.4) - 0.055)) == 21
    assert reported([*words, "--exposure", "-1"], capsys)["white"] == 0


def test_the_way_back(tmp_path, capsys):
    room = window(tmp_path / "room.exr", brightness=0.9)
    look = ["--set", "tone.kind='fixed'", "--vignetting", "--field-of-view", "60"]
    assert main(["develop", str(room), "-o", str(tmp_path / "a.png"), *look]) == 0
    back = ["develop", tmp_path / "a.png", "-o", tmp_path / "back.exr", "--undo", "--vignetting"]
    facts = reported([*back, "--field-of-view", "60"], capsys)
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


def test_presets_can_be_listed_and_used(tmp_path, capsys):
    assert "night" in reported(["develop", "--list-presets"], capsys)
    shown = printed(["develop", "--show-preset", "night"], capsys).out
    assert shown.startswith("title = ") and '[glare]\nkind = "eye"' in shown
    words = ["develop", window(tmp_path / "room.exr"), "-o", tmp_path / "a.png", "--preset", "slide", "--dry-run"]
    assert reported(words, capsys)["tone"] == "Darkroom" and not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tone", "reinhard", "--film", "slide"], "--tone and --film"),
        (["--focus", "2"], "--focus needs --aperture"),
        (["--iso", "100"], "--iso is the sensitivity of --shutter"),
        (["--move", "a"], r'--move.*"a" is not of the form DX,DY'),
        (["--set", "tone"], "expected KEY=VALUE"),
        (["--set", "tone.kind='reinhart'"], "tone.kind: got 'reinhart'"),
        (["--preset", "nothing"], "no such preset"),
        (["--display", "pq"], r"a picture for PQ is written to .avif"),
        (["--sheet", "sheet.txt"], "must end in .png"),
        (["--stops", "x", "--sheet", "sheet.png"], "--stops"),
        (["--display", "pq", "--dry-run"], r"a picture for PQ is written to .avif"),
        (["--match", "a.png", "--tone", "reinhard"], "--match is a whole camera"),
        (["--shutter", "abc", "--aperture", "4"], '--shutter.*"abc" is not of the form SECONDS'),
        (["--tone", "histogram", "--set", "tone.kind='reinhard'"], "choose the tone; leave one out"),
        (["--fps", "30"], "--fps is of a sequence"),
        (["--stops", "1,2"], "--stops are of --sheet"),
        (["--lens", "50"], "--lens is the focal length of --focus"),
        (["--aperture", "2"], "--aperture belongs to --focus or --shutter"),
        (["--shutter", "1/60", "--aperture", "4", "--film", "slide"], "--shutter exposes a camera"),
        (["--undo", "--exposure", "1"], "--undo has no tone"),
        (["--preset", "old-lens", "--glare", "lamp.exr"], f"{Path.cwd()}/lamp.exr: no such file"),
        (["--seconds", "1"], "--seconds is the exposure on --response"),
        (["--field-of-view", "200"], "field_of_view is 200°"),
        (["--soft", "2"], "soft_focus: the share is 2"),
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
    assert "1 pixels that were no number were replaced" in printed([*words, "--repair"], capsys).err
    assert np.ptp(files.read_photograph(tmp_path / "a.png").pixels) == 0
    files.write(tmp_path / "black.exr", RadianceMap(np.zeros((8, 8, 3), np.float32)))
    out = ["-o", tmp_path / "b.png"]
    assert "black everywhere" in refused(["develop", tmp_path / "black.exr", *out], capsys)
    files.write(tmp_path / "photo.png", Photograph(np.zeros((8, 8, 3), np.uint8), "photo"))
    assert "a photograph where a radiance map" in refused(["develop", tmp_path / "photo.png", *out], capsys)


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


def test_every_command_line_of_the_document_can_be_given(tmp_path, capsys):
    """The options of docs/how-to/develop.md, each on a small picture: lens, film, eye, a plate's camera, displays."""
    room = window(tmp_path / "room.exr", unit="cd/m²")
    depth = np.full((32, 48), 2.0, np.float32)
    depth[8:16, 20:28] = 0.5
    files.write_layers(tmp_path / "layers.exr", {"with": np.ones((32, 48, 3), np.float32), "depth": depth})
    out = tmp_path / "out.png"
    sharp = developed(room, out, "--tone", "reinhard")
    for words in (
        ["--turn", "2,0,6"],
        ["--move", "9,0"],
        ["--glare", "camera"],
        ["--glare", str(lamp(tmp_path / "lamp.exr"))],
        ["--soft", "0.3"],
        ["--focus", "2", "--aperture", "1", "--lens", "200", "--depth", str(tmp_path / "layers.exr")],
    ):
        drawn = developed(room, out, "--tone", "reinhard", *words)
        assert np.abs(drawn - sharp).max() > 4, words
    grey = developed(room, out, "--film", "black-and-white", "--exposure", "1")
    assert np.array_equal(grey[..., 0], grey[..., 2]) and np.ptp(grey) > 40
    assert developed(room, out, "--preset", "night").shape == sharp.shape
    assert main(["develop", str(room), "-o", str(tmp_path / "hdr.jpg"), "--display", "gain-map", "-q"]) == 0
    with pytest.warns(UserWarning, match="hdr.jpg"):
        light = files.read_radiance(tmp_path / "hdr.jpg").radiance
    assert light[12, 24, 1] > 4 * light[0, 0, 1] > 0
    capsys.readouterr()


def test_a_turn_is_to_the_right_and_the_picture_moves_to_the_left(tmp_path):
    radiance = np.full((33, 65, 3), 1e-3, np.float32)
    radiance[16, 32] = 1.0
    files.write(tmp_path / "dot.exr", RadianceMap(radiance))
    fixed = ["--set", "tone.kind='fixed'", "--set", "motion.opening=0.0"]
    rolled = developed(tmp_path / "dot.exr", tmp_path / "a.png", "--turn", "8", *fixed)
    assert np.count_nonzero(rolled[16, :, 0] > 30) > 4
    from relume.project.presets.preset import preset_of

    turn = preset_of({"motion": {"kind": "turn", "degrees": [8.0, 0.0, 0.0]}}).camera.motion
    # What the middle of the sensor sees at the end of a turn to the right lies to the right in the picture.
    path = turn.path((33, 65), 70.0)  # pyright: ignore[reportOptionalMemberAccess, reportAttributeAccessIssue]
    start, end = (np.asarray(path.matrices)[i] @ [32.5, 16.5, 1] for i in (0, -1))
    assert end[0] / end[2] > 35 > 30 > start[0] / start[2]


def test_a_plates_camera_makes_its_greys(tmp_path, capsys):
    scene = np.full((64, 96, 3), 0.2, np.float32) * np.linspace(0.5, 2, 96, dtype=np.float32)[None, :, None]
    files.write(tmp_path / "scene.exr", RadianceMap(scene))
    plate = developed(tmp_path / "scene.exr", tmp_path / "plate.png", "--set", "tone.kind='fixed'")
    words = ["develop", tmp_path / "scene.exr", "-o", tmp_path / "a.png", "--match", tmp_path / "plate.png"]
    assert any(line.startswith("exposure: metered") for line in reported(words, capsys)["matched"])
    # MeteredExposure: the log mean becomes 118, whatever the plate showed.
    again = files.read_photograph(tmp_path / "a.png").pixels.astype(float)
    assert np.median(again) == pytest.approx(118, abs=6) and np.median(plate) != pytest.approx(118, abs=2)


def test_a_profiles_balance_and_scale_go_both_ways(tmp_path, capsys):
    response = known_response()
    profile = CameraProfile("Maker One", response, balance=(2.0, 1.0, 0.5), scale=100.0, scale_exposure=(True, True))
    write_profile(tmp_path / "camera.json", profile)
    files.write(tmp_path / "grey.png", Photograph(np.full((8, 8, 3), 128, np.uint8), "grey"))
    undone = ["develop", str(tmp_path / "grey.png"), "-o", str(tmp_path / "grey.exr"), "--undo"]
    facts = reported([*undone, "--response", str(tmp_path / "camera.json"), "--seconds", "0.01"], capsys)
    assert facts["unit"] == "relative", "the photograph has no f-number: the scale does not hold"
    red, green, blue = files.read_radiance(tmp_path / "grey.exr").radiance[4, 4]
    curves = np.exp(response.log_exposure[:, 128])
    expected = 2 * curves[0] / curves[1], 0.5 * curves[2] / curves[1]
    assert (red / green, blue / green) == pytest.approx(expected, rel=0.01)
    words = ["--response", str(tmp_path / "camera.json"), "--seconds", "0.01"]
    assert np.abs(developed(tmp_path / "grey.exr", tmp_path / "back.png", *words).astype(int) - 128).max() <= 1


def test_nothing_that_was_given_or_made_is_written_over(tmp_path, capsys):
    for index in range(2):
        assert main(["develop", str(window(tmp_path / f"f{index}.exr")), "-o", str(tmp_path / f"f{index}.jpg"),
                     "--display", "gain-map", "-q"]) == 0  # fmt: skip
    maps = [str(tmp_path / f"f{index}.jpg") for index in range(2)]
    before = [Path(each).read_bytes() for each in maps]
    words = ["develop", *maps, "-o", str(tmp_path)]
    assert "the input itself" in refused([*words, "--display", "gain-map"], capsys)
    out = str(tmp_path / "a.png")
    assert "the input itself" in refused(["develop", maps[0], "-o", out, "--sheet", maps[0]], capsys)
    assert [Path(each).read_bytes() for each in maps] == before
    assert "another output has that name" in refused(["develop", maps[0], "-o", out, "--sheet", out], capsys)
    (tmp_path / "b").mkdir()
    window(tmp_path / "b" / "f0.exr")
    same = ["develop", str(tmp_path / "f0.exr"), str(tmp_path / "b" / "f0.exr"), "-o", str(tmp_path / "seq")]
    assert "would both be written as f0.png" in refused(same, capsys)
    assert not (tmp_path / "seq").exists()


def test_a_movie_reports_its_worst_frame(tmp_path, capsys):
    frames = [str(window(tmp_path / f"f{index}.exr", brightness=level)) for index, level in enumerate((0.1, 40.0))]
    words = ["develop", *frames, "-o", tmp_path / "m.mp4", "--set", "tone.kind='fixed'"]
    assert reported(words, capsys)["white in the worst frame"] == pytest.approx(64 / (32 * 48))
    assert (tmp_path / "m.mp4").stat().st_size > 0


def lamp(path: Path) -> Path:
    """The picture of a small lamp in the dark, with a glow about it."""
    y, x = np.ogrid[-10:11, -10:11]
    light = np.exp(-np.hypot(y, x) / 3)[..., None] * np.ones(3)
    files.write(path, RadianceMap(light.astype(np.float32)))
    return path


def developed(picture: Path, out: Path, *words: str) -> np.ndarray:
    """Pixels (H, W, 3) that a command line makes, as int."""
    assert main(["develop", str(picture), "-o", str(out), "-q", *words]) == 0
    return files.read_photograph(out).pixels.astype(int)


def test_a_frame_that_cannot_be_read_is_named_and_all_others_are_written(tmp_path, capsys):
    frames = [str(window(tmp_path / f"f{index}.exr")) for index in range(4)]
    (tmp_path / "f2.exr").write_bytes(b"no picture")
    words = ["develop", *frames, "-o", str(tmp_path / "seq")]
    assert "1 of 4 failed: f2.exr" in refused(words, capsys, 4)
    assert sorted(p.name for p in (tmp_path / "seq").glob("*.png")) == ["f0.png", "f1.png", "f3.png"]


# A camera's own response: how bright it comes out, and what is printed of that


def test_a_response_without_seconds_is_metered_to_248(tmp_path, capsys):
    response = known_response()
    write_profile(tmp_path / "camera.json", CameraProfile("Maker One", response))
    files.write(tmp_path / "grey.exr", RadianceMap(np.full((20, 30, 3), 0.2, np.float32)))
    words = ["develop", tmp_path / "grey.exr", "-o", tmp_path / "a.png", "--response", tmp_path / "camera.json"]
    white = np.exp(response.log_exposure[:, 248].mean())
    assert reported(words, capsys)["exposure"] == pytest.approx(white / 0.2, rel=0.01)
    assert np.abs(files.read_photograph(tmp_path / "a.png").pixels[..., 1].astype(int) - 248).max() <= 2


def test_a_preset_of_a_camera_exposes_by_its_settings_response_and_scale(tmp_path):
    response = known_response()
    profile = CameraProfile("Maker One", response, scale=100.0, scale_exposure=(True, True))
    write_profile(tmp_path / "camera.json", profile)
    table = "kind = 'camera'\nseconds = 0.25\nf_number = 2\niso = 200\nresponse = 'camera.json'\n"
    (tmp_path / "camera.toml").write_text("[tone]\n" + table, encoding="utf-8")
    # ¼ s at f/2 and ISO 200 expose by ⅛ per relative unit, and one is 100 cd/m².
    lit = np.exp(response.log_exposure[:, 128]) * 100 / 0.125
    files.write(tmp_path / "grey.exr", RadianceMap(np.full((20, 30, 3), lit, np.float32), unit="cd/m²"))
    pixels = developed(tmp_path / "grey.exr", tmp_path / "a.png", "--preset", str(tmp_path / "camera.toml"))
    assert np.abs(pixels - 128).max() <= 1


def test_what_a_response_saturates_is_listed_as_white(tmp_path, capsys):
    write_profile(tmp_path / "camera.json", CameraProfile("Maker One", known_response()))
    scene = np.full((20, 30, 3), 0.2, np.float32)
    scene[:5] = 1e4
    files.write(tmp_path / "scene.exr", RadianceMap(scene))
    words = ["develop", tmp_path / "scene.exr", "-o", tmp_path / "a.png", "--seconds", "1"]
    assert reported([*words, "--response", tmp_path / "camera.json"], capsys)["white"] == 0.25
