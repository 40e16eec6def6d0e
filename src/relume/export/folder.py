"""A folder of files that belong together, written whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from relume.errors import OutputNotWritten
from relume.image import files


@contextmanager
def whole_folder(folder: str | os.PathLike[str], last: str) -> Iterator[Path]:
    """A temporary folder to write to; when the block ends well its files are in `folder`, when it fails none is.

    last : name of the file that names the others; in a folder that exists already it is put there last

    A new folder appears at once. In one that exists each file replaces that of its name, and others stay as they are:
    they may be somebody's work. Raises OutputNotWritten.
    """
    folder = Path(folder)
    temporary = folder.with_name(f".{folder.name[:80]}.{secrets.token_hex(4)}")
    try:
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(None, "a file has that name; choose another")
        temporary.mkdir()
        try:
            yield temporary
            if not folder.exists() or not any(folder.iterdir()):
                os.replace(temporary, folder)
                return
            names = sorted(path.name for path in temporary.iterdir())
            for name in sorted(names, key=lambda name: name == last):
                with files.replacing(folder / name) as place:
                    shutil.copyfile(temporary / name, place)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    except OSError as error:
        reason = " ".join(str(error.strerror or error).split())
        raise OutputNotWritten(f"{folder}: cannot be written: {reason}; choose another place, or mend it") from error
