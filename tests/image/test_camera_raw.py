"""Camera raw files: what the sensor read, what EXIF says, which way is up; and plain refusals of the rest."""

from __future__ import annotations

import struct
from contextlib import nullcontext
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from dng_files import COLOUR_MATRIX, write_dng
from relume.errors import UnreadableFile
from relume.image.files import camera_raw, read, read_raw
from relume.image.files.signatures import kind_of
from relume.image.photograph import Exposure, Photograph, RawPhotograph

BLACK = (500, 510, 520, 530)


@pytest.fixture
def ramp() -> np.ndarray:
    """(30, 40) every value once, so that any turn or crop can be reported."""
    return (1000 + np.arange(30 * 40, dtype=np.uint16)).reshape(30, 40)


def test_the_sensors_values_come_as_they_were_written(tmp_path, ramp):
    raw = read_raw(write_dng(tmp_path / "a.dng", ramp, black=BLACK, white=15000))
    np.testing.assert_array_equal(raw.mosaic, ramp)
    assert raw.pattern.tolist() == [[0, 1], [1, 2]]
    assert raw.black.tolist() == [[500, 510], [520, 530]]
    assert raw.white == 15000
    assert raw.size == (40, 30)
    assert raw.name == str(tmp_path / "a.dng")


def test_exposure_and_settings_come_from_exif_with_exact_fractions(tmp_path, ramp):
    raw = read_raw(write_dng(tmp_path / "a.dng", ramp, seconds=1 / 60, f_number=5.6, iso=800))
    assert raw.exposure == Exposure(1 / 60, 5.6, 800)
    assert raw.exposure is not None
    assert raw.exposure.source == "EXIF"
    assert raw.camera == "Virtual One"
    assert raw.settings.taken == datetime(2026, 1, 2, 3, 4, 5)
    assert raw.settings.focal_length == 35
    assert raw.focal_length == pytest.approx(35 / 36 * 40)


def test_an_exposure_that_exif_does_not_say_is_unknown_and_not_a_second(tmp_path, ramp):
    assert read_raw(write_dng(tmp_path / "a.dng", ramp, seconds=None)).exposure is None
    assert read_raw(write_dng(tmp_path / "b.dng", ramp, seconds=0)).exposure is None
    assert read_raw(write_dng(tmp_path / "c.dng", ramp, f_number=None, iso=None)).exposure == Exposure(1 / 60)


TURNS = {1: lambda m: m, 3: lambda m: np.rot90(m, 2), 6: lambda m: np.rot90(m, -1), 8: lambda m: np.rot90(m)}


@pytest.mark.parametrize("orientation", TURNS)
@pytest.mark.parametrize("size", [(30, 40), (31, 40), (30, 41), (31, 41)])
def test_mosaic_pattern_and_black_are_turned_upright_together(tmp_path, orientation, size):
    # Each photosite's value says its own site of the pattern: 1000 · site plus where it is.
    y, x = np.mgrid[: size[0], : size[1]]
    sites = 2 * (y % 2) + x % 2
    mosaic = (1000 + 1000 * sites + y + x).astype(np.uint16)
    raw = read_raw(write_dng(tmp_path / "a.dng", mosaic, black=BLACK, orientation=orientation))
    np.testing.assert_array_equal(raw.mosaic, TURNS[orientation](mosaic))
    for i in (0, 1):
        for j in (0, 1):
            site = raw.mosaic[i, j] // 1000 - 1
            assert raw.pattern[i, j] == (0, 1, 1, 2)[site]
            assert raw.black[i, j] == BLACK[site]


def test_what_lies_outside_the_lit_part_is_left_out_and_the_pattern_counted_from_there(tmp_path, ramp):
    raw = read_raw(write_dng(tmp_path / "a.dng", ramp, margins=(4, 2), black=BLACK))
    np.testing.assert_array_equal(raw.mosaic, ramp[4:, 2:])
    assert raw.pattern.tolist() == [[0, 1], [1, 2]]
    assert raw.black.tolist() == [[500, 510], [520, 530]]
    # LibRaw begins at even rows and columns: at the lit part's second row, which is green, blue.
    raw = read_raw(write_dng(tmp_path / "b.dng", ramp, margins=(3, 2)))
    np.testing.assert_array_equal(raw.mosaic, ramp[4:, 2:])
    assert raw.pattern.tolist() == [[1, 2], [0, 1]]


@pytest.mark.parametrize("pattern", [((0, 1), (1, 2)), ((2, 1), (1, 0)), ((1, 0), (2, 1)), ((1, 2), (0, 1))])
def test_every_bayer_pattern_is_reported(tmp_path, ramp, pattern):
    raw = read_raw(write_dng(tmp_path / "a.dng", ramp, pattern=pattern))
    assert raw.pattern.tolist() == [list(row) for row in pattern]


def test_daylight_seen_by_the_camera_becomes_white_of_rec_709(tmp_path, ramp):
    raw = read_raw(write_dng(tmp_path / "a.dng", ramp, as_shot=(0.5, 1.0, 0.6)))
    assert raw.as_shot is not None
    assert raw.daylight.min() == raw.as_shot.min() == 1.0
    np.testing.assert_allclose(raw.as_shot, [2, 1, 1 / 0.6], rtol=1e-5)
    # CIE 15: D65 has XYZ 0.9505, 1, 1.0888.
    white = np.array(COLOUR_MATRIX) @ [0.9505, 1.0, 1.0888]
    np.testing.assert_allclose(raw.daylight * white / (raw.daylight * white)[1], 1, atol=2e-3)
    np.testing.assert_allclose(raw.matrix.sum(1), 1, atol=1e-6)
    # IEC 61966-2-1: red of Rec. 709 has XYZ 0.4124, 0.2126, 0.0193.
    red = np.array(COLOUR_MATRIX) @ [0.4124, 0.2126, 0.0193]
    np.testing.assert_allclose(raw.matrix @ (red / white), [1, 0, 0], atol=3e-3)


def test_the_colour_chart_is_read(shared):
    raw = read_raw(shared / "data/formats/raw/colorchart.dng")
    assert raw.size == (1734, 1156)
    assert raw.pattern.tolist() == [[0, 1], [1, 2]]
    assert (raw.black == 2056).all()
    assert raw.white == 15000
    assert raw.camera == "Canon EOS Kiss X4"
    assert raw.exposure is None  # its EXIF says 0 s
    assert (int(raw.mosaic.min()), int(raw.mosaic.max())) == (1958, 12128)


def test_raw_files_are_recognised_by_content_whatever_their_suffix(tmp_path, ramp):
    assert kind_of(write_dng(tmp_path / "a.tif", ramp)) == "RAW"
    for name, head in {
        "canon.cr3": b"\0\0\0\x18ftypcrx \0\0\0\x01",
        "fuji.raf": b"FUJIFILMCCD-RAW 0201",
        "panasonic.rw2": b"IIU\0\x18\0\0\0",
        "olympus.orf": b"IIRS\x08\0\0\0",
        "canon.cr2": b"II*\0\x10\0\0\0CR\x02\0",
    }.items():
        (tmp_path / name).write_bytes(head + bytes(64))
        assert kind_of(tmp_path / name) == "RAW"
        with pytest.raises(UnreadableFile, match=name):
            read_raw(tmp_path / name)


def test_a_sub_folder_with_a_mosaic_makes_a_tiff_a_raw(tmp_path):
    # As Nikon writes them: the first folder is a preview, tag 330 leads to the sensor's.
    first = b"\x00\x02" + b"\x01\x06\x00\x03\0\0\0\x01\x00\x02\0\0" + b"\x01\x4a\x00\x04\0\0\0\x01\0\0\0\x26" + bytes(4)
    second = b"\x00\x01" + b"\x01\x06\x00\x03\0\0\0\x01\x80\x23\0\0" + bytes(4)
    (tmp_path / "a.nef").write_bytes(b"MM\0*\0\0\0\x08" + first + second)
    assert kind_of(tmp_path / "a.nef") == "RAW"
    (tmp_path / "b.tif").write_bytes(b"MM\0*\0\0\0\x08" + first + second.replace(b"\x80\x23", b"\x00\x02"))
    assert kind_of(tmp_path / "b.tif") == "TIFF"


def test_folders_that_lead_in_circles_end(tmp_path):
    (tmp_path / "a.tif").write_bytes(b"II*\0\x08\0\0\0" + b"\0\0" + b"\x08\0\0\0")
    assert kind_of(tmp_path / "a.tif") == "TIFF"


def test_a_raw_is_no_photograph_and_a_photograph_no_raw(tmp_path, ramp, shared):
    with pytest.raises(UnreadableFile, match="camera raw file, not a photograph yet; give raw files to `relume merge`"):
        read(write_dng(tmp_path / "a.dng", ramp))
    with pytest.raises(UnreadableFile, match="a JPEG file where a camera raw is needed"):
        read_raw(shared / "data/malformed/raw_stubs/Issue 247-1.nef")


def test_raws_without_a_mosaic_are_refused_plainly(tmp_path, shared):
    with pytest.raises(UnreadableFile, match="no sensor's mosaic"):
        read_raw(shared / "data/malformed/raw_stubs/IMG_1361.dng")
    with pytest.raises(UnreadableFile, match="linear\\.dng"):
        read_raw(write_dng(tmp_path / "linear.dng", np.full((20, 20, 3), 700, np.uint16), linear=True))
    with pytest.raises(UnreadableFile, match="without pixels"):
        read_raw(write_dng(tmp_path / "empty.dng", np.zeros((30, 40), np.uint16)))


@pytest.mark.filterwarnings("ignore:.*its EXIF (cannot be read|is damaged)")
def test_a_file_cut_short_anywhere_is_refused_in_one_line_and_nothing_else_is_said(shared, tmp_path, capfd):
    whole = (shared / "data/formats/raw/colorchart.dng").read_bytes()
    cut = tmp_path / "cut.dng"
    for length in (4, 9, 100, 400, 1200, 2000, 100_000, 3_000_000, len(whole) - 10):
        cut.write_bytes(whole[:length])
        with pytest.raises(UnreadableFile) as refused:
            read_raw(cut)
        assert str(cut) in str(refused.value)
        assert "\n" not in str(refused.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.filterwarnings("ignore:.*its EXIF (cannot be read|is damaged)")
def test_bytes_altered_anywhere_in_the_header_never_crash(tmp_path, ramp):
    file = write_dng(tmp_path / "a.dng", ramp)
    whole, generator = file.read_bytes(), np.random.default_rng(3)
    refused = 0
    for _ in range(300):
        data = bytearray(whole)
        for place in generator.integers(8 + ramp.nbytes, len(whole), 3):
            data[place] = generator.integers(256)
        file.write_bytes(data)
        try:
            assert isinstance(read_raw(file), RawPhotograph)
        except UnreadableFile as error:
            refused += 1
            assert "\n" not in str(error)
    assert 30 < refused < 300


def test_damaged_exif_is_reported_and_the_pixels_kept(tmp_path, ramp):
    file = write_dng(tmp_path / "a.dng", ramp)
    whole = file.read_bytes()
    file.write_bytes(whole[:-20])
    with pytest.warns(UserWarning, match=r"a\.dng: its EXIF is damaged \(Trunc.*\); exposure may be missing"):
        raw = read_raw(file)
    # What stands ahead of the damage is still reported, and nothing is made up of what is not.
    assert (raw.exposure, raw.settings.taken) == (Exposure(1 / 60, 4.0, 100), None)
    np.testing.assert_array_equal(raw.mosaic, ramp)
    count = whole.index(struct.pack("<HHI", 0x829A, 5, 1)) + 4  # of the exposure time's values
    file.write_bytes(whole[:count] + b"\xff" * 4 + whole[count + 4 :])
    with pytest.warns(UserWarning, match=r"a\.dng: its EXIF is damaged"):
        raw = read_raw(file)
    assert (raw.exposure, raw.camera) == (None, "Virtual One")
    np.testing.assert_array_equal(raw.mosaic, ramp)


def test_a_camera_whose_colours_are_unknown_is_named(tmp_path, ramp):
    file = write_dng(tmp_path / "a.dng", ramp)
    data = file.read_bytes()
    entry = data.index(struct.pack("<HHI", 50721, 10, 9))  # ColorMatrix1, DNG 1.7: nine fractions
    (place,) = struct.unpack_from("<I", data, entry + 8)
    file.write_bytes(data[:place] + struct.pack("<ii", 1, 1) * 9 + data[place + 72 :])
    with pytest.raises(UnreadableFile, match="no colour matrix is known for its camera, 'Virtual One'; "):
        read_raw(file)
    file.write_bytes(file.read_bytes().replace(b"Virtual One", b"Virtual\nOne"))
    with pytest.raises(UnreadableFile, match=r"no colour matrix is known for its camera, 'Virtual\\nOne'; "):
        read_raw(file)


def test_damage_that_the_decoder_only_prints_is_damage(tmp_path, ramp, monkeypatch):
    file = write_dng(tmp_path / "a.dng", ramp)
    monkeypatch.setattr(camera_raw, "gathered_messages", lambda: nullcontext(["Corrupt data near 0x1000"]))
    with pytest.raises(UnreadableFile, match=r"damaged camera raw, LibRaw's .*found Corrupt data near 0x1000"):
        read_raw(file)


def test_senseless_raws_cannot_be_made(ramp):
    sound = {
        "mosaic": ramp,
        "pattern": np.array([[0, 1], [1, 2]]),
        "black": np.zeros((2, 2)),
        "white": 4095.0,
        "matrix": np.eye(3),
        "daylight": np.ones(3),
    }
    assert RawPhotograph(**sound).size == (40, 30)
    for field, value in {
        "mosaic": ramp.astype(float),
        "pattern": np.array([[0, 1], [2, 1]]),
        "black": np.full((2, 2), 5000.0),
        "matrix": np.eye(4),
        "daylight": np.ones(4),
    }.items():
        with pytest.raises(ValueError, match=field):
            RawPhotograph(**{**sound, field: value})


def test_the_picture_inside_a_nef_stub_is_still_a_photograph(shared):
    assert isinstance(read(Path(shared / "data/malformed/raw_stubs/Issue 247-1.nef")), Photograph)
