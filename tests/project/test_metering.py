"""The film that a scene's lights ask for: pinned for each kind of light, and never without one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lights
from relume.project.scene_file.metering import metered_scene
from relume.scene.lights import AmbientLight, DistantLight, Linear, PointLight, SphereLight, Unattenuated
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Sphere
from relume.virtual_camera.film.film import metered_film

BALL = Sphere((1.0, 0.0, 0.0), 0.5, Diffuse((0.5, 0.5, 0.5)))
DARK = Scene(lights.constant(4, 0.0), objects=(BALL,))
PI = (np.pi, np.pi, np.pi)


@pytest.mark.parametrize(
    ("light", "exposure"),
    [
        (DistantLight((0, 3, 0), PI), 1.0),
        (DistantLight((0, 3, 0), (0, np.pi, 0)), 1 / 0.7152),
        (AmbientLight((0.25, 0.25, 0.25)), 4.0),
        (PointLight((1, 0, 2), PI), 4.0),  # two metres away, a quarter
        (PointLight((1, 0, 2), PI, Unattenuated()), 1.0),
        (PointLight((1, 0, 2), PI, Linear(8)), 4 / 3),
        (SphereLight((1, 0, 2), 0.5, (16, 16, 16)), 1.0),  # L (r/d)²
        (SphereLight((1, 0, 2), 3.0, (2, 2, 2)), 0.5),  # the objects are in it
        (PointLight((1, 0, 0.1), PI), 0.75),  # within the objects: at the corner of their box, √¾ away
    ],
)
def test_a_white_card_that_faces_the_light_is_white(light, exposure: float):
    assert metered_scene(replace(DARK, lights=(light,))).exposure == pytest.approx(exposure, rel=1e-4)


def test_a_map_alone_is_metered_as_ever_and_a_faint_lamp_changes_nothing():
    sky = Scene(lights.sunny(32), objects=(BALL,))
    expected = metered_film(sky.light).exposure
    assert metered_scene(sky).exposure == pytest.approx(expected)
    lamp = PointLight((1, 0, 2), (1e-3, 1e-3, 1e-3))
    assert metered_scene(replace(sky, lights=(lamp,))).exposure == pytest.approx(expected)


def test_lights_and_a_map_shine_on_the_card_together():
    scene = Scene(lights.constant(4, 0.5), objects=(BALL,), lights=(DistantLight((0, 1, 0), PI),))
    assert metered_scene(scene).exposure == pytest.approx(1 / 1.5, rel=1e-4)
    twice = replace(scene, lights=scene.lights * 2)
    assert metered_scene(twice).exposure == pytest.approx(1 / 2.5, rel=1e-4)


def test_where_nothing_can_be_metered_the_exposure_is_1():
    assert metered_scene(DARK).exposure == 1
    assert metered_scene(replace(DARK, lights=(AmbientLight((0, 0, 0)),))).exposure == 1
    assert metered_scene(replace(DARK, objects=(), lights=(PointLight((0, 0, 0), PI),))).exposure == 1
    assert metered_scene(replace(DARK, lights=(PointLight((1, 0, 9), PI, Linear(3)),))).exposure == 1
