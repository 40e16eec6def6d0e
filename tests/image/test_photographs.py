"""JPEG, PNG and TIFF photographs: whole pixels or none, upright, with the exposure their EXIF says."""

import io
import os
import shutil
import struct
import warnings
import zlib
from dataclasses import replace
from datetime import datetime
from fractions import Fraction

import numpy as np
import OpenImageIO as oiio
import PIL
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from other_programs import attributes_by_openimageio
from relume.capture.exposure.bracket import read_bracket
from relume.errors import OutputNotWritten, UnreadableFile
from relume.image.files import read, read_facts, read_photograph, write
from relume.image.files.metadata import exif
from relume.image.photograph import Exposure, Photograph, Settings


@pytest.fixture
def smooth() -> np.ndarray:
    """(48, 64, 3) uint8 whose red says x, green y and blue neither: smooth, so that a JPEG keeps it."""
    y, x = np.mgrid[:48, :64]
    return np.stack([3 * x, 5 * y, np.full_like(x, 77)], axis=-1).astype(np.uint8)


@pytest.fixture
def numbered16(numbered) -> np.ndarray:
    return (numbered * 4).astype(np.uint16)


def saved(path, pixels, tags=None, folder=None, **options):
    """Save as Pillow does, with EXIF tags by number."""
    exif = Image.Exif()
    exif.update(tags or {})
    exif.get_ifd(0x8769).update(folder or {})
    Image.fromarray(pixels).save(path, exif=exif, **options)
    return path


def tiff(path, pixels):
    """Save a TIFF of any depth as OpenImageIO does."""
    oiio.ImageBuf(pixels).write(str(path))
    return path


def test_the_virtual_camera_says_its_exposure_name_and_focal_length(shared):
    path = sorted((shared / "shoots/room/plate").glob("*.jpg"))[0]
    photograph = read_photograph(path)
    assert photograph.exposure == Exposure(0.25, 8.0, 100.0)
    assert photograph.camera == "Virtual curve_a"
    assert photograph.focal_length == pytest.approx(1000.354, abs=1e-3)
    assert (photograph.size, photograph.pixels.dtype, photograph.name) == ((768, 512), np.uint8, str(path))


@pytest.mark.parametrize(
    "exposure",
    [
        Exposure(1 / 60, 5.6, 100),
        Exposure(1 / 8000, 1.4, 64),
        Exposure(30.0, 22.0, 204800),
        Exposure(0.0125, 2.8),
        Exposure(1 / 3),
        Exposure(4000.5, None, 65535),
        None,
    ],
)
@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_a_photograph_written_and_read_has_the_same_exposure(tmp_path, smooth, exposure, suffix):
    write(
        tmp_path / f"a{suffix}", Photograph(smooth, exposure=exposure, camera="Virtual curve_a", focal_length=1000.35)
    )
    again = read_photograph(tmp_path / f"a{suffix}")
    assert again.exposure == exposure
    assert again.camera == "Virtual curve_a"
    assert again.focal_length == pytest.approx(1000.35, abs=1e-6)


def test_another_reader_finds_the_exposure_as_exif_rationals(tmp_path, smooth):
    write(tmp_path / "a.jpg", Photograph(smooth, exposure=Exposure(1 / 60, 5.6, 100), camera="Virtual curve_a"))
    names = "ExposureTime", "FNumber", "Exif:PhotographicSensitivity", "jpeg:subsampling"
    reports = attributes_by_openimageio(tmp_path / "a.jpg", *names)
    assert reports == [pytest.approx(1 / 60), pytest.approx(5.6), 100, "4:4:4"]


def test_an_iso_that_exif_cannot_hold_is_refused(tmp_path, smooth):
    with pytest.raises(ValueError, match=r"iso is 133\.3"):
        write(tmp_path / "a.jpg", Photograph(smooth, exposure=Exposure(1, None, 133.3)))


def test_a_jpeg_is_written_within_two_codes(tmp_path, smooth):
    write(tmp_path / "a.jpg", Photograph(smooth))
    assert np.abs(read_photograph(tmp_path / "a.jpg").pixels.astype(int) - smooth).max() <= 2


def test_a_png_keeps_every_code_of_8_and_16_bits(tmp_path, smooth, numbered16):
    for pixels in (smooth, numbered16):
        write(tmp_path / "a.png", Photograph(pixels))
        again = read_photograph(tmp_path / "a.png").pixels
        assert again.dtype == pixels.dtype
        np.testing.assert_array_equal(again, pixels)
    assert again[3, 2].tolist() == [12008, 12009, 12010]
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), numbered16 >> 8)  # Pillow's 8 bits


def test_a_tiff_of_16_bits_keeps_every_code(tmp_path, numbered16):
    np.testing.assert_array_equal(read_photograph(tiff(tmp_path / "a.tif", numbered16)).pixels, numbered16)


def test_grey_becomes_three_equal_channels(tmp_path, smooth):
    photograph = read_photograph(saved(tmp_path / "a.png", smooth[..., 0]))
    np.testing.assert_array_equal(photograph.pixels, np.repeat(smooth[..., :1], 3, axis=2))


def test_opaque_alpha_goes_unsaid_and_other_alpha_does_not(tmp_path, smooth):
    alpha = np.full((48, 64, 1), 255, np.uint8)
    np.testing.assert_array_equal(
        read_photograph(saved(tmp_path / "a.png", np.concatenate([smooth, alpha], axis=2))).pixels, smooth
    )
    alpha[3, :5] = 10
    path = saved(tmp_path / "b.png", np.concatenate([smooth, alpha], axis=2))
    with pytest.warns(UserWarning, match="alpha is left out, though 5 pixels are not opaque"):
        np.testing.assert_array_equal(read_photograph(path).pixels, smooth)  # not multiplied by alpha


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_where_alpha_is_0_is_outside_the_picture_and_turned_with_it(tmp_path, smooth, suffix):
    alpha = np.full((48, 64, 1), 255, np.uint8)
    alpha[3, :5] = 0
    seen = np.concatenate([smooth, alpha], axis=2)
    photograph = read_photograph(saved(tmp_path / f"a{suffix}", seen))
    np.testing.assert_array_equal(photograph.outside, alpha[..., 0] == 0)
    np.testing.assert_array_equal(photograph.pixels, smooth)  # not multiplied by alpha
    # Orientation 6 is turned clockwise: the third row from the top becomes the fourth column from the right.
    turned = read_photograph(saved(tmp_path / f"b{suffix}", seen, {0x0112: 6})).outside
    assert turned is not None and turned.shape == (64, 48)
    assert np.argwhere(turned).tolist() == [[row, 44] for row in range(5)]
    alpha[10, :2] = 9
    path = saved(tmp_path / f"c{suffix}", np.concatenate([smooth, alpha], axis=2))
    with pytest.warns(UserWarning, match="though 2 pixels are not opaque"):
        outside = read_photograph(path).outside
    assert outside is not None and outside.sum() == 5


def test_a_photograph_transparent_everywhere_is_refused(tmp_path, smooth):
    path = saved(tmp_path / "a.png", np.concatenate([smooth, np.zeros((48, 64, 1), np.uint8)], axis=2))
    with pytest.raises(UnreadableFile, match=r"a\.png: alpha is 0 everywhere, .*; save it without alpha"):
        read(path)


SETTINGS = Settings(
    taken=datetime(2010, 5, 15, 13, 1, 23, 20_000),
    automatic_white=False,
    bias=-5 / 3,
    lens="EF-S18-55mm f/3.5-5.6 IS",
    serial="0430202142",
    focal_length=28.0,
)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize("settings", [SETTINGS, Settings(), Settings(automatic_white=True, bias=0.0)])
def test_a_photograph_written_and_read_has_the_same_settings(tmp_path, smooth, settings, suffix):
    write(tmp_path / f"a{suffix}", Photograph(smooth, settings=settings))
    again = read_photograph(tmp_path / f"a{suffix}").settings
    assert again.bias == (None if settings.bias is None else pytest.approx(settings.bias, abs=1e-9))
    assert replace(again, bias=None) == replace(settings, bias=None)


def test_settings_are_read_as_cameras_write_them(tmp_path, smooth):
    folder = {
        0x9003: "2010:05:15 13:01:23",
        0x9291: "02",
        0xA403: 1,
        0x9204: IFDRational(-2, 1),
        0xA434: "18-50mm F2.8 DC DN | Contemporary 021",
        0xA431: "0430202142",
        0x920A: IFDRational(28, 1),
    }
    read_back = read_photograph(saved(tmp_path / "a.jpg", smooth, {}, folder)).settings
    assert read_back.taken == datetime(2010, 5, 15, 13, 1, 23, 20_000)  # two hundredths of a second
    assert (read_back.automatic_white, read_back.bias, read_back.focal_length) == (False, -2.0, 28.0)
    assert (read_back.lens, read_back.serial) == ("18-50mm F2.8 DC DN | Contemporary 021", "0430202142")


@pytest.mark.parametrize("when", ["0000:00:00 00:00:00", "    :  :     :  :  ", "yesterday"])
def test_a_camera_without_a_clock_says_no_time(tmp_path, smooth, when):
    read_back = read_photograph(saved(tmp_path / "a.jpg", smooth, {}, {0x9003: when, 0x9291: "x", 0xA403: 7})).settings
    assert read_back == Settings()


def test_the_settings_of_real_photographs(shared):
    folder = shared / "data/brackets"
    middle = read_facts(folder / "ghost_hall/IMG_0959.JPG").settings
    assert (middle.taken, middle.bias) == (datetime(2011, 12, 13, 3, 9, 10, 320_000), 0.0)
    darker = read_facts(folder / "ghost_hall/IMG_0960.JPG")
    assert (darker.settings.bias, darker.exposure) == (-2.0, Exposure(0.01, 5.6, 100))
    assert read_facts(folder / "arch_full/img_15.jpg").settings.automatic_white is True
    assert read_facts(folder / "garage/1_40.JPG").settings.automatic_white is False


def test_the_facts_of_a_photograph_are_those_read_with_its_pixels(tmp_path, smooth):
    photograph = Photograph(smooth, exposure=Exposure(0.25, 8.0, 100), camera="Virtual curve_a", settings=SETTINGS)
    for name in ("a.jpg", "a.png", "a.tif"):
        write(tmp_path / name, photograph)
        facts, whole = read_facts(tmp_path / name), read_photograph(tmp_path / name)
        assert (facts.name, facts.size, facts.exposure) == (whole.name, whole.size, whole.exposure)
        assert (facts.camera, facts.settings) == (whole.camera, whole.settings)
    assert read_facts(saved(tmp_path / "c.jpg", smooth, {}, {0x9201: IFDRational(37, 8)})).shutter_speed == 4.625
    for suffix in ("jpg", "png", "tif"):
        assert read_facts(saved(tmp_path / f"b.{suffix}", smooth, {0x0112: 6})).size == (48, 64)


def test_the_facts_of_what_is_no_photograph_are_refused(tmp_path, smooth):
    from relume.image.radiance import RadianceMap

    write(tmp_path / "a.hdr", RadianceMap(np.ones((4, 4, 3), np.float32)))
    with pytest.raises(UnreadableFile, match=r"a\.hdr: a radiance map"):
        read_facts(tmp_path / "a.hdr")
    (tmp_path / "b.png").write_bytes(saved(tmp_path / "c.png", smooth).read_bytes()[:20])
    with pytest.raises(UnreadableFile, match=r"b\.png: damaged PNG"):
        read_facts(tmp_path / "b.png")


@pytest.mark.parametrize(
    ("orientation", "corners"),
    [
        (1, "abcd"),
        (2, "badc"),
        (3, "dcba"),
        (4, "cdab"),
        (5, "acbd"),
        (6, "cadb"),
        (7, "dbca"),
        (8, "bdac"),
    ],
)
@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_the_photograph_is_turned_upright(tmp_path, orientation, corners, suffix):
    # Stored corners: a top left, b top right, c bottom left, d bottom right (EXIF 2.32, figure of tag 0x0112).
    stored = np.zeros((16, 32, 3), np.uint8)
    codes = dict(zip("abcd", (40, 100, 160, 220), strict=True))
    stored[:8, :16], stored[:8, 16:], stored[8:, :16], stored[8:, 16:] = (codes[c] for c in "abcd")
    seen = read_photograph(saved(tmp_path / f"a{suffix}", stored, {0x0112: orientation})).pixels
    assert seen.shape == ((16, 32, 3) if orientation < 5 else (32, 16, 3))
    found = [seen[0, 0, 0], seen[0, -1, 0], seen[-1, 0, 0], seen[-1, -1, 0]]
    assert found == pytest.approx([codes[c] for c in corners], abs=3)


@pytest.mark.parametrize(
    ("folder", "pixels"),
    [
        ({}, None),
        ({0x920A: 50.0}, None),
        ({0x920A: 4.13, 0xA405: 33}, 33 / 36 * 64),
        ({0x920A: 46.8916, 0xA405: 47}, 46.8916 / 36 * 64),
        ({0x920A: 50.0, 0xA405: 0}, None),
        ({0x920A: 10.0, 0xA20E: 254.0, 0xA210: 2, 0xA002: 64, 0x927C: b"note"}, 100.0),
        ({0x920A: 10.0, 0xA20E: 100.0, 0xA210: 3, 0xA002: 64, 0x927C: b"note"}, 100.0),
        ({0x920A: 10.0, 0xA20E: 254.0, 0xA210: 2, 0xA002: 640, 0x927C: b"note"}, None),  # resized since
        ({0x920A: 10.0, 0xA20E: 254.0, 0xA210: 2, 0xA002: 64}, None),  # through an editor
    ],
)
def test_the_focal_length_in_pixels_is_known_or_none(tmp_path, smooth, folder, pixels):
    rational = {k: Fraction(v).limit_denominator(10_000) for k, v in folder.items() if isinstance(v, float)}
    exact = {k: (v.numerator, v.denominator) for k, v in rational.items()}
    path = saved(tmp_path / "a.jpg", smooth, {}, {**folder, **{k: IFDRational(*v) for k, v in exact.items()}})
    found = read_photograph(path).focal_length
    assert found == (None if pixels is None else pytest.approx(pixels, rel=1e-6))


@pytest.mark.parametrize(
    ("recorded", "pixels", "uncropped"),
    [
        ((64, 48), 24 / 36 * 64, None),  # whole
        ((640, 480), 24 / 36 * 64, None),  # resized: the same shape
        ((480, 640), 24 / 36 * 64, None),  # resized and turned
        ((641, 480), 24 / 36 * 64, None),  # resized, and rounded
        ((300, 200), 24 / 36 * 300, (300, 200)),  # a crop of 3:2
        ((66, 52), 24 / 36 * 66, (66, 52)),  # a narrow rim cut off
        ((65, 49), 24 / 36 * 64, None),  # pixels at the sensor's rim
        ((32, 40), None, None),  # larger than its camera's: stitched
    ],
)
def test_a_crop_has_the_focal_length_of_the_whole(tmp_path, smooth, recorded, pixels, uncropped):
    folder = {0x920A: 4.13, 0xA405: 24, 0xA002: recorded[0], 0xA003: recorded[1]}
    photograph = read_photograph(saved(tmp_path / "a.jpg", smooth, {}, folder))
    assert photograph.focal_length == (None if pixels is None else pytest.approx(pixels))
    assert photograph.uncropped == uncropped
    # A crop that lies on its side is upright with what it was cropped from.
    turned = read_photograph(saved(tmp_path / "b.jpg", smooth, {0x0112: 6}, folder))
    assert turned.uncropped == (None if uncropped is None else uncropped[::-1])


def test_the_sensor_s_own_scale_holds_for_a_crop(tmp_path, smooth):
    folder = {0x920A: 10, 0xA20E: 254, 0xA210: 2, 0x927C: b"note", 0xA002: 300, 0xA003: 200}
    assert read_photograph(saved(tmp_path / "a.jpg", smooth, {}, folder)).focal_length == pytest.approx(100)


def test_a_bracket_of_crops_is_one_note(tmp_path, smooth):
    folder = {0xA405: 24, 0xA002: 300, 0xA003: 200}
    paths = [saved(tmp_path / f"{i}.jpg", smooth // (i + 1), {}, folder) for i in range(3)]
    with pytest.warns(UserWarning, match=r"0\.jpg and 2 others were cropped from 300×200 pixels") as caught:
        bracket = read_bracket(paths, times=[4, 2, 1])
    assert len(caught) == 1 and bracket.focal_length == pytest.approx(200)


def test_a_portrait_has_the_focal_length_of_the_landscape(tmp_path, smooth):
    path = saved(tmp_path / "a.jpg", smooth, {0x0112: 6}, {0x920A: 4, 0xA405: 36})
    photograph = read_photograph(path)
    assert (photograph.size, photograph.focal_length) == ((48, 64), 64.0)


def test_canon_copies_resized_by_an_editor_say_no_focal_length(shared):
    folder = shared / "data/brackets"
    for file in [*(folder / "room").glob("*.jpg"), *(folder / "window").glob("*.jpg")]:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*colour profile")
            photograph = read_photograph(file)
        assert photograph.exposure is not None
        assert photograph.focal_length is None
        assert photograph.camera.startswith("Canon EOS")


def test_senseless_exif_numbers_are_taken_as_missing(tmp_path, smooth):
    photograph = read_photograph(saved(tmp_path / "a.jpg", smooth, {0x0112: 9}, {0x829A: 0, 0x829D: 8}))
    assert (photograph.exposure, photograph.size) == (None, (64, 48))


@pytest.mark.parametrize("share", [0.3, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_a_truncated_photograph_is_refused_in_one_line_and_silently(tmp_path, smooth, suffix, share, capfd):
    noisy = np.random.default_rng(1).integers(0, 255, (200, 200, 3), np.uint8)
    path = saved(tmp_path / f"a{suffix}", noisy)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
    with pytest.raises(UnreadableFile, match=rf"a\{suffix}: ") as raised:
        read(path)
    assert "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


def with_stray_bytes(data, marker):
    """A JPEG with bytes of no segment ahead of the last of these markers."""
    place = data.rindex(marker)
    return data[:place] + b"stray" + data[place:]


def with_an_altered_byte(data):
    place = data.index(b"IDAT") + 20
    return data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]


def with_an_absurd_size(data):
    head = data[12:16] + struct.pack(">II", 60_000, 60_000) + data[24:29]
    return data[:12] + head + struct.pack(">I", zlib.crc32(head)) + data[33:]


@pytest.mark.parametrize(
    ("name", "options", "damage", "said"),
    [
        ("a.jpg", {}, lambda data: data[:-2], "Premature end"),
        (
            "a.jpg",
            {},
            lambda data: data[: len(data) // 2] + data[len(data) // 2 + 1000 :],
            "Corrupt JPEG data: premature end of data segment",
        ),
        (
            "a.jpg",
            {"progressive": True},
            lambda data: with_stray_bytes(data, b"\xff\xda"),
            "extraneous bytes before marker",
        ),
        ("a.jpg", {}, lambda data: with_stray_bytes(data, b"\xff\xdb")[: len(data) // 2], "truncated"),
        ("a.png", {}, with_an_altered_byte, "damaged PNG, the chunk 'IDAT' at byte 33: expected the checksum"),
        ("a.png", {}, with_an_absurd_size, "60000 x 60000|claims a"),
    ],
    ids=["its end", "a hole", "stray bytes among scans", "stray bytes and cut", "an altered byte", "an absurd size"],
)
def test_damaged_pixels_are_refused(tmp_path, name, options, damage, said):
    noisy = np.random.default_rng(1).integers(0, 255, (200, 200, 3), np.uint8)
    path = saved(tmp_path / name, noisy, **options)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(UnreadableFile, match=said):
        read(path)


def test_stray_bytes_among_the_headers_of_a_jpeg_are_reported_and_do_no_harm(tmp_path, smooth):
    path = saved(tmp_path / "a.jpg", smooth)
    expected = read_photograph(path).pixels
    data = path.read_bytes()
    start = data.index(b"\xff\xdb")
    path.write_bytes(data[:start] + b"stray" + data[start:])
    with pytest.warns(UserWarning, match="stray bytes among its headers"):
        np.testing.assert_array_equal(read_photograph(path).pixels, expected)


def test_exif_that_is_damaged_is_reported_in_a_line_about_the_file_and_the_rest_is_read(tmp_path, smooth):
    whole = saved(tmp_path / "a.jpg", smooth, {0x0110: "One"}, {0x829A: IFDRational(1, 60)}).read_bytes()
    begin = whole.index(b"MM\0*")
    entry = whole.index(struct.pack(">HH", 0x829A, 5), begin)
    # Its count becomes 2³² − 1, then its folder lies beyond the segment.
    pointer = whole.index(struct.pack(">HHI", 0x8769, 4, 1), begin) + 8
    for place, value in ((entry + 4, 2**32 - 1), (pointer, 2**31)):
        (tmp_path / "a.jpg").write_bytes(whole[:place] + struct.pack(">I", value) + whole[place + 4 :])
        for reader in (read_photograph, read_facts):
            with pytest.warns(UserWarning) as reports:
                found = reader(tmp_path / "a.jpg")
            (line,) = {str(one.message) for one in reports}
            assert line.startswith(f"{tmp_path / 'a.jpg'}: its EXIF is damaged (")
            assert line.endswith("); exposure may be missing")
            assert (found.exposure, found.camera) == (None, "One")


@pytest.mark.parametrize("big", [False, True])
def test_exif_of_a_tiff_and_a_bigtiff_is_read(tmp_path, smooth, big):
    # Pillow writes no EXIF folder into a TIFF; photographs are believed that say it in their first.
    path = saved(tmp_path / "a.tif", smooth, {0x0110: "One", 0x829A: IFDRational(1, 60)}, big_tiff=big)
    assert path.read_bytes()[2] == (43 if big else 42)
    for found in (read_photograph(path), read_facts(path)):
        assert (found.exposure, found.camera, found.size) == (Exposure(1 / 60), "One", (64, 48))


def test_warnings_of_others_meanwhile_are_passed_on():
    damage: list[str] = []
    with pytest.warns(UserWarning, match="^of another$") as reports, exif.heard(damage):
        warnings.warn_explicit("of another", UserWarning, __file__, 1)
        warnings.warn_explicit("Truncated File Read", UserWarning, PIL.__file__, 1)
        warnings.warn_explicit("Metadata Warning, tag 1 had too many entries", UserWarning, PIL.__file__, 1)
    assert (len(reports), damage) == (1, ["Truncated File Read"])


def test_the_facts_of_a_tiff_of_many_channels_are_refused_or_reported_without_a_print(tmp_path, smooth, capfd):
    data = saved(tmp_path / "a.tif", smooth).read_bytes()
    entry = data.index(struct.pack("<HHI", 277, 3, 1))
    for samples in (9, 65):
        (tmp_path / "a.tif").write_bytes(data[: entry + 8] + struct.pack("<H", samples) + data[entry + 10 :])
        with pytest.raises(UnreadableFile, match=r"a\.tif: "):
            read_facts(tmp_path / "a.tif")
    assert capfd.readouterr() == ("", "")


def test_radiance_and_camera_raw_are_refused_by_name(shared):
    data = shared / "data"
    for path, what in {
        "formats/float_tiff/float32.tif": "a radiance map where a photograph is needed",
        "formats/logluv_tiff/off_luv24.tif": "a radiance map where a photograph is needed",
        "malformed/raw_stubs/IMG_1361.dng": "camera raw",
    }.items():
        with pytest.raises(UnreadableFile, match=what):
            read_photograph(data / path)


def test_a_colour_profile_other_than_srgb_is_reported(tmp_path, smooth):
    from PIL import ImageCms

    saved(tmp_path / "a.jpg", smooth, icc_profile=ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    read(tmp_path / "a.jpg")
    lab = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()
    saved(tmp_path / "b.jpg", smooth, icc_profile=lab)
    with pytest.warns(UserWarning, match="colour profile"):
        read(tmp_path / "b.jpg")


@pytest.mark.filterwarnings("ignore")
def test_every_real_damaged_photograph_is_refused_in_one_line_or_read_whole(shared, capfd):
    read_well = set()
    for file in sorted((shared / "data/malformed").glob("*/*")):
        if file.suffix not in (".jpg", ".tif", ".dng", ".nef", ".pgm"):
            continue
        try:
            assert read_photograph(file).pixels.dtype == np.uint8
            read_well.add(file.name)
        except UnreadableFile as error:
            assert str(error).startswith(f"{file}: ") and "\n" not in str(error)
    # Sound pictures with broken EXIF; the .nef is a JPEG by content, 2000 x 3008 pixels.
    assert read_well == {
        "corrupt-exif-1626.jpg", "corrupt-exif-recursive-ifd.jpg", "corrupt-exif-utf8-type.jpg",
        "crash-cmyk-1bit.tif", "Issue 247-1.nef"}  # fmt: skip
    assert capfd.readouterr() == ("", "")


def test_a_full_disk_leaves_the_old_photograph_and_no_temporary_file(tmp_path, smooth):
    resource = pytest.importorskip("resource")
    for name in ("a.jpg", "a.png", "a.tif"):
        write(tmp_path / name, Photograph(smooth))
        old = (tmp_path / name).read_bytes()
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (500, limits[1]))
            with pytest.raises(OutputNotWritten, match="File too large"):
                write(tmp_path / name, Photograph(np.random.default_rng(1).integers(0, 255, (99, 99, 3), np.uint8)))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert (tmp_path / name).read_bytes() == old
    assert sorted(os.listdir(tmp_path)) == ["a.jpg", "a.png", "a.tif"]


def test_a_file_is_recognised_by_its_content_and_not_by_its_suffix(tmp_path, smooth):
    shutil.move(saved(tmp_path / "a.png", smooth), tmp_path / "a.jpg")
    np.testing.assert_array_equal(read_photograph(tmp_path / "a.jpg").pixels, smooth)
    buffer = io.BytesIO()
    Image.fromarray(smooth).save(buffer, "TIFF")
    (tmp_path / "b.exr").write_bytes(buffer.getvalue())
    np.testing.assert_array_equal(read_photograph(tmp_path / "b.exr").pixels, smooth)
