"""Reinhard's operators: the global curve exactly (A33), its log average, and a key that suits the picture; dodging and
burning beside its slow twin, direct Gaussians of a small picture, one pixel at a time."""

import numpy as np
import pytest

from relume.virtual_camera.protocols import Adaptation, ToneOperator
from relume.virtual_camera.tone import reinhard_local_kernel
from relume.virtual_camera.tone.reinhard import Reinhard, ReinhardLocal, gaussians, surroundings
from relume.virtual_camera.view import View

VIEW = View(500.0)


def shown(tone: ToneOperator, picture: np.ndarray) -> np.ndarray:
    return tone.display_values(picture, VIEW, tone.adapt(picture, VIEW))


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return np.exp(np.random.default_rng(5).normal(0, 2, (90, 100, 3))).astype(np.float32)


def test_a_grey_picture_of_one_luminance_comes_to_the_key():
    wall = np.full((6, 7, 3), 42.0, np.float32)
    np.testing.assert_allclose(shown(Reinhard(0.18, np.inf), wall), 0.18 / 1.18, rtol=2e-6)
    # Its highest luminance is its white.
    np.testing.assert_allclose(shown(Reinhard(), wall), 1, rtol=2e-6)


def test_the_picture_is_its_slow_twin(picture: np.ndarray):
    light = picture.astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    average = np.exp(np.log(1e-6 * light.mean() + light).mean())
    scaled = 0.25 * light / average
    for white, tone in ((scaled.max(), Reinhard(0.25)), (2.0, Reinhard(0.25, 2.0)), (np.inf, Reinhard(0.25, np.inf))):
        display = scaled * (1 + scaled / white**2) / (1 + scaled)
        np.testing.assert_allclose(shown(tone, picture), picture * (display / light)[..., None], rtol=3e-6)


def test_the_brightest_pixel_is_white_and_nothing_is_beyond(picture: np.ndarray):
    light = shown(Reinhard(), picture).astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    assert light.max() == pytest.approx(1, rel=1e-6)


def test_the_unit_changes_nothing(picture: np.ndarray):
    for tone in (Reinhard(), Reinhard(None), Reinhard(white=3.0)):
        np.testing.assert_allclose(shown(tone, picture * np.float32(1e-7)), shown(tone, picture), rtol=1e-5)


def test_a_brighter_exposure_is_brighter(picture: np.ndarray):
    tone = Reinhard()
    settled = tone.adapt(picture, VIEW)
    assert np.all(
        tone.display_values(picture * np.float32(2), VIEW, settled) > tone.display_values(picture, VIEW, settled)
    )


def test_the_estimated_key_is_pinned_and_follows_where_the_average_lies():
    steps = np.repeat(np.float32(2) ** np.arange(9), 100)
    even = np.repeat(steps[None, :, None], 3, axis=2)
    # Percentiles 1 and 256 and an average of 16 lie evenly: 0.18 · 4⁰.
    assert np.exp(Reinhard(None).adapt(even, VIEW).values[2]) == pytest.approx(0.18, rel=1e-4)
    # Nine parts of ten at 256 of 1 to 256: the average is 2^7.2, 0.18 · 4^((14.4 − 8) / 8).
    bright = np.full((1, 1000, 3), 256, np.float32)
    bright[:, :100] = 1
    assert np.exp(Reinhard(None).adapt(bright, VIEW).values[2]) == pytest.approx(0.18 * 4**0.8, rel=1e-4)
    assert np.exp(Reinhard(None).adapt(1 / bright, VIEW).values[2]) == pytest.approx(0.18 * 4**-0.8, rel=1e-4)


def test_frames_mix_in_stops(picture: np.ndarray):
    tone = Reinhard()
    dim, bright = tone.adapt(picture, VIEW), tone.adapt(picture * np.float32(16), VIEW)
    between = tone.display_values(picture * np.float32(4), VIEW, dim.mixed(bright, 0.5))
    np.testing.assert_allclose(between, shown(tone, picture), rtol=1e-5)


WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def direct(picture: np.ndarray, tone: ReinhardLocal, adaptation: Adaptation) -> tuple[np.ndarray, np.ndarray]:
    """Eq. 2 and 5 to 9 in double precision by two-dimensional sums, and each pixel's distance from the threshold."""
    average, _, key = np.exp(adaptation.values)
    light = picture.astype(np.float64) @ WEIGHTS * key / average
    blurred = []
    for scale in 1.6 ** np.arange(tone.scales):
        width = scale / (2 * np.sqrt(2))
        reach = int(np.ceil(6 * width))
        y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
        weights = np.exp(-(x**2 + y**2) / width**2)
        windows = np.lib.stride_tricks.sliding_window_view(
            np.pad(light, reach, mode="symmetric"), (2 * reach + 1, 2 * reach + 1)
        )
        blurred.append(np.einsum("yxij,ij->yx", windows, weights / weights.sum()))
    around, margin = blurred[-1].copy(), np.full(light.shape, np.inf)
    even = np.ones(light.shape, bool)
    for i in range(tone.scales - 1):
        centre, surround = blurred[i], blurred[i + 1]
        activity = (centre - surround) / (2**tone.sharpening * key / (1.6**i) ** 2 + centre)
        margin = np.where(even, np.minimum(margin, abs(abs(activity) - tone.threshold)), margin)
        ends = even & (abs(activity) > tone.threshold)
        around[ends] = centre[ends]
        even &= ~ends
    return picture * (key / average / (1 + around))[..., None], margin


@pytest.fixture(scope="module")
def edges() -> np.ndarray:
    """(70, 90, 3) float32: a bright window, a soft slope and texture, over five decades."""
    generator = np.random.default_rng(6)
    x = np.arange(90)
    light = np.exp(0.05 * (x - 45)) * np.exp(generator.normal(0, 0.15, (70, 90)))
    light[20:45, 50:75] *= 300
    light[5, 7] = 1e4
    return (light[..., None] * [1.0, 0.8, 0.5]).astype(np.float32)


@pytest.mark.parametrize("tone", [ReinhardLocal(), ReinhardLocal(0.36, 2.0, 0.02, 6), ReinhardLocal(scales=1)])
def test_the_tiles_are_the_direct_twin(edges: np.ndarray, tone: ReinhardLocal):
    settled = tone.adapt(edges, VIEW)
    expected, margin = direct(edges, tone, settled)
    found = tone.display_values(edges, VIEW, settled)
    # Where an activity lies within rounding of the threshold either scale is right.
    clear = margin > 1e-5
    assert clear.mean() > 0.99
    np.testing.assert_allclose(found[clear], expected[clear], rtol=2e-5)


def test_scales_differ_where_they_should(edges: np.ndarray):
    tone = ReinhardLocal()
    settled = tone.adapt(edges, VIEW)
    one_scale = ReinhardLocal(scales=1).display_values(edges, VIEW, settled)
    assert np.mean(abs(tone.display_values(edges, VIEW, settled) / one_scale - 1) > 0.02) > 0.3


def test_gaussians_are_those_of_equation_5():
    taps, halves = gaussians(8)
    np.testing.assert_allclose(surroundings(8)[[1, 7]], [1.6, 26.8435456])
    np.testing.assert_allclose(taps[:, 0] + 2 * taps[:, 1:].sum(1), 1, rtol=1e-6)
    # exp(−1 / (0.35355 · 1.6)²), by hand
    assert taps[1, 1] / taps[1, 0] == pytest.approx(0.04393693, rel=1e-5)
    # Σ x² w of both sides: half the width squared, where the pixels are fine enough for it.
    assert 2 * (taps[7] * np.arange(len(taps[7])) ** 2).sum() == pytest.approx(
        (26.8435456 / 2.8284271) ** 2 / 2, rel=1e-5
    )
    assert halves[0] == 2


def test_an_even_picture_is_that_of_the_global_operator():
    wall = np.full((50, 60, 3), 7.0, np.float32)
    np.testing.assert_allclose(shown(ReinhardLocal(), wall), 0.18 / 1.18, rtol=1e-5)
    np.testing.assert_allclose(shown(ReinhardLocal(), wall), shown(Reinhard(white=np.inf), wall), rtol=1e-5)


def test_detail_beside_a_lamp_keeps_more_contrast_than_globally():
    y, x = np.mgrid[:80, :80]
    light = np.where(x < 40, 1.0, 200.0) * (1 + 0.2 * ((x // 2 + y // 2) % 2))
    picture = np.repeat(light[..., None], 3, -1).astype(np.float32)
    inside = (slice(10, 70), slice(60, 76), 0)

    def contrast(tone: ReinhardLocal | Reinhard) -> float:
        seen = shown(tone, picture)[inside].astype(np.float64)
        return float(seen.std() / seen.mean())

    assert contrast(ReinhardLocal()) > 3 * contrast(Reinhard(white=np.inf))


def test_a_step_has_no_halo_but_the_thresholds_own():
    light = np.ones((60, 200))
    light[:, 100:] = 1000
    picture = np.repeat(light[..., None], 3, -1).astype(np.float32)

    def halo(tone: ReinhardLocal, distance: int) -> float:
        """The most by which a pixel that far from the step differs from its side."""
        seen = shown(tone, picture)[30, :, 0].astype(np.float64)
        dark, bright = seen[: 100 - distance] / seen[0], seen[100 + distance :] / seen[-1]
        return float(max(abs(dark - 1).max(), abs(bright - 1).max()))

    assert halo(ReinhardLocal(), 5) < ReinhardLocal().threshold
    assert halo(ReinhardLocal(), 15) < 0.01
    # Surroundings that no edge ends are what makes halos.
    assert halo(ReinhardLocal(threshold=1e9), 5) > 0.5
    assert halo(ReinhardLocal(threshold=1e9), 15) > 0.02


def test_tiles_leave_no_seams_and_nothing_wraps_round():
    generator = np.random.default_rng(7)
    picture = np.exp(generator.normal(0, 1, (230, 410, 3))).astype(np.float32)
    picture[:, :3] *= 1e4
    tone = ReinhardLocal()
    settled = tone.adapt(picture, VIEW)
    whole = tone.display_values(picture, VIEW, settled)
    assert picture.shape[0] > reinhard_local_kernel.TILE
    # The same place in another tile, its surroundings whole, is the same.
    moved = tone.display_values(picture[30:, 100:].copy(), VIEW, settled)
    np.testing.assert_allclose(whole[90:, 160:], moved[60:, 60:], rtol=1e-5)
    dim = picture.copy()
    dim[:, :3] /= 1e4
    np.testing.assert_array_equal(tone.display_values(dim, VIEW, settled)[:, 60:], whole[:, 60:])


def test_the_smallest_pictures_are_mirrored_as_often_as_need_be():
    for shape in ((1, 1, 3), (1, 5, 3), (3, 2, 3)):
        picture = np.random.default_rng(8).uniform(0.5, 2, shape).astype(np.float32)
        tone = ReinhardLocal()
        settled = tone.adapt(picture, VIEW)
        expected, _ = direct(picture, tone, settled)
        np.testing.assert_allclose(tone.display_values(picture, VIEW, settled), expected, rtol=2e-5)
