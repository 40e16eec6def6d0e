"""The Camera pane in a real browser: a camera that is known is found again from what is drawn; and the wipe."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Tab, encoded, opened
from one_studio import OneStudio
from serving import Server
from small_shot import camera
from studio_page import done

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")


@pytest.fixture(scope="module")
def small(studio: OneStudio) -> Path:
    return studio.folder


@pytest.fixture(scope="module")
def server(studio: OneStudio) -> Server:
    return studio.server


@pytest.fixture
def page(browser: Any, server: Server) -> Iterator[Tab]:
    server.post("/shot/undo", {"by": 10_000})
    with opened(browser, server.address, refusals=True) as tab:
        yield tab


def table(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "shot.toml").read_text(encoding="utf-8"))


def seen(*point: float) -> tuple[float, float]:
    """Where the small shot's camera shows a point of the world."""
    x, y = camera().project(np.array(point))
    return float(x), float(y)


def drag_handle(page: Tab, name: str, to: tuple[float, float]) -> None:
    handle = page.tab.locator(f'circle[data-handle="{name}"]')
    box = handle.bounding_box()
    page.tab.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.tab.mouse.down()
    page.tab.mouse.move(*page.point_at(*to))
    page.tab.mouse.up()
    page.settle()


def test_lines_dragged_along_edges_give_the_camera_that_saw_them(page: Tab, small: Path, server: Server):
    page.press("Alt+4")
    page.tab.locator("#camera-source").select_option("lines")
    page.until(lambda: page.tab.locator('circle[data-handle="length1"]').count() == 1, "the lines' handles")
    # Edges of the table: two along X, two along Z; the origin; half a metre along X.
    wanted = {
        "x00": (-0.30, 0, -0.30), "x02": (0.30, 0, -0.30), "x10": (-0.25, 0, 0.20), "x12": (0.25, 0, 0.20),
        "z00": (-0.36, 0, 0.10), "z02": (-0.36, 0, -0.20), "z10": (0.36, 0, 0.10), "z12": (0.36, 0, -0.20),
        "origin": (0, 0, 0), "length0": (-0.20, 0, -0.10), "length1": (0.20, 0, -0.10),
    }  # fmt: skip
    for name, point in wanted.items():
        drag_handle(page, name, seen(*point))
    length = page.tab.locator('input[data-place="camera.lines.length.metres"]')
    length.fill("0.4")
    length.press("Tab")
    page.settle()
    lines = tomllib.loads((small / "shot.toml").read_text(encoding="utf-8"))["camera"]["lines"]
    assert lines["x"][0] == pytest.approx([*seen(-0.30, 0, -0.30), *seen(0.30, 0, -0.30)], abs=0.02)
    assert lines["z"][1] == pytest.approx([*seen(0.36, 0, 0.10), *seen(0.36, 0, -0.20)], abs=0.02)
    assert lines["origin"] == pytest.approx(seen(0, 0, 0), abs=0.02) and lines["length"]["metres"] == 0.4
    page.click('button:text-is("Find the camera")')
    done(page, server, "look")
    found = server.json("/shot")["measured"]["camera"]
    assert found["position"] == pytest.approx([0.1, 0.5, 1.0], abs=0.004)
    assert np.array(found["rotation"]) == pytest.approx(camera().rotation, abs=0.003)


def test_the_ball_drawn_on_the_plate_gives_the_camera_that_would_see_it_so(page: Tab, small: Path, server: Server):
    page.press("Alt+4")
    page.tab.locator("#camera-source").select_option("ball")
    page.settle()
    radius = page.tab.locator('input[data-place="camera.ball.radius"]')
    radius.fill("0.05")
    radius.press("Tab")
    page.click('button:text-is("Draw the ball")')
    page.until(lambda: page.tab.locator('circle[data-handle="edge"]').count() == 1, "the circle")
    away = float(np.linalg.norm([0.1, 0.45, 1.0]))
    x, y = seen(0, 0.05, 0)
    drag_handle(page, "middle", (x, y))
    drag_handle(page, "edge", (x + 200 * 0.05 / np.sqrt(away**2 - 0.05**2), y))
    pitch = float(np.degrees(np.arctan2(0.5, np.hypot(0.1, 1.0))))
    field = page.tab.locator('input[data-place="camera.ball.pitch"]')
    field.fill(f"{pitch:.3f}")
    field.press("Tab")
    page.settle()
    ball = table(small)["camera"]["ball"]
    assert ball["rim"][:2] == pytest.approx([x, y], abs=0.02) and ball["radius"] == 0.05
    page.click('button:text-is("Find the camera")')
    done(page, server, "look")
    # In the ball's own frame +Z is level and towards the camera.
    found = server.json("/shot")["measured"]["camera"]["position"]
    assert found == pytest.approx([0, 0.5, np.hypot(0.1, 1.0)], abs=0.02)
    # The place under it is drawn; dragged to where a stand met the table, it is looked at there by itself.
    page.until(lambda: page.tab.locator('circle[data-handle="foot"]').count() == 1, "the handle of its foot")
    number = server.json("/shot")["job"]["number"]
    drag_handle(page, "foot", (x, y + 25))
    page.until(lambda: server.json("/shot")["job"]["number"] > number, "a look")
    done(page, server, "look")
    ball = table(small)["camera"]["ball"]
    assert ball["foot"] == pytest.approx([x, y + 25], abs=0.02)
    from relume.studio.shots.cameras import camera_of

    stood = camera_of(server.json("/shot")["measured"]["camera"])
    assert stood.project(np.zeros(3)) == pytest.approx([x, y + 25], abs=0.1)
    assert stood.position[1] > 0.52  # the table is lower than the ball's lowest point
    # A ball on the table itself is one choice.
    page.tab.locator("#camera-stand").select_option("table")
    page.until(lambda: "foot" not in table(small)["camera"]["ball"], "the ball on the table")
    assert table(small)["camera"]["ball"]["raised"] == 0


def test_the_curved_grid_is_where_the_lens_puts_straight_lines(page: Tab, small: Path, server: Server):
    page.press("Alt+4")
    page.settle()
    revision = server.json("/shot")["revision"]
    change = {"set": ["camera", "distortion"], "value": {"k1": -0.15, "k2": 0.02}}
    assert server.post("/shot/edit", {"revision": revision, "changes": [change]})[0] == 200
    page.click('button:text-is("Find the camera")')
    done(page, server, "look")
    page.until(lambda: page.tab.locator("#camera-grid").is_enabled(), "the lens")
    page.tab.locator("#camera-grid").check()
    page.until(lambda: page.tab.locator("#overlay path.faint").count() == 1, "the grid")
    lens = camera()
    bent = dataclasses.replace(lens, distortion=rl.scene.Distortion(-0.15, 0.02))
    drawn = page.tab.evaluate("() => document.querySelector('#overlay path.thin').getAttribute('d')")
    lines = [[[float(v) for v in point.split(",")] for point in each.split("L")] for each in drawn.split("M")[1:]]
    box = page.tab.locator("#picture").bounding_box()
    # The first line is the left border of a picture without distortion, from top to bottom in 48 parts.
    assert len(lines[0]) == 49
    for part in (0, 12, 48):
        ray = lens.rays_through(np.array([[0.0, 128 * part / 48]]))[0]
        seen = bent.project(bent.position + ray)
        expected = np.subtract(page.point_at(float(seen[0]), float(seen[1])), [box["x"], box["y"]])
        assert lines[0][part] == pytest.approx(expected.tolist(), abs=0.05)
    corner = bent.project(bent.position + lens.rays_through(np.zeros((1, 2)))[0])
    assert f"by up to {np.hypot(*corner):.1f} pixels" in page.tab.locator("#overlay text").first.text_content()


def test_the_wipe_shows_the_composite_on_one_side_and_the_plate_on_the_other(page: Tab, small: Path, server: Server):
    page.press("Alt+8")
    page.click('button:text-is("Render the composite")')
    done(page, server, "insert")
    page.until(lambda: page.text("#caption") == "composite.png", "the composite")
    page.press("f", "w")
    page.until(lambda: page.tab.evaluate("() => relume.canvas.view.mode") == "wipe", "the wipe")
    page.press("r")
    composite, plate = (
        rl.read_radiance(path).radiance.astype(np.float64)
        for path in (small / "out" / "composite.exr", small / "plate.exr")
    )
    luminance = np.array([0.2126, 0.7152, 0.0722])
    gain = float(np.median(composite @ luminance) / np.median(plate @ luminance))
    x, y = (int(each) for each in seen(0.03, 0.05, 0))  # on the ball, right of the middle
    assert np.abs(composite[y, x] - plate[y, x]).max() > 0.03
    middle = (int(seen(0, 0.05, 0)[0]), y)
    # What is left of the edge is the composite; dragging it to the left of the place shows the plate there.
    page.drag(middle, (x + 20, y))
    assert page.shown(x + 0.5, y + 0.5) == pytest.approx(encoded(composite[y, x]), abs=1.5)
    page.drag((x + 20, y), (x - 20, y))
    assert page.shown(x + 0.5, y + 0.5) == pytest.approx(encoded(gain * plate[y, x]), abs=1.5)
    # The arrow keys move it too, and W ends it.
    before = page.tab.evaluate("() => relume.canvas.view.wipe")
    page.press("ArrowRight")
    assert page.tab.evaluate("() => relume.canvas.view.wipe") == pytest.approx(before + 0.02, abs=1e-9)
    page.press("w")
    assert page.tab.evaluate("() => relume.canvas.view.mode") == "picture"
    assert page.shown(x + 0.5, y + 0.5) == pytest.approx(encoded(composite[y, x]), abs=1.5)
    # D shows by how much they differ: grey where they are alike, brighter and darker elsewhere.
    page.press("d")
    page.until(lambda: page.tab.evaluate("() => relume.canvas.view.mode") == "difference", "the difference")
    page.settle()
    for a, b in ((x, y), (5, 5)):
        expected = encoded(0.18 + (composite[b, a] - gain * plate[b, a]))
        assert page.shown(a + 0.5, b + 0.5) == pytest.approx(expected, abs=2)
    page.press("d", "Shift+R")
    red = page.shown(x + 0.5, y + 0.5)
    assert red == pytest.approx(encoded(np.repeat(composite[y, x, 0], 3)), abs=1.5)
    page.press("c", "v")
    page.until(lambda: page.tab.locator("#legend").is_visible(), "the scale of false colour")
    page.press("v")
    assert page.shown(x + 0.5, y + 0.5) == pytest.approx(encoded(composite[y, x]), abs=1.5)
