"""Gain-map JPEGs: what is read of others', what is written, how much is lost and who else can read it."""

import io
import math
import warnings
from pathlib import Path

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image, ImageCms
from PIL.MpoImagePlugin import MpoImageFile

from relume.errors import UnreadableFile
from relume.image.colour import decode_srgb, encode_srgb, luminance
from relume.image.files.gain_map import encoding as gain_map_encoding
from relume.image.files.gain_map import gain_map
from relume.image.files.gain_map import layout as gain_map_layout
from relume.image.files.gain_map import metadata as gain_map_metadata
from relume.image.files.gain_map.metadata import GainMapMetadata
from relume.image.files.metadata import xmp
from relume.image.files.photographs import jpeg_segments
from relume.image.files.photographs.jpeg_segments import APP1, APP2, segment
from relume.image.radiance import RadianceMap


def landscape(stops: float, height: int = 96, width: int = 128) -> np.ndarray:
    """(height, width, 3) float32 that spans `stops` from left to right, coloured, with a little texture."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    light = 2 ** (stops * (x / (width - 1) - 0.5)) * (1 + 0.1 * np.sin(x / 5) * np.sin(y / 7))
    tint = np.stack([1 + 0.3 * y / height, np.ones_like(y), 1 - 0.4 * y / height], -1)
    return (light[..., None] * tint).astype(np.float32)


def base_of(bright: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 sRGB, what is above white clipped."""
    return np.rint(255 * encode_srgb(np.clip(bright, 0, 1))).astype(np.uint8)


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


def test_a_bright_rendition_comes_back_and_other_programs_read_it(tmp_path: Path) -> None:
    """OpenImageIO decodes the light; Pillow and OpenCV show the base, and Pillow finds the second picture."""
    path = tmp_path / "a.jpg"
    bright = landscape(7)
    gain_map.write_rendition(path, bright, base_of(bright))
    image = read_of(path, path.read_bytes())
    shares = np.abs(luminance(image.radiance) / luminance(bright) - 1)
    assert np.percentile(shares, (50, 99)).tolist() < [0.01, 0.05]
    theirs = openimageio_s(path)
    # libultrahdr looks its curves up in tables of 1024 steps; and it gives at most 10,000 cd/m² for a white of 203.
    shares = np.abs(theirs - image.radiance) / np.maximum(image.radiance, 0.01)
    assert np.percentile(shares, 50) < 0.008
    assert np.percentile(shares, 99) < 0.03
    base, cv = np.asarray(Image.open(path).convert("RGB")), cv2.imread(str(path))
    assert cv is not None
    assert np.abs(cv[..., ::-1].astype(int) - base).max() <= 1
    assert np.abs(base.astype(int) - base_of(bright)).max() <= 12
    with MpoImageFile(path) as both:
        assert both.n_frames == 2
        both.seek(1)
        assert both.size == (128, 96)
    with Image.open(path) as first:
        profile = ImageCms.ImageCmsProfile(io.BytesIO(first.info["icc_profile"]))
    assert "sRGB" in ImageCms.getProfileDescription(profile)
    assert len({gain_map_encoding.encoded_rendition("a.jpg", bright, base_of(bright), 95)[0] for _ in "ab"}) == 1


def test_a_size_that_no_jpeg_has_is_refused(tmp_path: Path) -> None:
    pixels = np.ones((1, 65_501, 3), np.float32)
    with pytest.raises(ValueError, match="the picture is 65501 x 1; a JPEG has 1 to 65500 a side"):
        gain_map.write_rendition(tmp_path / "a.jpg", pixels, base_of(pixels))
    assert not list(tmp_path.iterdir())


def test_radiance_that_relume_once_wrote_comes_back_in_its_unit(tmp_path: Path) -> None:
    own = {"gain_map_scale": "0.004", "unit": "cd/m²", "mapping": "latlong"}
    heads = (segment(APP1, jpeg_segments.XMP + xmp.packet(own)),)
    metadata = GainMapMetadata(high=(1, 1, 1))
    (tmp_path / "a.jpg").write_bytes(foreign(FLAT, FLAT, metadata, heads=heads))
    image = gain_map.read(tmp_path / "a.jpg")
    display = read_of(tmp_path / "b.jpg", foreign(FLAT, FLAT, metadata))
    assert (image.unit, image.attributes) == ("cd/m²", {"mapping": "latlong"})
    np.testing.assert_allclose(image.radiance, display.radiance / 0.004, rtol=1e-6)


FLAT = np.full((32, 48, 3), 128, np.uint8)


def test_the_formula_of_the_standard_by_hand(tmp_path: Path) -> None:
    """(base + base offset) · 2^(low + (high − low) · m^(1/gamma)) − bright offset."""
    metadata = GainMapMetadata((-1, -1, 0), (2, 3, 4), (1, 0.5, 2), (0.1, 0, 0), (0.05, 0, 0), 0, 4)
    image = read_of(tmp_path / "a.jpg", foreign(FLAT, FLAT, metadata))
    base, m = float(decode_srgb(np.array(128 / 255))), 128 / 255
    wanted = [(base + 0.1) * 2 ** (-1 + 3 * m) - 0.05, base * 2 ** (-1 + 4 * m**2), base * 2 ** (4 * math.sqrt(m))]
    np.testing.assert_allclose(image.radiance, np.broadcast_to(np.array(wanted), image.radiance.shape), rtol=1e-5)


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
    gain_map.write_rendition(tmp_path / "a.jpg", landscape(3), base_of(landscape(3)))
    data = (tmp_path / "a.jpg").read_bytes()
    wanted = read_of(tmp_path / "a.jpg", data).radiance
    no_index = data.replace(b"MPF\0MM", b"MPF\0XX")
    no_directory = no_index.replace(b"Item:Length", b"Item:Lengch")
    for damaged in (no_index, no_directory):
        assert damaged != data
        assert np.array_equal(read_of(tmp_path / "b.jpg", damaged).radiance, wanted)


def test_iso_comes_before_xmp(tmp_path: Path) -> None:
    gain_map.write_rendition(tmp_path / "a.jpg", landscape(3), base_of(landscape(3)))
    data = (tmp_path / "a.jpg").read_bytes()
    assert "ISO 21496-1" in gain_map.subtype(tmp_path / "a.jpg")
    wanted = read_of(tmp_path / "a.jpg", data).radiance
    other = data.replace(b"urn:iso:std:iso:ts:21496:-1", b"urn:iso:std:iso:ts:21496:-X")
    found = read_of(tmp_path / "b.jpg", other).radiance
    assert np.all(np.abs(found - wanted) <= np.maximum(1e-5 * np.abs(wanted), 1e-6))
    assert "XMP" in gain_map.subtype(tmp_path / "b.jpg")


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
