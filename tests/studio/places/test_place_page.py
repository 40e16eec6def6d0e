"""Edges marked in a real browser: by pointer and keys, as lines of the place file, and the sizes that come of them."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Tab, opened
from serving import Server, serving
from studio_page import serious_faults

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

PLACES = Path(__file__).resolve().parents[3] / "examples" / "places"
MARK = "front_top = [[692.67, 242.53], [830.14, 287.18]]\n"
ENDS = np.array([[692.67, 242.53], [830.14, 287.18]])
"""The upper edge of the tower's front, as front_left.jpg shows it."""
BEFORE = (PLACES / "chapel.toml").read_text(encoding="utf-8").replace(MARK, "", 1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("places")
    shutil.copytree(PLACES / "photographs", place / "photographs")
    (place / "chapel.toml").write_text(BEFORE, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Server]:
    with serving([folder / "chapel.toml"], "studio") as running:
        yield running


@pytest.fixture
def page(browser: Any, folder: Path, server: Server) -> Iterator[Tab]:
    server.post("/place/undo", {"by": 10_000})
    with opened(browser, server.address, refusals=True) as tab:
        tab.until(lambda: tab.tab.evaluate("() => relume.page.shownName") == "front_left", "the photograph")
        tab.settle()
        yield tab


def marks(folder: Path, photograph: str, block: str) -> dict[str, Any]:
    return marks_of(folder / "chapel.toml", photograph, block)


def marks_of(path: Path, photograph: str, block: str) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))["marks"][photograph].get(block, {})


def mark_front_top(page: Tab, folder: Path) -> np.ndarray:
    """The edge picked in the tower's drawing and drawn along in the photograph."""
    page.click('[data-block="tower"]')
    page.until(lambda: page.tab.locator('.wireframe path[data-edge="front_top"]').count() == 1, "the drawing")
    page.click('.wireframe path[data-edge="front_top"]')
    assert page.tab.locator('.edges [data-edge="front_top"]').get_attribute("aria-pressed") == "true"
    page.drag(ENDS[0], ENDS[1])
    page.until(lambda: "front_top" in marks(folder, "front_left", "tower"), "the mark")
    return np.array(marks(folder, "front_left", "tower")["front_top"])


def test_an_edge_is_marked_by_the_pointer_and_moved_by_quarters_of_a_pixel(page: Tab, folder: Path):
    found = mark_front_top(page, folder)
    zoom = page.tab.evaluate("() => relume.canvas.view.zoom")
    assert np.abs(found - ENDS).max() <= 1 / zoom  # the pointer's own pixel
    words = page.tab.evaluate("() => [...document.querySelectorAll('#overlay text')].map((each) => each.textContent)")
    assert "tower.front_top" in words and "spire.front_left" in words
    page.settle()
    page.tab.locator('circle[data-handle="1"]').focus()
    page.press("ArrowRight", "ArrowRight", "ArrowUp")
    moved = found + np.array([[0, 0], [0.5, -0.25]])
    page.until(lambda: np.allclose(marks(folder, "front_left", "tower")["front_top"], moved, atol=1e-6), "the nudge")
    # A handle is dragged, with the glass at it.
    page.drag(tuple(moved[0]), tuple(moved[0] + np.array([-20, 10])))
    page.until(lambda: marks(folder, "front_left", "tower")["front_top"][0][0] < moved[0, 0] - 15, "the drag")
    page.press("Control+z", "Control+z", "Control+z", "Control+z")
    page.until(lambda: np.allclose(marks(folder, "front_left", "tower")["front_top"], found, atol=1e-6), "the undo")
    page.press("Control+Shift+z")
    page.until(lambda: not np.allclose(marks(folder, "front_left", "tower")["front_top"], found, atol=1e-6), "redone")
    page.tab.locator("#picture").focus()
    page.press("Delete")
    page.until(lambda: (folder / "chapel.toml").read_text(encoding="utf-8") == BEFORE, "its end")


def test_solving_shows_sizes_distances_and_edges_and_lays_what_is_not_marked_yet(page: Tab, folder: Path):
    mark_front_top(page, folder)
    page.click("#solve")
    page.until(lambda: page.tab.locator('[data-size="tower"]').count() == 1, "the sizes")
    width, height, _ = (
        float(each.split("±")[0]) for each in page.tab.locator('[data-size="tower"] td').all_inner_texts()
    )
    assert (width, height) == pytest.approx((7, 15), rel=0.004)
    assert "±" in page.text('[data-size="tower"] td')
    words = page.tab.evaluate("() => [...document.querySelectorAll('#overlay text')].map((each) => each.textContent)")
    (front_top,) = [each for each in words if each.startswith("tower.front_top")]
    assert float(front_top.split()[1]) < 2
    lines = page.tab.evaluate(
        "() => [...document.querySelectorAll('#overlay path.found')].filter((each) => each.getAttribute('d')).length"
    )
    assert lines == 7
    # An edge that is hidden here is laid where it was found.
    page.click('.edges [data-edge="back_left"]')
    page.click("#put")
    page.until(lambda: "back_left" in marks(folder, "front_left", "tower"), "what was laid")
    state = page.tab.evaluate("() => relume.page.state")
    a, b = np.array(state["found"]["lines"]["front_left"]["tower"]["back_left"])
    laid = np.array(marks(folder, "front_left", "tower")["back_left"])
    assert laid == pytest.approx(np.array([a + 0.12 * (b - a), a + 0.88 * (b - a)]), abs=0.02)
    page.until(lambda: page.tab.locator("#stale").count() == 1, "that it is of before")


def test_points_of_a_ring_are_clicked_and_taken_out(page: Tab, folder: Path):
    page.click('[data-block="well"]')
    page.click('[data-photograph="right"]')
    page.until(lambda: page.tab.evaluate("() => relume.page.shownName") == "right", "the photograph")
    page.click('.edges [data-edge="ring_1"]')
    for number, x in enumerate((100, 140, 180)):
        page.tab.mouse.click(*page.point_at(x, 700))
        page.until(lambda n=number: len(marks(folder, "right", "well").get("ring_1", [])) == n + 1, "the point")
    page.settle()
    page.tab.locator('circle[data-handle="1"]').focus()
    page.press("Delete")
    page.until(lambda: len(marks(folder, "right", "well")["ring_1"]) == 2, "two points")
    assert [x for x, _ in marks(folder, "right", "well")["ring_1"]] == pytest.approx([100, 180], abs=2)


def test_a_point_is_kept_where_the_server_says_how_the_file_was_before_it(page: Tab, folder: Path):
    """Else the next click would begin the curve anew."""
    page.click('[data-block="well"]')
    page.click('[data-photograph="right"]')
    page.until(lambda: page.tab.evaluate("() => relume.page.shownName") == "right", "the photograph")
    page.click('.edges [data-edge="ring_1"]')
    known = page.tab.evaluate(
        "async () => { const { page } = relume, before = page.state; page.marks.clicked(100, 700);"
        "for (let i = 0; i < 20; i++) await null; page.take(before); return page.marks.points('well', 'ring_1'); }"
    )
    assert known == [[100, 700]]
    page.until(lambda: marks(folder, "right", "well").get("ring_1") == [[100, 700]], "the point")


def test_marks_are_the_file_s_where_another_window_s_change_came_before_the_answer(page: Tab):
    left = page.tab.evaluate(
        "() => { const { page } = relume, now = page.state, mark = () => page.marks.points('well', 'ring_1');"
        "const own = { ...now, revision: now.revision + 1 }, both = { ...now, revision: now.revision + 2 };"
        "const send = page.edit; page.edit = () => {}; page.photograph = 'right'; page.pick('well', 'ring_1');"
        "page.waiting = 1; page.marks.clicked(100, 700); const ahead = mark(); page.take(both);"
        "page.waiting = 0; page.take(own); const after = mark(); page.edit = send; return [ahead, after]; }"
    )
    assert left == [[[100, 700]], None]


def test_a_block_is_added_with_its_constraints_and_what_is_refused_is_said(page: Tab, folder: Path):
    page.click('details[data-part="adding"] > summary')
    page.tab.locator('details[data-part="adding"] input').fill("porch")
    page.tab.locator('details[data-part="adding"] select').first.select_option("wedge")
    page.click("#add-block")
    page.until(lambda: page.tab.locator('[data-block="porch"]').count() == 1, "the block")
    page.until(lambda: page.tab.evaluate("() => relume.page.block") == "porch", "its choice")
    page.click('details[data-part="known"] > summary')

    def typed(key: str, text: str) -> None:
        page.tab.locator(f'[data-place="blocks.7.{key}"]').fill(text)
        page.tab.locator(f'[data-place="blocks.7.{key}"]').press("Enter")
        page.settle()

    typed("width", "nave.width")
    typed("height", "2.5")
    text = (folder / "chapel.toml").read_text(encoding="utf-8")
    porch = '\n[[blocks]]\nname = "porch"\nkind = "wedge"\nwidth = "nave.width"\nheight = 2.5\n\n# Marks, which'
    assert porch in text
    typed("depth", "nav.depth")
    page.until(lambda: "did you mean nave?" in page.text("#message"), "the refusal")
    assert (folder / "chapel.toml").read_text(encoding="utf-8") == text
    page.click('button:text-is("Take out porch")')
    page.until(lambda: (folder / "chapel.toml").read_text(encoding="utf-8") == BEFORE, "its end")


def test_a_click_is_not_lost_where_the_pane_changes_between_press_and_release(page: Tab, folder: Path):
    where = page.tab.locator('[data-block="roof"]').bounding_box()
    assert where is not None
    page.tab.mouse.move(where["x"] + where["width"] / 2, where["y"] + where["height"] / 2)
    page.tab.mouse.down()
    (folder / "chapel.toml").write_text(BEFORE + "\n# written meanwhile\n", encoding="utf-8")
    page.until(lambda: page.tab.evaluate("() => relume.page.state.undo") > 0, "what others wrote")
    page.tab.mouse.up()
    page.until(lambda: page.tab.evaluate("() => relume.page.block") == "roof", "the block")
    pressed = page.tab.locator('[data-block="roof"][aria-pressed="true"]')
    page.until(lambda: pressed.count() == 1, "the block drawn as chosen")


def test_axe_finds_nothing_serious(page: Tab):
    page.click('[data-block="tower"]')
    page.click('.edges [data-edge="front_right"]')
    assert serious_faults(page) == []


@pytest.mark.slow
def test_from_bare_photographs_to_a_tower_s_sizes_by_the_pointer_alone(browser: Any, tmp_path: Path):
    """One length is typed, and what the spire has of the tower; all else is picked and drawn."""
    names = ("front_left", "front_right", "back_left", "above")
    (tmp_path / "photographs").mkdir()
    for name in names:
        shutil.copy(PLACES / "photographs" / f"{name}.jpg", tmp_path / "photographs")
    path = tmp_path / "place.toml"
    rl.scene.new_place_file(tmp_path / "photographs", path)
    truth = tomllib.loads((PLACES / "chapel.toml").read_text(encoding="utf-8"))["marks"]
    with serving([path], "studio") as running, opened(browser, running.address, refusals=True) as page:

        def typed(block: int, key: str, text: str) -> None:
            field = page.tab.locator(f'[data-place="blocks.{block}.{key}"]')
            field.fill(text)
            field.press("Enter")
            page.settle()

        # The block that a new file begins with is the tower: its height is known.
        page.click('details[data-part="known"] > summary')
        typed(0, "height", "15")
        typed(0, "width", "")
        page.click('details[data-part="adding"] > summary')
        page.tab.locator('details[data-part="adding"] input').fill("spire")
        for number, choice in enumerate(("pyramid", "house")):
            page.tab.locator('details[data-part="adding"] select').nth(number).select_option(choice)
        page.click("#add-block")
        page.until(lambda: page.tab.evaluate("() => relume.page.block") == "spire", "the spire")
        for key in ("width", "depth", "centre_x", "centre_z"):
            typed(1, key, f"house.{key}")
        # Its edges, in four photographs.
        for name in names:
            page.click(f'[data-photograph="{name}"]')
            page.until(lambda n=name: page.tab.evaluate("() => relume.page.shownName") == n, "the photograph")
            page.settle()
            for block, of in (("house", "tower"), ("spire", "spire")):
                page.click(f'[data-block="{block}"]')
                for edge, ends in truth[name][of].items():
                    page.click(f'.edges [data-edge="{edge}"]')
                    page.drag(ends[0], ends[1])
                    page.until(lambda n=name, b=block, e=edge: e in marks_of(path, n, b), f"{name}, {block}.{edge}")
        page.click("#solve")
        page.until(lambda: page.tab.locator('[data-size="spire"]').count() == 1, "the sizes")
        page.settle()
        place = rl.scene.read_place(path)
    assert place.doubts == ()
    assert place.block("house").size == pytest.approx([7, 15, 6], rel=0.01)
    assert place.block("spire").size == pytest.approx([7, 7, 6], rel=0.01)
    assert max(photograph.residual for photograph in place.photographs) < 1
