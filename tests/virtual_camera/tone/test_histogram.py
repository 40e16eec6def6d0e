"""Histogram adjustment: what `pcond` gives, what the paper promises, and what must not happen."""

import os
from itertools import pairwise

import numpy as np
import pytest

from relume.image.colour import luminance
from relume.virtual_camera.protocols import Adaptation, ToneOperator
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.histogram import adjustment as histogram
from relume.virtual_camera.tone.histogram import eye
from relume.virtual_camera.tone.histogram.adjustment import HistogramAdjustment
from relume.virtual_camera.tone.histogram.curve import DARKEST, FINE, HumanContrast, LinearContrast, fine_edges, gains
from relume.virtual_camera.tone.vision import threshold
from relume.virtual_camera.view import View

FOCAL_LENGTH = 40 / np.tan(np.radians(20))


def bars(scale=1.0):
    """Grey (60, 80, 3) and its view, 40° wide: bars an octave apart with a pattern, and a lamp, each exact in RGBE."""
    y, x = np.mgrid[:60, :80]
    exponent = np.where((x - 60) ** 2 + (y - 15) ** 2 < 36, 146, 118 + x // 5 + y // 20)
    grey = (128 + (7 * x + 11 * y) % 128 + 0.5) * np.exp2(exponent - 136.0)
    return np.repeat(grey[..., None], 3, -1).astype(np.float32), View(FOCAL_LENGTH, scale)


def developed(picture, view, operator):
    return operator.display_values(picture, view, operator.adapt(picture, view))


PLACES = ([5, 50, 25, 45, 10, 30, 55, 15], [2, 12, 22, 37, 47, 63, 77, 60])


@pytest.mark.parametrize(
    ("operator", "scale", "wanted", "within"),
    [
        (
            HistogramAdjustment(),
            1,
            [0.000507, 0.020752, 0.024292, 0.119141, 0.103027, 0.269531, 0.871094, 0.960938],
            0.013,
        ),
        (
            HistogramAdjustment(contrast=HumanContrast()),
            1,
            [0.000629, 0.019531, 0.023438, 0.088867, 0.081543, 0.188477, 0.839844, 0.949219],
            0.013,
        ),
        (
            HistogramAdjustment(contrast=HumanContrast()),
            0.01,
            [2.6e-05, 0.000538, 0.000744, 0.016602, 0.012573, 0.144531, 4.375, 7264.0],
            0.02,
        ),
        (
            HistogramAdjustment(centre_weighted=True),
            1,
            [0.0005, 0.020508, 0.024048, 0.119141, 0.103027, 0.271484, 0.871094, 0.960938],
            0.013,
        ),
        (
            HistogramAdjustment(DisplayRange(250, 0.5)),
            1,
            [0.000137, 0.00705, 0.008423, 0.060547, 0.050293, 0.175781, 0.832031, 0.945312],
            0.013,
        ),
    ],
    ids=["plain", "human contrast", "too dark to need a curve", "centre-weighted", "another screen"],
)
def test_it_is_what_pcond_shows(operator, scale, wanted, within):
    # Pixels of Radiance's `pcond`, run with no option, -s, -s, -w, and -u 250 -d 500. RGBE alone is good for 0.4 %.
    picture, view = bars(scale)
    np.testing.assert_allclose(developed(picture, view, operator)[PLACES][:, 1], wanted, rtol=within, atol=5e-6)


@pytest.mark.parametrize(
    "operator", [HistogramAdjustment(veil=True), HistogramAdjustment.human()], ids=["veil", "human"]
)
def test_the_veil_is_nearly_that_of_pcond(operator, monkeypatch):
    # `pcond -v`, and -h, which in this light is the same. Its veil has 0.08 of the light where the paper's has 0.087,
    # and its samples weigh the same off the axis; beyond the middles of the outermost it extrapolates.
    monkeypatch.setattr(eye, "SHARE", 0.08)
    monkeypatch.setattr(histogram, "SHARE", 0.08)
    picture, view = bars()
    wanted = [0.071777, 0.186523, 0.205078, 0.695312, 0.601563, 0.458984, 0.957031]
    np.testing.assert_allclose(developed(picture, view, operator)[PLACES][1:, 1], wanted, rtol=0.03)


def test_it_is_a_tone_and_says_whether_it_needs_absolute_luminance():
    operator: ToneOperator = HistogramAdjustment()
    assert not operator.absolute and not HistogramAdjustment(veil=True).absolute
    assert HistogramAdjustment(contrast=HumanContrast()).absolute and HistogramAdjustment(colour=True).absolute
    assert HistogramAdjustment.human().absolute


def slow_luminances(picture, view):
    """What the operator takes as samples: pixels, and the plain mean of every sample's pixels."""
    light = luminance(picture.astype(float)) * view.luminance_scale
    rows, columns = (round(side / (view.focal_length * np.radians(1))) for side in light.shape)
    starts = [-(-np.arange(n) * side // n) for n, side in zip((rows, columns), light.shape, strict=True)]
    sums = [np.add.reduceat(np.add.reduceat(a, starts[0], 0), starts[1], 1) for a in (light, np.ones_like(light))]
    return light, sums[0] / sums[1]


def test_the_samples_are_counted_as_slowly():
    picture = np.random.default_rng(4).lognormal(0, 2, (90, 120, 3)).astype(np.float32)
    view = View(150.0, 3.0)
    values = HistogramAdjustment().adapt(picture, view).values
    light, fovea = slow_luminances(picture, view)
    unit = np.exp(np.log(light).mean())
    edges = fine_edges()[FINE.start : FINE.stop + 1] * unit
    shares = np.histogram(light, edges)[0] / light.size / 2 + np.histogram(fovea, edges)[0] / fovea.size / 2
    # A luminance within rounding of an edge may fall on either side.
    assert np.abs(np.cumsum(values[4:]) - np.cumsum(shares)).max() < 3 / fovea.size
    assert np.abs(values[4:] - shares).sum() < 0.02
    np.testing.assert_allclose(values[[0, 2, 3]], np.log([unit, light.min() / unit, light.max() / unit]), atol=1e-5)
    # A bin is 1/128 octave, and its logarithm that of its middle.
    assert values[1] == pytest.approx(np.log(fovea / unit).mean() / 2, abs=1e-3)
    assert values[4:].sum() == pytest.approx(1)


def test_the_kernel_applies_the_curve_as_slowly():
    picture = np.random.default_rng(5).lognormal(0, 3, (40, 50, 3)).astype(np.float32)
    view, operator = View(90.0, 7.0), HistogramAdjustment()
    settled = operator.adapt(picture, view)
    light = luminance(picture.astype(float)) * 7
    unit = np.exp(np.log(light).mean())
    _, mean, darkest, brightest, *_ = settled.values
    table = gains(settled.values[4:], mean, darkest, brightest, operator.screen, operator.contrast)
    wanted = picture * np.interp(light / unit, fine_edges(), table)[..., None] * 7 / unit
    np.testing.assert_allclose(operator.display_values(picture, view, settled), wanted, rtol=1e-4)


def ramp(decades=6, width=600):
    grey = np.logspace(-decades / 2, decades / 2, width, dtype=np.float32)
    return np.repeat(np.broadcast_to(grey, (100, width))[..., None], 3, -1), View(400.0)


@pytest.mark.parametrize("contrast", [LinearContrast(), HumanContrast()])
def test_no_contrast_is_beyond_the_ceiling_but_for_the_tolerance(contrast):
    # eqs. 5 and 7: of the curve's whole length at most 2.5 % may be above it, and a little for the bins.
    picture, view = ramp()
    picture[:, 200:320] = np.linspace(0.1, 0.11, 120, dtype=np.float32)[
        :, None
    ]  # A crowd that equalization would spread.
    shown = developed(picture, view, HistogramAdjustment(contrast=contrast))[0, :, 1] * 99 + 1
    order = np.argsort(picture[0, :, 1])
    world, shown = picture[0, order, 1].astype(float), shown[order].astype(float)
    middle = np.sqrt(world[1:] * world[:-1]), np.sqrt(shown[1:] * shown[:-1])
    ceiling = contrast.slope(*middle) * np.diff(np.log(world))
    above = np.maximum(np.diff(np.log(shown)) - ceiling, 0).sum() / np.log(100)
    assert above < 0.035
    assert np.all(np.diff(shown) >= -1e-4)


def test_the_human_ceiling_hides_what_is_below_threshold_in_the_dark():
    dark, view = ramp(4)
    dark = dark * np.float32(1e-3)
    view = View(view.focal_length, 1.0)
    plain, human = (
        developed(dark, view, HistogramAdjustment(contrast=contrast))[0, :, 1]
        for contrast in (LinearContrast(), HumanContrast())
    )
    step = human[60] / human[10]
    assert step < plain[60] / plain[10]
    assert threshold(np.array(1.0)) / 1.0 < threshold(np.array(1e-4)) / 1e-4


def test_a_scene_that_fits_the_screen_is_only_exposed():
    picture = np.random.default_rng(6).uniform(1, 20, (50, 70, 3)).astype(np.float32)
    view = View(100.0, 5.0)
    factor = developed(picture, view, HistogramAdjustment()) / picture
    np.testing.assert_allclose(factor, factor[0, 0, 0], rtol=1e-5)
    # The log mean of all samples is shown at the screen's, 10 of 1 to 100 cd/m².
    light, fovea = slow_luminances(picture, view)
    mean = np.exp((np.log(light).mean() + np.log(fovea).mean()) / 2)
    assert factor[0, 0, 0] == pytest.approx(10 / mean / 100 * 5, rel=2e-3)


@pytest.mark.parametrize("factor", [64.0, 3.7, 1e-7, 1e-25, 1e8, 1e10])
@pytest.mark.parametrize("veil", [False, True])
def test_linear_contrast_does_not_ask_for_the_unit(factor, veil):
    (picture, view), operator = ramp(), HistogramAdjustment(veil=veil)
    wanted = developed(picture, view, operator)
    scaled = developed(picture, View(view.focal_length, factor), operator)
    np.testing.assert_allclose(scaled, wanted, rtol=1e-4, atol=1e-6)
    multiplied = developed(picture * np.float32(factor), view, operator)
    np.testing.assert_allclose(multiplied, wanted, rtol=1e-4, atol=1e-6)


def test_a_sun_beyond_what_an_eye_can_say_is_the_screens_white():
    # Grey of 1e6 to 1e7 cd/m² fits the screen; with the sun it does not, which is white and leaves the rest its place.
    (picture, view), operator = ramp(1), HistogramAdjustment(contrast=HumanContrast())
    scene = picture * np.float32(3e6)
    without = developed(scene, view, operator)
    scene[50, 300] = 1.6e9
    with_sun = developed(scene, view, operator)
    assert with_sun[50, 300] == pytest.approx(np.ones(3), abs=1e-4) and with_sun.max() < 1.001
    assert 0.05 < np.median(without) < 0.3 and np.median(with_sun) > 0.05
    # All of it beyond: in proportion, its own log mean in the middle.
    beyond = developed(picture * np.float32(1e9), view, operator)
    np.testing.assert_allclose(beyond / picture, (beyond / picture)[0, 0, 0], rtol=1e-5)
    assert 0.05 < np.median(beyond) < 0.3


def test_a_flicker_of_the_unit_settles_by_equal_ratios():
    # A camera that says no unit, and whose exposure jumps by 8: on the way each frame is as bright as asked.
    (picture, view), operator = ramp(), HistogramAdjustment()
    one, eight = operator.adapt(picture, view), operator.adapt(picture * np.float32(8), view)
    np.testing.assert_allclose(one.values[1:], eight.values[1:], atol=2e-5)
    assert eight.values[0] - one.values[0] == pytest.approx(np.log(8), abs=1e-6)


def test_colours_are_lost_in_the_dark_alone():
    scene = np.random.default_rng(9).uniform(0.5, 2, (40, 50, 3)).astype(np.float32)
    operator = HistogramAdjustment(colour=True)
    for scale, kept in ((1e-4, 0.0), (1000.0, 1.0)):
        view = View(60.0, scale)
        plain, seen = developed(scene, view, HistogramAdjustment()), developed(scene, view, operator)
        spread, left = (np.ptp(values, axis=2).mean() / values.mean() for values in (plain, seen))
        assert spread > 0.3 and left == pytest.approx(kept * spread, abs=1e-4)


def test_colours_keep_their_proportions():
    picture, view = ramp()
    picture = picture * np.array([1.0, 0.5, 0.1], np.float32)
    seen = developed(picture, view, HistogramAdjustment())
    np.testing.assert_allclose(seen[..., 1], seen[..., 0] / 2, rtol=1e-5)
    np.testing.assert_allclose(seen[..., 2], seen[..., 0] / 10, rtol=1e-5)


@pytest.mark.parametrize("operator", [HistogramAdjustment(), HistogramAdjustment.human()], ids=["plain", "human"])
def test_black_stays_black_and_one_value_is_shown_in_the_middle(operator):
    black, view = np.zeros((20, 30, 3), np.float32), View(40.0)
    assert not developed(black, view, operator).any()
    assert np.all(operator.adapt(black, view).values[2:4] == np.log(DARKEST))
    grey = developed(np.full((20, 30, 3), 300.0, np.float32), view, operator)
    assert np.ptp(grey) < 1e-6 and 0.02 < grey[0, 0, 0] < 0.5
    beyond = developed(np.full((20, 30, 3), 1e9, np.float32), view, operator)
    assert np.ptp(beyond) < 1e-6 and 0.02 < beyond[0, 0, 0] < 0.5


def test_black_pixels_beside_light_stay_black():
    picture, view = ramp()
    picture[20:40] = 0
    seen = developed(picture, view, HistogramAdjustment())
    assert not seen[20:40].any() and seen[60:].all()


def test_the_input_stays_as_it_was():
    picture, view = bars(0.01)
    before = picture.copy()
    for operator in (HistogramAdjustment(), HistogramAdjustment.human(), HistogramAdjustment(acuity=True)):
        developed(picture, view, operator)
    np.testing.assert_array_equal(picture, before)


@pytest.mark.parametrize("operator", [HistogramAdjustment(), HistogramAdjustment.human()], ids=["plain", "human"])
def test_the_pixels_do_not_depend_on_the_number_of_threads(operator, monkeypatch):
    picture = np.random.default_rng(7).lognormal(-2, 2, (150, 90, 3)).astype(np.float32)
    results = []
    for cores in (1, 5):
        monkeypatch.setattr(os, "cpu_count", lambda cores=cores: cores)
        results.append(developed(picture, View(100.0), operator))
    np.testing.assert_array_equal(*results)


def test_adaptation_mixes_from_one_frame_to_the_next():
    first, view = ramp()
    second = first * np.float32(8)
    operator = HistogramAdjustment()
    one, two = operator.adapt(first, view), operator.adapt(second, view)
    np.testing.assert_allclose(one.mixed(one, 0.3).values, one.values, rtol=1e-12)
    shown = [
        operator.display_values(first, view, one.mixed(two, share))[0, 100:500, 1] for share in np.linspace(0, 1, 9)
    ]
    # The eye that is on its way to brighter light shows this frame darker and darker, without a leap.
    steps = np.diff(np.log(shown), axis=0)
    assert np.all(steps <= 1e-3) and np.abs(steps[:, 100:]).max() < 0.2
    assert isinstance(one.mixed(two, 0.5), Adaptation)


def a_flash():
    """A frame of waves of light and dark, the same with a part 200 times as bright, and their view."""
    y, x = np.mgrid[:150, :200]
    waves = 3 * np.sin(x / 37 + y / 23) + 2 * np.cos(y / 17 - x / 51)
    grey = np.exp(waves + np.random.default_rng(8).normal(0, 0.3, waves.shape))
    frame = np.repeat(grey[..., None], 3, -1).astype(np.float32)
    flash = frame.copy()
    flash[40:80, 80:120] *= 200
    return frame, flash, View(200.0)


@pytest.mark.parametrize("contrast", [LinearContrast(), HumanContrast()])
def test_a_flicker_is_damped(contrast):
    frame, flash, view = a_flash()
    operator = HistogramAdjustment(contrast=contrast)
    steady, flashed = operator.adapt(frame, view), operator.adapt(flash, view)
    at_once, slowly = (operator.display_values(frame, view, steady.mixed(flashed, share))[..., 1] for share in (1, 0.1))
    still = operator.display_values(frame, view, steady)[..., 1]
    assert np.abs(slowly - still).max() < 0.2 * np.abs(at_once - still).max()


@pytest.mark.parametrize("contrast", [LinearContrast(), HumanContrast()])
def test_the_curve_moves_without_leaps(contrast):
    # The ceiling takes a few rounds, and one more at some point of the way from one adaptation to the other.
    frame, flash, view = a_flash()
    operator = HistogramAdjustment(contrast=contrast)
    steady, flashed = operator.adapt(frame, view), operator.adapt(flash, view)
    way = [
        operator.display_values(frame, view, steady.mixed(flashed, share))[..., 1] for share in np.linspace(0, 1, 101)
    ]
    assert max(np.abs(later - earlier).max() for earlier, later in pairwise(way)) < 0.003


def test_what_is_off_the_middle_counts_less_when_it_is_asked_to():
    # 120° wide: a paraboloid of the distance, 0 at 90 degrees' worth of the middle's pixels.
    picture = np.ones((80, 200, 3), np.float32)
    picture[:, 50:150] = 10
    view = View(100 / np.tan(np.radians(60)))
    plain, weighted = (HistogramAdjustment(centre_weighted=w).adapt(picture, view).values[4:] for w in (False, True))
    samples = np.round(np.array([80, 200]) / view.focal_length / np.radians(1)).clip(max=[80, 200]).astype(int)
    y, x = (
        (np.arange(n) - (n - 1) / 2) * side / n / view.focal_length / np.radians(1) / 90
        for n, side in zip(samples, (80, 200), strict=True)
    )
    weights = np.maximum(1 - x**2 - y[:, None] ** 2, 0)
    middle = weights[:, np.abs(x) < np.abs(x).max() / 2].sum() / weights.sum()
    bright = slice(np.flatnonzero(plain)[-1], None)
    assert plain[bright].sum() == pytest.approx(0.5, abs=0.01)
    assert weighted[bright].sum() == pytest.approx(0.25 + middle / 2, abs=0.01)
    assert middle > 0.6


def test_exposure_after_adaptation_brightens_the_picture():
    picture, view = ramp()
    operator = HistogramAdjustment()
    settled = operator.adapt(picture, view)
    before, after = (operator.display_values(picture * np.float32(gain), view, settled) for gain in (1, 4))
    assert np.all(after[0, 50:450, 1] > before[0, 50:450, 1])


@pytest.mark.parametrize("factor", [1e-42, 1e-38, 1e25, 1e35])
def test_units_at_the_ends_of_single_precision_give_numbers(factor):
    (picture, view), operator = ramp(), HistogramAdjustment()
    seen = developed((picture * factor).astype(np.float32), view, operator)
    assert np.all(np.isfinite(seen)) and seen.min() >= 0
    # Beyond 1e30 in the picture's own unit light is held.
    if factor == 1e25:
        np.testing.assert_allclose(seen, developed(picture, view, operator), rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("scale", [1e-12, 1.0])
def test_light_beyond_all_measure_is_held_at_what_sums_can_hold(scale):
    scene = np.random.default_rng(10).uniform(1, 9, (24, 40, 3)).astype(np.float32)
    view, operator, found = View(300.0, scale), HistogramAdjustment.human(), []
    for light in (3e38, 1e30):
        scene[6:15, 9:18] = light
        found.append((operator.adapt(scene, view).values, developed(scene, view, operator)))
    np.testing.assert_array_equal(found[0][0], found[1][0])
    np.testing.assert_array_equal(found[0][1], found[1][1])
