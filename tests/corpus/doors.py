"""Ways of reading that the child process takes, beside those of the package itself, and trials of the runner."""

from __future__ import annotations

import os
import signal
import time
import warnings
from pathlib import Path

from relume.errors import UnreadableFile
from relume.image.files import ReadOptions, read


def salvaged(path: str) -> object:
    """The image in a file that may end early."""
    return read(path, ReadOptions(salvage=True))


# Trials: what a reader must not do, so that the runner is seen to notice.


def hanging(path: str) -> object:
    """Never return."""
    while True:
        time.sleep(1)


def dying(path: str) -> object:
    """Die of a signal."""
    os.kill(os.getpid(), signal.SIGSEGV)
    return None


def leaving(path: str) -> object:
    """End the process."""
    os._exit(0)


def raising(path: str) -> object:
    """Let a bare error out."""
    raise IndexError("list index out of range")


def speaking(path: str) -> object:
    """Say two lines."""
    error = UnreadableFile(path)
    error.args = (f"{path}: byte 3\nis wrong",)  # which no message of ours can have
    raise error


def anonymous(path: str) -> object:
    """Not say which file."""
    raise UnreadableFile("byte 3 is wrong")


def printing(path: str) -> object:
    """Print past the interpreter, as libraries in C do."""
    os.write(2, b"libexample: bad file\n")
    raise UnreadableFile(f"{path}: byte 3 is wrong")


def hoarding(path: str) -> object:
    """Take 200 MiB before refusing."""
    taken = bytearray(200 * 2**20)
    taken[:: 2**12] = bytes([1]) * len(taken[:: 2**12])
    raise UnreadableFile(f"{path}: byte {len(taken)} is wrong")


def grasping(path: str) -> object:
    """Ask for more than the child may have."""
    return bytearray(2**40)


def dawdling(path: str) -> object:
    """Compute for a fifth of a second before refusing."""
    start = time.process_time()
    while time.process_time() - start < 0.2:
        pass
    raise UnreadableFile(f"{path}: byte 3 is wrong")


def warning_of_numbers(path: str) -> object:
    """Let NumPy's own warning out."""
    warnings.warn("overflow encountered in multiply", RuntimeWarning, stacklevel=1)
    return None


def warning_of_nothing(path: str) -> object:
    """Warn in another library's words."""
    warnings.warn("truncated file read", stacklevel=1)
    return None


def vague(path: str) -> object:
    """Refuse without telling where."""
    raise UnreadableFile(f"{path}: damaged; copy it again")


def exact(path: str) -> object:
    """Refuse as readers should."""
    raise UnreadableFile(f"{path}: damaged at byte {Path(path).stat().st_size}; copy it again")


def silent(path: str) -> object:
    """Hand back nothing."""
    return None
