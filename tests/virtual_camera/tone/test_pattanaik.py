"""The multiscale model of vision: its slow twin, and what it promises of uniform light, screens, nights and ranges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from enlarging import enlarged
from relume.virtual_camera.protocols import ToneOperator
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.pattanaik.pattanaik import ACHROMATIC, Pattanaik, light_of_signals, signals_of_rgb
from relume.virtual_camera.tone.pattanaik.pyramid import Level, levels
from relume.virtual_camera.tone.pattanaik.transducers import CONES, ROD_SHARE, RODS, Transducer, cone_gain, rod_gain
from relume.virtual_camera.view import View

VIEW = View(2400.0)  # 42 pixels a degree
DARK_ROOM = DisplayRange(100.0, 1e-6)


def displayed(radiance: np.ndarray, tone: Pattanaik | None = None, view: View = VIEW) -> np.ndarray:
    tone = tone or Pattanaik()
    return tone.display_values(radiance, view, tone.adapt(radiance, view))


def grey(light: np.ndarray | float, shape: tuple[int, int] = (8, 9)) -> np.ndarray:
    return np.broadcast_to(np.asarray(light, np.float32)[..., None], (*shape, 3)).astype(np.float32)


def grating(mean: float, contrast: float, frequency: float, shape: tuple[int, int] = (4, 512)) -> np.ndarray:
    angle = (np.arange(shape[1]) + 0.5) * VIEW.degrees_per_pixel
    return grey(mean * (1 + contrast * np.cos(2 * np.pi * frequency * angle)), shape)


def swing(picture: np.ndarray) -> float:
    """Half of what lies between the darkest and the brightest in the middle of a grating."""
    middle = picture[0, 128:-128, 1]
    return float(middle.max() - middle.min()) / 2


def undone(transducer: Transducer, response: np.ndarray) -> np.ndarray:
    """The contrast of a response, by halving intervals: independent of any formula of the inverse."""
    low, high = np.zeros_like(response), np.full_like(response, 1e4)
    for _ in range(80):
        middle = (low + high) / 2
        below = transducer.response(middle) < np.abs(response)
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.copysign((low + high) / 2, response)


def whole(level: Level) -> np.ndarray:
    return level.rows(0, len(level.pixels))


def slow(radiance: np.ndarray, view: View, tone: Pattanaik) -> np.ndarray:
    """The model in plain NumPy, all bands at full size through all of its steps."""
    matrix = signals_of_rgb() * view.luminance_scale

    def signals(pixels: np.ndarray) -> np.ndarray:
        found = pixels @ matrix.T
        found[..., 3] = np.maximum(found[..., 3], 0)
        return found

    found = levels(radiance, view.degrees_per_pixel)
    base = signals(whole(found[-1]).astype(np.float64))
    cones, rods = base[..., :3] * cone_gain(base[..., :3]), base[..., 3:] * rod_gain(base[..., 3:])
    back = light_of_signals(tone.screen_adaptation or 0.18 * tone.screen.white)
    picture, size = (cones + ROD_SHARE * rods) @ back.T, found[-1].size
    for index in reversed(range(6)):
        coarse = found[index]
        fine, finer_size = (radiance, 1) if index == 0 else (whole(found[index - 1]), found[index - 1].size)
        low = signals(enlarged(whole(coarse), size // finer_size, fine.shape))
        contrast = signals(fine.astype(np.float64)) - low
        cones, rods = contrast[..., :3] * cone_gain(low[..., :3]), contrast[..., 3] * rod_gain(low[..., 3])
        achromatic = cones @ ACHROMATIC
        response = CONES[index].response(achromatic) + ROD_SHARE * RODS[index].response(rods)
        cones = cones + (undone(CONES[index], response) - achromatic)[..., None]
        picture = enlarged(picture, size // finer_size, fine.shape) + cones @ back.T
        size = finer_size
    return (np.maximum(picture, 0) - tone.screen.black) / (tone.screen.white - tone.screen.black)


@pytest.mark.parametrize(("brightness", "focal_length"), [(1e-2, 2400.0), (300.0, 2400.0), (1.0, 60.0), (1.0, 40000.0)])
def test_the_kernels_agree_with_the_slow_twin(brightness: float, focal_length: float) -> None:
    radiance = np.random.default_rng(5).gamma(0.6, 1.0, (45, 70, 3)).astype(np.float32)
    tone, view = Pattanaik(DisplayRange(100.0, 0.01)), View(focal_length, brightness)
    found, expected = displayed(radiance, tone, view), slow(radiance, view, tone)
    assert found == pytest.approx(expected, rel=2e-3, abs=2e-5)


def test_uniform_light_becomes_uniform_light_of_pinned_values() -> None:
    # 18 cd/m² is what the screen's middle grey is: (18 − 1)/(100 − 1)
    for light, shown in ((0.1, 0.008565), (1.0, 0.067865), (18.0, 0.171717), (1e3, 0.336101), (1e6, 0.966457)):
        picture = displayed(grey(light, (37, 23)))
        np.testing.assert_allclose(picture, shown, rtol=2e-4)
        assert np.ptp(picture) < 1e-5


def test_a_picture_shown_on_the_same_screen_comes_back() -> None:
    # Fine patterns on the grey that the eye is adapted to: nothing else is at hand to adapt to.
    for colour in ((1, 1, 1), (1, -0.25, 0.3)):
        pattern = grating(18.0, 0.2, 12.0) - 18
        scene = (18 + pattern * np.array(colour)).astype(np.float32)
        np.testing.assert_allclose(displayed(scene), (scene - 1) / 99, rtol=0, atol=2e-3)


@pytest.mark.parametrize("mean", [3.0, 100.0, 1e4])
def test_a_threshold_of_the_scene_is_one_of_the_screen(mean: float) -> None:
    for frequency in (8.0, 16.0):
        index = {8.0: 1, 16.0: 0}[frequency]
        just_seen = CONES[index].threshold / float(cone_gain(mean)) / mean
        shown = swing(displayed(grating(mean, just_seen, frequency), Pattanaik(DARK_ROOM))) * 100
        assert shown == pytest.approx(CONES[index].threshold / float(cone_gain(18.0)), rel=0.02)


def test_night_takes_colour() -> None:
    stripes = np.array([[[1.5, 0.8, 0.7]], [[0.7, 1.0, 1.6]]], np.float32).repeat(10, 0)
    stripes = np.tile(stripes, (8, 60, 1))  # a quarter of a degree each, too narrow to adapt to

    def colourfulness(luminance: float) -> float:
        picture = displayed(stripes * np.float32(luminance), Pattanaik(DARK_ROOM))
        return float((np.ptp(picture, axis=2) / picture.mean(2)).mean())

    day, dusk, night = (colourfulness(luminance) for luminance in (100.0, 0.1, 1e-4))
    assert day > 0.7 and dusk < 0.7 * day and night < 0.06 * day


def test_night_takes_fine_detail_and_leaves_coarse() -> None:
    def contrast(mean: float, frequency: float) -> float:
        picture = displayed(grating(mean, 0.8, frequency), Pattanaik(DARK_ROOM))
        return swing(picture) / float(picture[0, 128:-128, 1].mean())

    fine, coarse = (contrast(1e-3, frequency) / contrast(100.0, frequency) for frequency in (12.0, 1.0))
    assert fine < 0.1 and coarse > 3 * fine


def test_a_great_range_is_compressed() -> None:
    light = np.logspace(0, 6, 600)
    picture = displayed(grey(light, (60, 600)), Pattanaik(DARK_ROOM), View(60.0))
    assert np.ptp(np.log10(picture[30, 60:540, 1])) < 1.5
    assert np.all(np.diff(picture[30, 60:540, 1]) > 0)


def test_angles_count_and_not_pixels() -> None:
    rng = np.random.default_rng(6)
    small = np.exp(whole(levels(rng.normal(0, 6, (60, 80, 3)).astype(np.float32), 0.01)[2]))
    small = np.kron(small, np.ones((4, 4, 1)))[:60, :80].astype(np.float32) * 50
    large = np.kron(small, np.ones((2, 2, 1), np.float32))
    near, far = displayed(small, view=View(1200.0)), displayed(large, view=View(2400.0))
    assert far[::2, ::2][4:-4, 4:-4] == pytest.approx(near[4:-4, 4:-4], rel=0.1, abs=0.01)
    assert np.abs(displayed(large, view=View(300.0))[::2, ::2] - near).max() > 0.02


def test_a_picture_goes_on_as_its_mirror_image() -> None:
    picture = np.random.default_rng(7).gamma(0.5, 200.0, (64, 128, 3)).astype(np.float32)
    whole = np.block([[[picture], [picture[:, ::-1]]], [[picture[::-1]], [picture[::-1, ::-1]]]])
    assert displayed(whole)[:64, :128] == pytest.approx(displayed(picture), rel=1e-3, abs=1e-4)


def test_the_same_pixels_come_of_any_number_of_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = np.random.default_rng(8).gamma(0.5, 200.0, (200, 90, 3)).astype(np.float32)
    before, first = picture.copy(), displayed(picture)
    monkeypatch.setattr("relume.image.kernel.os.cpu_count", lambda: 1)
    assert np.array_equal(displayed(picture), first) and np.array_equal(picture, before)


def test_the_scale_makes_the_unit() -> None:
    picture = np.random.default_rng(9).gamma(0.5, 1.0, (20, 30, 3)).astype(np.float32)
    scaled = displayed(picture, view=replace(VIEW, luminance_scale=64.0))
    assert scaled == pytest.approx(displayed(picture * 64), rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (3, 2), (65, 129)])
def test_pictures_of_any_size_and_black_ones_are_finite(shape: tuple[int, int]) -> None:
    black = -1 / 99
    np.testing.assert_allclose(displayed(np.zeros((*shape, 3), np.float32)), black, rtol=1e-6)
    picture = displayed(np.random.default_rng(10).gamma(0.05, 1e5, (*shape, 3)).astype(np.float32))
    assert np.isfinite(picture).all() and picture.min() >= np.float32(black) and picture.dtype == np.float32


def test_nothing_is_remembered_of_the_whole_picture() -> None:
    tone: ToneOperator = Pattanaik()
    first, later = (tone.adapt(grey(light), VIEW) for light in (1.0, 1e4))
    assert first.mixed(later, 0.5).values.shape == (0,) and Pattanaik.absolute


def test_a_brighter_adaptation_shows_a_brighter_picture() -> None:
    assert displayed(grey(40.0), Pattanaik(screen_adaptation=40.0)) == pytest.approx(39 / 99, rel=1e-4)
