"""Gloss that varies over a table, and a metal on it, from what several eyes see under one light."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest

from relume.composite.surface.gloss import Gloss, glossy
from relume.composite.surface.recovery import EstimatedGloss, Recovery
from relume.composite.surface.several_plates import LitView, recover_from_views
from relume.composite.surface.varying_gloss import Observations, VaryingGloss, fit_varying_gloss
from relume.image.radiance import RadianceMap
from relume.renderers.mitsuba.lobes import Arriving, arriving, ready
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Box, Scene
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

ROOM, PROBE = Box((-2.5, -0.75, -2.0), (2.5, 1.95, 2.0)), (0.0, 0.05, 0.0)
EYES = np.array([[0.25, 0.55, 1.15], [-1.2, 0.5, 0.6], [1.3, 0.4, 0.5], [0.3, 0.5, -1.2]])
SIDE, GROUP = 8, 4
GLOSSES = (Gloss(0.04, 0.25), Gloss(0.08, 0.5))
GOLD = Material((0.9, 0.65, 0.3), metallic=1.0, roughness=0.35)
X, Z = np.meshgrid((np.arange(3 * SIDE) + 0.5) / SIDE * 0.5 - 0.75, (np.arange(SIDE) + 0.5) / SIDE * 0.8 - 0.4)
POINTS = np.stack([X.ravel(), 0 * X.ravel(), Z.ravel()], axis=-1)
THIRD = np.tile(np.arange(3 * SIDE) // SIDE, SIDE)
GROUPS = (np.arange(3 * SIDE) // GROUP + (np.arange(SIDE)[:, None] // GROUP) * (3 * SIDE // GROUP)).ravel()
THIRD_OF_GROUP = np.tile(np.arange(3 * SIDE // GROUP) // (SIDE // GROUP), SIDE // GROUP)
ALBEDO = np.array([0.4, 0.25, 0.2]) * np.random.default_rng(0).uniform(0.6, 1.4, (len(POINTS), 1))


def surroundings() -> EnvironmentMap:
    """A room with a window."""
    directions = pixel_directions(LatLong(), 64)
    light = 0.5 + 0.3 * directions[..., :1] * [0.5, 0.2, -0.3] + 0.2 * directions[..., 1:2]
    window = (directions[..., 0] < -0.5) & (np.abs(directions[..., 1] - 0.3) < 0.15) & (directions[..., 2] < 0.4)
    return EnvironmentMap(np.where(window[..., None], [6.0, 7.0, 9.0], light).astype(np.float32))


SCENE = Scene(surroundings(), (Plane(Diffuse((0.5, 0.5, 0.5)), (1.7, 1.0)),), distant=ROOM, probe=PROBE)


def drawn(eye: np.ndarray, seed: int, sets: int) -> list[Arriving]:
    normals = np.broadcast_to([0.0, 1.0, 0.0], POINTS.shape)
    scene = ready(SCENE)
    return [arriving(scene, POINTS, normals, eye, seed=seed + k) for k in range(sets)]


def sent(eye: np.ndarray, seed: int) -> np.ndarray:
    """(N, 3) of the true table: two glosses and a metal."""
    total = np.zeros(POINTS.shape)
    for light in drawn(eye, seed, 12):
        for third, gloss in enumerate(GLOSSES):
            shine, base = light.gloss_and_base(glossy((1.0, 1.0, 1.0), gloss))
            total += np.where((THIRD == third)[:, None], shine + ALBEDO * base, 0)
        total += np.where((THIRD == 2)[:, None], light.reflected(GOLD), 0)
    return total / 12


def lights(count: int) -> list[Callable[[Gloss], tuple[np.ndarray, np.ndarray]]]:
    def of(eye: np.ndarray, seed: int) -> Callable[[Gloss], tuple[np.ndarray, np.ndarray]]:
        several = drawn(eye, seed, 5)

        @lru_cache(None)
        def mean(gloss: Gloss) -> tuple[np.ndarray, np.ndarray]:
            found = [each.gloss_and_base(glossy((1.0, 1.0, 1.0), gloss)) for each in several]
            return np.mean([each[0] for each in found], axis=0), np.mean([each[1] for each in found], axis=0)

        return mean

    return [of(EYES[k], 7 + 100 * k) for k in range(count)]


@pytest.fixture(scope="module")
def seen() -> np.ndarray:
    radiance = np.stack([sent(eye, 1000 + 50 * k) for k, eye in enumerate(EYES)])
    return radiance * (1 + 0.01 * np.random.default_rng(5).normal(size=radiance.shape))


@pytest.fixture(scope="module")
def four_lights() -> list[Callable[[Gloss], tuple[np.ndarray, np.ndarray]]]:
    return lights(4)


@pytest.fixture(scope="module")
def found(seen, four_lights) -> VaryingGloss:
    return fit_varying_gloss(Observations(seen, (0.01 * seen) ** 2, GROUPS), four_lights)


def test_each_gloss_is_found_where_it_is(found):
    for third, gloss in enumerate(GLOSSES):
        mine = THIRD_OF_GROUP == third
        assert not found.metal[mine].any()
        assert np.median(found.f0[mine]) == pytest.approx(gloss.f0, abs=0.02)
        assert np.median(found.roughness[mine]) == pytest.approx(gloss.roughness, abs=0.04)
        # Within the errors that are said of it.
        assert np.mean(np.abs(found.f0[mine, 0] - gloss.f0) < 2.5 * found.f0_error[mine, 0]) > 0.7
        assert np.mean(np.abs(found.roughness[mine] - gloss.roughness) < 2.5 * found.roughness_error[mine]) > 0.7
        ratio = found.diffuse[THIRD == third] / ALBEDO[THIRD == third]
        assert np.median(ratio) == pytest.approx(1, abs=0.08)


def test_the_metal_is_a_metal_of_its_colour(found):
    mine = THIRD_OF_GROUP == 2
    assert found.metal[mine].all() and found.determined[mine].all()
    np.testing.assert_allclose(np.median(found.f0[mine], axis=0), GOLD.base_color, atol=0.03)
    assert np.median(found.roughness[mine]) == pytest.approx(0.35, abs=0.05)
    assert not found.diffuse[THIRD == 2].any()


def test_what_is_hardly_seen_has_the_usual_gloss_and_wide_errors(seen, four_lights):
    few = seen.copy()
    few[1:, GROUPS == 0] = np.nan
    few = fit_varying_gloss(Observations(few, (0.01 * seen) ** 2, GROUPS), four_lights)
    assert not few.metal[0] and not few.determined[0]
    assert few.f0_error[0, 0] > 0.012


def test_one_view_is_refused(seen):
    with pytest.raises(ValueError, match="needs two or more"):
        fit_varying_gloss(Observations(seen[:1], seen[:1] * 0, GROUPS), lights(1))


@pytest.mark.slow
def test_a_table_of_lacquer_and_brass_is_found_from_three_rendered_photographs():
    def half(low: float, high: float, material: Material) -> Mesh:
        corners = np.array([[low, 0, 0.5], [high, 0, 0.5], [high, 0, -0.5], [low, 0, -0.5]], np.float32)
        return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), material, name="half")

    real = SCENE.with_local([half(-0.85, 0.0, glossy((0.35, 0.2, 0.15), Gloss(0.05, 0.3))), half(0.0, 0.85, GOLD)])
    views = []
    for number, eye in enumerate(EYES[:3]):
        view = Camera.looking_at(eye, np.zeros(3), width=72, height=48, focal_length=75.0)
        picture = Mitsuba(samples=400, depth=3).render(real, view, seed=number)
        views.append(LitView(RadianceMap(picture.radiance, picture.variance), view, SCENE))
    found = recover_from_views(views, [Recovery(gloss=EstimatedGloss())], renderer=Mitsuba(samples=64, depth=2))
    eye, rays = np.array(views[0].camera.position), views[0].camera.rays()
    x = (eye - rays * (eye[1] / rays[..., 1])[..., None])[..., 0]
    left, right = ((found.views == 3) & where for where in ((x < -0.15), (x > 0.15)))
    assert found.metal[right].mean() > 0.9 and found.metal[left].mean() < 0.1
    np.testing.assert_allclose(np.median(found.f0[right], axis=0), GOLD.base_color, atol=0.05)
    assert np.median(found.roughness[left]) == pytest.approx(0.3, abs=0.06)
    np.testing.assert_allclose(np.median(found.local.albedo[left], axis=0), [0.35, 0.2, 0.15], rtol=0.06)
    assert any("is metal" in note for note in found.notes)
    assert not any("do not agree" in note for note in found.notes)
