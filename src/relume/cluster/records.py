"""What earlier runs into a folder of results have done: a job that is given again redoes only what is not there.

A record lies in the hidden folder of the results, one a task: what the task was made from, and which files it wrote.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from relume.cluster.program import program
from relume.cluster.renaming import put_in_place, remove
from relume.errors import OutputNotWritten

RECORDS = ".relume-done"


def key_of(files: Sequence[Path], *settings: object) -> str:
    """A hash of files by their names, sizes and times of change, of settings by what they print, and of the program."""
    facts = [(str(path), path.stat().st_size, path.stat().st_mtime_ns) for path in files]
    return hashlib.sha256(repr([program(), facts, settings]).encode()).hexdigest()


def recorded(target: Path, key: str) -> Any:
    """The facts of a task whose file is there as an earlier run with this key left it; None for any other."""
    try:
        record = json.loads(_path(target).read_bytes())
        same = record["key"] == key and target.stat().st_size == record["size"]
        return record["facts"] if same else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def record(target: Path, key: str, facts: list[Any] | dict[str, Any]) -> None:
    """Take down what was written, once it is; facts are of JSON. Raises OutputNotWritten."""
    path = _path(target)
    text = json.dumps({"key": key, "size": target.stat().st_size, "facts": facts})
    temporary = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(exist_ok=True)
        temporary.write_text(text, encoding="utf-8")
        put_in_place(temporary, path)
    except OSError as error:
        with suppress(OSError):
            remove(temporary)
        raise OutputNotWritten(f"{path}: cannot be written ({error.strerror}); choose another folder") from None


def _path(target: Path) -> Path:
    return target.parent / RECORDS / f"{target.name}.json"
