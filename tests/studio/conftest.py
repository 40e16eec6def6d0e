"""What the tests of the pages share: one browser and one studio for each process of the suite."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest

from browsing import CHROMIUM, FLAGS
from one_studio import OneStudio
from serving import serving
from small_shot import write_small_shot


@pytest.fixture(scope="session")
def started_browser() -> Iterator[tuple[Any, asyncio.AbstractEventLoop]]:
    """The browser, which takes three seconds to begin and to draw its first page, and Playwright's event loop."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no Chromium here; on Debian: apt-get install chromium")
    with playwright.sync_playwright() as started:
        loop = asyncio.get_running_loop()
        running = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        asyncio._set_running_loop(None)
        yield running, loop
        asyncio._set_running_loop(loop)
        running.close()


@pytest.fixture(scope="module")
def browser(started_browser: tuple[Any, asyncio.AbstractEventLoop]) -> Iterator[Any]:
    """That browser; Playwright's loop is this thread's only in files that use it, others run loops of their own."""
    running, loop = started_browser
    asyncio._set_running_loop(loop)
    yield running
    asyncio._set_running_loop(None)


@pytest.fixture(scope="session")
def begun_studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OneStudio]:
    """The studio of the small shot that the files share; what kills or stops a server begins its own."""
    shot = write_small_shot(tmp_path_factory.mktemp("studio") / "shot")
    with serving([shot], "studio") as running:
        yield OneStudio(shot.parent, running)


@pytest.fixture(scope="module")
def studio(begun_studio: OneStudio) -> OneStudio:
    """The same as it was begun, for one file of tests."""
    begun_studio.as_begun()
    return begun_studio


@pytest.fixture(scope="module")
def looked_studio(studio: OneStudio) -> OneStudio:
    """The same whose camera and light are known."""
    studio.look()
    return studio
