"""Where a store lies: a folder of this machine, or what an fsspec URL names (s3://, file://, memory:// and others).

Credentials, end points and all other options of a URL are fsspec's own affair: its configuration files, FSSPEC_…
variables and those of the storage itself. What goes wrong there comes out as one line with the URL.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import OutputNotWritten, UnreadableFile, printable

Place = str | os.PathLike[str]
_DESCRIPTION = "zarr.json"


def is_url(place: Place) -> bool:
    """Whether a place is an fsspec URL and not a path of this machine."""
    return "://" in os.fspath(place)


def as_place(place: Place) -> Path | str:
    """A URL as a text without a last slash, anything else as a Path."""
    return os.fspath(place).rstrip("/") if is_url(place) else Path(place)


def within_process(place: Place) -> bool:
    """Whether no other process sees what lies there."""
    return os.fspath(place).startswith("memory://")


def exists(place: Place) -> bool:
    """Whether something lies there; raises UnreadableFile where that cannot be found out."""
    if not is_url(place):
        return Path(place).exists()
    with reading(place):
        system, path = filesystem(place)
        return bool(system.exists(path))


def is_bare(place: Place) -> bool:
    """Whether nothing lies there, or an empty folder."""
    if is_url(place):
        with reading(place):
            system, path = filesystem(place)
            try:
                return not system.ls(path, detail=False)
            except FileNotFoundError:
                _require_bucket(system, path, place)
                return True
    return not Path(place).exists() or (Path(place).is_dir() and not any(Path(place).iterdir()))


def described(place: Place) -> str | None:
    """The text of a store's description; None where there is none. Raises UnreadableFile for a URL that is refused."""
    if not is_url(place):
        try:
            return (Path(place) / _DESCRIPTION).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            return None
    with reading(place):
        system, path = filesystem(place)
        try:
            return system.cat_file(f"{path}/{_DESCRIPTION}").decode("utf-8", "replace")
        except (FileNotFoundError, IsADirectoryError):
            _require_bucket(system, path, place)
            return None


def opened_group(zarr: Any, place: Place, mode: Any) -> Any:
    """The zarr group that lies there."""
    where = str(place) if is_url(place) else str(Path(place).absolute())
    return zarr.open_group(where, mode=mode, storage_options=_options(place) or None)


def created_group(zarr: Any, place: Place, attributes: dict[str, Any]) -> Any:
    """A new zarr group, in the place of whatever lay there."""
    where = str(place) if is_url(place) else str(Path(place).absolute())
    return zarr.create_group(where, attributes=attributes, overwrite=True, storage_options=_options(place) or None)


def chunk_sizes(place: Place, grid: tuple[int, ...], groups: range | None = None) -> np.ndarray:
    """Bytes of the files of every chunk or shard of `values`, 0 where there is none.

    grid : files along lights, rows and columns
    groups : of lights; all unless given
    """
    chosen = range(grid[0]) if groups is None else groups
    found = np.zeros((len(chosen), *grid[1:]), np.int64)
    if is_url(place):
        system, path = filesystem(place)
        system.invalidate_cache()  # workers wrote since it was listed
        for row, group in enumerate(chosen):
            for name, facts in system.find(f"{path}/values/c/{group}", detail=True).items():
                down, across = (int(part) for part in name.split("/")[-3:-1])
                found[row, down, across] = int(facts["size"])
        return found
    for row, down, across in np.ndindex(found.shape):
        file = Path(place) / "values" / "c" / str(chosen[row]) / str(down) / str(across) / "0"
        found[row, down, across] = file.stat().st_size if file.is_file() else 0
    return found


def filesystem(place: Place) -> tuple[Any, str]:
    """fsspec's file system for a URL, and the path in it; ValueError where what it needs is not installed."""
    try:
        import fsspec
    except ImportError:
        raise ValueError(f'{place}: a URL needs fsspec: pip install "relume[lightstage]"') from None
    try:
        return fsspec.url_to_fs(os.fspath(place), **_options(place))
    except ImportError as error:
        raise ValueError(f"{place}: {_words(error)}; with pip, in the environment of relume") from None
    except ValueError as error:
        raise ValueError(f"{place}: {_words(error)}; give a URL that fsspec knows, like s3://bucket/cat.zarr") from None


@contextmanager
def reading(place: Place) -> Iterator[None]:
    """What a storage says inside, as an UnreadableFile of one line."""
    try:
        yield
    except (UnreadableFile, OutputNotWritten, ValueError):
        raise
    except Exception as error:  # each storage has its own
        raise UnreadableFile(refusal(place, error)) from error


def refusal(place: Place, error: Exception) -> str:
    """What a storage's error means, in one line."""
    kind, words = type(error).__name__, _words(error)
    if "Credentials" in kind or "credentials" in words.lower():
        return f"{place}: no credentials for it are found; give them as fsspec expects them, for S3 as AWS does"
    if isinstance(error, PermissionError):
        return f"{place}: access is denied ({words}); check the credentials and the rights to it"
    if isinstance(error, FileNotFoundError):
        return f"{place}: there is no such place ({words}); check the name, and make the bucket first"
    return f"{place}: the storage does not answer as it should ({kind}: {words}); check the URL and the connection"


def _options(place: Place) -> dict[str, Any]:
    """What a file system of folders needs so that it makes them as object stores do."""
    return {"auto_mkdir": True} if os.fspath(place).startswith(("file://", "local://")) else {}


def _words(error: BaseException) -> str:
    return " ".join(printable(str(error)).split())[:160] or type(error).__name__


def _require_bucket(system: Any, path: str, place: Place) -> None:
    """Raises UnreadableFile where not even the bucket is there, which object stores report as a missing file."""
    bucket, protocol = path.lstrip("/").split("/")[0], getattr(system, "protocol", "")
    if {"s3", "gs", "abfs"} & {protocol, *protocol} and not system.exists(bucket):
        raise UnreadableFile(f"{place}: there is no bucket {bucket}; check the name, or make it first")
