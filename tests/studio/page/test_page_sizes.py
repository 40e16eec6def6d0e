"""Both pages on small and large screens and enlarged to 200 %: nothing covers a control, nothing leaves the window."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from browsing import Tab
from serving import Server, serving
from small_shot import write_small_shot

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

WINDOWS = {
    "1280x720": (1280, 720, 1),
    "1280x720 at 200 %": (640, 360, 2),
    "4K": (3840, 2160, 1),
    "4K at 200 %": (1920, 1080, 2),
}
"""What a page is given: width and height in its own pixels, and how many of the screen's each has along its side."""
FAULTS = """() => {
  const faults = [], page = document.documentElement, name = (e) => (e.id || e.getAttribute("aria-label") || e.title
    || e.textContent || "").trim().slice(0, 30) + " <" + e.tagName.toLowerCase() + ">";
  if (page.scrollWidth > page.clientWidth) faults.push("the page scrolls sideways");
  for (const box of document.querySelectorAll("#pane, header, footer, aside, nav")) {
    if (box.scrollWidth > box.clientWidth + 1) faults.push(`${box.id || box.tagName} is wider than its place`);
  }
  const seen = (e) => e.checkVisibility({ visibilityProperty: true }) && !e.disabled;
  const before = document.activeElement;
  for (const each of document.querySelectorAll("button, input, select, summary, a[href], [tabindex]")) {
    if (!seen(each) || each.closest("svg") || each.type === "file") continue;
    // By the keyboard: it takes the focus, and is then in the window.
    each.focus();
    if (document.activeElement !== each || each.tabIndex < 0) faults.push(`${name(each)} takes no focus`);
    const { left, top, right, bottom } = each.getBoundingClientRect();
    if (left < -1 || right > page.clientWidth + 1) faults.push(`${name(each)} leaves the window`);
    // By the pointer: nothing lies over its middle.
    const x = (left + right) / 2, y = (Math.max(top, 0) + Math.min(bottom, innerHeight)) / 2;
    const there = document.elementFromPoint(x, y);
    if (!there || !(each.contains(there) || there.contains(each) && there.matches("label"))) {
      faults.push(`${name(each)} is under ${there ? name(there) : "the window's edge"}`);
    }
  }
  before?.focus?.();
  return faults;
}"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_small_shot(tmp_path_factory.mktemp("sizes")).parent


@pytest.fixture(scope="module")
def unlooked(folder: Path) -> Iterator[Server]:
    """A studio that knows nothing of the light yet: balls of materials, once made, are one stop of Tab together."""
    with serving([folder / "shot.toml"], "studio") as running:
        yield running


@pytest.fixture(scope="module")
def viewer(folder: Path) -> Iterator[Server]:
    with serving([folder / "plate.exr", folder / "light.exr"]) as running:
        yield running


@contextmanager
def window(browser: Any, server: Server, size: str) -> Iterator[Tab]:
    width, height, density = WINDOWS[size]
    context = browser.new_context(viewport={"width": width, "height": height}, device_scale_factor=density)
    tab = Tab(context.new_page())
    tab.tab.set_default_timeout(120_000)
    try:
        tab.tab.goto(server.address)
        tab.settle()
        yield tab
    finally:
        context.close()


def faults(page: Tab) -> list[str]:
    return page.tab.evaluate(FAULTS)


@pytest.mark.parametrize("size", WINDOWS)
def test_every_pane_of_the_studio_is_whole_and_reached(browser: Any, unlooked: Server, size: str):
    with window(browser, unlooked, size) as page:
        found = {}
        for step in range(page.tab.evaluate("() => relume.studio.panes.length")):
            page.tab.evaluate("(step) => relume.studio.go(step)", step)
            page.settle()
            page.tab.evaluate("() => document.querySelectorAll('#pane details').forEach((each) => (each.open = true))")
            found[page.tab.evaluate("() => relume.studio.panes[relume.studio.step].name")] = faults(page)
        assert {name: each for name, each in found.items() if each} == {}
        # The picture keeps a place worth the name, with a pixel for each of the screen's.
        box, density = page.tab.locator("#picture").bounding_box(), WINDOWS[size][2]
        assert box["width"] > 300 and box["height"] > 180
        page.tab.evaluate("() => relume.canvas.drawNow()")
        drawn = page.tab.evaluate("() => [relume.canvas.canvas.width, relume.canvas.canvas.height]")
        assert drawn == pytest.approx([box["width"] * density, box["height"] * density], abs=1.01)


@pytest.mark.parametrize("size", WINDOWS)
def test_the_viewer_is_whole_and_reached(browser: Any, viewer: Server, size: str):
    with window(browser, viewer, size) as page:
        assert faults(page) == []
        for key in ("?", "Control+k"):
            page.press(key)
            box = page.tab.locator("dialog[open]").bounding_box()
            assert box["x"] >= 0 and box["x"] + box["width"] <= WINDOWS[size][0]
            assert box["y"] >= 0 and box["y"] + box["height"] <= WINDOWS[size][1]
            page.press("Escape")


def test_tab_goes_through_all_controls_of_a_pane_at_200_per_cent(browser: Any, unlooked: Server):
    with window(browser, unlooked, "1280x720 at 200 %") as page:
        page.press("Alt+8")
        wanted = page.tab.evaluate(
            "() => { const found = [...document.querySelectorAll('button, input, select, summary, a[href], canvas')]"
            ".filter((e) => e.checkVisibility({ visibilityProperty: true }) && !e.disabled && e.tabIndex >= 0);"
            " found.forEach((e, i) => (e.dataset.wanted = String(i))); document.body.focus(); return found.length; }"
        )
        assert wanted >= 20
        seen = set()
        for _ in range(wanted + 5):
            page.tab.keyboard.press("Tab")
            at, top, bottom = page.tab.evaluate(
                "() => { const e = document.activeElement, b = e.getBoundingClientRect();"
                " return [e.dataset?.wanted ?? null, b.top, b.bottom]; }"
            )
            if at is not None:
                seen.add(int(at))
                assert bottom > 0 and top < 360  # what has the focus is seen
        unseen = page.tab.evaluate(
            "(seen) => [...document.querySelectorAll('[data-wanted]')].filter((e) => !seen.includes(Number(e.dataset"
            ".wanted))).map((e) => e.outerHTML)",
            sorted(seen),
        )
        assert unseen == []
