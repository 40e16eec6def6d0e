"""Work that one process does while others leave it alone: a lock file that names who holds it.

The lock is the operating system's own. It goes with the process that holds it, however that ends, and holds between
machines that share a folder where their file system has locks (NFS 4 and SMB do). Where there are none, as on Windows,
what the file says decides, or all go on: `sure`.
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from relume.cluster.renaming import patiently, remove
from relume.errors import OutputNotWritten, printable

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

POLL = 0.5
"""Seconds between two looks at a lock that another process holds."""
IN_USE = ".relume-in-use.json"
"""The lock of a folder of results."""


class Claimed(Exception):
    """Another process has claimed the work; `holder` says which, on which machine and since when."""

    def __init__(self, holder: str) -> None:
        super().__init__(holder)
        self.holder = holder


@contextmanager
def held(folder: str | os.PathLike[str]) -> Iterator[Path]:
    """Hold a folder, made where it is missing, for the block; the file that says so is what the block is given.

    folder : the one that this run alone may write to

    Where another run holds it, OutputNotWritten says which. What a process of this machine left behind as it died is
    taken over. Not so on Windows, nor what one of another machine left: nobody here can know whether that process is
    gone, so the folder stays held, and the message says what to delete.
    """
    path = Path(folder) / IN_USE
    try:
        with claim(path, sure=True):
            yield path
    except Claimed as error:
        raise OutputNotWritten(
            f"{folder}: in use by {error.holder}; wait for it or choose another folder (if that process is no more, "
            f"delete {IN_USE} there)"
        ) from None


@contextmanager
def claim(path: Path, waiting: Callable[[str], None] | None = None, *, sure: bool = False) -> Iterator[None]:
    """Hold the lock of that name while the block runs; the file goes with it.

    waiting : called with the holder's name now and then while another process has the lock, else Claimed is raised
    sure : a file that is there where locks do not reach, of another machine or of a file system without them, counts as
        held unless its process is dead for certain. If not sure, it stops nobody: then two processes may do the same
        work, which is for work whose result has the same bits whoever does it
    Raises OutputNotWritten where the file cannot be made.
    """
    file = _taken(path, waiting, sure)
    try:
        yield
    finally:
        if fcntl is None:  # an open file cannot be removed there
            os.close(file)
            with suppress(PermissionError):  # one who goes on without the lock has it open, and removes it
                remove(path)
        else:
            # While the lock is held: whoever opened the file before finds that it is gone, and makes another.
            path.unlink(missing_ok=True)
            os.close(file)


def _taken(path: Path, waiting: Callable[[str], None] | None, sure: bool) -> int:
    """The open lock file, locked and with our name in it."""
    while True:
        file, made = _opened(path)
        holder = None
        try:
            locked, record = _lock(file), _record(os.read(file, 1000))
            if locked is False or (sure and not made and not _left(record, locked is True)):
                holder = _words(record)
            elif _is_still(path, file):
                os.ftruncate(file, 0)
                os.lseek(file, 0, os.SEEK_SET)
                os.write(file, json.dumps(_mine()).encode())
                file, taken = -1, file
                return taken
        finally:
            if file >= 0:
                os.close(file)
        # Held by another, or just removed by the one before: then there is another file to lock.
        if holder is not None:
            if waiting is None:
                raise Claimed(holder)
            waiting(holder)
            time.sleep(POLL)


def _opened(path: Path) -> tuple[int, bool]:
    """The lock file, open, and whether it was made for that."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        while True:
            # Windows refuses while the one before is about to be removed.
            with suppress(FileExistsError):
                return patiently(lambda: os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)), True
            with suppress(FileNotFoundError):  # removed meanwhile: then it is made
                return patiently(lambda: os.open(path, os.O_RDWR)), False
    except OSError as error:
        raise OutputNotWritten(f"{path}: cannot be made ({error.strerror}); choose another -o") from None


def _lock(file: int) -> bool | None:
    """Whether the lock could be had; None where there are no locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return None
    return True


def _is_still(path: Path, file: int) -> bool:
    """Whether the open file is the one of that name, and not one that its holder has removed."""
    try:
        return fcntl is None or os.path.samestat(os.stat(path), os.fstat(file))
    except FileNotFoundError:
        return False


def _mine() -> dict[str, Any]:
    """What a lock file says of this process."""
    return {
        "host": socket.gethostname(), "pid": os.getpid(), "started": _started(os.getpid()),
        "since": time.strftime("%Y-%m-%d %H:%M:%S"),
    }  # fmt: skip


def _record(text: bytes) -> dict[str, Any]:
    """What a lock file says; nothing of one that is empty or broken."""
    try:
        record = json.loads(text)
    except ValueError:
        return {}
    return record if isinstance(record, dict) else {}


def _words(record: dict[str, Any]) -> str:
    """Who holds a lock, in words."""
    if not record:
        return "another process"
    pid, host, since = (printable(str(record.get(key, "?"))) for key in ("pid", "host", "since"))
    return f"process {pid} on {host} since {since}"


def _left(record: dict[str, Any], locked: bool) -> bool:
    """Whether the process that a lock file names is gone for certain.

    locked : whether the system's lock could be had: a process of this machine that lived would have it
    """
    if not record:
        return locked
    if record.get("host") != socket.gethostname():
        return False
    return locked or _dead(record)


def _dead(record: dict[str, Any]) -> bool:
    """Whether a process of this machine is gone, where its lock cannot be asked."""
    if not isinstance(pid := record.get("pid"), int) or os.name == "nt":
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    started = _started(pid)  # another process may have got its number
    return None not in (started, record.get("started")) and started != record["started"]


def _started(pid: int) -> int | None:
    """When a process began, in ticks since the machine did; None where that cannot be read."""
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return None
