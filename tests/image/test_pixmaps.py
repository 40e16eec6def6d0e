"""Windows bitmaps and portable pixmaps: literal bytes, other programs' files, and damaged ones."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from relume.errors import UnreadableFile
from relume.image.files import kind_of, read_facts, read_photograph, subtype

PICTURE = np.array([[[255, 0, 10], [20, 30, 40], [1, 2, 3]], [[7, 8, 9], [200, 100, 50], [0, 0, 255]]], np.uint8)


@pytest.mark.parametrize(
    ("data", "pixels", "form"),
    [
        (b"P6\n# made by hand\n3 2\n255\n" + PICTURE.tobytes(), PICTURE, "8 bits, RGB"),
        (b"P3 3 2 255\n255 0 10 20 30 40 1 2 3\n7 8 9 200 100 50 0 0 255", PICTURE, "8 bits, RGB, as text"),
        (b"P5 2 1 255\n\n#", np.array([[[10] * 3, [35] * 3]], np.uint8), "8 bits, grey"),
        (b"P2 2 1 15\n0 15", np.array([[[0] * 3, [255] * 3]], np.uint8), "4 bits, grey, as text"),
        (b"P5 2 1 65535\n\x01\x02\xff\xff", np.array([[[258] * 3, [65535] * 3]], np.uint16), "16 bits, grey"),
        (b"P5 2 1 1023\n\x03\xff\x00\x01", np.array([[[65535] * 3, [64] * 3]], np.uint16), "10 bits, grey"),
    ],
)
def test_pixmaps_hold_what_their_bytes_say(tmp_path, data, pixels, form):
    path = tmp_path / "a.ppm"
    path.write_bytes(data)
    read = read_photograph(path)
    assert read.pixels.dtype == pixels.dtype and np.array_equal(read.pixels, pixels)
    assert kind_of(path) == "PNM" and subtype(path) == form and read_facts(path).size == read.size
    assert read.exposure is None and read.camera == ""


@pytest.mark.parametrize("mode", ["RGB", "P", "L", "1", "RGBA"])
def test_bitmaps_are_read_as_pillow_wrote_them(tmp_path, mode):
    path = tmp_path / "a.bmp"
    Image.fromarray(PICTURE).convert(mode).save(path)
    expected = np.array(Image.fromarray(PICTURE).convert(mode).convert("RGB"))
    assert kind_of(path) == "BMP" and np.array_equal(read_photograph(path).pixels, expected)
    assert read_facts(path).size == (3, 2)


def test_a_bitmap_of_literal_bytes_is_bottom_up_blue_first(tmp_path):
    header = b"BM" + (54 + 16).to_bytes(4, "little") + b"\0\0\0\0" + (54).to_bytes(4, "little")
    sizes = [40, 2, 2]
    info = b"".join(n.to_bytes(4, "little") for n in sizes) + b"\1\0\x18\0" + b"\0" * 24
    rows = bytes([1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12, 0, 0])
    (tmp_path / "a.bmp").write_bytes(header + info + rows)
    expected = [[[9, 8, 7], [12, 11, 10]], [[3, 2, 1], [6, 5, 4]]]
    assert read_photograph(tmp_path / "a.bmp").pixels.tolist() == expected


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.ppm", b"P6 3 2 255\n\1\2\3", "expected 18 values, found 3"),
        ("a.ppm", b"P6 3 two 255\n", "expected its height, found two"),
        ("a.ppm", b"P6 3 2", "expected its value of white, found nothing"),
        ("a.ppm", b"P6 3 2 70000\n", "expected a white of 1 to 65535, found 70000"),
        ("a.ppm", b"P2 1 1 15\n16", "expected values up to 15, found 16"),
        ("a.ppm", b"P3 1 1 15\na b c", "expected numbers, found other words"),
        ("a.ppm", b"P5 0 2 255\n", "claims 0 x 2 pixels"),
        ("a.ppm", b"P5 99999 99999 255\n", "claims 99999 x 99999 pixels"),
        ("a.bmp", b"BM" + b"\0" * 12, "a.bmp"),
    ],
)
def test_damaged_files_are_refused_in_one_line(tmp_path, name, data, words):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(UnreadableFile, match=words) as caught:
        read_photograph(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_bitmap_that_ends_early_is_refused(tmp_path):
    Image.fromarray(np.tile(PICTURE, (20, 20, 1))).save(tmp_path / "a.bmp")
    data = (tmp_path / "a.bmp").read_bytes()
    (tmp_path / "a.bmp").write_bytes(data[: len(data) // 2])
    with pytest.raises(UnreadableFile, match="its pixels"):
        read_photograph(tmp_path / "a.bmp")
