"""Writing so that a name never holds half a file: everything goes to a temporary name beside it and is renamed.

The temporary file lies in the same folder, because a rename is atomic only within one file system; the data and then
the folder are flushed to the disk before and after, so that a power cut leaves the old file or the new one.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from relume.cluster.renaming import put_in_place, remove
from relume.errors import OutputNotWritten

WINDOWS = os.name == "nt"


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path to write to; when the block ends well it becomes `path`, when it fails `path` is untouched.

    path : the file that will be there

    The temporary file exists already (empty) and has the suffix of `path`. Raises OutputNotWritten where the folder
    is missing or full or forbids it; any other exception of the block passes through.
    """
    path = Path(path)
    try:
        if path.is_symlink():
            path = path.resolve()  # what it points to is written, and it goes on pointing there
        if path.exists() and not (path.stat().st_mode & 0o222 and os.access(path, os.W_OK)):
            raise PermissionError(None, "it is there already and write-protected")
        if path.is_dir():
            raise IsADirectoryError(None, "a folder has that name")
        temporary = path.with_name(f".{path.stem[:80]}.{secrets.token_hex(4)}{path.suffix}")
        with open(temporary, "xb"):
            pass
        try:
            yield temporary
            if path.exists():
                shutil.copymode(path, temporary)  # a file that only its owner may read stays so
            _flush(temporary)
            put_in_place(temporary, path)
        except BaseException:
            with suppress(OSError):  # what went wrong before is what is said
                remove(temporary)
            raise
        _flush(path.parent)
    except OSError as error:
        raise OutputNotWritten(f"{path}: cannot be written: {_reason(path, error)}") from error


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` as UTF-8, whole or not at all.

    path : the file
    Raises OutputNotWritten.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(text.encode("utf-8"))


def made_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, made where it is missing; raises OutputNotWritten."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{folder}: cannot be made a folder ({error.strerror}); choose another") from None
    return folder


def relative_name(path: str | os.PathLike[str], folder: str | os.PathLike[str]) -> str:
    """How a file beside others in `folder` may name `path`, with /; the whole path where it is on another drive."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # Windows' drives have no way from one to the other
        return Path(path).absolute().as_posix()


def _reason(path: Path, error: OSError) -> str:
    if not path.parent.exists():
        return f"the folder {path.parent} does not exist; create it first"
    if not path.parent.is_dir():
        return f"{path.parent} is a file, not a folder; choose another place"
    if WINDOWS and isinstance(error, PermissionError) and error.errno is not None and path.exists():
        return "another program has it open, or it may not be replaced; close it there, or choose another place"
    return " ".join(str(error.strerror or error).split()) + "; choose another place, or mend this one"


def _flush(path: Path) -> None:
    if path.is_dir() and WINDOWS:  # Windows opens no folder, and flushes renames by itself
        return
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
