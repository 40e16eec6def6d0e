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
from serving import Server, serving
from small_shot import TEXT, write_small_shot

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")


# Each test has a folder of its own: the names of what is written count up from what is there.
@pytest.fixture
def small(tmp_path: Path) -> Path:
    return write_small_shot(tmp_path).parent


@pytest.fixture
def server(small: Path) -> Iterator[Server]:
    with serving([small / "shot.toml"], "studio") as running:
        yield running


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


def test_what_is_no_edit_of_a_map_is_one_line_and_leaves_nothing(server: Server, small: Path):
    revision = server.json("/shot")["revision"]
    for path, body in (
        ("/light/edited", {"turn": [1, 2], "revision": revision}),
        ("/light/edited", {"mapping": "no such", "revision": revision}),
        ("/light/edited", {"size": 10**9, "revision": revision}),
        ("/light/edited", {"stops": 1, "revision": revision - 1}),
        ("/light/painted", {"slice": "shot.toml", "revision": revision}),
        ("/light/painted", {"slice": "../secret.png", "revision": revision}),
        ("/light/slice", {"view": [0, "x", 3]}),
    ):
        status, answer = server.post(path, body)
        assert status in (404, 409, 422) and len(answer["error"].splitlines()) == 1, (path, body)
    assert not list(small.glob("lights/*"))
    assert (small / "shot.toml").read_text(encoding="utf-8") == TEXT


def test_a_map_in_place_of_the_ball_keeps_its_place_its_scale_and_its_camera():
    from relume.studio.shots.edits import edited
    from relume.studio.shots.light_edits import pointed_at

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
