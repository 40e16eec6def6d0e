"""A scene file's sequence: where everything is at a frame, what is refused, and the frames that are made of it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from gltf_files import Channels, animated, as_glb, moving_gltf
from relume.errors import InvalidScene, UnsupportedScene
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.image.radiance import RadianceMap
from relume.project.film.film_file import read_film
from relume.project.scene_file.frame_plan import frame_plan
from relume.project.scene_file.rendering import render_scene
from relume.project.scene_file.renders import Pictures
from relume.project.scene_file.scene_file import SceneFile, read_scene
from relume.project.scene_file.settings import RenderSettings
from relume.scene.shapes.shapes import Mesh, Polygon, Sphere
from toml_files import refusal, scene_of

CAMERA = """
[camera]
size = [24, 16]
position = [0, 1, 4]
target = [0, 0, 0]
"""
MOVING = """
[camera]
size = [24, 16]
aperture = 0.1
keyframes = [
  { frame = 1, position = [0, 1, 4], look_at = [0, 0, 0], field_of_view = 40, focus = 4 },
  { frame = 5, position = [4, 1, 4], field_of_view = 60, roll = 20, focus = 6 },
]
"""
LIGHT = "[light]\ncolour = 0.5\n"
SEQUENCE = '[sequence]\nframes = "1-5"\n'
CLAY = """
[materials.clay]
kind = "diffuse"
reflectance = 0.5
"""
BALL = """
[[objects]]
sphere = { centre = [0, 0, 0], radius = 0.5 }
material = "clay"
"""
KEYS = "keyframes = [{ frame = 1, translate = [-1, 0, 0] }, { frame = 5, translate = [1, 2, 0], scale = 2 }]\n"
FEW = RenderSettings(renderer="mitsuba", samples=4)


def ball_at(found: SceneFile, frame: float) -> Sphere:
    (ball,) = found.at_frame(frame)[0].objects
    assert isinstance(ball, Sphere)
    return ball


# Where things are


def test_a_camera_goes_from_key_to_key(tmp_path):
    found = scene_of(tmp_path, MOVING + LIGHT + SEQUENCE + CLAY + BALL)
    _, camera = found.at_frame(3)
    np.testing.assert_allclose(camera.position, [2, 1, 4])
    assert camera.focal_length == pytest.approx(12 / np.tan(np.radians(25)))
    assert (camera.aperture, camera.focus) == (0.05, 5)
    # The look-at stays; one key alone says the roll, which is the same before it.
    ahead = -camera.rotation[:, 2]
    np.testing.assert_allclose(ahead, -camera.position / np.linalg.norm(camera.position), atol=1e-12)
    # Turned counter-clockwise: what points up in the world leans to the right in the picture.
    up = camera.rotation.T @ [0, 1, 0]
    assert np.degrees(np.arctan2(up[0], up[1])) == pytest.approx(20)
    np.testing.assert_array_equal(found.camera.position, [0, 1, 4])  # the first frame is what a picture shows


def test_words_of_shots_and_of_scenes_are_the_same_camera(tmp_path):
    ours = scene_of(tmp_path, CAMERA + "field_of_view = 53.13010235415598\n" + LIGHT + CLAY + BALL).camera
    shots = scene_of(tmp_path, CAMERA.replace("target", "look_at") + "focal_length = 24\n" + LIGHT + CLAY + BALL).camera
    np.testing.assert_array_equal(ours.rotation, shots.rotation)
    assert ours.focal_length == pytest.approx(24) and shots.focal_length == 24


def test_a_sphere_moves_and_grows_from_where_it_stands(tmp_path):
    found = scene_of(tmp_path, CAMERA + LIGHT + SEQUENCE + CLAY + BALL.replace("[0, 0, 0]", "[0, 3, 0]") + KEYS)
    assert (ball_at(found, 3).centre, ball_at(found, 3).radius) == ((0, 4, 0), 1.0)
    # One key alone gives the scale, which holds before it.
    assert (ball_at(found, 1).centre, ball_at(found, 9).centre) == ((-1, 3, 0), (1, 5, 0))


def test_meshes_and_polygons_move_and_what_no_key_moves_stays(tmp_path):
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    text = CAMERA + LIGHT + SEQUENCE + CLAY
    mesh = '[[objects]]\nmesh = "flat.obj"\nmaterial = "clay"\nscale = 2\n'
    polygon = '[[objects]]\npolygon = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]\nmaterial = "clay"\n'
    turning = "keyframes = [{ frame = 1, rotate = [0, 0, 0] }, { frame = 5, rotate = [0, 0, 180] }]\n"
    found = scene_of(tmp_path, text + mesh + turning + polygon + turning)
    placed, flat = found.at_frame(3)[0].objects
    assert isinstance(placed, Mesh) and isinstance(flat, Polygon)
    # A mesh turns about its file's origin, a polygon about its middle.
    np.testing.assert_allclose(placed.vertices, [[0, 0, 0], [0, 2, 0], [-2, 0, 0]], atol=1e-6)
    np.testing.assert_allclose(flat.vertices, [[2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 0]], atol=1e-9)
    still = scene_of(tmp_path, text + mesh + polygon)
    assert still.at_frame(1)[0].light is still.at_frame(4)[0].light


def test_meshes_and_cameras_that_move_in_their_own_files_move_with_the_sequence(tmp_path):
    times = [0.0, 0.125]  # three frames of 24 a second
    moves: Channels = [(0, "translation", times, [[0, 0, 0], [3, 0, 0]], "LINEAR")]
    (tmp_path / "moving.glb").write_bytes(as_glb(*animated(moves, [{"name": "square", "mesh": 0}])))
    moving_gltf(tmp_path / "camera.gltf")  # a metre a second along x
    text = '[camera]\nsize = [24, 16]\nfile = "camera.gltf"\n' + LIGHT + '[sequence]\nframes = "11-20"\n'
    found = scene_of(tmp_path, text + '[[objects]]\nmesh = "moving.glb"\nscale = 2\n')
    (rest,), (moved,) = (found.at_frame(frame)[0].objects for frame in (11, 13))
    assert isinstance(rest, Mesh) and isinstance(moved, Mesh)
    np.testing.assert_allclose(moved.vertices - rest.vertices, np.tile([4.0, 0, 0], (4, 1)), atol=1e-6)
    np.testing.assert_allclose(found.at_frame(17)[1].position, [6 / 24, 1, 0], atol=1e-12)
    # Beside the rest pose of both, a picture of the file shows the first frame.
    np.testing.assert_allclose(found.camera.position, [0, 1, 0], atol=1e-12)


def test_light_turns_and_brightens(tmp_path):
    radiance = np.zeros((8, 16, 3), np.float32)
    radiance[4, 8] = 1.0  # towards −Z
    write(tmp_path / "light.exr", RadianceMap(radiance))
    keys = "keyframes = [{ frame = 1, turn = 0, exposure = 0 }, { frame = 5, turn = 180, exposure = 2 }]\n"
    text = CAMERA + '[light]\nmap = "light.exr"\nscale = 3\n' + keys + SEQUENCE + CLAY + BALL
    found = scene_of(tmp_path, text)
    half = found.at_frame(3)[0].light.radiance
    assert half.max() == 6  # 3 · 2¹
    assert np.unravel_index(half[..., 0].argmax(), (8, 16)) == (4, 4)  # a quarter turn: it comes from −X
    # A map of one's own is turned and brightened by the keys alone.
    write(tmp_path / "own.exr", RadianceMap(10 * radiance))
    own = read_scene(tmp_path / "scene.toml", tmp_path / "own.exr")
    assert own.at_frame(3)[0].light.radiance.max() == 20 and own.scene.light.radiance.max() == 10


def test_orbits_go_round_once_in_a_sequence(tmp_path):
    orbit = "orbit = { centre = [1, 0, 0] }\n"
    found = scene_of(tmp_path, CAMERA + LIGHT + '[sequence]\nframes = "1-4"\n' + CLAY + BALL + orbit)
    np.testing.assert_allclose(ball_at(found, 1).centre, [0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(ball_at(found, 3).centre, [2, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (MOVING + LIGHT + CLAY + BALL, "camera.keyframes: of which frames? give [sequence]"),
        (CAMERA + LIGHT + CLAY + BALL + KEYS, "objects.0.keyframes: of which frames? give [sequence]"),
        (CAMERA + "look_at = [0, 0, 0]\n" + LIGHT + CLAY + BALL, "camera: has target and look_at, which say the same"),
        (CAMERA + "aperture = 0.1\n" + LIGHT + CLAY + BALL, "camera: has an aperture and no focus; give the distance"),
        (CAMERA + "focus = 2\n" + LIGHT + CLAY + BALL, "camera: has a focus and no aperture, so that all is sharp"),
        (CAMERA + 'file = "a.glb"\n' + LIGHT + CLAY + BALL, "camera: has file and position; the file says where"),
        ('[camera]\nfile = "a.glb"\n' + LIGHT + CLAY + BALL, "camera.file: "),
        (
            MOVING.replace("frame = 5", "frame = 1") + LIGHT + SEQUENCE + CLAY + BALL,
            "camera: keyframes: frame 1 comes after 1; give them in rising order",
        ),
        (
            CAMERA + LIGHT + SEQUENCE + CLAY + BALL + "keyframes = [{ frame = 1, turn = 3 }]\n",
            "objects.0.keyframes.0.turn: unknown key",
        ),
        (
            CAMERA + LIGHT + 'keyframes = [{ frame = 1, turn = 3 }]\n' + SEQUENCE + CLAY + BALL,
            "light: keyframes have turn, but a colour is the same from everywhere",
        ),
        (CAMERA + LIGHT + SEQUENCE + 'plates = "a.png"\n' + CLAY + BALL, "sequence.plates: a scene file has no plate"),
        (CAMERA + LIGHT + '[sequence]\nframes = "5-1"\n' + CLAY + BALL, "sequence.frames: '5-1' has no frames"),
    ],
)  # fmt: skip
def test_a_fault_is_one_line_with_its_key(tmp_path, text, line):
    assert refusal(tmp_path, text).startswith(line)


def test_a_key_that_no_file_may_have_is_named_with_its_frame(tmp_path):
    keys = MOVING.replace("focus = 6", "focus = 6, aperture = 1").replace("look_at = [0, 0, 0]", "look_at = [4, 1, 4]")
    found = scene_of(tmp_path, keys + LIGHT + SEQUENCE + CLAY + BALL)
    with pytest.raises(InvalidScene, match=r"camera: at frame 5 target \[4\.0, 1\.0, 4\.0\] is where the camera"):
        found.at_frame(5)


def test_the_examples_in_the_docs_are_a_scene_and_a_film(tmp_path):
    page = (Path(__file__).parents[2] / "docs/reference/scene-file.md").read_text(encoding="utf-8")
    scene, film = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[-2:]
    for name in ("room.hdr", "mine.exr"):
        write(tmp_path / name, RadianceMap(np.ones((8, 16, 3), np.float32)))
    found = scene_of(tmp_path, scene)
    assert found.sequence is not None and len(found.sequence.table.frames) == 120
    np.testing.assert_allclose(ball_at(found, 120).centre, [1, 0.1, 0])
    (tmp_path / "film.toml").write_text(film)
    assert len(read_film(tmp_path / "film.toml").scene.at_frame(240)[0].objects) == 1


# The frames


def test_a_frame_has_the_pixels_of_a_scene_that_stands_there(tmp_path):
    found = scene_of(tmp_path, CAMERA + LIGHT + SEQUENCE + CLAY + BALL + KEYS)
    render_scene(found, tmp_path / "moving.exr", RenderSettings(renderer="mitsuba", samples=4, frames="3"))
    still = BALL.replace("[0, 0, 0], radius = 0.5", "[0, 1, 0], radius = 1.0")
    render_scene(scene_of(tmp_path, CAMERA + LIGHT + CLAY + still), tmp_path / "still.exr", FEW)
    one, other = (read_layers(tmp_path / name)["radiance"] for name in ("moving.exr", "still.exr"))
    np.testing.assert_array_equal(one, other)


def test_frames_that_are_there_are_kept_and_those_that_changed_are_made_again(tmp_path):
    text = CAMERA + LIGHT + '[sequence]\nframes = "1-3"\n' + CLAY + BALL
    keys = "keyframes = [{ frame = 1, translate = [-1, 0, 0] }, { frame = 2, translate = [1, 0, 0] }%s]\n"
    out = tmp_path / "frames"
    # The first alone, then all of them.
    part = render_scene(scene_of(tmp_path, text + keys % ""), out, RenderSettings(samples=4, frames="1"))
    assert (part.renderer, part.frames, part.kept) == ("mitsuba", 1, 0)
    whole = render_scene(scene_of(tmp_path, text + keys % ""), out, FEW)
    assert (whole.frames, whole.kept) == (3, 1)
    before = [(out / f"frame_{number:04d}.png").stat().st_mtime_ns for number in (1, 2, 3)]
    # A key that moves the last frame alone, and other threads, which change no pixel.
    later = scene_of(tmp_path, text + keys % ", { frame = 3, translate = [3, 0, 0] }")
    again = render_scene(later, out, RenderSettings(renderer="mitsuba", samples=4, threads=1))
    assert again.kept == 2
    after = [(out / f"frame_{number:04d}.png").stat().st_mtime_ns for number in (1, 2, 3)]
    assert before[:2] == after[:2] and before[2] != after[2]
    assert not list(out.glob("*preview*")) and not list(out.glob(".*.passes")) and not list(out.glob(".*.lock"))


def test_a_frame_depends_on_what_moves_while_its_shutter_is_open(tmp_path):
    text = CAMERA + LIGHT + CLAY + BALL + "keyframes = [{ frame = 1, translate = [0, 0, 0] }, { frame = 2, %s }]\n"

    def key(words: str, shutter: str) -> str:
        sequence = f'[sequence]\nframes = "1-3"\n{shutter}[light]'
        found = scene_of(tmp_path, (text % words).replace("[light]", sequence))
        plan = frame_plan(found, tmp_path / "frames", RenderSettings())
        return Pictures(found, RenderSettings(), plan, "mitsuba").key(1, ".png")

    near, far = "translate = [1, 0, 0]", "translate = [2, 0, 0]"
    assert key(near, "") == key(far, "")
    open_shutter = "shutter = [0, 0.5]\n"
    assert key(near, open_shutter) == key(near, open_shutter) != key(far, open_shutter)


def test_what_moves_while_the_shutter_is_open_is_blurred(tmp_path):
    text = CAMERA + LIGHT + CLAY + BALL + KEYS
    blurred = text.replace("[light]", '[sequence]\nframes = "1-5"\nshutter = [-1, 1]\n[light]')
    sharp = text.replace("[light]", '[sequence]\nframes = "1-5"\n[light]')
    settings = RenderSettings(renderer="mitsuba", samples=16, frames="3")
    for name, words in (("blurred.exr", blurred), ("sharp.exr", sharp)):
        render_scene(scene_of(tmp_path, words), tmp_path / name, settings)
    covered = [
        int((np.abs(read_layers(tmp_path / name)["radiance"][..., 0] - 0.5) > 1e-3).sum())
        for name in ("blurred.exr", "sharp.exr")
    ]
    assert covered[0] > 1.4 * covered[1]


def test_an_interrupted_frame_is_resumed_with_the_same_pixels(tmp_path):
    found = scene_of(tmp_path, CAMERA + LIGHT + CLAY + BALL)
    settings = RenderSettings(renderer="mitsuba", samples=64)

    def interrupting(stage: str, share: float) -> None:
        if share > 0.4:
            raise RuntimeError("the lights went out")

    with pytest.raises(RuntimeError, match="lights went out"):
        render_scene(found, tmp_path / "cut.exr", settings, report=interrupting, preview=True)
    assert (tmp_path / ".cut.passes").is_file() and (tmp_path / "cut.preview.png").is_file()
    begun = []
    render_scene(found, tmp_path / "cut.exr", settings, report=lambda stage, share: begun.append(share))
    assert 0 < min(begun) and min(begun) > 0.4  # it went on
    render_scene(found, tmp_path / "whole.exr", settings)
    cut, whole = (read_layers(tmp_path / name)["radiance"] for name in ("cut.exr", "whole.exr"))
    np.testing.assert_array_equal(cut, whole)
    assert not list(tmp_path.glob(".*.passes*"))


def test_a_sequence_that_was_interrupted_within_a_frame_goes_on(tmp_path):
    found = scene_of(tmp_path, CAMERA + LIGHT + '[sequence]\nframes = "1-2"\n' + CLAY + BALL + KEYS)
    settings, out = RenderSettings(renderer="mitsuba", samples=64), tmp_path / "frames"

    def interrupting(stage: str, share: float) -> None:
        if share > 0.7:
            raise RuntimeError("the lights went out")

    with pytest.raises(RuntimeError, match="lights went out"):
        render_scene(found, out, settings, report=interrupting, preview=True)
    left = {path.name for path in out.glob("*.png")} | {path.name for path in out.glob(".*.passes")}
    assert left == {"frame_0001.png", "frame_0002.preview.png", ".frame_0002.passes"}
    assert render_scene(found, out, settings, preview=True).kept == 1
    assert {path.name for path in out.glob("*.png")} == {"frame_0001.png", "frame_0002.png"}


def test_a_turntable_and_orbits_by_light_transport(tmp_path):
    ball = BALL.replace("[0, 0, 0], radius = 0.5", "[1, 0, 0], radius = 0.5")
    found = scene_of(tmp_path, CAMERA + LIGHT + CLAY + ball + "orbit = { turns = 1 }\n")
    settings = RenderSettings(renderer="mitsuba", samples=4, frames=2, exposure=1)
    assert render_scene(found, tmp_path / "round", settings).frames == 2
    assert render_scene(found, tmp_path / "round", settings).kept == 2
    first, second = (read_photograph(tmp_path / f"round/frame_{n:04d}.png").pixels[..., 0] for n in (1, 2))
    # Half a turn later it is on the other side; what is darker than the light is the ball.
    across = [np.average(np.arange(24), weights=(255 - frame.astype(float)).sum(axis=0)) for frame in (first, second)]
    assert across[0] - 11.5 == pytest.approx(11.5 - across[1], abs=0.5) and across[0] > 14


@pytest.mark.parametrize(
    ("text", "settings", "line"),
    [
        (
            CAMERA + LIGHT + SEQUENCE + "shutter = [-0.25, 0.25]\n" + CLAY + BALL,
            RenderSettings(renderer="whitted"),
            "sequence.shutter: whitted has no shutter",
        ),
        (
            CAMERA + "aperture = 0.1\nfocus = 4\n" + LIGHT + SEQUENCE + CLAY + BALL,
            RenderSettings(renderer="prefiltered"),
            "camera.aperture: prefiltered has a pinhole",
        ),
        (
            CAMERA + SEQUENCE + '[materials.clay]\nkind = "pbr"\nemission = [1, 1, 1]\n' + BALL,
            RenderSettings(renderer="whitted"),
            "all light of the scene is its materials' emission",
        ),
        (
            CAMERA + "aperture = 0.1\nfocus = 4\n" + LIGHT + SEQUENCE + CLAY + BALL,
            RenderSettings(renderer="whitted"),
            "Whitted's camera is a pinhole",
        ),
    ],
)
def test_what_a_renderer_cannot_show_is_refused_by_name(tmp_path, text, settings, line):
    with pytest.raises(UnsupportedScene, match=f"^(frame 1: )?{re.escape(line)}"):
        render_scene(scene_of(tmp_path, text), tmp_path / "out", settings)


@pytest.mark.parametrize(
    ("out", "frames", "line"),
    [
        ("frames", "6", "frame 6 is not in the [sequence], which has 1-5"),
        ("frames", "1-x", "'1-x' is no frame"),
        ("a.png", "1-2", "of 2 frames; give a folder for them"),
    ],
)
def test_frames_that_cannot_be_are_refused(tmp_path, out, frames, line):
    found = scene_of(tmp_path, CAMERA + LIGHT + SEQUENCE + CLAY + BALL)
    with pytest.raises(ValueError, match=re.escape(line)):
        render_scene(found, tmp_path / out, RenderSettings(frames=frames))
    assert not (tmp_path / out).exists()


def test_frames_of_another_movie_are_not_mixed_in(tmp_path: Path):
    found = scene_of(tmp_path, CAMERA + LIGHT + SEQUENCE + CLAY + BALL)
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames/frame_0009.png").write_bytes(b"")
    with pytest.raises(ValueError, match=r"holds frames of another movie, from frame_0009\.png on"):
        render_scene(found, tmp_path / "frames", FEW)


def test_denoising_leaves_an_even_light_and_takes_noise(tmp_path):
    pytest.importorskip("mitsuba_oidn")
    found = scene_of(tmp_path, CAMERA + LIGHT + CLAY + BALL)
    for name, denoise in (("plain.hdr", False), ("clean.hdr", True)):
        settings = RenderSettings(renderer="mitsuba", samples=8, denoise=denoise)
        render_scene(found, tmp_path / name, settings)
    plain, clean = (read_radiance(tmp_path / name).radiance[6:10, 10:14] for name in ("plain.hdr", "clean.hdr"))
    assert clean.std() < 0.5 * plain.std()
    np.testing.assert_allclose(clean.mean(), plain.mean(), rtol=0.02)
