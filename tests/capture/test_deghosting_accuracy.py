"""Deghosting against the truth: the scene as it was at the instant that the result says it shows (goal G19)."""

import numpy as np
import pytest

from moving_scenes import MovingScene, known_response, moving_scene, pu21, pu_psnr
from relume.capture.ghosts.deghosting import Deghosted, deghost
from relume.capture.merging import InverseVariance, merge

RESPONSE = known_response()


def instant(scene: MovingScene, result: Deghosted) -> np.ndarray:
    """The scene at the reference's instant, and each moving region at that of the frame it was taken from."""
    truth = scene.instants[result.reference].copy()
    for index, other in enumerate(scene.instants):
        truth[result.sources == index] = other[result.sources == index]
    return truth


def gains(scene: MovingScene) -> tuple[float, float, float]:
    """dB by which the deghosted merge is nearer to its own instant than the plain merge is, to that instant and to
    whichever it is nearest; and by which a bracket of that instant, in which nothing moves, is.

    The plain merge weighs every value by itself: predicted weights leave out some of what moved by themselves.
    """
    bracket = scene.bracket()
    plain = merge(bracket, RESPONSE, weighting=InverseVariance(predicted=False)).radiance
    result = deghost(bracket, RESPONSE)
    truth = instant(scene, result)
    found = pu_psnr(merge(result.bracket, RESPONSE).radiance, truth)
    still = MovingScene("still", (truth,) * len(scene.instants), scene.seconds).bracket()
    to_it, to_nearest = pu_psnr(plain, truth), max(pu_psnr(plain, other) for other in scene.instants)
    return found - to_it, found - max(to_it, to_nearest), pu_psnr(merge(still, RESPONSE).radiance, truth) - to_it


@pytest.mark.parametrize("leaves", [False, True], ids=["people", "leaves"])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow), 4])  # slow: the others go red alike
def test_deghosting_gains_three_decibels(seed, leaves):
    gain, over_nearest, _ = gains(moving_scene(seed, leaves=leaves))
    assert min(gain, over_nearest) > (9.0 if not leaves else 3.0)


def test_a_static_bracket_merges_to_the_same_pixels():
    bracket = moving_scene(2).static().bracket()
    plain, deghosted = merge(bracket, RESPONSE), merge(deghost(bracket, RESPONSE).bracket, RESPONSE)
    np.testing.assert_array_equal(plain.radiance, deghosted.radiance)


@pytest.mark.slow
@pytest.mark.parametrize("leaves", [False, True], ids=["people", "leaves"])
def test_twenty_stacks_each(leaves):
    table = np.array([gains(moving_scene(seed, leaves=leaves)) for seed in range(20)])
    gain, over_nearest, possible = table.T
    # Where the scene is beyond what the exposures hold, there may be less than 3 dB to be gained: then all of it.
    assert np.all((gain > 3.0) | (gain > possible - 0.1)), np.round(table, 1)
    assert over_nearest.min() > 2.5 and np.median(over_nearest) > (13.0 if not leaves else 6.0), np.round(table, 1)


@pytest.mark.slow
def test_static_brackets_are_never_touched():
    for seed in range(20):
        scene = moving_scene(seed, leaves=seed % 2 == 1).static()
        for quality in (None, 85, 95):
            assert not deghost(scene.bracket(quality=quality), RESPONSE).ghosts.any(), (seed, quality)


def test_pu21_is_the_published_encoding():
    # Parameters "banding_glare" of the authors' encoder: 100 cd/m² is about 256, the least luminance 0.
    assert pu21(np.array([0.005, 100.0, 10_000.0])) == pytest.approx([0.0, 256.4, 595.4], abs=0.5)
