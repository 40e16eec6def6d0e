"""The tables of a shot's place and objects, what is made of them, and one line for what cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from relume.errors import InvalidShot
from relume.image.files import write
from relume.probe.ball.blending import Probe
from relume.project.insertion.photographs import finished_light
from relume.project.insertion.place import bare_place, relit, require_in_place
from relume.project.place_tables import distant_scene
from relume.project.shot_file.objects import doubts_about, placed_meshes, require_outside
from relume.project.shot_file.shot import Shot
from relume.scene.cameras.camera import Camera
from relume.scene.lights import SphereLight
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Box, Dome, Enclosure, Infinite, Scene
from relume.scene.shapes.shapes import Mesh, Plane, Sphere
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from solids import sphere
from toml_files import SHOT_HEAD, shot_of

SHOT = (
    SHOT_HEAD
    + """\
probe = [0.2, 0.1, -0.3]
"""
)
LAMP = (1.1, 1.5, -0.6)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    towards = np.subtract(LAMP, (0.2, 0.1, -0.3))
    inside = pixel_directions(LatLong(), 64) @ (towards / np.linalg.norm(towards)) > np.cos(0.08)
    radiance = np.where(inside[..., None], [90.0, 70.0, 40.0], 0.5).astype(np.float32)
    write(tmp_path / "light.exr", as_radiance_map(EnvironmentMap(radiance)))
    room = trimesh.creation.box(extents=(6, 4, 6))
    room.export(str(tmp_path / "room.glb"))
    trimesh.creation.box(extents=(0.2, 0.2, 0.2)).export(str(tmp_path / "cube.glb"))
    return tmp_path


def probe_of(shot: Shot) -> Probe:
    return finished_light(shot)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("distant = { shape = 'dome' }", "light.distant: a distant scene that is a dome needs radius"),
        ("distant = { shape = 'box', low = [0, 0, 0] }", "a box needs high"),
        ("distant = { shape = 'box', low = [0, 0, 0], high = [1, 0, 1] }", "each of low lies below its high"),
        ("distant = { radius = 3 }", "radius: not of a distant scene that is infinite"),
        ("distant = { shape = 'mesh' }", "a mesh needs mesh"),
        ("distant = { shape = 'cube' }", "light.distant.shape"),
        ("distant = { shape = 'dome', radius = -1 }", "light.distant.radius"),
        ("lamps = [[1, 2]]", "light.lamps.0"),
        ("[[local]]\nshape = 'box'\nlow = [0, 0, 0]", "local.0: a box needs high"),
        ("[[local]]\nshape = 'box'\nlow = [0, 0, 0]\nhigh = [1, 1, -1]", "local.0: the box goes from"),
        ("[[local]]\nshape = 'mesh'", "local.0: a mesh needs mesh"),
        ("[[local]]\nshape = 'plane'\nmirror = true", "a mirror's reflectance is given"),
        ("[[local]]\nshape = 'plane'\nreflectance = [1.5, 0, 0]", "local.0.reflectance"),
        ("[[local]]\nshape = 'plane'\ngloss = { strength = 0.04 }", "local.0.gloss"),
        ("[match]\naperture = 0.02", "match: aperture and focus go together"),
        ("[match]\nmode = 'screen'", "match.mode"),
        ("[[objects]]\nmesh = 'cube.glb'\nmaterial = { preset = 'glod' }", "objects.0.material.preset"),
        ("[[objects]]\nmesh = 'cube.glb'\nmaterial = { rougness = 1 }", "did you mean roughness"),
        ("[[objects]]\nmesh = 'cube.glb'\nscale = 0", "objects.0.scale"),
        ("[render]\nnoise = 0", "render.noise"),
    ],
)
def test_a_table_that_cannot_be_is_reported_by_its_key_in_one_line(folder: Path, change: str, words: str) -> None:
    with pytest.raises(InvalidShot) as caught:
        shot_of(folder, SHOT + change)
    assert words in str(caught.value) and "\n" not in str(caught.value) and "shot.toml" in str(caught.value)


def test_a_near_distant_scene_needs_the_place_of_the_map(folder: Path) -> None:
    bare = SHOT.replace("probe = [0.2, 0.1, -0.3]", "distant = { shape = 'dome', radius = 3 }")
    with pytest.raises(InvalidShot, match="needs probe ="):
        shot_of(folder, bare)


def test_the_distant_scene_is_what_the_table_says(folder: Path) -> None:
    def distant(table: str):
        return distant_scene(shot_of(folder, SHOT + f"distant = {table}").light.distant, folder)

    assert distant("{}") == Infinite()
    assert distant("{ shape = 'dome', radius = 3 }") == Dome(3.0)
    assert distant("{ shape = 'box', low = [-1, 0, -2], high = [1, 2, 3] }") == Box((-1, 0, -2), (1, 2, 3))
    mesh = distant("{ shape = 'mesh', mesh = 'room.glb' }")
    assert isinstance(mesh, Enclosure) and len(mesh.faces) == 12
    assert np.abs(mesh.vertices).max(0).tolist() == [3, 2, 3]


def test_a_lamp_is_taken_out_of_the_light_and_hangs_in_its_place(folder: Path) -> None:
    shot = shot_of(folder, SHOT + f"lamps = [{list(LAMP)}]\n[[local]]\nshape = 'plane'\nheight = 0.1")
    probe = probe_of(shot)
    place = bare_place(shot, probe)
    (lamp,) = place.lights
    assert isinstance(lamp, SphereLight) and lamp.position == pytest.approx(LAMP, abs=0.03)
    assert place.probe == (0.2, 0.1, -0.3) and isinstance(place.local[0], Plane) and place.local[0].height == 0.1
    # π r² L at the lamp's distance is what the map has lost.
    distance = np.linalg.norm(np.subtract(lamp.position, place.probe))
    given = np.pi * lamp.radius**2 * np.array(lamp.radiance) / distance**2
    assert given == pytest.approx(probe.light.total() - place.light.total(), rel=1e-4)
    with pytest.raises(InvalidShot, match=r"^light.lamps.1: the light shows no lamp towards"):
        bare_place(shot_of(folder, SHOT + f"lamps = [{list(LAMP)}, [-1.0, 1.0, 1.0]]"), probe)


def test_light_that_a_shot_makes_brighter_is_brighter_lamps_too_and_lamps_do_not_turn(folder: Path) -> None:
    shot = shot_of(folder, SHOT + f"lamps = [{list(LAMP)}]\nexposure = 1.0")
    place = bare_place(shot, probe_of(shot))
    brighter = relit(place, shot)
    before, after = place.lights[0], brighter.lights[0]
    assert isinstance(before, SphereLight) and isinstance(after, SphereLight)
    assert after.radiance == pytest.approx(2 * np.array(before.radiance)) and after.position == before.position
    assert brighter.light.total() == pytest.approx(2 * place.light.total(), rel=1e-4)
    assert relit(place, shot_of(folder, SHOT)) is place
    with pytest.raises(InvalidShot, match=r"^light.turn: lamps that have a place cannot be turned"):
        relit(place, shot_of(folder, SHOT + "turn = 90.0"))


def test_a_place_without_surfaces_is_doubted(folder: Path) -> None:
    shot = shot_of(folder, "local = []\n" + SHOT)
    with pytest.warns(UserWarning, match=r"no local surface.*\[\[local\]\]"):
        place = bare_place(shot, probe_of(shot))
    assert place.local == ()


CAMERA = Camera.looking_at(np.array([0, 1.0, 3.0]), np.zeros(3), width=60, height=40, focal_length=100)


@pytest.mark.parametrize(
    ("centre", "radius", "words"),
    [
        ((0.0, -1.0, 0.0), 0.5, "object 'ball' lies under the plane, 0.5 m below it"),
        ((0.0, 0.5, 5.0), 0.5, "behind the camera"),
        ((0.0, 0.6, 0.0), 0.5, "hover 0.1 m over the plane"),
        ((0.0, 0.4, 0.0), 0.5, "object 'ball' reaches 0.1 m into the plane"),
    ],
)
def test_objects_that_stand_strangely_are_reported(
    centre: tuple[float, float, float], radius: float, words: str
) -> None:
    ball = sphere(Diffuse((1, 1, 1)), centre=centre, radius=radius, fine=2)
    (said,) = doubts_about([ball], CAMERA, [Plane(Diffuse((1, 1, 1)))])
    assert words in said.line and "\n" not in said.line and said.effect is not None


def test_a_camera_inside_an_object_is_refused() -> None:
    ball = sphere(Diffuse((1, 1, 1)), centre=(0.0, 1.1, 3.1), radius=0.5, fine=2)
    with pytest.raises(InvalidShot, match="the camera is inside 'ball'"):
        require_outside([ball], CAMERA)


def test_what_stands_outside_of_the_distant_scene_is_named_by_its_key() -> None:
    light = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    room = Box((-5.0, -1.0, -5.0), (5.0, 4.0, 5.0))
    require_in_place(Scene(light, distant=room), CAMERA)
    lamp = SphereLight((11.0, 2.0, 0.0), 0.1, (1.0, 1.0, 1.0))
    with pytest.raises(InvalidShot, match=r"^light\.lamps\.0: at \(11, 2, 0\) metres it is outside"):
        require_in_place(Scene(light, lights=(lamp,), distant=room), CAMERA)
    with pytest.raises(InvalidShot, match=r"^camera: "):
        require_in_place(Scene(light, distant=Dome(2.0)), CAMERA)


def test_objects_that_stand_well_are_not_doubted() -> None:
    ball = sphere(Diffuse((1, 1, 1)), centre=(0.0, 0.49, 0.0), radius=0.5, fine=2)
    assert doubts_about([ball], CAMERA, [Plane(Diffuse((1, 1, 1)))]) == ()


def test_a_change_that_an_objects_material_does_not_have_names_the_key(folder: Path) -> None:
    text = SHOT + "[[objects]]\nmesh = 'cube.glb'\nmaterial = { preset = 'rolled_brass', roughness = 0.2 }"
    with pytest.raises(InvalidShot, match=r"^objects.material: roughness: a Ward surface has none"):
        placed_meshes(shot_of(folder, text))


def test_a_real_ball_on_the_table_is_a_sphere_and_a_box_is_turned_as_objects_are(folder):
    shot = shot_of(folder, SHOT + """
[[local]]
shape = "sphere"
centre = [0.4, 0.12, -0.2]
radius = 0.12
[[local]]
shape = "box"
low = [-0.2, 0.0, -0.1]
high = [0.2, 0.3, 0.1]
rotate = [0, 90, 0]
translate = [1.0, 0.0, -2.0]
""")  # fmt: skip
    ball, box = bare_place(shot, probe_of(shot)).local
    assert isinstance(ball, Sphere) and (ball.centre, ball.radius) == ((0.4, 0.12, -0.2), 0.12)
    assert isinstance(box, Mesh)
    assert box.vertices.min(0) == pytest.approx([0.9, 0.0, -2.2], abs=1e-6)
    assert box.vertices.max(0) == pytest.approx([1.1, 0.3, -1.8], abs=1e-6)


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ('shape = "sphere"\nradius = 0.1', "a sphere needs centre"),
        ('shape = "sphere"\ncentre = [0, 0, 0]\nradius = 0.1\nrotate = [0, 10, 0]', "placed by its centre"),
        ('shape = "sphere"\ncentre = [0, 0, 0]\nradius = 0', "radius"),
        ('shape = "sphere"\ncentre = [0, 0, 0]\nradius = 0.1\nheight = 1', "height: not of a sphere"),
        ('shape = "plane"\ncentre = [0, 0, 0]\nradius = 0.1', "centre, radius: not of a plane"),
        ('shape = "box"\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\nmesh = "hall.glb"', "mesh: not of a box"),
    ],
)
def test_a_sphere_that_is_none_is_refused_in_a_line(folder, table, line):
    with pytest.raises(InvalidShot, match=line):
        shot_of(folder, f"{SHOT}[[local]]\n{table}\n")
