"""Directions towards the objects: their density is one of them, and every object is reached."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Sphere
from relume.sphere.mappings.mapping import LatLong, pixel_directions

WHITE = Diffuse((1.0, 1.0, 1.0))
BALLS = [
    Sphere((0.0, 0.5, 0.0), 0.3, WHITE),
    Sphere((1.0, 0.2, -0.4), 0.2, WHITE),
    Sphere((-0.5, 1.5, 0.4), 0.4, WHITE),
]
PLACE = (0.4, 0.0, 0.3)
UP = (0.0, 1.0, 0.0)
SAMPLES = 1 << 17


def guide_of(mi: Any, balls: list[Sphere], place: tuple[float, float, float], up: tuple[float, float, float]) -> Any:
    from relume.renderers.mitsuba.transport.sampling import Guide

    guide = Guide(balls)
    return guide, guide.cones(mi.Point3f(*place), mi.Vector3f(*up))


def drawn(mi: Any, guide: Any, cones: Any) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(3).random((2, SAMPLES)).astype(np.float32)
    direction = guide.sample(cones, mi.Point2f(mi.Float(random[0]), mi.Float(random[1])))
    return np.array(direction).T, np.array(guide.density(cones, direction))


@pytest.mark.parametrize("inside", [False, True], ids=["outside", "inside one"])
def test_the_density_of_all_directions_is_one_and_samples_follow_it(mi, inside):
    place = (0.0, 0.4, 0.05) if inside else PLACE
    guide, cones = guide_of(mi, BALLS, place, UP)
    grid = pixel_directions(LatLong(), 512).reshape(-1, 3)
    areas = LatLong().solid_angles(512).reshape(-1)
    density = np.array(guide.density(cones, mi.Vector3f(*(mi.Float(c.astype(np.float32)) for c in grid.T))))
    assert density.astype(np.float64) @ areas == pytest.approx(1, abs=5e-3)
    directions, chance = drawn(mi, guide, cones)
    assert (chance > 0).mean() > 0.9999
    # A function of direction has the same mean over the samples as over all directions.
    for function in (lambda d: d, lambda d: d**2):
        expected = (function(grid) * (density * areas)[:, None]).sum(0)
        values = function(directions.astype(np.float64))
        assert np.all(np.abs(values.mean(0) - expected) < 4 * values.std(0) / np.sqrt(SAMPLES) + 5e-3)


def test_every_object_above_the_horizon_is_aimed_at_and_none_below(mi):
    below = Sphere((0.4, -1.0, 0.3), 0.3, WHITE)
    guide, cones = guide_of(mi, [*BALLS, below], PLACE, UP)
    directions, _ = drawn(mi, guide, cones)
    reached = []
    for ball in (*BALLS, below):
        away = np.subtract(ball.centre, PLACE)
        cosine = directions @ (away / np.linalg.norm(away))
        reached.append(float((cosine > np.sqrt(1 - ball.radius**2 / (away @ away))).mean()))
    assert min(reached[:3]) > 0.02 and reached[3] == 0.0 and sum(reached) > 0.999


def test_more_objects_than_cones_are_all_within_some_cone(mi):
    many = [Sphere((0.3 * i, 0.4, 0.3 * j), 0.1, WHITE) for i in range(-3, 4) for j in range(-3, 4)]
    guide, cones = guide_of(mi, many, (0.0, 0.0, 3.0), UP)
    assert len(cones) == 8
    towards = np.array([np.subtract(ball.centre, (0.0, 0.0, 3.0)) for ball in many])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    density = guide.density(cones, mi.Vector3f(*(mi.Float(c.astype(np.float32)) for c in towards.T)))
    assert np.array(density).min() > 0


def test_directions_to_even_points_are_even_in_each_cone(mi):
    """The first number chooses the cone and then goes on within it: squares of even points stay even there."""
    balls = [Sphere((-1.6, 1.0, 0.3), 0.3, WHITE), Sphere((2.4, 1.0, 0.3), 0.3, WHITE)]
    guide, cones = guide_of(mi, balls, PLACE, UP)
    side = 256
    x, y = ((np.arange(side**2) // side**axis % side + 0.5) / side for axis in (1, 0))
    direction = guide.sample(cones, mi.Point2f(mi.Float(x.astype(np.float32)), mi.Float(y.astype(np.float32))))
    directions = np.array(direction).T.astype(np.float64)
    for ball in balls:
        # About its axis as many to each side, far closer than chance would have it (1 in √32768), and to its very rim.
        away = np.subtract(ball.centre, PLACE)
        axis = away / np.linalg.norm(away)
        inside = directions[directions @ axis > 0.5]
        across = np.cross(axis, UP)
        assert abs(float(np.sign(inside @ across).mean())) < 1e-3
        rim = np.sqrt(1 - ball.radius**2 / (away @ away))
        assert rim < (inside @ axis).min() < rim + 0.01 * (1 - rim) and (inside @ axis).max() > 1 - 0.01 * (1 - rim)
