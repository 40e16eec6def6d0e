"""Claims: of many processes that want the same work one does it, and what a killed one held is free at once."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from relume.cluster import claims
from relume.cluster.claims import Claimed, claim, held
from relume.errors import OutputNotWritten

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="shows locks of fcntl, which Windows lacks")
# Counts to itself in a file that it reads, adds to and writes: two at once would lose counts.
COUNT = """
import sys, time
from pathlib import Path
from relume.cluster.claims import claim
folder = Path(sys.argv[1])
for _ in range(20):
    with claim(folder / "lock", lambda holder: None):
        count = int((folder / "count").read_text())
        time.sleep(0.002)
        (folder / "count").write_text(str(count + 1))
"""
HOLD = """
import sys, time
from pathlib import Path
from relume.cluster.claims import claim
with claim(Path(sys.argv[1]) / "lock"):
    print("held", flush=True)
    time.sleep(600)
"""


def begun(code: str, folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-c", code, str(folder)], stdout=subprocess.PIPE, text=True)


def ended(children: Sequence[subprocess.Popen[str]]) -> None:
    for child in children:
        if child.poll() is None:
            child.kill()
        child.communicate()


def test_of_many_processes_one_at_a_time_does_it(tmp_path):
    (tmp_path / "count").write_text("0")
    code = COUNT.replace("folder = Path", "import relume.cluster.claims as claims\nclaims.POLL = 0.003\nfolder = Path")
    children = [begun(code, tmp_path) for _ in range(3)]
    try:
        assert [child.wait(60) for child in children] == [0, 0, 0]
    finally:
        ended(children)
    assert (tmp_path / "count").read_text() == "60"
    assert not (tmp_path / "lock").exists()


def test_who_holds_it_is_named_and_a_killed_holder_holds_nothing(tmp_path):
    child = begun(HOLD, tmp_path)
    try:
        assert child.stdout is not None and child.stdout.readline() == "held\n"
        with pytest.raises(Claimed, match=rf"^process {child.pid} on .* since 20"), claim(tmp_path / "lock"):
            pass
        child.send_signal(signal.SIGKILL)
        child.wait(20)
        # The file is still there, and nobody holds it.
        assert (tmp_path / "lock").exists()
        with claim(tmp_path / "lock"):
            assert json.loads((tmp_path / "lock").read_text())["pid"] == os.getpid()
    finally:
        ended([child])
    assert not (tmp_path / "lock").exists()


def test_one_that_waits_is_given_the_holder_and_then_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr("relume.cluster.claims.POLL", 0.01)
    child, holders = begun(HOLD, tmp_path), []
    try:
        assert child.stdout is not None and child.stdout.readline() == "held\n"

        def waiting(holder: str) -> None:
            holders.append(holder)
            if len(holders) == 3:
                child.kill()
                child.wait(20)

        with claim(tmp_path / "lock", waiting):
            pass
    finally:
        ended([child])
    assert len(holders) >= 3 and holders[0].startswith(f"process {child.pid} on ")


def test_a_file_that_its_holder_removed_meanwhile_is_no_claim(tmp_path, monkeypatch):
    lock, calls = claims._lock, []

    def removed_first(file: int) -> bool | None:
        if not calls:
            (tmp_path / "lock").unlink()
        calls.append(file)
        return lock(file)

    monkeypatch.setattr(claims, "_lock", removed_first)
    with claim(tmp_path / "lock"):
        # Another that comes now must meet it.
        assert (tmp_path / "lock").exists() and len(calls) == 2


def test_a_failure_gives_the_claim_back(tmp_path):
    with pytest.raises(ZeroDivisionError), claim(tmp_path / "lock"):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


def without_locks(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(file: int, how: int) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr("relume.cluster.claims.fcntl.flock", refuse)


def test_a_file_system_without_locks_stops_nobody(tmp_path, monkeypatch):
    without_locks(monkeypatch)
    with claim(tmp_path / "lock"), claim(tmp_path / "lock"):
        pass
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputNotWritten, match="cannot be made"), claim(tmp_path / "file" / "lock"):
        pass


def test_without_locks_a_folder_is_held_by_what_its_file_says(tmp_path, monkeypatch):
    without_locks(monkeypatch)
    with held(tmp_path) as lock:
        with pytest.raises(OutputNotWritten, match=f"in use by process {os.getpid()} on"), held(tmp_path):
            pass
        record = json.loads(lock.read_text())
    assert list(tmp_path.iterdir()) == []
    # A process that ended, and one whose number another process has by now, hold nothing.
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    for gone in ({"pid": child.pid}, {"started": -1}):
        lock.write_text(json.dumps(record | gone))
        with held(tmp_path):
            pass


def test_a_folder_held_from_another_machine_is_left_alone_though_its_lock_can_be_had(tmp_path):
    lock = tmp_path / claims.IN_USE
    lock.write_text('{"host": "elsewhere", "pid": 1, "since": "yesterday"}')
    with pytest.raises(OutputNotWritten, match=r"process 1 on elsewhere since yesterday.*delete"), held(tmp_path):
        pass
    assert "elsewhere" in lock.read_text()
    with claim(lock):  # a frame that two make has the same bits
        assert "elsewhere" not in lock.read_text()
