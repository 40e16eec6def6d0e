"""The protocol of renderers: the public fake, and the change that every renderer estimates by subtraction."""

import numpy as np
import pytest

from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.renderer import ConstantRenderer, render
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Scene
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

CAMERA = Camera(9, 6, 10.0, np.zeros(3), np.eye(3))
EMPTY = Scene(EnvironmentMap(np.ones((2, 4, 3), np.float32)))
FULL = EMPTY.adding(sphere(Diffuse((0.5, 0.5, 0.5)), fine=0))


def test_every_pixel_has_the_radiance_asked_for():
    picture = render(EMPTY, CAMERA, ConstantRenderer((1.0, 2.0, 3.0)))
    assert picture.radiance.shape == (6, 9, 3)
    assert picture.radiance.dtype == np.float32
    assert np.all(picture.radiance == np.array([1, 2, 3], np.float32))
    assert not picture.variance.any()


def test_its_matte_covers_the_middle_ninth_when_objects_are_there():
    matte = render(FULL, CAMERA, ConstantRenderer()).matte
    assert matte.sum() == 6
    assert np.all(matte[2:4, 3:6] == 1)
    assert not render(EMPTY, CAMERA, ConstantRenderer()).matte.any()


def test_it_reports_that_it_is_done():
    shares = []
    render(EMPTY, CAMERA, ConstantRenderer(), progress=shares.append)
    assert shares == [1.0]


@pytest.mark.parametrize("plane", ["radiance", "variance", "normal", "albedo"])
def test_its_planes_have_the_shapes_of_a_render(plane):
    assert getattr(render(FULL, CAMERA, ConstantRenderer()), plane).shape == (6, 9, 3)


def test_a_change_is_the_difference_of_two_renders_unless_the_renderer_knows_better():
    change = ConstantRenderer((1.0, 2.0, 3.0)).change(FULL, CAMERA)
    assert np.array_equal(change.objects, change.matte[..., None] * np.array([1, 2, 3], np.float32))
    assert not change.difference.any()


def test_a_renderer_that_cannot_blur_what_moves_warns():
    with pytest.warns(UserWarning, match="ConstantRenderer does not blur"):
        ConstantRenderer().change(FULL, CAMERA, moments=lambda time: (FULL, CAMERA))


def test_the_differential_renderer_renders_plainly_too():
    plain = render(FULL, CAMERA, Differential(samples=4, depth=2))
    same = render(FULL, CAMERA, Mitsuba(samples=4, depth=2))
    assert np.array_equal(plain.radiance, same.radiance)
