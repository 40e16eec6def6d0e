"""Lenses, lamps with a size, what fills bodies and holes, as the plain path tracer shows them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lights
from relume.errors import UnsupportedScene
from relume.renderers.environment_probe import environment
from relume.renderers.mitsuba.path_tracer import Mitsuba, _mitsuba
from relume.renderers.mitsuba.scene import sensor
from relume.renderers.raytrace.alpha_coverage import coverage
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.lights import DistantLight, SphereLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Sphere
from solids import quad

WHITE = lights.constant(8, 1.0)
BLACK = lights.constant(4, 0.0)
CAMERA = Camera(6, 6, 40.0, np.array([0, 0, 6.0]), np.eye(3))
CLEAR = Material(roughness=0.0, transmission=1.0)


def ball(material, radius=1.0):
    return Sphere((0.0, 0.0, 0.0), radius, material)


def square(material, side, at=(0.0, 0.0, 0.0)):
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * side / 2 + at
    return quad(corners, material, textured=True)


# --- the lens --------------------------------------------------------------------------------------------------------


def test_the_principal_point_is_where_the_camera_has_it():
    camera = Camera(40, 30, 50.0, np.array([0.3, 0.2, 6.0]), np.eye(3), centre=(12.0, 20.0))
    with _mitsuba("scalar_rgb", None) as mi:
        ray, _ = mi.load_dict(sensor(mi, camera)).sample_ray(0.0, 0.0, [10.5 / 40, 4.5 / 30], [0.5, 0.5])
        np.testing.assert_allclose(np.array(ray.d), camera.rays_through(np.array([10.5, 4.5])), atol=1e-5)


def test_a_picture_shows_things_about_the_principal_point():
    camera = replace(CAMERA, width=16, height=12, centre=(4.0, 9.0))
    matte = render(Scene(WHITE, objects=(ball(Diffuse((0.5, 0.5, 0.5)), 0.2),)), camera, Mitsuba(samples=4)).matte
    rows, columns = np.nonzero(matte > 0)
    assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx((4.0, 9.0), abs=0.3)


@pytest.mark.parametrize("focus", [3.0, np.inf])
def test_rays_of_a_pixel_meet_in_the_plane_in_focus(focus):
    camera = replace(CAMERA, aperture=0.1, focus=focus)
    with _mitsuba("scalar_rgb", None) as mi:
        lens = mi.load_dict(sensor(mi, camera))
        rays = [lens.sample_ray(0.0, 0.0, [0.7, 0.3], at)[0] for at in ([0.1, 0.5], [0.9, 0.5], [0.5, 0.9])]
    towards = camera.rays_through(np.array([0.7 * 6, 0.3 * 6]))
    origins, ways = (np.array([np.array(getattr(ray, name)) for ray in rays]) for name in "od")
    if focus == np.inf:
        np.testing.assert_allclose(ways, np.broadcast_to(towards, ways.shape), atol=1e-5)
    else:
        met = origins + ways * ((6 - focus - origins[:, 2]) / ways[:, 2])[:, None]
        np.testing.assert_allclose(met, np.broadcast_to([0, 0, 6] - towards * focus / towards[2], met.shape), atol=1e-4)
    assert np.ptp(origins[:, 0]) > 0.1


@pytest.mark.parametrize(
    ("lens", "line"),
    [
        ({"distortion": Distortion(0.01)}, "no lens distortion; install LLVM"),
        ({"aperture": 0.1, "focus": 3.0, "centre": (2.0, 3.0)}, "principal point is elsewhere"),
    ],
)
def test_a_lens_that_mitsubas_own_tracers_have_not_is_refused_in_one_line(lens, line):
    with pytest.raises(UnsupportedScene, match=line) as caught:
        render(Scene(WHITE, objects=(ball(Material()),)), replace(CAMERA, **lens), Mitsuba(4, variant="scalar_rgb"))
    assert "\n" not in str(caught.value)


# --- lamps -----------------------------------------------------------------------------------------------------------

LAMP = SphereLight((0.0, 2.0, 0.0), 0.25, (8.0, 4.0, 2.0))


def test_a_lamp_is_seen_lights_and_throws_no_shadow():
    floor = Plane(Diffuse((0.6, 0.5, 0.4)), (40.0, 40.0))
    above = Camera.looking_at(np.array([1.5, 3.0, 0.0]), np.zeros(3), width=3, height=3, focal_length=3000)
    sun = DistantLight((0.0, 1.0, 0.0), (np.pi, np.pi, np.pi))
    # π L (r/d)², over π.
    expected = np.array([0.6, 0.5, 0.4]) * np.array(LAMP.radiance) * (0.25 / 2) ** 2
    scene = Scene(BLACK, local=(floor,), lights=(LAMP,))
    np.testing.assert_allclose(render(scene, above, Mitsuba(samples=64)).radiance[1, 1], expected, rtol=0.02)
    # The sun shines through it. One of the two is looked for at a time: 5 standard errors of 9 · 1024 choices.
    both = render(replace(scene, lights=(LAMP, sun)), above, Mitsuba(samples=1024)).radiance.mean((0, 1))
    np.testing.assert_allclose(both, expected + np.array([0.6, 0.5, 0.4]), rtol=0.045)


def test_an_environment_holds_a_lamp_once():
    light = environment(Scene(BLACK, lights=(LAMP,)), (0.0, 0.0, 0.0), Mitsuba(samples=64), size=64)
    # Seen by 21 pixels, of which those at its edge know their share to a sixteenth.
    np.testing.assert_allclose(light.irradiance(np.array([0, 1, 0])), np.pi * np.array(LAMP.radiance) / 64, rtol=0.05)


# --- bodies ----------------------------------------------------------------------------------------------------------


def test_a_white_body_returns_all_light():
    body = replace(CLEAR, ior=1.5, scattering_distance=(0.2, 0.2, 0.2))
    seen = render(Scene(WHITE, objects=(ball(body),)), CAMERA, Mitsuba(samples=64), seed=1)
    # Where radiance is 1 everywhere every path brings 1, however long it is.
    np.testing.assert_allclose(seen.radiance[2:4, 2:4], 1, rtol=0.02)


def test_white_smoke_returns_all_light():
    # Through its surface, which bends nothing, light is looked for from within: paths differ.
    body = replace(CLEAR, ior=1.0, scattering_distance=(0.2, 0.2, 0.2))
    seen = render(Scene(WHITE, objects=(ball(body),)), replace(CAMERA, focal_length=400.0), Mitsuba(256), seed=1)
    np.testing.assert_allclose(seen.radiance.mean((0, 1)), 1, rtol=0.025)
    assert np.sqrt(seen.variance.mean() / 36) < 0.006


def test_a_body_that_absorbs_dims_by_beers_law():
    # A slab two metres thick of no step, seen along its axis.
    body = replace(CLEAR, ior=1.0, attenuation_color=(0.5, 0.25, 0.9), attenuation_distance=1.0)
    narrow = replace(CAMERA, width=2, height=2, focal_length=1000.0)
    seen = render(Scene(WHITE, objects=(ball(body),)), narrow, Mitsuba(samples=1024), seed=1).radiance.mean((0, 1))
    np.testing.assert_allclose(seen, [0.25, 0.0625, 0.81], rtol=0.1)


# --- holes -----------------------------------------------------------------------------------------------------------


def test_holes_are_not_covered_and_what_is_behind_them_is():
    thin = Material(alpha=0.25)
    far = Plane(Diffuse((0.5, 0.5, 0.5)), (0.1, 0.1), -50.0)
    picture = render(Scene(WHITE, local=(far,), objects=(ball(thin),)), CAMERA, Mitsuba(samples=4))
    # Neither the front nor the back is met: 0.75².
    assert picture.matte[2:4, 2:4].mean() == pytest.approx(1 - 0.75**2, abs=0.1)
    wall = square(Diffuse((0.5, 0.5, 0.5)), 9.0)
    hidden = coverage(Scene(WHITE, local=(wall,), objects=(ball(thin),)), CAMERA, 64)
    # The wall hides the back.
    assert hidden[2:4, 2:4].mean() == pytest.approx(0.25, abs=0.09)


def test_an_image_of_holes_stands_as_the_texture_does():
    alpha = np.zeros((2, 2), np.float32)
    alpha[0, 1] = 1  # the upper right
    matte = coverage(Scene(WHITE, objects=(square(Material(alpha=alpha), 0.9),)), CAMERA, 256)
    # A pixel is 0.15 m: the picture is the square, and the middle of each quarter is a texel's.
    assert np.unravel_index(matte.argmax(), matte.shape)[0] < 3 <= np.unravel_index(matte.argmax(), matte.shape)[1]
    assert matte.mean() == pytest.approx(0.25, abs=0.03)
