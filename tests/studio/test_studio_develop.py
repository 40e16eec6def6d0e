"""The Develop pane in a real browser: two ways side by side, one kept; and a job held and let go on."""

from __future__ import annotations

import os
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Tab, opened
from one_studio import OneStudio
from relume.cli import main
from relume.studio.shots.camera_parameters import parameters
from relume.studio.shots.developed import developed
from serving import Server
from studio_page import serious_faults

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

LEFT_OUT = {"tone.camera.response", "view.field_of_view", "view.seed"}
"""Keys that the page does not offer: a file, and what the shot's own camera and render say."""
KINDS_LEFT_OUT = {"glare.measured", "vignetting.measured", "motion.vectors", "tone.ocio"}
"""Kinds that are made from files."""


@pytest.fixture(scope="module")
def small(looked_studio: OneStudio) -> Path:
    return looked_studio.folder


@pytest.fixture(scope="module")
def server(looked_studio: OneStudio) -> Server:
    return looked_studio.server


@pytest.fixture
def page(browser: Any, server: Server) -> Iterator[Tab]:
    server.post("/shot/undo", {"by": 10_000})
    with opened(browser, server.address, refusals=True) as tab:
        yield tab


def test_two_ways_to_develop_stand_side_by_side_and_the_kept_one_is_the_commands(
    page: Tab, small: Path, server: Server, monkeypatch: pytest.MonkeyPatch
):
    page.press("Alt+7")
    page.until(lambda: page.tab.locator("#develop-left").count() == 1, "the ways")
    page.tab.locator("#develop-left").select_option("tone reinhard")
    page.until(lambda: "left: reinhard; right: slide" in page.text("#message"), "the two")
    page.tab.locator("#develop-left-exposure").fill("1")
    page.until(lambda: "left: reinhard, +1 stops; right: slide" in page.text("#message"), "the brighter one")
    page.press("r", "f")
    # What one would type makes the right one; Python's text is run as it stands.
    page.tab.locator("#pane summary").last.click()
    python = page.tab.locator('pre[data-typed="Python"]').text_content()
    command = page.tab.locator('pre[data-typed="command"]').text_content()
    assert command.startswith(
        "relume develop out/preview.exr -o out/developed_slide.png --preset slide --field-of-view "
    )
    monkeypatch.chdir(small)
    exec(compile(python, "what one would type", "exec"), {})
    right = rl.read_photograph(small / "out" / "developed_slide.png").pixels
    left = rl.DevelopSettings(
        preset=rl.CameraPreset.read(None, {"tone": {"kind": "reinhard"}, "exposure": 1.0}),
        field_of_view=np.radians(float(command.split()[-1])),
    )
    rl.develop_file(small / "out" / "preview.exr", small / "left.png", left)
    left = rl.read_photograph(small / "left.png").pixels
    rows, columns = left.shape[:2]
    assert np.abs(left.astype(int) - right)[rows // 2, [columns // 4, 3 * columns // 4]].max() > 20
    # Pixel for pixel, each on its side.
    for x, expected in ((columns // 4, left), (3 * columns // 4, right)):
        found = page.shown(x + 0.5, rows // 2 + 0.5)
        assert found == pytest.approx(expected[rows // 2, x].tolist(), abs=1.5)
    # Kept, it is the file that the Python wrote, to the byte.
    (small / "out" / "developed_slide.png").rename(small / "typed.png")
    page.click('button:text-is("Keep the right")')
    page.until(lambda: "written: out/developed_slide.png" in page.text("#message"), "the file")
    assert (small / "out" / "developed_slide.png").read_bytes() == (small / "typed.png").read_bytes()


def test_a_side_that_was_not_changed_is_not_developed_again(tmp_path: Path):
    written: list[float] = []
    ramp = np.linspace(0.01, 0.6, 8 * 12 * 3, dtype=np.float32).reshape(8, 12, 3)

    def shown(value: float, **way: Any) -> tuple[int, np.ndarray, list[str]]:
        if value not in written:
            rl.write(tmp_path / "composite.exr", rl.RadianceMap(value * ramp))
            written.append(value)
        body = {"of": "composite.exr", **way}
        found = developed(body, results=tmp_path, named="out", scratch=tmp_path / "scratch", camera=None)
        path = tmp_path / "scratch" / found["path"]
        return path.stat().st_mtime_ns, rl.read_photograph(path).pixels, found["doubts"]

    (tmp_path / "scratch").mkdir()
    first, other = shown(1.0, tone="ferwerda"), shown(1.0, tone="exposure")
    assert shown(1.0, tone="ferwerda")[0] == first[0] and shown(1.0, tone="ferwerda")[2] == first[2] != []
    # Another exposure, another composite, and a file that is gone are made.
    assert shown(1.0, tone="exposure", exposure=1)[1].mean() > other[1].mean()
    again = shown(0.5, tone="exposure")
    assert again[0] > other[0]
    (tmp_path / "scratch" / "developed_exposure.png").unlink()
    assert (shown(0.5, tone="exposure")[1] == again[1]).all()


def test_every_key_of_a_camera_is_offered_with_its_default_or_named_as_left_out():
    offered = set()
    for part in parameters(depth=True):
        for kind, keys in part["kinds"].items():
            place = ".".join(filter(None, (part["table"], kind)))
            for key in keys:
                offered.add(f"{place}.{key['key']}")
                if not key["choices"] and isinstance(key["otherwise"], int | float):
                    assert key["low"] <= key["otherwise"] <= key["high"], f"{place}.{key['key']}"
    known = {
        f"{place}.{key}"
        for table, kinds in rl.CameraPreset.keys().items()
        for kind, keys in kinds.items()
        if (place := ".".join(filter(None, (table, kind)))) not in KINDS_LEFT_OUT
        for key in keys
    }
    assert offered | LEFT_OUT == known and not offered & LEFT_OUT
    assert rl.CameraPreset.keys()["glare"]["camera"]["f_number"] == 8.0
    assert rl.CameraPreset.keys()["tone"]["ferwerda"]["screen.black"] == 0.01


def test_a_lens_a_film_and_a_display_are_set_by_sliders_and_the_command_says_them(
    page: Tab, small: Path, server: Server, monkeypatch: pytest.MonkeyPatch
):
    page.press("Alt+7")
    page.until(lambda: page.tab.locator("#develop-left").count() == 1, "the ways")

    def part(name: str) -> None:
        page.tab.locator(f'details[data-part="{name}"] > summary').click()

    def sent() -> str:
        return page.tab.evaluate("() => document.querySelector('pre[data-typed=command]')?.textContent ?? ''")

    part("vignetting")
    page.tab.locator("#right-vignetting").select_option("polynomial")
    page.until(lambda: "vignetting.coefficients=[-0.3, 0, 0]" in sent(), "the vignetting")
    # A slider by its keys; the number beside it by typing; emptied it is as it was.
    first = page.tab.locator("#right-vignetting-coefficients-0")
    first.focus()
    page.press("ArrowLeft")
    page.until(lambda: "vignetting.coefficients=[-0.31, 0, 0]" in sent(), "the slider")
    part("tone")
    # What is shown unless given is the chosen camera's own: a slide's film, where others begin with black-and-white.
    assert page.tab.locator("#right-tone-stock").input_value() == '"slide"'
    page.tab.locator("#right-tone").select_option("darkroom")
    page.until(lambda: "tone.kind=darkroom" in sent(), "the film")
    assert page.tab.locator("#right-tone-stock").input_value() == '"slide"'
    page.tab.locator("#right-tone-stock").select_option(label="colour-negative")
    page.until(lambda: "tone.stock=colour-negative" in sent(), "the other film")
    page.tab.locator("#right-tone-grain").uncheck()
    page.until(lambda: "tone.grain=false" in sent(), "no grain")
    stops = page.tab.get_by_label("Film exposed by, stops")
    assert stops.get_attribute("placeholder") == "0"
    stops.fill("0.7")
    stops.press("Tab")
    page.until(lambda: "tone.stops=0.7" in sent(), "the exposure")
    part("display")
    page.tab.locator("#right-display").select_option("p3")
    page.until(lambda: "display.kind=p3" in sent(), "the display")
    part("glare")
    page.tab.locator("#right-glare").select_option("camera")
    page.tab.get_by_label("Veiling glare, of all light").fill("0.05")
    page.tab.get_by_label("Veiling glare, of all light").press("Tab")
    page.until(lambda: "glare.veil=0.05" in sent() and "glare.kind=camera" in sent(), "the glare")
    page.tab.get_by_label("Veiling glare, of all light").fill("")
    page.tab.get_by_label("Veiling glare, of all light").press("Tab")
    page.until(lambda: "glare.veil" not in sent(), "the glare as it is unless given")
    page.settle()
    # What one would type makes the same file, as Python and as a command.
    page.click('button:text-is("Keep the right")')
    page.until(lambda: page.text("#message").startswith("written: out/developed_"), "the file")
    kept = small / page.text("#message").removeprefix("written: ")
    expected = kept.read_bytes()
    found = rl.read_photograph(kept)
    monkeypatch.chdir(small)
    kept.unlink()
    exec(compile(page.tab.locator('pre[data-typed="Python"]').text_content(), "what one would type", "exec"), {})
    assert kept.read_bytes() == expected
    kept.unlink()
    words = shlex.split(sent())
    assert words[:2] == ["relume", "develop"]
    assert main(words[1:]) == 0
    assert kept.read_bytes() == expected
    # It is the picture of that very camera: its corner darker, by the polynomial.
    tables = {
        "vignetting": {"kind": "polynomial", "coefficients": [-0.31, 0, 0]},
        "tone": {"kind": "darkroom", "stock": "colour-negative", "grain": False, "stops": 0.7},
        "display": {"kind": "p3"}, "glare": {"kind": "camera"},
    }  # fmt: skip
    settings = rl.DevelopSettings(
        preset=rl.CameraPreset.read("slide", tables), field_of_view=np.radians(float(words[-1]))
    )
    rl.develop_file(small / "out" / "preview.exr", small / "same.png", settings)
    assert np.array_equal(rl.read_photograph(small / "same.png").pixels, found.pixels)
    # What a camera cannot be is one line.
    number = page.tab.get_by_role("spinbutton", name="f-number", exact=True)
    number.fill("-3")
    number.press("Tab")
    page.until(lambda: "f_number" in page.text("#message"), "the refusal")


def test_axe_finds_nothing_serious_among_the_numbers_of_a_camera(page: Tab, server: Server):
    page.press("Alt+7")
    page.until(lambda: page.tab.locator("#right-glare").count() == 1, "the parts")
    # The numbers are what is looked at: all changes of them get the pictures of the first.
    page.tab.evaluate(
        "() => { const plain = fetch; let made; window.fetch = async (address, given) =>"
        " address === '/developed' ? (await (made ??= plain(address, given))).clone() : plain(address, given); }"
    )
    for part, kind in (("glare", "camera"), ("tone", "darkroom"), ("motion", "turn"), ("geometry", "")):
        page.tab.locator(f'details[data-part="{part}"] > summary').click()
        page.tab.locator(f"#right-{part}").select_option(kind)
        page.settle()
    assert page.tab.locator(".slider").count() > 20
    assert serious_faults(page) == []


@pytest.mark.parametrize(
    ("key", "value"),
    [("preset", "../../slide.toml"), ("preset", "hdr-screen"), ("preset", ["slide"]), ("tone", "ocio"),
     ("glare", "/etc/passwd"), ("exposure", "1"),
     ("settings", {"glare": {"kind": "measured", "picture": "/etc/passwd"}}),
     ("settings", {"tone": {"kind": "ocio"}}), ("settings", {"tone": {"kind": "camera", "response": "x"}}),
     ("settings", {"tone": {"kind": [1]}}), ("settings", {"tone": {"kind": {}}}),
     ("settings", {"nothing": {}}), ("settings", {"soft_focus": {"share": 2}}), ("settings", [1]),
     ("settings", {"defocus": {"focus": 1, "f_number": 2, "focal_length": 50}}), ("of", "../shot.toml"),
     ("of", "plate.exr")],
)  # fmt: skip
def test_what_is_no_way_to_develop_is_one_line_and_leaves_nothing(server: Server, small: Path, key: str, value: Any):
    (small / "out").mkdir(exist_ok=True)
    if not (small / "out" / "preview.exr").exists():
        rl.write(small / "out" / "preview.exr", rl.RadianceMap(np.ones((8, 8, 3), np.float32)))
    before = sorted(each.name for each in (small / "out").iterdir())
    status, answer = server.post("/developed", {"of": "preview.exr", "keep": True, key: value})
    assert status == 422 and "\n" not in answer["error"]
    assert sorted(each.name for each in (small / "out").iterdir()) == before


def test_a_job_rests_while_it_is_held_and_goes_on(page: Tab, small: Path, server: Server):
    revision = server.json("/shot")["revision"]
    change = {"set": ["render", "samples"], "value": 100_000}
    assert server.post("/shot/edit", {"revision": revision, "changes": [change]})[0] == 200
    page.press("Alt+8")
    page.until(lambda: tomllib.loads((small / "shot.toml").read_text())["render"]["samples"] == 100_000, "the edit")
    page.click('button:text-is("Render the composite")')
    page.until(lambda: server.json("/shot")["job"].get("step") == "render", "the render")
    (worker,) = server.workers()
    page.click("#job-pause")
    page.until(lambda: page.text("#job-words") == "render: paused", "its rest")
    page.until(lambda: rests(page, worker), "a processor that is free")
    held = server.json("/shot")["job"]
    # By the same button it goes on, and is held again by its key; to stop it is possible there too.
    assert page.text("#job-pause") == "Go on"
    page.click("#job-pause")
    page.until(lambda: server.json("/shot")["job"]["share"] > held["share"], "more of the render")
    page.tab.locator("#picture").focus()
    page.press("p")
    page.until(lambda: rests(page, worker), "a processor that is free again")
    page.click("#job-stop")
    page.until(lambda: server.json("/shot")["job"]["status"] == "stopped", "its end")
    assert server.workers() == [worker]


def rests(page: Tab, process: int) -> bool:
    """Whether a process works nothing for a while."""
    before = worked(process)
    page.tab.wait_for_timeout(500)
    return worked(process) - before < 0.02


def worked(process: int) -> float:
    counted = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    return sum(map(int, counted)) / os.sysconf("SC_CLK_TCK")
