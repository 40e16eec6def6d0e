"""Gain-map JPEGs: what is read of others', what is written, how much is lost and who else can read it."""

import io
import math
import warnings
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image, ImageCms
from PIL.MpoImagePlugin import MpoImageFile

from relume.errors import UnreadableFile
from relume.image.colour import decode_srgb, encode_srgb, luminance
from relume.image.files.encodings import GainMap
from relume.image.files.gain_map import encoding as gain_map_encoding
from relume.image.files.gain_map import gain_map
from relume.image.files.gain_map import layout as gain_map_layout
from relume.image.files.gain_map import metadata as gain_map_metadata
from relume.image.files.gain_map.metadata import GainMapMetadata
from relume.image.files.metadata import exif
from relume.image.files.photographs import jpeg_segments
from relume.image.files.photographs.jpeg_segments import APP1, APP2, segment
from relume.image.files.read_options import ReadOptions
from relume.image.radiance import RadianceMap


def landscape(stops: float, height: int = 96, width: int = 128) -> np.ndarray:
    """(height, width, 3) float32 that spans `stops` from left to right, coloured, with a little texture."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    light = 2 ** (stops * (x / (width - 1) - 0.5)) * (1 + 0.1 * np.sin(x / 5) * np.sin(y / 7))
    tint = np.stack([1 + 0.3 * y / height, np.ones_like(y), 1 - 0.4 * y / height], -1)
    return (light[..., None] * tint).astype(np.float32)


def written(path: Path, image: RadianceMap, encoding: GainMap = GainMap()) -> str:
    """Write it; the sentence that tells the losses."""
    with pytest.warns(UserWarning, match="a gain map keeps luminance") as caught:
        gain_map.write(path, image, encoding)
    return str(caught[-1].message)


def openimageio_s(path: Path) -> np.ndarray:
    """(H, W, 3) float32 as OpenImageIO decodes the light with libultrahdr."""
    source = oiio.ImageInput.open(str(path))
    assert source is not None
    try:
        assert source.spec().format == oiio.HALF
        return np.asarray(source.read_image(), np.float32)[..., :3]
    finally:
        source.close()


def jpeg(pixels: np.ndarray, **options: object) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "JPEG", quality=100, subsampling=0, **options)
    return file.getvalue()


def foreign(
    base: np.ndarray, codes: np.ndarray, metadata: GainMapMetadata, profile: bytes = b"", heads: tuple[bytes, ...] = ()
) -> bytes:
    """A file without anything of ours: an index, and ISO 21496-1."""
    block = jpeg_segments.ISO_GAIN_MAP + gain_map_metadata.to_iso(metadata)
    second = jpeg_segments.with_segments(jpeg(codes), [segment(APP2, block)])
    ahead = [segment(APP2, jpeg_segments.ICC + b"\x01\x01" + profile)] if profile else []
    first = jpeg(base)
    return gain_map_layout.assembled(first, second, [*heads, *ahead])


def read_of(path: Path, data: bytes, *others: str) -> RadianceMap:
    """The map in a foreign file, whose reading must warn of its light, and of each of `others`."""
    path.write_bytes(data)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        image = gain_map.read(path)
    said = [str(warning.message) for warning in caught]
    assert len(said) == 1 + len(others), said
    for expected in ("made for displays", *others):
        assert any(expected in message for message in said), said
    assert image.attributes["rendition"] == "display"
    return image


def test_radiance_comes_back_in_its_unit_with_its_attributes(tmp_path: Path) -> None:
    image = RadianceMap(
        250 * landscape(8),
        unit="cd/m²",
        attributes={"mapping": "latlong", "exposure_time": "0.004", "camera": "Bär & Söhne", "primaries": "told"},
    )
    said = written(tmp_path / "a.jpg", image)
    assert gain_map.is_present(tmp_path / "a.jpg")
    back = gain_map.read(tmp_path / "a.jpg")
    assert back.unit == "cd/m²"
    assert back.attributes == image.attributes
    shares = np.abs(luminance(back.radiance) / luminance(image.radiance) - 1)
    half, most, worst = np.percentile(shares, (50, 99, 100))
    assert f"to {half:.1%} in half of the pixels, {most:.1%} in 99 of 100, {worst:.1%} in all" in said
    assert most < 0.025
    assert exif.tags(tmp_path / "a.jpg", "JPEG")[0x829A] == 0.004


@pytest.mark.parametrize("stops", [8, 12, 18])
def test_the_step_of_eight_bits_bounds_the_error_but_for_what_jpeg_adds(tmp_path: Path, stops: int) -> None:
    """The loss of the codes alone is at most 2^(s/510) − 1 for s stops of gain, of the light with its offset."""
    image = RadianceMap(landscape(stops))
    scale = gain_map_encoding._scale(image.radiance, None)
    base = gain_map_encoding._base(image.radiance, scale)
    linear = decode_srgb(np.arange(256) / 255).astype(np.float32)
    metadata = gain_map_encoding._metadata("a.jpg", image.radiance, scale, base, linear)
    metadata = replace(metadata, gamma=(1.0, 1.0, 1.0))
    codes = gain_map_encoding._codes(image.radiance, scale, base, linear, metadata)
    low, high = np.array(metadata.low), np.array(metadata.high)
    offset = metadata.base_offset[0]
    found = (linear[base] + offset) * 2 ** (low + (high - low) * codes / 255) - offset
    wanted = image.radiance * np.float32(scale)
    bound = 2 ** ((high - low) / 510) - 1
    shares = np.abs(found - wanted) / (wanted + offset)
    assert np.all(shares <= bound + 2e-6)
    assert np.all(shares.max((0, 1)) > 0.9 * bound)
    said = written(tmp_path / "a.jpg", image, GainMap(quality=100))
    back = gain_map.read(tmp_path / "a.jpg").radiance
    shares = np.abs(luminance(back) / luminance(image.radiance) - 1) / bound.max()
    assert np.percentile(shares, 50) < 0.7, said
    assert np.percentile(shares, 99) < 3.5, said
    assert shares.max() < 5, said


def test_the_base_is_a_good_picture(tmp_path: Path) -> None:
    """A grey card of the mean light shows at Reinhard's curve of 0.18, greys are grey, nothing burns out early."""
    pixels = np.full((64, 64, 3), 40, np.float32)
    pixels[:8, :8] = 40 * 2**6
    pixels[-8:, -8:] = 40 / 2**6
    written(tmp_path / "a.jpg", RadianceMap(pixels))
    base = np.asarray(Image.open(tmp_path / "a.jpg"))
    white = 0.18 * 2**6
    middle = encode_srgb(np.array(0.18 * (1 + 0.18 / white**2) / 1.18))
    assert np.abs(base[30:34, 30:34] / 255 - middle).max() < 0.01
    assert base[2, 2].min() >= 254
    assert 0 < base[-3, -3].max() < 30
    assert np.ptp(base.astype(int), axis=-1).max() <= 2


def test_a_picture_within_white_is_shown_as_it_is(tmp_path: Path) -> None:
    pixels = decode_srgb(np.tile(np.arange(0, 256, 2) / 255, (64, 1)))[..., None].repeat(3, 2).astype(np.float32)
    written(tmp_path / "a.jpg", RadianceMap(pixels), GainMap(quality=100, exposure=0.0))
    base = np.asarray(Image.open(tmp_path / "a.jpg")).astype(int)
    assert np.abs(base - np.arange(0, 256, 2)[:, None]).max() <= 1


def test_colours_too_bright_for_their_primary_keep_hue_and_luminance() -> None:
    pixels = np.full((64, 64, 3), 0.18, np.float32)
    pixels[20:40, 20:40] = (0.0, 0.2, 4.0)
    shown = decode_srgb(gain_map_encoding._base(pixels, 1.0)[30, 30] / 255)
    light = luminance(pixels[30, 30])
    assert luminance(shown) == pytest.approx(float(light * (1 + light / 1.0) / (1 + light)), rel=0.02)
    assert shown[2] == pytest.approx(1.0)
    assert shown[0] < shown[1] < 0.9


def test_black_stays_black_but_for_what_the_warning_tells(tmp_path: Path) -> None:
    pixels = landscape(6)
    pixels[:, 40:60] = 0
    said = written(tmp_path / "a.jpg", RadianceMap(pixels))
    back = luminance(gain_map.read(tmp_path / "a.jpg").radiance[:, 40:60]).max()
    assert back < 1e-3 * pixels.max()
    assert f"black becomes up to {back:.2g}" in said


def test_an_all_black_picture_is_written(tmp_path: Path) -> None:
    written(tmp_path / "a.jpg", RadianceMap(np.zeros((16, 16, 3), np.float32)))
    assert gain_map.read(tmp_path / "a.jpg").radiance.max() < 1e-6


def test_what_no_gain_map_holds_is_refused_with_counts(tmp_path: Path) -> None:
    pixels = landscape(4)
    pixels[0, :3] = -1
    pixels[1, :2, 1] = np.nan
    pixels[2, 0] = np.inf
    with pytest.raises(ValueError, match=r"3 negative, 2 NaN, 1 infinite; write \.exr"):
        gain_map.write(tmp_path / "a.jpg", RadianceMap(pixels))
    assert not list(tmp_path.iterdir())


def test_a_range_beyond_it_is_refused_and_told(tmp_path: Path) -> None:
    noise = np.random.default_rng(5)
    pixels = (2 ** noise.uniform(-14, 14, (64, 64, 1)) * np.ones(3)).astype(np.float32)
    with pytest.raises(ValueError, match=r"off by \d.*accepted: the picture spans 28 stops; write \.exr"):
        gain_map.write(tmp_path / "a.jpg", RadianceMap(pixels))
    with pytest.raises(ValueError, match=r"brightest pixel would be 84 stops above the base's white.*write \.exr"):
        gain_map.write(tmp_path / "a.jpg", RadianceMap(pixels * np.float32(2.0**70)), GainMap(exposure=0.0))
    assert not list(tmp_path.iterdir())
    loose = RadianceMap(landscape(20))
    with pytest.raises(ValueError, match=r"where 0\.1% is accepted"):
        gain_map.write(tmp_path / "a.jpg", loose, GainMap(tolerance=0.001))


def test_what_it_does_not_keep_is_told(tmp_path: Path) -> None:
    image = RadianceMap(landscape(2), clipped=np.zeros((96, 128), np.uint8), attributes={"a": "b" * 70000, "c": "d"})
    with pytest.warns(UserWarning) as caught:
        gain_map.write(tmp_path / "a.jpg", image)
    assert "does not keep the marks of clipped pixels; the attributes a;" in str(caught[0].message)
    assert gain_map.read(tmp_path / "a.jpg").attributes == {"c": "d"}


def test_the_same_radiance_makes_the_same_file() -> None:
    image = RadianceMap(landscape(3, 32, 32))
    assert len({gain_map_encoding.encoded("a.jpg", image, GainMap()).file for _ in range(2)}) == 1


def test_other_programs_read_it(tmp_path: Path) -> None:
    """OpenImageIO decodes the light; Pillow and OpenCV show the base, and Pillow finds the second picture."""
    path = tmp_path / "a.jpg"
    image = RadianceMap(landscape(7))
    written(path, image)
    theirs = openimageio_s(path)
    ours = gain_map.read(path).radiance * gain_map_encoding._scale(image.radiance, None)
    # libultrahdr looks its curves up in tables of 1024 steps; and it gives at most 10,000 cd/m² for a white of 203.
    shares = np.abs(theirs - ours) / np.maximum(ours, 0.01)
    assert np.percentile(shares, 50) < 0.008
    assert np.percentile(shares, 99) < 0.03
    base, cv = np.asarray(Image.open(path).convert("RGB")), cv2.imread(str(path))
    assert cv is not None
    assert np.abs(cv[..., ::-1].astype(int) - base).max() <= 1
    with MpoImageFile(path) as both:
        assert both.n_frames == 2
        both.seek(1)
        assert both.size == image.size
    with Image.open(path) as first:
        profile = ImageCms.ImageCmsProfile(io.BytesIO(first.info["icc_profile"]))
    assert "sRGB" in ImageCms.getProfileDescription(profile)


def test_light_above_the_exponent_s_steps_is_read_alike_by_others(tmp_path: Path) -> None:
    """A lamp far above all else makes the writer choose an exponent below 1, which others must understand."""
    pixels = landscape(3)
    pixels[40:42, 40:42] = 2.0**5
    path = tmp_path / "a.jpg"
    written(path, RadianceMap(pixels), GainMap(exposure=0.0))
    with open(path, "rb") as file:
        layout = gain_map_layout.located(path, file, ReadOptions())
    assert layout is not None
    assert layout.metadata.gamma[0] < 1
    theirs = openimageio_s(path)
    assert np.percentile(np.abs(theirs / gain_map.read(path).radiance - 1), 99) < 0.03


def test_what_openimageio_writes_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    wanted = landscape(5, 48, 64)
    spec = oiio.ImageSpec(64, 48, 3, oiio.HALF)
    spec.attribute("jpeg:ultrahdr", 1)
    spec.attribute("oiio:ColorSpace", "lin_rec709_scene")
    target = oiio.ImageOutput.create(str(path))
    assert target is not None
    target.open(str(path), spec)
    target.write_image(wanted)
    target.close()
    # It makes the base in Display P3, whatever it is given.
    image = read_of(path, path.read_bytes(), "its primaries are 0.680")
    theirs = openimageio_s(path)
    shares = np.abs(image.radiance - theirs) / np.maximum(theirs, 0.01)
    assert np.percentile(shares, (50, 99)).tolist() < [0.008, 0.03]
    assert np.median(np.abs(image.radiance / wanted - 1)) < 0.03  # what its own writing loses


FLAT = np.full((32, 48, 3), 128, np.uint8)


def test_the_formula_of_the_standard_by_hand(tmp_path: Path) -> None:
    """(base + base offset) · 2^(low + (high − low) · m^(1/gamma)) − bright offset."""
    metadata = GainMapMetadata((-1, -1, 0), (2, 3, 4), (1, 0.5, 2), (0.1, 0, 0), (0.05, 0, 0), 0, 4)
    image = read_of(tmp_path / "a.jpg", foreign(FLAT, FLAT, metadata))
    base, m = float(decode_srgb(np.array(128 / 255))), 128 / 255
    wanted = [(base + 0.1) * 2 ** (-1 + 3 * m) - 0.05, base * 2 ** (-1 + 4 * m**2), base * 2 ** (4 * math.sqrt(m))]
    assert image.radiance == pytest.approx(np.broadcast_to(np.array(wanted), image.radiance.shape), rel=1e-5)


def test_a_small_grey_map_is_spread_by_pixel_centres(tmp_path: Path) -> None:
    """A ramp of codes over 8 pixels, stretched to 64: linear between the centres of the outer ones, even beyond."""
    ramp = np.tile(np.arange(40, 200, 20, dtype=np.uint8), (8, 1))
    metadata = GainMapMetadata(high=(2, 2, 2), base_offset=(0, 0, 0), bright_offset=(0, 0, 0), bright_headroom=2)
    base = np.full((64, 64, 3), 128, np.uint8)
    image = read_of(tmp_path / "a.jpg", foreign(base, ramp, metadata))
    stops = np.log2(image.radiance[20, :, 1] / decode_srgb(np.array(128 / 255)))
    centres = (np.arange(64) + 0.5) / 8 - 0.5
    assert stops == pytest.approx(2 * (40 + 20 * np.clip(centres, 0, 7)) / 255, abs=0.012)  # a code and a half of JPEG


def test_a_grey_base_is_three_equal_channels(tmp_path: Path) -> None:
    image = read_of(tmp_path / "a.jpg", foreign(FLAT[..., 0], FLAT[..., 0], GainMapMetadata(high=(1, 1, 1))))
    assert np.ptp(image.radiance, axis=-1).max() == 0


def test_a_turned_picture_is_set_upright(tmp_path: Path) -> None:
    base = FLAT.copy()
    base[:8, :8] = 250
    tags = Image.Exif()
    tags[0x0112] = 6  # seen a quarter turn clockwise
    heads = (segment(APP1, tags.tobytes()),)
    image = read_of(tmp_path / "a.jpg", foreign(base, FLAT, GainMapMetadata(high=(1, 1, 1)), heads=heads))
    assert image.radiance.shape == (48, 32, 3)
    assert image.radiance[4, 28, 1] > 2 * image.radiance[4, 4, 1]


def test_the_directory_or_the_end_of_the_base_leads_to_the_map_too(tmp_path: Path) -> None:
    written(tmp_path / "a.jpg", RadianceMap(landscape(3)))
    data = (tmp_path / "a.jpg").read_bytes()
    wanted = gain_map.read(tmp_path / "a.jpg").radiance
    no_index = data.replace(b"MPF\0MM", b"MPF\0XX")
    no_directory = no_index.replace(b"Item:Length", b"Item:Lengch")
    for damaged in (no_index, no_directory):
        assert damaged != data
        (tmp_path / "b.jpg").write_bytes(damaged)
        assert np.array_equal(gain_map.read(tmp_path / "b.jpg").radiance, wanted)


def test_iso_comes_before_xmp(tmp_path: Path) -> None:
    written(tmp_path / "a.jpg", RadianceMap(landscape(3)))
    data = (tmp_path / "a.jpg").read_bytes()
    assert "ISO 21496-1" in gain_map.subtype(tmp_path / "a.jpg")
    wanted = gain_map.read(tmp_path / "a.jpg").radiance
    (tmp_path / "b.jpg").write_bytes(data.replace(b"urn:iso:std:iso:ts:21496:-1", b"urn:iso:std:iso:ts:21496:-X"))
    assert "XMP" in gain_map.subtype(tmp_path / "b.jpg")
    assert gain_map.read(tmp_path / "b.jpg").radiance == pytest.approx(wanted, rel=1e-5, abs=1e-6)


def test_a_plain_jpeg_has_none(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(jpeg(FLAT))
    assert not gain_map.is_present(tmp_path / "a.jpg")
    with pytest.raises(UnreadableFile, match="a JPEG without a gain map"):
        gain_map.read(tmp_path / "a.jpg")
    for name in (".", "missing.jpg"):
        assert not gain_map.is_present(tmp_path / name)


def test_a_bright_base_is_refused(tmp_path: Path) -> None:
    metadata = GainMapMetadata(low=(-2, -2, -2), base_headroom=2.0)
    (tmp_path / "a.jpg").write_bytes(foreign(FLAT, FLAT, metadata))
    with pytest.raises(UnreadableFile, match="its base is the picture for bright displays"):
        gain_map.read(tmp_path / "a.jpg")


@pytest.mark.slow  # twelve million pixels, twice
def test_a_telephone_s_file_is_read_as_openimageio_does(shared: Path) -> None:
    path = shared / "data/formats/gainmap_jpeg/sky.jpg"
    with pytest.warns(UserWarning) as caught:
        image = gain_map.read(path)
    said = [str(warning.message).removeprefix(f"{path}: ") for warning in caught]
    assert said[0] == "made for displays, its light is not measured"
    assert said[1].startswith("its primaries are 0.680004 0.320006 0.265 0.690007")  # Display P3
    assert image.radiance.max() == pytest.approx(4.61, abs=0.01)
    assert image.attributes["camera"] == "Pixel 6 Pro"
    assert gain_map.subtype(path) == "gain map of 2.2 stops, XMP, grey, 1020 x 768"
    theirs = luminance_of_p3(openimageio_s(path))
    shares = np.abs(luminance(image.radiance) - theirs) / np.maximum(theirs, 0.02)
    assert np.percentile(shares, (50, 99)).tolist() < [0.006, 0.03]


def luminance_of_p3(pixels: np.ndarray) -> np.ndarray:
    """SMPTE EG 432-1: the middle row of Display P3 to XYZ."""
    return pixels @ np.array([0.22897, 0.69174, 0.07929], np.float32)


def test_adobe_s_file_agrees_with_its_bright_twin(shared: Path) -> None:
    """The twin is the same photograph, graded for PQ with a white of 203 cd/m² (ITU-R BT.2408)."""
    folder = shared / "data/formats/gainmap_jpeg"
    with pytest.warns(UserWarning, match="made for displays"):
        image = gain_map.read(folder / "seine_sdr_gainmap_srgb.jpg")
    codes = cv2.imread(str(folder / "seine_hdr_srgb.avif"), cv2.IMREAD_UNCHANGED)
    if codes is None or codes.dtype != np.uint16:
        pytest.skip("this OpenCV decodes no AVIF")
    share = (codes[..., ::-1] / 1023) ** (32 / 2523)
    twin = 10000 / 203 * (np.maximum(share - 3424 / 4096, 0) / (2413 / 128 - 2392 / 128 * share)) ** (16384 / 2610)
    ratio = np.median(image.radiance / np.maximum(twin, 1e-3), axis=(0, 1))
    assert ratio == pytest.approx(np.ones(3), abs=0.02)
    assert np.median(np.abs(luminance(image.radiance) / np.maximum(luminance(twin), 1e-3) - 1)) < 0.03


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"exposure": 2000}, "exposure is 2000; give stops, -100 to 100, or None"),
        ({"exposure": math.nan}, "exposure is nan"),
        ({"exposure": math.inf}, "exposure is inf"),
        ({"quality": 95.5}, "quality is 95.5; give a whole number, 1 to 100"),
        ({"quality": 95.0}, "quality is 95.0"),
        ({"quality": math.nan}, "quality is nan"),
    ],
)
def test_options_that_make_no_file_are_refused_before_there_is_one(wrong: dict[str, float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        GainMap(**wrong)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("scale", "said"),
    [
        (1e-32, "middle grey is 10[0-9] stops above this picture's mean, and a gain map holds 100"),
        (1e-45, "middle grey is 14[0-9] stops above"),
        (1e37, "middle grey is 12[0-9] stops below"),
    ],
)
def test_light_so_far_from_one_that_it_would_not_be_read_again_is_refused(
    tmp_path: Path, scale: float, said: str
) -> None:
    image = RadianceMap((landscape(3).astype(float) * scale).astype(np.float32))
    with pytest.raises(ValueError, match=rf"a\.jpg: {said}"):
        gain_map.write(tmp_path / "a.jpg", image)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("stops", [-99.5, 99.5])
def test_scales_within_a_hundred_stops_come_back(tmp_path: Path, stops: float) -> None:
    image = RadianceMap(np.full((16, 16, 3), 0.18 * 2.0**-stops, np.float32))
    written(tmp_path / "a.jpg", image)
    back = gain_map.read(tmp_path / "a.jpg")
    assert back.attributes == {}
    np.testing.assert_allclose(back.radiance, image.radiance, rtol=0.02)


@pytest.mark.parametrize("stops", [-100, 100])
def test_an_exposure_at_its_limit_is_one_that_is_read(tmp_path: Path, stops: int) -> None:
    image = RadianceMap(np.full((16, 16, 3), 2.0**-stops, np.float32))
    written(tmp_path / "a.jpg", image, GainMap(exposure=stops))
    assert gain_map.read(tmp_path / "a.jpg").attributes == {}


@pytest.mark.parametrize(("value", "exposure"), [(3.4e38, None), (3.4e38, 0.0), (1e30, 60.0)])
def test_a_pixel_far_above_white_is_refused_by_what_it_is(tmp_path: Path, value: float, exposure: float | None) -> None:
    image = RadianceMap(landscape(3))
    image.radiance[3, 3] = value
    with pytest.raises(ValueError, match=r"the brightest pixel would be 1\d\d stops above the base's white"):
        gain_map.write(tmp_path / "a.jpg", image, GainMap(exposure=exposure, tolerance=math.inf))


def test_pixels_too_dark_for_float32_s_digits_are_lost_in_words(tmp_path: Path) -> None:
    image = RadianceMap(landscape(3))
    image.radiance[3, 3] = 1e-45
    assert "more than 1e38 times in all" in written(tmp_path / "a.jpg", image, GainMap(exposure=0))


def test_attributes_with_the_names_of_our_own_are_told_as_lost(tmp_path: Path) -> None:
    image = RadianceMap(landscape(3), unit="cd/m²", attributes={"unit": "lux", "gain_map_scale": "7", "owner": "me"})
    with pytest.warns(UserWarning, match="does not keep the attributes gain_map_scale, unit; .exr keeps"):
        written(tmp_path / "a.jpg", image)
    back = gain_map.read(tmp_path / "a.jpg")
    assert (back.attributes, back.unit) == ({"owner": "me"}, "cd/m²")
