"""The numbers of the page of `relume view`: installed size, first paint, a 24-megapixel map, frames, pixel read-out.

A Chromium of the machine draws WebGL by software (SwiftShader), and lays its windows together as it does where there
is no graphics card, or (`CARD`) by SwiftShader too, as the tests have it. Frames are counted over seconds of panning
and of turning the exposure in a window of 1920×1080, each frame asked for by the browser itself; beside them stands
the processor time of the browser's processes a frame, which other programs on the machine do not change as much as
wall time. A page whose one canvas is cleared in another colour each frame shows what the browser itself can do.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from playwright.sync_api import Browser, sync_playwright

import relume as rl

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from serving import Server, serving

ROOT = Path(__file__).resolve().parents[1]
SHARED = next((each / "shared" for each in (ROOT, ROOT.parent) if (each / "shared").exists()), ROOT / "shared")
FLAGS = ["--enable-unsafe-swiftshader", "--no-sandbox", "--disable-background-networking"]
CARD = ["--use-angle=swiftshader"]
"""As if SwiftShader were a graphics card."""
SECONDS = 4.0
"""Of panning, of exposure: each."""
MOVED = """([what, seconds]) => new Promise((done) => {
  const c = relume.canvas, gl = c.gl, one = new Uint8Array(4), times = [];
  let frames = 0, worked = 0, begin = 0;
  const step = (now) => {
    if (!begin) begin = now;
    if (now - begin > 1000 * seconds) return done({ frames, seconds: (now - begin) / 1000, script: worked / frames });
    const before = performance.now();
    if (what === "pan") c.pan(frames % 2 ? 7 : -5, frames % 3 ? 3 : -4);
    else if (what === "exposure") c.set({ stops: 3 * Math.sin(frames / 9) });
    else c.enlarge(frames % 80 < 40 ? 1.02 : 1 / 1.02, 700, 500);
    worked += performance.now() - before;
    frames++;
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})"""

BARE = """<!doctype html><style>html, body { margin: 0 } canvas { display: block }</style>
<canvas width=1920 height=1080></canvas><script>
const gl = document.querySelector("canvas").getContext("webgl2", { alpha: false, antialias: false });
const draw = (frame) => (gl.clearColor((frame % 50) / 50, 0.5, 0.3, 1), gl.clear(gl.COLOR_BUFFER_BIT));
</script>"""
CLEARED = """(seconds) => new Promise((done) => {
  let frames = 0, begin = 0;
  const step = (now) => {
    if (!begin) begin = now;
    if (now - begin > 1000 * seconds) return done({ frames, seconds: (now - begin) / 1000 });
    draw(frames++);
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})"""

MOVED_LIGHT = """([what, seconds]) => new Promise((done) => {
  const s = relume.state, first = s.pictures, turn = document.getElementById("turn");
  let begin = 0, n = 0;
  const step = (now) => {
    if (!begin) begin = now;
    if (now - begin > 1000 * seconds) return done({ pictures: s.pictures - first, seconds: (now - begin) / 1000 });
    if (what === "lamp") {
      s.lamps[0].direction = [Math.sin(n / 20), 0.3, Math.cos(n / 20)];
      const strength = document.getElementById("strength");
      strength.dispatchEvent(new Event("input"));
    } else {
      turn.value = String((n * 3) % 360 - 180);
      turn.dispatchEvent(new Event("input"));
    }
    n++;
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})"""


def large_map(rows: int, columns: int) -> np.ndarray:
    """Linear light over twelve stops, with detail in every pixel."""
    random = np.random.default_rng(1)
    smooth = np.exp2(np.linspace(-8, 4, columns, dtype=np.float32))[None, :, None]
    return smooth * random.uniform(0.5, 1.5, (rows, columns, 3)).astype(np.float32)


def requirements(names: list[str], extra: str = "") -> set[str]:
    """The distributions that these need, without optional parts; with those of one extra of the first."""
    found: set[str] = set()
    for name in names:
        for line in importlib.metadata.requires(name) or []:
            needed, _, condition = line.partition(";")
            if "extra" in condition and (not extra or not re.search(rf"extra\s*==\s*['\"]{extra}['\"]", condition)):
                continue
            distribution = re.split(r"[^\w.-]", needed.strip())[0].lower()
            try:
                importlib.metadata.distribution(distribution)
            except importlib.metadata.PackageNotFoundError:
                continue  # of another platform
            if distribution not in found:
                found |= {distribution} | requirements([distribution])
    return found


def size_of(distribution: str) -> int:
    files = importlib.metadata.files(distribution) or []
    return sum(place.stat().st_size for each in files if (place := Path(str(each.locate()))).is_file())


def installed() -> None:
    both, without = requirements(["relume"], "studio"), requirements(["relume"])
    of_extra = sorted(both - without)
    page = Path(rl.__file__).parent / "studio"
    own = sum(each.stat().st_size for each in page.rglob("*") if each.is_file() and each.suffix != ".pyc")
    total = sum(map(size_of, of_extra))
    print(f"{total / 1e6:.1f} MB  the extra: {', '.join(of_extra)} (limit 10); relume's own part {own / 1e6:.2f} MB")


@contextmanager
def chromium(*flags: str) -> Iterator[Browser]:
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with sync_playwright() as started:
        running = started.chromium.launch(executable_path=found, args=[*FLAGS, *flags])
        yield running
        running.close()


SHOWN = """() => new Promise((done) => {
  const look = () => (window.relume?.settled() ? done(true) : setTimeout(look, 5));
  look();
})"""


def settled(tab: Any) -> None:
    tab.evaluate(SHOWN)  # looked at in the page: to ask it from outside takes its time


def first_paint(browser: Browser, file: Path) -> None:
    """From the command's start to the picture in the page, the browser already running."""
    whole, address, painted = [], [], []
    person = browser.new_context(viewport={"width": 1280, "height": 720})
    for _ in range(5):
        begin = time.perf_counter()
        with serving([file]) as server:
            address.append(time.perf_counter() - begin)
            tab = person.new_page()
            tab.goto(server.address, wait_until="commit")
            settled(tab)
            whole.append(time.perf_counter() - begin)
            entries = "performance.getEntriesByName('first-contentful-paint').map((e) => e.startTime)[0]"
            painted.append(tab.evaluate(entries) / 1000)
            tab.close()
    print(
        f"{statistics.median(whole):.2f} s  command to picture (limit 1.5): address after "
        f"{statistics.median(address):.2f} s, first paint {statistics.median(painted):.2f} s after the page was asked"
    )


def opened(browser: Browser, file: Path) -> None:
    """A map of 24 megapixels: from asking for the page to its picture; the server reads the file in this time."""
    person = browser.new_context(viewport={"width": 1920, "height": 1080})
    begin = time.perf_counter()
    with serving([file]) as server:
        for which in ("the first time", "again"):
            asked = time.perf_counter()
            tab = person.new_page()
            tab.goto(server.address, wait_until="commit")
            settled(tab)
            seconds, whole = time.perf_counter() - asked, time.perf_counter() - begin
            spent = sum(map(int, Path(f"/proc/{server.process.pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]))
            print(
                f"{seconds:.2f} s  {file.name}, 6000×4000, {file.stat().st_size / 1e6:.0f} MB: asked to shown {which} "
                f"(limit 2), {whole:.2f} s after the command began; the server's processor time till then "
                f"{spent / os.sysconf('SC_CLK_TCK'):.2f} s"
            )
            tab.close()


def frames(server: Server, label: str, *flags: str) -> None:
    """Of the page, and of one that only clears its canvas."""
    with chromium(*flags) as browser:
        session = browser.new_browser_cdp_session()

        def used() -> float:
            return sum(each["cpuTime"] for each in session.send("SystemInfo.getProcessInfo")["processInfo"])

        def counted(name: str, script: str, given: object, limit: str) -> None:
            before = used()
            told = tab.evaluate(script, given)
            spent = 1000 * (used() - before) / told["frames"]
            print(
                f"{told['frames'] / told['seconds']:.0f} frames/s  {name} at 1920×1080, {label} ({limit}): {spent:.1f} "
                "ms of processor time a frame"
            )

        tab = browser.new_page(viewport={"width": 1920, "height": 1080})
        tab.set_content(BARE)
        counted("a canvas that is only cleared", CLEARED, SECONDS, "the browser's own")
        tab.goto(server.address)
        settled(tab)
        for name in ("fitted", "one to one"):
            tab.keyboard.press("f" if name == "fitted" else "1")
            settled(tab)
            for what in ("pan", "exposure"):
                counted(f"{what}, {name},", MOVED, [what, SECONDS], "limit 50")
                settled(tab)


def stage_folder(folder: Path, rows: int, columns: int) -> Path:
    """The head of ../shared/stages, enlarged to so many pixels, as a stage of its own."""
    head = SHARED / "stages" / "head"
    described = json.loads((head / "stage.json").read_text())
    field = rl.lightstage.read_stage(head)
    (folder / "olat").mkdir(parents=True)
    for index, entry in enumerate(described["lights"]):
        (picture,) = field.block(slice(index, index + 1), slice(0, field.shape[0]))
        large = cv2.resize(picture, (columns, rows), interpolation=cv2.INTER_CUBIC)
        rl.write(folder / entry["file"], rl.RadianceMap(np.maximum(large, 0)))
    (folder / "stage.json").write_text(json.dumps(described))
    return folder


def stage_pictures(browser: Browser, folder: Path) -> None:
    """Pictures a second while a lamp is dragged and while a map turns, as the page shows them."""
    stage, light = stage_folder(folder / "stage", 480, 720), SHARED / "data/hdri/three/quarry_01_1k.hdr"
    session = browser.new_browser_cdp_session()

    def used() -> float:
        return sum(each["cpuTime"] for each in session.send("SystemInfo.getProcessInfo")["processInfo"])

    with serving([stage, light]) as server:
        tab = browser.new_page(viewport={"width": 1280, "height": 720})
        tab.goto(server.address)
        while not tab.evaluate("window.relume?.state.facts?.step === 'ready'"):
            time.sleep(0.5)
        error = server.json("/stage")["error"]
        for what in ("lamp", "map"):
            if what == "map":
                tab.select_option("#map", "0")
            while not tab.evaluate("window.relume.settled()"):
                time.sleep(0.2)
            stat = Path(f"/proc/{server.process.pid}/stat")
            before, of_browser = sum(map(int, stat.read_text().rsplit(")", 1)[1].split()[11:13])), used()
            told = tab.evaluate(MOVED_LIGHT, [what, SECONDS])
            of_browser = 1000 * (used() - of_browser) / told["pictures"]
            size = "half" if tab.evaluate("relume.live.shown") else "whole"
            spent = sum(map(int, stat.read_text().rsplit(")", 1)[1].split()[11:13])) - before
            spent /= os.sysconf("SC_CLK_TCK") * told["pictures"]
            print(
                f"{told['pictures'] / told['seconds']:.0f} pictures/s  {what}, 288 lights, 480×720, while it moves at "
                f"{size} size (limit 30): {1000 * spent:.1f} and {of_browser:.1f} ms of the server's and the "
                f"browser's processor time a picture; error {error['random']:.2%} under light from everywhere, "
                f"{error['single']:.2%} under one"
            )
        tab.close()


def read_out(server: Server, pixels: np.ndarray) -> None:
    random = np.random.default_rng(3)
    wrong = 0
    for x, y in zip(random.integers(0, pixels.shape[1], 200), random.integers(0, pixels.shape[0], 200), strict=True):
        said = np.array(server.json(f"/pictures/0/value?x={x}&y={y}")["rgb"], np.float32)
        wrong += int((said.view(np.uint32) != pixels[y, x].view(np.uint32)).any())
    print(f"{wrong} of 200 pixels read out differ from the file's float32 in any bit (limit 0)")


def main() -> None:
    chrome = subprocess.run(["chromium", "--version"], capture_output=True, text=True).stdout.strip()
    print(f"Chromium {chrome}, SwiftShader; Python {sys.version.split()[0]}")
    installed()
    with tempfile.TemporaryDirectory() as folder:
        small, large = Path(folder) / "small.exr", Path(folder) / "large.exr"
        rl.write(small, rl.RadianceMap(large_map(512, 1024)))
        pixels = large_map(4000, 6000)
        rl.write(large, rl.RadianceMap(pixels))
        with chromium() as browser:
            first_paint(browser, small)
            opened(browser, large)
            with serving([large]) as server:
                read_out(server, pixels)
            if (SHARED / "stages" / "head").exists():
                stage_pictures(browser, Path(folder))
        with serving([large]) as server:
            frames(server, "no graphics card")
            frames(server, "SwiftShader as one", *CARD)


if __name__ == "__main__":
    main()
