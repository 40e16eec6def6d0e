"""G and F of grooved surfaces, against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from relume.light.reflection.weights import Fresnel
from relume.lightstage.surface.torrance_sparrow import (
    SKIN,
    grooved_reflection,
    half_vector,
    mirrored,
)
from relume.sphere.directions import normalised

UP = np.array([0.0, 0.0, 1.0])


def attenuation(view: np.ndarray, light: np.ndarray) -> np.ndarray:
    """G (…), from G F / (n·v) about +Z."""
    return grooved_reflection(view, light, UP) * view[..., 2] / fresnel(view, light)


def fresnel(view: np.ndarray, light: np.ndarray, index: float = SKIN) -> np.ndarray:
    """F (…): what a facet that mirrors `light` to `view` reflects of unpolarised light."""
    return Fresnel(index)(dot(view, half_vector(view, light)))


def dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.sum(np.asarray(first) * second, axis=-1)


def tilted(degrees: float, turn: float = 0.0) -> np.ndarray:
    """A direction so many degrees from the normal +Z, turned about it."""
    angle, turn = np.radians(degrees), np.radians(turn)
    return np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])


def random_directions(count: int) -> np.ndarray:
    found = normalised(np.random.default_rng(4).normal(size=(count, 3)))
    return found * np.where(found[:, 2:] < 0, -1, 1)


def test_nothing_is_hidden_where_light_and_view_are_near_the_normal() -> None:
    assert attenuation(tilted(20), tilted(30, 180)) == pytest.approx(1, rel=1e-12)


def test_masking_and_shadowing_are_those_of_grooves() -> None:
    # View 80° and light 40° on the other side: h leans 20° to the view, v·h = cos 60°.
    expected = 2 * np.cos(np.radians(20)) * np.cos(np.radians(80)) / np.cos(np.radians(60))
    assert expected == pytest.approx(0.65270364, rel=1e-7)
    assert attenuation(tilted(80), tilted(40, 180)) == pytest.approx(expected, rel=1e-12)
    assert attenuation(tilted(40, 180), tilted(80)) == pytest.approx(expected, rel=1e-12)


def test_attenuation_is_that_of_torrance_and_sparrow_whichever_way_the_light_goes() -> None:
    """min(1, 2 (n·h)(n·v)/(v·h), 2 (n·h)(n·l)/(v·h)), for grooves of equal sides, in the form of Blinn 1977."""
    view, light = random_directions(300), random_directions(300)[::-1]
    clear = (view[:, 2] > 0.01) & (light[:, 2] > 0.01)
    half = half_vector(view, light)
    open_part = 2 * half[:, 2] * np.minimum(view[:, 2], light[:, 2]) / dot(view, half)
    for found in (attenuation(view, light), attenuation(light, view)):
        np.testing.assert_allclose(found[clear], np.minimum(open_part, 1)[clear], rtol=1e-9)
    np.testing.assert_allclose(fresnel(view, light), fresnel(light, view), rtol=1e-12)


def test_a_facet_that_faces_both_reflects_as_fresnel_says() -> None:
    # (n − 1)² / (n + 1)² for n = 1.4 and 1.5; at Brewster's angle half of sin²(θi − θt).
    assert fresnel(UP, UP) == pytest.approx(1 / 36, rel=1e-12)
    assert fresnel(UP, UP, 1.5) == pytest.approx(0.04, rel=1e-12)
    brewster = np.degrees(np.arctan(1.4))
    assert fresnel(tilted(brewster), tilted(brewster, 180)) == pytest.approx(0.5 * (0.96 / 2.96) ** 2, rel=1e-9)
    assert fresnel(tilted(89.999), tilted(89.999, 180)) == pytest.approx(1, abs=1e-3)


def test_light_that_is_mirrored_has_the_half_vector_it_was_mirrored_at() -> None:
    view, half = random_directions(100), random_directions(100)[::-1]
    light = mirrored(half, view)
    assert np.allclose(np.linalg.norm(light, axis=-1), 1)
    facing = np.einsum("pk,pk->p", half, view) > 0.05
    assert facing.sum() > 50
    assert np.allclose(half_vector(view, light)[facing], half[facing])


def test_at_the_horizon_the_reflected_part_stays_finite_and_above_nothing() -> None:
    found = grooved_reflection(tilted(90), np.stack([tilted(90, 180), tilted(90), tilted(150)]), UP)
    assert np.all(np.isfinite(found)) and np.all(found > 0)
