"""What a process that runs one command and ends need not do: look for cycles of objects again and again, and take all
apart at its end.

Imports make hundreds of thousands of objects that live as long as the process. Python looks through them several times
while they are made, and frees them one by one when it exits: a tenth and a tenth of the time of a short command.
"""

from __future__ import annotations

import atexit
import gc
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec

_YOUNG = 10_000
"""New objects after which Python looks for cycles among them, 700 unless set. No picture of a command was in one."""
_COUNTED = ("OpenImageIO", "drjit", "mitsuba")
"""Bound by nanobind, which counts its objects at the end and complains of those that are left."""


def runs_one_command() -> None:
    """Let this process keep its objects until it ends; for a program that does one thing, as the command line is.

    Call it once, before the imports. Files are closed and threads joined as ever.
    """
    gc.set_threshold(_YOUNG, *gc.get_threshold()[1:])
    sys.meta_path.insert(0, _BeforeCounted())
    atexit.register(_keep)


def _keep() -> None:
    """Take what is there now out of all further looks."""
    if not any(name in sys.modules for name in _COUNTED):
        gc.freeze()


class _BeforeCounted:
    """Finds no module: keeps what is there before the first one whose objects are counted."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: object = None) -> ModuleSpec | None:
        if name in _COUNTED:
            _keep()
        return None
