"""The page of a light stage in a real browser: lamps are dragged, a map is turned, and the pixels are `relight`'s."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Page, encoded, opened
from relume.studio.stage.lighting import light_of
from serving import Server, serving
from small_stages import grid_directions, lit, write_stage
from studio_page import serious_faults

pytest.importorskip("uvicorn", reason="the extra studio is not installed")

ROWS, COLUMNS = 8, 16
ACTS = "([i, lamp]) => Object.assign(relume.state.lamps[i], lamp)"


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Lambertian ball under 128 lights: enough for smooth interpolation, so that no fit is made."""
    folder = tmp_path_factory.mktemp("stages") / "ball"
    folder.mkdir()
    lights = []
    for index, direction in enumerate(grid_directions(ROWS, COLUMNS)):
        rl.write(folder / f"light_{index:03d}.exr", rl.RadianceMap(lit(direction)))
        lights.append({"file": f"light_{index:03d}.exr", "direction": direction.tolist()})
    cameras = {"front": {"position": [0.0, 0.0, 4.0], "look_at": [0.0, 0.0, 0.0], "hfov_deg": 36.0}}
    (folder / "stage.json").write_text(json.dumps({"lights": lights, "cameras": cameras}), "utf-8")
    return folder


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dark room with a bright window to the right, +X."""
    radiance = np.full((32, 64, 3), 0.05, np.float32)
    radiance[12:18, 46:50] = (20.0, 18.0, 14.0)
    path = tmp_path_factory.mktemp("maps") / "room.exr"
    rl.write(path, rl.RadianceMap(radiance, attributes={"mapping": "latlong"}))
    return path


@pytest.fixture(scope="module")
def server(stage: Path, room: Path) -> Iterator[Server]:
    with serving([stage, room]) as running:
        yield running


@pytest.fixture
def page(browser: Any, server: Server) -> Iterator[Page]:
    with opened(browser, server.address, Page) as result:
        result.press("r", "f")
        yield result


def drag_to(page: Page, lamp: int, x: float, y: float) -> None:
    """Drag a lamp to a place of the disc, whose rim is at 1."""
    handle = page.tab.locator("#sphere .lamp").nth(lamp).bounding_box()
    disc = page.tab.locator("#sphere").bounding_box()
    page.tab.mouse.move(handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2)
    page.tab.mouse.down()
    place = (disc["x"] + disc["width"] * (x + 1.12) / 2.24, disc["y"] + disc["height"] * (y + 1.12) / 2.24)
    page.tab.mouse.move(*place, steps=5)
    page.tab.mouse.up()
    page.settle()


def own_picture(page: Page, stage: Path, room: Path) -> np.ndarray:
    """`rl.lightstage.relight` under the light that the page says it has."""
    light = light_of(page.tab.evaluate("relume.light()"), 1)
    lighting = light.lighting([rl.read_environment(room)])
    assert lighting is not None
    return rl.lightstage.relight(stage, lighting).radiance


def read(page: Page, x: int, y: int) -> list[float]:
    """The server's own value of the picture that is shown."""
    return page.tab.evaluate(
        "async ([x, y]) => { const at = `picture=${relume.state.shown}&x=${x}&y=${y}`;"
        " return (await (await fetch(`/stage/value?${at}`)).json()).rgb; }",
        [x, y],
    )


def test_a_lamp_that_is_dragged_lights_the_subject_as_relight_does(page: Page, stage: Path, room: Path):
    drag_to(page, 0, 0.5, 0.0)  # half way to the rim, to the right: beside the subject
    direction = page.tab.evaluate("relume.state.lamps[0].direction")
    assert direction == pytest.approx([1, 0, 0], abs=0.02)
    truth = own_picture(page, stage, room)
    for x, y in ((16, 12), (22, 12), (10, 12)):
        assert np.array(read(page, x, y), np.float32).tolist() == truth[y, x].tolist()  # to the bit
        assert page.shown(x + 0.5, y + 0.5) == pytest.approx(encoded(truth[y, x]), abs=1.01)
    assert truth[12, 22].sum() > 3 * truth[12, 10].sum()
    assert "relume stage relight --no-mesh" in page.text("#about")
    assert f"--direction {direction[0]:.6g}," in page.text("#command")


def test_a_lamp_where_the_stage_had_one_gives_its_photograph(page: Page, stage: Path):
    index = 3 * COLUMNS + 2
    direction = grid_directions(ROWS, COLUMNS)[index]
    page.tab.evaluate(ACTS, [0, {"direction": direction.tolist()}])
    page.tab.locator("#strength").evaluate(
        "(e) => { e.value = '1'; e.dispatchEvent(new Event('input', { bubbles: true })); }"
    )
    page.settle()
    photograph = rl.read_radiance(stage / f"light_{index:03d}.exr").radiance
    assert read(page, 14, 10) == pytest.approx((2 * photograph[10, 14]).tolist(), rel=2e-3)


def test_several_soft_coloured_lamps_and_a_turned_map_are_relights_sum(page: Page, stage: Path, room: Path):
    page.press("a")
    page.tab.evaluate(ACTS, [0, {"colour": "#ff8000", "size": 40}])
    page.tab.evaluate(ACTS, [1, {"colour": "#2040ff", "size": 5, "stops": 1.5}])
    page.tab.locator("#map").select_option("0")
    page.settle()
    before = read(page, 22, 12)
    page.tab.locator("#turn").focus()
    page.tab.keyboard.press("Home")  # half a turn
    page.settle()
    assert page.tab.evaluate("relume.state.turn") == -180
    truth = own_picture(page, stage, room)
    assert np.array(read(page, 22, 12), np.float32).tolist() == truth[12, 22].tolist()
    assert before[0] != pytest.approx(truth[12, 22, 0], rel=0.05)
    assert "--rotate -180" in page.text("#command") and "one size for all" in page.text("#command")


def test_while_it_moves_the_picture_is_within_the_stated_error(page: Page, server: Server, stage: Path, room: Path):
    page.tab.locator("#map").select_option("0")
    page.settle()
    page.tab.evaluate("() => { relume.state.turn = 33; }")
    asked = page.tab.evaluate(
        "async () => { const body = JSON.stringify(relume.light());"
        " const got = await fetch('/stage/picture', { method: 'POST', body });"
        " return [got.headers.get('x-size'), Array.from(new Uint16Array(await got.arrayBuffer()))]; }"
    )
    width, height = map(int, asked[0].split(","))
    live = np.array(asked[1], np.uint16).view(np.float16).astype(np.float32).reshape(height, width, 3)
    truth = own_picture(page, stage, room)
    stated = server.json("/stage")["error"]
    assert 0 < stated["single"] < 0.05
    # Of the map's place a hundredth more: it is turned in pixels of 0.9 degrees.
    assert np.abs(live - truth).sum() / np.abs(truth).sum() < stated["single"] + 0.01


def test_pictures_at_half_the_size_are_means_of_the_whole_ones(page: Page, server: Server, stage: Path, room: Path):
    page.tab.locator("#map").select_option("0")
    page.settle()
    light = json.dumps({**page.tab.evaluate("relume.light()"), "small": True})
    own = {"Origin": f"http://127.0.0.1:{server.port}", **server.cookie}
    status, headers, body = server.ask("/stage/picture", method="POST", body=light, **own)
    truth = own_picture(page, stage, room)
    height, width = truth.shape[:2]
    assert status == 200 and headers["x-size"] == f"{width // 2},{height // 2}"
    small = np.frombuffer(body, "<f2").reshape(height // 2, width // 2, 3).astype(np.float32)
    mean = truth.reshape(height // 2, 2, width // 2, 2, 3).mean((1, 3))
    assert np.abs(small - mean).sum() / np.abs(mean).sum() < 0.02


def test_a_machine_that_takes_long_shows_smaller_pictures_where_the_whole_one_is_until_nothing_moves(page: Page):
    page.tab.evaluate(
        "() => { window.seen = []; const plain = fetch, fill = relume.live.fill.bind(relume.live), c = relume.canvas;"
        " window.fetch = async (...a) => { await new Promise((done) => setTimeout(done, 50)); return plain(...a); };"
        " relume.live.fill = (got, small) => { fill(got, small);"
        "   seen.push([relume.live.shown, got.width, c.toPicture(0, 0), c.one.layer.sizes[0][0]]); };"
        " let n = 0; const strength = document.getElementById('strength');"
        " const step = () => { strength.value = String(++n / 100); strength.dispatchEvent(new Event('input'));"
        "   if (n < 40) requestAnimationFrame(step); }; step(); }"
    )
    page.until(lambda: len(page.tab.evaluate("seen")) >= 5, "pictures")
    page.settle()
    seen = page.tab.evaluate("seen")
    width = page.tab.evaluate("relume.state.facts.size[0]")
    assert [level for level, *_ in seen].count(1) >= 2 and seen[-1][:2] == [0, width], seen
    assert all(own == (width // 2 if level else width) for level, own, *_ in seen)
    # The view is the same throughout.
    assert all(where == seen[0][2] and whole == width for *_, where, whole in seen)


def test_the_keyboard_alone_moves_adds_and_removes_lamps(page: Page):
    page.tab.locator("#sphere .lamp").first.focus()
    before = page.tab.evaluate("relume.state.lamps[0].direction")
    page.press("ArrowRight", "ArrowRight")
    after = page.tab.evaluate("relume.state.lamps[0].direction")
    turned = np.degrees(np.arccos(np.clip(np.dot(before, after), -1, 1)))
    assert 2 < turned < 5 and after[0] > before[0]
    page.press("a", "a")
    assert page.tab.locator("#sphere .lamp").count() == 3
    page.press("Delete", "Delete", "Delete")
    assert page.tab.locator("#sphere .lamp").count() == 0
    assert read(page, 16, 12) == [0.0, 0.0, 0.0]


def test_normals_and_albedo_are_layers(page: Page):
    page.tab.locator("#layers button", has_text="normals").click()
    page.settle()
    # The ball's middle faces the camera: (0, 0, 1)/2 + ½.
    assert read(page, 16, 12) == pytest.approx([0.5, 0.5, 1.0], abs=0.06)
    page.tab.locator("#layers button", has_text="albedo").click()
    page.settle()
    assert read(page, 16, 12) == pytest.approx([0.7, 0.4, 0.3], abs=0.03)
    assert page.shown(16.5, 12.5) == pytest.approx(encoded(read(page, 16, 12)), abs=1.01)


def test_axe_finds_nothing_serious_in_the_stage(page: Page):
    assert serious_faults(page) == []
    for size in ((1280, 720), (640, 360), (3840, 2160)):
        page.tab.set_viewport_size({"width": size[0], "height": size[1]})
        page.settle()
        across = page.tab.evaluate("() => document.documentElement.scrollWidth - document.documentElement.clientWidth")
        assert across <= 0, size


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([1], "no object"),
        ({"lamps": [{"direction": [0, 0, 0], "irradiance": [1, 1, 1]}]}, "a lamp needs a direction"),
        ({"lamps": [{"direction": [0, 1], "irradiance": [1, 1, 1]}]}, "give 3 numbers"),
        ({"lamps": [{"direction": [0, 1, 0], "irradiance": [1, 1, float("nan")]}]}, "give 3 numbers"),
        ({"lamps": [{}] * 65}, "at most 64"),
        ({"map": 1}, "there are 1"),
        ({"map": True}, "there are 1"),
        ({"turn": "x"}, "give 1 number"),
        ({"stops": 99}, "−32 to 32"),
    ],
)
def test_what_is_no_light_is_refused_in_one_line(given: Any, said: str):
    with pytest.raises(ValueError, match=said) as refused:
        light_of(given, 1)
    assert "\n" not in str(refused.value)


def test_a_light_from_another_page_is_refused(server: Server):
    status, _, body = server.ask("/stage/picture", method="POST", **server.cookie)
    assert status == 403 and b"another origin" in body


def test_two_stages_and_a_stage_of_few_lights(stage: Path, tmp_path: Path):
    few = write_stage(tmp_path / "few")
    with pytest.raises(ValueError, match="a second light stage; show one at a time"):
        rl.view([stage, few], open_browser=False)
    field = rl.lightstage.read_stage(few)
    live = rl.lightstage.live_field(field)
    assert len(live.lights) == 288 and live.field.shape == field.shape
    lamp = rl.lightstage.StageLighting(lamps=(rl.scene.DistantLight((0.3, 0.5, 1.0), (1.0, 1.0, 1.0)),))
    truth = rl.lightstage.relight(field, lamp).radiance
    found = live.relight(lamp.irradiances(live.lights)).radiance
    assert np.abs(found - truth).sum() / np.abs(truth).sum() < 0.03
