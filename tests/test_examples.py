"""The examples show what their comments say: scene files of examples/whitted (Whitted 1980, §4), examples/places."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from itertools import combinations
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import relume as rl
from relume.renderers.whitted.whitted import PreparedWhitted
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.shapes.shapes import Patches

EXAMPLES = Path(__file__).parents[1] / "examples"
FOLDER = EXAMPLES / "whitted"
CHAPEL = EXAMPLES / "places" / "chapel.toml"
FILES = sorted(path.stem for path in FOLDER.glob("*.toml"))


@cache
def read(name: str) -> rl.SceneFile:
    return rl.read_scene(FOLDER / f"{name}.toml")


def prepared(name: str) -> PreparedWhitted:
    """The scene with one ray through the middle of each pixel."""
    return replace(read(name).whitted, antialiasing=None).prepared(read(name).scene)


@cache
def plain(name: str) -> rl.Render:
    """A quarter of its size, 160×120."""
    return prepared(name).render(smaller(read(name).camera, 4))


def smaller(camera: rl.Camera, by: int) -> rl.Camera:
    return replace(camera, width=camera.width // by, height=camera.height // by, focal_length=camera.focal_length / by)


def seen_at(name: str, point: tuple[float, float, float]) -> np.ndarray:
    """(3,) the radiance of the pixel of the full picture in which a point of the scene lies."""
    camera = read(name).camera
    x, y = np.floor(camera.project(np.array(point))).astype(int)
    return prepared(name).render(camera, region=(x, y, x + 1, y + 1)).radiance[0, 0]


def disc(name: str, index: int) -> np.ndarray:
    """(120, 160) the pixels of `plain` whose ray meets a sphere, whatever stands before it."""
    ball, camera = read(name).scene.objects[index], smaller(read(name).camera, 4)
    assert isinstance(ball, rl.Sphere)
    to_centre = np.asarray(ball.centre) - camera.position
    along = camera.rays() @ to_centre
    return to_centre @ to_centre - along**2 < ball.radius**2


def reflected_from(name: str, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Where the pixels of `plain` lie on a sphere, and whether the mirror image there is of what lies below."""
    ball, camera = read(name).scene.objects[index], smaller(read(name).camera, 4)
    assert isinstance(ball, rl.Sphere)
    rays, on = camera.rays(), disc(name, index)
    to_centre = np.asarray(ball.centre) - camera.position
    along = rays @ to_centre
    inside = np.sqrt(np.maximum(ball.radius**2 - to_centre @ to_centre + along**2, 0))
    normal = ((along - inside)[..., None] * rays - to_centre) / ball.radius
    mirrored = rays - 2 * np.sum(rays * normal, -1, keepdims=True) * normal
    return on, mirrored[..., 1] < -0.1


def is_red(radiance: np.ndarray) -> np.ndarray:
    return radiance[..., 0] > 2.5 * radiance[..., 1]


@pytest.mark.parametrize("name", FILES)
def test_every_example_is_read_and_rendered(name: str) -> None:
    file = read(name)
    assert file.asks_whitted
    assert (file.camera.width, file.camera.height) == (640, 480)
    assert 5 <= file.whitted.depth <= 8
    picture = file.whitted.render(file.scene, smaller(file.camera, 8))
    assert picture.radiance.shape == (60, 80, 3)
    assert np.all(np.isfinite(picture.radiance))
    assert picture.radiance.min() >= 0
    assert np.ptp(picture.radiance) > 0.3
    assert 0.05 < picture.matte.mean() < 0.8


def test_the_paper_s_three_figures_the_teapot_and_a_sequence_are_there() -> None:
    assert FILES == ["figure_6", "figure_7", "figure_8", "sequence", "teapot"]


def test_figure_6_shows_three_glossy_objects_of_which_two_are_wrinkled() -> None:
    materials = {id(thing.material): thing.material for thing in read("figure_6").scene.objects}.values()
    assert len(materials) == 3
    assert all(isinstance(material, WhittedMaterial) and max(material.specular) > 0 for material in materials)
    assert sum(isinstance(m, WhittedMaterial) and m.bumps is not None for m in materials) == 2
    objects = tuple(
        replace(thing, material=replace(thing.material, bumps=None))  # pyright: ignore[reportCallIssue, reportArgumentType]
        for thing in read("figure_6").scene.objects
    )
    smooth = replace(prepared("figure_6"), scene=replace(read("figure_6").scene, objects=objects))
    changed = np.abs(smooth.render(smaller(read("figure_6").camera, 4)).radiance - plain("figure_6").radiance).max(-1)
    orange, blue = disc("figure_6", 0), disc("figure_6", 1)
    assert np.mean(changed[orange & ~blue] > 0.02) > 0.4
    assert np.mean(changed[blue] > 0.02) < 0.1


def test_an_object_of_figure_6_is_seen_in_another() -> None:
    scene = read("figure_6").scene
    alone = replace(prepared("figure_6"), scene=replace(scene, objects=scene.objects[1:]))
    without = alone.render(smaller(read("figure_6").camera, 4)).radiance
    added = (plain("figure_6").radiance - without)[disc("figure_6", 1)]
    # The blue ball reflects the lit side of the orange one.
    orange = (added[:, 0] > 0.05) & (added[:, 0] > 2 * added[:, 2])
    assert 0.01 < orange.mean() < 0.3


def test_the_ball_of_figure_7_swaps_the_sides_of_what_is_behind_it() -> None:
    radiance, ball = plain("figure_7").radiance, disc("figure_7", 1)
    middle = np.nonzero(ball)[1].mean()
    rows, columns = np.nonzero(is_red(radiance) & ~ball)
    in_front = rows < np.nonzero(ball)[0].max()
    assert np.mean(columns[in_front] < middle) > 0.9
    _, refracted = np.nonzero(is_red(radiance) & ball)
    assert len(refracted) > 20
    assert np.mean(refracted > middle) > 0.9


def test_the_ball_of_figure_7_shows_the_table_above_the_wall() -> None:
    radiance, ball = plain("figure_7").radiance, disc("figure_7", 1)
    rows, columns = np.nonzero(ball)
    upper, lower = rows.min() + 5, int(0.75 * rows.max() + 0.25 * rows.min())
    across = slice(int(columns.mean()) - 15, int(columns.mean()) + 5)

    def blueness(row: int) -> np.ndarray:
        return radiance[row, across, 2] / radiance[row, across, 0]

    assert np.all(blueness(upper) < 1)  # brown throughout
    assert np.any(blueness(lower) > 1.5)  # the wall's blue squares


def test_the_mirrored_ball_of_figure_8_shows_the_floor_below_and_the_sky_above() -> None:
    radiance = plain("figure_8").radiance
    on, below = reflected_from("figure_8", 2)
    alone = on & ~disc("figure_8", 0)
    floor, sky = radiance[alone & below], radiance[alone & ~below]
    assert len(floor) > 300
    assert len(sky) > 300
    assert np.mean(floor[:, 0] > 1.5 * floor[:, 2]) > 0.9
    assert np.mean(sky[:, 2] > 1.5 * sky[:, 0]) > 0.7
    # Both of the floor's colours.
    assert 0.2 < np.mean(floor[:, 1] > 0.6 * floor[:, 0]) < 0.8


def test_the_bubble_of_figure_8_leaves_what_is_behind_it_upright() -> None:
    radiance, hollow = plain("figure_8").radiance, disc("figure_8", 1)
    rows, columns = np.nonzero(hollow & ~disc("figure_8", 2))
    right = columns > np.median(columns)
    low = rows > np.quantile(rows, 0.6)
    values = radiance[rows, columns]
    assert np.mean(values[right & low, 0] > values[right & low, 2]) > 0.9
    assert np.mean(values[right & ~low, 2] > values[right & ~low, 0]) > 0.6


def test_the_shadows_of_figure_8_are_as_dark_as_what_casts_them() -> None:
    # Below a light of intensity 2.7 at (28, 44, 10), ambient light 0.2, on red squares of 0.86.
    def on_the_floor(ball: tuple[float, float, float]) -> tuple[float, float, float]:
        """The middle of the red square nearest to a ball's shadow."""
        light = np.array([28.0, 44.0, 10.0])
        shadow = light + (np.array(ball) - light) * 44 / (44 - ball[1])
        middles = [(i + 0.5, 0.0, k + 0.5) for i in range(-2, 8) for k in range(-8, 2) if (i + k) % 2 == 0]
        return min(middles, key=lambda middle: float(np.linalg.norm(np.array(middle) - shadow)))

    def lit(point: tuple[float, float, float]) -> float:
        towards = np.array([28.0, 44.0, 10.0]) - point
        return 2.7 / np.pi * towards[1] / float(np.linalg.norm(towards))

    dark, pale = on_the_floor((2.0, 1.5, -2.5)), on_the_floor((4.0, 2.3, -4.0))
    open_floor = (0.5, 0.0, 0.5)
    assert seen_at("figure_8", open_floor)[0] == pytest.approx(0.86 * (0.2 + lit(open_floor)), rel=0.01)
    assert seen_at("figure_8", dark)[0] == pytest.approx(0.86 * 0.2, rel=0.01)
    # Through both sides of the glass and of the hollow in it.
    through = 0.82**2 * 0.96**2
    assert seen_at("figure_8", pale)[0] == pytest.approx(0.86 * (0.2 + through * lit(pale)), rel=0.01)


def test_the_teapot_stands_upright_on_the_floor() -> None:
    (teapot,) = read("teapot").scene.objects
    assert isinstance(teapot, Patches)
    assert len(teapot.control) == 32
    low, high = teapot.control.reshape(-1, 3).min(axis=0), teapot.control.reshape(-1, 3).max(axis=0)
    assert low[1] == pytest.approx(0, abs=1e-6)
    assert 3 < high[1] < 3.3
    assert high[0] > -low[0] > 2.5  # the spout to the right, the handle to the left


def test_the_balls_of_the_sequence_go_round_without_touching_and_come_back() -> None:
    file = read("sequence")
    assert sum(orbit is not None for orbit in file.orbits) == 3
    for share in np.linspace(0, 1, 97):
        balls = [ball for ball in file.at(share).objects if isinstance(ball, rl.Sphere)]
        assert len(balls) == 4
        for one, other in combinations(balls, 2):
            assert np.linalg.norm(np.subtract(one.centre, other.centre)) > one.radius + other.radius
    first, last = (np.array([ball.centre for ball in file.at(share).objects]) for share in (0, 1))  # pyright: ignore[reportAttributeAccessIssue]
    assert last == pytest.approx(first, abs=1e-9)
    half = file.at(0.5).objects[1]
    assert isinstance(half, rl.Sphere)
    assert half.centre == pytest.approx((-1.75, 0.6, 0.0), abs=1e-9)


def places_figures() -> ModuleType:
    """The script that makes the photographs and marks of examples/places."""
    specification = spec_from_file_location("places_figures", CHAPEL.with_name("figures.py"))
    assert specification is not None and specification.loader is not None
    module = module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_the_chapel_is_found_from_its_marks() -> None:
    place = rl.model_place(CHAPEL)
    assert place.doubts == ()
    assert [photograph.file.is_file() for photograph in place.photographs] == [True] * 5
    sizes = {block.name: block.size for block in place.blocks}
    assert sizes["nave"] == pytest.approx([7, 8, 14], rel=0.003)
    assert sizes["roof"] == pytest.approx([7, 4, 14], rel=0.003)
    assert sizes["left_aisle"] == pytest.approx([3, 4.5, 14], rel=0.003)
    assert sizes["right_aisle"].tolist() == sizes["left_aisle"].tolist()
    assert sizes["tower"] == pytest.approx([7, 15, 6], rel=0.003)
    assert sizes["spire"] == pytest.approx([7, 7, 6], rel=0.003)
    assert sizes["well"] == pytest.approx([2.5, 1.2, 2.5], rel=0.007)
    # Of what is found beside the truth in its own deviations; of 250 spare residuals χ² is 250 ± 22.
    off = [(size - truth) / deviation for size, truth, deviation in (
        (place.block("tower").size[1], 15.0, place.block("tower").deviation[1]),
        (place.block("well").size[0], 2.5, place.block("well").deviation[0]),
    )]  # fmt: skip
    assert np.abs(off).max() < 3
    assert 0.75 < place.chi_square / place.freedom < 1.25


def test_the_cameras_of_the_chapel_are_found() -> None:
    true = places_figures().CAMERAS
    for photograph in rl.model_place(CHAPEL).photographs:
        turned = photograph.camera.rotation.T @ true[photograph.name].rotation
        assert np.degrees(np.arccos((np.trace(turned) - 1) / 2)) < 0.2
        assert np.linalg.norm(photograph.camera.position - true[photograph.name].position) < 0.3
        assert photograph.camera.focal_length == pytest.approx(900, rel=0.01)


def test_the_chapel_s_marks_are_those_that_its_script_makes() -> None:
    figures = places_figures()
    assert CHAPEL.read_text(encoding="utf-8").endswith(figures.BELOW + figures.as_toml(figures.marks()))
