"""KTX 2.0 cubes against literal bytes of the format, round trips and damage."""

import struct

import numpy as np
import pytest

from relume.errors import OutputNotWritten, UnreadableFile
from relume.image.files import read_radiance
from relume.image.files.textures.ktx2 import read_cube, write_cube, write_cube_hdr

HALF, FLOAT = "VK_FORMAT_R16G16B16A16_SFLOAT", "VK_FORMAT_R32G32B32A32_SFLOAT"

# Every byte before the levels of a half cube of 2 × 2 and 1 × 1, from the KTX 2.0 and Data Format specifications.
HEADER = """
    AB 4B 54 58 20 32 30 BB 0D 0A 1A 0A
    61 00 00 00  02 00 00 00                 vkFormat 97, typeSize 2
    02 00 00 00  02 00 00 00  00 00 00 00    width, height, depth
    00 00 00 00  06 00 00 00  02 00 00 00    layers, faces, levels
    00 00 00 00                              no supercompression
    80 00 00 00  5C 00 00 00                 descriptor at 128, 92 bytes
    DC 00 00 00  30 00 00 00                 keys at 220, 48 bytes
    00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00
    40 01 00 00 00 00 00 00  C0 00 00 00 00 00 00 00  C0 00 00 00 00 00 00 00    level 0 at 320, 192 bytes
    10 01 00 00 00 00 00 00  30 00 00 00 00 00 00 00  30 00 00 00 00 00 00 00    level 1 at 272, 48 bytes
    5C 00 00 00                              92
    00 00 00 00  02 00 58 00                 vendor and type 0, version 2, block of 88
    01 01 01 00                              RGBSDA, BT.709, linear, straight alpha
    00 00 00 00  08 00 00 00 00 00 00 00     1 × 1 texels of 8 bytes
    00 00 0F C0  00 00 00 00  00 00 80 BF  00 00 80 3F    red: bit 0, 16 bits, signed float, −1 to 1
    10 00 0F C1  00 00 00 00  00 00 80 BF  00 00 80 3F
    20 00 0F C2  00 00 00 00  00 00 80 BF  00 00 80 3F
    30 00 0F CF  00 00 00 00  00 00 80 BF  00 00 80 3F
    12 00 00 00  4B 54 58 6F 72 69 65 6E 74 61 74 69 6F 6E 00  72 64 00  00 00    KTXorientation rd
    11 00 00 00  4B 54 58 77 72 69 74 65 72 00  72 65 6C 75 6D 65 00  00 00 00    KTXwriter relume
    00 00 00 00                              padding to a texel
"""


def literal(text):
    lines = (line.strip().split("    ")[0] for line in text.strip().splitlines())
    return bytes.fromhex("".join(lines))


def pyramid(size, seed=0, scale=1.0):
    random = np.random.default_rng(seed)
    sizes = [size >> level for level in range(size.bit_length())]
    return [(scale * random.random((6, s, s, 3))).astype(np.float32) for s in sizes]


def damaged(tmp_path, place, new):
    path = tmp_path / "cube.ktx2"
    write_cube(path, pyramid(2))
    data = bytearray(path.read_bytes())
    data[place : place + len(new)] = new
    path.write_bytes(data)
    return path


def test_every_byte_before_the_levels_is_the_specification_s(tmp_path):
    assert write_cube(tmp_path / "cube.ktx2", pyramid(2)) == HALF
    data = (tmp_path / "cube.ktx2").read_bytes()
    assert data[:272] == literal(HEADER)
    assert len(data) == 512


def test_the_smallest_level_is_first_and_faces_rows_and_columns_follow(tmp_path):
    large = np.arange(72, dtype=np.float32).reshape(6, 2, 2, 3)
    small = 100 + np.arange(18, dtype=np.float32).reshape(6, 1, 1, 3)
    write_cube(tmp_path / "cube.ktx2", [large, small])
    data = (tmp_path / "cube.ktx2").read_bytes()
    assert np.frombuffer(data, "<f2", 8, 272).tolist() == [100, 101, 102, 1, 103, 104, 105, 1]
    assert np.frombuffer(data, "<f2", 96, 320)[:12].tolist() == [0, 1, 2, 1, 3, 4, 5, 1, 6, 7, 8, 1]


def test_a_float_file_describes_itself(tmp_path):
    assert write_cube(tmp_path / "cube.ktx2", pyramid(4, scale=1e6)) == FLOAT
    data = (tmp_path / "cube.ktx2").read_bytes()
    assert struct.unpack_from("<9I", data, 12) == (109, 4, 4, 4, 0, 0, 6, 3, 0)
    descriptor = struct.unpack_from("<I", data, 48)[0]
    assert struct.unpack_from("<7I", data, descriptor) == (92, 0, 2 | 88 << 16, 0x00010101, 0, 16, 0)
    words = [struct.unpack_from("<I", data, descriptor + 28 + 16 * sample)[0] for sample in range(4)]
    assert words == [0xC01F0000, 0xC11F0020, 0xC21F0040, 0xCF1F0060]
    for level in range(3):
        offset, length, whole = struct.unpack_from("<3Q", data, 80 + 24 * level)
        assert offset % 16 == 0
        assert length == whole == 6 * (4 >> level) ** 2 * 16


@pytest.mark.parametrize("levels", [pyramid(8), pyramid(3)[:1], pyramid(8)[:2]], ids=["whole", "one", "two"])
def test_halves_come_back_as_halves(tmp_path, levels):
    assert write_cube(tmp_path / "cube.ktx2", levels) == HALF
    back = read_cube(tmp_path / "cube.ktx2")
    assert [level.dtype for level in back] == [np.float32] * len(levels)
    for level, original in zip(back, levels, strict=True):
        assert np.array_equal(level, original.astype(np.float16).astype(np.float32))


@pytest.mark.parametrize(
    ("largest", "kind"),
    [(65504.0, HALF), (65504.1, FLOAT), (3e38, FLOAT), (6.2e-5, HALF), (5e-5, FLOAT), (1e-30, FLOAT), (0.0, HALF)],
)
def test_what_halves_cannot_hold_is_stored_as_float(tmp_path, largest, kind):
    level = np.full((6, 1, 1, 3), np.float32(largest) / 4, np.float32)
    level[3, 0, 0, 1] = largest
    assert write_cube(tmp_path / "cube.ktx2", [level]) == kind
    (back,) = read_cube(tmp_path / "cube.ktx2")
    assert np.array_equal(back, level) if kind == FLOAT else back.max() == pytest.approx(largest, rel=1 / 2048)


@pytest.mark.parametrize(
    ("levels", "said"),
    [
        ([], "expected"),
        ([np.zeros((6, 2, 3, 3))], "expected"),
        ([np.zeros((6, 2, 2, 4))], "expected"),
        ([np.zeros((6, 4, 4, 3)), np.zeros((6, 1, 1, 3))], "expected"),
        ([np.zeros((6, 1, 1, 3)), np.zeros((6, 0, 0, 3))], "expected"),
        ([np.full((6, 1, 1, 3), np.nan)], "18 values"),
        ([np.full((6, 1, 1, 3), np.inf)], "18 values"),
        ([np.full((6, 1, 1, 3), 1e39)], "18 values"),
    ],
)
def test_what_is_no_cube_is_refused(tmp_path, levels, said):
    with pytest.raises(ValueError, match=said):
        write_cube(tmp_path / "cube.ktx2", levels)
    assert list(tmp_path.iterdir()) == []


def test_a_cube_that_cannot_be_written_is_reported(tmp_path):
    with pytest.raises(OutputNotWritten, match="does not exist"):
        write_cube(tmp_path / "none" / "cube.ktx2", pyramid(1))


@pytest.mark.parametrize(
    ("place", "new", "said"),
    [
        (5, b"1", "no KTX 2.0 file"),
        (12, b"\x25", "vkFormat is 37"),
        (20, b"\x00", "0 x 2 x 0 pixels"),
        (28, b"\x01", "2 x 2 x 1 pixels"),
        (32, b"\x02", "2 layer"),
        (36, b"\x01", "1 face"),
        (40, b"\x03", "levelCount: expected at most 2 for 2 pixels, found 3"),
        (40, b"\xff\xff\xff\xff", "levelCount: .* found 4294967295"),
        (44, b"\x02", "supercompressed"),
        (20, b"\xff\xff\xff\x7f\xff\xff\xff\x7f", "its header claims"),
        (80, b"\xff\xff\xff\xff\xff\xff\xff\xff", "level 0: expected .* bytes from byte 18446744073709551615"),
        (88, b"\xbf", "level 0: expected 192 bytes of 6 faces, found 191 bytes"),
    ],
)
def test_another_or_a_damaged_file_is_reported_in_one_line(tmp_path, place, new, said):
    with pytest.raises(UnreadableFile, match=said) as caught:
        read_cube(damaged(tmp_path, place, new))
    assert "\n" not in str(caught.value)
    assert "cube.ktx2" in str(caught.value)


def test_a_file_cut_anywhere_is_reported(tmp_path):
    path = tmp_path / "cube.ktx2"
    write_cube(path, pyramid(2))
    data = path.read_bytes()
    for length in range(len(data)):
        path.write_bytes(data[:length])
        with pytest.raises(UnreadableFile):
            read_cube(path)


def test_a_missing_file_is_reported(tmp_path):
    with pytest.raises(UnreadableFile, match="cannot be opened"):
        read_cube(tmp_path / "none.ktx2")
    with pytest.raises(UnreadableFile, match="cannot be opened"):
        read_cube(tmp_path)


def test_alpha_that_is_left_out_is_reported(tmp_path):
    path = damaged(tmp_path, 320 + 6, b"\x00\x38")  # ½ for the first texel's alpha
    with pytest.warns(UserWarning, match="1 texels are not opaque"):
        assert read_cube(path)[0].shape == (6, 2, 2, 3)


def test_strips_hold_the_faces_below_each_other_one_file_a_level(tmp_path):
    levels = [np.arange(1, 73, dtype=np.float32).reshape(6, 2, 2, 3), np.ones((6, 1, 1, 3), np.float32)]
    written = write_cube_hdr(tmp_path / "room.hdr", levels, unit="cd/m²")
    assert [path.name for path in written] == ["room_0.hdr", "room_1.hdr"]
    strip = read_radiance(written[0])
    assert strip.size == (2, 12)
    assert strip.unit == "cd/m²"
    assert np.array_equal(strip.radiance.reshape(6, 2, 2, 3), levels[0])
    assert read_radiance(written[1]).size == (1, 6)


def test_strips_are_hdr_and_hold_light(tmp_path):
    with pytest.raises(ValueError, match=r"\.exr"):
        write_cube_hdr(tmp_path / "room.exr", pyramid(1))
    with pytest.raises(ValueError, match="negative"):
        write_cube_hdr(tmp_path / "room.hdr", [np.full((6, 1, 1, 3), -1.0)])
