"""ICC profiles made here, as Little CMS understands them."""

import hashlib
import io
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageCms

from relume.image.colour import decode_srgb, encode_srgb
from relume.image.files.metadata import icc_profile
from relume.image.files.metadata.icc_profile import screen_profile
from relume.image.primaries import P3, REC709, between


def opened(data: bytes) -> ImageCms.ImageCmsProfile:
    return ImageCms.ImageCmsProfile(io.BytesIO(data))


def transformed(codes: np.ndarray, given: ImageCms.ImageCmsProfile, wanted: object) -> np.ndarray:
    picture = ImageCms.profileToProfile(Image.fromarray(codes), given, wanted, renderingIntent=1)  # pyright: ignore[reportArgumentType]
    assert picture is not None
    return np.asarray(picture).astype(int)


@pytest.mark.parametrize("primaries, name", [(REC709, "sRGB"), (P3, "Display P3")])
def test_it_names_itself_and_is_whole(primaries, name):
    data = screen_profile(primaries, name)
    assert ImageCms.getProfileDescription(opened(data)).strip() == name
    assert len(data) == int.from_bytes(data[:4]) and data[8] == 4 and len(data) % 4 == 0
    identified = bytearray(data)
    for part in (slice(44, 48), slice(64, 68), slice(84, 100)):
        identified[part] = bytes(part.stop - part.start)
    assert data[84:100] == hashlib.md5(identified).digest()


def test_display_p3_s_colorants_are_apple_s():
    """XYZ under D50, to the last 1/65536 but for rounding."""
    data = screen_profile(P3, "Display P3")
    parsed: Any = opened(data).profile
    assert parsed.red_colorant[0] == pytest.approx((0.51512, 0.2412, -0.00105), abs=6e-5)
    assert parsed.green_colorant[0] == pytest.approx((0.29198, 0.69225, 0.04189), abs=6e-5)
    assert parsed.blue_colorant[0] == pytest.approx((0.1571, 0.06657, 0.78407), abs=6e-5)
    assert parsed.media_white_point[0] == pytest.approx((0.9642, 1, 0.8249), abs=1e-5)


@pytest.mark.parametrize("primaries", [REC709, P3])
def test_our_own_reader_gives_primaries_and_curve_back(primaries):
    parsed = icc_profile.parsed(screen_profile(primaries, "a"))
    assert parsed is not None
    assert np.allclose(parsed.primaries.values, primaries.values, atol=2e-4)
    assert np.abs(parsed.curves - decode_srgb(np.linspace(0, 1, 256))[:, None]).max() < 2e-5


def test_srgb_is_little_cms_s_own():
    codes = np.random.default_rng(1).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    found = transformed(codes, opened(screen_profile(REC709, "sRGB")), ImageCms.createProfile("sRGB"))
    assert np.abs(found - codes).max() <= 1


def test_little_cms_takes_p3_to_srgb_by_our_matrix():
    codes = np.random.default_rng(2).integers(60, 180, (64, 64, 3)).astype(np.uint8)
    found = transformed(codes, opened(screen_profile(P3, "Display P3")), ImageCms.createProfile("sRGB"))
    linear = decode_srgb(codes / 255) @ between(P3, REC709).T
    inside = np.all((linear >= 0) & (linear <= 1), axis=-1)
    assert inside.mean() > 0.9
    assert np.abs(found - 255 * encode_srgb(linear))[inside].max() <= 1


def test_the_same_profile_is_the_same_bytes():
    assert screen_profile(P3, "a") == screen_profile(P3, "a") != screen_profile(REC709, "a")
