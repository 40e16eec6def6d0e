"""Work that one process does while others leave it alone: a lock file that names who holds it.

The lock is the operating system's own. It goes with the process that holds it, however that ends, and holds between
machines that share a folder where their file system has locks (NFS 4 and SMB do). Where there are none, as on Windows,
all go on: what they write is whole and has the same bits.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from relume.errors import OutputNotWritten

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

POLL = 0.5
"""Seconds between two looks at a lock that another process holds."""


class Claimed(Exception):
    """Another process has claimed the work; `holder` says which."""

    def __init__(self, holder: str) -> None:
        super().__init__(holder)
        self.holder = holder


@contextmanager
def claim(path: Path, waiting: Callable[[str], None] | None = None) -> Iterator[None]:
    """Hold the lock of that name while the block runs; the file goes with it.

    waiting : called with the holder's name now and then while another process has the lock, else Claimed is raised
    Raises OutputNotWritten where the file cannot be made.
    """
    file = _taken(path, waiting)
    try:
        yield
    finally:
        # While the lock is held: whoever opened the file before finds that it is gone, and makes another.
        path.unlink(missing_ok=True)
        os.close(file)


def _taken(path: Path, waiting: Callable[[str], None] | None) -> int:
    """The open lock file, locked."""
    while True:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise OutputNotWritten(f"{path}: cannot be made ({error.strerror}); choose another -o") from None
        holder = None
        try:
            if not _lock(file):
                holder = os.read(file, 200).decode(errors="replace") or "another process"
            elif _is_still(path, file):
                os.ftruncate(file, 0)
                os.write(file, f"{socket.gethostname()}, process {os.getpid()}".encode())
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


def _lock(file: int) -> bool:
    """Whether the lock could be had; also where there are no locks."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _is_still(path: Path, file: int) -> bool:
    """Whether the open file is the one of that name, and not one that its holder has removed."""
    try:
        return fcntl is None or os.path.samestat(os.stat(path), os.fstat(file))
    except FileNotFoundError:
        return False
