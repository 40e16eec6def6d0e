"""The server of a place file from outside: who is let in, edits, undo, the job and what it finds, faults."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import place_shoot
import relume as rl
from serving import Server, serving

for needed in ("starlette", "uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

PLACES = Path(__file__).resolve().parents[3] / "examples" / "places"
TEXT = (PLACES / "chapel.toml").read_text(encoding="utf-8")
POSTS = ["/place/edit", "/place/undo", "/opened", "/jobs/start", "/jobs/stop"]
GETS = ["/", "/place", "/photographs", "/place/body?block=nave", "/photographs/0"]
FRONT_TOP = ["marks", "front_left", "tower", "front_top"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("marks") / "places"
    shutil.copytree(PLACES / "photographs", place / "photographs")
    (place.parent / "secret.jpg").write_bytes((PLACES / "photographs" / "above.jpg").read_bytes())
    (place / "chapel.toml").write_text(TEXT, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def running(folder: Path) -> Iterator[Server]:
    with serving([folder / "chapel.toml"], "studio") as server:
        yield server


@pytest.fixture
def server(running: Server) -> Server:
    running.post("/place/undo", {"by": 10_000})
    return running


def edit(server: Server, *changes: dict[str, Any]) -> tuple[int, Any]:
    revision = server.json("/place")["revision"]
    return server.post("/place/edit", {"revision": revision, "changes": list(changes)})


def solved(server: Server) -> dict[str, Any]:
    """The job's end."""
    status, answer = server.post("/jobs/start")
    assert status == 200, answer
    end = time.monotonic() + 180
    while True:
        job = server.json("/place")["job"]
        if job["number"] == answer["number"] and job["status"] in ("done", "failed", "stopped"):
            return job
        assert time.monotonic() < end, job
        time.sleep(0.05)


@pytest.mark.parametrize("path", GETS + POSTS)
def test_strangers_are_refused(server: Server, path: str):
    method = "POST" if path in POSTS else "GET"
    own = {"Origin": f"http://127.0.0.1:{server.port}"}
    assert server.ask(path, method=method, body=b"{}", **own)[0] == 403
    if path in POSTS:
        for origin in ({"Origin": "http://evil.example"}, {}):
            assert server.ask(path, method="POST", body=b"{}", **server.cookie, **origin)[0] == 403


def test_what_a_place_holds_before_it_is_solved(server: Server):
    state = server.json("/place")
    assert state["fault"] is None and state["found"] is None and state["there"] == [True] * 5
    assert state["lacks"] == "nothing was found in it yet; solve it"
    assert state["bodies"]["roof"]["edges"][-1] == "back_right" and "ridge" in state["bodies"]["roof"]["edges"]
    assert state["bodies"]["well"] == {
        "edges": ["ring_0", "ring_1"], "corners": [], "curved": ["ring_0", "ring_1", "bottom", "top"]
    }  # fmt: skip
    body = server.json("/place/body?block=nave")
    front = [body["vertices"][i] for i in body["edges"]["front_top"]]
    assert front == [[0, 1, 1], [1, 1, 1]]
    assert server.ask("/place/body?block=none", **server.cookie)[0] == 404


def test_a_mark_is_written_undone_and_done_again(server: Server, folder: Path):
    path = folder / "chapel.toml"
    status, state = edit(server, {"set": FRONT_TOP, "value": [[690.123, 243], [831.5, 287.25]]})
    assert status == 200 and state["undo"] >= 1
    expected = TEXT.replace("[[692.67, 242.53], [830.14, 287.18]]", "[[690.12, 243.0], [831.5, 287.25]]")
    assert path.read_text(encoding="utf-8") == expected != TEXT
    assert server.post("/place/undo", {"by": 1})[0] == 200
    assert path.read_text(encoding="utf-8") == TEXT
    assert server.post("/place/undo", {"by": -1})[0] == 200
    assert path.read_text(encoding="utf-8") == expected


def test_an_edit_of_an_older_text_is_a_conflict(server: Server):
    stale = server.json("/place")["revision"] - 1
    status, answer = server.post("/place/edit", {"revision": stale, "changes": [{"remove": FRONT_TOP}]})
    assert status == 409 and "changed meanwhile" in answer["error"]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"set": ["marks", "front_left", "tower", "frnt_top"], "value": [[1, 2]]}, "did you mean front_top"),
        ({"set": ["marks", "front_lef", "tower", "front_top"], "value": [[1, 2]]}, "did you mean front_left"),
        ({"set": ["marks", "above", "tower", "front_left_top"], "value": [[1, 2], [3, 4]]}, "a corner is one point"),
        ({"append": ["blocks"], "value": {"name": "nave", "kind": "box"}}, "two blocks are named 'nave'"),
        ({"append": ["blocks"], "value": {"name": "x", "kind": "ball"}}, "blocks.7.kind"),
        ({"set": ["blocks", 5, "width"], "value": "towr.width"}, "did you mean tower"),
        ({"set": ["blocks", 5, "bottom"], "value": 1.0}, "leave bottom, centre_y and top out"),
        ({"remove": ["blocks", 4]}, "tower"),
        ({"set": ["photographs", 0, "file"], "value": "../secret.jpg"}, "is not below"),
        ({"set": ["photographs", 0, "file"], "value": "/etc/passwd"}, "is not below"),
    ],
)
def test_what_would_make_it_wrong_is_one_line_and_changes_nothing(
    server: Server, folder: Path, change: dict[str, Any], line: str
):
    status, answer = edit(server, change)
    assert status == 422 and line in answer["error"] and len(answer["error"].splitlines()) == 1
    assert (folder / "chapel.toml").read_text(encoding="utf-8") == TEXT


def test_photographs_are_shown_by_their_number_alone(server: Server):
    status, headers, content = server.ask("/photographs/4", **server.cookie)
    assert status == 200 and headers["content-type"] == "image/jpeg" and content[:2] == b"\xff\xd8"
    assert server.ask("/photographs/5", **server.cookie)[0] == 404
    number = server.post("/opened", {"photograph": 0})[1]["number"]
    assert server.json(f"/pictures/{number}")["size"] == [1200, 900]
    for other in (5, -1, "above", "../secret.jpg", None):
        assert server.post("/opened", {"photograph": other})[0] == 404


def test_solving_writes_what_model_place_writes_and_the_page_sees_it(server: Server, folder: Path, tmp_path: Path):
    path = folder / "chapel.toml"
    job = solved(server)
    assert job["status"] == "done" and job["result"]["doubts"] == []
    shutil.copytree(folder / "photographs", tmp_path / "photographs")
    (tmp_path / "chapel.toml").write_text(TEXT, encoding="utf-8")
    place = rl.model_place(tmp_path / "chapel.toml", out=tmp_path / "chapel.toml")
    assert path.read_text(encoding="utf-8") == (tmp_path / "chapel.toml").read_text(encoding="utf-8")
    state = server.json("/place")
    assert not state["stale"] and state["lacks"] is None
    found = state["found"]
    assert found["blocks"]["tower"]["size"] == pytest.approx([7, 15, 6], rel=0.003)
    assert found["blocks"]["nave"]["deviation"][2] == 0  # was given
    camera = place.photograph("front_left").camera
    ends = camera.project(place.block("tower").edges["front_top"])
    assert found["lines"]["front_left"]["tower"]["front_top"] == pytest.approx(ends, abs=0.006)
    assert len(found["lines"]["above"]["well"]["ring_1"]) == 97
    mark = next(m for m in place.marks if (m.photograph, m.block, m.edge) == ("above", "well", "ring_1"))
    assert found["distances"]["above"]["well"]["ring_1"] == pytest.approx(mark.distances, abs=6e-4)
    # A mark that is moved is as far off at once, and what was found is of before.
    at = [list(p) for p in ([690.67, 242.53], [828.14, 287.18])]
    state = edit(server, {"set": FRONT_TOP, "value": at})[1]
    assert state["stale"] and state["found"]["blocks"] == found["blocks"]
    before, now = (each["distances"]["front_left"]["tower"]["front_top"] for each in (found, state["found"]))
    across = 2 * (287.18 - 242.53) / np.hypot(830.14 - 692.67, 287.18 - 242.53)
    assert all(np.isclose(abs(a - b), across, atol=0.03) or np.isclose(a + b, across, atol=0.03)
               for a, b in zip(before, now, strict=True))  # fmt: skip
    text = path.read_text(encoding="utf-8")
    assert text.index("[[690.67, 242.53], [828.14, 287.18]]") < text.index("# Found by")
    # A block that was added is said to be new; undone, all is as it was found.
    state = edit(server, {"append": ["blocks"], "value": {"name": "porch", "kind": "wall"}})[1]
    assert state["found"] is None and state["lacks"] == "block 'porch' was added since it was solved; solve it"
    state = server.post("/place/undo", {"by": 2})[1]
    assert not state["stale"] and state["found"]["blocks"] == found["blocks"]


def test_a_job_that_is_stopped_ends_and_the_next_one_begins(server: Server):
    for _ in range(3):
        assert server.post("/jobs/start")[0] == 200
        assert server.post("/jobs/stop")[0] == 200
    assert solved(server)["status"] == "done"


def test_a_photograph_is_left_out_with_its_marks_and_taken_in_again(server: Server, folder: Path):
    assert server.json("/photographs") == {"files": []}
    status, state = edit(server, {"remove": ["marks", "right"]}, {"remove": ["photographs", 2]})
    assert status == 200 and [each["name"] for each in state["table"]["photographs"]] == [
        "front_left", "front_right", "back_left", "above"
    ]  # fmt: skip
    assert "right" not in state["table"]["marks"] and len(state["table"]["marks"]) == 4
    assert server.json("/photographs") == {"files": ["photographs/right.jpg"]}
    text = (folder / "chapel.toml").read_text(encoding="utf-8")
    assert "# Marks, which figures.py writes anew" in text and "# metres: the only length" in text
    value = {"name": "right", "file": "photographs/right.jpg"}
    assert edit(server, {"append": ["photographs"], "value": value})[0] == 200
    added = '[[photographs]]\nname = "right"\nfile = "photographs/right.jpg"\n\n[[blocks]]'
    assert added in (folder / "chapel.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def sketching(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Server]]:
    """A place file whose photographs are not there, and its server."""
    path = tmp_path_factory.mktemp("sketch") / "place.toml"
    path.write_text(place_shoot.toml(), encoding="utf-8")
    with serving([path], "studio") as running:
        yield path, running


@pytest.fixture
def sketch(sketching: tuple[Path, Server]) -> tuple[Path, Server]:
    path, server = sketching
    path.write_text(place_shoot.toml(), encoding="utf-8")
    assert server.json("/place")["fault"] is None
    return path, server


def test_a_size_that_is_not_determined_is_one_line(sketch: tuple[Path, Server]):
    path, server = sketch
    text = re.sub(r"(?m)^(front|back|left|right)_top = .*\n", "", place_shoot.toml())
    text = re.sub(r"(?m)^(front|back)_(left|right) = .*\n", "", text)
    path.write_text(text, encoding="utf-8")
    assert server.json("/place")["there"] == [False] * 5
    assert server.ask("/photographs/0", **server.cookie)[0] == 404
    job = solved(server)
    assert job["status"] == "failed"
    assert job["error"].startswith("height of block 'tower' is not determined: mark an edge at the top or bottom")
    assert path.read_text(encoding="utf-8") == text
    # A file that others break is said to be broken, and nothing is solved.
    path.write_text(text + "\nbroken = [", encoding="utf-8")
    state = server.json("/place")
    assert "not valid TOML" in state["fault"] and list(state["bodies"]) == ["house", "roof", "tower", "annex"]
    status, answer = server.post("/jobs/start")
    assert status == 422 and "the place file is not sound" in answer["error"]


@pytest.mark.parametrize("photographs", ["3", '"a.jpg"', '["a.jpg", 3]', "{ file = 3 }"])
def test_photographs_that_are_no_tables_are_a_fault_and_the_page_goes_on(sketch: tuple[Path, Server], photographs: str):
    path, server = sketch
    text = re.sub(r"(?ms)^\[\[photographs\]\].*?(?=^\[(?!\[photographs))", "", place_shoot.toml())
    path.write_text(f"photographs = {photographs}\n{text}", encoding="utf-8")
    state = server.json("/place")
    assert "photographs" in state["fault"] and not any(state["there"])
    assert server.ask("/photographs/0", **server.cookie)[0] == 404
    assert server.json("/photographs") == {"files": []}


def test_what_is_no_place_to_mark_is_refused_before_a_page_opens(tmp_path: Path):
    path = tmp_path / "place.toml"
    path.write_text(place_shoot.toml(), encoding="utf-8")
    with pytest.raises(ValueError, match="holds what is found itself; leave the folder out out"):
        rl.open_studio(path, "out", open_browser=False)
    path.write_text('[photogrammetry]\nmodel = "sparse/0"\n', encoding="utf-8")
    with pytest.raises(ValueError, match="there is nothing to mark in it"):
        rl.open_studio(path, open_browser=False)
