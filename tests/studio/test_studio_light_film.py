"""Light that changes, in the studio's light pane: a slider over its maps, their lights, and a ball lit by each."""

from __future__ import annotations

import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Tab, encoded, opened
from one_studio import OneStudio
from relume.sphere.map_store import MapStore
from serving import Server
from small_shot import TEXT
from studio_page import serious_faults

for needed in ("starlette", "uvicorn", "tomlkit", "zarr"):
    pytest.importorskip(needed, reason="the extras studio and lightstage are not installed")

ROWS, COUNT = 32, 4
MAPS = TEXT.replace('map = "light.exr"\n', 'maps = "film/*.exr"\nrate = 12\n')


def lamp_at(k: int) -> np.ndarray:
    """A lamp behind the camera that goes to the left of it, two pixels a frame, over dim light."""
    light = np.full((ROWS, 2 * ROWS, 3), 0.2, np.float32)
    light[10:14, 4 + 2 * k : 8 + 2 * k] = (30, 20, 10)
    return light


@pytest.fixture(scope="module")
def folder(studio: OneStudio) -> Path:
    place = studio.folder
    (place / "film").mkdir()
    store = MapStore.begun(place / "film.zarr", COUNT, ROWS)
    for k in range(COUNT):
        picture = rl.RadianceMap(lamp_at(k), None, None, attributes={"mapping": "latlong"})
        rl.write(place / "film" / f"map_{k + 1:06d}.exr", picture)
        store.write(k, picture)
    (place / "shot.toml").write_text(MAPS, encoding="utf-8")
    assert studio.server.json("/shot")["fault"] is None
    return place


@pytest.fixture(scope="module")
def server(folder: Path, studio: OneStudio) -> Server:
    return studio.server


def test_a_frame_is_its_file_its_lights_and_what_a_ball_gets(server: Server):
    for number in (1, 2, 3, 4):
        status, found = server.post("/light/frame", {"frame": number})
        assert status == 200 and (found["frame"], found["count"], found["rate"]) == (number, COUNT, 12)
        assert found["path"] == f"film/map_{number:06d}.exr" and found["unit"] == "relative"
        # The lights' shares are all of the light, and the strongest stand in the lamp.
        assert sum(each["share"] for each in found["lights"]) == pytest.approx(1)
        within = [e for e in found["lights"] if 9 <= e["y"] <= 15 and -1 <= e["x"] - 2 - 2 * number <= 5]
        assert sum(each["share"] for each in within) > 0.5
        # The constant term of the irradiance is its mean over all normals: ∫ L dω / 4.
        light = rl.EnvironmentMap(lamp_at(number - 1))
        np.testing.assert_allclose(found["irradiance"][0], light.total() / 4, rtol=0.03)
    for wrong in (0, COUNT + 1):
        status, found = server.post("/light/frame", {"frame": wrong})
        assert status == 422 and "the light has the maps 1 to 4" in found["error"]
    assert server.post("/light/frame", {"frame": "2"})[0] == 422


def test_lights_go_on_from_frame_to_frame(server: Server):
    found = [server.post("/light/frame", {"frame": number})[1]["lights"] for number in (1, 2, 3, 4)]
    assert {len(each) for each in found} == {len(found[0])}
    places = np.array([[(each["x"], each["y"], each["share"]) for each in lights] for lights in found])
    # Together they go as far as the lamp, most of the light, goes; and none of them jumps.
    lamp = (places[..., 1] > 9) & (places[..., 1] < 15) & (places[..., 0] < 16)
    middle = [
        float(np.average(frame[at][:, 0], weights=frame[at][:, 2])) for frame, at in zip(places, lamp, strict=True)
    ]
    assert all(1.5 < b - a < 2.5 for a, b in pairwise(middle)), middle
    assert np.abs(np.diff(places[..., 0], axis=0))[lamp[1:] & lamp[:-1]].max() < 4


def test_a_store_is_shown_frame_by_frame_as_a_folder_is(server: Server, folder: Path):
    revision = server.json("/shot")["revision"]
    change = {"set": ["light", "maps"], "value": "film.zarr"}
    status, state = server.post("/shot/edit", {"changes": [change], "revision": revision})
    assert status == 200, state
    try:
        found = server.post("/light/frame", {"frame": 3})[1]
        assert found["path"] == "film.zarr/radiance/2.0.0.0"
        number = server.post("/opened", {"path": found["path"]})[1]["number"]
        facts = server.json(f"/pictures/{number}")
        assert (facts["size"], facts["mapping"]) == ([2 * ROWS, ROWS], "latlong")
        value = server.json(f"/pictures/{number}/value?layer=0&x=9&y=12")
        np.testing.assert_allclose(value["rgb"], [30, 20, 10], rtol=1e-3)
    finally:
        server.post("/shot/undo", {"by": 1})


def test_maps_elsewhere_and_light_that_is_none_are_refused(server: Server, folder: Path):
    shot = folder / "shot.toml"
    shutil.copy(folder / "light.exr", folder.parent / "outside_1.exr")
    try:
        for text, line in (
            (TEXT, "no maps that follow one another"),
            (MAPS.replace("film/*.exr", "../outside_1.exr"), "is not below"),
        ):
            shot.write_text(text, encoding="utf-8")
            server.json("/shot")
            status, found = server.post("/light/frame", {"frame": 1})
            assert status == 422 and line in found["error"]
    finally:
        shot.write_text(MAPS, encoding="utf-8")
        assert server.json("/shot")["fault"] is None


def ball_at(page: Tab, x: float, y: float) -> list[int]:
    """The ball's red, green and blue at a place of it, −1 to 1 to the right and up."""
    return page.tab.evaluate(
        "([x, y]) => { const c = document.querySelector('#light-ball'), s = c.width;"
        "return [...c.getContext('2d').getImageData(s * (1 + x) / 2, s * (1 - y) / 2, 1, 1).data].slice(0, 3); }",
        [x, y],
    )  # fmt: skip


def test_the_light_pane_plays_the_maps_with_their_lights_and_a_ball(browser: Any, server: Server):
    with opened(browser, server.address, refusals=True) as page:
        page.press("Alt+3")
        page.until(lambda: page.text("#caption") == "film/map_000001.exr", "the first map")
        page.settle()
        assert page.text("#light-frame-words") == "1 of 4, 0.00 s"
        # The lights are drawn on it, the strongest about the lamp.
        assert page.tab.locator("#overlay circle.point").count() == len(
            server.post("/light/frame", {"frame": 1})[1]["lights"]
        )
        # The slider shows another frame; the exposure stays, and the ball's light comes from further to the left.
        stops = page.tab.evaluate("relume.canvas.view.stops")
        left = ball_at(page, -0.5, 0.2)
        page.tab.locator("#light-frame").fill("4")
        page.until(lambda: page.text("#caption") == "film/map_000004.exr", "the fourth map")
        page.settle()
        page.until(lambda: page.text("#light-frame-words") == "4 of 4, 0.25 s", "its words")
        assert page.tab.evaluate("relume.canvas.view.stops") == stops
        assert page.shown(12, 12) != page.shown(5, 12)
        # What a matte ball shows: E · 0.8 / π at the picture's exposure, seen along −Z.
        light = rl.EnvironmentMap(lamp_at(3))
        normal = np.array([-0.5, 0.2, np.sqrt(1 - 0.29)])
        expected = encoded(light.irradiance(normal) * 0.8 / np.pi * 2**stops)
        right = ball_at(page, -0.5, 0.2)
        assert right != left
        np.testing.assert_allclose(right, expected, atol=12)
        page.press("e")
        page.until(lambda: ball_at(page, -0.5, 0.2) != right, "a ball at another exposure")
        # Without its lights.
        page.tab.locator("#light-lights").uncheck()
        page.until(lambda: page.tab.locator("#overlay circle.point").count() == 0, "no lights")
        page.tab.locator("#light-lights").check()
        # It plays, round and round, until it is stopped.
        seen: set[str] = set()
        page.tab.locator("#light-play").click()
        page.until(lambda: seen.add(page.text("#caption")) or len(seen) >= 3, "frames that play")
        assert page.text("#light-play") == "Pause"
        page.tab.locator("#light-play").click()
        page.until(lambda: page.text("#light-play") == "Play", "the pause")
        page.settle()
        assert serious_faults(page) == []
