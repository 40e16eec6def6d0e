"""Light of lamps in bodies that scatter it: as much as paths find by chance, and of lamps that none finds too."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.progressive.accumulation import pass_seed
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight, Light, PointLight, SphereLight
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.materials.media import Medium
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Polygon, Sphere
from relume.sphere.environment_map import EnvironmentMap

pytestmark = pytest.mark.usefixtures("mi")
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
CAMERA = Camera.looking_at(np.array([0.1, 1.0, 2.6]), np.array([0, 0.5, 0]), width=12, height=12, focal_length=36)
FLOOR = Plane(Diffuse((0.6, 0.5, 0.4)), (4.0, 4.0))
LARGE = SphereLight((0.6, 1.6, 0.8), 0.6, (10.0, 9.0, 8.0))
PASSES = 12


def body(free: float, g: float = 0.0) -> Material:
    return Material(
        roughness=0.0, transmission=1.0, ior=1.33, scattering_distance=(free, 1.2 * free, 1.5 * free),
        scattering_albedo=(0.99, 0.95, 0.9), scattering_anisotropy=g,
    )  # fmt: skip


def scene(material: Material, *lamps: Light) -> Scene:
    return Scene(BLACK, (FLOOR,), (Sphere((0.0, 0.5, 0.0), 0.45, material),), lamps)


def passes(scene: Scene, flooded: bool, samples: int, differential: bool = False) -> np.ndarray:
    """The picture of each pass, (PASSES, H, W, 3), with light kept in bodies or by paths from the camera alone."""
    from relume.renderers.mitsuba.transport.estimator import Estimator
    from relume.renderers.mitsuba.transport.plain import Plain

    made = (Estimator if differential else Plain)(scene, CAMERA, 12)
    assert made.floods, "no light would be kept"
    made.floods = flooded
    plane = "objects" if differential else "radiance"
    return np.stack([made.traced(samples, pass_seed(int(flooded), index))[plane] for index in range(PASSES)])


@pytest.mark.parametrize(
    ("free", "g", "differential"),
    [
        pytest.param(0.2, 0.6, False, marks=pytest.mark.slow),
        pytest.param(0.2, 0.6, True, marks=pytest.mark.slow),
        pytest.param(1.0, 0.0, False, marks=pytest.mark.slow),
        pytest.param(0.05, 0.0, False, marks=pytest.mark.slow),
    ],
)
def test_what_is_kept_in_bodies_is_what_paths_find(free, g, differential):
    one = passes(scene(body(free, g), LARGE), True, 128, differential).astype(np.float64)
    other = passes(scene(body(free, g), LARGE), False, 1024, differential).astype(np.float64)
    means = [found.mean(axis=(1, 2)) for found in (one, other)]
    error = np.sqrt(sum(m.var(axis=0, ddof=1) / PASSES for m in means))
    found, expected = (m.mean(axis=0) for m in means)
    assert np.all(error < 0.02 * expected), error / expected  # else the next line says little
    assert np.all(np.abs(found - expected) < 4.5 * error), (found / expected, error / expected)


def test_a_point_lights_milk_as_a_small_sphere_of_its_intensity_does():
    place, radius = (0.6, 1.6, 0.8), 0.01
    small = SphereLight(place, radius, triple(np.full(3, 3.0 / (np.pi * radius**2))))
    means = []
    for lamp in (PointLight(place, (3.0, 3.0, 3.0)), small):
        found = Mitsuba(256, passes=4).render(scene(body(0.05), lamp), CAMERA, seed=3)
        means.append(found.radiance[found.matte == 1].mean(0))
    # The same rays of light but for where on the lamp they begin.
    np.testing.assert_allclose(means[0], means[1], rtol=0.02)
    np.testing.assert_allclose(means[0], [0.2222, 0.1461, 0.1053], rtol=0.03)


def test_a_sun_lights_milk_and_photons_do_not_depend_on_the_threads():
    sun = DistantLight((0.4, 1.0, 0.6), (1.0, 1.0, 1.0))
    pictures = [
        Mitsuba(4, threads=threads, passes=2).render(scene(body(0.1), sun), CAMERA, seed=4) for threads in (1, 2)
    ]
    assert pictures[0].radiance[pictures[0].matte == 1].mean() > 0.05
    assert np.array_equal(pictures[0].radiance, pictures[1].radiance)


@pytest.mark.slow
def test_a_points_caustic_is_seen_through_a_pane():
    # A thin pane right before the camera lets the same share of everything through.
    lamp = PointLight((0.7, 1.8, 0.4), (5.0, 4.0, 3.0))
    eye, ahead = np.array([0.1, 2.4, 1.5]), np.array([-0.25, -2.4, -1.6])
    camera = Camera.looking_at(eye, eye + ahead, width=24, height=24, focal_length=60)
    middle, side, up = eye + 0.1 * ahead / np.linalg.norm(ahead), camera.rotation[:, 0], camera.rotation[:, 1]
    corners = np.array([middle + 0.1 * (i * side + j * up) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    ball = Sphere((0.0, 0.45, 0.0), 0.3, Material(roughness=0.0, transmission=1.0))
    pane = Polygon(corners, Material(roughness=0.0, transmission=1.0, thin=True))
    bare, behind = (
        Mitsuba(2048).render(Scene(BLACK, (FLOOR,), shapes, (lamp,)), camera, seed=2)
        for shapes in ((ball,), (ball, pane))
    )
    floor = bare.matte == 0
    bright = floor & (bare.radiance.mean(-1) > np.quantile(bare.radiance.mean(-1), 0.95))
    shares = [behind.radiance[where].mean() / bare.radiance[where].mean() for where in (floor & ~bright, bright)]
    # Twice 4 % are mirrored, and go to and fro between: 1 − 2 · 0.04/1.04.
    assert shares[0] == pytest.approx(0.923, abs=0.01)
    assert shares[1] == pytest.approx(shares[0], rel=0.03)


@pytest.mark.slow
def test_what_glass_bends_into_fog_is_what_paths_find():
    from relume.renderers.mitsuba.transport.plain import Plain

    glass = Material(roughness=0.0, transmission=1.0)
    fog = Medium((0.0, 0.0, 0.0), (0.4, 0.3, 0.2), 0.2)
    foggy = replace(scene(glass, LARGE), medium=fog)
    means, errors = [], []
    for flooded, samples in ((True, 128), (False, 512)):
        made = Plain(foggy, CAMERA, 8)
        assert made.floods
        made.floods = made.world.smooth = flooded
        found = np.stack([made.traced(samples, pass_seed(flooded, index))["radiance"] for index in range(PASSES)])
        passes_means = found.astype(np.float64).mean((1, 2))
        means.append(passes_means.mean(0))
        errors.append(passes_means.std(0, ddof=1) / np.sqrt(PASSES))
    error = np.hypot(*errors)
    assert np.all(error < 0.01 * means[1])
    assert np.all(np.abs(means[0] - means[1]) < 4.5 * error), means[0] / means[1]


BEAM = Camera.looking_at(np.array([0.0, 0.0, 2.6]), np.array([0, -0.15, 0]), width=8, height=8, focal_length=80)
GLASS = Material(roughness=0.0, transmission=1.0, ior=1.5)
DARK = Diffuse((0.0, 0.0, 0.0))
DARK_FLOOR = Plane(DARK, (6.0, 6.0), height=-1.0)
GLASS_BEAD = Sphere((2.0, -0.9, 0.0), 0.01, GLASS)


def beam(grounds: tuple[Plane | Sphere, ...], others: tuple[Sphere, ...]) -> tuple[Scene, Sphere]:
    """Fog, and the ball in it that gathers a lamp's light."""
    lamp = SphereLight((0.0, 1.7, 0.0), 0.25, (10.0, 10.0, 10.0))
    ball = Sphere((0.0, 0.5, 0.0), 0.45, GLASS)
    return Scene(BLACK, grounds, (ball, *others), (lamp,), medium=Medium((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.0)), ball


def require_clear_inside(made: Any, ball: Sphere) -> None:
    """Fog ends at clear glass: none of it scatters light inside."""
    kept = np.stack([np.array(axis)[:-1] for axis in made.world.photons.place], axis=1)
    away = np.linalg.norm(kept - ball.centre, axis=1)
    assert len(away) > 10_000
    assert away.min() > 0.449


@pytest.mark.parametrize(
    ("grounds", "others"),
    [
        pytest.param((Sphere((3.0, -1.0, 0.0), 0.45, DARK),), (), id="nothing behind", marks=pytest.mark.slow),
        pytest.param(
            (DARK_FLOOR, Sphere((2.0, -0.9, 0.0), 0.01, DARK)), (), id="a black bead elsewhere", marks=pytest.mark.slow
        ),
        # slow: of paths by chance; test_the_beam_of_a_glass_ball_in_fog_is_as_bright_as_paths_found_it goes red for the
        # same break.
        pytest.param((DARK_FLOOR,), (GLASS_BEAD,), id="a glass bead elsewhere", marks=pytest.mark.slow),
    ],
)
def test_the_beam_of_a_glass_ball_in_fog_is_what_paths_find(grounds, others):
    from relume.renderers.mitsuba.transport.plain import Plain

    foggy, ball = beam(grounds, others)
    means, errors = [], []
    for flooded, samples in ((True, 320), (False, 1280)):
        made = Plain(foggy, BEAM, 8)
        assert made.floods
        made.floods = made.world.smooth = flooded
        found = [made.traced(samples, pass_seed(flooded, index))["radiance"].mean() for index in range(PASSES)]
        means.append(np.mean(found, dtype=np.float64))
        errors.append(np.std(found, ddof=1, dtype=np.float64) / np.sqrt(PASSES))
        if flooded:
            require_clear_inside(made, ball)
    error = np.hypot(*errors)
    assert error < 0.012 * means[1], (means, errors)
    assert abs(means[0] - means[1]) < 4 * error, (means, errors)


def test_the_beam_of_a_glass_ball_in_fog_is_as_bright_as_paths_found_it():
    from relume.renderers.mitsuba.transport.plain import Plain

    foggy, ball = beam((DARK_FLOOR,), (GLASS_BEAD,))
    made = Plain(foggy, BEAM, 8)
    found = np.mean([made.traced(320, pass_seed(1, index))["radiance"].mean() for index in range(4)])
    require_clear_inside(made, ball)
    # By chance alone, 12 passes of 1280 paths a pixel: the slow test above.
    assert found == pytest.approx(0.09486, rel=0.03)


def test_light_on_a_surface_is_counted_over_a_size_of_what_sent_it():
    # The caustic of a ball, seen in a mirror; a bead beside it has a size of its own.
    mirror = Material((1.0, 1.0, 1.0), metallic=1.0, roughness=0.0)
    wall = Polygon(np.array([[-2.0, y, z] for y, z in ((0, -2), (0, 2), (3, 2), (3, -2))], float), mirror)
    grounds, lamp = (Plane(Diffuse((0.5, 0.5, 0.5)), (6.0, 6.0)), wall), PointLight((1.2, 2.0, 0.0), (10.0, 10.0, 10.0))
    eye, at = np.array([-1.0, 1.6, 1.2]), np.array([-3.65, 0.0, 0.0])
    camera = Camera.looking_at(eye, at, width=24, height=24, focal_length=90)
    ball, bead = Sphere((0.0, 0.5, 0.0), 0.3, GLASS), Sphere((2.0, 0.02, 2.0), 0.01, GLASS)
    alone, beside = (
        Mitsuba(32).render(Scene(BLACK, grounds, objects, (lamp,)), camera, seed=1)
        for objects in ((ball,), (ball, bead))
    )
    np.testing.assert_allclose(beside.radiance.mean(), alone.radiance.mean(), rtol=0.03)
    assert beside.variance.mean() < 2 * alone.variance.mean()
