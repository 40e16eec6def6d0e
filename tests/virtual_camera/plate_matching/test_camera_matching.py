"""A camera like the plate's: what it develops has the plate's tones, exposure, fall-off, sharpness and grain."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from relume.capture.lens.vignetting import Vignetting
from relume.capture.response.camera_profile import CameraProfile
from relume.image.colour import decode_srgb, encode_srgb, luminance
from relume.image.files.metadata.icc_profile import adobe_rgb
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.undeveloping import undevelop
from relume.virtual_camera.lens.vignetting import MeasuredVignetting
from relume.virtual_camera.plate_matching.camera_matching import Softness, match_camera
from relume.virtual_camera.plate_matching.grain_measuring import photograph_grain
from relume.virtual_camera.plate_matching.sharpness import Sharpness, measured_sharpness
from relume.virtual_camera.view import View
from synthetic import NOISELESS

VIEW = View(200.0, seed=1)
STATED = Exposure(1 / 4, 2.0, 200.0)


def response() -> Response:
    curve = NOISELESS.log_exposure()
    curve[:, 0] = curve[:, 1] - 2
    return Response(curve, np.full(3, 2.0))


@cache
def board() -> np.ndarray:
    """A slanted chequered board (H, W, 3), 0.3 and 0.9, 160 × 220, by pixels as wide as they are."""
    y, x = (np.mgrid[: 160 * 4, : 220 * 4] + 0.5) / 4
    across, down = x * np.cos(0.14) + y * np.sin(0.14), y * np.cos(0.14) - x * np.sin(0.14)
    light = 0.3 + 0.6 * ((across // 30 + down // 30) % 2)
    return np.repeat(light.reshape(160, 4, 220, 4).mean((1, 3))[..., None], 3, axis=2).astype(np.float32)


@cache
def clean() -> np.ndarray:
    """Pixel values, not rounded, of the board through a lens of 1.1 pixels."""
    soft = gaussian_filter(np.repeat(np.repeat(board(), 4, axis=0), 4, axis=1), (4.4, 4.4, 0))
    return Film.of(STATED, response()).pixel_values(soft.reshape(160, 4, 220, 4, 3).mean((1, 3)))


@cache
def plate() -> Photograph:
    """The board with noise of two pixel values."""
    values = clean() + 2 * np.random.default_rng(0).standard_normal(clean().shape)
    return Photograph(np.rint(np.clip(values, 0, 255)).astype(np.uint8), exposure=STATED)


SMALL = Photograph(np.full((40, 50, 3), 118, np.uint8), exposure=STATED)
DIM = RadianceMap(np.full((40, 50, 3), 30.0, np.float32))
LIT = RadianceMap(np.full((40, 50, 3), 1.0, np.float32))
"""As bright as the plate."""


def test_what_is_developed_looks_as_the_plate_does():
    camera = match_camera(plate(), RadianceMap(board()), response(), clean=clean())
    light = board()
    for step in camera.optics:
        light = step.apply(light, VIEW)
    shown = camera.film.display_values(light, VIEW, camera.film.adapt(light, VIEW))
    again = Photograph(np.rint(255 * encode_srgb(shown)).astype(np.uint8))
    difference = again.pixels.astype(int) - plate().pixels
    # Both have noise of two values, so their difference 2.8 and its mean over 35,000 pixels hardly any.
    assert np.abs(difference.mean((0, 1))).max() < 0.15 and difference.std() == pytest.approx(2.85, abs=0.25)
    found, grain = measured_sharpness(undevelop(again, camera.film)), photograph_grain(again, clean=clean())
    wanted = measured_sharpness(undevelop(plate(), camera.film))
    assert found is not None and wanted is not None and grain is not None
    assert found.sigma == pytest.approx(wanted.sigma, abs=0.1) and found.sigma == pytest.approx(1.1, abs=0.15)
    assert grain.deviation_at(np.full(3, 120.0)).mean() == pytest.approx(2.0, abs=0.2)
    assert any(line.startswith("sharpness: sigma 1.") for line in camera.facts)
    assert any(line.startswith("grain: standard deviation") for line in camera.facts)


def radiance_at_118(film: Film) -> float:
    """Luminance of the colour whose pixel values are 118."""
    if film.response is None:
        return float(decode_srgb(np.array(118 / 255))) / film.exposure
    return float(luminance(np.exp(film.response.log_exposure[:, 118]))) / film.exposure


def exposure_of(photograph: Photograph, picture: RadianceMap, profile=None) -> tuple[float, str]:
    camera = match_camera(photograph, picture, profile)
    return camera.film.exposure, next(line for line in camera.facts if line.startswith("exposure"))


def test_a_relative_picture_and_a_response_take_the_plates_exposure():
    exposure, fact = exposure_of(SMALL, LIT, response())
    assert exposure == STATED.factor == 0.125
    assert fact == ("exposure: the plate's, 0.25 s, f/2, ISO 200; the picture is taken to be on the response's scale")


def test_a_picture_in_candelas_takes_it_by_the_profiles_scale_or_by_the_iso_number():
    picture = RadianceMap(50 * LIT.radiance, unit="cd/m²")
    profile = CameraProfile("one", response(), scale=50.0, scale_deviation=0.02, scale_exposure=(True, True))
    exposure, fact = exposure_of(SMALL, picture, profile)
    assert exposure == pytest.approx(0.125 / 50) and "the profile's scale" in fact
    other = replace(profile, scale_exposure=(False, False))
    picture = replace(LIT, unit="cd/m²")
    camera = match_camera(SMALL, picture, other)
    assert any(line.startswith("scale: the profile's needs f-number and ISO") for line in camera.facts)
    # ISO 12232 at 200: 10 / 200 lx·s = 0.65 L / 4 / 4 make 118, L = 1.2308 cd/m².
    for known in (None, other):
        camera = match_camera(SMALL, picture, known)
        assert radiance_at_118(camera.film) == pytest.approx(1.23077, rel=1e-4)
        assert any("ISO 12232" in line for line in camera.facts)


@pytest.mark.parametrize(
    "photograph, unit, why",
    [
        (replace(SMALL, exposure=None), "relative", "the plate has no exposure"),
        (SMALL, "relative", "the picture is relative, and sRGB has no scale of its own"),
        (replace(SMALL, exposure=Exposure(0.25)), "cd/m²", "the plate has no f-number or ISO"),
    ],
)
def test_where_no_exposure_holds_the_picture_is_metered_and_that_is_said(photograph, unit, why):
    camera = match_camera(photograph, replace(DIM, unit=unit))
    assert camera.film.pixel_values(np.full((1, 1, 3), 30.0))[0, 0] == pytest.approx(118, abs=0.05)
    fact = next(line for line in camera.facts if line.startswith("exposure"))
    assert fact.startswith("exposure: metered, the picture's log mean becomes 118 of 255") and why in fact
    assert any(line.startswith("response: sRGB, for no profile was given") for line in camera.facts)


def test_a_plate_in_another_colour_space_is_matched_as_srgb_with_a_warning():
    with pytest.warns(UserWarning, match=r"in Adobe RGB .*matched as if it were in sRGB.*convert it to sRGB first"):
        match_camera(replace(SMALL, name="P.jpg", profile=adobe_rgb()), DIM)


def test_a_camera_without_exposure_is_metered_on_its_own_curve():
    assert radiance_at_118(match_camera(replace(SMALL, exposure=None), DIM, response()).film) == pytest.approx(30)


def test_softness_comes_before_the_profiles_fall_off_as_in_a_virtual_camera():
    profile = CameraProfile("one", response(), vignetting=Vignetting((-0.3,), f_number=2.0).to_dict())
    camera = match_camera(plate(), LIT, profile)
    assert [type(step) for step in camera.optics] == [Softness, MeasuredVignetting]
    assert "vignetting: of the profile" in camera.facts
    wide = replace(profile, vignetting=Vignetting((-0.3,), f_number=8.0).to_dict())
    facts = match_camera(SMALL, LIT, wide).facts
    assert "vignetting: of the profile, measured at f/8; the plate is at f/2" in facts


def test_a_profiles_balance_is_undone_before_the_response():
    profile = CameraProfile("one", response(), balance=(2.0, 1.0, 0.5))
    film = match_camera(SMALL, LIT, profile).film
    balanced = np.full((1, 1, 3), 1.0) * np.array(profile.balance)
    plain = Film(film.exposure, response())
    np.testing.assert_allclose(film.pixel_values(balanced), plain.pixel_values(np.ones((1, 1, 3))))


def test_a_plate_that_shows_nothing_says_so():
    blank = Photograph(np.full((40, 50, 3), 255, np.uint8))
    camera = match_camera(blank, DIM)
    assert camera.optics == () and camera.film.grain is None
    assert any("too few clean edges" in line for line in camera.facts)
    assert any("too few flat patches" in line for line in camera.facts)


def test_sixteen_bits_have_the_grain_of_eight():
    deep = replace(plate(), pixels=plate().pixels.astype(np.uint16) * 257)
    grain = match_camera(deep, DIM, clean=257 * clean()).film.grain
    assert grain is not None
    assert grain.deviation_at(np.full(3, 120.0)).mean() == pytest.approx(2.0, abs=0.2)


def test_softness_keeps_the_light():
    light = np.zeros((30, 40, 3), np.float32)
    light[15, 20] = 1000, 500, 1
    before = light.copy()
    soft = Softness(Sharpness(1.3)).apply(light, VIEW)
    np.testing.assert_allclose(soft.sum((0, 1)), [1000, 500, 1], rtol=1e-5)
    assert soft[15, 20, 0] < 150 and soft.dtype == np.float32
    np.testing.assert_array_equal(light, before)


@pytest.mark.parametrize("factor, said", [(2.0, "1.0 stops brighter"), (0.5, "1.0 stops darker")])
def test_the_facts_say_how_much_brighter_the_picture_comes_out_and_at_which_exposure(factor, said):
    light = np.exp(response().log_exposure[:, 118]) / STATED.factor
    picture = RadianceMap(np.broadcast_to(factor * light, (40, 50, 3)).astype(np.float32))
    facts = match_camera(SMALL, picture, response()).facts
    assert f"brightness: the picture comes out {said} than the plate, by their medians" in facts
    assert "exposed by 0.125 per unit of radiance" in facts


def test_a_picture_in_another_unit_than_the_exposure_holds_for_is_warned_of():
    light = 50 * np.exp(response().log_exposure[:, 118]) / STATED.factor
    picture = RadianceMap(np.broadcast_to(light, (40, 50, 3)).astype(np.float32))
    with pytest.warns(UserWarning, match=r"5\.6 stops brighter than the plate, .* expose by -5\.6 stops$") as warned:
        camera = match_camera(SMALL, picture, response())
    assert len(warned) == 1 and warned[0].filename == __file__
    assert any("5.6 stops brighter" in line for line in camera.facts)
    white = match_camera(replace(SMALL, pixels=np.full((40, 50, 3), 255, np.uint8)), picture, response())
    assert any(line.startswith("brightness: the plate is white or black nearly everywhere") for line in white.facts)
