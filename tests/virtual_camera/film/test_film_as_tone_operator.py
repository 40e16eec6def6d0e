"""A film as a tone: the display encodes its own pixel values again, with its grain, and nothing is cut off unsaid."""

import numpy as np
import pytest

from relume.capture.scale.absolute import Scale
from relume.errors import NotABracket
from relume.image.colour import decode_srgb, encode_srgb
from relume.image.photograph import Exposure
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import (
    SATURATED,
    Film,
    srgb_response,
    virtual_photograph,
)
from relume.virtual_camera.film.grain import Grain
from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.tone.display.encoding import PQ, DisplayP3, Srgb, encoded_and_clipped
from relume.virtual_camera.view import View
from synthetic import NOISELESS, wide_scene

VIEW, NOTHING = View(100.0, seed=3), Adaptation(np.zeros(0))


def response() -> Response:
    curve = NOISELESS.log_exposure()
    curve[:, 0] = curve[:, 1] - 2
    return Response(curve, np.full(3, 1.0))


def white_grain(deviation: float = 3.0) -> Grain:
    values = np.tile(np.array([0.0, 255.0]), (3, 1))
    correlation = np.zeros((3, 3, 7, 7))
    correlation[[0, 1, 2], [0, 1, 2], 3, 3] = 1
    return Grain(values, np.full((3, 2), deviation), correlation)


def shown_values(film: Film, light: np.ndarray) -> np.ndarray:
    """Pixel values, 0 to 255, that a display with the sRGB curve shows."""
    return 255 * np.minimum(
        encode_srgb(film.display_values(light, VIEW, film.adapt(light, VIEW)).astype(np.float64)), 1
    )


@pytest.mark.parametrize("own", [None, response()], ids=["srgb", "camera"])
def test_the_display_is_given_the_films_own_pixel_values(own):
    light = wide_scene(96, 64).astype(np.float32)
    film = Film(1 / 12, own)
    values = film.pixel_values(light)
    np.testing.assert_allclose(shown_values(film, light), values, atol=1e-3)
    tie = np.abs(values % 1 - 0.5) < 1e-3
    pixels = np.rint(shown_values(film, light)).astype(int)
    assert np.all((pixels == develop(light, film).pixels) | tie) and tie.mean() < 0.01


def test_every_pixel_value_of_a_camera_comes_back():
    own = response()
    light = np.exp(own.log_exposure).T[None].astype(np.float32)
    np.testing.assert_allclose(shown_values(Film(1.0, own), light)[0], np.tile(np.arange(256)[:, None], 3), atol=3e-3)


def test_a_film_has_nothing_to_adapt_and_keeps_its_grain_when_exposed_longer():
    film = Film(2.0, response(), white_grain())
    assert film.adapt(wide_scene(24, 16), VIEW).values.size == 0
    assert film.brighter(1).exposure == 4 and film.brighter(1).grain is film.grain


def test_grain_is_drawn_with_the_views_seed_in_the_films_pixel_values():
    light = np.full((1200, 60, 3), 0.2, np.float32)
    film = Film(1.0, None, white_grain(3.0))
    values = shown_values(film, light)
    noise = values - Film().pixel_values(light)
    # 72,000 values a channel: 3 ± 0.03 at four deviations; so are the rows where squares of noise meet.
    assert noise.std() == pytest.approx(3.0, abs=0.03) and abs(noise.mean()) < 0.05
    assert noise[218:234].std() == pytest.approx(3.0, rel=0.07)
    assert abs(np.corrcoef(noise[:226].ravel(), noise[226:452].ravel())[0, 1]) < 0.02
    np.testing.assert_array_equal(shown_values(film, light), values)
    other = film.display_values(light, View(100.0, seed=4), NOTHING)
    assert not np.array_equal(other, film.display_values(light, VIEW, NOTHING))


def test_grain_is_as_strong_as_its_pixel_value_says_in_each_channel():
    values = np.tile(np.array([0.0, 100.0, 255.0]), (3, 1))
    grain = Grain(values, np.array([[1.0, 2, 6], [1, 4, 6], [2, 1, 1]]), white_grain().correlation)
    # Pixel values 50 and 150: halfway to 100, and 50 of 155 beyond.
    wanted = np.array([[1.5, 2.5, 1.5], [2 + 4 * 50 / 155, 4 + 2 * 50 / 155, 1]])
    for value, deviation in zip((50, 150), wanted, strict=True):
        light = np.full((300, 300, 3), decode_srgb(np.array(value / 255)), np.float32)
        noise = shown_values(Film(1.0, None, grain), light) - value
        # 90,000 values: 1 % at four deviations.
        np.testing.assert_allclose(noise.std((0, 1)), deviation, rtol=0.01)


def test_grain_leaves_white_and_black_as_they_are():
    light = np.zeros((40, 60, 3), np.float32)
    light[:, :30] = 5.0
    light[20:] = 0.3
    shown = Film(1.0, None, white_grain()).display_values(light, VIEW, NOTHING)
    np.testing.assert_array_equal(shown[:20], light[:20])
    assert shown[20:].std() > 0 and 0 <= shown.min() <= shown[20:].max() <= 1
    shown = Film(1.0, response(), white_grain()).display_values(light, VIEW, NOTHING)
    np.testing.assert_array_equal(shown[:20], np.where(light[:20] > 1, np.float32(SATURATED), np.float32(0)))


@pytest.mark.parametrize("display", [Srgb(), Srgb(16), DisplayP3()], ids=["srgb", "16 bits", "p3"])
@pytest.mark.parametrize("own", [None, response()], ids=["srgb", "camera"])
def test_what_a_film_saturates_is_reported_as_beyond_white(own, display):
    light = np.full((40, 60, 3), 0.1, np.float32)
    light[:10] = 400.0
    values = Film(1.0, own).display_values(light, VIEW, NOTHING)
    codes, clipping = encoded_and_clipped(values, display)
    assert max(clipping.above) == 0.25 and max(clipping.below) == 0
    assert np.all(codes[:10] == np.iinfo(codes.dtype).max) and codes[10:].max() < np.iinfo(codes.dtype).max


def test_a_display_with_room_above_white_shows_it_of_plain_film_and_not_of_a_cameras_response():
    light = np.array([[[0.125, 0.25, 0.5], [0.25, 1.0, 4.0]]], np.float32)
    np.testing.assert_array_equal(Film(2.0).display_values(light, VIEW, NOTHING), 2 * light)
    light = np.repeat(np.array([[[0.1], [0.1], [400.0]]], np.float32), 3, axis=2)
    signal = encoded_and_clipped(Film(2.0, response()).display_values(light, VIEW, NOTHING), PQ())[0]
    white = encoded_and_clipped(np.ones_like(light), PQ())[0]
    np.testing.assert_allclose(signal[0, 2].astype(int), white[0, 2], atol=1)


def test_no_finite_light_overflows():
    light = np.array([[[0.0, 1e-7, 3e38]]], np.float32)
    assert np.isfinite(Film(1e6).display_values(light, VIEW, NOTHING)).all()
    assert np.isfinite(Film(1e6, response()).display_values(light, VIEW, NOTHING)).all()


def test_a_standard_camera_makes_118_of_what_its_iso_number_promises():
    # ISO 12232: 10 / 100 lx·s = 0.65 L t / N², L = 0.1 · 64 / (0.65 / 100) = 984.6 cd/m² at f/8, 1/100 s, ISO 100.
    film = Film.of(Exposure(1 / 100, 8.0, 100.0))
    assert film.pixel_values(np.full((1, 1, 3), 984.615))[0, 0] == pytest.approx(118, abs=0.01)
    assert Film.of(Exposure(1 / 50, 8.0, 100.0)).exposure == pytest.approx(2 * film.exposure)
    assert Film.of(Exposure(1 / 100, 4.0, 200.0)).exposure == pytest.approx(8 * film.exposure)
    with pytest.raises(NotABracket, match="no ISO"):
        Film.of(Exposure(1 / 100, 8.0))
    with pytest.raises(ValueError, match="a scale belongs to a camera's response"):
        Film.of(Exposure(1 / 100, 8.0, 100.0), scale=Scale.grey(2.0, 0.1, "test"))


def test_a_camera_at_its_settings_takes_the_photograph_that_virtual_photograph_takes():
    light, exposure, own = wide_scene(48, 36).astype(np.float32), Exposure(1 / 2, 2.0, 200.0), response()
    taken = virtual_photograph(RadianceMap(light), own, exposure)
    np.testing.assert_array_equal(develop(light, Film.of(exposure, own)).pixels, taken.pixels)
    scale = Scale((2.0, 3.0, 5.0), 0.1, "test")
    candelas = light * np.array(scale.factor, np.float32)
    taken = virtual_photograph(RadianceMap(candelas, unit="cd/m²"), own, exposure, scale=scale)
    film = Film.of(exposure, own, scale=scale)
    assert np.abs(film.pixel_values(candelas) - taken.pixels).max() <= 0.5 + 1e-6
    assert film.exposure == pytest.approx(exposure.factor / scale.luminance)


@pytest.mark.parametrize("own", [None, response()], ids=["srgb", "camera"])
def test_a_film_that_does_not_reach_the_exposure_asked_says_so_in_one_line(own):
    light = np.exp2(np.random.default_rng(0).uniform(5, 6, (40, 60, 1))).astype(np.float32).repeat(3, axis=2)
    with pytest.warns(
        UserWarning, match=r"^100 % of the picture is white: its middle is 5\.\d stops above the most"
    ) as caught:
        Film(1.0, own).display_values(light, VIEW, NOTHING)
    assert "expose by -5." in str(caught[0].message) and "\n" not in str(caught[0].message)
    with pytest.warns(UserWarning, match=r"^100 % of the picture is black: .* below the least .* expose by \+"):
        Film(1e-12, own).display_values(light, VIEW, NOTHING)


def test_an_exposure_for_one_part_of_a_picture_and_a_black_picture_say_nothing():
    light = np.full((40, 60, 3), 0.2, np.float32)
    light[:, :28] = 50
    Film(1.0).display_values(light, VIEW, NOTHING)
    Film(1.0).display_values(np.zeros_like(light), VIEW, NOTHING)


def test_the_srgb_response_is_the_curve():
    own = srgb_response()
    np.testing.assert_allclose(np.exp(own.log_exposure[1, [255, 118, 10]]), [1.0, 0.18116, 0.0030353], rtol=1e-4)
    light = wide_scene(48, 36) / 40
    lit = Film().pixel_values(light) >= 1
    same = Film(1.0, own).pixel_values(light) - Film().pixel_values(light)
    assert np.abs(same[lit]).max() < 0.05
    assert srgb_response(65536).levels == 65536
