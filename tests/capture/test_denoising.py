"""Denoising of a merged map: in squares as at once, and less noise than before."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.fft import dctn, idctn

from relume.capture import denoising
from relume.capture.denoising import denoise
from relume.capture.denoising_kernel import BLOCK, COSINES, STEP, THRESHOLD, shrunk
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


def slowly_shrunk(channels: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """The weighted mean (3, H, W) of all blocks by SciPy's transforms, in float64, block by block."""
    total, weight = np.zeros(channels.shape), np.zeros(channels.shape[1:])
    for top in range(0, channels.shape[1] - BLOCK + 1, STEP):
        for left in range(0, channels.shape[2] - BLOCK + 1, STEP):
            at = slice(top, top + BLOCK), slice(left, left + BLOCK)
            frequencies = np.asarray(dctn(channels[:, *at].astype(np.float64), axes=(1, 2), norm="ortho"))
            deviation = np.sqrt(variance[:, *at].astype(np.float64).mean((1, 2)))[:, None, None]
            kept = np.abs(frequencies) > np.sqrt(2 * np.log(256)) * deviation
            kept[:, 0, 0] = True
            total[:, *at] += idctn(np.where(kept, frequencies, 0), axes=(1, 2), norm="ortho") / kept.sum()
            weight[at] += 1 / kept.sum()
    return total / np.maximum(weight, 1e-30)


def test_blocks_to_frequencies_and_back_are_those_of_scipy_in_float64():
    generator = np.random.default_rng(3)
    rows, columns = np.indices((61, 74)) / 9
    truth = np.stack([np.sin(rows) * np.cos(columns), np.round(columns) % 2, 0 * rows])
    truth[2, 20:, 30:] = 2.0
    variance = np.full(truth.shape, 0.04**2, np.float32)
    variance[1] *= 4
    channels = (truth + np.sqrt(variance) * generator.standard_normal(truth.shape)).astype(np.float32)
    ours, slow = shrunk(channels, variance), slowly_shrunk(channels, variance)
    # The last row and column are in no block: 61 is odd. A frequency at the very threshold may fall on the other side.
    covered = np.s_[:, :60, :]
    assert np.abs(ours - slow)[covered].max() < 1e-3 and np.abs(ours - slow)[covered].mean() < 2e-6
    assert np.abs(slow - truth)[covered].mean() < 0.5 * np.abs(channels - truth)[covered].mean()


def test_the_transform_is_the_orthonormal_cosine_transform():
    assert np.allclose(COSINES, np.asarray(dctn(np.eye(16), axes=0, norm="ortho")), atol=1e-7)
    assert THRESHOLD == pytest.approx(3.3302, abs=1e-4)
    # Without noise nothing is left out, whatever the block holds: every frequency goes there and back.
    picture = np.random.default_rng(4).standard_normal((3, 32, 48)).astype(np.float32)
    assert np.allclose(shrunk(picture, np.zeros_like(picture)), picture, atol=2e-6)
