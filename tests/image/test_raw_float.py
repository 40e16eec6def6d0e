"""Raw float files: nothing in them says the size or the byte order, and nothing is guessed that could be otherwise."""

import gzip
import struct
import warnings
import zlib
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import relume.image.files as files
from relume.errors import FormatError, UnreadableFile
from relume.image.files import raw_float
from relume.image.files.encodings import RawFloat
from relume.image.files.read_options import ReadOptions
from relume.image.radiance import OUTSIDE, RadianceMap

BITS = [0, 1 << 31, 1, 0x807FFFFF, 0x7F7FFFFF, 0xFF7FFFFF, 0x7F800000, 0xFF800000, 0x7FC00000, 0x7F800001, 0xFFC12345]
ODD = np.resize(np.array(BITS, np.uint32), (3, 3, 3)).view(np.float32)


def saved(folder: Path, data: bytes, name: str = "probe.float") -> Path:
    path = folder / name
    path.write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
    return path


@pytest.fixture
def square() -> np.ndarray:
    """(4, 4, 3) float32 with random mantissas, as light has."""
    return np.random.default_rng(3).lognormal(0, 2, (4, 4, 3)).astype(np.float32)


def bits(radiance: np.ndarray) -> list[int]:
    return np.ascontiguousarray(radiance).view(np.uint32).ravel().tolist()


@pytest.mark.parametrize("name", ["probe.float", "probe.float.gz", "PROBE.FLOAT.GZ"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_square_picture_is_read_in_either_order_top_row_first(tmp_path, square, name, order):
    path = tmp_path / name
    data = square.astype(f"{order}f4").tobytes()
    path.write_bytes(gzip.compress(data) if name.lower().endswith(".gz") else data)
    found = files.read_radiance(path)
    np.testing.assert_array_equal(found.radiance, square)
    assert found.radiance.dtype == np.float32
    assert raw_float.subtype(path).startswith("little-endian, colour" if order == "<" else "big-endian, colour")


def test_written_bytes_are_literally_these(tmp_path):
    image = RadianceMap(np.array([[[1, 2, 0.5]]], np.float32))
    files.write(tmp_path / "little.float", image)
    files.write(tmp_path / "big.float", image, RawFloat(big_endian=True))
    assert (tmp_path / "little.float").read_bytes() == bytes.fromhex("0000803f 00000040 0000003f")
    assert (tmp_path / "big.float").read_bytes() == bytes.fromhex("3f800000 40000000 3f000000")


@pytest.mark.parametrize("name", ["odd.float", "odd.float.gz"])
@pytest.mark.parametrize("big_endian", [False, True])
def test_every_bit_comes_back(tmp_path, name, big_endian):
    files.write(tmp_path / name, RadianceMap(ODD), RawFloat(big_endian))
    options = ReadOptions(float_order="big" if big_endian else "little")
    assert bits(files.read_radiance(tmp_path / name, options).radiance) == bits(ODD)


def test_other_programs_unpack_what_is_written(tmp_path, square):
    files.write(tmp_path / "probe.float.gz", RadianceMap(square))
    data = (tmp_path / "probe.float.gz").read_bytes()
    assert gzip.decompress(data) == square.astype("<f4").tobytes()
    assert data[4:8] == bytes(4)  # no time: the same picture gives the same file


def test_a_map_of_many_rows_keeps_their_order(tmp_path):
    radiance = np.arange(1, 600 * 2 * 3 + 1, dtype=np.float32).reshape(600, 2, 3)
    for name in ("tall.float", "tall.float.gz"):
        with pytest.warns(UserWarning, match=r"--float-size 2x600"):
            files.write(tmp_path / name, RadianceMap(radiance))
        found = files.read_radiance(tmp_path / name, ReadOptions(float_size=(2, 600)))
        np.testing.assert_array_equal(found.radiance, radiance)


def test_the_size_may_be_given(tmp_path, numbered):
    path = saved(tmp_path, numbered.astype("<f4").tobytes())
    np.testing.assert_array_equal(files.read_radiance(path, ReadOptions(float_size=(7, 5))).radiance, numbered)
    assert raw_float.subtype(path, ReadOptions(float_size=(7, 5))) == "little-endian, colour"


def test_a_given_size_that_does_not_fit_is_refused(tmp_path, numbered):
    path = saved(tmp_path, numbered.astype("<f4").tobytes())
    with pytest.raises(FormatError, match=r"expected 432 bytes of three channels, or 144 of one, for 6 x 6.*found 420"):
        files.read_radiance(path, ReadOptions(float_size=(6, 6)))
    for salvage in (False, True):
        with pytest.raises(FormatError, match="found 420"):
            files.read_radiance(path, ReadOptions(float_size=(5, 5), salvage=salvage))
    with pytest.raises(ValueError, match=r"float_size is \(0, 5\)"):
        files.read_radiance(path, ReadOptions(float_size=(0, 5)))


def test_without_a_size_an_oblong_is_refused_and_its_pixels_reported(tmp_path, numbered):
    path = saved(tmp_path, numbered.astype("<f4").tobytes())
    with pytest.raises(UnreadableFile, match=r"35 pixels of three channels.*give it, --float-size WIDTHxHEIGHT"):
        files.read_radiance(path)


def test_a_grey_square_is_reported_where_no_coloured_picture_has_its_length(tmp_path):
    values = np.arange(1, 17, dtype="<f4")
    path = saved(tmp_path, values.tobytes())
    found = files.read_radiance(path).radiance
    np.testing.assert_array_equal(found, np.repeat(values.reshape(4, 4, 1), 3, axis=2))
    assert raw_float.subtype(path) == "little-endian, grey, taken for square"


def test_a_length_that_two_shapes_have_is_asked_for(tmp_path):
    values = np.arange(1, 37, dtype="<f4")  # 6 x 6 grey, or 12 pixels in colour
    path = saved(tmp_path, values.tobytes())
    with pytest.raises(UnreadableFile, match="12 pixels of three channels, or 36 of one"):
        files.read_radiance(path)
    grey = files.read_radiance(path, ReadOptions(float_size=(6, 6))).radiance
    np.testing.assert_array_equal(grey[..., 1].ravel(), values)
    colour = files.read_radiance(path, ReadOptions(float_size=(4, 3))).radiance
    np.testing.assert_array_equal(colour.ravel(), values)


def test_no_length_is_that_of_two_squares():
    grey, colour = ({channels * 4 * side * side for side in range(1, 4000)} for channels in (1, 3))
    assert not grey & colour


def test_a_length_of_broken_floats_is_damage(tmp_path):
    with pytest.raises(FormatError, match="a multiple of 4 bytes, found 13"):
        files.read_radiance(saved(tmp_path, bytes(13)))


def test_a_black_picture_has_no_order_and_needs_none(tmp_path):
    assert not files.read_radiance(saved(tmp_path, bytes(48))).radiance.any()


def test_values_that_make_sense_in_both_orders_are_asked_for(tmp_path):
    both = bytes.fromhex("3f00003f") * 12  # 0.5 and a little, from either end
    path = saved(tmp_path, both)
    with pytest.raises(
        UnreadableFile,
        match=r"both byte orders \(100% as little-endian and 100% as big-endian\); give --float-order little or big",
    ):
        files.read_radiance(path)
    found = files.read_radiance(path, ReadOptions(float_order="big")).radiance
    assert found[0, 0, 0] == struct.unpack(">f", both[:4])[0]


def test_values_that_make_sense_in_neither_order_are_asked_for(tmp_path):
    path = saved(tmp_path, np.random.default_rng(1).bytes(12 * 16 * 16))
    with pytest.raises(UnreadableFile, match="neither byte order"):
        files.read_radiance(path)
    assert raw_float.subtype(path) == "colour, taken for square"


def test_a_gzip_file_without_its_ending_is_reported(tmp_path, square):
    data = gzip.compress(square.astype("<f4").tobytes())
    data += bytes.fromhex("ff") * (-len(data) % 4)
    path = saved(tmp_path, data[: len(data) // 4 * 4])
    options = ReadOptions(float_size=(1, len(path.read_bytes()) // 4))
    with pytest.raises(UnreadableFile, match=r"neither byte order .*\(\.gz is for gzipped ones\)"):
        files.read_radiance(path, options)


def test_the_order_is_shown_by_one_lit_pixel_in_a_black_picture(tmp_path):
    radiance = np.zeros((400, 400, 3), np.float32)
    radiance[123, 321] = 0.3, 17, 1 / 3
    orders: tuple[tuple[str, Literal["little", "big"]], ...] = (("<", "little"), (">", "big"))
    for order, name in orders:
        path = saved(tmp_path, radiance.astype(f"{order}f4").tobytes())
        with pytest.warns(UserWarning, match=f"{name}-endian by a guess: of its values, 3 different ones, 100% make"):
            np.testing.assert_array_equal(files.read_radiance(path).radiance, radiance)
        np.testing.assert_array_equal(files.read_radiance(path, ReadOptions(float_order=name)).radiance, radiance)


def test_a_picture_that_was_written_here_and_is_taken_for_the_other_order_is_reported(tmp_path):
    """Light of 1e-20, which as big-endian is more likely than it is as it was written."""
    value = np.frombuffer(bytes.fromhex("3f80601e"), "<f4")[0]  # 1.2e-20, or 1.003 from the other end
    files.write(tmp_path / "a.float", RadianceMap(np.full((40, 40, 3), value, np.float32)))
    with pytest.warns(UserWarning, match="big-endian by a guess: of its values, 1 different ones, 100%.*or little$"):
        assert files.read_radiance(tmp_path / "a.float").radiance[0, 0, 0] > 1


@pytest.mark.parametrize("order", ["<", ">"])
def test_an_even_picture_is_clear_where_its_value_is_no_number_the_other_way(tmp_path, order):
    path = saved(tmp_path, np.full(48, 0.5, f"{order}f4").tobytes())
    assert files.read_radiance(path).radiance.min() == 0.5  # and no warning


@pytest.mark.parametrize(("share", "clear"), [(0.005, True), (0.05, False)])
def test_a_few_stray_values_leave_the_order_clear_and_more_do_not(tmp_path, share, clear):
    random = np.random.default_rng(7)
    radiance = random.lognormal(0, 2, (64, 64, 3)).astype(np.float32)
    radiance[random.random(radiance.shape) < share] = 1e-30
    path = saved(tmp_path, radiance.astype("<f4").tobytes())
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        np.testing.assert_array_equal(files.read_radiance(path).radiance, radiance)
    assert len(said) == (0 if clear else 1)


def test_values_of_which_half_make_sense_in_the_other_order_are_reported(tmp_path):
    radiance = np.random.default_rng(8).lognormal(0, 2, (32, 32, 3)).astype(np.float32)
    both = radiance.reshape(-1)[: 32 * 32 * 3 // 5 * 3]
    both[:] = (both.view(np.uint32) & 0xFFFFFF00 | 0x3F).view(np.float32)
    with pytest.warns(UserWarning, match="little-endian by a guess: .* 100% make sense so, [67].% the other way"):
        files.read_radiance(saved(tmp_path, radiance.astype("<f4").tobytes()))


def test_some_values_that_no_light_has_do_not_hide_the_order(tmp_path, square):
    square[0, 0] = np.nan, np.inf, 1e-40
    for order, name in (("<", "little"), (">", "big")):
        path = saved(tmp_path, square.astype(f"{order}f4").tobytes())
        with pytest.warns(UserWarning, match=f"{name}-endian by a guess: of its values, 48 different ones, 94% make"):
            assert bits(files.read_radiance(path).radiance) == bits(square)


@pytest.mark.parametrize("name", ["probe.float", "probe.float.gz"])
def test_a_file_that_ends_early_is_refused_or_read_as_far_as_it_goes(tmp_path, name):
    radiance = np.random.default_rng(5).lognormal(0, 2, (90, 70, 3)).astype(np.float32)
    path = saved(tmp_path, radiance.astype("<f4").tobytes(), name)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(UnreadableFile):
        files.read_radiance(path)
    with pytest.raises(FormatError):
        files.read_radiance(path, ReadOptions(float_size=(70, 90)))
    with pytest.warns(UserWarning, match=r"the last \d+ of 90 rows are missing") as said:
        found = files.read_radiance(path, ReadOptions(float_size=(70, 90), salvage=True))
    there = 90 - int(str(said[0].message).split(" of 90")[0].split()[-1])
    assert 30 < there < 60
    np.testing.assert_array_equal(found.radiance[:there], radiance[:there])
    assert not found.radiance[there:].any()
    assert found.clipped is not None
    assert found.clipped[:there].max() == 0 and found.clipped[there:].min() == OUTSIDE


def packed(data: bytes) -> bytearray:
    return bytearray(gzip.compress(data, mtime=0))


def test_gzip_cut_short_before_a_trailer_that_is_right_is_refused(tmp_path, square):
    stored = zlib.compressobj(0, wbits=31)
    data = stored.compress(square.astype("<f4").tobytes()) + stored.flush()
    path = tmp_path / "probe.float.gz"
    path.write_bytes(data[:100] + data[-4:])
    with pytest.raises(FormatError, match="expected 192 bytes, found the end of the file"):
        files.read_radiance(path)


def test_gzip_that_claims_too_much_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    data = packed(bytes(48))
    monkeypatch.setattr(zlib, "decompressobj", lambda *_: pytest.fail("unpacked"))
    path = tmp_path / "bomb.float.gz"
    for side, message in ((10000, "cannot hold"), (18000, "claims 18000 x 18000 pixels")):
        data[-4:] = struct.pack("<I", 12 * side * side)
        path.write_bytes(data)
        with pytest.raises(UnreadableFile, match=message):
            files.read_radiance(path)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda data: data[:10] + b"\xff" * 8 + data[18:], "near byte 0: expected packed floats"),
        (lambda data: data[:-8] + b"\0\0\0\0" + data[-4:], "check"),
        (lambda data: data + data, "more; unpack it with gunzip"),
        (lambda data: b"PK\3" + data[3:], "expected 1f 8b 08, found 50 4b 03; name it .float"),
        (lambda data: data[:12], "expected 1f 8b 08"),
        (
            lambda _: bytes(packed(bytes(12 * 10**6)))[:-4] + struct.pack("<I", 48),
            "48 bytes unpacked, as they claim, found more",
        ),
        (lambda data: data[:-4] + struct.pack("<I", 300), "length check"),
    ],
)
def test_damaged_gzip_is_reported_in_one_line(tmp_path, square, damage, message):
    path = tmp_path / "probe.float.gz"
    path.write_bytes(damage(bytes(packed(square.astype("<f4").tobytes()))))
    for salvage in (False, True):
        with pytest.raises(FormatError, match=message) as refused:
            files.read_radiance(path, ReadOptions(salvage=salvage))
        assert "\n" not in str(refused.value)
