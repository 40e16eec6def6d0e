"""The demo's composite from the room's photographs alone, by the pointer, from the first click to the last file."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Tab, opened
from serving import COMMAND, Server, serving
from studio_page import done

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

ROOM = Path(__file__).resolve().parents[2] / "examples" / "room"
MESHES = ("suzanne_plastic", "sphere_mirror", "sphere_gray", "sphere_glass", "cube_gold")
STANDS = [(-0.24, 0.02), (-0.10, -0.06), (0.02, 0.07), (0.13, -0.04), (0.24, 0.06)]
PATIENT = 1500
"""Seconds: finding the light of two views takes a minute or two, on a busy machine many."""


@pytest.mark.slow  # the whole job, twice
def test_the_demos_composite_is_made_by_the_pointer_and_is_the_commands_to_the_bit(browser: Any, tmp_path: Path):
    folder, recorded = tmp_path / "room", tmp_path / "recorded"
    recorded.mkdir()
    for name in ("plate", "ball_0", "ball_90"):
        shutil.copytree(ROOM / name, folder / name)
    shutil.copy(ROOM / "plate_grid.jpg", folder)
    with serving([folder], "studio") as server, opened(browser, server.address, refusals=True) as page:

        def record(name: str) -> None:
            page.settle()
            page.tab.screenshot(path=recorded / f"{name}.png")

        # Photographs: what is what.
        for bracket, role in (("plate", "Plate"), ("ball_0", "Ball"), ("ball_90", "Ball")):
            page.click(f'.bracket[data-name="{bracket}"] button:text-is("{role}")')
        record("1 photographs")
        assert table(folder)["plate"]["photographs"] == ["plate/*.jpg"] and len(table(folder)["light"]["balls"]) == 2

        # Radiance: merged and looked at.
        step(page, "Radiance")
        page.click('button:text-is("Merge")')
        finished(page, server, "merge")
        page.until(lambda: page.text("#caption") == "merged_plate.exr", "the merged plate", 60)
        page.tab.mouse.click(*page.point_at(300.5, 400.5))
        page.until(lambda: page.tab.locator('[data-read="spot"]').count() == 1, "the reading", 60)
        record("2 radiance")

        # Light: each ball's rim is found, and kept.
        step(page, "Light")
        for view in (1, 2):
            page.click(f'button:text-is("View {view}")')
            page.until(lambda: "an edge was seen" in page.text("#pane"), "the rim", 120)
            page.click('button:text-is("Keep it")')
            page.until(lambda view=view: "pick" in table(folder)["light"]["balls"][view - 1], "the pick", 60)
        record("3 light")

        # Camera: the board is found; what no photograph shows is by tape measure.
        step(page, "Photographs")
        page.click('.bracket[data-name="plate_grid.jpg"] button:text-is("Board")')
        step(page, "Camera")
        page.until(lambda: "the board is there" in page.text("#pane"), "the board", 120)
        for view, place in ((0, (0.0, 0.17, 1.0)), (1, (1.0, 0.17, 0.0))):
            for axis, value in enumerate(place):
                field = page.tab.locator(f'input[data-place="light.balls.{view}.camera"]').nth(axis)
                field.fill(str(value))
                field.press("Tab")
                page.settle()
        page.until(lambda: page.tab.locator("#fault").is_hidden(), "a shot that is whole", 60)
        page.click('button:text-is("Find the camera")')
        finished(page, server, "look")
        record("4 camera")

        # Place: the table as far as it goes, by its sides; the room about it.
        step(page, "Place")
        page.click('button:text-is("Describe it")')
        lens = camera_of(server)
        held = page.tab.evaluate("() => { const h = relume.studio.overlay.handles.get('side 2'); return [h.x, h.y]; }")
        ray = lens.rays_through(np.array([held]))[0]
        x = float((lens.position - ray * (lens.position[1] / ray[1]))[0])
        ends = lens.project(np.array([x, 0.0, -0.5]))  # where the photograph shows its far edge
        page.drag((held[0], held[1]), (float(ends[0]), float(ends[1])))
        assert table(folder)["local"][0]["size"] == pytest.approx([1.2, 1.1], abs=1e-3)
        page.tab.locator("select").last.select_option(label="a room")
        page.until(lambda: table(folder)["light"].get("distant", {}).get("shape") == "box", "the room", 60)
        record("5 place")

        # Objects: dropped, and dragged on the table to where they shall stand.
        step(page, "Objects")
        page.tab.locator("#objects-look").uncheck()
        page.tab.locator('input[type="file"]').set_input_files([str(ROOM / "objects" / f"{n}.glb") for n in MESHES])
        page.until(lambda: len(table(folder).get("objects", [])) == 5, "five objects", 120)
        page.until(lambda: page.tab.evaluate("() => !document.getElementById('live').hidden"), "the live picture", 60)
        page.settle()
        for number in (4, 3, 2, 1, 0):
            facts = server.json("/objects")["objects"][number]
            before = table(folder)["objects"][number]["stand"]
            # Held in its middle; the pointer's ray meets the table somewhere behind, and moves as the object shall.
            height = 0.5 * (facts["high"][1] + facts["low"][1])
            start = lens.project(np.array([facts["foot"][0], height, facts["foot"][2]]))
            ray = lens.rays_through(start[None])[0]
            held = lens.position - ray * (lens.position[1] / ray[1])
            target = held + np.array([STANDS[number][0] - before[0], 0.0, STANDS[number][1] - before[1]])
            end = lens.project(target)
            page.drag((float(start[0]), float(start[1])), (float(end[0]), float(end[1])))
            page.until(lambda n=number, b=before: table(folder)["objects"][n]["stand"] != b, "the drag", 60)
            page.settle()
        found = [each["stand"] for each in table(folder)["objects"]]
        assert np.array(found) == pytest.approx(np.array(STANDS), abs=2e-4)
        record("6 objects, live")
        page.click('button:text-is("Quick look")')
        finished(page, server, "look")
        page.until(lambda: page.text("#caption") == "preview.exr", "the quick look", 60)
        record("7 objects, looked at")

        # Develop, and deliver with few rays.
        step(page, "Develop")
        record("8 develop")
        step(page, "Deliver")
        rays = page.tab.locator('input[data-place="render.samples"]')
        rays.fill("4")
        rays.press("Tab")
        page.settle()
        page.click('button:text-is("Render the composite")')
        finished(page, server, "insert")
        page.until(lambda: page.text("#caption") == "composite.png", "the composite", 60)
        record("9 delivered")
        page.press("w")
        record("10 wiped")

    # The command, from the shot file alone, in a folder of its own.
    made = subprocess.run(
        [sys.executable, "-c", COMMAND, "insert", str(folder / "shot.toml"), "-o", str(tmp_path / "typed"), "--accept"],
        capture_output=True, text=True, timeout=PATIENT,
    )  # fmt: skip
    assert made.returncode in (0, 4), made.stderr
    for name in ("composite.exr", "composite.png"):
        pictures = [rl.read(place / name) for place in (folder / "out", tmp_path / "typed")]
        one, other = (each.radiance if isinstance(each, rl.RadianceMap) else each.pixels for each in pictures)
        assert np.array_equal(one, other)
    # The objects are in it, and where no object is or acts the plate is as it was.
    layers = rl.files.read_layers(folder / "out" / "layers.exr")
    assert 0.01 < float((layers["matte"] > 0.5).mean()) < 0.5


def step(page: Tab, name: str) -> None:
    page.click(f'#steps button:text-is("{name}")')


def table(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "shot.toml").read_text(encoding="utf-8"))


def finished(page: Tab, server: Server, kind: str) -> None:
    page.until(
        lambda: (job := server.json("/shot")["job"])["kind"] == kind and job["status"] in ("done", "failed"),
        kind, PATIENT,
    )  # fmt: skip
    done(page, server, kind)


def camera_of(server: Server) -> rl.Camera:
    """The plate's camera as the page has it."""
    found = server.json("/shot")["measured"]["camera"]
    lens = found["distortion"]
    return rl.Camera(
        position=np.array(found["position"]), rotation=np.array(found["rotation"]), width=found["size"][0],
        height=found["size"][1], focal_length=found["focal_length"], centre=tuple(found["centre"]),
        distortion=None if lens is None else rl.scene.Distortion(*lens),
    )  # fmt: skip
