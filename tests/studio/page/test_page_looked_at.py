"""While a picture refines in the studio: what is about the pointer comes first, and the noise that is left is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from browsing import opened
from one_studio import OneStudio
from serving import serving
from small_shot import write_small_shot
from studio_page import done, looked_at

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")


@pytest.mark.slow
def test_a_look_begins_about_the_pointer_and_a_render_says_its_noise(browser: Any, tmp_path: Path):
    shot = write_small_shot(tmp_path / "shot")
    with serving([shot], "studio") as server, opened(browser, f"{server.address}#objects", refusals=True) as page:
        looked_at(page, server)
        page.tab.evaluate("() => relume.studio.show('preview.exr', 'results')")
        page.settle()
        # Beside the picture nothing is looked at, on it the place under the pointer.
        sent = "() => { window.sent = []; const plain = fetch; window.fetch = (address, given) => {"
        sent += " if (address === '/jobs/start') window.sent.push(JSON.parse(given.body));"
        sent += " return plain(address, given); }; }"
        page.tab.evaluate(sent)
        page.tab.mouse.move(5, 300)
        page.tab.mouse.move(*page.point_at(96, 80))
        page.press("l")
        done(page, server, "look")
        (asked,) = page.tab.evaluate("() => window.sent")
        assert asked["kind"] == "look" and asked["about"] == pytest.approx([96 / 192, 80 / 128], abs=0.01)
        steps = server.json("/shot")["job"]["steps"]
        assert steps.index("first picture") < steps.index("around the pointer")
        page.tab.mouse.move(5, 300)
        page.press("l")
        done(page, server, "look")
        assert page.tab.evaluate("() => window.sent")[1]["about"] is None
        assert "around the pointer" not in server.json("/shot")["job"]["steps"]
        # A render that takes a while is watched from Deliver.
        page.press("Alt+8")
        changes = [{"set": ["render", "samples"], "value": 40_000}, {"set": ["render", "preview"], "value": True}]
        page.tab.evaluate("(changes) => relume.studio.edit(changes)", changes)
        page.settle()
        page.tab.evaluate("() => relume.studio.start('insert')")
        try:
            page.until(lambda: "noise" in page.text("#caption"), "the noise")
            words = page.text("#caption")
            assert words.startswith("preview.exr: noise ") and words.endswith(" %")
            first = float(words.split()[-2])
            page.until(lambda: float(page.text("#caption").split()[-2]) < first, "less of it")
            # And it may be drawn: the picture's own error so far.
            page.press("u")
            page.until(lambda: page.tab.locator("#legend").is_visible(), "the errors")
        finally:
            page.tab.evaluate("() => relume.studio.stop()")
            page.until(lambda: server.json("/shot")["job"]["status"] == "stopped", "its end")


@pytest.mark.parametrize("about", [[0.5], [0.5, 1.5], "here", [0.5, "a"], {"x": 1}])
def test_a_place_that_is_none_is_refused_in_a_line(studio: OneStudio, about: Any):
    status, said = studio.server.post("/jobs/start", {"kind": "look", "about": about})
    assert status == 422 and "shares of the picture's width and height" in said["error"]
