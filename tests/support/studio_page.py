"""What tests of the studio's page share: a job waited for, a camera that is known."""

from __future__ import annotations

from typing import Any

import pytest

from browsing import Tab
from serving import Server


def done(page: Tab, server: Server, kind: str) -> None:
    """Wait for a job's end in the server and in the page."""
    page.until(
        lambda: (job := server.json("/shot")["job"])["kind"] == kind and job["status"] in ("done", "failed"), kind, 240
    )
    job = server.json("/shot")["job"]
    assert job["status"] == "done", job
    page.until(lambda: page.tab.evaluate("() => relume.studio.state.job.status") == "done", "its end in the page")
    page.settle()


def looked_at(page: Tab, server: Server) -> None:
    """The camera is known: by a quick look, once."""
    if page.tab.evaluate("() => relume.studio.measured === null"):
        server.post("/jobs/start", {"kind": "look"})
        done(page, server, "look")
        page.until(lambda: page.tab.evaluate("() => relume.studio.measured !== null"), "what it measured")


def serious_faults(page: Tab, within: str | None = None) -> list[tuple[str, str]]:
    """What axe finds serious or worse in the page as it is, or in a part of it, with every part of the pane open."""
    axe: Any = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is missing")
    while (closed := page.tab.locator("details:not([open]) > summary")).count():
        closed.first.click()
    if not page.tab.evaluate("() => !!window.axe"):
        page.tab.evaluate(axe.Axe().axe_script)
    found = page.tab.evaluate(
        "async (within) => (await axe.run(within ?? document, { resultTypes: ['violations'] })).violations"
        ".filter((each) => ['serious', 'critical'].includes(each.impact)).map((each) => [each.id, each.nodes[0].html])",
        within,
    )
    return [tuple(each) for each in found]
