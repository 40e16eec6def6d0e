"""Lamps that move and change by keys: their values at a frame, the light that renderers see there, what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from relume.errors import InvalidScene, InvalidShot
from relume.image.files import read_layers
from relume.project.insertion.frame_shots import at_frame
from relume.project.insertion.place import relit
from relume.project.scene_file.rendering import render_scene
from relume.project.scene_file.scene_file import SceneFile
from relume.project.scene_file.settings import RenderSettings
from relume.scene.lights import DistantLight, PointLight, RectangleLight, SphereLight
from relume.scene.scene import Scene
from relume.sphere.environment_map import EnvironmentMap
from toml_files import SHOT_HEAD, refusal, scene_of, shot_of

# A floor of reflectance ½, seen from above, of which a pixel is 4 cm.
SCENE = """
[camera]
size = [5, 5]
position = [0, 5, 0.01]
target = [0, 0, 0]
field_of_view = 2.29
[sequence]
frames = "1-5"
%s
[materials.clay]
kind = "diffuse"
reflectance = 0.5
[[local]]
shape = "plane"
size = [30, 30]
material = "clay"
[[lights]]
"""
POINT = SCENE + 'kind = "point"\nposition = [0, 1, 0]\nintensity = 2\n'
KEYS = "keyframes = [{ frame = 1, position = [0, 1, 0], exposure = 0 }, { frame = 5, position = [0, 3, 0], %s }]\n"


def lamp_at(found: SceneFile, frame: float) -> object:
    (lamp,) = found.at_frame(frame)[0].lights
    return lamp


def test_every_value_of_every_lamp_goes_from_key_to_key(tmp_path):
    point = scene_of(tmp_path, POINT % "" + KEYS % "intensity = [4, 2, 0], exposure = 2")
    # One key alone says the intensity, which holds before it; exposure is in stops.
    assert lamp_at(point, 3) == PointLight((0, 2, 0), (8, 4, 0))
    assert point.scene.lights == (PointLight((0, 1, 0), (4, 2, 0)),)
    sun = 'kind = "distant"\ntowards = [1, 0, 0]\nirradiance = 1\nexposure = 1\n'
    keys = "keyframes = [{ frame = 1, towards = [1, 0, 0] }, { frame = 5, towards = [0, 1, 0], irradiance = 3 }]\n"
    assert lamp_at(scene_of(tmp_path, SCENE % "" + sun + keys), 3) == DistantLight((0.5, 0.5, 0), (6, 6, 6))
    ball = 'kind = "sphere"\nposition = [0, 1, 0]\nradius = 0.1\nradiance = 1\n'
    keys = "keyframes = [{ frame = 1, radius = 0.1, radiance = 1 }, { frame = 5, radius = 0.3, radiance = 5 }]\n"
    there = lamp_at(scene_of(tmp_path, SCENE % "" + ball + keys), 3)
    assert isinstance(there, SphereLight) and there.radiance == (3, 3, 3)
    assert there.radius == pytest.approx(0.2)


def test_a_rectangle_that_moves_still_faces_what_it_looks_at(tmp_path):
    flat = 'kind = "rectangle"\nposition = [0, 2, 0]\nlook_at = [0, 0, 0]\nsize = [1, 1]\nradiance = 1\n'
    first = "{ frame = 1, position = [0, 2, 0], size = [1, 1] }"
    keys = f"keyframes = [{first}, {{ frame = 5, position = [4, 2, 0], size = [1, 3] }}]\n"
    there = lamp_at(scene_of(tmp_path, SCENE % "" + flat + keys), 5)
    assert isinstance(there, RectangleLight)
    assert (there.position, there.towards, there.size) == ((4, 2, 0), (-4, -2, 0), (1, 3))
    keys = "keyframes = [{ frame = 1, look_at = [0, 0, 0] }, { frame = 5, look_at = [4, 2, 0] }]\n"
    assert lamp_at(scene_of(tmp_path, SCENE % "" + flat + keys), 3) == RectangleLight(
        (0, 2, 0), (2, -1, 0), (1, 1), (1.0, 1.0, 1.0)
    )


@pytest.mark.parametrize("renderer", ["whitted", "mitsuba"])
def test_the_floor_shines_by_the_lamp_of_its_frame(tmp_path, renderer: Literal["whitted", "mitsuba"]):
    """L = ρ / π · I / d²: 2 at one metre, 8 at three."""
    found = scene_of(tmp_path, POINT % "" + KEYS % "exposure = 2")
    for frame, expected in ((1, 1 / np.pi), (5, 4 / 9 / np.pi)):
        settings = RenderSettings(renderer=renderer, samples=16 if renderer == "mitsuba" else None, frames=str(frame))
        render_scene(found, tmp_path / "one.exr", settings)
        middle = read_layers(tmp_path / "one.exr")["radiance"][2, 2]
        np.testing.assert_allclose(middle, expected, rtol=0.02)


def test_what_a_lamp_does_while_the_shutter_is_open_is_in_the_frame(tmp_path):
    step = 'interpolation = "step"\nshutter = [0, 1]'
    text = POINT % step + "keyframes = [{ frame = 1, exposure = 0 }, { frame = 1.5, exposure = 2 }]\n"
    render_scene(
        scene_of(tmp_path, text), tmp_path / "one.exr", RenderSettings(renderer="mitsuba", samples=16, frames="1")
    )
    middle = read_layers(tmp_path / "one.exr")["radiance"][2, 2]
    np.testing.assert_allclose(middle, (1 + 4) / 2 / np.pi, rtol=0.02)


def test_exposure_of_a_lamp_without_keys_and_with_a_spectrum(tmp_path):
    still = POINT.replace('[sequence]\nframes = "1-5"\n%s\n', "")
    assert scene_of(tmp_path, still + "exposure = -1\n").scene.lights == (PointLight((0, 1, 0), (1, 1, 1)),)
    warm = "spectrum = { blackbody = 2856 }\n"
    one, four = (scene_of(tmp_path, still + warm + f"exposure = {stops}\n").scene.lights[0] for stops in (0, 2))
    assert isinstance(one, PointLight) and isinstance(four, PointLight)
    np.testing.assert_allclose(four.intensity, 4 * np.array(one.intensity), rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (POINT.replace("[sequence]\nframes = \"1-5\"\n%s\n", "") + KEYS % "exposure = 1",
         "lights.0.keyframes: of which frames? give [sequence]"),
        (POINT % "" + "keyframes = [{ frame = 1, radius = 2 }]\n", "lights.0.keyframes.0.radius: unknown key"),
        (POINT % "" + "keyframes = [{ frame = 2 }, { frame = 1 }]\n", "lights.0: keyframes: frame 1 comes after 2"),
        (SCENE % "" + 'kind = "rectangle"\nposition = [0, 2, 0]\nsize = [1, 1]\nradiance = 1\n',
         "lights.0: towards: missing; give one of towards, a direction, and look_at"),
        (SCENE % "" + 'kind = "rectangle"\nposition = [0, 2, 0]\ntowards = [0, -1, 0]\nsize = [1, 1]\nradiance = 1\n'
         "keyframes = [{ frame = 1, look_at = [0, 0, 0] }]\n",
         "lights.0: keyframes have look_at, but the lamp has towards"),
        (SCENE % "" + 'kind = "rectangle"\nposition = [0, 2, 0]\nlook_at = [0, 2, 0]\nsize = [1, 1]\nradiance = 1\n',
         "lights.0: look_at [0.0, 2.0, 0.0] is where the lamp stands"),
    ],
)  # fmt: skip
def test_a_fault_is_one_line_with_its_key(tmp_path, text, line):
    assert refusal(tmp_path, text).startswith(line)


def test_a_value_that_no_lamp_may_have_is_named_with_its_frame(tmp_path):
    sun = 'kind = "distant"\ntowards = [1, 0, 0]\nirradiance = 1\n'
    keys = "keyframes = [{ frame = 1, towards = [1, 0, 0] }, { frame = 5, towards = [-1, 0, 0] }]\n"
    found = scene_of(tmp_path, SCENE % "" + sun + keys)
    with pytest.raises(InvalidScene, match=r"lights\.0: at frame 3: direction of a distant light is \(0\.0, 0\.0"):
        found.at_frame(3)


SHOT = (
    SHOT_HEAD
    + """\
[sequence]
frames = "1-5"
[[objects]]
mesh = "cube.glb"
[[light.added]]
direction = [1, 0, 0]
irradiance = 2
keyframes = [
  { frame = 1, direction = [1, 0, 0], size = 10 },
  { frame = 5, direction = [0, 1, 0], irradiance = 4, size = %s },
]
"""
)


def test_an_added_light_of_a_shot_goes_from_key_to_key_and_lights_the_place_there(tmp_path: Path):
    shot = shot_of(tmp_path, SHOT % 30)
    (there,) = at_frame(shot, 3).light.added
    assert (there.direction, there.irradiance, there.size) == ((0.5, 0.5, 0), (4, 4, 4), 20) and not there.keyframes
    dark = Scene(EnvironmentMap(np.zeros((32, 64, 3), np.float32)))
    above, beside = (relit(dark, at_frame(shot, frame)).light.radiance[..., 0] for frame in (5, 1))
    assert above[0].min() > 0 and above[16].max() == 0
    assert np.unravel_index(beside.argmax(), beside.shape)[1] // 2 in (23, 24) and beside[0].max() == 0
    with pytest.raises(InvalidShot, match=r"light\.added\.0\.size: at frame 5 the keys make it 200"):
        at_frame(shot_of(tmp_path, SHOT % 200), 5)
