"""The camera backwards: what was developed comes back within its pixel values' steps, and losses are reported."""

from dataclasses import dataclass

import numpy as np
import pytest

from relume.capture.lens.vignetting import Vignetting
from relume.errors import NotABracket
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response, srgb_response
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.undeveloping import AllButEnds, undevelop
from relume.virtual_camera.lens.undoing import undo_optics
from relume.virtual_camera.lens.vignetting import MeasuredVignetting
from relume.virtual_camera.view import View
from synthetic import NOISELESS, wide_scene

VIEW = View(100.0)


def response() -> Response:
    curve = NOISELESS.log_exposure()
    curve[:, 0] = curve[:, 1] - 2
    return Response(curve, np.full(3, np.sqrt(1 / 12)))


def half_steps(own: Response, pixels: np.ndarray) -> np.ndarray:
    """The most by which ln radiance may be off at each pixel value: half of the wider step beside it."""
    steps = np.diff(own.log_exposure, axis=1)
    wider = np.maximum(np.pad(steps, ((0, 0), (1, 0))), np.pad(steps, ((0, 0), (0, 1)))) / 2
    return np.stack([wider[c][pixels[..., c]] for c in range(3)], axis=-1)


@pytest.mark.parametrize("own", [None, response()], ids=["srgb", "camera"])
def test_developed_and_undone_radiance_returns_to_within_half_a_step(own):
    light = wide_scene(96, 64).astype(np.float32)
    film = Film(1 / 8, own)
    photograph = develop(light, film)
    back = undevelop(photograph, film)
    measured = (photograph.pixels > 0) & (photograph.pixels < 255)
    allowed = half_steps(own or srgb_response(), photograph.pixels)
    # sRGB is no straight line over ln exposure between two values: a hundredth of a step beside the half.
    off = np.abs(np.log(back.radiance / light))
    assert np.all(off[measured] <= 1.02 * allowed[measured] + 1e-6)
    assert np.median(off[measured]) < 0.01 and measured.mean() > 0.5


def test_what_was_white_or_black_is_flagged_and_bounded():
    light = wide_scene(96, 64).astype(np.float32)
    light[40:] /= 3000
    film = Film(1 / 8, response())
    photograph = develop(light, film)
    back = undevelop(photograph, film)
    white, black = (photograph.pixels == 255).any(2), (photograph.pixels == 0).any(2)
    assert white.any() and black.any()
    np.testing.assert_array_equal(back.clipped == SATURATED, white)
    np.testing.assert_array_equal(back.clipped == BLACK, black & ~white)
    assert np.all(back.radiance[photograph.pixels == 255] <= light[photograph.pixels == 255])
    assert np.all(back.radiance[photograph.pixels == 0] >= light[photograph.pixels == 0])
    assert back.variance is not None
    ends = (photograph.pixels == 0) | (photograph.pixels == 255)
    np.testing.assert_array_equal(np.isinf(back.variance), ends)


def test_the_variance_is_that_of_the_responses_deviation():
    own = response()
    noisy = Response(own.log_exposure, np.full(3, 2.0))
    pixels = np.full((4, 4, 3), 120, np.uint8)
    back = undevelop(Photograph(pixels), Film(0.5, noisy))
    slope = (own.log_exposure[:, 121] - own.log_exposure[:, 119]) / 2
    expected = (2.0 * slope * back.radiance[0, 0]) ** 2
    assert back.variance is not None
    np.testing.assert_allclose(back.variance[0, 0], expected, rtol=1e-4)
    np.testing.assert_allclose(back.radiance[0, 0], np.exp(own.log_exposure[:, 120]) / 0.5, rtol=1e-6)


def test_the_films_exposure_counts_and_not_the_files():
    photograph = Photograph(np.full((4, 4, 3), 188, np.uint8), exposure=Exposure(8.0))
    assert undevelop(photograph, Film(0.25)).radiance[0, 0, 0] == pytest.approx(4 * 0.5029, rel=1e-3)
    deep = Photograph(np.full((4, 4, 3), 188 * 257, np.uint16))
    assert undevelop(deep, Film()).radiance[0, 0, 0] == pytest.approx(0.5029, rel=1e-3)


def test_values_that_jpeg_spoils_can_be_left_out():
    pixels = np.full((20, 20, 3), 100, np.uint8)
    pixels[0], pixels[1] = 252, 3
    film = Film(1.0, response())
    assert not np.any(undevelop(Photograph(pixels), film).clipped)
    guarded = undevelop(Photograph(pixels), film, weighting=AllButEnds(5)).clipped
    assert guarded is not None
    assert guarded[:3, 0].tolist() == [SATURATED, BLACK, 0]


def test_a_response_of_another_depth_and_a_white_photograph_are_refused():
    with pytest.raises(NotABracket, match="65536"):
        undevelop(Photograph(np.full((4, 4, 3), 300, np.uint16)), Film(1.0, response()))
    with pytest.raises(NotABracket, match="saturated in every photograph"):
        undevelop(Photograph(np.full((4, 4, 3), 255, np.uint8)), Film())


@dataclass(frozen=True)
class Gain:
    factor: float

    @property
    def absolute(self) -> bool:
        return False

    def apply(self, radiance, view):
        return radiance * np.float32(self.factor)

    def undo(self, radiance, view):
        return radiance / np.float32(self.factor)


@dataclass(frozen=True)
class Shift:
    """Moves the picture to the right."""

    columns: int

    @property
    def absolute(self) -> bool:
        return False

    def apply(self, radiance, view):
        return np.roll(radiance, self.columns, axis=1)

    def undo(self, radiance, view):
        back = np.roll(radiance, -self.columns, axis=1)
        back[:, -self.columns :] = np.nan
        return back


@dataclass(frozen=True)
class Blur:
    @property
    def absolute(self) -> bool:
        return False

    def apply(self, radiance, view):
        return radiance


def test_optics_are_undone_the_last_first():
    light = np.random.default_rng(0).random((6, 10, 3), np.float32) + 0.1
    falloff = MeasuredVignetting(Vignetting((-0.3,)))
    optics = (falloff, Shift(2), Gain(0.5))
    through = light
    for step in optics:
        through = step.apply(through, VIEW)
    variance = np.full_like(light, 0.04)
    back = undo_optics(RadianceMap(through, variance), optics, VIEW)
    np.testing.assert_allclose(back.radiance[:, :-2], light[:, :-2], rtol=1e-5)
    # The other way round the fall-off would be divided out beside its place.
    shape = Vignetting((-0.3,)).falloff((10, 6))[..., None]
    assert back.variance is not None and back.clipped is not None
    np.testing.assert_allclose(back.variance[:, :-2], np.broadcast_to(0.16 / shape**2, light.shape)[:, :-2], rtol=1e-4)
    np.testing.assert_array_equal(back.clipped[:, -2:], OUTSIDE)
    assert not back.clipped[:, :-2].any()
    assert np.all(back.radiance[:, -2:] == 0) and np.all(np.isinf(back.variance[:, -2:]))


def test_clipped_marks_go_with_their_light():
    light = np.ones((6, 10, 3), np.float32)
    clipped = np.zeros((6, 10), np.uint8)
    clipped[2, 5], clipped[3, 6], clipped[4, 0] = SATURATED, BLACK, OUTSIDE
    variance = np.where(clipped == 0, np.float32(1), np.float32(np.inf))[..., None].repeat(3, axis=2)
    back = undo_optics(RadianceMap(light, variance, clipped), (Gain(4.0), Shift(2)), VIEW)
    assert back.clipped is not None and back.variance is not None
    expected = np.zeros_like(clipped)
    expected[2, 3], expected[3, 4], expected[:, -2:] = SATURATED, BLACK, OUTSIDE
    np.testing.assert_array_equal(back.clipped, expected)
    np.testing.assert_array_equal(np.isinf(back.variance[..., 0]), expected != 0)
    assert np.allclose(back.variance[expected == 0], 1 / 16)


def test_optics_that_cannot_be_undone_stay_and_are_named():
    light = np.ones((6, 10, 3), np.float32)
    with pytest.warns(UserWarning, match="^Blur cannot be undone; it is left in the picture$"):
        back = undo_optics(RadianceMap(light), (Gain(2.0), Blur()), VIEW)
    np.testing.assert_allclose(back.radiance, 0.5)
    assert back.clipped is None and back.variance is None


def test_the_whole_camera_backwards():
    light = wide_scene(96, 64).astype(np.float32)
    falloff = MeasuredVignetting(Vignetting((-0.4, 0.05)))
    film = Film(1 / 8, response())
    photograph = develop(falloff.apply(light, VIEW), film)
    back = undo_optics(undevelop(photograph, film), (falloff,), VIEW)
    assert back.clipped is not None
    measured = back.clipped == 0
    allowed = half_steps(response(), photograph.pixels)
    assert np.all(np.abs(np.log(back.radiance / light))[measured] <= 1.02 * allowed[measured] + 1e-5)
    np.testing.assert_array_equal(back.clipped == SATURATED, (photograph.pixels == 255).any(2))
