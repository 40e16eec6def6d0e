"""Separation by polarisers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.lightstage.field.field import Noise, Pictures, whole
from relume.lightstage.field.lights import StageLights
from relume.lightstage.field.polarised import PolarisedPair
from relume.lightstage.relighting.voronoi_cells import even_directions
from small_stages import chosen

LIGHTS = StageLights.towards(even_directions(12))
RANDOM = np.random.default_rng(5)
DIFFUSE = np.kron(RANDOM.random((12, 8, 8, 3)), np.ones((1, 6, 6, 1)))
SPECULAR = np.zeros_like(DIFFUSE)
SPECULAR[:, 20:24, 20:24] = 5.0


def pair(noise: Noise | None = None) -> tuple[Pictures, Pictures]:
    first, second = SPECULAR + DIFFUSE / 2, DIFFUSE / 2
    return tuple(Pictures(values.astype(np.float32), LIGHTS, noise=noise) for values in (first, second))  # type: ignore[return-value]


def test_the_parts_are_parallel_less_crossed_and_twice_crossed() -> None:
    both = PolarisedPair(*pair())
    np.testing.assert_allclose(whole(both.specular), SPECULAR, atol=1e-6)
    np.testing.assert_allclose(whole(both.diffuse), DIFFUSE, atol=1e-6)


def test_together_they_are_the_subject_without_polarisers() -> None:
    parallel, crossed = pair()
    both = PolarisedPair(parallel, crossed)
    total = whole(both.specular) + whole(both.diffuse)
    np.testing.assert_allclose(total, whole(parallel) + whole(crossed), atol=1e-6)


def test_noise_below_zero_stays() -> None:
    parallel, crossed = pair()
    darker = replace(parallel, values=parallel.values - np.float32(0.01))
    assert whole(PolarisedPair(darker, crossed).specular).min() == pytest.approx(-0.01, abs=1e-6)


def test_noise_of_the_parts() -> None:
    both = PolarisedPair(*pair(Noise(1e-4)))
    assert both.diffuse.noise == Noise(4e-4) and both.specular.noise == Noise(2e-4)
    photons = PolarisedPair(*pair(Noise(1e-4, 1e-3)))
    assert photons.diffuse.noise == Noise(4e-4, 2e-3)
    assert photons.specular.noise is None
    assert PolarisedPair(*pair()).diffuse.noise is None


def test_the_noise_of_the_diffuse_part_is_what_noise_does_to_it() -> None:
    """Var(2X) at D = 2X is 4 (c + s X) = 4 c + 2 s D."""
    noise = Noise(1e-4, 1e-3)
    crossed = 0.3
    samples = 2 * (crossed + RANDOM.normal(size=200_000) * np.sqrt(noise.constant + noise.slope * crossed))
    found = PolarisedPair(*pair(noise)).diffuse.noise
    assert found is not None
    assert samples.var() == pytest.approx(found.constant + found.slope * 2 * crossed, rel=0.02)


def test_a_shifted_take_is_reported() -> None:
    parallel, crossed = pair()
    moved = replace(crossed, values=np.roll(crossed.values, 3, axis=2))
    with pytest.warns(UserWarning, match=r"shifted by \(\+3, \+0\) pixels"):
        PolarisedPair(parallel, moved)


@pytest.mark.parametrize("drift", [0.985, 1.0, 1.015])
def test_a_polariser_that_was_not_turned_is_reported(drift: float) -> None:
    parallel = pair()[0]
    noise = RANDOM.normal(0, 0.01, parallel.values.shape)
    again = replace(parallel, values=(drift * parallel.values + noise).astype(np.float32))
    with pytest.raises(ValueError, match=r"holds (9|10)\d\.\d% of the parallel one's light.*turn its polariser"):
        PolarisedPair(parallel, again)


def test_the_faintest_highlights_of_a_white_body_are_enough() -> None:
    """0.04 of the light at the surface, 1 below it."""
    body = np.ones((12, 8, 8, 3), np.float32)
    both = PolarisedPair(Pictures(0.5 * body + np.float32(0.04), LIGHTS), Pictures(0.5 * body, LIGHTS))
    np.testing.assert_allclose(whole(both.specular), 0.04, atol=1e-6)


PARALLEL, CROSSED = pair()
BLACK = Pictures(np.zeros((12, 8, 8, 3), np.float32), LIGHTS)
REVERSED = chosen(LIGHTS, np.array([0, *range(10, 0, -1), 11]))


@pytest.mark.parametrize(
    ("parallel", "crossed", "said"),
    [
        (CROSSED, PARALLEL, "swap the two"),
        (PARALLEL, PARALLEL, "the crossed take is the parallel one itself"),
        (CROSSED, CROSSED, "the crossed take is the parallel one itself"),
        (BLACK, BLACK, "both takes are black"),
        (PARALLEL, replace(CROSSED, values=CROSSED.values[:, :, :40]), "48×48 pixels and the crossed one 40×48"),
        (PARALLEL, Pictures(CROSSED.values[:11], chosen(LIGHTS, np.arange(11))), "12 lights and the crossed one 11"),
        (PARALLEL, replace(CROSSED, lights=REVERSED), 'the light "1" of the parallel take is "10"'),
    ],
)
def test_takes_that_are_no_pair_are_refused(parallel: Pictures, crossed: Pictures, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        PolarisedPair(parallel, crossed)
