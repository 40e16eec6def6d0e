"""Two pictures side by side, the error of each pixel over them, and numbers in enlarged pixels: by pixels read back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Page, Tab, encoded, opened
from one_studio import OneStudio
from serving import Server, serving
from studio_page import done

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

WIDTH, HEIGHT = 256, 128
ERRORS = (0.001, 0.0316, 1.0, 0.0)
"""Of the four quarters of the picture, relative: the ends of the scale, its middle, and none."""
VIRIDIS = {0.001: (68, 1, 84), 0.0316: (35, 144, 140), 1.0: (253, 231, 37)}


def gradient(factor: float = 1.0) -> np.ndarray:
    """Light that doubles every 32 columns; green and blue are a half and a quarter of red."""
    red = np.exp2(np.arange(WIDTH) / 32 - 6)[None, :, None] * np.ones((HEIGHT, 1, 1))
    return (factor * red * np.array([1.0, 0.5, 0.25])).astype(np.float32)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("overlays")
    share = np.repeat(np.array(ERRORS, np.float32), WIDTH // 4)[None, :, None]
    variance = (share * gradient()) ** 2
    variance[:32, : WIDTH // 4] = np.inf  # what no photograph measured
    rl.write(folder / "a.exr", rl.RadianceMap(gradient(), variance))
    # The same at half its size, twice as bright.
    rl.write(folder / "b.exr", rl.RadianceMap(gradient(2.0)[::2, ::2]))
    with serving([folder / "a.exr", folder / "b.exr"]) as running:
        yield running


@pytest.fixture
def page(browser: Any, server: Server) -> Iterator[Page]:
    with opened(browser, server.address, Page, refusals=True) as result:  # sizes that differ are not subtracted
        result.press("r", "f")
        yield result


@pytest.fixture
def beside(page: Page) -> Page:
    page.tab.locator("#files button").nth(1).click(button="right")
    page.until(lambda: page.view("mode") == "wipe", "the reference")
    page.press("b")
    page.until(lambda: page.view("mode") == "beside", "both")
    page.press("f")
    return page


def screen_at(page: Tab, side: int, x: float, y: float) -> tuple[float, float]:
    """Where in the window a point of the picture lies, to the left (0) or to the right (1)."""
    return tuple(
        page.tab.evaluate(
            "([side, x, y]) => { const c = relume.canvas, p = c.toScreen(x, y), b = c.canvas.getBoundingClientRect();"
            "const d = c.width / b.width; return [b.left + (p[0] + side * c.right) / d, b.top + p[1] / d]; }",
            [side, x, y],
        )
    )  # fmt: skip


def shown(page: Tab, side: int, x: float, y: float) -> list[int]:
    return page.tab.evaluate(
        "([side, x, y]) => { const c = relume.canvas, p = c.toScreen(x, y);"
        " return c.screenAt(p[0] + side * c.right, p[1]); }",
        [side, x, y],
    )[:3]


def printed(page: Tab, side: int) -> int:
    """How many pixels of a half hold a part of a number."""
    return page.tab.evaluate(
        "(side) => { const n = document.getElementById('numbers'), c = relume.canvas; if (n.hidden) return 0;"
        " const d = n.getContext('2d').getImageData(side * c.right, 0, c.across, n.height).data;"
        " return d.reduce((count, v) => count + (v > 0 ? 1 : 0), 0); }",
        side,
    )


def test_two_pictures_side_by_side_show_one_place_and_one_exposure(beside: Page):
    assert beside.view("mode") == "beside"
    for keys, stops in (((), 0.0), (("e", "e"), 1.0)):
        beside.press(*keys)
        for x in (40, 100, 200):
            one = encoded(gradient()[0, x] * 2**stops)
            other = encoded(gradient(2.0)[0, x - x % 2] * 2**stops)  # of half the size, drawn as large
            assert shown(beside, 0, x + 0.5, 60.5) == pytest.approx(one, abs=1.01)
            assert shown(beside, 1, x + 0.5, 60.5) == pytest.approx(other, abs=1.01)
    # The whole of both is seen, each in its half.
    assert screen_at(beside, 0, WIDTH, 0)[0] <= screen_at(beside, 1, 0, 0)[0]


def test_what_moves_the_one_moves_the_other_and_the_point_under_the_pointer_stays(beside: Page):
    for side in (0, 1):
        x, y = (round(each) for each in screen_at(beside, side, 100, 60))
        held = beside.picture_at(x, y)
        assert held == pytest.approx([100, 60], abs=1)
        beside.tab.mouse.move(x, y)
        beside.tab.mouse.wheel(0, -400)
        beside.settle()
        assert beside.picture_at(x, y) == pytest.approx(held, abs=0.01)
        beside.tab.mouse.down()
        beside.tab.mouse.move(x + 31, y + 17, steps=3)
        beside.tab.mouse.up()
        beside.settle()
        assert beside.picture_at(x + 31, y + 17) == pytest.approx(held, abs=0.01)
        # In both halves the same place.
        assert shown(beside, 0, 100.5, 60.5) == pytest.approx(encoded(gradient()[0, 100]), abs=1.01)
        assert shown(beside, 1, 100.5, 60.5) == pytest.approx(encoded(gradient(2.0)[0, 100]), abs=1.01)
        beside.press("f")


def test_the_pointer_reads_both_and_a_cross_stands_at_the_same_place_of_the_other(beside: Page):
    beside.tab.mouse.move(*screen_at(beside, 1, 100.5, 60.5))
    beside.until(lambda: "100, 60" in beside.text("#value") and "+1.00 stops" in beside.text("#value"), "both")
    cross = beside.tab.locator("#twin").bounding_box()
    middle = [cross["x"] + cross["width"] / 2, cross["y"] + cross["height"] / 2]
    assert middle == pytest.approx(screen_at(beside, 0, 100.5, 60.5), abs=1.5)
    beside.press("b")
    assert beside.view("mode") == "picture" and beside.tab.locator("#twin").is_hidden()


def test_enlarged_pixels_of_both_print_their_own_numbers(beside: Page):
    beside.tab.mouse.move(*screen_at(beside, 0, 100.5, 60.5))
    for _ in range(6):
        beside.tab.mouse.wheel(0, -200)
    beside.settle()
    assert beside.view("zoom") >= 56
    beside.until(lambda: printed(beside, 0) > 100 and printed(beside, 1) > 100, "numbers in both")
    beside.press("f")
    assert printed(beside, 0) == printed(beside, 1) == 0


def test_the_error_of_each_pixel_lies_over_the_picture_in_the_scales_colours(page: Page):
    page.press("u")
    assert page.view("errors") is True
    for quarter, error in enumerate(ERRORS):
        x = quarter * WIDTH // 4 + 20
        grey = np.round(encoded(gradient()[0, x])) @ [0.2126, 0.7152, 0.0722]
        expected = 0.3 * grey + 0.7 * np.array(VIRIDIS[error]) if error else np.array([grey] * 3)
        assert page.shown(x + 0.5, 100.5) == pytest.approx(expected, abs=3)
    # What was not measured is hatched, whatever its value.
    unknown = np.array([page.shown(20.5 + i, 10.5) for i in range(12)])
    assert {round(float(each), -1) for each in unknown.ravel()} == {30, 140}
    assert page.text("#legend").split("\n")[0] == "error 0.1 %" and "100 %" in page.text("#legend")
    # The picture's own numbers stay, and false colour takes its place.
    page.tab.mouse.move(*page.point_at(20.5, 100.5))
    page.until(lambda: "± σ" in page.text("#value"), "the value with its error")
    page.press("v")
    assert page.view("errors") is False and page.view("falseColour") is True
    page.press("v", "u", "u")
    assert page.view("errors") is False and page.tab.locator("#legend").is_hidden()


def test_a_picture_without_errors_says_so_in_one_line(page: Page):
    page.press("ArrowDown")
    page.until(lambda: page.text('#files [aria-current="true"]').startswith("b.exr"), "the next picture")
    page.press("u")
    page.until(lambda: "does not say how uncertain" in page.text("#message"), "the line")
    assert page.view("errors") is False


def test_the_studio_compares_side_by_side_shows_errors_and_prints_numbers(
    browser: Any, studio: OneStudio
):  # fmt: skip
    folder, server = studio.folder, studio.server
    with opened(browser, f"{server.address}#deliver", refusals=True) as page:
        page.press("b")
        page.until(lambda: "no picture to compare yet" in page.text("#message"), "the line")
        server.post("/jobs/start", {"kind": "insert"})
        done(page, server, "insert")
        page.press("b")
        page.until(lambda: page.tab.evaluate("() => relume.canvas.view.mode") == "beside", "both")
        page.press("f")
        made = rl.read_radiance(folder / "out" / "composite.exr").radiance
        plate = rl.read_radiance(folder / "plate.exr").radiance
        gain, stops = page.tab.evaluate("() => [relume.canvas.view.gain, relume.canvas.view.stops]")
        for side, pixels in ((0, made), (1, gain * plate)):
            for x, y in ((10, 10), (96, 60), (150, 100)):
                assert shown(page, side, x + 0.5, y + 0.5) == pytest.approx(encoded(2**stops * pixels[y, x]), abs=1.01)
        page.tab.mouse.move(*screen_at(page, 1, 10.5, 10.5))
        # At a place that nothing changes both are as bright as each other, as they are shown.
        said = (
            2**stops * made[10, 10] @ [0.2126, 0.7152, 0.0722],
            2**stops * gain * plate[10, 10] @ [0.2126, 0.7152, 0.0722],
        )
        words = f"{abs(np.log2(said[1] / said[0])):.2f} stops"
        page.until(lambda: "|" in page.text("#value") and words in page.text("#value"), "both values")
        # Numbers in enlarged pixels, of the file itself.
        page.tab.mouse.move(*screen_at(page, 0, 96.5, 60.5))
        for _ in range(6):
            page.tab.mouse.wheel(0, -200)
        page.settle()
        page.until(lambda: printed(page, 0) > 100 and printed(page, 1) > 100, "numbers in both")
        page.press("b", "f", "u")
        # The render's errors: none where the objects change nothing, and some on the ball.
        assert page.tab.evaluate("() => relume.canvas.view.errors") and page.tab.locator("#legend").is_visible()
        with_ball = rl.files.read_layers(folder / "out" / "layers.exr")["variance"]
        assert with_ball[5, 5].max() == 0 and with_ball[60, 96].max() > 0
        colours = page.tab.evaluate("() => [[5.5, 5.5], [96.5, 60.5]].map(([x, y]) => { const c = relume.canvas;"
                                    " return c.screenAt(...c.toScreen(x, y)).slice(0, 3); })")  # fmt: skip
        assert np.ptp(colours[0]) <= 1 and np.ptp(colours[1]) > 20
        assert "U ends it" in page.text("#message")
        page.press("u")
        assert page.tab.locator("#legend").is_hidden() and page.text("#message") == ""
