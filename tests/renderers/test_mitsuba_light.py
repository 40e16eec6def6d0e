"""The scene's light: what is sampled, with which density, and what arrives, beside sums over all directions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

from relume.errors import UnsupportedScene
from relume.scene.lights import DistantLight, Linear, PointLight, SphereLight
from relume.scene.scene import Box, Distant, Dome, Enclosure, Infinite, Scene
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

PROBE = (0.3, 0.4, -0.2)
ROOM = Box((-2.0, -0.5, -1.5), (2.0, 2.0, 1.5))
PLACES = [(0.3, 0.0, -0.2), (-1.2, 0.3, 0.9)]
LAMP = SphereLight((0.8, 1.2, -0.5), 0.25, (30.0, 20.0, 10.0))
SAMPLES = 1 << 18
ROWS = 512
"""Of the sums over directions: a lamp's rim is then a few thousandths of its light."""


def walls() -> Enclosure:
    mesh = trimesh.creation.box(bounds=[ROOM.low, ROOM.high])
    return Enclosure(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32))


DISTANT: dict[str, Distant] = {
    "infinite": Infinite(), "dome": Dome(3.0, (0.2, 0.0, 0.1)), "box": ROOM, "mesh": walls(),
}  # fmt: skip


def window() -> EnvironmentMap:
    """A dim room with a window of 0.4 by 0.3 rad and a glow above."""
    radiance = np.full((64, 128, 3), 0.3, np.float32)
    radiance[20:26, 30:38] = (4.0, 6.0, 9.0)
    radiance[6:12, 80:100] = (20.0, 15.0, 6.0)
    return EnvironmentMap(radiance)


def light_of(distant: Distant, *lamps: Any, light: EnvironmentMap | None = None) -> Any:
    from relume.renderers.mitsuba.transport.light import SceneLight

    return SceneLight(Scene(light or window(), (), (), lamps, distant, PROBE))


def drawn(mi: Any, light: Any, place: tuple[float, float, float], seed: int = 1) -> Any:
    random = np.random.default_rng(seed).random((3, SAMPLES)).astype(np.float32)
    point = mi.Point2f(mi.Float(random[1]), mi.Float(random[2]))
    return light.sample(mi.Point3f(*place), mi.Float(random[0]), point, mi.Bool(True))


def looked(mi: Any, light: Any, place: tuple[float, float, float], directions: np.ndarray) -> tuple[Any, Any]:
    """Radiance (N, 3) and density (N,) of directions (N, 3) with nothing before the light."""
    ways = mi.Vector3f(*(mi.Float(np.ascontiguousarray(d, np.float32)) for d in directions.T))
    given = mi.Point3f(*place), ways, mi.Float(np.inf), mi.Bool(True)
    radiance, weighed = (np.array(light.arriving(*given, mi.Float(own))).T for own in (0.0, 1.0))
    # The balance heuristic weighs radiance by 1/(1 + p) beside a density of 1; of the brightest channel for precision.
    brightest = radiance.max(axis=1)
    return radiance, brightest / np.maximum(weighed.max(axis=1), 1e-30) - 1


def over_all_directions(distant: Distant, place: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Radiance (N, 3) that the place sees of the map, and what each direction counts for a surface that faces up."""
    directions = pixel_directions(LatLong(), ROWS).reshape(-1, 3)
    areas = LatLong().solid_angles(ROWS).reshape(-1)
    if isinstance(distant, Infinite):
        towards = directions
    else:
        shape = ROOM if isinstance(distant, Enclosure) else distant
        origin = np.array(place)
        towards = origin + shape.distances(origin, directions)[:, None] * directions - np.array(PROBE)
        towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    return window().lookup(towards), areas * np.maximum(directions[:, 1], 0)


def in_lamp(place: tuple[float, float, float]) -> np.ndarray:
    """Which directions meet the lamp."""
    away = np.subtract(LAMP.position, place)
    distance = np.linalg.norm(away)
    cosine = pixel_directions(LatLong(), ROWS).reshape(-1, 3) @ (away / distance)
    return cosine > np.sqrt(1 - (LAMP.radius / distance) ** 2)


def assert_arrives(found: Any, expected: np.ndarray) -> None:
    """The mean of the samples on a surface that faces up is the irradiance, within its noise, which is small."""
    up = np.maximum(np.array(found.direction)[1], 0) * np.array(found.valid)
    values = np.array(found.weight).astype(np.float64) * up
    error = values.std(axis=1) / np.sqrt(SAMPLES)
    assert np.all(error < 0.006 * expected)
    # A thousandth on top, of the sum's own pixels and of single precision.
    assert np.all(np.abs(values.mean(axis=1) - expected) < 4 * error + 1e-3 * expected), (values.mean(1), expected)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("distant", DISTANT.values(), ids=DISTANT)
def test_what_is_sampled_is_the_irradiance_that_all_directions_give(mi, distant, place):
    radiance, counts = over_all_directions(distant, place)
    assert_arrives(drawn(mi, light_of(distant), place), radiance.T @ counts)


@pytest.mark.parametrize("place", PLACES)
def test_a_lamp_that_has_a_size_is_added_to_what_is_behind_it(mi, place):
    radiance, counts = over_all_directions(ROOM, place)
    lamp = in_lamp(place)
    expected = np.where(lamp[:, None], radiance + LAMP.radiance, radiance).T @ counts
    assert_arrives(drawn(mi, light_of(ROOM, LAMP), place), expected)


def test_a_sphere_a_point_and_a_sun_in_the_dark_light_as_the_formulas_say(mi):
    place = PLACES[0]
    away = np.subtract(LAMP.position, place)
    distance = np.linalg.norm(away)
    # A sphere that is all above the horizon: π L (r/d)² cos θ (Foley & al. 1990, and any table of form factors).
    sphere = np.pi * np.array(LAMP.radiance) * LAMP.radius**2 / distance**2 * away[1] / distance
    point = PointLight((0.3, 2.0, -0.2), (4.0, 2.0, 1.0))
    sun = DistantLight((0.0, 3.0, 4.0), (5.0, 10.0, 20.0))
    darkness = EnvironmentMap(np.zeros((8, 16, 3), np.float32))
    light = light_of(Infinite(), LAMP, point, sun, light=darkness)
    expected = sphere + np.array(point.intensity) / 4 + 0.6 * np.array(sun.irradiance)
    assert_arrives(drawn(mi, light, place), expected)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("distant", DISTANT.values(), ids=DISTANT)
def test_the_density_of_all_directions_is_one(mi, distant, place):
    directions = pixel_directions(LatLong(), ROWS).reshape(-1, 3)
    _, density = looked(mi, light_of(distant), place, directions)
    # The density steps from pixel to pixel of the map, which this sum's pixels cut.
    assert density.astype(np.float64) @ LatLong().solid_angles(ROWS).reshape(-1) == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize("lamps", [(), (LAMP,)], ids=["map", "lamp"])
@pytest.mark.parametrize("distant", DISTANT.values(), ids=DISTANT)
def test_what_is_looked_at_has_the_density_and_the_radiance_of_what_was_sampled(mi, distant, lamps):
    place = PLACES[1]
    # A lamp alone: the map behind it would be seen in the same directions, and has a density of its own.
    light = light_of(distant, *lamps, light=EnvironmentMap(np.zeros((8, 16, 3), np.float32)) if lamps else None)
    found = drawn(mi, light, place)
    valid = np.array(found.valid)
    directions, density = np.array(found.direction).T[valid], np.array(found.density)[valid]
    weight = np.array(found.weight).T[valid]
    radiance, chance = looked(mi, light, place, directions)
    # Single precision puts a few directions into the next pixel of the map, or beside the lamp.
    close = np.isclose(chance, density, rtol=2e-3) & np.isclose(radiance, weight * density[:, None], rtol=2e-2).all(1)
    assert valid.mean() > 0.9 and close.mean() > 0.999


def test_a_mesh_of_a_box_is_the_box(mi):
    place = PLACES[1]
    box, mesh = (drawn(mi, light_of(distant), place) for distant in (ROOM, walls()))
    assert np.array(mesh.valid).all()
    for name in ("direction", "distance", "weight", "density"):
        one, other = np.array(getattr(box, name)), np.array(getattr(mesh, name))
        assert np.isclose(other, one, rtol=1e-3, atol=1e-5).mean() > 0.9999, name


def test_a_wall_of_the_distant_scene_hides_what_is_behind_it(mi):
    # A screen across the room at x = −0.5, which the probe does not see through, and neither does the place.
    screen = np.array([[-0.5, -0.5, -1.5], [-0.5, 2.0, -1.5], [-0.5, 2.0, 1.5], [-0.5, -0.5, 1.5]], np.float32)
    outer = walls()
    faces = np.concatenate([outer.faces, np.array([[0, 1, 2], [0, 2, 3]], np.int32) + len(outer.vertices)])
    split = Enclosure(np.concatenate([outer.vertices, screen]), faces)
    place = (1.0, 0.0, 0.5)
    # On the probe's side the screen is a nearer wall.
    right = Box((-0.5, -0.5, -1.5), ROOM.high)
    radiance, counts = over_all_directions(right, place)
    assert_arrives(drawn(mi, light_of(split), place), radiance.T @ counts)
    # Behind it nothing of the walls there is known: the place sees the screen alone.
    behind = (-1.2, 0.3, 0.9)
    found = drawn(mi, light_of(split), behind)
    valid = np.array(found.valid)
    reached = behind[0] + (np.array(found.distance) * np.array(found.direction)[0])[valid]
    assert 0 < valid.mean() < 0.9 and np.abs(reached + 0.5).max() < 1e-3


def test_a_lamp_of_another_falloff_is_refused(mi):
    with pytest.raises(UnsupportedScene, match="square law"):
        light_of(Infinite(), PointLight((0, 1, 0), (1, 1, 1), Linear(3.0)))
