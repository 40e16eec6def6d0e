"""`[light] probes` in shot and scene files: joined over the place's shape, or refused in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from relume.errors import InvalidScene, InvalidShot
from relume.image.files import write
from relume.probe.ball.blending import Probe
from relume.project.insertion.photographs import Calibrated, finished_light, joined_light
from relume.project.insertion.place import bare_place
from relume.project.probe_tables import without_hanging
from relume.scene.lights import SphereLight
from relume.scene.scene import Box, Infinite
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from toml_files import refusal, scene_of, shot_of

SHOT = """
[plate]
photographs = "plate.exr"
[camera]
pose = { position = [0, 1, 1.4], look_at = [0, 0, 0] }
focal_length = 100
[[local]]
shape = "plane"
[light]
"""
ROOM = 'distant = { shape = "box", low = [-2, 0, -1.5], high = [2, 2.6, 1.5] }\n'
PROBES = """probes = [
  { map = "left.exr", position = [-1, 0.7, 0.4] },
  { map = "right.exr", position = [1, 0.7, 0.4] },
]
"""
LEFT, RIGHT = (-1.0, 0.7, 0.4), (1.0, 0.7, 0.4)
LAMP, RADIUS, RADIANCE = np.array([-0.2, 1.9, -0.5]), 0.12, np.array([60.0, 50.0, 40.0])
ROWS = 128
SCENE = """
[camera]
size = [16, 12]
position = [0, 1, 1.4]
target = [0, 0, 0]
[materials.clay]
kind = "diffuse"
reflectance = 0.5
[[objects]]
sphere = { centre = [0, 0.5, 0], radius = 0.1 }
material = "clay"
[light]
"""


def seen(place: tuple[float, float, float], unit: str = "relative") -> EnvironmentMap:
    """Grey walls and a bright sphere that hangs before them."""
    directions, way = pixel_directions(LatLong(), ROWS), LAMP - place
    distance = np.linalg.norm(way)
    on_it = directions @ (way / distance) > np.cos(np.arcsin(RADIUS / distance))
    return EnvironmentMap(np.where(on_it[..., None], RADIANCE, 0.5).astype(np.float32), unit=unit)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path / "left.exr", as_radiance_map(seen(LEFT)))
    write(tmp_path / "right.exr", as_radiance_map(seen(RIGHT)))
    write(tmp_path / "absolute.exr", as_radiance_map(seen(RIGHT, "cd/m²")))
    return tmp_path


def test_a_shot_takes_its_light_from_both_and_its_lamp_from_where_it_hangs(folder):
    shot = shot_of(folder, SHOT + PROBES + ROOM)
    joined = joined_light(shot)
    assert joined is not None and joined.position == (0.0, 0.7, 0.4)
    calibrated = Calibrated(None, None, None, None, {}, joined=joined)  # pyright: ignore[reportArgumentType]
    probe = finished_light(shot_of(folder, SHOT + 'map = "left.exr"'))
    place = bare_place(shot, probe_of(joined.light, probe), calibrated.centre, calibrated.joined)
    assert place.probe == (0.0, 0.7, 0.4) and isinstance(place.distant, Box)
    (lamp,) = place.lights
    assert isinstance(lamp, SphereLight)
    np.testing.assert_allclose(lamp.position, LAMP, atol=0.03)
    strength = np.array(lamp.radiance) * np.pi * lamp.radius**2
    np.testing.assert_allclose(strength, RADIANCE * np.pi * RADIUS**2, rtol=0.06)
    # All but the lamp is the walls' grey again.
    np.testing.assert_allclose(place.light.radiance, 0.5, atol=0.01)


def test_a_lamp_that_the_joined_map_does_not_show_lights_the_scene_all_the_same(folder):
    # A shelf hides it from the middle of the probes alone.
    room = trimesh.creation.box(extents=(4, 2.6, 3))
    room.apply_translation((0, 1.3, 0))
    shelf = trimesh.creation.box(extents=(0.3, 0.01, 0.3))
    shelf.apply_translation((-0.1, 1.3, -0.05))
    trimesh.util.concatenate([room, shelf]).export(str(folder / "room.glb"))
    text = SCENE + PROBES + 'distant = { shape = "mesh", mesh = "room.glb" }\nscale = 2\n'
    with pytest.warns(UserWarning, match=r"the joined map shows 0% of it"):
        scene = scene_of(folder, text).scene
    np.testing.assert_allclose(scene.light.radiance, 1.0, atol=0.02)
    (lamp,) = scene.lights
    assert isinstance(lamp, SphereLight)
    np.testing.assert_allclose(lamp.position, LAMP, atol=0.03)
    np.testing.assert_allclose(
        np.array(lamp.radiance) * np.pi * lamp.radius**2, 2 * RADIANCE * np.pi * RADIUS**2, rtol=0.06
    )


def test_a_half_hidden_lamp_that_stays_in_the_map_gives_no_more_than_all_of_its_light(folder):
    joined = joined_light(shot_of(folder, SHOT + PROBES + ROOM))
    assert joined is not None and joined.lamps_seen.tolist() == [1.0]
    # The map shows so much of it that it stands out from the wall, or so little that it does not.
    joined = replace(joined, lamps_seen=np.array([0.75]))
    whole = joined.lamps.intensity[0]
    faint = replace(joined.light, radiance=np.minimum(joined.light.radiance, 1.5))
    for light, free in ((joined.light, 1.0), (faint, 0.25)):
        rest, (lamp,) = without_hanging(light, joined, np.ones(3))
        np.testing.assert_allclose(np.array(lamp.radiance) * np.pi * lamp.radius**2, free * whole, rtol=1e-6)
        assert (rest.radiance.max() > 1) == (free < 1)


def probe_of(light: EnvironmentMap, like: Probe) -> Probe:
    return replace(like, light=light, confidence=np.ones(light.radiance.shape[:2], np.float32))


def test_a_shot_at_infinity_is_lit_where_its_objects_are(folder):
    trimesh.creation.icosphere(radius=0.1).export(str(folder / "ball.glb"))
    objects = '[[objects]]\nmesh = "ball.glb"\ntranslate = [1, 0.7, 0.4]\n'
    joined = joined_light(shot_of(folder, SHOT + PROBES + objects))
    assert joined is not None
    np.testing.assert_allclose(joined.position, RIGHT, atol=1e-4)
    np.testing.assert_allclose(joined.shares, [0, 1], atol=1e-3)
    assert any("no parallax" in note.line for note in joined.notes)
    given = joined_light(shot_of(folder, SHOT + PROBES + "probe = [-1, 0.7, 0.4]\n" + objects))
    assert given is not None and given.position == LEFT


def test_a_scene_takes_them_alike(folder):
    with pytest.warns(UserWarning, match="a lamp hangs at"):
        scene = scene_of(folder, SCENE + PROBES + ROOM + "scale = 2\n").scene
    assert scene.probe == (0.0, 0.7, 0.4) and isinstance(scene.distant, Box)
    np.testing.assert_allclose(scene.light.radiance, 1.0, atol=0.02)
    (lamp,) = scene.lights
    assert isinstance(lamp, SphereLight)
    np.testing.assert_allclose(
        np.array(lamp.radiance) * np.pi * lamp.radius**2, 2 * RADIANCE * np.pi * RADIUS**2, rtol=0.06
    )
    with pytest.warns(UserWarning, match="no parallax"), pytest.warns(UserWarning, match="the map shows it where"):
        scene = scene_of(folder, SCENE + PROBES).scene
    assert scene.lights == () and isinstance(scene.distant, Infinite)


def test_the_files_of_probes_are_the_shots_files(folder):
    shot = shot_of(folder, SHOT + PROBES + ROOM)
    assert {"left.exr", "right.exr"} <= set(shot.named_files())
    assert str(shot.name_of_light()).endswith("left.exr")


@pytest.mark.parametrize(
    ("light", "words"),
    [
        ('map = "left.exr"\n' + PROBES, "has map and probes; give one of map, maps, probes and sky"),
        ("probes = []\n", "probes are none"),
        ('probes = [ { map = "left.exr" } ]\n', "light.probes.0.position"),
        (PROBES + "heading = 20\n", "heading: of several probes each has its own"),
    ],
)
def test_a_table_that_cannot_be_is_refused_in_one_line(folder, light, words):
    with pytest.raises(InvalidShot, match=words) as caught:
        shot_of(folder, SHOT + light + ROOM)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("light", "words"),
    [
        (
            PROBES.replace("[1, 0.7, 0.4]", "[3, 0.7, 0.4]"),
            r"light.probes: right.exr at \[3.0, 0.7, 0.4\] is outside of the",
        ),
        (PROBES.replace("right", "absolute"), "light.probes: the probes' maps are in cd/m² and in relative"),
        (PROBES.replace("[1, 0.7, 0.4]", "[-1, 0.7, 0.4]"), "light.probes: left.exr and right.exr both stood at"),
        (PROBES.replace("right", "none"), "light.probes.1: .*none.exr"),
        (PROBES + "probe = [0, 9, 0]\n", "light.probes: the light is wanted at"),
    ],
)
def test_maps_that_do_not_go_together_are_refused_in_one_line(folder, light, words):
    with pytest.raises(InvalidShot, match=words) as caught:
        joined_light(shot_of(folder, SHOT + light + ROOM))
    assert "\n" not in str(caught.value)


def test_a_scene_refuses_them_in_one_line(folder):
    text = SCENE + PROBES.replace("[1, 0.7, 0.4]", "[3, 0.7, 0.4]") + ROOM
    with pytest.raises(InvalidScene, match=r"scene\.toml: light.probes: right.exr"):
        scene_of(folder, text)
    assert "probes are none" in refusal(folder, SCENE + "probes = []\n")
