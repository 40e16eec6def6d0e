"""Files that Windows refuses to replace or to remove for a moment: every place that does so waits, and then goes on."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from relume.cluster import claims, records, renaming
from relume.cluster.claims import Claimed, claim, held
from relume.errors import OutputNotWritten
from relume.export.shot_files import complete_folder
from relume.image.files.atomic import replacing
from relume.probe.video.map_files import appearing
from relume.renderers.progressive.checkpoint import Checkpoint, previous, read_checkpoint, write_checkpoint
from relume.studio.shots.bundles import Bundle, Listed
from relume.studio.shots.document import Document
from relume.studio.shots.folder import Folder


class Scanner:
    """Has every file open for a moment: what it is asked about it refuses twice."""

    def __init__(self, does: Callable[..., None], times: int = 2) -> None:
        self.does, self.times, self.asked = does, times, {}

    def __call__(self, *paths: object, **others: object) -> None:
        self.asked[paths] = self.asked.get(paths, 0) + 1
        if self.asked[paths] <= self.times:
            raise PermissionError(13, "The process cannot access the file because it is being used by another process")
        self.does(*paths, **others)


@pytest.fixture
def scanner(monkeypatch: pytest.MonkeyPatch) -> Scanner:
    """Windows, where a scanner looks at every new file."""
    found = Scanner(os.replace)
    monkeypatch.setattr(renaming, "WINDOWS", True)
    monkeypatch.setattr(renaming.time, "sleep", lambda seconds: None)
    monkeypatch.setattr(os, "replace", found)
    monkeypatch.setattr(os, "unlink", Scanner(os.unlink))
    return found


def checkpoint(passes: int) -> Checkpoint:
    return Checkpoint({"scene": "a"}, {"radiance": np.full((2, 3), passes, float)}, passes)


def test_a_checkpoint_and_the_one_before_are_put_in_their_places(tmp_path, scanner):
    path = tmp_path / "p"
    write_checkpoint(path, checkpoint(1))
    write_checkpoint(path, checkpoint(2))
    kept = read_checkpoint(path, {"scene": "a"})
    assert kept is not None and kept.passes == 2 and previous(path).exists()
    assert set(scanner.asked.values()) == {3}


def test_records_are_put_in_their_places(tmp_path, scanner):
    (tmp_path / "a.exr").write_bytes(b"x")
    records.record(tmp_path / "a.exr", "key", {"n": 1})
    assert records.recorded(tmp_path / "a.exr", "key") == {"n": 1}


def test_folders_are_put_in_their_places(tmp_path, scanner):
    with appearing(tmp_path / "maps") as folder:
        (folder / "map.exr").write_bytes(b"x")
    with complete_folder(tmp_path / "shot", "shot.py") as folder:
        (folder / "shot.py").write_bytes(b"x")
    assert (tmp_path / "maps" / "map.exr").exists() and (tmp_path / "shot" / "shot.py").exists()
    assert len(scanner.asked) == 2


def test_the_studio_waits_as_well(tmp_path, scanner):
    bundle = Bundle(Folder(tmp_path), [Listed("chair.obj", 0)])
    (next((tmp_path / "objects").iterdir()) / "chair.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert bundle.settled()["meshes"] == ["objects/chair/chair.obj"]
    document = Document(tmp_path / "shot.toml")
    document.edit([{"set": ["plate", "photographs"], "value": ["a.jpg"]}], revision=0, unfinished=True)
    document.undo(1)
    assert not (tmp_path / "shot.toml").exists()
    assert list(scanner.asked.values()) == [3, 3]


def test_a_shot_file_that_stays_open_is_no_fault_of_the_studio(tmp_path, scanner, monkeypatch):
    document = Document(tmp_path / "shot.toml")
    document.edit([{"set": ["plate", "photographs"], "value": ["a.jpg"]}], revision=0, unfinished=True)
    monkeypatch.setattr(os, "unlink", Scanner(os.unlink, times=9))
    with pytest.raises(OutputNotWritten, match=r"^shot\.toml: cannot be removed"):
        document.undo(1)
    assert document.text


def test_what_went_wrong_is_said_though_the_new_file_cannot_be_cleared_away(tmp_path, scanner, monkeypatch):
    monkeypatch.setattr(os, "unlink", Scanner(os.unlink, times=9))
    with pytest.raises(ValueError, match="no picture"), replacing(tmp_path / "a.exr"):
        raise ValueError("no picture")


def test_what_stays_open_is_refused_in_a_line(tmp_path, scanner):
    scanner.times = 9
    (tmp_path / "a.exr").write_bytes(b"x")
    with pytest.raises(OutputNotWritten, match="cannot be written"):
        records.record(tmp_path / "a.exr", "key", {})
    with pytest.raises(OutputNotWritten, match="cannot be written"), appearing(tmp_path / "maps"):
        pass


def test_other_systems_are_not_asked_again(tmp_path, monkeypatch):
    once = Scanner(os.replace, times=1)
    monkeypatch.setattr(os, "replace", once)
    monkeypatch.setattr(renaming, "WINDOWS", False)
    (tmp_path / "a").write_text("x")
    with pytest.raises(PermissionError):
        renaming.put_in_place(tmp_path / "a", tmp_path / "b")
    assert list(once.asked.values()) == [1]


def test_a_lock_file_that_another_looks_at_goes_all_the_same(tmp_path, scanner, monkeypatch):
    monkeypatch.setattr(claims, "fcntl", None)
    with held(tmp_path / "results"), pytest.raises(OutputNotWritten, match="in use by process"):
        with held(tmp_path / "results"):
            pass
    assert list((tmp_path / "results").iterdir()) == []


def test_of_two_that_go_on_without_locks_the_last_removes_the_file(tmp_path, scanner, monkeypatch):
    monkeypatch.setattr(claims, "fcntl", None)
    kept_open: set[Path] = set()
    remove = claims.remove

    def removed(path: Path) -> None:
        if path in kept_open:
            raise PermissionError(13, "another has it open")
        remove(path)

    monkeypatch.setattr(claims, "remove", removed)
    with claim(tmp_path / "lock"):
        with claim(tmp_path / "lock"):
            kept_open.add(tmp_path / "lock")
        kept_open.clear()
        assert (tmp_path / "lock").exists()
    assert not (tmp_path / "lock").exists()


def test_a_lock_file_that_is_removed_while_it_is_opened_is_made_anew(tmp_path, monkeypatch):
    """Opened once more, it was an empty file that nobody holds and nobody removes."""
    monkeypatch.setattr(claims, "fcntl", None)
    path, open_file = tmp_path / "lock", os.open
    path.write_text("the one before")

    def opened(name: Path, flags: int, mode: int = 0o777) -> int:
        if name == path and not flags & os.O_EXCL:
            path.unlink(missing_ok=True)  # its holder ends at this moment
        return open_file(name, flags, mode)

    monkeypatch.setattr(os, "open", opened)
    with claim(path, sure=True):
        assert b"pid" in path.read_bytes()
    assert not path.exists()


def test_a_holder_is_named_also_where_there_are_no_locks(tmp_path, monkeypatch):
    monkeypatch.setattr(claims, "fcntl", None)
    with claim(tmp_path / "lock"), pytest.raises(Claimed, match=f"process {os.getpid()} on"):
        with claim(tmp_path / "lock", sure=True):
            pass
