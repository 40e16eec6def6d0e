"""A scene file whose distant scene shines by its own radiance: seen, as light, with lamps, with what takes light."""

from typing import Any

import numpy as np
import pytest

import relume as rl
import virtual_place as place
from relume.renderers.projective.shining_meshes import place_of

SCENE = """
[camera]
size = [32, 24]
position = [0.0, 1.6, 2.0]
target = [0.0, 0.8, 0.0]
field_of_view = 86
[light]
distant = {{ shape = "mesh", mesh = "hall.glb", radiance = "own"{more} }}
{rest}
[materials.white]
kind = "pbr"
base_color = [0.8, 0.8, 0.8]
[[objects]]
sphere = {{ centre = [0.3, 1.3, 0.6], radius = 0.2 }}
material = "white"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("hall")
    rl.report.write_place(path / "hall.glb", rl.renderers.bake(place.meshes(), place.photographs()))
    return path


def read(folder, more="", rest="") -> Any:
    (folder / "scene.toml").write_text(SCENE.format(more=more, rest=rest), encoding="utf-8")
    return rl.read_scene(folder / "scene.toml")


def test_the_place_is_backdrop_and_light(folder):
    found = read(folder)
    assert sorted(mesh.name for mesh in found.scene.local) == ["bench", "block", "room"]
    assert not found.scene.light.radiance.any()
    bare = rl.render(found.scene.without_objects(), found.camera, rl.Mitsuba(samples=16))
    truth = place.seen_by(found.camera)
    assert place.decibels(bare.radiance, truth) > 28
    ball = rl.render(found.scene, found.camera, rl.Mitsuba(samples=16))
    assert 0.005 < ball.matte.mean() < 0.1
    # A white ball in a room whose walls shine with about a third, and its lamp above.
    assert 0.2 < ball.radiance[ball.matte > 0.99].mean() < 2


def test_its_lamp_is_a_lamp_and_the_rest_glows(folder):
    found = read(folder, more=", lamps = 4")
    lamp = found.scene.lights[0]
    assert np.allclose(lamp.position, [1, 3, 0], atol=0.06) and isinstance(lamp, rl.scene.RectangleLight)
    # Half of its brightness is where a lamp ends; the blurred rim of its picture stays.
    assert max(float(np.max(mesh.material.emission)) for mesh in found.scene.local) < 0.55 * place.LAMP


def test_a_map_may_lie_beyond_it(folder):
    found = read(folder, rest="colour = 0.5")
    assert np.all(found.scene.light.radiance == 0.5) and len(found.scene.local) == 3


def test_a_mesh_that_receives_light_reflects_it(folder):
    # This room's radiance is of no physics, so that some of the block would have to reflect more than it gets.
    with pytest.warns(UserWarning, match="of 'block' would reflect more than the light it gets"):
        found = read(folder, more=', receives = ["block"]')
    block = next(mesh for mesh in found.scene.local if mesh.name == "block")
    assert isinstance(block.material, rl.Diffuse) and np.median(block.material.reflectance) > 0.05


def sent(mesh):
    """What a mesh sends out, ∫ L dA."""
    part = place_of([mesh]).parts[0]
    return part.radiance[part.used].sum(axis=0, dtype=float) * part.texel**2


def test_sun_on_a_floor_that_takes_light_is_no_lamp(tmp_path):
    walls = place.painted(
        place.box((-3, 0, -2.5), (3, 3, 2.5), "walls", inward=True),
        lambda at: np.where((abs(at[:, 0] - 1) < 0.4) & (abs(at[:, 2]) < 0.3) & (at[:, 1] > 2.99), place.LAMP, 0.5),
    )
    floor = place.painted(place.flat_floor(), lambda at: np.where(np.hypot(at[:, 0], at[:, 2]) < 0.5, 30.0, 0.3))
    rl.report.write_place(tmp_path / "hall.glb", place_of([walls, floor]))
    both = read(tmp_path, more=", lamps = 8").scene
    assert sorted(round(lamp.position[1]) for lamp in both.lights) == [0, 3]
    with pytest.warns(UserWarning, match="of 'floor' would reflect more than the light it gets"):
        found = read(tmp_path, more=', lamps = 8, receives = ["floor"]').scene
    assert [round(lamp.position[1]) for lamp in found.lights] == [3]
    (shining,) = [mesh for mesh in found.local if mesh.name == "walls"]
    (receiving,) = [mesh for mesh in found.local if mesh.name == "floor"]
    assert isinstance(receiving.material, rl.Diffuse)
    # The walls and the lamps together send out what the walls did; the floor's light is theirs.
    lamps = sum(np.prod(lamp.size) * np.array(lamp.radiance) for lamp in found.lights)
    np.testing.assert_allclose(sent(shining) + lamps, sent(walls), rtol=1e-3)


def test_bad_words_are_refused_in_one_line(folder):
    with pytest.raises(rl.errors.InvalidScene, match=r"light\.distant: the place has no mesh 'floor'; it has"):
        read(folder, more=', receives = ["floor"]')
    with pytest.raises(rl.errors.InvalidScene, match='lamps and receives are of a mesh with radiance = "own"'):
        (folder / "scene.toml").write_text(
            SCENE.format(more=", lamps = 2", rest="").replace(', radiance = "own"', ""), encoding="utf-8"
        )
        rl.read_scene(folder / "scene.toml")
    (folder / "grey.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    text = SCENE.format(more="", rest="").replace("hall.glb", "grey.obj")
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(rl.errors.InvalidScene, match="no radiance of its own"):
        rl.read_scene(folder / "scene.toml")
    (folder / "scene.toml").write_text(text.replace('mesh = "grey.obj"', "radius = 2").replace('"mesh"', '"dome"'))
    with pytest.raises(rl.errors.InvalidScene, match="of a mesh with emissive textures"):
        rl.read_scene(folder / "scene.toml")
