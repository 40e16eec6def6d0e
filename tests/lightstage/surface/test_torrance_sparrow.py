"""G and F of grooved surfaces, against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from relume.light.reflection.weights import Fresnel
from relume.lightstage.surface.torrance_sparrow import (
    LEAST_COSINE,
    SKIN,
    grooved_reflection,
    half_vector,
    mirrored,
)
from relume.sphere.directions import normalised

UP = np.array([0.0, 0.0, 1.0])


def geometric_attenuation(view: np.ndarray, light: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """G (…): min(1, 2 (n·h)(n·v)/(v·h), 2 (n·h)(n·l)/(v·h)), and 0 where view or light is below the horizon.

    Source: Torrance and Sparrow 1967, for grooves of equal sides; in this form Blinn 1977.
    """
    half = half_vector(view, light)
    across = np.maximum(dot(view, half), LEAST_COSINE)
    towards_view, towards_light = dot(view, normal), dot(light, normal)
    open_part = 2 * dot(half, normal) * np.minimum(towards_view, towards_light) / across
    return np.where((towards_view > 0) & (towards_light > 0), np.clip(open_part, 0, 1), 0.0)


def fresnel(view: np.ndarray, light: np.ndarray, index: float = SKIN) -> np.ndarray:
    """F (…): what a facet that mirrors `light` to `view` reflects of unpolarised light.

    index : of refraction, the surface's to the air's
    """
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
    assert geometric_attenuation(tilted(20), tilted(30, 180), UP) == 1


def test_masking_and_shadowing_are_those_of_grooves() -> None:
    # View 80° and light 40° on the other side: h leans 20° to the view, v·h = cos 60°.
    expected = 2 * np.cos(np.radians(20)) * np.cos(np.radians(80)) / np.cos(np.radians(60))
    found = geometric_attenuation(tilted(80), tilted(40, 180), UP)
    assert found == pytest.approx(expected, rel=1e-12)
    assert found == pytest.approx(0.65270364, rel=1e-7)
    assert geometric_attenuation(tilted(40, 180), tilted(80), UP) == pytest.approx(0.65270364, rel=1e-7)


def test_at_the_horizon_and_below_it_nothing_is_left() -> None:
    assert geometric_attenuation(tilted(90), tilted(10), UP) == pytest.approx(0, abs=1e-15)
    assert geometric_attenuation(tilted(100), tilted(10), UP) == 0
    assert geometric_attenuation(tilted(10), tilted(130), UP) == 0


def test_attenuation_and_reflectance_do_not_care_which_way_the_light_goes() -> None:
    view, light = random_directions(200), random_directions(200)[::-1]
    assert np.allclose(
        geometric_attenuation(view, light, UP), geometric_attenuation(light, view, UP), rtol=1e-9, atol=1e-12
    )
    assert np.allclose(fresnel(view, light), fresnel(light, view), rtol=1e-12)


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


def test_the_reflected_part_is_attenuation_times_reflectance_over_the_cosine_of_view() -> None:
    view, light = random_directions(300), random_directions(300)[::-1]
    expected = geometric_attenuation(view, light, UP) * fresnel(view, light) / view[:, 2]
    clear = (view[:, 2] > 0.01) & (light[:, 2] > 0.01)
    assert np.allclose(grooved_reflection(view, light, UP)[clear], expected[clear], rtol=1e-9)


def test_at_the_horizon_the_reflected_part_stays_finite_and_above_nothing() -> None:
    found = grooved_reflection(tilted(90), np.stack([tilted(90, 180), tilted(90), tilted(150)]), UP)
    assert np.all(np.isfinite(found)) and np.all(found > 0)
