"""PNG: every kind of the format is read as stored, damage is refused, and what is written other decoders read."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from relume.errors import FormatError, UnreadableFile
from relume.image import files
from relume.image.files import read_photograph
from relume.image.files.photographs import png
from relume.image.files.photographs.photographs import read_png
from relume.image.files.read_options import ReadOptions
from relume.image.photograph import Photograph

KINDS = [(c, b) for c, depths in {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}.items()
         for b in depths]  # fmt: skip
SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
STARTS = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))


def filtered(row: bytes, above: bytes, step: int, kind: int) -> bytes:
    """A row as its differences by one of the five filters (W3C PNG, 9.2), slow and plain."""
    out = bytearray([kind])
    for x, value in enumerate(row):
        a, b = row[x - step] if x >= step else 0, above[x]
        c = above[x - step] if x >= step else 0
        p = a + b - c
        paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        out.append((value - (0, a, b, (a + b) // 2, paeth)[kind]) % 256)
    return bytes(out)


def packed(samples: np.ndarray, bits: int) -> list[bytes]:
    """The rows of (H, W, C) samples as a PNG stores them, before they are filtered."""
    text = ["".join(f"{value:0{bits}b}" for value in row.ravel()) for row in samples]
    return [int(f"{row:0<{-(-len(row) // 8) * 8}}", 2).to_bytes(-(-len(row) // 8)) for row in text]


def encoded(
    samples: np.ndarray, colour: int, bits: int, *ahead: tuple[bytes, bytes], interlaced: bool = False
) -> bytes:
    """A PNG whose rows go through all five filters in turn."""
    data = b""
    for x, y, across, down in STARTS if interlaced else ((0, 0, 1, 1),):
        part = samples[y::down, x::across]
        if part.size:
            rows = packed(part, bits)
            step = max(1, SAMPLES[colour] * bits // 8)
            for number, row in enumerate(rows):
                data += filtered(row, rows[number - 1] if number else bytes(len(row)), step, (4 - number) % 5)
    return file(samples.shape[1], samples.shape[0], bits, colour, zlib.compress(data), *ahead, interlaced=interlaced)


def file(width, height, bits, colour, data: bytes, *ahead: tuple[bytes, bytes], interlaced: bool = False) -> bytes:
    fields = struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, int(interlaced))
    chunks = [(b"IHDR", fields), *ahead, (b"IDAT", data[:100]), (b"IDAT", data[100:]), (b"IEND", b"")]
    return png.SIGNATURE + b"".join(png.chunk(*one) for one in chunks)


def decoded(path: Path, data: bytes) -> np.ndarray:
    path.write_bytes(data)
    return read_png(path)


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize(("colour", "bits"), KINDS)
def test_every_kind_of_png_is_read_as_it_was_stored(tmp_path, colour, bits, interlaced):
    generator = np.random.default_rng(bits)
    table = generator.integers(0, 256, (2**bits, 3), np.uint8) if colour == 3 else None
    for size in ((13, 11), (1, 1), (2, 3), (5, 9)):
        samples = generator.integers(0, 2**bits, (*size, SAMPLES[colour]))
        ahead = [(b"PLTE", table.tobytes())] if table is not None else []
        data = encoded(samples, colour, bits, *ahead, interlaced=interlaced)
        found = decoded(tmp_path / "a.png", data)
        whole = samples * (255 // (2**bits - 1)) if bits < 8 else samples
        np.testing.assert_array_equal(found, whole if table is None else table[samples[..., 0]])
        assert found.dtype == (np.uint16 if bits == 16 else np.uint8)
        if bits <= 8 and colour != 0:  # Pillow rounds 16 bits, and widens no grey
            with Image.open(io.BytesIO(data)) as image:
                np.testing.assert_array_equal(np.asarray(image.convert("RGB")), found[..., :3] if found.shape[2] > 2
                                              else np.repeat(found[..., :1], 3, 2))  # fmt: skip


@pytest.mark.parametrize(("colour", "bits"), [(0, 2), (0, 8), (0, 16), (2, 8), (2, 16)])
def test_the_transparent_colour_is_outside(tmp_path, colour, bits):
    samples = np.random.default_rng(bits).integers(0, 2**bits, (6, 7, SAMPLES[colour]))
    samples[2, 3] = samples[5, 6] = key = samples[0, 0]
    said = np.asarray(key, ">u2").tobytes()
    (tmp_path / "a.png").write_bytes(encoded(samples, colour, bits, (b"tRNS", said)))
    outside = read_photograph(tmp_path / "a.png").outside
    assert outside is not None and outside[2, 3] and outside[5, 6]
    np.testing.assert_array_equal(outside, np.all(samples == key, axis=2))


def test_a_palette_has_alpha_where_the_file_says_it(tmp_path):
    indices = np.array([[[0], [1], [2]], [[2], [1], [0]]])
    data = encoded(indices, 3, 8, (b"PLTE", bytes(range(9))), (b"tRNS", b"\0\xff"))
    assert decoded(tmp_path / "a.png", data)[0].tolist() == [[0, 1, 2, 0], [3, 4, 5, 255], [6, 7, 8, 255]]


@pytest.mark.filterwarnings("ignore:.*its EXIF cannot be read")  # Pillow looks at tRNS too
def test_what_a_decoder_can_do_without_is_left_out_and_nothing_is_printed(tmp_path, capfd):
    samples = np.arange(48).reshape(4, 4, 3)
    tall = bytearray(encoded(samples, 2, 8))
    struct.pack_into(">I", tall, 20, 3)
    struct.pack_into(">I", tall, 29, zlib.crc32(tall[12:29]))
    for data, wanted in ((encoded(samples, 2, 8, (b"tRNS", b"a")), samples), (bytes(tall), samples[:3])):
        (tmp_path / "a.png").write_bytes(data)
        np.testing.assert_array_equal(read_photograph(tmp_path / "a.png").pixels, wanted)
    (tmp_path / "a.png").write_bytes(encoded(samples, 2, 8, (b"iCCP", b"a\0\0" + zlib.compress(bytes(99)))))
    with pytest.warns(UserWarning, match='its colour profile is "damaged", not one of primaries'):
        read_photograph(tmp_path / "a.png")
    assert capfd.readouterr() == ("", "")


def test_damage_is_refused_and_nothing_is_printed(tmp_path, capfd):
    lines = b"".join(b"\0" + bytes(range(k, k + 12)) for k in range(4))
    sound = zlib.compress(lines)
    head = (4, 4, 8, 2)
    two_heads = file(*head, sound, (b"IHDR", struct.pack(">IIBBBBB", 4, 4, 8, 2, 0, 0, 0)))
    for data, line in (
        (file(*head, zlib.compress(lines[:26] + b"\x05" + lines[27:])), "its pixels"),
        (file(*head, zlib.compress(lines[:-1])), "its pixels"),
        (file(*head, sound[:-2]), "its pixels"),
        (file(*head, sound[:-1] + b"!"), "its pixels"),
        (file(*head, b""), "its pixels"),
        (file(11, 4, 8, 3, zlib.compress(bytes(48))), "its pixels"),
        (file(11, 4, 8, 3, zlib.compress(bytes(48)), (b"PLTE", bytes(771))), "its pixels"),
        (file(4, 4, 4, 2, sound), "its IHDR chunk: expected a colour type of PNG, found type 2 of 4 bits"),
        (file(*head, sound).replace(b"IEND", b"IEN0"), "byte .*expected a kind of chunk that PNG knows here"),
        (file(*head, sound, (b"ABCD", b"")), "byte 37: expected a kind of chunk .*found 'ABCD'"),
        (two_heads, "byte 37: .*found 'IHDR'"),
        (file(*head, sound)[:-3], "byte 97: expected whole chunks, and IEND as the last, found the end of the file"),
    ):
        (tmp_path / "a.png").write_bytes(data)
        with pytest.raises(FormatError, match=r"a\.png: damaged PNG, .*" + line):
            read_photograph(tmp_path / "a.png")
    for place, value in ((26, 1), (27, 1), (28, 2)):
        wrong = bytearray(file(*head, sound))
        wrong[place] = value
        struct.pack_into(">I", wrong, 29, zlib.crc32(wrong[12:29]))
        (tmp_path / "a.png").write_bytes(wrong)
        with pytest.raises(FormatError, match="expected compression 0, filtering 0 and interlacing 0 or 1"):
            read_photograph(tmp_path / "a.png")
    assert capfd.readouterr() == ("", "")


@pytest.mark.filterwarnings("ignore:.*rows are missing")
def test_a_png_cut_anywhere_in_its_pixels_gives_the_rows_that_are_there_and_no_other(tmp_path):
    samples = np.random.default_rng(2).integers(0, 2**16, (9, 8, 3))
    data = encoded(samples, 2, 16)
    seen = set()
    for length in range(70, len(data) - 12, 7):
        (tmp_path / "a.png").write_bytes(data[:length])
        try:
            photograph = read_photograph(tmp_path / "a.png", ReadOptions(salvage=True))
        except UnreadableFile as error:
            assert "ends before its first rows are whole" in str(error)
            continue
        assert photograph.outside is not None
        rows = 9 - int(photograph.outside.all(axis=1).sum())
        np.testing.assert_array_equal(photograph.pixels[:rows], samples[:rows])
        seen.add(rows)
    assert len(seen) > 5


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(1, 1), (3, 60_000), (1300, 400)])
def test_pixels_that_were_written_come_back(tmp_path, kind, shape):
    pixels = np.random.default_rng(2).integers(0, np.iinfo(kind).max + 1, (*shape, 3)).astype(kind)
    files.write(tmp_path / "a.png", Photograph(pixels))
    np.testing.assert_array_equal(files.read_photograph(tmp_path / "a.png").pixels, pixels)
    if kind == np.uint8:
        with Image.open(tmp_path / "a.png") as image:
            np.testing.assert_array_equal(np.asarray(image), pixels)


def test_drawings_are_packed_by_their_patterns():
    pattern = np.random.default_rng(3).integers(0, 255, (1, 100, 3)).astype(np.uint8)
    tiled = np.tile(pattern, (300, 6, 1))
    assert len(png.encode(tiled)) < len(png.encode(tiled, drawing=False)) / 20
