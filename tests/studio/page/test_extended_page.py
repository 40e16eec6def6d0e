"""True HDR in the page: who gets the switch, what goes to the screen beyond white, and that nothing else changes."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import CHROMIUM, FLAGS, Page, Tab, opened
from serving import Server, serving

pytest.importorskip("uvicorn", reason="the extra studio is not installed")

# WebGPU by software, and a screen that says it shows more than white: a headless browser has neither by itself.
WEBGPU = [
    *("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--use-vulkan=swiftshader"),
    *("--enable-features=Vulkan", "--disable-vulkan-surface"),
]
BRIGHT_SCREEN = """
const asked = window.matchMedia.bind(window);
window.matchMedia = (query) => {
  const found = asked(query);
  if (!query.includes("dynamic-range")) return found;
  window.screenChanged ??= new EventTarget();
  const proxy = { get matches() { return window.bright !== false; },
    addEventListener: (name, act) => window.screenChanged.addEventListener(name, act) };
  return proxy;
};
"""
VALUES = [0.25, 1.0, 2.0, 12.0]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder: Path = tmp_path_factory.mktemp("extended")
    picture = np.repeat(np.array(VALUES, np.float32), 16)[None, :, None] * np.ones((32, 1, 3), np.float32)
    picture[:16] *= [1, 0.5, 0.25]  # the upper half has a colour
    rl.write(folder / "steps.exr", rl.RadianceMap(picture))
    with serving([folder / "steps.exr"]) as running:
        yield running


@pytest.fixture(scope="module")
def bright(browser: Any) -> Iterator[Any]:
    """A browser with WebGPU and such a screen; skipped where Chromium has no WebGPU even by software."""
    running = browser.browser_type.launch(executable_path=CHROMIUM, args=[*FLAGS, *WEBGPU])
    context = running.new_context()
    context.add_init_script(BRIGHT_SCREEN)
    context.new_page().set_default_timeout(120_000)
    yield running
    running.close()


@pytest.fixture
def page(bright: Any, server: Server) -> Iterator[Page]:
    with opened(bright, server.address, Page) as tab:
        if not tab.tab.evaluate("async () => Boolean(await navigator.gpu?.requestAdapter())"):
            pytest.skip("this Chromium gives no WebGPU adapter, not even by software")
        tab.press("r", "f")
        yield tab


def switch(page: Tab) -> Any:
    return page.tab.locator("#hdr")


def handed_over(page: Tab) -> np.ndarray:
    """What the screen's texture holds, (H, W, 4), the highest row first: copied to a buffer and read back."""
    rows = page.tab.evaluate(
        """async () => {
          const { screen } = relume.canvas, { device, context, shown } = screen, { width, height } = shown;
          relume.canvas.drawNow();
          const row = Math.ceil(width * 8 / 256) * 256;
          const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ, texture = context.getCurrentTexture();
          const buffer = device.createBuffer({ size: row * height, usage });
          const encoder = device.createCommandEncoder();
          encoder.copyTextureToBuffer({ texture }, { buffer, bytesPerRow: row }, [width, height]);
          device.queue.submit([encoder.finish()]);
          await buffer.mapAsync(GPUMapMode.READ);
          const found = new Uint8Array(buffer.getMappedRange()), rows = [];
          const step = Math.max(1, Math.floor(height / 64));
          for (let y = 0; y < height; y += step)
            rows.push(btoa(String.fromCharCode(...found.subarray(y * row, y * row + 8 * width))));
          return rows;
        }"""
    )
    bytes_of = b"".join(base64.b64decode(each) for each in rows)
    return np.frombuffer(bytes_of, np.float16).astype(np.float32).reshape(len(rows), -1, 4)


def decoded(codes: np.ndarray) -> np.ndarray:
    """Linear light of extended sRGB."""
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def test_light_beyond_white_goes_to_the_screen_as_bright_as_it_is(page: Page):
    switch(page).click()
    page.until(lambda: switch(page).get_attribute("aria-pressed") == "true", "the HDR canvas")
    page.settle()
    shown = decoded(handed_over(page))
    height, width = shown.shape[:2]
    for i, value in enumerate(VALUES):
        x = int((i + 0.5) / len(VALUES) * width)
        lower, upper = shown[int(0.62 * height), x, :3], shown[int(0.38 * height), x, :3]
        np.testing.assert_allclose(lower, value, rtol=0.01)
        np.testing.assert_allclose(upper, value * np.array([1, 0.5, 0.25]), rtol=0.01)
    # Exposure is followed.
    page.press("e", "e")
    brighter = decoded(handed_over(page))[int(0.62 * height), int(0.875 * width), :3]
    np.testing.assert_allclose(brighter, 24.0, rtol=0.01)
    assert page.tab.locator("canvas.extended").count() == 1
    page.press("h")
    assert page.tab.locator("canvas.extended").count() == 0
    assert switch(page).get_attribute("aria-pressed") == "false"


def test_the_other_canvas_and_the_numbers_stay_as_they_are(page: Page):
    points = [(8, 4), (24, 20), (40, 4), (56, 28)]
    before = [page.shown(*each) for each in points]
    switch(page).click()
    page.until(lambda: switch(page).get_attribute("aria-pressed") == "true", "the HDR canvas")
    assert [page.shown(*each) for each in points] == before
    page.tab.mouse.move(*page.point_at(56.5, 20.5))
    page.until(lambda: "12" in page.text("#value"), "the pixel")


def test_up_to_white_both_canvases_hold_the_same_frame(page: Page):
    switch(page).click()
    page.until(lambda: switch(page).get_attribute("aria-pressed") == "true", "the HDR canvas")
    page.settle()
    floats = handed_over(page)
    step = max(1, int(page.tab.evaluate("() => relume.canvas.height")) // 64)
    points = [(x, row) for row in range(2, len(floats), 7) for x in range(5, floats.shape[1], 90)]
    codes = page.tab.evaluate(
        "(points) => { const c = relume.canvas, { gl } = c; c.drawNow(); return points.map(([x, y]) => {"
        " const found = new Uint8Array(4);"
        " gl.readPixels(x, c.height - 1 - y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, found); return [...found]; }); }",
        [(x, row * step) for x, row in points],
    )
    for (x, row), code in zip(points, codes, strict=True):
        np.testing.assert_allclose(255 * np.minimum(floats[row, x], 1), code, atol=0.7)


def test_a_window_that_is_moved_to_a_plain_screen_goes_on_without(page: Page):
    switch(page).click()
    page.until(lambda: page.tab.locator("canvas.extended").count() == 1, "the HDR canvas")
    page.tab.evaluate("() => { window.bright = false; window.screenChanged.dispatchEvent(new Event('change')); }")
    page.settle()
    assert page.tab.locator("canvas.extended").count() == 0 and switch(page).is_hidden()


def test_a_card_that_gives_no_webgpu_is_one_line_and_the_picture_stays(page: Page):
    before = page.shown(24, 20)
    page.tab.evaluate("() => { GPU.prototype.requestAdapter = async () => null; }")
    switch(page).click()
    page.until(lambda: "no WebGPU" in page.text("#message"), "the line")
    assert page.shown(24, 20) == before and page.tab.locator("canvas.extended").count() == 0


def test_a_browser_that_ends_its_pictures_at_white_is_one_line(page: Page):
    page.tab.evaluate("() => { GPUCanvasContext.prototype.getConfiguration = () => ({}); }")
    switch(page).click()
    page.until(lambda: "ends its pictures at white" in page.text("#message"), "the line")
    assert page.tab.locator("canvas.extended").count() == 0


@pytest.mark.parametrize("gpu, high, expected", [(True, True, True), (True, False, False), (False, True, False)])
def test_the_switch_is_there_where_screen_and_browser_can(
    browser: Any, server: Server, gpu: bool, high: bool, expected: bool
):
    with opened(browser, server.address, Page) as plain:
        found = plain.tab.evaluate(
            "async ([gpu, high]) => (await import('/page/extended.js')).canExtend("
            "{ navigator: { gpu: gpu ? {} : undefined }, matchMedia: () => ({ matches: high }) })",
            [gpu, high],
        )
        assert found is expected
        # This browser has no such screen: no switch, and its key says why.
        assert switch(plain).is_hidden()
        plain.press("h")
        assert "nothing beyond white" in plain.text("#message")
