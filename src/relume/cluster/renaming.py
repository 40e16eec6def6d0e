"""Files put in their place and removed on every system: Windows refuses while another program has the file open.

Scanners and indexers open a new file for a moment. POSIX systems do not mind, so there each is done once.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

WINDOWS = os.name == "nt"
TRIED_AGAIN = (0.05, 0.2, 0.8)
"""Seconds to wait before what Windows refused is tried again."""
T = TypeVar("T")


def put_in_place(source: str | os.PathLike[str], target: str | os.PathLike[str]) -> None:
    """Give a file or a folder another name, in the place of the file that has it; raises OSError as `os.replace`.

    source : its name now
    target : its new name, in a folder of the same file system

    On Windows a refusal is tried again for a second, since scanners keep a new file open for a moment.
    """
    patiently(lambda: os.replace(source, target))


def remove(path: str | os.PathLike[str]) -> None:
    """Remove a file if it is there; on Windows a refusal is tried again for a second. Raises OSError.

    path : of the file
    """
    patiently(lambda: Path(path).unlink(missing_ok=True))


def patiently(act: Callable[[], T]) -> T:
    """What `act` gives; on Windows a PermissionError is waited out for a second before it is raised."""
    for wait in TRIED_AGAIN if WINDOWS else ():
        try:
            return act()
        except PermissionError:
            time.sleep(wait)
    return act()
