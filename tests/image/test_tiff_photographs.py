"""JPEG, PNG and TIFF photographs: their form from the header, limits, gain maps, salvage, and TIFF written."""

import io
import struct
import warnings
import zlib

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image

from other_programs import attributes_by_openimageio, by_opencv
from relume.errors import FormatError, UnreadableFile
from relume.image.files import read_photograph, write
from relume.image.files.photographs import header, photographs, png
from relume.image.files.read_options import ReadOptions
from relume.image.files.tiff.directories import read_folders
from relume.image.files.tiff.writing import write_tiff
from relume.image.photograph import Exposure, Photograph, Settings


@pytest.fixture
def noisy() -> np.ndarray:
    """(60, 50, 3) uint16 of random values."""
    return np.random.default_rng(3).integers(0, 2**16, (60, 50, 3), np.uint16)


def saved(path, pixels, **options):
    Image.fromarray(pixels).save(path, **options)
    return path


def bomb_png(width, height):
    fields = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return png.SIGNATURE + b"".join([png.chunk(b"IHDR", fields), png.chunk(b"IDAT", zlib.compress(bytes(1000))),
                                     png.chunk(b"IEND", b"")])  # fmt: skip


# TIFF, written


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_tiff_keeps_every_code_in_every_reader(tmp_path, noisy, dtype):
    pixels = noisy.astype(dtype)
    write(tmp_path / "a.tif", Photograph(pixels))
    again = read_photograph(tmp_path / "a.tif").pixels
    assert again.dtype == dtype
    np.testing.assert_array_equal(again, pixels)
    kind = {np.uint8: oiio.UINT8, np.uint16: oiio.UINT16}[dtype]
    np.testing.assert_array_equal(oiio.ImageBuf(str(tmp_path / "a.tif")).get_pixels(kind), pixels)
    np.testing.assert_array_equal(by_opencv(tmp_path / "a.tif"), pixels)
    if dtype is np.uint8:
        np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.tif")), pixels)
    assert photographs.subtype(tmp_path / "a.tif") == f"{np.iinfo(dtype).bits} bits, RGB, ZIP"


def test_a_tiff_is_written_in_bytes_that_differ_from_the_pixel_before(tmp_path):
    pixels = np.array([[[1, 2, 3], [0x101, 1, 4]]], np.uint16)
    write(tmp_path / "a.tif", Photograph(pixels))
    (folder,) = read_folders(tmp_path / "a.tif")
    (place,), (length,) = folder.integers(273), folder.integers(279)
    data = (tmp_path / "a.tif").read_bytes()[place : place + length]
    assert zlib.decompress(data).hex(" ", 2) == "0100 0200 0300 0001 ffff 0100"
    assert {tag: folder.integers(tag) for tag in (258, 259, 262, 277, 317)} == {
        258: (16, 16, 16), 259: (8,), 262: (2,), 277: (3,), 317: (2,)}  # fmt: skip


def test_another_reader_finds_the_exposure_in_a_tiff(tmp_path, noisy):
    settings = Settings(make="Virtual", model="curve_a")
    write(tmp_path / "a.tif", Photograph(noisy, exposure=Exposure(1 / 60, 5.6, 204800), settings=settings))
    reports = attributes_by_openimageio(tmp_path / "a.tif", "ExposureTime", "FNumber", "Make", "Model")
    assert reports == [pytest.approx(1 / 60), pytest.approx(5.6), "Virtual", "curve_a"]
    assert read_photograph(tmp_path / "a.tif").exposure == Exposure(1 / 60, 5.6, 204800)


# Forms


@pytest.mark.parametrize(
    ("mode", "name", "options", "words"),
    [
        ("RGB", "a.jpg", {"subsampling": 0}, "8 bits, YCbCr 4:4:4"),
        ("RGB", "a.jpg", {"subsampling": 1}, "8 bits, YCbCr 4:2:2"),
        ("RGB", "a.jpg", {"subsampling": 2, "progressive": True}, "8 bits, YCbCr 4:2:0, progressive"),
        ("L", "a.jpg", {}, "8 bits, grey"),
        ("CMYK", "a.jpg", {}, "8 bits, CMYK"),
        ("RGB", "a.png", {}, "8 bits, RGB"),
        ("RGBA", "a.png", {}, "8 bits, RGB with alpha"),
        ("I;16", "a.png", {}, "16 bits, grey"),
        ("P", "a.png", {}, "1 bit, palette"),
        ("LA", "a.png", {}, "8 bits, grey with alpha"),
        ("RGB", "a.tif", {}, "8 bits, RGB, uncompressed"),
        ("RGBA", "a.tif", {"compression": "tiff_lzw"}, "8 bits, RGB with alpha, LZW"),
        ("L", "a.tif", {"compression": "packbits"}, "8 bits, grey, PackBits"),
    ],
)
def test_the_form_is_recognised_from_the_header_alone(tmp_path, mode, name, options, words):
    Image.new(mode, (40, 30)).save(tmp_path / name, **options)
    assert photographs.subtype(tmp_path / name) == words


def test_forms_of_tiff_beyond_pillow(tmp_path, noisy):
    spec = oiio.ImageSpec(50, 60, 3, "uint16")
    spec.tile_width, spec.tile_height = 16, 32
    target = oiio.ImageOutput.create("a.tif")
    assert target is not None
    target.open(str(tmp_path / "a.tif"), spec)
    target.write_image(noisy)
    target.close()
    assert photographs.subtype(tmp_path / "a.tif") == "16 bits, RGB, ZIP, tiled 16 × 32"
    np.testing.assert_array_equal(read_photograph(tmp_path / "a.tif").pixels, noisy)


def test_a_tiff_packed_otherwise_is_refused_by_the_name_of_its_packing(shared):
    with pytest.raises(UnreadableFile, match="packed by ZSTD, which relume does not read"):
        photographs.read(shared / "data/malformed/tiff_gdal/byte_zstd_corrupted.tif")


def test_further_pages_are_reported_and_smaller_copies_are_not(tmp_path, noisy):
    page = Image.fromarray(noisy.astype(np.uint8))
    page.save(tmp_path / "a.tif", save_all=True, append_images=[page])
    with pytest.warns(UserWarning, match="only the first of its 2 pages is read"):
        read_photograph(tmp_path / "a.tif")
    thumbnail = page.resize((5, 6))
    thumbnail.encoderinfo = {"tiffinfo": {254: 1}}
    page.save(tmp_path / "b.tif", save_all=True, append_images=[thumbnail])
    assert len(read_folders(tmp_path / "b.tif")) == 2
    np.testing.assert_array_equal(read_photograph(tmp_path / "b.tif").pixels, noisy.astype(np.uint8))


# Gain maps


@pytest.mark.filterwarnings("ignore:.*colour profile")
@pytest.mark.parametrize("name", ["sky.jpg", "seine_sdr_gainmap_srgb.jpg"])
def test_a_jpeg_with_a_gain_map_is_its_base_picture(shared, name):
    path = shared / "data/formats/gainmap_jpeg" / name
    with Image.open(path) as image:
        turns = {1: 0, 3: 2, 6: 3, 8: 1}[image.getexif().get(0x0112, 1)]
        expected = np.rot90(np.asarray(image), turns)
    photograph = photographs.read(path)
    np.testing.assert_array_equal(photograph.pixels, expected)
    assert photograph.exposure is not None
    assert photographs.subtype(path).startswith("8 bits, YCbCr")


def test_a_damaged_base_picture_is_refused(shared, tmp_path):
    data = bytearray((shared / "data/formats/gainmap_jpeg/sky.jpg").read_bytes())
    scan = data.index(b"\xff\xda")
    del data[scan + 200_000 : scan + 200_900]
    (tmp_path / "a.jpg").write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(UnreadableFile, match="damaged JPEG, base picture"):
            photographs.read(tmp_path / "a.jpg")


# PNG that is encoded otherwise


def with_chunk(path, name, content):
    """Put a chunk behind the header of a PNG."""
    data = path.read_bytes()
    path.write_bytes(data[:33] + png.chunk(name, content) + data[33:])
    return path


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        (b"gAMA", struct.pack(">I", 100000), "encoded by gamma 1/1, not sRGB"),
        (b"gAMA", struct.pack(">I", 55556), r"encoded by gamma 1/1\.8, not sRGB"),
        (b"cICP", bytes([9, 16, 0, 1]), "its values are PQ, not sRGB"),
        (b"cICP", bytes([9, 18, 0, 1]), "its values are HLG, not sRGB"),
    ],
)
def test_a_png_encoded_otherwise_is_reported_and_not_converted(tmp_path, noisy, name, content, said):
    path = with_chunk(saved(tmp_path / "a.png", noisy.astype(np.uint8)), name, content)
    with pytest.warns(UserWarning, match=said):
        np.testing.assert_array_equal(read_photograph(path).pixels, noisy.astype(np.uint8))


def test_a_png_of_srgb_goes_unsaid(tmp_path, noisy):
    for chunks in ([(b"gAMA", 45455)], [(b"gAMA", 45000)], [(b"gAMA", 100000), (b"sRGB", None)]):
        path = saved(tmp_path / "a.png", noisy.astype(np.uint8))
        for name, value in chunks:
            with_chunk(path, name, b"\0" if value is None else struct.pack(">I", value))
        read_photograph(path)
    with_chunk(path, b"cICP", bytes([1, 13, 0, 1]))
    read_photograph(path)


# Limits


def bomb_jpeg(width, height, progressive=False):
    stored = io.BytesIO()
    Image.new("RGB", (8, 8)).save(stored, "JPEG", progressive=progressive)
    data = bytearray(stored.getvalue())
    place = data.index(b"\xff\xc2" if progressive else b"\xff\xc0")
    struct.pack_into(">HH", data, place + 5, height, width)
    return bytes(data)


def bomb_tiff(path, width, height):
    known = {256: (4, [width]), 257: (4, [height]), 258: (3, [8] * 3), 259: (3, [8]), 262: (3, [2]), 277: (3, [3]),
             278: (4, [height])}  # fmt: skip
    write_tiff(path, known, [zlib.compress(bytes(100))])
    return path.read_bytes()


@pytest.mark.parametrize("side", [65500, 16000])
def test_bombs_are_refused_from_their_headers(tmp_path, side):
    bombs = {
        "a.png": bomb_png(side, side),
        "a.jpg": bomb_jpeg(side, side),
        "b.jpg": bomb_jpeg(side, side, progressive=True),
        "a.tif": bomb_tiff(tmp_path / "t.tif", side, side),
    }
    for name, data in bombs.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(UnreadableFile, match=rf"{name}: .*(65500 x 65500|claims 768000000 bytes)"):
            photographs.read(tmp_path / name)


def test_limits_are_those_that_are_given(tmp_path, noisy):
    for name in ("a.png", "a.jpg", "a.tif"):
        path = saved(tmp_path / name, noisy.astype(np.uint8))
        with pytest.raises(UnreadableFile, match="50 x 60"):
            photographs.read(path, ReadOptions(side=59))
        with pytest.raises(UnreadableFile, match="claims 9000 bytes"):
            photographs.read(path, ReadOptions(decoded=8999))
        photographs.read(path, ReadOptions(side=60, pixels=3000, decoded=9000))


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.jpg", b"\xff\xd8\xff"),
        ("a.jpg", b"\xff\xd8" + b"\xff\xe1\x00\x08abcdef" * 3),
        ("a.jpg", b"\xff\xd8\xff\xe0" + bytes(100_000)),
        ("a.jpg", b"\xff\xd8\xff\xc0\x00\x11\x08\x00\x10\x00\x10\x03\x01\x11"),
        ("a.jpg", b"\xff\xd8\xff\xda\x00\x08"),
        ("a.jpg", b"\xff\xd8" + b"\xff\xd0" * 2**20),
        ("a.jpg", b"\xff\xd8" + b"\xff\xfe\0\2" * 2**20),
        ("a.png", bomb_png(8, 8)[:33] + png.chunk(b"tEXt", b"") * 2**20),
        ("a.png", png.SIGNATURE),
        ("a.png", png.SIGNATURE + png.chunk(b"IHDR", bytes(13))),
        ("a.png", png.SIGNATURE + png.chunk(b"IHDR", struct.pack(">IIBBBBB", 1, 1, 3, 7, 0, 0, 0))),
    ],
)
def test_headers_that_break_their_format_are_refused_by_place(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(UnreadableFile, match=rf"{name}: ") as raised:
        photographs.read(tmp_path / name)
    assert "\n" not in str(raised.value)


def test_facts_keep_the_limits_and_are_of_photographs_alone(tmp_path, noisy):
    path = saved(tmp_path / "a.tif", noisy.astype(np.uint8))
    assert header.read_facts(path, ReadOptions(side=60)).size == (50, 60)
    with pytest.raises(UnreadableFile, match="50 x 60"):
        header.read_facts(path, ReadOptions(side=59))
    Image.new("F", (3, 2)).save(tmp_path / "b.tif")
    with pytest.raises(UnreadableFile, match=r"b\.tif: a radiance map"):
        header.read_facts(tmp_path / "b.tif")


# Salvage

SALVAGE = ReadOptions(salvage=True)


def cut(path, share):
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    return path


@pytest.mark.parametrize("options", [{}, {"subsampling": 2}, {"subsampling": 0}])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.95])
def test_the_rows_salvaged_from_a_jpeg_are_those_of_the_whole(tmp_path, options, share):
    pixels = np.random.default_rng(4).integers(0, 256, (200, 150, 3), np.uint8)
    path = saved(tmp_path / "a.jpg", pixels, **options)
    whole = read_photograph(path).pixels
    cut(path, share)
    with pytest.raises(UnreadableFile):
        read_photograph(path)
    with pytest.warns(UserWarning, match=r"a\.jpg: ends early; \d+ of 200 rows are missing"):
        salvaged = photographs.read(path, SALVAGE)
    assert salvaged.outside is not None
    rows = 200 - np.count_nonzero(salvaged.outside.all(axis=1))
    assert (share - 0.2) * 200 <= rows <= share * 200
    assert not salvaged.outside[:rows].any()
    np.testing.assert_array_equal(salvaged.pixels[:rows], whole[:rows])
    assert not salvaged.pixels[rows:].any()


@pytest.mark.parametrize("mode", ["RGB", "L", "RGBA", "P", "I;16", "1"])
def test_the_rows_salvaged_from_a_png_are_those_of_the_whole(tmp_path, mode):
    random = np.random.default_rng(4)
    if mode == "I;16":
        image = Image.fromarray(random.integers(0, 2**16, (200, 150), np.uint16))
    else:
        image = Image.fromarray(random.integers(0, 256, (200, 150, 4), np.uint8), "RGBA")
        if mode == "RGBA":
            image.putalpha(255)
        else:
            image = image.convert("RGB").convert(mode)
    path = tmp_path / "a.png"
    image.save(path)
    whole = read_photograph(path)
    cut(path, 0.6)
    with pytest.warns(UserWarning, match="ends early"):
        salvaged = photographs.read(path, SALVAGE)
    assert salvaged.outside is not None
    rows = 200 - np.count_nonzero(salvaged.outside.all(axis=1))
    assert 60 < rows < 180
    np.testing.assert_array_equal(salvaged.pixels[:rows], whole.pixels[:rows])


def test_the_rows_salvaged_from_a_tiff_are_those_of_the_whole(tmp_path, noisy):
    # Its folder ahead of its pixels, as Pillow writes it.
    path = saved(tmp_path / "a.tif", noisy.astype(np.uint8))
    path.write_bytes(path.read_bytes()[: -50 * 3 * 20])
    with pytest.raises(UnreadableFile):
        read_photograph(path)
    with pytest.warns(UserWarning, match="ends early; 20 of 60 rows are missing"):
        salvaged = photographs.read(path, SALVAGE)
    np.testing.assert_array_equal(salvaged.pixels[:40], noisy[:40].astype(np.uint8))


def test_of_a_packed_tiff_whole_strips_are_salvaged(tmp_path, noisy):
    strips = [zlib.compress(noisy[top : top + 10].tobytes()) for top in range(0, 60, 10)]
    tags = {256: (4, [50]), 257: (4, [60]), 258: (3, [16] * 3), 259: (3, [8]), 262: (3, [2]), 277: (3, [3]),
            278: (4, [10])}  # fmt: skip
    write_tiff(tmp_path / "a.tif", tags, strips)
    whole = (tmp_path / "a.tif").read_bytes()
    # The fourth strip is said to lie where a longer file would have it.
    (folder,) = read_folders(tmp_path / "a.tif")
    place = struct.pack("<I", folder.integers(273)[3])
    assert whole.count(place) == 1
    (tmp_path / "a.tif").write_bytes(whole.replace(place, struct.pack("<I", len(whole) - 5)))
    with pytest.warns(UserWarning, match="ends early; 30 of 60 rows are missing"):
        salvaged = photographs.read(tmp_path / "a.tif", SALVAGE)
    np.testing.assert_array_equal(salvaged.pixels[:30], noisy[:30])


def test_what_nobody_can_say_is_not_salvaged(tmp_path, noisy):
    path = cut(saved(tmp_path / "a.jpg", noisy.astype(np.uint8), progressive=True), 0.7)
    with pytest.raises(UnreadableFile, match="a progressive JPEG that ends early"):
        photographs.read(path, SALVAGE)
    early = saved(tmp_path / "b.png", noisy.astype(np.uint8))
    early.write_bytes(early.read_bytes()[:80])
    with pytest.raises(UnreadableFile, match="ends before its first rows"):
        photographs.read(early, SALVAGE)


def test_a_whole_file_is_salvaged_to_itself(tmp_path, noisy):
    for name in ("a.jpg", "a.png", "a.tif"):
        path = saved(tmp_path / name, noisy.astype(np.uint8))
        salvaged = photographs.read(path, SALVAGE)
        np.testing.assert_array_equal(salvaged.pixels, read_photograph(path).pixels)
        assert salvaged.outside is None


def test_an_altered_png_is_not_salvaged(tmp_path, noisy):
    path = saved(tmp_path / "a.png", noisy.astype(np.uint8))
    data = bytearray(path.read_bytes())
    data[data.index(b"IDAT") + 20] ^= 1
    path.write_bytes(data)
    with pytest.raises(FormatError, match="checksum"):
        photographs.read(path, SALVAGE)
