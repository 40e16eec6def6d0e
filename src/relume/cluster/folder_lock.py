"""A folder of results in use by one run at a time: a small file in it says by whom."""

from __future__ import annotations

import json
import os
import secrets
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from relume.errors import OutputNotWritten, printable

LOCK = ".relume-in-use.json"


@contextmanager
def held(folder: str | os.PathLike[str]) -> Iterator[Path]:
    """Hold a folder, made where it is missing, for the block; the file that says so is what the block is given.

    Where another run holds it, OutputNotWritten says which. What a process of this machine left behind as it died is
    taken over; of another machine nobody here can know, and the message says what to delete.
    """
    folder = Path(folder)
    path = folder / LOCK
    mine = {
        "host": socket.gethostname(), "pid": os.getpid(), "started": _started(os.getpid()),
        "since": time.strftime("%Y-%m-%d %H:%M:%S"), "token": secrets.token_hex(8),
    }  # fmt: skip
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _take(path, json.dumps(mine).encode())
    except OSError as error:
        raise OutputNotWritten(f"{folder}: cannot be written ({error.strerror}); choose another folder") from None
    try:
        yield path
    finally:
        if _read(path).get("token") == mine["token"]:
            with suppress(OSError):
                path.unlink()


def _take(path: Path, text: bytes) -> None:
    """Write the file where it is not there, or where its process is dead; raises OutputNotWritten."""
    try:
        with open(path, "xb") as file:
            file.write(text)
    except FileExistsError:
        _take_over(path, text)


def _take_over(path: Path, text: bytes) -> None:
    with open(path, "r+b") as file:
        # Of two that take over, the second waits here and then finds the first alive.
        with suppress(ImportError):
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
        try:
            holder = json.loads(file.read())
        except ValueError:
            holder = {}
        if not _dead(holder):
            pid, host, since = (printable(str(holder.get(key, "?"))) for key in ("pid", "host", "since"))
            raise OutputNotWritten(
                f"{path.parent}: in use by process {pid} on {host} since {since}; wait for it or choose "
                f"another folder (if that process is no more, delete {path.name} there)"
            )
        file.seek(0)
        file.write(text)
        file.truncate()
        file.flush()


def _dead(holder: dict[str, Any]) -> bool:
    """Whether a process of this machine is gone for certain."""
    if holder.get("host") != socket.gethostname() or not isinstance(pid := holder.get("pid"), int) or os.name == "nt":
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    started = _started(pid)  # another process may have got its number
    return None not in (started, holder.get("started")) and started != holder["started"]


def _started(pid: int) -> int | None:
    """When a process began, in ticks since the machine did; None where that cannot be read."""
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return None


def _read(path: Path) -> dict[str, Any]:
    try:
        return json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
