"""Painted environments: what the values of a painting mean, and parts that are brighter than paint."""

import numpy as np
import pytest

from relume.image.photograph import Photograph
from relume.probe.painting import HotSpot, environment_from_painting, read_gamma
from relume.sphere.mappings.discs import Angular

GREY = Photograph(np.full((4, 8, 3), 128, np.uint8), "grey.png")
MASK = np.zeros((4, 8))
MASK[1, 2], MASK[1, 3] = 1.0, 0.5


def test_a_gamma_raises_values_to_its_power_and_white_is_as_bright_as_given():
    assert environment_from_painting(GREY, 2.2).radiance[0, 0, 0] == pytest.approx((128 / 255) ** 2.2, rel=1e-6)
    assert environment_from_painting(GREY, "srgb").radiance[0, 0, 0] == pytest.approx(0.215861, rel=1e-5)
    white = Photograph(np.full((4, 8, 3), 65535, np.uint16))
    light = environment_from_painting(white, 1.8, (1.0, 2.0, 300.0), unit="cd/m²")
    assert light.radiance[3, 7].tolist() == [1, 2, 300] and light.unit == "cd/m²"


def test_a_hot_spot_of_given_radiance_replaces_the_paint_and_its_soft_edge_mixes_logarithms():
    light = environment_from_painting(GREY, 1.0, hot=[HotSpot(MASK, radiance=(1000.0, 500.0, 250.0))])
    paint_value = 128 / 255
    np.testing.assert_allclose(light.radiance[1, 2], [1000, 500, 250], rtol=1e-5)
    np.testing.assert_allclose(light.radiance[1, 3], np.sqrt(paint_value * np.array([1000, 500, 250])), rtol=1e-5)
    assert light.radiance[0, 0, 0] == pytest.approx(paint_value)


def test_a_factor_keeps_the_detail_and_spots_follow_each_other():
    picture = GREY.pixels.copy()
    picture[1, 2] = [255, 128, 0]
    light = environment_from_painting(
        Photograph(picture), 1.0, hot=[HotSpot(MASK, factor=16.0), HotSpot(MASK, factor=2.0)]
    )
    np.testing.assert_allclose(light.radiance[1, 2], [32, 32 * 128 / 255, 0], rtol=1e-6)
    np.testing.assert_allclose(light.radiance[1, 3], np.sqrt(32) * 128 / 255, rtol=1e-6)


def test_black_that_a_factor_is_to_raise_is_counted():
    picture = GREY.pixels.copy()
    picture[1, 2] = 0
    picture[0, 0] = 0  # beside the mask
    with pytest.warns(UserWarning, match=r"sun\.png: 1 pixels of sky\.png are black there, and stay so times 1024;"):
        light = environment_from_painting(
            Photograph(picture, "sky.png"), 1.0, hot=[HotSpot(MASK, factor=1024.0, name="sun.png")]
        )
    assert light.radiance[1, 2].max() == 0


def test_a_mask_is_read_from_a_picture_and_stops_are_powers_of_two():
    picture = np.zeros((4, 8, 3), np.uint8)
    picture[1, 2] = 255
    spot = HotSpot.of_picture(Photograph(picture, "sun.png"), stops=3)
    assert spot.factor == 8 and spot.name == "sun.png" and spot.mask.sum() == 1
    assert environment_from_painting(GREY, 1.0, hot=[spot]).radiance[1, 2, 0] == pytest.approx(8 * 128 / 255)


def test_black_paint_is_raised_too_and_stays_black_outside_the_mask():
    black = Photograph(np.zeros((4, 8, 3), np.uint8))
    light = environment_from_painting(black, 2.2, hot=[HotSpot(MASK, radiance=9.0)])
    assert light.radiance[1, 2, 0] == pytest.approx(9) and light.radiance[0, 0, 0] == 0
    assert 0 < light.radiance[1, 3, 0] < 0.1
    with pytest.warns(UserWarning, match="black all over"):
        environment_from_painting(black, 2.2)


def test_another_mapping_can_be_given():
    square = Photograph(np.full((8, 8, 3), 128, np.uint8))
    assert environment_from_painting(square, 2.2, mapping=Angular()).mapping.name == "angular"


@pytest.mark.parametrize("text", ["2.2", " sRGB ", "1"])
def test_a_gamma_is_a_number_or_srgb(text: str):
    assert read_gamma(text) in (2.2, "srgb", 1.0)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: read_gamma(None, "sky.png"), "sky.png: a painting does not say how bright its values are"),
        (lambda: read_gamma("bright"), '"bright" is no display gamma'),
        (lambda: read_gamma("-1"), '"-1" is no display gamma'),
        (lambda: environment_from_painting(GREY, -2.2), "gamma is -2.2"),
        (lambda: environment_from_painting(GREY, 2.2, 0.0), "white is 0.0"),
        (
            lambda: environment_from_painting(Photograph(np.ones((4, 7, 3), np.uint8), "odd.png"), 2.2),
            "odd.png is 7×4 pixels",
        ),
        (
            lambda: environment_from_painting(GREY, 2.2, hot=[HotSpot(np.ones((4, 4)), factor=2)]),
            "hot spot is 4×4 pixels, grey.png 8×4",
        ),
        (lambda: HotSpot(MASK), "give either a factor or a radiance"),
        (lambda: HotSpot(MASK, factor=2, radiance=3), "give either a factor or a radiance"),
        (lambda: HotSpot(MASK, radiance=-3), "expected a number above 0"),
        (lambda: HotSpot(MASK + 1, factor=2), "numbers from 0 to 1"),
    ],
)
def test_what_is_no_painting_is_refused_in_a_line(call, line):
    with pytest.raises(ValueError) as caught:
        call()
    assert line in str(caught.value) and "\n" not in str(caught.value)
