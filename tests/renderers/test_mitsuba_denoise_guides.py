"""What guides the denoiser: smooth mirrors and clear glass show the first thing behind them that scatters light."""

from __future__ import annotations

import numpy as np
import pytest

from relume.renderers.mitsuba.differential import Differential
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

LIGHT = EnvironmentMap(np.full((8, 16, 3), 2.0, np.float32))
RED = (0.6, 0.1, 0.2)
FLOOR = Plane(Diffuse(RED), (40.0, 40.0))
CAMERA = Camera.looking_at(np.array([0, 2.0, 6]), np.array([0, 1.0, 0]), width=32, height=24, focal_length=50)


def seen(material: Material | Diffuse) -> Change:
    ball = sphere(material, centre=(0.0, 1.0, 0.0), fine=4)
    return Differential(samples=4).change(Scene(LIGHT, (FLOOR,), (ball,)), CAMERA, seed=1)


def middle(change: Change, plane: str, rows: slice) -> np.ndarray:
    return np.asarray(getattr(change, plane))[rows, 14:18].mean((0, 1))


def test_a_mirror_shows_the_floor_and_the_light():
    change = seen(Material((0.8, 0.9, 1.0), metallic=1.0, roughness=0.0))
    below, above = slice(15, 17), slice(6, 8)
    assert change.matte[15:17, 14:18].min() == 1 and change.matte[6:8, 14:18].min() == 1
    # Tinted by the mirror: its own colour times the floor's, and the floor's normal.
    assert middle(change, "guide_albedo", below) == pytest.approx(np.array(RED) * [0.8, 0.9, 1.0], abs=0.02)
    assert middle(change, "guide_normal", below) == pytest.approx([0, 1, 0], abs=0.02)
    # An even light is its own mean: L / (L + L).
    assert middle(change, "guide_albedo", above) == pytest.approx(0.5 * np.array([0.8, 0.9, 1.0]), abs=0.02)
    assert not middle(change, "guide_normal", above).any()
    # What is written for compositors stays the ball's own.
    assert middle(change, "normal", below)[2] > 0.5


def test_glass_shows_what_is_behind_it_and_a_matte_ball_itself():
    clear = seen(Material((1.0, 1.0, 1.0), roughness=0.0, transmission=1.0, ior=1.0001))
    assert middle(clear, "guide_albedo", slice(15, 17)) == pytest.approx(np.array(RED), abs=0.02)
    matte = seen(Diffuse((0.2, 0.5, 0.7)))
    assert matte.guide_albedo is not None and matte.guide_normal is not None
    np.testing.assert_allclose(matte.guide_albedo, matte.albedo, rtol=0, atol=1e-6)
    np.testing.assert_allclose(matte.guide_normal, matte.normal, rtol=0, atol=1e-6)
