"""The studio's page in a real browser: what pointing does to shot.toml, to files and to pixels."""

from __future__ import annotations

import shutil
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
from serving import Server, serving
from small_shot import TEXT, camera
from studio_page import done, looked_at, serious_faults

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

BEGUN = 'render = { samples = 64, denoise = true }\n\n[plate]\nphotographs = ["plate/*.jpg"]\n'
ROOM = Path(__file__).resolve().parents[2] / "examples" / "room"


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of photographs without a shot file."""
    folder = tmp_path_factory.mktemp("room")
    for name, frames in (("plate", (1, 2, 3, 4)), ("ball_0", (3, 5, 7, 8))):
        (folder / name).mkdir()
        for number in frames:
            shutil.copy(ROOM / name / f"IMG_{number:04d}.jpg", folder / name)
    shutil.copy(ROOM / "plate_grid.jpg", folder)
    return folder


@pytest.fixture(scope="module")
def room_server(room: Path) -> Iterator[Server]:
    with serving([room], "studio") as running:
        yield running


@pytest.fixture
def room_page(browser: Any, room: Path, room_server: Server) -> Iterator[Tab]:
    room_server.post("/shot/undo", {"by": 10_000})
    assert not (room / "shot.toml").exists()
    with opened(browser, room_server.address, refusals=True) as page:
        yield page


@pytest.fixture(scope="module")
def small(looked_studio: OneStudio) -> Path:
    return looked_studio.folder


@pytest.fixture(scope="module")
def small_server(looked_studio: OneStudio) -> Server:
    return looked_studio.server


@pytest.fixture
def page(browser: Any, small: Path, small_server: Server) -> Iterator[Tab]:
    small_server.post("/shot/undo", {"by": 10_000})
    assert (small / "shot.toml").read_text(encoding="utf-8") == TEXT
    with opened(browser, small_server.address, refusals=True) as tab:
        yield tab


def table(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "shot.toml").read_text(encoding="utf-8"))


def bracket(name: str, role: str) -> str:
    return f'.bracket[data-name="{name}"] button:text-is("{role}")'


# Photographs


def test_choosing_photographs_writes_the_shot_and_undo_takes_it_back(room_page: Tab, room: Path):
    assert "4 photographs, 768 × 512, 1/4 s … 16 s, f/8, ISO 100" in room_page.text('.bracket[data-name="plate"]')
    room_page.click(bracket("plate", "Plate"))
    assert (room / "shot.toml").read_text(encoding="utf-8") == BEGUN
    assert "light: missing" in room_page.text("#fault")
    room_page.click(bracket("ball_0", "Ball"))
    assert table(room)["light"] == {"balls": [{"photographs": ["ball_0/*.jpg"]}], "ball": {"radius": 0.05}}
    assert room_page.tab.locator("#fault").is_hidden()
    # A frame left out by Delete, and taken in again.
    frame = room_page.tab.locator('.thumb[data-path="plate/IMG_0001.jpg"]')
    frame.focus()
    room_page.press("Delete")
    assert table(room)["plate"]["photographs"] == [f"plate/IMG_000{n}.jpg" for n in (2, 3, 4)]
    room_page.tab.locator('.thumb[data-path="plate/IMG_0001.jpg"]').focus()
    room_page.press("Delete")
    assert table(room)["plate"]["photographs"] == ["plate/*.jpg"]
    room_page.press("Control+z", "Control+z", "Control+z")
    assert (room / "shot.toml").read_text(encoding="utf-8") == BEGUN
    room_page.press("Control+Shift+Z")
    assert "balls" in table(room)["light"]


def test_a_pattern_whose_photographs_are_gone_is_said_and_taken_out(room_page: Tab, room: Path):
    room_page.click(bracket("plate", "Plate"))
    room_page.click(bracket("ball_0", "Ball"))
    (room / "ball_0").rename(room / "elsewhere")
    try:
        room_page.tab.reload()
        lost = '.bracket[data-name="ball_0/*.jpg"]'
        room_page.until(lambda: room_page.tab.locator(lost).count() == 1, "what is gone")
        assert "no photograph is here under this name, which is view 1 of the ball" in room_page.text(lost)
        room_page.click(f'{lost} button:text-is("Remove")')
        assert "balls" not in table(room)["light"] and room_page.tab.locator(lost).count() == 0
        assert table(room)["plate"]["photographs"] == ["plate/*.jpg"]
    finally:
        (room / "elsewhere").rename(room / "ball_0")


def test_a_frame_dragged_to_another_bracket_belongs_to_it_in_the_shot(room_page: Tab, room: Path):
    room_page.click(bracket("plate", "Plate"))
    room_page.tab.locator('.thumb[data-path="plate_grid.jpg"]').drag_to(
        room_page.tab.locator('.bracket[data-name="plate"] h3')
    )
    room_page.settle()
    assert table(room)["plate"]["photographs"] == [*(f"plate/IMG_000{n}.jpg" for n in (1, 2, 3, 4)), "plate_grid.jpg"]


def test_a_frame_among_others_gets_a_bracket_of_its_own_and_keeps_it(browser: Any, tmp_path: Path):
    for number in (1, 2, 3, 4):
        shutil.copy(ROOM / "plate" / f"IMG_{number:04d}.jpg", tmp_path)
    with serving([tmp_path], "studio") as server:
        with opened(browser, server.address) as page:
            assert page.tab.locator(".bracket").count() == 1
            assert page.text(".bracket h3") == tmp_path.name
            page.tab.drag_and_drop('.thumb[data-path="IMG_0001.jpg"]', ".drop")
            page.until(lambda: page.tab.locator(".bracket").count() == 2, "the two brackets")
            page.click(bracket("IMG_0001.jpg", "Plate"))
            page.click('.bracket:not([data-name="IMG_0001.jpg"]) button:text-is("Ball")')
            page.settle()
        chosen = table(tmp_path)
        assert chosen["plate"] == {"photographs": ["IMG_0001.jpg"]}
        assert chosen["light"]["balls"] == [{"photographs": ["IMG_0002.jpg", "IMG_0003.jpg", "IMG_0004.jpg"]}]
        with opened(browser, server.address) as page:  # a page loaded anew asks the folder again
            assert [page.tab.locator(".bracket").nth(n).locator(".thumb").count() for n in range(2)] == [1, 3]


# Light


def test_the_rim_is_found_and_follows_its_handles_pixel_by_pixel(room_page: Tab, room: Path):
    room_page.click(bracket("plate", "Plate"))
    room_page.click(bracket("ball_0", "Ball"))
    room_page.press("Alt+3")
    room_page.until(lambda: "an edge was seen" in room_page.text("#pane"), "the rim")
    found = [float(each) for each in room_page.text("#pane").split("\nrim ")[1].split(";")[0].split(",")]
    assert found == pytest.approx([320, 320, 295.5], abs=1.0)  # the ball of this shoot
    assert "% of all directions are unseen" in room_page.text("#pane")
    room_page.click('button:text-is("Keep it")')
    kept = table(room)["light"]["balls"][0]["pick"]
    x, y, radius = kept
    # The middle by the pointer, the rim by the arrow keys.
    room_page.drag((x, y), (x + 12, y - 7))
    room_page.until(lambda: table(room)["light"]["balls"][0]["pick"] != kept, "the edit")
    assert table(room)["light"]["balls"][0]["pick"] == pytest.approx([x + 12, y - 7, radius], abs=0.02)
    room_page.tab.locator('circle[data-handle="right"]').focus()
    room_page.press("ArrowRight", "ArrowRight", "ArrowRight")
    room_page.until(
        lambda: table(room)["light"]["balls"][0]["pick"][2] == pytest.approx(radius + 3, abs=0.02), "three pixels"
    )
    # Taken exactly, it is a rim.
    room_page.tab.locator("#light-way").select_option("rim")
    room_page.settle()
    view = table(room)["light"]["balls"][0]
    assert "pick" not in view and view["rim"] == pytest.approx([x + 12, y - 7, radius + 3], abs=0.02)
    room_page.until(lambda: sum(map_pixel(room_page)) > 60, "the floor in the map")


# Camera


def test_the_board_is_found_and_drawn_where_it_lies(room_page: Tab, room: Path):
    room_page.click(bracket("plate", "Plate"))
    room_page.click(bracket("ball_0", "Ball"))
    room_page.click(bracket("plate_grid.jpg", "Board"))
    assert table(room)["camera"]["grid"] == {"photograph": "plate_grid.jpg", "squares": [9, 6], "square": 0.03}
    room_page.press("Alt+4")
    room_page.until(lambda: "the board is there" in room_page.text("#pane"), "the board")
    truth = rl.camera_from_grid(rl.read_photograph(room / "plate_grid.jpg"), squares=(9, 6), square=0.03)
    assert f"{truth.position[1]:.3f} m above it" in room_page.text("#pane")
    room_page.settle()
    drawn = room_page.tab.evaluate("() => document.querySelector('#overlay path.thin').getAttribute('d')")
    first = [float(each) for each in drawn.split("M")[1].split("L")[0].split(",")]
    x, y = truth.project(np.array([-0.135, 0.0, -0.09]))
    box = room_page.tab.locator("#picture").bounding_box()
    expected = np.subtract(room_page.point_at(float(x), float(y)), [box["x"], box["y"]])
    assert first == pytest.approx(expected.tolist(), abs=0.05)


# Place and objects


def test_the_tables_side_is_dragged_to_where_it_ends(page: Tab, small: Path, small_server: Server):
    looked_at(page, small_server)
    page.press("Alt+5")
    lens = camera()
    # It is held in the middle of what the picture shows of it.
    held = page.tab.evaluate("() => { const h = relume.studio.overlay.handles.get('side 1'); return [h.x, h.y]; }")
    ray = lens.rays_through(np.array([held]))[0]
    x, _, z = lens.position - ray * (lens.position[1] / ray[1])
    assert x == pytest.approx(0.5, abs=1e-6) and 0 < held[0] < 192 and 0 < held[1] < 128
    end = lens.project(np.array([0.4, 0.0, z]))
    page.drag((held[0], held[1]), (float(end[0]), float(end[1])))
    assert table(small)["local"][0]["size"] == pytest.approx([0.9, 0.8], abs=1e-4)
    assert table(small)["local"][0]["translate"] == pytest.approx([-0.05, 0, 0], abs=1e-4)


def test_what_stands_in_front_is_painted_by_polygon_and_brush_and_hides_the_object(page: Tab, small: Path):
    page.press("Alt+5")
    page.click('button:text-is("Polygon")')
    for x, y in ((80, 40), (100, 40), (100, 80), (60, 80)):
        page.tab.mouse.click(*page.point_at(x, y))
    page.settle()
    # A corner dragged to where it belongs.
    page.drag((60, 80), (80, 80))
    page.click('button:text-is("Fill it")')
    page.click('button:text-is("Eraser")')
    page.tab.locator("#brush").fill("4")
    page.drag((90, 70), (90, 78))
    page.click('button:text-is("Keep it")')
    page.until(lambda: "occluder" in table(small).get("match", {}), "the matte in the shot")
    name = table(small)["match"]["occluder"]
    picture = cv2.imread(str(small / name), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    alpha = picture[..., 3]
    assert alpha.shape == (128, 192)
    assert (alpha[42:64, 82:98] == 255).all() and (alpha[:38] == 0).all() and (alpha[:, 104:] == 0).all()
    assert (alpha[:, :78] == 0).all()  # the corner was dragged
    assert (alpha[70:78, 88:92] == 0).all() and alpha[74, 84] == 255  # what was erased
    # It covers the plate's own pixels again in the composite.
    shot = rl.read_shot(small / "shot.toml")
    rl.insert(shot, small / "masked")
    composite, plate = (rl.read_radiance(small / each).radiance for each in ("masked/composite.exr", "plate.exr"))
    assert np.array_equal(composite[alpha == 255], plate[alpha == 255])
    assert not np.array_equal(composite[70:78, 88:92], plate[70:78, 88:92])
    # Undone it is gone from the page too; done again it is there.
    page.press("Control+z")
    page.until(lambda: "occluder" not in table(small).get("match", {}), "the undo")
    page.until(lambda: painted(page, 90, 50) == 0, "the page without it")
    page.press("Control+Shift+Z")
    page.until(lambda: painted(page, 90, 50) > 80, "the page with it")
    assert "mattes" not in str(page.tab.evaluate("() => relume.studio.brackets.map((each) => each.name)"))


def test_an_object_is_dragged_on_the_table_by_what_the_pointer_moved_there(
    page: Tab, small: Path, small_server: Server
):
    looked_at(page, small_server)
    page.press("Alt+6")
    page.until(lambda: page.tab.evaluate("() => !document.getElementById('live').hidden"), "the live picture")
    page.tab.locator("#objects-look").uncheck()
    page.until(lambda: page.tab.locator("#overlay path").count() > 0, "the object")
    lens = camera()
    start = lens.project(np.array([0.0, 0.05, 0.0]))
    end = start + np.array([30.0, 8.0])
    before = live_pixel(page, end)
    page.drag(tuple(start), tuple(end))
    page.until(lambda: "translate" in table(small)["objects"][0], "the edit")
    rays = lens.rays_through(np.array([start, end]))
    hits = lens.position - rays * (lens.position[1] / rays[:, 1])[:, None]
    moved = table(small)["objects"][0]["translate"]
    assert moved == pytest.approx((hits[1] - hits[0]).tolist(), abs=1e-4)  # a tenth of a millimetre
    page.until(lambda: live_pixel(page, end)[3] == 255 and live_pixel(page, start)[3] == 0, "the ball in its new place")
    assert before[3] == 0
    # Turned and scaled about its foot by keys: it stays where it is.
    page.tab.locator("#picture").focus()
    page.press("[", ".")
    page.until(lambda: table(small)["objects"][0].get("scale") == 1.1, "the scale")
    found = table(small)["objects"][0]
    assert found["rotate"] == [0, 15, 0]
    foot = np.concatenate([m.vertices for m in rl.report.placed_meshes(rl.read_shot(small / "shot.toml"))])
    assert (foot.min(0) + foot.max(0))[[0, 2]] / 2 == pytest.approx([moved[0], moved[2]], abs=1e-3)
    assert foot[:, 1].min() == pytest.approx(0, abs=1e-6)


@pytest.fixture
def larger(looked_studio: OneStudio) -> Iterator[OneStudio]:
    """The studio over a plate of four times the width."""
    folder = looked_studio.folder
    looked_studio.as_begun(TEXT.replace("focal_length = 200", "focal_length = 800"))
    before = (folder / "plate.exr").read_bytes()
    plate = np.repeat(np.repeat(rl.read_radiance(folder / "plate.exr").radiance, 4, 0), 4, 1)
    rl.write(folder / "plate.exr", rl.RadianceMap(plate))
    looked_studio.look()
    yield looked_studio
    (folder / "plate.exr").write_bytes(before)
    looked_studio.as_begun()
    looked_studio.look()


def test_a_look_of_a_larger_plate_is_dragged_on_and_stays_where_it_was_enlarged(browser: Any, larger: OneStudio):
    server = larger.server
    # A look may be written anew while its tiles come: they are refused, and those of the new one come.
    with opened(browser, server.address, refusals=True) as tab:
        # Balls of materials, made anew for a camera, are the work of other tests.
        tab.tab.evaluate(
            "() => { const plain = fetch; window.fetch = async (address, given) => address === '/materials'"
            " ? new Response(JSON.stringify({ error: 'not now' }), { status: 422 }) : plain(address, given); }"
        )
        tab.press("Alt+6", "l")
        done(tab, server, "look")
        tab.until(lambda: tab.text("#caption") == "preview.exr", "the look")
        tab.settle()
        # The second look begins with a rougher picture; the last is seen as large as that was.
        size, zoom = tab.tab.evaluate("[relume.studio.facts.get(relume.studio.number).size, relume.canvas.view.zoom]")
        assert size == [384, 256]
        width, height = tab.tab.evaluate("[relume.canvas.width, relume.canvas.height]")
        assert zoom == pytest.approx(min(width / 384, height / 256))
        tab.press("+")
        start = 4 * camera().project(np.array([0.0, 0.05, 0.0]))
        end = start + np.array([60.0, 20.0])
        tab.tab.locator("#objects-look").uncheck()
        tab.drag(tuple(start / 2), tuple(end / 2))
        tab.until(lambda: "translate" in table(larger.folder)["objects"][0], "the edit")
        lens = camera().resized(768, 512)
        rays = lens.rays_through(np.array([start, end]))
        hits = lens.position - rays * (lens.position[1] / rays[:, 1])[:, None]
        assert table(larger.folder)["objects"][0]["translate"] == pytest.approx((hits[1] - hits[0]).tolist(), abs=2e-4)
        # The plate is there now, at the same place and as large.
        tab.until(lambda: tab.text("#caption") == "plate.exr", "the plate")
        assert tab.tab.evaluate("relume.canvas.view.zoom") == pytest.approx(zoom)


def test_a_mesh_is_handed_over_stands_on_the_table_and_is_looked_at(page: Tab, small: Path, small_server: Server):
    looked_at(page, small_server)
    number = small_server.json("/shot")["job"]["number"]
    page.press("Alt+6")
    page.until(lambda: page.tab.locator("#overlay path").count() > 0, "the object")
    page.tab.locator('input[type="file"]').set_input_files(str(small / "objects" / "ball.glb"))
    page.until(lambda: len(table(small)["objects"]) == 2, "the object")
    assert table(small)["objects"][1] == {"mesh": "objects/ball-2.glb", "stand": [0, 0]}
    assert (small / "objects" / "ball-2.glb").read_bytes() == (small / "objects" / "ball.glb").read_bytes()
    page.settle()
    page.until(lambda: small_server.json("/shot")["job"]["number"] == number + 1, "a look by itself")
    done(page, small_server, "look")
    page.until(lambda: page.text("#caption") == "preview.exr", "the look")
    page.tab.locator("select").last.select_option(label="gold")
    page.until(lambda: table(small)["objects"][1].get("material") == {"preset": "gold"}, "the material")
    page.tab.get_by_label("Smooth up to").fill("30")
    page.tab.get_by_label("Smooth up to").press("Enter")
    page.until(lambda: table(small)["objects"][1].get("smooth") == 30, "smooth edges")


def test_a_light_is_placed_by_the_point_that_shall_mirror_it_and_stands_apart(
    page: Tab, small: Path, small_server: Server
):
    looked_at(page, small_server)
    page.press("Alt+6")
    page.until(lambda: page.tab.evaluate("() => !document.getElementById('live').hidden"), "the live picture")
    page.tab.locator("#objects-look").uncheck()
    page.until(lambda: page.tab.locator("#overlay path").count() > 0, "the object")
    x, y = camera().project(np.array([0.01, 0.06, 0.0]))
    page.click('button:text-is("Add one by its reflection")')
    # Beside the object there is nothing that could mirror it.
    page.tab.mouse.click(*page.point_at(20, 20))
    page.until(lambda: "there is no object at this point" in page.text("#message"), "the refusal")
    page.tab.mouse.click(*page.point_at(float(x), float(y)))
    page.until(lambda: "added" in table(small)["light"], "the light")
    (light,) = table(small)["light"]["added"]
    expected = rl.report.mirrored_light(rl.read_shot(small / "shot.toml"), camera(), float(x), float(y))
    assert expected is not None
    assert np.degrees(np.linalg.norm(np.subtract(light["direction"], expected.direction))) < 0.1
    assert "translate" not in table(small)["objects"][0]  # it was clicked, not dragged
    page.until(lambda: "adds 50 %" in page.text('[data-added="0"]'), "its share")
    # Switched off it stays in the file; taken out it goes.
    page.tab.locator("#added-0").uncheck()
    page.until(lambda: table(small)["light"]["added"][0].get("on") is False, "off")
    page.click('button:text-is("Brighter")')
    page.until(lambda: table(small)["light"]["added"][0]["irradiance"] > 1.4 * light["irradiance"], "brighter")
    page.click('[data-added="0"] button:text-is("Out")')
    page.until(lambda: "added" not in table(small)["light"], "gone")


# The document


def test_edits_outside_appear_and_a_broken_file_is_said_and_undone(page: Tab, small: Path):
    page.press("Alt+8")
    field = page.tab.locator('input[data-place="render.samples"]')
    assert field.input_value() == "8"
    (small / "shot.toml").write_text(TEXT.replace("samples = 8", "samples = 24"), encoding="utf-8")
    page.until(lambda: field.input_value() == "24", "the edit made outside")
    (small / "shot.toml").write_text(TEXT.replace("samples = 8", "samples = = 24 "), encoding="utf-8")
    page.until(lambda: "not valid TOML" in page.text("#fault"), "the fault")
    assert "line 26" in page.text("#fault") and field.input_value() == "24"
    page.click("#undo")
    assert table(small)["render"]["samples"] == 24
    page.until(lambda: page.tab.locator("#fault").is_hidden(), "the fault's end")
    # What is wrong is refused, and the field shows what the file holds.
    field.fill("1")
    field.press("Tab")
    page.until(lambda: "not done: render.samples" in page.text("#message"), "the refusal")
    assert table(small)["render"]["samples"] == 24 and field.input_value() == "24"


def test_two_windows_on_one_shot_see_each_others_edits(page: Tab, browser: Any, small: Path, small_server: Server):
    with opened(browser, small_server.address, refusals=True) as other:
        for each in (page, other):
            each.press("Alt+7")
        page.tab.locator("select").first.select_option(label="sRGB")
        page.until(lambda: table(small).get("develop") == {"response": "srgb"}, "the edit")
        other.until(lambda: other.tab.locator("select").first.input_value() == '"srgb"', "the edit in the other window")
        other.press("Control+z")
        page.until(lambda: page.tab.locator("select").first.input_value() == '"plate"', "the undo in the first")
    assert (small / "shot.toml").read_text(encoding="utf-8") == TEXT


# Deliver


def test_the_composite_is_rendered_shown_and_listed_with_what_one_would_type(
    page: Tab, small: Path, small_server: Server
):
    page.press("Alt+8")
    page.click('button:text-is("Render the composite")')
    done(page, small_server, "insert")
    for name in ("composite.exr", "composite.png", "layers.exr", "light.exr", "report.html"):
        assert name in page.text(".files") and (small / "out" / name).is_file()
    page.until(lambda: page.text("#caption") == "composite.png", "the composite")
    page.press("r")
    codes = rl.read_photograph(small / "out" / "composite.png").pixels[40, 50].tolist()
    page.until(lambda: page.shown(50.5, 40.5) == pytest.approx(codes, abs=1.01), "its pixels")
    # Its radiance is one click away, as bright as the plate.
    page.click('.files button:text-is("composite.exr")')
    page.until(lambda: page.text("#caption") == "composite.exr", "its radiance")
    page.press("r")
    linear = rl.read_radiance(small / "out" / "composite.exr").radiance[40, 50].astype(np.float64)
    code = 255 * (1.055 * np.clip(linear, 0, 1) ** (1 / 2.4) - 0.055)
    page.until(lambda: page.shown(50.5, 40.5) == pytest.approx(code, abs=1.01), "its radiance's pixels")
    page.tab.locator("summary").click()
    assert page.text('[data-typed="command"]') == "relume insert shot.toml -o out"
    exec(page.text('[data-typed="Python"]').split("\n\n")[0], {})
    assert 'rl.insert(rl.read_shot("shot.toml"), "out")' in page.text('[data-typed="Python"]')


def test_no_element_lacks_a_name_and_nothing_leaves_a_small_window(page: Tab):
    for size in ((1280, 720), (640, 480)):
        page.tab.set_viewport_size({"width": size[0], "height": size[1]})
        for step in range(1, page.tab.evaluate("() => relume.studio.panes.length") + 1):
            page.press(f"Alt+{step}")
            across = page.tab.evaluate(
                "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"
            )
            assert across <= 0, (size, step)
            nameless = page.tab.evaluate(
                "() => [...document.querySelectorAll('button, input, select, canvas[tabindex], progress')]"
                ".filter((e) => !e.hidden && !(e.textContent.trim() || e.getAttribute('aria-label')"
                " || e.labels?.length))"
                ".map((e) => e.outerHTML)"
            )
            assert nameless == []


def test_axe_finds_nothing_serious_in_any_pane(page: Tab, browser: Any, room: Path, room_server: Server):
    steps = page.tab.evaluate("() => relume.studio.panes.map((each) => each.name)")
    found = {}
    for step, name in enumerate(steps):
        page.press(f"Alt+{step + 1}")
        found[name] = serious_faults(page)
    # The panes of photographs, and of a ball and a board that are there.
    with opened(browser, room_server.address, refusals=True) as photographed:
        for name, role in (("plate", "Plate"), ("ball_0", "Ball"), ("plate_grid.jpg", "Board")):
            photographed.click(bracket(name, role))
        for step in range(4):
            photographed.press(f"Alt+{step + 1}")
            found[f"photographs {step}"] = serious_faults(photographed)
    assert {name: faults for name, faults in found.items() if faults} == {}


def painted(page: Tab, x: float, y: float) -> int:
    """How opaque the matte is drawn over a pixel of the picture."""
    return page.tab.evaluate(
        "([x, y]) => { const c = document.getElementById('matte'), s = relume.canvas.toScreen(x, y);"
        "return c.getContext('2d').getImageData(s[0] | 0, s[1] | 0, 1, 1).data[3]; }", [x, y],
    )  # fmt: skip


def live_pixel(page: Tab, at: np.ndarray) -> list[int]:
    """What is drawn over the picture at a pixel of it: red, green, blue and how opaque."""
    return page.tab.evaluate(
        "([x, y]) => { const c = document.getElementById('live'), g = c.getContext('webgl2'), p = new Uint8Array(4);"
        "const s = relume.canvas.toScreen(x, y); g.bindFramebuffer(g.FRAMEBUFFER, null);"
        "g.readPixels(s[0] | 0, c.height - 1 - (s[1] | 0), 1, 1, g.RGBA, g.UNSIGNED_BYTE, p); return [...p]; }",
        [float(at[0]), float(at[1])],
    )


def map_pixel(page: Tab) -> list[int]:
    """Red, green and blue of the unwrapped map, below its middle."""
    return page.tab.evaluate(
        "() => { const c = document.querySelector('.map canvas'), g = c.getContext('webgl2'), p = new Uint8Array(4);"
        "g.bindFramebuffer(g.FRAMEBUFFER, null);"
        "g.readPixels(c.width / 2 | 0, c.height * 0.1 | 0, 1, 1, g.RGBA, g.UNSIGNED_BYTE, p); return [...p]; }"
    )[:3]
