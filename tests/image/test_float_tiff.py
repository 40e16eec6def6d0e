"""TIFF of floats: every bit comes back, other programs agree, and no file is believed."""

import itertools
import struct
import zlib
from dataclasses import replace

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image

from other_programs import attributes_by_openimageio, by_opencv, by_openimageio
from relume.errors import FormatError, UnreadableFile
from relume.image.files import read_radiance as read
from relume.image.files import write
from relume.image.files.encodings import FloatTIFF
from relume.image.files.read_options import ReadOptions
from relume.image.files.tiff import float_tiff
from relume.image.files.tiff.directories import read_folders
from relume.image.files.tiff.samples import predicted
from relume.image.files.tiff.writing import write_tiff
from relume.image.primaries import BT2020, REC709, between
from relume.image.radiance import OUTSIDE, RadianceMap
from tiff_files import big_endian, moved_tags

SPECIAL = np.array([0x0, 0x80000000, 1, 0x807FFFFF, 0x7F800000, 0xFF800000, 0x7FC00001, 0xFFA12345, 0x3F800000,
                    0x7F7FFFFF, 0x00800000, 0x12345678], np.uint32)  # fmt: skip


@pytest.fixture
def every_bit() -> np.ndarray:
    """(70, 90, 3) float32 of random bits, with the special values in the first row."""
    bits = np.random.default_rng(11).integers(0, 2**32, (70, 90, 3), np.uint32)
    bits[0, :4] = SPECIAL.reshape(4, 3)
    return bits.view(np.float32)


def bits(pixels):
    return np.ascontiguousarray(pixels).view(np.uint32)


def written_by_oiio(path, pixels, kind="float", **attributes):
    """Write as OpenImageIO does."""
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.alpha_channel = channels - 1 if channels in (2, 4) else -1
    for name, value in attributes.items():
        if name in ("tile_width", "tile_height"):
            setattr(spec, name, value)
        else:
            spec.attribute(name.replace("__", ":"), value)
    target = oiio.ImageOutput.create(str(path))
    assert target is not None and target.open(str(path), spec), oiio.geterror()
    assert target.write_image(pixels), target.geterror()
    target.close()
    return path


def by_hand(path, samples, width, height, tags=(), strips=None, photometric=1):
    """A TIFF of one strip of ready bytes; `tags` go over those it needs."""
    known = {256: (4, [width]), 257: (4, [height]), 258: (3, [24]), 259: (3, [1]), 262: (3, [photometric]),
             277: (3, [1]), 278: (4, [height]), 339: (3, [3]), **dict(tags)}  # fmt: skip
    write_tiff(path, known, strips or [samples])
    return path


@pytest.mark.parametrize("compressed", [True, False])
def test_every_bit_comes_back(tmp_path, every_bit, compressed):
    float_tiff.write(tmp_path / "a.tif", RadianceMap(every_bit), FloatTIFF(compressed))
    again = read(tmp_path / "a.tif")
    np.testing.assert_array_equal(bits(again.radiance), bits(every_bit))
    assert (again.unit, again.attributes, again.clipped, again.variance) == ("relative", {}, None, None)


@pytest.mark.parametrize("compressed", [True, False])
def test_other_readers_find_the_same_bits(tmp_path, every_bit, compressed):
    path = tmp_path / "a.tif"
    float_tiff.write(path, RadianceMap(every_bit), FloatTIFF(compressed))
    np.testing.assert_array_equal(bits(by_openimageio(path)), bits(every_bit))
    np.testing.assert_array_equal(bits(by_opencv(path)), bits(every_bit))


def test_a_map_is_written_byte_for_byte(tmp_path):
    pixels = np.array([[[1, -2, 0.5], [1, 2, 0.25]]], np.float32)
    float_tiff.write(tmp_path / "a.tif", RadianceMap(pixels, unit="cd/m²"), FloatTIFF(compressed=False))
    data = (tmp_path / "a.tif").read_bytes()
    assert data[:4] == b"II*\0"
    assert data[8:32] == bytes.fromhex("0000803f 000000c0 0000003f 0000803f 00000040 0000803e")
    (folder,) = read_folders(tmp_path / "a.tif")
    assert folder.values == {
        256: (2,), 257: (1,), 258: (32, 32, 32), 259: (1,), 262: (2,), 273: (8,), 277: (3,), 278: (21845,), 279: (24,),
        284: (1,), 305: b"relume\0", 318: (0.3127, 0.329), 319: (0.64, 0.33, 0.3, 0.6, 0.15, 0.06), 339: (3, 3, 3),
        37439: (1.0,)}  # fmt: skip
    # The highest bytes of both pixels, 3f c0 3f | 3f 40 3e, then the next; each less the one of a pixel before it.
    reports = "3fc03f 0080ff 414042 404000 80c080 000000 000000 000000".replace(" ", "")
    assert predicted_slowly(pixels).hex() == predicted(pixels).hex()
    assert predicted(pixels).hex()[:12] == reports[:12]


def predicted_slowly(pixels):
    """The floating-point predictor of Adobe's technical note 3, byte by byte."""
    made = bytearray()
    for row in pixels:
        values = [struct.pack(">f", value) for value in row.ravel()]
        weights = [value[byte] for byte in range(4) for value in values]
        step = row.shape[-1]
        made += bytes((w - weights[i - step]) % 256 if i >= step else w for i, w in enumerate(weights))
    return bytes(made)


def test_the_predictor_is_that_of_the_note():
    pixels = np.random.default_rng(2).normal(size=(3, 5, 3)).astype(np.float32)
    assert predicted(pixels) == predicted_slowly(pixels)


def test_floats_of_all_depths_hold_the_same_picture(shared):
    folder = shared / "data/formats/float_tiff"
    expected = by_openimageio(folder / "float32.tif")
    assert (expected.min(), expected.max()) == (74, 255)
    for depth in (16, 24, 32, 64):
        image = read(folder / f"float{depth}.tif")
        np.testing.assert_array_equal(image.radiance, np.repeat(expected.reshape(20, 20, 1), 3, axis=2))
        assert float_tiff.subtype(folder / f"float{depth}.tif") == f"float, {depth} bits, uncompressed, grey"


def value_of_24_bits(code):
    """The value of a 24-bit float by its definition: 1 sign, 7 exponent bits of bias 63, 16 mantissa bits."""
    sign, exponent, mantissa = (-1) ** (code >> 23), code >> 16 & 127, code & 65535
    if exponent == 127:
        return sign * np.inf if mantissa == 0 else np.nan
    return sign * ((1 + mantissa / 65536) * 2.0 ** (exponent - 63) if exponent else mantissa / 65536 * 2.0**-62)


CODES = [0, 0x800000, 1, 0x80FFFF, 0x010000, 0x3F0000, 0xBF8000, 0x7EFFFF, 0x7F0000, 0xFF0000, 0x7F0001, 0x123456]


def test_24_bits_are_decoded_by_their_definition(tmp_path):
    codes = CODES + np.random.default_rng(4).integers(0, 2**24, 500).tolist()
    stored = b"".join(code.to_bytes(3, "little") for code in codes)
    found = read(by_hand(tmp_path / "a.tif", stored, 64, 8)).radiance[..., 0].ravel()
    expected = np.array([value_of_24_bits(code) for code in codes])
    np.testing.assert_array_equal(found, expected)
    assert np.signbit(found[1]) and not np.signbit(found[0])


@pytest.mark.parametrize(("compression", "predictor"), [(8, 1), (8, 3), (32946, 1)])
def test_24_bits_may_be_packed(tmp_path, compression, predictor):
    codes = [code for code in CODES if code not in (0x7F0001,)] + [0x400000]
    width, height = 6, 2
    if predictor == 3:
        rows = [[code.to_bytes(3, "big") for code in codes[r * width : (r + 1) * width]] for r in range(height)]
        weights = [[code[byte] for byte in range(3) for code in row] for row in rows]
        stored = b"".join(bytes([w[0]] + [(b - a) % 256 for a, b in itertools.pairwise(w)]) for w in weights)
    else:
        stored = b"".join(code.to_bytes(3, "little") for code in codes)
    tags = {259: (3, [compression]), 317: (3, [predictor])}
    path = by_hand(tmp_path / "a.tif", zlib.compress(stored), width, height, tags.items())
    expected = np.array([value_of_24_bits(code) for code in codes])
    np.testing.assert_array_equal(read(path).radiance[..., 1].ravel(), expected)


def test_24_bits_may_be_big_endian(tmp_path):
    codes = b"".join(code.to_bytes(3, "big") for code in (0x3F0000, 0xBF8000, 0x400000))
    path = by_hand(tmp_path / "a.tif", codes, 3, 1)
    path.write_bytes(big_endian(path))
    assert read(path).radiance[0, :, 0].tolist() == [1.0, -1.5, 2.0]
    assert float_tiff.subtype(path) == "float, 24 bits, uncompressed, grey, big-endian"


@pytest.mark.parametrize("compression", [1, 8])
@pytest.mark.parametrize("depth", [16, 32, 64])
def test_floats_may_be_big_endian(tmp_path, compression, depth):
    pixels = np.random.default_rng(6).normal(size=(4, 5)).astype(np.float16).astype(f">f{depth // 8}")
    stored = zlib.compress(pixels.tobytes()) if compression == 8 else pixels.tobytes()
    tags = {258: (3, [depth]), 259: (3, [compression])}
    path = by_hand(tmp_path / "a.tif", stored, 5, 4, tags.items())
    path.write_bytes(big_endian(path))
    np.testing.assert_array_equal(read(path).radiance[..., 2], pixels)


def test_predicted_floats_are_the_same_in_both_orders(tmp_path):
    pixels = np.random.default_rng(6).normal(size=(4, 5, 1)).astype("<f4")
    tags = {258: (3, [32]), 259: (3, [8]), 317: (3, [3])}
    path = by_hand(tmp_path / "a.tif", zlib.compress(predicted(pixels)), 5, 4, tags.items())
    np.testing.assert_array_equal(read(path).radiance[..., :1], pixels)
    path.write_bytes(big_endian(path))
    np.testing.assert_array_equal(read(path).radiance[..., :1], pixels)


@pytest.mark.parametrize("compression", ["none", "zip", "lzw", "packbits"])
@pytest.mark.parametrize("depth", ["half", "float", "double"])
@pytest.mark.parametrize("tiled", [False, True])
@pytest.mark.parametrize("planar", ["contig", "separate"])
def test_what_openimageio_writes_is_read_alike(tmp_path, compression, depth, tiled, planar):
    pixels = np.random.default_rng(9).normal(size=(37, 53, 3)).astype(np.float16).astype(np.float32)
    tile = {"tile_width": 16, "tile_height": 32} if tiled else {"tiff__RowsPerStrip": 5}
    tile["tiff__half"] = int(depth == "half")
    path = written_by_oiio(tmp_path / "a.tif", pixels, depth, compression=compression, planarconfig=planar, **tile)
    np.testing.assert_array_equal(read(path).radiance, pixels)
    words = float_tiff.subtype(path)
    assert words.startswith(f"float, {dict(half=16, float=32, double=64)[depth]} bits, ")
    assert words.endswith("tiled 16 × 32") == tiled


def test_what_opencv_and_pillow_write_is_read_alike(tmp_path):
    pixels = np.random.default_rng(9).normal(size=(37, 53, 3)).astype(np.float32)
    assert cv2.imwrite(str(tmp_path / "a.tif"), pixels[..., ::-1])
    np.testing.assert_array_equal(read(tmp_path / "a.tif").radiance, pixels)
    for compression in (None, "tiff_lzw", "tiff_adobe_deflate"):
        Image.fromarray(pixels[..., 0]).save(tmp_path / "b.tif", compression=compression)
        np.testing.assert_array_equal(read(tmp_path / "b.tif").radiance, np.repeat(pixels[..., :1], 3, axis=2))


def test_a_bigtiff_is_read(tmp_path, monkeypatch, every_bit):
    import relume.image.files.tiff.writing as tiff_writing

    monkeypatch.setattr(tiff_writing, "_LARGEST", 4)
    float_tiff.write(tmp_path / "a.tif", RadianceMap(every_bit))
    assert (tmp_path / "a.tif").read_bytes()[:4] == b"II+\0"
    np.testing.assert_array_equal(bits(read(tmp_path / "a.tif").radiance), bits(every_bit))
    np.testing.assert_array_equal(bits(by_openimageio(tmp_path / "a.tif")), bits(every_bit))


def test_doubles_beyond_float32_are_refused_and_infinite_ones_kept(tmp_path):
    pixels = np.ones((4, 5, 3))
    pixels[0, 0] = [np.inf, -np.inf, np.nan]
    path = written_by_oiio(tmp_path / "a.tif", pixels, "double")
    np.testing.assert_array_equal(read(path).radiance[0, 0], [np.inf, -np.inf, np.nan])
    pixels[1, 1:3, 2] = [1e39, -1e300]
    for compression in ("none", "zip"):
        written_by_oiio(path, pixels, "double", compression=compression)
        with pytest.raises(UnreadableFile, match=r"2 of its doubles are beyond float32, 3\.4e38; scale it down"):
            read(path)


@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize("compression", ["none", "zip"])
def test_alpha_is_left_out_and_reported(tmp_path, planar, compression):
    pixels = np.random.default_rng(9).normal(size=(6, 5, 4)).astype(np.float32)
    pixels[..., 3] = 1
    path = written_by_oiio(tmp_path / "a.tif", pixels, planarconfig=planar, compression=compression)
    np.testing.assert_array_equal(read(path).radiance, pixels[..., :3])
    pixels[2, :4, 3] = 0.5
    written_by_oiio(path, pixels, planarconfig=planar, compression=compression)
    with pytest.warns(UserWarning, match="alpha is left out, though 4 pixels are not opaque"):
        np.testing.assert_array_equal(read(path).radiance, pixels[..., :3])


def test_further_pages_are_reported(tmp_path):
    Image.new("F", (3, 2)).save(tmp_path / "a.tif", save_all=True, append_images=[Image.new("F", (3, 2))] * 2)
    with pytest.warns(UserWarning, match="only the first of its 3 pages is read"):
        read(tmp_path / "a.tif")
    assert float_tiff.subtype(tmp_path / "a.tif") == "float, 32 bits, uncompressed, grey, 3 pages"


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_map_is_turned_upright(tmp_path, numbered, orientation):
    path = written_by_oiio(tmp_path / "a.tif", numbered, Orientation=orientation)
    rows = numbered.swapaxes(0, 1) if orientation >= 5 else numbered
    # EXIF 2.32, tag 0x0112: where the first row and the first column of the stored picture are seen.
    top = orientation in (1, 2, 5, 6)
    left = orientation in (1, 4, 5, 8)
    np.testing.assert_array_equal(read(path).radiance, rows[:: 1 if top else -1, :: 1 if left else -1])


# Unit, primaries, attributes

ATTRIBUTES = {
    "exposure_time": "0.016666668", "f_number": "5.6", "iso": "100", "focal_length": "50", "camera": "EOS 5D",
    "camera_make": "Canon", "serial": "0430", "lens": "EF 50mm", "taken": "2010:05:15 13:01:23", "owner": "Ü. Someone",
    "comments": "two\nlines ", "software": "other 1.0", "mapping": "latlong", "view": "-vf a\0b", "two words": "<&>",
    "primaries": "0.7 0.3 0.2 0.8 0.1 0.1 0.3 0.3", "envmap": ""}  # fmt: skip


def test_every_attribute_comes_back_and_no_unit_is_lost(tmp_path, numbered):
    given = RadianceMap(numbered, unit="cd/m²", attributes=ATTRIBUTES)
    write(tmp_path / "a.tif", given)
    again = read(tmp_path / "a.tif")
    assert (again.unit, again.attributes) == ("cd/m²", ATTRIBUTES)
    np.testing.assert_array_equal(again.radiance, numbered)
    odd = {
        "exposure_time": "1/60",
        "f_number": "5.60",
        "iso": "133.3",
        "focal_length": "-3",
        "lens": " x ",
        "owner": "",
    }
    write(tmp_path / "a.tif", replace(given, attributes=odd))
    assert read(tmp_path / "a.tif").attributes == odd


def test_another_program_finds_the_settings(tmp_path, numbered):
    write(tmp_path / "a.tif", RadianceMap(numbered, attributes=ATTRIBUTES))
    names = "ExposureTime", "FNumber", "Model", "Software", "Exif:LensModel"
    reports = attributes_by_openimageio(tmp_path / "a.tif", *names)
    assert reports == [pytest.approx(1 / 60), pytest.approx(5.6), "EOS 5D", "other 1.0", "EF 50mm"]


def test_settings_of_another_program_are_read(tmp_path, numbered):
    path = written_by_oiio(
        tmp_path / "a.tif", numbered, ExposureTime=0.25, FNumber=8.0, Model="M", Artist="A", ImageDescription="words"
    )
    found = read(path).attributes
    assert {name: found[name] for name in ("exposure_time", "f_number", "camera", "owner", "comments")} == {
        "exposure_time": "0.25", "f_number": "8", "camera": "M", "owner": "A", "comments": "words"}  # fmt: skip


def with_tags(path, image, tags):
    """Write a map with further tags."""
    rows = np.ascontiguousarray(image, "<f4")
    height, width, _ = rows.shape
    known = {258: (3, [32] * 3), 262: (3, [2]), 277: (3, [3]), 339: (3, [3] * 3), **tags}
    return by_hand(path, rows.tobytes(), width, height, known.items())


def test_stonits_scales_to_cd_per_m2(tmp_path, numbered):
    path = with_tags(tmp_path / "a.tif", numbered, {37439: (12, [100.0])})
    image = read(path)
    assert image.unit == "cd/m²"
    np.testing.assert_array_equal(image.radiance, numbered * np.float32(100))
    for value in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(FormatError, match="STONITS"):
            read(with_tags(path, numbered, {37439: (12, [value])}))
    with pytest.raises(UnreadableFile, match=r"STONITS of 1e\+38, .* beyond float32"):
        read(with_tags(path, numbered, {37439: (12, [1e38])}))


def rationals(*numbers):
    return 5, [term for number in numbers for term in (round(number * 10000), 10000)]


def test_other_primaries_are_converted_and_reported(tmp_path, numbered):
    named = {318: rationals(*BT2020.white), 319: rationals(*BT2020.red, *BT2020.green, *BT2020.blue)}
    path = with_tags(tmp_path / "a.tif", numbered, named)
    with pytest.warns(UserWarning, match=r"its primaries are 0\.708 0\.292 .*; converted to Rec\. 709"):
        image = read(path)
    expected = numbered @ between(BT2020, REC709).T
    np.testing.assert_allclose(image.radiance, expected, rtol=1e-5, atol=1e-2)
    assert image.attributes["primaries"] == BT2020.text
    assert (image.radiance < 0).any()  # nothing is clipped
    senseless = with_tags(tmp_path / "b.tif", numbered, {318: rationals(0.3, 0.3), 319: rationals(*[0.3] * 6)})
    with pytest.warns(UserWarning, match=r"taken for Rec\. 709"):
        np.testing.assert_array_equal(read(senseless).radiance, numbered)


def test_damaged_metadata_is_left_out_and_reported(tmp_path, numbered):
    with pytest.warns(UserWarning, match="XMP packet is damaged"):
        np.testing.assert_array_equal(
            read(with_tags(tmp_path / "a.tif", numbered, {700: (1, b"<x")})).radiance, numbered
        )
    with pytest.warns(UserWarning, match="its EXIF is left out"):
        read(with_tags(tmp_path / "a.tif", numbered, {34665: (4, [10**6])}))


# Damage


def test_a_file_that_ends_early_is_refused_or_read_as_far_as_it_goes(tmp_path):
    pixels = np.arange(40 * 30 * 3, dtype=np.float32).reshape(40, 30, 3)
    whole = with_tags(tmp_path / "a.tif", pixels, {})
    path = tmp_path / "b.tif"
    path.write_bytes(moved_tags(whole))
    np.testing.assert_array_equal(read(path).radiance, pixels)
    path.write_bytes(moved_tags(whole, cut=30 * 360 - 7))
    with pytest.raises(FormatError, match="after 10 of 40 rows"):
        read(path)
    with pytest.warns(UserWarning, match="ends early; 30 of 40 rows are missing"):
        image = read(path, ReadOptions(salvage=True))
    np.testing.assert_array_equal(image.radiance[:10], pixels[:10])
    assert not image.radiance[10:].any()
    assert image.clipped is not None
    assert (image.clipped[:10] == 0).all() and (image.clipped[10:] == OUTSIDE).all()


def grey(tags):
    return {258: (3, [32]), **tags}


@pytest.mark.parametrize(
    ("tags", "said"),
    [
        (grey({259: (3, [34925])}), "LZMA"),
        (grey({317: (3, [3])}), "predictor"),
        (grey({259: (3, [8]), 317: (3, [2])}), "predictor"),
        (grey({262: (3, [0])}), "photometric interpretation 0"),
        (grey({262: (3, [5])}), "photometric interpretation 5"),
        ({258: (3, [32] * 2), 277: (3, [2]), 339: (3, [3, 1])}, r"tag 339 \(sample format\)"),
        ({258: (3, [128])}, r"tag 258 \(bits\)"),
        ({258: (3, [8])}, "8 bits of sample format 3"),
        (grey({277: (3, [65])}), "claims 65 channels"),
        (grey({277: (3, [0])}), r"tag 277 \(samples\)"),
        (grey({256: (4, [70000])}), "70000 x 2"),
        (grey({256: (4, [60000]), 257: (4, [4000]), 278: (4, [4000])}), "cannot hold"),
        (grey({256: (4, [600]), 257: (4, [400]), 278: (4, [400])}), "strips that hold 960000 bytes"),
        (grey({259: (3, [8]), 256: (4, [60000]), 257: (4, [4000]), 278: (4, [4000])}), "cannot hold"),
        (grey({259: (3, [8]), 256: (4, [1000]), 257: (4, [1000]), 278: (4, [1000])}), "strips that hold 4000000 bytes"),
        (grey({278: (4, [1])}), "2 offsets of strips, found 1"),
        (grey({322: (4, [16])}), r"tag 323 \(tile height\)"),
        (grey({256: (11, [float("nan")])}), r"tag 256 \(width\)"),
    ],
)
def test_what_makes_no_sense_is_refused_by_its_tag(tmp_path, tags, said):
    path = by_hand(tmp_path / "a.tif", bytes(24), 3, 2, tags.items())
    with pytest.raises(UnreadableFile, match=said) as raised:
        float_tiff.read(path)
    assert "\n" not in str(raised.value)


def test_damaged_zip_data_is_refused(tmp_path, every_bit):
    for own in (True, False):
        path = tmp_path / "a.tif"
        if own:
            by_hand(path, zlib.compress(bytes(3000))[:-20], 100, 10, {259: (3, [8])}.items())
        else:
            float_tiff.write(path, RadianceMap(every_bit))
            data = bytearray(path.read_bytes())
            data[3000:3010] = b"\xff" * 10
            path.write_bytes(data)
        with pytest.raises(FormatError, match=r"strip 0|rows 0 to"):
            read(path)
