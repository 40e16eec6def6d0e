"""Whole pictures by relume's transport against Mitsuba's own integrators, where those are right: two-sample z-tests."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from relume.renderers.progressive.accumulation import pass_seed
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight, PointLight, RectangleLight, SphereLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.materials.media import Medium
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Polygon, Sphere
from relume.sphere.environment_map import EnvironmentMap

pytestmark = pytest.mark.usefixtures("mi")
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
CAMERA = Camera.looking_at(np.array([0.1, 1.0, 3.4]), np.array([0, 0.9, 0]), width=16, height=16, focal_length=16)
PASSES = 16
WHITE, RED, GREEN = Diffuse((0.7, 0.7, 0.7)), Diffuse((0.6, 0.1, 0.1)), Diffuse((0.1, 0.5, 0.1))


def wall(corners: list[list[float]], paint: Diffuse | Material) -> Polygon:
    return Polygon(np.array(corners, np.float64), paint)


BOX = (
    wall([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], WHITE),
    wall([[-1, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1]], WHITE),
    wall([[-1, 0, -1], [1, 0, -1], [1, 2, -1], [-1, 2, -1]], WHITE),
    wall([[-1, 0, 1], [-1, 0, -1], [-1, 2, -1], [-1, 2, 1]], RED),
    wall([[1, 0, -1], [1, 0, 1], [1, 2, 1], [1, 2, -1]], GREEN),
)
"""Cornell's, two metres wide, open to the front."""
CEILING = wall([[-0.4, 1.99, -0.4], [0.4, 1.99, -0.4], [0.4, 1.99, 0.4], [-0.4, 1.99, 0.4]], Material(
    base_color=(0.0, 0.0, 0.0), specular=0.0, emission=(12.0, 10.0, 7.0)
))  # fmt: skip
METAL = Sphere((0.3, 0.4, 0.1), 0.4, Material((0.9, 0.7, 0.4), metallic=1.0, roughness=0.4))
MATT = Sphere((0.0, 0.5, 0.0), 0.4, Diffuse((0.5, 0.6, 0.7)))


def sky() -> EnvironmentMap:
    light = np.full((16, 32, 3), 0.4, np.float32)
    light[4, 14:17] = (20.0, 15.0, 9.0)
    return EnvironmentMap(light)


SCENES = {
    "Cornell box": Scene(BLACK, BOX, (CEILING, MATT)),
    "rough metal": Scene(sky(), (Plane(WHITE, (6.0, 6.0)),), (METAL,)),
    "narrow lobes": Scene(
        sky(), (Plane(WHITE, (6.0, 6.0)),),
        (
            Sphere((0.35, 0.4, 0.1), 0.4, Material((0.9, 0.7, 0.4), metallic=1.0, roughness=0.25)),
            Sphere((-0.5, 0.4, 0.1), 0.4, Material(roughness=0.3, transmission=1.0)),
            Sphere((-0.1, 0.2, 0.7), 0.2, Material((0.5, 0.6, 0.7), roughness=0.3)),
        ),
    ),
    "sphere lamp": Scene(BLACK, BOX, (MATT,), (SphereLight((0.4, 1.5, 0.2), 0.15, (30.0, 25.0, 20.0)),)),
    "rectangle lamp": Scene(
        BLACK, BOX, (MATT,), (RectangleLight((-0.3, 1.8, 0.0), (0.3, -1, 0.2), (0.5, 0.3), (20.0, 15.0, 10.0)),)
    ),
    "point and sun": Scene(
        BLACK, BOX, (MATT,),
        (PointLight((0.4, 1.5, 0.2), (2.0, 3.0, 1.0)), DistantLight((0.2, 0.3, 1.0), (2.0, 2.0, 2.0))),
    ),
}  # fmt: skip


def own(scene: Scene, samples: int, passes: int = PASSES) -> np.ndarray:
    """Passes of ours, (PASSES, H, W, 3)."""
    from relume.renderers.mitsuba.transport.plain import Plain

    plain = Plain(scene, CAMERA, 6)
    return np.stack([plain.traced(samples, pass_seed(5, index))["radiance"] for index in range(passes)])


def theirs(mi: Any, scene: Scene, samples: int, passes: int = PASSES, change: Any = None) -> np.ndarray:
    """The same by the integrator that Mitsuba has for the scene."""
    from relume.renderers.mitsuba.scalar import integrator
    from relume.renderers.mitsuba.scene import scene_dictionary

    dictionary = scene_dictionary(mi, scene, CAMERA, media=True)
    if change is not None:
        change(dictionary)
    world, path = mi.load_dict(dictionary), mi.load_dict(integrator(scene, 6))
    return np.stack([
        np.array(mi.render(world, integrator=path, spp=samples, seed=pass_seed(7, index))) for index in range(passes)
    ])  # fmt: skip


def require_same(one: np.ndarray, other: np.ndarray, quiet: float) -> None:
    """The means of quarters of the picture and of all of it, channel by channel, within 4.5 standard errors."""
    bright = other.astype(np.float64).mean(axis=(0, 1, 2)).max()
    for where in (np.s_[:, :, :], np.s_[:, :8, :8], np.s_[:, :8, 8:], np.s_[:, 8:, :8], np.s_[:, 8:, 8:]):
        means = [found[where].astype(np.float64).mean(axis=(1, 2)) for found in (one, other)]
        error = np.sqrt(sum(m.var(axis=0, ddof=1) / len(m) for m in means))
        ours, expected = (m.mean(axis=0) for m in means)
        assert np.all(error < quiet * max(bright, expected.max())), (error, expected)  # else the next line says little
        assert np.all(np.abs(ours - expected) < 4.5 * error + 1e-4 * expected), (where, ours, expected, error)


SOONER = ("Cornell box", "rectangle lamp")


@pytest.mark.parametrize(
    "name", [name if name in SOONER else pytest.param(name, marks=pytest.mark.slow) for name in SCENES]
)
def test_whole_pictures_are_those_of_mitsubas_own_integrators(mi, name):
    require_same(own(SCENES[name], 64), theirs(mi, SCENES[name], 64), 0.02)


@pytest.mark.slow
@pytest.mark.parametrize("lamp", [SphereLight((0.5, 1.4, 0.3), 0.2, (30.0, 25.0, 20.0)), "sky"], ids=["sphere", "sky"])
def test_smoke_in_a_ball_is_mitsubas(mi, lamp):
    # Of index 1, so that light goes straight through its surface.
    body = Material(
        roughness=0.0, transmission=1.0, ior=1.0, attenuation_color=(0.9, 0.8, 0.95), attenuation_distance=0.5,
        scattering_distance=(0.2, 0.3, 0.4), scattering_albedo=(0.9, 0.95, 0.8), scattering_anisotropy=0.4,
    )  # fmt: skip
    light, lights = (sky(), ()) if lamp == "sky" else (BLACK, (lamp,))
    scene = Scene(light, (Plane(WHITE, (4.0, 4.0)),), (Sphere((0.0, 0.5, 0.0), 0.45, body),), lights)

    def clear(dictionary: dict[str, Any]) -> None:
        dictionary["shape_0001"]["bsdf"] = {"type": "null"}

    require_same(own(scene, 64), theirs(mi, scene, 64, change=clear), 0.03)


def test_fog_round_everything_is_that_of_a_ball_of_it(mi):
    fog = Medium((0.05, 0.1, 0.02), (0.3, 0.2, 0.4), 0.3)
    lamp = SphereLight((0.4, 1.4, 0.2), 0.2, (30.0, 25.0, 20.0))
    scene = Scene(BLACK, BOX, (MATT,), (lamp,), medium=fog)
    from relume.renderers.mitsuba.materials import rgb
    from relume.renderers.raytrace.extent import sphere_round_all

    def filled(dictionary: dict[str, Any]) -> None:
        centre, radius = sphere_round_all(scene)
        medium = {
            "type": "homogeneous", "sigma_t": rgb(np.array(fog.extinction)), "albedo": rgb(fog.albedo),
            "phase": {"type": "hg", "g": fog.anisotropy},
        }  # fmt: skip
        dictionary["fog"] = {
            "type": "sphere", "center": list(map(float, centre)), "radius": radius, "bsdf": {"type": "null"},
            "interior": medium,
        }  # fmt: skip
        # All else stands in it.
        for key, words in dictionary.items():
            if key.startswith(("shape_", "light_")) and isinstance(words, dict):
                words["exterior"] = medium
                if words["type"] == "sphere" and key.startswith("light_"):
                    words["interior"] = medium

    ours = own(replace(scene), 32)
    smoky = replace(scene, objects=(*scene.objects, Sphere((0.0, 50.0, 0.0), 0.01, Material(
        roughness=0.0, transmission=1.0, ior=1.0, scattering_distance=(1.0, 1.0, 1.0), scattering_albedo=(0.5, 0.5, 0.5)
    ))), medium=None)  # fmt: skip
    require_same(ours, theirs(mi, smoky, 32, change=filled), 0.03)
