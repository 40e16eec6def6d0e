"""Photographs of other colour spaces than sRGB: taken to Rec. 709 in linear light, after their curve, not before."""

from __future__ import annotations

import struct
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from relume.capture.brackets.merging import merge_brackets
from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.errors import NotABracket
from relume.image import files
from relume.image.colour_space import colour_space_of, decoded, in_rec709, name_of, response_of, to_own_primaries
from relume.image.files.metadata import icc_profile
from relume.image.files.metadata.icc_profile import adobe_rgb, screen_profile
from relume.image.photograph import Exposure, Photograph
from relume.image.primaries import BT2020, P3, REC709, Primaries, between, inside_gamut
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap
from relume.probe.clipped_light import linear
from relume.probe.painting import environment_from_painting
from relume.project.insertion.composite import Development, _developed
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.undeveloping import undevelop
from synthetic import STOPS, VirtualCamera, wide_scene

DISPLAY_P3 = screen_profile(P3, "Display P3")
PROPHOTO = Primaries((0.7347, 0.2653), (0.1596, 0.8404), (0.0366, 0.0001), (0.3457, 0.3585))

# B. Lindbloom, "RGB/XYZ Matrices": Adobe RGB (1998) to XYZ, and XYZ to sRGB, both under D65; ProPhoto to XYZ under D50.
ADOBE_TO_XYZ = [[0.5767309, 0.1855540, 0.1881852], [0.2973769, 0.6273491, 0.0752741], [0.0270343, 0.0706872, 0.9911085]]
XYZ_TO_SRGB = [
    [3.2404542, -1.5371385, -0.4985314],
    [-0.9692660, 1.8760108, 0.0415560],
    [0.0556434, -0.2040259, 1.0572252],
]
PROPHOTO_TO_XYZ = [[0.7976749, 0.1351917, 0.0313534], [0.2880402, 0.7118741, 0.0000857], [0.0, 0.0, 0.8252100]]
BRADFORD_D50_TO_D65 = [
    [0.9555766, -0.0230393, 0.0631636],
    [-0.0282895, 1.0099416, 0.0210077],
    [0.0122982, -0.0204830, 1.3299098],
]
# SMPTE EG 432-1's primaries under D65, as CSS Color 4 has it: P3's own green is nearly -0.22 of Rec. 709's red.
P3_TO_709 = [[1.2249401, -0.2249404, 0.0], [-0.0420569, 1.0420571, 0.0], [-0.0196376, -0.0786361, 1.0982735]]


def one_pixel(codes: tuple[int, int, int], profile: bytes, kind: type = np.uint8) -> Photograph:
    return Photograph(np.tile(np.array(codes, kind), (2, 2, 1)), profile=profile)


def test_display_p3_becomes_rec_709_by_the_published_matrix():
    light = (np.array([200, 100, 50]) / 255 + 0.055) / 1.055
    found = decoded(one_pixel((200, 100, 50), DISPLAY_P3))[0, 0]
    np.testing.assert_allclose(found, np.array(P3_TO_709) @ light**2.4, rtol=1e-3)
    # P3's own green lies outside: nothing is clipped.
    green = decoded(one_pixel((0, 255, 0), DISPLAY_P3))[0, 0]
    np.testing.assert_allclose(green, [-0.2249, 1.0421, -0.0786], atol=5e-4)
    np.testing.assert_allclose(decoded(one_pixel((255, 255, 255), DISPLAY_P3))[0, 0], 1, atol=1e-4)


def test_adobe_rgb_has_its_own_curve_and_matrix():
    light = (np.array([200, 100, 50]) / 255) ** 2.19921875
    wanted = np.array(XYZ_TO_SRGB) @ np.array(ADOBE_TO_XYZ) @ light
    np.testing.assert_allclose(wanted, [0.7687, 0.1276, 0.0235], atol=1e-4)
    for kind, factor in ((np.uint8, 1), (np.uint16, 257)):
        codes = (200 * factor, 100 * factor, 50 * factor)
        np.testing.assert_allclose(decoded(one_pixel(codes, adobe_rgb(), kind))[0, 0], wanted, rtol=2e-3)


def test_prophoto_is_adapted_from_its_white():
    photograph = one_pixel((200, 100, 50), screen_profile(PROPHOTO, "ProPhoto RGB", 1.8), np.uint8)
    light = (np.array([200, 100, 50]) / 255) ** (round(1.8 * 256) / 256)
    wanted = np.array(XYZ_TO_SRGB) @ np.array(BRADFORD_D50_TO_D65) @ np.array(PROPHOTO_TO_XYZ) @ light
    np.testing.assert_allclose(decoded(photograph)[0, 0], wanted, atol=2e-3)


def test_srgb_by_whatever_profile_is_no_other_colour_space():
    little_cms = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    for profile in (little_cms, screen_profile(REC709, "sRGB")):
        photograph = one_pixel((200, 100, 50), profile)
        assert colour_space_of(photograph) is None and response_of(photograph) is None
        assert name_of(photograph) == "sRGB"
    assert name_of(one_pixel((1, 2, 3), DISPLAY_P3)) == "Display P3"


def test_little_cms_agrees_within_a_code():
    codes = np.random.default_rng(3).integers(70, 180, (32, 32, 3)).astype(np.uint8)
    theirs = ImageCms.profileToProfile(
        Image.fromarray(codes),
        ImageCms.ImageCmsProfile(__import__("io").BytesIO(adobe_rgb())),
        ImageCms.createProfile("sRGB"),
        renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
    )
    ours = decoded(Photograph(codes, profile=adobe_rgb()))
    encoded = np.where(ours <= 0.0031308, 12.92 * ours, 1.055 * np.maximum(ours, 0) ** (1 / 2.4) - 0.055)
    assert np.abs(255 * np.clip(encoded, 0, 1) - np.asarray(theirs).astype(float)).max() < 1.1


# Brackets


def hue(radiance: np.ndarray) -> np.ndarray:
    return radiance / radiance.sum(-1, keepdims=True)


@pytest.fixture(scope="module")
def scene() -> np.ndarray:
    """Of Rec. 709, its colours well apart."""
    pale = wide_scene(96, 64)
    grey = pale.mean(-1, keepdims=True)
    return np.maximum(grey + 3 * (pale - grey), 0.05 * grey).astype(np.float32)


@pytest.fixture(scope="module")
def wide(scene: np.ndarray) -> Bracket:
    """A camera of unknown response that writes Display P3 took it."""
    taken = VirtualCamera().bracket(scene @ between(REC709, P3).T, STOPS)
    return Bracket(tuple(replace(each, profile=DISPLAY_P3, camera="Virtual Wide") for each in taken.photographs))


def test_a_bracket_of_another_colour_space_is_merged_first_and_then_converted(wide, scene, tmp_path):
    picture = merge_brackets(wide).picture
    seen = (picture.clipped == 0) & (scene.min(-1) > 0)
    error = np.abs(hue(picture.radiance[seen]) - hue(scene[seen])).max(-1)
    assert np.median(error) < 0.004 and np.quantile(error, 0.9) < 0.02
    # The same without the profile: what is seen above is no accident of the scene.
    plain = merge_brackets(Bracket(tuple(replace(each, profile=None) for each in wide.photographs))).picture
    assert np.median(np.abs(hue(plain.radiance[seen]) - hue(scene[seen])).max(-1)) > 0.02
    # The file says Rec. 709, and what the photographs were.
    assert Primaries.of(picture.attributes["primaries"].split()).is_close(P3)
    files.write(tmp_path / "a.exr", picture)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = files.read_radiance(tmp_path / "a.exr")
    np.testing.assert_array_equal(again.radiance, picture.radiance)
    assert "primaries" not in plain.attributes


def test_two_colour_spaces_in_one_bracket_are_refused_in_one_line(wide):
    first, *others = wide.photographs
    with pytest.raises(NotABracket, match=r"is in sRGB, .* in Display P3; .* export all alike$"):
        Bracket((*others, replace(first, profile=None)))
    Bracket((*others, replace(first, profile=screen_profile(P3, "another name"))))


def test_what_one_channel_lacks_stays_with_that_channel():
    radiance = np.full((1, 2, 3), (4.0, 2.0, 1.0), np.float32)
    variance = np.array([[[np.inf, 0.01, 0.01], [0.01, 0.01, 0.01]]], np.float32)
    given = RadianceMap(radiance, variance, np.array([[SATURATED, 0]], np.uint8))
    found = in_rec709(given, one_pixel((0, 0, 0), DISPLAY_P3))
    assert found.variance is not None and found.clipped is not None
    assert np.isinf(found.variance[0, 0]).tolist() == [True, False, False]
    # Green: 0.0421² of a bound that may be wrong by all of its 4, and its own.
    assert found.variance[0, 0, 1] == pytest.approx(0.04206**2 * 16 + 1.04206**2 * 0.01, rel=1e-3)
    np.testing.assert_allclose(found.radiance[0, 1], np.array(P3_TO_709) @ [4, 2, 1], rtol=1e-4)
    unseen = RadianceMap(
        np.zeros((1, 1, 3), np.float32), np.full((1, 1, 3), np.inf, np.float32), np.full((1, 1), OUTSIDE, np.uint8)
    )
    found = in_rec709(unseen, one_pixel((0, 0, 0), DISPLAY_P3))
    assert found.variance is not None and np.all(np.isinf(found.variance))


def test_what_is_developed_in_the_plate_s_primaries_comes_back():
    pixels = np.random.default_rng(4).uniform(0, 3, (5, 6, 3)).astype(np.float32)
    photograph = one_pixel((0, 0, 0), adobe_rgb())
    there = to_own_primaries(pixels, photograph)
    assert np.abs(there - pixels).max() > 0.1
    np.testing.assert_allclose(in_rec709(RadianceMap(there), photograph).radiance, pixels, atol=1e-5)
    assert to_own_primaries(pixels, one_pixel((0, 0, 0), screen_profile(REC709, "a"))) is pixels


def test_a_composite_is_developed_in_the_plate_s_colour_space():
    """The plate's own light, through the plate's own curve: its codes come back, under its profile."""
    codes = np.random.default_rng(6).integers(5, 250, (8, 9, 3)).astype(np.uint8)
    plate = Photograph(codes, exposure=Exposure(1.0), profile=DISPLAY_P3)
    film = Film(1.0, response_of(plate))
    picture = _developed(decoded(plate), film, Development(film, Bracket((plate,))))
    assert picture.profile == DISPLAY_P3 and np.abs(picture.pixels.astype(int) - codes).max() <= 1
    assert np.abs(_developed(decoded(plate), film, Development(film)).pixels.astype(int) - codes).max() > 5


# Single photographs


def test_a_single_photograph_takes_the_curve_of_its_profile():
    codes = one_pixel((180, 180, 180), adobe_rgb())
    assert linear(codes).radiance[0, 0] == pytest.approx((180 / 255) ** 2.19921875, rel=1e-4)
    undeveloped = undevelop(codes, Film(1.0))
    assert undeveloped.radiance[0, 0] == pytest.approx((180 / 255) ** 2.19921875, rel=1e-4)


def test_a_profile_of_one_value_for_all_codes_is_not_understood():
    profile = screen_profile(P3, "dark", 2.2)
    curve = b"curv" + bytes(4) + struct.pack(">IH", 1, round(256 * 2.2))
    assert profile.count(curve) == 1
    # An exponent of 0: every code is white.
    flat = profile.replace(curve, b"curv" + bytes(4) + struct.pack(">IH", 1, 0))
    assert icc_profile.parsed(profile) is not None and icc_profile.parsed(flat) is None
    assert response_of(one_pixel((9, 9, 9), flat)) is None


def test_every_response_of_a_profile_rises():
    for kind in (np.uint8, np.uint16):
        for profile in (DISPLAY_P3, adobe_rgb(), screen_profile(BT2020, "wide", 1.0)):
            response = response_of(one_pixel((0, 0, 0), profile, kind))
            assert response is not None and response.log_exposure[:, -1] == pytest.approx(0, abs=1e-3)


def test_a_painting_s_colours_outside_become_light_that_can_be():
    painting = Photograph(np.tile(np.array([0, 255, 0], np.uint8), (4, 8, 1)), profile=DISPLAY_P3)
    light = environment_from_painting(painting, "srgb")
    # Its luminance stays: 0.7152 · 1.0421 − 0.2126 · 0.2249 − 0.0722 · 0.0786.
    assert light.radiance[0, 0] @ [0.2126, 0.7152, 0.0722] == pytest.approx(0.6918, abs=1e-3)
    assert light.radiance.min() == 0


def test_inside_the_gamut_nothing_changes_and_outside_luminance_stays():
    given = np.array([[0.2, 0.5, 0.1], [-0.3, 0.9, 0.05], [-0.5, 0.01, -0.1]], np.float32)
    found = inside_gamut(given)
    np.testing.assert_array_equal(found[0], given[0])
    assert found[1] @ [0.2126, 0.7152, 0.0722] == pytest.approx(-0.3 * 0.2126 + 0.9 * 0.7152 + 0.05 * 0.0722, rel=1e-5)
    assert found.min() == 0 and not found[2].any()


# Files


def saved(path: Path, *, exif: bytes = b"", profile: bytes | None = None) -> Path:
    pixels = np.random.default_rng(5).integers(0, 255, (24, 32, 3), np.uint8)
    Image.fromarray(pixels).save(path, quality=95, exif=b"Exif\0\0" + exif, icc_profile=profile)
    return path


def exif_of(colour_space: int, index: str | None) -> bytes:
    """A block of EXIF with ColorSpace and the interoperability index, by Pillow."""
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA001] = colour_space
    if index is not None:
        exif.get_ifd(0x8769)[0xA005] = {1: index, 2: b"0100"}
    return exif.tobytes().removeprefix(b"Exif\0\0")


@pytest.mark.parametrize(
    "space, index, name",
    [(0xFFFF, "R03", "Adobe RGB (1998)"), (2, None, "Adobe RGB (1998)"), (1, "R98", "sRGB"), (0xFFFF, None, "sRGB")],
)
def test_adobe_rgb_is_known_by_exif_alone(tmp_path, space, index, name):
    photograph = files.read_photograph(saved(tmp_path / "a.jpg", exif=exif_of(space, index)))
    assert name_of(photograph) == name
    # What is written again keeps it.
    files.write(tmp_path / "b.png", photograph)
    assert name_of(files.read_photograph(tmp_path / "b.png")) == name


def test_an_embedded_profile_goes_before_exif(tmp_path):
    path = saved(tmp_path / "a.jpg", exif=exif_of(0xFFFF, "R03"), profile=DISPLAY_P3)
    assert name_of(files.read_photograph(path)) == "Display P3"


def test_a_bracket_is_read_without_a_word_on_profiles_that_are_understood(tmp_path):
    paths = [saved(tmp_path / f"{i}.jpg", profile=DISPLAY_P3) for i in range(2)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.warns(UserWarning, match="pixel for pixel"):
            read_bracket(paths, times=[1.0, 1.0])
