"""A page of ours in a real browser, for tests: waiting without sleeping, and the pixels and points it shows."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# A processor that draws by software need not draw buttons by the graphics card's ways too, only what the pages ask for.
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing"]
FLAGS += ["--no-sandbox", "--disable-background-networking"]
# Our pages ask for a process of their own (Cross-Origin-Opener-Policy): begun for each test, it takes as long as the
# page itself. Every page here is ours and may have the process of the one before.
FLAGS += ["--renderer-process-limit=1", "--disable-site-isolation-trials"]
# A processor draws what the window shows: 720 pixels high, that is a third of the browser's time. As wide as it was: at
# other widths places have broken pixels, by which the page's numbers and the window's differ by a tenth.
WINDOW = {"width": 1280, "height": 480}


class Tab:
    """A tab with what tests do in it."""

    def __init__(self, tab: Any) -> None:
        self.tab = tab

    def until(self, holds: Callable[[], Any], what: str, seconds: float = 180) -> None:
        # The page's own rules forbid to evaluate texts, by which Playwright waits: it is asked again and again.
        # To ask takes the processor from what is waited for: the longer that takes, the rarer.
        end, wait = time.monotonic() + seconds, 0.01
        while not holds():
            assert time.monotonic() < end, f"never came: {what}; {self.text('#message')}"
            time.sleep(wait)
            wait = min(1.3 * wait, 0.25)

    def settle(self) -> None:
        self.until(lambda: self.tab.evaluate("!!window.relume?.settled()"), "the picture")

    def press(self, *keys: str) -> None:
        for key in keys:
            self.tab.keyboard.press(key)
        self.settle()

    def text(self, selector: str) -> str:
        return self.tab.locator(selector).first.inner_text()

    def click(self, selector: str) -> None:
        self.tab.locator(selector).first.click()
        self.settle()

    def point_at(self, x: float, y: float) -> tuple[float, float]:
        """Where in the window a pixel of the picture lies."""
        return tuple(
            self.tab.evaluate(
                "([x, y]) => { const c = relume.canvas, p = c.toScreen(x, y), b = c.canvas.getBoundingClientRect();"
                "const d = c.width / b.width; return [b.left + p[0] / d, b.top + p[1] / d]; }", [x, y],
            )
        )  # fmt: skip

    def shown(self, x: float, y: float) -> list[int]:
        """The screen's red, green and blue at a pixel of the picture."""
        return self.tab.evaluate(
            "([x, y]) => { const c = relume.canvas, p = c.toScreen(x, y); return c.screenAt(p[0], p[1]); }", [x, y]
        )[:3]

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """From one pixel of the picture to another."""
        (x, y), (a, b) = self.point_at(*start), self.point_at(*end)
        self.tab.mouse.move(x, y)
        self.tab.mouse.down()
        self.tab.mouse.move((x + a) / 2, (y + b) / 2)
        self.tab.mouse.move(a, b)
        self.tab.mouse.up()
        self.settle()


class Page(Tab):
    """The page of `relume view`."""

    def picture_at(self, x: float, y: float) -> list[float]:
        """The point of the picture that lies in the window at (x, y)."""
        return self.tab.evaluate(
            "([x, y]) => { const c = relume.canvas, b = c.canvas.getBoundingClientRect(), d = c.width / b.width;"
            "return c.toPicture((x - b.left) * d, (y - b.top) * d); }", [x, y],
        )  # fmt: skip

    def view(self, name: str) -> Any:
        return self.tab.evaluate("(name) => relume.canvas.view[name]", name)


T = TypeVar("T", bound=Tab)


def encoded(linear: np.ndarray | list[float]) -> np.ndarray:
    """sRGB's codes of linear values, 0 to 255."""
    v = np.clip(np.asarray(linear, np.float64), 0, 1)
    return 255 * np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


@contextmanager
def opened(browser: Any, address: str, kind: type[T] = Tab, *, refusals: bool = False) -> Iterator[T]:
    """A page of an address, loaded anew; what it says on its console is a failure.

    refusals : whether the server may refuse something, which the browser notes too
    """
    said: list[str] = []

    def failed(error: Any) -> None:
        said.append(str(error))

    def wrote(message: Any) -> None:
        if message.type == "error" and not (refusals and "the server responded with a status of 4" in message.text):
            said.append(message.text)

    tab = _spare_tab(browser)
    tab.on("pageerror", failed)
    tab.on("console", wrote)
    tab.goto(address)
    result = kind(tab)
    result.settle()
    yield result
    tab.goto("about:blank")
    tab.remove_listener("pageerror", failed)
    tab.remove_listener("console", wrote)
    assert not said, said


def _spare_tab(browser: Any) -> Any:
    """An empty tab: one that is done with, or a new one. A new one takes longer to begin than our pages to load."""
    for context in browser.contexts:
        (tab,) = context.pages
        if tab.url == "about:blank":
            break
    else:
        context = browser.new_context()
        tab = context.new_page()
        tab.set_default_timeout(120_000)  # machines may be busy
    context.clear_cookies()
    # Whatever the test before left: held keys and buttons, where the pointer was, the window's size.
    for key in ("Shift", "Control", "Alt", "Meta"):
        tab.keyboard.up(key)
    tab.mouse.up()
    tab.mouse.move(0, 0)
    tab.set_viewport_size(WINDOW)
    return tab
