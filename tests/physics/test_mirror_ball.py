"""The chain from light to picture and back: a rendered mirror ball unwraps to the light it was rendered under."""

import numpy as np
import pytest

from angles import degrees_between
from relume.image.radiance import RadianceMap
from relume.probe.ball.blending import blend_views
from relume.probe.ball.unwrapping import unwrap_ball
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.scene import Scene
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_points
from solids import sphere

CENTRE, RADIUS, SILVER = np.array([0.0, 0.05, 0.0]), 0.05, 0.8
CAMERAS = [np.array([0.0, 0.17, 1.0]), np.array([1.0, 0.17, 0.0])]
LAMPS = {  # direction, width in degrees, radiance per channel
    "ahead": ((0.6, 0.5, -0.6), 6, (20, 18, 14)),
    "behind": ((-0.7, 0.2, 0.5), 10, (4, 5, 8)),
    "above": ((0.1, 0.9, 0.3), 9, (3, 3, 5)),
    "below": ((0.5, -0.4, 0.7), 12, (2, 4, 2)),
}


def smooth_light(size):
    """A sky that differs in every direction and channel, with four round lamps."""
    directions = LatLong().directions(pixel_points(LatLong(), size))
    x, y, z = np.moveaxis(directions, -1, 0)
    radiance = np.stack([1 + 0.4 * y + 0.3 * x * z, 0.9 + 0.3 * y - 0.2 * z + 0.2 * x, 0.8 - 0.2 * x + 0.3 * y * y], -1)
    for towards, width, colour in LAMPS.values():
        sharpness = 1 / np.radians(width) ** 2
        radiance += np.exp(sharpness * (directions @ normalised(towards) - 1))[..., None] * np.array(colour)
    return EnvironmentMap(radiance.astype(np.float32))


@pytest.fixture(scope="module")
def light():
    return smooth_light(256)


@pytest.fixture(scope="module")
def probe(light):
    # It reflects a little less than all, as silver does; else its rim would look like the light behind it.
    ball = sphere(
        Material((SILVER, SILVER, SILVER), metallic=1.0, roughness=0.0), centre=tuple(CENTRE), radius=RADIUS, fine=6
    )
    views = []
    for position in CAMERAS:
        camera = Camera.looking_at(position, CENTRE, width=192, height=192, focal_length=192 * 8.4)
        picture = render(Scene(light, objects=(ball,)), camera, Mitsuba(samples=16), seed=1)
        views.append(
            unwrap_ball(RadianceMap(picture.radiance), camera=position, centre=CENTRE, focal_length=camera.focal_length)
        )
    return blend_views(views, size=128)


def towards_lamp(light, lamp):
    """The mean direction of what a lamp adds, weighted by solid angle."""
    middle = normalised(LAMPS[lamp][0])
    directions = LatLong().directions(pixel_points(LatLong(), light.size))
    near = directions @ middle > np.cos(np.radians(2 * LAMPS[lamp][1]))
    green = light.radiance[..., 1]
    added = np.where(near, np.maximum(green - np.quantile(green[near], 0.3), 0), 0)
    return normalised(np.einsum("hw,hwk->k", added * LatLong().solid_angles(light.size), directions))


def test_a_rendered_mirror_ball_unwraps_to_the_light_it_was_rendered_under(light, probe):
    truth = light.remapped(LatLong(), 128)
    weight = LatLong().solid_angles(128)[..., None]
    found = probe.light.radiance / SILVER
    error = np.sum(np.abs(found - truth.radiance) * weight) / np.sum(truth.radiance * weight)
    # Measured 0.8 %: the outline is found to a quarter of a pixel of a ball of 214, and lamps fall by 10 % in a degree.
    assert error < 0.02
    np.testing.assert_allclose(probe.light.total() / SILVER, truth.total(), rtol=3e-3)


@pytest.mark.parametrize("lamp", LAMPS)
def test_lamps_unwrap_to_where_they_were(light, probe, lamp):
    found, true = towards_lamp(probe.light, lamp), towards_lamp(light, lamp)
    # A quarter of a pixel of a ball 107 pixels in radius turns a reflected ray by 0.27°.
    assert degrees_between(found, true) < 0.5


def test_views_that_agree_are_not_turned_and_light_at_infinity_is_not_near(probe):
    assert max(probe.corrections) < np.radians(0.8)  # what a quarter of a pixel in either outline amounts to
    assert probe.nearness < 0.02
    assert probe.clipped_solid_angle == 0
    assert probe.confidence.min() > 0.05  # two views leave no direction unseen


def test_the_unwrapped_ball_lights_a_surface_as_the_light_itself_does(light, probe):
    normals = np.concatenate([np.eye(3), -np.eye(3), normalised(np.random.default_rng(0).normal(size=(6, 3)))])
    np.testing.assert_allclose(probe.light.irradiance(normals) / SILVER, light.irradiance(normals), rtol=0.01)
