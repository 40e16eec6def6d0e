"""The studio when things break: its server killed while a job runs, uploads that never end."""

from __future__ import annotations

import asyncio
import http.client
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
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
    try:
        asyncio.run(asyncio.wait_for(routes.studio_application(studio)(scope, receive, send), 60))
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
