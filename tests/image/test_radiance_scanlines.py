"""Runs of Radiance scan lines, by bytes written by hand and against slow twins of the loops."""

import numpy as np
import pytest

from relume.errors import FormatError
from relume.image.files import read, read_radiance, write
from relume.image.files.encodings import RadianceHDR
from relume.image.files.hdr.radiance_hdr import subtype
from relume.image.radiance import RadianceMap
from rgbe import encode

HEADER = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"


def picture(path, pixels, resolution):
    path.write_bytes(HEADER + f"{resolution}\n".encode() + bytes(pixels))
    return path


def pixels_of(path) -> bytes:
    data = path.read_bytes()
    return data[data.index(b"\n", data.index(b"\n\n") + 2) + 1 :]


# --- Reading


def test_new_runs_are_read_with_repeats_and_literals(tmp_path):
    line = [2, 2, 0, 8, 128 + 8, 7, 8, *range(8), 128 + 3, 9, 5, *range(5), 128 + 8, 136]
    path = picture(tmp_path / "a.hdr", line * 2, "-Y 2 +X 8")
    image = read_radiance(path)
    assert image.radiance[1, :, 0].tolist() == [7] * 8
    assert image.radiance[1, :, 1].tolist() == list(range(8))
    assert image.radiance[1, :, 2].tolist() == [9, 9, 9, 0, 1, 2, 3, 4]
    assert subtype(path) == "RGBE, new runs"


def test_old_runs_count_in_powers_of_256(tmp_path):
    pixels = [5, 6, 7, 136, 1, 1, 1, 2, 1, 1, 1, 1, 8, 8, 8, 136]
    path = picture(tmp_path / "a.hdr", pixels, "-Y 1 +X 260")
    assert read_radiance(path).radiance[0].tolist() == [[5, 6, 7]] * 259 + [[8, 8, 8]]
    assert subtype(path) == "RGBE, old runs"


def test_old_runs_of_three_digits_and_of_none_before_another_pixel(tmp_path):
    digits = [5, 6, 7, 136, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 1]  # 0 + 0·256 + 1·65536, less one too many
    with pytest.raises(FormatError, match="a run that stays within the line of 65536 pixels"):
        read(picture(tmp_path / "a.hdr", digits, "-Y 1 +X 65536"))
    pixels = [5, 6, 7, 136, 1, 1, 1, 0, 9, 9, 9, 136, 1, 1, 1, 1]
    assert read_radiance(picture(tmp_path / "a.hdr", pixels, "-Y 1 +X 3")).radiance[0, :, 0].tolist() == [5, 9, 9]


def test_one_picture_may_mix_all_three_kinds_of_lines(tmp_path):
    new = [2, 2, 0, 8, *[128 + 8, 3] * 3, 128 + 8, 136]
    old = [4, 4, 4, 136, 1, 1, 1, 7]
    flat = [5, 5, 5, 136] * 8
    image = read_radiance(picture(tmp_path / "a.hdr", new + old + flat + new, "-Y 4 +X 8"))
    assert image.radiance[:, :, 2].tolist() == [[3] * 8, [4] * 8, [5] * 8, [3] * 8]


@pytest.mark.parametrize(("width", "first"), [(7, (2, 2, 0, 7)), (8, (2, 2, 128, 8)), (32768, (2, 2, 128, 0))])
def test_lines_whose_length_new_runs_cannot_say_are_flat_whatever_they_begin_with(tmp_path, width, first):
    codes = np.full((1, width, 4), 136, np.uint8)
    codes[0, 0] = first
    image = read_radiance(picture(tmp_path / "a.hdr", codes.tobytes(), f"-Y 1 +X {width}"))
    assert image.radiance[0, 1].tolist() == [136] * 3
    assert image.radiance[0, 0, 0] == 2.0 * 2.0 ** (first[3] - 136) * (first[3] > 0)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ([2, 2, 0, 8, 128 + 9, 7], "byte 49: expected a run that stays within the line of 8 pixels"),
        ([2, 2, 0, 8, 9, *range(9)], "byte 49: expected a run that stays within the line of 8 pixels"),
        ([2, 2, 0, 8, 0], "byte 49: expected a run of 1 byte or more"),
        ([2, 2, 0, 8, 128 + 8], "byte 50: expected 8 pixels, found the end of the file"),
        ([2, 2, 0, 8, 8, 1], "byte 51: expected 8 pixels, found the end of the file"),
        ([2, 2, 0, 9, 128 + 8, 7], "byte 45: expected a line of 8 pixels, found the mark of another length"),
        ([2, 2, 0], "byte 48: expected 8 pixels, found the end of the file"),
    ],
)
def test_damaged_new_runs_are_refused(tmp_path, line, complaint):
    with pytest.raises(FormatError, match=f"scan line 1 of 2, {complaint}"):
        read(picture(tmp_path / "a.hdr", line, "-Y 2 +X 8"))


# --- Writing


def test_written_runs_are_these_bytes(tmp_path):
    # Mantissas are the values at exponent 136, which the 200 in blue sets.
    red = [1, 2, 3, 3, 3, 3, 3, 9, 9, 9]
    green = [0] * 10
    codes = np.stack([red, green, [200] * 10], axis=-1)
    write(tmp_path / "a.hdr", RadianceMap(codes[None].astype(np.float32)))
    assert list(pixels_of(tmp_path / "a.hdr")) == [
        *(2, 2, 0, 10),
        *(2, 1, 2, 128 + 5, 3, 3, 9, 9, 9),  # three alike are no run
        *(128 + 10, 0),
        *(128 + 10, 200),
        *(128 + 10, 136),
    ]


def test_runs_are_at_most_127_and_literals_128_bytes_long(tmp_path):
    width = 260
    codes = np.zeros((1, width, 3), np.float32)
    codes[0, :, 0] = np.arange(width) % 2 + 128
    codes[0, :, 1] = 7
    write(tmp_path / "a.hdr", RadianceMap(codes))
    stored = list(pixels_of(tmp_path / "a.hdr"))
    alternating = [128, 129] * 64
    assert stored[:4] == [2, 2, 1, 4]
    assert stored[4:267] == [128, *alternating, 128, *alternating, 4, *alternating[:4]]
    assert stored[267:273] == [255, 7, 255, 7, 128 + 6, 7]


@pytest.mark.parametrize(("width", "form"), [(7, "flat"), (8, "new runs"), (32767, "new runs"), (32768, "flat")])
def test_lines_are_compressed_where_their_length_can_be_reported(tmp_path, width, form):
    image = RadianceMap(np.full((2, width, 3), 3, np.float32))
    write(tmp_path / "a.hdr", image)
    assert subtype(tmp_path / "a.hdr") == f"RGBE, {form}"
    assert (len(pixels_of(tmp_path / "a.hdr")) == 8 * width) == (form == "flat")
    np.testing.assert_array_equal(read_radiance(tmp_path / "a.hdr").radiance, image.radiance)


def test_flat_pictures_are_the_codes_alone(tmp_path, numbered):
    write(tmp_path / "a.hdr", RadianceMap(numbered), RadianceHDR(compressed=False))
    assert pixels_of(tmp_path / "a.hdr") == encode(numbered).tobytes()


# --- Slow twins


def slow_codes(radiance: np.ndarray) -> np.ndarray:
    """(..., 4) uint8: m·2^(e − 136) nearest to each channel, with the least exponent that the largest fits."""
    values = radiance.astype(np.float64)
    largest = values.max(axis=-1)
    exponent = np.maximum(np.frexp(largest)[1] + 128, 1)
    exponent += np.rint(np.ldexp(largest, 136 - exponent)) > 255
    codes = np.concatenate([np.rint(np.ldexp(values, 136 - exponent[..., None])), exponent[..., None]], axis=-1)
    codes[codes[..., :3].max(axis=-1) < 128] = 0
    return codes.astype(np.uint8)


def slow_runs(row: bytes) -> bytes:
    """One plane of a line: runs of 4 to 127 equal bytes where they begin first, and literals of at most 128 between."""
    out, pending, place = bytearray(), bytearray(), 0
    while True:
        count = 0
        while place + count < len(row) and count < 127 and row[place + count] == row[place]:
            count += 1
        if place < len(row) and count < 4:
            pending += row[place : place + count]
            place += count
            continue
        for begin in range(0, len(pending), 128):
            literal = pending[begin : begin + 128]
            out += bytes([len(literal)]) + literal
        pending.clear()
        if place == len(row):
            return bytes(out)
        out += bytes([128 + count, row[place]])
        place += count


def slow_lines(data: bytes, lines: int, length: int) -> np.ndarray:
    """(lines, length, 4) uint8 of new runs."""
    codes, place = [], 0
    for _ in range(lines):
        place += 4
        row = bytearray()
        while len(row) < 4 * length:
            count = data[place]
            row += data[place + 1 : place + 2] * (count - 128) if count > 128 else data[place + 1 : place + 1 + count]
            place += 2 if count > 128 else 1 + count
        codes.append(np.frombuffer(row, np.uint8).reshape(4, length).T)
    return np.stack(codes)


def test_codes_equal_those_of_a_slow_twin_over_the_whole_range():
    random = np.random.default_rng(3)
    pixels = np.exp2(random.uniform(-140, 126.9, (20000, 1))) * random.uniform(0, 1, (20000, 3)) ** 4
    pixels = pixels.astype(np.float32)
    np.testing.assert_array_equal(encode(pixels), slow_codes(pixels))


def test_runs_equal_those_of_a_slow_twin(tmp_path):
    random = np.random.default_rng(4)
    for width in (8, 9, 130, 700):
        codes = random.integers(1, 255, (40, width, 3))
        codes = np.repeat(codes, random.integers(1, 6, width), axis=1)[:, :width]
        codes[:, width // 2 :, 1] = 5
        codes[3:6] = codes[3:6, :1]
        write(tmp_path / "a.hdr", RadianceMap(codes.astype(np.float32)))
        stored = pixels_of(tmp_path / "a.hdr")
        rows = encode(codes.astype(np.float32))
        mark = bytes([2, 2, width >> 8, width & 255])
        assert stored == b"".join(mark + b"".join(slow_runs(plane.tobytes()) for plane in row.T) for row in rows)
        np.testing.assert_array_equal(slow_lines(stored, 40, width), rows)
        decoded = np.ldexp(rows[..., :3].astype(np.float32), rows[..., 3:].astype(int) - 136)
        np.testing.assert_array_equal(read_radiance(tmp_path / "a.hdr").radiance, decoded)


def test_a_picture_of_many_stretches_is_whole_in_every_form_and_order(tmp_path):
    # Wider than what one thread takes at a time, so that stretches of it are decoded side by side.
    random = np.random.default_rng(6)
    codes = random.integers(1, 256, (300, 2000, 3)).astype(np.float32)
    codes[:, ::3] = 130
    codes[..., 0] = np.maximum(codes[..., 0], 128)
    for encoding in (RadianceHDR(), RadianceHDR(compressed=False)):
        write(tmp_path / "a.hdr", RadianceMap(codes), encoding)
        np.testing.assert_array_equal(read_radiance(tmp_path / "a.hdr").radiance, codes)
        turned = (tmp_path / "a.hdr").read_bytes().replace(b"\n-Y 300 +X 2000\n", b"\n-X 300 -Y 2000\n")
        (tmp_path / "b.hdr").write_bytes(turned)
        np.testing.assert_array_equal(read_radiance(tmp_path / "b.hdr").radiance, codes.swapaxes(0, 1)[:, ::-1])


def test_a_view_of_a_picture_is_written_like_its_copy(tmp_path, numbered):
    for view in (numbered[::-1, ::2], np.asfortranarray(numbered), numbered.swapaxes(0, 1)):
        write(tmp_path / "a.hdr", RadianceMap(view))
        write(tmp_path / "b.hdr", RadianceMap(np.ascontiguousarray(view)))
        assert (tmp_path / "a.hdr").read_bytes() == (tmp_path / "b.hdr").read_bytes()
