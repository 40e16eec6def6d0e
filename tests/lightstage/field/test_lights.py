"""The lights of a stage and their cells."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions, voronoi_solid_angles
from relume.sphere.directions import rotation_about
from small_stages import grid_directions

AXES = np.concatenate([np.eye(3), -np.eye(3)])


def test_six_lights_along_the_axes_have_a_sixth_of_the_sphere_each():
    np.testing.assert_allclose(StageLights.towards(AXES).solid_angles, 4 * np.pi / 6, rtol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 50, 2048])
def test_the_cells_fill_the_sphere(count):
    directions = np.random.default_rng(count).normal(size=(count, 3))
    areas = StageLights.towards(directions).solid_angles
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(4 * np.pi, rel=1e-12)


def test_a_cell_is_what_is_nearest_to_its_light():
    lights = StageLights.towards(np.random.default_rng(3).normal(size=(40, 3)))
    samples = even_directions(400_000)
    counted = np.bincount(np.argmax(samples @ lights.directions.T, axis=1), minlength=40) * (4 * np.pi / len(samples))
    np.testing.assert_allclose(lights.solid_angles, counted, rtol=5e-3)


def test_the_cells_of_a_grid_go_as_the_sine_of_the_inclination():
    areas = StageLights.towards(grid_directions(64, 128, 0.5)).solid_angles.reshape(64, 128)
    sines = np.sin(np.pi * (np.arange(64) + 0.5) / 64)
    expected = sines / sines.sum() * 4 * np.pi / 128
    np.testing.assert_allclose(areas[4:-4], np.broadcast_to(expected[4:-4, None], (56, 128)), rtol=5e-3)


@pytest.mark.parametrize("height", [0.0, 0.3, -0.8])
@pytest.mark.parametrize("turns", [(0, 90, 180, 270), (10, 40, 200), (350, 5, 100, 130, 260), (20, 25)])
def test_lights_on_one_circle_share_the_sphere_by_their_turns(turns, height):
    turned = np.radians(turns)
    ring = np.stack([np.cos(turned), np.zeros(len(turns)), np.sin(turned)], axis=1) * np.sqrt(1 - height**2)
    ring[:, 1] = height
    ring = ring @ rotation_about((1.0, 2.0, 3.0), 40).T
    order = np.argsort(turned)
    gaps = np.diff(turned[order], append=turned[order[0]] + 2 * np.pi)
    areas = voronoi_solid_angles(ring, "abcdef")
    np.testing.assert_allclose(areas[order], gaps + np.roll(gaps, 1), rtol=1e-9)
    # What is nearest to each, counted.
    samples = even_directions(200_000)
    counted = np.bincount(np.argmax(samples @ ring.T, axis=1), minlength=len(ring)) * (4 * np.pi / len(samples))
    np.testing.assert_allclose(areas, counted, rtol=2e-3)


def test_lights_hardly_off_one_circle_are_counted_or_cut_as_exactly():
    turns = np.radians([0, 70, 150, 210, 290])
    ring = np.stack([np.cos(turns), 2e-6 * np.arange(5), np.sin(turns)], axis=1)
    ring /= np.linalg.norm(ring, axis=1, keepdims=True)
    gaps = np.diff(turns, append=2 * np.pi)
    np.testing.assert_allclose(voronoi_solid_angles(ring, "abcde"), gaps + np.roll(gaps, 1), rtol=2e-3)


@pytest.mark.parametrize(
    ("directions", "names", "said"),
    [
        ([[1.0, 0, 0], [0, 1, 0], [2, 0, 0]], ("left", "top", "again"), '"left" and "again" have one direction'),
        ([[1.0, 0, 0], [0, 0, 0]], ("a", "b"), 'the light "b" has the direction'),
        (AXES[:2], ("a", "a"), 'two lights are called "a"'),
    ],
)
def test_impossible_lights_are_refused_by_name(directions, names, said):
    with pytest.raises(ValueError, match=said):
        StageLights.towards(np.array(directions), names)
