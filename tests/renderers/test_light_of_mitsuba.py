"""The two adapters that turn the world round: what Mitsuba sees is what our light map and our camera say."""

import numpy as np
import pytest

import lights
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.mitsuba.scene import envmap_pixels
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene
from relume.sphere.directions import rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.discs import Angular
from relume.sphere.mappings.mapping import LatLong, pixel_points

X, Y, Z = np.eye(3)
SAMPLES = 256
VIEWS = {
    "ahead": np.eye(3),
    "to +X": rotation_about(Y, -np.pi / 2),
    "back, over the seam": rotation_about(Y, np.pi),
    "straight up": rotation_about(X, np.pi / 2),
    "straight down": rotation_about(X, -np.pi / 2),
    "askew": rotation_about([1, 2, -0.5], 2.1),
}


def noise():
    return EnvironmentMap(np.random.default_rng(5).random((8, 16, 3)).astype(np.float32))


def lone(row, column):
    return EnvironmentMap(lights.lone(8, row, column).radiance * np.array([100, 50, 20], np.float32))


def smooth():
    directions = LatLong().directions(pixel_points(LatLong(), 32))
    values = np.stack([1 + directions[..., 0], 1 + directions[..., 1], 1 + directions[..., 2]], -1)
    return EnvironmentMap(values.astype(np.float32))


LIGHTS = {
    "noise": noise(),
    "smooth": smooth(),
    "a lone pixel ahead": lone(3, 8),
    "a lone pixel at the seam": lone(4, 0),
    "a lone pixel at +Y": lone(0, 5),
    "a lone pixel at -Y": lone(7, 12),
}


@pytest.mark.parametrize("rotation", VIEWS.values(), ids=VIEWS.keys())
@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS.keys())
def test_mitsuba_sees_our_light_in_our_camera(light, rotation):
    cells = 24
    camera = Camera(10, 10, 5.0, np.zeros(3), rotation)  # 90° wide
    fine = Camera(10 * cells, 10 * cells, 5.0 * cells, np.zeros(3), rotation)
    seen = light.lookup(fine.rays()).reshape(10, cells, 10, cells, 3)
    expected, spread = seen.mean((1, 3)), seen.std((1, 3))
    found = render(Scene(light), camera, Mitsuba(samples=SAMPLES), seed=3).radiance
    # 300 values: 4.5 standard errors of independent rays, and a ten-thousandth of the brightest for pixels that a
    # bilinear tent only just touches, where neither cells nor rays are many.
    allowed = 4.5 * spread / np.sqrt(SAMPLES) + 1e-4 * seen.max()
    assert np.all(np.abs(found - expected) <= allowed), float(np.max(np.abs(found - expected) / allowed))


@pytest.mark.parametrize(
    ("row", "column", "where"),
    [(4, 11, "right"), (4, 4, "left"), (1, 8, "upper"), (6, 8, "lower")],
    ids=["+X", "-X", "+Y", "-Y"],
)
def test_light_from_plus_x_is_right_and_from_plus_y_above_for_a_camera_that_looks_along_minus_z(row, column, where):
    camera = Camera(32, 32, 4.0, np.zeros(3), np.eye(3))  # 152° wide
    picture = render(Scene(lone(row, column)), camera, Mitsuba(samples=16)).radiance[..., 0]
    halves = {"right": picture[:, 16:], "left": picture[:, :16], "upper": picture[:16], "lower": picture[16:]}
    assert picture.sum() > 0
    # Row 4 is the first below the horizon; the others lie wholly on one side.
    assert halves[where].sum() > 0.99 * picture.sum()


def test_light_in_another_mapping_is_rendered_where_its_directions_point():
    latlong = smooth()
    camera = Camera(8, 8, 8.0, np.zeros(3), VIEWS["askew"])
    one, other = (
        render(Scene(light), camera, Mitsuba(samples=64)).radiance
        for light in (latlong, latlong.remapped(Angular(), 64))
    )
    np.testing.assert_allclose(one, other, rtol=0.03)  # blurred by a pixel of 5.6° on the way there and back


def test_our_pixel_centres_stand_on_the_odd_rows_half_a_turn_round():
    y, x = np.indices((2, 4))
    light = EnvironmentMap(np.repeat((x + 10 * y)[..., None], 3, 2).astype(np.float32))
    pixels = envmap_pixels(light)[..., 0]
    assert pixels.shape == (5, 4)
    assert pixels[1].tolist() == [2, 3, 0, 1]  # its left edge looks where our middle does
    assert pixels[3].tolist() == [12, 13, 10, 11]
    assert pixels[2].tolist() == [7, 8, 5, 6]
    assert pixels[0].tolist() == [1, 2, 1, 2]  # at a pole: the mean of a pixel and the one across
