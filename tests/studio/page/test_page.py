"""The page of `relume view` in a real browser: what keys and the pointer do, by pixels read back and numbers shown."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Page, encoded, opened
from serving import Server, serving
from studio_page import serious_faults

pytest.importorskip("uvicorn", reason="the extra studio is not installed")

WIDTH, HEIGHT = 640, 320


def gradient(factor: float = 1.0) -> np.ndarray:
    """Light that doubles every 40 columns; green and blue are a half and a quarter of red."""
    red = np.exp2(np.arange(WIDTH) / 40 - 8)[None, :, None] * np.ones((HEIGHT, 1, 1))
    return (factor * red * np.array([1.0, 0.5, 0.25])).astype(np.float32)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("page")
    clipped = np.zeros((HEIGHT, WIDTH), np.uint8)
    clipped[:40, -40:] = 1
    rl.write(folder / "a.exr", rl.RadianceMap(gradient(), None, clipped, "cd/m²", {"mapping": "latlong"}))
    rl.write(folder / "b.exr", rl.RadianceMap(gradient(2.0), unit="cd/m²"))
    odd = gradient()
    odd[100:140, 100:140] = np.nan
    layers = {"odd": odd, "matte": np.full((HEIGHT, WIDTH), 0.25, np.float32)}
    rl.files.write_layers(folder / "layers.exr", layers)
    return [folder / "a.exr", folder / "b.exr", folder / "layers.exr"]


@pytest.fixture(scope="module")
def server(files: list[Path]) -> Iterator[Server]:
    with serving(files) as running:
        yield running


@pytest.fixture
def page(browser: Any, server: Server) -> Iterator[Page]:
    with opened(browser, server.address, Page) as result:
        result.press("r", "f")
        yield result


def test_the_screen_shows_the_exposed_value_and_the_file_is_never_written(page: Page, files: list[Path]):
    before = files[0].read_bytes()
    for stops, keys in ((0.0, ()), (1.0, ("e", "e")), (-0.5, ("Shift+E",) * 3)):
        page.press(*keys)
        assert page.view("stops") == stops
        for x in (20, 300, 340, 500):
            value = gradient()[0, x] * 2.0**stops
            assert page.shown(x + 0.5, 200.5) == pytest.approx(encoded(value), abs=1.01)
    assert page.text("#exposure-shown") == "−0.50 stops"
    page.press("r")
    assert page.view("stops") == 0 and files[0].read_bytes() == before


def test_the_pixel_under_the_pointer_is_the_files_float_and_a_click_holds_it(page: Page):
    page.tab.mouse.move(*page.point_at(480.5, 160.5))
    page.until(lambda: "480, 160" in page.text("#value"), "the pixel")
    said = page.text("#value")
    assert "16 8 4" in said and "cd/m²" in said and "measured" in said  # 2^(480/40 − 8)
    assert "90.281° right" in said  # (480.5/640 − ½)·360°
    page.tab.mouse.down()
    page.tab.mouse.up()
    page.tab.mouse.move(*page.point_at(560.5, 160.5))
    page.until(lambda: "560, 160" in page.text("#value"), "the other pixel")
    assert "× 4, +2.00 stops" in page.text("#value")


def test_a_region_is_drawn_and_measured(page: Page):
    page.tab.keyboard.down("Shift")
    page.tab.mouse.move(*page.point_at(480.5, 100.5))
    page.tab.mouse.down()
    page.tab.mouse.move(*page.point_at(482.5, 109.5), steps=4)
    page.tab.mouse.up()
    page.tab.keyboard.up("Shift")
    page.until(lambda: "30" in page.text("#statistics"), "the region")
    mean = gradient()[0, 480:483, 0].mean()
    assert f"{float(f'{mean:.5g}'):g}" in page.text("#statistics")
    page.press("Escape")
    assert page.tab.locator("#region").is_hidden()


def test_wheel_and_drag_keep_the_point_that_is_held(page: Page):
    x, y = (round(each) for each in page.point_at(400.5, 100.5))  # wheels turn at whole pixels
    held = page.picture_at(x, y)
    page.tab.mouse.move(x, y)
    page.tab.mouse.wheel(0, -600)
    page.settle()
    assert page.view("zoom") > 4
    assert page.picture_at(x, y) == pytest.approx(held, abs=0.01)
    page.tab.mouse.down()
    page.tab.mouse.move(x + 60, y - 25, steps=3)
    page.tab.mouse.up()
    page.settle()
    assert page.picture_at(x + 60, y - 25) == pytest.approx(held, abs=0.01)
    page.press("f", "1")
    assert page.view("zoom") == 1


def test_enlarged_pixels_print_their_numbers(page: Page):
    page.tab.mouse.move(*page.point_at(480.5, 160.5))
    for _ in range(8):
        page.tab.mouse.wheel(0, -200)
    page.settle()
    assert page.view("zoom") >= 128

    def printed() -> bool:
        return page.tab.evaluate(
            "() => { const n = document.getElementById('numbers'); const d = n.getContext('2d')"
            ".getImageData(0, 0, n.width, n.height).data; return d.some((v) => v > 0); }"
        )

    page.until(printed, "numbers in the pixels")
    page.press("f")
    assert not printed()


def test_wipe_and_difference_against_a_reference(page: Page):
    page.tab.locator("#files button").nth(1).click(button="right")
    page.settle()
    page.press("r")
    assert page.view("mode") == "wipe"
    # Left of the middle the picture, right of it the reference, twice as bright.
    assert page.shown(200.5, 100.5) == pytest.approx(encoded(gradient()[0, 200]), abs=1.01)
    assert page.shown(330.5, 100.5) == pytest.approx(encoded(gradient(2.0)[0, 330]), abs=1.01)
    x, y = page.point_at(320, 160)
    page.tab.mouse.move(x, y)
    page.tab.mouse.down()
    page.tab.mouse.move(page.point_at(340, 160)[0], y, steps=3)
    page.tab.mouse.up()
    page.settle()
    assert page.shown(330.5, 100.5) == pytest.approx(encoded(gradient()[0, 330]), abs=1.01)
    assert "50 % RMS" not in page.text("#difference") and "-50 % bias" in page.text("#difference")
    page.press("d")
    # Half as bright: the difference is what the picture itself holds, below middle grey.
    assert page.shown(200.5, 100.5) == pytest.approx(encoded(0.18 - gradient()[0, 200]), abs=1.01)
    page.press("g")
    assert page.shown(200.5, 100.5) == pytest.approx(encoded([0.18] * 3), abs=1.01)
    assert "× 0.5" in page.text("#difference") and "alike" in page.text("#difference")
    page.press("g", " ")
    assert page.text('#files [aria-current="true"]').startswith("b.exr")
    assert page.view("mode") == "difference"
    assert page.shown(200.5, 100.5) == pytest.approx(encoded(0.18 + gradient()[0, 200]), abs=1.01)


def test_channels_false_colour_clipping_and_marks(page: Page):
    page.press("Shift+G")
    assert page.shown(300.5, 200.5) == pytest.approx(encoded([gradient()[0, 300, 1]] * 3), abs=1.01)
    page.press("l")
    luminance = gradient()[0, 300] @ [0.2126, 0.7152, 0.0722]
    assert page.shown(300.5, 200.5) == pytest.approx(encoded([luminance] * 3), abs=1.01)
    page.press("c", "v")
    # Viridis ends in dark violet and in yellow.
    assert page.shown(0.5, 200.5) == pytest.approx([68, 1, 84], abs=6)
    assert page.shown(639.5, 200.5) == pytest.approx([253, 231, 37], abs=6)
    assert page.tab.locator("#legend").is_visible() and "cd/m²" in page.text("#legend")
    page.press("v", "x")
    beyond = np.array([page.shown(600.5, 200.5 + i) for i in range(12)])
    assert (beyond[:, 1] < 60).any() and (beyond[:, 1] > 200).any()  # stripes of red and white
    page.press("x", "m")
    marked = np.array([page.shown(620.5, 10.5 + i) for i in range(12)])
    assert (np.abs(marked - [255, 140, 0]).max(1) < 3).any() and (marked[:, 2] > 200).any()
    assert page.shown(620.5, 60.5) == [255, 255, 255]


def test_layers_and_what_is_no_number(page: Page):
    page.tab.locator("#files button").nth(2).click()
    page.settle()
    page.press("r")
    assert page.text("#layers").split() == ["matte", "odd"] or page.text("#layers").split() == ["odd", "matte"]
    page.tab.locator("#layers button", has_text="odd").click()
    page.settle()
    page.press("f")
    seen = np.array([page.shown(110.5 + i, 120.5) for i in range(12)])
    assert ((seen == [255, 0, 255]).all(1)).any()
    assert "4,800 values are not finite" in page.text("#title")
    page.tab.locator("#layers button", has_text="matte").click()
    page.settle()
    assert page.shown(300.5, 100.5) == pytest.approx(encoded([0.25] * 3), abs=1.01)


def test_a_map_from_inside_has_the_direction_under_the_pointer(page: Page):
    page.press("i")
    assert page.view("mode") == "inside"
    box = page.tab.locator("#picture").bounding_box()
    # −Z is in the middle of the view and of the map; +X lies to the right of it in both.
    page.tab.mouse.move(box["x"] + box["width"] / 2 + 0.5, box["y"] + box["height"] / 2 + 0.5)
    page.until(lambda: "320, 160" in page.text("#value"), "the pixel ahead")
    page.tab.mouse.move(box["x"] + box["width"] - 1, box["y"] + box["height"] / 2)
    page.until(lambda: "320, 160" not in page.text("#value"), "the pixel to the right")
    right = np.degrees(np.arctan(box["width"] / box["height"]))
    assert float(page.text("#value").split("° right")[0].split()[-1]) == pytest.approx(right, abs=0.6)
    middle = page.tab.evaluate("() => { const c = relume.canvas; return c.screenAt(c.width / 2, c.height / 2); }")
    assert middle[:3] == pytest.approx(encoded(gradient()[0, 320]), abs=2)


def test_the_palette_finds_a_command_and_keys_alone_are_enough(page: Page):
    page.press("Control+k")
    page.tab.keyboard.type("false col")
    page.tab.keyboard.press("Enter")
    page.settle()
    assert page.view("falseColour") is True
    page.press("?")
    assert page.tab.locator("#sheet").is_visible() and "Half a stop brighter" in page.text("#sheet")
    page.press("Escape", "ArrowDown")
    page.until(lambda: page.text('#files [aria-current="true"]').startswith("b.exr"), "the next picture")
    page.press("Shift+Enter", "ArrowUp")
    page.until(lambda: page.text('#files [aria-current="true"]').startswith("a.exr"), "the picture before")
    assert "reference" in page.text('#files [data-reference="true"]')


def test_a_file_that_changes_is_shown_anew(page: Page, files: list[Path]):
    kept = files[0].read_bytes()
    try:
        rl.write(files[0], rl.RadianceMap(np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)))
        page.until(lambda: page.shown(20.5, 200.5) == pytest.approx(encoded([0.5] * 3), abs=1.01), "the new picture")
    finally:
        files[0].write_bytes(kept)


@pytest.mark.parametrize("shown", ["picture", "wipe", "sheet", "palette"])
def test_axe_finds_nothing_serious(page: Page, shown: str):
    if shown == "wipe":
        page.tab.locator("#files button").nth(1).click(button="right")
        page.press("v")
    elif shown != "picture":
        page.press({"sheet": "?", "palette": "Control+k"}[shown])
    assert serious_faults(page) == []


def test_frames_that_come_slowly_are_rough_while_they_move_and_sharp_after(page: Page):
    page.tab.evaluate(
        "() => { const c = relume.canvas; window.seen = []; const plain = c.drawNow.bind(c);"
        " c.drawNow = (rough) => { plain(rough); seen.push([!!rough, c.canvas.width, c.width, c.toPicture(10, 10)]); };"
        " c.lasting = 200; let n = 0; const step = () => { c.lasting = 200; c.pan(2, 0); if (++n < 6)"
        " requestAnimationFrame(step); }; step(); }"
    )
    page.until(lambda: len(page.tab.evaluate("window.seen")) >= 6, "six frames")
    page.settle()
    seen = page.tab.evaluate("window.seen")
    # Rough frames have a part of the pixels, the last has the screen's own again. The view does not depend on it.
    assert any(rough for rough, *_ in seen) and seen[-1][0] is False
    assert all(own == (-(-width // 2) if rough else width) for rough, own, width, _ in seen), seen
    across = [where[0] for *_, where in seen]
    assert across == sorted(across, reverse=True) and across[0] - across[-1] == pytest.approx(10 / page.view("zoom"))
    # What the screen itself holds then, not what a drawing for the test makes of it.
    shown = page.tab.evaluate(
        "() => { const c = relume.canvas, p = c.toScreen(300.5, 200.5), out = new Uint8Array(4), gl = c.gl;"
        " gl.bindFramebuffer(gl.FRAMEBUFFER, null);"
        " gl.readPixels(Math.floor(p[0]), c.canvas.height - 1 - Math.floor(p[1]), 1, 1, gl.RGBA,"
        " gl.UNSIGNED_BYTE, out);"
        " return Array.from(out).slice(0, 3); }"
    )
    assert shown == pytest.approx(encoded(gradient()[0, 300]), abs=1.01)


def test_a_plain_screen_draws_by_programs_without_the_way_beyond_white(page: Page):
    # A processor that draws by software works out both ways of a choice made while it draws: a third of a frame.
    page.press("v")
    used, *sources, choices = page.tab.evaluate(
        "() => { const c = relume.canvas, { gl, programs } = c; c.drawNow(); const used = [...programs.kept.keys()];"
        " const made = [false, true].map((e) => programs.of('plain', e).program), choices = [];"
        " const count = gl.getProgramParameter(made[0], gl.ACTIVE_UNIFORMS);"
        " for (let i = 0; i < count; i++) choices.push(gl.getActiveUniform(made[0], i));"
        " return [used, ...made.map((p) => gl.getAttachedShaders(p).map((s) => gl.getShaderSource(s)).join('')),"
        " choices.filter((u) => u.type === gl.BOOL).map((u) => u.name)]; }"
    )
    assert sorted(used) == ["plain", "show"]  # what was needed so far; nothing else is compiled
    assert ["#define EXTENDED" in each for each in sources] == [False, True]
    assert choices == ["turned"]  # which the corners ask about, not the pixels


@pytest.mark.parametrize("mode", ["picture", "wipe", "difference", "inside"])
def test_a_rough_frame_shows_what_the_sharp_one_does(page: Page, mode: str):
    page.tab.locator("#files button").nth(1).click(button="right")
    page.settle()
    page.tab.evaluate("(mode) => relume.canvas.set({ mode, wipe: 0.3 })", mode)
    page.settle()
    shown = page.tab.evaluate(
        "() => [false, true].map((rough) => { const c = relume.canvas, gl = c.gl; c.drawNow(rough);"
        " return [0.1, 0.25, 0.35, 0.6, 0.8].map((x) => { const out = new Uint8Array(4);"
        " gl.readPixels(Math.floor(x * c.canvas.width), Math.floor(0.55 * c.canvas.height), 1, 1, gl.RGBA,"
        " gl.UNSIGNED_BYTE, out); return Array.from(out); }); })"
    )
    sharp, rough = np.array(shown)
    # Light doubles in 40 columns: the pixels beside each other, of which a rough frame shows one, are 4 codes apart.
    assert np.abs(sharp - rough).max() <= 6 and np.ptp(sharp[:, 0]) > 60, (sharp, rough)


def test_no_element_lacks_a_name_and_nothing_leaves_a_small_window(page: Page):
    nameless = page.tab.evaluate(
        "() => [...document.querySelectorAll('button, input, [role=slider]')].filter((e) => !(e.textContent.trim() ||"
        " e.getAttribute('aria-label') || e.labels?.length)).map((e) => e.outerHTML)"
    )
    assert nameless == []
    for size in ((1280, 720), (640, 360), (3840, 2160)):
        page.tab.set_viewport_size({"width": size[0], "height": size[1]})
        page.settle()
        across = page.tab.evaluate("() => document.documentElement.scrollWidth - document.documentElement.clientWidth")
        assert across <= 0, size


def test_a_notebook_shows_the_picture_without_a_server(browser: Any, tmp_path: Path):
    shown = rl.show(rl.RadianceMap(gradient(), unit="cd/m²"), stops=0.0, height=400)
    (tmp_path / "notebook.html").write_text(shown.page, encoding="utf-8")
    tab = browser.new_page(viewport={"width": 900, "height": 500})
    try:
        tab.goto((tmp_path / "notebook.html").as_uri())
        page = Page(tab)
        page.settle()
        assert page.shown(300.5, 100.5) == pytest.approx(encoded(gradient()[0, 300]), abs=1.01)
        tab.mouse.move(*page.point_at(480.5, 160.5))
        page.until(lambda: "480, 160: 16 8 4 cd/m²" in page.text("#value"), "the value")
    finally:
        tab.close()
    with pytest.raises(ValueError, match=r"the picture is of shape \(4, 4\); show a radiance map"):
        rl.show(np.zeros((4, 4)))
