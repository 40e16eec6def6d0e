"""`relume studio`'s server from outside: who is let in, what it refuses, and that its results are the command's."""

from __future__ import annotations

import json
import os
import shutil
import signal
import struct
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from one_studio import OneStudio
from relume.studio.shots.ball import unwrapped
from serving import Server
from small_shot import TEXT

for needed in ("starlette", "uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

ROOM = Path(__file__).resolve().parents[2] / "examples" / "room"
POSTS = ["/shot/edit", "/shot/undo", "/opened", "/ball", "/board", "/light/mirrored", "/light/edited", "/light/slice",
         "/light/painted", "/light/frame", "/jobs/start", "/jobs/stop",
         "/uploads?name=a.glb", "/occluder"]  # fmt: skip
GETS = ["/", "/shot", "/brackets", "/thumbnail?path=plate.exr", "/objects", "/objects/0", "/occluder?path=plate.exr",
        "/results/report.html"]  # fmt: skip


@pytest.fixture(scope="module")
def folder(studio: OneStudio) -> Iterator[Path]:
    place = studio.folder
    (place.parent / "secret.jpg").write_bytes((ROOM / "plate_grid.jpg").read_bytes())
    (place / "link.jpg").symlink_to(place.parent / "secret.jpg")
    (place / "elsewhere").symlink_to(place.parent)
    yield place
    for link in ("link.jpg", "elsewhere"):
        (place / link).unlink()


@pytest.fixture(scope="module")
def server(folder: Path, studio: OneStudio) -> Server:
    return studio.server


def until(holds: Callable[[], Any], what: str, seconds: float = 120) -> Any:
    end = time.monotonic() + seconds
    while not (found := holds()):
        assert time.monotonic() < end, f"never came: {what}"
        time.sleep(0.05)
    return found


def finished(server: Server) -> dict[str, Any]:
    def job() -> dict[str, Any] | None:
        state = server.json("/shot")["job"]
        return state if state["status"] in ("done", "failed", "stopped") else None

    return until(job, "the job's end")


def edit(server: Server, *changes: dict[str, Any]) -> tuple[int, Any]:
    revision = server.json("/shot")["revision"]
    return server.post("/shot/edit", {"revision": revision, "changes": list(changes)})


# Who is let in


@pytest.mark.parametrize("path", GETS + POSTS)
def test_strangers_are_refused(server: Server, path: str):
    method = "POST" if path in POSTS else "GET"
    own = {"Origin": f"http://127.0.0.1:{server.port}"}
    assert server.ask(path, method=method, body=b"{}", **own)[0] == 403
    foreign = {**server.cookie, "Host": f"evil.example:{server.port}", "Origin": f"http://evil.example:{server.port}"}
    assert server.ask(path, method=method, body=b"{}", **foreign)[0] == 403


@pytest.mark.parametrize("path", POSTS)
@pytest.mark.parametrize("origin", ["http://evil.example", "null", None])
def test_pages_of_other_origins_change_nothing(server: Server, folder: Path, path: str, origin: str | None):
    given = {} if origin is None else {"Origin": origin}
    assert server.ask(path, method="POST", body=b"{}", **server.cookie, **given)[0] == 403
    assert (folder / "shot.toml").read_text(encoding="utf-8") == TEXT


def test_a_websocket_of_another_origin_is_refused(server: Server):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    for origin in ("http://evil.example", "null"):
        with pytest.raises(InvalidStatus) as refused:
            connect(
                f"ws://127.0.0.1:{server.port}/events", additional_headers={**server.cookie, "Origin": origin}
            ).close()
        assert refused.value.response.status_code == 403


# Files below the folder alone

OUTSIDE = ["../secret.jpg", "%2e%2e/secret.jpg", "..%2fsecret.jpg", "/etc/passwd", "%2fetc%2fpasswd", "..\\secret.jpg",
           "link.jpg", "elsewhere/secret.jpg", "objects/../../secret.jpg", "", "objects%00", "nothing.jpg"]  # fmt: skip


@pytest.mark.parametrize("name", OUTSIDE)
def test_no_name_leads_out_of_the_folder(server: Server, name: str):
    from urllib.parse import unquote

    assert server.ask(f"/occluder?path={name}", **server.cookie)[0] == 404
    status, _, body = server.ask(f"/thumbnail?path={name}", **server.cookie)
    assert status == 404 and b"root:" not in body
    for path, key in (("/opened", "path"), ("/ball", "path"), ("/board", "photograph")):
        assert server.post(path, {key: unquote(name), "squares": [9, 6], "square": 0.03})[0] == 404
        assert server.post(path, {key: name, "squares": [9, 6], "square": 0.03})[0] == 404
    for where in ("results", "scratch"):
        assert server.post("/opened", {"path": unquote(name), "where": where})[0] == 404
    assert server.ask(f"/results/{name}", **server.cookie)[0] in (404, 403)


@pytest.mark.parametrize("name", ["/etc/passwd", "../secret.jpg", "objects/../../secret.jpg"])
def test_an_edit_names_no_file_outside(server: Server, folder: Path, name: str):
    status, answer = edit(server, {"append": ["objects"], "value": {"mesh": name}})
    assert status == 422 and "is not below" in answer["error"]
    assert (folder / "shot.toml").read_text(encoding="utf-8") == TEXT


def test_uploads_get_names_of_their_own_and_overwrite_nothing(server: Server, folder: Path):
    kept = (folder / "objects" / "ball.glb").read_bytes()
    made = []
    for name in ("..%2F..%2Fball.glb", "ball.glb", "%2Fetc%2F%C3%A4%20b%3B%24(x).obj", ".glb"):
        status, answer = server.post(f"/uploads?name={name}", b"not a mesh")
        assert status in (200, 422)
        if status == 200:
            made.append(answer["path"])
    try:
        assert made == ["objects/ball-2.glb", "objects/ball-3.glb", "objects/b_x.obj"]
        assert (folder / "objects" / "ball.glb").read_bytes() == kept
    finally:
        for each in made:
            (folder / each).unlink()
    for name in ("x.py", "shot.toml", "x.html", "x", "x.glb%00.sh"):
        assert server.post(f"/uploads?name={name}", b"x")[0] == 422
    assert sorted(each.name for each in (folder / "objects").iterdir()) == ["ball.glb"]


def test_a_matte_that_is_no_png_is_refused(server: Server, folder: Path):
    for content in (b"", b"<svg/>", b"\x89PNG\r\n\x1a\nbroken"):
        status, answer = server.post("/occluder", content)
        assert status == 422 and len(answer["error"].splitlines()) == 1
    assert not list((folder / "mattes").glob("*"))


def test_two_gigabytes_are_refused_before_they_are_sent(server: Server, folder: Path):
    own = {"Origin": f"http://127.0.0.1:{server.port}", **server.cookie, "Content-Length": str(2 * 1024**3)}
    status, _, body = server.ask("/uploads?name=a.glb", method="POST", body=b"", **own)
    assert status == 413 and b"is too much" in body
    assert not (folder / "objects" / "a.glb").exists()


def test_a_picture_of_65500_by_65500_pixels_is_one_line(server: Server, folder: Path):
    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 65500, 65500, 8, 2, 0, 0, 0))
    picture = folder / "large.png"
    picture.write_bytes(
        b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
    )
    try:
        status, _, body = server.ask("/thumbnail?path=large.png", **server.cookie)
        assert status == 422 and b"large.png" in body and b"Traceback" not in body
        assert server.post("/ball", {"path": "large.png"})[0] == 422
        found = server.json("/brackets")["brackets"]
        assert any("large.png" in each["name"] for each in found)
    finally:
        picture.unlink()


@pytest.mark.parametrize(
    "body", [b"[]", b"{", b'{"by": NaN}', b"{" * 100_000, b'{"by": "x"}', b'"' + b"x" * 2_000_000 + b'"']
)
def test_what_is_no_request_is_one_line(server: Server, body: bytes):
    status, answer = server.post("/shot/undo", body)
    assert status in (400, 413, 422) and len(answer["error"].splitlines()) == 1


def test_other_machines_are_let_in_only_when_that_is_meant(folder: Path, tmp_path: Path):
    with pytest.raises(
        ValueError, match=r"host is 0\.0\.0\.0, which other machines reach; whoever has the address then"
    ):
        rl.open_studio(folder, host="0.0.0.0", open_browser=False)
    with pytest.raises(rl.errors.UnreadableFile, match="no such shot file"):
        rl.open_studio(tmp_path / "none.toml", open_browser=False)
    with pytest.raises(ValueError, match="neither a folder nor a shot file"):
        rl.open_studio(folder / "plate.exr", open_browser=False)


# What it answers


def test_brackets_are_found_with_their_exposures(tmp_path: Path):
    from relume.studio.shots.folder import Folder
    from relume.studio.shots.photographs import brackets

    for name in ("plate", "ball_0"):
        shutil.copytree(ROOM / name, tmp_path / name)
    shutil.copy(ROOM / "plate_grid.jpg", tmp_path)
    (tmp_path / "out").mkdir()
    shutil.copy(ROOM / "plate_grid.jpg", tmp_path / "out")
    (tmp_path / "broken.jpg").write_bytes(b"\xff\xd8\xff" + bytes(50))
    found = {each["name"]: each for each in brackets(Folder(tmp_path.resolve()), tmp_path.resolve() / "out")}
    assert found["plate"]["patterns"] == ["plate/*.jpg"] and found["ball_0"]["patterns"] == ["ball_0/*.jpg"]
    assert [frame["seconds"] for frame in found["plate"]["frames"]] == [0.25, 1.0, 4.0, 16.0]
    assert found["plate_grid.jpg"]["patterns"] == ["plate_grid.jpg"] and len(found["ball_0"]["frames"]) == 9
    assert any("broken.jpg" in str(each) for each in found.values())


def test_brackets_of_one_folder_have_names_of_their_own(tmp_path: Path):
    from relume.studio.shots.folder import Folder
    from relume.studio.shots.photographs import brackets

    for name, frames in (("plate", (1, 2)), ("ball_0", (3, 5, 7))):
        for number in frames:
            shutil.copy(ROOM / name / f"IMG_{number:04d}.jpg", tmp_path / f"{name[0]}{number}.jpg")
    found = {each["name"]: each["patterns"] for each in brackets(Folder(tmp_path.resolve()), tmp_path / "out")}
    assert found == {
        f"{tmp_path.name}, p1 … p2": ["p1.jpg", "p2.jpg"],
        f"{tmp_path.name}, b3 … b7": ["b3.jpg", "b5.jpg", "b7.jpg"],
    }


def test_two_windows_see_each_others_edits_and_the_later_of_two_is_refused(server: Server, folder: Path):
    from websockets.sync.client import connect

    def heard(window: Any) -> Any:
        """The next words that are more than that the server is there."""
        while "state" not in (said := json.loads(window.recv(timeout=10))):
            assert said == {"alive": True}
        return said

    own = {"Origin": f"http://127.0.0.1:{server.port}", **server.cookie}
    address = f"ws://127.0.0.1:{server.port}/events"
    with connect(address, additional_headers=own) as one, connect(address, additional_headers=own) as other:
        begun = [heard(window)["state"]["revision"] for window in (one, other)]
        assert begun[0] == begun[1]
        changes = [{"set": ["render", "samples"], "value": 9}]
        assert server.post("/shot/edit", {"revision": begun[0], "changes": changes})[0] == 200
        for window in (one, other):
            state = heard(window)["state"]
            assert (state["revision"], state["table"]["render"]["samples"]) == (begun[0] + 1, 9)
        status, answer = server.post("/shot/edit", {"revision": begun[1], "changes": changes})
        assert status == 409 and answer["error"].startswith("shot.toml was changed meanwhile")
        # By hand, while both are open.
        text = (folder / "shot.toml").read_text(encoding="utf-8").replace("samples = 9", "samples = 10")
        (folder / "shot.toml").write_text(text, encoding="utf-8")
        for window in (one, other):
            assert heard(window)["state"]["table"]["render"]["samples"] == 10
        assert server.post("/shot/undo", {"by": 1000})[0] == 200
    assert (folder / "shot.toml").read_text(encoding="utf-8") == TEXT


def test_a_ball_is_sought_with_its_lens_in_pixels(monkeypatch, tmp_path: Path):
    photograph, known = ROOM / "ball_0" / "IMG_0005.jpg", []

    def sought(*_: Any, focal_length: float, **__: Any) -> None:
        known.append(focal_length)
        raise rl.errors.BallNotFound("enough")

    monkeypatch.setattr(rl, "unwrap_ball", sought)
    with pytest.raises(rl.errors.BallNotFound):
        unwrapped(photograph, None, tmp_path / "light.exr")
    # 335 mm, by EXIF.
    assert known == [pytest.approx(5960.26, abs=0.01)]


def test_an_objects_triangles_are_where_the_job_has_them(server: Server, folder: Path):
    found = server.json("/objects")
    content = server.ask("/objects/0", **server.cookie)[2]
    (number,) = np.frombuffer(content, "<u4", 1)
    vertices = np.frombuffer(content, "<f4", 9 * number, 4).reshape(-1, 9)
    corners = vertices[np.frombuffer(content, "<u4", offset=4 + 36 * number)].reshape(-1, 3, 9)
    mesh = rl.report.placed_meshes(rl.read_shot(folder / "shot.toml"))[0]
    assert np.array_equal(corners[..., :3], mesh.vertices[mesh.faces])
    assert found["objects"][0]["foot"] == pytest.approx([0, 0, 0], abs=1e-6) and "gold" in found["presets"]
    assert server.ask("/objects/1", **server.cookie)[0] == 404


def test_what_is_dragged_is_lit_as_the_light_is_and_shaded_from_its_lamp():
    from relume.studio.shots.measured import irradiance_facts, lamp_direction

    radiance = np.full((64, 128, 3), 0.1, np.float32)
    radiance[10:12, 100:102] = 100
    light = rl.EnvironmentMap(radiance)
    x, y, z = normal = np.array([0.3, 0.8, -0.52]) / np.linalg.norm([0.3, 0.8, -0.52])
    terms = np.array([1, x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1])
    assert terms @ irradiance_facts(light) == pytest.approx(light.irradiance(normal), rel=0.02)
    towards = rl.mappings.pixel_directions(light.mapping, 64)[10:12, 100:102].mean((0, 1))
    assert lamp_direction(light) == pytest.approx(towards / np.linalg.norm(towards), abs=0.02)


# Jobs


def test_the_pages_picture_is_the_commands_and_neither_renders_what_the_other_did(
    server: Server, folder: Path, tmp_path: Path
):
    assert server.post("/jobs/start", {"kind": "insert"})[0] == 200
    job = finished(server)
    assert job["status"] == "done", job
    assert set(job["result"]["camera"]["position"]) == {0.1, 0.5, 1.0} and "render" in job["result"]["seconds"]
    kept = rl.insert(rl.read_shot(folder / "shot.toml"), folder / "out")
    assert "render" in kept.kept or "change" in kept.kept
    fresh = rl.insert(rl.read_shot(folder / "shot.toml"), tmp_path / "fresh")
    assert not fresh.kept
    for name in ("composite.exr", "composite.png"):
        page, command = rl.read(folder / "out" / name), rl.read(tmp_path / "fresh" / name)
        one, other = (each.radiance if isinstance(each, rl.RadianceMap) else each.pixels for each in (page, command))
        assert np.array_equal(one, other)
    # And the other way round: what the command made the page takes.
    server.post("/jobs/start", {"kind": "insert"})
    assert set(kept.kept) <= set(finished(server)["result"]["kept"])
    status, headers, body = server.ask("/results/report.html", **server.cookie)
    assert status == 200 and b"<html" in body and "sandbox" in headers["content-security-policy"]


def test_the_latest_job_wins_a_killed_worker_is_one_line_and_nothing_is_lost(server: Server, folder: Path):
    edit(server, {"set": ["render", "samples"], "value": 200_000})
    try:
        server.post("/jobs/start", {"kind": "insert"})
        first = until(lambda: (j := server.json("/shot")["job"])["status"] == "running" and j["step"] and j, "a step")
        # Another act, another job: the first makes way.
        server.post("/jobs/start", {"kind": "insert"})
        second = until(
            lambda: (j := server.json("/shot")["job"])["number"] > first["number"] and j["step"] and j, "the next"
        )
        assert second["status"] == "running"
        workers = server.workers()
        assert len(workers) == 1
        os.kill(workers[0], signal.SIGKILL)
        job = finished(server)
        assert job["status"] == "failed" and len(job["error"].splitlines()) == 1
        assert job["error"].startswith("the worker process ended by signal 9")
    finally:
        server.post("/shot/undo", {"by": 1000})
    assert (folder / "shot.toml").read_text(encoding="utf-8") == TEXT
    server.post("/jobs/start", {"kind": "check"})
    assert finished(server)["status"] == "done"


def test_a_job_for_an_unfinished_shot_is_refused(server: Server, folder: Path):
    revision = server.json("/shot")["revision"]
    changes = [{"remove": ["light", "map"]}]
    server.post("/shot/edit", {"revision": revision, "changes": changes, "unfinished": True})
    status, answer = server.post("/jobs/start", {"kind": "insert"})
    assert status == 422 and answer["error"].startswith("the shot is not finished: light")
    server.post("/shot/undo", {"by": 1})
    assert server.post("/jobs/start", {"kind": "rm -rf"})[0] == 422
