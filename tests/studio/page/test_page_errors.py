"""The errors of a render, which stand in a file of their own: of the picture that is shown, and as they are now."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Tab, encoded, opened
from one_studio import OneStudio

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

VIRIDIS = {0.0316: (35, 144, 140), 1.0: (253, 231, 37)}
HOLD = """() => {
  const plain = window.fetch;
  window.fetch = async (address, given) => {
    if (address === "/opened" && given.body.includes("layers.exr")) await new Promise((go) => (window.release = go));
    return plain(address, given);
  };
}"""


def write_composite(folder: Path, value: float) -> None:
    rl.write(folder / "out/composite.exr", rl.RadianceMap(np.full((128, 192, 3), value, np.float32)))


def write_layers(folder: Path, value: float, error: float) -> None:
    made = np.full((128, 192, 3), value, np.float32)
    rl.files.write_layers(folder / "out/layers.exr", {"with": made, "variance": (error * made) ** 2})


@pytest.fixture
def folder(studio: OneStudio) -> Path:
    studio.as_begun()
    folder = studio.folder
    (folder / "out").mkdir(exist_ok=True)
    write_composite(folder, 0.2)
    write_layers(folder, 0.2, 0.0316)
    return folder


@pytest.fixture
def page(browser: Any, folder: Path, studio: OneStudio) -> Iterator[Tab]:
    with opened(browser, f"{studio.server.address}#deliver", refusals=True) as tab:
        tab.tab.evaluate("() => relume.studio.show('composite.exr', 'results')")
        tab.settle()
        assert tab.tab.evaluate("() => relume.studio.shownPath") == "composite.exr"
        tab.press("r", "f")
        yield tab


def is_drawn(page: Tab, value: float, error: float) -> bool:
    """Whether a pixel is drawn as one of that value and error."""
    expected = 0.3 * encoded([value])[0] + 0.7 * np.array(VIRIDIS[error])
    return bool(np.abs(np.array(page.shown(96.5, 60.5)) - expected).max() <= 3)


def test_errors_that_come_late_are_not_drawn_over_another_picture(page: Tab):
    page.tab.evaluate(HOLD)
    page.tab.keyboard.press("u")
    page.until(lambda: page.tab.evaluate("() => !!window.release"), "the request")
    page.tab.evaluate("() => { relume.studio.show('plate.exr'); }")
    page.until(lambda: page.tab.evaluate("() => relume.studio.shownPath") == "plate.exr", "the plate")
    page.tab.evaluate("() => window.release()")
    page.settle()
    assert not page.tab.evaluate("() => relume.canvas.view.errors")
    assert "the error" not in page.text("#message")


def test_errors_follow_a_new_render_which_writes_them_after_the_composite(page: Tab, folder: Path):
    page.press("u")
    page.until(lambda: is_drawn(page, 0.2, 0.0316), "the errors")
    write_composite(folder, 0.4)
    page.until(lambda: is_drawn(page, 0.4, 0.0316), "the new composite")
    write_layers(folder, 0.4, 1.0)
    page.until(lambda: is_drawn(page, 0.4, 1.0), "the new errors", seconds=20)
    page.press("u")
    assert not page.tab.evaluate("() => relume.canvas.view.errors")
