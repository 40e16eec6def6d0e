"""The layout of a TIFF: which rows a file holds, and that no picture is claimed that its bytes cannot make."""

import pytest

from relume.errors import FormatError
from relume.image.files.read_options import ReadOptions
from relume.image.files.tiff.directories import Folder
from relume.image.files.tiff.layout import layout_of, pages_of

# 10 x 12 pixels of three bytes in three strips of four rows, 120 bytes each.
TAGS = {256: (10,), 257: (12,), 258: (8, 8, 8), 262: (2,), 277: (3,), 278: (4,), 273: (8, 128, 248), 279: (120,) * 3}


def layout(tags=(), size=1000):
    return layout_of("a.tif", Folder("<", {**TAGS, **dict(tags)}), size, ReadOptions())


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
    told = layout(tiles.items())
    assert (told.across, told.down, told.rows_within(776), told.rows_within(775), told.rows_within(250)) == (
        2, 2, 12, 12, 2)  # fmt: skip


def test_rows_of_a_strip_may_be_more_than_the_picture_has():
    told = layout({278: (2**32 - 1,), 273: (8,), 279: (360,)}.items())
    assert (told.block, told.across, told.down) == ((10, 12), 1, 1)


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
def test_what_breaks_the_format_is_told_by_its_tag(tags, said):
    with pytest.raises(FormatError, match=said):
        layout(tags.items())


def test_smaller_copies_and_masks_are_no_pages():
    folders = [Folder("<", {254: (kind,)}) for kind in (0, 0, 1, 4, 2)]
    assert pages_of(folders) == 3
