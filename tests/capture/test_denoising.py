"""Denoising of a merged map: in squares as at once, and less noise than before."""

from __future__ import annotations

import numpy as np
import pytest

from relume.capture import denoising
from relume.capture.denoising import denoise
from relume.image.radiance import RadianceMap


def noisy(height: int, width: int) -> tuple[np.ndarray, RadianceMap]:
    """A chequered picture and the same with noise of 5 %; a corner is not measured, a pixel is black."""
    rows, columns = np.indices((height, width)) // 20
    truth = np.where((rows + columns)[..., None] % 2, [0.3, 0.2, 0.1], [0.9, 1.0, 1.1])
    sigma = 0.05 * truth
    radiance = (truth + sigma * np.random.default_rng(2).standard_normal(truth.shape)).astype(np.float32)
    variance = (sigma**2).astype(np.float32)
    variance[:3, :4] = np.inf
    radiance[30, 7] = 0
    return truth, RadianceMap(radiance, variance)


@pytest.mark.parametrize("size", [(70, 101), (31, 90), (16, 16)])
def test_in_squares_it_is_what_it_is_at_once(monkeypatch, size):
    _, picture = noisy(max(size[0], 31), size[1])
    picture = RadianceMap(picture.radiance[: size[0]], picture.variance[: size[0]])  # pyright: ignore[reportOptionalSubscript]
    at_once = denoise(picture).radiance
    monkeypatch.setattr(denoising, "SQUARE", 32)
    assert np.array_equal(denoise(picture).radiance, at_once)


def test_noise_goes_and_what_was_not_measured_stays():
    truth, picture = noisy(100, 120)
    clean = denoise(picture)
    assert np.array_equal(clean.radiance[:3, :4], picture.radiance[:3, :4]) and not clean.radiance[30, 7].any()
    assert picture.variance is not None
    known = np.isfinite(picture.variance) & (picture.radiance > 0)
    before, after = (np.abs(each.radiance / truth - 1)[known].mean() for each in (picture, clean))
    assert after < 0.4 * before
