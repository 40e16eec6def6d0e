"""LogLuv TIFF: literal bytes, every layout a file may have, and files that are damaged."""

import math
import struct
import warnings
from dataclasses import replace

import numpy as np
import pytest

import naive_logluv
from relume.errors import FormatError, UnreadableFile
from relume.image.files import ReadOptions, write
from relume.image.files import read_radiance as read
from relume.image.files.encodings import LogLuv
from relume.image.files.logluv import blocks as logluv_blocks
from relume.image.files.logluv import kernels
from relume.image.files.logluv.logluv_tiff import subtype
from relume.image.files.tiff.directories import read_folders
from relume.image.files.tiff.writing import write_tiff
from relume.image.primaries import REC709
from relume.image.radiance import RadianceMap
from tiff_files import big_endian, moved_tags

TO_XYZ = REC709.to_xyz()
FROM_XYZ = np.linalg.inv(TO_XYZ)
GREY = 0x4000_51C0  # luminance code 16384, u′ and v′ nearest to D65


def tiff(path, data, width, height, bits=32, others=()):
    """A LogLuv TIFF of ready-made strips."""
    channels = 1 if bits == 16 else 3
    tags = {
        256: (4, [width]),
        257: (4, [height]),
        258: (3, [16] * channels),
        259: (3, [34677 if bits == 24 else 34676]),
        262: (3, [32844 if bits == 16 else 32845]),
        277: (3, [channels]),
        278: (4, [-(-height // len(data))]),
        284: (3, [1]),
        **dict(others),
    }
    write_tiff(path, tags, data)
    return path


def packed(words, bits=32, rows=None):
    return [bytes(strip) for strip in logluv_blocks.packed(np.asarray(words, np.uint32), bits, rows or len(words))]


def some_words(height, width, seed=1):
    """Words with runs of every length, of luminances about 1 and colours about white."""
    generator = np.random.default_rng(seed)
    values = generator.integers(0, [256, 24, 24], (height * width, 3)) @ [1 << 16, 1 << 8, 1] + 0x4000_5090
    lengths = generator.integers(1, 300, height * width)
    lengths[generator.random(len(lengths)) < 0.8] = 1
    return np.repeat(values, lengths)[: height * width].reshape(height, width).astype(np.uint32)


def radiance_of(words):
    return (naive_logluv.decode(words.astype(np.int64), 32) @ FROM_XYZ.T).astype(np.float32)


@pytest.mark.parametrize(
    ("bits", "pixel", "stored"),
    [
        # As libtiff writes them: L = 1 is 16384 or 768; u′ = .1978, v′ = .4683 are 81 and 192, or cell 11926.
        (32, (1, 1, 1), "0140 0100 0151 01c0"),
        (32, (-1, -1, -1), "01c0 0100 0151 01c0"),
        (32, (0, 0, 0), "0100 0100 0156 01c2"),
        (24, (1, 1, 1), "c02e96"),
        (24, (0, 0, 0), "002fea"),
        (16, (1, 1, 1), "0140 0100"),
        (16, (4, 4, 4), "0142 0100"),
    ],
)
def test_a_pixel_is_written_as_these_bytes(tmp_path, bits, pixel, stored):
    path = tmp_path / "a.tif"
    write(path, RadianceMap(np.array([[pixel]], np.float32)), LogLuv(bits))
    data = path.read_bytes()[8 : 8 + read_folders(path)[0].integers(279)[0]]
    assert data.hex() == stored.replace(" ", "")


def test_runs_and_literals_are_read_as_the_format_says(tmp_path):
    # Five pixels: a run of five, literals, a literal of none (a legal nothing) and a run of two among literals.
    streams = bytes([0x83, 0x40]) + bytes([2, 0, 1, 0x81, 2]) + bytes([0, 0x83, 0x51]) + bytes([5, *[0xC0] * 5])
    image = read(tiff(tmp_path / "a.tif", [streams], 5, 1))
    words = np.array([[0x400051C0, 0x400151C0, 0x400251C0, 0x400251C0, 0x400251C0]])
    np.testing.assert_allclose(image.radiance, radiance_of(words), rtol=1e-6)
    assert image.unit == "relative"
    assert image.clipped is None


@pytest.mark.parametrize("streams", [2, 4])
@pytest.mark.parametrize("width", [1, 2, 3, 127, 128, 129, 130, 131, 258, 1000])
def test_packed_runs_unpack_to_the_same(streams, width):
    words = some_words(5, width, seed=width)
    words[0] = 7  # a row of one run
    words[1] = np.arange(width) % 251 * 0x01010101  # a row without any
    if streams == 2:
        words &= np.uint32(0xFFFF0000)
    room = np.empty(5 * streams * (width + -(-width // 127)), np.uint8)
    length = kernels.pack_runs(words, streams, room)
    places, failures = np.full(5, -1), np.full((1, 3), -1)
    ends, firsts = np.array([length]), np.array([0, 5])
    kernels.find_rows(room[:length], np.array([0]), ends, firsts, width, streams, places, failures)
    found = np.empty((5, width), np.uint32)
    kernels.unpack_runs(room[:length], places, streams, found)
    np.testing.assert_array_equal(found, words)
    assert failures.tolist() == [[-1, -1, -1]]
    assert places[1] - places[0] == streams * 2 * -(-width // 129)
    assert length == len(b"".join(slow_runs(found, streams)))


def slow_runs(words, streams):
    """The runs of each byte stream: four and more are worth one, two and three only where no literals are open."""
    for row in words.tolist():
        for stream in range(streams):
            values, out, literals, at = [word >> (24 - 8 * stream) & 255 for word in row], b"", b"", 0
            while at < len(values):
                end = at
                while end < min(len(values), at + 129) and values[end] == values[at]:
                    end += 1
                if end - at >= 4 or (end - at >= 2 and not literals):
                    out += split(literals) + bytes([end - at + 126, values[at]])
                    literals = b""
                else:
                    literals += bytes(values[at:end])
                at = end
            yield out + split(literals)


def split(literals):
    return b"".join(
        bytes([len(literals[at : at + 127])]) + literals[at : at + 127] for at in range(0, len(literals), 127)
    )


@pytest.mark.parametrize("rows", [1, 3, 7, 20])
@pytest.mark.parametrize("order", ["little", "big"])
def test_strips_of_any_height_and_order_are_read(tmp_path, rows, order):
    words = some_words(20, 37)
    path = tiff(tmp_path / "a.tif", packed(words, rows=rows), 37, 20, others={278: (4, [rows])})
    if order == "big":
        path.write_bytes(big_endian(path))
    np.testing.assert_allclose(read(path).radiance, radiance_of(words), rtol=2e-6, atol=1e-6)


@pytest.mark.parametrize("bits", [16, 24, 32])
def test_tiles_are_read(tmp_path, bits):
    words = some_words(40, 50)
    if bits == 24:
        words = (words >> 16 & 0xFF) + 700 << 16 | words & 0x1FFF
    padded = np.zeros((48, 64), np.uint32)
    padded[:40, :50] = words
    tiles = [packed(padded[y : y + 16, x : x + 32], bits)[0] for y in (0, 16, 32) for x in (0, 32)]
    tiled = tiff(tmp_path / "t.tif", tiles, 50, 40, bits)
    turned = {273: 324, 278: 323, 279: 325}
    data = bytearray(tiled.read_bytes())
    (at,) = struct.unpack_from("<I", data, 4)
    (count,) = struct.unpack_from("<H", data, at)
    entries = [bytearray(data[at + 2 + 12 * i : at + 14 + 12 * i]) for i in range(count)]
    for entry in entries:
        (tag,) = struct.unpack_from("<H", entry)
        struct.pack_into("<H", entry, 0, turned.get(tag, tag))
        if tag == 278:
            struct.pack_into("<I", entry, 8, 16)
        if tag == 284:  # not needed: here stands the tiles' width
            entry[:] = struct.pack("<HHII", 322, 4, 1, 32)
    data[at + 2 : at + 2 + 12 * count] = b"".join(sorted(entries, key=lambda entry: struct.unpack_from("<H", entry)))
    tiled.write_bytes(data)
    strips = tiff(tmp_path / "s.tif", packed(words, bits), 50, 40, bits)
    np.testing.assert_array_equal(read(tiled).radiance, read(strips).radiance)
    assert subtype(tiled).endswith(f"{bits} bits, tiled 32 × 16")
    # Cut short, only what lay in the last tiles is missing.
    (tmp_path / "cut.tif").write_bytes(moved_tags(tiled, cut=len(tiles[-1]) - 3))
    with pytest.warns(UserWarning, match="of its 40 rows are missing"):
        salvaged = read(tmp_path / "cut.tif", ReadOptions(salvage=True))
    assert salvaged.clipped is not None
    assert np.all(salvaged.clipped[:32] == 0)
    assert np.all(salvaged.clipped[:, :32] == 0)
    assert salvaged.clipped[39, 49] == 3


@pytest.mark.parametrize(
    ("orientation", "corner"), [(1, (0, 0)), (2, (0, -1)), (3, (-1, -1)), (4, (-1, 0)), (6, (0, -1)), (8, (-1, 0))]
)
def test_pictures_are_turned_upright(tmp_path, orientation, corner):
    words = np.full((2, 3), GREY)
    words[0, 0] += 256 << 16
    image = read(tiff(tmp_path / "a.tif", packed(words), 3, 2, others={274: (3, [orientation])}))
    assert image.radiance.shape[:2] == ((3, 2) if orientation in (6, 8) else (2, 3))
    assert image.radiance[corner][1] == image.radiance[..., 1].max() > 1.9


@pytest.mark.parametrize("bits", [16, 24, 32])
@pytest.mark.parametrize("unit", ["relative", "cd/m²"])
def test_a_map_comes_back_within_the_steps(tmp_path, bits, unit):
    attributes = {"mapping": "latlong", "camera": "Nikon D70", "exposure_time": "0.5", "comments": "two\nlines"}
    image = naive_logluv.some_map(unit, attributes)
    path = tmp_path / "a.tif"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if bits == 16 else "error")
        write(path, image, LogLuv(bits))
    found = read(path)
    assert (found.unit, found.attributes) == (unit, attributes)
    ratio = found.radiance @ TO_XYZ[1] / (image.radiance @ TO_XYZ[1])
    assert np.abs(np.log2(ratio)).max() < (0.5 / 64 if bits == 24 else 0.5 / 256) + 1e-6
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write(tmp_path / "b.tif", found, LogLuv(bits))
    assert (tmp_path / "b.tif").read_bytes() == path.read_bytes()


def test_24_bits_of_cd_per_square_metre_are_scaled_to_fit(tmp_path):
    image = RadianceMap(np.full((1, 2, 3), [[[3e4], [90.0]]], np.float32), unit="cd/m²")
    write(tmp_path / "a.tif", image, LogLuv(24))
    assert read_folders(tmp_path / "a.tif")[0].number(37439) == 2048  # 3e4 / 2048 = 14.6, just below 16
    np.testing.assert_allclose(read(tmp_path / "a.tif").radiance[..., 1], image.radiance[..., 1], rtol=0.02)


# The second is 1 but for half a unit in the last place of a float64, and its logarithm that of 1.
@pytest.mark.parametrize("pixel", [(1, 1, 1), (0.9254888296127319, 0.9107989072799683, 2.1031341552734375)])
@pytest.mark.parametrize("power", [-20, 0, 15])
def test_a_maximum_of_a_power_of_two_fits_in_24_bits(tmp_path, pixel, power):
    image = RadianceMap(np.full((1, 3, 3), np.array(pixel, np.float32) * 2.0**power, np.float32), unit="cd/m²")
    write(tmp_path / "a.tif", image, LogLuv(24))
    assert read_folders(tmp_path / "a.tif")[0].number(37439) == 2.0 ** (power - 3)
    np.testing.assert_allclose(read(tmp_path / "a.tif").radiance @ TO_XYZ[1], 2.0**power, rtol=0.0055)


def test_stonits_scales_and_names_the_unit(tmp_path):
    path = tiff(tmp_path / "a.tif", packed([[GREY]]), 1, 1, others={37439: (12, [179.0])})
    image = read(path)
    assert image.unit == "cd/m²"
    assert image.radiance[0, 0] @ TO_XYZ[1] == pytest.approx(179 * 2 ** (0.5 / 256), rel=1e-6)


def test_another_white_is_adapted_and_reported(tmp_path):
    equal = [1, 3, 1, 3]
    path = tiff(tmp_path / "a.tif", packed([[0x4000_56C2]]), 1, 1, others={318: (5, equal)})
    with pytest.warns(UserWarning, match=r"its white is 0\.3333 0\.3333 \(x, y\); adapted to D65"):
        image = read(path)
    assert image.attributes["white"] == "0.333333 0.333333"
    # The code nearest to equal energy is grey once it is adapted, to within its cell, and pink as it is.
    assert np.ptp(image.radiance) < 0.02
    assert np.ptp(read(tiff(tmp_path / "b.tif", packed([[0x4000_56C2]]), 1, 1)).radiance) > 0.2
    for x, y in (([0, 0], [0, 0]), ([3, 10], [1, 10**9]), ([2, 1], [1, 3])):
        with pytest.warns(UserWarning, match="which no light has"):
            plain = read(tiff(tmp_path / "c.tif", packed([[0x4000_56C2]]), 1, 1, others={318: (5, [*x, *y])}))
        np.testing.assert_array_equal(plain.radiance, read(tmp_path / "b.tif").radiance)


def test_codes_that_no_colour_has_are_neutral_and_reported(tmp_path):
    stored = b"".join((768 << 14 | code).to_bytes(3, "big") for code in (16288, 16289, 16383)) + (16383).to_bytes(3)
    path = tiff(tmp_path / "a.tif", [stored], 4, 1, 24)
    with pytest.warns(UserWarning, match="2 of 4 pixels have a code that no colour has"):
        image = read(path)
    x, y, z = TO_XYZ @ image.radiance[0, 1].astype(np.float64)
    assert (x, z) == pytest.approx((y, y), rel=1e-5)
    np.testing.assert_array_equal(image.radiance[0, 1], image.radiance[0, 2])
    assert image.radiance[0, 3].tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("bits", "pixel", "message"),
    [
        (32, (math.nan, 0, 0), "1 of 2 pixels are NaN or infinite"),
        (24, (1, math.inf, 0), "1 of 2 pixels are NaN or infinite"),
        (16, (0, 0, -math.inf), "1 of 2 pixels are NaN or infinite"),
        (32, (2e19, 2e19, 2e19), r"brighter than 1\.845e\+19.*write \.exr"),
        (24, (16.5, 16.5, 16.5), r"brighter than 16.*lower its exposure, or write 32 bits \(--as logluv32\)"),
        (24, (-0.1, -0.1, -0.1), "negative luminance"),
    ],
)
def test_what_no_code_holds_is_refused(tmp_path, bits, pixel, message):
    image = RadianceMap(np.array([[pixel, (1, 1, 1)]], np.float32))
    with pytest.raises(ValueError, match=message):
        write(tmp_path / "a.tif", image, LogLuv(bits))
    if "finite" in message or "negative" in message:
        with pytest.raises(ValueError, match=message):
            write(tmp_path / "a.tif", replace(image, unit="cd/m²"), LogLuv(bits))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("bits", "pixel", "message"),
    [
        (32, (1e-25, 1e-25, 1e-25), "1 of 2 pixels are darker than 5.421e-20 and become 0"),
        (
            24,
            (1e-4, 1e-4, 1e-4),
            r"1 of 2 pixels are darker than 0.0002441 and become 0; write 32 bits \(--as logluv32\)",
        ),
        (24, (-2, 1, -2), "1 of 2 pixels have a colour that LogLuv does not hold"),
        (32, (-2, 1, -2), "1 of 2 pixels have a colour that LogLuv does not hold"),
        (16, (1, 2, 1), "1 of 2 pixels have a colour, of which 16 bits keep nothing"),
    ],
)
def test_what_is_lost_is_reported(tmp_path, bits, pixel, message):
    image = RadianceMap(np.array([[pixel, (1, 1, 1)]], np.float32))
    with pytest.warns(UserWarning, match=message) as said:
        write(tmp_path / "a.tif", image, LogLuv(bits))
    assert len(said) == 1
    luminance = read(tmp_path / "a.tif").radiance @ TO_XYZ[1]
    expected = np.maximum(0 if "darker" in message else -math.inf, image.radiance @ TO_XYZ[1])
    np.testing.assert_allclose(luminance, expected, rtol=0.006, atol=2e-4)


def test_negative_luminance_is_kept_in_32_and_16_bits(tmp_path):
    image = RadianceMap(np.full((1, 1, 3), -0.25, np.float32))
    for bits in (16, 32):
        write(tmp_path / "a.tif", image, LogLuv(bits))
        np.testing.assert_allclose(read(tmp_path / "a.tif").radiance, -0.25, rtol=0.02)


@pytest.mark.parametrize(
    ("others", "error"),
    [
        ({259: (3, [1])}, "photometric 32845 with compression 1 is no LogLuv"),
        ({259: (3, [8])}, "compression 8"),
        ({277: (3, [2]), 258: (3, [16, 16])}, "tag 277: expected 1 sample of LogL, 3 of LogLuv, found 2"),
        ({284: (3, [2]), 273: (4, [8, 8, 8]), 279: (4, [8, 8, 8])}, "damaged"),
        ({266: (3, [2])}, "bits are in reverse order"),
        ({257: (4, [0])}, "damaged TIFF, tag 257"),
        ({256: (4, [70000])}, "70000 x 1 pixels"),
        ({256: (4, [2000])}, r"row 0, block 0 at byte 8: expected 128 bytes or more"),
        ({256: (4, [5]), 257: (4, [2]), 278: (4, [1])}, "damaged TIFF"),
        ({322: (4, [17]), 323: (4, [16]), 324: (4, [8]), 325: (4, [8])}, "tiles of a multiple of 16"),
    ],
)
def test_headers_that_cannot_be_are_refused_in_one_line(tmp_path, others, error):
    path = tiff(tmp_path / "a.tif", packed([[GREY]]), 1, 1, others=others)
    with pytest.raises(UnreadableFile, match=error) as raised:
        read(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("streams", "error"),
    [
        (bytes([0x84, 0x40, 0x83, 0, 0x83, 0x51, 0x83, 0xC0]), "row 0, byte 8: .*found a run that makes them 6"),
        (bytes([0x83, 0x40, 6, 1, 2, 3, 4, 5, 6, 0x83, 0]), "row 0, byte 10: .*found a run that makes them 6"),
        (bytes([0x83, 0x40, 0x83, 0, 0x83, 0x51, 0x82, 0xC0]), "row 0, byte 16: .*found 4 until the end of its block"),
        (bytes([0x83, 0x40, 0x83, 0, 0x83, 0x51, 5, 1]), "row 0, byte 14: .*found 0 until the end"),
        (bytes(9), "row 0, byte 17: .*found 0 until the end"),
    ],
)
def test_runs_that_miss_the_end_of_a_row_are_refused_with_their_byte(tmp_path, streams, error):
    with pytest.raises(FormatError, match=error):
        read(tiff(tmp_path / "a.tif", [streams], 5, 1))


@pytest.mark.parametrize("bits", [24, 32])
def test_a_file_cut_short_is_refused_or_salvaged(tmp_path, bits):
    words = some_words(20, 37)
    if bits == 24:
        words = (words >> 16 & 0xFF) + 700 << 16 | words & 0x1FFF
    whole = tiff(tmp_path / "a.tif", packed(words, bits, rows=20), 37, 20, bits)
    length = read_folders(whole)[0].integers(279)[0]
    cut = tmp_path / "cut.tif"
    cut.write_bytes(moved_tags(whole, cut=length // 2 + length % 2))
    with pytest.raises(FormatError, match=f"row 0, block 0 at byte .*: expected {length} bytes or more, found the end"):
        read(cut)
    with pytest.warns(UserWarning, match=r"\d+ of its 20 rows are missing, and marked so"):
        image = read(cut, ReadOptions(salvage=True))
    expected = read(whole).radiance
    assert image.clipped is not None
    missing = np.all(image.clipped == 3, axis=1)
    assert 5 < missing.sum() < 15
    assert np.all(np.diff(missing.astype(int)) >= 0)
    np.testing.assert_array_equal(image.radiance[~missing], expected[~missing])
    assert np.all(image.radiance[missing] == 0)
    assert np.all(image.clipped[~missing] == 0)


def test_blocks_over_one_another_are_refused(tmp_path):
    stored = packed([[GREY] * 40])
    path = tiff(tmp_path / "a.tif", stored * 40, 40, 40)
    folder = read_folders(path)[0]
    data = bytearray(path.read_bytes())
    offsets = struct.pack("<40I", *folder.integers(273))
    lengths = struct.pack("<40I", *folder.integers(279))
    data = data.replace(offsets, struct.pack("<40I", *[8] * 40)).replace(lengths, struct.pack("<40I", *[300] * 40))
    path.write_bytes(data)
    with pytest.raises(FormatError, match="its blocks: expected"):
        read(path)


@pytest.mark.parametrize(("bits", "said"), [(16, "LogL, 16 bits"), (24, "LogLuv, 24 bits"), (32, "LogLuv, 32 bits")])
def test_the_subtype_is_recognised_from_the_header(tmp_path, bits, said):
    write(tmp_path / "a.tif", RadianceMap(np.ones((2, 2, 3), np.float32)), LogLuv(bits))
    assert subtype(tmp_path / "a.tif") == said


@pytest.mark.parametrize(("bits", "red", "blue"), [(32, 0.0154, -0.0178), (24, -0.0095, 0.0235)])
def test_one_colour_is_off_alike_in_every_pixel(tmp_path, bits, red, blue):
    """Grey of any luminance: by what the code nearest to D65 is off, as the documentation of the codes says."""
    grey = np.geomspace(0.01, 10, 64, dtype=np.float32).reshape(8, 8, 1)
    write(tmp_path / "a.tif", RadianceMap(np.repeat(grey, 3, axis=2)), LogLuv(bits=bits))
    found = read(tmp_path / "a.tif").radiance.astype(float)
    shares = found / (found @ TO_XYZ[1])[..., None] - 1
    assert np.ptp(shares, axis=(0, 1)).max() < 1e-6
    assert shares[0, 0, ::2].tolist() == [pytest.approx(red, abs=2e-4), pytest.approx(blue, abs=2e-4)]
