"""Radiance RGBE against literal bytes of the format, references decoded by others, and real files of 1990 to 2018."""

import os
import re

import numpy as np
import pytest

from relume.errors import OutputNotWritten, UnreadableFile
from relume.image.files import read, read_radiance, write
from relume.image.files.radiance_hdr import encode
from relume.image.radiance import RadianceMap


def picture(path, pixels, resolution="-Y 2 +X 3", header="FORMAT=32-bit_rle_rgbe\n", first="#?RADIANCE\n"):
    path.write_bytes(f"{first}{header}\n{resolution}\n".encode() + bytes(pixels))
    return path


SIX = [value for i in range(1, 7) for value in (10 * i, 20 * i, 30 * i, 136)]  # exponent 136: the mantissas themselves
REDS = [[10, 20, 30], [40, 50, 60]]


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


@pytest.mark.parametrize(
    ("value", "rgbe"),
    [
        ((1.0, 0.5, 0.25), (128, 64, 32, 129)),
        ((0, 0, 0), (0, 0, 0, 0)),
        ((255.0, 1.4, 1.6), (255, 1, 2, 136)),
        ((255.49, 3, 0), (255, 3, 0, 136)),
        ((255.5, 3.1, 0), (128, 2, 0, 137)),  # 255.5 rounds to 256, which is 128 at the next exponent
        ((0.999, 0, 0), (128, 0, 0, 129)),
        ((1e-40, 0, 0), (0, 0, 0, 0)),
        ((1.69e38, 0, 0), (254, 0, 0, 255)),
    ],
)
def test_writing_rounds_to_nearest_and_carries(value, rgbe):
    assert tuple(encode(np.array([value], np.float32))[0]) == rgbe


def test_every_code_survives_reading_and_writing(tmp_path):
    largest, exponent = np.meshgrid(np.arange(128, 256), np.arange(1, 256))
    codes = np.stack([largest, largest // 2, largest % 7, exponent], axis=-1).astype(np.uint8)
    path = picture(tmp_path / "a.hdr", codes.tobytes(), "-Y 255 +X 128")
    np.testing.assert_array_equal(encode(read_radiance(path).radiance), codes)


def test_the_error_of_writing_is_at_most_one_in_256_and_without_bias(tmp_path):
    pixels = np.random.default_rng(1).uniform(0.01, 5, (64, 64, 3)).astype(np.float32)
    write(tmp_path / "a.hdr", RadianceMap(pixels))
    error = read_radiance(tmp_path / "a.hdr").radiance - pixels
    assert np.all(np.abs(error) <= pixels.max(axis=-1, keepdims=True) / 256)
    assert abs(error.mean() / pixels.mean()) < 2e-4  # truncation would give 4e-3


def test_a_map_comes_back_with_unit_attributes_and_place(tmp_path, numbered):
    write(tmp_path / "a.hdr", RadianceMap(numbered, unit="cd/m²", attributes={"mapping": "latlong"}))
    again = read_radiance(tmp_path / "a.hdr")
    assert (again.unit, again.attributes) == ("cd/m²", {"mapping": "latlong"})
    assert again.radiance == pytest.approx(numbered, rel=1 / 256, abs=1)
    assert (
        (tmp_path / "a.hdr").read_bytes().startswith(b"#?RADIANCE\nrelume:mapping=latlong\nrelume:unit=cd/m2\nFORMAT=")
    )
    assert b"\n\n-Y 5 +X 7\n" in (tmp_path / "a.hdr").read_bytes()


@pytest.mark.parametrize(
    ("bad", "count"), [(-1.0, 2), (np.nan, 2), (np.inf, 2), (1.8e38, 2)], ids=["negative", "nan", "infinite", "large"]
)
def test_pixels_the_format_cannot_hold_are_counted_and_refused(tmp_path, numbered, bad, count):
    numbered[1, 2, 0] = numbered[3, 3, 2] = bad
    with pytest.raises(ValueError, match=f"^{count} of 35 pixels are negative, NaN, infinite or above"):
        write(tmp_path / "a.hdr", RadianceMap(numbered))
    assert os.listdir(tmp_path) == []


def test_planes_the_format_cannot_hold_are_told(tmp_path, numbered):
    with pytest.warns(UserWarning, match=r"neither variance nor clipped pixels; write \.exr"):
        write(tmp_path / "a.hdr", RadianceMap(numbered, numbered))


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
    assert read_radiance(picture(tmp_path / "a.hdr", SIX, resolution)).radiance[..., 0].tolist() == reds


def test_all_exposure_lines_are_divided_out(tmp_path):
    header = "EXPOSURE=2\nFORMAT=32-bit_rle_rgbe\npfilt -1\nEXPOSURE= 2.5\nCOLORCORR=1 2 4\n"
    image = read_radiance(picture(tmp_path / "a.hdr", SIX, header=header))
    assert image.radiance[0, 0] == pytest.approx([10 / 5, 20 / 10, 30 / 20])


def test_new_runs_are_read_with_repeats_and_literals(tmp_path):
    line = [2, 2, 0, 8, 128 + 8, 7, 8, *range(8), 128 + 3, 9, 5, *range(5), 128 + 8, 136]
    image = read_radiance(picture(tmp_path / "a.hdr", line * 2, "-Y 2 +X 8"))
    assert image.radiance[1, :, 0].tolist() == [7] * 8
    assert image.radiance[1, :, 1].tolist() == list(range(8))
    assert image.radiance[1, :, 2].tolist() == [9, 9, 9, 0, 1, 2, 3, 4]


def test_old_runs_count_in_powers_of_256(tmp_path):
    pixels = [5, 6, 7, 136, 1, 1, 1, 2, 1, 1, 1, 1, 8, 8, 8, 136]
    image = read_radiance(picture(tmp_path / "a.hdr", pixels, "-Y 1 +X 260"))
    assert image.radiance[0, :, 0].tolist() == [5] * 259 + [8]


@pytest.mark.parametrize(
    ("pixels", "complaint"),
    [
        (SIX[:-1], "ends early, in scan line 2 of 2, byte 57"),
        ([], "ends early, in scan line 1 of 2, byte 45"),
        ([1, 1, 1, 3, *SIX], "damaged in scan line 1"),
        ([*SIX[:4], *[1, 1, 1, 255] * 9, *SIX], "damaged in scan line 1"),
    ],
)
def test_a_truncated_or_damaged_picture_is_refused_where_it_breaks(tmp_path, pixels, complaint):
    with pytest.raises(UnreadableFile, match=complaint):
        read(picture(tmp_path / "a.hdr", pixels))


@pytest.mark.parametrize("line", [[2, 2, 0, 8, 128 + 9, 7], [2, 2, 0, 8, 0], [2, 2, 0, 8, 128 + 8], [2, 2, 0, 8, 8, 1]])
def test_damaged_new_runs_are_refused(tmp_path, line):
    with pytest.raises(UnreadableFile, match="scan line 1 of 2"):
        read(picture(tmp_path / "a.hdr", line, "-Y 2 +X 8"))


@pytest.mark.parametrize(
    ("header", "resolution", "complaint"),
    [
        ("FORMAT=32-bit_rle_xyze\n", "-Y 2 +X 3", "32-bit_rle_xyze, not RGBE"),
        ("FORMAT=32-bit_rle_rgbe\n", "-Y 2 +Y 3", "resolution line"),
        ("FORMAT=32-bit_rle_rgbe\n", "-Y 0 +X 3", "3 x 0 pixels"),
        ("FORMAT=32-bit_rle_rgbe\n", "-Y 40000 +X 40000", "40000 x 40000 pixels"),
        ("FORMAT=32-bit_rle_rgbe\n", "-Y 10000 +X 10000", "cannot hold its 100000000 pixels"),
        ("EXPOSURE=bright\n", "-Y 2 +X 3", "EXPOSURE='bright'; expected 1 number"),
        ("EXPOSURE=0\n", "-Y 2 +X 3", "expected positive numbers"),
    ],
)
def test_a_header_that_cannot_be_right_is_refused(tmp_path, header, resolution, complaint):
    with pytest.raises(UnreadableFile, match=complaint) as raised:
        read(picture(tmp_path / "a.hdr", SIX, resolution, header))
    assert "\n" not in str(raised.value)


def test_converted_line_ends_are_recognised(tmp_path):
    (tmp_path / "a.hdr").write_bytes(b"#?RADIANCE\r\nFORMAT=32-bit_rle_rgbe\r\n\r\n-Y 2 +X 3\r\n" + bytes(SIX))
    with pytest.raises(UnreadableFile, match="CR LF, which ruins the pixels; copy it again in binary mode"):
        read(tmp_path / "a.hdr")


def test_primaries_other_than_rec_709_are_told_but_not_eight_zeros(tmp_path):
    wide = "PRIMARIES= 0.7080 0.2920 0.1700 0.7970 0.1310 0.0460 0.3127 0.3290\n"
    with pytest.warns(UserWarning, match=r"0\.7080.*not Rec\. 709"):
        read(picture(tmp_path / "a.hdr", SIX, header=wide))
    read(picture(tmp_path / "b.hdr", SIX, header="PRIMARIES=0 0 0 0 0 0 0 0\n"))


def test_a_full_disk_leaves_the_old_picture_and_no_temporary_file(tmp_path, numbered, monkeypatch):
    write(tmp_path / "a.hdr", RadianceMap(numbered))
    old = (tmp_path / "a.hdr").read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputNotWritten, match=r"a\.hdr: cannot be written: No space"):
        write(tmp_path / "a.hdr", RadianceMap(numbered * 2))
    assert (tmp_path / "a.hdr").read_bytes() == old
    assert os.listdir(tmp_path) == ["a.hdr"]


@pytest.mark.parametrize("name", ["image1", "old-rle", "rgbr4x4", "scale"])
def test_real_pictures_equal_the_references_others_decoded(shared, name):
    import OpenImageIO as oiio

    folder = shared / "data/formats/radiance_hdr_imagers"
    source = oiio.ImageInput.open(str(folder / f"reference/{name}.hdr.tiff"))
    assert source is not None
    np.testing.assert_array_equal(read_radiance(folder / f"{name}.hdr").radiance, source.read_image())
    source.close()


def test_a_picture_of_1990_has_its_three_exposures_divided_out(shared):
    image = read_radiance(shared / "data/formats/radiance_pic/Earth128.pic")
    assert image.size == (128, 128)
    assert image.attributes == {"PIXASPECT": "0.500000"}
    # Stored (161, 161, 161, 130) and (0, 8, 166, 129), over 4.926198 · 0.2 · 2.571646 = 2.533687 (decoded by hand)
    assert image.radiance[18, 47] == pytest.approx([0.992871] * 3, abs=1e-6)
    assert image.radiance[64, 64] == pytest.approx([0, 0.0625 / 2.533687, 1.296875 / 2.533687], abs=1e-6)
    assert image.radiance.max() == image.radiance[18, 47, 0]


@pytest.mark.filterwarnings("ignore:.*not Rec. 709")
def test_every_real_picture_is_read_and_every_damaged_one_refused(shared):
    good = [*shared.glob("data/formats/radiance_p*/*.[hp][di][rc]"), *shared.glob("data/probes/*/*.hdr")]
    assert len(good) >= 15
    for file in good:
        assert np.all(np.isfinite(read_radiance(file).radiance)), file
    for file in shared.glob("data/malformed/*/*.hdr"):
        with pytest.raises(UnreadableFile, match=re.escape(str(file)) + ": .+"):
            read(file)


def test_the_same_picture_as_exr_and_hdr_has_the_same_values(shared):
    folder = shared / "data/formats/exr_hdr_pair"
    hdr = read_radiance(folder / "overexposed gradient.hdr").radiance
    exr = read_radiance(folder / "overexposed gradient - data window equals display window.exr").radiance
    assert hdr == pytest.approx(exr, abs=float(exr.max()) / 128)
