"""Surfaces that shine beside and in milk and coloured glass: looked for, and found as chance finds them."""

from __future__ import annotations

import numpy as np
import pytest

from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.progressive.accumulation import pass_seed
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Polygon, Sphere
from relume.sphere.environment_map import EnvironmentMap

pytestmark = pytest.mark.usefixtures("mi")
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
FLOOR = Plane(Diffuse((0.5, 0.5, 0.5)), (4.0, 4.0))
MILK = Material(
    roughness=0.0, transmission=1.0, scattering_distance=(0.3, 0.3, 0.3), scattering_albedo=(0.9, 0.9, 0.9)
)  # fmt: skip
INK = Material(
    roughness=0.0, transmission=1.0, attenuation_color=(0.5, 0.5, 0.5), attenuation_distance=0.2
)  # fmt: skip
PASSES = 16


def shining(radiance: float) -> Material:
    return Material((0.0, 0.0, 0.0), specular=0.0, emission=(radiance, 0.7 * radiance, 0.4 * radiance))


# slow: what fills the body changes only what is left of the light; that of coloured glass goes red for the same break.
@pytest.mark.parametrize("filling", [pytest.param(MILK, marks=pytest.mark.slow), INK], ids=["milk", "coloured glass"])
def test_what_shines_in_a_body_lights_what_lies_in_it_as_chance_finds(filling):
    from relume.renderers.mitsuba.transport.plain import Plain

    glow = Sphere((-0.2, 0.55, 0.2), 0.1, shining(10.0))
    lit = Sphere((0.1, 0.5, -0.1), 0.2, Diffuse((0.8, 0.8, 0.8)))
    scene = Scene(BLACK, (FLOOR,), (Sphere((0.0, 0.5, 0.0), 0.48, filling), glow, lit))
    # At the ball that is lit.
    camera = Camera.looking_at(np.array([0.1, 0.6, 2.4]), np.array(lit.centre), width=8, height=8, focal_length=200)
    means, errors = [], []
    for looks, samples in ((True, 192), (False, 768)):
        made = Plain(scene, camera, 12)
        made.world.looks_for_objects = looks
        found = [made.traced(samples, pass_seed(looks, index))["radiance"].mean() for index in range(PASSES)]
        means.append(np.mean(found, dtype=np.float64))
        errors.append(np.std(found, ddof=1, dtype=np.float64) / np.sqrt(PASSES))
    error = np.hypot(*errors)
    assert error < 0.01 * means[1], (means, errors)
    assert abs(means[0] - means[1]) < 4 * error, (means, errors)


@pytest.mark.parametrize("filling", [MILK, INK], ids=["milk", "coloured glass"])
def test_a_body_in_a_corner_makes_light_of_what_shines_no_noisier(filling):
    corners = np.array([[-0.25, 3, -0.25], [0.25, 3, -0.25], [0.25, 3, 0.25], [-0.25, 3, 0.25]])
    lamp, body = Polygon(corners, shining(30.0)), Sphere((1.7, 0.2, -1.7), 0.15, filling)
    camera = Camera.looking_at(np.array([1.0, 2.0, 1.0]), np.array([0.8, 0, 0.5]), width=8, height=8, focal_length=40)
    alone, beside = (
        Mitsuba(32).render(Scene(BLACK, (FLOOR, lamp), objects), camera, seed=1) for objects in ((), (body,))
    )
    np.testing.assert_allclose(beside.radiance.mean(), alone.radiance.mean(), rtol=0.02)
    assert beside.variance.mean() < 1.5 * alone.variance.mean()
