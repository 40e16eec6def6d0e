"""A name holds the old file or the new one, whole, and no temporary file stays behind."""

import importlib
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from relume.cluster import renaming
from relume.errors import OutputNotWritten
from relume.image.files import atomic, replacing, write_text

NOBODY = 65534


def test_text_is_written_under_its_name_and_nothing_else_is_left(tmp_path):
    write_text(tmp_path / "a.toml", "π = 3\n")
    assert (tmp_path / "a.toml").read_bytes() == "π = 3\n".encode()
    assert os.listdir(tmp_path) == ["a.toml"]


def test_the_temporary_file_has_the_suffix_and_folder_of_the_final_one(tmp_path):
    with replacing(tmp_path / "a.exr") as temporary:
        assert (temporary.parent, temporary.suffix) == (tmp_path, ".exr")
        assert temporary.name != "a.exr"


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt])
def test_an_overwrite_that_fails_midway_leaves_the_old_file_and_no_temporary_one(tmp_path, failure):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(failure), replacing(path) as temporary:
        temporary.write_text("half of the ne")
        raise failure
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_failing_disk_is_reported_in_one_line_and_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(OutputNotWritten, match=r"a\.txt: cannot be written: No space") as raised, replacing(path):
        raise OSError(28, "No space left on device")
    assert "\n" not in str(raised.value)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_the_file_is_flushed_before_it_has_its_name_and_the_folder_after(tmp_path, monkeypatch):
    seen = []
    flush, rename = importlib.import_module(os.name).fsync, os.replace  # the suite's own flushes nothing

    def flushed(handle: int) -> None:
        flush(handle)
        seen.append("folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else os.fstat(handle).st_size)

    def renamed(old: Path, new: Path) -> None:
        rename(old, new)
        seen.append(new.name)

    monkeypatch.setattr(os, "fsync", flushed)
    monkeypatch.setattr(os, "replace", renamed)
    write_text(tmp_path / "a.txt", "four")
    assert seen == [4, "a.txt", "folder"]


def test_a_disk_that_cannot_be_flushed_leaves_the_old_file(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    write_text(tmp_path / "a.txt", "old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputNotWritten, match=r"a\.txt: cannot be written: No space"):
        write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize(
    ("obstacle", "name", "said"),
    [
        (None, "out/a.txt", r"out does not exist; create it"),
        ("a file", "out/a.txt", "is a file, not a folder"),
        ("a folder", "out", "a folder has that name"),
    ],
)
def test_what_stands_in_the_way_is_named(tmp_path, obstacle, name, said):
    if obstacle == "a folder":
        (tmp_path / "out").mkdir()
    elif obstacle:
        write_text(tmp_path / "out", "x")
    with pytest.raises(OutputNotWritten, match=said):
        write_text(tmp_path / name, "x")
    assert os.listdir(tmp_path) == (["out"] if obstacle else [])


@pytest.fixture
def forbidding() -> Iterator[Path]:
    """A folder in which whoever runs the test may not write; the super-user, who may anywhere, is another meanwhile."""
    folder, user = Path(tempfile.mkdtemp()), os.geteuid()
    write_text(folder / "b.txt", "what is imported for this is imported as oneself")
    if user == 0:
        os.chown(folder, NOBODY, -1)
    folder.chmod(0o500)
    os.seteuid(user or NOBODY)
    yield folder
    os.seteuid(user)
    folder.chmod(0o700)
    shutil.rmtree(folder)


@pytest.mark.skipif(os.name == "nt", reason="the mode of a folder forbids nothing on Windows")
def test_a_folder_that_forbids_writing_is_reported_in_one_line(forbidding: Path):
    with pytest.raises(OutputNotWritten, match="Permission denied"):
        write_text(forbidding / "a.txt", "x")
    assert os.listdir(forbidding) == ["b.txt"]


def test_a_write_protected_file_stays(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    path.chmod(0o444)
    with pytest.raises(OutputNotWritten, match="write-protected; choose another place"):
        write_text(path, "new")
    assert path.read_text() == "old"


def test_a_file_keeps_its_mode(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    path.chmod(0o600)
    write_text(path, "new")
    assert (path.read_text(), path.stat().st_mode & 0o777) == ("new", 0o600)


def test_a_link_goes_on_pointing_to_what_is_written(tmp_path):
    (tmp_path / "real").mkdir()
    write_text(tmp_path / "real" / "a.txt", "old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real" / "a.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink() and (tmp_path / "real" / "a.txt").read_text() == "new"


def like_windows(monkeypatch):
    monkeypatch.setattr(atomic, "WINDOWS", True)
    monkeypatch.setattr(renaming, "WINDOWS", True)
    monkeypatch.setattr(renaming.time, "sleep", lambda seconds: None)


def test_windows_refuses_while_a_scanner_has_the_file_and_is_asked_again(tmp_path, monkeypatch):
    asked = []
    rename = os.replace

    def refusing_twice(source, target):
        asked.append(target)
        if len(asked) < 3:
            raise PermissionError(13, "Access is denied")
        rename(source, target)

    monkeypatch.setattr(os, "replace", refusing_twice)
    like_windows(monkeypatch)
    path = tmp_path / "a.txt"
    with atomic.replacing(path) as temporary:
        temporary.write_bytes(b"x")
    assert len(asked) == 3 and path.read_bytes() == b"x"


def test_a_file_that_windows_has_open_elsewhere_is_named_and_stays(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def refusing(source, target):
        raise PermissionError(13, "Access is denied")

    monkeypatch.setattr(os, "replace", refusing)
    like_windows(monkeypatch)
    with pytest.raises(OutputNotWritten, match="another program has it open"), atomic.replacing(path) as temporary:
        temporary.write_bytes(b"new")
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["a.txt"]


def test_a_name_relative_to_another_drive_is_whole(tmp_path, monkeypatch):
    assert atomic.relative_name(tmp_path / "a" / "b.jpg", tmp_path / "c") == "../a/b.jpg"

    def another_drive(path, start):
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr(atomic.os.path, "relpath", another_drive)
    assert atomic.relative_name(tmp_path / "b.jpg", tmp_path) == (tmp_path / "b.jpg").as_posix()
