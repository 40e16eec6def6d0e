"""The studio when things break: its server killed while a job runs, uploads that never end, a laptop that sleeps."""

from __future__ import annotations

import asyncio
import http.client
import os
import signal
import time
import tomllib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Tab, encoded
from one_studio import OneStudio
from serving import Server, serving, started
from small_shot import TEXT, write_small_shot

for needed in ("starlette", "uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")


def until(holds: Callable[[], Any], what: str, seconds: float = 120) -> Any:
    end = time.monotonic() + seconds
    while not (found := holds()):
        assert time.monotonic() < end, f"never came: {what}"
        time.sleep(0.02)
    return found


def edit(server: Server, place: list[Any], value: Any) -> int:
    revision = server.json("/shot")["revision"]
    return server.post("/shot/edit", {"revision": revision, "changes": [{"set": place, "value": value}]})[0]


def test_a_server_killed_while_a_job_runs_loses_nothing_and_the_next_goes_on(tmp_path: Path):
    shot = write_small_shot(tmp_path / "killed")
    out = shot.parent / "out"
    server = started([shot], "studio")
    try:
        assert edit(server, ["local", 0, "reflectance"], "recover") == 200
        assert edit(server, ["render", "samples"], 100_000) == 200
        assert server.post("/jobs/start", {"kind": "insert"})[0] == 200
        until(lambda: server.json("/shot")["job"].get("step") == "render", "the render")
        (worker,) = server.workers()
        text = shot.read_text(encoding="utf-8")
        os.kill(server.process.pid, signal.SIGKILL)
    finally:
        server.process.kill()
        server.process.wait(timeout=60)
    # Every act is in the file, whole; the worker finds its server gone and ends; what it kept can be read.
    assert shot.read_text(encoding="utf-8") == text
    assert 'reflectance = "recover"' in text and "samples = 100000" in text
    until(lambda: not _runs(worker), "the worker's end")
    server.process.communicate(timeout=60)  # the worker had its pipes too: they end with it
    assert not (out / "composite.exr").exists()
    kept = sorted(path.name for path in (out / "stages").rglob("*") if path.is_file())
    assert any("reflectance" in name for name in kept)
    # A new server on the same shot goes on with them, to the picture that was never interrupted.
    with serving([shot], "studio") as again:
        assert again.json("/shot")["fault"] is None and again.json("/shot")["undo"] == 0
        assert edit(again, ["render", "samples"], 8) == 200
        assert again.post("/jobs/start", {"kind": "insert"})[0] == 200
        job = until(lambda: (j := again.json("/shot")["job"])["status"] in ("done", "failed") and j, "the job's end")
        assert job["status"] == "done", job
        assert "reflectance" in job["result"]["kept"]
    fresh = rl.insert(rl.read_shot(shot), tmp_path / "fresh")
    assert "reflectance" not in fresh.kept
    found, expected = (rl.read_radiance(each / "composite.exr").radiance for each in (out, tmp_path / "fresh"))
    assert np.array_equal(found, expected)


def test_an_upload_that_says_no_length_is_refused_by_what_has_come(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from relume.studio.library import Library
    from relume.studio.shots import routes
    from relume.studio.shots.document import Document
    from relume.studio.shots.folder import Folder
    from relume.studio.shots.jobs import Jobs

    shot = write_small_shot(tmp_path / "shot")
    monkeypatch.setattr(routes, "LARGEST_UPLOAD", 1_000_000)
    jobs = Jobs(tmp_path)
    folder = Folder(shot.parent)
    studio = routes.Studio(folder, Document(shot), shot.parent / "out", tmp_path, Library(()), jobs)
    asked, said = 0, []

    async def receive() -> dict[str, Any]:
        nonlocal asked
        asked += 1
        return {"type": "http.request", "body": bytes(64_000), "more_body": True}  # without end

    async def send(message: Any) -> None:
        said.append(message)

    scope = {
        "type": "http", "method": "POST", "path": "/uploads", "query_string": b"name=endless.glb", "headers": [],
        "http_version": "1.1", "scheme": "http", "server": ("127.0.0.1", 80), "root_path": "",
    }  # fmt: skip
    answering = routes.studio_application(studio)
    try:
        # In a thread of its own, as the browser's loop may run in this one.
        with ThreadPoolExecutor(1) as own:
            own.submit(lambda: asyncio.run(asyncio.wait_for(answering(scope, receive, send), 60))).result()
    finally:
        jobs.close()
    assert said[0]["status"] == 413 and b"the file is too large; up to 1 MB are taken" in said[1]["body"]
    assert (b"connection", b"close") in said[0]["headers"]
    assert asked == 16  # 15 chunks of 64 kB are below a megabyte
    assert sorted(each.name for each in (shot.parent / "objects").iterdir()) == ["ball.glb"]


@pytest.mark.slow  # a gigabyte is written before it is refused
def test_two_gigabytes_without_a_length_are_refused_while_they_come(tmp_path: Path):
    shot = write_small_shot(tmp_path / "shot")
    with serving([shot], "studio") as server:
        speaking = http.client.HTTPConnection("127.0.0.1", server.port, timeout=120)
        sent = 0

        def chunks() -> Any:
            nonlocal sent
            piece = bytes(1024**2)
            for _ in range(2048):
                sent += len(piece)
                yield piece

        own = {"Origin": f"http://127.0.0.1:{server.port}", **server.cookie}
        try:
            speaking.request("POST", "/uploads?name=a.glb", chunks(), own, encode_chunked=True)
            answer = speaking.getresponse()
            assert answer.status == 413 and b"too large" in answer.read()
        except OSError:  # the server closed while the rest was on its way
            pass
        finally:
            speaking.close()
        assert sent < 1.1 * 1024**3
        assert sorted(each.name for each in (shot.parent / "objects").iterdir()) == ["ball.glb"]
        assert shot.read_text(encoding="utf-8") == TEXT
        assert server.json("/shot")["fault"] is None  # and it goes on


def _runs(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


# A closed laptop: the page, its connection or the server sleeps, and afterwards the page is at the truth again.

CONNECTIONS = """
const Plain = WebSocket;
window.sockets = [];
window.down = false;
window.WebSocket = function (address) {
  const made = new Plain(window.down ? address.replace("/events", "/nowhere") : address);
  window.sockets.push(made);
  return made;
};
Object.assign(window.WebSocket, { OPEN: 1 });
// A lost connection is tried again after a tenth of a second, not two; time passes faster where a test wants it so.
const later = window.setTimeout, now = performance.now.bind(performance);
window.setTimeout = (act, wait, ...rest) => later(act, wait === 2000 ? 100 : wait, ...rest);
let begun = 0, ahead = 0, rate = 1;
performance.now = () => now() + ahead + (rate - 1) * (now() - begun);
window.hurry = (factor) => {
  ahead += (rate - 1) * (now() - begun);
  begun = now();
  rate = factor;
};
"""


@contextmanager
def window(browser: Any, server: Server) -> Iterator[Tab]:
    """A window of its own, whose connection a test may cut."""
    context = browser.new_context()
    context.add_init_script(CONNECTIONS)
    tab = Tab(context.new_page())
    tab.tab.set_default_timeout(120_000)
    try:
        tab.tab.goto(server.address)
        tab.settle()
        tab.until(lambda: tab.tab.evaluate("() => sockets.length && sockets[0].readyState === 1"), "the connection")
        yield tab
    finally:
        context.close()


def is_at_the_truth(page: Tab, shot: Path) -> bool:
    """Whether the page holds what the file and the pictures hold now, and says nothing more."""
    rays = page.tab.evaluate("() => relume.studio.state.table.render?.samples")
    return rays == tomllib.loads(shot.read_text("utf-8"))["render"]["samples"] and page.text("#message") == ""


def write_plate(shot: Path, value: float) -> None:
    rl.write(shot.parent / "plate.exr", rl.RadianceMap(np.full((128, 192, 3), value, np.float32)))


def middle(page: Tab) -> float:
    """What the picture shows in its middle, at the exposure of the file."""
    page.tab.evaluate("() => relume.canvas.set({ stops: 0 })")
    return page.shown(96.5, 64.5)[0]


@pytest.fixture
def renewed(studio: OneStudio) -> Iterator[tuple[Path, Server]]:
    """The shot and the server that the files share, as they were begun before and after."""
    studio.as_begun()
    plate = (studio.folder / "plate.exr").read_bytes()
    yield studio.folder / "shot.toml", studio.server
    (studio.folder / "plate.exr").write_bytes(plate)


def test_a_window_whose_connection_was_lost_for_long_is_at_the_truth_again(browser: Any, renewed: tuple[Path, Server]):
    shot, server = renewed
    with window(browser, server) as page:
        page.tab.evaluate("() => relume.studio.show('plate.exr')")
        page.settle()
        page.tab.evaluate("() => { window.down = true; sockets.at(-1).close(); }")
        page.until(lambda: "relume has ended" in page.text("#message"), "the line")
        # Meanwhile: the shot and the picture that is shown are others, by others.
        assert edit(server, ["render", "samples"], 99) == 200
        write_plate(shot, 0.8)
        page.until(lambda: page.tab.evaluate("() => sockets.length") >= 3, "two tries in vain")
        assert page.tab.evaluate("() => relume.studio.state.table.render.samples") == 8
        assert "relume has ended" in page.text("#message")
        page.tab.evaluate("() => { window.down = false; }")
        page.until(lambda: is_at_the_truth(page, shot), "the truth")
        page.settle()
        page.until(lambda: abs(middle(page) - encoded([0.8])[0]) < 2, "the picture as it is now")
        # And it hears again, once of each thing.
        assert edit(server, ["render", "samples"], 77) == 200
        page.until(lambda: is_at_the_truth(page, shot), "the next edit")
        assert page.tab.evaluate("() => sockets.filter((each) => each.readyState === 1).length") == 1


def test_a_window_says_that_its_server_sleeps_and_what_was_done_meanwhile_is_done_after(
    browser: Any, renewed: tuple[Path, Server]
):
    shot, server = renewed
    with window(browser, server) as page:
        os.kill(server.process.pid, signal.SIGSTOP)
        try:
            # Five times as fast it would take itself for one that slept.
            page.tab.evaluate("() => hurry(3)")
            page.until(lambda: "does not answer now" in page.text("#message"), "the line")
            page.tab.evaluate("() => hurry(1)")
            # An act of the page, and one of an editor.
            page.tab.evaluate("() => { relume.studio.edit([{ set: ['render', 'seed'], value: 5 }]); }")
            text = shot.read_text("utf-8")
            assert "seed" not in text
        finally:
            os.kill(server.process.pid, signal.SIGCONT)
        page.until(lambda: page.text("#message") == "", "the line's end")
        page.settle()
        assert "seed = 5" in shot.read_text("utf-8")
        shot.write_text(shot.read_text("utf-8").replace("samples = 8", "samples = 12"), "utf-8")
        page.until(lambda: is_at_the_truth(page, shot), "the truth")
        assert page.tab.evaluate("() => relume.studio.state.table.render.seed") == 5


@pytest.mark.slow
def test_a_window_that_slept_looks_again_at_everything_and_says_nothing(browser: Any, tmp_path: Path):
    shot = write_small_shot(tmp_path / "shot")
    with serving([shot], "studio") as server, window(browser, server) as page:
        page.tab.evaluate(
            "() => { window.said = []; new MutationObserver(() => said.push(document.getElementById('message')"
            ".textContent)).observe(document.getElementById('message'), { childList: true });"
            " window.looked = 0; const plain = relume.studio.lookAgain.bind(relume.studio);"
            " relume.studio.lookAgain = (line) => { looked++; return plain(line); }; }"
        )
        session = page.tab.context.new_cdp_session(page.tab)
        session.send("Debugger.enable")
        session.send("Debugger.pause")  # its script stands still, as of a page that sleeps
        page.tab.wait_for_timeout(10)
        assert edit(server, ["render", "samples"], 99) == 200
        time.sleep(10)  # longer than the silence that is said
        session.send("Debugger.disable")
        page.until(lambda: is_at_the_truth(page, shot), "the truth")
        page.until(lambda: page.tab.evaluate("() => looked") >= 1, "another look")
        assert not any("relume" in line for line in page.tab.evaluate("() => said"))
