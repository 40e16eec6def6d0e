"""Virtual photographs: a radiance map through any camera at any exposure is what that camera would have written."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.capture.scale.absolute import Scale, apply_scale
from relume.image.photograph import Exposure
from relume.image.radiance import OUTSIDE, RadianceMap
from relume.image.response import Response
from relume.virtual_camera.film.film import virtual_photograph
from synthetic import STOPS, wide_scene


def power_response(levels: int = 256, *, power: float = 2.2, noise: float = 0.6) -> Response:
    """Exposure (z / largest)^power of value z; white is exposure 1."""
    curve = power * np.log(np.maximum(np.arange(levels), 0.5) / (levels - 1))
    return Response(np.tile(curve, (3, 1)), np.full(3, noise))


def grey(*values: float) -> RadianceMap:
    return RadianceMap(np.repeat(np.array([values], np.float32)[..., None], 3, axis=2))


def test_each_value_is_the_one_whose_exposure_it_is():
    # f/2, 1/4 s and ISO 400: 4 / 4 / 4 = 0.25 of sensor exposure per unit of radiance.
    photograph = virtual_photograph(
        grey(0.0, 4 * 0.2**2.2, 4 * (100 / 255) ** 2.2, 4.0, 400.0), power_response(), Exposure(0.25, 2.0, 400.0)
    )
    assert photograph.pixels[0, :, 1].tolist() == [0, 51, 100, 255, 255] and photograph.pixels.dtype == np.uint8
    assert photograph.exposure == Exposure(0.25, 2.0, 400.0) and photograph.outside is None


def test_sixteen_bits_by_a_response_of_sixteen_bits():
    light = grey(1e-3, 0.5, 1.0, 3.0)
    photograph = virtual_photograph(light, power_response(65536, power=1.0), Exposure(1.0))
    assert photograph.pixels.dtype == np.uint16
    assert photograph.pixels[0, :, 2].tolist() == [66, 32768, 65535, 65535]
    with pytest.raises(ValueError, match="the response has 1024 values; photographs have 256 or 65536"):
        virtual_photograph(light, power_response(1024), Exposure(1.0))


def test_a_virtual_bracket_merges_back_to_the_radiance(calibration):
    scene = RadianceMap(wide_scene())
    frames = [
        virtual_photograph(scene, calibration.response, Exposure(t, 4.0, 200.0), name=f"{t}.png")
        for t in (8 * s for s in STOPS)
    ]
    merged = merge(Bracket(tuple(frames)), calibration.response)
    assert merged.variance is not None
    where = np.isfinite(merged.variance)
    assert where.mean() > 0.8
    error = np.log(merged.radiance[where] / scene.radiance[where])
    assert np.median(np.abs(error)) < 0.005 and abs(error.mean()) < 0.002


def test_another_camera_photographs_the_same_radiance():
    scene, other = RadianceMap(wide_scene(96, 64, stops=5)), power_response(power=1.8)
    photograph = virtual_photograph(scene, other, Exposure(1 / 60))
    # Written down by hand: 255 (E t)^(1/1.8), saturating.
    expected = np.rint(255 * np.minimum(scene.radiance.astype(np.float64) / 60, 1) ** (1 / 1.8))
    difference = np.abs(photograph.pixels.astype(int) - expected)
    # Between two values the logarithm of exposure is interpolated, which bends by less than one value.
    assert difference.max() <= 1 and (difference == 0).mean() > 0.97


def test_calibrated_light_needs_the_scale_of_the_camera():
    scene, response = RadianceMap(wide_scene(48, 32)), power_response()
    scale = Scale((200.0, 210.0, 190.0), 0.1, "a test")
    plain = virtual_photograph(scene, response, Exposure(0.02))
    again = virtual_photograph(apply_scale(scene, scale), response, Exposure(0.02), scale=scale)
    np.testing.assert_array_equal(again.pixels, plain.pixels)
    with pytest.raises(ValueError, match="give the response's scale with a map in cd/m²"):
        virtual_photograph(apply_scale(scene, scale), response, Exposure(0.02))
    with pytest.raises(ValueError, match="and none with a relative one"):
        virtual_photograph(scene, response, Exposure(0.02), scale=scale)


def test_the_noise_is_the_response_s():
    ideal = np.random.default_rng(2).uniform(110, 130, (200, 300, 1))
    for noise in (0.4, 2.5):
        response = power_response(noise=noise)
        light = RadianceMap(
            np.exp(np.interp(ideal, np.arange(256), response.log_exposure[0]) + np.zeros(3)).astype(np.float32)
        )
        pixels = virtual_photograph(light, response, Exposure(1.0), noise=np.random.default_rng(1)).pixels
        # Its deviation holds the rounding, too. 60 000 values: the deviation is known to 0.3 %.
        error = pixels[..., 1] - ideal[..., 0]
        assert error.std() == pytest.approx(noise, rel=0.01) and abs(error.mean()) < 0.03
    # Noise that grows with the value, as photons' does.
    light = RadianceMap(np.full((200, 300, 3), (120 / 255) ** 2.2, np.float32))
    growing = replace(power_response(), noise=np.tile(np.linspace(0.5, 4.5, 256), (3, 1)))
    pixels = virtual_photograph(light, growing, Exposure(1.0), noise=np.random.default_rng(1)).pixels
    assert pixels[..., 2].std() == pytest.approx(0.5 + 4 * 120 / 255, rel=0.01)


def test_the_same_seed_gives_the_same_pixels_and_white_has_no_noise():
    light = grey(*np.linspace(0, 2, 500))
    one, same, other = (
        virtual_photograph(light, power_response(noise=5.0), Exposure(1.0), noise=np.random.default_rng(s)).pixels
        for s in (7, 7, 8)
    )
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()
    assert (one[:, light.radiance[0, :, 0] >= 1] == 255).all()


def test_what_is_outside_the_map_is_outside_the_photograph():
    clipped = np.zeros((6, 8), np.uint8)
    clipped[:2] = OUTSIDE
    scene = RadianceMap(np.full((6, 8, 3), 0.5, np.float32), clipped=clipped)
    photograph = virtual_photograph(scene, power_response(), Exposure(1.0), noise=np.random.default_rng(1))
    assert photograph.outside is not None
    np.testing.assert_array_equal(photograph.outside, clipped == OUTSIDE)
    assert photograph.pixels[:2].max() == 0 and photograph.pixels[2:].min() > 100


def windows() -> RadianceMap:
    """A dark church (H, W) with two windows, a thousand times as bright as the film can show beside the walls."""
    scene = np.full((60, 200, 3), 0.05)
    scene[20:40, 60:70] = (300.0, 260.0, 200.0)
    scene[10:16, 140:143] = (90.0, 80.0, 70.0)
    return RadianceMap(scene.astype(np.float32))


def test_motion_blur_of_radiance_saturates_where_that_of_a_photograph_does_not():
    # The paper's Fig. 9: a 37×1 box, on a photograph (a) and on the radiance map that is then photographed (b).
    response, exposure, scene = power_response(), Exposure(1.0), windows()
    photograph = virtual_photograph(scene, response, exposure).pixels
    muddy = uniform_filter1d(photograph.astype(np.float64), 37, axis=1)
    moved = replace(scene, radiance=uniform_filter1d(scene.radiance, 37, axis=1))
    crisp = virtual_photograph(moved, response, exposure).pixels
    # (b) The window, ten pixels wide, saturates over all 46 that its blur covers, and its edges are one pixel wide.
    assert (crisp[30, :, 1] == 255).sum() == 46 and crisp[30, 42, 1] == 255 and crisp[30, 41, 1] < 80
    # (a) Clamped to 255 before, it never reaches white again.
    assert muddy[30, :, 1].max() < 150 and (muddy[30, :, 1] > 250).sum() == 0
    # Away from the windows the two are the same: the tones are those of one camera.
    np.testing.assert_allclose(crisp[50, 20:180], muddy[50, 20:180], atol=1)
    # The box keeps the radiance's light, so a longer lens shutter would have seen this.
    assert moved.radiance.sum() == pytest.approx(scene.radiance.sum(), rel=1e-4)
