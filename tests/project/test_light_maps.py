"""Maps that change with time and skies, in shot files: at each frame, in the frames themselves, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from gltf_files import square_glb
from relume.errors import InvalidShot, UnreadableFile
from relume.image.files import read_radiance, write
from relume.image.radiance import RadianceMap
from relume.project.insertion.frame_shots import at_frame, at_moment, frames_of
from relume.project.insertion.insert_frames import insert_frames
from relume.project.insertion.photographs import finished_light
from relume.project.insertion.sequence import frame_key
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from toml_files import shot_of

SHOT = """
[plate]
photographs = "plate.exr"
[camera]
pose = { position = [0, 0.5, 2], look_at = [0, 0.2, 0] }
focal_length = 40
[light]
maps = "probe/*.exr"
[sequence]
frames = "1-5"
rate = 4
[[objects]]
mesh = "ball.glb"
"""
VALUES = (1.0, 3.0, 2.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "probe").mkdir()
    for number, value in enumerate(VALUES):
        light = EnvironmentMap(np.full((8, 16, 3), value, np.float32))
        write(tmp_path / "probe" / f"m_{number + 9}.exr", as_radiance_map(light))
    return tmp_path


def lit(folder: Path, text: str, frame: float) -> float:
    light = finished_light(at_frame(shot_of(folder, text), frame)).light
    return float(light.radiance[3, 3, 1])


def test_a_frame_has_the_map_of_its_time(folder: Path):
    # A map for each frame, unless a rate is given; then the last one holds.
    assert [lit(folder, SHOT, frame) for frame in (1, 2, 3, 4, 2.5)] == [1, 3, 2, 2, 2.5]
    slow = SHOT.replace('exr"\n[seq', 'exr"\nrate = 2\n[seq')
    np.testing.assert_allclose([lit(folder, slow, frame) for frame in (1, 2, 3, 4, 5)], [1, 2, 3, 2.5, 2], rtol=1e-6)
    steps = slow.replace("rate = 2", 'rate = 2\ninterpolation = "none"')
    assert [lit(folder, steps, frame) for frame in (1, 2, 3, 4, 5)] == [1, 1, 3, 3, 2]
    late = slow.replace("rate = 2", "rate = 2\ntime = 0.5")
    assert [lit(folder, late, frame) for frame in (1, 3)] == [3, 2]


def test_a_frame_with_a_shutter_has_the_mean_light_of_its_time(folder: Path):
    # Maps at 0, 1/4 and 1/2 s, a frame each; from half a frame before to half a frame after.
    shot = SHOT.replace("rate = 4", "rate = 4\nshutter = [-0.5, 0.5]")
    # Frame 1 begins before the first map, which holds; 2 goes up from 2 to 3 and down to 2.5; 3 ends behind the last.
    found = [lit(folder, shot, frame) for frame in (1, 2, 3, 4)]
    np.testing.assert_allclose(found, [(1 + 1.5) / 2, (2.5 + 2.75) / 2, (2.25 + 2) / 2, 2], rtol=1e-6)
    # At a moment the light is that moment's.
    moment = at_moment(shot_of(folder, shot), 2.5)
    assert float(finished_light(moment).light.radiance[3, 3, 1]) == 2.5
    # A straight rise: the mean is that of the middle, for any shutter within.
    rise = SHOT.replace("rate = 4", "rate = 8\nshutter = [-0.1, 0.7]").replace('exr"\n[seq', 'exr"\nrate = 4\n[seq')
    assert lit(folder, rise, 2) == pytest.approx(1 + 2 * (1 + 0.3) / 2, rel=1e-6)
    steps = shot.replace('exr"\n[seq', 'exr"\ninterpolation = "none"\n[seq')
    np.testing.assert_allclose([lit(folder, steps, frame) for frame in (1, 2, 3)], [1, 2, 2.5], rtol=1e-6)


def test_objects_that_move_are_lit_by_each_moments_map(folder: Path):
    ball = trimesh.creation.icosphere(1, 0.4).apply_translation([0, 0.2, 0])
    (folder / "ball.glb").write_bytes(bytes(ball.export(file_type="glb")))
    write(folder / "plate.exr", RadianceMap(np.ones((16, 24, 3), np.float32)))
    text = "local = []\n" + SHOT.replace('exr"\n[seq', 'exr"\nscale = 2.0\n[seq').replace('"1-5"', '"2"')
    text = text.replace("rate = 4", "rate = 4\nshutter = [0, 0.5]")
    text += "[match]\ngrain = false\nsharpness = false\n[render]\nsamples = 256\npreview = false\n"
    found = []
    # From its first map, 3, to half-way to the second; at rest, and moved by as good as nothing.
    for name, keys in (
        ("still", ""),
        ("moved", "keyframes = [{ frame = 2, scale = 1 }, { frame = 3, scale = 1.0001 }]"),
    ):
        shot = shot_of(
            folder,
            text.replace('maps = "probe', 'time = 0.25\nmaps = "probe').replace(
                'mesh = "ball.glb"', f'mesh = "ball.glb"\n{keys}'
            ),
        )
        made = insert_frames(shot, folder / name, threads=1)
        found.append(read_radiance(made.frames[0].folder / "composite.exr").radiance[8, 12, 1])
    dim = shot_of(folder, text.replace("shutter = [0, 0.5]", "").replace('maps = "probe', 'time = 0.25\nmaps = "probe'))
    whole = read_radiance(insert_frames(dim, folder / "at once", threads=1).frames[0].folder / "composite.exr")
    assert found[0] / whole.radiance[8, 12, 1] == pytest.approx((3 + 2.5) / 2 / 3, rel=1e-3)
    assert found[1] == pytest.approx(found[0], rel=0.02)


def test_a_frame_depends_on_the_maps_round_it_alone(folder: Path):
    (folder / "plate.exr").write_bytes(b"a plate")
    (folder / "ball.glb").write_bytes(square_glb())
    shot = shot_of(folder, SHOT)
    before = [frame_key(at_frame(shot, frame)) for frame in (1, 2, 3)]
    write(folder / "probe" / "m_10.exr", as_radiance_map(EnvironmentMap(np.full((8, 16, 3), 7, np.float32))))
    after = [frame_key(at_frame(shot, frame)) for frame in (1, 2, 3)]
    assert [one == other for one, other in zip(before, after, strict=True)] == [True, False, True]


def test_maps_that_are_missing_or_unlike_are_refused_before_any_frame(folder: Path):
    write(folder / "probe" / "m_11.exr", as_radiance_map(EnvironmentMap(np.ones((4, 8, 3), np.float32))))
    with pytest.raises(UnreadableFile, match=r"m_11.exr: a map of 4 rows, but m_9.exr is a map of 8 rows"):
        frames_of(shot_of(folder, SHOT))
    (folder / "probe" / "m_10.exr").unlink()
    write(folder / "probe" / "m_12.exr", as_radiance_map(EnvironmentMap(np.ones((4, 8, 3), np.float32))))
    with pytest.raises(UnreadableFile, match="the map of number 10 is missing"):
        frames_of(shot_of(folder, SHOT))


@pytest.mark.parametrize(
    ("light", "part"),
    [
        ('map = "a.exr"\nmaps = "probe/*.exr"', "has map and maps; give one"),
        ('map = "a.exr"\nrate = 2', "has rate, which is of maps that change"),
        ("maps = []", "maps are none"),
        ("turn = 3", "give one of balls, map, maps, probes and sky"),
        ('maps = "p*.exr"\nrate = 0', "rate: input should be greater than 0"),
        ("sky = { latitude = 50 }", "light.sky: give latitude, longitude and date"),
        ("sky = { sun = [-4, 90] }", "light.sky: the sun is 4° below the horizon"),
        ("sky = { sun = [4, 90], latitude = 3 }", "leave latitude, longitude and date out"),
        ("sky = { latitude = 50, longitude = 8, date = 2026-06-21T13:00:00 }", "no offset from UTC"),
    ],
)
def test_what_cannot_be_is_one_line_that_names_the_key(folder: Path, light: str, part: str):
    text = SHOT.replace('maps = "probe/*.exr"', light)
    with pytest.raises(InvalidShot) as error:
        shot_of(folder, text)
    assert part in str(error.value)
    assert "\n" not in str(error.value)


def test_a_sky_lights_a_shot_in_candelas(folder: Path):
    sky = "sky = { latitude = 52.5, longitude = 13.4, date = 2026-06-21T13:06:00+02:00, size = 32, ground = 0.1 }"
    shot = shot_of(folder, SHOT.replace('maps = "probe/*.exr"', sky))
    light = finished_light(at_frame(shot, 1)).light
    assert (light.unit, light.size) == ("cd/m²", 32)
    bare = finished_light(shot_of(folder, SHOT.replace('maps = "probe/*.exr"', sky[:-2] + ", disc = false }"))).light
    level = np.array([0.0, 1.0, 0.0])
    assert np.all(light.irradiance(level) > 3 * bare.irradiance(level))


def test_the_object_brightens_with_the_maps_and_only_changed_frames_are_made_again(folder: Path):
    ball = trimesh.creation.icosphere(1, 0.4).apply_translation([0, 0.2, 0])
    (folder / "ball.glb").write_bytes(bytes(ball.export(file_type="glb")))
    write(folder / "plate.exr", RadianceMap(np.ones((16, 24, 3), np.float32)))
    text = "local = []\n" + SHOT.replace('exr"\n[seq', 'exr"\nscale = 1.0\n[seq').replace('"1-5"', '"1-2"')
    text += "[match]\ngrain = false\nsharpness = false\n[render]\nsamples = 8\npreview = false\n"
    shot = shot_of(folder, text)
    made = insert_frames(shot, folder / "out", threads=1)
    first, second = (read_radiance(frame.folder / "composite.exr").radiance[8, 12] for frame in made.frames)
    np.testing.assert_allclose(second / first, 3, rtol=1e-3)
    assert not any(frame.kept for frame in made.frames)
    light = EnvironmentMap(np.full((8, 16, 3), 5, np.float32))
    write(folder / "probe" / "m_10.exr", as_radiance_map(light))
    again = insert_frames(shot, folder / "out", threads=1)
    assert [frame.kept for frame in again.frames] == [True, False]
