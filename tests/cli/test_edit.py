"""`relume edit`: edits in their order, light maps on the sphere, the way through a painter, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from command_line import printed, refused, reported
from relume.cli import main
from relume.image.files import read_photograph, read_radiance, write
from relume.image.files.metadata.icc_profile import screen_profile
from relume.image.photograph import Photograph
from relume.image.primaries import P3
from relume.image.radiance import BLACK, SATURATED, RadianceMap
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_environment


@pytest.fixture
def flat(tmp_path: Path) -> Path:
    """A map without a mapping, with all planes: 30×20, a lamp of 1000 in it."""
    field = np.random.default_rng(1).random((20, 30, 3)).astype(np.float32)
    field[4:7, 4:8] = 1000.0
    clipped = np.zeros((20, 30), np.uint8)
    clipped[4, 4] = SATURATED
    write(tmp_path / "flat.exr", RadianceMap(field, field * 0.01, clipped, "cd/m²", {"camera": "A"}))
    return tmp_path / "flat.exr"


@pytest.fixture
def light(tmp_path: Path) -> Path:
    """A lat-long map that says so, with a sun on its seam."""
    field = np.random.default_rng(2).random((16, 32, 3)).astype(np.float32)
    field[5, 0] = 1e4
    write(tmp_path / "light.exr", RadianceMap(field, attributes={"mapping": "latlong"}))
    return tmp_path / "light.exr"


def edited(capsys: pytest.CaptureFixture[str], source: Path, *words: str) -> tuple[RadianceMap, dict]:
    """Run the command; the map it wrote and what it report."""
    out = source.with_name("out.exr")
    report = reported(["edit", source, "-o", out, *words], capsys)
    return read_radiance(out), report


def test_a_crop_and_a_gain_keep_every_plane(flat, capsys):
    made, report = edited(capsys, flat, "--crop", "3,4,10,6", "--stops", "1")
    before = read_radiance(flat)
    assert np.array_equal(made.radiance, 2 * before.radiance[4:10, 3:13])
    assert made.variance is not None and made.clipped is not None and before.variance is not None
    assert np.array_equal(made.variance, 4 * before.variance[4:10, 3:13])
    assert made.clipped[0, 1] == SATURATED and made.clipped.sum() == SATURATED
    assert (made.unit, made.attributes["camera"]) == ("cd/m²", "A")
    assert report["edits"] == ["crop 3,4,10,6", "gain × 2"] and report["size"] == [10, 6]
    assert report["mean after"] == pytest.approx(made.radiance.mean((0, 1), dtype=np.float64), rel=1e-5)


def test_edits_are_done_in_their_order_whatever_that_of_the_words(flat, capsys):
    words = ["--blur", "1", "--gain", "3", "--add", "1", "--resize", "50%", "--crop", "0,10,20,10"]
    _, report = edited(capsys, flat, *words)
    assert [words.split()[0] for words in report["edits"]] == ["crop", "resize", "add", "gain", "soft"]
    made, _ = edited(capsys, flat, "--crop", "0,10,2,2", "--gain", "3", "--add", "1")
    assert made.radiance == pytest.approx(3 * (read_radiance(flat).radiance[10:12, :2] + 1), rel=1e-6)


@pytest.mark.parametrize(
    ("word", "size"), [("15", (15, 10)), ("60,10", (60, 10)), ("45x30", (45, 30)), ("50%", (15, 10))]
)
def test_sizes_in_all_spellings(flat, word, size, capsys):
    made, report = edited(capsys, flat, "--resize", word)
    assert made.size == size
    assert report["mean after"] == pytest.approx(report["mean before"], rel=1e-5)


def test_arithmetic_with_maps_and_constants(flat, capsys):
    before = read_radiance(flat).radiance
    for words, expected in (
        (["--add", "1,2,3"], before + np.array([1, 2, 3], np.float32)),
        (["--subtract", str(flat), "--subtract", "-2"], np.full_like(before, 2)),
        (["--multiply", "0.5", "--multiply", "4"], 2 * before),
        (["--divide", str(flat)], np.ones_like(before)),
        (["--min", "0.5"], np.minimum(before, np.float32(0.5))),
        (["--max", "0.5"], np.maximum(before, np.float32(0.5))),
        (["--average", str(flat), "--average", str(flat)], before),
    ):
        assert edited(capsys, flat, *words)[0].radiance == pytest.approx(expected, rel=1e-6), words
    assert edited(capsys, flat, "--divide", str(flat))[0].unit == "relative"


def test_constants_may_be_negative(flat, capsys):
    before = read_radiance(flat)
    made, _ = edited(capsys, flat, "--multiply", "-2", "--signed")
    assert np.array_equal(made.radiance, -2 * before.radiance)
    assert made.clipped is not None and made.clipped[4, 4] == BLACK and made.clipped.sum() == BLACK
    assert np.array_equal(edited(capsys, flat, "--divide", "-0.5", "--signed")[0].radiance, -2 * before.radiance)
    assert edited(capsys, flat, "--min", "-1", "--signed")[0].radiance.max() == -1
    assert np.array_equal(edited(capsys, flat, "--max", "-1,-1,-1")[0].radiance, before.radiance)


def test_negative_results_are_reported_or_kept(flat, capsys):
    out = flat.with_name("out.exr")
    assert "came out negative" in printed(["edit", str(flat), "-o", str(out), "--subtract", "0.5"], capsys).err
    assert read_radiance(out).radiance.min() == 0
    assert edited(capsys, flat, "--subtract", "0.5", "--signed")[0].radiance.min() < -0.4


def test_the_three_balances(flat, capsys):
    before = read_radiance(flat).radiance
    assert edited(capsys, flat, "--balance", "2,1,0.5")[0].radiance == pytest.approx(before * [2, 1, 0.5], rel=1e-6)
    made = edited(capsys, flat, "--grey", "20,12,3")[0].radiance
    rows, columns = np.mgrid[:20, :30]
    disc = (columns - 20) ** 2 + (rows - 12) ** 2 <= 9
    assert made[disc].mean(0) == pytest.approx(np.full(3, before[disc].mean(0) @ [0.2126, 0.7152, 0.0722]), rel=1e-5)
    gains = edited(capsys, flat, "--temperature", "3200")[0].radiance / before
    assert np.abs(gains / gains[0, 0] - 1).max() < 1e-5
    assert gains[0, 0, 2] > 2.5 > gains[0, 0, 1] > gains[0, 0, 0]


def test_light_maps_are_resized_and_blurred_on_the_sphere(light, capsys):
    made, report = edited(capsys, light, "--spherical-blur", "10")
    assert report["total after"] == pytest.approx(report["total before"], rel=1e-5)
    assert made.radiance[5, 31, 0] > 100 and made.attributes["mapping"] == "latlong"
    made, report = edited(capsys, light, "--spin", "45")
    assert made.radiance[5, 31, 0] == pytest.approx(2500, rel=1e-2)
    assert report["total after"] == pytest.approx(report["total before"], rel=1e-5)
    made, report = edited(capsys, light, "--resize", "16")
    assert made.size == (16, 8) and made.attributes["mapping"] == "latlong"
    assert report["total after"] == pytest.approx(report["total before"], rel=1e-3)
    made, report = edited(capsys, light, "--spherical-blur", "10", "--glow", "0.5")
    assert report["edits"] == ["soft blur 10° of 0.5 of the light"] and made.radiance[5, 0, 0] > 5000


def test_flat_edits_of_light_maps_are_refused_or_noted(light, capsys):
    start = ["edit", str(light), "-o", str(light.with_name("out.exr"))]
    assert "--spherical-blur" in refused([*start, "--blur", "2"], capsys)
    assert "--spin" in refused([*start, "--motion", "2"], capsys)
    assert "32 pixels wide" in refused([*start, "--resize", "20,16"], capsys)
    assert "no longer says its mapping" in printed([*start, "--crop", "0,0,8,8"], capsys).err
    assert "mapping" not in read_radiance(light.with_name("out.exr")).attributes


@pytest.mark.parametrize("program", ["blender", "pbrt"])
def test_a_map_for_another_program_stays_for_it_or_says_it_no_longer_is(program, light, tmp_path, capsys):
    there = tmp_path / "there.exr"
    assert main(["convert", str(light), "--for", program, "-o", str(there), "--size", "64"]) == 0
    ours, sun = as_environment(read_radiance(light)), normalised([0.0, np.cos(np.pi * 5.5 / 16), 0.9])
    for words in (["--resize", "50%"], ["--spherical-blur", "4"], ["--spin", "20"]):
        noted = printed(["edit", there, "-o", tmp_path / "out.exr", *words], capsys).err
        made = read_radiance(tmp_path / "out.exr")
        turned = words[0] == "--spin"
        assert (f"laid out for {program}; written in our frame" in noted) == turned, words
        assert made.attributes.get("orientation") == (None if turned else program)
        if turned:
            assert made.attributes["mapping"] == "latlong"
        # Wherever it is read the sun stands where it stood.
        seen = as_environment(made)
        assert seen.total() == pytest.approx(ours.total(), rel=2e-3), words
        assert seen.irradiance(sun) == pytest.approx(ours.irradiance(sun), rel=3e-2), words
        assert seen.irradiance(sun)[0] > 1.5 * seen.irradiance(-sun)[0]
    sized = as_environment(made)
    spun_here = tmp_path / "here.exr"
    assert main(["edit", str(light), "-o", str(spun_here), "--spin", "20"]) == 0
    expected = as_environment(read_radiance(spun_here))
    # The vertical it was spun about is ours: pixels of 11° apart, what grazes a surface moves by 2 % of the sun.
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    assert sized.irradiance(normals) == pytest.approx(expected.irradiance(normals), abs=0.02 * ours.irradiance(sun)[0])


def test_mirrored_faces_stay_so_or_say_they_no_longer_are(light, tmp_path, capsys):
    there, out = tmp_path / "there.exr", tmp_path / "out.exr"
    # The sun, on the seam at +Z, is brought to +X: mirroring in x would move it.
    words = ["--to", "strip", "--mirror", "x", "--rotate", "90", "--size", "32"]
    assert main(["convert", str(light), *words, "-o", str(there)]) == 0
    ours = as_environment(read_radiance(there)).irradiance(np.array([[1.0, 0, 0], [-1.0, 0, 0]]))
    assert ours[0, 0] > 10 * ours[1, 0]
    for words, mirror in ((["--resize", "50%"], "x"), (["--spherical-blur", "4"], "x"), (["--spin", "20"], None)):
        noted = printed(["edit", there, "-o", out, *words], capsys).err
        assert ("mirrored in x; written in our frame" in noted) == (mirror is None), words
        made = read_radiance(out)
        assert made.attributes.get("mirror") == mirror and made.attributes["mapping"] == "strip"
        after = as_environment(made).irradiance(np.array([[1.0, 0, 0], [-1.0, 0, 0]]))
        assert after[0] == pytest.approx(ours[0], rel=3e-2) and after[0, 0] > 10 * after[1, 0], words


def test_a_part_of_a_map_stores_nothing_that_is_no_longer_true(light, tmp_path, capsys):
    picture, out = read_radiance(light), tmp_path / "out.exr"
    looks = {"orientation": "blender", "mirror": "x", "view-field": "90", "view-rotation": "1 0 0 0 1 0 0 0 1"}
    write(tmp_path / "in.exr", replace(picture, attributes={**picture.attributes, **looks, "camera": "A"}))
    assert main(["edit", str(tmp_path / "in.exr"), "-o", str(out), "--crop", "0,0,8,8"]) == 0
    made = read_radiance(out)
    assert not {"mapping", *looks} & set(made.attributes) and made.attributes["camera"] == "A"
    del picture.attributes["mapping"]
    write(tmp_path / "view.exr", replace(picture, attributes={"view-field": "90"}))
    noted = printed(["edit", tmp_path / "view.exr", "-o", out, "--crop", "0,0,8,8"], capsys).err
    assert "no longer says where in its map" in noted


def test_a_light_map_from_elsewhere_is_given_its_mapping(tmp_path, capsys):
    source, out = tmp_path / "probe.exr", tmp_path / "out.exr"
    field = np.ones((16, 16, 3), np.float32)
    field[8, 8] = -1
    write(source, RadianceMap(field))
    start = ["edit", str(source), "-o", str(out), "--spherical-blur", "5"]
    assert "--max 0" in refused([*start, "--from", "angular"], capsys)
    assert "--from" in refused([*start, "--max", "0"], capsys)
    assert "latlong" in refused([*start, "--from", "round"], capsys)
    cut = ["edit", source, "-o", out.with_suffix(".png"), "--slice", "0"]
    assert "--from" in refused([*cut, "--from", "ball"], capsys)
    assert not out.exists()
    assert "total after" in printed([*start, "--from", "angular", "--max", "0"], capsys).out
    assert read_radiance(out).attributes["mapping"] == "angular"


def test_motion_and_soft_blur_of_a_flat_map(flat, capsys):
    for words in (["--motion", "8,90"], ["--blur", "3"], ["--blur", "3", "--glow", "0.4"]):
        made, report = edited(capsys, flat, *words)
        assert report["mean after"] == pytest.approx(report["mean before"], rel=1e-5), words
        assert made.radiance.max() < 990 and made.variance is not None
    upright = edited(capsys, flat, "--motion", "8,90")[0].radiance
    assert upright[1, 5].min() > 50 and upright[5, 1].max() < 10


@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
@pytest.mark.parametrize("words", [["--slice", "0"], ["--slice", "auto", "--bits", "16"]])
def test_a_slice_that_nobody_paints_on_is_the_same_file(light, suffix, words, tmp_path, capsys):
    source, out, cut = tmp_path / f"in{suffix}", tmp_path / f"out{suffix}", tmp_path / "slice.png"
    write(source, read_radiance(light))
    assert reported(["edit", str(source), *words, "-o", str(cut)], capsys)["written"] == [str(cut), f"{cut}.json"]
    assert "no pixel was changed" in printed(["edit", str(source), "--paint", str(cut), "-o", str(out)], capsys).err
    assert out.read_bytes() == source.read_bytes()


def test_a_part_of_a_map_is_painted_on_and_comes_back_to_its_place(flat, tmp_path, capsys):
    cut, out = tmp_path / "slice.png", tmp_path / "out.exr"
    report = reported(["edit", str(flat), "--slice", "0", "--crop", "3,4,10,6", "-o", str(cut)], capsys)
    assert report["crop"] == [3, 4, 10, 6]
    pixels = read_photograph(cut).pixels.copy()
    assert pixels.shape == (6, 10, 3)
    pixels[1, 2] = (188, 0, 0)
    write(cut, Photograph(pixels, "painted"))
    report = reported(["edit", str(flat), "--paint", str(cut), "-o", str(out)], capsys)
    before, after = read_radiance(flat), read_radiance(out)
    assert report["pixels changed"] == 1 and after.size == before.size
    assert after.radiance[5, 5] == pytest.approx([0.5029, 0, 0], abs=1e-4)
    same = np.ones(before.radiance.shape[:2], bool)
    same[5, 5] = False
    np.testing.assert_array_equal(after.radiance[same], before.radiance[same])
    assert after.variance is not None and np.isinf(after.variance[5, 5]).all()
    outside = refused(["edit", str(flat), "--slice", "0", "--crop", "0,0,31,5", "-o", str(cut)], capsys)
    assert "is not in a picture of 30×20" in outside
    assert "--slice and" in refused(
        ["edit", str(flat), "--slice", "0", "--crop", "0,0,3,5", "--resize", "50%", "-o", str(cut)], capsys
    )


def test_only_what_was_painted_comes_back(flat, tmp_path, capsys):
    cut, out = tmp_path / "slice.png", tmp_path / "out.exr"
    assert main(["edit", str(flat), "--slice", "0", "-o", str(cut), "-q"]) == 0
    description = json.loads((tmp_path / "slice.png.json").read_text())
    assert (description["stops"], description["white"], description["bits"]) == (0.0, 1.0, 8)
    pixels = read_photograph(cut).pixels.copy()
    pixels[10:12, 3:5] = (188, 0, 0)
    pixels[5, 5] = (188, 188, 188)
    write(tmp_path / "painted.png", Photograph(pixels))
    start = ["edit", str(flat), "--paint", str(tmp_path / "painted.png"), "-o", str(out)]
    assert "no painted.png.json beside it" in refused(start, capsys)
    noted = printed([*start, "--original", cut], capsys).err
    assert "1 changed pixels were brighter than the slice's white" in noted
    before, made = read_radiance(flat).radiance, read_radiance(out).radiance
    changed = np.zeros((20, 30), bool)
    changed[10:12, 3:5] = changed[5, 5] = True
    assert made[~changed].tobytes() == before[~changed].tobytes()
    assert made[10, 3] == pytest.approx([0.5028865, 0, 0], rel=1e-5)
    assert made[5, 5] == pytest.approx(np.full(3, 0.5028865), rel=1e-5)
    report = reported([*start, "--slice", "0", "--scale"], capsys)
    assert (report["pixels changed"], report["places changed"]) == (5, 2)
    assert read_radiance(out).radiance[5, 5] == pytest.approx(np.full(3, 502.8865), rel=1e-5)


def test_a_jpeg_changes_everything_a_little_and_is_doubtful(tmp_path, capsys):
    field = np.random.default_rng(3).random((64, 64, 3)).astype(np.float32)
    source, cut, out = tmp_path / "in.exr", tmp_path / "slice.png", tmp_path / "out.exr"
    write(source, RadianceMap(field))
    assert main(["edit", str(source), "--slice", "0", "-o", str(cut), "-q"]) == 0
    write(tmp_path / "painted.jpg", read_photograph(cut))
    start = ["edit", str(source), "--paint", str(tmp_path / "painted.jpg"), "--slice", "0", "-o", str(out), "-q"]
    line = refused(start, capsys, 4)
    assert "% of the pixels changed" in line and "--tolerance" in line and out.exists()
    assert main([*start, "--accept"]) == 0
    assert "separate places changed, as a JPEG leaves them" in printed([*start[:-1], "--tolerance", "8"], capsys).err
    # The same program's own original has the same changes, and takes them all away.
    assert main([*start, "--original", str(tmp_path / "painted.jpg")]) == 0
    assert out.read_bytes() == source.read_bytes()


def test_paintings_that_cannot_go_back_are_one_line(flat, light, tmp_path, capsys):
    cut, out = tmp_path / "slice.png", tmp_path / "out.exr"
    assert main(["edit", str(flat), "--slice", "0", "-o", str(cut), "-q"]) == 0
    pixels = read_photograph(cut).pixels

    def line(picture: Image.Image, profile: bytes | None = None) -> str:
        picture.save(tmp_path / "p.png", icc_profile=profile)
        return refused(["edit", str(flat), "--paint", str(tmp_path / "p.png"), "--slice", "0", "-o", str(out)], capsys)

    assert "29×20 pixels and the map 30×20" in line(Image.fromarray(pixels[:, :-1].copy()))
    alpha = np.dstack([pixels, np.full((20, 30, 1), 255, np.uint8)])
    alpha[0, 0, 3] = 0
    assert "transparent" in line(Image.fromarray(alpha))
    alpha[0, 0, 3] = 100
    assert "flatten it" in line(Image.fromarray(alpha))
    assert "in Display P3; save it in sRGB" in line(Image.fromarray(pixels), screen_profile(P3, "Display P3"))
    assert "not the map that" in refused(["edit", str(light), "--paint", str(cut), "-o", str(out)], capsys)
    (tmp_path / "slice.png.json").write_text("{}")
    assert "not the description" in refused(["edit", str(flat), "--paint", str(cut), "-o", str(out)], capsys)
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "part"),
    [
        ([], "nothing to do"),
        (["--crop", "0,0,31,5"], "crop: the rectangle 0,0,31,5 is not in a picture of 30×20"),
        (["--crop", "0,0,5"], "--crop"),
        (["--resize", "0"], "resize: the size is 0×0"),
        (["--resize", "wide"], "--resize"),
        (["--add", "1", "--multiply", "2"], "--add and --multiply"),
        (["--average", "1"], "takes maps"),
        (["--add", "nobody.exr"], "nobody.exr: no such file"),
        (["--add", "1,2"], "1,2: no such file"),
        (["--divide", "0"], "other than 0"),
        (["--multiply", "FLAT"], "no radiance"),
        (["--signed"], "--subtract"),
        (["--gain", "0"], "gain is 0"),
        (["--gain", "2", "--stops", "1"], "--stops and --gain"),
        (["--stops", "1000"], "stops are 1000"),
        (["--grey", "20,12", "--temperature", "5000"], "--grey and --temperature"),
        (["--grey", "4,4"], "grey: "),
        (["--balance", "1,0,1"], "three positive numbers"),
        (["--temperature", "500"], "2000 to 25000 K"),
        (["--blur", "-1"], "blur: sigma"),
        (["--motion", "500"], "motion: the length"),
        (["--spherical-blur", "5"], "does not say its mapping"),
        (["--glow", "0.5"], "--glow"),
        (["--slice", "0", "--gain", "2"], "--slice and gain"),
        (["--slice", "bright"], "--slice"),
        (["--scale"], "--paint"),
        (["--bits", "16", "--gain", "2"], "--bits"),
    ],
)
def test_wrong_words_are_one_line_and_write_nothing(flat, words, part, capsys):
    out = flat.with_name("out.png" if "--slice" in words and "--gain" not in words else "out.exr")
    words = [str(flat) if word == "FLAT" else word for word in words]
    assert part in refused(["edit", str(flat), "-o", str(out), *words], capsys)
    assert not out.exists()


def test_wrong_files_are_refused(flat, tmp_path, capsys):
    out = str(tmp_path / "out.exr")
    write(tmp_path / "photo.png", Photograph(np.zeros((2, 2, 3), np.uint8)))
    assert "a photograph where" in refused(["edit", str(tmp_path / "photo.png"), "-o", out, "--gain", "2"], capsys)
    assert "no such file" in refused(["edit", str(tmp_path / "none.exr"), "-o", out, "--gain", "2"], capsys)
    assert ".exr or .hdr" in refused(["edit", str(flat), "-o", str(tmp_path / "a.png"), "--gain", "2"], capsys)
    assert ".png" in refused(["edit", str(flat), "-o", out, "--slice", "0"], capsys)
    refused(["edit", str(flat), "-o", str(tmp_path / "nowhere" / "a.exr"), "--gain", "2"], capsys, 3)


def test_dry_runs_say_what_would_be_done(flat, tmp_path, capsys):
    there = sorted(tmp_path.iterdir())
    for words, out, part in (
        (["--crop", "0,0,5,5", "--blur", "2"], "a.exr", "crop 0,0,5,5, soft blur 2 pixels"),
        (["--slice", "auto"], "a.png", "a.png.json"),
        (["--paint", str(flat), "--slice", "1"], "a.exr", "replace"),
    ):
        text = printed(["edit", str(flat), "-o", str(tmp_path / out), "--dry-run", *words], capsys).out
        assert "would write" in text and part in text
    assert sorted(tmp_path.iterdir()) == there
