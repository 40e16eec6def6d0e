"""Photon maps against closed forms, against Mitsuba, and against themselves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

import relume as rl
from cornell_box import cornell_box, cornell_camera
from relume.errors import UnsupportedScene
from relume.renderers import PhotonMap, PhotonStep, drawn_discs, drawn_photons
from relume.scene.lights import AmbientLight, DistantLight, Linear, PointLight, RectangleLight, SphereLight
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.media import Medium
from relume.scene.scene import Dome, Scene
from relume.scene.shapes.shapes import Mesh, Plane, Sphere
from relume.sphere.environment_map import EnvironmentMap

DARK = EnvironmentMap(np.zeros((2, 4, 3), np.float32))
EVEN = EnvironmentMap(np.ones((4, 8, 3), np.float32))
GLASS = Material(roughness=0.0, transmission=1.0, ior=1.5, name="glass")
GREY, BLACK = Diffuse((0.5, 0.5, 0.5)), Diffuse((0.0, 0.0, 0.0))
LAMP = PointLight((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def looking(position: Any, target: Any, size: int = 8, focal_length: float | None = None) -> rl.Camera:
    focal_length = focal_length or float(size)
    return rl.Camera.looking_at(np.array(position, float), np.array(target, float), width=size, height=size,
                                focal_length=focal_length)  # fmt: skip


def last(steps: Iterator[PhotonStep]) -> PhotonStep:
    *_, step = steps
    return step


def test_inside_a_ball_lit_from_its_middle_light_is_what_the_series_says():
    albedo, radius = 0.6, 2.0
    scene = Scene(DARK, (Sphere((0.0, 0.0, 0.0), radius, Diffuse((albedo, albedo, albedo))),), lights=(LAMP,))
    step = last(PhotonMap(photons=4000, passes=2).steps(scene, looking((0, 0, 1), (0, 0.3, 0), focal_length=3.0)))
    # Φ = 4π; each landing keeps ρ of it, so Σ = Φ / (1 − ρ) lands, over 4π r².
    landed = step.flight.surface.power.sum(0)
    np.testing.assert_allclose(landed, 4 * np.pi / (1 - albedo), rtol=0.02)
    radiance = albedo / np.pi * 4 * np.pi / (1 - albedo) / (4 * np.pi * radius**2)
    np.testing.assert_allclose(step.render.radiance.mean((0, 1)), radiance, rtol=0.02)
    # The map itself, without final gathering and shadow rays, says the same.
    plain = PhotonMap(photons=10_000, neighbours=200, passes=4, gather=0).render(
        scene, looking((0, 0, 1), (0, 0.3, 0), focal_length=3.0)
    )
    np.testing.assert_allclose(plain.radiance.mean((0, 1)), radiance, rtol=0.02)


def test_photons_keep_the_energy_of_their_lamps():
    step = last(PhotonMap(photons=20_000, passes=1, gather=0).steps(cornell_box(), cornell_camera(4)))
    flight = step.flight
    # π·L·A, and what is absorbed, escapes through the open side or is cut.
    np.testing.assert_allclose(flight.sent, np.pi * np.array([17, 12, 4]) * 0.13 * 0.105, rtol=1e-4)
    np.testing.assert_allclose(flight.absorbed + flight.escaped + flight.cut, flight.sent, rtol=0.01)
    assert flight.cut.max() < 1e-6 * flight.sent.max()


def away_from_lamps(radiance: np.ndarray, brightest: float) -> np.ndarray:
    """Which pixels (H, W) are no brighter, and do not touch one that is: those see a lamp's edge, which is noisy."""
    return np.asarray(binary_erosion(radiance.max(-1) < brightest, border_value=1), bool)


def cornell_mitsuba(size: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Mitsuba's radiance, and which pixels do not show the lamp, whose edges are noisy."""
    truth = rl.Mitsuba(samples=samples, depth=40).render(cornell_box(), cornell_camera(size), seed=1).radiance
    return truth, away_from_lamps(truth, 1)


# slow: test_a_corner_under_each_kind_of_lamp_is_as_bright_as_mitsubas goes red for the same break.
@pytest.mark.slow
def test_the_cornell_box_is_as_bright_as_mitsubas():
    truth, walls = cornell_mitsuba(24, 256)
    found = PhotonMap(photons=25_000, passes=8).render(cornell_box(), cornell_camera(24))
    np.testing.assert_allclose(found.radiance[walls].mean(0), truth[walls].mean(0), rtol=0.02)
    assert found.matte.max() == 1 and found.matte.min() == 0
    assert np.all(np.isfinite(found.variance)) and found.samples == found.passes == 8


@pytest.mark.slow
def test_each_part_of_a_finer_cornell_box_is_as_bright_as_mitsubas():
    truth, walls = cornell_mitsuba(64, 2048)
    found = PhotonMap(photons=150_000, passes=32).render(cornell_box(), cornell_camera(64)).radiance
    np.testing.assert_allclose(found[walls].mean(0), truth[walls].mean(0), rtol=0.01)
    for rows in np.split(np.arange(64), 4):
        for columns in np.split(np.arange(64), 4):
            part = np.ix_(rows, columns)
            if walls[part].all():
                np.testing.assert_allclose(found[part].mean((0, 1)), truth[part].mean((0, 1)), rtol=0.03)


def through_ball(reach: float, ior: float = 1.5, radius: float = 0.3, lamp: float = 2.0, floor: float = 1.0) -> float:
    """Flux of a lamp of intensity 1 that a ball sends, by two refractions, to within `reach` of the spot below it.

    The ball's middle lies `lamp` below the lamp and `floor` above the floor; of each ring of rays Fresnel's shares.
    """
    rays = 20_000
    angle = np.arcsin(radius / lamp) * (np.arange(rays) + 0.5) / rays
    outside = np.arcsin(lamp * np.sin(angle) / radius)
    inside = np.arcsin(np.sin(outside) / ior)
    a, b = np.cos(outside), np.cos(inside)
    reflected = (((a - ior * b) / (a + ior * b)) ** 2 + ((ior * a - b) / (ior * a + b)) ** 2) / 2
    leaves = outside - angle + np.pi - 2 * inside
    down = angle - 2 * (outside - inside)
    at = radius * np.sin(leaves) + (floor + radius * np.cos(leaves)) * np.tan(down)
    ring = 2 * np.pi * np.sin(angle) * np.arcsin(radius / lamp) / rays
    return float(np.sum(ring * (1 - reflected) ** 2 * (np.abs(at) < reach)))


def caustic_scene() -> Scene:
    lamp = PointLight((0.0, 3.0, 0.0), (1.0, 1.0, 1.0))
    return Scene(DARK, (Plane(GREY, size=(6.0, 6.0)),), (Sphere((0.0, 1.0, 0.0), 0.3, GLASS),), (lamp,))


def test_a_glass_ball_gathers_the_light_of_a_point():
    camera = looking((0, 0.6, 0), (0, 0, 1e-3), 24, 15.0)
    step = last(PhotonMap(photons=40_000, passes=2, gather=1).steps(caustic_scene(), camera))
    assert through_ball(0.2) == pytest.approx(0.02357, abs=1e-5)
    # The photons of the caustic map, and the picture of the floor below the ball.
    away = np.hypot(*step.caustics.surface.position[:, [0, 2]].T)
    rays = camera.rays()
    area = (-rays[..., 1]) ** -3 * 0.6**2 / camera.focal_length**2 * (rays @ -camera.rotation[:, 2]) ** 3
    places = camera.position - rays * 0.6 / rays[..., 1:2]
    flux = step.render.radiance[..., 1] * np.pi / 0.5 * area
    for reach in (0.2, 0.3):
        assert step.caustics.surface.power[away < reach, 1].sum() == pytest.approx(through_ball(reach), rel=0.02)
        assert flux[np.hypot(places[..., 0], places[..., 2]) < reach].sum() == pytest.approx(
            through_ball(reach), rel=0.05
        )


@pytest.mark.slow
def test_the_energy_of_a_caustic_is_within_two_per_cent_of_the_ball_lens():
    camera = looking((0, 0.6, 0), (0, 0, 1e-3), 96, 60.0)
    step = last(PhotonMap(photons=200_000, passes=8, gather=1).steps(caustic_scene(), camera))
    rays = camera.rays()
    area = (-rays[..., 1]) ** -3 * 0.6**2 / camera.focal_length**2 * (rays @ -camera.rotation[:, 2]) ** 3
    places = camera.position - rays * 0.6 / rays[..., 1:2]
    away = np.hypot(*step.caustics.surface.position[:, [0, 2]].T)
    flux = step.render.radiance[..., 1] * np.pi / 0.5 * area
    for reach in (0.1, 0.2, 0.3, 0.4):
        seen = flux[np.hypot(places[..., 0], places[..., 2]) < reach].sum()
        assert seen == pytest.approx(through_ball(reach), rel=0.02)
        assert step.caustics.surface.power[away < reach, 1].sum() == pytest.approx(through_ball(reach), rel=0.01)


def test_under_an_even_sky_white_things_and_clear_glass_cannot_be_seen():
    white = Sphere((0.0, 0.0, 0.0), 0.5, Diffuse((1.0, 1.0, 1.0)))
    pane = Sphere((0.0, 0.0, 0.0), 1.0, GLASS)
    camera = looking((0, 0, 4), (0, 0, 0), 12, 24.0)
    clear = PhotonMap(photons=2000, passes=2).render(Scene(EVEN, (), (pane,)), camera)
    np.testing.assert_allclose(clear.radiance, 1, rtol=1e-5)
    # In glass radiance is n² times as high, on the white ball's surface too, and so seen from outside it is the same.
    within = PhotonMap(photons=20_000, passes=4, gather=4).render(Scene(EVEN, (), (pane, white)), camera)
    assert within.radiance[3:9, 3:9].mean() == pytest.approx(1, rel=0.03)


def test_a_painted_floor_under_an_even_sky_shows_its_picture():
    image = np.zeros((8, 8, 3), np.float32)
    image[:, 4:] = (0.8, 0.4, 0.2)
    scene = Scene(EVEN, (Plane(Diffuse(image), size=(2.0, 2.0)),))
    # 50,000 shadow rays for the mean below, whose noise is then 0.6 %.
    method = PhotonMap(photons=200, passes=16, shadows=128)
    seen = method.render(scene, looking((0, 2, 0), (0, 0, 1e-3), 8, 12.0)).radiance
    # From above with +Z up, +X lies to the left.
    bright, dark = seen[:, :3].mean((0, 1)), seen[:, 5:].mean((0, 1))
    np.testing.assert_allclose(bright, (0.8, 0.4, 0.2), rtol=0.02)
    np.testing.assert_allclose(dark, 0, atol=1e-6)


def test_what_an_object_changes_is_the_difference_of_two_renders():
    scene = cornell_box()
    change = PhotonMap(photons=2000, passes=2, gather=2).change(scene, cornell_camera(16), seed=3)
    assert change.matte[12, 10] == 1 and change.matte[2, 8] == 0
    assert change.objects[change.matte == 1].mean() > 0.01 and not change.objects[2, 8].any()
    # Beside the blocks it is darker than without them.
    floor = change.difference[15, 2:14][change.matte[15, 2:14] == 0]
    assert floor.mean() < 0


def test_light_through_coloured_glass_fades_by_beers_law():
    filter_ = replace(GLASS, attenuation_color=(0.5, 0.8, 1.0), attenuation_distance=1.0, ior=1.0)
    scene = Scene(EVEN, (), (Sphere((0.0, 0.0, 0.0), 1.0, filter_),))
    seen = PhotonMap(photons=100, passes=1).render(scene, looking((0, 0, 4), (0, 0, 0), 1, 400.0))
    np.testing.assert_allclose(seen.radiance[0, 0], np.array([0.5, 0.8, 1.0]) ** 2, rtol=1e-4)


def test_mirrors_reflect_what_they_face():
    mirror = Material((0.9, 0.5, 0.1), metallic=1.0, roughness=0.0)
    scene = Scene(EVEN, (), (Sphere((0.0, 0.0, 0.0), 1.0, mirror),))
    seen = PhotonMap(photons=100, passes=1).render(scene, looking((0, 0, 4), (0, 0, 0), 4, 400.0))
    np.testing.assert_allclose(seen.radiance, np.broadcast_to((0.9, 0.5, 0.1), (4, 4, 3)), rtol=1e-6)
    # A caustic by a mirror: photons of a lamp that only the mirror sends to the wall behind the lamp.
    floor = Plane(replace(mirror, base_color=(0.9, 0.9, 0.9)), size=(8.0, 8.0))
    wall = Sphere((0.0, 0.0, 0.0), 20.0, GREY)
    box = Scene(DARK, (floor, wall), (), (PointLight((0.0, 1.0, 0.0), (1.0, 1.0, 1.0)),))
    step = last(PhotonMap(photons=20_000, passes=1, gather=0).steps(box, looking((0, 2, 3), (0, 2, 0), 2)))
    # A square of side 8 seen from 1 above its middle: Ω = 4 asin(16/17).
    solid_angle = 4 * np.arcsin(16 / 17)
    assert step.caustics.surface.power[:, 0].sum() == pytest.approx(0.9 * solid_angle, rel=0.02)


def single_scattering(medium: Medium, lamp: np.ndarray, eye: np.ndarray, rays: np.ndarray, far: float) -> np.ndarray:
    """Radiance (N, 3) of light that was scattered once, between the eye and a black ball of radius `far`."""
    count = 4000
    middle = -rays @ eye
    length = middle + np.sqrt(middle**2 + far**2 - eye @ eye)
    way = length[:, None] * (np.arange(count) + 0.5) / count
    points = eye + way[..., None] * rays[:, None]
    distance = np.linalg.norm(lamp - points, axis=-1)
    cosine = np.einsum("nkj,nj->nk", (lamp - points) / distance[..., None], rays)
    left = np.exp(-np.multiply.outer(way + distance, medium.extinction)) * medium.scattering
    return (left * (medium.phase(cosine) / distance**2 * length[:, None] / count)[..., None]).sum(1)


@pytest.mark.parametrize("g", [0.0, 0.6])
def test_light_scattered_once_in_fog_is_the_integral_along_the_ray(g: float):
    medium = Medium((0.2, 0.2, 0.4), (0.3, 0.6, 0.1), g)
    lamp = PointLight((0.0, 3.0, 0.0), (1.0, 1.0, 1.0))
    scene = Scene(DARK, (Sphere((0.0, 0.0, 0.0), 8.0, BLACK),), lights=(lamp,), medium=medium)
    camera = looking((0, 0, 2), (0, 0, 0), 8)
    with pytest.warns(rl.errors.DoubtWarning, match="raise the depth"):
        seen = PhotonMap(photons=100, passes=6, depth=1).render(scene, camera).radiance
    truth = single_scattering(medium, np.array(lamp.position), camera.position, camera.rays().reshape(-1, 3), 8.0)
    np.testing.assert_allclose(seen.mean((0, 1)), truth.mean(0), rtol=0.01)
    assert truth[0, 0] != pytest.approx(truth[0, 1], rel=0.1)


def test_between_a_lamp_and_a_wall_fog_takes_what_beer_and_lambert_say():
    fog = Medium((0.3, 0.6, 0.9))
    room = Scene(DARK, (Sphere((0.0, 0.0, 0.0), 2.0, GREY),), lights=(LAMP,))
    camera = looking((0, 0, 0), (0, 0, 1), 6)
    clear, hazy = (
        PhotonMap(photons=2000, passes=1, gather=0).steps(s, camera) for s in (room, replace(room, medium=fog))
    )
    first, second = (last(steps).flight.surface for steps in (clear, hazy))
    share = second.power[second.direct].sum(0) / first.power[first.direct].sum(0)
    # Photons that chance let through, weighed by channel.
    np.testing.assert_allclose(share, np.exp(-2 * np.array(fog.extinction)), rtol=0.1)
    # By shadow rays and the camera's own way it is exact: there and back.
    direct = [
        PhotonMap(photons=1, passes=1).render(replace(room, medium=medium), camera).radiance for medium in (None, fog)
    ]
    expected = np.broadcast_to(np.exp(-4 * np.array(fog.extinction)), (6, 6, 3))
    np.testing.assert_allclose(direct[1] / direct[0], expected, rtol=0.005)


def test_inside_glass_there_is_no_fog():
    pane = replace(GLASS, ior=1.0)
    scene = Scene(EVEN, (), (Sphere((0.0, 0.0, 0.0), 1.0, pane),), medium=Medium((2.0, 2.0, 2.0)))
    # The fog ends where the ball does, and all of it would lie inside.
    seen = PhotonMap(photons=100, passes=1).render(scene, looking((0, 0, 4), (0, 0, 0), 2, 400.0))
    np.testing.assert_allclose(seen.radiance, 1, rtol=1e-3)


def test_in_an_endless_fog_photons_scatter_as_often_as_the_albedo_says():
    fog = Medium((0.5, 0.25, 0.5), (0.5, 0.75, 0.5), 0.4)
    far = Sphere((0.0, 0.0, 0.0), 12.0, BLACK)
    scene = Scene(DARK, (far,), lights=(LAMP,), medium=fog)
    method = PhotonMap(photons=5000, passes=1, gather=0, march=1)
    flight = last(method.steps(scene, looking((0, 0, 3), (0, 0, 0), 1))).flight
    albedo = np.array(fog.albedo)
    np.testing.assert_allclose(flight.fog.power.sum(0), 4 * np.pi * albedo / (1 - albedo), rtol=0.03)
    np.testing.assert_allclose(flight.absorbed + flight.escaped, flight.sent, rtol=0.01)


@pytest.mark.slow
def test_a_foggy_cornell_box_is_as_bright_as_mitsubas():
    scene, camera = replace(cornell_box(), medium=Medium((0.2, 0.2, 0.2), (1.5, 1.5, 1.5))), cornell_camera(24)
    truth = rl.Mitsuba(samples=4096, depth=64).render(scene, camera, seed=1)
    walls = away_from_lamps(truth.radiance, 1)
    found = PhotonMap(photons=60_000, passes=16, shadows=1).render(scene, camera).radiance
    np.testing.assert_allclose(found[walls].mean(0), truth.radiance[walls].mean(0), rtol=0.03)


@pytest.mark.parametrize(
    "lamp",
    [
        SphereLight((0.0, 2.0, 0.0), 0.3, (9.0, 6.0, 3.0)),
        RectangleLight((0.0, 2.0, 0.0), (0.0, -1.0, 0.2), (0.8, 0.4), (9.0, 6.0, 3.0)),
        DistantLight((1.0, 2.0, 0.5), (3.0, 2.0, 1.0)),
        None,
    ],
    ids=["sphere", "rectangle", "distant", "sky"],
)
def test_a_corner_under_each_kind_of_lamp_is_as_bright_as_mitsubas(lamp: Any):
    sky = np.full((8, 16, 3), 0.2, np.float32)
    sky[2, 10] = 20.0
    wall = Mesh(
        np.array([[-1, 0, -1], [1, 0, -1], [1, 2, -1], [-1, 2, -1]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32), Diffuse((0.8, 0.3, 0.3)), name="wall",
    )  # fmt: skip
    ball = Sphere((0.2, 0.4, 0.0), 0.4, Diffuse((0.5, 0.7, 0.5)))
    light = EnvironmentMap(sky) if lamp is None else DARK
    scene = Scene(
        light, (Plane(Diffuse((0.7, 0.7, 0.7)), size=(2.0, 2.0)), wall), (ball,), () if lamp is None else (lamp,)
    )
    camera = looking((0, 1.2, 3), (0, 0.8, 0), 16, 16.0)
    truth = rl.Mitsuba(samples=256, depth=16).render(scene, camera, seed=1).radiance
    found = PhotonMap(photons=12_000, passes=6, gather=6).render(scene, camera).radiance
    dim = away_from_lamps(truth, 3)
    np.testing.assert_allclose(found[dim].mean(0), truth[dim].mean(0), rtol=0.03)
    # The lamp itself is seen, and lit from one side alone.
    assert found.max() == pytest.approx(truth.max(), rel=0.35)


def test_the_same_seed_gives_the_same_pixels_whatever_the_threads():
    scene = replace(cornell_box(), medium=Medium((0.1, 0.1, 0.1), (0.4, 0.4, 0.4)))
    glass = Sphere((0.28, 0.45, 0.2), 0.08, GLASS)
    scene, camera = scene.adding(glass), cornell_camera(8)
    first, again, other = (
        PhotonMap(photons=3000, passes=2, threads=threads).render(scene, camera, seed=seed).radiance
        for threads, seed in ((1, 7), (3, 7), (1, 8))
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_passes_are_means_and_their_discs_shrink_as_knaus_and_zwicker_say():
    scene, camera = cornell_box(blocks=False), cornell_camera(8)
    steps = list(PhotonMap(photons=4000, passes=4, gather=0).steps(scene, camera))
    assert [step.render.passes for step in steps] == [1, 2, 3, 4]
    radii = [np.median(step.radius[step.radius > 0]) for step in steps]
    # r² goes as ∏ (i + α)/(i + 1) = 5/6, 8/9, 11/12.
    expected = np.sqrt(np.cumprod([1, 5 / 6, 8 / 9, 11 / 12]))
    np.testing.assert_allclose(radii / radii[0], expected, rtol=0.06)
    kept = list(PhotonMap(photons=4000, passes=2, gather=0, shrink=1.0).steps(scene, camera))
    assert np.median(kept[1].radius) == pytest.approx(np.median(kept[0].radius), rel=0.06)
    # With one pass nobody knows the noise.
    assert np.isnan(steps[0].render.variance).all() and np.isfinite(steps[1].render.variance).all()
    np.testing.assert_array_equal(steps[0].render.radiance, PhotonMap(photons=4000, passes=1, gather=0).render(
        scene, camera).radiance)  # fmt: skip


def test_the_stated_variance_is_that_of_many_renders():
    scene = Scene(
        DARK, (Sphere((0.0, 0.0, 0.0), 2.0, GREY),), lights=(SphereLight((0.0, 1.0, 0.0), 0.3, (1.0, 1.0, 1.0)),)
    )
    method, camera = PhotonMap(photons=300, passes=4, gather=2, shrink=1.0), looking((0, -0.5, 1), (0, -1, 0), 6)
    renders = [method.render(scene, camera, seed=seed) for seed in range(12)]
    seen = np.var([render.radiance[:, :, 1] for render in renders], axis=0, ddof=1)
    stated = np.mean([render.variance[:, :, 1] for render in renders], axis=0)
    assert stated.mean() == pytest.approx(seen.mean(), rel=0.25)


def test_drawn_photons_lie_where_the_camera_sees_them():
    scene, camera = cornell_box(), cornell_camera(32)
    step = last(PhotonMap(photons=4000, passes=1, gather=0).steps(scene, camera))
    picture = drawn_photons(step.flight.surface, scene, camera)
    assert picture.shape == (32, 32, 3) and picture.max() == pytest.approx(1)
    lit = picture.any(-1)
    assert 0.2 < lit.mean() < 1
    # The back of the tall block is hidden: of photons there none is drawn.
    behind = step.flight.surface.only(step.flight.surface.normal[:, 2] > 0.5)
    assert len(behind.power) and not drawn_photons(behind, scene, camera).any()
    # On the left wall they have taken its red.
    indirect = step.flight.surface.only(~step.flight.surface.direct)
    assert drawn_photons(indirect, scene, camera)[20:, :, 0].mean() > 0
    circles = drawn_discs(step, camera, every=16)
    changed = np.any(circles != step.render.radiance, axis=-1)
    assert 0 < changed.mean() < 0.5


REFUSED = [
    ({"objects": (Sphere((0, 0, 0), 1, Material(name="clay")),)}, "gloss of the material 'clay'"),
    ({"objects": (Sphere((0, 0, 0), 1, Ward((0.1, 0.1, 0.1), 0.1, 0.1, name="brush")),)}, "Ward material 'brush'"),
    ({"objects": (Sphere((0, 0, 0), 1, replace(GLASS, roughness=0.4)),)}, "gloss of the material 'glass'"),
    ({"objects": (Sphere((0, 0, 0), 1, replace(GLASS, dispersion=1.0)),)}, "dispersion of the material 'glass'"),
    (
        {"objects": (Sphere((0, 0, 0), 1, replace(GLASS, scattering_distance=(1.0, 1.0, 1.0), name="milk")),)},
        "what fills the body of the material 'milk'",
    ),
    ({"objects": (Sphere((0, 0, 0), 1, replace(GLASS, thin=True)),)}, "thinness of the material 'glass'"),
    ({"lights": (AmbientLight((1.0, 1.0, 1.0)),)}, "no place for ambient light; use rl.Whitted"),
    (
        {"lights": (PointLight((0.0, 2.0, 0.0), (1.0, 1.0, 1.0), Linear(3.0)),)},
        "no place for a point of light that does not fall by the square law; use rl.Whitted",
    ),
    ({"light": DARK}, "nothing shines"),
    ({"distant": Dome(5.0)}, "at infinity"),
    ({"local": (Plane(GREY),)}, "give it a size"),
]


@pytest.mark.parametrize(("change", "named"), REFUSED, ids=[named for _, named in REFUSED])
def test_what_photons_cannot_meet_is_refused_by_name(change: dict[str, Any], named: str):
    with pytest.raises(UnsupportedScene, match=named) as caught:
        PhotonMap().render(replace(Scene(EVEN), **change), looking((0, 0, 4), (0, 0, 0)))
    assert "\n" not in str(caught.value)


def test_a_lens_with_an_aperture_and_settings_out_of_range_are_refused():
    camera = replace(looking((0, 0, 4), (0, 0, 0)), aperture=0.01, focus=3.0)
    with pytest.raises(UnsupportedScene, match="aperture"):
        PhotonMap().render(Scene(EVEN, (Sphere((0, 0, 0), 1, GREY),)), camera)
    out_of_range: tuple[dict[str, Any], ...] = (
        {"photons": 0},
        {"neighbours": 1},
        {"passes": 0},
        {"gather": -1},
        {"shrink": 0.0},
        {"threads": 0},
    )
    for wrong in out_of_range:
        with pytest.raises(ValueError, match=f"{next(iter(wrong))} is"):
            PhotonMap(**wrong)
