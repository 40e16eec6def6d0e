"""`relume convert` between formats: what is written, what is reported of it, and what is refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from command_line import printed, refused, reported
from relume.cli import main
from relume.image import files
from relume.image.colour import encode_srgb
from relume.image.files import read_photograph, read_radiance, write
from relume.image.files.encodings import LogLuv
from relume.image.files.gain_map import gain_map
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import OUTSIDE, RadianceMap
from relume.light.conversion.file_formats import kept


def made(words: list[object], capsys: pytest.CaptureFixture[str]) -> dict:
    return reported(["convert", *words], capsys)


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    """A picture of 20 × 12 pixels with a NaN, a negative channel and a sun."""
    radiance = np.random.default_rng(7).random((12, 20, 3), np.float32) + 0.1
    radiance[3, 4], radiance[5, 6, 2], radiance[8, 9] = np.nan, -0.25, 1e6
    write(tmp_path / "in.exr", RadianceMap(radiance, unit="cd/m²", attributes={"camera": "A", "iso": "400"}))
    return tmp_path / "in.exr"


@pytest.mark.parametrize("name", ["out.exr", "out.tif"])
def test_what_holds_floats_keeps_every_bit(name, stored, capsys):
    out = stored.with_name(name)
    report = made([stored, "-o", out], capsys)
    assert report["kept"] == {"exact": True} and report["unit"] == "cd/m²" and report["size"] == [20, 12]
    before, after = read_radiance(stored), read_radiance(out)
    np.testing.assert_array_equal(after.radiance.view(np.uint32), before.radiance.view(np.uint32))
    assert (after.unit, after.attributes) == (before.unit, before.attributes)


def test_what_a_format_does_not_keep_is_said(stored, capsys):
    shown = printed(["convert", str(stored), "-o", str(stored.with_name("out.pfm"))], capsys)
    assert "does not keep the unit cd/m²; the attributes camera, iso" in shown.err
    assert "exact" in shown.out


def test_a_picture_that_a_format_cannot_hold_is_refused(stored, capsys):
    out = stored.with_name("out.hdr")
    assert "2 of 240 pixels are negative, NaN" in refused(["convert", str(stored), "-o", str(out)], capsys)
    assert not out.exists()
    assert "1 pixels are NaN" in refused(["convert", str(stored), "-o", str(out), "--clamp"], capsys)


def test_halves_are_written_where_they_hold_the_picture(stored, capsys):
    out = stored.with_name("half.exr")
    report = made([stored, "-o", out, "--half", "--roi", "0,0,20,8"], capsys)
    assert "half" in report["format"] and report["size"] == [20, 8]
    assert report["kept"]["error % of the largest channel"]["largest"] <= 100 * 2**-11
    assert "65504" in printed(["convert", str(stored), "-o", str(out), "--half"], capsys).err
    assert np.nanmax(read_radiance(out).radiance) == 1e6


def test_a_rectangle_is_cut_and_brightened(stored, capsys):
    out = stored.with_name("out.pfm")
    assert main(["convert", str(stored), "-o", str(out), "--roi", "8,7,3,4", "--exposure", "-2"]) == 0
    assert "no longer cd/m²" in capsys.readouterr().err
    np.testing.assert_array_equal(read_radiance(out).radiance, read_radiance(stored).radiance[7:11, 8:11] / 4)
    assert "not in a picture of 20×12" in refused(["convert", str(stored), "-o", str(out), "--roi", "18,0,3,3"], capsys)


@pytest.mark.parametrize(
    ("words", "subtype"),
    [
        (["out.hdr", "--as", "xyze"], "XYZE"),
        (["out.tif", "--as", "logluv32"], "32"),
        (["out.tif", "--as", "logluv24"], "24"),
        (["out.tif", "--as", "logl16"], "16"),
        (["out.pfm", "--as", "grey"], "grey"),
    ],
)
def test_varieties_of_a_format_are_asked_for(words, subtype, tmp_path, capsys):
    grey = np.full((4, 4, 3), 0.5, np.float32)
    write(tmp_path / "in.exr", RadianceMap(grey))
    report = made([tmp_path / "in.exr", "-o", tmp_path / words[0], *words[1:]], capsys)
    assert subtype in report["format"]
    # A cell of u′v′ is 0.0035 wide: up to 3 % of a neutral's blue.
    np.testing.assert_allclose(read_radiance(tmp_path / words[0]).radiance, grey, rtol=0.03)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["out.hdr", "--half"], "--half is for .exr; out.hdr is not one"),
        (["out.exr", "--as", "xyze"], "--as xyze is for .hdr, .pic"),
        (["out.exr", "--half", "--float"], "contradict"),
        (["out.hdr", "--float"], "--float is for .exr, .tif"),
        (["out.png"], "relume develop"),
        (["out.dds"], "must end in"),
        (["out.exr", "--roi", "1,2,3"], "--roi"),
        (["out.exr", "--to", "angular", "--roi", "0,0,2,2"], "change of format alone"),
    ],
)
def test_wrong_words_are_refused(words, message, stored, capsys):
    out = stored.with_name(words[0])
    assert message in refused(["convert", str(stored), "-o", str(out), *words[1:]], capsys)
    assert not out.exists()


def test_a_file_cut_short_is_salvaged_on_request(stored, tmp_path, capsys):
    made([stored, "-o", tmp_path / "a.pfm"], capsys)
    (tmp_path / "short.pfm").write_bytes((tmp_path / "a.pfm").read_bytes()[: -5 * 240])
    words = ["convert", str(tmp_path / "short.pfm"), "-o", str(tmp_path / "saved.exr")]
    refused(words, capsys)
    assert "5 of 12 rows" in printed([*words, "--salvage"], capsys).err
    saved = read_radiance(tmp_path / "saved.exr")
    assert saved.clipped is not None
    # Rows are stored from the bottom: the top ones are missing.
    assert np.array_equal(saved.clipped, np.repeat([OUTSIDE] * 5 + [0] * 7, 20).reshape(12, 20))
    np.testing.assert_array_equal(saved.radiance[5:], read_radiance(stored).radiance[5:])


def test_limits_are_raised_and_lowered(stored, capsys):
    words = ["convert", str(stored), "-o", str(stored.with_name("out.exr"))]
    assert "claims 20 x 12 pixels" in refused([*words, "--largest", "0.0002"], capsys)
    assert main([*words, "--largest", "500"]) == 0


def test_a_raw_float_is_read_with_the_size_that_is_given(tmp_path, capsys):
    pixels = np.random.default_rng(1).random((3, 5, 3), np.float32)
    (tmp_path / "a.float").write_bytes(pixels.astype(">f4").tobytes())
    made([tmp_path / "a.float", "-o", tmp_path / "a.exr", "--float-size", "5x3"], capsys)
    np.testing.assert_array_equal(read_radiance(tmp_path / "a.exr").radiance, pixels)
    made([tmp_path / "a.exr", "-o", tmp_path / "b.float"], capsys)
    assert (tmp_path / "b.float").read_bytes() == pixels.astype("<f4").tobytes()


def test_photographs_change_their_format_with_their_exif(tmp_path, capsys):
    pixels = np.random.default_rng(1).integers(0, 65536, (6, 8, 3), np.uint16)
    taken = Exposure(1 / 60, 5.6, 200, "EXIF")
    write(tmp_path / "a.png", Photograph(pixels, exposure=taken, camera="A B"))
    report = made([tmp_path / "a.png", "-o", tmp_path / "a.tif"], capsys)
    assert report["bits"] == 16
    back = read_photograph(tmp_path / "a.tif")
    assert (back.exposure, back.camera) == (taken, "A B")
    np.testing.assert_array_equal(back.pixels, pixels)
    made([tmp_path / "a.tif", "-o", tmp_path / "b.png", "--roi", "2,1,4,5"], capsys)
    np.testing.assert_array_equal(read_photograph(tmp_path / "b.png").pixels, pixels[1:6, 2:6])
    out = str(tmp_path / "c.exr")
    assert "values are no light yet" in refused(["convert", str(tmp_path / "a.tif"), "-o", out], capsys)
    words = ["convert", tmp_path / "a.tif", "-o", tmp_path / "c.png", "--exposure", "1"]
    assert "--exposure" in refused(words, capsys)


def test_a_gain_map_is_light_or_a_photograph_as_the_output_wants(tmp_path, capsys):
    ramp = (np.geomspace(0.02, 8, 64).astype(np.float32)[None, :, None] * np.ones((64, 1, 3), np.float32)).copy()
    write(tmp_path / "in.exr", RadianceMap(ramp))
    words = ["convert", str(tmp_path / "in.exr"), "-o", str(tmp_path / "a.jpg")]
    assert "relume develop" in refused(words, capsys)
    gain_map.write_rendition(tmp_path / "a.jpg", ramp, np.rint(255 * encode_srgb(np.clip(ramp, 0, 1))).astype(np.uint8))
    made([tmp_path / "a.jpg", "-o", tmp_path / "b.exr"], capsys)
    np.testing.assert_allclose(read_radiance(tmp_path / "b.exr").radiance, ramp, rtol=0.1)
    assert "gain map" in printed(["convert", str(tmp_path / "a.jpg"), "-o", str(tmp_path / "b.png")], capsys).err
    assert files.kind_of(tmp_path / "b.png") == "PNG"
    made([tmp_path / "a.jpg", "-o", tmp_path / "b.tif", "--float"], capsys)
    assert files.kind_of(tmp_path / "b.tif") == "float TIFF"


def test_a_dry_run_writes_nothing(stored, capsys):
    out = stored.with_name("out.hdr")
    assert made([stored, "-o", out, "--dry-run"], capsys) == {"would write": [str(out)]}
    assert not out.exists()


def test_the_input_is_never_written_over(stored, capsys):
    before = stored.read_bytes()
    assert "the input itself" in refused(["convert", str(stored), "-o", str(stored)], capsys)
    (stored.parent / "link.exr").symlink_to(stored)
    out = str(stored.parent / "link.exr")
    assert "the input itself" in refused(["convert", str(stored), "-o", out, "--size", "6"], capsys)
    assert stored.read_bytes() == before


def test_a_damaged_tiff_is_no_painting(tmp_path, capsys):
    files.write(tmp_path / "a.tif", RadianceMap(np.ones((8, 8, 3), np.float32)), LogLuv())
    (tmp_path / "short.tif").write_bytes((tmp_path / "a.tif").read_bytes()[:60])
    report = refused(["convert", str(tmp_path / "short.tif"), "-o", str(tmp_path / "b.exr")], capsys)
    assert "damaged TIFF" in report and "light" not in report


def test_the_report_of_a_copy_counts_every_kind_of_change():
    before = np.array([[[0, 0, 0], [1, 1, 1], [2, 2, 2], [np.nan, 1, 1]]], np.float32)
    after = np.array([[[0, 3, 0], [1, 1.5, 1], [np.inf, 2, 2], [np.nan, 1, 1]]], np.float32)
    report = kept(RadianceMap(before), RadianceMap(after))
    assert report["black becomes"] == 3 and report["no longer finite"] == 1 and not report["exact"]
    assert report["error % of the largest channel"] == {"half": 50, "99 of 100": 50, "largest": 50}
    assert report["mean change %"] == [0, 350, 0]
    assert kept(RadianceMap(before), RadianceMap(before.copy())) == {"exact": True}


def test_a_reader_that_has_seen_enough_is_no_fault(stored):
    command = f"{sys.executable} -c 'from relume.cli import main; raise SystemExit(main())' info {stored} -v | true"
    done = subprocess.run(["bash", "-c", f"{command}; exit ${{PIPESTATUS[0]}}"], capture_output=True, text=True)
    assert done.stderr == "" and done.returncode in (0, 141)
