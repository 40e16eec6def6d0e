"""`relume stage import`: lights from balls, films and lists, what is mended, what is reported, and what is refused."""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import relume as rl
from angles import degrees_between
from command_line import printed, refused, reported
from relume.cli import main
from relume.image.colour import encode_srgb
from relume.image.files import read_photograph, write
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.lightstage.acquire.rotating_arm import RotatingArm, SteadyRotation
from relume.lightstage.acquire.store import StoredField, read_store
from relume.lightstage.field.field import whole
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from small_stages import CAMERA as SMALL_CAMERA
from small_stages import LIGHTS, camera, write_stage

pytest.importorskip("zarr", reason="stores need the extra lightstage")

GUIDE = Path(__file__).parents[2] / "docs" / "how-to" / "light-stage" / "README.md"
FAR = even_directions(24)[even_directions(24)[:, 2] > -0.4]
CIRCLE = (60.0, 45.0, 32.0)
FIELD_OF_VIEW = 40.0
CAMERA = Camera(240, 150, 120 / np.tan(np.radians(20)), np.zeros(3), np.eye(3))
BALLS = np.array([[-0.25, 0.02, -1.5], [0.25, -0.02, -1.6]])
RADIUS = 0.22
LAMPS = np.array([[0.6, 1.5, 0.4], [-0.9, 0.8, 0.2], [0.2, 0.9, 0.5], [1.2, -0.6, 0.3], [-0.5, -0.9, 0.6]])


def glow(towards: np.ndarray, light: np.ndarray) -> np.ndarray:
    """What a ball mirrors of a room of 0.02 and a lamp 12° wide, by where each ray goes."""
    return 0.02 + 5 * np.exp(-((np.arccos(np.clip((towards * light).sum(-1), -1, 1)) / np.radians(6)) ** 2))


def far_ball(light: np.ndarray, circle: tuple[float, float, float] = CIRCLE) -> np.ndarray:
    """A mirrored ball seen from far away, before a grey wall that every light reaches, (90, 120, 3)."""
    rows, columns = np.indices((90, 120)) + 0.5
    x, y = (columns - circle[0]) / circle[2], (circle[1] - rows) / circle[2]
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    mirrored = np.stack([2 * z * x, 2 * z * y, 2 * z * z - 1], axis=-1)
    picture = np.where(x**2 + y**2 < 1, glow(mirrored, light), 0.3)
    return np.repeat(picture[..., None], 3, axis=2).astype(np.float32)


def near_balls(lamp: np.ndarray) -> np.ndarray:
    """Two mirrored balls and a lamp that stands near, as `CAMERA` sees them, (150, 240, 3)."""
    rays = CAMERA.rays()
    picture = np.full(rays.shape[:2], 0.3)
    for centre in BALLS:
        along = rays @ centre
        inside = RADIUS**2 - centre @ centre + along**2
        points = (along - np.sqrt(np.maximum(inside, 0)))[..., None] * rays
        normals = (points - centre) / RADIUS
        leaving = rays - 2 * (rays * normals).sum(-1, keepdims=True) * normals
        picture = np.where(inside > 0, glow(leaving, normalised(lamp - points)), picture)
    return np.repeat(picture[..., None], 3, axis=2).astype(np.float32)


def near_word(centre: np.ndarray) -> str:
    """The middle of a ball's outline in `near_balls`, the radius of a circle of its area, and that in metres."""
    distance = float(np.linalg.norm(centre))
    axis, sine = centre / distance, RADIUS / distance
    side = normalised(np.cross(axis, [0.0, 1.0, 0.0]))
    turns = np.linspace(0, 2 * np.pi, 90, endpoint=False)[:, None]
    ring = np.cos(turns) * side + np.sin(turns) * np.cross(axis, side)
    rim = CAMERA.project(np.sqrt(1 - sine**2) * axis + sine * ring)
    middle = (rim.max(axis=0) + rim.min(axis=0)) / 2
    x, y = (rim - middle).T
    area = abs((x * np.roll(y, 1) - y * np.roll(x, 1)).sum()) / 2
    return f"{middle[0]:.3f},{middle[1]:.3f},{np.sqrt(area / np.pi):.3f}={RADIUS}"


def pictures(folder: Path, values: list[np.ndarray]) -> Path:
    folder.mkdir(parents=True)
    for index, value in enumerate(values):
        write(folder / f"shot_{index}.exr", RadianceMap(value))
    return folder


@pytest.fixture(scope="module")
def ball_shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pictures(tmp_path_factory.mktemp("far") / "shots", [far_ball(light) for light in FAR])


@pytest.fixture(scope="module")
def near_shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pictures(tmp_path_factory.mktemp("near") / "shots", [near_balls(lamp) for lamp in LAMPS])


def imported(source: Path, out: Path, *options: str) -> StoredField:
    command = ["stage", "import", str(source), "-o", str(out), "--dtype", "float", "--json", *options]
    assert main(command) == 0
    return read_store(out)


def reported_last(capsys: pytest.CaptureFixture[str]) -> dict:
    return json.loads(capsys.readouterr().out)


# Lights


def test_lights_are_found_in_a_ball_whose_circle_is_given(ball_shots, tmp_path, capsys):
    field = imported(ball_shots, tmp_path / "a.zarr", "--ball", ",".join(map(str, CIRCLE)))
    assert degrees_between(field.lights.directions, FAR).max() < 2
    assert field.camera is None and field.lights.names[0] == "shot_0.exr"
    assert reported_last(capsys)["balls"] == [list(CIRCLE)]


def test_a_ball_is_found(ball_shots, tmp_path, capsys):
    field = imported(ball_shots, tmp_path / "a.zarr", "--ball", "find")
    assert degrees_between(field.lights.directions, FAR).max() < 2
    np.testing.assert_allclose(reported_last(capsys)["balls"], [CIRCLE], atol=0.5)


def test_a_ball_in_pictures_of_its_own_shows_the_lights_of_the_subject_s(ball_shots, tmp_path):
    subject = pictures(
        tmp_path / "subject", [np.full((20, 30, 3), 0.1 + 0.01 * i, np.float32) for i in range(len(FAR))]
    )
    options = ["--ball", "60,45,32", "--ball-pictures", str(ball_shots)]
    field = imported(subject, tmp_path / "a.zarr", *options)
    assert field.shape == (20, 30) and degrees_between(field.lights.directions, FAR).max() < 2
    np.testing.assert_allclose(whole(field)[3], 0.13, rtol=1e-6)


def test_the_guide_s_python_relights_a_stage_with_a_ball(ball_shots, tmp_path, monkeypatch):
    code = re.search(r"```python\n(.*?)```", GUIDE.read_text("utf-8"), re.S)
    assert code is not None and code.group(1).count("1510, 980, 64") == 1
    (tmp_path / "shots").symlink_to(ball_shots)
    # Light from the camera's half of the sphere, where the lights stand.
    light = np.zeros((8, 16, 3), np.float32)
    light[:, :4] = light[:, 12:] = 1
    write(tmp_path / "map.exr", as_radiance_map(EnvironmentMap(light)))
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        # The ball's lights stand on one side, and its pictures have no noise.
        warnings.simplefilter("ignore", UserWarning)
        exec(code.group(1).replace("1510, 980, 64", "60, 45, 32"), names := {})
    # The wall is 0.3 under every light of irradiance 1, and half a sphere of light gives 2π of it in all.
    np.testing.assert_allclose(names["picture"].radiance[2, 2], 0.3 * 2 * np.pi, rtol=0.02)
    assert read_photograph(tmp_path / "cat.png").pixels.shape == (90, 120, 3)


def test_the_guide_s_names_are_public():
    section = GUIDE.read_text("utf-8").partition("## In Python")[2].partition("\n## ")[0]
    prose = section.rpartition("```")[2].replace("\n", " ")
    named = [name for name in re.findall(r"`([A-Za-z_]+)`", prose) if name != "relight"]
    assert len(named) > 12 and [name for name in named if not hasattr(rl.lightstage, name)] == []


def test_a_ball_is_where_a_picture_is_white(tmp_path):
    folder = pictures(tmp_path / "shots", [far_ball(light) for light in FAR])
    rows, columns = np.indices((90, 120)) + 0.5
    inside = np.hypot(columns - CIRCLE[0], rows - CIRCLE[1]) < CIRCLE[2]
    # Beside the pictures, it is none of a light.
    write(folder / "white.png", Photograph(np.repeat(inside[..., None] * np.uint8(255), 3, axis=2)))
    field = imported(folder, tmp_path / "a.zarr", "--ball", str(folder / "white.png"))
    assert len(field.lights) == len(FAR) and degrees_between(field.lights.directions, FAR).max() < 2


def test_the_ambient_picture_beside_the_ball_s_is_no_light_s(tmp_path, capsys):
    folder = pictures(tmp_path / "shots", [far_ball(light) for light in FAR[:4]])
    write(folder / "off.exr", RadianceMap(np.full((90, 120, 3), 0.01, np.float32)))
    options = ["--ball", "60,45,32", "--ambient", str(folder / "off.exr")]
    field = imported(folder, tmp_path / "a.zarr", *options)
    assert len(field.lights) == 4 and "off.exr" not in capsys.readouterr().err
    np.testing.assert_allclose(whole(field)[:, 2, 2], 0.29, rtol=1e-5)


def test_as_many_pictures_of_the_ball_as_of_the_subject_are_asked_for(ball_shots, tmp_path, capsys):
    subject = tmp_path / "subject"
    subject.mkdir()
    for index in range(3):
        write(subject / f"cat_{index}.exr", RadianceMap(np.full((20, 30, 3), 0.1, np.float32)))
    command = ["stage", "import", str(subject), "-o", str(tmp_path / "a.zarr"), "--ball", "60,45,32"]
    line = refused([*command, "--ball-pictures", str(ball_shots)], capsys)
    assert f"{len(FAR)} pictures of the ball, 3 of the subject" in line and "stage.json" not in line


def test_pictures_that_the_ball_lacks_are_named(ball_shots, tmp_path, capsys):
    subject = pictures(tmp_path / "subject", [np.full((20, 30, 3), 0.1, np.float32)] * (len(FAR) + 1))
    command = ["stage", "import", str(subject), "-o", str(tmp_path / "a.zarr"), "--ball", "60,45,32"]
    line = refused([*command, "--ball-pictures", str(ball_shots)], capsys)
    assert f"(only one of the folders has shot_{len(FAR)})" in line


def test_pictures_of_the_ball_are_those_of_the_same_names_whatever_their_format(ball_shots, tmp_path, capsys):
    names = sorted(path.stem for path in ball_shots.iterdir())
    subject = tmp_path / "subject"
    subject.mkdir()
    for index, name in enumerate(names[2:]):
        write(subject / f"{name}.png", Photograph(np.full((20, 30, 3), 40 + index, np.uint8)))
    options = ["--ball", "60,45,32", "--ball-pictures", str(ball_shots)]
    field = imported(subject, tmp_path / "a.zarr", *options)
    kept = [int(Path(name).stem.removeprefix("shot_")) for name in field.lights.names]
    assert degrees_between(field.lights.directions, FAR[kept]).max() < 2
    assert f"{names[0]}.exr has no namesake among the subject's pictures (2 such)" in capsys.readouterr().err


def test_pictures_without_a_ball_are_named_by_their_folder(tmp_path, capsys):
    folder = pictures(tmp_path / "shots", [np.full((90, 120, 3), 0.1, np.float32)] * 3)
    line = refused(["stage", "import", str(folder), "-o", str(tmp_path / "a.zarr"), "--ball", "find"], capsys)
    assert str(folder) in line and "give the ball's circle" in line


def matte_ball(light: np.ndarray) -> np.ndarray:
    """A grey ball with a stain before a dark wall, seen from far away, (90, 120, 3) in codes of a photograph."""
    rows, columns = np.indices((90, 120)) + 0.5
    x, y = (columns - CIRCLE[0]) / CIRCLE[2], (CIRCLE[1] - rows) / CIRCLE[2]
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    shading = np.maximum(np.stack([x, y, z], axis=-1) @ light, 0)
    albedo = np.where((x - 0.2) ** 2 + (y - 0.1) ** 2 < 0.04, 0.4, 0.8)
    value = np.where(x**2 + y**2 < 1, albedo * shading + 0.01, 0.02)
    return np.repeat(np.rint(255 * encode_srgb(value))[..., None], 3, axis=2).astype(np.uint8)


def test_a_matte_ball_shows_the_lights_by_its_shading(tmp_path, capsys):
    folder = tmp_path / "shots"
    folder.mkdir()
    lights = FAR[FAR[:, 2] > 0.2]
    for index, light in enumerate(lights):
        write(folder / f"shot_{index}.jpg", Photograph(matte_ball(light)))
    field = imported(folder, tmp_path / "a.zarr", "--ball", "60,45,32")
    said = capsys.readouterr()
    assert degrees_between(field.lights.directions, lights).max() < 1.5
    assert json.loads(said.out)["balls are"] == ["matte"]
    # The camera's tone curve is not known, which is a doubt unless it is said.
    assert "JPEGs such as shot_0.jpg are read as sRGB, a guess" in said.err
    imported(folder, tmp_path / "b.zarr", "--ball", "60,45,32", "--encoding", "srgb")
    assert "a guess" not in capsys.readouterr().err


def test_a_picture_in_which_a_ball_shows_no_lamp_is_named_with_its_folder(tmp_path, capsys):
    subject = pictures(tmp_path / "subject", [np.full((20, 30, 3), 0.1, np.float32)] * 4)
    dark = pictures(tmp_path / "left", [*(far_ball(light) for light in FAR[:3]), np.full((90, 120, 3), 0.1, "f")])
    command = ["stage", "import", str(subject), "-o", str(tmp_path / "a.zarr"), "--ball", "60,45,32"]
    line = refused([*command, "--ball-pictures", str(dark)], capsys)
    assert f"{dark / 'shot_3.exr'}: the ball shows no lamp" in line


def test_a_ball_that_the_lights_hardly_show_is_found_in_the_room_s_light(ball_shots, tmp_path, capsys):
    # The lamp's glow alone, and one picture more with the room's lights on.
    dark = pictures(tmp_path / "ball", [np.where(far_ball(light) > 0.5, far_ball(light), 0.01) for light in FAR])
    subject = pictures(tmp_path / "subject", [np.full((20, 30, 3), 0.1, np.float32)] * len(FAR))
    command = ["stage", "import", str(subject), "-o", str(tmp_path / "a.zarr"), "--dtype", "float", "--json"]
    command += ["--ball", "find", "--ball-pictures", str(dark)]
    line = refused(command, capsys)
    assert line.count(str(dark)) == 1 and "ball found" in line
    write(dark / "room.exr", RadianceMap(np.mean([far_ball(light) for light in FAR], axis=0)))
    assert main(command) == 0
    assert degrees_between(read_store(tmp_path / "a.zarr").lights.directions, FAR).max() < 2


def test_a_folder_of_folders_and_two_balls_where_there_is_one_are_refused(ball_shots, tmp_path, capsys):
    command = ["stage", "import", str(ball_shots.parent), "-o", str(tmp_path / "a.zarr"), "--ball", "find"]
    assert "but its folders shots do: name the subject's" in refused(command, capsys)
    command = ["stage", "import", str(ball_shots), "-o", str(tmp_path / "a.zarr"), "--ball", "find", "--ball", "find"]
    line = refused(command, capsys)
    assert f"{ball_shots}: 2 balls are sought in the same pictures, and not so many round things" in line
    assert "give each ball its circle" in line


def require_in_place(field, lamps, camera):
    """Every lamp within a share of its distance from the middle of the balls, the camera within metres."""
    middle = BALLS.mean(axis=0)
    assert field.lights.positions is not None and field.camera is not None
    away = np.linalg.norm(field.lights.positions - (LAMPS - middle), axis=1) / np.linalg.norm(LAMPS - middle, axis=1)
    assert away.max() < lamps
    np.testing.assert_allclose(field.camera.position, -middle, atol=camera)


def test_two_balls_in_metres_show_where_lamps_and_camera_stand(near_shots, tmp_path):
    options = [word for centre in BALLS for word in ("--ball", near_word(centre))]
    field = imported(near_shots, tmp_path / "a.zarr", *options, "--field-of-view", str(FIELD_OF_VIEW))
    middle = BALLS.mean(axis=0)
    require_in_place(field, lamps=0.05, camera=0.01)
    assert field.camera is not None
    np.testing.assert_allclose(field.camera.rotation, np.eye(3), atol=1e-12)
    # The camera sees the origin between the two balls, where it is.
    np.testing.assert_allclose(field.camera.project(np.zeros(3)), CAMERA.project(middle), atol=0.5)


def test_two_balls_in_one_frame_are_found_and_show_where_lamps_and_camera_stand(near_shots, tmp_path, capsys):
    options = ["--ball", "find", "--ball", "find", "--field-of-view", str(FIELD_OF_VIEW)]
    field = imported(near_shots, tmp_path / "a.zarr", *options, "--ball-radius", str(RADIUS))
    require_in_place(field, lamps=0.08, camera=0.02)
    wanted = [[float(v) for v in near_word(centre).split("=")[0].split(",")] for centre in BALLS]
    np.testing.assert_allclose(reported_last(capsys)["balls"], wanted, atol=0.6)
    # One of them given, the other sought beside it; without metres directions alone are found.
    given = ["--ball", "find", "--ball", near_word(BALLS[0]).split("=")[0]]
    found = imported(near_shots, tmp_path / "b.zarr", *given)
    np.testing.assert_allclose(reported_last(capsys)["balls"], wanted[::-1], atol=0.6)
    assert found.lights.positions is None


def test_what_is_round_and_no_ball_is_not_taken_for_the_second(ball_shots, tmp_path, capsys):
    # A ball, and a bright plate larger than it under every light.
    rows, columns = np.indices((90, 200)) + 0.5
    plate = np.hypot(columns - 158, rows - 45) < 36
    wide = [np.concatenate([far_ball(light), np.full((90, 80, 3), 0.3, np.float32)], axis=1) for light in FAR]
    folder = pictures(tmp_path / "shots", [np.where(plate[..., None], np.float32(0.9), each) for each in wide])
    command = ["stage", "import", str(folder), "-o", str(tmp_path / "a.zarr"), "--ball", "find", "--ball", "find"]
    assert "not so many round things" in refused(command, capsys)


def test_radii_of_balls_are_above_nothing_and_as_many_as_balls(ball_shots, tmp_path, capsys):
    command = ["stage", "import", str(ball_shots), "-o", str(tmp_path / "a.zarr"), "--ball", "60,45,32"]
    assert "1 radii for 1 balls, the least 0.0 metres" in refused([*command, "--ball-radius", "0"], capsys)
    line = refused([*command, "--ball-radius", "0.1", "--ball-radius", "0.2"], capsys)
    assert "2 radii for 1 balls" in line and "one for each" in line


def test_a_camera_is_reported_by_its_field_of_view_and_distance(ball_shots, tmp_path):
    circle = ["--ball", "60,45,32", "--field-of-view", "40"]
    field = imported(ball_shots, tmp_path / "a.zarr", *circle, "--camera-distance", "2.5")
    assert field.camera is not None
    assert field.camera.focal_length == pytest.approx(60 / np.tan(np.radians(20)))
    np.testing.assert_allclose(field.camera.position, [0, 0, 2.5])
    np.testing.assert_allclose(field.camera.rays()[45, 60], [0, 0, -1], atol=0.01)
    assert imported(ball_shots, tmp_path / "b.zarr", *circle).camera is None


def test_a_list_of_directions_has_no_line_for_the_ambient_picture(tmp_path):
    folder = pictures(tmp_path / "shots", [np.full((8, 8, 3), 0.5 + 0.1 * i, np.float32) for i in range(4)])
    write(folder / "off.exr", RadianceMap(np.full((8, 8, 3), 0.2, np.float32)))
    (tmp_path / "lights.txt").write_text("1 0 0\n0 1 0\n0 0 1\n-1 0 0\n")
    options = ["--lights", str(tmp_path / "lights.txt"), "--ambient", str(folder / "off.exr")]
    field = imported(folder, tmp_path / "a.zarr", *options, "--field-of-view", "30", "--camera-distance", "3")
    np.testing.assert_allclose(whole(field)[:, 4, 4, 0], [0.3, 0.4, 0.5, 0.6], rtol=1e-5)
    assert field.camera is not None and field.camera.position[2] == 3


def frame(index: int) -> np.ndarray:
    return np.full((32, 48, 3), 40 + 10 * index, np.uint8)


def test_a_folder_of_frames_is_a_spinning_stage(tmp_path, capsys):
    (tmp_path / "film").mkdir()
    for index in range(16):
        write(tmp_path / "film" / f"f{index}.png", Photograph(frame(index)))
    # A picture without the lamp among them is none of its frames.
    write(tmp_path / "film" / "a.png", Photograph(np.full((32, 48, 3), 40, np.uint8)))
    options = ["--film", "2,4,8", "--ambient", str(tmp_path / "film" / "a.png")]
    field = imported(tmp_path / "film", tmp_path / "a.zarr", *options)
    assert len(field.lights) == 8 and field.lights.grid == (2, 4)
    # Two rings, at 45° and 135° from +Y; the first light is seen an eighth of a turn from +Z towards +X.
    np.testing.assert_allclose(field.lights.directions[:, 1], np.repeat([0.5**0.5, -(0.5**0.5)], 4), atol=1e-12)
    numbers = np.array([int(name[-6:]) for name in field.lights.names])
    linear = (((40 + 10 * numbers) / 255 + 0.055) / 1.055) ** 2.4 - ((40 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(whole(field)[:, 0, 0, 0], linear, atol=1e-6)
    # Frames between those of the grid are no surprise.
    assert "named by none" not in capsys.readouterr().err


@pytest.mark.parametrize(("start", "more"), [(0.7, 0), (-0.3, 0), (5.0, 14)])
def test_a_ball_in_a_film_shows_how_the_lamp_went(start, more, tmp_path):
    # The lamp goes on with the first ring: in the film, just before it, or in a film that is a turn too long.
    course = RotatingArm(SteadyRotation(1 / 12.3, start), rings=2, first_inclination=0.9, step=1.1)
    (tmp_path / "film").mkdir()
    count = int(np.ceil(start + 2 * 12.3))
    for index, towards in enumerate(course.directions(np.arange(count + more))):
        dark = np.isnan(towards).any()
        value = np.full((90, 120, 3), 0.02) if dark else far_ball(towards)
        write(tmp_path / "film" / f"f{index}.exr", RadianceMap(value.astype(np.float32)))
    field = imported(tmp_path / "film", tmp_path / "a.zarr", "--film", "2,4", "--ball", ",".join(map(str, CIRCLE)))
    assert field.lights.grid == (2, 4)
    frames = np.array([int(name[-6:]) for name in field.lights.names])
    assert degrees_between(field.lights.directions, course.directions(frames)).max() < 2


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("av")
    from relume.image.files.video import Movie

    path = tmp_path_factory.mktemp("video") / "spin.mp4"
    with Movie(path, 30) as movie:
        for index in range(16):
            movie.add(frame(index))
    return path


def test_a_dry_run_of_a_film_writes_nothing(video, tmp_path, capsys):
    command = ["stage", "import", str(video), "-o", str(tmp_path / "new" / "a.zarr"), "--film", "2,4,8", "--dry-run"]
    facts = reported(command, capsys)
    assert (facts["frames"], facts["lights"], facts["size"]) == (16, 8, [48, 32])
    assert list(tmp_path.iterdir()) == [] and [path.name for path in video.parent.iterdir()] == ["spin.mp4"]


def test_the_frames_of_a_film_do_not_stay_beside_the_store(video, tmp_path):
    field = imported(video, tmp_path / "a.zarr", "--film", "2,4,8", "--field-of-view", "30", "--camera-distance", "2")
    assert len(field.lights) == 8 and field.shape == (32, 48) and field.camera is not None
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_the_frames_of_a_film_that_is_refused_do_not_stay(video, tmp_path, capsys):
    command = ["stage", "import", str(video), "-o", str(tmp_path / "a.zarr"), "--film", "2,4,8"]
    assert "not within pictures of 48×32" in refused([*command, "--target", "0,0,99,9=0.5"], capsys)
    assert list(tmp_path.iterdir()) == []


# Mending


def plain(folder: Path, shape: tuple[int, int] = (60, 80), noise: float = 0.0, **table: object) -> Path:
    """A smooth thing that every light of 24 reaches, on a camera that looks along −Z."""
    rng = np.random.default_rng(3)
    rows = np.linspace(1, 1.3, shape[0])[:, None, None]
    folder.mkdir()
    lights = []
    for index, direction in enumerate(even_directions(LIGHTS)):
        value = rows * (0.3 + 0.1 * direction[1]) * np.ones((*shape, 3))
        value = value + noise * np.sqrt(value) * rng.standard_normal(value.shape)
        write(folder / f"light_{index:02d}.exr", RadianceMap(value.astype(np.float32)))
        lights.append({"file": f"light_{index:02d}.exr", "direction": direction.tolist()})
    front = {"position": [0, 0, 3], "look_at": [0, 0, 0], "hfov_deg": 60}
    (folder / "stage.json").write_text(json.dumps({"lights": lights, "cameras": {"front": front}} | table))
    return folder


def painted(folder: Path, light: int, pixels: np.ndarray, value: float) -> np.ndarray:
    """Spoil one light's picture at pixels (H, W) bool; the picture as it was."""
    from relume.image.files import read_radiance

    path = folder / f"light_{light:02d}.exr"
    before = read_radiance(path).radiance
    write(path, RadianceMap(np.where(pixels[..., None], np.float32(value), before)))
    return before


def test_the_room_s_own_light_is_taken_off(tmp_path):
    folder = plain(tmp_path / "shots", (8, 8))
    write(folder / "off.exr", RadianceMap(np.full((8, 8, 3), 0.05, np.float32)))
    bare = imported(folder, tmp_path / "b.zarr", "--ambient", str(folder / "off.exr"))
    expected = whole(imported(folder, tmp_path / "a.zarr")) - 0.05
    np.testing.assert_allclose(whole(bare), expected, atol=1e-6)


def test_what_a_mask_paints_white_is_filled_from_the_lights_around(tmp_path):
    folder = plain(tmp_path / "shots")
    spot = np.zeros((60, 80), bool)
    spot[20:30, 30:40] = True
    before = painted(folder, 5, spot, 9.0)
    (tmp_path / "masks").mkdir()
    write(tmp_path / "masks" / "light_05.png", Photograph(np.repeat(spot[..., None] * np.uint8(255), 3, axis=2)))
    seen = whole(imported(folder, tmp_path / "a.zarr", "--mask", str(tmp_path / "masks")))[5]
    np.testing.assert_allclose(seen[spot], before[spot], rtol=0.15)
    np.testing.assert_array_equal(seen[~spot], before[~spot])


def test_the_stage_s_own_bar_is_filled(tmp_path):
    folder = plain(tmp_path / "shots")
    bar = np.zeros((60, 80), bool)
    bar[:, 40:43] = True
    before = painted(folder, 5, bar, 0.002)
    with_bar = whole(imported(folder, tmp_path / "a.zarr"))[5]
    assert with_bar[bar].max() < 0.01
    seen = whole(imported(folder, tmp_path / "b.zarr", "--bars"))[5]
    np.testing.assert_allclose(seen[bar], before[bar], rtol=0.15)


def test_a_lamp_that_shines_into_the_lens_is_filled(tmp_path):
    folder = plain(tmp_path / "shots")
    front = Camera.looking_at(np.array([0, 0, 3.0]), np.zeros(3), width=80, height=60, focal_length=40 * 3**0.5)
    ahead = int(np.argmin(even_directions(LIGHTS)[:, 2]))
    angle = degrees_between(front.rays(), even_directions(LIGHTS)[ahead])
    assert angle.min() < 1
    before = painted(folder, ahead, angle < 3, 500.0)
    seen = whole(imported(folder, tmp_path / "a.zarr", "--flare", "--lamp-size", "6"))[ahead]
    np.testing.assert_allclose(seen, before, rtol=0.3)


def test_the_stage_file_s_own_target_is_used_and_reported(tmp_path, capsys):
    card = {"rectangle": [2, 3, 4, 5], "reflectance": 0.5}
    folder = plain(tmp_path / "shots", (12, 12), target=card)
    own = whole(imported(folder, tmp_path / "a.zarr"))
    facts = reported_last(capsys)
    assert facts["target"] == "2,3,4,5=0.5" and "irradiance, median" in facts
    np.testing.assert_array_equal(whole(imported(folder, tmp_path / "b.zarr", "--target", "2,3,4,5=0.5")), own)
    other = whole(imported(folder, tmp_path / "c.zarr", "--target", "2,3,4,5=1"))
    np.testing.assert_allclose(other, 2 * own, rtol=1e-5)


def board_and_subject(folder: Path, kind: str) -> tuple[Path, Path]:
    """A grey wall and a white board of twice its albedo under lights that are uneven, each its own way."""
    x, y = np.meshgrid(np.linspace(-1, 1, 48), np.linspace(-1, 1, 36))
    lights = []
    for place, albedo in (("wall", 0.25), ("board", 0.5)):
        (folder / place).mkdir()
        for index, direction in enumerate(even_directions(4)):
            value = albedo * np.exp(0.4 * direction[0] * x + 0.3 * direction[1] * y * y)
            value = np.repeat(value[..., None], 3, axis=2)
            name = f"{index}.{kind}"
            if kind == "exr":
                write(folder / place / name, RadianceMap(value.astype(np.float32)))
            else:
                write(folder / place / name, Photograph(np.round(65535 * value).astype(np.uint16)))
            lights.append({"file": name, "direction": direction.tolist()})
    (folder / "wall" / "stage.json").write_text(json.dumps({"lights": lights[:4]}))
    return folder / "wall", folder / "board"


@pytest.mark.parametrize(("kind", "options"), [("exr", []), ("png", ["--encoding", "linear"])])
def test_a_white_board_takes_out_how_unevenly_each_light_shines(kind, options, tmp_path):
    wall, board = board_and_subject(tmp_path, kind)
    assert np.ptp(whole(imported(wall, tmp_path / "a.zarr", *options))[0]) > 0.1
    even = whole(imported(wall, tmp_path / "b.zarr", *options, "--board", str(board)))
    means = even.mean(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(even, np.broadcast_to(means, even.shape), rtol=2e-3)
    np.testing.assert_allclose(means, 0.25, rtol=0.1)


@pytest.mark.parametrize("slope", [0.0, 0.7])
def test_the_fall_off_of_near_lamps_is_divided_out(slope, tmp_path):
    # A card through the middle: upright, as is assumed, or leaning back to the right, which a mesh says.
    view = camera()
    rays = view.rays()
    points = view.position + (view.position[2] / (slope * rays[..., 0] - rays[..., 2]))[..., None] * rays
    folder, lights = tmp_path / "card", []
    folder.mkdir()
    for index, direction in enumerate(normalised(np.array([[1, 0, 1.0], [-1, 1, 1], [0, -1, 2]]))):
        square = ((1.5 * direction - points) ** 2).sum(axis=-1, keepdims=True)
        value = np.repeat(0.2 * 1.5**2 / square, 3, axis=2)
        assert np.ptp(value) > 0.1
        write(folder / f"{index}.exr", RadianceMap(value.astype(np.float32)))
        lights.append({"file": f"{index}.exr", "position": (1.5 * direction).tolist()})
    table: dict[str, object] = {"lights": lights, "cameras": {"front": SMALL_CAMERA}}
    if slope:
        corners = [f"v {x} {y} {slope * x}" for x, y in ((-3, -3), (3, -3), (3, 3), (-3, 3))]
        (folder / "card.obj").write_text("\n".join([*corners, "f 1 2 3", "f 1 3 4"]) + "\n")
        table["mesh"] = "card.obj"
    (folder / "stage.json").write_text(json.dumps(table))
    np.testing.assert_allclose(whole(imported(folder, tmp_path / "a.zarr", "--near-fall-off")), 0.2, rtol=1e-4)


# Noise


def test_the_noise_is_seen_in_the_pictures_kept_and_reported(tmp_path, capsys):
    field = imported(plain(tmp_path / "shots", (96, 128), 0.02), tmp_path / "a.zarr")
    assert field.noise is not None
    # The variance is 4e-4 of the value.
    assert field.noise.constant + 0.35 * field.noise.slope == pytest.approx(0.35 * 4e-4, rel=0.1)
    assert reported_last(capsys)["noise"] == pytest.approx([field.noise.constant, field.noise.slope], rel=0.01)


def test_noise_that_is_given_goes_into_the_store_with_the_gains(tmp_path):
    folder = plain(tmp_path / "shots", (70, 70), target={"rectangle": [0, 0, 70, 70], "reflectance": 1.0})
    field = imported(folder, tmp_path / "a.zarr", "--noise", "1e-4,2e-3")
    gains = (
        whole(field)[:, 35, 35, 0] / whole(imported(plain(tmp_path / "b", (70, 70)), tmp_path / "b.zarr"))[:, 35, 35, 0]
    )
    assert field.noise is not None
    assert field.noise.constant == pytest.approx(1e-4 * (gains**2).mean(), rel=1e-3)
    assert field.noise.slope == pytest.approx(2e-3 * gains.mean(), rel=1e-3)


def test_the_steps_of_8_bits_are_in_the_noise(tmp_path):
    (tmp_path / "shots").mkdir()
    lights = []
    for index, direction in enumerate(even_directions(4)):
        write(tmp_path / "shots" / f"{index}.png", Photograph(np.full((64, 64, 3), 100 + index, np.uint8)))
        lights.append({"file": f"{index}.png", "direction": direction.tolist()})
    (tmp_path / "shots" / "stage.json").write_text(json.dumps({"lights": lights, "encoding": "linear"}))
    field = imported(tmp_path / "shots", tmp_path / "a.zarr")
    assert field.noise is not None
    assert field.noise.constant == pytest.approx((1 / 255) ** 2 / 12) and field.noise.slope == 0


def test_noise_is_left_unknown_where_that_is_asked_for_or_nothing_shows_it(tmp_path, capsys):
    folder = plain(tmp_path / "shots", (96, 128), 0.02)
    assert imported(folder, tmp_path / "a.zarr", "--no-noise").noise is None
    assert "noise" not in capsys.readouterr().err
    assert imported(plain(tmp_path / "clean", noise=1e-4), tmp_path / "b.zarr").noise is None
    assert "the pictures show none; give it" in capsys.readouterr().err
    assert imported(plain(tmp_path / "small", (20, 20), 0.02), tmp_path / "c.zarr").noise is None
    assert "20×20 are too small" in capsys.readouterr().err


# Refusals


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_stage(tmp_path_factory.mktemp("stage") / "ball", 6)


def test_a_dry_run_says_what_would_be_done_and_writes_nothing(stage, tmp_path, capsys):
    facts = reported(["stage", "import", stage, "-o", tmp_path / "a.zarr", "--noise", "1e-6,0", "--dry-run"], capsys)
    assert facts["lights"] == 6 and facts["noise"] == [1e-6, 0]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--ball", "find", "--film", "2,4,8"], "give one of them"),
        (["--ball", "round"], "round"),
        (["--ball", "3,3,-1"], "radii above 0"),
        (["--ball", "3,3,2=0"], "radii above 0"),
        (["--ball", "500,500,9"], "the ball at 500,500 is not in a picture of 32×24"),
        (["--ball-pictures", "."], "pictures of balls without balls"),
        (["--film", "2"], "--film"),
        (["--film", "2,4"], "one ball in the film"),
        (["--film", "8,4,8"], "not the 8 rings of the stage"),
        (["--lights", "none.txt"], "none.txt"),
        (["--field-of-view", "40"], "give the distance too"),
        (["--camera-distance", "2"], "without its field of view"),
        (["--camera-distance", "0", "--field-of-view", "40"], "distance is 0"),
        (["--camera-distance", "2", "--field-of-view", "40"], "has a camera of its own"),
        (["--ball", "9,9,5=0.1", "--camera-distance", "2", "--field-of-view", "40"], "balls in metres"),
        (["--noise", "a"], "CONSTANT,SLOPE"),
        (["--noise", "1,-1"], "not below 0"),
        (["--noise", "1e-6,0", "--no-noise"], "give one of them"),
        (["--target", "0,0,4,4"], "--target"),
        (["--target", "0,0,40,4=0.9"], "not within pictures of 32×24"),
        (["--ambient", "off.exr"], "off.exr"),
        (["--ball", "9,9,5", "--flare"], "the ball shows no lamp"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(stage, options, said, tmp_path, capsys):
    out = tmp_path / "a.zarr"
    assert said in refused(["stage", "import", str(stage), "-o", str(out), *options], capsys)
    assert not out.exists()


def test_a_ball_that_is_not_there_is_not_found(tmp_path, capsys):
    folder = plain(tmp_path / "shots", (60, 60))
    command = ["stage", "import", str(folder), "-o", str(tmp_path / "a.zarr"), "--ball", "find"]
    assert f"{folder}: no ball found; it must be round" in refused(command, capsys)


def test_flare_without_a_camera_says_how_to_give_one(ball_shots, tmp_path, capsys):
    command = ["stage", "import", str(ball_shots), "-o", str(tmp_path / "a.zarr"), "--ball", "60,45,32", "--flare"]
    assert "the camera's distance" in refused(command, capsys)


def test_a_target_of_one_of_several_cameras_is_not_guessed(stage, tmp_path, capsys):
    table = json.loads((stage / "stage.json").read_text())
    lights = [
        {"files": {"left": light["file"]}, "direction": light["direction"]}
        | ({"files": {"left": light["file"], "right": f"r{light['file']}"}})
        for light in table["lights"]
    ]
    card = {"rectangle": [0, 0, 4, 4], "reflectance": 1}
    (tmp_path / "stage.json").write_text(json.dumps({"lights": lights, "target": card}))
    line = refused(["stage", "import", str(tmp_path), "-o", str(tmp_path / "a.zarr")], capsys)
    assert "left, right" in line and "give the target" in line


def test_one_mask_leaves_its_pixels_black_under_every_light(tmp_path):
    folder = plain(tmp_path / "stage")
    painted_white = np.zeros((60, 80, 3), np.uint8)
    painted_white[:10] = 255
    write(tmp_path / "mask.png", Photograph(painted_white))
    values = whole(imported(folder, tmp_path / "a.zarr", "--mask", str(tmp_path / "mask.png")))
    np.testing.assert_array_equal(values[:, :10], 0)
    assert values[:, 10:].max() > 0


@pytest.mark.parametrize(("encoding", "value"), [("linear", 128 / 255), ("srgb", 0.21586), (None, 0.21586)])
def test_photographs_stand_for_what_they_are_asked_to(encoding, value, tmp_path):
    folder = tmp_path / "stage"
    folder.mkdir()
    for index in range(4):
        write(folder / f"light_{index}.png", Photograph(np.full((20, 30, 3), 128, np.uint8)))
    (folder / "lights.lp").write_text("4\n" + "".join(f"light_{i}.png {i - 1.5} 0.5 1\n" for i in range(4)))
    options = [] if encoding is None else ["--encoding", encoding]
    values = whole(imported(folder, tmp_path / "a.zarr", *options))
    np.testing.assert_allclose(values, value, rtol=1e-4)


def test_an_import_is_gone_on_with_only_as_it_was_begun(tmp_path, capsys):
    folder, store = plain(tmp_path / "stage"), tmp_path / "a.zarr"
    imported(folder, store)
    chunk = max(path for path in (store / "values").rglob("*") if path.is_file() and path.name != "zarr.json")
    chunk.unlink()
    command = ["stage", "import", str(folder), "-o", str(store), "--dtype", "float"]
    assert "another" in printed([*command, "--noise", "1e-6,0"], capsys, 2).err
    assert main(command) == 0


def test_a_store_remembers_the_stage_s_mesh(tmp_path):
    from relume.lightstage.acquire.read_stage import stage_geometry

    folder = plain(tmp_path / "stage", light={"angular_diameter_deg": 3.0})
    (folder / "objects").mkdir()
    (folder / "objects" / "ball.ply").write_text("ply\n")
    imported(folder, tmp_path / "a.zarr")
    mesh, radius = stage_geometry(tmp_path / "a.zarr")
    assert mesh == (folder / "objects" / "ball.ply").resolve()
    assert radius == pytest.approx(np.radians(1.5))


def test_strobes_along_an_arm_are_one_light_a_frame(tmp_path, capsys):
    (tmp_path / "film").mkdir()
    for index in range(12):
        write(tmp_path / "film" / f"f{index}.png", Photograph(np.full((32, 48, 3), 9 + 10 * index, np.uint8)))
    options = ["--strobes", "3,4", "--stepped", "--no-noise", "--encoding", "linear"]
    field = imported(tmp_path / "film", tmp_path / "a.zarr", *options)
    assert field.lights.grid == (3, 4)
    # The ring nearest the top holds the first flash of each sequence.
    np.testing.assert_allclose(255 * whole(field)[:4, 0, 0, 0], [9, 39, 69, 99], rtol=1e-5)
    for wrong in (["--strobes", "5,4"], ["--strobes", "3,4", "--film", "3,4,4"]):
        assert main(["stage", "import", str(tmp_path / "film"), "-o", str(tmp_path / "b.zarr"), *wrong]) == 2
    assert not (tmp_path / "b.zarr").exists()
