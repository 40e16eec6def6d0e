"""From releasing a dragged object in `relume studio` to its picture: the first, and the whole look. With `--drag`: how
many frames a second are drawn while one is dragged, in a window of 1920 × 1080.

The room's shot at 768×512. An object is dragged on the table by the pointer in a Chromium that draws by software, and
the page itself says when what is shown. Beside wall times stands the processor time of the worker, the server and the
browser, which other programs on the machine do not change as much.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Browser, sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from serving import Server, serving

ROOT = Path(__file__).resolve().parents[1]
FLAGS = ["--enable-unsafe-swiftshader", "--no-sandbox", "--disable-background-networking"]
MOVES = 8
STEPS = ("edited", "started", "rendered", "first picture", "around", "done", "whole look")
"""What is waited for: the shot file is written, the worker begun, its first picture written, that picture shown; then
what is about the pointer written; the worker done, its last picture shown."""
WATCHED = """() => new Promise((done) => {
  const s = relume.studio, number = s.state.job.number, revision = s.state.revision, found = {};
  const live = document.getElementById("live");
  let last = "";
  document.getElementById("picture").addEventListener("pointerup", () => {
    const begin = performance.now();
    const mark = (name) => (found[name] ??= (performance.now() - begin) / 1000);
    const look = () => {
      const { job } = s.state, mine = job.number > number;
      if (s.state.revision > revision) mark("edited");
      if (mine && job.status !== "waiting") mark("started");
      if (mine && (job.steps ?? []).includes("first picture")) mark("rendered");
      const shown = live.hidden && s.shownPath === "preview.exr" && s.canvas.settled && "rendered" in found;
      if (shown) mark("first picture");
      if ((job.steps ?? []).includes("around the pointer") && mine) mark("around");
      if (mine && job.status === "done" && !("done" in found)) {
        mark("done");
        fetch(`/pictures/${s.number}`).then((got) => got.json()).then((facts) => (last = facts.layers[0].digest));
      }
      if (shown && last && s.facts.get(s.number)?.layers[0].digest === last) {
        mark("whole look");
        return done(found);
      }
      if (mine && job.status === "failed") return done({ error: job.error });
      if (performance.now() - begin > 60000) return done({ error: `only ${Object.keys(found)} came` });
      setTimeout(look, 5);
    };
    look();
  }, { once: true });
})"""


SECONDS = 4.0
"""Of dragging."""
DRAGGED = """([seconds, x, y]) => new Promise((done) => {
  const picture = document.getElementById("picture");
  let frames = 0, begin = 0;
  const step = (now) => {
    if (!begin) begin = now;
    if (now - begin > 1000 * seconds) return done({ frames, seconds: (now - begin) / 1000 });
    const [clientX, clientY] = [x + 60 * Math.sin(frames / 9), y + 20 * Math.cos(frames / 9)];
    picture.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY, bubbles: true }));
    frames++;
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})"""
CARD = ["--use-angle=swiftshader"]
"""As if SwiftShader were a graphics card, which lays the window together too."""


def finished(server: Server, kind: str) -> None:
    while (job := server.json("/shot")["job"])["kind"] != kind or job["status"] not in ("done", "failed"):
        time.sleep(0.2)
    assert job["status"] == "done", job


def place_of(tab: Any, server: Server, number: int) -> tuple[float, float]:
    """Where in the window the middle of an object lies; the picture shown may be smaller than the plate."""
    facts, lens = server.json("/objects")["objects"][number], server.json("/shot")["measured"]["camera"]
    middle = (np.array(facts["low"]) + np.array(facts["high"])) / 2
    x, y, z = np.array(lens["rotation"]).T @ (middle - np.array(lens["position"]))
    (across, down), focal_length = lens["centre"], lens["focal_length"]
    return tuple(
        tab.evaluate(
            "([x, y, width]) => { const s = relume.studio, c = s.canvas, k = s.facts.get(s.number).size[0] / width;"
            "const p = c.toScreen(x * k, y * k), b = c.canvas.getBoundingClientRect(), d = c.width / b.width;"
            "return [b.left + p[0] / d, b.top + p[1] / d]; }",
            [across - focal_length * x / z, down + focal_length * y / z, lens["size"][0]],
        )
    )


def spent(process: int) -> float:
    counted = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    return sum(map(int, counted)) / os.sysconf("SC_CLK_TCK")


def looks(browser: Browser, server: Server) -> None:
    """Drag the mirrored ball to and fro."""
    session = browser.new_browser_cdp_session()

    def used() -> np.ndarray:
        of_browser = sum(each["cpuTime"] for each in session.send("SystemInfo.getProcessInfo")["processInfo"])
        (worker,) = server.workers()
        return np.array([spent(worker), spent(server.process.pid), of_browser])

    tab = browser.new_page(viewport={"width": 1280, "height": 720})
    tab.goto(server.address)
    tab.wait_for_selector("#steps button")
    tab.locator('#steps button:text-is("Objects")').click()
    begun = time.perf_counter()
    server.post("/jobs/start", {"kind": "look"})
    finished(server, "look")
    print(f"{time.perf_counter() - begun:.1f} s  the first look, from the photographs")
    seconds, work = [], []
    for move in range(MOVES + 1):
        while not tab.evaluate("relume.settled() && relume.studio.state.job.status === 'done'"):
            time.sleep(0.1)
        time.sleep(1)
        x, y = place_of(tab, server, 1)
        tab.evaluate(f"() => {{ window.found = ({WATCHED})(); }}")
        tab.mouse.move(x, y)
        tab.mouse.down()
        away = (9 + move) * (1 if move % 2 else -1)
        for step in range(1, 6):
            tab.mouse.move(x + away * step / 5, y)
        time.sleep(0.3)  # the last of the drag is drawn
        before = used()
        tab.mouse.up()
        found = tab.evaluate("() => window.found")
        assert "error" not in found, found
        if move:  # the first compiles what the look from the photographs had not
            seconds.append([found[name] for name in STEPS])
            work.append(used() - before)
    middle, least = np.median(seconds, axis=0), np.min(seconds, axis=0)
    for index, name in enumerate(STEPS):
        limit = " (limit 1)" if name == "first picture" else ""
        print(f"{middle[index]:.2f} s  from release to: {name}{limit}; at best {least[index]:.2f}")
    worker, own, of_browser = np.median(work, axis=0)
    print(
        f"{statistics.median(sum(each) for each in work):.2f} s  of processor time a look: worker {worker:.2f}, server "
        f"{own:.2f}, browser {of_browser:.2f}"
    )


def drags(browser: Browser, server: Server, label: str) -> None:
    """Drag the mirrored ball to and fro for some seconds."""
    session = browser.new_browser_cdp_session()

    def used() -> float:
        return sum(each["cpuTime"] for each in session.send("SystemInfo.getProcessInfo")["processInfo"])

    tab = browser.new_page(viewport={"width": 1920, "height": 1080})
    tab.goto(server.address)
    tab.wait_for_selector("#steps button")
    tab.locator('#steps button:text-is("Objects")').click()
    while not tab.evaluate("relume.settled() && !document.getElementById('live').hidden"):
        time.sleep(0.1)
    tab.locator("#objects-look").uncheck()
    for _ in range(2):
        time.sleep(2)
        x, y = place_of(tab, server, 1)
        tab.mouse.move(x, y)
        tab.mouse.down()
        before = used()
        found = tab.evaluate(DRAGGED, [SECONDS, x, y])
        spent = 1000 * (used() - before) / found["frames"]
        print(
            f"{found['frames'] / found['seconds']:.1f} frames/s  while one of five objects is dragged, {label} (limit "
            f"20): {spent:.0f} ms of the browser's processor time a frame"
        )
        tab.mouse.up()
    tab.close()


def main() -> None:
    chrome = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    said = subprocess.run([chrome, "--version"], capture_output=True, text=True).stdout.strip()
    print(f"{said}; {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; room at 768×512, {MOVES} moves, medians")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as started:
        room = Path(folder) / "room"
        shutil.copytree(ROOT / "examples" / "room", room)
        with serving([room / "shot.toml"], "studio") as server:
            if "--drag" in sys.argv[1:]:
                server.post("/jobs/start", {"kind": "look"})
                finished(server, "look")
            for label, flags in (("no graphics card", []), ("SwiftShader as one", CARD)):
                browser = started.chromium.launch(executable_path=chrome, args=[*FLAGS, *flags])
                if "--drag" in sys.argv[1:]:
                    drags(browser, server, label)
                elif not flags:
                    looks(browser, server)
                browser.close()


if __name__ == "__main__":
    main()
