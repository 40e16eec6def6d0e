"""Radiance pictures against literal bytes of the format, references others decoded, and real files of 1990 to 2018."""

import errno
import mmap
import os
import re

import numpy as np
import pytest

from other_programs import by_opencv, by_openimageio
from relume.errors import FormatError, UnreadableFile
from relume.image.files import ReadOptions, read, read_radiance, write
from relume.image.files.encodings import RadianceHDR
from relume.image.files.hdr import radiance_hdr
from relume.image.files.hdr.radiance_hdr import subtype
from relume.image.files.hdr.scanlines import DARKEST, encoded
from relume.image.primaries import EQUAL_ENERGY, REC709, Primaries, between
from relume.image.radiance import OUTSIDE, RadianceMap
from rgbe import encode


def picture(path, pixels, resolution="-Y 2 +X 3", header="FORMAT=32-bit_rle_rgbe\n", first="#?RADIANCE\n"):
    path.write_bytes(f"{first}{header}\n{resolution}\n".encode() + bytes(pixels))
    return path


XYZE = "FORMAT=32-bit_rle_xyze\n"
SIX = [value for i in range(1, 7) for value in (10 * i, 20 * i, 30 * i, 136)]  # exponent 136: the mantissas themselves
EIGHT_IN_NEW_RUNS = [2, 2, 0, 8, 128 + 8, 7, 8, *range(8), 128 + 3, 9, 5, *range(5), 128 + 8, 136]


@pytest.mark.parametrize(
    ("rgbe", "value"),
    [
        ((128, 64, 32, 129), (1.0, 0.5, 0.25)),
        ((255, 0, 1, 136), (255, 0, 1)),
        ((200, 100, 50, 0), (0, 0, 0)),
        ((128, 0, 0, 255), (2.0**126, 0, 0)),
        ((128, 255, 1, 1), (2.0**-128, 255 * 2.0**-135, 2.0**-135)),
    ],
)
def test_a_pixel_is_mantissa_times_two_to_the_exponent_minus_136(tmp_path, rgbe, value):
    assert read_radiance(picture(tmp_path / "a.hdr", rgbe, "-Y 1 +X 1")).radiance[0, 0].tolist() == list(value)


@pytest.mark.parametrize("left", [0, 1, 2])
def test_where_the_system_gives_no_pages_of_its_own_those_of_numpy_are_taken(tmp_path, monkeypatch, left):
    """And where there are none either, NumPy says that memory is short, which is no fault of ours."""
    given = [mmap.mmap] * left

    def mapped(*size, **flags):
        if not given:
            raise OSError(errno.ENOMEM, "Cannot allocate memory")
        return given.pop()(*size, **flags)

    path = picture(tmp_path / "a.hdr", SIX)
    expected = read_radiance(path).radiance
    monkeypatch.setattr(radiance_hdr, "_LARGE", 1)
    monkeypatch.setattr(radiance_hdr.mmap, "mmap", mapped)
    np.testing.assert_array_equal(read_radiance(path).radiance, expected)
    assert not given


def test_mantissas_are_read_as_the_middle_of_their_step_on_request(tmp_path):
    path = picture(tmp_path / "a.hdr", [128, 64, 0, 136, 0, 0, 0, 0], "-Y 1 +X 2")
    middle = read_radiance(path, ReadOptions(mantissa_middle=True)).radiance
    assert middle.tolist() == [[[128.5, 64.5, 0.5], [0, 0, 0]]]


@pytest.mark.parametrize(
    ("value", "rgbe"),
    [
        ((1.0, 0.5, 0.25), (128, 64, 32, 129)),
        ((0, 0, 0), (0, 0, 0, 0)),
        ((-0.0, 0, -0.0), (0, 0, 0, 0)),
        ((255.0, 1.4, 1.6), (255, 1, 2, 136)),
        ((255.49, 3, 0), (255, 3, 0, 136)),
        ((255.5, 3.1, 0), (128, 2, 0, 137)),  # 255.5 rounds to 256, which is 128 at the next exponent
        ((0.999, 0, 0), (128, 0, 0, 129)),
        ((1e-40, 0, 0), (0, 0, 0, 0)),
        ((0, 127.4 * 2.0**-135, 0), (0, 0, 0, 0)),
        ((0, 127.6 * 2.0**-135, 0), (0, 128, 0, 1)),
        ((255.6 * 2.0**-135, 0, 0), (128, 0, 0, 2)),
        ((255.6 * 2.0**-134, 0, 0), (128, 0, 0, 3)),
        ((1.69e38, 0, 0), (254, 0, 0, 255)),
    ],
)
def test_writing_rounds_to_nearest_and_carries(value, rgbe):
    assert tuple(encode(np.array([value], np.float32))[0]) == rgbe


def legal_codes() -> np.ndarray:
    """(255, 128, 4): all exponents, and all largest mantissas that fill their byte, in changing channels."""
    largest, exponent = np.meshgrid(np.arange(128, 256), np.arange(1, 256))
    codes = np.stack([largest, largest // 2, largest % 7, exponent], axis=-1).astype(np.uint8)
    for line in range(len(codes)):
        codes[line, :, :3] = np.roll(codes[line, :, :3], line, axis=-1)
    return codes


def test_every_code_survives_reading_and_writing(tmp_path):
    codes = legal_codes()
    path = picture(tmp_path / "a.hdr", codes.tobytes(), "-Y 255 +X 128")
    np.testing.assert_array_equal(encode(read_radiance(path).radiance), codes)


@pytest.mark.slow
def test_every_triple_of_mantissas_survives_reading_and_writing(tmp_path):
    # All exponents behave alike but where floats lose digits, below 2^-126, and at the end.
    for exponent in (1, 2, 3, 4, 128, 255):
        for red in range(256):
            green, blue = np.meshgrid(np.arange(256), np.arange(256))
            codes = np.stack([np.full_like(green, red), green, blue, np.full_like(green, exponent)], axis=-1)
            codes = codes[codes[..., :3].max(axis=-1) >= 128].astype(np.uint8)
            path = picture(tmp_path / "a.hdr", codes.tobytes(), f"-Y 1 +X {len(codes)}")
            np.testing.assert_array_equal(encode(read_radiance(path).radiance)[0], codes)


def test_every_code_of_xyze_survives_too_where_floats_hold_it(tmp_path):
    codes = legal_codes()[9:250]
    path = picture(tmp_path / "a.hdr", codes.tobytes(), "-Y 241 +X 128", XYZE)
    again = read_radiance(path)
    write(tmp_path / "b.hdr", again, RadianceHDR(xyz=True, compressed=False))
    stored = (tmp_path / "b.hdr").read_bytes()[-codes.size :]
    np.testing.assert_array_equal(np.frombuffer(stored, np.uint8).reshape(codes.shape), codes)


def test_the_error_of_writing_is_at_most_one_in_256_and_without_bias(tmp_path):
    pixels = np.random.default_rng(1).uniform(0.01, 5, (64, 64, 3)).astype(np.float32)
    write(tmp_path / "a.hdr", RadianceMap(pixels))
    error = read_radiance(tmp_path / "a.hdr").radiance - pixels
    assert np.all(np.abs(error) <= pixels.max(axis=-1, keepdims=True) / 256)
    assert abs(error.mean() / pixels.mean()) < 2e-4  # truncation would give 4e-3


def test_one_in_256_is_reached_so_that_no_smaller_bound_is_true(tmp_path):
    write(tmp_path / "a.hdr", RadianceMap(np.array([[[128, 0.5, 0]]], np.float32)))
    assert read_radiance(tmp_path / "a.hdr").radiance.tolist() == [[[128, 0, 0]]]


@pytest.mark.parametrize(
    ("bad", "count"), [(-1.0, 2), (np.nan, 2), (np.inf, 2), (1.8e38, 2)], ids=["negative", "nan", "infinite", "large"]
)
@pytest.mark.parametrize("encoding", [RadianceHDR(), RadianceHDR(compressed=False)], ids=["runs", "flat"])
def test_pixels_the_format_cannot_hold_are_counted_and_refused(tmp_path, numbered, bad, count, encoding):
    numbered[1, 2, 0] = numbered[3, 3, 2] = bad
    with pytest.raises(ValueError, match=f"^{count} of 35 pixels are negative, NaN, infinite or above"):
        write(tmp_path / "a.hdr", RadianceMap(numbered), encoding)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("value", [(-1e-30, 0, 0), (-np.nan, 1, 1), (-np.inf, 0, 1), (1e-40, -1e-40, 0), (1, -1e-7, 1)])
def test_not_even_the_smallest_negative_value_is_cut_off_unseen(value):
    with pytest.raises(ValueError, match="1 of 1 pixels are negative"):
        encode(np.array([value], np.float32))


@pytest.mark.parametrize(
    ("resolution", "reds"),
    [
        ("-Y 2 +X 3", [[10, 20, 30], [40, 50, 60]]),
        ("+Y 2 +X 3", [[40, 50, 60], [10, 20, 30]]),
        ("-Y 2 -X 3", [[30, 20, 10], [60, 50, 40]]),
        ("+Y 2 -X 3", [[60, 50, 40], [30, 20, 10]]),
        ("+X 2 -Y 3", [[10, 40], [20, 50], [30, 60]]),
        ("-X 2 -Y 3", [[40, 10], [50, 20], [60, 30]]),
        ("+X 2 +Y 3", [[30, 60], [20, 50], [10, 40]]),
        ("-X 2 +Y 3", [[60, 30], [50, 20], [40, 10]]),
    ],
)
def test_all_eight_axis_orders_come_out_upright(tmp_path, resolution, reds):
    path = picture(tmp_path / "a.hdr", SIX, resolution)
    radiance = read_radiance(path).radiance
    assert radiance.tolist() == [[[red, 2 * red, 3 * red] for red in row] for row in reds]
    order = " ".join(resolution.split()[::2])
    assert subtype(path) == ("RGBE, flat" if order == "-Y +X" else f"RGBE, flat, {order}")


def test_all_exposure_lines_are_divided_out(tmp_path):
    header = "EXPOSURE=2\nFORMAT=32-bit_rle_rgbe\npfilt -1\nEXPOSURE= 2.5\nCOLORCORR=1 2 4\n"
    image = read_radiance(picture(tmp_path / "a.hdr", SIX, header=header))
    assert image.radiance[0, 0] == pytest.approx([10 / 5, 20 / 10, 30 / 20])


def test_exposures_that_divide_beyond_floats_are_refused_and_others_as_small_are_not(tmp_path):
    header = "EXPOSURE=1e-20\nFORMAT=32-bit_rle_rgbe\n"
    dim = read_radiance(picture(tmp_path / "a.hdr", [128, 0, 0, 129], "-Y 1 +X 1", header))
    assert dim.radiance[0, 0, 0] == np.float32(1e20)
    for exposure, exponent in (("1e-20", 200), ("1e-300", 255)):
        header = f"EXPOSURE={exposure}\nFORMAT=32-bit_rle_rgbe\n"
        with pytest.raises(FormatError, match=r"without exposure.*: expected values within float32, found \d beyond"):
            read(picture(tmp_path / "a.hdr", [128, 0, 0, exponent], "-Y 1 +X 1", header))


def test_xyze_that_is_beyond_floats_as_rec_709_is_refused(tmp_path):
    # Red is about three times X; 255 at the last exponent is half the largest float.
    with pytest.raises(FormatError, match=r"in Rec\. 709: expected values within float32, found 1 beyond"):
        read(picture(tmp_path / "a.hdr", [255, 0, 0, 255, *[60, 0, 0, 255] * 2, 0, 0, 255, 255], "-Y 1 +X 4", XYZE))
    with pytest.raises(ValueError, match="1 of 1 pixels are negative in X, Y or Z, NaN, infinite or above"):
        write(tmp_path / "a.hdr", RadianceMap(np.full((1, 1, 3), 3e38, np.float32)), RadianceHDR(xyz=True))


# --- XYZE and primaries


def test_what_is_neutral_in_xyze_is_neutral_and_as_bright(tmp_path):
    grey = read_radiance(picture(tmp_path / "a.hdr", [128, 128, 128, 129], "-Y 1 +X 1", XYZE))
    assert grey.radiance[0, 0] == pytest.approx([1, 1, 1], abs=1e-6)
    write(tmp_path / "b.hdr", RadianceMap(np.ones((1, 1, 3), np.float32)), RadianceHDR(xyz=True))
    data = (tmp_path / "b.hdr").read_bytes()
    assert data == b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n" + bytes([128, 128, 128, 129])


def test_xyze_is_converted_by_the_primaries_of_rec_709_and_bradfords_adaptation(tmp_path):
    # Rec. 709 red under D65 is X, Y, Z = 0.4125, 0.2127, 0.0193; Lindbloom's Bradford matrix from D65 to E after it.
    adaptation = [[1.0502616, 0.0270757, -0.0232523], [0.0390650, 0.9729502, -0.0092579]]
    adaptation += [[-0.0024047, 0.0026446, 0.9180873]]
    xyz = np.array(adaptation) @ [0.4124564, 0.2126729, 0.0193339]
    write(tmp_path / "a.hdr", RadianceMap(np.array([[[1, 0, 0]]], np.float32)), RadianceHDR(xyz=True))
    code = np.frombuffer((tmp_path / "a.hdr").read_bytes()[-4:], np.uint8)
    assert code[:3] == pytest.approx(xyz * 512, abs=0.52)
    assert code[3] == 127


def test_colours_beyond_rec_709_are_held_by_xyze_but_none_that_do_not_exist(tmp_path):
    # Monochromatic light of 520 nm, (x, y) = (0.0743, 0.8338), under equal energy.
    xyz = np.array([0.0743, 0.8338, 0.0919])
    wide = Primaries((1, 0), (0, 1), (0, 0), EQUAL_ENERGY)
    green = (between(wide, REC709) @ xyz).astype(np.float32).reshape(1, 1, 3)
    assert green.min() < -0.5
    with pytest.raises(ValueError, match="or XYZE where they are colours beyond"):
        write(tmp_path / "a.hdr", RadianceMap(green))
    write(tmp_path / "a.hdr", RadianceMap(green), RadianceHDR(xyz=True))
    np.testing.assert_allclose(read_radiance(tmp_path / "a.hdr").radiance, green, rtol=0, atol=4 / 256)
    with pytest.raises(ValueError, match="1 of 1 pixels are negative in X, Y or Z"):
        write(tmp_path / "a.hdr", RadianceMap(np.array([[[-1, 1, 0]]], np.float32)), RadianceHDR(xyz=True))


@pytest.mark.parametrize(("xyz", "held"), [((0.6, 0.4, 0), True), ((0, 0, 1), True), ((0.6, 0.4, -1e-4), False)])
def test_xyze_forgives_the_rounding_of_floats_and_no_more(tmp_path, xyz, held):
    wide = Primaries((1, 0), (0, 1), (0, 0), EQUAL_ENERGY)
    pixels = (between(wide, REC709) @ xyz).astype(np.float32) * np.geomspace(1, 1000, 50, dtype=np.float32)[:, None]
    image = RadianceMap(pixels[None])
    if not held:
        with pytest.raises(ValueError, match="50 of 50 pixels are negative in X, Y or Z"):
            write(tmp_path / "a.hdr", image, RadianceHDR(xyz=True))
        return
    write(tmp_path / "a.hdr", image, RadianceHDR(xyz=True))
    np.testing.assert_allclose(
        read_radiance(tmp_path / "a.hdr").radiance[0] / pixels.max(1, keepdims=True),
        pixels / pixels.max(1, keepdims=True),
        atol=4 / 256,
    )


def test_other_primaries_are_converted_reported_and_remembered(tmp_path):
    wide = "PRIMARIES= 0.7080 0.2920 0.1700 0.7970 0.1310 0.0460 0.3127 0.3290\n"
    path = picture(tmp_path / "a.hdr", [128, 0, 0, 129, 128, 128, 128, 129], "-Y 1 +X 2", wide)
    with pytest.warns(UserWarning, match=r"a\.hdr: its primaries are 0\.708 0\.292 .*; converted to Rec\. 709") as said:
        image = read_radiance(path)
    assert (len(said), said[0].filename) == (1, __file__)
    # ITU-R BT.2087 has Rec. 2020 red as this in Rec. 709.
    assert image.radiance[0, 0] == pytest.approx([1.6605, -0.1246, -0.0182], abs=1e-4)
    assert image.radiance[0, 1] == pytest.approx([1, 1, 1], abs=1e-6)
    assert image.attributes == {"primaries": "0.708 0.292 0.17 0.797 0.131 0.046 0.3127 0.329"}
    write(tmp_path / "b.hdr", RadianceMap(np.abs(image.radiance), attributes=image.attributes))
    again = read_radiance(tmp_path / "b.hdr")
    assert again.attributes == image.attributes
    np.testing.assert_allclose(again.radiance, np.abs(image.radiance), rtol=0, atol=1.7 / 256)


def test_rec_709_and_eight_zeros_are_no_other_primaries(tmp_path):
    for values in ("0.64 0.33 0.30 0.60 0.15 0.06 0.313 0.329", "0 0 0 0 0 0 0 0"):
        image = read_radiance(picture(tmp_path / "a.hdr", SIX, header=f"PRIMARIES={values}\n"))
        assert image.radiance[0, 0].tolist() == [10, 20, 30]
        assert image.attributes == {}


def test_the_white_that_an_xyze_names_is_its_white(tmp_path):
    d65 = f"PRIMARIES= {REC709.text}\n"
    xyz = REC709.to_xyz() @ np.ones(3)  # 0.950, 1, 1.089
    codes = [*np.rint(xyz * 64).astype(int), 130]
    image = read_radiance(picture(tmp_path / "a.hdr", codes, "-Y 1 +X 1", d65 + XYZE))
    assert image.radiance[0, 0] == pytest.approx([1, 1, 1], abs=2 / 64)
    assert image.attributes == {}


# --- Damaged and truncated files


@pytest.mark.parametrize(
    ("pixels", "complaint"),
    [
        (SIX[:-1], "scan line 2 of 2, byte 68: expected 3 pixels, found the end of the file"),
        ([], "scan line 1 of 2, byte 45: expected 3 pixels, found the end"),
        ([1, 1, 1, 3, *SIX], "scan line 1 of 2, byte 45: expected the first pixel of the line, found a run"),
        ([*SIX[:4], *[1, 1, 1, 255] * 9, *SIX], "scan line 1 of 2, byte 49: expected a run that stays within"),
    ],
)
def test_a_truncated_or_damaged_picture_is_refused_where_it_breaks(tmp_path, pixels, complaint):
    with pytest.raises(FormatError, match=f"a.hdr: damaged Radiance, {complaint}"):
        read(picture(tmp_path / "a.hdr", pixels))


def test_a_truncated_picture_is_salvaged_as_far_as_it_goes(tmp_path):
    path = picture(tmp_path / "a.hdr", [*EIGHT_IN_NEW_RUNS * 2, 2, 2, 0, 8, 130], "-X 4 +Y 8")
    with pytest.raises(FormatError, match=r"scan line 3 of 4, byte 100: expected 8 pixels, found the end of"):
        read(path)
    with pytest.warns(UserWarning, match="a.hdr: ends early; 2 of 4 scan lines are missing: they are 0 and marked"):
        image = read_radiance(path, ReadOptions(salvage=True))
    assert image.clipped is not None
    assert image.clipped.tolist() == [[OUTSIDE, OUTSIDE, 0, 0]] * 8
    assert image.radiance[..., 1].tolist() == [[0, 0, y, y] for y in range(7, -1, -1)]


def test_nothing_is_salvaged_from_less_than_a_line_or_from_damage(tmp_path):
    for pixels in (EIGHT_IN_NEW_RUNS[:9], [*EIGHT_IN_NEW_RUNS, 2, 2, 0, 8, 0]):
        with pytest.raises(FormatError):
            read(picture(tmp_path / "a.hdr", pixels, "-Y 2 +X 8"), ReadOptions(salvage=True))


@pytest.mark.parametrize(
    ("header", "resolution", "complaint"),
    [
        ("FORMAT=32-bit_rle_cmyk\n", "-Y 2 +X 3", "FORMAT line: expected 32-bit_rle_rgbe or 32-bit_rle_xyze, found 32"),
        ("FORMAT=32-bit_rle_rgbe\n" + XYZE, "-Y 2 +X 3", "FORMAT line: .*found 32-bit_rle_rgbe and 32-bit_rle_xyze"),
        ("FORMAT=32-bit_rle_rgbe\n", "-Y 2 +Y 3", "resolution line, byte 35: expected one like"),
        ("FORMAT=32-bit_rle_rgbe\n", "-Y 0 +X 3", "3 x 0 pixels"),
        ("FORMAT=32-bit_rle_rgbe\n", "-Y 40000 +X 40000", "40000 x 40000 pixels"),
        ("FORMAT=32-bit_rle_rgbe\n", "-Y 10000 +X 10000", "1200000000 bytes of pixels, which 77 bytes of file cannot"),
        ("EXPOSURE=bright\n", "-Y 2 +X 3", r"EXPOSURE line: expected 1 number\(s\), found 'bright'"),
        ("EXPOSURE=0\n", "-Y 2 +X 3", "EXPOSURE lines: expected positive numbers"),
        ("EXPOSURE=1e200\n" * 2, "-Y 2 +X 3", "EXPOSURE lines: expected positive numbers"),
        ("PRIMARIES=1 2 3\n", "-Y 2 +X 3", r"PRIMARIES line: expected 8 number\(s\)"),
        ("PRIMARIES=.1 .1 .2 .2 .3 .3 .4 .4\n", "-Y 2 +X 3", "PRIMARIES line: .* white must lie within"),
        ("PIXASPECT=0\n", "-Y 2 +X 3", "PIXASPECT line: expected a pixel's height by its width"),
        ("a b\n" * 70000, "-Y 2 +X 3", "its header: expected at most 65536 lines"),
    ],
)
def test_a_header_that_cannot_be_right_is_refused(tmp_path, header, resolution, complaint):
    with pytest.raises(UnreadableFile, match=complaint) as raised:
        read(picture(tmp_path / "a.hdr", SIX, resolution, header))
    assert "\n" not in str(raised.value)


def test_a_header_that_does_not_end_is_read_no_further_than_the_limit(tmp_path):
    (tmp_path / "a.hdr").write_bytes(b"#?RADIANCE\n" + b"a b\n" * 50000)
    with pytest.raises(FormatError, match="expected an empty line and one with the size, found none in 100000 "):
        read(tmp_path / "a.hdr", ReadOptions(metadata=100_000))


def test_converted_line_ends_are_recognised(tmp_path):
    (tmp_path / "a.hdr").write_bytes(b"#?RADIANCE\r\nFORMAT=32-bit_rle_rgbe\r\n\r\n-Y 2 +X 3\r\n" + bytes(SIX))
    with pytest.raises(FormatError, match=r"found CR LF, .* the pixels too; copy it again in binary mode"):
        read(tmp_path / "a.hdr")


# --- Real files


@pytest.mark.parametrize("name", ["image1", "old-rle", "rgbr4x4", "scale"])
def test_real_pictures_equal_the_references_others_decoded(shared, name):
    folder = shared / "data/formats/radiance_hdr_imagers"
    reference = by_openimageio(folder / f"reference/{name}.hdr.tiff")
    np.testing.assert_array_equal(read_radiance(folder / f"{name}.hdr").radiance, reference)


def test_a_picture_of_1990_has_its_three_exposures_divided_out(shared):
    path = shared / "data/formats/radiance_pic/Earth128.pic"
    image = read_radiance(path)
    assert (image.size, subtype(path)) == ((128, 128), "RGBE, new runs")
    assert image.attributes == {"pixel_aspect": "2"}  # PIXASPECT=0.5, half as high as wide
    # Stored (161, 161, 161, 130) and (0, 8, 166, 129), over 4.926198 · 0.2 · 2.571646 = 2.533687 (decoded by hand)
    assert image.radiance[18, 47] == pytest.approx([0.992871] * 3, abs=1e-6)
    assert image.radiance[64, 64] == pytest.approx([0, 0.0625 / 2.533687, 1.296875 / 2.533687], abs=1e-6)
    assert image.radiance.max() == image.radiance[18, 47, 0]


def test_a_photograph_of_2018_keeps_its_camera_view_and_exposure(shared):
    path = shared / "data/formats/radiance_px/test.hdr"
    with pytest.warns(UserWarning, match=r"0\.64 0\.33 0\.29 0\.6 0\.15 0\.06 0\.3333 0\.3333"):
        image = read_radiance(path)
    assert image.size == (544, 544)
    assert image.attributes == {
        "camera": "Nikon D700 version dcraw v9.28",
        "view": "-vta -vh 180 -vv 180",
        "taken": "2018:11:06 17:03:12",
        "latitude": "37.896408",
        "longitude": "-122.259972",
        "primaries": "0.64 0.33 0.29 0.6 0.15 0.06 0.3333 0.3333",
    }
    stored = by_opencv(path)  # heeds neither exposure nor primaries
    given = Primaries((0.64, 0.33), (0.29, 0.60), (0.15, 0.06), (0.3333, 0.3333))
    wanted = (stored / (0.02720623 * 46.76974)) @ between(given, REC709).T
    np.testing.assert_allclose(image.radiance, wanted, rtol=1e-6, atol=1e-6 * wanted.max())


@pytest.mark.filterwarnings("ignore:.*converted to Rec. 709")
def test_every_real_picture_is_read_and_every_damaged_one_refused(shared):
    good = [*shared.glob("data/formats/radiance_p*/*.[hp][di][rc]"), *shared.glob("data/probes/*/*.hdr")]
    assert len(good) >= 15
    for file in good:
        assert np.all(np.isfinite(read_radiance(file).radiance)), file
    damaged = [*shared.glob("data/malformed/*/*.hdr")]
    assert len(damaged) >= 3
    for file in damaged:
        with pytest.raises(UnreadableFile, match=re.escape(str(file)) + ": .+"):
            read(file)


@pytest.mark.parametrize("xyz", [False, True])
def test_pixels_darker_than_the_least_code_are_counted(tmp_path, xyz):
    """The least code is 128 at exponent 1, 2⁻¹²⁸: from half a step less on, 2.93e-39, nothing is lost to black."""
    pixels = np.zeros((4, 5, 3), np.float32)
    pixels[0] = 1
    pixels[1, :3] = 1e-39
    pixels[2, :4] = 1e-38
    with pytest.warns(UserWarning, match=r"a\.hdr: 3 of 20 pixels are darker than 2\.9e-39 and become 0; .exr keeps"):
        write(tmp_path / "a.hdr", RadianceMap(pixels), RadianceHDR(xyz=xyz))
    found = read_radiance(tmp_path / "a.hdr").radiance
    assert np.count_nonzero(found.any(2)) == 9


@pytest.mark.parametrize(("steps", "dark"), [(127.4, 1), (127.6, 0)])
def test_what_is_black_ends_half_a_step_below_the_least_code(steps, dark):
    _, unfit, found = encoded(np.full((1, 1, 3), steps * 2.0**-135, np.float32), compressed=True)
    assert (unfit, found) == (0, dark)
    assert (steps * 2.0**-135 < DARKEST) == bool(dark)
