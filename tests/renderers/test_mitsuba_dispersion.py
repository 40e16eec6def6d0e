"""Dispersion in one picture: angles of the catalogue, white that stays white, and the picture that each band makes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh

from lights import constant
from montecarlo import assert_mean_agrees
from relume.image.colour import LUMINANCE_WEIGHTS
from relume.light.spectra.hero import STRATA, strata
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.progressive.accumulation import pass_seed
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight
from relume.scene.materials.glasses import GLASSES, Glass
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Sphere
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from solids import built, quad

CAMERA = Camera.looking_at(np.array([0, 0.0, 3.0]), np.zeros(3), width=8, height=8, focal_length=60)
APEX = np.radians(60)
BANDS = 24
"""Of the reference by brute force."""


def glass(of: Glass) -> Material:
    return Material(roughness=0.0, transmission=1.0, glass=of)


def prism(material: Material, width: float = 4.0) -> Any:
    """An equilateral prism along z, its apex up: faces of length 1 m."""
    corners = np.array([[-0.5, 0.0], [0.5, 0.0], [0.0, np.sqrt(0.75)]]) - [0.0, np.sqrt(0.75) / 3]
    body = trimesh.creation.extrude_triangulation(corners, [[0, 1, 2]], width)
    body.apply_translation([0, 0, -width / 2])
    return built(body, material, "prism")


@pytest.mark.parametrize("name", ["N-BK7", "SF11", "diamond"])
@pytest.mark.parametrize("place", [0.02, 0.3, 0.5, 0.8, 0.98])
def test_light_leaves_a_prism_at_the_catalogues_angle(mi, name, place):
    # At minimum deviation: sin((A + δ)/2) = n sin(A/2), which the refraction angle A/2 at both faces makes.
    from relume.renderers.mitsuba.transport.plain import Plain

    apex = APEX if name != "diamond" else np.radians(40)
    wavelength = np.interp(place * STRATA, np.arange(STRATA + 1), strata()[0])
    n = float(GLASSES[name].index(wavelength))
    corners = [[-np.tan(apex / 2), 0.0], [np.tan(apex / 2), 0.0], [0.0, 1.0]]
    body = trimesh.creation.extrude_triangulation(np.array(corners), [[0, 1, 2]], 1.0)
    body.apply_translation([0, -0.5, -0.5])
    world = Plain(Scene(constant(4), objects=(built(body, glass(GLASSES[name])),)), CAMERA, 8).world
    assert world.dispersion is not None
    incidence = np.arcsin(n * np.sin(apex / 2))
    # Down onto the left face, so that it runs level inside.
    turn = incidence - apex / 2
    way = np.array([np.cos(turn), np.sin(turn), 0.0])
    begin = np.array([-np.tan(apex / 2) / 2, 0.0, 0.0]) - way
    ray = mi.Ray3f(mi.Point3f(begin.tolist()), mi.Vector3f(way.tolist()))
    for _ in range(2):
        si = world.objects.ray_intersect(ray)
        assert bool(si.is_valid()[0])
        si.time = world.dispersion.index(si.shape, mi.Float(place))
        assert float(si.time[0]) == pytest.approx(n, abs=2e-6)
        sample, _ = si.bsdf().sample(mi.BSDFContext(), si, mi.Float(0.999999), mi.Point2f(0.5, 0.5))
        ray = si.spawn_ray(si.to_world(sample.wo))
    out = np.array(ray.d).ravel()
    deviation = np.arctan2(way[0] * out[1] - way[1] * out[0], way @ out)
    expected = -(2 * np.arcsin(n * np.sin(apex / 2)) - apex)
    assert np.degrees(deviation) == pytest.approx(np.degrees(expected), abs=0.01)


def test_the_index_of_a_path_is_its_wavelengths(mi):
    from relume.renderers.mitsuba.transport.plain import Plain

    solids = (Sphere((0, 0, 0), 1.0, Diffuse((0.5, 0.5, 0.5))), prism(glass(GLASSES["SF11"])))
    world = Plain(Scene(constant(4), objects=solids), CAMERA, 8).world
    assert world.dispersion is not None
    plain, flint = (mi.ShapePtr(shape) for shape in world.objects.shapes())
    places = np.linspace(0, 0.999, 41)
    lengths = np.interp(places * STRATA, np.arange(STRATA + 1), strata()[0])
    found = np.array(world.dispersion.index(flint, mi.Float(places)))
    np.testing.assert_allclose(found, GLASSES["SF11"].index(lengths), atol=3e-6)
    assert np.all(np.array(world.dispersion.index(plain, mi.Float(places))) == 0)


@pytest.mark.parametrize("seen_by", ["render", "change"])
def test_white_stays_white_in_a_furnace(seen_by):
    scene = Scene(constant(8), objects=(Sphere((0.0, 0.0, 0.0), 0.5, glass(GLASSES["SF11"])),))
    if seen_by == "render":
        found = Mitsuba(samples=1024, depth=60).render(scene, CAMERA, seed=1)
        seen, variance = found.radiance, found.variance
    else:
        change = Differential(samples=1024, depth=60).change(scene, CAMERA, seed=2)
        seen, variance = change.objects, change.objects_variance
    # Each path has one wavelength: pixels are noisy, and their mean is not.
    assert variance.mean() > 1e-5
    assert_mean_agrees(seen, variance, 1.0)
    assert np.all(np.sqrt(variance.mean(axis=(0, 1)) / 64) < 0.004)


def test_coloured_light_keeps_its_colour_where_nothing_parts_it():
    light = (1.0, 2.0, 0.25)
    scene = Scene(constant(8, light), objects=(Sphere((0.0, 0.0, 0.0), 0.5, glass(GLASSES["N-SF66"])),))
    found = Mitsuba(samples=1024, depth=60).render(scene, CAMERA, seed=3)
    assert_mean_agrees(found.radiance, found.variance, np.array(light))


def stripes() -> EnvironmentMap:
    """White and black by turns round the horizon, and a glow from all sides."""
    directions = pixel_directions(LatLong(), 64)
    bright = np.sin(10 * np.arctan2(directions[..., 0], -directions[..., 2])) > 0
    return EnvironmentMap((0.1 + 2.0 * bright)[..., None].repeat(3, -1).astype(np.float32))


def standing(material: Material) -> Any:
    """A prism of 40° on its end on the floor, that edge to the left; what goes in by one face leaves by the other."""
    corners = np.array([[-np.tan(np.radians(20)), 0.0], [np.tan(np.radians(20)), 0.0], [0.0, 1.0]])
    body = trimesh.creation.extrude_triangulation(corners, [[0, 1, 2]], 1.4)
    body.apply_translation([0, -0.5, -0.7])
    body.apply_transform(np.array([[0, -1, 0, 0], [0, 0, 1, 0], [-1, 0, 0, 0], [0, 0, 0, 1.0]]))
    return built(body, material, "prism")


FLOOR = Plane(Diffuse((0.7, 0.7, 0.7)), (6.0, 6.0), -0.7)
FLINT = glass(GLASSES["N-SF66"])
OTHER = Sphere((0.5, -0.3, -1.2), 0.4, Diffuse((0.6, 0.6, 0.6)))
VIEW = Camera.looking_at(np.array([0, 0.8, 3.0]), np.array([0.0, -0.2, 0.0]), width=10, height=8, focal_length=12)
SUN = DistantLight((-1.0, 0.8, 0.1), (2.0, 2.0, 2.0))
SCENES = {
    "a prism on a floor": (Scene(stripes(), (FLOOR,), (standing(FLINT),)), "objects"),
    "under a sun": (Scene(constant(4, 0.1), (FLOOR,), (standing(FLINT),), (SUN,)), ""),
    "a real prism and an object": (Scene(stripes(), (FLOOR, standing(FLINT)), (OTHER,)), "difference"),
}
PASSES = 8


def traced(scene: Scene, samples: int, seed: int) -> dict[str, np.ndarray]:
    """The planes of one pass, (8, 10, 3)."""
    from relume.renderers.mitsuba.transport.estimator import Estimator

    return Estimator(scene, VIEW, 8).traced(samples, seed)


def of_index(scene: Scene, wavelength: float) -> Scene:
    """The scene as light of one wavelength meets it."""

    def plain(shape: Any) -> Any:
        if getattr(shape.material, "glass", None) is None:
            return shape
        ior = float(shape.material.glass.index(wavelength))
        return replace(shape, material=replace(shape.material, glass=None, ior=ior, dispersion=0.0))

    return replace(scene, local=tuple(map(plain, scene.local)), objects=tuple(map(plain, scene.objects)))


@pytest.mark.usefixtures("mi")
@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_one_picture_is_the_sum_of_one_picture_for_each_band(name):
    # Spectral rendering by brute force: pictures of one wavelength each, drawn anew within its band for each pass.
    scene, coloured = SCENES[name]
    ends, weights, _ = strata()
    rng = np.random.default_rng(5)
    found = [traced(scene, 2048, pass_seed(1, index)) for index in range(PASSES)]
    per = STRATA // BANDS
    sums: list[dict[str, np.ndarray]] = []
    for again in range(PASSES // 2 - 1):
        whole: dict[str, np.ndarray] = {}
        for band in range(BANDS):
            stratum = band * per + int(rng.integers(per))
            wavelength = float(ends[stratum] + rng.random() * (ends[stratum + 1] - ends[stratum]))
            seed = pass_seed(2, again * BANDS + band)
            for plane, values in traced(of_index(scene, wavelength), 128, seed).items():
                # White light: all channels of a band's picture are alike.
                weight = weights[stratum] / BANDS if values.ndim == 3 else 1 / BANDS
                whole[plane] = whole.get(plane, 0.0) + weight * values
        sums.append(whole)
    for plane in ("objects", "difference"):
        one, other = (np.stack([each[plane] for each in made]).mean(axis=1) for made in (found, sums))
        error = np.sqrt(one.var(axis=0, ddof=1) / len(one) + other.var(axis=0, ddof=1) / len(other))
        # A variance of few passes is brought up to half of its neighbours'.
        error = np.maximum(error, 0.5 * error.mean())
        away = (one.mean(axis=0) - other.mean(axis=0)) / np.maximum(error, 1e-9)
        assert np.abs(away).max() < 5, (plane, away)
        if plane == coloured:
            # And the columns have colours, far beyond the noise.
            colours = other.mean(axis=0) - other.mean(axis=(0, 2))[:, None]
            assert np.abs(colours / error).max() > 6, colours / error


def landing(n: np.ndarray, way: np.ndarray, wall: float, count: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Heights (N, count) at which parallel light lands on a wall behind the prism, and its shares, by Snell's law."""

    def bent(direction: np.ndarray, normal: np.ndarray, eta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        cosine = -direction @ normal
        inside = np.sqrt(np.maximum(1 - (1 - cosine**2) / eta**2, 0))
        across, along = (cosine - eta * inside) / (cosine + eta * inside), (eta * cosine - inside) / (
            eta * cosine + inside
        )  # fmt: skip
        out = direction / eta[:, None] + ((cosine / eta) - inside)[:, None] * normal
        return out, 1 - (across**2 + along**2) / 2

    high, low = np.sqrt(0.75) * 2 / 3, -np.sqrt(0.75) / 3
    left, right = np.array([-np.sqrt(0.75), 0.5]), np.array([np.sqrt(0.75), 0.5])
    shares = (np.arange(count) + 0.5) / count
    entry = np.array([-0.5, low]) + shares[:, None] * np.array([0.5, high - low])
    inside, first = bent(np.broadcast_to(way, (len(n), 2)), left, n)
    apex = np.array([0.0, high])
    # Where each ray leaves the right face, (p + t d − apex) · right = 0.
    length = ((apex - entry) @ right)[None, :] / (inside @ right)[:, None]
    exit_ = entry[None] + length[..., None] * inside[:, None]
    outside, second = bent(inside, -right, 1 / n)
    height = exit_[..., 1] + (wall - exit_[..., 0]) * (outside[:, 1] / outside[:, 0])[:, None]
    there = (exit_[..., 1] > low) & (exit_[..., 1] < high)
    return height, there * (first * second)[:, None]


def test_the_spectrum_of_a_prism_lands_where_the_catalogue_says(mi):
    from relume.renderers.mitsuba.transport.estimator import Estimator

    # A wall 3 m behind, seen by a camera that stands before it.
    wall, eye = 3.0, np.array([1.5, -2.0, 0.0])
    corners = [[wall, -9.0, -9.0], [wall, 9.0, -9.0], [wall, 9.0, 9.0], [wall, -9.0, 9.0]]
    turn = np.arcsin(GLASSES["SF11"].n_d * 0.5) - np.radians(30)
    way = np.array([np.cos(turn), np.sin(turn)])
    sun = DistantLight((-float(way[0]), -float(way[1]), 0.0), (1.0, 1.0, 1.0))
    # What would come in by the prism's base is held off.
    low = -np.sqrt(0.75) / 3 - 1e-3
    shade = quad([[-0.5, low, -0.2], [0.5, low, -0.2], [0.5, low, 0.2], [-0.5, low, 0.2]], Diffuse((0.0, 0.0, 0.0)))
    solids = (quad(corners, Diffuse((0.8, 0.8, 0.8))), shade), (prism(glass(GLASSES["SF11"]), 0.3),)
    scene = Scene(constant(4, 0.0), *solids, (sun,))
    camera = Camera.looking_at(eye, eye + np.array([1.0, 0, 0]), width=64, height=512, focal_length=192.0)
    # In and out again: what is mirrored inside first is left out.
    estimator = Estimator(scene, camera, 2)
    assert estimator.world.smooth
    light = np.stack(
        [each["difference"].sum(axis=1) for each in estimator._lit(250_000, [pass_seed(3, n) for n in range(4)])]
    )
    ends, weights, _ = strata()
    heights, shares = landing(GLASSES["SF11"].index((ends[1:] + ends[:-1]) / 2), way, wall)
    rows = eye[1] - (np.arange(512) + 0.5 - 256) * (wall - eye[0]) / 192
    means, angle = [], 90.0
    for colour in (*np.eye(3), LUMINANCE_WEIGHTS):
        weight = shares * (weights @ colour)[:, None]
        expected = (heights * weight).sum() / weight.sum()
        seen = light @ colour
        each = (rows * seen).sum(axis=1) / seen.sum(axis=1)
        means.append(each.mean())
        error = each.std(ddof=1) / 2
        assert abs(each.mean() - expected) < 5 * error + 1e-4, (colour, each, expected)
        angle = np.degrees(np.arctan(each.mean() / wall) - np.arctan(expected / wall))
    # All light, by luminance; half a metre of beam lets no more be said of a million rays.
    assert abs(angle) < 0.05
    # Red is bent least.
    assert means[0] - means[1] > 0.1 and means[1] - means[2] > 0.25
