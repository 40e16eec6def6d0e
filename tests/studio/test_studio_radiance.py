"""The Radiance pane in a real browser: it shows what the merge measured, and a clicked place gives the scale."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import relume as rl
from browsing import Tab, opened
from one_studio import OneStudio
from serving import Server
from studio_page import done

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

ROOM = Path(__file__).resolve().parents[2] / "examples" / "room"
TEXT = """\
[plate]
photographs = ["plate/*.jpg"]

[camera]
grid = { photograph = "plate_grid.jpg", squares = [9, 6], square = 0.03 }

[light]
map = "even.exr"
"""
WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture(scope="module")
def folder(studio: OneStudio) -> Path:
    place = studio.folder
    (place / "plate").mkdir()
    for path in sorted((ROOM / "plate").glob("*.jpg")):  # at half the size: three merges are made of them
        whole = rl.read_photograph(path)
        pixels = cv2.resize(whole.pixels, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        rl.write(place / "plate" / path.name, replace(whole, pixels=pixels, name=path.name))
    shutil.copy(ROOM / "plate_grid.jpg", place)
    rl.write(place / "even.exr", rl.as_radiance_map(rl.EnvironmentMap(np.full((16, 32, 3), 0.3, np.float32))))
    (place / "shot.toml").write_text(TEXT, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def server(folder: Path, studio: OneStudio) -> Server:
    return studio.server


@pytest.fixture
def page(browser: Any, server: Server) -> Iterator[Tab]:
    with opened(browser, server.address, refusals=True) as tab:
        yield tab


def plate(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "shot.toml").read_text(encoding="utf-8"))["plate"]


def test_radiance_is_read_with_its_error_scaled_by_a_click_and_merged_anew_without_a_frame(
    page: Tab, folder: Path, server: Server
):
    page.press("Alt+2")
    page.click('button:text-is("Merge")')
    done(page, server, "merge")
    page.until(lambda: page.text("#caption") == "merged_plate.exr", "the merged plate")
    truth = rl.report.merge_shot(rl.read_shot(folder / "shot.toml"))
    picture = truth.brackets[0].picture
    assert picture.variance is not None

    # Frames with what they depart by, and the response that was recovered.
    assert page.tab.locator(".frames li").count() == 4
    for name, stops in truth.residuals[0].items():
        shown = page.text(f'.frames li[data-frame="plate/{Path(name).name}"] .stops')
        assert float(shown.replace("−", "-")) == pytest.approx(stops, abs=0.006)
    camera = server.json("/shot")["merged"]["cameras"]
    (response,) = [each.response for each in truth.cameras.values()]
    (curves,) = [each["curves"] for each in camera.values()]
    (values,) = [each["values"] for each in camera.values()]
    assert response is not None and curves == pytest.approx(response.log_exposure[:, values].round(4))
    assert page.tab.locator("#pane svg.plot path").count() >= 6

    # A click reads a pixel: the file's own float32 and its error.
    x, y = 150, 200
    page.tab.mouse.click(*page.point_at(x + 0.5, y + 0.5))
    page.until(lambda: page.tab.locator('[data-read="spot"]').count() == 1, "the reading")
    page.settle()
    held = page.text('[data-read="spot"]')
    light, sigma = float(picture.radiance[y, x] @ WEIGHTS), float(np.sqrt(picture.variance[y, x] @ WEIGHTS**2))
    words = held.split("luminance\n")[1].split()
    assert f"at {x}, {y}" in held
    assert float(words[0]) == pytest.approx(light, rel=2e-3) and float(words[2]) == pytest.approx(sigma, rel=2e-3)

    # A region by Shift and the pointer.
    page.tab.keyboard.down("Shift")
    page.drag((140, 190), (160, 205))
    page.tab.keyboard.up("Shift")
    page.until(lambda: page.tab.locator('[data-read="region"]').count() == 1, "the region")
    rows = page.text('[data-read="region"] tbody tr >> nth=0').split()
    assert "300 pixels" in page.text('[data-read="region"] caption')
    assert [float(each) for each in rows[1:4]] == pytest.approx(
        picture.radiance[190:205, 140:160].mean((0, 1)), rel=2e-3
    )

    # What a meter showed there puts the plate in cd/m², in the file and in a new merge.
    page.tab.locator("#spot-luminance").fill("85")
    page.press("Enter")
    page.until(lambda: "spot" in plate(folder), "the edit")
    assert plate(folder)["spot"] == {"at": [x, y], "luminance": 85}
    page.until(lambda: server.json("/shot")["merged"]["brackets"][0]["unit"] == "cd/m²", "the merge in cd/m²")
    page.until(lambda: "cd/m²" in page.text("#pane p:has-text('Merged as')"), "it in the page")
    page.settle()
    scaled = rl.report.merge_shot(rl.read_shot(folder / "shot.toml")).brackets[0].picture
    assert scaled.unit == "cd/m²"
    page.tab.mouse.click(*page.point_at(x + 0.5, y + 0.5))
    page.until(lambda: page.tab.locator('[data-read="spot"]').count() == 1, "the reading in cd/m²")
    page.settle()
    words = page.text('[data-read="spot"]').split("luminance\n")[1].split()
    assert float(words[0]) == pytest.approx(float(scaled.radiance[y, x] @ WEIGHTS), rel=2e-3)

    # A frame left out: it goes from the file, and the response is recovered without it.
    page.click('button[aria-label="Leave out plate/IMG_0001.jpg"]')
    page.until(lambda: len(server.json("/shot")["merged"]["brackets"][0]["frames"]) == 3, "the merge without it", 240)
    assert plate(folder)["photographs"] == [f"plate/IMG_000{n}.jpg" for n in (2, 3, 4)]
    (fewer,) = [each["curves"] for each in server.json("/shot")["merged"]["cameras"].values()]
    assert not np.allclose(fewer, curves, atol=1e-4)
    page.until(lambda: page.tab.locator(".frames li").count() == 3, "three frames")
