"""Portable float maps: every form of the header, bit for bit, and the places where programs disagree."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

import relume.image.files as files
from other_programs import by_opencv
from relume.errors import DoubtWarning, FormatError, UnreadableFile
from relume.image.files import pfm
from relume.image.files.encodings import PFM
from relume.image.files.read_options import ReadOptions
from relume.image.radiance import OUTSIDE, RadianceMap

# Two pixels wide, two rows: the bottom row comes first.
ROWS = [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [7.0, 8.0, 9.0, 10.0, 11.0, 12.0]]
UPRIGHT = np.array([ROWS[1], ROWS[0]], np.float32).reshape(2, 2, 3)
# Zeros of both signs, denormals, the largest values, infinities, and NaN: quiet, signalling, with a payload.
BITS = [
    0,
    0x80000000,
    1,
    0x807FFFFF,
    0x7F7FFFFF,
    0xFF7FFFFF,
    0x7F800000,
    0xFF800000,
    0x7FC00000,
    0x7F800001,
    0xFFC12345,
]
ODD = np.resize(np.array(BITS, np.uint32), (3, 5, 3)).view(np.float32)


def saved(folder: Path, header: bytes, pixels: bytes) -> Path:
    path = folder / "map.pfm"
    path.write_bytes(header + pixels)
    return path


def packed(order: str) -> bytes:
    return struct.pack(f"{order}12f", *ROWS[0], *ROWS[1])


def bits(radiance: np.ndarray) -> list[int]:
    return np.ascontiguousarray(radiance).view(np.uint32).ravel().tolist()


@pytest.mark.parametrize(
    "header",
    [
        b"PF\n2 2\n-1.0\n",
        b"PF\n2\n2\n-1\n",
        b"PF 2 2 -1 ",
        b"PF\t2  2 \n\n -1.000000\t",
        b"PF\r2 2\r-1.0\r",
        b"PF\n2 2 \n-1e0\n",
        b"PF\n002 02\n-.1E1\n",
        b"PF\r\n2 2\r\n-1.0\r\n",
        b"PF\n2 2\n-1.0\r\n",
    ],
)
def test_every_form_of_the_header_leads_to_the_same_pixels(tmp_path, header):
    found = files.read_radiance(saved(tmp_path, header, packed("<"))).radiance
    np.testing.assert_array_equal(found, UPRIGHT)


def test_a_pixel_that_looks_like_a_line_feed_after_a_carriage_return_is_a_pixel(tmp_path):
    line_feed = struct.pack("<I", 0x3F80000A)
    path = saved(tmp_path, b"Pf\n1 1\n-1.0\r", line_feed)
    assert bits(files.read_radiance(path).radiance) == [0x3F80000A] * 3


def test_a_dos_header_never_shifts_the_pixels_of_a_file_that_lacks_its_last_byte(tmp_path):
    path = saved(tmp_path, b"PF\r\n2 2\r\n-1.0\r\n", packed("<")[:-1])
    with pytest.raises(FormatError, match="1 of 2 rows"):
        files.read_radiance(path)


def test_a_positive_scale_is_big_endian(tmp_path):
    path = saved(tmp_path, b"PF\n2 2\n+1.0\n", packed(">"))
    np.testing.assert_array_equal(files.read_radiance(path).radiance, UPRIGHT)
    assert pfm.subtype(path) == "big-endian, colour"


def test_grey_is_three_equal_channels(tmp_path):
    path = saved(tmp_path, b"Pf\n1 2\n-1\n", struct.pack("<2f", 0.25, 8))
    assert files.read_radiance(path).radiance.tolist() == [[[8.0] * 3], [[0.25] * 3]]
    assert pfm.subtype(path) == "little-endian, grey"


def test_the_scale_multiplies_with_a_warning(tmp_path):
    path = saved(tmp_path, b"PF\n2 2\n-2.5\n", packed("<"))
    with pytest.warns(UserWarning, match=r"map\.pfm: its scale is 2\.5; its samples were multiplied"):
        found = files.read_radiance(path).radiance
    np.testing.assert_array_equal(found, 2.5 * UPRIGHT)
    assert pfm.subtype(path) == "little-endian, colour, scale 2.5"


def test_a_scale_is_multiplied_without_rounding_it_first(tmp_path):
    path = saved(tmp_path, b"Pf\n1 1\n-0.1\n", struct.pack("<f", 9))
    with pytest.warns(UserWarning, match="scale"):
        assert files.read_radiance(path).radiance[0, 0, 0] == np.float32(9 * 0.1)
    assert np.float32(9 * 0.1) != np.float32(9) * np.float32(0.1)  # what rounding first would give


def test_a_scale_that_takes_values_beyond_floats_is_refused(tmp_path):
    path = saved(tmp_path, b"Pf\n3 1\n-1e38\n", struct.pack("<3f", 1, 4, np.inf))
    with pytest.raises(UnreadableFile, match=r"1e.38 takes 1 values beyond float32"):
        files.read_radiance(path)


def test_comments_are_kept(tmp_path):
    path = saved(tmp_path, b"PF\n# made by hand\n2 2 # width, height\n-1.0\n", packed("<"))
    found = files.read_radiance(path)
    np.testing.assert_array_equal(found.radiance, UPRIGHT)
    assert found.attributes == {"comments": "made by hand\nwidth, height"}


def test_bytes_after_the_pixels_are_reported(tmp_path):
    with pytest.warns(UserWarning, match=r"map\.pfm: 3 bytes after its pixels are left out"):
        found = files.read_radiance(saved(tmp_path, b"PF\n2 2\n-1.0\n", packed("<") + b"end"))
    np.testing.assert_array_equal(found.radiance, UPRIGHT)


@pytest.mark.parametrize(
    ("encoding", "header", "order"),
    [(PFM(), b"PF\n2 2\n-1.0\n", "<"), (PFM(big_endian=True), b"PF\n2 2\n1.0\n", ">")],
)
def test_written_bytes_are_literally_these(tmp_path, encoding, header, order):
    files.write(tmp_path / "map.pfm", RadianceMap(UPRIGHT), encoding)
    assert (tmp_path / "map.pfm").read_bytes() == header + packed(order)


def test_grey_is_written_from_one_channel(tmp_path):
    radiance = np.repeat(np.array([[[8]], [[0.25]]], np.float32), 3, axis=2)
    files.write(tmp_path / "map.pfm", RadianceMap(radiance), PFM(grey=True))
    assert (tmp_path / "map.pfm").read_bytes() == b"Pf\n1 2\n-1.0\n\x00\x00\x80\x3e\x00\x00\x00\x41"


@pytest.mark.parametrize("encoding", [PFM(), PFM(big_endian=True)])
def test_every_bit_comes_back(tmp_path, encoding):
    files.write(tmp_path / "odd.pfm", RadianceMap(ODD), encoding)
    assert bits(files.read_radiance(tmp_path / "odd.pfm").radiance) == bits(ODD)


@pytest.mark.parametrize("encoding", [PFM(grey=True), PFM(grey=True, big_endian=True)])
def test_every_bit_of_a_grey_map_comes_back(tmp_path, encoding):
    grey = np.repeat(ODD[..., :1], 3, axis=2)
    files.write(tmp_path / "odd.pfm", RadianceMap(grey), encoding)
    assert bits(files.read_radiance(tmp_path / "odd.pfm").radiance) == bits(grey)


@pytest.mark.parametrize("height", [1, 63, 64, 65, 200])
def test_rows_beyond_one_batch_keep_their_order(tmp_path, height):
    radiance = np.arange(height * 6, dtype=np.float32).reshape(height, 2, 3)
    files.write(tmp_path / "tall.pfm", RadianceMap(radiance))
    np.testing.assert_array_equal(files.read_radiance(tmp_path / "tall.pfm").radiance, radiance)


def test_a_view_of_another_array_is_written_as_it_looks(tmp_path, numbered):
    view = numbered[::-1, ::2, ::-1]
    files.write(tmp_path / "view.pfm", RadianceMap(view))
    np.testing.assert_array_equal(files.read_radiance(tmp_path / "view.pfm").radiance, view)


def test_grey_of_a_coloured_map_is_refused_with_the_count(tmp_path):
    radiance = np.ones((2, 3, 3), np.float32)
    radiance[1, 2, 0] = np.nextafter(np.float32(1), np.float32(2))
    with pytest.raises(ValueError, match="1 of 6 pixels have channels that differ"):
        files.write(tmp_path / "map.pfm", RadianceMap(radiance), PFM(grey=True))
    assert not list(tmp_path.iterdir())


def test_a_minus_zero_is_not_the_grey_of_a_zero(tmp_path):
    radiance = np.array([[[0.0, -0.0, 0.0]]], np.float32)
    with pytest.raises(ValueError, match="1 of 1 pixels"):
        files.write(tmp_path / "map.pfm", RadianceMap(radiance), PFM(grey=True))


def test_what_is_not_kept_is_said(tmp_path):
    image = RadianceMap(UPRIGHT, variance=UPRIGHT, unit="cd/m²", attributes={"camera": "box"})
    with pytest.warns(UserWarning, match="the variance; the unit cd/m²; the attributes camera"):
        files.write(tmp_path / "map.pfm", image)
    found = files.read_radiance(tmp_path / "map.pfm")
    assert (found.unit, found.variance, found.attributes) == ("relative", None, {})


@pytest.mark.parametrize("channels", [1, 3])
def test_a_file_that_ends_early_is_refused_or_read_as_far_as_it_goes(tmp_path, channels):
    pixels = np.arange(1, 1 + 4 * 2 * channels, dtype="<f4").reshape(4, 2, channels)
    header = b"%s\n2 4\n-1.0\n" % (b"PF" if channels == 3 else b"Pf")
    path = saved(tmp_path, header, pixels.tobytes()[: 2 * 8 * channels + 5])
    with pytest.raises(FormatError, match="2 of 4 rows") as refused:
        files.read_radiance(path)
    assert refused.value.where == f"byte {path.stat().st_size}"
    with pytest.warns(DoubtWarning, match="the top 2 of 4 rows are missing") as said:
        found = files.read_radiance(path, ReadOptions(salvage=True))
    assert [getattr(each.message, "effect", None) for each in said] == [0.5]
    np.testing.assert_array_equal(found.radiance[2:], np.broadcast_to(pixels[1::-1], (2, 2, 3)))
    assert not found.radiance[:2].any()
    assert found.clipped is not None
    assert found.clipped.tolist() == [[OUTSIDE] * 2] * 2 + [[0] * 2] * 2


def test_a_file_without_one_whole_row_cannot_be_salvaged(tmp_path):
    path = saved(tmp_path, b"PF\n2 2\n-1.0\n", packed("<")[:23])
    with pytest.raises(FormatError, match="0 of 2 rows"):
        files.read_radiance(path, ReadOptions(salvage=True))


@pytest.mark.parametrize(
    ("header", "where", "expected"),
    [
        (b"PF\n", "byte 3", "width"),
        (b"PF\n-2 2\n-1\n", "byte 3", "width"),
        (b"PF\n2.5 2\n-1\n", "byte 3", "width"),
        (b"PF\n2x2\n-1\n", "byte 3", "width"),
        (b"PF\n2 99999999999\n-1\n", "byte 5", "height"),
        (b"PF\n2 2\n", "byte 7", "scale"),
        (b"PF\n2 2\nnan\n", "byte 7", "scale"),
        (b"PF\n2 2\n-inf\n", "byte 7", "scale"),
        (b"PF\n2 2\n0x1\n", "byte 7", "scale"),
        (b"PF\n2 2\n-1", "byte 7", "scale"),
        (b"PF\n2 2\n-0.0\n", "the scale", "other than 0"),
        (b"PF\n2 2\n1e-999\n", "the scale", "other than 0"),
        (b"PF\n2 2\n1e99\n", "the scale", "other than 0"),
        (b"PF\n# " + b"a" * 20000 + b"\n2 2\n-1\n", "byte 3", "width"),
        (b"PF" + b" " * 30000 + b"2 2\n-1\n", "byte 16384", "width"),
    ],
)
def test_a_damaged_header_is_reported_by_place_and_word(tmp_path, header, where, expected):
    with pytest.raises(FormatError) as refused:
        files.read_radiance(saved(tmp_path, header, packed("<")[:0] if header.endswith(b"-1") else packed("<")))
    assert refused.value.where == where
    assert expected in refused.value.expected
    assert "\n" not in str(refused.value)


def test_line_ends_turned_to_dos_are_reported(tmp_path):
    line_feeds = struct.pack("<I", 0x3F0A0A0A) * 12
    path = saved(tmp_path, b"", (b"PF\n2 2\n-1.0\n" + line_feeds).replace(b"\n", b"\r\n"))
    with pytest.raises(FormatError, match="converted to CR LF"):
        files.read_radiance(path)


@pytest.mark.parametrize(
    ("size", "message"),
    [
        (b"0 2", "0 x 2 pixels"),
        (b"70000 1", "70000 x 1 pixels"),
        (b"60000 60000", "60000 x 60000"),
        (b"9999 9999", "cannot hold"),
    ],
)
def test_a_header_that_claims_too_much_is_refused_before_anything_is_allocated(tmp_path, size, message, monkeypatch):
    path = saved(tmp_path, b"PF\n" + size + b"\n-1.0\n", bytes(64))
    monkeypatch.setattr(np, "empty", lambda *_: pytest.fail("allocated"))
    for salvage in (False, True):
        with pytest.raises(UnreadableFile, match=message):
            files.read_radiance(path, ReadOptions(salvage=salvage))


def test_openimageio_reads_what_is_written_upside_down(tmp_path, numbered):
    oiio = pytest.importorskip("OpenImageIO")
    for name, encoding in (("little", PFM()), ("big", PFM(big_endian=True))):
        path = tmp_path / f"{name}.pfm"
        files.write(path, RadianceMap(numbered), encoding)
        found = oiio.ImageInput.open(str(path)).read_image(oiio.FLOAT)
        np.testing.assert_array_equal(found[::-1], numbered)  # it does not turn the rows


def test_pillow_reads_what_is_written_in_grey(tmp_path, numbered):
    image = pytest.importorskip("PIL.Image")
    grey = np.repeat(numbered[..., :1], 3, axis=2)
    for name, encoding in (("little", PFM(grey=True)), ("big", PFM(grey=True, big_endian=True))):
        path = tmp_path / f"{name}.pfm"
        files.write(path, RadianceMap(grey), encoding)
        np.testing.assert_array_equal(np.asarray(image.open(path)), grey[..., 0])


def test_what_opencv_writes_is_read(tmp_path, numbered):
    assert cv2.imwrite(str(tmp_path / "theirs.pfm"), numbered[..., ::-1])
    np.testing.assert_array_equal(files.read_radiance(tmp_path / "theirs.pfm").radiance, numbered)


def test_the_samples_have_the_values_that_their_notes_give(shared):
    folder = shared / "data" / "formats" / "pfm"
    plain = files.read_radiance(folder / "hopper.pfm").radiance
    assert (plain.shape, plain.max()) == ((128, 128, 3), 255)
    with pytest.warns(UserWarning, match="its scale is 2.5"):
        scaled = files.read_radiance(folder / "hopper_be.pfm").radiance
    np.testing.assert_array_equal(scaled, 2.5 * plain)
    for name in ("test-1.pfm", "test-2.pfm"):
        np.testing.assert_array_equal(files.read_radiance(folder / name).radiance, by_opencv(folder / name))
