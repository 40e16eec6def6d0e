"""The absolute scale: each source of cd/m² gives the factor that its definition says, with its uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from relume.capture.scale.absolute import (
    SATURATION,
    Scale,
    apply_scale,
    combine_scales,
    scale_from_exposure,
    scale_from_illuminance,
    scale_from_lux,
    scale_from_saturation,
    scale_from_spot,
)
from relume.capture.scale.regions import disc, measured_patch, rectangle, spot_radius
from relume.errors import NotABracket
from relume.image.colour import decode_srgb, luminance
from relume.image.photograph import Exposure
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response
from relume.sphere.environment_map import EnvironmentMap

DAYLIGHT = Exposure(1 / 125, 8.0, 200.0)


def srgb_response(levels: int = 256, gain: float = 1.0) -> Response:
    """Of a camera that encodes by sRGB, exposure `gain` at white."""
    linear = gain * decode_srgb(np.maximum(np.arange(levels), 0.5) / (levels - 1))
    return Response(np.tile(np.log(linear), (3, 1)), np.ones(3))


def picture(width: int = 40, height: int = 30, *, noise: float = 0.0) -> RadianceMap:
    """A grey ramp of relative radiance 1 to 2 from left to right, bluish in its lower half."""
    ramp = np.broadcast_to(np.linspace(1, 2, width)[None, :, None], (height, width, 3)).copy()
    ramp[height // 2 :] *= (0.5, 1.0, 2.0)
    ramp *= 1 + noise * np.random.default_rng(4).standard_normal(ramp.shape)
    clipped = np.zeros((height, width), np.uint8)
    return RadianceMap(ramp.astype(np.float32), (noise * ramp).astype(np.float32) ** 2, clipped)


# ISO 12232, worked by hand ------------------------------------------------------------------------------------------


def test_the_standard_output_sensitivity_sets_the_scale_of_a_jpeg():
    # The camera shows value 118 at H = 10/S = 0.05 lx·s, which is L = H N² / (q t) = 0.05 · 64 · 125 / 0.65.
    shown = 0.05 * 64 * 125 / 0.65
    assert shown == pytest.approx(615.38, rel=1e-4)
    # Its relative radiance there is f⁻¹(118) / (t S/100 / N²): linear sRGB 118 is 0.1812.
    relative = decode_srgb(np.array(118 / 255)) / (2.0 / 125 / 64)
    scale = scale_from_exposure(srgb_response(), DAYLIGHT)
    assert scale.luminance == pytest.approx(shown / relative, rel=1e-9)
    assert scale.factor == (scale.factor[0],) * 3 and scale.deviation == pytest.approx(np.log(2) / 3)
    # The scale holds for all settings: they are in the relative radiance already.
    assert scale_from_exposure(srgb_response(), Exposure(2.0, 2.8, 800.0)).factor == pytest.approx(scale.factor)


def test_the_scale_undoes_whatever_zero_the_response_has():
    one, other = scale_from_exposure(srgb_response(), DAYLIGHT), scale_from_exposure(srgb_response(gain=7.0), DAYLIGHT)
    assert one.luminance == pytest.approx(7 * other.luminance, rel=1e-12)
    sixteen = scale_from_exposure(srgb_response(65536), DAYLIGHT)
    assert sixteen.luminance == pytest.approx(one.luminance, rel=1e-3)


def test_the_saturation_based_speed_sets_the_scale_of_raw_values():
    # 78/S saturates: 78/200 · 64 · 125 / 0.65 cd/m² at relative radiance saturation / (t S/100 / N²).
    shown, relative = 78 / 200 * 64 * 125 / 0.65, 0.8 / (2.0 / 125 / 64)
    assert scale_from_saturation(0.8, DAYLIGHT).luminance == pytest.approx(shown / relative, rel=1e-12)
    linear = Response(np.tile(np.log(np.maximum(np.arange(256), 0.5) * 0.8 / 255), (3, 1)), np.ones(3))
    assert scale_from_exposure(linear, DAYLIGHT, rating=SATURATION).luminance == pytest.approx(shown / relative)


def test_the_scale_agrees_with_an_incident_light_meter():
    # By ISO 2720 (C = 250) the meter says f/16 and 1/100 s at ISO 100 under E = C N² / (S t) = 64 000 lx, where a grey
    # card has 0.18 E / π; the photograph shows it at middle grey, 118, within a third of a stop.
    response, exposure = srgb_response(), Exposure(1 / 100, 16.0, 100.0)
    relative = np.exp(response.log_exposure[0, 118]) / exposure.factor
    card = 0.18 * 250 * 16**2 / np.pi
    assert abs(np.log2(relative * scale_from_exposure(response, exposure).luminance / card)) < 1 / 3


def test_unknown_aperture_or_iso_gives_no_scale():
    with pytest.raises(NotABracket, match=r"a photograph of 0\.5 s has no f-number"):
        scale_from_exposure(srgb_response(), [DAYLIGHT, Exposure(0.5, None, 100.0)])
    with pytest.raises(NotABracket, match="has no ISO"):
        scale_from_saturation(1.0, Exposure(0.5, 2.8))
    with pytest.raises(ValueError, match="saturation is 0"):
        scale_from_saturation(0.0, DAYLIGHT)


# Readings -----------------------------------------------------------------------------------------------------------


def test_a_spot_reading_is_compared_with_the_mean_of_its_disc():
    scene = picture()
    scale = scale_from_spot(scene, 20, 7, 300.0, radius=3.0, deviation=0.0)
    # The disc lies evenly about column 20, whose radiance is 1 + 20/39.
    assert scale.luminance == pytest.approx(300 / (1 + 20 / 39), rel=1e-6)
    assert scale.source == "a spot-meter reading at 20, 7"
    assert scale_from_spot(scene, 3, 22, 10.0, radius=0.0).luminance == pytest.approx(
        10 / float(luminance(scene.radiance[22, 3].astype(np.float64))), rel=1e-6
    )


def test_the_uncertainty_of_a_reading_is_meter_noise_and_unevenness():
    flat = RadianceMap(np.ones((30, 40, 3), np.float32), np.full((30, 40, 3), 0.04, np.float32))
    region = disc((40, 30), 20, 15, 4.0)
    # Flat but for noise that the variance says of: 0.2 √(Σw²) / √n, w the luminance weights.
    expected = 0.2 * np.linalg.norm([0.2126, 0.7152, 0.0722]) / np.sqrt(region.sum())
    assert measured_patch(flat, region).uncertainty == pytest.approx(expected, rel=1e-6)
    # On a ramp the unevenness is what moving the spot by half its radius changes.
    patch = measured_patch(picture(), disc((40, 30), 20, 7, 6.0))
    moved = measured_patch(picture(), disc((40, 30), 23, 7, 6.0)).luminance
    assert patch.unevenness == pytest.approx(moved / patch.luminance - 1, rel=0.05)
    scale = scale_from_spot(picture(), 20, 7, 300.0, radius=6.0, deviation=0.03)
    assert scale.deviation == pytest.approx(np.hypot(0.03, patch.uncertainty))


def test_noise_that_the_variance_explains_is_no_unevenness():
    noisy = picture(400, 60, noise=0.1)
    region = np.zeros((60, 400), bool)
    region[:30, 100:110] = True
    assert measured_patch(noisy, region).unevenness < 0.05
    assert measured_patch(replace(noisy, variance=None), region).unevenness > 0.06


def test_a_lux_reading_at_a_card():
    region = rectangle((40, 30), 10, 2, 1, 8)
    scale = scale_from_lux(picture(), region, 500.0, reflectance=0.18)
    # A matte card of 18 % under 500 lx has 0.18 · 500 / π = 28.65 cd/m².
    assert scale.luminance == pytest.approx(28.648 / (1 + 10 / 39), rel=1e-4)
    assert scale_from_lux(picture(), region, 500.0, reflectance=0.9).luminance == pytest.approx(5 * scale.luminance)
    for reflectance in (0.0, 1.2):
        with pytest.raises(ValueError, match="expected a number above 0 and up to 1"):
            scale_from_lux(picture(), region, 500.0, reflectance=reflectance)


def test_a_lux_reading_where_the_light_was_captured():
    # Even light of radiance 2 brings 2π on any plane; a sky over black ground brings it on the table only.
    even = EnvironmentMap(np.full((64, 128, 3), 2.0, np.float32))
    assert scale_from_illuminance(even, 1000.0).luminance == pytest.approx(1000 / (2 * np.pi), rel=1e-3)
    sky = even.radiance.copy()
    sky[32:] = 0
    half = EnvironmentMap(sky)
    assert scale_from_illuminance(half, 1000.0).luminance == pytest.approx(1000 / (2 * np.pi), rel=1e-3)
    assert scale_from_illuminance(half, 1000.0, normal=(5.0, 0.0, 0.0)).luminance == pytest.approx(
        1000 / np.pi, rel=1e-3
    )
    with pytest.raises(ValueError, match="no light of the map reaches that plane"):
        scale_from_illuminance(EnvironmentMap(np.zeros((4, 8, 3), np.float32)), 100.0)


@pytest.mark.parametrize("mark", [SATURATED, BLACK, OUTSIDE])
def test_a_place_that_was_not_measured_is_refused(mark):
    scene = picture()
    assert scene.clipped is not None
    scene.clipped[8, 21] = mark
    with pytest.raises(
        ValueError, match="1 of the region's 49 pixels are clipped or outside, the first in column 21, row 8"
    ):
        scale_from_spot(scene, 20, 7, 300.0, radius=4.0)
    scale_from_spot(scene, 30, 7, 300.0, radius=4.0)


def test_a_map_whose_variance_alone_shows_clipping_is_refused_too():
    scene = replace(picture(), clipped=None)
    assert scene.variance is not None
    scene.variance[7, 20, 2] = np.inf
    with pytest.raises(ValueError, match="column 20, row 7"):
        scale_from_spot(scene, 20, 7, 300.0)


def test_a_wrong_place_or_reading_is_refused():
    with pytest.raises(ValueError, match="pixel 40, 7 is not in a picture of 40×30"):
        scale_from_spot(picture(), 40, 7, 300.0)
    with pytest.raises(ValueError, match="reading is -3"):
        scale_from_spot(picture(), 20, 7, -3.0)
    with pytest.raises(ValueError, match="region is empty"):
        scale_from_lux(picture(), np.zeros((30, 40), bool), 500.0)
    with pytest.raises(ValueError, match=r"region is \(3, 3\) bool; expected \(30, 40\) bool"):
        scale_from_lux(picture(), np.ones((3, 3), bool), 500.0)
    with pytest.raises(ValueError, match="rectangle 35, 0, 10×5 is not in a picture of 40×30"):
        rectangle((40, 30), 35, 0, 10, 5)
    dark = RadianceMap(np.zeros((30, 40, 3), np.float32))
    with pytest.raises(ValueError, match="mean luminance is 0; choose one that is lit"):
        scale_from_spot(dark, 20, 7, 300.0)


def test_discs_and_rectangles_lie_where_they_say():
    spot = disc((9, 7), 6, 2, 1.0)
    assert [tuple(p) for p in np.argwhere(spot)] == [(1, 6), (2, 5), (2, 6), (2, 7), (3, 6)]
    box = rectangle((9, 7), 1, 4, 3, 2)
    assert box.shape == (7, 9) and box.sum() == 6 and box[4:6, 1:4].all()
    # A 1° field of a lens of 3000 pixels' focal length: 3000 · tan 0.5° = 26.2.
    assert spot_radius(3000.0) == pytest.approx(26.18, abs=0.01)


# Using the scale ----------------------------------------------------------------------------------------------------


def test_a_calibrated_map_is_in_candelas_with_its_variance():
    scene = picture(noise=0.1)
    result = apply_scale(scene, Scale((2.0, 3.0, 5.0), 0.1, "a test"))
    assert result.unit == "cd/m²" and scene.unit == "relative"
    np.testing.assert_allclose(result.radiance, scene.radiance * np.array([2, 3, 5]), rtol=1e-6)
    assert result.variance is not None and scene.variance is not None
    np.testing.assert_allclose(result.variance, scene.variance * np.array([4, 9, 25]), rtol=1e-6)
    assert result.clipped is scene.clipped
    # 0.2126 · 2 + 0.7152 · 3 + 0.0722 · 5
    assert result.attributes == {"scale": "2.932 cd/m² ± 10 % per relative unit, from a test"}


def test_a_spot_reads_what_it_was_calibrated_with():
    scene = picture()
    result = apply_scale(scene, scale_from_spot(scene, 12, 20, 123.0))
    assert measured_patch(result, disc(scene.size, 12, 20, 4.0)).luminance == pytest.approx(123.0, rel=1e-6)


def test_a_calibrated_map_is_not_calibrated_again():
    scale = Scale.grey(2.0, 0.1, "a test")
    result = apply_scale(picture(), scale)
    with pytest.raises(ValueError, match="in cd/m² already"):
        apply_scale(result, scale)
    again = apply_scale(replace(result, unit="relative"), scale)
    assert again.radiance[0, 0, 0] == pytest.approx(4 * picture().radiance[0, 0, 0])


def test_two_sources_are_combined_by_their_certainty():
    rough, fine = Scale.grey(100.0, 0.2, "the exposure"), Scale.grey(121.0, 0.05, "a spot")
    both = combine_scales([rough, fine])
    # ln factors weighted 25 : 400.
    assert np.log(both.luminance) == pytest.approx((25 * np.log(100) + 400 * np.log(121)) / 425)
    assert both.deviation == pytest.approx(425**-0.5) and both.source == "the exposure and a spot"
    assert combine_scales([rough]) == rough


def test_sources_that_disagree_are_named_and_make_the_scale_less_sure():
    one, other = Scale.grey(100.0, 0.05, "a spot"), Scale.grey(200.0, 0.05, "a lux reading")
    with pytest.warns(UserWarning, match="a spot and a lux reading disagree by 1.00 stops, more than the 0.20"):
        both = combine_scales([one, other])
    assert both.luminance == pytest.approx(np.sqrt(2e4))
    # Two values a ln 2 apart: their mean is known to half of that, not to 0.05/√2.
    assert both.deviation == pytest.approx(np.log(2) / 2)
    with pytest.raises(ValueError, match="no scales"):
        combine_scales([])


def test_a_scale_that_cannot_be_is_refused():
    for factor, deviation in (((0.0, 1.0, 1.0), 0.1), ((1.0, 1.0, np.nan), 0.1), ((1.0, 1.0, 1.0), -0.1)):
        with pytest.raises(ValueError, match=r"(factor|deviation) is"):
            Scale(factor, deviation, "a test")
