"""What `describe` says of files of every kind: plain values, the right ones, under names that stay."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.image.files import write
from relume.image.files.description import describe
from relume.image.files.encodings import LogLuv, OpenEXR
from relume.image.files.gain_map import gain_map
from relume.image.files.read_options import ReadOptions
from relume.image.files.textures.ktx2 import write_cube
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import RadianceMap


def described(path: Path, options: ReadOptions = ReadOptions()) -> dict:
    """The description, after it went through JSON without NaN."""
    return json.loads(json.dumps(describe(path, options), allow_nan=False))


def window() -> RadianceMap:
    """A grey wall with a bright window, marks, and a value of each odd kind."""
    pixels = np.full((30, 40, 3), 0.25, np.float32)
    pixels[10:13, 20:23] = 64
    pixels[29, 0] = np.nan
    pixels[29, 1, 0] = np.inf
    pixels[29, 2, 2] = -0.125
    clipped = np.zeros((30, 40), np.uint8)
    clipped[10:13, 20:23], clipped[0, :5], clipped[29, :3] = 1, 2, 3
    return RadianceMap(pixels, None, clipped, "cd/m²", {"exposure_time": "0.5", "mapping": "angular"})


def test_a_radiance_map_is_reported_with_its_range_spot_marks_and_faults(tmp_path: Path):
    write(tmp_path / "a.exr", window())
    facts = described(tmp_path / "a.exr")
    assert (facts["file"], facts["format"], facts["kind"]) == (str(tmp_path / "a.exr"), "EXR", "radiance map")
    assert (facts["size"], facts["megapixels"], facts["unit"]) == ([40, 30], 0.001, "cd/m²")
    assert "float" in facts["subtype"] and "ZIP" in facts["subtype"]
    assert (facts["primaries"], facts["primaries_of_file"]) == ("Rec. 709", None)
    assert facts["attributes"] == {"exposure_time": "0.5", "mapping": "angular"}
    assert (facts["minimum"], facts["maximum"], facts["at_maximum"]) == (-0.125, 64, 9)
    assert (facts["nan"], facts["infinite"], facts["negative"]) == (3, 1, 1)
    assert facts["clipped"] == {"saturated": 9, "black": 5, "outside": 3}
    assert (facts["brightest"]["x"], facts["brightest"]["y"], facts["lone"]) == (21, 11, None)
    assert facts["brightest"]["radiance"] == [64, 64, 64]
    assert facts["brightest"]["luminance"] == facts["brightest"]["around"] == pytest.approx(64)
    light = facts["luminance"]
    assert light["lit"] == 30 * 40 - 2
    assert (light["robust_minimum"], light["robust_maximum"]) == pytest.approx((0.25, 64), rel=0.1)
    assert list(light["percentiles"]) == ["1", "5", "25", "50", "75", "95", "99", "99.9"]
    assert light["percentiles"]["50"] == pytest.approx(0.25)
    span = facts["dynamic_range"]
    assert span["stops"] == pytest.approx(math.log2(64 / light["minimum"]))
    assert span["ratio"] == pytest.approx(64 / light["minimum"])
    assert span["robust_stops"] == pytest.approx(math.log2(span["robust_ratio"]))
    assert [(part["name"], part["channels"], part["dtype"], part["size"]) for part in facts["parts"]] == [
        ("radiance", ["B", "G", "R"], "float32", [40, 30]),
        ("clipped", ["Y"], "float32", [40, 30]),
    ]


def test_halves_are_reported_by_what_is_stored(tmp_path: Path):
    write(tmp_path / "a.exr", RadianceMap(np.full((4, 5, 3), 2, np.float32)), OpenEXR(half=True))
    facts = described(tmp_path / "a.exr")
    assert (facts["dtype"], facts["parts"][0]["dtype"]) == ("float16", "float16")
    assert facts["subtype"].startswith("half")
    assert facts["clipped"] is None and not facts["has_variance"]


@pytest.mark.parametrize(
    ("name", "kind"),
    [("a.hdr", "HDR"), ("a.pfm", "PFM"), ("a.float", "raw float"), ("a.tif", "float TIFF"), ("b.tif", "LogLuv TIFF")],
)
@pytest.mark.filterwarnings("ignore:.*does not keep")
def test_every_format_of_maps_is_reported_alike(tmp_path: Path, name: str, kind: str):
    pixels = np.ones((16, 16, 3), np.float32)
    pixels[3, 5] = 8
    write(tmp_path / name, RadianceMap(pixels), LogLuv() if name == "b.tif" else None)
    facts = described(tmp_path / name)
    assert (facts["format"], facts["kind"], facts["size"]) == (kind, "radiance map", [16, 16])
    assert facts["subtype"] and facts["channels"] == ["R", "G", "B"]
    assert (facts["brightest"]["x"], facts["brightest"]["y"]) == (5, 3)
    assert facts["dynamic_range"]["stops"] == pytest.approx(3, abs=0.02)


def test_converted_primaries_are_reported_as_the_file_has_them(tmp_path: Path):
    wide = "0.708 0.292 0.17 0.797 0.131 0.046 0.3127 0.329"
    head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nPRIMARIES={wide}\n\n-Y 1 +X 2\n".encode()
    (tmp_path / "wide.hdr").write_bytes(head + bytes((128, 128, 128, 129)) * 2)
    with pytest.warns(UserWarning, match=r"converted to Rec\. 709"):
        facts = described(tmp_path / "wide.hdr")
    assert facts["primaries"] == "Rec. 709" and facts["primaries_of_file"] == wide
    assert facts["maximum"] == pytest.approx(1, rel=1e-4)


def test_a_photograph_is_reported_with_its_exposure_and_its_clipping(tmp_path: Path):
    pixels = np.full((20, 30, 3), 100, np.uint8)
    pixels[:5, :, 0], pixels[:2, :, 2] = 255, 0
    write(tmp_path / "a.png", Photograph(pixels, exposure=Exposure(0.004, 8, 200), camera="Virtual 1"))
    facts = described(tmp_path / "a.png")
    assert (facts["kind"], facts["format"], facts["size"], facts["unit"]) == ("photograph", "PNG", [30, 20], "encoded")
    assert facts["exposure"] == {"seconds": 0.004, "f_number": 8, "iso": 200, "source": "EXIF"}
    assert (facts["camera"], facts["settings"]["taken"], facts["gain_map"]) == ("Virtual 1", None, None)
    assert (facts["at_black"], facts["at_white"]) == ([0, 0, 0.1], [0.25, 0, 0])
    assert (facts["minimum"], facts["maximum"], facts["percentiles"]["50"]) == (0, 255, 100)


@pytest.mark.filterwarnings("ignore:.*made for displays")
def test_a_jpeg_with_a_gain_map_is_reported_as_a_photograph_with_one(tmp_path: Path):
    ramp = np.geomspace(0.1, 3, 64 * 64, dtype=np.float32).reshape(64, 64, 1)
    gain_map.write_rendition(tmp_path / "a.jpg", np.repeat(ramp, 3, axis=-1), np.full((64, 64, 3), 200, np.uint8))
    facts = described(tmp_path / "a.jpg")
    assert (facts["kind"], facts["format"]) == ("photograph", "JPEG")
    assert "stops" in facts["gain_map"]
    write(tmp_path / "b.jpg", Photograph(np.full((16, 16, 3), 100, np.uint8)))
    assert described(tmp_path / "b.jpg")["gain_map"] is None


def test_a_cube_is_reported_by_its_levels_and_its_largest(tmp_path: Path):
    levels = [np.full((6, side, side, 3), 0.5, np.float32) for side in (8, 4, 2)]
    levels[0][3, 2, 2] = 1000
    write_cube(tmp_path / "a.ktx2", levels)
    facts = described(tmp_path / "a.ktx2")
    assert (facts["kind"], facts["format"], facts["size"], facts["levels"]) == ("cube", "KTX2", [8, 8], [8, 4, 2])
    assert (facts["dtype"], facts["maximum"]) == ("float16", 1000)
    assert facts["luminance"]["lit"] == 6 * 64
    levels[0][3, 2, 2] = 100_000
    write_cube(tmp_path / "b.ktx2", levels)
    assert described(tmp_path / "b.ktx2")["dtype"] == "float32"


def test_a_camera_raw_is_reported_by_its_sensor(shared: Path):
    facts = described(shared / "data" / "formats" / "raw" / "colorchart.dng")
    assert (facts["kind"], facts["format"], facts["pattern"]) == ("camera raw", "RAW", "RGGB")
    assert (facts["black"], facts["white"], facts["size"]) == ([2056] * 4, 15000, [1734, 1156])
    assert facts["camera"] == "Canon EOS Kiss X4" and facts["at_white"] == [0, 0, 0]
    assert facts["black"][0] < facts["percentiles"]["50"] < facts["maximum"] < facts["white"]


def test_what_was_lost_of_a_file_cut_short_is_reported_where_it_is_salvaged(tmp_path: Path):
    write(tmp_path / "a.hdr", RadianceMap(np.random.default_rng(4).uniform(1, 2, (50, 20, 3)).astype(np.float32)))
    whole = (tmp_path / "a.hdr").read_bytes()
    (tmp_path / "a.hdr").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(UnreadableFile):
        describe(tmp_path / "a.hdr")
    with pytest.warns(UserWarning, match="of 50"):
        facts = described(tmp_path / "a.hdr", ReadOptions(salvage=True))
    assert facts["clipped"]["outside"] % 20 == 0 and 400 < facts["clipped"]["outside"] < 600


def test_limits_hold_for_a_description_too(tmp_path: Path):
    write(tmp_path / "a.pfm", RadianceMap(np.ones((20, 20, 3), np.float32)))
    with pytest.raises(UnreadableFile, match="399 pixels"):
        describe(tmp_path / "a.pfm", ReadOptions(pixels=399))
    assert described(tmp_path / "a.pfm", ReadOptions(pixels=400))["size"] == [20, 20]
