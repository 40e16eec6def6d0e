"""Real surfaces that shine: they light the objects, which hide their light; their own picture stays the plate's."""

from __future__ import annotations

import numpy as np
import pytest

from montecarlo import assert_change_is_the_difference
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Polygon, Sphere
from relume.sphere.environment_map import EnvironmentMap

pytestmark = pytest.mark.usefixtures("mi")
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
FLOOR = Plane(Diffuse((0.7, 0.5, 0.3)), (4.0, 4.0))
GLOW = Material((0.0, 0.0, 0.0), specular=0.0, emission=(5.0, 4.0, 3.0), name="panel")
PANEL = Polygon(np.array([[-1.0, 0.1, -0.9], [0.6, 0.1, -0.9], [0.6, 0.9, -0.9], [-1.0, 0.9, -0.9]]), GLOW)
CAMERA = Camera.looking_at(np.array([0.3, 1.5, 1.7]), np.array([0.0, 0.2, -0.3]), width=24, height=20, focal_length=24)


@pytest.mark.parametrize(
    ("material", "samples", "whole"),
    [
        pytest.param(Diffuse((0.3, 0.5, 0.7)), 1024, 2048, id="matte"),
        # Of light through it, which chance finds, nine tenths of the noise is that of the two pictures.
        # slow: four times the others; where a panel's light or shadow goes wrong, matte and shining go red too.
        pytest.param(Material(roughness=0.0, transmission=1.0), 4096, 16384, id="glass", marks=pytest.mark.slow),
        pytest.param(Material(emission=(2.0, 1.0, 0.5)), 1024, 2048, id="shining"),
    ],
)
def test_the_change_is_the_difference_of_whole_pictures(material, samples, whole):
    scene = Scene(BLACK, (FLOOR, PANEL), (Sphere((0.0, 0.25, -0.2), 0.22, material),))
    change = Differential(samples).change(scene, CAMERA, seed=1)
    with_, without = (Mitsuba(whole).render(each, CAMERA, seed=2) for each in (scene, scene.without_objects()))
    assert_change_is_the_difference(change, with_, without, most=0.04)


def test_a_panel_lights_an_object_by_its_form_factor_and_is_not_changed_itself():
    # A small matte patch that faces the middle of a panel of 2 m: E = π L F.
    square = np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 2.0, -1.0], [-1.0, 2.0, -1.0]])
    patch = Polygon(
        np.array([[-0.01, 0.99, 0.0], [-0.01, 1.01, 0.0], [0.01, 1.01, 0.0], [0.01, 0.99, 0.0]]),
        Diffuse((0.5, 0.5, 0.5)),
    )
    eye = np.array([0.3, 1.2, -0.5])
    camera = Camera.looking_at(eye, np.array([0.0, 1.0, 0.0]), width=2, height=2, focal_length=900)
    change = Differential(1024).change(Scene(BLACK, (Polygon(square, GLOW),), (patch,)), camera, seed=1)
    # Of a quarter of 1 m × 1 m from 1 m (Hottel): F = 4 · (1/√2 · atan(1/√2)) / π.
    factor = 4 / np.pi * np.arctan(1 / np.sqrt(2)) / np.sqrt(2)
    np.testing.assert_allclose(change.objects.mean((0, 1)), 0.5 * factor * np.array([5.0, 4.0, 3.0]), rtol=0.01)
    assert factor == pytest.approx(0.5541, abs=1e-4)
    away = Camera.looking_at(np.array([0.0, 1.8, 1.0]), np.array([0.0, 1.8, -1.0]), width=4, height=4, focal_length=20)
    seen = Differential(16).change(Scene(BLACK, (Polygon(square, GLOW),), (patch,)), away, seed=1)
    assert not np.any(seen.difference)
