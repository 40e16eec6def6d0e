"""`relume merge`, run in this process: what it reads, writes, prints and refuses, option by option."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command_line import printed, refused, reported
from half_room import smaller
from moving_scenes import known_response
from relume.capture.brackets.settings import MergeSettings
from relume.capture.brackets.shoot import targets
from relume.capture.lens.lateral_colour import LateralColour, recover_lateral_colour
from relume.capture.lens.vignetting import Vignetting
from relume.capture.merging import Hat
from relume.capture.raw.sensor import Sensor, SensorNoise
from relume.capture.response.camera_profile import CameraProfile, read_profile, write_profile
from relume.capture.response.debevec_malik import DebevecMalik
from relume.capture.response.other_methods import MitsunagaNayar, Robertson
from relume.capture.scale.absolute import THIRD_OF_A_STOP
from relume.capture.scale.readings import (
    DarkPlace,
    ExposureScale,
    LampInTheDark,
    LuminaireReading,
    LuxReading,
    Rectangle,
    SpotReading,
    WhiteCard,
)
from relume.cli import main
from relume.cli.merge import Lens, Readings, Steps, settings_of
from relume.errors import NotABracket
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap
from shoots import MAKER, exposed, raw_files, textured, written

SECONDS = (1 / 256, 1 / 128, 1 / 64, 1 / 32, 1 / 16)
EXPOSURES = [Exposure(t, 1.0, 100.0) for t in SECONDS]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
ROOM = Path(__file__).parents[2] / "examples" / "room"
PLATE = [str(p) for p in sorted((ROOM / "plate").glob("*.jpg"))]


def only(facts: dict) -> dict:
    """What is reported of the one bracket there is."""
    (bracket,) = facts["brackets"]
    return bracket


def exposures(facts: dict) -> dict[str, tuple[float, str]]:
    """Seconds and source of each photograph of the one bracket there is."""
    return {frame["name"]: (frame["seconds"], frame["source"]) for frame in only(facts)["frames"]}


def wall(path: Path, size: tuple[int, int]) -> np.ndarray:
    """Write the radiance map of an evenly lit wall; the falloff in it."""
    falloff = Vignetting((-0.3,)).falloff(size)[..., None]
    write(path, RadianceMap(np.repeat(falloff, 3, 2).astype(np.float32), clipped=np.zeros(size[::-1], np.uint8)))
    return falloff


LIGHT = textured(240, 160).mean(2) / 30


def raws_of(folder: Path, *seconds: float) -> list[str]:
    """Camera raws of `LIGHT`."""
    return [str(path) for path in raw_files(folder, [LIGHT] * len(seconds), seconds)]


@pytest.fixture(scope="module")
def scene() -> np.ndarray:
    return textured()


@pytest.fixture(scope="module")
def shoot(scene, tmp_path_factory) -> list[str]:
    """Five photographs a stop apart, with EXIF."""
    return written(tmp_path_factory.mktemp("shoot"), exposed(scene, EXPOSURES))


@pytest.fixture(scope="module")
def profile(tmp_path_factory) -> str:
    """The virtual camera's own."""
    path = tmp_path_factory.mktemp("profile") / "known.json"
    write_profile(path, CameraProfile(MAKER, known_response()))
    return str(path)


@pytest.fixture
def merged(shoot, profile, tmp_path, capsys) -> Callable[..., tuple[RadianceMap, dict]]:
    """Merges `shoot` by the known profile with more words: the map, and what was reported of the bracket."""

    def run(*words: str, photographs: list[str] = shoot, code: int = 0) -> tuple[RadianceMap, dict]:
        out = tmp_path / f"map_{len(list(tmp_path.iterdir()))}.exr"
        facts = reported(["merge", *photographs, "-o", str(out), "--profile", profile, *words], capsys, code)
        return read_radiance(out), only(facts)

    return run


def test_a_bracket_is_merged_with_its_report_and_its_profile(shoot, scene, tmp_path, capsys):
    out, profile, report = tmp_path / "a.exr", tmp_path / "p.json", tmp_path / "r.html"
    words = ["merge", *shoot, "-o", str(out), "--save-profile", str(profile), "--report", str(report)]
    facts = reported(words, capsys)
    assert only(facts)["written"] == str(out) and only(facts)["camera"] == MAKER
    assert facts["profile"] == {MAKER: str(profile)} and facts["report"] == str(report)
    assert exposures(facts) == {f"frame_{i}.png": (pytest.approx(t), "EXIF") for i, t in enumerate(SECONDS)}
    assert only(facts)["unit"] == "relative" and len(facts["misfit"][MAKER]) == 3 and max(facts["misfit"][MAKER]) < 0.1
    assert list(read_layers(out)) == ["radiance", "variance", "clipped"]
    picture = read_radiance(out)
    assert picture.clipped is not None
    found = (picture.radiance / scene)[(picture.clipped == 0) & (scene.min(2) > 2)]  # darker places are noisy
    assert np.percentile(found / np.median(found), (5, 95)) == pytest.approx((1, 1), abs=0.03)
    page = report.read_text()
    assert page.startswith("<!doctype html>") and "frame_4.png" in page and "The camera&#x27;s response" in page
    assert read_profile(profile).camera == MAKER

    # With its profile the same photographs give the same radiance,
    again = tmp_path / "again.exr"
    facts = reported(["merge", *shoot, "-o", str(again), "--profile", str(profile)], capsys)
    assert facts["misfit"] == {} and facts["profile"] == {} and facts["report"] is None
    np.testing.assert_allclose(read_radiance(again).radiance, picture.radiance, rtol=1e-6)
    # and the map developed through it at a photograph's own exposure is that photograph again.
    exposure = read_photograph(shoot[2]).exposure
    assert exposure is not None
    png = tmp_path / "frame.png"
    develop = ["develop", str(out), "-o", str(png), "--response", str(profile), "--seconds", str(exposure.factor)]
    assert main([*develop, "-q"]) == 0
    difference = read_photograph(png).pixels.astype(int) - read_photograph(shoot[2]).pixels
    assert np.median(np.abs(difference)) <= 1 and np.percentile(np.abs(difference), 99) <= 8
    report.write_text("{")
    assert "r.html: not a camera profile" in refused([*develop[:5], str(report)], capsys)
    assert "none.json" in refused([*develop[:5], str(tmp_path / "none.json")], capsys)


def test_the_example_s_plate_is_merged_and_reported_as_lines(tmp_path, capsys):
    out, plate = tmp_path / "plate.hdr", [tmp_path / Path(path).name for path in PLATE]
    for path, copy in zip(PLATE, plate, strict=True):
        smaller(Path(path), copy, 4)
    lines = printed(["merge", *map(str, plate), "-o", str(out)], capsys).out.splitlines()
    assert [line.split()[0] for line in lines[:3]] == ["written", "exposures", "unit"]
    assert "IMG_0001.jpg 1/4 s (EXIF), IMG_0002.jpg 1 s (EXIF)" in lines[1]
    assert read_radiance(out).size == (192, 128)


SWITCHES = {
    "": {},
    "--method debevec-malik": {"method": DebevecMalik()},
    "--method mitsunaga-nayar": {"method": MitsunagaNayar()},
    "--method robertson": {"method": Robertson()},
    "--refine": {"refine": True},
    "--no-align": {"align": False},
    "--no-deghost": {"deghost": False},
    "--deghost": {},
    "--paper-weights": {"weighting": Hat()},
    "--neutral 128": {"neutral": 128},
    "--focal-length 900": {"focal_length": 900.0},
    "--absolute": {"scale": ExposureScale()},
    "--spot 1,2,3": {"scale": SpotReading(1, 2, 3.0)},
    "--lux 1,2,3,4,500,0.18": {"scale": LuxReading(Rectangle(1, 2, 3, 4), 500.0, 0.18)},
    "--luminaire 1,2,3,4,5,6,7": {"scale": LuminaireReading(Rectangle(1, 2, 3, 4), (5.0, 6.0, 7.0))},
    "--glare 1,2,3,4": {"glare": DarkPlace(Rectangle(1, 2, 3, 4))},
    "--white 1,2,3,4": {"balance": WhiteCard(Rectangle(1, 2, 3, 4))},
}


@pytest.mark.parametrize("words", SWITCHES)
def test_every_switch_changes_its_setting_and_nothing_else(words, shoot, tmp_path, monkeypatch, capsys):
    import relume.capture.brackets.shoot as shoot_module

    given = {}

    def merge_brackets(brackets, **options):
        given.update(options, brackets=brackets)
        raise NotABracket("seen enough")

    monkeypatch.setattr(shoot_module, "merge_brackets", merge_brackets)
    refused(["merge", *shoot, "-o", str(tmp_path / "a.exr"), *words.split()], capsys)
    assert given["settings"] == MergeSettings(**SWITCHES[words]) and given["profile"] is None
    assert [p.name for p in given["brackets"][0].photographs] == shoot


def test_times_come_from_the_command_line_or_from_a_file(scene, tmp_path, profile, capsys):
    paths = written(tmp_path / "bare", [replace(p, exposure=None) for p in exposed(scene, EXPOSURES)])
    words = ["merge", *paths, "--profile", profile, "-o"]
    first = reported([*words, str(tmp_path / "a.exr"), "--times", "1/256,1/128,1/64,1/32,1/16"], capsys)
    reported([*words, str(tmp_path / "b.exr"), "--times", "1/128 1/64 1/32 1/16 1/8"], capsys)
    listed = tmp_path / "exposures.txt"
    listed.write_text("".join(f"{Path(p).name} {t}\n" for p, t in zip(paths, SECONDS, strict=True)))
    from_file = reported([*words, str(tmp_path / "c.exr"), "--times", str(listed)], capsys)
    a, b, c = (read_radiance(tmp_path / f"{name}.exr").radiance for name in "abc")
    assert np.median(a / b) == pytest.approx(2, rel=1e-6)
    assert np.array_equal(a, c)
    assert exposures(first) == exposures(from_file) and exposures(first)["frame_0.png"] == (1 / 256, "given")
    # A row of times longer than any name of a file is no name of a file.
    line = refused([*words, str(tmp_path / "d.exr"), "--times", ",".join(["0.00390625"] * 60)], capsys)
    assert "60 times were given for 5 photographs" in line
    # The order that they go in is reported: for a folder by name, 9 before 10.
    for old, new in zip(paths[:2], ("frame_10.png", "frame_9.png"), strict=True):
        Path(old).rename(Path(old).with_name(new))
    listed.unlink()
    line = refused(["merge", str(tmp_path / "bare"), "-o", str(tmp_path / "d.exr"), "--times", "1,2"], capsys)
    assert "frame_2.png, frame_3.png, frame_4.png, frame_9.png, frame_10.png" in line and "9 before 10" in line
    words = ["merge", str(tmp_path / "bare"), "-o", str(tmp_path / "d.exr"), "--dry-run", "--times", "1,2,4,8,16"]
    reported_of = exposures(reported(words, capsys))
    assert {name: seconds for name, (seconds, _) in reported_of.items()} == {
        "frame_2.png": 1, "frame_3.png": 2, "frame_4.png": 4, "frame_9.png": 8, "frame_10.png": 16,
    }  # fmt: skip
    # Photographs named one by one keep their order, and that a shell puts 10 before 9 is reported.
    bare = [str(tmp_path / "bare" / f"frame_{i}.png") for i in (10, 9)]
    facts = reported(["merge", *bare, "-o", str(tmp_path / "d.exr"), "--dry-run", "--times", "4,1"], capsys)
    assert exposures(facts) == {"frame_9.png": (1, "given"), "frame_10.png": (4, "given")}
    assert any("in the order given, frame_10.png, frame_9.png" in line for line in facts["notes"])


def test_times_are_read_from_names_when_asked_and_suggested_otherwise(scene, tmp_path, profile, capsys):
    names = ["cp_t256.png", "cp_t128.png", "cp_t64.png", "cp_t32.png", "cp_t16.png"]
    bare = [replace(p, exposure=None) for p in exposed(scene, EXPOSURES)]
    for folder in ("one", "two"):
        for path, name in zip(written(tmp_path / folder, bare), names, strict=True):
            Path(path).rename(Path(path).with_name(name))
    words = ["merge", str(tmp_path / "one"), "--profile", profile, "-o", str(tmp_path / "a.exr")]
    suggested = "if they are, give --times-from-names (1/16, 1/32, 1/64, 1/128, 1/256 s)"
    assert suggested in printed(words, capsys, 4).err
    named = reported([*words, "--times-from-names"], capsys)
    assert exposures(named) == dict(zip(names, [(t, "name") for t in SECONDS], strict=True))
    # Every folder is a bracket of its own, and one call does as much.
    shoot = ["merge", str(tmp_path / "one"), str(tmp_path / "two"), "--profile", profile, "-o", str(tmp_path / "maps")]
    assert len(reported([*shoot, "--times-from-names", "--dry-run"], capsys)["brackets"]) == 2
    assert "choose one of the two" in refused([*words, "--times-from-names", "--times", "1,2,4,8,16"], capsys)
    (tmp_path / "one" / "cp_t16.png").rename(tmp_path / "one" / "last.png")
    line = refused([*words, "--times-from-names"], capsys)
    assert "last.png: the names of these photographs give no times" in line


def test_unequal_crops_of_one_bracket_are_pointed_to_probe(scene, tmp_path, capsys):
    bare = [replace(p, exposure=None) for p in exposed(scene, EXPOSURES)]
    crops = [replace(p, pixels=np.ascontiguousarray(p.pixels[i:, 2 * i :])) for i, p in enumerate(bare)]
    line = refused(["merge", *written(tmp_path / "crops", crops), "-o", str(tmp_path / "a.exr")], capsys)
    assert "frame_0.png and 4 others: of 5 sizes, all but alike" in line and "relume probe" in line


def test_without_any_exposure_the_pixels_say_and_the_result_is_doubtful(scene, tmp_path, profile, capsys):
    paths = written(tmp_path / "bare", [replace(p, exposure=None) for p in exposed(scene, EXPOSURES)])
    words = ["merge", *paths, "--profile", profile, "-o", str(tmp_path / "a.exr")]
    captured = printed(words, capsys, 4)
    assert "no exposure is known" in captured.err and captured.err.splitlines()[-1].startswith("relume: ")
    assert "(estimated)" in captured.out and (tmp_path / "a.exr").exists()


def test_doubtful_results_are_written_and_exit_with_4_unless_accepted(shoot, tmp_path, capsys):
    words = ["merge", *shoot, "-o", str(tmp_path / "a.exr"), "--times", "1/64,1/256,1/16,1/32,1/128"]
    captured = printed(words, capsys, 4)
    assert (tmp_path / "a.exr").exists() and "written" in captured.out
    notes = [line for line in captured.err.splitlines() if line.startswith("relume: note: ")]
    last = captured.err.splitlines()[-1]
    assert any("fits badly" in line for line in notes) and any("in another order" in line for line in notes)
    assert "doubts, noted above" in last and "--accept" in last
    (tmp_path / "a.exr").unlink()
    captured = printed([*words, "--accept"], capsys)
    assert "fits badly" in captured.err and captured.err.count("\n") == captured.err.count("relume: note: ")
    assert (tmp_path / "a.exr").exists()


def test_a_single_doubt_is_reported_in_one_line(merged, shoot, tmp_path, profile, capsys):
    times = ["1/256", "1/128", "1/48", "1/32", "1/16"]
    words = ["merge", *shoot, "--profile", profile, "--times", ",".join(times), "-o", str(tmp_path / "a.exr"), "-q"]
    line = refused(words, capsys, 4)
    assert "frame_2.png" in line and line.endswith("(all was written; --accept takes it as it is)\n")
    assert printed([*words, "--accept"], capsys).err == ""


def test_marked_shutter_speeds_stand_for_powers_of_two_where_asked(scene, tmp_path, capsys):
    paths = written(tmp_path, exposed(scene, [Exposure(t) for t in (1 / 60, 1 / 30)]))
    words = ["merge", *paths, "-o", str(tmp_path / "a.exr"), "--dry-run"]
    marked, true = exposures(reported(words, capsys)), exposures(reported([*words, "--true-shutter"], capsys))
    assert [seconds for seconds, _ in marked.values()] == pytest.approx([1 / 60, 1 / 30])
    assert [seconds for seconds, _ in true.values()] == pytest.approx([1 / 64, 1 / 32])


def test_a_colour_that_is_no_part_of_the_picture_is_left_out(merged, shoot, tmp_path):
    photographs = [read_photograph(path) for path in shoot]
    for photograph in photographs:
        photograph.pixels[:, :9] = (0, 0, 255)
        photograph.pixels[40, 50] = (0, 1, 255)
    bordered = written(tmp_path / "bordered", [replace(p, name=Path(p.name).name) for p in photographs])
    picture, facts = merged("--ignore", "0,0,255", photographs=bordered)
    assert picture.clipped is not None
    outside = picture.clipped == OUTSIDE
    assert outside[:, :9].all() and outside.sum() == 9 * 120
    assert facts["outside"] == 1080 and facts["pixels"] == 120 * 180


def test_a_hand_held_and_a_moving_bracket_are_reported(merged, scene, tmp_path):
    shifted = list(exposed(scene, EXPOSURES))
    shifted[1] = replace(shifted[1], pixels=np.roll(shifted[1].pixels, 3, axis=1))
    _, facts = merged(photographs=written(tmp_path / "held", shifted))
    assert facts["moved"] == 1
    assert [frame["dx"] for frame in facts["frames"]] == pytest.approx([0, 3, 0, 0, 0], abs=0.2)
    assert [frame["dy"] for frame in facts["frames"]] == pytest.approx([0, 0, 0, 0, 0], abs=0.2)
    _, facts = merged("--no-align", "--accept", photographs=written(tmp_path / "held", shifted))
    assert facts["moved"] is None and facts["frames"][1]["dx"] is None
    moving = list(exposed(scene, EXPOSURES))
    for index, photograph in enumerate(moving):
        photograph.pixels[30:90, 20 + 28 * index : 45 + 28 * index] = 60 + 20 * index
    paths = written(tmp_path / "moving", moving)
    _, facts = merged("--no-align", photographs=paths)
    assert 0.05 < facts["ghost_share"] < 0.6 and max(frame["ghost_share"] for frame in facts["frames"]) > 0.02
    assert merged("--no-align", "--no-deghost", photographs=paths)[1]["ghost_share"] is None


def test_the_scale_comes_from_any_one_reading(merged, scene):
    plain, facts = merged()
    assert plain.unit == "relative" and facts["scale"] is None
    light = plain.radiance @ LUMINANCE
    by_spot, facts = merged("--spot", "60,40,500")
    assert by_spot.unit == facts["unit"] == "cd/m²" and "a spot-meter reading at 60, 40" in facts["scale"]["source"]
    factor = by_spot.radiance[0, 0] / plain.radiance[0, 0]
    assert facts["scale"]["factor"] == pytest.approx(factor, rel=1e-4) and 0.05 <= facts["scale"]["deviation"] < 0.3
    y, x = np.mgrid[:120, :180]
    disc = (x - 60) ** 2 + (y - 40) ** 2 <= 16
    assert factor == pytest.approx(np.full(3, 500 / light[disc].mean()), rel=0.02)
    by_lux, facts = merged("--lux", "20,30,16,8,1000,0.18")
    card = light[30:38, 20:36].mean()
    assert by_lux.radiance[0, 0] / plain.radiance[0, 0] == pytest.approx(np.full(3, 180 / np.pi / card), rel=1e-4)
    by_lamp, facts = merged("--luminaire", "20,30,16,8,100,200,300")
    colour = by_lamp.radiance[30:38, 20:36].mean((0, 1))
    assert colour == pytest.approx((100, 200, 300), rel=0.01)
    by_exposure, facts = merged("--absolute")
    assert facts["scale"]["deviation"] == THIRD_OF_A_STOP and "aperture" in facts["scale"]["source"]
    assert np.ptp(by_exposure.radiance[0, 0] / plain.radiance[0, 0]) < 1e-2


def test_the_lens_is_undone(merged, tmp_path):
    plain, _ = merged()
    grey, _ = merged("--white", "100,60,10,10")
    assert np.ptp(grey.radiance[60:70, 100:110].mean((0, 1))) < 1e-3 * grey.radiance[60, 100, 0]
    falloff = wall(tmp_path / "wall.exr", (180, 120))
    even, _ = merged("--flat-field", str(tmp_path / "wall.exr"))
    np.testing.assert_allclose(even.radiance, plain.radiance / falloff, rtol=2e-3)
    veiled = plain.radiance.min((0, 1)).mean()
    dark = np.argwhere(plain.radiance.max(2) == plain.radiance[5:-5, 5:-5].max(2).min())[0]
    clear, _ = merged("--glare", f"{dark[1]},{dark[0]},1,1")
    assert clear.radiance.min() < 0.2 * veiled and clear.radiance.max() > plain.radiance.max()


def test_everything_that_was_measured_is_kept_in_the_profile(shoot, tmp_path, capsys):
    """Vignetting, the balance of a white card and of a coloured lamp, and the scale: used again they give the same."""
    wall(tmp_path / "wall.exr", (180, 120))
    out, again, profile = (str(tmp_path / name) for name in ("a.exr", "b.exr", "p.json"))
    words = ["merge", *shoot, "-o", out, "--save-profile", profile, "--flat-field", str(tmp_path / "wall.exr")]
    words += ["--white", "100,60,10,10", "--luminaire", "20,30,16,8,100,200,300"]
    before = only(reported(words, capsys))["scale"]
    after = only(reported(["merge", *shoot, "-o", again, "--profile", profile], capsys))["scale"]
    # As uncertain as it was measured, and no better.
    assert after["deviation"] == pytest.approx(before["deviation"]) and "the camera's profile" in after["source"]
    np.testing.assert_allclose(read_radiance(again).radiance, read_radiance(out).radiance, rtol=1e-5)
    assert read_radiance(again).unit == "cd/m²"


def test_a_profile_of_another_camera_is_reported(merged, shoot, tmp_path, capsys):
    other = tmp_path / "other.json"
    write_profile(other, CameraProfile("Another Two", known_response()))
    words = ["merge", *shoot, "-o", str(tmp_path / "a.exr"), "--profile", str(other)]
    (line,) = printed([*words, "--report", str(tmp_path / "r.html")], capsys, 4).err.splitlines()
    assert "the profile of Another Two" in line and f"of the camera {MAKER}" in line
    assert "the profile of Another Two" in (tmp_path / "r.html").read_text()
    facts = reported([*words, "--accept"], capsys)
    assert len(facts["doubts"]) == 1 and "Another Two" in facts["doubts"][0] and facts["notes"] == []
    merged()
    assert capsys.readouterr().err == ""


def test_options_that_do_nothing_are_reported(merged, profile, tmp_path, capsys):
    plain, _ = merged()
    words = ["--neutral", "128", "--refine", "--method", "robertson"]
    for option, value in (("--neutral", "128"), ("--refine", ""), ("--method", "robertson")):
        assert np.array_equal(merged(option, *filter(None, [value]))[0].radiance, plain.radiance)
    assert printed(["merge", *PLATE, "-o", str(tmp_path / "a.exr"), "--neutral", "128", "--dry-run"], capsys).err == ""
    assert main(["merge", *PLATE, "-o", str(tmp_path / "b.exr"), "--profile", profile, "--dry-run", *words]) == 0
    line = "without effect: neutral, method, refine; the profile's response is taken as it is"
    assert capsys.readouterr().err == f"relume: note: {line}\n"
    raws = raws_of(tmp_path / "raws", 1.0, 4.0)
    reported(["merge", *raws, "-o", str(tmp_path / "plain.exr")], capsys)
    words = ["--neutral", "9", "--method", "robertson", "--no-align", "--no-deghost", "--paper-weights"]
    assert main(["merge", *raws, "-o", str(tmp_path / "a.exr"), "--dry-run", "--refine", "--align", "--deghost"]) == 0
    assert capsys.readouterr().err == ""
    words += ["--ignore", "0,0,255", "--true-shutter"]
    assert main(["merge", *raws, "-o", str(tmp_path / "with.exr"), *words]) == 0
    line = "neutral, method, align, deghost, weighting, ignore, true_shutter"
    assert capsys.readouterr().err == f"relume: note: without effect: {line}; camera raws are merged as they are\n"
    without, with_ = (read_radiance(tmp_path / f"{name}.exr") for name in ("plain", "with"))
    assert np.array_equal(with_.radiance, without.radiance)


def test_a_folder_is_merged_to_a_folder(shoot, profile, tmp_path, capsys):
    folder = str(Path(shoot[0]).parent)
    facts = reported(["merge", folder, "-o", str(tmp_path), "--profile", profile], capsys)
    assert only(facts)["written"] == str(tmp_path / "frame_0-frame_4.exr") and Path(only(facts)["written"]).exists()
    # One without a suffix is a folder, whether it is there or not.
    assert main(["merge", *shoot, "-o", f"{tmp_path}/new/", "--profile", profile, "-q"]) == 0
    assert (tmp_path / "new" / "frame_0-frame_4.exr").exists()
    (tmp_path / "file").write_text("")
    assert "not a folder" in refused(["merge", *shoot, "-o", str(tmp_path / "file"), "--profile", profile], capsys, 3)
    (tmp_path / "file").unlink()
    assert "no photograph is in this folder" in refused(["merge", str(tmp_path), "-o", "a.exr"], capsys)


def test_several_brackets_are_merged_to_a_folder_and_to_no_file(scene, tmp_path, profile, capsys):
    shoot = tmp_path / "shoot"
    written(shoot, exposed(scene, EXPOSURES, prefix="a_"))
    written(shoot, exposed(scene[::-1].copy(), EXPOSURES[1:], prefix="b_"))
    words = ["merge", str(shoot), "--profile", profile]
    line = refused([*words, "-o", str(tmp_path / "one.exr")], capsys)
    first, second = ("5 photographs, Virtual One, 180×120, f/1"), ("4 photographs, Virtual One, 180×120, f/1")
    assert f"2 brackets are here, not one: a_0.png … a_4.png ({first}); b_0.png … b_3.png ({second})" in line
    bare = [replace(p, exposure=None, camera="") for p in exposed(scene, EXPOSURES[:2], prefix="c_")]
    paths = written(tmp_path / "bare", bare)
    line = refused(["merge", str(shoot), *paths, "-o", str(tmp_path / "one.exr")], capsys)
    assert "3 brackets are here" in line and "c_0.png … c_1.png (2 photographs, no EXIF, 180×120)" in line
    (tmp_path / "file").write_text("")
    assert "not a folder" in refused([*words, "-o", str(tmp_path / "file")], capsys, 3)
    maps = tmp_path / "maps"
    planned = reported([*words, "-o", str(maps), "--dry-run"], capsys)
    assert not maps.exists()
    assert [[frame["name"] for frame in bracket["frames"]] for bracket in planned["brackets"]] == [
        [f"a_{i}.png" for i in range(5)], [f"b_{i}.png" for i in range(4)],
    ]  # fmt: skip
    facts = reported([*words, "-o", str(maps)], capsys)
    first, second = (read_radiance(maps / name) for name in ("a_0-a_4.exr", "b_0-b_3.exr"))
    assert [path.name for path in sorted(maps.iterdir())] == ["a_0-a_4.exr", "b_0-b_3.exr"]
    assert [bracket["written"] for bracket in facts["brackets"]] == [
        str(maps / f"{n}.exr") for n in ("a_0-a_4", "b_0-b_3")
    ]
    assert facts["brackets"][1]["frames"][0]["seconds"] == 1 / 128
    assert np.median(second.radiance[::-1] / first.radiance) == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(
    ("brackets", "names"),
    [
        ([("monday", "IMG_0", "IMG_2"), ("tuesday", "IMG_0", "IMG_2")], ["monday-IMG_0-IMG_2", "tuesday-IMG_0-IMG_2"]),
        ([("1997/day", "IMG_0", "IMG_2"), ("1998/day", "IMG_0", "IMG_2")], ["day-IMG_0-IMG_2", "day-IMG_0-IMG_2_1"]),
        ([("monday", "IMG_0", "IMG_2")], ["IMG_0-IMG_2"]),
        ([("monday", "IMG_0")], ["IMG_0"]),
        ([("x/a", "I"), ("y/a", "I"), ("y/b", "I"), ("q/a", "I_1")], ["a-I", "a-I_1", "b-I", "a-I_1_1"]),
    ],
)
def test_no_map_overwrites_another_whatever_their_names(brackets, names, tmp_path):
    groups = [[tmp_path / folder / f"{name}.JPG" for name in photographs] for folder, *photographs in brackets]
    assert targets(groups, tmp_path / "maps") == tuple(tmp_path / "maps" / f"{name}.exr" for name in names)


def test_each_camera_has_its_own_response_and_profile(scene, tmp_path, capsys):
    from synthetic import VirtualCamera

    other = VirtualCamera(power=(1.8, 1.8, 1.8), electrons=20_000.0, read_noise=6.0)
    first = written(tmp_path / "shoot", exposed(scene, EXPOSURES, prefix="a_"))
    second = written(tmp_path / "shoot", exposed(scene, EXPOSURES, prefix="b_", camera=other, maker="Other Two"))
    profile, maps = tmp_path / "p.json", tmp_path / "maps"
    words = ["merge", *first, *second, "-o", str(maps), "--save-profile", str(profile)]
    facts = reported([*words, "--report", str(tmp_path / "r.html")], capsys)
    assert facts["profile"] == {MAKER: str(profile), "Other Two": str(tmp_path / "p_1.json")}
    assert [read_profile(path).camera for path in facts["profile"].values()] == [MAKER, "Other Two"]
    assert list(facts["misfit"]) == [MAKER, "Other Two"] and facts["misfit"][MAKER] != facts["misfit"]["Other Two"]
    assert [bracket["camera"] for bracket in facts["brackets"]] == [MAKER, "Other Two"]
    # A reading belongs to one camera.
    line = refused([*words[:-2], "--spot", "60,40,500"], capsys)
    assert f"spot is read in one bracket, and these are of several cameras ({MAKER}, Other Two)" in line
    one, two = (read_radiance(path).radiance for path in sorted(maps.iterdir()))
    ratio = one / two
    assert np.percentile(ratio / np.median(ratio), (5, 95)) == pytest.approx((1, 1), abs=0.06)
    assert (tmp_path / "r.html").read_text().count("<h2>The camera&#x27;s response</h2>") == 2


def test_dry_runs_write_nothing(shoot, tmp_path, capsys):
    words = ["merge", *shoot, "-o", str(tmp_path / "a.exr"), "--report", str(tmp_path / "r.html"), "--dry-run"]
    facts = reported([*words, "--save-profile", str(tmp_path / "p.json")], capsys)
    assert only(facts)["would_write"] == str(tmp_path / "a.exr") and only(facts)["written"] is None
    assert exposures(facts)["frame_4.png"] == (1 / 16, "EXIF")
    assert [frame["stops"] for frame in only(facts)["frames"]] == pytest.approx([0, 1, 2, 3, 4])
    assert printed(words, capsys).out.startswith(f"would write {tmp_path / 'a.exr'}\n  frame_0.png  1/256 s (EXIF)\n")
    assert list(tmp_path.iterdir()) == []


WRONG = {
    "--times 1/x": "1/x",
    "--times 1/2,0": "1/2,0",
    "--times 1,2": "2 times were given for 5",
    "--ignore 0,0": '"0,0" is not of the form R,G,B',
    "--ignore red": '"red" is not of the form',
    "--ignore 0,0,254.5": '"0,0,254.5" is not',
    "--ignore 0,0,inf": '"0,0,inf" is not',
    "--spot 1,2": '"1,2" is not of the form X,Y,CD',
    "--spot 1.5,2,100": '"1.5,2,100" is not',
    "--spot 1,2,nan": '"1,2,nan" is not',
    "--spot 900,2,100": "900",
    "--spot 20,20,-100": "spot: luminance is -100",
    "--spot 20,20,100,0": "spot: radius is 0",
    "--lux 1,2,3,4": '"1,2,3,4" is not of the form X,Y,WIDTH,HEIGHT,LUX',
    "--lux 1,2,3,4,100,18": "(write 0.18 for 18 %)",
    "--lux 1,2,3,4,100,0": "lux: reflectance is 0",
    "--lux 1,2,3,4,-1,0.18": "lux: illuminance is -1",
    "--luminaire 1,2,3,4,5": '"1,2,3,4,5" is not',
    "--luminaire 1,2,3,4,5,6,0": "luminaire: blue is 0",
    "--glare 1,2,3": '"1,2,3" is not',
    "--glare 1e30,2,3,4": "glare: the rectangle",
    "--glare 1,2,0,4": "1,2,0,4 is not a rectangle",
    "--white=-1,2,3,4": "-1,2,3,4 is not a rectangle",
    "--focal-length 0": "focal_length: 0 pixels",
    "--focal-length nan": "focal_length: nan",
    "--neutral -1": "neutral: -1 is not a pixel value",
    "--white 1,2,3,x": '"1,2,3,x" is not',
    "--white 170,2,30,4": "white: the rectangle 170, 2, 30×4 is not in a picture of 180×120",
    "--absolute --spot 1,2,3": "--absolute and --spot both",
    "--method magic": "magic",
    "--neutral white": "white",
    "--flat-field none.exr": "none.exr",
    "--profile none.json": "none.json",
    "--report r.txt": ".html",
    "--save-profile p.exr": ".json",
    "--bogus": "--bogus",
}  # fmt: skip


@pytest.mark.parametrize("words", WRONG)
def test_wrong_words_are_refused_in_one_line(words, shoot, profile, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    known = [] if "profile" in words else ["--profile", profile]
    assert WRONG[words] in refused(["merge", *shoot, "-o", "a.exr", *known, *words.split()], capsys)
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_saved_is_refused_before_any_work(shoot, profile, tmp_path, capsys):
    out = ["-o", str(tmp_path / "a.exr")]
    assert "neutral is 300" in refused(["merge", *shoot, *out, "--neutral", "300"], capsys)
    words = ["merge", *shoot, *out, "--profile", profile, "--save-profile"]
    assert "so there is none to save" in refused([*words, str(tmp_path / "p.json")], capsys)
    assert ".exr or .hdr" in refused(["merge", *shoot, "-o", str(tmp_path / "a.png")], capsys)
    refused(["merge", *shoot, "-o", str(tmp_path / "nowhere" / "a.exr")], capsys, 3)
    refused(["merge", *shoot, "-o", str(tmp_path / "a.exr"), "--report", str(tmp_path / "no" / "r.html")], capsys, 3)
    assert list(tmp_path.iterdir()) == []


def test_photographs_that_are_no_bracket_are_refused_in_one_line(shoot, profile, scene, tmp_path, capsys):
    out = str(tmp_path / "a.exr")
    assert "none.jpg: no such file" in refused(["merge", "none.jpg", "-o", out], capsys)
    assert "--out" in refused(["merge", shoot[0]], capsys)
    small = written(tmp_path, exposed(scene[:100], [Exposure(1 / 8, 1.0, 100.0)], prefix="small_"))
    line = refused(["merge", *shoot, *small, "-o", out, "--times", "1,2,4,8,16,32"], capsys)
    assert "small_0.png" in line and "180×100" in line
    photographs = exposed(scene, [Exposure(1.0), Exposure(4.0)])
    for name, value, remedy in (("white", 255, "shorter"), ("black", 0, "longer")):
        alike = [replace(p, pixels=np.full_like(p.pixels, value), name=f"{name}_{p.name}") for p in photographs]
        paths = written(tmp_path, alike)
        line = refused(["merge", *paths, "-o", out, "--profile", profile], capsys)
        assert remedy in line and f"{name}_frame_0.png" in line
        refused(["merge", *paths, "-o", out], capsys)
    torn = tmp_path / "torn.jpg"
    torn.write_bytes(Path(PLATE[0]).read_bytes()[:20000])
    assert "torn.jpg" in refused(["merge", str(torn), *PLATE[1:], "-o", out], capsys)
    assert not Path(out).exists()


def test_camera_raws_are_merged_photosite_by_photosite(scene, shoot, tmp_path, capsys):
    paths = raws_of(tmp_path / "raws", 0.25, 1.0, 4.0)
    out, report = tmp_path / "a.exr", tmp_path / "r.html"
    facts = reported(["merge", *paths, "-o", str(out), "--report", str(report)], capsys)
    found = exposures(facts)
    assert list(found) == ["raw_0.dng", "raw_1.dng", "raw_2.dng"] and {source for _, source in found.values()} == {
        "EXIF"
    }
    assert [seconds for seconds, _ in found.values()] == pytest.approx([0.25, 1, 4], rel=2e-3)
    assert facts["misfit"] == {} and report.exists()
    plain = read_radiance(out)
    assert plain.size == (240, 160) and plain.variance is not None
    # f/4 takes a sixteenth of the light: it is allowed for, unless times given by hand replace the whole exposure.
    words = ["merge", *paths, "-o", str(out), "--times", "1/4 1 4"]
    assert exposures(reported([*words, "--dry-run"], capsys)) == {
        "raw_0.dng": (0.25, "given"), "raw_1.dng": (1, "given"), "raw_2.dng": (4, "given"),
    }  # fmt: skip
    reported(words, capsys)
    assert np.median(plain.radiance / read_radiance(out).radiance) == pytest.approx(16, rel=1e-3)
    found = only(reported(["merge", *paths, "-o", str(out), "--absolute"], capsys))
    assert found["unit"] == "cd/m²" and found["scale"]["deviation"] == THIRD_OF_A_STOP
    reported(["merge", *paths, "-o", str(out), "--spot", "50,50,77"], capsys)
    seen = read_radiance(out).radiance @ LUMINANCE
    assert seen[46:55, 46:55].mean() == pytest.approx(77, rel=0.05)
    # Photographs beside them are left out, and that is reported.
    assert main(["merge", *paths, shoot[0], "-o", str(out)]) == 0
    assert "1 photograph beside 3 camera raws is left out" in capsys.readouterr().err


def test_camera_raws_that_cannot_be_merged_are_refused_in_one_line(tmp_path, capsys):
    paths = raws_of(tmp_path / "raws", 1.0, 4.0)
    words = ["merge", *paths, "-o", str(tmp_path / "a.exr")]
    listed = tmp_path / "times.txt"
    listed.write_text("1 4\n")
    for more in ([], ["--dry-run"]):
        assert "write them as --times" in refused([*words, "--times", str(listed), *more], capsys)
        assert "3 times were given for 2 photographs" in refused([*words, "--times", "1,2,3", *more], capsys)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["raws", "times.txt"]


def test_what_raws_showed_is_kept_in_a_profile_and_used_again(tmp_path, capsys):
    raws = raws_of(tmp_path / "raws", 0.25, 1.0, 4.0)
    wall(tmp_path / "wall.exr", (240, 160))
    out, again, profile = (str(tmp_path / name) for name in ("a.exr", "b.exr", "p.json"))
    words = ["merge", *raws, "-o", out, "--save-profile", profile, "--flat-field", str(tmp_path / "wall.exr")]
    reported([*words, "--white", "100,60,10,10", "--luminaire", "20,30,16,8,100,200,300"], capsys)
    kept = read_profile(profile)
    assert kept.camera == MAKER and kept.response is None and kept.sensor is not None and kept.sensor.noise is not None
    assert (kept.sensor.black, kept.sensor.white) == ((512.0,) * 4, 16383.0)
    assert 1 / kept.sensor.noise.shot == pytest.approx(20_000, rel=0.05) and kept.sensor.noise.iso == 100
    assert kept.vignetting is not None and kept.scale is not None and kept.balance != (1.0, 1.0, 1.0)
    assert printed(["merge", *raws, "-o", again, "--profile", profile], capsys).err == ""
    first, second = read_radiance(out), read_radiance(again)
    assert second.unit == "cd/m²"
    np.testing.assert_allclose(second.radiance, first.radiance, rtol=1e-5)
    assert first.variance is not None and second.variance is not None
    np.testing.assert_allclose(second.variance, first.variance, rtol=1e-4)
    assert "the camera's profile" in second.attributes["scale"]
    # A reading of the day counts more than the profile.
    reported(["merge", *raws, "-o", again, "--profile", profile, "--spot", "50,50,77"], capsys)
    seen = read_radiance(again).radiance @ LUMINANCE
    assert seen[46:55, 46:55].mean() == pytest.approx(77, rel=0.05)


def test_a_profile_of_another_kind_camera_or_sensor_is_reported(shoot, profile, tmp_path, capsys):
    raws = raws_of(tmp_path / "raws", 1.0, 4.0)
    out, kept = str(tmp_path / "a.exr"), tmp_path / "raw.json"
    sensor = Sensor((512.0, 512.0, 512.0, 512.0), 16383.0, 1.0, SensorNoise(5e-5, 2e-4))
    write_profile(kept, CameraProfile(MAKER, sensor=sensor))
    words = ["merge", *shoot, "-o", out, "--profile", str(kept)]
    assert "a profile of camera raws, and these are encoded photographs" in refused(words, capsys)
    words = ["merge", *raws, "-o", out, "--profile", profile]
    assert "a profile of encoded photographs, and these are camera raws" in refused(words, capsys)
    assert not Path(out).exists()
    words = ["merge", *raws, "-o", out, "--profile", str(kept)]
    assert "there is none to save" in refused([*words, "--save-profile", str(tmp_path / "p.json")], capsys)
    assert main([*words, "-q"]) == 0
    reported(["merge", *raws, "-o", out], capsys)
    line = refused(["develop", out, "-o", str(tmp_path / "a.png"), "--response", str(kept)], capsys)
    assert "raw.json: a profile of camera raws, which holds no response" in line
    write_profile(kept, CameraProfile(MAKER, sensor=replace(sensor, white=15000.0)))
    assert "its white 16383, those of the profile 512 and 15000" in printed(words, capsys).err
    write_profile(kept, CameraProfile("Another Two", sensor=sensor))
    assert "profile of Another Two" in refused([*words, "-q"], capsys, 4)


def test_brackets_of_raws_share_the_reading_of_the_first(tmp_path, capsys):
    raw_files(tmp_path / "raws" / "a", [LIGHT] * 3, (0.25, 1.0, 4.0))
    raw_files(tmp_path / "raws" / "b", [LIGHT[::-1].copy()] * 2, (0.5, 2.0))
    maps, folders = tmp_path / "maps", [str(tmp_path / "raws" / name) for name in "ab"]
    reported(["merge", *folders, "-o", str(maps), "--spot", "50,50,77", "--report", str(tmp_path / "r.html")], capsys)
    first, second = (read_radiance(maps / f"raw_0-raw_{last}.exr") for last in (2, 1))
    assert (first.radiance @ LUMINANCE)[46:55, 46:55].mean() == pytest.approx(77, rel=0.05)
    assert first.clipped is not None and second.clipped is not None
    both = (first.clipped == 0) & (second.clipped[::-1] == 0) & (LIGHT > np.median(LIGHT))
    assert np.median((second.radiance[::-1] / first.radiance)[both]) == pytest.approx(1, abs=2e-3)
    assert second.unit == "cd/m²" and (tmp_path / "r.html").exists()


def test_a_raw_bracket_that_moved_exits_with_4(tmp_path, capsys):
    paths = raw_files(tmp_path / "raws", [LIGHT, np.roll(LIGHT, 4, 1), LIGHT], (0.25, 1.0, 4.0))
    words = ["merge", *map(str, paths), "-o", str(tmp_path / "a.exr"), "-q"]
    # What -q keeps from being noted above is reported in the line itself.
    line = refused(words, capsys, 4)
    assert "doubts: " in line and line.count("raws are merged as they lie") >= 2 and "noted above" not in line
    assert (tmp_path / "a.exr").exists()
    said = printed([*words[:-1], "--accept"], capsys).err
    assert "pixels off the others, and raws are merged as they lie" in said


def test_a_profile_s_scale_holds_only_for_exposures_that_say_the_same(shoot, tmp_path, capsys):
    """Without f-number and ISO relative radiance is in another unit: the scale would be wrong by their factor."""
    profile = str(tmp_path / "p.json")
    times = ",".join(str(2.0**k) for k in range(len(shoot)))
    words = ["merge", *shoot, "-o", str(tmp_path / "a.exr"), "--spot", "60,40,500", "--save-profile", profile]
    reported(words, capsys)
    reused = ["merge", *shoot, "-o", str(tmp_path / "b.exr"), "--profile", profile]
    reported(reused, capsys)
    line = refused([*reused, "--times", times], capsys)
    assert "neither f-number nor ISO" in line and "profile" in line
    assert not (tmp_path / "c.exr").exists()


def test_several_brackets_are_reported_a_block_each(scene, tmp_path, profile, capsys):
    shifted = list(exposed(scene, EXPOSURES, prefix="a_"))
    shifted[1] = replace(shifted[1], pixels=np.roll(shifted[1].pixels, 3, axis=1))
    written(tmp_path / "shoot", shifted)
    written(tmp_path / "shoot", exposed(scene, EXPOSURES[1:], prefix="b_"))
    maps = tmp_path / "maps"
    words = ["merge", str(tmp_path / "shoot"), "-o", str(maps), "--profile", profile]
    captured = printed([*words, "--spot", "60,40,500", "--report", str(tmp_path / "r.html")], capsys)
    lines = captured.out.splitlines()
    titles = [line for line in lines if not line.startswith(" ")]
    assert titles == [str(maps / "a_0-a_4.exr"), str(maps / "b_0-b_3.exr"), "all together"]
    times = ", ".join(f"a_{i}.png 1/{256 >> i} s (EXIF)" for i in range(5))
    assert lines[1].split(maxsplit=1) == ["exposures", times]
    assert sum(line.split()[:2] == ["unit", "cd/m²"] for line in lines) == 2
    assert [line.split() for line in lines if line.split()[0] == "moved"] == [["moved", "1", "photograph"]]
    assert lines[-1].split() == ["report", str(tmp_path / "r.html")]
    # Where the reading was taken is reported.
    notes = [line for line in captured.err.splitlines() if "spot: read in" in line]
    assert len(notes) == 1 and "a_0.png" in notes[0] and "the first of 2 brackets" in notes[0]


def test_notes_and_doubts_are_in_the_json(shoot, tmp_path, profile, capsys):
    words = ["merge", *shoot, "-o", tmp_path / "a.exr", "--profile", profile, "--times", "1/256,1/128,1/48,1/32,1/16"]
    facts = reported([*words, "--ignore", "1,2,3"], capsys, 4)
    assert len(facts["doubts"]) == 1 and "frame_2.png" in facts["doubts"][0]
    assert any("no pixel of the colour 1,2,3" in line for line in facts["notes"])
    # Nothing was saturated, so nothing is reported at least.
    bracket = only(facts)
    assert bracket["black"] == int((read_radiance(tmp_path / "a.exr").clipped == 2).sum())
    assert bracket["saturated"] > 0 or bracket["luminance_at_least"] is None


def test_what_is_saturated_is_reported_in_numbers(merged, shoot):
    picture, facts = merged("--focal-length", "200", photographs=shoot[-2:])
    assert picture.clipped is not None
    lost = picture.clipped == SATURATED
    assert facts["saturated"] == lost.sum() > 0 and facts["pixels"] == 180 * 120
    light = picture.radiance @ LUMINANCE
    assert facts["luminance_at_least"] == pytest.approx(light[lost].max(), rel=1e-5)
    assert 0 < facts["solid_angle_sr"] < 1 and 0 < facts["light_share_at_least"] < 1
    assert len(facts["irradiance_at_least"]) == 3
    unknown = merged(photographs=shoot[-2:])[1]
    assert unknown["solid_angle_sr"] is None and unknown["irradiance_at_least"] is None
    assert unknown["luminance_at_least"] == facts["luminance_at_least"]


def test_lateral_colour_and_a_lamp_in_the_dark_are_asked_for():
    settings = settings_of(Steps(), Lens(lateral=(0.001, 0.0, -0.002, 0.0)), Readings())
    assert settings.lateral == LateralColour((0.001, 0.0), (-0.002, 0.0))
    assert settings_of(Steps(), Lens(lateral="auto"), Readings()).lateral is recover_lateral_colour
    lamp = settings_of(Steps(), Lens(glare_lamp=(3, 4, 5, 6), glare_map=Path("dark.exr")), Readings())
    assert lamp.glare == LampInTheDark(Path("dark.exr"), Rectangle(3, 4, 5, 6))


def test_the_lateral_colour_taken_out_is_said(merged, shoot, profile, tmp_path, capsys):
    picture, facts = merged("--lateral", "0.001,0,-0.002,0")
    assert facts["lateral_colour"] == picture.attributes["lateral_colour"]
    assert facts["lateral_colour"] == "red +0.001000 +0.000000 blue -0.002000 +0.000000"
    assert merged()[1]["lateral_colour"] is None
    words = ["merge", *shoot, "-o", str(tmp_path / "b.exr"), "--profile", profile, "--lateral", "0.001,0,-0.002,0"]
    assert main(words) in (0, 4) and "red +0.001000 +0.000000 blue -0.002000" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--glare-lamp", "1,2,3,4"], "--glare-lamp and --glare-map go together"),
        (["--glare-lamp", "1,2,3,4", "--glare-map", "a.exr", "--glare", "1,2,3,4"], "both give the glare; give one"),
        (["--lateral", "0.5,0,0,0"], "red is 0.5,0"),
        (["--lateral", "0.001,0"], '"0.001,0" is not of the form RED_A,RED_B,BLUE_A,BLUE_B; write it like auto or'),
        (["--lateral", "foo"], '"foo" is not of the form RED_A,RED_B,BLUE_A,BLUE_B; write it like auto or'),
        (["--scans", "a.json", "--each"], "--report are not for --scans"),
        (["--scans", "a.json", "--times", "1,2"], "--times is its one exposure; give one number"),
        (["--scans", "a.json", "b.json"], "1 scans and 2 profiles"),
    ],
)
def test_options_of_lens_and_scans_that_contradict_themselves_are_refused(tmp_path, capsys, options, words):
    write(tmp_path / "a.png", Photograph(np.zeros((8, 8, 3), np.uint8)))
    out = tmp_path / "out.exr"
    assert words in refused(["merge", tmp_path / "a.png", "-o", out, *options], capsys) and not out.exists()
