"""Grain: what is measured of a picture's noise is what was put in, and noise made from it measures the same again."""

import functools

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.merging import merge
from relume.capture.response.calibration import recover_response
from relume.image import files
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.grain import Grain
from relume.virtual_camera.plate_matching.grain_measuring import bracket_grain, photograph_grain, radiance_grain
from synthetic import VirtualCamera, wide_scene

MIXED = np.linalg.cholesky(np.array([[1, 0.5, 0.2], [0.5, 1, 0.4], [0.2, 0.4, 1]]))


def ramp(height: int = 288, width: int = 384) -> np.ndarray:
    """Values (H, W, 3) that rise from left to right."""
    y, x = np.mgrid[:height, :width]
    return np.stack([40 + 150 * x / width + 6 * np.sin(y / 120)] * 3, axis=-1) * [1, 0.9, 0.8]


def deviation(values: np.ndarray) -> np.ndarray:
    return 1 + values / 60


@functools.cache
def smooth_noise(height: int = 288, width: int = 384) -> np.ndarray:
    """Noise of variance 1, correlated between neighbours and channels."""
    white = np.random.default_rng(0).standard_normal((height, width, 3))
    smooth = gaussian_filter(white, (0.8, 0.8, 0), mode="wrap")
    return smooth / smooth.std((0, 1)) @ MIXED.T


@functools.cache
def noisy() -> Photograph:
    return Photograph(np.rint(ramp() + deviation(ramp()) * smooth_noise()).astype(np.uint8))


@functools.cache
def measured() -> Grain:
    grain = photograph_grain(noisy())
    assert grain is not None
    return grain


def correlation_of(noise: np.ndarray, row: int, column: int) -> np.ndarray:
    """(3, 3) of channels at a pixel with those `row`, `column` away, of noise of variance 1."""
    there = np.roll(noise, (-row, -column), axis=(0, 1))
    return np.einsum("yxa,yxb->ab", noise, there) / noise[..., 0].size


def test_the_size_of_the_noise_is_found_at_every_brightness():
    # 16 ranges of 150 patches: a range's variance is good to about 2 %, its deviation to 1 %.
    np.testing.assert_allclose(measured().deviation, deviation(measured().values), rtol=0.05)
    assert abs(np.mean(measured().deviation / deviation(measured().values)) - 1) < 0.01
    assert measured().values[0, 0] < 55 and measured().values[0, -1] > 175


def test_what_neighbours_and_channels_share_is_found():
    for row, column in ((0, 0), (0, 1), (1, 1), (0, 2), (-2, 1), (3, 3)):
        found = measured().correlation[:, :, 3 + row, 3 + column]
        np.testing.assert_allclose(found, correlation_of(smooth_noise(), row, column), atol=0.02)


def test_noise_of_one_channel_that_lags_behind_another_is_found_and_made_again():
    # Blue is red, two pixels to the right and one down: a correlation that is not the same both ways.
    white = np.random.default_rng(1).standard_normal((288, 384, 3))
    white[..., 2] = np.roll(white[..., 0], (1, 2), axis=(0, 1))
    grain = photograph_grain(Photograph(np.rint(ramp() + 4 * white).astype(np.uint8)))
    assert grain is not None
    assert grain.correlation[0, 2, 3 + 1, 3 + 2] == pytest.approx(1, abs=0.02)
    assert grain.correlation[0, 2, 3 - 1, 3 - 2] == pytest.approx(0, abs=0.02)
    again = grain.draw((384, 288), seed=5)
    assert correlation_of(again, 1, 2)[0, 2] == pytest.approx(1, abs=0.03)
    assert correlation_of(again, -1, -2)[0, 2] == pytest.approx(0, abs=0.03)


def test_grain_put_on_a_clean_picture_measures_as_the_photograph_did():
    values = np.rint(measured().apply(ramp(), seed=3)).astype(np.uint8)
    again = photograph_grain(Photograph(values))
    assert again is not None
    np.testing.assert_allclose(again.deviation, measured().deviation, rtol=0.06)
    assert abs(np.mean(again.deviation / measured().deviation) - 1) < 0.01
    np.testing.assert_allclose(again.correlation, measured().correlation, atol=0.025)


def test_drawn_noise_has_variance_1_and_follows_its_seed():
    noise = measured().draw((300, 200), seed=7)
    assert noise.shape == (200, 300, 3)
    np.testing.assert_allclose(noise.var((0, 1)), 1, rtol=0.03)
    np.testing.assert_array_equal(noise, measured().draw((300, 200), seed=7))
    assert np.abs(np.mean(noise * measured().draw((300, 200), seed=8))) < 0.02


def test_no_share_leaves_a_value_as_it_is_and_the_noise_is_proportional_to_it():
    share = np.zeros((20, 30))
    share[:, 10:20], share[:, 20:] = 0.5, 1
    values = np.full((20, 30, 3), 100.0)
    plain, once = measured().apply(values, share, seed=1) - values, measured().apply(values, seed=1) - values
    np.testing.assert_array_equal(plain[:, :10], 0)
    np.testing.assert_allclose(plain[:, 10:20], 0.5 * once[:, 10:20])
    np.testing.assert_allclose(plain[:, 20:], once[:, 20:])


def test_a_little_noise_is_distinguished_from_rounding():
    # Deviation 0.7: a third of what varies in the rounded picture is rounding, 1/12 of 0.7² + 1/12.
    white = np.random.default_rng(2).standard_normal((288, 384, 3))
    grain = photograph_grain(Photograph(np.rint(ramp() + 0.7 * white).astype(np.uint8)))
    assert grain is not None
    np.testing.assert_allclose(grain.deviation, 0.7, rtol=0.06)
    assert np.abs(grain.correlation[:, :, 3, 4]).max() < 0.03


def test_texture_beside_flat_places_is_not_noise():
    picture = ramp() + deviation(ramp()) * smooth_noise()
    y, x = np.mgrid[:288, :384]
    # Two thirds of the picture are covered with pebbles as strong as the light.
    pebbles = 25 * np.sin(x / 2.5) * np.cos(y / 3.5) * (y > 96)
    grain = photograph_grain(Photograph(np.rint(np.clip(picture + pebbles[..., None], 1, 254)).astype(np.uint8)))
    assert grain is not None
    np.testing.assert_allclose(grain.deviation, deviation(grain.values), rtol=0.15)


def test_a_range_of_brightness_that_is_all_texture_does_not_count():
    picture = ramp() + deviation(ramp()) * smooth_noise()
    y, x = np.mgrid[:288, :384]
    pebbles = 25 * np.sin(x / 2.5) * np.cos(y / 3.5) * (x > 360)
    grain = photograph_grain(Photograph(np.rint(picture + pebbles[..., None]).astype(np.uint8)))
    assert grain is not None
    # Twice the variance of its neighbours is what the brightest range may have.
    assert np.max(grain.deviation / deviation(grain.values)) < 1.5


def test_with_the_clean_picture_at_hand_texture_everywhere_is_no_trouble():
    y, x = np.mgrid[:288, :384]
    wood = ramp() + (8 * np.sin(x / 3 + y / 40))[..., None]
    photograph = Photograph(np.rint(wood + 1.5 * smooth_noise()).astype(np.uint8))
    blind, said = photograph_grain(photograph), photograph_grain(photograph, clean=wood)
    assert blind is not None and said is not None
    np.testing.assert_allclose(said.deviation, 1.5, rtol=0.05)
    assert blind.deviation.mean() > 2 * said.deviation.mean()


def test_beyond_the_brightness_of_flat_patches_the_response_says_how_noise_goes_on():
    steps = np.arange(256)
    said = np.tile(np.sqrt((1 + steps / 60) ** 2 + 1 / 12), (3, 1))
    response = Response(np.tile(np.linspace(-5, 1, 256), (3, 1)), 2 * said)  # a response that is wrong by a factor
    grain = photograph_grain(noisy(), response=response)
    assert grain is not None
    at = np.array([[[20.0, 20, 20], [100, 100, 100], [230, 230, 230]]])
    np.testing.assert_allclose(grain.deviation_at(at)[0], deviation(at)[0], rtol=0.06)


def test_a_photograph_that_shows_nothing_flat_has_the_grain_of_its_response_or_none():
    white = np.zeros((64, 64, 3), np.uint8) + np.uint8(255)
    assert photograph_grain(Photograph(white)) is None
    assert photograph_grain(Photograph(white[:10, :10])) is None
    response = Response(np.tile(np.linspace(-5, 1, 256), (3, 1)), np.array([1.0, 2.0, 3.0]))
    grain = photograph_grain(Photograph(white), response=response)
    assert grain is not None
    np.testing.assert_allclose(grain.deviation_at(np.full(3, 99.0)), np.sqrt(np.array([1, 4, 9]) - 1 / 12))
    assert grain.correlation[1, 1, 3, 3] == 1 and np.count_nonzero(grain.correlation) == 3


def test_the_grain_of_a_radiance_map_is_in_its_unit_and_grows_with_the_root_of_the_light_beyond_it():
    light = ramp() / 10
    noise = 0.05 * np.sqrt(light) * np.random.default_rng(4).standard_normal(light.shape)
    variance = (0.05**2 * light).astype(np.float32)
    clipped = np.zeros(light.shape[:2], np.uint8)
    grain = radiance_grain(RadianceMap((light + noise).astype(np.float32), variance, clipped))
    assert grain is not None
    for brightness in (5.0, 10.0, 15.0, 200.0, 0.2):
        np.testing.assert_allclose(grain.deviation_at(np.full(3, brightness)), 0.05 * np.sqrt(brightness), rtol=0.12)


def test_the_grain_of_a_bracket_is_shown_by_its_other_photographs():
    camera, scene = VirtualCamera(electrons=900.0, read_noise=4.0), wide_scene(256, 192, stops=4.0)
    # Fine texture everywhere: a photograph alone would take it for grain.
    y, x = np.mgrid[:192, :256]
    scene = scene * np.exp(0.1 * np.sin(x / 1.7 + y / 9))[..., None]
    bracket = camera.bracket(scene.astype(np.float32), (0.0025, 0.005, 0.01, 0.02))
    curve = camera.log_exposure()
    curve[:, 0] = curve[:, 1] - 1
    response = Response(curve, np.full(3, 2.0))
    photograph, factor = bracket.photographs[1], float(bracket.exposures[1])
    clean = 255 * np.clip(camera.curve(scene * factor), 0, 1)
    right = photograph_grain(photograph, clean=clean)
    found, blind = bracket_grain(bracket, 1, response), photograph_grain(photograph, response=response)
    assert right is not None and found is not None and blind is not None
    ratio = found.deviation_at(right.values.T) / right.deviation.T
    # Some noise of the others, less exposed or hardly more, is left in what it is compared with.
    assert 0.99 < ratio.min() and ratio.max() < 1.1
    assert (blind.deviation_at(right.values.T) / right.deviation.T).mean() > 1.15
    assert np.abs(found.correlation[:, :, 3, 4]).max() < 0.15


def test_a_bracket_of_one_has_the_grain_of_its_photograph():
    response = Response(np.tile(np.linspace(-5, 1, 256), (3, 1)), np.full(3, 2.0))
    photograph = Photograph(noisy().pixels, exposure=Exposure(1.0))
    grain, alone = bracket_grain(Bracket((photograph,)), 0, response), photograph_grain(photograph, response=response)
    assert grain is not None and alone is not None
    np.testing.assert_array_equal(grain.deviation, alone.deviation)


@pytest.mark.slow
def test_the_grain_of_the_room_is_what_its_photograph_has_beside_the_truth(shared):
    bracket = read_bracket(sorted((shared / "shoots/room/plate").glob("*.jpg")))
    response = recover_response(bracket).response
    plate = merge(bracket, response).radiance
    truth = files.read_radiance(shared / "shoots/room/truth/plate.exr").radiance
    truth = truth * np.median(plate / truth, axis=(0, 1))
    # The third is the one that the developed picture sits in; noise of the others is in the difference to some part.
    for index, most in ((1, 1.05), (2, 1.26)):
        film = Film(float(bracket.exposures[index]), response)
        right = photograph_grain(bracket.photographs[index], clean=film.pixel_values(truth))
        found = bracket_grain(bracket, index, response)
        assert right is not None and found is not None
        ratio = found.deviation_at(right.values.T) / right.deviation.T
        assert 0.97 < ratio.min() and ratio.max() < most
        np.testing.assert_allclose(found.correlation, right.correlation, atol=0.14)


def test_tables_that_do_not_fit_together_are_refused():
    with pytest.raises(ValueError, match=r"correlation is \(3, 3, 5, 5\); expected \(3, 3, 7, 7\)"):
        Grain(np.zeros((3, 2)), np.zeros((3, 2)), np.zeros((3, 3, 5, 5)))
    with pytest.raises(ValueError, match=r"values are \(3, 2\), deviation \(3, 4\)"):
        Grain(np.zeros((3, 2)), np.zeros((3, 4)), np.zeros((3, 3, 7, 7)))
