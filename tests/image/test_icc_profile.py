"""ICC profiles: those of the base picture of a gain map, and those made here, as Little CMS understands them."""

import hashlib
import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageCms

from relume.image.colour import decode_srgb, encode_srgb
from relume.image.files.gain_map import gain_map
from relume.image.files.gain_map import layout as gain_map_layout
from relume.image.files.gain_map import metadata as gain_map_metadata
from relume.image.files.gain_map.metadata import GainMapMetadata
from relume.image.files.metadata import icc_profile
from relume.image.files.metadata.icc_profile import screen_profile
from relume.image.files.photographs import jpeg_segments
from relume.image.files.photographs.jpeg_segments import APP2, segment
from relume.image.primaries import P3, REC709, Primaries, adaptation, between

ADOBE = Primaries((0.64, 0.33), (0.21, 0.71), (0.15, 0.06), (0.3127, 0.3290))
D50 = (0.3457, 0.3585)
SRGB_CURVE = b"para" + struct.pack(
    ">IHH5i", 0, 3, 0, *(round(65536 * n) for n in (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045))
)
GAMMA_CURVE = b"curv" + struct.pack(">IIH", 0, 1, 0x0233) + b"\0\0"


def profile_of(
    primaries: Primaries, curve: bytes, *, chad: bool = False, more: dict[bytes, bytes] | None = None
) -> bytes:
    """A version 4 matrix profile, put together by ICC.1:2022, 7.2 and 7.3."""
    matrix = adaptation(primaries.white, D50) @ primaries.to_xyz()
    tags = {
        name: b"XYZ \0\0\0\0" + struct.pack(">3i", *np.rint(65536 * column).astype(int))
        for name, column in zip((b"rXYZ", b"gXYZ", b"bXYZ"), matrix.T, strict=True)
    }
    tags |= dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curve) | (more or {})
    if chad:
        numbers = np.rint(65536 * adaptation(primaries.white, D50)).astype(int).ravel()
        tags[b"chad"] = b"sf32\0\0\0\0" + struct.pack(">9i", *numbers)
    head = bytearray(128)
    head[12:24], head[36:40] = b"mntrRGB XYZ ", b"acsp"
    listed, data = struct.pack(">I", len(tags)), b""
    for name, value in tags.items():
        listed += struct.pack(">4sII", name, 132 + 12 * len(tags) + len(data), len(value))
        data += value
    return bytes(head) + listed + data


def jpeg(pixels: np.ndarray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "JPEG", quality=100, subsampling=0)
    return file.getvalue()


ORANGE = np.full((16, 16, 3), (200, 120, 60), np.uint8)


def shown() -> np.ndarray:
    """The codes of the orange as its JPEG has them."""
    return np.asarray(Image.open(io.BytesIO(jpeg(ORANGE))))[8, 8]


def file_of(profile: bytes, map_profile: bytes | None = None) -> bytes:
    """A flat orange base under a gain of one stop in each channel."""
    metadata = GainMapMetadata((1, 1, 1), (1, 1, 1), bright_headroom=1, in_base_primaries=map_profile is None)
    heads = [segment(APP2, jpeg_segments.ISO_GAIN_MAP + gain_map_metadata.to_iso(metadata))]
    if map_profile is not None:
        heads.append(segment(APP2, jpeg_segments.ICC + b"\x01\x01" + map_profile))
    second = jpeg_segments.with_segments(jpeg(ORANGE[..., 0]), heads)
    pieces = [profile[:100], profile[100:]]  # as profiles longer than a segment come
    heads = [segment(APP2, jpeg_segments.ICC + bytes((i + 1, 2)) + piece) for i, piece in enumerate(pieces)]
    return gain_map_layout.assembled(jpeg(ORANGE), second, heads[::-1])


def test_pillow_s_srgb_is_srgb() -> None:
    parsed = icc_profile.parsed(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    assert parsed is not None
    assert parsed.primaries.is_close(REC709)
    assert parsed.curves == pytest.approx(icc_profile.srgb().curves, abs=2e-5)


@pytest.mark.parametrize("chad", [False, True])
@pytest.mark.parametrize("primaries", [P3, ADOBE, REC709])
def test_primaries_are_found_behind_their_adaptation(primaries: Primaries, chad: bool) -> None:
    parsed = icc_profile.parsed(profile_of(primaries, SRGB_CURVE, chad=chad))
    assert parsed is not None
    assert parsed.primaries.values == pytest.approx(primaries.values, abs=2e-4)
    assert parsed.curves[:, 1] == pytest.approx(decode_srgb(np.arange(256) / 255), abs=1e-4)


def test_curves_of_every_kind() -> None:
    codes = np.arange(256) / 255
    table = b"curv" + struct.pack(">II3H", 0, 3, 0, 16384, 65535)
    one = b"para" + struct.pack(">IHH3i", 0, 1, 0, 2 * 65536, 2 * 65536, -65536)  # (2x − 1)² from ½, 0 below
    for curve, wanted in (
        (b"curv" + bytes(8), codes),
        (GAMMA_CURVE, codes ** (0x233 / 256)),
        (table, np.interp(codes, [0, 0.5, 1], [0, 16384 / 65535, 1])),
        (b"para" + struct.pack(">IHHi", 0, 0, 0, 3 * 65536), codes**3),
        (one, np.where(codes >= 0.5, (2 * codes - 1) ** 2, 0)),
    ):
        parsed = icc_profile.parsed(profile_of(REC709, curve))
        assert parsed is not None
        assert parsed.curves[:, 0] == pytest.approx(wanted, abs=1e-5)


def test_a_wide_base_is_converted_and_reported(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(file_of(profile_of(ADOBE, GAMMA_CURVE)))
    with pytest.warns(UserWarning) as caught:
        image = gain_map.read(tmp_path / "a.jpg")
    assert "its primaries are 0.639998 0.330003 0.21" in str(caught[1].message)
    assert image.attributes["primaries"].startswith("0.639998 0.330003 0.21")
    linear = (shown() / 255) ** (0x233 / 256)
    wanted = between(ADOBE, REC709) @ ((linear + 1 / 64) * 2 - 1 / 64)
    assert image.radiance[8, 8] == pytest.approx(wanted, rel=1e-3)


def test_gains_for_the_bright_picture_s_primaries(tmp_path: Path) -> None:
    """The base in sRGB, the gains for Display P3, which the map's own profile says."""
    (tmp_path / "a.jpg").write_bytes(file_of(profile_of(REC709, SRGB_CURVE), profile_of(P3, SRGB_CURVE)))
    with pytest.warns(UserWarning) as caught:
        image = gain_map.read(tmp_path / "a.jpg")
    assert "its primaries are 0.68001 0.319995" in str(caught[1].message)
    linear = between(REC709, P3) @ decode_srgb(shown() / 255)
    wanted = between(P3, REC709) @ ((linear + 1 / 64) * 2 - 1 / 64)
    assert image.radiance[8, 8] == pytest.approx(wanted, rel=1e-3)


GOOD = profile_of(P3, SRGB_CURVE)


@pytest.mark.parametrize(
    "profile",
    [
        b"",
        GOOD[:200],
        GOOD[:-30],
        b"\xff" * 600,
        GOOD.replace(b"RGB XYZ ", b"GRAYXYZ "),
        GOOD.replace(b"RGB XYZ ", b"RGB Lab "),
        GOOD[:128] + b"\xff\xff\xff\xff" + GOOD[132:],
        GOOD.replace(b"para\0\0\0\0\0\3", b"para\0\0\0\0\0\x09"),
        GOOD.replace(b"gTRC", b"gTRX"),
        profile_of(REC709, b"curv" + struct.pack(">II", 0, 2**32 - 1)),
        profile_of(REC709, SRGB_CURVE, more={b"A2B0": bytes(64)}),
        profile_of(REC709, SRGB_CURVE, more={b"chad": b"sf32" + bytes(40)}),
        profile_of(REC709, b"para" + struct.pack(">IHHi", 0, 0, 0, -(2**31))),
    ],
)
def test_other_and_damaged_profiles_are_none(profile: bytes) -> None:
    parsed = icc_profile.parsed(profile)
    assert parsed is None or np.all(np.isfinite(parsed.curves))
    if not profile.startswith(GOOD[:132]):
        assert parsed is None


def test_a_profile_not_understood_is_taken_for_srgb_and_reported(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(file_of(GOOD.replace(b"RGB XYZ ", b"GRAYXYZ ")))
    with pytest.warns(UserWarning) as caught:
        image = gain_map.read(tmp_path / "a.jpg")
    assert "its colour profile is damaged or none of primaries and curves; taken for sRGB" in str(caught[0].message)
    assert "primaries" not in image.attributes


# Profiles made


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
