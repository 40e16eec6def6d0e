"""Surfaces and lamps drawn on the photograph in a real browser: each is an entry of shot.toml, moved by its handles."""

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
from small_shot import TEXT, camera
from studio_page import serious_faults

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

RECOVERED = TEXT.replace("reflectance = [0.3, 0.3, 0.3]", 'reflectance = "recover"\ngloss = "recover"').replace(
    "scale = 1.0\n", "scale = 1.0\nprobe = [0.0, 0.05, 0.0]\n"
)


@pytest.fixture(scope="module")
def recovering(studio: OneStudio) -> OneStudio:
    """The studio with a look at what a surface's reflectance is found to be."""
    studio.as_begun(RECOVERED)
    studio.look()
    return studio


@pytest.fixture
def small(recovering: OneStudio) -> Path:
    recovering.as_begun(RECOVERED)
    return recovering.folder


@pytest.fixture
def page(browser: Any, small: Path, recovering: OneStudio) -> Iterator[Tab]:
    with opened(browser, recovering.server.address, refusals=True) as tab:
        tab.press("Alt+5")
        yield tab


def table(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "shot.toml").read_text(encoding="utf-8"))


def seen(*point: float) -> tuple[float, float]:
    """Where the photograph shows a point of the world."""
    x, y = camera().project(np.array(point))
    return float(x), float(y)


def handle(page: Tab, key: str) -> tuple[float, float]:
    return tuple(
        page.tab.evaluate("(key) => { const h = relume.studio.overlay.handles.get(key); return [h.x, h.y]; }", key)
    )


def surface(folder: Path, number: int) -> rl.Mesh:
    """A surface as the job has it."""
    (mesh,) = rl.read_shot(folder / "shot.toml").surfaces()[number].shapes(folder)
    assert isinstance(mesh, rl.Mesh)
    return mesh


def test_a_box_is_drawn_by_its_foot_and_its_height_and_moved_by_its_handles(page: Tab, small: Path):
    page.click('button:text-is("Draw a box")')
    page.drag(seen(0.1, 0, -0.1), seen(0.3, 0, 0.05))
    page.until(lambda: len(table(small)["local"]) == 2, "the box")
    assert table(small)["local"][1] == {
        "shape": "box", "low": pytest.approx([0.1, 0, -0.1], abs=1e-4),
        "high": pytest.approx([0.3, 0.15, 0.05], abs=1e-4), "reflectance": "recover",
    }  # fmt: skip
    # Its height: upward from its foot's middle, anywhere.
    page.drag(seen(0.2, 0, -0.025), seen(0.2, 0.22, -0.025))
    page.until(lambda: table(small)["local"][1]["high"][1] == pytest.approx(0.22, abs=1e-4), "its height")
    # A side, and then its height again, by handles; the arrow keys move one by a pixel.
    x, y = handle(page, "side 1")
    end = seen(0.25, 0, -0.025)
    page.drag((x, y), end)
    page.until(lambda: table(small)["local"][1]["high"][0] == pytest.approx(0.25, abs=1e-3), "its side")
    assert table(small)["local"][1]["low"] == pytest.approx([0.1, 0, -0.1], abs=1e-4)
    page.tab.locator('circle[data-handle="top"]').focus()
    page.press("ArrowUp", "ArrowUp")
    page.until(lambda: table(small)["local"][1]["high"][1] > 0.224, "two pixels")
    # Turned about its middle it stands where it stood.
    before = surface(small, 1).vertices
    page.drag(handle(page, "turn"), seen(0.175 + 0.1, 0, -0.025))
    page.until(lambda: "rotate" in table(small)["local"][1], "the turn")
    turned = surface(small, 1).vertices
    middles = [(each.min(0) + each.max(0)) / 2 for each in (before, turned)]
    assert middles[1] == pytest.approx(middles[0], abs=1e-3)
    assert table(small)["local"][1]["rotate"][1] == pytest.approx(45, abs=0.2)  # its foot is a square of 0.15 m
    page.press(*["Control+z"] * 6)
    page.until(lambda: (small / "shot.toml").read_text(encoding="utf-8") == RECOVERED, "all undone")


def test_a_wall_is_drawn_along_its_foot_and_faces_the_camera(page: Tab, small: Path):
    page.click('button:text-is("Draw a wall")')
    page.drag(seen(0.4, 0, -0.3), seen(-0.2, 0, -0.35))
    page.until(lambda: len(table(small)["local"]) == 2, "the wall")
    page.drag(seen(0.1, 0, -0.325), seen(0.1, 0.2, -0.325))
    page.until(lambda: table(small)["local"][1]["size"][1] == pytest.approx(0.2, abs=1e-4), "its height")
    wall = table(small)["local"][1]
    assert wall["size"][0] == pytest.approx(np.hypot(0.6, 0.05), abs=1e-4) and wall["rotate"][::2] == [90, 0]
    corners = surface(small, 1).vertices
    expected = [[-0.2, 0, -0.35], [-0.2, 0.2, -0.35], [0.4, 0, -0.3], [0.4, 0.2, -0.3]]
    assert sorted(np.round(corners, 3).tolist()) == pytest.approx(np.array(expected), abs=2e-3)
    mesh = surface(small, 1)
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a) @ (camera().position - a) > 0
    # One end where it belongs; the other stays.
    page.drag(handle(page, "end 0"), seen(-0.3, 0, -0.3))
    page.until(lambda: np.abs(surface(small, 1).vertices - [-0.3, 0, -0.3]).sum(1).min() < 2e-3, "its end")
    assert np.abs(surface(small, 1).vertices - [0.4, 0, -0.3]).sum(1).min() < 2e-3


def test_a_second_table_is_drawn_and_raised_and_taken_out(page: Tab, small: Path):
    page.click('button:text-is("Draw a table")')
    page.drag(seen(-0.3, 0, -0.2), seen(-0.1, 0, 0.1))
    page.until(lambda: len(table(small)["local"]) == 2, "the table")
    found = table(small)["local"][1]
    assert found["size"] == pytest.approx([0.2, 0.3], abs=1e-4)
    assert found["translate"] == pytest.approx([-0.2, 0, -0.05], abs=1e-4)
    page.drag(handle(page, "top"), seen(-0.2, 0.1, -0.05))
    page.until(lambda: table(small)["local"][1].get("height") == pytest.approx(0.1, abs=1e-4), "its height")
    assert surface(small, 1).vertices[:, 1] == pytest.approx([0.1] * 4, abs=1e-4)
    page.click('button:text-is("Take it out")')
    page.until(lambda: len(table(small)["local"]) == 1, "its end")


def test_a_lamp_is_hung_over_a_point_of_the_table_and_moved(page: Tab, small: Path):
    page.click('button:text-is("Draw a lamp")')
    page.drag(seen(0.05, 0, 0.1), seen(0.05, 0.3, 0.1))
    page.until(lambda: "lamps" in table(small)["light"], "the lamp")
    assert table(small)["light"]["lamps"] == [pytest.approx([0.05, 0.3, 0.1], abs=1e-4)]
    page.drag(handle(page, "lamp 0"), seen(0.05, 0.35, 0.1))
    page.until(lambda: table(small)["light"]["lamps"][0][1] == pytest.approx(0.35, abs=1e-4), "its height")
    page.drag(handle(page, "lamp 0 foot"), seen(-0.1, 0, 0.0))
    page.until(lambda: table(small)["light"]["lamps"][0][0] == pytest.approx(-0.1, abs=1e-4), "its place")
    assert table(small)["light"]["lamps"][0] == pytest.approx([-0.1, 0.35, 0], abs=2e-4)
    page.press("Control+z")
    page.until(lambda: table(small)["light"]["lamps"][0][0] == pytest.approx(0.05, abs=1e-4), "the undo")
    page.click('button:text-is("Take it out")')
    page.until(lambda: "lamps" not in table(small)["light"], "its end")


def test_what_was_refused_leaves_an_older_surface_as_it_is(page: Tab, small: Path):
    page.click('button:text-is("Draw a box")')
    page.drag(seen(0.1, 0, -0.1), seen(0.3, 0, 0.05))
    page.until(lambda: len(table(small)["local"]) == 2, "the box")
    page.drag(seen(0.2, 0, -0.025), seen(0.2, 0.22, -0.025))
    page.until(lambda: table(small)["local"][1]["high"][1] == pytest.approx(0.22, abs=1e-4), "its height")
    page.tab.locator('[data-surface="0"]').click()
    before = (small / "shot.toml").read_text(encoding="utf-8")
    page.tab.evaluate(
        "() => { const plain = fetch; window.fetch = async (address, given) => address === '/shot/edit'"
        " ? new Response(JSON.stringify({ error: 'not now' }), { status: 422 }) : plain(address, given); }"
    )
    for kind in ("wall", "lamp"):
        page.click(f'button:text-is("Draw a {kind}")')
        page.drag(seen(-0.1, 0, -0.1), seen(-0.3, 0, 0.0))
        page.until(lambda: "not now" in page.text("#message"), "the refusal")
        assert "Drag upward" not in page.text("#pane")
        # Chosen is still what was, and a drag moves the picture alone.
        assert page.tab.locator('[data-surface="0"]').get_attribute("aria-pressed") == "true", kind
        assert page.tab.locator("#overlay path.draft").count() == 0
    page.drag(seen(0.0, 0, 0.0), seen(0.0, 0.1, 0.0))
    assert (small / "shot.toml").read_text(encoding="utf-8") == before


def test_axe_finds_nothing_serious_while_surfaces_are_drawn(page: Tab, small: Path):
    page.click('button:text-is("Draw a lamp")')
    page.click('button:text-is("Put one in the middle")')
    page.until(lambda: len(table(small)["light"].get("lamps", [])) == 1, "the lamp")
    page.click('button:text-is("Draw a box")')
    page.click('button:text-is("Put one in the middle")')
    page.until(lambda: len(table(small)["local"]) == 2, "the box")
    middle = surface(small, 1).vertices.mean(0)
    assert middle[[0, 2]] == pytest.approx([0, 0], abs=0.02)  # the camera looks at the origin
    assert table(small)["light"]["lamps"][0] == pytest.approx([middle[0], 1.0, middle[2]], abs=1e-4)
    page.settle()
    page.click('button:text-is("Draw a wall")')
    assert serious_faults(page) == []


def test_what_was_found_of_a_surface_stands_on_it_with_its_errors(page: Tab, small: Path):
    result = rl.insert(rl.read_shot(small / "shot.toml"), small / "out", preview=True)
    recovered = result.place.recovered
    assert recovered is not None
    (found,) = recovered.surfaces
    assert found.reflectance is not None and found.spread is not None and found.fitted is not None
    three = [" ".join(f"{each:.3f}" for each in of) for of in (found.reflectance, found.spread)]
    fitted = found.fitted
    written = page.tab.evaluate("() => [...document.querySelectorAll('#overlay text')].map((each) => each.textContent)")
    assert f"1: reflectance {three[0]} ± {three[1]}" in written
    assert (
        f"gloss F₀ {fitted.gloss.f0:.3f} ± {fitted.f0_error:.3f}, "
        f"roughness {fitted.gloss.roughness:.2f} ± {fitted.roughness_error:.2f}"
    ) in written
    assert f"from {fitted.points} places that the plate alone shows" in page.text('[data-found="0"]')
    # Of a surface that was changed since, nothing is written.
    page.tab.locator("select").first.select_option(label="found, one colour")
    page.until(lambda: "before the last change" in page.text('[data-found="0"]'), "what is said of it")
    assert page.tab.locator("#overlay text").count() == 0
