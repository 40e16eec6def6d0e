"""Blurs an octave apart: their deviations, their bands' best frequencies, borders and sizes."""

from __future__ import annotations

import numpy as np
import pytest

from enlarging import enlarged
from relume.virtual_camera.tone.pattanaik.pyramid import BLUR_OF_PEAK, PEAKS, blurred_rows, levels


def blurred(pixels: np.ndarray, variance: float) -> np.ndarray:
    return blurred_rows(pixels, variance, 0, len(pixels))


def halved(pixels: np.ndarray) -> np.ndarray:
    """The slow twin of the halving."""
    for axis in (0, 1):
        odd = pixels.shape[axis] % 2
        ends = [(1, 1 + odd) if a == axis else (0, 0) for a in range(3)]
        wide = np.moveaxis(np.pad(pixels, ends, mode="symmetric"), axis, 0)
        pixels = np.moveaxis((wide[:-3:2] + 3 * wide[1:-2:2] + 3 * wide[2:-1:2] + wide[3::2]) / 8, 0, axis)
    return pixels


def variance_of(weights: np.ndarray) -> float:
    places = np.arange(len(weights)) - np.average(np.arange(len(weights)), weights=weights)
    return float(np.average(places**2, weights=weights))


def test_the_constant_of_a_bands_peak() -> None:
    assert pytest.approx(0.153004, abs=1e-6) == BLUR_OF_PEAK
    frequency = np.linspace(0.2, 3, 20001)
    gauss = [np.exp(-2 * (np.pi * deviation * frequency) ** 2) for deviation in (BLUR_OF_PEAK, 2 * BLUR_OF_PEAK)]
    assert frequency[np.argmax(gauss[0] - gauss[1])] == pytest.approx(1, abs=2e-4)


@pytest.mark.parametrize("variance", [0.05, 0.5, 3.0])
def test_a_blur_has_the_variance_asked_and_keeps_the_light(variance: float) -> None:
    dot = np.zeros((41, 43, 2), np.float32)
    dot[20, 21, 1] = 7
    seen = blurred(dot, variance)
    assert seen[..., 0].max() == 0 and seen.sum() == pytest.approx(7, rel=1e-5)
    assert variance_of(seen[..., 1].sum(0)) == pytest.approx(variance, rel=1e-3)
    assert variance_of(seen[..., 1].sum(1)) == pytest.approx(variance, rel=1e-3)


def test_a_blur_mirrors_the_picture_at_its_border() -> None:
    pixels = np.random.default_rng(3).random((6, 5, 3)).astype(np.float32)
    tripled = np.pad(pixels, ((6, 6), (5, 5), (0, 0)), mode="symmetric")
    assert blurred(pixels, 1.0) == pytest.approx(blurred(tripled, 1.0)[6:12, 5:10], abs=1e-6)
    assert np.array_equal(blurred(pixels, 0.0), pixels)
    assert np.array_equal(blurred_rows(pixels, 1.0, 2, 5), blurred(pixels, 1.0)[2:5])


def test_levels_are_halved_as_by_their_slow_twin() -> None:
    picture = np.random.default_rng(4).random((37, 50, 3)).astype(np.float32)
    degrees = 2 * BLUR_OF_PEAK / 16 / 2.5  # the sharpest blur is 2.5 pixels: halved once
    first = levels(picture, degrees)[0]
    assert first.size == 2 and first.pixels.shape == (19, 25, 3)
    # 2.5² − 3/4 of the halving − 3/4 of the way back, in areas of the large pixels
    np.testing.assert_allclose(first.pixels, blurred(halved(picture).astype(np.float32), 4.75 / 4), rtol=0, atol=1e-6)


@pytest.mark.parametrize("blur", [0.6, 1.7, 3.1])
def test_every_level_is_as_blurred_as_its_band_asks(blur: float) -> None:
    dot = np.zeros((769, 769, 1), np.float32)
    dot[384, 384] = 1
    for number, level in enumerate(levels(dot, 2 * BLUR_OF_PEAK / 16 / blur)[:5]):
        wide = enlarged(level.rows(0, len(level.pixels)), level.size, dot.shape)
        assert wide.sum() == pytest.approx(1, rel=2e-3)
        assert np.sqrt(variance_of(wide[..., 0].sum(0))) == pytest.approx(blur * 2**number, rel=0.03)


def test_a_band_answers_most_to_its_own_frequency() -> None:
    degrees = 1 / 40
    angle = (np.arange(1600) + 0.5) * degrees
    for band in (2, 3):  # 4 and 2 cycles per degree

        def answer(frequency: float, band: int = band) -> float:
            grating = (1 + np.cos(2 * np.pi * frequency * angle))[None, :, None].astype(np.float32)
            found = levels(grating, degrees)
            sharp, soft = (
                enlarged(level.rows(0, len(level.pixels)), level.size, grating.shape)
                for level in found[band - 1 : band + 1]
            )
            return float((sharp - soft)[0, 400:1200].std())

        own = answer(PEAKS[band])
        assert own > 1.02 * max(answer(PEAKS[band] * 0.7), answer(PEAKS[band] * 1.5))


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (5, 3), (64, 64), (33, 70)])
def test_uniform_light_stays_uniform_at_any_size(shape: tuple[int, int]) -> None:
    for degrees in (0.2, 0.02, 0.0005):
        found = levels(np.full((*shape, 3), 0.7, np.float32), degrees)
        assert len(found) == 6
        for level in found:
            np.testing.assert_allclose(level.rows(0, len(level.pixels)), 0.7, rtol=3e-5)
