"""Lamps as rays meet them: the flux of the photons that they send, and the irradiance that reaches a point."""

from __future__ import annotations

import numpy as np
import pytest

from relume.renderers.raytrace.lamps import Environment, Lamp, Surface, lamp_of
from relume.scene.lights import AmbientLight, DistantLight, Linear, PointLight, RectangleLight, SphereLight
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh, Plane, Polygon, Sphere
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.sampling import BrightDirections, shuffled

COUNT = 20_000
L = (3.0, 2.0, 1.0)
BALL = (np.array([0.0, 0.0, 0.0]), 2.0)
SHINING = Material(emission=L, specular=0.0)


def lamp(light) -> Lamp:
    found = lamp_of(light)
    assert found is not None
    return found


def quad(size: float, height: float, uv: np.ndarray | None = None) -> Mesh:
    """A square that faces down."""
    corners = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) * size / 2 + [0, height, 0]
    return Mesh(corners.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32), SHINING, uv=uv)


@pytest.mark.parametrize(
    ("lamp", "flux"),
    [
        (lamp(PointLight((0.1, 0.2, 0.0), L)), 4 * np.pi),
        (lamp(SphereLight((0.1, 0.2, 0.0), 0.5, L)), np.pi * 4 * np.pi * 0.25),
        (lamp(RectangleLight((0.0, 1.0, 0.0), (0.0, -2.0, 0.3), (0.5, 0.8), L)), np.pi * 0.4),
        (lamp(DistantLight((0.0, 3.0, 1.0), L)), np.pi * 4),
        (Surface(quad(0.5, 1.0), L), np.pi * 0.25),
        (Surface(Plane(SHINING, size=(0.5, 0.4)), L), np.pi * 0.2),
        (Surface(Polygon(np.array([[0, 0, 0], [1, 0, 0], [0, 1.0, 0]]), SHINING), L), np.pi * 0.5),
    ],
)
def test_photons_carry_the_flux_of_their_lamp(lamp: Lamp, flux: float):
    sent = lamp.sent(np.random.default_rng(1), COUNT, BALL)
    assert len(sent.origins) == COUNT
    np.testing.assert_allclose(np.linalg.norm(sent.directions, axis=1), 1, atol=1e-12)
    # The corners of meshes are single precision.
    np.testing.assert_allclose(sent.power.sum(0), flux * np.array(L), rtol=1e-6)


def test_an_even_sky_sends_its_light_through_the_ball():
    sky = Environment(BrightDirections.of(EnvironmentMap(np.full((8, 16, 3), 0.5, np.float32))))
    sent = sky.sent(np.random.default_rng(1), COUNT, BALL)
    # Through a ball's surface goes π·L for each square metre.
    np.testing.assert_allclose(sent.power.sum(0), np.pi * 0.5 * 4 * np.pi * 4, rtol=0.01)
    across = np.linalg.norm(np.cross(sent.origins - BALL[0], sent.directions), axis=1)
    assert across.max() <= 2 and (across**2).mean() == pytest.approx(2, rel=0.03)


def test_at_a_ball_far_away_only_those_are_sent_that_meet_it():
    far = (np.array([0.0, -6.0, 0.0]), 1.0)
    for light, exact in ((PointLight((0.0, 0.0, 0.0), L), True), (SphereLight((0.0, 0.0, 0.0), 0.1, L), False)):
        sent = lamp(light).sent(np.random.default_rng(2), COUNT, far)
        way = far[0] - sent.origins
        closest = np.linalg.norm(np.cross(way, sent.directions), axis=1)
        assert closest.max() <= 1 + 1e-9
        # Seen from a point, a ball of radius 1 at distance 6 fills 2π (1 − cos).
        intensity = 1.0 if exact else np.pi * 0.01
        cone = 2 * np.pi * (1 - np.sqrt(1 - 1 / 36)) * intensity
        np.testing.assert_allclose(sent.power.sum(0), cone * np.array(L), rtol=1e-9 if exact else 0.03)


def test_light_that_reaches_a_point_is_that_of_closed_forms():
    points = np.zeros((COUNT, 3))
    cases = [
        (lamp(PointLight((0.0, 2.0, 0.0), L)), 0.25),
        (lamp(DistantLight((0.0, 2.0, 0.0), L)), 1.0),
        # π (r/d)², and a small square's L·A/d².
        (lamp(SphereLight((0.0, 2.0, 0.0), 0.5, L)), np.pi / 16),
        (Surface(quad(0.01, 2.0), L), 1e-4 / 4),
    ]
    for each, irradiance in cases:
        light = each.reaching(shuffled(np.random.default_rng(3), COUNT, 3), points)
        found = (light.irradiance * light.directions[:, 1:2]).mean(0)
        np.testing.assert_allclose(found, irradiance * np.array(L), rtol=0.02)
    # One-sided: from behind there is nothing.
    above = Surface(quad(0.5, 2.0), L).reaching(
        shuffled(np.random.default_rng(3), COUNT, 3), points + np.array([0, 4, 0])
    )
    assert not above.irradiance.any()


def test_an_image_shines_where_its_pixels_are_bright():
    image = np.zeros((2, 2, 3), np.float32)
    image[:, 1] = 4.0
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    sent = Surface(quad(1.0, 1.0, uv), np.kron(image, np.ones((8, 8, 1)))).sent(np.random.default_rng(4), COUNT, BALL)
    np.testing.assert_allclose(sent.power.sum(0), np.pi * 2.0, rtol=0.03)
    lit = sent.power[:, 0] > 0.9 * sent.power[:, 0].max()
    assert (sent.origins[lit, 0] > 0).mean() > 0.95
    ball = Surface(Sphere((0.0, 0.0, 0.0), 1.0, SHINING), np.repeat([[[4.0] * 3], [[0.0] * 3]], 8, axis=0))
    above = ball.sent(np.random.default_rng(5), COUNT, BALL)
    bright = above.power[:, 0] > 0.9 * above.power[:, 0].max()
    # The picture's upper row is the sphere's top.
    assert (above.origins[bright, 1] > 0).mean() > 0.95


def test_light_without_the_square_law_and_ambient_light_are_no_lamps():
    assert lamp_of(PointLight((0.0, 0.0, 0.0), L, Linear(3.0))) is None
    assert lamp_of(AmbientLight(L)) is None
