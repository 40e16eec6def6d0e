"""The shot file as a document: edits keep what a person wrote, and every text it had can be had again."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import relume as rl
from small_shot import TEXT, write_small_shot

pytest.importorskip("tomlkit", reason="the extra studio is not installed")

from relume.studio.shots.document import Conflict, Document
from relume.studio.shots.edits import edited


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    return write_small_shot(tmp_path)


def outside(path: Path, text: str) -> None:
    """Written by another program, at another time than before."""
    path.write_text(text, encoding="utf-8")
    os.utime(path, ns=(1, path.stat().st_mtime_ns + 10**9))


def test_edits_keep_comments_and_formatting():
    text = edited(
        TEXT,
        [
            {"set": ["camera", "focal_length"], "value": 210.5},
            {"set": ["objects", 0, "translate"], "value": [0.1, 0, -0.2]},
            {"append": ["objects"], "value": {"mesh": "b.glb"}},
            {"set": ["light", "distant"], "value": {"shape": "infinite"}},
            {"set": ["light", "distant", "centre"], "value": [0, 1, 0]},
            {"remove": ["match", "grain"]},
        ],
    )
    expected = TEXT.replace("focal_length = 200", "focal_length = 210.5")
    expected = expected.replace('ball.glb"\n', 'ball.glb"\ntranslate = [0.1, 0, -0.2]\n\n[[objects]]\nmesh = "b.glb"\n')
    expected = expected.replace("scale = 1.0\n", 'scale = 1.0\ndistant = { shape = "infinite", centre = [0, 1, 0] }\n')
    assert text == expected.replace("grain = false\n", "")


def test_a_shot_begun_from_nothing_reads_as_a_person_writes_it():
    changes = [
        {"set": ["plate", "photographs"], "value": ["plate/*.jpg"]},
        {"append": ["light", "balls"], "value": {"photographs": ["ball/*.jpg"]}},
        {"set": ["light", "ball"], "value": {"radius": 0.05}},
        {"set": ["camera", "ball", "rim"], "value": [10.5, 20, 5]},
        {"append": ["objects"], "value": {"mesh": "a.glb", "stand": [0, 0.1]}},
        {"append": ["objects"], "value": {"mesh": "b.glb"}},
    ]
    assert edited("", changes) == (
        '[plate]\nphotographs = ["plate/*.jpg"]\n\n[light]\nballs = [\n    { photographs = ["ball/*.jpg"] },\n]\n'
        "ball = { radius = 0.05 }\n\n[camera]\nball = { rim = [10.5, 20, 5] }\n\n"
        '[[objects]]\nmesh = "a.glb"\nstand = [0, 0.1]\n\n[[objects]]\nmesh = "b.glb"\n\n'
    )


@pytest.mark.parametrize(
    "change",
    [
        {"set": ["objects", 7, "mesh"], "value": "a.glb"},
        {"set": [], "value": 1},
        {"remove": ["light", "nothing"]},
        {"set": ["render", "samples"], "value": None},
        {"set": ["plate", "photographs", "x"], "value": 1},
        {"set": ["a"], "append": ["b"], "value": 1},
        {},
    ],
)
def test_a_change_that_cannot_be_made_is_refused(change: dict[str, object]):
    with pytest.raises(ValueError):
        edited(TEXT, [change])


def test_undo_to_the_start_gives_the_bytes_of_the_start(shot: Path):
    start = shot.read_bytes()
    document = Document(shot)
    for x in range(50):
        document.edit([{"set": ["objects", 0, "translate"], "value": [x / 100, 0, 0]}], revision=x)
    last = shot.read_bytes()
    document.undo(1000)
    assert shot.read_bytes() == start
    document.undo(-1000)
    assert shot.read_bytes() == last and b"[0.49, 0, 0]" in last
    assert document.state()["undo"] == 50 and document.revision == 52


def test_an_edit_made_outside_appears_and_is_undone_like_any_other(shot: Path):
    document = Document(shot)
    document.edit([{"set": ["render", "samples"], "value": 16}], revision=0)
    outside(shot, shot.read_text(encoding="utf-8").replace("samples = 16", "samples = 32  # by hand"))
    assert document.look() and document.table["render"]["samples"] == 32
    assert not document.look()
    document.undo(1)
    assert "samples = 16\n" in shot.read_text(encoding="utf-8")
    document.undo(1)
    assert shot.read_text(encoding="utf-8") == TEXT
    document.undo(-2)
    assert "samples = 32  # by hand" in shot.read_text(encoding="utf-8")


def test_a_shot_broken_by_hand_keeps_its_last_good_values_and_is_mended_by_undo(shot: Path):
    document = Document(shot)
    broken = TEXT.replace("samples = 8", "samples = = 8").encode() + b"\xff"
    shot.write_bytes(broken)
    os.utime(shot, ns=(1, shot.stat().st_mtime_ns + 10**9))
    assert document.look()
    assert document.fault is not None and "UTF-8" in document.fault and document.table["render"]["samples"] == 8
    with pytest.raises(ValueError, match="mend the file or undo"):
        document.edit([{"set": ["render", "samples"], "value": 9}], revision=document.revision)
    assert shot.read_bytes() == broken
    outside(shot, TEXT.replace("samples = 8", "samples = = 8"))
    assert document.look() and document.fault is not None
    assert document.fault.startswith("not valid TOML: ") and "line 26" in document.fault
    document.undo(2)
    assert shot.read_text(encoding="utf-8") == TEXT and document.fault is None
    document.undo(-1)
    assert shot.read_bytes() == broken


def test_an_edit_of_an_older_text_is_refused_and_changes_nothing(shot: Path):
    document = Document(shot)
    outside(shot, TEXT.replace("samples = 8", "samples = 12"))
    with pytest.raises(Conflict, match="was changed meanwhile"):
        document.edit([{"set": ["render", "samples"], "value": 9}], revision=0)
    assert "samples = 12" in shot.read_text(encoding="utf-8")


def test_an_edit_that_would_make_a_sound_shot_wrong_is_refused(shot: Path):
    document = Document(shot)
    with pytest.raises(ValueError, match=r"not done: render\.samples: input should be greater than or equal to 2"):
        document.edit([{"set": ["render", "samples"], "value": 1}], revision=0)
    assert shot.read_text(encoding="utf-8") == TEXT
    document.edit([{"remove": ["plate", "photographs"]}], revision=0, unfinished=True)
    assert document.fault == "plate.photographs: missing; the shot file must have it"


def test_a_disk_that_is_full_loses_nothing(shot: Path, monkeypatch: pytest.MonkeyPatch):
    document = Document(shot)

    def full(_text: object) -> bytes:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("relume.studio.shots.document._bytes", full)
    with pytest.raises(rl.errors.OutputNotWritten, match="cannot be written"):
        document.edit([{"set": ["render", "samples"], "value": 9}], revision=0)
    assert shot.read_text(encoding="utf-8") == TEXT and document.text == TEXT and document.revision == 0
    assert sorted(each.name for each in shot.parent.iterdir()) == ["light.exr", "objects", "plate.exr", "shot.toml"]


def test_the_first_act_in_a_folder_makes_the_shot_file_and_undo_takes_it_away(tmp_path: Path):
    document = Document(tmp_path / "shot.toml")
    assert document.fault == "plate: missing; choose its photographs"
    document.edit([{"set": ["plate", "photographs"], "value": ["a.jpg"]}], revision=0, unfinished=True)
    assert (tmp_path / "shot.toml").read_text(encoding="utf-8") == '[plate]\nphotographs = ["a.jpg"]\n'
    document.undo(1)
    assert not (tmp_path / "shot.toml").exists()
