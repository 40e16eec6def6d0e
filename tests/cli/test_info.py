"""`relume info`: what a person reads and what a machine reads, of good files and bad ones."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from command_line import printed, refused, reported
from relume.capture.exposure.advice import advise_brackets
from relume.cli.arguments import ReadingOptions
from relume.cli.info import lines_of, number
from relume.image.files import write
from relume.image.files.description import describe
from relume.image.files.gain_map import gain_map
from relume.image.files.read_options import ReadOptions
from relume.image.files.textures.ktx2 import write_cube
from relume.image.photograph import Exposure, Photograph, Settings
from relume.image.radiance import RadianceMap
from relume.report.merge_facts import advice_summary
from relume.sphere.map_store import MapStore
from relume.sphere.mappings.discs import Angular
from relume.sphere.mappings.mapping import LatLong, Mapping
from relume.sphere.mappings.orientation import orientation_named


def lit(path: Path, layout: Mapping, direction: tuple[float, float, float], **attributes: str) -> str:
    """A file with a lamp of 3 × 3 pixels in one direction of a map of 64 rows, and dim light elsewhere."""
    rows, columns = layout.shape(64)
    pixels = np.full((rows, columns, 3), 0.5, np.float32)
    unit = np.array(direction) / np.linalg.norm(direction)
    x, y = (layout.image_points(unit) * [columns, rows]).astype(int)
    pixels[y - 1 : y + 2, x - 1 : x + 2] = 2
    pixels[y, x] = 4
    write(path, RadianceMap(pixels, attributes=attributes))
    return str(path)


def facts_in(words: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    """The lines of one file: label → text."""
    lines = printed(["info", *words], capsys).out.splitlines()[1:]
    pairs = [line.strip().partition("  ") for line in lines]
    return {label: text.strip() for label, _, text in pairs}


def test_a_store_of_maps_says_how_many_and_what_they_hold(tmp_path, capsys):
    pytest.importorskip("zarr", reason="the extra lightstage is not installed")
    store = MapStore.begun(tmp_path / "a.zarr", 3, 8, variance=True, attributes={"rate": "23.976"})
    for k in range(3):
        store.write(k, RadianceMap(np.full((8, 16, 3), 0.5, np.float32)))
    assert facts_in([str(tmp_path / "a.zarr")], capsys) == {
        "format": "zarr: a store of maps, float16",
        "holds": "light that changes: radiance without an absolute unit",
        "size": "16 × 8", "frames": "3, 23.976 a second", "variance": "of every map",
    }  # fmt: skip
    found = json.loads(printed(["info", str(tmp_path / "a.zarr"), "--json"], capsys).out)
    assert (found["kind"], found["frames"], found["rate"], found["variance"]) == ("maps", 3, 23.976, True)
    (tmp_path / "a.zarr" / "radiance" / "1.0.0.0").unlink()
    assert "map 2 of 3 is missing" in refused(["info", str(tmp_path / "a.zarr")], capsys)
    bare = MapStore.begun(tmp_path / "b.zarr", 1, 8, np.float32, unit="cd/m²")
    bare.write(0, RadianceMap(np.full((8, 16, 3), 0.5, np.float32)))
    facts = facts_in([str(tmp_path / "b.zarr")], capsys)
    assert (facts["frames"], facts["variance"]) == ("1", "not kept") and facts["holds"].endswith("in cd/m²")


def test_a_map_is_reported_in_the_words_of_a_photographer(tmp_path, capsys):
    pixels = np.full((50, 100, 3), 0.25, np.float32)
    pixels[20:22, 70:72] = 4096
    pixels[20, 70] = 8192
    pixels[49, 99, 1] = -1
    clipped = np.zeros((50, 100), np.uint8)
    clipped[20:22, 70:72] = 1
    attributes = {"exposure_time": "0.004", "f_number": "8", "iso": "100", "camera": "Canon EOS 5D", "lens": "EF24mm"}
    attributes |= {"focal_length": "24", "taken": "2026:11:21 12:00:00", "comments": "a\nb\x1b[31m"}
    write(tmp_path / "a.exr", RadianceMap(pixels, None, clipped, "cd/m²", attributes))
    lines = printed(["info", str(tmp_path / "a.exr")], capsys).out.splitlines()
    assert lines[0] == str(tmp_path / "a.exr")
    assert lines[1:] == [
        "  format         OpenEXR: float, ZIP, 2 parts",
        "  size           100 × 50",
        "  holds          radiance in cd/m², Rec. 709",
        "  exposure       1/250 s, f/8, ISO 100",
        "  camera         Canon EOS 5D, EF24mm",
        "  taken          2026-11-21 12:00:00",
        "  dynamic range  0.0 stops (1 : 1) from percentile 0.1 to 99.9 of the lit pixels; 15.0 stops (32,800 : 1) "
        "in all",
        "  luminance      0.25 to 8,192 cd/m² of the lit pixels, mean 4.35 of all; 0.02 % are not above 0",
        "  percentiles    1 % 0.25 · 5 % 0.25 · 25 % 0.25 · 50 % 0.25 · 75 % 0.25 · 95 % 0.25 · 99 % 0.25 · "
        "99.9 % 0.25",
        "  brightest      8,192 cd/m² at x 70, y 20: 74° to the right, 16° up if lat-long; R 8,192 G 8,192 B 8,192; "
        "mean of 3 × 3 pixels 2,276",
        "  marked pixels  4 saturated in every photograph",
        "  odd values     1 below 0, the lowest -1",
        "  attributes     1",
        "    comments     a b [31m",
        "  part 1         radiance: B, G, R (float32)",
        "  part 2         clipped: Y (float32)",
    ]


def test_a_photograph_is_reported_with_how_it_was_made(tmp_path, capsys):
    pixels = np.full((10, 20, 3), 100, np.uint8)
    pixels[:5, :, 0], pixels[0, 0, 2] = 255, 0
    taken = datetime(2026, 11, 21, 12, 30, 0, 250_000)
    settings = Settings(taken, automatic_white=True, bias=-0.5, lens="EF50mm f/1.4", focal_length=50)
    photograph = Photograph(pixels, exposure=Exposure(1 / 60, 5.6, 200), camera="Canon 5D", settings=settings)
    write(tmp_path / "a.png", photograph)
    assert facts_in([str(tmp_path / "a.png")], capsys) == {
        "format": "PNG: 8 bits, RGB",
        "size": "20 × 10",
        "holds": "an encoded photograph",
        "exposure": "1/60 s, f/5.6, ISO 200, compensated by -0.5 stops",
        "white balance": "automatic",
        "camera": "Canon 5D, EF50mm f/1.4",
        "taken": "2026-11-21 12:30:00.25",
        "codes": "0 to 255, mean 125.7",
        "percentiles": "1 % 100 · 5 % 100 · 25 % 100 · 50 % 100 · 75 % 100 · 95 % 255 · 99 % 255 · 99.9 % 255",
        "at 0": "R 0 % · G 0 % · B 0.5 %",
        "at 255": "R 50 % · G 0 % · B 0 %",
    }
    write(tmp_path / "b.png", Photograph(pixels, settings=Settings(automatic_white=False, bias=1)))
    lines = facts_in([str(tmp_path / "b.png")], capsys)
    assert (lines["exposure"], lines["white balance"]) == ("the file stores none", "set by hand")


def test_a_camera_raw_and_a_cube_are_reported(shared, tmp_path, capsys):
    lines = facts_in([str(shared / "data" / "formats" / "raw" / "colorchart.dng")], capsys)
    assert (lines["format"], lines["black"], lines["white"]) == ("camera raw: Bayer RGGB", "2056", "15000")
    assert lines["at white"] == "none" and lines["exposure"] == "the file stores none"
    write_cube(tmp_path / "a.ktx2", [np.full((6, side, side, 3), 0.5, np.float32) for side in (4, 2, 1)])
    lines = facts_in([str(tmp_path / "a.ktx2")], capsys)
    assert lines["format"] == "KTX 2.0: half"
    assert lines["size"] == "six faces of 4 × 4; 3 levels, down to 1 × 1"
    assert lines["luminance"] == "0.5 to 0.5, mean 0.5" and "percentiles" not in lines


def test_a_gain_map_is_shown_without_its_light(tmp_path, capsys):
    ramp = np.geomspace(0.1, 3, 64 * 64, dtype=np.float32).reshape(64, 64, 1)
    gain_map.write_rendition(tmp_path / "a.jpg", np.repeat(ramp, 3, axis=-1), np.full((64, 64, 3), 200, np.uint8))
    captured = printed(["info", str(tmp_path / "a.jpg")], capsys)
    line = next(line for line in captured.out.splitlines() if line.startswith("  gain map "))
    assert re.fullmatch(r"  gain map +\d\.\d stops, .+", line) and "made for displays" in captured.err


@pytest.mark.parametrize(
    ("direction", "azimuth", "elevation", "words"),
    [
        ((0, 0, -1), 0, 0, "ahead, level"),
        ((1, 1, -1), 45, 35, "° to the right, 3"),
        ((-1, 0, 0), -90, 0, "° to the left, "),
        ((-1, -1, 0), -90, -45, "° down"),
    ],
)
@pytest.mark.parametrize("mapping", [LatLong(), Angular()])
def test_the_brightest_spot_has_a_direction_where_the_map_states_its_mapping(
    tmp_path, capsys, mapping, direction, azimuth, elevation, words
):
    path = lit(tmp_path / "a.exr", mapping, direction, mapping=mapping.name)
    place = reported(["info", path], capsys)["brightest"]["direction"]
    pixel = 360 / 64
    assert place["azimuth"] == pytest.approx(azimuth, abs=pixel)
    assert place["elevation"] == pytest.approx(elevation, abs=pixel)
    assert (place["mapping"], place["assumed"]) == (mapping.name, False)
    text = facts_in([path], capsys)["brightest"]
    assert "lat-long" not in text
    assert words in text or azimuth == elevation == 0  # no pixel's middle lies straight ahead


def test_a_map_laid_out_for_another_program_is_reported_in_our_frame(tmp_path, capsys):
    blender = orientation_named("blender")
    u, v = blender.image_points(np.array([0.6, 0.0, -0.8]))
    direction = LatLong().directions(np.array([u, v]))
    path = lit(tmp_path / "a.exr", LatLong(), tuple(direction), mapping="latlong", orientation="blender")
    place = reported(["info", path], capsys)["brightest"]["direction"]
    assert place["azimuth"] == pytest.approx(np.degrees(np.arctan2(0.6, 0.8)), abs=3)
    assert place["elevation"] == pytest.approx(0, abs=3)


def test_a_direction_is_reported_as_an_assumption_or_not_at_all(tmp_path, capsys):
    def direction(name, layout, **attributes):
        path = lit(tmp_path / name, layout, (1, 0, 0), **attributes)
        return reported(["info", path], capsys)["brightest"]["direction"]

    assert direction("a.exr", LatLong())["assumed"]
    assert direction("b.exr", Angular()) is None
    assert direction("c.exr", LatLong(), mapping="somebody's") is None
    assert direction("d.exr", Angular(), mapping="latlong") is None


def test_a_lone_pixel_is_reported_beside_the_lamp(tmp_path, capsys):
    pixels = np.full((30, 31, 3), 0.5, np.float32)
    pixels[4:6, 4:6], pixels[20, 9] = 8, 1000
    write(tmp_path / "a.exr", RadianceMap(pixels))
    lines = facts_in([str(tmp_path / "a.exr")], capsys)
    assert lines["brightest"].startswith("8 at x ")
    assert lines["lone pixel"].startswith("1,000 at x 9, y 20") and "firefly" in lines["lone pixel"]


def test_full_halves_are_named(tmp_path, capsys):
    from relume.image.files.encodings import OpenEXR

    pixels = np.ones((4, 5, 3), np.float32)
    pixels[1:3, 1:3] = 65504
    write(tmp_path / "half.exr", RadianceMap(pixels), OpenEXR(half=True))
    assert facts_in([str(tmp_path / "half.exr")], capsys)["at maximum"] == (
        "4 pixels at 65,504, the most that half floats hold"
    )
    write(tmp_path / "float.exr", RadianceMap(pixels))
    assert facts_in([str(tmp_path / "float.exr")], capsys)["at maximum"] == "4 pixels at 65,500"


def test_a_black_map_has_no_range(tmp_path, capsys):
    write(tmp_path / "a.exr", RadianceMap(np.zeros((4, 5, 3), np.float32)))
    lines = facts_in([str(tmp_path / "a.exr")], capsys)
    assert lines["luminance"] == "no pixel is brighter than 0" and "dynamic range" not in lines


def test_of_several_files_the_good_ones_are_reported(tmp_path, capsys):
    good = [lit(tmp_path / name, LatLong(), (1, 0, 0)) for name in ("a.exr", "b.pfm")]
    (tmp_path / "bad.exr").write_bytes(b"v/1\x01")
    words = ["info", str(tmp_path / "bad.exr"), good[0], str(tmp_path / "none.hdr"), good[1]]
    captured = printed([*words, "--json"], capsys, 2)
    assert [json.loads(line)["file"] for line in captured.out.splitlines()] == good
    errors = captured.err.splitlines()
    assert len(errors) == 2 and "bad.exr" in errors[0] and "none.hdr: no such file" in errors[1]
    captured = printed(words, capsys, 2)
    assert captured.out.count("dynamic range") == 2 and len(captured.err.splitlines()) == 2


def test_limits_and_raw_floats_are_reported_on_the_command_line(tmp_path, capsys):
    path = tmp_path / "a.float"
    path.write_bytes(np.arange(1, 20 * 50 * 3 + 1, dtype=">f4").tobytes())
    line = refused(["info", str(path)], capsys)
    assert "a.float" in line
    facts = reported(["info", str(path), "--float-size", "50x20", "--float-order", "big"], capsys)
    assert (facts["size"], facts["minimum"], facts["maximum"]) == ([50, 20], 1, 3000)
    small = ["info", str(path), "--float-size", "50x20", "--largest", "0.0009"]
    assert "900 pixels" in refused(small, capsys)
    assert "--float-size" in refused(["info", str(path), "--float-size", "50"], capsys)
    assert "--largest" in refused(["info", str(path), "--largest", "-1"], capsys)


def test_a_file_cut_short_is_salvaged_when_asked(tmp_path, capsys):
    path = tmp_path / "a.hdr"
    write(path, RadianceMap(np.random.default_rng(4).uniform(1, 2, (50, 20, 3)).astype(np.float32)))
    path.write_bytes(path.read_bytes()[:-300])
    refused(["info", str(path)], capsys)
    captured = printed(["info", str(path), "--salvage"], capsys)
    assert "outside all" in captured.out and captured.err.startswith("relume: note: ")


def test_options_become_the_reading_they_name():
    assert ReadingOptions().reading() == ReadOptions()
    assert ReadingOptions(largest=1).reading() == ReadOptions(pixels=10**6)
    raised = ReadingOptions(largest=1000).reading()
    assert raised.pixels == raised.side == 10**9 and raised.decoded >= 12 * 10**9
    assert ReadingOptions(salvage=True, mantissa_middle=True).reading() == ReadOptions(
        salvage=True, mantissa_middle=True
    )
    assert ReadingOptions(float_size=(640, 480)).reading().float_size == (640, 480)
    for wrong in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="--largest"):
            ReadingOptions(largest=wrong).reading()


@pytest.mark.parametrize("text", ["640", "640x", "0x5", "axb", "1x2x3", "-1x-1"])
def test_a_size_that_is_none_is_refused(tmp_path, capsys, text):
    assert "--float-size" in refused(["info", str(tmp_path / "a.float"), "--float-size", text], capsys)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (0.012345, "0.0123"),
        (1, "1"),
        (254.6, "255"),
        (4095.9998, "4,096"),
        (12345.6, "12,350"),
        (999_999, "1,000,000"),
        (1.234e6, "1.23e6"),
        (3.2e-11, "3.2e-11"),
        (-7.5, "-7.5"),
    ],
)
def test_numbers_have_three_digits(value: float, text: str):
    assert number(value) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        ("0.004", "1/250 s"),
        ("1/60", "1/60 s"),
        ("0.3", "0.3 s"),
        ("2.5", "2.5 s"),
        ("0.00777", "1/129 s"),
        ("x", "x s"),
    ],
)
def test_exposure_times_are_reported_as_cameras_show_them(tmp_path, seconds, text):
    write(tmp_path / "a.exr", RadianceMap(np.ones((2, 2, 3), np.float32)))
    facts = describe(tmp_path / "a.exr")
    assert lines_of(facts | {"attributes": {"exposure_time": seconds}})["exposure"] == text


def test_attributes_are_shortened_unless_asked_for_whole(tmp_path, capsys):
    write(tmp_path / "a.exr", RadianceMap(np.ones((2, 2, 3), np.float32), attributes={"provenance": "ab" * 200}))
    assert facts_in([str(tmp_path / "a.exr")], capsys)["provenance"] == "ab" * 50 + " … (400 characters; -v shows all)"
    assert facts_in([str(tmp_path / "a.exr"), "-v"], capsys)["provenance"] == "ab" * 200


def test_a_mesh_is_described_by_its_size_and_what_it_is_made_of(capsys):
    cube = Path(__file__).parents[2] / "examples" / "room" / "objects" / "cube_gold.glb"
    said = printed(["info", cube], capsys).out
    facts = reported(["info", cube], capsys)
    assert facts["kind"] == "mesh" and facts["format"] == "glb" and facts["meshes"] == 1
    assert facts["triangles"] >= 12 and facts["extent"] == pytest.approx(np.subtract(facts["high"], facts["low"]))
    assert facts["materials"] == ["gold_rough"] and facts["low"][1] == pytest.approx(0, abs=1e-6)
    assert "0.109 × 0.08 × 0.109 m, if its unit is the metre" in said and "12, 24 vertices" in said
    assert "no such mesh" not in refused(["info", cube.with_name("none.glb")], capsys)


def test_one_photograph_that_is_too_short_is_one():
    photograph = Photograph(np.full((4, 4, 3), 255, np.uint8), exposure=Exposure(1 / 8000, 8.0, 100.0))
    advice = advise_brackets(photograph)
    for count, words in ((1, "1 is shorter than 1/8000 s: use a neutral filter for it"), (2, "2 are shorter than")):
        short = replace(advice, exposures=(Exposure(1 / 16000, 8.0, 100.0),) * count)
        assert str(advice_summary(short)["filter"]).startswith(words)


def test_brackets_are_advised_for_a_photograph(tmp_path, capsys):
    pixels = np.full((20, 40, 3), 120, np.uint8)
    pixels[:, 30:] = 255
    pixels[:, :10] = 20
    write(tmp_path / "a.png", Photograph(pixels, exposure=Exposure(1 / 60, 8.0, 100.0)))
    text = printed(["info", tmp_path / "a.png", "--brackets"], capsys).out
    assert "25 % lighter than 240 of 255" in text and "7.0 stops, so 2 photographs at least" in text
    assert "1/8000 s" in text and "while any of it is white" in text
    told = reported(["info", tmp_path / "a.png", "--brackets", "--brightest", "1.6e9"], capsys)["brackets"]
    assert told["fewest"] == 4 and len(told["stops"]) == len(told["exposures"]) > 3
    words = refused(["info", tmp_path / "a.png", "--brightest", "100"], capsys)
    assert "--brightest is for --brackets; give that too" in words
