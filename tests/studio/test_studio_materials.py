"""The Objects pane's materials: balls under the measured light, clicked, dragged onto an object, reached by keys."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Tab, opened
from one_studio import OneStudio
from serving import Server
from small_shot import TEXT
from studio_page import serious_faults

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

SECOND = """
[[objects]]
mesh = "objects/ball.glb"
translate = [0.2, 0.0, 0.0]
material = { base_color = [0.1, 0.2, 0.9] }
"""


@pytest.fixture(scope="module")
def server(looked_studio: OneStudio) -> Server:
    return looked_studio.server


@pytest.fixture
def small(looked_studio: OneStudio) -> Path:
    looked_studio.as_begun(TEXT.replace("\n[match]", SECOND + "\n[match]"))
    return looked_studio.folder


@pytest.fixture
def page(browser: Any, server: Server, small: Path) -> Iterator[Tab]:
    with opened(browser, server.address) as tab:
        tab.press("Alt+6")
        tab.until(lambda: tab.tab.locator(".balls button").count() > 30, "the balls")
        tab.tab.locator("#objects-look").uncheck()
        tab.tab.locator("#picture").focus()
        yield tab


def material(folder: Path, number: int) -> Any:
    return tomllib.loads((folder / "shot.toml").read_text(encoding="utf-8"))["objects"][number].get("material")


def drawn(page: Tab, name: str) -> np.ndarray:
    """The pixels of a ball in the strip, (64, 64, 4)."""
    return np.array(
        page.tab.evaluate(
            "(name) => { const c = document.querySelector(`[data-ball='${name}'] canvas`);"
            "return [...c.getContext('2d').getImageData(0, 0, c.width, c.height).data]; }", name,
        )
    ).reshape(64, 64, 4)  # fmt: skip


def test_a_ball_is_clicked_for_the_chosen_object_and_undo_takes_it_back(page: Tab, small: Path):
    before = (small / "shot.toml").read_text(encoding="utf-8")
    page.click('[data-ball="gold"]')
    assert material(small, 0) == {"preset": "gold"}
    assert page.tab.locator('.balls [aria-pressed="true"]').get_attribute("data-ball") == "gold"
    page.click('[data-ball="ball, its own"]')
    assert material(small, 0) is None
    page.press("Control+z", "Control+z")
    assert (small / "shot.toml").read_text(encoding="utf-8") == before
    # What another object has is there for this one too.
    page.click('[data-ball="ball, as in the shot"]')
    assert material(small, 0) == {"base_color": [0.1, 0.2, 0.9]}


def test_a_ball_is_dragged_onto_an_object_in_the_photograph(page: Tab, small: Path):
    camera = rl.Camera.looking_at(np.array([0.1, 0.5, 1.0]), np.zeros(3), width=192, height=128, focal_length=200)
    (x, y), *_ = camera.project(np.array([[0.2, 0.05, 0.0]]))
    if page.tab.locator('button:text-is("Show it live")').is_visible():
        page.click('button:text-is("Show it live")')
    a, b = page.point_at(float(x), float(y))
    box = page.tab.locator("#picture").bounding_box()
    assert box is not None
    page.tab.drag_and_drop(
        '[data-ball="chrome"]', "#picture", target_position={"x": a - box["x"], "y": b - box["y"]}, force=True
    )
    page.until(lambda: material(small, 1) == {"preset": "chrome"}, "the material")
    page.settle()
    assert material(small, 0) is None


def test_the_strip_is_one_stop_of_tab_and_arrow_keys_go_on_within_it(page: Tab, small: Path):
    assert page.tab.locator('.balls button[tabindex="0"]').count() == 1
    page.tab.locator('.balls button[tabindex="0"]').focus()
    page.press("End", "ArrowLeft", "ArrowUp", "Home", "ArrowRight", "ArrowDown", "ArrowRight")
    name = page.tab.evaluate("() => document.activeElement.dataset.ball")
    names = page.tab.evaluate("() => [...document.querySelectorAll('.balls button')].map((each) => each.dataset.ball)")
    assert name == names[8]
    page.press("Enter")
    assert material(small, 0) == {"preset": name}
    assert page.tab.evaluate("() => document.activeElement.dataset.ball") == name


def test_balls_are_drawn_as_the_light_shows_them_and_as_bright_as_the_picture(page: Tab):
    matt, mirror = drawn(page, "concrete"), drawn(page, "mirror")
    assert matt[0, 0, 3] == 0 and matt[32, 32, 3] == 255
    # The lamp stands high, behind the camera's left: it is seen in the mirror and lights the matt ball from above.
    assert mirror[..., :3].max() == 255 and matt[12, 32, 1] > matt[56, 32, 1] + 10
    page.press("Shift+E", "Shift+E")
    assert drawn(page, "concrete")[32, 32, 1] < matt[32, 32, 1]
    page.press("E", "E")


def test_balls_are_kept_with_the_shots_stages(page: Tab, server: Server, small: Path):
    assert (small / "out" / "stages" / "material_balls.npz").is_file()
    facts = server.json("/materials")
    assert facts["size"] == 64 and {"gold", "glass", "velvet"} <= {each["name"] for each in facts["balls"]}
    velvet = next(each for each in facts["balls"] if each["name"] == "velvet")
    assert velvet["left_out"] == ["sheen"] and velvet["table"] == {"preset": "velvet"}


def test_axe_finds_nothing_serious_in_the_strip(page: Tab):
    assert serious_faults(page, "#pane") == []
