"""Maps that change with time and skies, in scene files."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidScene, UnreadableFile
from relume.image.files import read_radiance, write
from relume.project.scene_file.rendering import render_scene
from relume.project.scene_file.scene_file import SceneFile, read_scene
from relume.project.scene_file.settings import RenderSettings
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from toml_files import scene_of

SCENE = """
[camera]
position = [0, 0, 4]
target = [0, 0, 0]
size = [16, 12]
[light]
maps = "probe/*.exr"
[materials.chrome]
kind = "mirror"
[[objects]]
sphere = { centre = [0, 0, 0], radius = 1 }
material = "chrome"
"""
FRAMES = '[sequence]\nframes = "1-5"\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "probe").mkdir()
    for number, value in enumerate((1.0, 3.0, 2.0)):
        light = EnvironmentMap(np.full((8, 16, 3), value, np.float32))
        write(tmp_path / "probe" / f"m_{number + 9}.exr", as_radiance_map(light))
    return tmp_path


def light_at(read: SceneFile, frame: float) -> float:
    scene, _ = read.at_frame(frame)
    return float(scene.light.radiance[2, 2, 0])


def test_a_frame_has_the_light_of_its_time(folder: Path):
    read = scene_of(folder, SCENE + FRAMES)
    assert [light_at(read, frame) for frame in (1, 2, 2.5, 3, 5)] == [1, 3, 2.5, 2, 2]
    assert float(read.scene.light.radiance[0, 0, 0]) == 1
    slow = SCENE.replace('exr"\n', 'exr"\nrate = 12\nscale = 2\ntime = 0.0\n') + FRAMES
    np.testing.assert_allclose([light_at(scene_of(folder, slow), frame) for frame in (1, 2, 3, 4)], [2, 4, 6, 5])
    # What workers are given.
    assert light_at(pickle.loads(pickle.dumps(read)), 2) == 3


def test_without_a_sequence_it_is_the_first_or_that_of_a_time(folder: Path):
    assert float(scene_of(folder, SCENE).scene.light.radiance[0, 0, 0]) == 1
    later = SCENE.replace('exr"\n', 'exr"\nrate = 2\ntime = 0.25\n')
    assert float(scene_of(folder, later).scene.light.radiance[0, 0, 0]) == 2


def test_another_light_that_is_given_stays(folder: Path):
    scene_of(folder, SCENE + FRAMES)
    other = as_radiance_map(EnvironmentMap(np.full((8, 16, 3), 5, np.float32)))
    write(folder / "other.exr", other)
    read = read_scene(next(folder.glob("*.toml")), folder / "other.exr")
    assert [light_at(read, frame) for frame in (1, 2, 3)] == [5, 5, 5]


def test_the_frames_show_the_maps_and_only_changed_ones_are_made_again(folder: Path):
    read = scene_of(folder, SCENE + FRAMES.replace("1-5", "1-2"))
    settings = RenderSettings(renderer="prefiltered")
    for number, value in ((1, 1.0), (2, 3.0)):
        out = folder / f"one_{number}.hdr"
        render_scene(read, out, RenderSettings(renderer="prefiltered", frames=str(number)))
        np.testing.assert_allclose(read_radiance(out).radiance[6, 8], value, rtol=5e-3)
    render_scene(read, folder / "out", settings)
    assert render_scene(read, folder / "out", settings).kept == 2
    write(folder / "probe" / "m_10.exr", as_radiance_map(EnvironmentMap(np.full((8, 16, 3), 4, np.float32))))
    again = scene_of(folder, SCENE + FRAMES.replace("1-5", "1-2"))
    assert render_scene(again, folder / "out", settings).kept == 1


def test_while_the_shutter_is_open_the_light_goes_on(folder: Path):
    # Half a map's time before and after frame 2: from 2 up to 3 and down to 2.5.
    matte = SCENE.replace('kind = "mirror"', 'kind = "pbr"') + FRAMES + "shutter = [-0.5, 0.5]\n"
    read = scene_of(folder, matte)
    out = folder / "open.hdr"
    render_scene(read, out, RenderSettings(renderer="mitsuba", frames="2", samples=64, threads=1))
    np.testing.assert_allclose(read_radiance(out).radiance[0, 0], (2.5 + 2.75) / 2, rtol=1e-3)


def test_a_sky_is_the_light_of_a_scene(folder: Path):
    sky = "sky = { sun = [30, 180], size = 32, turbidity = 2, heading = 180 }"
    light = scene_of(folder, SCENE.replace('maps = "probe/*.exr"', sky)).scene.light
    assert light.unit == "cd/m²"
    row, column = divmod(int(light.radiance[..., 1].argmax()), 64)
    # Ahead and 30° up.
    assert (row, column) in [(10, 31), (10, 32)]


@pytest.mark.parametrize(
    ("light", "part"),
    [
        ('maps = "probe/*.exr"\ncolour = 1', "has maps and colour; give one of map, maps, probes, sky and colour"),
        ("turn = 3", "has none of them; give one of map, maps, probes, sky and colour"),
        ("colour = 1\nrate = 3", "has rate, which is of maps that change"),
        ("sky = { sun = [95, 0] }", "light.sky: the sun's elevation is"),
    ],
)
def test_what_cannot_be_names_the_key(folder: Path, light: str, part: str):
    with pytest.raises(InvalidScene) as error:
        scene_of(folder, SCENE.replace('maps = "probe/*.exr"', light))
    assert part in str(error.value)


def test_maps_that_are_not_alike_are_refused(folder: Path):
    write(folder / "probe" / "m_12.exr", as_radiance_map(EnvironmentMap(np.ones((4, 8, 3), np.float32))))
    with pytest.raises(UnreadableFile, match=r"m_12.exr: a map of 4 rows"):
        scene_of(folder, SCENE + FRAMES)
