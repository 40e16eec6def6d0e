"""Several views of the ball side by side: each has its own rim, and what each gave of the map is shown."""

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
from one_studio import OneStudio
from studio_page import serious_faults

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

ROOM = Path(__file__).resolve().parents[2] / "examples" / "room"
TEXT = """\
[plate]
photographs = ["plate/*.jpg"]

[camera]
grid = { photograph = "plate_grid.jpg", squares = [9, 6], square = 0.03 }

[light]
balls = [
    { photographs = ["ball_0/*.jpg"], camera = [0.0, 0.17, 1.0] },   # the window's side
    { photographs = ["ball_90/*.jpg"], camera = [1.0, 0.17, 0.0], rim = [320, 320, 295] },
]
ball = { centre = [0.0, 0.05, 0.0], radius = 0.05 }
"""


@pytest.fixture
def room(studio: OneStudio) -> Path:
    studio.as_begun()
    folder = studio.folder
    for name, frames in (("plate", (2, 3)), ("ball_0", (5, 7)), ("ball_90", (5, 7))):
        (folder / name).mkdir()
        for number in frames:
            shutil.copy(ROOM / name / f"IMG_{number:04d}.jpg", folder / name)
    shutil.copy(ROOM / "plate_grid.jpg", folder)
    (folder / "shot.toml").write_text(TEXT, encoding="utf-8")
    return folder


@pytest.fixture
def page(browser: Any, room: Path, studio: OneStudio) -> Iterator[Tab]:
    with opened(browser, studio.server.address, refusals=True) as tab:
        tab.press("Alt+3")
        yield tab


def balls(folder: Path) -> list[dict[str, Any]]:
    return tomllib.loads((folder / "shot.toml").read_text(encoding="utf-8"))["light"]["balls"]


def said(page: Tab, view: int) -> str:
    return page.text(f'#views figure[data-view="{view}"] figcaption')


def middle(page: Tab, view: int, key: str = "middle") -> tuple[float, float]:
    """Where in the window a handle of a view is."""
    box = page.tab.locator(f'#views figure[data-view="{view}"] circle[data-handle="{key}"]').bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_views_stand_side_by_side_and_picking_in_one_leaves_the_other(page: Tab, room: Path):
    page.click('button:text-is("Side by side")')
    page.until(lambda: "an edge was seen" in said(page, 0), "the rim of the first")
    page.until(lambda: "rim 320.0, 320.0, 295.0" in said(page, 1), "the rim of the second")
    found = [float(each) for each in said(page, 0).split("rim ")[1].split(";")[0].split(",")]
    assert found == pytest.approx([320, 320, 295.5], abs=1.0)
    other = said(page, 1)
    # Kept, then dragged: the first view's alone.
    page.click('#views figure[data-view="0"] figcaption')
    page.click('button:text-is("Keep it")')
    page.until(lambda: "pick" in balls(room)[0], "the pick")
    before = balls(room)[0]["pick"]
    scale = page.tab.evaluate(
        "() => { const r = (k) => document.querySelector(`#views figure[data-view='0'] circle[data-handle=${k}]`);"
        "return Number(r('right').getAttribute('cx')) - Number(r('middle').getAttribute('cx')); }"
    ) / before[2]  # fmt: skip
    x, y = middle(page, 0)
    page.tab.mouse.move(x, y)
    page.tab.mouse.down()
    page.tab.mouse.move(x + 20, y + 8)
    page.tab.mouse.up()
    page.until(lambda: balls(room)[0]["pick"] != before, "the edit")
    moved = np.subtract(balls(room)[0]["pick"], before)
    assert moved == pytest.approx([20 / scale, 8 / scale, 0], abs=0.05)
    assert balls(room)[1] == {
        "photographs": ["ball_90/*.jpg"], "camera": [1.0, 0.17, 0.0], "rim": [320, 320, 295],
    }  # fmt: skip
    assert said(page, 1) == other
    # The second is chosen by touching it, and its rim moved by an arrow key; the first stays where it was put.
    first = balls(room)[0]
    page.tab.locator('#views figure[data-view="1"] circle[data-handle="right"]').focus()
    page.until(lambda: "Rim in view 2" in page.tab.locator("#pane").inner_html(), "the second view")
    page.press("ArrowRight")
    page.until(lambda: balls(room)[1]["rim"][2] == pytest.approx(296, abs=0.02), "its rim")
    assert balls(room)[0] == first
    assert "# the window's side" in (room / "shot.toml").read_text(encoding="utf-8")
    page.press(*["Control+z"] * 3)
    page.until(lambda: (room / "shot.toml").read_text(encoding="utf-8") == TEXT, "all undone")
    page.until(lambda: "rim 320.0, 320.0, 295.0" in said(page, 1), "the rim as it was")
    # One of them alone again, on the large picture.
    page.click('button:text-is("View 2")')
    page.until(lambda: page.text("#caption").startswith("ball_90/"), "the second's photograph")
    assert page.tab.locator("#views").is_hidden()
    page.until(lambda: page.tab.locator("#overlay circle[data-handle]").count() == 5, "its handles")


def test_axe_finds_nothing_serious_in_views_side_by_side(page: Tab):
    page.click('button:text-is("Side by side")')
    page.until(lambda: page.tab.locator("#views circle[data-handle]").count() == 10, "the handles of both")
    assert serious_faults(page) == []


def test_what_each_view_gave_of_the_map_is_counted_and_coloured(tmp_path: Path):
    from relume.studio.shots.measured import COLOURS, view_facts

    # The first view gives the left half, the second the right; all light is to the right.
    shares = np.zeros((2, 96, 192), np.float32)
    shares[0, :, :96] = shares[1, :, 96:] = 1
    shares[:, :8] = 0
    light = np.zeros((128, 256, 3), np.float32)
    light[:, 128:] = 1
    probe = rl.probe.Probe(rl.EnvironmentMap(light), (), 0.0, 0.0, np.ones((128, 256), np.float32), shares=shares)
    first, second = view_facts(probe, tmp_path / "views.exr")
    seen = (1 + np.cos(np.pi * 8 / 96)) / 2
    assert first == {"directions": pytest.approx(seen / 2, abs=1e-6), "light": pytest.approx(0, abs=0.02)}
    assert second == {"directions": pytest.approx(seen / 2, abs=1e-6), "light": pytest.approx(seen, abs=0.02)}
    drawn = rl.read_radiance(tmp_path / "views.exr").radiance
    codes = np.array([[int(colour[i : i + 2], 16) for i in (0, 2, 4)] for colour in COLOURS[:2]]) / 255
    linear = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
    rows = len(drawn)
    for column, colour in ((rows // 2, linear[0]), (3 * rows // 2, linear[1])):
        pixel = drawn[rows // 2, column]
        np.testing.assert_allclose(pixel / pixel.sum(), colour / colour.sum(), atol=2e-3)
    assert (drawn[0] == 0).all()
    # One view alone gave all: nothing is to be said.
    from dataclasses import replace

    assert view_facts(replace(probe, shares=shares[:1]), tmp_path / "one.exr") == []
    assert not (tmp_path / "one.exr").exists()
