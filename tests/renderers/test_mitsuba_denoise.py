"""Denoising a change: less noise, and what the objects do not change stays 0 to the bit."""

import numpy as np

from relume.renderers.mitsuba.denoise import denoised
from relume.renderers.results import Change

HEIGHT, WIDTH = 32, 40


def flat_change(level=0.5, noise=0.1):
    """A darker square on a noisy floor, with its matte and a noisy shadow beside it."""
    generator = np.random.default_rng(9)
    floor = (level + noise * generator.standard_normal((HEIGHT, WIDTH, 3))).clip(0).astype(np.float32)
    matte = np.zeros((HEIGHT, WIDTH), np.float32)
    matte[10:20, 10:20] = 1
    objects, difference = np.zeros_like(floor), np.zeros_like(floor)
    objects[10:20, 10:20] = (0.1 + 0.02 * generator.standard_normal((10, 10, 3))).clip(0)
    difference[10:20, 20:30] = -0.5 * floor[10:20, 20:30]
    normal = np.broadcast_to(np.array([0, 1, 0], np.float32), floor.shape).copy()
    variance = np.full_like(floor, noise**2)
    return Change(objects, difference, matte, matte, normal, np.full_like(floor, 0.5), variance, variance)


def test_what_nothing_changes_stays_zero_to_the_bit():
    change = flat_change()
    same = np.all(change.difference == 0, axis=-1)
    assert same.any() and not same.all()
    assert not denoised(change).difference[same].any()


def test_a_noisy_shadow_and_a_noisy_object_get_smoother_and_keep_their_light():
    change = flat_change()
    smooth = denoised(change)
    for name, part, level in (("difference", np.s_[12:18, 22:28], -0.25), ("objects", np.s_[12:18, 12:18], 0.1)):
        before, after = (getattr(each, name)[part] for each in (change, smooth))
        assert np.abs(after - after.mean()).mean() < 0.9 * np.abs(before - before.mean()).mean()
        assert abs(after.mean() - level) < 0.02


def test_everything_but_the_two_planes_is_handed_on():
    change = flat_change()
    smooth = denoised(change)
    assert smooth.matte is change.matte and smooth.depth is change.depth
    assert smooth.objects.dtype == smooth.difference.dtype == np.float32
