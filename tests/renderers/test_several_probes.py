"""Maps of several probes joined on the walls of their place: against painted walls, and a room by our path tracer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import relume as rl
from relume.composite.surface.projection import box_mesh
from relume.image.radiance import OUTSIDE
from relume.light.constellations.local_lamps import free_lamp
from relume.renderers.environment_probe import environment
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.several_probes.interpolation import interpolate_probes
from relume.renderers.several_probes.placed_probe import PlacedProbe
from relume.scene.lights import RectangleLight, SphereLight
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Box, Distant, Dome, Enclosure, Infinite, Scene
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

ROOM = Box((-2.0, 0.0, -1.5), (2.0, 2.6, 1.5))
LEFT, RIGHT, BETWEEN = (-1.0, 0.7, 0.4), (1.0, 0.7, 0.4), (0.0, 0.7, 0.4)
ROWS = 64
DIRECTIONS = pixel_directions(LatLong(), ROWS)


def shining(points: np.ndarray) -> np.ndarray:
    """Radiance (…, 3) that walls of this test send from points (…, 3)."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([2 + np.sin(x + z), 1.5 + 0.5 * np.cos(2 * y), 2 + np.sin(y - x)], axis=-1)


def seen(place: tuple[float, float, float], distant: Box | Dome = ROOM) -> PlacedProbe:
    origin = np.array(place)
    distance = distant.distances(np.broadcast_to(origin, DIRECTIONS.shape), DIRECTIONS)
    return PlacedProbe(
        EnvironmentMap(shining(origin + distance[..., None] * DIRECTIONS).astype(np.float32), unit="cd/m²"), place
    )


def off(light: EnvironmentMap, truth: EnvironmentMap) -> float:
    """Root mean square of irradiance's error over all ways that a surface may face, as a share of the mean."""
    normals = np.random.default_rng(1).normal(size=(100, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    right = truth.irradiance(normals)
    return float(np.sqrt(np.mean((light.irradiance(normals) - right) ** 2)) / right.mean())


@pytest.mark.parametrize("distant", [ROOM, Dome(4.0, (0.0, 1.0, 0.0))], ids=["box", "dome"])
def test_painted_walls_are_seen_right_from_a_third_place(distant):
    joined = interpolate_probes([seen(LEFT, distant), seen(RIGHT, distant)], (0.3, 1.5, -0.6), distant)
    truth = seen((0.3, 1.5, -0.6), distant).light
    # Pixels over the edges of the room are means of the rays in them, and the truth has their middles.
    wrong = np.abs(joined.light.radiance - truth.radiance)
    assert wrong.mean() < 0.005 and np.quantile(wrong, 0.998) < 0.06
    assert off(joined.light, truth) < 0.001
    assert joined.light.unit == "cd/m²" and joined.notes == () and joined.disagreements == ()
    assert joined.unseen_solid_angle == 0 and not len(joined.lamps.positions)


def test_a_mesh_of_the_room_is_the_room():
    mesh = box_mesh(ROOM.low, ROOM.high, Diffuse((0.0, 0.0, 0.0)))
    probes = [seen(LEFT), seen(RIGHT)]
    as_mesh = interpolate_probes(probes, BETWEEN, Enclosure(mesh.vertices, mesh.faces)).light.radiance
    np.testing.assert_allclose(as_mesh, interpolate_probes(probes, BETWEEN, ROOM).light.radiance, rtol=1e-3)


def test_each_wall_is_taken_from_the_nearer_probe():
    bright = replace(seen(RIGHT), light=EnvironmentMap(np.full((ROWS, 2 * ROWS, 3), 1.02, np.float32)))
    dark = replace(seen(LEFT), light=EnvironmentMap(np.ones((ROWS, 2 * ROWS, 3), np.float32)))
    joined = interpolate_probes([dark, bright], BETWEEN, ROOM)
    left, right = joined.light.lookup(np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))[:, 0]
    assert left < 1.004 and right > 1.016
    np.testing.assert_allclose(joined.shares.sum(), 1)
    # At its own place a probe is believed.
    assert abs(interpolate_probes([dark, bright], RIGHT, ROOM).light.radiance.mean() - 1.02) < 2e-4


def test_variance_of_two_equal_maps_is_halved_where_both_count_alike():
    each = np.full((ROWS, 2 * ROWS, 3), 0.04, np.float32)
    probes = [replace(seen(LEFT), variance=each), replace(seen(RIGHT), variance=each)]
    variance = interpolate_probes(probes, BETWEEN, ROOM).variance
    assert variance is not None
    # Straight up, ahead and back both are as far away;  towards a wall the nearer one counts more.
    np.testing.assert_allclose(variance[[0, ROWS // 2], ROWS], 0.02, rtol=0.03)
    assert variance[ROWS // 2, ROWS // 2].mean() > 0.025
    assert interpolate_probes([probes[0], seen(RIGHT)], BETWEEN, ROOM).variance is None


def test_what_one_map_does_not_show_comes_from_the_other():
    marks = np.zeros((ROWS, 2 * ROWS), np.uint8)
    marks[:, :ROWS] = OUTSIDE
    bare = seen(LEFT)
    black = np.where(marks[..., None] > 0, 0, bare.light.radiance).astype(np.float32)
    blind = replace(bare, light=replace(bare.light, radiance=black, clipped=marks))
    joined = interpolate_probes([blind, seen(RIGHT)], BETWEEN, ROOM)
    assert off(joined.light, seen(BETWEEN).light) < 0.02
    assert joined.disagreements == ()


def test_a_wall_that_only_one_map_shows_bright_is_told_with_its_place():
    other = seen(RIGHT)
    towards = np.subtract((2.0, 1.6, -0.4), RIGHT) / np.linalg.norm(np.subtract((2.0, 1.6, -0.4), RIGHT))
    spot = DIRECTIONS @ towards > np.cos(0.5)
    radiance = np.where(spot[..., None], 8 * other.light.radiance, other.light.radiance).astype(np.float32)
    joined = interpolate_probes([seen(LEFT), replace(other, light=replace(other.light, radiance=radiance))], None, ROOM)
    worst = joined.disagreements[0]
    assert worst.probes == (0, 1) and worst.place is not None and 5 < worst.ratio < 9 and worst.share > 0.01
    assert np.linalg.norm(np.subtract(worst.place, (2.0, 1.6, -0.4))) < 0.6
    assert "probe 1 and probe 2 differ" in joined.notes[0].line and "wall at" in joined.notes[0].line


def test_probes_are_called_by_their_names():
    twice = replace(seen(RIGHT), name="right.exr")
    twice = replace(twice, light=replace(twice.light, radiance=2 * twice.light.radiance))
    joined = interpolate_probes([replace(seen(LEFT), name="left.exr"), twice], BETWEEN, ROOM)
    assert joined.notes[0].line.startswith("right.exr is 2.00 times as bright as left.exr where")
    assert joined.notes[1].line.startswith("left.exr and right.exr differ 2.0 times about the wall")
    same = [replace(seen(place), name="map.exr") for place in (LEFT, LEFT)]
    with pytest.raises(ValueError, match=r"^map.exr \(probe 1\) and map.exr \(probe 2\) both stood at"):
        interpolate_probes(same, BETWEEN, ROOM)


def test_a_map_of_another_exposure_is_told():
    twice = seen(RIGHT)
    twice = replace(twice, light=replace(twice.light, radiance=2 * twice.light.radiance))
    notes = interpolate_probes([seen(LEFT), twice], BETWEEN, ROOM).notes
    assert notes[0].line.startswith("probe 2 is 2.00 times as bright as probe 1 where")


def test_without_a_shape_maps_are_mixed_by_distance():
    maps = [
        replace(seen(p), light=EnvironmentMap(np.full((8, 16, 3), v, np.float32))) for p, v in ((LEFT, 1), (RIGHT, 3))
    ]
    assert interpolate_probes(maps, BETWEEN).light.radiance.mean() == pytest.approx(2)
    # Half a metre and one and a half: weights 9 to 1.
    joined = interpolate_probes(maps, (-0.5, 0.7, 0.4), Infinite())
    assert joined.light.radiance.mean() == pytest.approx(1.2)
    assert interpolate_probes(maps, LEFT).light.radiance.mean() == pytest.approx(1)
    assert len(joined.notes) == 1 and "no parallax" in joined.notes[0].line
    assert "differ most towards" in joined.notes[0].line


def test_a_lone_probe_is_its_own_map():
    alone = interpolate_probes([seen(LEFT)], None, ROOM)
    np.testing.assert_array_equal(alone.light.radiance, seen(LEFT).light.radiance)
    assert alone.notes == () and alone.position == LEFT


def cellar(probe: PlacedProbe, unit: str) -> PlacedProbe:
    return replace(probe, light=replace(probe.light, unit=unit))


@pytest.mark.parametrize(
    ("probes", "at", "distant", "words"),
    [
        ([], None, ROOM, "there are no probes"),
        (
            [seen(LEFT), cellar(seen(RIGHT), "relative")],
            None,
            ROOM,
            "in cd/m² and in relative; give all of them in one",
        ),
        ([seen(LEFT), seen(LEFT)], None, ROOM, "probe 1 and probe 2 both stood at"),
        (
            [seen(LEFT), replace(seen(RIGHT), position=(3.0, 1.0, 0.0))],
            None,
            ROOM,
            r"probe 2 at \[3.0, 1.0, 0.0\] is outs",
        ),
        ([seen(LEFT)], (0.0, 9.0, 0.0), ROOM, r"wanted at \[0.0, 9.0, 0.0\], which is outside"),
        ([seen(LEFT)], None, Enclosure(np.eye(3, dtype=np.float32) * 9, np.array([[0, 1, 2]], np.int32)), "outside"),
    ],
)
def test_refusals(probes: list[PlacedProbe], at: tuple[float, float, float] | None, distant: Distant, words: str):
    with pytest.raises(ValueError, match=words) as caught:
        interpolate_probes(probes, at, distant)
    assert "\n" not in str(caught.value)


def test_a_position_that_is_none_is_refused():
    with pytest.raises(ValueError, match="position of a probe"):
        rl.renderers.PlacedProbe(seen(LEFT).light, (0.0, np.nan, 0.0))


LAMP = (-0.2, 1.9, -0.5)
GLOW = 0.5


def with_shelf(low_x: float) -> Enclosure:
    """The room and a shelf in it, from there to x = 0.05, that hides the lamp between the probes and from neither."""
    room = box_mesh(ROOM.low, ROOM.high, Diffuse((0.0, 0.0, 0.0)))
    shelf = box_mesh((low_x, 1.29, -0.2), (0.05, 1.3, 0.1), Diffuse((0.0, 0.0, 0.0)))
    faces = np.concatenate([room.faces, shelf.faces + len(room.vertices)])
    return Enclosure(np.concatenate([room.vertices, shelf.vertices]), faces)


def glowing(place: tuple[float, float, float], lamp: bool = True) -> PlacedProbe:
    """Even walls and the lamp, 0.12 m in radius."""
    way = np.subtract(LAMP, place)
    distance = np.linalg.norm(way)
    on_it = lamp & (DIRECTIONS @ (way / distance) > np.cos(np.arcsin(0.12 / distance)))
    return PlacedProbe(EnvironmentMap(np.where(on_it[..., None], (60.0, 50.0, 40.0), GLOW).astype(np.float32)), place)


def test_a_lamp_that_hangs_behind_something_is_not_in_the_joined_map():
    probes, walls = [glowing(LEFT), glowing(RIGHT)], with_shelf(-0.25)
    joined = interpolate_probes(probes, BETWEEN, walls)
    np.testing.assert_allclose(joined.lamps.positions, [LAMP], atol=0.03)
    assert joined.lamps_seen.tolist() == [0.0] and "shows 0% of it" in joined.notes[0].line
    np.testing.assert_allclose(joined.light.radiance, GLOW, rtol=1e-3)
    # A hand's breadth behind the shelf's shadow it is there again, with all of its light.
    above = interpolate_probes(probes, (0.5, 0.7, 0.4), walls)
    assert above.lamps_seen.tolist() == [1.0] and "of it" not in above.notes[0].line
    assert above.light.radiance.max() > 10
    # A probe that does not see it does not keep the others from finding it.
    third = interpolate_probes([*probes, glowing(BETWEEN, lamp=False)], (0.5, 0.7, 0.4), walls)
    np.testing.assert_allclose(third.lamps.intensity, above.lamps.intensity, rtol=1e-6)
    np.testing.assert_allclose(third.light.radiance, above.light.radiance, atol=1e-3)


def test_of_a_lamp_that_is_half_hidden_the_map_shows_a_half():
    probes = [glowing(LEFT), glowing(RIGHT)]
    # The line from the place to the lamp's middle passes the shelf's height at x = -0.1.
    half, whole = (interpolate_probes(probes, BETWEEN, walls) for walls in (with_shelf(-0.1), ROOM))
    assert 0.4 < half.lamps_seen[0] < 0.6
    shown, all_of_it = (each.light.total() - 4 * np.pi * GLOW for each in (half, whole))
    np.testing.assert_allclose(shown, half.lamps_seen[0] * all_of_it, rtol=0.02)


@pytest.fixture(scope="module")
def room() -> list[EnvironmentMap]:
    """Maps of a room with a lamp that hangs in it and a window in its wall, from the left, the right and between."""
    walls = box_mesh(ROOM.low, ROOM.high, Diffuse((0.6, 0.55, 0.5)), "room")
    lights = (
        SphereLight(LAMP, 0.1, (60.0, 50.0, 40.0)),
        RectangleLight((1.99, 1.4, 0.2), (-1.0, 0.0, 0.0), (1.2, 1.0), (4.0, 5.0, 7.0)),
    )
    scene = Scene(EnvironmentMap(np.zeros((4, 8, 3), np.float32)), (walls,), (), lights)
    renderer = Mitsuba(samples=16, depth=5)
    return [environment(scene, place, renderer, size=64, seed=i) for i, place in enumerate((LEFT, RIGHT, BETWEEN))]


def test_light_between_two_probes_is_many_times_nearer_the_truth_than_the_nearest(room):
    probes = [PlacedProbe(light, place) for light, place in zip(room, (LEFT, RIGHT), strict=False)]
    joined = interpolate_probes(probes, BETWEEN, ROOM)
    error, nearest = off(joined.light, room[2]), min(off(room[0], room[2]), off(room[1], room[2]))
    assert nearest > 0.2 and error < 0.02 and error < nearest / 10
    # Even one whose map lies on the room's walls takes the lamp for a part of them.
    walls = [off(interpolate_probes([probe], BETWEEN, ROOM).light, room[2]) for probe in probes]
    assert error < min(walls) / 5


def test_a_lamp_that_hangs_in_the_room_is_found_by_two_maps(room):
    joined = interpolate_probes(
        [PlacedProbe(light, place) for light, place in zip(room, (LEFT, RIGHT), strict=False)], BETWEEN, ROOM
    )
    assert len(joined.lamps.positions) == 1
    assert np.linalg.norm(joined.lamps.positions[0] - LAMP) < 0.03
    np.testing.assert_allclose(joined.lamps.intensity[0], np.pi * 0.1**2 * np.array([60, 50, 40]), rtol=0.03)
    assert "a lamp hangs at" in joined.notes[0].line
    # It is in the map too, where a probe there would have it.
    again = free_lamp(joined.light, LAMP, BETWEEN)
    assert again.off < np.radians(1)
    np.testing.assert_allclose(again.lamp.intensity[0], joined.lamps.intensity[0], rtol=0.02)
