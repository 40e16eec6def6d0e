"""Denoising a pair: less noise, and what the objects do not change stays equal to the bit."""

import numpy as np

from relume.renderers.mitsuba.denoise import denoise_pair
from relume.renderers.results import Render

HEIGHT, WIDTH = 32, 40


def flat_pair(level=0.5, noise=0.1):
    """A flat noisy floor, and the same with a darker square in it that has its matte and a shadow beside it."""
    generator = np.random.default_rng(9)
    floor = (level + noise * generator.standard_normal((HEIGHT, WIDTH, 3))).clip(0).astype(np.float32)
    matte = np.zeros((HEIGHT, WIDTH), np.float32)
    matte[10:20, 10:20] = 1
    changed = floor.copy()
    changed[10:20, 10:20] = (0.1 + 0.02 * generator.standard_normal((10, 10, 3))).clip(0)
    changed[10:20, 20:26] *= 0.5
    planes = {
        "variance": np.full_like(floor, noise**2),
        "depth": np.ones((HEIGHT, WIDTH), np.float32),
        "normal": np.broadcast_to(np.array([0, 1, 0], np.float32), floor.shape).copy(),
        "albedo": np.full_like(floor, 0.5),
    }
    without = Render(floor, matte=np.zeros_like(matte), **planes)
    return Render(changed, matte=matte, **planes), without


def test_pixels_that_were_equal_stay_equal_to_the_bit():
    with_, without = flat_pair()
    equal = np.all(with_.radiance == without.radiance, axis=-1)
    smooth_with, smooth_without = denoise_pair(with_, without)
    assert equal.any() and not equal.all()
    assert np.array_equal(smooth_with.radiance[equal], smooth_without.radiance[equal])


def test_a_noisy_flat_picture_gets_closer_to_flat():
    with_, without = flat_pair()
    _, smooth = denoise_pair(with_, without)
    before, after = (np.abs(r.radiance - 0.5).mean() for r in (without, smooth))
    assert after < 0.3 * before
    # Nor is its light lost: the mean of 3840 values with noise 0.1 is known to 0.0016.
    assert abs(smooth.radiance.mean() - without.radiance.mean()) < 0.005


def test_the_object_keeps_its_own_brightness():
    with_, without = flat_pair()
    smooth, _ = denoise_pair(with_, without)
    assert abs(smooth.radiance[12:18, 12:18].mean() - 0.1) < 0.01


def test_everything_but_radiance_is_handed_on():
    with_, without = flat_pair()
    smooth_with, smooth_without = denoise_pair(with_, without)
    assert smooth_with.matte is with_.matte
    assert smooth_without.depth is without.depth
    assert smooth_with.radiance.dtype == np.float32
