"""The folders of a TIFF in every byte order and width, and its layout: nothing believed that the file cannot hold."""

import io
import struct

import numpy as np
import pytest
from PIL import Image

from other_programs import attributes_by_openimageio, by_openimageio
from relume.errors import FormatError, OutputNotWritten
from relume.image.files.read_options import ReadOptions
from relume.image.files.tiff.directories import Folder, folder_at, folders_in, read_folders
from relume.image.files.tiff.layout import layout_of, pages_of
from relume.image.files.tiff.writing import write_tiff

KINDS = [("<", False), (">", False), ("<", True), (">", True)]
SHORT, LONG, RATIONAL, ASCII = 3, 4, 5, 2


def header(order, big, first):
    start = {"<": b"II", ">": b"MM"}[order]
    return start + (struct.pack(order + "HHHQ", 43, 8, 0, first) if big else struct.pack(order + "HI", 42, first))


def folder(order, big, entries, following=0):
    """A folder of (tag, type, count, the bytes of the field itself)."""
    width, letters = (8, "QHHQQ") if big else (4, "HHHII")
    body = b"".join(struct.pack(f"{order}HH{letters[3]}", *e[:3]) + e[3].ljust(width, b"\0") for e in entries)
    return struct.pack(order + letters[0], len(entries)) + body + struct.pack(order + letters[4], following)


def read(data, options=ReadOptions()):
    return folders_in("a.tif", io.BytesIO(data), options)


@pytest.mark.parametrize(("order", "big"), KINDS)
def test_values_in_the_entry_and_elsewhere_are_read_in_both_orders_and_widths(order, big):
    start, pointer = (16, "Q") if big else (8, "I")
    held = struct.pack(order + "2I", 1, 3) + struct.pack(order + "d", 0.1) + b"a long name\0\0"
    first = start + len(held)
    entries = [
        (256, SHORT, 1, struct.pack(order + "H", 4711)),
        (257, LONG, 1, struct.pack(order + "I", 70000)),
        (258, SHORT, 2, struct.pack(order + "HH", 8, 9)),
        (282, RATIONAL, 1, struct.pack(order + "2I", 1, 3) if big else struct.pack(order + pointer, start)),
        (305, ASCII, 12, struct.pack(order + pointer, start + 16)),
        (306, ASCII, 4, b"a\0b\0"),
        (340, 12, 1, struct.pack(order + "d", 0.1) if big else struct.pack(order + pointer, start + 8)),
        (341, 6, 2, b"\xff\x01"),
        (342, 9, 1, struct.pack(order + "i", -5)),
        (343, 11, 1, struct.pack(order + "f", 0.5)),
        (344, 99, 1, b"\1"),
    ]
    (only,) = read(header(order, big, first) + held + folder(order, big, entries))
    assert only.order == order
    assert only.values == {
        256: (4711,), 257: (70000,), 258: (8, 9), 282: (1 / 3,), 305: b"a long name\0", 306: b"a\0b\0",
        340: (0.1,), 341: (-1, 1), 342: (-5,), 343: (0.5,)}  # fmt: skip
    assert (only.number(256), only.number(1), only.number(1, 7)) == (4711, None, 7)
    assert (only.integers(258), only.integers(305)) == ((8, 9), ())
    assert (only.text(305), only.text(306), only.text(256)) == ("a long name", "a", "")


def test_a_number_of_bigtiff_may_need_64_bits():
    (only,) = read(header("<", True, 16) + folder("<", True, [(273, 16, 1, struct.pack("<Q", 2**40))]))
    assert only.integers(273) == (2**40,)


def test_a_rational_without_denominator_is_0_and_no_integer_is_made_of_nan():
    held = struct.pack("<2I", 5, 0)
    entries = [(282, RATIONAL, 1, struct.pack("<I", 8)), (256, 11, 1, struct.pack("<f", np.nan))]
    (only,) = read(header("<", False, 16) + held + folder("<", False, entries))
    assert (only.number(282), only.integers(256)) == (0.0, ())


@pytest.mark.parametrize(("order", "big"), KINDS)
def test_pages_follow_one_another_and_never_in_a_circle(order, big):
    start = 16 if big else 8
    pages = [[(256, SHORT, 1, struct.pack(order + "H", width))] for width in (1, 2, 3)]
    length = len(folder(order, big, pages[0]))
    following = [start + length, start + 2 * length, 0]

    def file(following):
        bodies = [folder(order, big, page, after) for page, after in zip(pages, following, strict=True)]
        return header(order, big, start) + b"".join(bodies)

    assert [page.number(256) for page in read(file(following))] == [1, 2, 3]
    following[2] = start + length
    with pytest.raises(FormatError, match=rf"the folder at byte {start + length}.*found one that was read already"):
        read(file(following))
    with pytest.raises(FormatError, match="more than 2"):
        read(file([start + length, start + 2 * length, 0]), ReadOptions(parts=2))


GOOD = header("<", False, 8) + folder("<", False, [(256, SHORT, 1, b"\1"), (270, ASCII, 9, struct.pack("<I", 8))])


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "first bytes.*found nothing"),
        (b"II*\0", "first bytes"),
        (b"II\x07\0" + bytes(20), "first bytes"),
        (b"XX*\0" + bytes(20), "first bytes"),
        (header("<", False, 0), "place of a folder"),
        (header("<", False, 9), "the folder at byte 9"),
        (header("<", False, 2**32 - 1), "the folder at byte 4294967295"),
        (header("<", True, 2**64 - 1), "the folder at byte 18446744073709551615"),
        (header("<", True, 16)[:15], "byte 4"),
        (header("<", True, 16)[:4] + b"\4" + header("<", True, 16)[5:], "byte 4"),
        (GOOD[:-6], "its 2 entries within the file"),
        (header("<", False, 8) + b"\xff\xff" + bytes(99), "its 65535 entries"),
        (header("<", True, 16) + b"\xff" * 8 + bytes(99), "its 18446744073709551615 entries"),
        (header("<", False, 8) + folder("<", False, [(256, LONG, 2, b"\xff" * 4)]), "tag 256 in the folder at byte 8"),
        (header("<", False, 8) + folder("<", False, [(256, LONG, 2**32 - 1, b"\x08")]), "17179869180 bytes at 8"),
        (header("<", True, 16) + folder("<", True, [(256, 12, 2**64 - 1, b"\x08")]), "tag 256"),
        (header("<", False, 8) + folder("<", False, [(40000, LONG, 20, b"\x08")]), "tag 40000"),
    ],
)
def test_what_the_file_cannot_hold_is_refused_by_place(data, said):
    with pytest.raises(FormatError, match=said) as raised:
        read(data)
    assert str(raised.value).startswith("a.tif: damaged TIFF, ") and "\n" not in str(raised.value)


def test_a_last_folder_may_end_with_the_file():
    assert len(read(GOOD[:-4])) == 1


def test_metadata_beyond_the_limit_is_refused_in_all_and_a_private_tag_left_out():
    # Many tags that name the same bytes: each small enough, all of them together not.
    shared = bytes(1000)
    entries = [(1000 + tag, ASCII, 1000, struct.pack("<I", 8)) for tag in range(20)]
    data = header("<", False, 1008) + shared + folder("<", False, entries)
    assert len(read(data)[0].values) == 20
    with pytest.raises(FormatError, match="tag 1010"):
        read(data, ReadOptions(metadata=10_500))
    private = header("<", False, 1008) + shared + folder("<", False, [(37724, ASCII, 1000, struct.pack("<I", 8))])
    assert read(private, ReadOptions(metadata=999))[0].values == {}
    assert len(read(private, ReadOptions(metadata=1000))[0].values[37724]) == 1000


def test_numbers_in_a_tag_are_counted_before_they_are_made():
    count = 2**20 + 1
    data = header("<", False, 8 + count) + bytes(count)
    with pytest.raises(FormatError, match="tag 256"):
        read(data + folder("<", False, [(256, 1, count, struct.pack("<I", 8))]))
    assert read(data + folder("<", False, [(40000, 1, count, struct.pack("<I", 8))]))[0].values == {}


def test_any_bytes_make_folders_or_one_error():
    random = np.random.default_rng(7)
    elsewhere = struct.pack("<I", 8)
    entries = [(256, SHORT, 1, b"\1"), (270, ASCII, 8, elsewhere), (282, RATIONAL, 1, elsewhere)]
    sound = header("<", False, 16) + bytes(8) + folder("<", False, entries)
    for _ in range(2000):
        data = bytearray(sound[: random.integers(1, len(sound) + 1)])
        for place in random.integers(0, len(data), random.integers(1, 6)):
            data[place] = random.integers(0, 256)
        try:
            read(bytes(data))
        except FormatError as error:
            assert "\n" not in str(error)


# Writing


TAGS = {256: (LONG, [3]), 257: (LONG, [1]), 258: (SHORT, [8]), 262: (SHORT, [1]), 259: (SHORT, [1]),
        277: (SHORT, [1]), 278: (LONG, [1]), 282: (RATIONAL, [72, 1])}  # fmt: skip


def test_a_tiff_is_written_byte_for_byte(tmp_path):
    write_tiff(tmp_path / "a.tif", {256: (LONG, [3]), 282: (RATIONAL, [1, 3]), 305: (ASCII, b"abcde\0")}, [b"xyz"])
    expected = bytes.fromhex(
        "49492a00 0c000000"  # II, 42, the folder is at 12
        "78797a 00"  # the strip, and a byte that makes it even
        "0500"
        "0001 0400 01000000 03000000"
        "1101 0400 01000000 08000000"
        "1701 0400 01000000 03000000"
        "1a01 0500 01000000 4e000000"
        "3101 0200 06000000 56000000"
        "00000000"
        "01000000 03000000"
        "6162636465 00"
    )
    assert (tmp_path / "a.tif").read_bytes() == expected


def test_other_readers_open_what_is_written(tmp_path):
    path = tmp_path / "a.tif"
    tags = {**TAGS, 257: (LONG, [2]), 305: (ASCII, b"relume\0"), 36867: (ASCII, b"no\0")}
    write_tiff(path, tags, [b"\1\2\3", memoryview(b"\4\5\6")], {0x829A: (RATIONAL, [1, 60]), 0x8827: (SHORT, [100])})
    with Image.open(path) as image:
        assert np.asarray(image).tolist() == [[1, 2, 3], [4, 5, 6]]
        assert image.getexif().get_ifd(0x8769)[0x829A] == pytest.approx(1 / 60)
    assert attributes_by_openimageio(path, "ExposureTime", "Software") == [pytest.approx(1 / 60), "relume"]
    assert (255 * by_openimageio(path).ravel()).round().tolist() == [1, 2, 3, 4, 5, 6]
    (first,) = read_folders(path)
    assert [first.integers(tag) for tag in (273, 279)] == [(8, 12), (3, 3)]
    with open(path, "rb") as file:
        exif = folder_at(path, file, first.integers(34665)[0])
    assert exif.values == {0x829A: (1 / 60,), 0x8827: (100,)}


def test_thousands_of_strips_are_written_and_found(tmp_path):
    path = tmp_path / "a.tif"
    strips = [bytes([index % 251] * (index % 7)) for index in range(5000)]
    write_tiff(path, {**TAGS, 257: (LONG, [5000])}, strips)
    (folder,) = read_folders(path)
    data = path.read_bytes()
    places = zip(folder.integers(273), folder.integers(279), strict=True)
    assert [data[place : place + length] for place, length in places] == strips
    assert all(place % 2 == 0 for place in folder.integers(273))


def test_a_picture_of_more_than_4_gib_is_a_bigtiff(tmp_path, monkeypatch):
    import relume.image.files.tiff.writing as tiff_writing

    monkeypatch.setattr(tiff_writing, "_LARGEST", 4)
    path = tmp_path / "a.tif"
    write_tiff(path, {**TAGS, 305: (ASCII, b"a longer name\0")}, [b"\1\2\3", b"\4\5"], {0x829A: (RATIONAL, [1, 60])})
    # 43, offsets of 8 bytes; the folder comes after 16 + 4 + 2 bytes and that of EXIF: 8 + 20 + 8.
    assert path.read_bytes()[:16] == bytes.fromhex("49492b00 08000000 3a00000000000000")
    (folder,) = read_folders(path)
    assert (folder.integers(273), folder.integers(279), folder.text(305)) == ((16, 20), (3, 2), "a longer name")
    with open(path, "rb") as file:
        assert folder_at(path, file, folder.integers(34665)[0]).number(0x829A) == 1 / 60
    write_tiff(path, TAGS, [b"\1\2\3\4\5"])
    with Image.open(path) as image:
        image.load()
        assert image.getpixel((2, 0)) == 3


def test_a_tiff_is_written_whole_or_not_at_all(tmp_path):
    with pytest.raises(OutputNotWritten, match="does not exist"):
        write_tiff(tmp_path / "none" / "a.tif", TAGS, [b"\1\2\3"])


# Layout: which rows a file holds, and that no picture is claimed that its bytes cannot make


# 10 x 12 pixels of three bytes in three strips of four rows, 120 bytes each.
STRIPS = {256: (10,), 257: (12,), 258: (8, 8, 8), 262: (2,), 277: (3,), 278: (4,), 273: (8, 128, 248), 279: (120,) * 3}


def layout(tags=(), size=1000):
    return layout_of("a.tif", Folder("<", {**STRIPS, **dict(tags)}), size, ReadOptions())


@pytest.mark.parametrize(("size", "rows"), [(368, 12), (367, 11), (338, 11), (337, 10), (248, 8), (100, 3), (8, 0)])
def test_of_plain_strips_every_whole_row_counts(size, rows):
    assert layout().rows_within(size) == rows


@pytest.mark.parametrize(("size", "rows"), [(368, 12), (367, 8), (248, 8), (247, 4), (8, 0)])
def test_of_packed_strips_only_whole_strips_count(size, rows):
    assert layout({259: (8,)}.items()).rows_within(size) == rows


def test_a_row_counts_where_all_planes_and_tiles_have_it():
    planar = {284: (2,), 273: tuple(range(8, 368, 40)), 279: (40,) * 9}
    assert layout(planar.items()).rows_within(367) == 11
    assert layout(planar.items()).rows_within(327) == 7  # the second strip of the third plane
    tiles = {322: (8,), 323: (8,), 324: (8, 200, 392, 584), 325: (192,) * 4, 273: (), 279: ()}
    reports = layout(tiles.items())
    assert (reports.across, reports.down) == (2, 2)
    assert [reports.rows_within(size) for size in (776, 775, 250)] == [12, 12, 2]


def test_rows_of_a_strip_may_be_more_than_the_picture_has():
    reports = layout({278: (2**32 - 1,), 273: (8,), 279: (360,)}.items())
    assert (reports.block, reports.across, reports.down) == ((10, 12), 1, 1)


def test_a_missing_length_of_one_strip_is_the_rest_of_the_file():
    assert layout({278: (12,), 273: (8,), 279: ()}.items(), size=368).lengths == (360,)


@pytest.mark.parametrize(
    ("tags", "said"),
    [
        ({279: (120, 120)}, "3 byte counts of strips, found 2"),
        ({279: (100, 100, 100)}, "strips that hold 360 bytes of pixels, found 300 bytes, uncompressed"),
        ({258: (8, 8, 16)}, r"tag 258 \(bits\): expected the same of every sample"),
        ({257: (0,)}, r"tag 257 \(height\): expected a number above 0"),
        ({256: b"10"}, r"tag 256 \(width\)"),
    ],
)
def test_what_breaks_the_format_is_reported_by_its_tag(tags, said):
    with pytest.raises(FormatError, match=said):
        layout(tags.items())


def test_smaller_copies_and_masks_are_no_pages():
    folders = [Folder("<", {254: (kind,)}) for kind in (0, 0, 1, 4, 2)]
    assert pages_of(folders) == 3
