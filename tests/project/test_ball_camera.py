"""Five lines are a shot: the camera from the ball, the light in its frame, objects in its place; slips in one line."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from angles import degrees_between
from relume.errors import InvalidShot, doubt_of
from relume.image import files
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import RadianceMap
from relume.probe.ball.blending import blend_views
from relume.probe.ball.unwrapping import CAMERA_FROM_PIXELS, BallView, unwrap_ball
from relume.project.insertion.ball_camera import BallCamera, camera_of_ball
from relume.project.insertion.insert import insert
from relume.project.shot_file.ball_table import BallOnTable
from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.shot import Shot, read_shot
from relume.renderers.renderer import ConstantRenderer
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import rotation_about
from relume.sphere.mappings.mapping import LatLong, pixel_points
from shoots import exposed, written
from synthetic import CENTRE, LAMPS, backdrop, lobes, photograph_ball

CUBE = Path(__file__).parents[2] / "examples/room/objects/cube_gold.glb"
WIDTH, HEIGHT, FOCAL = 300, 220, 620.0
CAMERA = Camera.looking_at(
    np.array([0.0, 0.35, 0.7]), np.array([0.11, 0.03, 0.0]), width=WIDTH, height=HEIGHT, focal_length=FOCAL
)
PITCH = float(np.degrees(np.arcsin(-(CAMERA.rotation @ [0, 0, -1])[1])))
SHORTEST = f"""
plate.photographs = "plate/*.png"
light.balls = [{{ photographs = "ball/*.png" }}]
light.ball.radius = 0.05
[[objects]]
mesh = "{CUBE.as_posix()}"
"""
KNOWN = f"camera.focal_length = {FOCAL}\ncamera.ball.pitch = {PITCH}\n"
QUICK = 'local = [{ shape = "plane", reflectance = [0.4, 0.3, 0.2] }]\nlight.size = 64\nmatch.grain = false\n'
QUICK += "match.sharpness = false\n"
SECONDS = tuple(Exposure(0.01 * 4.0**step) for step in range(6))


def seen_from(
    position: tuple[float, float, float], target: tuple[float, float, float] = (0.11, 0.03, 0.0)
) -> np.ndarray:
    """The ball as a camera of these photographs sees it from a place."""
    picture = photograph_ball(
        lobes, np.array(position), width=WIDTH, height=HEIGHT, focal_length=FOCAL, target=np.array(target)
    )
    return picture.radiance


PLATE = RadianceMap(backdrop(CAMERA.rays()).astype(np.float32))
BALL = RadianceMap(seen_from((0.0, 0.35, 0.7)))


def shot_of(folder: Path, text: str, name: str = "shot.toml") -> Shot:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return read_shot(path)


def stood(
    folder: Path, text: str = KNOWN + SHORTEST, plate: RadianceMap = PLATE, ball: RadianceMap = BALL
) -> BallCamera:
    """The camera that the ball of a shot gives, without the job around it."""
    shot = shot_of(folder, text)
    asked = shot.camera.of_ball
    assert asked is not None
    return camera_of_ball(shot, asked, plate, None, [("ball.png", ball)])


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> BallCamera:
    return stood(tmp_path_factory.mktemp("found"))


def test_the_ball_shows_where_the_camera_stood(found: BallCamera) -> None:
    # A tenth of a pixel of a rim of 40 is a quarter of a per cent of the distance.
    camera = found.fit.camera
    assert np.linalg.norm(camera.position - CAMERA.position) < 0.01 * np.linalg.norm(CAMERA.position - CENTRE)
    assert degrees_between(camera.rotation[:, 2], CAMERA.rotation[:, 2]) < 0.3
    assert found.fit.residual is not None and found.fit.residual < 0.5
    assert found.centre == (0, 0.05, 0)


def test_the_light_stands_in_the_ball_s_frame(found: BallCamera) -> None:
    """Each lamp is looked up where a camera of the true pose has it; a level look at the ball leans by pixels."""
    view = unwrap_ball(
        BALL, camera=found.fit.camera.position, centre=np.array(found.centre), focal_length=FOCAL, outline=found.outline
    )
    true = replace(view, world_from_pixels=CAMERA.rotation @ CAMERA_FROM_PIXELS)

    def off(other: BallView) -> float:
        places = [np.stack(each.places(np.array(LAMPS), 0.0)[:2]) for each in (true, other)]
        return float(np.linalg.norm(places[0] - places[1], axis=0).max())

    assert off(found.turned(view)) < 0.3 < 0.9 < off(view)
    brightest = blend_views([found.turned(view)], size=64).light.radiance.mean(-1).argmax()
    directions = LatLong().directions(pixel_points(LatLong(), 64)).reshape(-1, 3)
    assert degrees_between(directions[brightest], np.array(LAMPS)).min() < 4


def test_an_object_stands_in_the_ball_s_place(tmp_path: Path) -> None:
    (cube,) = placed_meshes(shot_of(tmp_path, SHORTEST))
    low, high = cube.vertices.min(0), cube.vertices.max(0)
    assert low[1] == 0 and np.allclose((low + high)[[0, 2]], 0, atol=1e-6)
    (own,) = placed_meshes(shot_of(tmp_path, SHORTEST + "stand = false"))
    assert not np.allclose(own.vertices.min(0), low)
    (larger,) = placed_meshes(shot_of(tmp_path, SHORTEST + "size = 0.4\nstand = [0.2, -0.1]\ntranslate = [0, 0.1, 0]"))
    assert np.ptp(larger.vertices, axis=0).max() == pytest.approx(0.4)
    assert larger.vertices.min(0)[1] == pytest.approx(0.1)
    assert (larger.vertices.min(0) + larger.vertices.max(0))[[0, 2]] / 2 == pytest.approx([0.2, -0.1])


def test_what_leans_over_stands_on_its_foot(tmp_path: Path) -> None:
    foot = trimesh.creation.box((0.02, 0.1, 0.02)).apply_translation((0.3, 0.05, -0.1))
    head = trimesh.creation.box((0.2, 0.05, 0.05)).apply_translation((0.4, 0.125, -0.1))
    trimesh.util.concatenate([foot, head]).export(tmp_path / "lamp.stl")
    (lamp,) = placed_meshes(shot_of(tmp_path, SHORTEST.replace(CUBE.as_posix(), "lamp.stl")))
    below = lamp.vertices[lamp.vertices[:, 1] < 1e-6]
    np.testing.assert_allclose((below.min(0) + below.max(0)) / 2, 0, atol=1e-6)
    assert lamp.vertices[:, 0].max() == pytest.approx(0.2, abs=1e-6)


def test_the_table_ends_where_a_table_may_unless_it_is_described(tmp_path: Path) -> None:
    (plane,) = shot_of(tmp_path, SHORTEST).surfaces()
    assert plane.size == pytest.approx((1.2, 1.2)) and plane.height == 0
    assert shot_of(tmp_path, "local = []\n" + SHORTEST).surfaces() == []


def test_what_is_guessed_is_said_with_its_effect(tmp_path: Path) -> None:
    # This plate shows no straight edge, and holds no focal length.
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        stood(tmp_path, SHORTEST)
    focal, level = (doubt_of(each.message) for each in caught)
    assert "240 pixels are taken" in focal.line and focal.effect == 0.05
    assert "give pitch (degrees) or camera_height" in level.line and level.effect == pytest.approx(0.21, abs=0.01)
    assert not level.wrong


def test_the_height_of_the_lens_stands_for_how_far_it_looked_down(tmp_path: Path, found: BallCamera) -> None:
    height = KNOWN.replace(f"pitch = {PITCH}", "camera_height = 0.35")
    other = stood(tmp_path, height + SHORTEST)
    assert np.allclose(other.fit.camera.position, found.fit.camera.position, atol=0.004)
    raised = stood(tmp_path, KNOWN + "camera.ball.raised = 0.1\n" + SHORTEST)
    moved = raised.fit.camera.position - found.fit.camera.position
    assert np.allclose(moved, [0, 0.1, 0]) and raised.centre == pytest.approx((0, 0.15, 0))


def test_a_stand_is_noticed_and_objects_stand_at_its_foot(tmp_path: Path) -> None:
    x, y = CAMERA.project(CENTRE)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    below = (rows > y + 38) & (rows < y + 88)
    cup = np.where((below & (np.abs(columns - x) < 14))[..., None], 0.4, BALL.radiance).astype(np.float32)
    with pytest.warns(UserWarning, match=r"stand on something .*give foot = \[x, y\].*or raised = 0"):
        found = stood(tmp_path, ball=RadianceMap(cup))
    foot = found.fit.camera.project(np.zeros(3))
    # The cup is painted upright; in a picture that looks down things lean, which moves its foot sideways.
    assert foot == pytest.approx([x, y + 88], abs=7) and found.centre[1] > 0.1
    on_table = stood(tmp_path, "camera.ball.raised = 0\n" + KNOWN + SHORTEST, ball=RadianceMap(cup))
    assert on_table.centre == (0, 0.05, 0)
    # A shadow is as wide as the ball, and darker.
    shadow = np.where((below & (np.abs(columns - x) < 45))[..., None], 0.4 * BALL.radiance, BALL.radiance)
    assert stood(tmp_path, ball=RadianceMap(shadow.astype(np.float32))).centre == (0, 0.05, 0)


def test_a_camera_below_a_ball_on_a_stand_looks_at_it_from_above_the_table() -> None:
    low = Camera.looking_at(np.array([0.0, 0.1, 0.7]), np.array([0, 0.2, 0]), width=WIDTH, height=400, focal_length=300)
    bare = replace(low, position=np.zeros(3), rotation=np.eye(3))
    turns = np.linspace(0, 2 * np.pi, 40)
    # A ball of 5 cm whose middle stands 25 cm above the table.
    middle = np.array([0.0, 0.25, 0.0])
    axis = low.position - middle
    side = np.cross(axis, [1.0, 0, 0]) / np.linalg.norm(np.cross(axis, [1.0, 0, 0]))
    ring = np.cos(turns)[:, None] * [1.0, 0, 0] + np.sin(turns)[:, None] * side
    rim = low.project(middle + 0.05**2 * axis / (axis @ axis) + 0.05 * np.sqrt(1 - 0.05**2 / (axis @ axis)) * ring)
    x, y = low.project(np.zeros(3))
    up = low.rotation.T @ [0.0, 1, 0]
    assert BallOnTable(foot=(float(x), float(y)))._looks_down(up, rim, bare, 0.05)
    assert BallOnTable(raised=0.2)._looks_down(up, rim, bare, 0.05)
    assert not BallOnTable()._looks_down(up, rim, bare, 0.05)
    # By a way up that puts the foot above the ball it does not.
    assert not BallOnTable(foot=(float(x), float(y)))._looks_down(-up, rim, bare, 0.05)


def test_crops_do_not_say_where_the_ball_stood(tmp_path: Path) -> None:
    x, y = CAMERA.project(CENTRE).astype(int)
    crop = RadianceMap(np.ascontiguousarray(BALL.radiance[y - 60 : y + 60, x - 60 : x + 60]))
    with pytest.warns(UserWarning, match=r"120×120 against 300×220.*rim = \[x, y, radius\]"):
        assert stood(tmp_path, ball=crop).outline is None
    # With a rim in the plate nothing is guessed, and the camera is where such a ball would have been seen from.
    away = float(np.linalg.norm(CAMERA.position - CENTRE))
    rim = [*np.round(CAMERA.project(CENTRE), 1).tolist(), round(FOCAL * 0.05 / away, 2)]
    placed = stood(tmp_path, f"camera.ball.rim = {rim}\n" + KNOWN + SHORTEST, ball=crop)
    assert np.linalg.norm(placed.fit.camera.position - CAMERA.position) < 0.02


def test_a_tripod_that_was_moved_is_noticed(tmp_path: Path) -> None:
    turned = replace(CAMERA, rotation=rotation_about((0, 1, 0), 0.3) @ CAMERA.rotation)
    other = RadianceMap(backdrop(turned.rays()).astype(np.float32))
    with pytest.raises(InvalidShot, match=r"camera: ball.png does not show the plate's view beside the ball"):
        stood(tmp_path, plate=other)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as files."""
    made = tmp_path_factory.mktemp("shortest")
    written(made / "plate", exposed(PLATE.radiance, SECONDS))
    written(made / "ball", exposed(BALL.radiance, SECONDS))
    return made


@pytest.mark.slow
def test_five_lines_and_a_second_view_are_a_picture(folder: Path) -> None:
    written(folder / "side", exposed(seen_from((0.75, 0.2, 0.0), (0.0, 0.05, 0.0)), SECONDS))
    two = SHORTEST.replace('"ball/*.png" }', '"ball/*.png" }, { photographs = "side/*.png", focal_length = 620 }')
    made = [
        insert(shot_of(folder, KNOWN + QUICK + text), folder / name, renderer=ConstantRenderer((1.0, 1.0, 1.0)))
        for name, text in (("one", SHORTEST), ("two", two))
    ]
    assert np.linalg.norm(made[0].camera.position - CAMERA.position) < 0.01
    assert made[0].place.bare.probe == pytest.approx((0, 0.05, 0)) and (folder / "one/composite.png").is_file()
    # The other camera was carried a quarter turn round the ball.
    turns = made[1].calibrated.probe.turns
    assert turns is not None
    # Turns are of the ways from the ball to the cameras: the first one looks 8° past it.
    towards = turns[1] @ (CAMERA.position - CENTRE)
    assert degrees_between(towards * [1, 0, 1], [1.0, 0.0, 0.0]) < 4
    assert made[1].calibrated.probe.unseen_solid_angle < made[0].calibrated.probe.unseen_solid_angle


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("light.ball.radius = 0.05", "light.ball = { radius = 0.05, centre = [0, 0.05, 0] }"),
            "light.ball.centre: in which frame",
        ),
        (
            ('"ball/*.png" }', '"ball/*.png", camera = [0, 0.3, 1] }'),
            r"light.balls.0.camera: in which frame\? give one of",
        ),
        (("light.ball.radius = 0.05", "light.ball.radius = 0.05\ncamera.ball.radius = 0.04"), "give it once"),
        (("light.ball.radius = 0.05", ""), "balls need ball = { radius }"),
        (
            ("plate.", "camera.pose = { position = [0, 1, 1], look_at = [0, 0, 0] }\nplate."),
            "light.ball.centre: missing",
        ),
        (("light.balls", "light.map = 'a.exr'\n#"), r"camera: give one of .*, or ball = \{ photograph, radius \}"),
        (
            ("light.balls", "camera.ball.rim = [150, 110, 40]\nlight.map = 'a.exr'\n#"),
            "camera.ball.radius: missing; give the ball's in metres",
        ),
    ],
    ids=["centre", "camera", "radius", "no radius", "pose", "map", "map and rim"],
)
def test_what_contradicts_the_ball_is_refused_in_one_line(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    assert change[0] in SHORTEST
    text = SHORTEST.replace(*change)
    with pytest.raises(InvalidShot, match=message) as refusal:
        shot_of(tmp_path, text.replace("light.ball.radius = 0.05", "") if "map" in text else text)
    assert "\n" not in str(refusal.value)


def test_a_foot_and_a_photograph_that_cannot_be_are_refused(tmp_path: Path) -> None:
    files.write(tmp_path / "small.png", Photograph(np.full((20, 30, 3), 99, np.uint8)))
    with pytest.raises(InvalidShot, match=r"camera.ball: foot 150,10 is not below the ball"):
        stood(tmp_path, "camera.ball.foot = [150, 10]\n" + KNOWN + SHORTEST)
    with pytest.raises(InvalidShot, match=r"small.png is 30×20, the plate 300×220"):
        stood(tmp_path, "camera.ball.photograph = 'small.png'\n" + KNOWN + SHORTEST)
