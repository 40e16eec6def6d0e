"""The child process: reads the files it is reported through its input, and says what each one did on another channel.

Run as `python -m corpus.child CHANNEL`, where the channel is an open file descriptor; one line of JSON a file, in and
out. Its own output and error output belong to the readers, who should leave them empty.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from importlib import import_module

ADDRESS_SPACE = 4 * 2**30
"""Bytes the child may map beyond what it has when it starts."""


def main(channel: int) -> None:
    """Read files until the input ends."""
    doors: dict[str, Callable[[str], object]] = {}
    import numpy  # so that its own memory is part of the beginning  # noqa: F401

    import relume.image.files  # noqa: F401

    limit = _status("VmSize") + ADDRESS_SPACE
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with os.fdopen(channel, "w", encoding="utf-8") as answers:
        for line in sys.stdin:
            path, door = json.loads(line)
            if door not in doors:
                module, name = door.split(":")
                doors[door] = getattr(import_module(module), name)
            answers.write(json.dumps(_outcome(path, doors[door])) + "\n")
            answers.flush()


def _outcome(path: str, door: Callable[[str], object]) -> dict[str, object]:
    from relume.errors import FormatError, UnreadableFile

    decoded, error, kind, trace = 0, "", "", ""
    before = _peak_from_here()
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        began, computed = time.perf_counter(), time.process_time()
        try:
            result = door(path)
            kind, decoded = "read", _amount(result)
            del result
        except UnreadableFile as refusal:
            kind, error = ("format" if isinstance(refusal, FormatError) else "refused"), str(refusal)
        except Exception as fault:
            kind, error, trace = "raised", f"{type(fault).__name__}: {fault}", traceback.format_exc()
        seconds, computed = time.perf_counter() - began, time.process_time() - computed
    return {
        "kind": kind,
        "error": error,
        "trace": trace,
        "warnings": [(issubclass(w.category, UserWarning), str(w.message)) for w in heard],
        "seconds": seconds,
        "computed": computed,
        "growth": max(0, _status("VmHWM") - before),
        "decoded": decoded,
    }


def _amount(result: object) -> int:
    """Bytes of the picture, as three channels of 32-bit floats: what G4 counts by."""
    if isinstance(result, list):
        return sum(_amount(level) for level in result)
    if isinstance(result, dict):
        return sum(_amount(value) for value in result.values())
    for name in ("radiance", "pixels", "mosaic"):
        result = getattr(result, name, result)
    return 4 * getattr(result, "size", 0) if hasattr(result, "dtype") else 0


def _peak_from_here() -> int:
    """Forget the largest memory so far, where the system allows it, and give the present one in bytes."""
    try:
        with open("/proc/self/clear_refs", "w", encoding="ascii") as file:
            file.write("5")
    except OSError:
        return _status("VmHWM")  # then only growth beyond the largest so far is seen
    return _status("VmRSS")


def _status(field: str) -> int:
    with open("/proc/self/status", encoding="ascii") as file:
        for line in file:
            if line.startswith(field + ":"):
                return int(line.split()[1]) * 1024
    raise RuntimeError(f"the system does not state {field}")


if __name__ == "__main__":
    main(int(sys.argv[1]))
