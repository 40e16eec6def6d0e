"""False colours: a colour stands for a luminance, and the scale says which."""

import matplotlib
import numpy as np
import pytest

from relume.image.radiance import RadianceMap
from relume.virtual_camera.tone.display.false_colour import false_colour, ticks

TURBO = np.rint(255 * matplotlib.colormaps["turbo"](np.linspace(0, 1, 256))[:, :3]).astype(int)


def grey(light: np.ndarray, unit: str = "relative") -> RadianceMap:
    return RadianceMap(np.repeat(light[..., None], 3, axis=2).astype(np.float32), unit=unit)


def ramp(decades: float = 4.0, height: int = 300, width: int = 257) -> np.ndarray:
    """From 1 to 10^decades, left to right."""
    return np.repeat(10.0 ** np.linspace(0, decades, width)[None], height, axis=0)


def test_equal_ratios_are_equal_steps_of_the_colour_map():
    shown = false_colour(grey(ramp()), low=1, high=1e4).pixels[:, :257].astype(int)
    assert np.array_equal(shown[150, 0], TURBO[0]) and np.array_equal(shown[150, 256], TURBO[255])
    assert np.abs(shown[150, 64] - TURBO[64]).max() <= 3  # a quarter of the way: 10
    assert np.abs(shown[150, 128] - TURBO[128]).max() <= 3


def test_what_is_beyond_the_scale_has_the_colour_of_its_end_black_is_black_and_nan_grey():
    light = np.array([[0.0, -1.0, np.nan, 0.5, 1.0, 100.0, 1e9, np.inf]])
    shown = false_colour(grey(light), low=1, high=100).pixels[0, :8].astype(int)
    ends = [TURBO[0], TURBO[0], TURBO[255], TURBO[255], TURBO[255]]
    assert np.array_equal(shown, [[0] * 3, [0] * 3, [128] * 3, *ends])


def test_the_scale_s_decades_stand_where_its_colours_are():
    page = false_colour(grey(ramp(), "cd/m²"), low=1, high=1e4).pixels.astype(int)
    panel = page[:, 257:]
    marks = np.flatnonzero((panel == 255).all(-1).sum(1) >= 4)
    columns = np.flatnonzero((panel != 28).any(-1).sum(0) > 150)  # the bar is the only tall thing
    bar = panel[:, columns[len(columns) // 2]]
    found = [y for y in marks if not np.array_equal(bar[y], [28] * 3)]
    assert len(found) == 5
    for y, level in zip(sorted(found, reverse=True), (0, 64, 128, 191, 255), strict=True):
        assert min(np.abs(bar[y] - TURBO[max(level - 2, 0) : level + 3]).max(1)) <= 1


def test_the_scale_s_own_ends_are_the_picture_s():
    light = ramp(3.0)
    light[0, 0] = 1e-9  # one speck
    own = false_colour(grey(light)).pixels
    reports = false_colour(grey(light), low=float(np.percentile(light.astype(np.float32), 0.1)), high=1000).pixels
    assert np.abs(own.astype(int) - reports).max() <= 4
    assert np.array_equal(false_colour(grey(light), high=10).pixels[5, 200], TURBO[255])


@pytest.mark.parametrize(
    "low, high, expected",
    [
        (1, 1e4, [1, 10, 100, 1000, 10000]),
        (0.004, 3, [0.01, 0.1, 1]),
        (0.03, 0.6, [0.05, 0.1, 0.2, 0.5]),
        (3, 4, [3, 4]),
        (0.1, 1, [0.1, 1]),
    ],
)
def test_ticks(low, high, expected):
    assert ticks(low, high) == expected


def test_contours_lie_between_the_luminances():
    plain = false_colour(grey(ramp()), low=1, high=1e4).pixels
    lined = false_colour(grey(ramp()), low=1, high=1e4, contours=(100.5, 10.5)).pixels
    changed = np.flatnonzero((plain[100, :257] != lined[100, :257]).any(-1))
    assert changed.tolist() == [65, 128]  # 10^(4 · 65/256) = 10.37, the next is above 10.5
    assert (lined[100, changed] == 255).all()


def test_a_flat_picture_and_a_small_one_have_a_scale_too():
    assert false_colour(grey(np.full((3, 2), 5.0))).pixels.shape[0] >= 200
    assert false_colour(grey(np.full((2, 3), 5.0)), low=9).pixels.shape[1] > 50


@pytest.mark.parametrize(
    "options, said",
    [
        ({}, "no light"),
        ({"low": 2, "high": 1}, "from 2 to 1"),
        ({"low": 0, "high": 1}, "from 0 to 1"),
        ({"low": 1, "high": 2, "colours": "jetty"}, 'colours is "jetty"'),
    ],
)
def test_senseless_scales_are_refused(options, said):
    with pytest.raises(ValueError, match=said):
        false_colour(grey(np.zeros((4, 4))), **options)


def test_a_black_picture_with_a_scale_is_black():
    assert not false_colour(grey(np.zeros((4, 4))), low=1, high=2).pixels[:4, :4].any()
