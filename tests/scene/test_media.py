"""The phase function of a medium, and directions drawn from it."""

from __future__ import annotations

import numpy as np
import pytest

from relume.scene.materials.media import Medium


@pytest.mark.parametrize("g", [0.0, 0.0005, 0.6, -0.8])
def test_the_phase_function_is_a_share_of_all_directions_with_its_mean_cosine(g: float):
    medium = Medium((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), g)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    share = 2 * np.pi * medium.phase(nodes) * weights
    assert share.sum() == pytest.approx(1, abs=1e-9)
    assert (share * nodes).sum() == pytest.approx(g, abs=1e-9)
    assert Medium((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)).phase(np.array(0.3)) == pytest.approx(1 / (4 * np.pi))


@pytest.mark.parametrize("g", [0.0, 0.6, -0.8])
def test_scattered_cosines_are_drawn_from_the_phase_function(g: float):
    medium = Medium((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), g)
    cosine = medium.scattered_cosine((np.arange(100_000) + 0.5) / 100_000)
    assert cosine.min() >= -1 and cosine.max() <= 1
    # Henyey and Greenstein's Legendre moments are powers of g.
    assert cosine.mean() == pytest.approx(g, abs=1e-4)
    assert ((3 * cosine**2 - 1) / 2).mean() == pytest.approx(g * g, abs=1e-4)
