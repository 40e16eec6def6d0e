"""What an EXR header may claim: every claim is judged before anything is allocated, and refused with its place."""

import os
import re
import struct

import numpy as np
import pytest

from exr_files import FLOAT, HALF, attribute, header, scan_lines, window
from relume.errors import FormatError, UnreadableFile
from relume.image.files import ReadOptions, read_layers, read_radiance
from relume.image.files.exr.header import COMPRESSIONS, read_headers
from relume.image.files.exr.maps import subtype

GREY = [("Y", HALF, 1)]


def saved(path, data):
    path.write_bytes(data)
    return path


def test_the_file_that_is_written_by_hand_is_read(tmp_path):
    pixels = np.arange(12, dtype=np.float32).reshape(3, 4)
    image = read_radiance(saved(tmp_path / "a.exr", scan_lines(4, 3, [("Y", pixels, 1)])))
    np.testing.assert_array_equal(image.radiance[..., 2], pixels)


def test_windows_channels_and_texts_are_reported(tmp_path):
    path = saved(
        tmp_path / "a.exr", header(5, 4, [("R", HALF, 1), ("Z", FLOAT, 2)], attribute("owner", "string", b"me"))
    )
    (part,) = read_headers(path).parts
    assert [(c.name, c.kind, c.x_sampling, c.y_sampling) for c in part.channels] == [
        ("R", "half", 1, 1),
        ("Z", "float", 2, 2),
    ]
    assert (part.data, part.display, part.size, part.deep) == ((0, 0, 4, 3), (0, 0, 4, 3), (5, 4), False)
    assert (part.compression.name, part.texts["owner"]) == ("uncompressed", "me")
    assert read_headers(path).end == path.stat().st_size


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"\x76\x2f\x31\x01", "byte 0, magic number and version: expected 8 bytes"),
        (b"\x76\x2f\x31\x01\x03\0\0\0" + bytes(300), "byte 4, version: expected 2 with known flags, found 3"),
        (b"\x76\x2f\x31\x01\x02\0\x10\0" + bytes(300), "byte 4, version: .*found 2 with flags 0x1000"),
        (b"\x76\x2f\x31\x01\x02\0\0\0\0", 'byte 8, header of part 0: expected the attribute "channels", found none'),
        (b"\x76\x2f\x31\x01\x02\x10\0\0\0", "byte 8, header: expected at least one part"),
        (b"\x76\x2f\x31\x01\x02\0\0\0" + b"x" * 400, "byte 8, name of an attribute: expected at most 255 letters"),
        (
            header(4, 4, GREY)[:60],
            'byte 59, type of the attribute "compression": expected a zero after it, found the end of the',
        ),
        (header(4, 4, []), 'byte 28, "channels": expected at least one channel, found none'),
        (header(4, 4, [("Y", 3, 1)]), 'channel "Y": expected type 0, 1 or 2'),
        (
            header(4, 4, [("Y", HALF, 0)]),
            'channel "Y": expected type 0, 1 or 2 and samplings above 0, found 1 and 0 x 0',
        ),
        (header(4, 4, GREY, compression=14), '"compression": expected a number below 14, found 14'),
        (header(0, 4, GREY), r'"dataWindow": expected a window .*found \(0, 0\) to \(-1, 3\)'),
        (header(4, 2**31, GREY), r'"dataWindow": expected a window'),
        (header(4, 4, GREY, attribute("chromaticities", "x\ny", b""))[:-1], "end of the file"),
    ],
)
def test_a_broken_header_is_refused_with_its_place(tmp_path, data, complaint):
    path = saved(tmp_path / "a.exr", data)
    with pytest.raises(FormatError, match=complaint) as raised:
        read_radiance(path)
    assert "\n" not in str(raised.value)
    assert re.search(r"byte \d+, ", raised.value.where)
    with pytest.raises(FormatError):
        subtype(path)


def test_an_attribute_larger_than_the_file_is_refused_where_it_claims_so(tmp_path):
    data = bytearray(header(4, 4, GREY))
    place = data.index(b"chlist\0") + 7
    data[place : place + 4] = struct.pack("<i", 2**30)
    with pytest.raises(FormatError, match=rf'byte {place}, size of "channels": expected at most \d+, found 1073741824'):
        read_radiance(saved(tmp_path / "a.exr", bytes(data)))


def test_a_name_with_line_breaks_does_not_break_the_line(tmp_path):
    data = b"\x76\x2f\x31\x01\x02\0\0\0" + b"a\nb\0string\0" + struct.pack("<i", -1)
    with pytest.raises(FormatError, match=r"a\\\\?nb") as raised:
        read_radiance(saved(tmp_path / "a.exr", data))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("size", "compression", "limits", "complaint"),
    [
        ((2**17, 1), 3, {}, "its data window claims 131072 x 1 pixels"),
        ((2**15, 2**15), 3, {}, "its data window claims 32768 x 32768 pixels"),
        ((1000, 1000), 3, {"side": 999}, "claims 1000 x 1000 pixels; relume reads sides up to 999"),
        ((1000, 1000), 3, {"pixels": 999_999}, "and 999999 pixels in all"),
        ((1000, 1000), 3, {"decoded": 1_999_999}, "claims 2000000 bytes of pixels"),
        ((2**14, 2**13), 1, {}, r"claims 268435456 bytes of pixels, which \d+ bytes of file cannot hold"),
        ((4, 4), 3, {"metadata": 100}, "a header beyond 100 bytes at its"),
    ],
)
def test_a_claim_beyond_the_limits_is_refused(tmp_path, size, compression, limits, complaint):
    path = saved(tmp_path / "a.exr", header(size[0], size[1], GREY, compression=compression))
    with pytest.raises(UnreadableFile, match=complaint):
        read_radiance(path, ReadOptions(**limits))


def test_more_channels_or_parts_than_allowed_are_refused(tmp_path):
    many = [(f"c{i}", HALF, 1) for i in range(65)]
    with pytest.raises(UnreadableFile, match="more than 64 channels in a part"):
        read_radiance(saved(tmp_path / "a.exr", header(4, 4, many)))
    part = header(4, 4, GREY, attribute("type", "string", b"scanlineimage"))[8:]
    parts = b"\x76\x2f\x31\x01\x02\x10\0\0" + part * 3 + b"\0"
    with pytest.raises(UnreadableFile, match="more than 2 parts"):
        read_radiance(saved(tmp_path / "b.exr", parts), ReadOptions(parts=2))


def test_an_even_picture_may_pack_beyond_the_ratio_in_piz_but_not_in_rle(tmp_path):
    """65,536 × 1,024 halves are 128 MiB; the file has a table and no more, so that what is refused says the order."""
    for code, complaint in ((1, "cannot hold"), (4, "row 0: expected 32 chunks")):
        head = header(2**16, 1024, GREY, compression=code)
        table = struct.pack("<Q", 0) * -(-1024 // COMPRESSIONS[code].rows)
        with pytest.raises(UnreadableFile, match=complaint):
            read_radiance(saved(tmp_path / "a.exr", head + table))


def test_a_bomb_of_a_few_hundred_bytes_is_refused_from_its_table(tmp_path):
    """Tiles of one pixel: 2²⁸ chunks, whose table alone would take 2 GiB."""
    tiles = attribute("tiles", "tiledesc", struct.pack("<IIB", 1, 1, 0))
    data = bytearray(header(2**14, 2**14, GREY, tiles, compression=3))
    data[5] = 2
    path = saved(tmp_path / "a.exr", bytes(data).ljust(464, b"\0"))
    with pytest.raises(FormatError, match=r"table of offsets: expected 2147483648 bytes, found \d+ to the end"):
        read_radiance(path)


def test_a_window_of_other_sides_is_refused_for_display_too(tmp_path):
    data = header(4, 4, GREY).replace(window("displayWindow", 4, 4), window("displayWindow", 2**17, 4))
    with pytest.raises(UnreadableFile, match="its display window claims 131072 x 4"):
        read_radiance(saved(tmp_path / "a.exr", data))


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("exrs_f32/dwab.exr", "float, DWAB"),
        ("envmaps/StageEnvCube.exr", "half, ZIP, tiled 64 × 64, MIP-mapped"),
        ("chromaticities/XYZ_YC.exr", "half, PIZ, luminance/chroma"),
        ("deep/Trunks.exr", "float and half, ZIPS, deep"),
        ("multipart/multipart.0006.exr", "half, ZIPS, 10 parts"),
        ("compression/v1.7.test.tiled.exr", "float and half, uncompressed, tiled 12 × 24"),
    ],
)
def test_the_subtype_of_real_files_is_reported(shared, file, said):
    assert subtype(shared / "data/formats/openexr" / file) == said


def test_a_file_that_went_away_is_reported(tmp_path):
    with pytest.raises(UnreadableFile, match=r"a\.exr: cannot be opened"):
        read_headers(tmp_path / "a.exr")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("corner", [(0, 0), (9000, -9000)])
def test_a_frame_around_nothing_is_refused_before_it_is_made(tmp_path, corner):
    """16 × 8 pixels that are all there, in a display window of 805 MB; ZIP, whose ratio has no bound for pixels."""
    (left, top), pixels = corner, np.ones((8, 16), np.float32)
    data = scan_lines(16, 8, [("Y", pixels, 1)]).replace(b"compression\0\x01\0\0\0\0", b"compression\0\x01\0\0\0\x03")
    frame = attribute("displayWindow", "box2i", struct.pack("<4i", left, top, left + 8191, top + 8191))
    path = saved(tmp_path / "a.exr", data.replace(window("displayWindow", 16, 8), frame))
    empty = 12 * (2**26 - (128 if corner == (0, 0) else 0))
    said = f"claims 8192 x 8192 pixels around a data window of 16 x 8, {empty} bytes of nothing for {len(data)} bytes"
    for reader in (read_radiance, read_layers):
        with pytest.raises(UnreadableFile, match=said):
            reader(path)


def test_a_frame_counts_with_the_pixels(tmp_path):
    pixels = np.ones((8, 16), np.float32)
    data = scan_lines(16, 8, [("Y", pixels, 1)]).replace(window("displayWindow", 16, 8), window("displayWindow", 20, 8))
    path = saved(tmp_path / "a.exr", data)
    needed = 16 * 8 * 4 + 4 * 8 * 12
    with pytest.warns(UserWarning, match="32 of its 160 pixels lie outside its data window"):
        assert read_radiance(path, ReadOptions(decoded=needed)).size == (20, 8)
    with pytest.raises(UnreadableFile, match=f"claims {needed} bytes of pixels"):
        read_radiance(path, ReadOptions(decoded=needed - 1))


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("channels", "chlist"),
        ("compression", "compression"),
        ("dataWindow", "box2i"),
        ("displayWindow", "box2i"),
        ("lineOrder", "lineOrder"),
        ("pixelAspectRatio", "float"),
        ("screenWindowCenter", "v2f"),
        ("screenWindowWidth", "float"),
        ("tiles", "tiledesc"),
        ("name", "string"),
        ("type", "string"),
        ("chunkCount", "int"),
    ],
)
def test_an_attribute_of_another_type_is_refused(tmp_path, name, kind):
    data = scan_lines(4, 3, [("Y", np.ones((3, 4), np.float32), 1)])
    found = f"{name}\0{kind}\0".encode()
    wrong = (
        data.replace(found, f"{name}\0widget\0".encode())
        if found in data
        else header(4, 3, GREY, attribute(name, "widget", b"abcd"))
    )
    path = saved(tmp_path / "a.exr", wrong)
    for reader in (read_radiance, read_layers, subtype):
        with pytest.raises(FormatError, match=rf'byte \d+, "{name}": expected the type {kind}, found \'widget\''):
            reader(path)


def test_an_attribute_that_stands_there_twice_is_refused(tmp_path):
    """Which of the two counts is not said: the window that was judged and the one that is used could differ."""
    data = header(4, 3, GREY, window("displayWindow", 9000, 9000))
    with pytest.raises(FormatError, match=r'"displayWindow": expected each attribute once, found another at byte \d+'):
        read_radiance(saved(tmp_path / "a.exr", data))


@pytest.mark.parametrize(("names", "index", "found"), [("aba", 2, "'a'"), ("aa", 1, "'a'"), (["a", ""], 1, "''")])
def test_parts_need_names_of_their_own(tmp_path, names, index, found):
    parts = [
        header(4, 3, GREY, attribute("type", "string", b"scanlineimage"), attribute("name", "string", name.encode()))[
            8:
        ]
        for name in names
    ]
    path = saved(tmp_path / "a.exr", b"\x76\x2f\x31\x01\x02\x10\0\0" + b"".join(parts) + b"\0")
    start = 8 + sum(map(len, parts[:index]))
    with pytest.raises(
        FormatError, match=f'byte {start}, "name" of part {index}: expected one of its own, found {found}'
    ):
        read_layers(path)


@pytest.mark.parametrize("said", ["tiledimage", "deepscanline", "hologram\n"])
def test_a_type_that_contradicts_the_version_field_is_reported(tmp_path, said):
    pixels = np.arange(12, dtype=np.float32).reshape(3, 4)
    data = scan_lines(4, 3, [("Y", pixels, 1)], attribute("type", "string", said.encode()))
    path = saved(tmp_path / "a.exr", data)
    with pytest.warns(UserWarning) as heard:
        image = read_radiance(path)
    (line,) = (str(warning.message) for warning in heard)
    found = f'its attribute "type" is {said!r}, but its version field says scan lines'
    assert line == f"{path}: {found}, and as those it is read; save it again"
    np.testing.assert_array_equal(image.radiance[..., 1], pixels)


def test_a_type_that_agrees_is_no_matter(tmp_path):
    pixels = np.ones((3, 4), np.float32)
    data = scan_lines(4, 3, [("Y", pixels, 1)], attribute("type", "string", b"scanlineimage"))
    assert read_radiance(saved(tmp_path / "a.exr", data)).size == (4, 3)
