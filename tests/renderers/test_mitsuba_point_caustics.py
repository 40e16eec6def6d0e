"""The light that a point sends through a glass ball and off a mirror ball, against Mitsuba's particle tracer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relume.renderers.progressive.accumulation import pass_seed
from relume.scene.cameras.camera import Camera
from relume.scene.lights import PointLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Sphere
from relume.sphere.environment_map import EnvironmentMap

BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
CAMERA = Camera.looking_at(
    np.array([0.1, 2.4, 1.5]), np.array([-0.15, 0.0, -0.1]), width=24, height=24, focal_length=40
)
PASSES = 8


@pytest.mark.parametrize(
    "material",
    [
        Material(roughness=0.0, transmission=1.0),
        pytest.param(Material((0.9, 0.8, 0.7), metallic=1.0, roughness=0.0), marks=pytest.mark.slow),
    ],
    ids=["glass", "mirror"],
)
def test_a_balls_caustic_under_a_point_is_the_particle_tracers(mi: Any, material: Material):
    from relume.renderers.mitsuba.scene import scene_dictionary
    from relume.renderers.mitsuba.transport.plain import Plain

    lamp = PointLight((0.7, 1.8, 0.4), (5.0, 4.0, 3.0))
    scene = Scene(
        BLACK, (Plane(Diffuse((0.6, 0.5, 0.4)), (4.0, 4.0)),), (Sphere((0.0, 0.45, 0.0), 0.3, material),), (lamp,)
    )
    plain = Plain(scene, CAMERA, 8)
    ours = np.stack([plain.traced(64, pass_seed(1, index))["radiance"] for index in range(PASSES)])
    world = mi.load_dict(scene_dictionary(mi, scene, CAMERA))
    particles = mi.load_dict({"type": "ptracer", "max_depth": 9, "rr_depth": 8, "hide_emitters": True})
    theirs = np.stack([
        np.array(mi.render(world, integrator=particles, spp=1024, seed=pass_seed(9, index))) for index in range(PASSES)
    ])  # fmt: skip
    # Where the ball is not seen, for its own picture no particle finds: the brightest twentieth, and all of it.
    chosen = plain.traced(128, 77)
    beside = chosen["matte"] == 0
    bright = beside & (chosen["radiance"].mean(-1) > np.quantile(chosen["radiance"].mean(-1), 0.95))
    for where in (bright, beside):
        means = [found[:, where].astype(np.float64).mean((1, 2)) for found in (ours, theirs)]
        error = np.hypot(*(m.std(ddof=1) / np.sqrt(PASSES) for m in means))
        found, expected = (m.mean() for m in means)
        assert error < 0.01 * expected
        assert abs(found / expected - 1) < 0.02
        assert abs(found - expected) < 4.5 * error
