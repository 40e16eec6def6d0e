"""A shot whose distant scene shines by its own radiance: it lights the objects, and takes their shadows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import relume as rl
import virtual_place as place
from relume.errors import InvalidShot
from relume.image.files import write
from relume.image.radiance import RadianceMap
from relume.project.insertion.insert import insert
from relume.project.insertion.photographs import calibrate, read_photographs
from relume.project.stages import Stages, Steps
from relume.renderers.projective.shining_meshes import place_of
from relume.scene.lights import RectangleLight
from relume.scene.shapes.shapes import Mesh
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_radiance_map
from toml_files import shot_of

SHOT = """
[plate]
photographs = "plate.exr"
[camera]
pose = {{ position = [0, 1.4, 2.3], look_at = [0, 0.6, 0] }}
focal_length = 40
[light]
distant = {{ shape = "mesh", mesh = "hall.glb", radiance = "own"{more} }}
{light}
[[objects]]
mesh = "ball.glb"
material = {{ base_color = {colour}, roughness = 1.0, specular = 0.0 }}
[match]
grain = false
sharpness = false
[render]
samples = 128
preview = false
"""
CENTRE, RADIUS = np.array([0.2, 0.5, 0.4]), 0.3
VIEW = rl.Camera.looking_at(np.array([0, 1.4, 2.3]), np.array([0, 0.6, 0]), width=64, height=48, focal_length=40.0)


def shot(folder: Path, colour: float = 0.6, more: str = "", light: str = ""):
    return shot_of(folder, SHOT.format(more=more, light=light, colour=[colour] * 3))


def put(folder: Path, plate: np.ndarray) -> Path:
    ball = trimesh.creation.icosphere(4, RADIUS).apply_translation(CENTRE)
    (folder / "ball.glb").write_bytes(bytes(ball.export(file_type="glb")))
    write(folder / "plate.exr", RadianceMap(plate.astype(np.float32)))
    return folder


def shining_walls() -> Mesh:
    box = place.box((-3, 0, -2.5), (3, 3, 2.5), "walls", inward=True)
    return place.painted(box, lambda at: np.ones(len(at)), texel=0.4)


def even(folder: Path, below: float) -> Path:
    """Walls that shine with 1 everywhere, and a floor. All is even, so that few texels are enough."""
    floor = place.painted(place.flat_floor(), lambda at: np.full(len(at), below), texel=0.4)
    rl.report.write_place(folder / "hall.glb", place_of([shining_walls(), floor]))
    return put(folder, np.where(on_floor()[..., None], below, 1.0) * np.ones(3))


def ends() -> np.ndarray:
    """Where the floor's height is met by the camera's rays, (H, W, 3)."""
    rays = VIEW.rays()
    return VIEW.position + rays * ((0.01 - VIEW.position[1]) / rays[..., 1])[..., None]


def on_floor() -> np.ndarray:
    points = ends()
    return (VIEW.rays()[..., 1] < 0) & (abs(points[..., 0]) < 2.9) & (abs(points[..., 2]) < 2.4)


def normals_of_ball() -> np.ndarray:
    """Of the ball where each of the camera's rays meets it, or passes it next, (H, W, 3)."""
    along = VIEW.rays() @ (CENTRE - VIEW.position)
    reach = along - np.sqrt(np.maximum(along**2 - ((CENTRE - VIEW.position) ** 2).sum() + RADIUS**2, 0))
    return normalised(VIEW.position + reach[..., None] * VIEW.rays() - CENTRE)


def test_a_place_gives_light_and_takes_shadows(tmp_path: Path):
    made = insert(shot(even(tmp_path, 0.3), 0.0, ', receives = ["floor"]'), tmp_path / "out")
    points, floor = ends(), on_floor()
    # Of what a floor gets under even light, a black ball of radius r at a height h and a distance D hides h r² / D³.
    height = CENTRE[1] - 0.01
    away = np.linalg.norm(points - CENTRE, axis=-1)
    open_ = 1 - height * RADIUS**2 / away**3
    matte = made.change.matte
    bare = floor & (matte == 0) & (away < 1.5)
    composite = made.composite[..., 1]
    assert bare.sum() > 200 and open_[bare].min() < 0.75
    ratio = composite[bare] / (0.3 * open_[bare])
    np.testing.assert_allclose(ratio, 1, atol=0.08)
    assert np.mean(abs(ratio - 1)) < 0.01 and ratio[open_[bare] < 0.85].mean() == pytest.approx(1, abs=0.015)
    # Elsewhere the plate stays, and the ball is black.
    assert composite[matte > 0.999].max() < 0.01
    # The floor takes light: the plate's is not compared with the wall below it.
    assert not any("light.scale" in each.line for each in made.doubts)


def test_in_even_light_a_matte_ball_is_as_bright_as_it_reflects(tmp_path: Path):
    made = insert(shot(even(tmp_path, 1.0), 0.6, light="scale = 0.5"), tmp_path / "out")
    inside = made.change.matte > 0.999
    shown = made.change.objects[inside]
    assert shown.mean() == pytest.approx(0.5 * 0.6, rel=0.01)
    assert np.mean(abs(shown / 0.3 - 1)) < 0.05
    (doubt,) = [each.line for each in made.doubts if "light.scale" in each.line]
    assert doubt.startswith("the plate is 2 times as bright as light.distant where both show one place;")
    # It stands beside the present scale; the room that is as bright as the plate again needs none.
    assert doubt.endswith("give light.scale = 1")
    again = insert(shot(tmp_path, 0.6, light="scale = 1"), tmp_path / "again")
    assert not any("light.scale" in each.line for each in again.doubts)
    assert again.change.objects[again.change.matte > 0.999].mean() == pytest.approx(0.6, rel=0.01)


def test_a_scale_of_each_channel_is_corrected_channel_by_channel(tmp_path: Path):
    made = insert(shot(even(tmp_path, 1.0), 0.6, light="scale = [0.5, 0.5, 0.5]"), tmp_path / "out")
    (doubt,) = [each.line for each in made.doubts if "light.scale" in each.line]
    assert doubt.endswith("give light.scale = [1, 1, 1]")


def test_what_hides_the_shining_walls_is_not_compared_with_them(tmp_path: Path):
    even(tmp_path, 0.3)
    rl.report.write_place(tmp_path / "hall.glb", place_of([shining_walls()]))
    floor = '[[local]]\nshape = "plane"\nsize = [6, 5]\nheight = 0.01'
    made = insert(shot(tmp_path, 0.0, light=floor), tmp_path / "out")
    assert on_floor().mean() > 0.5 and not any("light.scale" in each.line for each in made.doubts)


def test_a_ball_in_a_photographed_room_has_the_rooms_light(tmp_path: Path):
    rl.report.write_place(tmp_path / "hall.glb", rl.renderers.bake(place.meshes(), place.photographs()))
    put(tmp_path, place.seen_by(VIEW))
    made = insert(shot(tmp_path, 0.6, ", lamps = 4"), tmp_path / "out")
    assert any(isinstance(lamp, RectangleLight) for lamp in made.place.bare.lights)
    assert not any("light.scale" in each.line for each in made.doubts)
    # The truth: every wall's own radiance along rays from the ball's side that the camera sees.
    inside = made.change.matte > 0.999
    normals = normals_of_ball()[inside]
    truth = 0.6 / np.pi * place.irradiance_at(CENTRE + (RADIUS + 1e-3) * normals, normals)
    shown = made.change.objects[inside]
    np.testing.assert_allclose(shown.mean(axis=0), truth.mean(axis=0), rtol=0.04)
    assert np.mean(np.abs(shown - truth)) < 0.08 * truth.mean()


@pytest.mark.parametrize(
    "light", ['map = "sky.exr"', "sky = { sun = [40, 180], size = 16 }", 'map = "sky.exr"\nscale = 2']
)
def test_light_beyond_in_another_unit_is_refused(tmp_path: Path, light: str):
    beyond = rl.EnvironmentMap(np.full((16, 32, 3), 2000.0, np.float32), unit="cd/m²")
    write(tmp_path / "sky.exr", as_radiance_map(beyond))
    with pytest.raises(InvalidShot, match=r"is in cd/m² and the plate in relative, and nothing says") as caught:
        insert(shot(even(tmp_path, 1.0), light=light), tmp_path / "out")
    assert "\n" not in str(caught.value)


def test_light_beyond_in_the_plates_unit_and_none_are_taken(tmp_path: Path):
    even(tmp_path, 1.0)
    write(tmp_path / "sky.exr", as_radiance_map(rl.EnvironmentMap(np.ones((16, 32, 3), np.float32))))
    write(tmp_path / "plate.exr", RadianceMap(np.ones((48, 64, 3), np.float32), unit="cd/m²"))
    for light, unit in (
        ("", "cd/m²"),
        ("sky = { sun = [40, 180], size = 16 }", "cd/m²"),
        ('map = "sky.exr"', "relative"),
    ):
        write(tmp_path / "plate.exr", RadianceMap(np.ones((48, 64, 3), np.float32), unit=unit))
        read = shot(tmp_path, light=light)
        found = calibrate(read, read_photographs(read), Steps(Stages(tmp_path / "stages")))
        assert found.probe.light.unit == found.plate.unit == unit


@pytest.mark.parametrize(
    ("light", "words"),
    [
        ("probe = [0, 1, 0]", "light: probe measures the place's light, which distant.radiance"),
        ("lamps = [[0, 1, 0]]", "lamps measures the place's light"),
        ("turn = 20", "turn, exposure and keyframes change light that was measured"),
    ],
)
def test_what_would_measure_its_light_again_is_refused(tmp_path: Path, light: str, words: str):
    with pytest.raises(InvalidShot, match=words) as caught:
        shot(tmp_path, light=light)
    assert "\n" not in str(caught.value)
    with pytest.raises(InvalidShot, match=r"distant\.receives: input should be a list \(got 'floor'\)"):
        shot(tmp_path, more=', receives = "floor"')
    with pytest.raises(InvalidShot, match=r"light\.distant: the place has no mesh 'lawn'; it has"):
        put(tmp_path, np.ones((48, 64, 3)))
        rl.report.write_place(
            tmp_path / "hall.glb", place_of([place.painted(place.flat_floor(), lambda at: abs(at[:, 0]))])
        )
        insert(shot(tmp_path, more=', receives = ["lawn"]'), tmp_path / "out")
