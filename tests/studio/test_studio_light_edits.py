"""The light edited as a whole in the page: turned, brightened, converted; a slice painted on and brought back."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import relume as rl
from browsing import Tab, opened
from one_studio import OneStudio
from serving import Server
from small_shot import TEXT

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")


@pytest.fixture
def small(studio: OneStudio) -> Path:
    """The shot as it was: the names of what is written count up from what is there."""
    studio.as_begun()
    return studio.folder


@pytest.fixture
def server(small: Path, studio: OneStudio) -> Server:
    return studio.server


@pytest.fixture
def page(browser: Any, server: Server) -> Iterator[Tab]:
    with opened(browser, server.address, refusals=True) as tab:
        tab.press("Alt+3")
        tab.tab.locator('summary:text-is("Edit the whole map")').click()
        yield tab


def light(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "shot.toml").read_text(encoding="utf-8"))["light"]


def made(page: Tab, folder: Path, before: str) -> rl.EnvironmentMap:
    """The map that the shot names once it is another than before."""
    page.until(lambda: light(folder)["map"] != before, "the new map")
    page.settle()
    return rl.read_environment(folder / light(folder)["map"])


def test_a_map_is_turned_brightened_and_converted_and_the_shot_points_to_it(page: Tab, small: Path):
    for name, value in (("yaw", "90"), ("stops", "1"), ("rows", "64")):
        page.tab.locator(f"#edit-{name}").fill(value)
    page.tab.locator("#edit-mapping").select_option("angular")
    page.click('button:text-is("Make this the light")')
    found, before = made(page, small, "light.exr"), rl.read_environment(small / "light.exr")
    assert light(small)["map"] == "lights/light-1.exr"
    assert (found.mapping.name, found.size) == ("angular", 64)
    assert found.total() == pytest.approx(2 * before.total(), rel=0.02)
    # Yaw is counter-clockwise seen from above: what came from −Z comes from −X.
    rows = rl.mappings.pixel_directions(found.mapping, 64)
    brightest = rows.reshape(-1, 3)[np.argmax(np.nan_to_num(found.radiance.sum(-1)).ravel())]
    lamp = rl.mappings.pixel_directions(before.mapping, 32)[4:8, 20:24].mean((0, 1))
    turned = np.array([lamp[2], lamp[1], -lamp[0]])
    assert brightest @ turned / np.linalg.norm(turned) > np.cos(np.radians(12))
    assert "angular" in page.text("[data-edited]")
    page.press("Control+z")
    assert (small / "shot.toml").read_text(encoding="utf-8") == TEXT and (small / "lights" / "light-1.exr").is_file()


def test_a_map_is_scaled_by_channel_made_neutral_where_it_was_clicked_and_blurred(page: Tab, small: Path):
    page.click('button:text-is("See the map itself")')
    page.until(lambda: page.text("#caption") == "light.exr", "the map")
    for name, value in (("red", "2"), ("green", "1"), ("blue", "0.5")):
        page.tab.locator(f"#edit-{name}").fill(value)
    page.tab.locator("#edit-mapping").select_option("ball")
    page.click('button:text-is("Make this the light")')
    found, before = made(page, small, "light.exr"), rl.read_environment(small / "light.exr")
    assert found.mapping.name == "ball"
    np.testing.assert_allclose(found.total() / before.total(), [2, 1, 0.5], rtol=0.03)
    # The numbers are as they were before; of the scaled map a place is said to be grey, and all of it is neutral.
    page.press("Control+z")
    page.until(lambda: light(small)["map"] == "light.exr", "the undo")
    assert page.tab.locator("#edit-red").input_value() == "1"
    page.tab.locator("#edit-red").fill("4")
    page.tab.locator("#edit-blur").fill("6")
    page.click('button:text-is("Make this the light")')
    blurred = made(page, small, "light.exr")
    assert blurred.radiance[..., 1].max() < 0.9 * before.radiance[..., 1].max()
    np.testing.assert_allclose(blurred.total() / before.total(), [4, 1, 1], rtol=0.02)
    page.click('button:text-is("See the map itself")')
    name = light(small)["map"]
    page.until(lambda: page.text("#caption") == name, "the reddish map")
    page.tab.mouse.click(*page.point_at(50.5, 20.5))
    page.until(lambda: "Neutral about pixel 50, 20" in page.text("#pane"), "the pixel")
    page.tab.locator("#edit-grey").check()
    page.click('button:text-is("Make this the light")')
    neutral = made(page, small, name).radiance
    np.testing.assert_allclose(neutral[20, 50] / neutral[20, 50].mean(), 1, rtol=1e-3)


def test_a_map_is_shown_as_matte_surfaces_reflect_it(page: Tab, small: Path):
    page.click('button:text-is("See it diffusely integrated")')
    page.until(lambda: page.text("#caption") == "diffuse.exr", "the map")
    page.press("r")
    page.settle()
    # E(n)/π of the direction that its pixels stand for.
    before = rl.read_environment(small / "light.exr")
    for column, row in ((30, 20), (100, 50)):
        normal = rl.mappings.pixel_directions(rl.mappings.LatLong(), 72)[row, column]
        expected = before.irradiance(normal) / np.pi
        value = page.tab.evaluate(
            "async ([x, y]) => (await (await fetch("
            "`/pictures/${relume.studio.number}/value?layer=0&x=${x}&y=${y}`)).json()).rgb",
            [column, row],
        )
        np.testing.assert_allclose(value, expected, rtol=0.03)
    assert (small / "shot.toml").read_text(encoding="utf-8") == TEXT


def test_a_slice_goes_to_a_paint_program_and_comes_back(page: Tab, small: Path):
    page.click('button:text-is("Slice the whole map")')
    page.until(lambda: "is written" in page.text("[data-edited]"), "the slice")
    (path,) = (small / "paint").glob("slice-*.png")
    # What a paint program does: a dark blot.
    picture = cv2.imread(str(path))
    assert picture is not None
    picture[20:26, 40:50] = picture[20:26, 40:50] // 2
    cv2.imwrite(str(path), picture)
    page.tab.locator("#edit-lamps").check()
    page.click('button:text-is("Bring it back")')
    found, before = made(page, small, "light.exr"), rl.read_environment(small / "light.exr")
    changed = (found.radiance != before.radiance).any(-1)
    assert changed[20:26, 40:50].all() and changed.sum() == 60
    assert (found.radiance[changed] < 0.5 * before.radiance[changed]).all()
    assert "60 pixels changed" in page.text("[data-edited]")


def test_a_view_is_cut_out_where_the_map_was_clicked_and_put_back(page: Tab, small: Path):
    page.click('button:text-is("See the map itself")')
    page.until(lambda: page.text("#caption") == "light.exr", "the map")
    page.settle()
    page.tab.mouse.click(*page.point_at(48.5, 16.5))  # three quarters across: to the right, level
    page.until(lambda: "° to the right" in page.text("#pane"), "the direction")
    page.settle()
    if not page.tab.locator('button:text-is("Cut out the view")').is_visible():
        page.tab.locator('summary:text-is("Edit the whole map")').click()
    page.click('button:text-is("Cut out the view")')
    page.until(lambda: list((small / "paint").glob("slice-*.png.json")), "the slice")
    page.settle()
    (path,) = (small / "paint").glob("slice-*.png")
    assert json.loads(path.with_name(path.name + ".json").read_text(encoding="utf-8"))
    picture = cv2.imread(str(path))
    assert picture is not None and picture.shape == (1024, 1024, 3)
    picture[312:712, 312:712] = 0
    cv2.imwrite(str(path), picture)
    page.tab.locator("#edit-lamps").uncheck()
    page.click('button:text-is("Bring it back")')
    found, before = made(page, small, "light.exr"), rl.read_environment(small / "light.exr")
    where = rl.mappings.pixel_directions(before.mapping, 32)[16, 48]
    assert np.all(found.lookup(where) < 0.02) and np.all(before.lookup(where) > 0.25)
    assert found.lookup(-where) == pytest.approx(before.lookup(-where), rel=1e-5)


def rectangle(page: Tab) -> list[int]:
    return [
        int(each)
        for each in page.tab.evaluate("() => [...document.querySelectorAll('[data-crop]')].map((e) => e.value)")
    ]


@pytest.fixture
def map_page(page: Tab) -> Tab:
    page.click('button:text-is("See the map itself")')
    page.until(lambda: page.text("#caption") == "light.exr", "the map")
    page.settle()
    page.click('button:text-is("Draw a rectangle")')
    return page


def test_a_rectangle_is_dragged_and_cut_out_as_a_picture_that_is_no_map(map_page: Tab, small: Path):
    page = map_page
    assert rectangle(page) == [16, 8, 32, 16]  # the middle, until another is drawn
    page.drag((18.4, 2.3), (29.6, 9.7))
    assert rectangle(page) == [18, 2, 12, 8]
    # A corner by keys, and a number typed.
    page.tab.locator('[aria-label="The rectangle\'s lower right corner"]').focus()
    page.press("ArrowRight", "ArrowDown")
    page.tab.locator('[data-crop="left"]').fill("19")
    page.tab.locator('[data-crop="left"]').press("Enter")
    page.until(lambda: rectangle(page) == [19, 2, 13, 9], "the numbers")
    page.click('button:text-is("Cut it out")')
    page.until(lambda: "written" in page.text("[data-cropped]"), "the crop")
    said = page.text("[data-cropped]")
    assert "no map" in said and "relume convert light.exr -o paint/crop-1.exr --roi 19,2,13,9" in said
    part, whole = rl.read_radiance(small / "paint" / "crop-1.exr"), rl.read_radiance(small / "light.exr")
    np.testing.assert_array_equal(part.radiance, whole.radiance[2:11, 19:32])
    assert "mapping" in whole.attributes and "mapping" not in part.attributes
    assert (small / "shot.toml").read_text(encoding="utf-8") == TEXT


def test_a_part_of_the_map_is_painted_on_and_put_back_where_it_was(map_page: Tab, small: Path):
    page = map_page
    page.drag((18.5, 2.5), (29.5, 11.5))
    page.click('button:text-is("Slice it to paint on")')
    page.until(lambda: list((small / "paint").glob("slice-*.png.json")), "the slice")
    page.settle()
    (path,) = (small / "paint").glob("slice-*.png")
    picture = cv2.imread(str(path))
    assert picture is not None and picture.shape == (10, 12, 3)
    picture[2:6, 2:6] //= 2  # the lamp, of which the map's columns 20 to 23 and rows 4 to 7 are
    cv2.imwrite(str(path), picture)
    page.tab.locator("#edit-lamps").check()
    page.click('button:text-is("Bring it back")')
    found, before = made(page, small, "light.exr"), rl.read_environment(small / "light.exr")
    changed = (found.radiance != before.radiance).any(-1)
    assert changed[4:8, 20:24].all() and changed.sum() == 16 and found.mapping.name == "latlong"
    assert (found.radiance[changed] < 0.5 * before.radiance[changed]).all()


def test_a_photograph_is_cut_to_a_photograph_and_a_rectangle_outside_is_one_line(server: Server, small: Path):
    picture = np.random.default_rng(0).integers(0, 255, (40, 60, 3), np.uint8)
    cv2.imwrite(str(small / "place.png"), picture)
    status, found = server.post("/crop", {"path": "place.png", "box": [5, 6, 20, 10]})
    assert status == 200 and found == {"path": "paint/crop-1.png", "size": [20, 10]}
    np.testing.assert_array_equal(cv2.imread(str(small / found["path"])), picture[6:16, 5:25])
    for body in (
        {"path": "place.png", "box": [50, 6, 20, 10]},
        {"path": "place.png", "box": [0, 0, 0, 5]},
        {"path": "place.png", "box": [1, 2, 3]},
        {"path": "../place.png", "box": [0, 0, 4, 4]},
    ):
        status, answer = server.post("/crop", body)
        assert status in (404, 422) and len(answer["error"].splitlines()) == 1, body
    assert len(list((small / "paint").iterdir())) == 1


def test_what_is_no_edit_of_a_map_is_one_line_and_leaves_nothing(server: Server, small: Path):
    revision = server.json("/shot")["revision"]
    for path, body in (
        ("/light/edited", {"turn": [1, 2], "revision": revision}),
        ("/light/edited", {"mapping": "no such", "revision": revision}),
        ("/light/edited", {"size": 10**9, "revision": revision}),
        ("/light/edited", {"gains": [1, 2], "revision": revision}),
        ("/light/edited", {"gains": [1, -2, 1], "revision": revision}),
        ("/light/edited", {"grey": [10**6, 0], "revision": revision}),
        ("/light/edited", {"blur": 1e9, "revision": revision}),
        ("/light/edited", {"stops": 1, "revision": revision - 1}),
        ("/light/painted", {"slice": "shot.toml", "revision": revision}),
        ("/light/painted", {"slice": "../secret.png", "revision": revision}),
        ("/light/slice", {"view": [0, "x", 3]}),
    ):
        status, answer = server.post(path, body)
        assert status in (404, 409, 422) and len(answer["error"].splitlines()) == 1, (path, body)
    assert not list(small.glob("lights/*"))
    assert (small / "shot.toml").read_text(encoding="utf-8") == TEXT


@pytest.mark.parametrize("number", ["1e400", "-1e400", "1" + "0" * 400])
def test_a_number_without_an_end_is_one_line_and_leaves_nothing(server: Server, small: Path, number: str):
    revision = server.json("/shot")["revision"]
    for path, body in (
        ("/light/edited", '"grey": [N, 0]'),
        ("/light/edited", '"size": N'),
        ("/light/edited", '"gains": [1, N, 1]'),
        ("/light/edited", '"turn": [N, 0, 0]'),
        ("/light/edited", '"stops": N'),
        ("/light/edited", '"blur": N'),
        ("/light/slice", '"box": [0, 0, N, 4]'),
        ("/light/slice", '"view": [0, N, 3]'),
    ):
        status, answer = server.post(path, f'{{"revision": {revision}, {body.replace("N", number)}}}'.encode())
        assert status in (400, 422) and len(answer["error"].splitlines()) == 1, (path, body)
    assert not list(small.glob("lights/*")) and not list(small.glob("paint/*"))
    assert (small / "shot.toml").read_text(encoding="utf-8") == TEXT


def test_a_map_in_place_of_the_ball_keeps_its_place_its_scale_and_its_camera():
    from relume.studio.shots.edits import edited
    from relume.studio.shots.light.edits import pointed_at

    text = (
        '[plate]\nphotographs = ["p.jpg"]\n[light]\nballs = [{ photographs = ["b/*.jpg"] }]\nball = { radius = 0.05 }\n'
    )
    found = tomllib.loads(edited(text, pointed_at(tomllib.loads(text), "lights/light-1.exr", "b/2.jpg")))
    assert found["light"] == {"map": "lights/light-1.exr", "scale": 1.0, "probe": [0.0, 0.05, 0.0]}
    assert found["camera"] == {"ball": {"photograph": "b/2.jpg", "radius": 0.05}}
    rl.Shot.model_validate(found)
    measured = (
        text.replace("radius", "centre = [0, 0.1, 0], radius")
        + '[camera]\ngrid = { photograph = "g.jpg", squares = [9, 6], square = 0.03 }\n'
    )
    found = tomllib.loads(edited(measured, pointed_at(tomllib.loads(measured), "lights/light-1.exr", "b/2.jpg")))
    assert found["light"]["probe"] == [0, 0.1, 0] and list(found["camera"]) == ["grid"]
