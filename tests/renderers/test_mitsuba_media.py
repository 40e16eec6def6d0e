"""What fills objects: how much light passes, that scattering loses none, and which way it goes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

from lights import constant
from montecarlo import assert_mean_agrees
from relume.renderers.mitsuba.differential import Differential
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.materials.media import Medium
from relume.scene.scene import Scene
from solids import built, sphere

LIGHT = np.array([1.0, 2.0, 0.5])
FURNACE = constant(8, (1.0, 2.0, 0.5))
SAMPLES = 1 << 17


def media_of(mi: Any, *media: Medium | None) -> tuple[Any, list[Any]]:
    """The media, and the shapes that they fill."""
    from relume.renderers.mitsuba.transport.media import Media

    world = mi.load_dict({"type": "scene"} | {f"ball_{i}": {"type": "sphere"} for i in range(len(media))})
    shapes = world.shapes_dr()
    return Media(shapes, media), [mi.ShapePtr(shape) for shape in world.shapes()]


def crossed(mi: Any, medium: Medium, distance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of rays along z: whether each scattered on the way, its weight (3, N), and its direction after."""
    media, (shape,) = media_of(mi, medium)
    rng = mi.PCG32(size=SAMPLES)
    ray = mi.Ray3f(mi.Point3f(0, 0, 0), mi.Vector3f(0, 0, 1))
    scattered, weight, onward = media.crossed(ray, mi.Float(distance), media.number(shape), rng, mi.Bool(True))
    every = np.broadcast_to(np.array(scattered), SAMPLES)
    return every, np.broadcast_to(np.array(weight).reshape(3, -1), (3, SAMPLES)), np.array(onward.d)


def test_media_are_kept_apart_by_their_shapes_and_empty_ones_take_nothing(mi):
    thin, thick = Medium((1.0, 2.0, 3.0)), Medium((4.0, 5.0, 6.0))
    media, shapes = media_of(mi, thick, None, thin, thick)
    assert [int(np.array(media.number(shape))[0]) for shape in shapes] == [1, 0, 2, 1]
    for shape, absorption in zip(shapes, (thick.absorption, (0, 0, 0), thin.absorption, thick.absorption), strict=True):
        passed = np.array(media.passed(media.number(shape), mi.Float(0.3))).ravel()
        assert passed == pytest.approx(np.exp(-0.3 * np.array(absorption)), rel=1e-5)


def test_what_only_absorbs_takes_its_share_without_chance(mi):
    scattered, weight, _ = crossed(mi, Medium((1.0, 5.0, 0.0)), 0.4)
    assert not scattered.any()
    assert weight[:, 0] == pytest.approx(np.exp([-0.4, -2.0, 0.0]), rel=1e-5) and np.ptp(weight, axis=1).max() == 0


@pytest.mark.parametrize("absorption", [(0.0, 0.0, 0.0), (0.5, 1.0, 2.0)], ids=["white", "coloured"])
def test_of_what_scatters_the_unscattered_share_is_beer_and_lamberts(mi, absorption):
    medium, distance = Medium(absorption, (2.0, 1.0, 4.0)), 0.5
    scattered, weight, _ = crossed(mi, medium, distance)
    straight = np.where(scattered, 0, weight).astype(np.float64)
    error = straight.std(axis=1) / np.sqrt(SAMPLES)
    # Beer and Lambert's law.
    passed = np.exp(-distance * np.array(medium.extinction))
    assert np.all(np.abs(straight.mean(1) - passed) < 4 * error)
    assert np.all(error < 0.01 * passed)


def test_a_white_medium_loses_nothing_on_the_way(mi):
    _, weight, _ = crossed(mi, Medium((0.0, 0.0, 0.0), (2.0, 1.0, 4.0)), 0.5)
    values = weight.astype(np.float64)
    assert np.all(np.abs(values.mean(1) - 1) < 4 * values.std(1) / np.sqrt(SAMPLES))
    # Weighed by all channels together, none of them is far above 1.
    assert values.max() < 3.01


@pytest.mark.parametrize("g", [-0.6, 0.0, 0.3, 0.9])
def test_light_turns_with_the_mean_cosine_of_the_phase_function(mi, g):
    scattered, _, after = crossed(mi, Medium((0.0, 0.0, 0.0), (50.0, 50.0, 50.0), g), 1e3)
    assert scattered.all()
    np.testing.assert_allclose(np.linalg.norm(after, axis=0), np.ones(SAMPLES), rtol=0, atol=1e-5)
    mean = after.astype(np.float64).mean(1)
    assert mean[2] == pytest.approx(g, abs=4 / np.sqrt(SAMPLES))
    assert np.abs(mean[:2]).max() < 4 / np.sqrt(SAMPLES)


def test_a_body_that_only_scatters_cannot_be_seen_in_a_furnace():
    wax = Material(
        roughness=0.0, transmission=1.0, ior=1.3, scattering_distance=(0.5, 1.0, 2.0), scattering_albedo=(1.0, 1.0, 1.0)
    )
    camera = Camera(8, 8, 24.0, np.array([0, 0, 6.0]), np.eye(3))
    change = Differential(samples=256, depth=64).change(Scene(FURNACE, (), (sphere(wax, fine=3),)), camera, seed=7)
    assert change.matte.max() == 1
    # Paths end after 64 bounces, and facets under smooth normals turn some rays into the ball itself.
    expected = change.matte[..., None] * LIGHT
    assert_mean_agrees(change.objects, change.objects_variance, expected, near=5e-3)


def test_a_slab_takes_its_share_of_the_light_behind_it():
    # Looked through squarely; with an index of 1 nothing is mirrored at its faces.
    clear = Material(
        roughness=0.0, transmission=1.0, ior=1.0, attenuation_color=(0.5, 0.25, 0.8), attenuation_distance=0.3
    )
    slab = built(trimesh.creation.box(extents=(2, 2, 0.6)), clear)
    camera = Camera(4, 4, 400.0, np.array([0, 0, 3.0]), np.eye(3))
    change = Differential(samples=32).change(Scene(FURNACE, (), (slab,)), camera, seed=8)
    assert (change.matte == 1).all()
    # Twice the distance at which the colour is what it is; rays lean by less than a hundredth.
    expected = np.broadcast_to(LIGHT * np.array([0.25, 0.0625, 0.64]), change.objects.shape)
    assert change.objects == pytest.approx(expected, rel=1e-3)
