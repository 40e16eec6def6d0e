"""Frames that end below white, channels that hardly saturate, and hues that a merge must not change."""

from dataclasses import replace

import numpy as np
import pytest

from moving_scenes import known_response, through_jpeg
from relume.capture.brackets.hues import hue_departure, hue_doubts
from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.capture.response.calibration import Calibration
from relume.capture.response.nearly_white import below_white
from relume.capture.response.neutral import neutral_exposures, tied
from relume.capture.response.saturation import EDGE, White, whitened
from relume.image.filtering import eroded
from relume.image.radiance import SATURATED
from relume.image.response import Response
from synthetic import VirtualCamera, wide_scene

CAMERA = VirtualCamera(
    toe=(0.003, 0.003, 0.003), power=(2.2, 2.2, 2.2), knee=(1.2, 1.2, 1.2), electrons=20_000.0, read_noise=6.0
)
TIMES = (1 / 160, 1 / 40, 1 / 10)


def lamps(scale: float = 1.0) -> np.ndarray:
    """A room of two stops, and three lamps that the shortest of TIMES measures."""
    scene = wide_scene(240, 160, stops=4.0, brightest=6.0) * scale
    for left, light in ((30, 60.0), (110, 90.0), (190, 120.0)):
        scene[50:90, left : left + 30] = light
    return scene.astype(np.float32)


def pressed(bracket: Bracket, value: int, *, spread: int = 2) -> Bracket:
    """The bracket, of which the longest frame ends at about `value`."""
    last = bracket.photographs[-1]
    noise = np.random.default_rng(1).integers(-spread, spread + 1, last.pixels.shape)
    pixels = np.where(last.pixels > value, value + noise, last.pixels).astype(np.uint8)
    return Bracket((*bracket.photographs[:-1], replace(last, pixels=pixels)))


@pytest.mark.parametrize("value", [237, 200])
def test_lamps_are_not_lost_where_the_longest_frame_ends_below_white(value):
    scene = lamps()
    result = merge_brackets(pressed(CAMERA.bracket(scene, TIMES), value))
    light = result.picture.radiance
    room, lamp = np.s_[100:150, 20:220], np.s_[55:85, 35:55]
    scale = np.median(light[room] / scene[room])
    # It was 2 stops.
    assert np.median(light[lamp] / scene[lamp]) / scale == pytest.approx(1, abs=0.05)
    (note,) = [line for line in result.notes if "ends below white" in line]
    assert note.startswith("frame_2.jpg: ") and f"red at {value + 2}" in note


def test_what_is_pressed_together_counts_as_white_in_that_frame_alone():
    bracket = pressed(CAMERA.bracket(lamps(), TIMES), 230, spread=3)
    found, whites = whitened(bracket)
    ends = [white for white in whites if white.least is not None]
    assert [(white.name, white.channel) for white in ends] == [("frame_2.jpg", c) for c in range(3)]
    assert all(white.value == 233 and 224 <= (white.least or 0) <= 227 for white in ends)
    assert all(a is b for a, b in zip(found.photographs[:2], bracket.photographs[:2], strict=True))
    last, before = found.photographs[-1].pixels, bracket.photographs[-1].pixels
    assert np.all(last[55:85, 35:55] == 255)
    kept = before < 224
    np.testing.assert_array_equal(last[kept], before[kept])


def test_a_bracket_that_saturates_at_white_is_left_as_it_is():
    bracket = CAMERA.bracket(lamps(), TIMES)
    found, whites = whitened(bracket)
    assert found is bracket and all(white.least is None and white.value == 255 for white in whites)
    # A thing that moved before a lamp is no plateau: brighter places are in the frame.
    last = bracket.photographs[-1].pixels
    last[50:90, 30:220] = 180
    assert all(white.least is None for white in whitened(bracket)[1])


def straight(*shown: int, top: float = 0.0) -> Calibration:
    """Three equal straight curves, blue's bent by `top` above 150; the values that each was observed at, at most."""
    curve = np.tile(np.arange(256) * 0.02, (3, 1))
    curve[2] += top * np.clip(np.arange(256) - 150, 0, None) / 105
    red, green, blue = (np.column_stack([np.zeros(1000), np.linspace(10, most, 1000)]) for most in shown)
    return Calibration(Response(curve, np.full(3, 1.0)), (red, green, blue), np.zeros(3))


@pytest.mark.parametrize("size", [(30, 41), (1, 1), (3, 2), (9, 4)])
def test_the_inside_of_what_is_white_is_white_all_about_as_far_as_the_picture_goes(size):
    white = np.random.default_rng(7).random((*size, 3)) < 0.95
    rows, columns = np.indices(size)
    for row, column in np.ndindex(size):
        about = white[(abs(rows - row) <= EDGE) & (abs(columns - column) <= EDGE)]
        assert np.array_equal(eroded(white, EDGE)[row, column], about.all(0))


def test_channels_are_tied_where_each_is_white():
    np.testing.assert_allclose(neutral_exposures(straight(250, 250, 250), ()), [5.1, 5.1, 5.1])
    # A channel that its frames show to end at 240, in two of three frames at 235.
    whites = [White("a", 0, 235, 230), White("b", 0, 240, None), White("c", 0, 235, 230)]
    np.testing.assert_allclose(neutral_exposures(straight(250, 250, 250), whites), [4.8, 5.1, 5.1])


def test_a_channel_that_was_not_seen_near_white_is_tied_to_the_others_lower_down():
    # Blue observed up to 200 of 255: a hair is believed, an end that runs away is not.
    assert neutral_exposures(straight(250, 250, 200, top=0.1), ())[2] == pytest.approx(5.1 + 0.1)
    assert neutral_exposures(straight(250, 250, 200, top=3.1), ())[2] == pytest.approx(
        0.02 * 199 + 3.1 * 49 / 105 + 0.02 * (255 - 199), abs=0.01
    )
    # Observed up to the middle: a guess, whatever it looks like.
    assert neutral_exposures(straight(250, 250, 120, top=0.1), ())[2] == pytest.approx(5.1)
    # None was seen near white: all where all were seen.
    np.testing.assert_allclose(neutral_exposures(straight(200, 190, 110, top=2.0), ()), [0.02 * 109] * 3)


def test_the_end_of_one_curve_does_not_tint_where_the_others_say_better():
    # Blue runs away by 0.15 over its last 36 values, alike below; 0.02 a value are 0.04 of doubt.
    runaway = straight(250, 250, 250)
    runaway.response.log_exposure[2] += 0.15 * np.clip((np.arange(256) - 219) / 36, 0, 1)
    ends = neutral_exposures(runaway, ())
    assert ends[2] - ends[1] == pytest.approx(0.15 * 0.01**2 / (0.01**2 + (2.0 * 0.02) ** 2), abs=1e-6)
    found = tied(runaway, ())
    np.testing.assert_allclose(found.response.log_exposure[:, 255] - found.response.log_exposure[0, 255], 0, atol=1e-6)
    # The curve is bent with it, and not below.
    assert np.ptp(found.response.log_exposure[:, 200]) == pytest.approx(ends[2] - ends[1], abs=1e-6)
    assert np.all(np.diff(found.response.log_exposure) > 0)
    # Where blue's frames end at 251 and red's at 253, all are one light there, and as much brighter above.
    whites = [White("a", 0, 253, None), White("a", 2, 251, None)]
    pressed_ends = neutral_exposures(runaway, whites)
    bent = tied(runaway, whites).response.log_exposure
    assert abs(pressed_ends[2] - runaway.response.log_exposure[2, 251]) > 0.05
    np.testing.assert_allclose(bent[[0, 1, 2], [253, 255, 251]] - bent[1, 255], 0, atol=1e-6)
    was = runaway.response.log_exposure[2]
    np.testing.assert_allclose(bent[2, 251:] - bent[2, 251], was[251:] - was[251], atol=1e-6)
    # A channel that differs all along ends where it says: four tenths as much again are expected.
    unlike = straight(250, 250, 250)
    unlike.response.log_exposure[2] += 0.4 * np.clip((np.arange(256) - 127) / 128, 0, 1)
    assert np.ptp(neutral_exposures(unlike, ())) == pytest.approx(0.4, abs=0.015)


def test_a_lamp_just_below_white_is_measured_though_its_values_are_those_of_white():
    scene = lamps()
    # By the camera's own curve: red of the first lamp at 251 in the shortest frame, the third beyond white.
    at = np.exp(CAMERA.log_exposure()[0, 251]) * 160
    scene[50:90, 30:60], scene[50:90, 190:220] = (at, 0.5 * at, 0.4 * at), 3 * at
    frames = [
        replace(p, pixels=through_jpeg(p.pixels, 95))
        for p in CAMERA.bracket(scene.astype(np.float32), TIMES).photographs
    ]
    bracket = Bracket(tuple(frames))
    believed = below_white(bracket)
    inner, beyond = np.s_[55:85, 35:55], np.s_[52:88, 192:218]
    first = frames[0].pixels[inner][..., 0]
    assert believed is not None and first.max() >= 253
    np.testing.assert_array_equal(believed[inner][..., 0], first >= 249)
    assert not believed[beyond].any() and not believed[..., 1:].any()
    response = known_response(CAMERA)
    plain, found = merge(bracket, response), merge(bracket, response, believed=believed)
    assert plain.clipped is not None and found.clipped is not None and found.variance is not None
    assert plain.clipped[inner].mean() > 0.5 and not found.clipped[inner].any() and found.clipped[beyond].all()
    assert found.radiance[inner][..., 0].mean() / at == pytest.approx(1, abs=0.01)
    # One value is worth 1.7 % there: two of JPEG's ringing are what is not known.
    error = np.sqrt(found.variance[inner][..., 0][first >= 249]) / at
    assert np.median(error) == pytest.approx(0.03, abs=0.01)


def two_frames(shorter: np.ndarray, longer: np.ndarray) -> Bracket:
    """A bracket of two grey photographs of these values."""
    first, second = CAMERA.bracket(wide_scene(shorter.shape[1], shorter.shape[0]), TIMES).photographs[:2]
    values = (np.repeat(each[..., None], 3, 2).astype(np.uint8) for each in (shorter, longer))
    return Bracket(tuple(replace(p, pixels=pixels) for p, pixels in zip((first, second), values, strict=True)))


SMALL = {"3×3": np.s_[30:33, 30:33], "strip": np.s_[20:60, 30:32], "line": np.s_[30, 10:50], "5×5": np.s_[30:35, 30:35]}


@pytest.mark.parametrize("shape", SMALL)
@pytest.mark.parametrize("quality", [None, 85, 95])
def test_what_is_white_stays_saturated_however_small_and_thin_though_what_is_beside_it_brightens(shape, quality):
    shorter, longer = np.full((80, 96), 50), np.full((80, 96), 130)
    shorter[SMALL[shape]] = longer[SMALL[shape]] = 255
    bracket = two_frames(shorter, longer)
    if quality is not None:
        photographs = (replace(p, pixels=through_jpeg(p.pixels, quality)) for p in bracket.photographs)
        bracket = Bracket(tuple(photographs))
    believed = below_white(bracket)
    assert believed is None
    found = merge(bracket, known_response(CAMERA), believed=believed)
    assert found.clipped is not None
    white = bracket.photographs[0].pixels.min(-1) >= 252
    assert white.any() and np.all(found.clipped[white] == SATURATED)


@pytest.mark.parametrize("radius", [0, 1, 2, 3, 6])
def test_the_sun_in_a_cloud_just_below_white_stays_saturated_and_the_cloud_is_measured(radius):
    y, x = np.mgrid[:300, :96]
    noise = np.random.default_rng(2).normal(0, 0.7, y.shape)
    shorter = np.clip(np.rint(250 + noise), 0, 254).astype(int)
    # One sun where two bands of rows meet.
    suns = [np.hypot(y - row, x - column) <= radius for row, column in ((40, 30), (256, 60))]
    shorter[suns[0] | suns[1]] = 255
    bracket = two_frames(shorter, np.full(y.shape, 255))
    believed = below_white(bracket)
    assert believed is not None
    found = merge(bracket, known_response(CAMERA), believed=believed)
    assert found.clipped is not None and found.variance is not None
    for sun in suns:
        assert np.all(found.clipped[sun] == SATURATED) and np.all(np.isinf(found.variance[sun]))
    cloud = np.min([np.hypot(y - row, x - column) for row, column in ((40, 30), (256, 60))], axis=0) > 20
    assert (found.clipped[cloud & (shorter >= 249)] == 0).mean() > 0.99


def test_a_scene_without_blue_keeps_its_colour():
    tint = np.array([1.0, 1.0, 0.08])
    scene = (wide_scene(240, 160, stops=8.0, brightest=8.0) * tint).astype(np.float32)
    light = merge_brackets(CAMERA.bracket(scene, (1 / 64, 1 / 16, 1 / 4))).picture.radiance
    ratio = np.median(light / scene, axis=(0, 1))
    assert ratio[2] / ratio[1] == pytest.approx(1, abs=0.06) and ratio[0] / ratio[1] == pytest.approx(1, abs=0.03)


def test_hues_that_are_not_the_photographs_are_doubted():
    scene = wide_scene(160, 120, stops=6.0, brightest=4.0)
    bracket = CAMERA.bracket(scene, (1 / 16, 1 / 4))
    right = known_response(CAMERA)
    departure = hue_departure(bracket, merge(bracket, right))
    assert departure is not None and np.abs(departure).max() < 0.25
    assert hue_doubts(bracket, merge(bracket, right)) == ()
    magenta = Response(right.log_exposure + np.array([[0.0], [0.0], [3.1]]), right.noise)
    (doubt,) = hue_doubts(bracket, merge(bracket, magenta))
    assert doubt.degraded and "blue is 4.5 stops brighter beside green than the photographs show it" in doubt.line
    assert "--neutral, 128 for film, or give the camera's profile" in doubt.remedy
    # Nothing well exposed says nothing.
    dark = replace(bracket.photographs[0], pixels=np.zeros_like(bracket.photographs[0].pixels))
    assert hue_departure(Bracket((dark,)), merge(bracket, right)) is None


def test_the_doubt_of_a_wrong_hue_reaches_the_result():
    bracket = CAMERA.bracket(wide_scene(160, 120, stops=6.0, brightest=4.0), (1 / 16, 1 / 4))
    right = known_response(CAMERA)
    green = Response(right.log_exposure + np.array([[0.0], [1.5], [0.0]]), right.noise)
    plain = MergeSettings(align=False, deghost=False)
    found = merge_brackets(bracket, profile=green, settings=plain)
    (line,) = [line for line in found.warnings if "stops darker beside green" in line]
    # A profile is what is wrong, and no other one helps but this camera's.
    assert "the profile is of another camera or picture style" in line and "--neutral" not in line
    assert not any("beside green" in line for line in merge_brackets(bracket, profile=right, settings=plain).warnings)
